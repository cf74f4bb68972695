//! Meshes that a document names as files, and terrains.

use glam::DVec3;
use lacuna_kernel::model::{Interior, Shape, TerrainBase};

use crate::diagnostic::code;
use crate::document::{DocumentLimits, read_job_beside, read_model, read_model_beside, write_model};
use crate::format::{MeshFile, ReadLimits, read};

const QUADS: &[u8] = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nf 1 2 3 4\nf 2 5 6 3\n";

/// A folder with two meshes.
fn folder(name: &str) -> Result<MeshFile, String> {
    match name {
        "parts/quads.obj" => read(QUADS, None, &ReadLimits::default()).map_err(|error| error.to_string()),
        "quads mm.ply" => {
            let text = "ply\nformat ascii 1.0\ncomment units mm\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 0 0 0 1 0 3 0 1 2\n";
            read(text.as_bytes(), None, &ReadLimits::default()).map_err(|error| error.to_string())
        }
        _ => Err("there is none".to_owned()),
    }
}

fn document(members: &str) -> String {
    format!(r#"{{"lacuna": 1, "units": "cm", "shape": {{"family": "mesh", {members}}}}}"#)
}

#[test]
fn a_mesh_comes_from_a_file_of_the_folder() {
    let text = document(r#""file": "parts/quads.obj", "interior": "surface""#);
    let model = read_model_beside(text.as_bytes(), &DocumentLimits::default(), &folder).unwrap();
    let Shape::Mesh(mesh) = &model.shape else { panic!("a mesh") };
    // Without a unit of its own the file's numbers are the document's centimetres; quads stay quads.
    assert_eq!((mesh.vertices[5], mesh.interior), (DVec3::new(20.0, 10.0, 0.0), Interior::Surface));
    assert_eq!(mesh.faces, [[0, 1, 2, 3], [1, 4, 5, 2]]);
    // What is stored and hashed has the mesh in it.
    assert_eq!(read_model(write_model(&model).as_bytes(), &DocumentLimits::default()).unwrap(), model);
    let text = document(r#""file": "quads mm.ply""#);
    let model = read_model_beside(text.as_bytes(), &DocumentLimits::default(), &folder).unwrap();
    let Shape::Mesh(mesh) = &model.shape else { panic!("a mesh") };
    assert_eq!(mesh.vertices[1], DVec3::X);
    let job = format!(r#"{{"lacuna": 1, "kind": "measure", "model": {text}, "params": {{"tolerance_mm": 0.1}}}}"#);
    assert!(read_job_beside(job.as_bytes(), &DocumentLimits::default(), &folder).is_ok());
}

#[track_caller]
fn assert_fault(members: &str, code: &str, pointer: &str) {
    let found = read_model_beside(document(members).as_bytes(), &DocumentLimits::default(), &folder).unwrap_err();
    assert_eq!((found[0].code, found[0].pointer.as_str()), (code, pointer), "{found:#?}");
}

#[test]
fn paths_out_of_the_folder_and_folders_that_are_not_there_are_refused() {
    for path in
        ["../quads.obj", "parts/../quads.obj", "/etc/passwd", "parts//quads.obj", "./quads.obj", "C:quads.obj", r"..\\quads.obj", "parts/"]
    {
        assert_fault(&format!(r#""file": "{path}""#), code::FILE_OUTSIDE, "/shape/file");
    }
    assert_fault(r#""file": "none.obj""#, code::FILE_NOT_READ, "/shape/file");
    assert_fault(r#""file": 7"#, code::WRONG_TYPE, "/shape/file");
    assert_fault(r#""file": """#, code::BAD_NAME, "/shape/file");
    assert_fault(r#""file": "parts/quads.obj", "vertices": [[0, 0, 0]]"#, code::CONFLICTING_MEMBERS, "/shape/vertices");
    assert_fault(r#""vertices": [[0, 0, 0]]"#, code::MISSING_MEMBER, "/shape");
    let found = read_model(document(r#""file": "parts/quads.obj""#).as_bytes(), &DocumentLimits::default()).unwrap_err();
    assert_eq!((found[0].code, found[0].pointer.as_str()), (code::FILE_NOT_AVAILABLE, "/shape/file"));
}

#[test]
fn terrains_start_from_a_triangle_or_a_grid() {
    let shape = |members: &str| {
        let text = format!(r#"{{"lacuna": 1, "units": "cm", "shape": {{"family": "terrain", {members}}}}}"#);
        read_model(text.as_bytes(), &DocumentLimits::default()).map(|model| model.shape)
    };
    let found = shape(r#""triangle": [[0,0,0],[1,0,0],[0,1,0]], "roughness": 0.5, "levels": 3"#).unwrap();
    let Shape::Terrain(terrain) = found else { panic!("a terrain") };
    assert_eq!(terrain.base, TerrainBase::Triangle([DVec3::ZERO, DVec3::X * 10.0, DVec3::Y * 10.0]));
    assert_eq!((terrain.levels, terrain.random_seed), (3, 0));
    let fault = |members: &str| {
        let found = shape(members).unwrap_err().remove(0);
        (found.code, found.pointer)
    };
    assert_eq!(fault(r#""roughness": 0.5, "levels": 3"#), (code::MISSING_MEMBER, "/shape".to_owned()));
    assert_eq!(fault(r#""triangle": [[0,0,0],[1,0,0]], "roughness": 0.5, "levels": 3"#).1, "/shape/triangle");
    assert_eq!(fault(r#""grid": [[[0,0,0],[1,0,0]]], "roughness": 0.5, "levels": 3"#).1, "/shape/grid");
    let grid = r#""grid": [[[0,0,0],[1,0,0]],[[0,1,0],[1,1,0]]]"#;
    assert_eq!(fault(&format!(r#"{grid}, "roughness": 0.5, "levels": -1"#)), (code::NOT_AN_INDEX, "/shape/levels".to_owned()));
    assert_eq!(fault(&format!(r#"{grid}, "roughness": 0.5, "levels": 1.5"#)).0, code::NOT_AN_INDEX);
    assert!(shape(&format!(r#"{grid}, "roughness": 0.5, "levels": 1e15, "random_seed": 9007199254740991"#)).is_ok());
    let both = format!(r#"{grid}, "triangle": [[0,0,0],[1,0,0],[0,1,0]], "roughness": 0.5, "levels": 1"#);
    assert_eq!(fault(&both).0, code::CONFLICTING_MEMBERS);
}

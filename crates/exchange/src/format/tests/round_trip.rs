//! What is written is read back the same, verified, and written the same again.

use super::*;
use lacuna_kernel::error::Kind;
use lacuna_kernel::tessellation::{Normals, Tessellation};

const MESH_FORMATS: [Format; 7] = [Format::Stl, Format::ThreeMf, Format::Glb, Format::Obj, Format::Ply, Format::Off, Format::Vrml];

#[test]
fn the_table_is_in_the_order_of_the_enum() {
    for (index, row) in FORMATS.iter().enumerate() {
        assert_eq!(row.format as usize, index);
        assert_eq!(Format::from_name(row.ending), Some(row.format));
    }
    assert_eq!(Format::from_name("MODEL/3MF"), Some(Format::ThreeMf));
    assert_eq!(Format::from_name(".Stl"), Some(Format::Stl));
    assert_eq!(Format::from_name("application/octet-stream"), None);
}

#[test]
fn meshes_come_back_as_they_went() {
    let certificate = Certificate { kernel_version: "0.1.0 <&>".into(), ..Certificate::default() };
    let metadata = Metadata {
        title: Some("a <b> & \"c\"\nv 1 2 3 \u{1}"),
        certificate: Some(&certificate),
        thumbnail_png: Some(b"\x89PNG\r\n\x1a\n"),
        ..Metadata::default()
    };
    for mesh in [torus(48, 24, DVec3::new(0.1, -3.0, 1e-6)), hollow_and_torus()] {
        for format in MESH_FORMATS {
            let bytes = written(format, &mesh, &metadata);
            verify_written(format, &mut Cursor::new(&bytes), &mesh).unwrap();
            assert_eq!(detect(&bytes), Some(format));
            if !format.facts().reads {
                continue;
            }
            let file = read(&bytes, None, &ReadLimits::default()).unwrap();
            assert_eq!(file.facts.format, format);
            assert!(corners(&file.mesh) == corners(&mesh), "{format}");
            if format != Format::Stl {
                assert!(file.mesh.triangles == mesh.triangles, "{format}");
            }
            if format != Format::Off {
                assert_eq!(file.facts.unit, Some(Unit::Millimetre), "{format}");
            }
        }
    }
}

#[test]
fn an_stl_file_has_84_bytes_and_50_for_each_facet() {
    let mesh = torus(16, 8, DVec3::ZERO);
    let application = "solid works";
    let bytes = written(Format::Stl, &mesh, &Metadata { application, ..Metadata::default() });
    assert_eq!(bytes.len(), 84 + 50 * mesh.triangles.len());
    assert!(!bytes.starts_with(b"solid"));
    assert!(bytes.starts_with(b"_solid works units mm "));
    // Equal coordinates are one vertex again.
    assert_eq!(read(&bytes, None, &ReadLimits::default()).unwrap().mesh.vertices.len(), mesh.vertices.len());
}

#[test]
fn a_binary_stl_that_says_solid_is_binary_by_its_length() {
    let mesh = torus(16, 8, DVec3::ZERO);
    let mut bytes = written(Format::Stl, &mesh, &Metadata::default());
    bytes[..12].copy_from_slice(b"solid facet ");
    let file = read(&bytes, None, &ReadLimits::default()).unwrap();
    assert_eq!((file.facts.encoding, file.mesh.triangles.len()), ("binary", 256));
}

#[test]
fn a_text_stl_is_read_in_any_letter_case() {
    let text = b"solid two parts\r\n FACET normal 0 0 1\n outer loop\nvertex 0 0 -0\nvertex 1 0 0.0\nVERTEX 0 1.5e0 0\n\
        endloop\nendfacet\nendsolid two parts\n\n";
    let file = read(text, None, &ReadLimits::default()).unwrap();
    assert_eq!(file.facts.object_names, ["two parts"]);
    assert_eq!(file.mesh.vertices, [DVec3::ZERO, DVec3::X, DVec3::Y * 1.5]);
}

#[test]
fn parts_stay_apart_where_the_format_has_objects() {
    let meshes = [torus(12, 6, DVec3::ZERO), cube(DVec3::splat(50.0), 4.0, false)];
    let parts = [NamedMesh { name: "ring & \"x\"", mesh: &meshes[0] }, NamedMesh { name: "cube", mesh: &meshes[1] }];
    let geometry = Geometry::Parts(&parts);
    for format in MESH_FORMATS {
        let bytes = written(format, geometry, &Metadata::default());
        verify_written(format, &mut Cursor::new(&bytes), geometry).unwrap();
        if format.facts().reads {
            let file = read(&bytes, Some(format), &ReadLimits::default()).unwrap();
            assert!(corners(&file.mesh) == corners(&join(&meshes)), "{format}");
            match format {
                Format::ThreeMf => assert_eq!(file.facts.object_names, ["ring & \"x\"", "cube"]),
                Format::Obj => assert_eq!(file.facts.object_names, ["1 ring & \"x\"", "2 cube"]),
                Format::Vrml => assert_eq!(file.facts.object_names, ["part_1_ring____x_", "part_2_cube"]),
                _ => {}
            }
        }
    }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let mesh = torus(400, 200, DVec3::ZERO);
    for format in [Format::Stl, Format::ThreeMf, Format::Glb, Format::Png] {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| written(format, &mesh, &Metadata::default()))
        };
        let one = with(1);
        assert_eq!(one, with(3), "{format}");
        assert_eq!(one, with(1), "{format}");
    }
}

#[test]
fn verification_finds_any_changed_coordinate_or_index() {
    let mesh = torus(24, 12, DVec3::ZERO);
    let mut moved = mesh.clone();
    moved.vertices[100].z = f64::from((moved.vertices[100].z as f32).next_up());
    let mut turned = mesh.clone();
    turned.triangles[77].rotate_left(1);
    let mut shorter = mesh.clone();
    shorter.triangles.pop();
    for format in MESH_FORMATS {
        for other in [&moved, &turned, &shorter] {
            let bytes = written(format, other, &Metadata::default());
            let error = verify_written(format, &mut Cursor::new(&bytes), &mesh).unwrap_err();
            assert_eq!((error.kind(), error.code()), (Kind::Defect, "format.written-file-differs"), "{format}: {error}");
        }
        let mut cut = written(format, &mesh, &Metadata::default());
        cut.truncate(cut.len() - 1);
        assert!(verify_written(format, &mut Cursor::new(&cut), &mesh).is_err(), "{format}");
        let mut longer = written(format, &mesh, &Metadata::default());
        longer.push(0);
        // What follows a ZIP archive is no part of it.
        assert_eq!(verify_written(format, &mut Cursor::new(&longer), &mesh).is_err(), format != Format::ThreeMf);
    }
}

/// Two triangles folded along their edge, which has a normal on each side; the other corners have one.
fn folded() -> Tessellation {
    Tessellation {
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 0.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 3, 1]],
        normals: Some(Box::new(Normals { vectors: vec![DVec3::Z, DVec3::Y], triangles: vec![[0; 3], [1; 3]], degenerate: 0 })),
        ..Tessellation::default()
    }
}

#[test]
fn normals_go_with_vertices_or_beside_them() {
    let text = |format| String::from_utf8(written(format, &folded(), &Metadata::default())).unwrap();
    let obj = text(Format::Obj);
    assert!(obj.contains("\nvn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 4//2 2//2\n"), "{obj}");
    let vrml = text(Format::Vrml);
    assert!(vrml.contains("normal Normal { vector [\n0 0 1\n0 1 0\n] }\nnormalIndex [\n0 0 0 -1\n1 1 1 -1\n] } }"), "{vrml}");
    // Vertices 0 and 1 twice: 4 + 2 vertices of six numbers, two faces of 13 bytes.
    let ply = written(Format::Ply, &folded(), &Metadata::default());
    let header = String::from_utf8_lossy(&ply).into_owned();
    assert!(header.contains("element vertex 6\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"), "{header}");
    assert_eq!(ply.len() - (header.find("end_header\n").unwrap() + 11), 6 * 24 + 2 * 13);
    // What is read back are the same places.
    for format in [Format::Obj, Format::Vrml, Format::Ply] {
        let bytes = written(format, &folded(), &Metadata::default());
        let file = read(&bytes, Some(format), &ReadLimits::default()).unwrap();
        let corners = |vertices: &[DVec3], triangles: &[[u32; 3]]| -> Vec<[DVec3; 3]> {
            triangles.iter().map(|corners| corners.map(|corner| vertices[corner as usize])).collect()
        };
        assert_eq!(corners(&file.mesh.vertices, &file.mesh.triangles), corners(&folded().vertices, &folded().triangles), "{format}");
    }
    let glb = written(Format::Glb, &folded(), &Metadata::default());
    let words = String::from_utf8_lossy(&glb).into_owned();
    assert!(words.contains("\"NORMAL\":1") && words.contains("\"count\":6"), "{words}");
}

#[test]
fn evaluations_go_where_there_is_room_for_them() {
    let sample = Tessellation {
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::splat(0.1)],
        points: vec![3],
        segments: vec![[0, 1], [1, 3]],
        triangles: vec![[0, 1, 2]],
        ..Tessellation::default()
    };
    for format in [Format::Glb, Format::Obj, Format::Ply, Format::Vrml, Format::Png] {
        written(format, &sample, &Metadata::default());
    }
    let error = write(Format::ThreeMf, &sample, &Metadata::default(), &mut Cursor::new(Vec::new())).unwrap_err();
    let expected = "3MF cannot carry surfaces and wires and points; GLB, OBJ, PLY, VRML, PNG can";
    assert_eq!((error.to_string().as_str(), error.kind()), (expected, Kind::Invalid));
    let error = write(Format::Off, &sample, &Metadata::default(), &mut Cursor::new(Vec::new())).unwrap_err();
    assert_eq!(error.to_string(), "OFF cannot carry wires; GLB, OBJ, PLY, VRML, PNG can");
    let text = String::from_utf8(written(Format::Obj, &sample, &Metadata::default())).unwrap();
    assert!(text.ends_with("f 1 2 3\nl 1 2\nl 2 4\np 4\n"), "{text}");
}

#[test]
fn a_mesh_that_no_file_should_hold_is_refused_before_the_first_byte() {
    let refuse = |mesh: &TriMesh| {
        let mut sink = Cursor::new(Vec::new());
        let error = write(Format::Stl, mesh, &Metadata::default(), &mut sink).unwrap_err();
        assert!(sink.into_inner().is_empty());
        (error.kind(), error.code())
    };
    let mesh = cube(DVec3::ZERO, 1.0, false);
    assert_eq!(refuse(&TriMesh::default()), (Kind::Invalid, "format.empty-geometry"));
    let mut finer = mesh.clone();
    finer.vertices[3].x = 0.1;
    assert_eq!(refuse(&finer), (Kind::Unreachable, "format.not-single-precision"));
    let mut infinite = mesh.clone();
    infinite.vertices[3].x = 1e300;
    assert_eq!(refuse(&infinite), (Kind::Invalid, "format.not-finite"));
    let mut loose = mesh;
    loose.triangles[0][0] = 8;
    assert_eq!(refuse(&loose), (Kind::Invalid, "format.index-out-of-range"));
}

#[test]
fn polygons_become_fans_and_indices_count_back() {
    let text = b"# a square\nmtllib none\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4/1/2 -3// \\\n -2 4\n";
    let file = read(text, None, &ReadLimits::default()).unwrap();
    assert_eq!(file.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!((file.faces(), file.facts.unit), (vec![vec![0, 1, 2, 3]], None));
    let text = b"COFF 4 1 0 # colours\n0 0 0 1 1 1 1\n1 0 0 1 1 1 1\n\n1 1 0 1 1 1 1\n0 1 0 1 1 1 1\n4 0 1 2 3 255 0 0\n";
    assert_eq!(read(text, None, &ReadLimits::default()).unwrap().mesh, file.mesh);
    let text = b"ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty float y\nproperty uchar red\n\
        property int z\nelement face 1\nproperty list uchar uint vertex_index\nend_header\n\
        0 0 9 0\n1 0 9 0\n1 1 9 0\n0 1 9 0\n4 0 1 2 3";
    assert_eq!(read(text, None, &ReadLimits::default()).unwrap().mesh, file.mesh);
}

#[test]
fn big_endian_polygon_files_are_read() {
    let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\nproperty double y\n\
        property short z\nelement face 1\nproperty list uint8 int16 vertex_indices\nend_header\n"
        .to_vec();
    for (x, y, z) in [(0_f32, 0_f64, -2_i16), (1.0, 0.0, 0), (0.0, 1.5, 300)] {
        bytes.extend(x.to_be_bytes());
        bytes.extend(y.to_be_bytes());
        bytes.extend(z.to_be_bytes());
    }
    bytes.extend([3, 0, 0, 0, 1, 0, 2]);
    let mesh = read(&bytes, None, &ReadLimits::default()).unwrap().mesh;
    assert_eq!(mesh.vertices, [DVec3::Z * -2.0, DVec3::X, DVec3::new(0.0, 1.5, 300.0)]);
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
}

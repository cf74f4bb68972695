//! Files that lie, end early, bomb or climb: an error with its place, and nothing worse.

use super::*;
use lacuna_kernel::error::Kind;
use std::io::Write as _;
use zip::write::SimpleFileOptions;

fn refused(bytes: &[u8], format: Option<Format>, limits: &ReadLimits) -> (&'static str, String) {
    let error = read(bytes, format, limits).unwrap_err();
    assert!(matches!(error.kind(), Kind::Invalid | Kind::Limit), "{error:?}");
    (error.code(), error.to_string())
}

fn code(bytes: &[u8], format: Format) -> &'static str {
    refused(bytes, Some(format), &ReadLimits::default()).0
}

/// A 3MF archive of such parts.
fn package(parts: &[(&str, &str)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, text) in parts {
        zip.start_file(*name, SimpleFileOptions::default()).unwrap();
        zip.write_all(text.as_bytes()).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

const RELATIONSHIPS: (&str, &str) = (
    "_rels/.rels",
    "<Relationships><Relationship Target='/3D/3dmodel.model' Id='r' \
     Type='http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel'/></Relationships>",
);
const TETRAHEDRON: &str = "<mesh><vertices><vertex x='0' y='0' z='0'/><vertex x='1' y='0' z='0'/>\
    <vertex x='0' y='1' z='0'/><vertex x='0' y='0' z='1'/></vertices><triangles><triangle v1='0' v2='2' v3='1'/>\
    <triangle v1='0' v2='1' v3='3'/><triangle v1='1' v2='2' v3='3'/><triangle v1='0' v2='3' v3='2'/></triangles></mesh>";

fn model(root: &str, body: &str) -> Vec<u8> {
    let model = format!("<model {root} xmlns='{}'>{body}</model>", "http://schemas.microsoft.com/3dmanufacturing/core/2015/02");
    package(&[RELATIONSHIPS, ("3D/3dmodel.model", &model)])
}

fn threemf(root: &str, body: &str) -> Result<MeshFile, FormatError> {
    read(&model(root, body), None, &ReadLimits::default())
}

#[test]
fn every_truncation_of_every_format_is_an_error_or_a_mesh() {
    let mesh = torus(5, 4, DVec3::ZERO);
    for format in [Format::Stl, Format::ThreeMf, Format::Obj, Format::Ply, Format::Off, Format::Vrml] {
        let bytes = written(format, &mesh, &Metadata::default());
        for length in 0..bytes.len() {
            // A text that ends between two lines may still be a mesh; nothing may panic.
            if let Ok(file) = read(&bytes[..length], Some(format), &ReadLimits::default()) {
                assert!(matches!(format, Format::Obj | Format::Off | Format::Vrml), "{format} at {length}");
                assert!(file.mesh.triangles.iter().flatten().all(|&index| (index as usize) < file.mesh.vertices.len()));
            }
        }
    }
}

#[test]
fn every_flipped_byte_is_an_error_or_a_mesh_in_range() {
    let mesh = torus(5, 4, DVec3::ZERO);
    let limits = ReadLimits { vertices: 1000, triangles: 1000, ..ReadLimits::default() };
    for format in [Format::Stl, Format::ThreeMf, Format::Obj, Format::Ply, Format::Off, Format::Vrml] {
        let bytes = written(format, &mesh, &Metadata::default());
        for place in 0..bytes.len() {
            for flip in [0x01, 0x10, 0x80, 0xff] {
                let mut bytes = bytes.clone();
                bytes[place] ^= flip;
                if let Ok(file) = read(&bytes, Some(format), &limits) {
                    assert!(file.mesh.triangles.iter().flatten().all(|&index| (index as usize) < file.mesh.vertices.len()));
                    assert!(file.mesh.vertices.iter().all(|vertex| vertex.is_finite()));
                }
            }
        }
    }
}

#[test]
fn lying_counts_take_no_memory() {
    let mut stl = written(Format::Stl, &torus(5, 4, DVec3::ZERO), &Metadata::default());
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_eq!(code(&stl, Format::Stl), "format.truncated");
    assert_eq!(code(b"OFF\n40000000 40000000 0\n", Format::Off), "format.truncated");
    assert_eq!(code(b"OFF\n-1 4 0\n", Format::Off), "format.malformed");
    assert_eq!(code(b"OFF\n99999999999 4 0\n", Format::Off), "format.limit");
    let ply = |count: &str, rest: &[u8]| {
        let head = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\n\
            property float y\nproperty float z\nelement face 1\nproperty list uint int vertex_indices\nend_header\n"
        );
        code(&[head.as_bytes(), rest].concat(), Format::Ply)
    };
    assert_eq!(ply("18446744073709551615", b""), "format.truncated");
    assert_eq!(ply("40000000", &[0; 12]), "format.truncated");
    assert_eq!(ply("0", &[255; 64]), "format.truncated");
    assert_eq!(ply("0", &[1, 0, 0, 0, 7, 0, 0, 0]), "format.index-out-of-range");
    let endless = b"ply\nformat ascii 1.0\nelement nothing 9000000000000000000\nend_header\n";
    assert_eq!(code(endless, Format::Ply), "format.truncated");
}

#[test]
fn errors_name_the_place() {
    let text = b"v 0 0 0\nv 1 0 nan\n";
    assert_eq!(refused(text, None, &ReadLimits::default()), ("format.not-finite", "line 2: coordinate NaN is not finite".into()));
    let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n";
    let (code, words) = refused(text, None, &ReadLimits::default());
    assert_eq!((code, words.as_str()), ("format.index-out-of-range", "line 4: vertex index 3 with 3 vertices"));
    let mut stl = written(Format::Stl, &torus(5, 4, DVec3::ZERO), &Metadata::default());
    stl[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let (code, words) = refused(&stl, None, &ReadLimits::default());
    assert_eq!((code, words.as_str()), ("format.not-finite", "byte 134: coordinate inf is not finite"));
    let text = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 2\n";
    assert_eq!(refused(text, None, &ReadLimits::default()).1, "line 4: STL expects a coordinate, found \"\"");
    let text = b"OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n# fine\n\n3 0 2 1\n";
    assert_eq!(
        refused(text, None, &ReadLimits::default()).1,
        "line 8: OFF expects the end of the file, as no more faces were announced, found \"3 0 2 1\""
    );
    assert_eq!(refused(b"v 0 0 0\nf 0 1 1", None, &ReadLimits::default()).0, "format.malformed");
    assert_eq!(refused(b"hello", None, &ReadLimits::default()).0, "format.unknown");
    assert_eq!(
        refused(b"v 0 0 0\nf 9223372036854775807 -9223372036854775808 1", None, &ReadLimits::default()).0,
        "format.index-out-of-range"
    );
}

#[test]
fn limits_hold_in_every_format() {
    let mesh = torus(12, 8, DVec3::ZERO);
    for format in [Format::Stl, Format::ThreeMf, Format::Obj, Format::Ply, Format::Off, Format::Vrml] {
        let bytes = written(format, &mesh, &Metadata::default());
        let default = ReadLimits::default();
        for limits in
            [ReadLimits { vertices: 95, ..default }, ReadLimits { triangles: 191, ..default }, ReadLimits { file_bytes: 100, ..default }]
        {
            assert_eq!(refused(&bytes, Some(format), &limits).0, "format.limit", "{format}");
        }
        let enough = ReadLimits { vertices: 96, triangles: 192, ..default };
        assert!(read(&bytes, Some(format), &enough).is_ok(), "{format}");
    }
}

#[test]
fn units_components_and_transforms_are_applied() {
    let body = format!(
        "<resources><object id='1' name='tip'>{TETRAHEDRON}</object><object id='4' type='support'>{TETRAHEDRON}</object>\
         <object id='2'><components><component objectid='1'/><component objectid='4'/>\
         <component objectid='1' transform='-1 0 0 0 1 0 0 0 1 5 0 0'/></components></object></resources>\
         <build><item objectid='2' transform='0 1 0 -1 0 0 0 0 1 0 0 10'/></build>"
    );
    let file = threemf("unit='centimeter'", &body).unwrap();
    assert_eq!(file.facts.unit, Some(Unit::Centimetre));
    assert_eq!(file.facts.object_names, ["tip", "tip"]);
    assert_eq!((file.mesh.vertices.len(), file.mesh.triangles.len()), (8, 8));
    // (1, 0, 0) mirrored to (4, 0, 0), turned to (0, 4, 0), lifted by 10, in centimetres.
    assert_eq!(file.mesh.vertices[5], DVec3::new(0.0, 40.0, 100.0));
    let volume = |mesh: &TriMesh| corners(mesh).iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum::<f64>();
    assert!((volume(&file.mesh) - 2.0 * 1000.0 / 6.0).abs() < 1e-9);
}

#[test]
fn what_a_3mf_file_must_not_do_is_refused() {
    let item = "<build><item objectid='1'/></build>";
    let code = |root: &str, body: &str| threemf(root, body).unwrap_err().code();
    let loops =
        "<resources><object id='1'><components><component objectid='1'/><component objectid='1'/></components></object></resources>";
    assert_eq!(code("", &format!("{loops}{item}")), "format.limit");
    assert_eq!(code("", item), "format.malformed");
    assert_eq!(code("unit='parsec'", item), "format.malformed");
    assert_eq!(code("requiredextensions='b' xmlns:b='urn:beams'", item), "format.refused");
    let body = format!("<resources><object id='1'>{}</object></resources>{item}", TETRAHEDRON.replace("v3='3'", "v3='4'"));
    assert_eq!(code("", &body), "format.index-out-of-range");
    let body = format!("<resources><object id='1'>{}</object></resources>{item}", TETRAHEDRON.replace("x='1'", "x='nan'"));
    assert_eq!(code("", &body), "format.not-finite");
    let dtd = "<!DOCTYPE model [<!ENTITY a 'aaaa'>]><model xmlns='x'/>";
    let parts = |parts: &[(&str, &str)]| read(&package(parts), None, &ReadLimits::default()).unwrap_err();
    assert_eq!(parts(&[RELATIONSHIPS, ("3D/3dmodel.model", dtd)]).code(), "format.refused");
    assert_eq!(parts(&[RELATIONSHIPS, ("../3dmodel.model", "")]).code(), "format.refused");
    assert_eq!(parts(&[RELATIONSHIPS]).code(), "format.malformed");
    assert_eq!(parts(&[("_rels/.rels", "<Relationships><Relationship TargetMode='External'/></Relationships>")]).code(), "format.refused");
    assert_eq!(parts(&[("readme.txt", "hello")]).code(), "format.malformed");
}

#[test]
fn two_entries_of_one_name_are_refused() {
    let mut bytes = package(&[RELATIONSHIPS, ("3D/3dmodel.model", "<a/>"), ("3D/3dmodel.other", "<b/>")]);
    for at in 0..bytes.len() - 5 {
        if &bytes[at..at + 5] == b"other" {
            bytes[at..at + 5].copy_from_slice(b"model");
        }
    }
    assert_eq!(read(&bytes, None, &ReadLimits::default()).unwrap_err().code(), "format.refused");
}

#[test]
fn an_archive_has_few_entries_and_its_elements_lie_in_few_others() {
    let nested = |levels: usize| {
        // The model is around them, and the tetrahedron beside.
        let body = format!(
            "{}{}<resources><object id='1'>{TETRAHEDRON}</object></resources><build><item objectid='1'/></build>",
            "<a>".repeat(levels),
            "</a>".repeat(levels)
        );
        threemf("", &body)
    };
    assert!(nested(31).is_ok());
    let error = nested(32).unwrap_err();
    assert_eq!((error.limit_facts().unwrap().limit, error.limit_facts().unwrap().allowed), ("xml_depth", 32.0));

    let names: Vec<String> = (0..201).map(|k| format!("x/{k}")).collect();
    let parts: Vec<(&str, &str)> = names.iter().map(|name| (name.as_str(), "")).collect();
    let facts = read(&package(&parts), Some(Format::ThreeMf), &ReadLimits::default()).unwrap_err();
    assert_eq!((facts.limit_facts().unwrap().limit, facts.limit_facts().unwrap().allowed), ("archive_entries", 200.0));
}

#[test]
fn bombs_are_stopped_while_they_inflate() {
    let spaces = " ".repeat(40 << 20);
    let bomb = model("", &spaces);
    assert!(bomb.len() < 100_000);
    let error = read(&bomb, None, &ReadLimits::default()).unwrap_err();
    assert_eq!(error.code(), "format.limit", "{error}");
    let facts = error.limit_facts().unwrap();
    assert!(["inflated_bytes", "xml_element_bytes"].contains(&facts.limit), "{facts:?}");
    let small = ReadLimits { inflated_bytes: 1000, ..ReadLimits::default() };
    let bytes = written(Format::ThreeMf, &torus(12, 8, DVec3::ZERO), &Metadata::default());
    assert_eq!(read(&bytes, None, &small).unwrap_err().limit_facts().unwrap().limit, "inflated_bytes");
    let few = ReadLimits { archive_entries: 2, ..ReadLimits::default() };
    assert_eq!(read(&bytes, None, &few).unwrap_err().limit_facts().unwrap().limit, "archive_entries");
}

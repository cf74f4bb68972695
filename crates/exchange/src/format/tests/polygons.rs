//! Polygons stay polygons, and scenes of both versions of VRML become meshes or are refused with their line.

use super::*;

const SQUARE: &str =
    "Shape { geometry IndexedFaceSet { coord Coordinate { point [0 0 0, 1 0 0, 1 1 0, 0 1 0] } coordIndex [0 1 2 3 -1] } }";

fn scene(body: &str) -> Result<MeshFile, FormatError> {
    read(format!("#VRML V2.0 utf8\n{body}").as_bytes(), None, &ReadLimits::default())
}

fn inventor(body: &str) -> Result<MeshFile, FormatError> {
    read(format!("#VRML V1.0 ascii\n{body}").as_bytes(), None, &ReadLimits::default())
}

fn assert_near(found: &[DVec3], expected: &[[f64; 3]]) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((*found - DVec3::from_array(*expected)).length() < 1e-12, "{found} is not {expected:?}");
    }
}

/// A cage of quads, triangles, a pentagon and a face of 300 corners.
fn cage() -> MeshFile {
    let mut text = String::from("# cage\n");
    for k in 0..310 {
        text.push_str(&format!("v {k} {} 0.5\n", k * k));
    }
    text.push_str("f 1 2 3\nf 1 2 3 4\nf 5 6 7 8 9\nf 9 8 7\nf 9 8 1\nf ");
    (10..=309).for_each(|k| text.push_str(&format!("{k} ")));
    text.push_str("\nf 4 3 2 1\n");
    read(text.as_bytes(), None, &ReadLimits::default()).unwrap()
}

#[test]
fn polygons_go_through_every_format_that_has_them() {
    let cage = cage();
    let faces = cage.faces();
    assert_eq!(faces.iter().map(Vec::len).collect::<Vec<_>>(), [3, 4, 5, 3, 3, 300, 4]);
    assert_eq!(faces[5], (9..309).collect::<Vec<u32>>());
    assert_eq!(cage.polygons.len(), 4);
    for format in [Format::Obj, Format::Ply, Format::Off, Format::Vrml] {
        let bytes = written(format, Geometry::Polygons { mesh: &cage.mesh, polygons: &cage.polygons, closed: false }, &Metadata::default());
        let back = read(&bytes, None, &ReadLimits::default()).unwrap();
        assert!(back.faces() == faces, "{format}");
        assert!(back.mesh == cage.mesh, "{format}");
    }
    // Formats of triangles have them cut.
    let bytes =
        written(Format::Stl, Geometry::Polygons { mesh: &cage.mesh, polygons: &cage.polygons, closed: false }, &Metadata::default());
    assert_eq!(read(&bytes, None, &ReadLimits::default()).unwrap().faces().len(), cage.mesh.triangles.len());
    let error = write(
        Format::ThreeMf,
        Geometry::Polygons { mesh: &cage.mesh, polygons: &cage.polygons, closed: false },
        &Metadata::default(),
        &mut Cursor::new(vec![]),
    );
    assert_eq!(error.unwrap_err().code(), "format.cannot-carry");
    // Quads alone take one byte for their number in a PLY file.
    let quads = scene(SQUARE).unwrap();
    let bytes =
        written(Format::Ply, Geometry::Polygons { mesh: &quads.mesh, polygons: &quads.polygons, closed: false }, &Metadata::default());
    assert_eq!(bytes.len(), bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11 + 4 * 12 + 1 + 4 * 4);
}

#[test]
fn a_scene_of_version_2_is_read_with_its_transforms() {
    let file = scene(
        "# units mm, said here: units mm\nWorldInfo { title \"a # and a } in \\\" a string\" info [\"x\", \"y\"] }\n\
         DEF body Transform { translation 10 0 0 rotation 0 0 2 1.5707963267948966 scale 2 3 1 children [\n\
         Shape { appearance Appearance { material DEF m Material { diffuseColor 1 0 0, transparency 0 } }\n\
           geometry DEF set IndexedFaceSet { ccw TRUE solid FALSE coord DEF c Coordinate { point [ 0 0 0 # origin\n\
           1. 0 0, +1 1e0 0 ,0,.1E1,0 ] } color Color { color [1 0 0, 0 1 0] } coordIndex [ 0,1,2,3,-1, 0x0 2 1 ] } }\n\
         Group { children Shape { geometry IndexedFaceSet { coord USE c ccw FALSE coordIndex [ 0 1 2 -1 ] } } } ] }\n\
         Shape { geometry Sphere { radius 2 } } Shape { geometry USE set }\nROUTE a.x TO b.y\n",
    )
    .unwrap();
    assert_eq!(
        (file.facts.unit, file.facts.object_names.as_slice()),
        (Some(Unit::Millimetre), ["set", "body"].map(str::to_owned).as_slice())
    );
    assert_eq!(file.facts.left_out, [("Sphere", 1)]);
    // (x, y) to (10 - 3 y, 2 x); the two sets of the group share their points.
    let placed = [[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [7.0, 2.0, 0.0], [7.0, 0.0, 0.0]];
    let plain = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    assert_near(&file.mesh.vertices, &[placed, plain].concat());
    assert_eq!(file.faces(), [vec![0, 1, 2, 3], vec![0, 2, 1], vec![2, 1, 0], vec![4, 5, 6, 7], vec![4, 6, 5]]);
}

#[test]
fn the_map_of_a_transform_is_that_of_the_standard() {
    // Scaled by 2 along the diagonal (1, 1), about the point (1, 0): (2, 0) is 1 away, half of it along the diagonal.
    let file = scene(&format!(
        "Transform {{ center 1 0 0 scale 2 1 1 scaleOrientation 0 0 1 {} children [ {} ] }}",
        std::f64::consts::FRAC_PI_4,
        SQUARE.replace("0 0 0, 1 0 0, 1 1 0, 0 1 0", "2 0 0 1 0 0 1 1 0 0 1 0")
    ))
    .unwrap();
    assert_near(&file.mesh.vertices, &[[2.5, 0.5, 0.0], [1.0, 0.0, 0.0], [1.5, 1.5, 0.0], [0.0, 1.0, 0.0]]);
    // A mirror image keeps its outside outside.
    let file = scene(&format!("Transform {{ scale -1 1 1 children {SQUARE} }}")).unwrap();
    assert_near(&file.mesh.vertices, &[[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(file.faces(), [[3, 2, 1, 0]]);
}

#[test]
fn a_scene_of_version_1_is_read_in_order() {
    let file = inventor(
        "DEF all Separator {\n Coordinate3 { point [0 0 0, 1 0 0, 0 1 0, 1 1 0] }\n\
         IndexedFaceSet { coordIndex [0, 1, 3, 2, -1] }\n\
         Separator { Translation { translation 0 0 5 } ShapeHints { vertexOrdering CLOCKWISE faceType CONVEX }\n\
           IndexedFaceSet { coordIndex [0, 1, 3, -1,] } IndexedFaceSet { coordIndex [3 2 0 -1] } }\n\
         FontStyle { style (BOLD | ITALIC) } Cube { width 1 }\n\
         TransformSeparator { MatrixTransform { matrix 0 1 0 0  -1 0 0 0  0 0 1 0  7 8 9 1 } IndexedFaceSet { coordIndex [0 1 2] } }\n\
         Switch { whichChild 1 Material { } IndexedFaceSet { coordIndex [1 3 2 -1] } IndexedFaceSet { coordIndex [0 1 2 -1] } }\n\
         Switch { IndexedFaceSet { coordIndex [0 1 2 -1] } }\n}\n",
    )
    .unwrap();
    assert_eq!(file.facts.left_out, [("Cube", 1)]);
    let plain = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let lifted = plain.map(|[x, y, _]| [x, y, 5.0]);
    let turned = plain.map(|[x, y, _]| [7.0 - y, 8.0 + x, 9.0]);
    assert_near(&file.mesh.vertices, &[plain, lifted, turned].concat());
    assert_eq!(file.faces(), [vec![0, 1, 3, 2], vec![7, 5, 4], vec![4, 6, 7], vec![8, 9, 10], vec![1, 3, 2]]);
    let file = read(
        b"#Inventor V2.1 ascii\nSeparator { IndexedFaceSet { vertexProperty VertexProperty { vertex [0 0 0 1 0 0 0 1 0] } \
        coordIndex [0 1 2 -1] } }",
        None,
        &ReadLimits::default(),
    );
    assert_eq!(file.unwrap().faces(), [[0, 1, 2]]);
}

#[track_caller]
fn assert_refused(body: &str, code: &str, words: &str) {
    let error = scene(body).unwrap_err();
    assert_eq!(error.code(), code, "{error}");
    assert!(error.to_string().contains(words), "{error}");
}

#[test]
fn scenes_that_lie_are_refused_with_their_line() {
    let set = |points: &str, indices: &str| SQUARE.replace("0 0 0, 1 0 0, 1 1 0, 0 1 0", points).replace("0 1 2 3 -1", indices);
    let good = "0 0 0 1 0 0 1 1 0 0 1 0";
    assert_refused(&set(good, "0 1\n4 -1"), "format.index-out-of-range", "line 2: vertex index 4 with 4 vertices");
    assert_refused(&set(good, "0 1 -2"), "format.malformed", "found \"-2\"");
    assert_refused(&set(good, "0 1 1.5"), "format.malformed", "an index of a vertex, or -1");
    assert_refused(&set(good, "0 1 99999999999"), "format.malformed", "99999999999");
    assert_refused(&set("0 0 0\n\n1 0", "0 1 2"), "format.malformed", "line 4: VRML expects three coordinates");
    assert_refused(&set("0 0 0 1 0 nan", "0 1 1"), "format.not-finite", "NaN");
    assert_refused(&set("0 0 0 1 0 1e999", "0 1 1"), "format.not-finite", "inf");
    assert_refused(&set("0 0 0 1 0 -1.#IND", "0 1 1"), "format.malformed", "-1.#IND");
    assert_refused(&set("0 0 0 1 zero 0", "0 1 1"), "format.malformed", "zero");
    assert_refused("Group { children [ USE ghost ] }", "format.malformed", "a name that DEF gave before, found \"ghost\"");
    assert_refused("DEF a Group { children [ USE a ] }", "format.malformed", "found \"a\"");
    assert_refused("PROTO Wheel [] { }", "format.refused", "prototypes");
    assert_refused("Shape { geometry Box { } }", "format.malformed", "found \"Box\"");
    assert_refused("", "format.malformed", "an IndexedFaceSet");
    assert_refused("Shape { geometry IndexedFaceSet { coordIndex [0 1 2 -1] } }", "format.malformed", "coordinates");
    assert_refused("}", "format.malformed", "found \"}\"");
    assert_refused("Shape { geometry \"", "format.truncated", "line 2");
    assert_refused(&"Group { children ".repeat(1000), "format.limit", "scene_nesting");
    assert_refused(&"Group { children [".repeat(50), "format.truncated", "line 2");
    assert_eq!(inventor("MatrixTransform { matrix 1 0 0 0 0 1 0 0 0 0 1 1 0 0 0 1 }").unwrap_err().code(), "format.refused");
    assert_eq!(
        read(b"#Inventor V2.1 binary\n\0\0\0\0", None, &ReadLimits::default()).unwrap_err().kind(),
        lacuna_kernel::error::Kind::Invalid
    );
}

#[test]
fn scenes_that_grow_by_names_are_stopped() {
    let grow = |levels: usize, first: &str| {
        let mut text = format!("DEF a0 Group {{ children [ {first} ] }}\n");
        for k in 1..levels {
            text.push_str(&format!("DEF a{k} Group {{ children [ USE a{0} USE a{0} ] }}\n", k - 1));
        }
        text
    };
    let start = std::time::Instant::now();
    assert_refused(&grow(60, SQUARE), "format.limit", "instances");
    assert_refused(&grow(100, SQUARE), "format.limit", "");
    // A long list of nothing, placed again and again, is work as well.
    let empty = SQUARE.replace("0 1 2 3 -1", &"-1 ".repeat(100_000));
    let few = ReadLimits { triangles: 100_000, ..ReadLimits::default() };
    let text = format!("#VRML V2.0 utf8\n{}", grow(12, &empty));
    assert_eq!(read(text.as_bytes(), None, &few).unwrap_err().code(), "format.limit");
    // Each placed elsewhere, so that their points are new.
    let moved = format!("DEF a0 {SQUARE}\n") + &(1..15).map(|k| {
        format!("DEF a{k} Transform {{ translation {k} 0 0 children [ USE a{0} Transform {{ translation 0 {1} 1 children USE a{0} }} ] }}\n", k - 1, 1 << k)
    }).collect::<String>();
    let text = format!("#VRML V2.0 utf8\n{moved}");
    let few = ReadLimits { vertices: 10_000, ..ReadLimits::default() };
    assert_eq!(read(text.as_bytes(), None, &few).unwrap_err().limit_facts().unwrap().limit, "vertices");
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn any_change_of_a_byte_gives_a_mesh_or_an_error() {
    let text = format!(
        "#VRML V2.0 utf8\nDEF a Transform {{ rotation 1 0 0 1 children [ {SQUARE} Switch {{ whichChoice 0 choice {SQUARE} }} ] }} USE a"
    );
    let limits = ReadLimits::default();
    for at in 0..text.len() {
        for byte in *b" {}[]\"#-19.eDU,x\n\0\xff" {
            let mut bytes = text.clone().into_bytes();
            bytes[at] = byte;
            if let Ok(file) = read(&bytes, Some(Format::Vrml), &limits) {
                assert!(file.mesh.triangles.iter().flatten().all(|&index| (index as usize) < file.mesh.vertices.len()));
            }
        }
    }
}

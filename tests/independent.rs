//! Every solid case as STL and 3MF, and sections of solids, read back by libraries that we did not write (`independent/check.py`).

use std::fs;
use std::path::{Path, PathBuf};

use lacuna_tests::support::binary::succeed;
use lacuna_tests::support::cases::{self, Case};
use lacuna_tests::support::python::{Judge, skipped};
use lacuna_tests::support::scratch::Scratch;
use serde_json::Value;

/// Counts that reports and certificates have in common.
const COUNTS: [&str; 13] = [
    "vertices",
    "edges",
    "triangles",
    "euler",
    "shells",
    "components",
    "cavities",
    "genus",
    "boundary_edges",
    "nonmanifold_edges",
    "nonmanifold_vertices",
    "flipped_pairs",
    "degenerate_triangles",
];

/// Counts that are 0 in every printable file.
const ZERO: [&str; 5] = ["boundary_edges", "nonmanifold_edges", "nonmanifold_vertices", "flipped_pairs", "degenerate_triangles"];

/// Relative rounding of sums over a mesh in double precision.
const ROUNDING: f64 = 1e-9;

/// What is wrong with a case.
#[derive(Default)]
struct Findings(Vec<String>);

impl Findings {
    fn expect(&mut self, holds: bool, words: impl FnOnce() -> String) {
        if !holds {
            self.0.push(words());
        }
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING * a.abs().max(b.abs()).max(1.0)
}

/// Writes the solid in both formats and gives its certificate.
fn solidify(case: &Case, files: &[PathBuf; 2], certificate: &Path) -> Value {
    let expected = &case.expected;
    succeed([
        "solidify".into(),
        case.model().into_os_string(),
        "--tolerance".into(),
        expected.tolerance_mm.to_string().into(),
        "--radius".into(),
        expected.radius_mm.unwrap().to_string().into(),
        "-o".into(),
        files[0].as_os_str().to_owned(),
        "-o".into(),
        files[1].as_os_str().to_owned(),
        "--certificate".into(),
        certificate.as_os_str().to_owned(),
    ]);
    serde_json::from_slice(&fs::read(certificate).unwrap()).unwrap()
}

/// The report agrees with the certificate, with the case, and with itself.
fn judge(case: &Case, format: &str, report: &Value, certificate: &Value, found: &mut Findings) {
    let name = format!("{}.{format}", case.name);
    if let Some(problem) = report.get("problem") {
        found.expect(false, || format!("{name} cannot be read: {problem}"));
        return;
    }
    for count in COUNTS {
        let (theirs, ours) = (&report[count], &certificate[count]);
        found.expect(theirs.is_i64() && theirs == ours, || format!("{name}: {count} is {theirs}, the certificate says {ours}"));
        let stated = case.expected.count(count);
        found.expect(stated.is_none_or(|value| theirs == value), || format!("{name}: {count} is {theirs}, exact is {stated:?}"));
    }
    for count in ZERO {
        found.expect(report[count] == 0, || format!("{name}: {count} is {}", report[count]));
    }
    found.expect(report["finite"] == true, || format!("{name}: a coordinate is no number"));
    let (volume, ours) = (number(&report["volume"]), number(&certificate["mesh_volume_mm3"]));
    found.expect(near(volume, ours), || format!("{name}: volume {volume}, the certificate says {ours}"));
    if format == "stl" {
        judge_opinions(&name, report, volume, found);
    }
    if format == "3mf" {
        let read = &report["lib3mf"];
        let sound =
            read["valid"] == true && read["oriented"] == true && read["millimetres"] == true && read["warnings"] == serde_json::json!([]);
        found.expect(sound, || format!("{name}: lib3mf says {read}"));
    }
    judge_measures(case, &name, report, volume, found);
}

fn judge_opinions(name: &str, report: &Value, volume: f64, found: &mut Findings) {
    let (trimesh, manifold) = (&report["trimesh"], &report["manifold"]);
    for opinion in [trimesh, manifold] {
        found.expect(near(volume, number(&opinion["volume"])), || format!("{name}: volume {volume}, another opinion is {opinion}"));
    }
    found.expect(trimesh["watertight"] == true && trimesh["winding"] == true, || format!("{name}: trimesh says {trimesh}"));
    found.expect(trimesh["euler"] == report["euler"], || format!("{name}: trimesh says {trimesh}"));
    found.expect(manifold["status"] == "NoError", || format!("{name}: Manifold says {manifold}"));
    found.expect(manifold["shells"] == report["shells"], || format!("{name}: Manifold says {manifold}"));
    let crossings = &report["self_intersections"];
    found.expect(*crossings == 0, || format!("{name}: {crossings} pairs of triangles cross"));
}

fn judge_measures(case: &Case, name: &str, report: &Value, volume: f64, found: &mut Findings) {
    if let Some(band) = case.expected.scalar.get("mesh_volume_mm3") {
        let (lower, upper) = (band.lower.unwrap(), band.upper.unwrap());
        found.expect(lower <= volume && volume <= upper, || format!("{name}: volume {volume} is not in [{lower}, {upper}]"));
    }
    let Some(exact) = &case.expected.exact_box else { return };
    for (corner, numbers) in [exact.lower, exact.upper].iter().enumerate() {
        for (axis, value) in numbers.iter().enumerate() {
            // 1e-6 relative: the files may hold single precision.
            let allowed = case.expected.tolerance_mm + 1e-6 * value.abs();
            let got = number(&report["box"][corner][axis]);
            found.expect((got - value).abs() <= allowed, || format!("{name}: box[{corner}][{axis}] is {got}, exact {value}"));
        }
    }
}

#[test]
fn other_peoples_libraries_find_what_the_cases_say() {
    if skipped() {
        return;
    }
    let mut judge_process = Judge::start();
    let mut found = Findings::default();
    let scratch = Scratch::new();
    let cases = cases::solids();
    assert!(cases.len() >= 30, "only {} solid cases were found", cases.len());
    for case in &cases {
        let files = ["part.stl", "part.3mf"].map(|name| scratch.join(name));
        let certificate = solidify(case, &files, &scratch.join("certificate.json"));
        // Both hold the same mesh, as counts and volume tell: the second opinions are asked once.
        let reports = [("stl", true), ("3mf", false)].map(|(format, opinions)| {
            let report = judge_process.report(&scratch.join(&format!("part.{format}")), opinions);
            judge(case, format, &report, &certificate, &mut found);
            report
        });
        let (a, b) = (number(&reports[0]["volume"]), number(&reports[1]["volume"]));
        found.expect(near(a, b), || format!("{}: STL holds {a} mm3, 3MF {b} mm3", case.name));
    }
    assert!(found.0.is_empty(), "{} findings:\n{}", found.0.len(), found.0.join("\n"));
}

/// ASCII STL of triangles over named corners.
fn stl(corners: &[[f64; 3]], triangles: &[[usize; 3]]) -> String {
    let mut text = String::from("solid defect\n");
    for triangle in triangles {
        text += "facet normal 0 0 0\nouter loop\n";
        for corner in triangle {
            let [x, y, z] = corners[*corner];
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    text + "endsolid defect\n"
}

/// A judge that never objects is none: known defects must be seen.
#[test]
fn the_judge_sees_defects() {
    if skipped() {
        return;
    }
    let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [-1., 0., 0.], [0., -1., 0.], [0., 0., -1.]];
    let tetrahedron = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    // Mirrored through the origin: meets the first in one point.
    let other = [[0, 4, 5], [0, 6, 4], [4, 6, 5], [5, 6, 0]];
    let inward: Vec<[usize; 3]> = tetrahedron.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let turned = [[0, 1, 2], tetrahedron[1], tetrahedron[2], tetrahedron[3]];
    let shifted: Vec<[f64; 3]> = corners.iter().copied().chain(corners[..4].iter().map(|p| p.map(|x| x + 0.1))).collect();
    let crossing: Vec<[usize; 3]> = tetrahedron.iter().copied().chain(tetrahedron.iter().map(|t| t.map(|k| k + 7))).collect();
    let both: Vec<[usize; 3]> = tetrahedron.iter().chain(&other).copied().collect();
    let cases: [(&str, Vec<[usize; 3]>, &str, i64); 7] = [
        ("sound", tetrahedron.to_vec(), "components", 1),
        ("open", tetrahedron[1..].to_vec(), "boundary_edges", 3),
        ("touching", both, "nonmanifold_vertices", 1),
        ("inward", inward, "cavities", 1),
        ("turned", turned.to_vec(), "flipped_pairs", 3),
        ("crossing", crossing.clone(), "components", 2),
        ("tripled", tetrahedron.iter().copied().chain([[0, 1, 5]]).collect(), "nonmanifold_edges", 1),
    ];
    let scratch = Scratch::new();
    let mut judge = Judge::start();
    for (name, triangles, count, expected) in cases {
        let file = scratch.join(&format!("{name}.stl"));
        fs::write(&file, stl(&shifted, &triangles)).unwrap();
        let report = judge.report(&file, name == "sound" || name == "crossing");
        assert_eq!(report[count], expected, "{name}: {report}");
        match name {
            "sound" => assert_eq!(report["self_intersections"], 0, "{report}"),
            "crossing" => assert!(report["self_intersections"].as_i64().unwrap() > 0, "{report}"),
            _ => {}
        }
    }
}

#[test]
fn the_judge_does_not_read_rubbish() {
    if skipped() {
        return;
    }
    let scratch = Scratch::new();
    let mut judge = Judge::start();
    for name in ["rubbish.3mf", "rubbish.stl"] {
        let file = scratch.join(name);
        fs::write(&file, "rubbish").unwrap();
        assert!(judge.report(&file, false).get("problem").is_some(), "{name}");
    }
}

/// What is wrong with drawn sections, as trimesh and shapely see them.
///
/// Both programs take a corner as p + t (q - p) of the same single-precision ends, with t from differences of heights that are rounded once: a few roundings of the greatest
/// coordinate, so outlines lie within 16 of them of each other, and the area between them within that times the perimeter.
fn judge_sections(name: &str, report: &Value, count: usize, found: &mut Findings) {
    let sections = report["sections"].as_array().map_or(&[][..], Vec::as_slice);
    found.expect(sections.len() == count, || format!("{name}: {count} sections were asked for: {report}"));
    let size = [0, 1].iter().flat_map(|&end| (0..3).map(move |axis| number(&report["box"][end][axis]).abs())).fold(0.0, f64::max);
    for section in sections {
        let (ours, theirs) = (&section["ours"], &section["theirs"]);
        let same = ["outlines", "holes", "valid"].iter().all(|what| ours[what] == theirs[what]) && ours["valid"] == true;
        found.expect(same, || format!("{name}: other outlines: {section}"));
        let allowed = 16.0 * f64::EPSILON * size * number(&theirs["perimeter"]);
        found.expect(number(&section["apart"]) <= allowed, || format!("{name}: more than {allowed} mm2 apart: {section}"));
    }
}

/// Draws sections of a mesh file across Z.
fn slice(file: &Path, heights: &[f64], drawing: &Path) {
    let at = format!("--at={}", heights.iter().map(f64::to_string).collect::<Vec<_>>().join(","));
    let words = ["slice", "--tolerance", "0.001", &at, "-o"].map(std::ffi::OsStr::new);
    succeed(words.into_iter().chain([drawing.as_os_str(), file.as_os_str()]));
}

const OCTAHEDRON: [[f64; 3]; 6] = [[4., 0., 0.], [0., 4., 0.], [-4., 0., 0.], [0., -4., 0.], [0., 0., 4.], [0., 0., -4.]];
const OCTAHEDRON_FACES: [[usize; 3]; 8] = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]];

#[test]
fn sections_are_those_of_another_library() {
    if skipped() {
        return;
    }
    let scratch = Scratch::new();
    let (ring, menger) = (scratch.join("ring.json"), scratch.join("menger.json"));
    let corners = [[0, 0, 0], [20, 0, 0], [20, 20, 0], [0, 20, 0]];
    let shape = serde_json::json!({ "family": "corner_cutting", "a": 0.25, "b": 0.25, "closed": true, "control_points": corners });
    fs::write(&ring, serde_json::json!({ "lacuna": 1, "shape": shape }).to_string()).unwrap();
    fs::write(&menger, succeed(["library", "menger_sponge"])).unwrap();
    let tetrahedron = lacuna_tests::support::root().join("fixtures/ifs/sierpinski_tetrahedron/model.json");
    // Where a face of the sponge is in the file, in single precision.
    let ninth = 11.111_111_f32;
    let faces = [0.0, 5.0, f64::from(ninth), 50.0];
    // Planes between vertices, and along faces, where the solid above them is cut.
    let solids: [(&str, &Path, &[&str], &[f64]); 3] = [
        ("tetrahedron", &tetrahedron, &["--tolerance", "2", "--radius", "4"], &[0.0, 1.0, 20.0, 50.0]),
        ("ring", &ring, &["--tolerance", "0.1", "--radius", "1"], &[-0.5, 0.0, 0.7]),
        ("sponge", &menger, &["--level", "2"], &faces),
    ];
    let mut judge = Judge::start();
    let mut found = Findings::default();
    let (file, drawing, layers) = (scratch.join("part.stl"), scratch.join("part.svg"), scratch.join("part.dxf"));
    let (mut outlines, mut holes) = (0, 0);
    for (name, model, words, heights) in solids {
        let words = ["solidify"].iter().chain(words).map(std::ffi::OsStr::new);
        succeed(words.chain(["-o".as_ref(), file.as_os_str(), model.as_os_str()]));
        if name == "sponge" {
            assert!(fs::read(&file).unwrap().windows(4).any(|bytes| bytes == ninth.to_le_bytes()), "no face is at {ninth}");
        }
        slice(&file, heights, &drawing);
        let report = judge.sections(&file, heights, &drawing);
        judge_sections(name, &report, heights.len(), &mut found);
        slice(&file, heights, &layers);
        judge_sections(&format!("{name}, DXF"), &judge.sections(&file, heights, &layers), heights.len(), &mut found);
        let most = |what: &str| report["sections"].as_array().unwrap().iter().filter_map(|section| section["ours"][what].as_u64()).max();
        (outlines, holes) = (outlines.max(most("outlines").unwrap()), holes.max(most("holes").unwrap()));
    }
    // Through four vertices and along four edges.
    fs::write(&file, stl(&OCTAHEDRON, &OCTAHEDRON_FACES)).unwrap();
    let heights = [-1.3, 0.0, 3.0];
    slice(&file, &heights, &drawing);
    judge_sections("octahedron", &judge.sections(&file, &heights, &drawing), heights.len(), &mut found);
    assert!(found.0.is_empty(), "{} findings:\n{}", found.0.len(), found.0.join("\n"));
    // Of the sponge: a plane through its middle leaves 16 squares, one through its lowest cells 9 holes.
    assert_eq!((outlines, holes), (16, 9));
}

/// One corner moved by a millionth of a micrometre is seen, and so is an outline too few.
#[test]
fn the_judge_sees_outlines_that_are_moved() {
    if skipped() {
        return;
    }
    let scratch = Scratch::new();
    let (file, drawing) = (scratch.join("octahedron.stl"), scratch.join("octahedron.svg"));
    fs::write(&file, stl(&OCTAHEDRON, &OCTAHEDRON_FACES)).unwrap();
    slice(&file, &[1.0], &drawing);
    let sound = fs::read_to_string(&drawing).unwrap();
    let start = sound.find("d=\"M").unwrap() + 4;
    let end = start + sound[start..].find(' ').unwrap();
    let corner: f64 = sound[start..end].parse().unwrap();
    let moved = format!("{}{}{}", &sound[..start], corner + 1e-9, &sound[end..]);
    let path = start - 10..start + sound[start..].find("/>").unwrap() + 2;
    let missing = format!("{}{}", &sound[..path.start], &sound[path.end..]);
    let mut judge = Judge::start();
    for (words, text, findings) in [("sound", &sound, 0), ("moved", &moved, 1), ("missing", &missing, 2)] {
        fs::write(&drawing, text).unwrap();
        let mut found = Findings::default();
        judge_sections(words, &judge.sections(&file, &[1.0], &drawing), 1, &mut found);
        assert_eq!(found.0.len(), findings, "{words}: {:?}", found.0);
    }
}

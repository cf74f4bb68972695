//! Plane sections through the command, as drawings that other programs read.

use std::f64::consts::PI;
use std::path::Path;

use lacuna_tests::support::binary;
use lacuna_tests::support::scratch::Scratch;
use serde_json::Value;

fn write(path: &Path, shape: &Value) {
    std::fs::write(path, serde_json::json!({ "lacuna": 1, "shape": shape }).to_string()).unwrap();
}

fn certificate(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The areas of the groups of an SVG drawing: paths of `M x y L x y ... z`, v upwards.
fn areas(drawing: &str) -> Vec<f64> {
    let of_loop = |points: &str| {
        let numbers: Vec<f64> = points.split(['L', ' ']).filter(|word| !word.is_empty()).map(|word| word.parse().unwrap()).collect();
        let corners: Vec<&[f64]> = numbers.chunks(2).collect();
        (0..corners.len())
            .map(|k| (corners[k], corners[(k + 1) % corners.len()]))
            .map(|(a, b)| 0.5 * (b[0] * a[1] - a[0] * b[1]))
            .sum::<f64>()
    };
    let of_group = |group: &str| {
        let paths = group.split("<path d=\"").skip(1).map(|path| path.split('"').next().unwrap());
        paths.flat_map(|path| path.split('M').skip(1)).map(|run| of_loop(run.trim_end_matches('z'))).sum::<f64>()
    };
    drawing.split("<g id=\"z_").skip(1).map(of_group).collect()
}

#[test]
fn layers_of_a_ball() {
    let folder = Scratch::new();
    let (model, svg, dxf, told) = (folder.join("ball.json"), folder.join("ball.svg"), folder.join("ball.dxf"), folder.join("told.json"));
    write(&model, &serde_json::json!({ "family": "mesh", "vertices": [[10, 20, 30]], "faces": [[0]] }));
    let radius = 5.0_f64;
    let arguments = ["slice", "--tolerance", "0.01", "--radius", "5", "--step", "0.5", "-o"].map(std::ffi::OsStr::new);
    let paths = [svg.as_os_str(), "-o".as_ref(), dxf.as_os_str(), "--certificate".as_ref(), told.as_os_str(), model.as_os_str()];
    binary::succeed(arguments.into_iter().chain(paths));
    let certificate = certificate(&told);
    let planes = certificate["sections"]["planes"].as_array().unwrap();
    let drawn = areas(&std::fs::read_to_string(&svg).unwrap());
    assert_eq!(planes.len(), drawn.len());
    assert!((20..=21).contains(&planes.len()), "{}", planes.len());
    let bound = |name: &str| certificate[name].as_f64().unwrap();
    for (plane, drawn) in planes.iter().zip(drawn) {
        let (height, area) = (plane["offset_mm"].as_f64().unwrap() - 30.0, plane["area_mm2"].as_f64().unwrap());
        let disc = |radius: f64| PI * (radius * radius - height * height).max(0.0);
        let (least, most) = (disc(radius - bound("inner_bound_mm")), disc(radius + bound("outer_bound_mm")));
        assert!(least <= area && area <= most, "{area} at {height} is not in [{least}, {most}]");
        assert!((area - drawn).abs() <= 1e-9 * area, "{drawn} is drawn, {area} is told");
        assert_eq!((plane["polygons"].as_u64(), plane["holes"].as_u64()), (Some(1), Some(0)));
    }
    let drawing = std::fs::read_to_string(&dxf).unwrap();
    assert_eq!(drawing.matches("LWPOLYLINE\n").count(), planes.len());
    assert!(certificate["output_digests"]["svg"].is_string() && certificate["output_digests"]["dxf"].is_string());
}

#[test]
fn a_hole_and_an_oblique_plane() {
    let folder = Scratch::new();
    let (model, svg, told) = (folder.join("box.json"), folder.join("box.svg"), folder.join("told.json"));
    // A cube of 2 about the origin: the plane across its diagonal through the centre gives a regular hexagon with sides of sqrt(2).
    let vertices: Vec<[f64; 3]> = (0..8).map(|code| std::array::from_fn(|axis| if code >> axis & 1 == 1 { 1.0 } else { -1.0 })).collect();
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    write(&model, &serde_json::json!({ "family": "mesh", "vertices": vertices, "faces": faces }));
    let arguments = ["slice", "--tolerance", "0.001", "--normal", "1,1,1", "--at", "0,9", "-o"].map(std::ffi::OsStr::new);
    binary::succeed(arguments.into_iter().chain([svg.as_os_str(), "--certificate".as_ref(), told.as_os_str(), model.as_os_str()]));
    let certificate = certificate(&told);
    let area = certificate["sections"]["planes"][0]["area_mm2"].as_f64().unwrap();
    assert!((area - 3.0 * 3.0_f64.sqrt()).abs() < 1e-5, "{area}");
    assert_eq!(certificate["sections"]["planes"][1]["polygons"], 0);
    assert!(certificate["warnings"][0].as_str().unwrap().contains("1 of 2 sections are empty"), "{}", certificate["warnings"]);
}

/// Planes are cut where they leave the solid above them: at its bottom, not at its top.
#[test]
fn what_is_empty_or_counts_twice_is_said() {
    let folder = Scratch::new();
    let (model, svg, told) = (folder.join("cubes.json"), folder.join("cubes.svg"), folder.join("told.json"));
    let cut = |cubes: &[[f64; 2]], words: [&str; 2]| {
        let outward = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let corner = |ends: &[f64; 2], code: usize| [0, 1, 2].map(|axis| ends[code >> axis & 1]);
        let vertices: Vec<[f64; 3]> = cubes.iter().flat_map(|ends| (0..8).map(move |code| corner(ends, code))).collect();
        let faces: Vec<[usize; 4]> = (0..cubes.len()).flat_map(|cube| outward.map(|face| face.map(|k| 8 * cube + k))).collect();
        write(&model, &serde_json::json!({ "family": "mesh", "vertices": vertices, "faces": faces }));
        let words = ["slice", "--tolerance", "0.001", words[0], words[1], "-o"].map(std::ffi::OsStr::new);
        binary::succeed(words.into_iter().chain([svg.as_os_str(), "--certificate".as_ref(), told.as_os_str(), model.as_os_str()]));
        let certificate = certificate(&told);
        let warnings =
            certificate["warnings"].as_array().unwrap().iter().map(|words| words.as_str().unwrap().to_owned()).collect::<Vec<_>>();
        (certificate["sections"]["planes"].clone(), warnings.join("; "))
    };
    let (planes, said) = cut(&[[0.0, 1.0]], ["--at", "0,1"]);
    assert_eq!((planes[0]["area_mm2"].as_f64(), planes[1]["polygons"].as_u64()), (Some(1.0), Some(0)));
    assert!(said.contains("or only touch it"), "{said}");
    let (planes, said) = cut(&[[0.0, 1.0]], ["--step", "3"]);
    assert_eq!(planes.as_array().map(Vec::len), Some(0));
    assert!(said.contains("smaller step"), "{said}");
    let (planes, said) = cut(&[[0.0, 4.0], [3.0, 1.0]], ["--at", "2"]);
    assert!((planes[0]["area_mm2"].as_f64().unwrap() - 12.0).abs() < 1e-6 && !said.contains("counts"), "{planes} {said}");
    let (_, said) = cut(&[[0.0, 4.0], [1.0, 3.0]], ["--at", "2"]);
    assert!(said.contains("counts 2 times"), "{said}");
    let (_, said) = cut(&[[0.0, 2.0], [1.0, 3.0]], ["--at", "1.5"]);
    assert!(said.contains("counts twice"), "{said}");
}

/// Cubes from 0 to 1 and from 1 to 2 along all axes, with one vertex for the corner that both have: at that corner's height the upper one begins.
#[test]
fn solids_that_share_a_vertex_are_cut() {
    let folder = Scratch::new();
    let (model, svg, told) = (folder.join("cubes.json"), folder.join("cubes.svg"), folder.join("told.json"));
    let corner = |low: f64, code: usize| [0, 1, 2].map(|axis| low + if code >> axis & 1 == 1 { 1.0 } else { 0.0 });
    let vertices: Vec<[f64; 3]> = (0..8).map(|code| corner(0.0, code)).chain((1..8).map(|code| corner(1.0, code))).collect();
    let outward = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let faces: Vec<[usize; 4]> = outward.into_iter().chain(outward.map(|face| face.map(|k| k + 7))).collect();
    write(&model, &serde_json::json!({ "family": "mesh", "vertices": vertices, "faces": faces }));
    let words = ["slice", "--tolerance", "0.001", "--at", "0.5,1,1.5", "-o"].map(std::ffi::OsStr::new);
    binary::succeed(words.into_iter().chain([svg.as_os_str(), "--certificate".as_ref(), told.as_os_str(), model.as_os_str()]));
    let certificate = certificate(&told);
    for plane in certificate["sections"]["planes"].as_array().unwrap() {
        assert!((plane["area_mm2"].as_f64().unwrap() - 1.0).abs() < 1e-5, "{plane}");
        assert_eq!((plane["polygons"].as_u64(), plane["holes"].as_u64()), (Some(1), Some(0)), "{plane}");
    }
    assert_eq!(certificate["components"], 2);
    // As a union with a cube elsewhere.
    let (other, part) = (folder.join("other.json"), folder.join("part.stl"));
    let apart: Vec<[f64; 3]> = (0..8).map(|code| corner(5.0, code)).collect();
    write(&other, &serde_json::json!({ "family": "mesh", "vertices": apart, "faces": outward }));
    let words = ["intersect", "--operation", "union", "--tolerance", "0.001", "-o"].map(std::ffi::OsStr::new);
    let paths = [part.as_os_str(), "--certificate".as_ref(), told.as_os_str(), model.as_os_str(), other.as_os_str()];
    binary::succeed(words.into_iter().chain(paths));
    let bounds = serde_json::from_slice::<Value>(&std::fs::read(&told).unwrap()).unwrap()["volume_mm3"].clone();
    let [low, high] = [0, 1].map(|end| bounds[end].as_f64().unwrap());
    assert!(low <= 3.0 && 3.0 <= high && high - low < 0.01, "{bounds}");
}

/// The picture beside a drawing shows the sections: it is that of no other planes, and of a drawing without any it says that there is nothing to see.
#[test]
fn a_picture_of_sections() {
    let folder = Scratch::new();
    let (model, svg, png) = (folder.join("ball.json"), folder.join("ball.svg"), folder.join("ball.png"));
    write(&model, &serde_json::json!({ "family": "mesh", "vertices": [[10, 20, 30]], "faces": [[0]] }));
    let words = |planes: [&'static str; 2]| {
        let words = ["slice", "--tolerance", "0.1", "--radius", "5", planes[0], planes[1], "-o"].map(std::ffi::OsString::from);
        words.into_iter().chain([svg.clone().into(), "--preview".into(), png.clone().into(), model.clone().into()])
    };
    let pictured = |planes| {
        binary::succeed(words(planes));
        let bytes = std::fs::read(&png).unwrap();
        // Width and height stand behind the signature and the name of the first chunk.
        let side = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!((&bytes[..8], side(16), side(20)), (&b"\x89PNG\r\n\x1a\n"[..], 1024, 1024));
        bytes
    };
    let (few, many) = (pictured(["--at", "30"]), pictured(["--step", "1"]));
    assert!(svg.exists() && few != many);
    std::fs::remove_file(&png).unwrap();
    let output = binary::run(words(["--at", "90"]));
    assert!(output.status.code() == Some(3) && !png.exists(), "{output:?}");
}

/// The face at the top of the lower cube is tilted by the last bits of its coordinates, as the faces of a boolean's result may be: what a plane at its height cuts is told to be in doubt.
#[test]
fn planes_in_faces_that_are_level_but_for_rounding_are_told() {
    let folder = Scratch::new();
    let (model, svg, told) = (folder.join("step.json"), folder.join("step.svg"), folder.join("told.json"));
    let said = |tilt: f64, at: &str| {
        let mut vertices: Vec<[f64; 3]> = (0..8).map(|code| [0, 1, 2].map(|axis| 5.0 * f64::from(code >> axis & 1))).collect();
        vertices[7][2] += tilt;
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        write(&model, &serde_json::json!({ "family": "mesh", "vertices": vertices, "faces": faces }));
        let words = ["slice", "--tolerance", "0.001", "--at", at, "-o"].map(std::ffi::OsStr::new);
        binary::succeed(words.into_iter().chain([svg.as_os_str(), "--certificate".as_ref(), told.as_os_str(), model.as_os_str()]));
        certificate(&told)["warnings"].to_string()
    };
    // A unit in the last place of single precision at 5 is 4.8e-7.
    let tilted = said(4.8e-7, "2.5,5");
    assert!(tilted.contains("1 of 2 planes, the first at 5 mm, lie in faces that are level but for rounding"), "{tilted}");
    for (tilt, at) in [(0.0, "0,5"), (4.8e-7, "2.5,4.9"), (0.01, "5.005")] {
        let said = said(tilt, at);
        assert!(!said.contains("but for rounding"), "{said}");
    }
}

#[test]
fn what_cannot_be_cut_is_refused() {
    let folder = Scratch::new();
    let (model, out) = (folder.join("point.json"), folder.join("out.svg"));
    write(&model, &serde_json::json!({ "family": "mesh", "vertices": [[0, 0, 0]], "faces": [[0]] }));
    let code = |words: &[&str], out: &Path| {
        let arguments = words.iter().map(std::ffi::OsStr::new).chain(["-o".as_ref(), out.as_os_str(), model.as_os_str()]);
        let output = binary::run(arguments);
        assert!(!out.exists());
        (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (exit, said) = code(&["slice", "--tolerance", "0.1", "--at", "0"], &out);
    assert!(exit == 3 && said.contains("radius"), "{exit} {said}");
    let (exit, said) = code(&["slice", "--tolerance", "0.1", "--radius", "1", "--normal", "0,0,0", "--at", "0"], &out);
    assert!(exit == 3 && said.contains("normal"), "{exit} {said}");
    let (exit, said) = code(&["slice", "--tolerance", "0.1", "--radius", "1", "--step", "1e-9"], &out);
    assert!(exit == 4 && said.contains("step_mm"), "{exit} {said}");
    let (exit, _) = code(&["slice", "--tolerance", "0.1", "--radius", "1"], &out);
    assert_eq!(exit, 2);
    let (exit, said) = code(&["slice", "--tolerance", "0.1", "--radius", "1", "--at", "0"], &folder.join("out.stl"));
    assert!(exit != 0 && said.contains("SVG"), "{exit} {said}");
}

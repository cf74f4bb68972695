//! The same bytes for one thread and for two, and for a second run.

use std::fs;

use lacuna_tests::support::binary::succeed;
use lacuna_tests::support::cases::{self, Case};
use lacuna_tests::support::scratch::Scratch;

const CASES: [&str; 6] =
    ["ifs/koch_curve", "ifs/sierpinski_triangle_5", "ifs/takagi_surface", "curves/circle", "meshes/dodecahedron", "bcifs/plate"];

/// File and certificate of a case.
fn make(case: &Case, format: &str, threads: &str) -> (Vec<u8>, String) {
    let scratch = Scratch::new();
    let (file, certificate) = (scratch.join(&format!("part.{format}")), scratch.join("certificate.json"));
    let expected = &case.expected;
    succeed([
        "solidify".into(),
        case.model().into_os_string(),
        "--tolerance".into(),
        expected.tolerance_mm.to_string().into(),
        "--radius".into(),
        expected.radius_mm.unwrap().to_string().into(),
        "--threads".into(),
        threads.into(),
        "-o".into(),
        file.clone().into_os_string(),
        "--certificate".into(),
        certificate.clone().into_os_string(),
    ]);
    (fs::read(file).unwrap(), fs::read_to_string(certificate).unwrap())
}

#[test]
fn one_thread_and_two_give_the_same_bytes() {
    for name in CASES {
        let case = cases::named(name);
        for format in ["stl", "3mf"] {
            let (one, two) = (make(&case, format, "1"), make(&case, format, "2"));
            assert!(one.0.len() > 1000, "{name}: {} bytes", one.0.len());
            assert!(one.0 == two.0, "{name}.{format} depends on the number of threads");
            assert_eq!(one.1, two.1, "{name}: the certificate depends on the number of threads");
        }
    }
}

#[test]
fn a_second_run_gives_the_same_bytes() {
    for name in CASES {
        let case = cases::named(name);
        assert!(make(&case, "3mf", "2") == make(&case, "3mf", "2"), "{name} depends on the run");
    }
}

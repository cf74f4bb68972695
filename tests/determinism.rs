//! The same bytes for one thread and for two, and for a second run.

use std::fs;

use lacuna_tests::support::binary::succeed;
use lacuna_tests::support::cases::{self, Case};
use lacuna_tests::support::scratch::Scratch;

const CASES: [&str; 6] =
    ["ifs/koch_curve", "ifs/sierpinski_triangle_5", "ifs/takagi_surface", "curves/circle", "meshes/dodecahedron", "bcifs/plate"];

/// STL, 3MF and certificate of a case.
fn make(case: &Case, threads: &str) -> [Vec<u8>; 3] {
    let scratch = Scratch::new();
    let files = ["part.stl", "part.3mf", "certificate.json"].map(|name| scratch.join(name));
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
        files[0].clone().into_os_string(),
        "-o".into(),
        files[1].clone().into_os_string(),
        "--certificate".into(),
        files[2].clone().into_os_string(),
    ]);
    files.map(|file| fs::read(file).unwrap())
}

#[test]
fn one_thread_and_two_give_the_same_bytes() {
    for name in CASES {
        let case = cases::named(name);
        let (one, two) = (make(&case, "1"), make(&case, "2"));
        assert!(one[0].len() > 1000, "{name}: {} bytes", one[0].len());
        for (what, (a, b)) in ["STL", "3MF", "certificate"].iter().zip(one.iter().zip(&two)) {
            assert!(a == b, "{name}: the {what} depends on the number of threads");
        }
    }
}

#[test]
fn a_second_run_gives_the_same_bytes() {
    for name in CASES {
        let case = cases::named(name);
        assert!(make(&case, "2") == make(&case, "2"), "{name} depends on the run");
    }
}

//! Every case of `fixtures/`, through the real command, and the command's own honesty.

use std::fs;

use lacuna_tests::support::binary::run;
use lacuna_tests::support::cases;
use lacuna_tests::support::python::system_python;
use lacuna_tests::support::root;
use lacuna_tests::support::scratch::Scratch;

#[test]
fn every_case_holds() {
    let count = cases::all().len();
    assert!(count >= 60, "only {count} cases were found");
    let output = run(["verify".as_ref(), cases::folder().as_os_str()]);
    let words = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}\n{words}", output.status);
    for case in cases::all() {
        let name = case.folder.file_name().unwrap().to_string_lossy().into_owned();
        assert!(words.contains(&name), "{} was not verified:\n{words}", case.name);
    }
}

/// A copy of the case with one line of its expectations replaced.
fn altered(name: &str, from: &str, to: &str) -> Scratch {
    let case = cases::named(name);
    let scratch = Scratch::new();
    fs::create_dir(scratch.join("case")).unwrap();
    fs::copy(case.model(), scratch.join("case/model.json")).unwrap();
    let expected = fs::read_to_string(case.folder.join("expected.toml")).unwrap();
    let changed = expected.replacen(from, to, 1);
    assert_ne!(expected, changed, "{name} has no line {from:?}");
    fs::write(scratch.join("case/expected.toml"), changed).unwrap();
    scratch
}

#[track_caller]
fn assert_fails(scratch: &Scratch, word: &str) {
    let output = run(["verify".as_ref(), scratch.path().as_os_str()]);
    let words = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{words}");
    assert!(words.contains(word), "{word:?} is not named:\n{words}");
}

#[test]
fn the_unaltered_copy_holds() {
    let scratch = altered("meshes/point", "kind = ", "kind  = ");
    let output = run(["verify".as_ref(), scratch.path().as_os_str()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
}

#[test]
fn a_wrong_count_is_noticed() {
    assert_fails(&altered("meshes/point", "genus = 0", "genus = 1"), "genus");
}

#[test]
fn a_wrong_volume_is_noticed() {
    assert_fails(&altered("meshes/point", "value = 3", "value = 4"), "volume_mm3");
}

#[test]
fn a_volume_outside_of_its_band_is_noticed() {
    assert_fails(&altered("meshes/point", "upper = 3", "upper = 1"), "mesh_volume_mm3");
}

#[test]
fn a_wrong_box_is_noticed() {
    assert_fails(&altered("meshes/point", "lower = [-1.0", "lower = [-1.2"), "bbox");
}

#[test]
fn a_member_that_no_certificate_has_fails() {
    assert_fails(&altered("meshes/point", "genus = 0", "beauty = 0"), "beauty");
}

#[test]
fn a_wrong_solution_is_noticed() {
    let corner_cutting = "bcifs/free_corner_cutting";
    assert_fails(&altered(corner_cutting, "degrees_of_freedom = 2", "degrees_of_freedom = 3"), "degrees_of_freedom");
    assert_fails(&altered(corner_cutting, "value = 0.625", "value = 0.626"), "operator/0/0");
    assert_fails(&altered(corner_cutting, "constant = \"1\"", "constant = \"2\""), "constant");
    assert_fails(&altered(corner_cutting, "{a = \"-1\"}", "{a = \"-1\", b = \"1\"}"), "coefficients");
    assert_fails(&altered(corner_cutting, "a = 0.375", "c = 0.375"), "solve.unknown-name");
    assert_fails(&altered("bcifs/free_contradiction", ", \"/shape/relations/1\"", ""), "refused.pointers");
}

#[test]
fn an_expectation_that_cannot_be_read_fails() {
    assert_fails(&altered("meshes/point", "genus = 0", "genus = "), "case");
    assert_fails(&altered("meshes/point", "[exact]", "[exactly]"), "exactly");
}

#[test]
fn a_missing_model_fails() {
    let scratch = altered("meshes/point", "kind = ", "kind  = ");
    fs::remove_file(scratch.join("case/model.json")).unwrap();
    assert_fails(&scratch, "model.json");
}

#[test]
fn a_job_that_should_be_refused_and_is_not_fails() {
    let scratch = altered("meshes/point", "kind = ", "kind  = ");
    let expected = "about = \"x\"\nkind = \"solidify\"\ntolerance_mm = 0.1\nradius_mm = 2.0\n[refused]\ncode = \"mesh.any\"\n";
    fs::write(scratch.join("case/expected.toml"), expected).unwrap();
    assert_fails(&scratch, "refused");
}

#[test]
fn a_folder_without_cases_is_an_error() {
    let scratch = Scratch::new();
    let output = run(["verify".as_ref(), scratch.path().as_os_str()]);
    assert!(!output.status.success());
}

#[test]
fn the_cases_are_what_the_formulas_say() {
    let output = system_python().arg(root().join("fixtures/derive")).arg("--check").output().unwrap();
    assert!(output.status.success(), "{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
}

#[test]
fn every_expectation_has_a_source() {
    for case in cases::all() {
        let expected = &case.expected;
        assert!(expected.about.len() > 10, "{}", case.name);
        let sources = expected.scalar.values().flat_map(|s| [&s.source, &s.reason]);
        let sources = sources.chain(expected.exact_box.iter().flat_map(|b| [&b.source, &b.reason]));
        for words in sources.chain(expected.entry.values().map(|entry| &entry.source)) {
            assert!(words.len() >= 5, "{}: {words:?} is no source", case.name);
        }
        if !expected.exact.is_empty() {
            let source = expected.exact.get("source").and_then(toml::Value::as_str).unwrap_or("");
            assert!(source.len() >= 5, "{}: [exact] has no source", case.name);
        }
        let stated = !expected.exact.is_empty() || !expected.scalar.is_empty() || expected.exact_box.is_some() || !expected.entry.is_empty();
        assert_ne!(stated, expected.refused.is_some(), "{} states a result or a refusal", case.name);
    }
}

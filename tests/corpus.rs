//! Every case of `fixtures/`, through the real command, and the command's own honesty.

use std::fs;

use lacuna_tests::support::binary::{run, succeed};
use lacuna_tests::support::cases;
use lacuna_tests::support::python::system_python;
use lacuna_tests::support::root;
use lacuna_tests::support::scratch::Scratch;
use serde_json::{Value, json};

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
        let sound = |point: &cases::Point| point.relative >= 0.0 && point.relative < 1e-6 && point.value.iter().all(|x| x.is_finite());
        assert!(expected.point.values().all(sound), "{}", case.name);
        assert!(!expected.stability || expected.kind == "solidify", "{}: only solidify examines the stability", case.name);
        let sources = expected.scalar.values().flat_map(|s| [&s.source, &s.reason]);
        let sources = sources.chain(expected.exact_box.iter().flat_map(|b| [&b.source, &b.reason]));
        let sources =
            sources.chain(expected.entry.values().map(|entry| &entry.source)).chain(expected.point.values().map(|point| &point.source));
        for words in sources {
            assert!(words.len() >= 5, "{}: {words:?} is no source", case.name);
        }
        if !expected.exact.is_empty() {
            let source = expected.exact.get("source").and_then(toml::Value::as_str).unwrap_or("");
            assert!(source.len() >= 5, "{}: [exact] has no source", case.name);
        }
        let stated = !expected.exact.is_empty()
            || !expected.scalar.is_empty()
            || expected.exact_box.is_some()
            || !expected.entry.is_empty()
            || !expected.point.is_empty();
        assert_ne!(stated, expected.refused.is_some(), "{} states a result or a refusal", case.name);
    }
}

/// The words and the exit code of a command that refuses.
fn refusal(arguments: &[&str]) -> (Option<i32>, String) {
    let output = run(arguments);
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn the_solve_command_writes_models_that_validate() {
    let scratch = Scratch::new();
    let model = cases::named("bcifs/free_corner_cutting").model();
    let (model, filled) = (model.to_str().unwrap(), scratch.join("filled.json"));
    let space: Value = serde_json::from_slice(&succeed(["solve", model, "--set", "a=0.375", "-o", filled.to_str().unwrap()])).unwrap();
    assert_eq!((&space["degrees_of_freedom"], &space["parameters"][0]["name"]), (&json!(2), &json!("a")));
    assert!(space.get("model").is_none());
    let report: Value = serde_json::from_slice(&succeed(["validate".as_ref(), filled.as_os_str()])).unwrap();
    assert_eq!((&report["valid"], &report["degrees_of_freedom"]), (&json!(true), &json!(0)));
    // on stdout the model stands alone, for the next command
    let piped = succeed(["--quiet", "solve", model, "--set", "a=0.375", "-o", "-"]);
    assert_eq!(piped, fs::read(&filled).unwrap());
    let whole: Value = serde_json::from_slice(&succeed(["solve", model, "--set", "a=0.375", "--json"])).unwrap();
    assert_eq!(whole["model"], serde_json::from_slice::<Value>(&piped).unwrap());
}

#[test]
fn the_solve_command_says_what_is_wrong() {
    let path = |name: &str| cases::named(name).model().to_str().unwrap().to_owned();
    let corner_cutting = path("bcifs/free_corner_cutting");
    for (arguments, code, word) in [
        (vec!["--set", "c=1"], 2, "solve.unknown-name"),
        (vec!["--set", "a=NaN"], 2, "not a finite number"),
        (vec!["--set", "a"], 2, "NAME=VALUE"),
        (vec!["--set", "a=1", "--set", "a=2"], 2, "two values"),
        (vec!["--json", "-o", "-"], 2, "--json"),
        (vec!["--set", "a=0.25", "--set", "curve.0[0][0]=0.3"], 3, "'a' is chosen to be 0.25"),
    ] {
        let (exit, words) = refusal(&[&["solve", &corner_cutting], arguments.as_slice()].concat());
        assert!(exit == Some(code) && words.contains(word), "{arguments:?}: {exit:?} {words}");
    }
    let (exit, words) = refusal(&["solve", &path("bcifs/free_contradiction")]);
    assert!(exit == Some(3) && words.contains("/shape/relations/1") && words.contains("automaton.contradiction"), "{words}");
}

#[test]
fn validate_counts_the_degrees_of_freedom_of_what_is_unknown() {
    for (name, valid, degrees, word) in [
        ("bcifs/free_curve_3_1", false, json!(6), "6 degrees of freedom"),
        ("bcifs/free_catmull_clark", false, json!(4), "4 degrees of freedom"),
        ("bcifs/free_doo_sabin", true, json!(0), ""),
        ("bcifs/free_contradiction", false, Value::Null, "contradict each other"),
        ("bcifs/parabola", true, json!(0), ""),
    ] {
        let output = run(["validate".as_ref(), cases::named(name).model().as_os_str()]);
        assert_eq!(output.status.code(), Some(if valid { 0 } else { 3 }), "{name}");
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!((&report["valid"], report.get("degrees_of_freedom").unwrap_or(&Value::Null)), (&json!(valid), &degrees), "{report}");
        assert!(report["diagnostics"].to_string().contains(word), "{report}");
    }
}

//! `verify`, `bless` and `diff` as the continuous integration of another repository uses them: a folder with cases of its own.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use lacuna_tests::support::binary::{lacuna, succeed};
use lacuna_tests::support::cases;
use lacuna_tests::support::root;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;
use serde_json::{Value, json};

/// Another repository: two parts that nobody has a formula for.
fn repository() -> Scratch {
    let scratch = Scratch::new();
    for (name, radius) in [("handle", 1.5), ("rail", 2.0)] {
        let folder = scratch.join("parts").join(name);
        fs::create_dir_all(&folder).unwrap();
        fs::copy(cases::named("meshes/segment").model(), folder.join("model.json")).unwrap();
        let case = format!("about = \"the {name} of the drawer\"\nkind = \"solidify\"\ntolerance_mm = 0.1\nradius_mm = {radius}\n");
        fs::write(folder.join("expected.toml"), case).unwrap();
    }
    scratch
}

fn at(folder: &Path, server: Option<&Service>, arguments: &[&str]) -> Output {
    let mut command = Command::new(lacuna());
    command.env_remove("LACUNA_SERVER").current_dir(folder).args(arguments);
    if let Some(service) = server {
        command.args(["--server", &format!("http://{}", service.address)]);
    }
    command.output().unwrap()
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

#[track_caller]
fn ends_with(output: &Output, code: i32, word: &str) {
    assert_eq!(output.status.code(), Some(code), "{}", words(output));
    assert!(words(output).contains(word), "{word:?} is not said:\n{}", words(output));
}

fn edit(path: &Path, change: impl FnOnce(&mut Value)) {
    let mut value: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    change(&mut value);
    fs::write(path, serde_json::to_vec(&value).unwrap()).unwrap();
}

#[test]
fn a_repository_blesses_its_parts_and_learns_when_they_change() {
    let scratch = repository();
    let folder = scratch.path();
    // A case that states nothing and that nobody has approved of shows nothing.
    ends_with(&at(folder, None, &["verify", "parts"]), 1, "or a blessing");
    ends_with(&at(folder, None, &["bless", "parts"]), 2, "--reason");
    ends_with(&at(folder, None, &["bless", "parts", "--reason", " "]), 2, "--reason is empty");
    assert!(!folder.join("parts/rail/blessed.json").exists());
    // A blessing never counts as a verification.
    ends_with(&at(folder, None, &["bless", "parts", "--reason", "measured on the first print"]), 1, "no verification");
    let blessed: Value = serde_json::from_slice(&fs::read(folder.join("parts/rail/blessed.json")).unwrap()).unwrap();
    assert_eq!((&blessed["reason"], &blessed["version"]), (&json!("measured on the first print"), &json!("0.1.0")));
    assert!(blessed["blessed"].as_str().unwrap().ends_with('Z') && blessed["certificate"]["components"] == 1);

    let output = at(folder, None, &["verify", "parts", "--junit", "report.xml"]);
    ends_with(&output, 0, "2 cases, 0 failed");
    assert!(fs::read_to_string(folder.join("report.xml")).unwrap().contains("tests=\"2\" failures=\"0\""));
    // The same work by the same version is the same to the last bit.
    let rail = folder.join("parts/rail/blessed.json");
    edit(&rail, |value| value["certificate"]["triangles"] = json!(value["certificate"]["triangles"].as_u64().unwrap() + 1));
    ends_with(&at(folder, None, &["verify", "parts"]), 1, "blessed triangles");
    // Another version may use other triangles, but not another shape.
    edit(&rail, |value| value["certificate"]["kernel_version"] = json!("0.0.9"));
    ends_with(&at(folder, None, &["verify", "parts"]), 0, "0 failed");
    edit(&rail, |value| value["certificate"]["volume_mm3"] = json!([1.0, 2.0]));
    let output = at(folder, None, &["verify", "parts", "--junit", "report.xml"]);
    ends_with(&output, 1, "blessed volume_mm3");
    let report = fs::read_to_string(folder.join("report.xml")).unwrap();
    assert!(report.contains("failures=\"1\"") && report.contains("blessed volume_mm3"), "{report}");
    // What changed is told when it is approved of, and then it holds.
    let output = at(folder, None, &["bless", "parts", "--filter", "rail", "--reason", "the rail is right after all"]);
    ends_with(&output, 1, "APART");
    ends_with(&at(folder, None, &["verify", "parts"]), 0, "0 failed");
    // What a case states from a source of its own no blessing changes.
    let expected = folder.join("parts/rail/expected.toml");
    fs::write(&expected, fs::read_to_string(&expected).unwrap() + "[exact]\ngenus = 1\nsource = \"wishes\"\n").unwrap();
    let before = fs::read(&rail).unwrap();
    ends_with(&at(folder, None, &["bless", "parts", "--reason", "please"]), 1, "NOT BLESSED  rail: genus is 0");
    assert_eq!(before, fs::read(&rail).unwrap());
    // Half a blessing is a failed case.
    fs::write(&rail, &before[..before.len() / 2]).unwrap();
    ends_with(&at(folder, None, &["verify", "parts"]), 1, "blessed.json");
}

/// The rows of the one case of a report.
fn rows(output: &Output) -> Vec<Value> {
    let report: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {}", words(output)));
    report["cases"][0]["rows"].as_array().unwrap().clone()
}

#[track_caller]
fn row<'r>(rows: &'r [Value], field: &str) -> &'r Value {
    rows.iter().find(|row| row["field"] == field).unwrap_or_else(|| panic!("{field} is not among {rows:?}"))
}

/// A part in a folder of its own, with its expectations, and what its text is made of it.
fn rewrite(path: &Path, change: impl FnOnce(String) -> String) {
    let before = fs::read_to_string(path).unwrap();
    let after = change(before.clone());
    assert_ne!(before, after);
    fs::write(path, after).unwrap();
}

#[test]
fn shapes_bytes_and_times_are_stated_where_that_is_asked_for() {
    let scratch = repository();
    let folder = scratch.path();
    let expected = folder.join("parts/rail/expected.toml");
    let before = fs::read_to_string(&expected).unwrap();
    let bless = |more: &[&str]| at(folder, None, &[&["bless", "parts", "--filter", "rail", "--reason", "as \"drawn\""], more].concat());
    ends_with(&bless(&[]), 1, "1 of 1");
    assert_eq!(fs::read_to_string(&expected).unwrap(), before, "nobody asked for more");
    ends_with(&bless(&["--digest", "xyz"]), 2, "xyz");
    ends_with(&bless(&["--shape", "0"]), 2, "--shape");
    ends_with(&bless(&["--shape", "0.8", "--digest", "stl", "--digest", "3mf", "--perf", "600"]), 1, "[shape], [digest], [perf] written");
    let stated = fs::read_to_string(&expected).unwrap();
    assert!(stated.starts_with(&before), "{stated}");
    let read: toml::Table = toml::from_str(&stated).unwrap();
    for table in ["shape", "digest", "perf"] {
        assert_eq!(read[table]["reason"].as_str(), Some("as \"drawn\""), "{stated}");
        assert!(read[table]["source"].as_str().unwrap().contains("kernel 0.1.0, 20"), "{stated}");
    }
    assert_eq!(read["perf"]["gating"].as_bool(), Some(false));
    let output = at(folder, None, &["verify", "parts", "--filter", "rail", "--json"]);
    ends_with(&output, 0, "");
    let all = rows(&output);
    for field in ["shape", "digest stl", "digest 3mf"] {
        assert_eq!((&row(&all, field)["standing"], &row(&all, field)["passed"]), (&json!("passed"), &json!(true)));
    }
    // The coarse reference is as far as its tolerance at most, and not the part itself.
    let distance = row(&all, "shape")["difference"].as_f64().unwrap();
    assert!(distance > 0.01 && distance <= 0.8, "{distance}");
    assert_eq!(row(&all, "perf seconds")["standing"], "reported");
    // Asked for once more they take the place of what was there.
    ends_with(&bless(&["--digest", "stl", "--perf", "700"]), 1, "[digest], [perf] written");
    let again: toml::Table = toml::from_str(&fs::read_to_string(&expected).unwrap()).unwrap();
    assert_eq!((again["perf"]["seconds"].as_float(), &again["shape"]), (Some(700.0), &read["shape"]));
    assert_eq!(again["digest"]["outputs"].as_table().unwrap().len(), 1);
}

/// The tables of one part, blessed, to be changed.
fn stated() -> (Scratch, std::path::PathBuf) {
    let scratch = repository();
    let words = ["bless", "parts", "--filter", "rail", "--reason", "r", "--shape", "0.8", "--digest", "stl", "--perf", "600"];
    ends_with(&at(scratch.path(), None, &words), 1, "written");
    let expected = scratch.join("parts/rail/expected.toml");
    (scratch, expected)
}

#[test]
fn another_shape_other_bytes_and_another_version_are_told_apart() {
    let (scratch, expected) = stated();
    let folder = scratch.path();
    let verify = |more: &[&str]| at(folder, None, &[&["verify", "parts", "--filter", "rail"], more].concat());
    let original = fs::read_to_string(&expected).unwrap();
    let digest = original.split("stl = \"sha256:").nth(1).unwrap()[..64].to_owned();
    // Other bytes by the same version.
    rewrite(&expected, |text| text.replace(&digest, &"0".repeat(64)));
    ends_with(&verify(&["--junit", "report.xml"]), 1, "digest stl");
    let report = fs::read_to_string(scratch.join("report.xml")).unwrap();
    assert!(report.contains("failures=\"1\"") && report.contains("digest stl"), "{report}");
    // By another version they are not compared, which is neither a pass nor a failure, and is told by every kind of report.
    rewrite(&expected, |text| text.replace("kernel_version = \"0.1.0\"", "kernel_version = \"0.0.9\""));
    let output = verify(&["--json", "--junit", "report.xml"]);
    ends_with(&output, 0, "");
    let all = rows(&output);
    let told = row(&all, "digest stl");
    assert_eq!((&told["standing"], &told["passed"]), (&json!("not_compared"), &json!(false)), "{told}");
    ends_with(&verify(&[]), 0, "1 comparisons not made");
    ends_with(&verify(&[]), 0, "not compared: made by kernel 0.1.0, and the digest is of 0.0.9");
    let report = fs::read_to_string(scratch.join("report.xml")).unwrap();
    assert!(report.contains("failures=\"0\"") && report.contains("<system-out>") && report.contains("not compared"), "{report}");
    // Nearer than the reference is, and another part than the one that was approved of.
    fs::write(&expected, original.replace("within_mm = 0.8", "within_mm = 0.0001")).unwrap();
    ends_with(&verify(&[]), 1, "within 0.0001 mm of reference.stl");
    fs::write(&expected, original.replace("radius_mm = 2", "radius_mm = 3")).unwrap();
    let output = verify(&["--json"]);
    ends_with(&output, 1, "");
    let all = rows(&output);
    let shape = row(&all, "shape");
    assert_eq!(shape["standing"], "failed");
    assert!(shape["difference"].as_f64().unwrap() > 0.8 && shape["got"].as_str().unwrap().starts_with('['), "{shape}");
    // What is not there has not passed.
    fs::write(&expected, &original).unwrap();
    fs::remove_file(scratch.join("parts/rail/reference.stl")).unwrap();
    ends_with(&verify(&[]), 1, "reference.stl");
}

#[test]
fn time_decides_only_where_the_file_says_so_and_tables_are_held_to_their_grammar() {
    let (scratch, expected) = stated();
    let verify = || at(scratch.path(), None, &["verify", "parts", "--filter", "rail"]);
    let original = fs::read_to_string(&expected).unwrap();
    // No machine does it in so short a time.
    let hurried = original.replace("seconds = 600.0", "seconds = 1e-9");
    fs::write(&expected, &hurried).unwrap();
    ends_with(&verify(), 0, "OVER THE BUDGET");
    fs::write(&expected, hurried.replace("gating = false", "gating = true")).unwrap();
    ends_with(&verify(), 1, "perf seconds");
    // Whether it does is kept by a blessing, which never makes it so.
    let words = ["bless", "parts", "--filter", "rail", "--reason", "r", "--perf", "500"];
    ends_with(&at(scratch.path(), None, &words), 1, "[perf] written");
    assert!(fs::read_to_string(&expected).unwrap().contains("gating = true"));
    ends_with(&verify(), 0, "0 failed");
    for (from, to, word) in [
        ("seconds = 600.0", "seconds = nan", "a time above zero"),
        ("within_mm = 0.8", "within_mm = inf", "a length in mm above zero"),
        ("within_mm = 0.8", "within = 0.8", "within"),
        ("reference = \"reference.stl\"", "reference = \"../reference.stl\"", "beside expected.toml"),
        ("[shape]", "[shapes]", "shapes"),
        ("sha256:", "md5:", "64 hex digits"),
        ("gating = false", "gating = \"no\"", "gating"),
    ] {
        fs::write(&expected, original.replacen(from, to, 1)).unwrap();
        assert_ne!(original, fs::read_to_string(&expected).unwrap(), "{from}");
        ends_with(&verify(), 1, word);
    }
}

#[test]
fn a_service_verifies_as_this_machine_does() {
    let (scratch, data) = (repository(), Scratch::new());
    let service = Service::start_with(data.path(), &[("LACUNA_SUBMISSIONS_PER_MINUTE", "100000")]);
    ends_with(&at(scratch.path(), Some(&service), &["bless", "parts", "--reason", "as drawn"]), 1, "2 of 2 cases");
    ends_with(&at(scratch.path(), None, &["verify", "parts"]), 0, "0 failed");
    ends_with(&at(scratch.path(), Some(&service), &["verify", "parts"]), 0, "0 failed");
    let posted = service.get("/v1/jobs").json()["items"].as_array().unwrap().len();
    assert_eq!(posted, 4, "the service did not do the work");
    edit(&scratch.join("parts/rail/blessed.json"), |value| value["certificate"]["genus"] = json!(7));
    ends_with(&at(scratch.path(), Some(&service), &["verify", "parts"]), 1, "blessed genus");
    // Refusals, solutions, points at addresses and jobs with files, from our own cases.
    for case in ["malformed", "bcifs/free", "curves/beta_spline", "meshes", "jobs/boxes", "jobs/bracket"] {
        let here = at(&root(), None, &["verify", "fixtures", "--filter", case, "--json"]);
        let there = at(&root(), Some(&service), &["verify", "fixtures", "--filter", case, "--json"]);
        assert!(here.status.success() && there.status.success(), "{case}: {}\n{}", words(&here), String::from_utf8_lossy(&there.stderr));
        let rows = |output: &Output| -> Vec<Value> {
            let report: Value = serde_json::from_slice(&output.stdout).unwrap();
            let rows = report["cases"].as_array().unwrap().iter().flat_map(|case| case["rows"].as_array().unwrap().clone());
            // How long it takes is another number every time.
            rows.filter(|row| row["field"] != "perf seconds").collect()
        };
        assert_eq!(rows(&here), rows(&there), "{case}");
    }
}

#[test]
fn differences_are_told_with_their_units() {
    let scratch = Scratch::new();
    let model = cases::named("meshes/segment").model();
    for (name, tolerance) in [("coarse", "0.2"), ("fine", "0.02")] {
        let file = |ending: &str| scratch.join(&format!("{name}.{ending}")).into_os_string();
        let arguments = ["solidify", "--quiet", "--radius", "1", "--tolerance", tolerance].map(std::ffi::OsString::from);
        let paths = [model.clone().into_os_string(), "-o".into(), file("stl"), "--certificate".into(), file("json")];
        succeed(arguments.into_iter().chain(paths));
    }
    let diff = |arguments: &[&str]| at(scratch.path(), None, &[&["diff"], arguments].concat());
    ends_with(&diff(&["fine.json", "fine.json"]), 0, "0 differ");
    // Another tolerance is another order; everything that is proven of the shape agrees.
    let output = diff(&["coarse.json", "fine.json", "--json"]);
    ends_with(&output, 1, "requested_tolerance_mm");
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let apart: Vec<&Value> = told["differences"].as_array().unwrap().iter().filter(|row| row["verdict"] == "apart").collect();
    assert!(apart.len() == 1 && apart[0]["field"] == "requested_tolerance_mm" && apart[0]["unit"] == "mm", "{apart:?}");
    let volume = told["differences"].as_array().unwrap().iter().find(|row| row["field"] == "volume_mm3").unwrap();
    assert_eq!((&volume["unit"], &volume["verdict"], &volume["difference"]), (&json!("mm^3"), &json!("within"), &json!(0.0)));
    // Files: by the distance of their surfaces.
    ends_with(&diff(&["fine.stl", "fine.stl"]), 0, "0 differ");
    ends_with(&diff(&["coarse.stl", "fine.stl"]), 2, "--within");
    // Each is within its tolerance of the same surface, so they are within 0.2 + 0.02 of each other; the distance is known to a fiftieth.
    ends_with(&diff(&["coarse.stl", "fine.stl", "--within", "0.225"]), 0, "within");
    ends_with(&diff(&["coarse.stl", "fine.stl", "--within", "0.001"]), 1, "APART");
    // What is neither, and what does not belong together.
    fs::write(scratch.join("other.json"), "{\"lacuna\": 1}").unwrap();
    ends_with(&diff(&["other.json", "fine.json"]), 3, "neither a certificate nor a mesh file");
    ends_with(&diff(&["fine.stl", "fine.json", "--within", "1"]), 2, "two of a kind");
    ends_with(&diff(&["absent.json", "fine.json"]), 6, "absent.json");
}

#[test]
fn the_example_workflow_runs_as_it_stands_there() {
    let workflow = fs::read_to_string(root().join("docker/workflow.example.yaml")).unwrap();
    // The lines of the step's script, with the container left out: the command is at hand here.
    let lines = workflow.lines().map(str::trim).filter(|line| line.starts_with("lacuna "));
    let commands: Vec<&str> = lines.map(|line| line.trim_end_matches('\\').trim()).collect();
    assert!(commands.len() >= 2, "{commands:?}");
    let scratch = repository();
    ends_with(&at(scratch.path(), None, &["bless", "parts", "--reason", "first"]), 1, "2 of 2");
    let data = Scratch::new();
    let service = Service::start(data.path());
    for command in commands {
        let output = Command::new("sh")
            .args(["-c", &format!("lacuna() {{ \"$LACUNA\" \"$@\"; }}\n{command}")])
            .env("LACUNA", lacuna())
            .env("LACUNA_SERVER", format!("http://{}", service.address))
            .current_dir(scratch.path())
            .output()
            .unwrap();
        assert!(output.status.success(), "{command}: {}", words(&output));
    }
    assert!(
        fs::read_to_string(scratch.join("report.xml")).unwrap().contains("<testsuite name=\"lacuna verify\" tests=\"2\" failures=\"0\"")
    );
}

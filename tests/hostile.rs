//! A stranger's program reads the committed description and asks the real service everything that it allows, and more.

use lacuna_tests::support::python::{skipped, tool};
use lacuna_tests::support::root;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;

/// What must hold of every answer: no failure of ours, and nothing that the description does not say.
const CHECKS: &str =
    "not_a_server_error,status_code_conformance,content_type_conformance,response_schema_conformance,response_headers_conformance";

/// Has every operation asked in a phase, for so many examples or seconds, and gives how many cases there were.
fn asked(phase: &str, more: &[&str]) -> u32 {
    let scratch = Scratch::new();
    // Whatever it submits ends soon, and no rate holds it up.
    let environment = [
        ("LACUNA_SUBMISSIONS_PER_MINUTE", "1000000"),
        ("LACUNA_LIMIT_SECONDS", "2"),
        ("LACUNA_QUEUED", "100000"),
        ("LACUNA_JOBS_PER_KEY", "100000"),
    ];
    let service = Service::start_with(&scratch.join("data"), &environment);
    let mut run = tool("schemathesis");
    run.arg("run").arg(root().join("api/openapi.json")).args(["--url", &format!("http://{}", service.address)]).args(["--checks", CHECKS]);
    run.args(["--phases", phase, "--mode", "all", "--generation-deterministic", "--no-shrink"]).args(more);
    run.args(["--continue-on-failure", "--request-timeout", "60", "--suppress-health-check", "all", "--warnings", "off", "--no-color"]);
    let output = run.current_dir(scratch.path()).output().unwrap();
    let words = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{words}{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(service.get("/readyz").status, 200);
    // That it ran at all: it counts what it asked.
    let counted = words.lines().find_map(|line| line.trim().strip_suffix(" passed")?.split(" generated").next()?.parse::<u32>().ok());
    counted.unwrap_or_else(|| panic!("{words}"))
}

#[test]
fn schemathesis_finds_no_answer_that_the_description_does_not_allow() {
    if skipped() {
        return;
    }
    let cases = asked("fuzzing", &["--max-examples", "10", "--max-time", "45"]);
    assert!(cases > 100, "{cases}");
}

/// Every keyword of every schema, kept and broken, one at a time and without chance. Nine operations take a model or a job, and the description of each
/// holds the whole grammar of models: more than twenty thousand cases apiece, which is why this takes half an hour and is not in everyday
/// runs: `cargo test --release --package lacuna-tests hostile -- --ignored`.
#[test]
#[ignore = "half an hour"]
fn schemathesis_covers_every_keyword_of_the_description() {
    let cases = asked("coverage", &[]);
    assert!(cases > 200_000, "{cases}");
}

//! The container's files, read as instructions: what a builder would only find out on somebody's machine.

use std::fs;

use lacuna_tests::support::root;

/// Instructions of a Dockerfile: (keyword, arguments), with continued lines joined and comments dropped.
fn instructions() -> Vec<(String, String)> {
    let text = fs::read_to_string(root().join("docker/Dockerfile")).unwrap();
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with('#')).collect();
    let joined = lines.join("\n").replace("\\\n", " ");
    let split = |line: &str| line.split_once(' ').map(|(word, rest)| (word.to_owned(), rest.trim().to_owned()));
    joined.lines().filter(|line| !line.trim().is_empty()).map(|line| split(line).expect("an instruction with arguments")).collect()
}

/// Arguments of the instructions of the last stage with a keyword.
fn last_stage(keyword: &str) -> Vec<String> {
    let all = instructions();
    let start = all.iter().rposition(|(word, _)| word == "FROM").unwrap();
    all[start..].iter().filter(|(word, _)| word == keyword).map(|(_, rest)| rest.clone()).collect()
}

#[test]
fn every_instruction_is_one() {
    let known = [
        "FROM",
        "RUN",
        "COPY",
        "WORKDIR",
        "USER",
        "ENV",
        "VOLUME",
        "EXPOSE",
        "STOPSIGNAL",
        "HEALTHCHECK",
        "ENTRYPOINT",
        "CMD",
        "ARG",
        "LABEL",
    ];
    for (word, rest) in instructions() {
        assert!(known.contains(&word.as_str()), "{word} {rest}");
    }
}

#[test]
fn images_are_pinned_and_copies_come_from_stages_that_exist() {
    let all = instructions();
    let mut stages = Vec::new();
    for (word, rest) in &all {
        if word == "FROM" {
            let words: Vec<&str> = rest.split_whitespace().collect();
            assert!(words[0].contains(':') && !words[0].ends_with(":latest"), "{rest} floats");
            assert_eq!(words[1], "AS");
            stages.push(words[2].to_owned());
        }
        if let Some(from) = rest.split_whitespace().find_map(|option| option.strip_prefix("--from=")) {
            assert!(stages.iter().any(|stage| stage == from), "{rest}");
        }
    }
    assert_eq!(stages.len(), 2, "one stage builds, one runs");
    let wanted = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let version = wanted.lines().find_map(|line| line.strip_prefix("rust-version = ")).unwrap().trim_matches('"').to_owned();
    assert!(all[0].1.starts_with(&format!("rust:{version}-")), "{} builds with another Rust than {version}", all[0].1);
}

#[test]
fn it_does_not_run_as_root_and_keeps_its_data_in_one_volume() {
    let user = last_stage("USER");
    let (user, group) = user.last().unwrap().split_once(':').unwrap();
    assert!(user.parse::<u32>().unwrap() > 1000 && group.parse::<u32>().unwrap() > 1000);
    assert_eq!(last_stage("VOLUME"), ["[\"/data\"]"]);
    assert!(last_stage("ENV").join(" ").contains("LACUNA_DATA=/data"));
    assert!(last_stage("RUN").is_empty(), "the image that runs is only copied together");
}

#[test]
fn it_starts_and_is_asked_for_its_health_without_a_shell() {
    let list = |text: &str| -> Vec<String> { serde_json::from_str(text).unwrap_or_else(|_| panic!("{text} is not in exec form")) };
    assert_eq!(list(&last_stage("ENTRYPOINT")[0]), ["lacuna"]);
    assert_eq!(list(&last_stage("CMD")[0]), ["serve"]);
    let health = last_stage("HEALTHCHECK");
    let (_, command) = health[0].split_once("CMD ").unwrap();
    assert_eq!(list(command), ["lacuna", "healthcheck"]);
}

#[test]
fn the_context_holds_what_the_build_needs() {
    let text = fs::read_to_string(root().join(".dockerignore")).unwrap();
    let manifest = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let members = manifest.lines().find(|line| line.starts_with("members")).unwrap();
    for member in members.split('"').skip(1).step_by(2).chain(["Cargo.toml", "Cargo.lock"]) {
        let top = member.split('/').next().unwrap();
        assert!(text.lines().any(|line| line == format!("!{top}")), "{member} does not get into the context");
    }
    assert!(text.lines().any(|line| line == "*"), "everything else stays out");
}

#[test]
fn the_compositions_are_closed() {
    closed("compose.yaml", &["- data:/data"]);
    let shared = ["LACUNA_ROLE: front", "LACUNA_ROLE: worker", "LACUNA_OBJECTS_URL: s3://parts/lacuna", "condition: service_healthy"];
    closed("compose.distributed.yaml", &shared);
}

fn closed(name: &str, more: &[&str]) {
    let text = fs::read_to_string(root().join("docker").join(name)).unwrap();
    let said = |words: &str| assert!(text.lines().any(|line| line.trim() == words), "{words:?} is not said");
    more.iter().copied().for_each(said);
    said("read_only: true");
    said("cap_drop: [ALL]");
    said("security_opt: [\"no-new-privileges:true\"]");
    said("dockerfile: docker/Dockerfile");
    assert!(!text.contains('\t'), "YAML has no tabs");
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let spaces = line.len() - line.trim_start().len();
        assert_eq!(spaces % 2, 0, "odd indentation: {line:?}");
    }
    for line in text.lines().filter(|line| line.trim_start().starts_with("- \"")) {
        assert!(line.contains("127.0.0.1:"), "{line:?} opens a port to everybody");
    }
    assert!(text.contains("${LACUNA_API_KEYS:?"), "without keys it must not start");
}

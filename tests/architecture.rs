//! The invariants of `crates/README.md`, on `cargo metadata` and on the tree.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use lacuna_tests::support::root;
use serde_json::Value;

/// Which crate of ours may use which: arrows point down only.
const EDGES: [(&str, &[&str]); 6] = [
    ("lacuna-kernel", &[]),
    ("lacuna-boolean", &["lacuna-kernel"]),
    ("lacuna-fabrication", &["lacuna-kernel", "lacuna-boolean"]),
    ("lacuna-exchange", &["lacuna-kernel", "lacuna-fabrication"]),
    ("lacuna-api", &["lacuna-kernel", "lacuna-boolean", "lacuna-fabrication", "lacuna-exchange"]),
    ("lacuna-tests", &["lacuna-kernel", "lacuna-boolean", "lacuna-fabrication", "lacuna-exchange", "lacuna-api"]),
];

/// Dependencies of others that only these crates of ours may name.
const KEEPERS: [(&str, &[&str]); 6] = [
    ("tokio", &["lacuna-api"]),
    ("axum", &["lacuna-api"]),
    ("tokio-postgres", &["lacuna-api"]),
    ("object_store", &["lacuna-api"]),
    ("manifold-rust", &["lacuna-boolean"]),
    ("manifold-rs", &["lacuna-boolean"]),
];

/// Longest source file, in lines.
const LINES: usize = 1000;

fn metadata() -> Value {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo).args(["metadata", "--format-version", "1", "--no-deps"]).current_dir(root()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// (crate, dependency, whether only its tests use it) for every dependency that a crate of ours names.
fn named_dependencies() -> Vec<(String, String, bool)> {
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let metadata = metadata();
    let packages = metadata["packages"].as_array().unwrap();
    let of = |package: &Value| {
        let name = text(&package["name"]);
        let all = package["dependencies"].as_array().unwrap().clone();
        all.into_iter().map(move |dependency| (name.clone(), text(&dependency["name"]), dependency["kind"] == "dev"))
    };
    packages.iter().flat_map(of).collect()
}

#[test]
fn crates_use_only_what_lies_below_them() {
    let allowed: BTreeMap<&str, &[&str]> = EDGES.into_iter().collect();
    let mut seen = 0;
    for (from, to, _) in named_dependencies() {
        let below = allowed
            .get(from.as_str())
            .unwrap_or_else(|| panic!("{from} has no place in the house: add it to EDGES and to crates/README.md"));
        if to.starts_with("lacuna-") {
            assert!(below.contains(&to.as_str()), "{from} must not use {to}");
            seen += 1;
        }
    }
    assert!(seen >= 5, "only {seen} edges were found: the metadata was not understood");
}

#[test]
fn what_has_one_keeper_is_named_by_nobody_else() {
    for (from, to, only_tests) in named_dependencies() {
        if let Some((_, keepers)) = KEEPERS.iter().find(|(name, _)| *name == to) {
            assert!(only_tests || keepers.contains(&from.as_str()), "{from} must not use {to}: that is for {keepers:?}");
        }
    }
}

#[test]
fn the_kernel_knows_no_documents_files_sockets_or_clocks() {
    let allowed: BTreeSet<&str> = ["glam", "num-bigint", "num-rational", "num-traits", "rayon", "robust", "spade", "thiserror"].into();
    for (from, to, only_tests) in named_dependencies() {
        assert!(from != "lacuna-kernel" || only_tests || allowed.contains(to.as_str()), "the kernel must not use {to}");
    }
    let banned = ["serde", "tokio", "std::fs", "std::net", "std::time", "std::env", "std::process", "static mut", "println!"];
    let mut files = 0;
    for path in sources(&root().join("crates/kernel/src")) {
        let text = fs::read_to_string(&path).unwrap();
        for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//")) {
            for word in banned {
                assert!(!line.contains(word), "{}:{}: the kernel must not use {word}", path.display(), number + 1);
            }
        }
        files += 1;
    }
    assert!(files >= 5, "the kernel was not found");
}

#[test]
fn exchange_and_fabrication_know_no_paths_and_no_sockets() {
    for room in ["crates/exchange/src", "crates/fabrication/src"] {
        for path in sources(&root().join(room)) {
            let text = fs::read_to_string(&path).unwrap();
            // What a file's own tests do is their business.
            let code = text.split("#[cfg(test)]").next().unwrap_or("");
            for word in ["std::fs", "std::net", "std::path", "tokio"] {
                let used = code.lines().any(|line| !line.trim_start().starts_with("//") && line.contains(word));
                assert!(!used, "{} must not use {word}", path.display());
            }
        }
    }
}

#[test]
fn the_top_level_is_the_one_that_was_asked_for() {
    let expected: BTreeSet<String> =
        ["Cargo.toml", "Cargo.lock", "README.md", "api", "crates", "docker", "fixtures", "tests"].map(str::to_owned).into();
    // Build products have places of their own that git ignores.
    let ignored = ["target", "out"];
    let found: BTreeSet<String> = fs::read_dir(root())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !name.starts_with('.') && !ignored.contains(&name.as_str()))
        .collect();
    assert_eq!(found, expected);
}

#[test]
fn the_map_lists_exactly_the_members() {
    let metadata = metadata();
    let names = metadata["packages"].as_array().unwrap().iter().map(|package| package["name"].as_str().unwrap().to_owned());
    let members: BTreeSet<String> = names.collect();
    let map = fs::read_to_string(root().join("crates/README.md")).expect("crates/README.md is the map of the house");
    let is_name = |word: &&str| word.strip_prefix("lacuna-").is_some_and(|rest| rest.bytes().all(|b| b.is_ascii_lowercase()));
    let listed: BTreeSet<String> = map.split('`').skip(1).step_by(2).filter(is_name).map(str::to_owned).collect();
    assert_eq!(listed, members, "crates/README.md must name every member, as `lacuna-...`, and nothing else");
}

#[test]
fn pages_stay_readable() {
    for path in texts() {
        let text = fs::read_to_string(&path).unwrap();
        let lines = text.lines().count();
        assert!(lines <= LINES, "{} has {lines} lines", path.display());
    }
}

#[test]
fn nothing_names_the_machine_it_was_made_on() {
    // In two halves, so that this page passes itself.
    let words =
        [["/ro", "ot/"], ["/ho", "me/"], ["/Us", "ers/"], ["/wo", "rk/"], ["C:\\", "Users"], ["arti", "factory"]].map(|half| half.concat());
    let mut read = 0;
    for path in texts() {
        let text = fs::read_to_string(&path).unwrap();
        for (number, line) in text.lines().enumerate() {
            for word in &words {
                assert!(!line.contains(word.as_str()), "{}:{}: {word}", path.display(), number + 1);
            }
        }
        read += 1;
    }
    assert!(read > 50, "only {read} files were read");
}

/// Rust files below a folder, but for those that hold only tests.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    walk(folder, &mut found);
    let tests = |path: &Path| path.with_extension("").components().any(|part| part.as_os_str() == "tests");
    found.retain(|path| path.extension().is_some_and(|ending| ending == "rs") && !tests(path.strip_prefix(folder).unwrap()));
    found
}

/// Everything that people write: sources, scripts, prose, settings; not what is generated, nor models.
fn texts() -> Vec<PathBuf> {
    let endings = ["rs", "py", "md", "toml", "txt", "yaml", "yml", "html", "sh"];
    let names = ["Dockerfile", ".dockerignore", "run"];
    let mut found = Vec::new();
    for part in ["Cargo.toml", "README.md", ".cargo", ".ci", ".github", "api", "crates", "docker", "fixtures", "tests"] {
        walk(&root().join(part), &mut found);
    }
    found.retain(|path| {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        let name = path.file_name().and_then(|e| e.to_str()).unwrap_or("");
        endings.contains(&ending) || names.contains(&name)
    });
    found
}

fn walk(path: &Path, found: &mut Vec<PathBuf>) {
    if path.is_file() {
        found.push(path.to_path_buf());
    } else if path.is_dir() && path.file_name().is_none_or(|name| name != "__pycache__" && name != "target") {
        for entry in fs::read_dir(path).unwrap() {
            walk(&entry.unwrap().path(), found);
        }
    }
}

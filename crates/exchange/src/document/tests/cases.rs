//! Every document among the fixtures: the good ones are read and survive a round trip, the malformed
//! ones are refused with exactly the faults that stand beside them.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::diagnostic::{CODES, Diagnostic};
use crate::document::{DocumentLimits, read_job, read_model, write_model, write_model_indented};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Expected {
    about: String,
    stage: Stage,
    diagnostic: Vec<ExpectedDiagnostic>,
}

/// Who refuses: the reader of documents, or the kernel after a clean reading.
#[derive(Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Stage {
    Document,
    Kernel,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ExpectedDiagnostic {
    pointer: String,
    code: String,
    #[serde(default)]
    warning: bool,
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures")
}

/// Folders two levels below the fixtures, in a fixed order.
fn case_folders(family: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let mut folders = Vec::new();
    for family_folder in fs::read_dir(fixtures()).unwrap() {
        let path = family_folder.unwrap().path();
        if path.is_dir() && family(&path.file_name().unwrap().to_string_lossy()) {
            folders.extend(fs::read_dir(path).unwrap().map(|case| case.unwrap().path()).filter(|case| case.is_dir()));
        }
    }
    folders.sort();
    folders
}

fn refused(folder: &Path) -> Vec<Diagnostic> {
    let limits = DocumentLimits::default();
    let job = folder.join("job.json");
    if job.exists() {
        read_job(&fs::read(job).unwrap(), &limits).err().unwrap_or_default()
    } else {
        read_model(&fs::read(folder.join("model.json")).unwrap(), &limits).err().unwrap_or_default()
    }
}

#[test]
fn malformed_documents_are_refused_with_every_fault() {
    let folders = case_folders(|family| family == "malformed");
    assert!(folders.len() >= 40, "the museum of malformed documents has lost its pieces");
    let mut wrong = Vec::new();
    for folder in folders {
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        let expected: Expected = toml::from_str(&fs::read_to_string(folder.join("diagnostics.toml")).unwrap()).unwrap();
        assert!(!expected.about.is_empty() && !expected.diagnostic.is_empty(), "{name} says nothing");
        let found = refused(&folder);
        if expected.stage == Stage::Kernel {
            if !found.is_empty() {
                wrong.push(format!("{name} is for the kernel to judge, and its document is refused: {found:?}"));
            }
            continue;
        }
        let told: Vec<_> = found.iter().map(|fault| (fault.pointer.as_str(), fault.code)).collect();
        let wanted: Vec<_> = expected.diagnostic.iter().map(|fault| (fault.pointer.as_str(), fault.code.as_str())).collect();
        assert!(expected.diagnostic.iter().all(|fault| !fault.warning), "{name}: the reader gives no warnings");
        if told != wanted {
            wrong.push(format!("{name}\n  wanted {wanted:?}\n  found  {found:#?}"));
        }
        for fault in &found {
            assert!(CODES.iter().any(|(code, _)| *code == fault.code), "{} is not in the list of codes", fault.code);
            assert!(fault.message.len() < 1200, "{name}: a message is too long to be read: {}", fault.message);
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn good_documents_are_read_and_written_back() {
    let folders = case_folders(|family| family != "malformed");
    for folder in folders {
        let path = folder.join("model.json");
        if !path.exists() {
            continue;
        }
        let model = read_model(&fs::read(&path).unwrap(), &DocumentLimits::default())
            .unwrap_or_else(|faults| panic!("{}: {faults:#?}", folder.display()));
        let canonical = write_model(&model);
        let again = read_model(canonical.as_bytes(), &DocumentLimits::default()).unwrap();
        assert_eq!(again, model, "{}", folder.display());
        assert_eq!(write_model(&again), canonical, "{}", folder.display());
        assert_eq!(read_model(write_model_indented(&model).as_bytes(), &DocumentLimits::default()).unwrap(), model);
    }
}

//! The data folder: job records, documents, models and result files.
//!
//! Everything is one file per thing, written by [`crate::files`], so that a crash leaves the state before or
//! the state after. This module is the boundary behind which a database or an object store can stand.

mod uploads;

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::digest::Digest;
use crate::files::{self, PENDING_ENDING, PendingFile};
use crate::inspection::MeshReport;
use crate::jobs::record::{Answer, JobRecord};

/// What is told of a stored model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ModelView {
    /// Its id, chosen by its contents.
    pub id: String,
    /// The author's name for it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub name: Option<String>,
    /// Length of the canonical document, or of the mesh file.
    pub bytes: u64,
    /// When it was first stored.
    pub created: String,
    /// `sha256:` digest of the canonical document, or of the mesh file.
    #[schema(value_type = String)]
    pub digest: Digest,
    /// What an uploaded mesh file holds; absent for model documents.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub mesh: Option<MeshReport>,
}

/// Where things are kept.
#[derive(Debug)]
pub struct Store {
    root: PathBuf,
}

impl Store {
    /// Opens a data folder, makes what is missing in it and removes what an earlier process left half written.
    ///
    /// # Errors
    /// When the folder cannot be made or written.
    pub fn open(root: &Path) -> io::Result<Self> {
        for name in ["jobs", "documents", "models", "uploads", "results", "answers"] {
            let folder = root.join(name);
            fs::create_dir_all(&folder)?;
            for entry in fs::read_dir(&folder)? {
                let path = entry?.path();
                if path.to_string_lossy().ends_with(PENDING_ENDING) {
                    fs::remove_file(path)?;
                }
            }
        }
        Ok(Self { root: root.to_owned() })
    }

    /// Whether the folder can be written now.
    ///
    /// # Errors
    /// When it cannot.
    pub fn probe(&self) -> io::Result<()> {
        PendingFile::create_in(&self.root).map(drop)
    }

    /// A file to write a result into.
    ///
    /// # Errors
    /// When the device fails.
    pub fn new_result(&self) -> io::Result<PendingFile> {
        PendingFile::create_in(&self.root.join("results"))
    }

    /// Keeps a result under its digest. The same bytes are kept once.
    ///
    /// # Errors
    /// When the device fails.
    pub fn keep_result(&self, pending: PendingFile, digest: Digest) -> io::Result<()> {
        pending.commit(&self.result_path(digest))
    }

    /// Where a result is kept.
    #[must_use]
    pub fn result_path(&self, digest: Digest) -> PathBuf {
        self.root.join("results").join(digest.hex())
    }

    /// Removes the results that `needed` does not want, and tells how many.
    ///
    /// # Errors
    /// When the device fails.
    pub fn sweep_results(&self, needed: impl Fn(Digest) -> bool) -> io::Result<usize> {
        let mut removed = 0;
        for entry in fs::read_dir(self.root.join("results"))? {
            let path = entry?.path();
            let name = path.file_name().map(|n| format!("sha256:{}", n.to_string_lossy())).unwrap_or_default();
            if name.parse().is_ok_and(|digest| !needed(digest)) {
                fs::remove_file(path)?;
                removed += 1;
            }
        }
        Ok(removed)
    }

    /// Keeps a job document under its digest.
    ///
    /// # Errors
    /// When the device fails.
    pub fn keep_document(&self, digest: Digest, bytes: &[u8]) -> io::Result<()> {
        let path = self.root.join("documents").join(digest.hex());
        if path.exists() { Ok(()) } else { files::write_whole(&path, bytes) }
    }

    /// A job document.
    ///
    /// # Errors
    /// When it is not there or the device fails.
    pub fn document(&self, digest: Digest) -> io::Result<Vec<u8>> {
        fs::read(self.root.join("documents").join(digest.hex()))
    }

    /// Keeps a job's record in place of its earlier one.
    ///
    /// # Errors
    /// When the device fails.
    pub fn keep_job(&self, record: &JobRecord) -> io::Result<()> {
        files::write_whole(&self.job_path(&record.view.id), &serde_json::to_vec(record)?)
    }

    /// Forgets a job's record.
    ///
    /// # Errors
    /// When the device fails.
    pub fn forget_job(&self, id: &str) -> io::Result<()> {
        absent_is_fine(fs::remove_file(self.job_path(id)))
    }

    /// All records that can be read; one that cannot is told to the log and left alone.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn jobs(&self) -> io::Result<Vec<JobRecord>> {
        let mut records = Vec::new();
        for entry in fs::read_dir(self.root.join("jobs"))? {
            let path = entry?.path();
            match read_json(&path) {
                Ok(Some(record)) => records.push(record),
                Ok(None) => {}
                Err(error) => tracing::error!(file = %path.display(), %error, "unreadable job record"),
            }
        }
        Ok(records)
    }

    /// What the same work left earlier, if it was done by this version.
    ///
    /// # Errors
    /// When the device fails.
    pub fn answer(&self, key: Digest) -> io::Result<Option<Answer>> {
        let answer: Option<Answer> = read_json(&self.answer_path(key))?;
        // Its files may have been swept since.
        Ok(answer.filter(|a| a.outputs.iter().all(|output| self.result_path(output.digest).exists())))
    }

    /// Keeps what work left.
    ///
    /// # Errors
    /// When the device fails.
    pub fn keep_answer(&self, key: Digest, answer: &Answer) -> io::Result<()> {
        files::write_whole(&self.answer_path(key), &serde_json::to_vec(answer)?)
    }

    /// Keeps a model of an owner; tells what is kept and whether it is new.
    ///
    /// # Errors
    /// When the device fails.
    pub fn keep_model(&self, owner: &str, name: Option<&str>, document: &[u8]) -> io::Result<(ModelView, bool)> {
        let digest = Digest::of(document);
        let id = format!("mdl_{}", &digest.hex()[..32]);
        if let Some(known) = self.model(owner, &id)? {
            return Ok((known, false));
        }
        let view =
            ModelView { id, name: name.map(str::to_owned), bytes: document.len() as u64, created: crate::clock::now(), digest, mesh: None };
        fs::create_dir_all(self.models(owner))?;
        files::write_whole(&self.models(owner).join(format!("{}.document", view.id)), document)?;
        files::write_whole(&self.models(owner).join(format!("{}.json", view.id)), &serde_json::to_vec(&view)?)?;
        Ok((view, true))
    }

    /// What is told of an owner's model.
    ///
    /// # Errors
    /// When the device fails.
    pub fn model(&self, owner: &str, id: &str) -> io::Result<Option<ModelView>> {
        if is_id(id) { read_json(&self.models(owner).join(format!("{id}.json"))) } else { Ok(None) }
    }

    /// The canonical document of an owner's model.
    ///
    /// # Errors
    /// When the device fails.
    pub fn model_document(&self, owner: &str, id: &str) -> io::Result<Option<Vec<u8>>> {
        if is_id(id) { read_if_there(&self.models(owner).join(format!("{id}.document"))) } else { Ok(None) }
    }

    /// An owner's models, sorted by id.
    ///
    /// # Errors
    /// When the device fails.
    pub fn list_models(&self, owner: &str) -> io::Result<Vec<ModelView>> {
        let entries = match fs::read_dir(self.models(owner)) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries?,
        };
        let mut views = Vec::new();
        for entry in entries {
            let path = entry?.path();
            if path.extension().is_some_and(|ending| ending == "json") {
                views.extend(read_json::<ModelView>(&path)?);
            }
        }
        views.sort_by(|a, b| a.id.cmp(&b.id));
        Ok(views)
    }

    /// Forgets an owner's model; tells whether it was there.
    ///
    /// # Errors
    /// When the device fails.
    pub fn forget_model(&self, owner: &str, id: &str) -> io::Result<bool> {
        let known = self.model(owner, id)?.is_some();
        if known {
            fs::remove_file(self.models(owner).join(format!("{id}.json")))?;
            absent_is_fine(fs::remove_file(self.models(owner).join(format!("{id}.document"))))?;
        }
        Ok(known)
    }

    fn job_path(&self, id: &str) -> PathBuf {
        self.root.join("jobs").join(format!("{id}.json"))
    }

    fn answer_path(&self, key: Digest) -> PathBuf {
        self.root.join("answers").join(format!("{}.json", key.hex()))
    }

    /// One folder per owner: what is not in it does not exist for that owner.
    fn models(&self, owner: &str) -> PathBuf {
        self.root.join("models").join(owner)
    }
}

/// Ids come from addresses; only what we could have made may become part of a path.
fn is_id(id: &str) -> bool {
    id.len() <= 64 && id.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
}

fn read_if_there(path: &Path) -> io::Result<Option<Vec<u8>>> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

fn read_json<T: DeserializeOwned>(path: &Path) -> io::Result<Option<T>> {
    read_if_there(path)?.map(|bytes| serde_json::from_slice(&bytes).map_err(io::Error::from)).transpose()
}

fn absent_is_fine(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::Write as _;

    use super::*;

    fn folder() -> PathBuf {
        std::env::temp_dir().join(format!("lacuna-store-{}", uuid::Uuid::now_v7()))
    }

    #[test]
    fn models_belong_to_their_owner() {
        let root = folder();
        let store = Store::open(&root).unwrap();
        let (view, new) = store.keep_model("ada", Some("curve"), b"{}").unwrap();
        assert!(new);
        assert!(!store.keep_model("ada", Some("curve"), b"{}").unwrap().1);
        assert_eq!(store.list_models("ada").unwrap(), std::slice::from_ref(&view));
        assert_eq!(store.model("bob", &view.id).unwrap(), None);
        assert_eq!(store.model("ada", "../ada/x").unwrap(), None);
        assert!(store.forget_model("ada", &view.id).unwrap());
        assert!(!store.forget_model("ada", &view.id).unwrap());
        fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn leftovers_go_and_results_stay() {
        let root = folder();
        let store = Store::open(&root).unwrap();
        let mut pending = store.new_result().unwrap();
        pending.write_all(b"mesh").unwrap();
        let digest = Digest::of(b"mesh");
        store.keep_result(pending, digest).unwrap();
        let leftover = root.join("results").join(format!(".x{PENDING_ENDING}"));
        fs::write(&leftover, b"half").unwrap();

        let store = Store::open(&root).unwrap();
        assert!(!leftover.exists());
        assert_eq!(fs::read(store.result_path(digest)).unwrap(), b"mesh");
        assert_eq!(store.sweep_results(|kept| kept != digest).unwrap(), 1);
        fs::remove_dir_all(root).unwrap();
    }
}

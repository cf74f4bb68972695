//! Documents, models and result files, by their digests: in the data folder of one process, or in a bucket that
//! several share.
//!
//! Results and documents never change, so every shelf needs only six verbs. A thing is there in full or not at all.

use std::fs::{self, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use axum::body::Body;
use serde::{Deserialize, Serialize};
use tokio::runtime::Handle;
use utoipa::ToSchema;

use crate::digest::Digest;
use crate::files::PendingFile;
use crate::inspection::MeshReport;

/// Does the same on either shelf.
macro_rules! on_shelf {
    ($store:expr, $shelf:ident => $call:expr) => {
        match &$store.shelf {
            Shelf::Folder($shelf) => $call,
            Shelf::Bucket($shelf) => $call,
        }
    };
}

mod bucket;
pub mod folder;
mod uploads;

use bucket::Bucket;
use folder::Folder;

/// Age below which nothing is swept: what a running job has made is kept before its record names it.
const SWEPT_AFTER: Duration = Duration::from_secs(3600);

const DOCUMENTS: &str = "documents";
const ROOMS: [&str; 4] = [DOCUMENTS, "models", "uploads", "results"];

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

/// A file that never changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum File {
    /// What a job made.
    Result(Digest),
    /// A mesh file that was uploaded.
    Upload(Digest),
}

/// Where things are kept. Its methods block, but for [`Store::part`].
#[derive(Debug)]
pub struct Store {
    shelf: Shelf,
    /// Where results are written before they take their place.
    scratch: PathBuf,
    /// Held as long as the folder is in use. The system gives it back however the process ends.
    _alone: Option<fs::File>,
}

#[derive(Debug)]
enum Shelf {
    Folder(Folder),
    Bucket(Bucket),
}

/// Takes the folder for this process alone: two that write to it would take up each other's jobs.
fn alone(root: &Path) -> io::Result<fs::File> {
    fs::create_dir_all(root)?;
    let path = root.join("in-use");
    let file = fs::File::options().create(true).truncate(false).write(true).open(&path)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => {
            let message = format!("another service uses the folder {}: stop it, or give this one a folder of its own", root.display());
            Err(io::Error::new(io::ErrorKind::ResourceBusy, message))
        }
        Err(TryLockError::Error(error)) => Err(error),
    }
}

impl Store {
    /// Opens a data folder.
    ///
    /// # Errors
    /// When the folder cannot be made or written.
    pub fn open(root: &Path) -> io::Result<Self> {
        // Before anything is cleared away that another process may be writing.
        let alone = alone(root)?;
        Ok(Self { shelf: Shelf::Folder(Folder::open(root, &ROOMS)?), scratch: root.join("results"), _alone: Some(alone) })
    }

    /// Opens a bucket, `s3://BUCKET/FOLDER`; the data folder only holds what is being written.
    ///
    /// # Errors
    /// When the address cannot be understood or the folder cannot be written.
    pub fn open_bucket(address: &str, root: &Path, runtime: Handle) -> io::Result<Self> {
        // Several processes may have the same folder: none clears what another is writing.
        let scratch = root.join("scratch");
        std::fs::create_dir_all(&scratch)?;
        Ok(Self { shelf: Shelf::Bucket(Bucket::open(address, runtime)?), scratch, _alone: None })
    }

    /// Whether it can be used now.
    ///
    /// # Errors
    /// When it cannot.
    pub fn probe(&self) -> io::Result<()> {
        on_shelf!(self, shelf => shelf.probe())
    }

    /// The folder of files that are being written.
    #[must_use]
    pub fn scratch(&self) -> &Path {
        &self.scratch
    }

    /// A file to write a result into, in [`Store::scratch`].
    ///
    /// # Errors
    /// When the device fails.
    pub fn new_result(&self) -> io::Result<PendingFile> {
        PendingFile::create_in(&self.scratch)
    }

    /// Keeps a result under its digest. The same bytes are kept once. After a failure it can be tried again.
    ///
    /// # Errors
    /// When the shelf fails.
    pub fn keep_result(&self, pending: &mut PendingFile, digest: Digest) -> io::Result<()> {
        self.keep_file(pending, &result_name(digest))
    }

    fn keep_file(&self, pending: &mut PendingFile, name: &str) -> io::Result<()> {
        match &self.shelf {
            Shelf::Folder(folder) => pending.settle(&folder.path(name)),
            Shelf::Bucket(bucket) => bucket.put_file(name, pending),
        }
    }

    /// Whether a result is there. If it is, no sweep of the next hour takes it.
    ///
    /// # Errors
    /// When the shelf fails.
    pub fn holds_result(&self, digest: Digest) -> io::Result<bool> {
        match &self.shelf {
            Shelf::Folder(folder) => folder.renew(&result_name(digest)),
            // Here the record of the answer keeps the sweep away.
            Shelf::Bucket(bucket) => bucket.holds(&result_name(digest)),
        }
    }

    /// Bytes of a file, as they are asked for.
    ///
    /// # Errors
    /// When it is not there or the shelf fails.
    pub async fn part(&self, file: File, first: u64, length: u64) -> io::Result<Body> {
        let name = match file {
            File::Result(digest) => result_name(digest),
            File::Upload(digest) => uploads::upload_name(digest),
        };
        on_shelf!(self, shelf => shelf.part(&name, first, length).await)
    }

    /// Removes the results and job documents that nobody needs, unless they are new, and tells how many. `needed` is asked
    /// once, after the shelf was looked through.
    ///
    /// # Errors
    /// When the shelf or the question fails.
    pub fn sweep<E: From<io::Error>>(&self, needed: impl FnOnce() -> Result<std::collections::HashSet<Digest>, E>) -> Result<usize, E> {
        let mut candidates = Vec::new();
        for room in [DOCUMENTS, "results"] {
            for (name, since) in on_shelf!(self, shelf => shelf.list(room))? {
                let digest: Option<Digest> = format!("sha256:{name}").parse().ok();
                let old = SystemTime::now().duration_since(since).is_ok_and(|age| age >= SWEPT_AFTER);
                if let (Some(digest), true) = (digest, old) {
                    candidates.push((room, digest));
                }
            }
        }
        let needed = needed()?;
        let mut removed = 0;
        for (room, digest) in candidates.into_iter().filter(|(_, digest)| !needed.contains(digest)) {
            on_shelf!(self, shelf => shelf.remove(&format!("{room}/{}", digest.hex())))?;
            removed += 1;
        }
        Ok(removed)
    }

    /// Keeps job documents, each under its digest.
    ///
    /// # Errors
    /// When the shelf fails.
    pub fn keep_documents(&self, documents: &[(Digest, &[u8])]) -> io::Result<()> {
        match &self.shelf {
            Shelf::Folder(folder) => {
                let mut new: Vec<(String, &[u8])> = Vec::with_capacity(documents.len());
                for (digest, bytes) in documents {
                    if !folder.renew(&document_name(*digest))? {
                        new.push((digest.hex(), bytes));
                    }
                }
                folder.put_together(DOCUMENTS, &new)
            }
            Shelf::Bucket(bucket) => documents.iter().try_for_each(|(digest, bytes)| bucket.put(&document_name(*digest), bytes)),
        }
    }

    /// A job document.
    ///
    /// # Errors
    /// When it is not there or the shelf fails.
    pub fn document(&self, digest: Digest) -> io::Result<Vec<u8>> {
        let found = on_shelf!(self, shelf => shelf.get(&document_name(digest)))?;
        found.ok_or_else(|| io::Error::new(ErrorKind::NotFound, "the job document is no longer kept"))
    }

    /// Keeps a model of an owner; tells what is kept and whether it is new.
    ///
    /// # Errors
    /// When the shelf fails.
    pub fn keep_model(&self, owner: &str, name: Option<&str>, document: &[u8]) -> io::Result<(ModelView, bool)> {
        let digest = Digest::of(document);
        let id = format!("mdl_{}", &digest.hex()[..32]);
        if let Some(known) = self.model(owner, &id)? {
            return Ok((known, false));
        }
        let view =
            ModelView { id, name: name.map(str::to_owned), bytes: document.len() as u64, created: crate::clock::now(), digest, mesh: None };
        on_shelf!(self, shelf => shelf.put(&model_name(owner, &view.id, "document"), document))?;
        on_shelf!(self, shelf => shelf.put(&model_name(owner, &view.id, "json"), &serde_json::to_vec(&view)?))?;
        Ok((view, true))
    }

    /// What is told of an owner's model.
    ///
    /// # Errors
    /// When the shelf fails.
    pub fn model(&self, owner: &str, id: &str) -> io::Result<Option<ModelView>> {
        if !is_id(id) {
            return Ok(None);
        }
        let found = on_shelf!(self, shelf => shelf.get(&model_name(owner, id, "json")))?;
        found.map(|bytes| serde_json::from_slice(&bytes).map_err(io::Error::from)).transpose()
    }

    /// The canonical document of an owner's model.
    ///
    /// # Errors
    /// When the shelf fails.
    pub fn model_document(&self, owner: &str, id: &str) -> io::Result<Option<Vec<u8>>> {
        if is_id(id) { on_shelf!(self, shelf => shelf.get(&model_name(owner, id, "document"))) } else { Ok(None) }
    }

    /// An owner's models, sorted by id.
    ///
    /// # Errors
    /// When the shelf fails.
    pub fn list_models(&self, owner: &str) -> io::Result<Vec<ModelView>> {
        let names = on_shelf!(self, shelf => shelf.list(&format!("models/{owner}")))?;
        let mut views = Vec::new();
        for id in names.iter().filter_map(|(name, _)| name.strip_suffix(".json")) {
            views.extend(self.model(owner, id)?);
        }
        views.sort_by(|a, b| a.id.cmp(&b.id));
        Ok(views)
    }

    /// Forgets an owner's model; tells whether it was there.
    ///
    /// # Errors
    /// When the shelf fails.
    pub fn forget_model(&self, owner: &str, id: &str) -> io::Result<bool> {
        let known = self.model(owner, id)?.is_some();
        if known {
            on_shelf!(self, shelf => shelf.remove(&model_name(owner, id, "json")))?;
            on_shelf!(self, shelf => shelf.remove(&model_name(owner, id, "document")))?;
        }
        Ok(known)
    }
}

fn result_name(digest: Digest) -> String {
    format!("results/{}", digest.hex())
}

fn document_name(digest: Digest) -> String {
    format!("{DOCUMENTS}/{}", digest.hex())
}

/// One room per owner: what is not in it does not exist for that owner.
fn model_name(owner: &str, id: &str, ending: &str) -> String {
    format!("models/{owner}/{id}.{ending}")
}

/// Ids come from addresses; only what we could have made may become part of a path.
fn is_id(id: &str) -> bool {
    id.len() <= 64 && id.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::collections::HashSet;
    use std::fs;
    use std::io::Write as _;

    use super::*;
    use crate::files::PENDING_ENDING;

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
        store.keep_result(&mut pending, digest).unwrap();
        let leftover = root.join("results").join(format!(".x{PENDING_ENDING}"));
        fs::write(&leftover, b"half").unwrap();
        // Whoever is at work in a folder is not disturbed.
        assert_eq!(Store::open(&root).unwrap_err().kind(), ErrorKind::ResourceBusy);
        assert!(leftover.exists());

        drop(pending);
        drop(store);
        let store = Store::open(&root).unwrap();
        assert!(!leftover.exists());
        let place = root.join(result_name(digest));
        assert_eq!(fs::read(&place).unwrap(), b"mesh");
        let nobody = || Ok::<_, io::Error>(HashSet::new());
        assert_eq!(store.sweep(nobody).unwrap(), 0, "it is new");
        let age = |hours: u64| {
            let since = SystemTime::now() - Duration::from_secs(3600 * hours);
            fs::File::open(&place).unwrap().set_modified(since).unwrap();
        };
        age(2);
        assert_eq!(store.sweep(|| Ok::<_, io::Error>(HashSet::from([digest]))).unwrap(), 0, "somebody needs it");
        assert!(store.holds_result(digest).unwrap());
        assert_eq!(store.sweep(nobody).unwrap(), 0, "somebody has just asked for it");
        age(2);
        assert_eq!(store.sweep(nobody).unwrap(), 1);
        assert!(!store.holds_result(digest).unwrap());
        fs::remove_dir_all(root).unwrap();
    }
}

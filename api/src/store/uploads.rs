//! Mesh files that callers uploaded: one file for the same bytes, and a view of it for each owner.

use std::collections::HashSet;
use std::io;
use std::time::{Duration, SystemTime};

use lacuna_exchange::format::{FORMATS, Format};

use super::{ModelView, Shelf, Store, model_name};
use crate::digest::Digest;
use crate::documents::{Stored, StoredMesh};
use crate::files::PendingFile;
use crate::inspection::MeshReport;

/// The name of a mesh file.
pub(super) fn upload_name(digest: Digest) -> String {
    format!("uploads/{}", digest.hex())
}

/// The id of a mesh file that is read as a format.
fn upload_id(format: &str, digest: Digest) -> String {
    let key = Digest::of(format!("{format} {digest}").as_bytes());
    format!("mdl_{}", &key.hex()[..32])
}

impl Store {
    /// A file to receive an upload.
    ///
    /// # Errors
    /// When the device fails.
    pub fn new_upload(&self) -> io::Result<PendingFile> {
        PendingFile::create_in(&self.scratch)
    }

    /// Keeps a mesh file of an owner; tells what is kept and whether it is new. The id depends on the contents and on the
    /// format that they are read as.
    ///
    /// # Errors
    /// When the device fails.
    pub fn keep_upload(
        &self,
        owner: &str,
        name: Option<String>,
        pending: &mut PendingFile,
        digest: Digest,
        report: MeshReport,
    ) -> io::Result<(ModelView, bool)> {
        let id = upload_id(&report.format, digest);
        if let Some(known) = self.model(owner, &id)? {
            return Ok((known, false));
        }
        self.keep_file(pending, &upload_name(digest))?;
        let view = ModelView { id, name, bytes: report.bytes, created: crate::clock::now(), digest, mesh: Some(report) };
        on_shelf!(self, shelf => shelf.put(&model_name(owner, &view.id, "json"), &serde_json::to_vec(&view)?))?;
        Ok((view, true))
    }

    /// What an owner has stored under an id: a model document or a mesh file.
    ///
    /// # Errors
    /// When the device fails.
    pub fn stored(&self, owner: &str, id: &str) -> io::Result<Option<Stored>> {
        let Some(view) = self.model(owner, id)? else { return Ok(None) };
        let Some(mesh) = &view.mesh else { return Ok(self.model_document(owner, id)?.map(Stored::Document)) };
        let found = Format::from_name(&mesh.format).map(|format| self.mesh(view.digest, format, view.name.clone()));
        Ok(found.transpose()?.flatten().map(Stored::Mesh))
    }

    /// The mesh file that a worker's document refers to, whoever uploaded it: only our own documents have such words.
    #[must_use]
    pub fn referred(&self, reference: &str) -> Option<Stored> {
        let (digest, ending) = reference.rsplit_once('.')?;
        let found = self.mesh(digest.parse().ok()?, Format::from_name(ending)?, None);
        let found = found.unwrap_or_else(|error| {
            tracing::error!(%error, "an uploaded mesh file could not be read");
            None
        });
        found.map(Stored::Mesh)
    }

    fn mesh(&self, digest: Digest, format: Format, name: Option<String>) -> io::Result<Option<StoredMesh>> {
        let reference = format!("{digest}.{}", format.facts().ending);
        let bytes = on_shelf!(self, shelf => shelf.get(&upload_name(digest)))?;
        Ok(bytes.map(|bytes| StoredMesh { name, format, bytes, reference }))
    }

    /// Removes mesh files that no owner has any more and that were not touched for so long; tells how many.
    ///
    /// # Errors
    /// When the device fails.
    pub fn sweep_uploads(&self, age: Duration) -> io::Result<usize> {
        let oldest = SystemTime::now().checked_sub(age).unwrap_or(SystemTime::UNIX_EPOCH);
        let files = on_shelf!(self, shelf => shelf.list("uploads"))?;
        let known = self.model_files()?;
        let mut removed = 0;
        for (name, _) in files.into_iter().filter(|(_, since)| *since < oldest) {
            let Ok(digest) = format!("sha256:{name}").parse::<Digest>() else { continue };
            // Somebody has it when some owner has a view of it under one of its possible ids.
            let needed = FORMATS.iter().any(|format| known.contains(&format!("{}.json", upload_id(format.ending, digest))));
            if !needed {
                on_shelf!(self, shelf => shelf.remove(&format!("uploads/{name}")))?;
                removed += 1;
            }
        }
        Ok(removed)
    }

    /// The names of what is kept of models, of all owners.
    fn model_files(&self) -> io::Result<HashSet<String>> {
        let names = |found: Vec<(String, SystemTime)>| found.into_iter().map(|(name, _)| name);
        match &self.shelf {
            Shelf::Folder(folder) => {
                let mut all = HashSet::new();
                for owner in names(folder.list("models")?) {
                    all.extend(names(folder.list(&format!("models/{owner}"))?));
                }
                Ok(all)
            }
            // A bucket has no folders: all names below are listed.
            Shelf::Bucket(bucket) => Ok(names(bucket.list("models")?).collect()),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;
    use std::io::Write as _;

    use lacuna_exchange::format::ReadLimits;

    use super::*;
    use crate::inspection;

    const TRIANGLE: &[u8] = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    fn upload(store: &Store, owner: &str) -> (ModelView, bool) {
        let mut pending = store.new_upload().unwrap();
        pending.write_all(TRIANGLE).unwrap();
        let file = inspection::read(TRIANGLE, None, &ReadLimits::default()).unwrap();
        let report = inspection::report(&file, TRIANGLE.len() as u64).unwrap();
        store.keep_upload(owner, Some("part".into()), &mut pending, Digest::of(TRIANGLE), report).unwrap()
    }

    #[test]
    fn files_are_kept_once_and_for_their_owners_alone() {
        let root = std::env::temp_dir().join(format!("lacuna-uploads-{}", uuid::Uuid::now_v7()));
        let store = Store::open(&root).unwrap();
        let (view, new) = upload(&store, "ada");
        assert!(new && !upload(&store, "ada").1 && upload(&store, "bob").1);
        assert_eq!(fs::read_dir(root.join("uploads")).unwrap().count(), 1);
        let Some(Stored::Mesh(mesh)) = store.stored("ada", &view.id).unwrap() else { panic!("it is a mesh") };
        assert_eq!((mesh.bytes.as_slice(), mesh.name.as_deref()), (TRIANGLE, Some("part")));
        assert!(matches!(store.referred(&mesh.reference), Some(Stored::Mesh(_))));
        assert!(store.stored("eve", &view.id).unwrap().is_none() && store.referred(&view.id).is_none());

        assert!(store.forget_model("ada", &view.id).unwrap());
        assert_eq!(store.sweep_uploads(Duration::ZERO).unwrap(), 0, "bob still has it");
        assert!(store.forget_model("bob", &view.id).unwrap());
        assert_eq!(store.sweep_uploads(Duration::from_secs(3600)).unwrap(), 0, "too young");
        assert_eq!(store.sweep_uploads(Duration::ZERO).unwrap(), 1);
        fs::remove_dir_all(root).unwrap();
    }
}

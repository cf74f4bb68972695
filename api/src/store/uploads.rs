//! Mesh files that callers uploaded: one file for the same bytes, and a view of it for each owner.

use std::collections::HashSet;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use lacuna_exchange::format::Format;

use super::{ModelView, Store, read_if_there, read_json};
use crate::digest::Digest;
use crate::documents::{Stored, StoredMesh};
use crate::files::{self, PendingFile};
use crate::inspection::MeshReport;

impl Store {
    /// A file to receive an upload.
    ///
    /// # Errors
    /// When the device fails.
    pub fn new_upload(&self) -> io::Result<PendingFile> {
        PendingFile::create_in(&self.root.join("uploads"))
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
        pending: PendingFile,
        digest: Digest,
        report: MeshReport,
    ) -> io::Result<(ModelView, bool)> {
        let key = Digest::of(format!("{} {digest}", report.format).as_bytes());
        let id = format!("mdl_{}", &key.hex()[..32]);
        if let Some(known) = self.model(owner, &id)? {
            return Ok((known, false));
        }
        pending.commit(&self.upload_path(digest))?;
        let view = ModelView { id, name, bytes: report.bytes, created: crate::clock::now(), digest, mesh: Some(report) };
        fs::create_dir_all(self.models(owner))?;
        files::write_whole(&self.models(owner).join(format!("{}.json", view.id)), &serde_json::to_vec(&view)?)?;
        Ok((view, true))
    }

    /// Where a mesh file is kept.
    #[must_use]
    pub fn upload_path(&self, digest: Digest) -> PathBuf {
        self.root.join("uploads").join(digest.hex())
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
        let bytes = read_if_there(&self.upload_path(digest))?;
        Ok(bytes.map(|bytes| StoredMesh { name, format, bytes, reference }))
    }

    /// Removes mesh files that no owner has any more and that were not touched for so long; tells how many.
    ///
    /// # Errors
    /// When the device fails.
    pub fn sweep_uploads(&self, age: Duration) -> io::Result<usize> {
        let oldest = SystemTime::now().checked_sub(age).unwrap_or(SystemTime::UNIX_EPOCH);
        let mut needed = HashSet::new();
        for owner in fs::read_dir(self.root.join("models"))? {
            for entry in fs::read_dir(owner?.path())? {
                let path = entry?.path();
                if path.extension().is_some_and(|ending| ending == "json") {
                    needed.extend(read_json::<ModelView>(&path)?.filter(|view| view.mesh.is_some()).map(|view| view.digest.hex()));
                }
            }
        }
        let mut removed = 0;
        for entry in fs::read_dir(self.root.join("uploads"))? {
            let entry = entry?;
            let old = match entry.metadata() {
                Err(error) if error.kind() == ErrorKind::NotFound => false,
                metadata => metadata?.modified()? < oldest,
            };
            if old && !needed.contains(&*entry.file_name().to_string_lossy()) {
                fs::remove_file(entry.path())?;
                removed += 1;
            }
        }
        Ok(removed)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
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
        store.keep_upload(owner, Some("part".into()), pending, Digest::of(TRIANGLE), report).unwrap()
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

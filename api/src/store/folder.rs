//! The shelf of one process: a folder with one file per thing, each there in full or not at all.

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use axum::body::{Body, Bytes};
use futures_util::stream;
use tokio::fs::File;
use tokio::io::{AsyncReadExt, AsyncSeekExt};

use crate::files::{self, PENDING_ENDING, PendingFile};

/// Bytes that are read from the disk at once.
const CHUNK: u64 = 1 << 16;

/// A data folder.
#[derive(Debug)]
pub struct Folder {
    root: PathBuf,
}

impl Folder {
    /// Opens a folder, makes the rooms that are missing in it and removes what an earlier process left half written.
    ///
    /// # Errors
    /// When the folder cannot be made or written.
    pub fn open(root: &Path, rooms: &[&str]) -> io::Result<Self> {
        for room in rooms {
            let folder = root.join(room);
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

    pub(super) fn probe(&self) -> io::Result<()> {
        // A full disk still takes names: only bytes tell.
        let mut file = PendingFile::create_in(&self.root)?;
        file.write_all(&[0; 4096])?;
        file.reread()?.sync_data()
    }

    /// Where a thing is kept.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    pub(super) fn put(&self, name: &str, bytes: &[u8]) -> io::Result<()> {
        let path = self.path(name);
        if let Some(room) = path.parent().filter(|room| !room.is_dir()) {
            fs::create_dir_all(room)?;
        }
        files::write_whole(&path, bytes)
    }

    /// Puts several things into one room.
    pub(super) fn put_together(&self, room: &str, things: &[(String, &[u8])]) -> io::Result<()> {
        files::write_together(&self.path(room), things)
    }

    pub(super) fn get(&self, name: &str) -> io::Result<Option<Vec<u8>>> {
        match fs::read(self.path(name)) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Whether the thing is there; it counts as new from now on, so that no sweep takes it from whoever asks.
    pub(super) fn renew(&self, name: &str) -> io::Result<bool> {
        match fs::File::open(self.path(name)) {
            Ok(file) => file.set_modified(SystemTime::now()).map(|()| true),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
            Err(error) => Err(error),
        }
    }

    pub(super) fn remove(&self, name: &str) -> io::Result<()> {
        match fs::remove_file(self.path(name)) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            other => other,
        }
    }

    /// Names in a room and when each thing came into it.
    pub(super) fn list(&self, room: &str) -> io::Result<Vec<(String, SystemTime)>> {
        let entries = match fs::read_dir(self.path(room)) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries?,
        };
        let mut found = Vec::new();
        for entry in entries {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            // What is being written, or was swept meanwhile, is not there.
            if let (false, Ok(facts)) = (name.ends_with(PENDING_ENDING), entry.metadata()) {
                found.push((name, facts.modified()?));
            }
        }
        Ok(found)
    }

    pub(super) async fn part(&self, name: &str, first: u64, length: u64) -> io::Result<Body> {
        let mut file = File::open(self.path(name)).await?;
        if first > 0 {
            file.seek(io::SeekFrom::Start(first)).await?;
        }
        if length <= CHUNK {
            return match next_chunk((file, length)).await? {
                Some((bytes, _)) => Ok(Body::from(bytes)),
                None => Ok(Body::empty()),
            };
        }
        Ok(Body::from_stream(stream::try_unfold((file, length), next_chunk)))
    }
}

async fn next_chunk((mut file, left): (File, u64)) -> io::Result<Option<(Bytes, (File, u64))>> {
    if left == 0 {
        return Ok(None);
    }
    let mut chunk = vec![0; usize::try_from(left.min(CHUNK)).unwrap_or(0)];
    file.read_exact(&mut chunk).await?;
    let left = left - chunk.len() as u64;
    Ok(Some((Bytes::from(chunk), (file, left))))
}

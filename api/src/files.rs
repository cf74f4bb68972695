//! Files that are there in full or not at all: written beside their place, synced, then renamed.

use std::cell::Cell;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use lacuna_kernel::budget::CancelToken;
use uuid::Uuid;

/// Ending of files that are being written; whoever owns a folder may remove leftovers of it.
pub const PENDING_ENDING: &str = ".lacuna-part";

/// A file that is being written. Dropping it without [`PendingFile::commit`] removes it, unless it is lent.
pub struct PendingFile {
    file: File,
    path: PathBuf,
    lent: bool,
}

impl PendingFile {
    /// Starts a file in a folder.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn create_in(folder: &Path) -> io::Result<Self> {
        let path = folder.join(format!(".{}{PENDING_ENDING}", Uuid::now_v7().simple()));
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(&path)?;
        Ok(Self { file, path, lent: false })
    }

    /// A file that another process has started: it is written here, and keeps or removes it there.
    ///
    /// # Errors
    /// When it is not there.
    pub fn lent(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        Ok(Self { file, path: path.to_owned(), lent: true })
    }

    /// Its name while it is being written.
    #[must_use]
    pub fn name(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Starts a file in the folder of the file that it will become.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn create_beside(target: &Path) -> io::Result<Self> {
        Self::create_in(folder_of(target))
    }

    /// The file's bytes from its start, for reading back what was written.
    ///
    /// # Errors
    /// When the device fails.
    pub fn reread(&mut self) -> io::Result<&mut File> {
        self.file.flush()?;
        self.file.seek(SeekFrom::Start(0))?;
        Ok(&mut self.file)
    }

    /// Puts the file in its place, over a file that stands there.
    ///
    /// # Errors
    /// When the device fails; then nothing is in the place that was not there before.
    pub fn commit(mut self, target: &Path) -> io::Result<()> {
        self.settle(target)
    }

    /// As [`PendingFile::commit`]; after a failure it can be tried again.
    ///
    /// # Errors
    /// As [`PendingFile::commit`].
    pub fn settle(&mut self, target: &Path) -> io::Result<()> {
        self.file.sync_all()?;
        fs::rename(&self.path, target)?;
        sync_folder(folder_of(target))
    }
}

impl Write for PendingFile {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.file.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for PendingFile {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.file.seek(position)
    }
}

/// A stream that fails once a token is fired, so that writing and reading large files stop as soon as
/// computing does.
pub struct Stoppable<'a, S> {
    /// The stream.
    pub stream: S,
    /// The flag.
    pub token: &'a CancelToken,
}

impl<S> Stoppable<'_, S> {
    fn check(&self) -> io::Result<()> {
        // Not `ErrorKind::Interrupted`: callers would try again.
        self.token.check().map_err(io::Error::other)
    }
}

impl<S: Write> Write for Stoppable<'_, S> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.check()?;
        self.stream.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

impl<S: Read> Read for Stoppable<'_, S> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.check()?;
        self.stream.read(buffer)
    }
}

impl<S: Seek> Seek for Stoppable<'_, S> {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.stream.seek(position)
    }
}

/// Bytes that several files may have together, and how many of them are left.
#[derive(Debug)]
pub struct Allowance {
    allowed: u64,
    left: Cell<u64>,
    /// Bytes that there would have been, once there was no room for some.
    asked: Cell<Option<u64>>,
}

impl Allowance {
    /// So many bytes, all of them left.
    #[must_use]
    pub fn new(allowed: u64) -> Self {
        Self { allowed, left: Cell::new(allowed), asked: Cell::new(None) }
    }

    /// How many bytes there may be, and how many there would have been at least, if that is more.
    #[must_use]
    pub fn exceeded(&self) -> Option<(u64, u64)> {
        self.asked.get().map(|asked| (self.allowed, asked))
    }

    fn take(&self, bytes: usize) -> io::Result<()> {
        let left = self.left.get();
        let Some(rest) = left.checked_sub(bytes as u64) else {
            self.asked.set(Some((self.allowed - left).saturating_add(bytes as u64)));
            return Err(io::Error::other("there are more bytes than the limit of the output allows"));
        };
        self.left.set(rest);
        Ok(())
    }
}

/// A stream that fails when it is to hold more than an allowance has left. What is written twice, such as a length that is known at the end, counts twice.
pub struct Metered<'a, S> {
    /// The stream.
    pub stream: S,
    /// What is left.
    pub allowance: &'a Allowance,
}

impl<S: Write> Write for Metered<'_, S> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.allowance.take(buffer.len())?;
        let written = self.stream.write(buffer)?;
        self.allowance.left.set(self.allowance.left.get() + (buffer.len() - written) as u64);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

impl<S: Seek> Seek for Metered<'_, S> {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.stream.seek(position)
    }
}

impl Drop for PendingFile {
    fn drop(&mut self) {
        // After a commit nothing has this name any more.
        if !self.lent {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Writes a whole file at once.
///
/// # Errors
/// When the device fails.
pub fn write_whole(target: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut pending = PendingFile::create_beside(target)?;
    pending.write_all(bytes)?;
    pending.commit(target)
}

/// Writes several whole files of one folder, which is waited for once.
///
/// # Errors
/// When the device fails; then some may be in their places.
pub fn write_together<B: AsRef<[u8]>>(folder: &Path, files: &[(String, B)]) -> io::Result<()> {
    let mut pending = Vec::with_capacity(files.len());
    for (_, bytes) in files {
        let mut file = PendingFile::create_in(folder)?;
        file.write_all(bytes.as_ref())?;
        pending.push(file);
    }
    // All are on their way to the device before the first is waited for.
    for file in &pending {
        file.file.sync_all()?;
    }
    for (file, (name, _)) in pending.iter().zip(files) {
        fs::rename(&file.path, folder.join(name))?;
    }
    if files.is_empty() { Ok(()) } else { sync_folder(folder) }
}

/// Writes a whole file at once, which outlives the process, but perhaps not a power failure: for what is found out again.
///
/// # Errors
/// When the device fails.
pub fn write_soon(target: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut pending = PendingFile::create_beside(target)?;
    pending.write_all(bytes)?;
    fs::rename(&pending.path, target)
}

/// What a model's name leaves for a file name: letters, digits, `-` and `_` of ASCII, 64 at most.
#[must_use]
pub fn safe_stem(name: &str) -> String {
    let kept: String = name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '-' }).take(64).collect();
    let stem = kept.trim_matches('-');
    if stem.is_empty() { "result".to_owned() } else { stem.to_owned() }
}

fn folder_of(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A rename lasts only when its folder is on the device too.
fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn names_cannot_leave_their_folder() {
        assert_eq!(safe_stem("../../etc/passwd"), "etc-passwd");
        assert_eq!(safe_stem("Koch curve \u{e9}"), "Koch-curve");
        assert_eq!(safe_stem("\u{3b1}"), "result");
    }

    #[test]
    fn files_share_an_allowance_to_the_last_byte() {
        let allowance = Allowance::new(10);
        let mut first = Metered { stream: Vec::new(), allowance: &allowance };
        first.write_all(b"123456").unwrap();
        let mut second = Metered { stream: Vec::new(), allowance: &allowance };
        second.write_all(b"7890").unwrap();
        assert_eq!((second.stream.as_slice(), allowance.exceeded()), (&b"7890"[..], None));
        assert!(second.write_all(b"123").is_err());
        assert_eq!((second.stream.len(), allowance.exceeded()), (4, Some((10, 13))));
    }

    #[test]
    fn nothing_is_left_of_an_abandoned_file() {
        let folder = std::env::temp_dir().join(format!("lacuna-files-{}", Uuid::now_v7()));
        fs::create_dir_all(&folder).unwrap();
        let target = folder.join("part.stl");
        fs::write(&target, b"old").unwrap();

        let mut pending = PendingFile::create_beside(&target).unwrap();
        pending.write_all(b"half").unwrap();
        drop(pending);
        assert_eq!((fs::read(&target).unwrap().as_slice(), fs::read_dir(&folder).unwrap().count()), (&b"old"[..], 1));

        let mut pending = PendingFile::create_beside(&target).unwrap();
        pending.write_all(b"whole").unwrap();
        assert_eq!(io::read_to_string(pending.reread().unwrap()).unwrap(), "whole");
        pending.commit(&target).unwrap();
        assert_eq!((fs::read(&target).unwrap().as_slice(), fs::read_dir(&folder).unwrap().count()), (&b"whole"[..], 1));
        fs::remove_dir_all(&folder).unwrap();
    }
}

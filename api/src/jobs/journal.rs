//! The records of one process on its device: jobs and the answers of finished work, one file for each.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::batch::BatchRecord;
use super::record::{Answer, JobRecord, JobState};
use crate::digest::Digest;
use crate::files;
use crate::store::folder::Folder;

const JOBS: &str = "jobs";
const ROOMS: [&str; 4] = [JOBS, "starts", "answers", "batches"];

/// The rooms of a data folder in which records are kept.
#[derive(Debug)]
pub(super) struct Journal {
    root: PathBuf,
}

impl Journal {
    /// Opens the rooms of a data folder and removes what an earlier process left half written.
    pub(super) fn open(root: &Path) -> io::Result<Self> {
        Folder::open(root, &ROOMS)?;
        Ok(Self { root: root.to_owned() })
    }

    /// Keeps a job's record in place of its earlier one: on the device when this returns.
    pub(super) fn keep(&self, record: &JobRecord) -> io::Result<()> {
        files::write_whole(&self.job(&record.view.id), &serde_json::to_vec(record)?)
    }

    /// Keeps the records of several new jobs.
    pub(super) fn keep_all(&self, records: &[JobRecord]) -> io::Result<()> {
        let file = |record: &JobRecord| Ok((job_file(&record.view.id), serde_json::to_vec(record)?));
        files::write_together(&self.root.join(JOBS), &records.iter().map(file).collect::<io::Result<Vec<_>>>()?)
    }

    /// Notes that a job is started: a job that brings the process down is known by its attempt. A power failure may undo
    /// the note, and is nothing that a job can bring about; so nobody waits for the device here.
    pub(super) fn note_start(&self, id: &str, attempt: u32) -> io::Result<()> {
        files::write_soon(&self.start(id), attempt.to_string().as_bytes())
    }

    /// Forgets the note of a job whose record says how often it was started.
    pub(super) fn forget_start(&self, id: &str) -> io::Result<()> {
        absent_is_fine(fs::remove_file(self.start(id)))
    }

    /// Forgets a job's record.
    pub(super) fn forget(&self, id: &str) -> io::Result<()> {
        absent_is_fine(fs::remove_file(self.job(id)))
    }

    /// Keeps a batch, whose jobs are kept already: with this it is accepted.
    pub(super) fn keep_batch(&self, batch: &BatchRecord) -> io::Result<()> {
        files::write_whole(&self.batch(&batch.id), &serde_json::to_vec(batch)?)
    }

    /// Forgets a batch, before its jobs: those that are left are forgotten at the next start.
    pub(super) fn forget_batch(&self, id: &str) -> io::Result<()> {
        absent_is_fine(fs::remove_file(self.batch(id)))
    }

    /// All batches.
    ///
    /// One that cannot be read is an error: its jobs would count as those of a batch that was never accepted, and go.
    pub(super) fn batches(&self) -> io::Result<Vec<BatchRecord>> {
        let mut batches = Vec::new();
        for entry in fs::read_dir(self.root.join("batches"))? {
            let path = entry?.path();
            let read = read_json(&path).map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())))?;
            batches.extend(read);
        }
        Ok(batches)
    }

    /// All records that can be read, the oldest first; one that cannot is told to the log and left alone.
    pub(super) fn jobs(&self) -> io::Result<Vec<JobRecord>> {
        let mut records: Vec<JobRecord> = Vec::new();
        for entry in fs::read_dir(self.root.join(JOBS))? {
            let path = entry?.path();
            match read_json(&path) {
                Ok(Some(record)) => records.push(self.with_start(record)),
                Ok(None) => {}
                Err(error) => tracing::error!(file = %path.display(), %error, "unreadable job record"),
            }
        }
        records.sort_by(|a, b| a.view.id.cmp(&b.view.id));
        Ok(records)
    }

    /// The record as it was when the process ended.
    fn with_start(&self, mut record: JobRecord) -> JobRecord {
        let noted = fs::read_to_string(self.start(&record.view.id)).ok().and_then(|text| text.parse().ok());
        if let (JobState::Queued, Some(attempt)) = (record.view.state, noted) {
            record.view.state = JobState::Running;
            record.view.attempt = attempt;
        }
        record
    }

    /// What the same work left earlier.
    pub(super) fn answer(&self, work: Digest) -> io::Result<Option<Answer>> {
        read_json(&self.answer_path(work))
    }

    /// Keeps what work left. If the power fails first, the work is done again.
    pub(super) fn note_answer(&self, work: Digest, answer: &Answer) -> io::Result<()> {
        files::write_soon(&self.answer_path(work), &serde_json::to_vec(answer)?)
    }

    /// Forgets the answers that no job has any more.
    pub(super) fn sweep(&self, needed: impl Fn(Digest) -> bool) -> io::Result<()> {
        for entry in fs::read_dir(self.root.join("answers"))? {
            let path = entry?.path();
            let stem = path.file_stem().map(|stem| format!("sha256:{}", stem.to_string_lossy())).unwrap_or_default();
            if stem.parse().is_ok_and(|work| !needed(work)) {
                fs::remove_file(path)?;
            }
        }
        Ok(())
    }

    fn job(&self, id: &str) -> PathBuf {
        self.root.join(JOBS).join(job_file(id))
    }

    fn batch(&self, id: &str) -> PathBuf {
        self.root.join("batches").join(format!("{id}.json"))
    }

    fn start(&self, id: &str) -> PathBuf {
        self.root.join("starts").join(id)
    }

    fn answer_path(&self, work: Digest) -> PathBuf {
        self.root.join("answers").join(format!("{}.json", work.hex()))
    }
}

fn job_file(id: &str) -> String {
    format!("{id}.json")
}

fn absent_is_fine(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

fn read_json<T: DeserializeOwned>(path: &Path) -> io::Result<Option<T>> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(serde_json::from_slice(&bytes)?)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

//! The shelf that several processes share: a bucket of an S3-compatible object store.

use std::io::{self, ErrorKind, Read};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use axum::body::Body;
use futures_util::{StreamExt, TryStreamExt};
use object_store::aws::{AmazonS3Builder, Checksum};
use object_store::path::Path;
use object_store::{ClientOptions, GetOptions, ObjectStore, ObjectStoreExt, RetryConfig, WriteMultipart};
use tokio::runtime::Handle;

use crate::files::PendingFile;

/// Bytes of a part of an upload; S3 takes at most 10 000 parts, so files of up to 78 GiB.
const PART: usize = 8 << 20;

/// Parts that are on their way at once.
const PARTS: usize = 4;

/// How long the store may be silent.
const SILENCE: Duration = Duration::from_secs(20);

/// How long it is asked again and again before it counts as out of reach.
const PATIENCE: Duration = Duration::from_secs(8);

/// A bucket, and the folder in it.
#[derive(Debug)]
pub struct Bucket {
    objects: Arc<dyn ObjectStore>,
    folder: String,
    runtime: Handle,
}

impl Bucket {
    /// A bucket by its address, `s3://BUCKET/FOLDER`; endpoint, region and credentials come from the environment
    /// (`AWS_ENDPOINT_URL`, `AWS_REGION`, `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY` and the others that S3 clients know).
    ///
    /// # Errors
    /// When the address or the environment cannot be understood.
    pub fn open(address: &str, runtime: Handle) -> io::Result<Self> {
        let understood = |error: object_store::Error| io::Error::new(ErrorKind::InvalidInput, error.to_string());
        let (bucket, folder) = parts(address).ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "s3://BUCKET/FOLDER is expected"))?;
        // A large file may take its time; only silence is a failure.
        let options = ClientOptions::new().with_connect_timeout(PATIENCE).with_timeout_disabled().with_read_timeout(SILENCE);
        let retries = RetryConfig { max_retries: 4, retry_timeout: PATIENCE, ..RetryConfig::default() };
        let builder = AmazonS3Builder::from_env().with_bucket_name(bucket).with_client_options(options).with_retry(retries);
        // Whoever names an endpoint without TLS means it; the digest of every part is checked by the store.
        let objects = builder.with_allow_http(true).with_checksum_algorithm(Checksum::SHA256).build().map_err(understood)?;
        Ok(Self { objects: Arc::new(objects), folder: folder.to_owned(), runtime })
    }

    fn path(&self, name: &str) -> Path {
        Path::from_iter(self.folder.split('/').chain(name.split('/')).filter(|part| !part.is_empty()))
    }

    pub(super) fn probe(&self) -> io::Result<()> {
        absent(self.runtime.block_on(self.objects.head(&self.path("probe")))).map(drop)
    }

    pub(super) fn put(&self, name: &str, bytes: &[u8]) -> io::Result<()> {
        self.runtime.block_on(self.objects.put(&self.path(name), bytes.to_vec().into())).map(drop).map_err(failed)
    }

    /// Puts a file into its place part by part. The object appears when all of it has arrived.
    pub(super) fn put_file(&self, name: &str, pending: &mut PendingFile) -> io::Result<()> {
        let file = pending.reread()?;
        let length = file.metadata()?.len();
        if length <= PART as u64 {
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes)?;
            return self.put(name, &bytes);
        }
        let upload = self.runtime.block_on(self.objects.put_multipart(&self.path(name))).map_err(failed)?;
        let mut parts = WriteMultipart::new_with_chunk_size(upload, PART);
        let mut buffer = vec![0; PART];
        let sent = loop {
            match file.read(&mut buffer) {
                Ok(0) => break Ok(()),
                Ok(count) => {
                    // The uploads are tasks of the runtime, and only it can start them.
                    let ready = self.runtime.block_on(async {
                        parts.wait_for_capacity(PARTS).await?;
                        parts.write(&buffer[..count]);
                        Ok(())
                    });
                    if let Err(error) = ready {
                        break Err(failed(error));
                    }
                }
                Err(error) => break Err(error),
            }
        };
        match sent {
            Ok(()) => self.runtime.block_on(parts.finish()).map(drop).map_err(failed),
            Err(error) => {
                let _ = self.runtime.block_on(parts.abort());
                Err(error)
            }
        }
    }

    pub(super) fn get(&self, name: &str) -> io::Result<Option<Vec<u8>>> {
        let found = self.runtime.block_on(async {
            let answer = self.objects.get(&self.path(name)).await?;
            answer.bytes().await
        });
        absent(found).map(|found| found.map(|bytes| bytes.to_vec()))
    }

    pub(super) fn holds(&self, name: &str) -> io::Result<bool> {
        absent(self.runtime.block_on(self.objects.head(&self.path(name)))).map(|found| found.is_some())
    }

    pub(super) fn remove(&self, name: &str) -> io::Result<()> {
        absent(self.runtime.block_on(self.objects.delete(&self.path(name)))).map(drop)
    }

    pub(super) fn list(&self, room: &str) -> io::Result<Vec<(String, SystemTime)>> {
        let room = self.path(room);
        let listed = self.objects.list(Some(&room)).map(|entry| {
            entry.map(|facts| (facts.location.filename().unwrap_or_default().to_owned(), SystemTime::from(facts.last_modified)))
        });
        self.runtime.block_on(listed.try_collect()).map_err(failed)
    }

    pub(super) async fn part(&self, name: &str, first: u64, length: u64) -> io::Result<Body> {
        let options = GetOptions { range: (length > 0).then(|| (first..first + length).into()), ..GetOptions::default() };
        let answer = self.objects.get_opts(&self.path(name), options).await.map_err(failed)?;
        Ok(Body::from_stream(answer.into_stream().map_err(failed)))
    }
}

/// Bucket and folder of an address.
fn parts(address: &str) -> Option<(&str, &str)> {
    let rest = address.strip_prefix("s3://")?;
    let (bucket, folder) = rest.split_once('/').unwrap_or((rest, ""));
    (!bucket.is_empty()).then_some((bucket, folder))
}

fn absent<T>(result: object_store::Result<T>) -> io::Result<Option<T>> {
    match result {
        Ok(found) => Ok(Some(found)),
        Err(object_store::Error::NotFound { .. }) => Ok(None),
        Err(error) => Err(failed(error)),
    }
}

/// The store's own words name addresses of the inside: they are for the log.
fn failed(error: object_store::Error) -> io::Error {
    if matches!(error, object_store::Error::NotFound { .. }) {
        return io::Error::new(ErrorKind::NotFound, "there is no such object");
    }
    tracing::warn!(%error, "the object store failed");
    io::Error::new(ErrorKind::NetworkUnreachable, "the object store does not answer as it should")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_name_a_bucket_and_perhaps_a_folder() {
        assert_eq!(parts("s3://parts"), Some(("parts", "")));
        assert_eq!(parts("s3://parts/a/b"), Some(("parts", "a/b")));
        for bad in ["s3://", "s3:///a", "http://parts", "parts"] {
            assert_eq!(parts(bad), None, "{bad}");
        }
    }
}

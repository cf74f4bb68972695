//! Results from a service: resumed where they broke, and held against their digests.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::time::Duration;

use ureq::http::{Method, StatusCode};

use super::server::Server;
use crate::digest::Digest;
use crate::jobs::record::Output;
use crate::problem::{Problem, ProblemKind};

/// How often a download may break without a single byte in between.
const TRIES: u32 = 5;

/// Completes a file that holds the first bytes of a result, or none, and checks its digest.
pub(super) fn complete(server: &Server, output: &Output, file: &mut File) -> Result<(), Problem> {
    let failed = |error: std::io::Error| Problem::io(format!("{} could not be kept", output.file_name), &error);
    let mut have = file.seek(SeekFrom::End(0)).map_err(failed)?;
    if have > output.bytes {
        // Not of this result.
        have = restart(file).map_err(failed)?;
    }
    let mut failures = 0;
    while have < output.bytes {
        let before = have;
        match more(server, output, file, have) {
            Ok(Some(length)) => have = length,
            Ok(None) => have = restart(file).map_err(failed)?,
            Err(problem) if problem.kind != ProblemKind::ServiceUnreachable => return Err(problem),
            Err(problem) => {
                have = file.seek(SeekFrom::End(0)).map_err(failed)?;
                failures = if have > before { 0 } else { failures + 1 };
                if failures >= TRIES {
                    return Err(problem);
                }
                std::thread::sleep(Duration::from_millis(200) * failures);
            }
        }
    }
    file.seek(SeekFrom::Start(0)).map_err(failed)?;
    let (digest, bytes) = Digest::of_stream(file).map_err(failed)?;
    if digest == output.digest {
        return Ok(());
    }
    let detail =
        format!("{} arrived damaged: {bytes} bytes with the digest {digest}, not {}; fetch it again", output.file_name, output.digest);
    restart(file).map_err(failed)?;
    Err(Problem::new(ProblemKind::InputOutput, detail).code("download.digest"))
}

fn restart(file: &mut File) -> std::io::Result<u64> {
    file.set_len(0)?;
    file.seek(SeekFrom::Start(0))
}

/// Appends what comes; the length then, or nothing if the file must be begun again.
fn more(server: &Server, output: &Output, file: &mut File, have: u64) -> Result<Option<u64>, Problem> {
    let (range, tag) = (format!("bytes={have}-"), format!("\"{}\"", output.digest));
    let headers = [("range", range.as_str()), ("if-range", tag.as_str())];
    let path = format!("/v1/results/{}", output.digest);
    let mut answer = server.ask(Method::GET, &path, if have > 0 { &headers } else { &[] }, b"")?;
    if have > 0 && answer.status() != StatusCode::PARTIAL_CONTENT {
        return Ok(None);
    }
    let mut source = answer.body_mut().with_config().limit(u64::MAX).reader();
    let broken = |error: std::io::Error| {
        Problem::new(
            ProblemKind::ServiceUnreachable,
            format!("the download of {} from {} broke off: {error}", output.file_name, server.base()),
        )
    };
    let mut buffer = vec![0_u8; 1 << 16];
    let mut length = have;
    loop {
        let count = std::io::Read::read(&mut source, &mut buffer).map_err(broken)?;
        if count == 0 {
            return if length < output.bytes { Err(broken(std::io::ErrorKind::UnexpectedEof.into())) } else { Ok(Some(length)) };
        }
        file.write_all(&buffer[..count]).map_err(|error| Problem::io(&output.file_name, &error))?;
        length += count as u64;
    }
}

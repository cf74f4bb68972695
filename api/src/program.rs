//! Which program this is.

use std::fs::File;
use std::sync::OnceLock;

use crate::digest::Digest;

/// The digest of the program that runs, found once and then remembered; nothing where the system does not let it be read. Two processes with the same digest run the same bytes.
///
/// Cost at the first call: the program is read whole, some tens of milliseconds for a release build.
#[must_use]
pub fn digest() -> Option<Digest> {
    static FOUND: OnceLock<Option<Digest>> = OnceLock::new();
    *FOUND.get_or_init(|| {
        // The file that was started, even if another has taken its place since; elsewhere than on Linux only the place is known.
        let program = File::open("/proc/self/exe").or_else(|_| File::open(std::env::current_exe()?));
        program.and_then(|mut program| Digest::of_stream(&mut program)).ok().map(|(digest, _)| digest)
    })
}

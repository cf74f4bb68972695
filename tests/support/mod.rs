//! Helpers; what is tested stands in `tests/*.rs`.

#![allow(clippy::unwrap_used, clippy::print_stderr)]

pub mod binary;
pub mod cases;
pub mod collector;
pub mod inside;
pub mod objects;
pub mod postgres;
pub mod python;
pub mod random;
pub mod scratch;
pub mod service;
pub mod stage;

use std::path::{Path, PathBuf};

/// The top of the repository.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_path_buf()
}

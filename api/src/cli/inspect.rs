//! `lacuna inspect`: what a mesh file really contains, and what a slicer will make of it.

use std::path::Path;

use lacuna_exchange::format::{MeshFile, ReadLimits};

use super::{print_json, read_input};
use crate::inspection;
use crate::problem::Problem;

/// Reads a mesh file and tells what is in it as JSON.
pub(super) fn inspect(path: &Path) -> Result<(), Problem> {
    let (file, bytes) = mesh_file(path)?;
    print_json(&inspection::report(&file, bytes)?)
}

/// Reads a mesh file; gives its length too.
pub(super) fn mesh_file(path: &Path) -> Result<(MeshFile, u64), Problem> {
    let limits = ReadLimits::default();
    let bytes = read_input(path, limits.file_bytes)?;
    Ok((inspection::read(&bytes, None, &limits)?, bytes.len() as u64))
}

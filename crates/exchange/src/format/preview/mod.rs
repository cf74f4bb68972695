//! Stub.
use super::{FormatError, Geometry};
use std::io::Write;
/// Options.
#[derive(Default)]
pub struct PreviewOptions;
pub fn write<W: Write>(_: Geometry<'_>, _: &PreviewOptions, _: &mut W) -> Result<(), FormatError> { Ok(()) }

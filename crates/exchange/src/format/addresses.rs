//! The addresses of an evaluation's vertices, segments and triangles, as comma-separated values.
//!
//! One line for each, in the order in which the other formats write them, after a line of titles:
//!
//! ```text
//! element,index,address
//! vertex,0,0: /0 /0
//! segment,0,0: 1 0
//! triangle,0,0: 2 1
//! ```
//!
//! An address begins with the root cell; `i` steps to child i, `/m` to boundary m. It belongs to the cell that was
//! first met there: neighbours share it.

use super::error::FormatError;
use super::geometry::Geometry;
use super::text::CHUNK_BYTES;
use lacuna_kernel::attractor::CellAddress;
use std::io::Write;

pub(crate) fn write<W: Write>(geometry: &Geometry<'_>, sink: &mut W) -> Result<(), FormatError> {
    let Geometry::Sample(sample) = geometry else { return Err(FormatError::NoAddresses) };
    let complex = sample.complex.as_ref().ok_or(FormatError::NoAddresses)?;
    if complex.drawn_vertices() < sample.vertices.len() as u64 {
        return Err(FormatError::NoAddresses);
    }
    let mut text = Vec::with_capacity(CHUNK_BYTES + 4096);
    text.extend_from_slice(b"element,index,address\n");
    let mut line = |element: &str, index: usize, address: Option<CellAddress>| -> Result<(), FormatError> {
        let address = address.ok_or(FormatError::NoAddresses)?;
        writeln!(text, "{element},{index},{address}")?;
        super::off::flush_full(&mut text, sink)
    };
    (0..sample.vertices.len()).try_for_each(|index| line("vertex", index, complex.vertex_address(index)))?;
    (0..sample.segments.len()).try_for_each(|index| line("segment", index, complex.segment_address(index)))?;
    (0..sample.triangles.len()).try_for_each(|index| line("triangle", index, complex.triangle_address(index)))?;
    sink.write_all(&text)?;
    sink.flush()?;
    Ok(())
}

//! Polygon files: binary little-endian out; text and both binary orders in.
//!
//! Format: Turk, The PLY Polygon File Format (1994): a header in text that lists elements and the
//! types of their properties, then the elements in that order.

mod read;

pub(crate) use read::read;

use super::error::{FormatError, Place};
use super::geometry::{Piece, counts};
use super::off::flush_full;
use super::scanner::Scanner;
use super::text::{CHUNK_BYTES, one_line, singles};
use super::{Format, Metadata};
use std::io::{Read, Write};

pub(crate) fn write<W: Write>(pieces: &[Piece<'_>], metadata: &Metadata<'_>, sink: &mut W) -> Result<(), FormatError> {
    let counts = counts(pieces);
    // Indices are of the type `int`, the only one that every reader takes.
    let most = i32::MAX as u64;
    if counts.vertices > most {
        return Err(FormatError::limit(Place::File, "vertices", counts.vertices, most));
    }
    let mut bytes = Vec::with_capacity(CHUNK_BYTES + 4096);
    bytes.extend_from_slice(header(pieces, metadata).as_bytes());
    for vertex in pieces.iter().flat_map(|piece| piece.vertices) {
        for number in singles(vertex) {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        flush_full(&mut bytes, sink)?;
    }
    let mut before = 0;
    for piece in pieces {
        for triangle in piece.triangles {
            bytes.extend_from_slice(&face(triangle, before));
            flush_full(&mut bytes, sink)?;
        }
        before += piece.vertices.len() as u32;
    }
    let mut before = 0;
    for piece in pieces {
        for segment in piece.segments {
            for index in segment {
                bytes.extend_from_slice(&(before + index).to_le_bytes());
            }
            flush_full(&mut bytes, sink)?;
        }
        before += piece.vertices.len() as u32;
    }
    sink.write_all(&bytes)?;
    sink.flush()?;
    Ok(())
}

fn header(pieces: &[Piece<'_>], metadata: &Metadata<'_>) -> String {
    let counts = counts(pieces);
    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment {} units mm\n", one_line(metadata.application));
    if let Some(title) = metadata.title {
        header.push_str(&format!("comment {}\n", one_line(title)));
    }
    header.push_str(&format!("element vertex {}\nproperty float x\nproperty float y\nproperty float z\n", counts.vertices));
    if counts.triangles > 0 {
        header.push_str(&format!("element face {}\nproperty list uchar int vertex_indices\n", counts.triangles));
    }
    if counts.segments > 0 {
        header.push_str(&format!("element edge {}\nproperty int vertex1\nproperty int vertex2\n", counts.segments));
    }
    header.push_str("end_header\n");
    header
}

/// A face's bytes: the number of its corners and their indices.
fn face(triangle: &[u32; 3], before: u32) -> [u8; 13] {
    let mut face = [3; 13];
    for (four, index) in face[1..].chunks_exact_mut(4).zip(triangle) {
        four.copy_from_slice(&(before + index).to_le_bytes());
    }
    face
}

pub(crate) fn verify<R: Read>(pieces: &[Piece<'_>], source: &mut R) -> Result<(), FormatError> {
    let counts = counts(pieces);
    let mut scanner = Scanner::new(source, Format::Ply);
    scanner.expect(b"ply\nformat binary_little_endian 1.0\n")?;
    while scanner.expect(b"comment ").is_ok() {
        scanner.skip_past(b"\n", 1 << 20)?;
    }
    scanner.expect(b"element vertex ")?;
    scanner.index(counts.vertices, b'\n')?;
    scanner.expect(b"property float x\nproperty float y\nproperty float z\nelement face ")?;
    scanner.index(counts.triangles, b'\n')?;
    scanner.expect(b"property list uchar int vertex_indices\nend_header\n")?;
    for (number, vertex) in (0..).zip(pieces.iter().flat_map(|piece| piece.vertices)) {
        scanner.element = Place::Vertex(number);
        scanner.binary_numbers(singles(vertex))?;
    }
    let (mut number, mut before) = (0, 0);
    for piece in pieces {
        for triangle in piece.triangles {
            scanner.element = Place::Triangle(number);
            let (found, expected) = (scanner.bytes::<13>()?, face(triangle, before));
            if found != expected {
                return Err(scanner.differs(format!("{triangle:?} after {before}"), format!("the bytes {found:02x?}")));
            }
            number += 1;
        }
        before += piece.vertices.len() as u32;
    }
    scanner.end()
}

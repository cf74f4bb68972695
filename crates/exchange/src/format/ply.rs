//! Polygon files: binary little-endian out; text and both binary orders in.
//!
//! Format: Turk, The PLY Polygon File Format (1994): a header in text that lists elements and the
//! types of their properties, then the elements in that order.

mod fields;
mod read;

pub use fields::{ScalarField, write_fields};
pub(crate) use read::read;

use super::error::{FormatError, Place};
use super::geometry::{Piece, Split, counts};
use super::off::flush_full;
use super::scanner::Scanner;
use super::text::{CHUNK_BYTES, one_line, singles};
use super::{Format, Metadata};
use glam::DVec3;
use std::io::{Read, Seek, SeekFrom, Write};

pub(crate) fn write<W: Write>(pieces: &[Piece<'_>], metadata: &Metadata<'_>, sink: &mut W) -> Result<(), FormatError> {
    // Normals are properties of vertices: pieces with some and others without do not occur together.
    if let [piece] = pieces
        && let Some(split) = Split::of(piece)
    {
        return write_with_normals(piece, &split, metadata, sink);
    }
    let counts = counts(pieces);
    check_count(counts.vertices)?;
    let wide = counts_are_wide(pieces);
    let mut bytes = Vec::with_capacity(CHUNK_BYTES + 4096);
    bytes.extend_from_slice(header(pieces, metadata).as_bytes());
    for vertex in pieces.iter().flat_map(|piece| piece.vertices) {
        push(vertex, &mut bytes);
        flush_full(&mut bytes, sink)?;
    }
    let mut before = 0;
    for piece in pieces {
        piece.each_face(|corners| {
            if let Ok(triangle) = <&[u32; 3]>::try_from(corners)
                && !wide
            {
                bytes.extend_from_slice(&face(triangle, before));
            } else {
                let count = (corners.len() as u32).to_le_bytes();
                bytes.extend_from_slice(if wide { &count } else { &count[..1] });
                corners.iter().for_each(|index| bytes.extend_from_slice(&(before + index).to_le_bytes()));
            }
            flush_full(&mut bytes, sink)
        })?;
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

/// Indices are of the type `int`, the only one that every reader takes.
fn check_count(vertices: u64) -> Result<(), FormatError> {
    let most = i32::MAX as u64;
    if vertices > most { Err(FormatError::limit(Place::File, "vertices", vertices, most)) } else { Ok(()) }
}

fn push(vector: &DVec3, bytes: &mut Vec<u8>) {
    singles(vector).into_iter().for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
}

/// As [`write()`], with the properties nx, ny, nz.
fn write_with_normals<W: Write>(piece: &Piece<'_>, split: &Split, metadata: &Metadata<'_>, sink: &mut W) -> Result<(), FormatError> {
    check_count(split.normals.len() as u64)?;
    let counts = [split.normals.len() as u64, split.triangles.len() as u64, piece.segments.len() as u64];
    let further = Further { vertex: "property float nx\nproperty float ny\nproperty float nz\n".into(), ..Further::default() };
    let mut bytes = header_of(counts, false, &further, metadata).into_bytes();
    let copies = split.copies.iter().map(|&vertex| &piece.vertices[vertex as usize]);
    for (vertex, normal) in piece.vertices.iter().chain(copies).zip(&split.normals) {
        push(vertex, &mut bytes);
        push(normal, &mut bytes);
        flush_full(&mut bytes, sink)?;
    }
    for triangle in &split.triangles {
        bytes.extend_from_slice(&face(triangle, 0));
        flush_full(&mut bytes, sink)?;
    }
    for index in piece.segments.as_flattened() {
        bytes.extend_from_slice(&index.to_le_bytes());
        flush_full(&mut bytes, sink)?;
    }
    sink.write_all(&bytes)?;
    sink.flush()?;
    Ok(())
}

/// A file of points whose number is known when they have all been written: memory stays flat. The header is as long
/// for every number of points, and is written again at the end.
pub struct PointFile<'a, W> {
    sink: W,
    metadata: &'a Metadata<'a>,
    bytes: Vec<u8>,
    written: u64,
}

impl<'a, W: Write + Seek> PointFile<'a, W> {
    /// Starts a file where the sink is.
    ///
    /// # Errors
    /// When the sink fails.
    pub fn start(mut sink: W, metadata: &'a Metadata<'a>) -> Result<Self, FormatError> {
        sink.write_all(point_header(0, metadata).as_bytes())?;
        Ok(Self { sink, metadata, bytes: Vec::with_capacity(CHUNK_BYTES + 4096), written: 0 })
    }

    /// Adds points, in mm, rounded to single precision.
    ///
    /// # Errors
    /// When the sink fails.
    pub fn push(&mut self, points: &[DVec3]) -> Result<(), FormatError> {
        for point in points {
            for number in singles(point) {
                self.bytes.extend_from_slice(&number.to_le_bytes());
            }
            flush_full(&mut self.bytes, &mut self.sink)?;
        }
        self.written += points.len() as u64;
        Ok(())
    }

    /// Writes the rest and the header with the number of points.
    ///
    /// # Errors
    /// When the sink fails.
    pub fn finish(mut self) -> Result<(), FormatError> {
        self.sink.write_all(&self.bytes)?;
        let end = self.sink.stream_position()?;
        let header = point_header(self.written, self.metadata);
        self.sink.seek(SeekFrom::Start(end - 12 * self.written - header.len() as u64))?;
        self.sink.write_all(header.as_bytes())?;
        self.sink.seek(SeekFrom::Start(end))?;
        self.sink.flush()?;
        Ok(())
    }
}

/// The header of a file of points, with a comment of as many blanks as the number leaves of twenty digits.
fn point_header(count: u64, metadata: &Metadata<'_>) -> String {
    let header = header_of([count, 0, 0], false, &Further::default(), metadata);
    let blanks = " ".repeat(20 - count.to_string().len());
    // Titles may hold any words, but are before the elements.
    let (comments, elements) = header.split_at(header.rfind("element vertex").unwrap_or(header.len()));
    format!("{comments}comment{blanks}\n{elements}")
}

/// Whether a face has more corners than one byte counts.
fn counts_are_wide(pieces: &[Piece<'_>]) -> bool {
    pieces.iter().any(|piece| piece.most_corners() > 255)
}

fn header(pieces: &[Piece<'_>], metadata: &Metadata<'_>) -> String {
    let counts = counts(pieces);
    header_of([counts.vertices, counts.faces, counts.segments], counts_are_wide(pieces), &Further::default(), metadata)
}

/// What a header says besides.
#[derive(Default)]
struct Further {
    /// Comments.
    comments: Vec<String>,
    /// Lines of the vertices' properties after the coordinates.
    vertex: String,
    /// Lines of the faces' properties after the corners.
    face: String,
}

fn header_of([vertices, faces, segments]: [u64; 3], wide: bool, further: &Further, metadata: &Metadata<'_>) -> String {
    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment {} units mm\n", one_line(metadata.application));
    for words in metadata.title.into_iter().chain(further.comments.iter().map(String::as_str)) {
        header.push_str(&format!("comment {}\n", one_line(words)));
    }
    header.push_str(&format!("element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n{}", further.vertex));
    if faces > 0 {
        let count = if wide { "uint" } else { "uchar" };
        header.push_str(&format!("element face {faces}\nproperty list {count} int vertex_indices\n{}", further.face));
    }
    if segments > 0 {
        header.push_str(&format!("element edge {}\nproperty int vertex1\nproperty int vertex2\n", segments));
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::{ReadLimits, read};
    use super::*;

    #[test]
    fn a_file_of_points_has_its_number_in_its_header() {
        let metadata = Metadata { title: Some("element vertex"), ..Metadata::default() };
        let mut bytes = std::io::Cursor::new(b"before".to_vec());
        bytes.set_position(6);
        let mut file = PointFile::start(&mut bytes, &metadata).unwrap();
        let points: Vec<DVec3> = (0..12_345).map(|i| DVec3::new(f64::from(i), 0.5, -1.0)).collect();
        points.chunks(1000).for_each(|chunk| file.push(chunk).unwrap());
        file.finish().unwrap();
        let bytes = bytes.into_inner();
        let text = String::from_utf8_lossy(&bytes[6..300]);
        assert!(text.contains("\nelement vertex 12345\n"), "{text}");
        assert_eq!(bytes.len() - 6, point_header(0, &metadata).len() + 12 * points.len());
        assert_eq!(read(&bytes[6..], None, &ReadLimits::default()).unwrap().mesh.vertices, points);
    }
}

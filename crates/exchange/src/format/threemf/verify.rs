//! Proof that a written 3MF file carries the mesh it was written from.

use super::super::Format;
use super::super::error::{FormatError, Place};
use super::super::geometry::Piece;
use super::super::scanner::Scanner;
use super::super::text::singles;
use super::{BUILD_START, MODEL_END, MODEL_PART, OBJECT_END, VERTICES_END, VERTICES_START};
use std::io::{BufReader, Read, Seek};

/// Longest head or object start that is scanned for its end: titles and certificates are small.
const LONGEST_WORDS: u64 = 64 << 20;

/// Inflates the model part once and compares as it goes; the archive reader checks the sum of the
/// bytes at the end.
pub(crate) fn verify<R: Read + Seek>(pieces: &[Piece<'_>], source: &mut R) -> Result<(), FormatError> {
    let unusable = |source| FormatError::Archive { place: Place::File, source };
    let mut archive = zip::ZipArchive::new(BufReader::with_capacity(256 << 10, source)).map_err(unusable)?;
    let part = archive.by_name(MODEL_PART).map_err(unusable)?;
    let mut scanner = Scanner::new(part, Format::ThreeMf);
    let (mut vertex_number, mut triangle_number) = (0, 0);
    for piece in pieces {
        scanner.skip_past(VERTICES_START, LONGEST_WORDS)?;
        for vertex in piece.vertices {
            scanner.element = Place::Vertex(vertex_number);
            let [x, y, z] = singles(vertex);
            scanner.expect(b"<vertex x=\"")?;
            scanner.number(x, b'"')?;
            scanner.expect(b" y=\"")?;
            scanner.number(y, b'"')?;
            scanner.expect(b" z=\"")?;
            scanner.number(z, b'"')?;
            scanner.expect(b"/>\n")?;
            vertex_number += 1;
        }
        scanner.expect(VERTICES_END)?;
        for triangle in piece.triangles {
            scanner.element = Place::Triangle(triangle_number);
            scanner.expect(b"<triangle v1=\"")?;
            scanner.index(u64::from(triangle[0]), b'"')?;
            scanner.expect(b" v2=\"")?;
            scanner.index(u64::from(triangle[1]), b'"')?;
            scanner.expect(b" v3=\"")?;
            scanner.index(u64::from(triangle[2]), b'"')?;
            scanner.expect(b"/>\n")?;
            triangle_number += 1;
        }
        scanner.expect(OBJECT_END)?;
    }
    scanner.element = Place::File;
    scanner.expect(BUILD_START)?;
    for number in 1..=pieces.len() as u64 {
        scanner.expect(b"<item objectid=\"")?;
        scanner.index(number, b'"')?;
        scanner.expect(b"/>\n")?;
    }
    scanner.expect(MODEL_END)?;
    scanner.end()
}

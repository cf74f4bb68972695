//! Virtual reality modelling language: the polygons of both versions in, version 2.0 out.
//!
//! Formats: ISO/IEC 14772-1:1997 (VRML97, which calls itself 2.0); G. Bell, A. Parisi, M. Pesce, The Virtual Reality
//! Modeling Language, version 1.0 (1995), which is Open Inventor's ASCII format with fewer nodes. Written are one
//! `Shape` each for faces, wires and points, over coordinates that they share by name.

mod scan;
mod scene;
mod walk;

use super::error::{FormatError, Place};
use super::geometry::Piece;
use super::limits::MeshBuilder;
use super::off::flush_full;
use super::read::{MeshFacts, MeshFile};
use super::scanner::Scanner;
use super::text::{CHUNK_BYTES, one_line, push_integer, push_position, singles};
use super::{Format, Metadata, ReadLimits};
use glam::DVec3;
use std::io::{Read, Write};

const HEADER: &str = "#VRML V2.0 utf8\n";

pub(crate) fn write<W: Write>(pieces: &[Piece<'_>], metadata: &Metadata<'_>, sink: &mut W) -> Result<(), FormatError> {
    let mut text = Vec::with_capacity(CHUNK_BYTES + 4096);
    text.extend_from_slice(format!("{HEADER}# {} units mm\n", one_line(metadata.application)).as_bytes());
    if let Some(title) = metadata.title {
        text.extend_from_slice(format!("# {}\n", one_line(title)).as_bytes());
    }
    for (number, piece) in pieces.iter().enumerate() {
        write_piece(number, piece, &mut text, sink)?;
    }
    sink.write_all(&text)?;
    sink.flush()?;
    Ok(())
}

/// A group of at most three shapes; the first that has indices defines the coordinates.
fn write_piece<W: Write>(number: usize, piece: &Piece<'_>, text: &mut Vec<u8>, sink: &mut W) -> Result<(), FormatError> {
    text.extend_from_slice(group(number, piece).as_bytes());
    let coordinates = |text: &mut Vec<u8>, sink: &mut W| {
        text.extend_from_slice(format!("coord DEF points_{number} Coordinate {{ point [\n").as_bytes());
        write_points(piece.vertices.iter(), text, sink)
    };
    if !piece.triangles.is_empty() {
        // Both sides of a surface are to be seen; of a solid only its outside can be.
        let solid = if piece.is_closed() { "TRUE" } else { "FALSE" };
        text.extend_from_slice(format!("Shape {{ geometry IndexedFaceSet {{ solid {solid}\n").as_bytes());
        coordinates(text, sink)?;
        text.extend_from_slice(b"] }\ncoordIndex [\n");
        piece.each_face(|corners| write_indices(corners, text, sink))?;
        if let Some(normals) = piece.normals {
            text.extend_from_slice(b"]\nnormal Normal { vector [\n");
            write_points(normals.vectors.iter(), text, sink)?;
            text.extend_from_slice(b"] }\nnormalIndex [\n");
            normals.triangles.iter().try_for_each(|corners| write_indices(corners, text, sink))?;
        }
        text.extend_from_slice(b"] } }\n");
    }
    if !piece.segments.is_empty() {
        text.extend_from_slice(b"Shape { geometry IndexedLineSet {\n");
        if piece.triangles.is_empty() {
            coordinates(text, sink)?;
            text.extend_from_slice(b"] }\n");
        } else {
            text.extend_from_slice(format!("coord USE points_{number}\n").as_bytes());
        }
        text.extend_from_slice(b"coordIndex [\n");
        piece.segments.iter().try_for_each(|ends| write_indices(ends, text, sink))?;
        text.extend_from_slice(b"] } }\n");
    }
    if !piece.points.is_empty() {
        text.extend_from_slice(b"Shape { geometry PointSet { coord Coordinate { point [\n");
        write_points(piece.points.iter().map(|&point| &piece.vertices[point as usize]), text, sink)?;
        text.extend_from_slice(b"] } } }\n");
    }
    text.extend_from_slice(b"] }\n");
    flush_full(text, sink)
}

/// The line that opens a piece's group, under its name as far as the format has its characters.
fn group(number: usize, piece: &Piece<'_>) -> String {
    let legal = |character: char| if character.is_ascii_alphanumeric() { character } else { '_' };
    let name: String = piece.name.unwrap_or("shape").chars().take(MeshFacts::NAME_CHARACTERS).map(legal).collect();
    format!("DEF part_{}_{name} Group {{ children [\n", number + 1)
}

fn write_points<'p, W: Write>(points: impl Iterator<Item = &'p DVec3>, text: &mut Vec<u8>, sink: &mut W) -> Result<(), FormatError> {
    for point in points {
        push_position(text, point);
        text.push(b'\n');
        flush_full(text, sink)?;
    }
    Ok(())
}

#[inline]
fn write_indices<W: Write>(indices: &[u32], text: &mut Vec<u8>, sink: &mut W) -> Result<(), FormatError> {
    for &index in indices {
        push_integer(text, u64::from(index));
        text.push(b' ');
    }
    text.extend_from_slice(b"-1\n");
    flush_full(text, sink)
}

pub(crate) fn verify<R: Read>(pieces: &[Piece<'_>], source: &mut R) -> Result<(), FormatError> {
    let mut scanner = Scanner::new(source, Format::Vrml);
    scanner.expect(HEADER.as_bytes())?;
    while scanner.expect(b"# ").is_ok() {
        scanner.skip_past(b"\n", 1 << 20)?;
    }
    let (mut vertex_number, mut triangle_number) = (0, 0);
    for (number, piece) in pieces.iter().enumerate() {
        scanner.expect(b"DEF part_")?;
        scanner.skip_past(b" Group { children [\n", 1 << 12)?;
        scanner.expect(b"Shape { geometry IndexedFaceSet { solid TRUE\n")?;
        scanner.expect(format!("coord DEF points_{number} Coordinate {{ point [\n").as_bytes())?;
        for vertex in piece.vertices {
            scanner.element = Place::Vertex(vertex_number);
            for (value, delimiter) in singles(vertex).into_iter().zip(*b"  \n") {
                scanner.number(value, delimiter)?;
            }
            vertex_number += 1;
        }
        scanner.expect(b"] }\ncoordIndex [\n")?;
        for triangle in piece.triangles {
            scanner.element = Place::Triangle(triangle_number);
            triangle.iter().try_for_each(|&index| scanner.index(u64::from(index), b' '))?;
            scanner.expect(b"-1\n")?;
            triangle_number += 1;
        }
        scanner.expect(b"] } }\n] }\n")?;
    }
    scanner.end()
}

/// Whether the first line is one of the format's.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    dialect(bytes).is_some()
}

/// Which rules of inheritance hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dialect {
    /// 1.0 and Open Inventor: coordinates and transforms hold for what follows, until their separator ends.
    Stateful,
    /// 2.0: a transform holds for its children, coordinates for the shape that has them.
    Nested,
}

fn dialect(bytes: &[u8]) -> Option<Dialect> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let nested = bytes.starts_with(b"#VRML V2.");
    let stateful = bytes.starts_with(b"#VRML V1.") || bytes.starts_with(b"#Inventor V");
    nested.then_some(Dialect::Nested).or(stateful.then_some(Dialect::Stateful))
}

/// Reads the polygons of a scene, where its transforms put them. Vertices of coordinates that several face sets use
/// in one place are there once. What has no polygons is counted in the facts.
///
/// The text is read in one pass; a scene is held as its numbers and a few words per node. What is used by name is
/// placed again each time, within the limits on instances, vertices and triangles.
pub(crate) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<MeshFile, FormatError> {
    let Some(dialect) = dialect(bytes) else {
        return Err(FormatError::malformed(
            Format::Vrml,
            Place::Line(1),
            "#VRML V1.0 ascii, #VRML V2.0 utf8 or #Inventor V2.1 ascii",
            bytes,
        ));
    };
    let mut facts = MeshFacts::of(Format::Vrml, "ascii");
    let scene = scene::read(bytes, limits, &mut facts)?;
    let mut builder = MeshBuilder::new(limits);
    walk::place(&scene, dialect, limits, &mut builder, &mut facts)?;
    if builder.vertex_count() == 0 {
        let found = facts.left_out.first().map_or("none", |(word, _)| word);
        return Err(FormatError::malformed(Format::Vrml, Place::File, "an IndexedFaceSet", found.as_bytes()));
    }
    Ok(MeshFile::new(builder, facts))
}

//! Wavefront OBJ: text out and in.
//!
//! Format: Wavefront, Advanced Visualizer Manual, appendix B1 (Object Files). Indices count from
//! 1 through the whole file; negative ones count back from the last vertex. Lines and points are read where there are no
//! faces. Statements that hold no mesh (materials, normals, texture coordinates, smoothing) are read over.

use super::error::{FormatError, Place};
use super::geometry::Piece;
use super::limits::MeshBuilder;
use super::off::flush_full;
use super::read::{MeshFacts, MeshFile, Unit, keep_name};
use super::scanner::Scanner;
use super::text::{CHUNK_BYTES, Lines, integer, one_line, position, push_integer, push_position, singles, words};
use super::{Format, Metadata, ReadLimits};
use std::io::{Read, Write};

const UNIT_COMMENT: &[u8] = b"# units mm\n";

pub(crate) fn write<W: Write>(pieces: &[Piece<'_>], metadata: &Metadata<'_>, sink: &mut W) -> Result<(), FormatError> {
    let mut text = Vec::with_capacity(CHUNK_BYTES + 4096);
    text.extend_from_slice(format!("# {}\n", one_line(metadata.application)).as_bytes());
    text.extend_from_slice(UNIT_COMMENT);
    if let Some(title) = metadata.title {
        text.extend_from_slice(format!("# {}\n", one_line(title)).as_bytes());
    }
    let (mut first, mut first_normal) = (1, 1);
    for (number, piece) in pieces.iter().enumerate() {
        let name = one_line(piece.name.unwrap_or("part"));
        text.extend_from_slice(format!("o {} {name}\n", number + 1).as_bytes());
        for vertex in piece.vertices {
            text.extend_from_slice(b"v ");
            push_position(&mut text, vertex);
            text.push(b'\n');
            flush_full(&mut text, sink)?;
        }
        if let Some(normals) = piece.normals {
            for normal in &normals.vectors {
                text.extend_from_slice(b"vn ");
                push_position(&mut text, normal);
                text.push(b'\n');
                flush_full(&mut text, sink)?;
            }
            for (corners, own) in piece.triangles.iter().zip(&normals.triangles) {
                text.push(b'f');
                for (&vertex, &normal) in corners.iter().zip(own) {
                    text.push(b' ');
                    push_integer(&mut text, first + u64::from(vertex));
                    text.extend_from_slice(b"//");
                    push_integer(&mut text, first_normal + u64::from(normal));
                }
                text.push(b'\n');
                flush_full(&mut text, sink)?;
            }
            first_normal += normals.vectors.len() as u64;
        } else {
            piece.each_face(|corners| element(b'f', corners, first, &mut text, sink))?;
        }
        piece.segments.iter().try_for_each(|ends| element(b'l', ends, first, &mut text, sink))?;
        piece.points.iter().try_for_each(|&point| element(b'p', &[point], first, &mut text, sink))?;
        first += piece.vertices.len() as u64;
    }
    sink.write_all(&text)?;
    sink.flush()?;
    Ok(())
}

#[inline]
fn element<W: Write>(keyword: u8, corners: &[u32], first: u64, text: &mut Vec<u8>, sink: &mut W) -> Result<(), FormatError> {
    text.push(keyword);
    for &index in corners {
        text.push(b' ');
        push_integer(text, first + u64::from(index));
    }
    text.push(b'\n');
    flush_full(text, sink)
}

pub(crate) fn verify<R: Read>(pieces: &[Piece<'_>], source: &mut R) -> Result<(), FormatError> {
    let mut scanner = Scanner::new(source, Format::Obj);
    while scanner.expect(b"# ").is_ok() {
        scanner.skip_past(b"\n", 1 << 20)?;
    }
    let (mut first, mut vertex_number, mut triangle_number) = (1, 0, 0);
    for piece in pieces {
        scanner.element = Place::Vertex(vertex_number);
        scanner.expect(b"o ")?;
        scanner.skip_past(b"\n", 1 << 20)?;
        for vertex in piece.vertices {
            scanner.element = Place::Vertex(vertex_number);
            scanner.expect(b"v ")?;
            for (value, delimiter) in singles(vertex).into_iter().zip(*b"  \n") {
                scanner.number(value, delimiter)?;
            }
            vertex_number += 1;
        }
        for triangle in piece.triangles {
            scanner.element = Place::Triangle(triangle_number);
            scanner.expect(b"f ")?;
            for (&index, delimiter) in triangle.iter().zip(*b"  \n") {
                scanner.index(first + u64::from(index), delimiter)?;
            }
            triangle_number += 1;
        }
        first += piece.vertices.len() as u64;
    }
    scanner.end()
}

/// Whether the first statement is one of the format's.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    const STATEMENTS: [&[u8]; 9] = [b"v", b"vn", b"vt", b"f", b"o", b"g", b"mtllib", b"usemtl", b"s"];
    let comment = |line: &&[u8]| line.first().is_none_or(|&byte| byte == b'#');
    let first = Lines::new(bytes.get(..65_536).unwrap_or(bytes)).map(<[u8]>::trim_ascii).find(|line| !comment(line));
    first.and_then(|line| words(line).next().map(|word| STATEMENTS.contains(&word))).unwrap_or(false)
}

pub(crate) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<MeshFile, FormatError> {
    let mut builder = MeshBuilder::new(limits);
    let mut facts = MeshFacts::of(Format::Obj, "ascii");
    let mut lines = Lines::new(bytes);
    let mut joined = Vec::new();
    let mut corners = Vec::new();
    while let Some(mut line) = lines.next() {
        // A backslash at the end continues the statement on the next line.
        if line.ends_with(b"\\") {
            joined.clear();
            while let Some(start) = line.strip_suffix(b"\\") {
                joined.extend_from_slice(start);
                joined.push(b' ');
                line = lines.next().unwrap_or_default();
            }
            joined.extend_from_slice(line);
            line = &joined;
        }
        let mut words = words(line);
        match words.next() {
            Some(b"v") => {
                let vertex = position(&mut words, Format::Obj, || lines.place())?;
                builder.vertex(vertex, &|| lines.place())?;
            }
            Some(b"f") => {
                corners.clear();
                for word in words {
                    corners.push(corner(word, builder.vertex_count(), &lines)?);
                }
                builder.polygon(&corners, &|| lines.place())?;
            }
            Some(word @ (b"l" | b"p")) => {
                corners.clear();
                for word in words {
                    corners.push(corner(word, builder.vertex_count(), &lines)?);
                }
                if word == b"l" {
                    builder.chain(&corners, &|| lines.place())?;
                } else {
                    corners.chunks(1).try_for_each(|point| builder.polygon(point, &|| lines.place()))?;
                }
            }
            Some(b"o" | b"g") => keep_name(&mut facts, line.trim_ascii_start().get(1..).unwrap_or_default()),
            Some(b"#") if line == UNIT_COMMENT.trim_ascii_end() => facts.unit = Some(Unit::Millimetre),
            _ => {}
        }
    }
    if builder.vertex_count() == 0 {
        return Err(FormatError::malformed(Format::Obj, lines.place(), "vertices", bytes));
    }
    Ok(MeshFile::new(builder, facts))
}

/// The vertex of `vertex/texture/normal`, counted from 0.
fn corner(word: &[u8], vertices: usize, lines: &Lines<'_>) -> Result<i64, FormatError> {
    let vertex = word.split(|&byte| byte == b'/').next().unwrap_or_default();
    let vertices = i64::try_from(vertices).unwrap_or(i64::MAX);
    match integer(vertex) {
        Some(index) if index > 0 => Ok(index - 1),
        // What counts back beyond the first vertex stays negative and is refused with the others.
        Some(index) if index < 0 => Ok(vertices.saturating_add(index)),
        _ => Err(FormatError::malformed(Format::Obj, lines.place(), "a vertex index", word)),
    }
}

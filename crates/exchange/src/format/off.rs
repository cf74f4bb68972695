//! Object file format of Geomview: text out and in.
//!
//! Format: Geomview manual, section OFF: the word `OFF`, the numbers of vertices, faces and
//! edges, a line for each vertex, a line for each face with its number of corners first. The
//! prefixes `C`, `N` and `ST` announce colours, normals and texture coordinates after the three
//! coordinates of a vertex; they are read over. Its edges are a count alone, so wires have no room.

use super::error::{FormatError, Place};
use super::geometry::{Piece, counts};
use super::limits::MeshBuilder;
use super::read::{MeshFacts, MeshFile};
use super::scanner::Scanner;
use super::text::{CHUNK_BYTES, Lines, integer, one_line, position, push_integer, push_position, singles, words};
use super::{Format, Metadata, ReadLimits};
use std::io::{Read, Write};

/// Prefixes of the keyword that leave the coordinates three-dimensional.
const KEYWORDS: [&[u8]; 8] = [b"OFF", b"COFF", b"NOFF", b"STOFF", b"CNOFF", b"NCOFF", b"STCNOFF", b"STNOFF"];

pub(crate) fn write<W: Write>(pieces: &[Piece<'_>], metadata: &Metadata<'_>, sink: &mut W) -> Result<(), FormatError> {
    let counts = counts(pieces);
    let mut text = Vec::with_capacity(CHUNK_BYTES + 4096);
    text.extend_from_slice(format!("OFF\n# {} units mm\n", one_line(metadata.application)).as_bytes());
    if let Some(title) = metadata.title {
        text.extend_from_slice(format!("# {}\n", one_line(title)).as_bytes());
    }
    text.extend_from_slice(format!("{} {} 0\n", counts.vertices, counts.faces).as_bytes());
    for vertex in pieces.iter().flat_map(|piece| piece.vertices) {
        push_position(&mut text, vertex);
        text.push(b'\n');
        flush_full(&mut text, sink)?;
    }
    let mut before = 0;
    for piece in pieces {
        piece.each_face(|corners| {
            push_integer(&mut text, corners.len() as u64);
            for &index in corners {
                text.push(b' ');
                push_integer(&mut text, before + u64::from(index));
            }
            text.push(b'\n');
            flush_full(&mut text, sink)
        })?;
        before += piece.vertices.len() as u64;
    }
    sink.write_all(&text)?;
    sink.flush()?;
    Ok(())
}

/// Hands the text to the sink once a chunk is full.
pub(crate) fn flush_full<W: Write>(text: &mut Vec<u8>, sink: &mut W) -> Result<(), FormatError> {
    if text.len() >= CHUNK_BYTES {
        sink.write_all(text)?;
        text.clear();
    }
    Ok(())
}

pub(crate) fn verify<R: Read>(pieces: &[Piece<'_>], source: &mut R) -> Result<(), FormatError> {
    let counts = counts(pieces);
    let mut scanner = Scanner::new(source, Format::Off);
    scanner.expect(b"OFF\n")?;
    while scanner.expect(b"# ").is_ok() {
        scanner.skip_past(b"\n", 1 << 20)?;
    }
    scanner.index(counts.vertices, b' ')?;
    scanner.index(counts.triangles, b' ')?;
    scanner.expect(b"0\n")?;
    for (number, vertex) in (0..).zip(pieces.iter().flat_map(|piece| piece.vertices)) {
        scanner.element = Place::Vertex(number);
        for (value, delimiter) in singles(vertex).into_iter().zip(*b"  \n") {
            scanner.number(value, delimiter)?;
        }
    }
    let (mut number, mut before) = (0, 0);
    for piece in pieces {
        for triangle in piece.triangles {
            scanner.element = Place::Triangle(number);
            scanner.expect(b"3 ")?;
            for (&index, delimiter) in triangle.iter().zip(*b"  \n") {
                scanner.index(before + u64::from(index), delimiter)?;
            }
            number += 1;
        }
        before += piece.vertices.len() as u64;
    }
    scanner.end()
}

/// Whether the first words are the format's.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    let line = Lines::new(bytes.get(..1024).unwrap_or(bytes)).map(content).find(|line| !line.is_empty());
    line.and_then(|line| words(line).next().map(|word| KEYWORDS.contains(&word))).unwrap_or(false)
}

/// A line without its comment and the blanks around it.
fn content(line: &[u8]) -> &[u8] {
    let end = line.iter().position(|&byte| byte == b'#').unwrap_or(line.len());
    line[..end].trim_ascii()
}

/// The next line that is not blank.
fn next_line<'a>(lines: &mut Lines<'a>, total: usize) -> Result<&'a [u8], FormatError> {
    match lines.by_ref().map(content).find(|line| !line.is_empty()) {
        Some(line) => Ok(line),
        None => {
            let found = total as u64;
            Err(FormatError::Truncated { format: Format::Off, place: lines.place(), needed: found + 2, found })
        }
    }
}

pub(crate) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<MeshFile, FormatError> {
    let mut lines = Lines::new(bytes);
    let mut line = next_line(&mut lines, bytes.len())?;
    // The keyword is optional, and the counts may follow it on its line.
    if let Some(first) = words(line).next().filter(|word| integer(word).is_none()) {
        if !KEYWORDS.contains(&first) {
            return Err(FormatError::malformed(Format::Off, lines.place(), "OFF with three coordinates", line));
        }
        line = line[first.len()..].trim_ascii();
        if line == b"BINARY" {
            return Err(FormatError::malformed(Format::Off, lines.place(), "text", line));
        }
        if line.is_empty() {
            line = next_line(&mut lines, bytes.len())?;
        }
    }
    let mut numbers = words(line).map(|word| integer(word).and_then(|count| u64::try_from(count).ok()));
    let (Some(Some(vertices)), Some(Some(faces))) = (numbers.next(), numbers.next()) else {
        return Err(FormatError::malformed(Format::Off, lines.place(), "the numbers of vertices and faces", line));
    };
    let mut builder = MeshBuilder::new(limits);
    builder.announce(vertices, faces, lines.rest().len() as u64, &lines.place())?;
    for _ in 0..vertices {
        let line = next_line(&mut lines, bytes.len())?;
        let vertex = position(&mut words(line), Format::Off, || lines.place())?;
        builder.vertex(vertex, &|| lines.place())?;
    }
    let mut corners = Vec::new();
    for _ in 0..faces {
        let line = next_line(&mut lines, bytes.len())?;
        read_face(line, &lines, &mut corners)?;
        builder.polygon(&corners, &|| lines.place())?;
    }
    if let Some(line) = lines.by_ref().map(content).find(|line| !line.is_empty()) {
        return Err(FormatError::malformed(Format::Off, lines.place(), "the end of the file, as no more faces were announced", line));
    }
    let facts = MeshFacts::of(Format::Off, "ascii");
    Ok(MeshFile::new(builder, facts))
}

/// The corners of a face; the colour that may follow them is left.
fn read_face(line: &[u8], lines: &Lines<'_>, corners: &mut Vec<i64>) -> Result<(), FormatError> {
    let mut words = words(line);
    let count = words.next().and_then(integer).and_then(|count| usize::try_from(count).ok());
    corners.clear();
    if let Some(count) = count {
        corners.extend(words.map_while(integer).take(count));
    }
    if count == Some(corners.len()) {
        return Ok(());
    }
    Err(FormatError::malformed(Format::Off, lines.place(), "a number of corners and so many indices", line))
}

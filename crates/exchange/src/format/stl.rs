//! Stereolithography files: binary out, binary and text in.
//!
//! Format: 3D Systems, StereoLithography Interface Specification (1989): 80 bytes of header, the
//! number of facets, then per facet a normal, three vertices and two attribute bytes, all
//! little-endian. The header must not begin with `solid`, the mark of the text form; whether a
//! file is binary is judged by its length, because producers break that rule.
//!
//! Reading goes through `stl_io`; writing does not, because its header is blank.

use super::error::{FormatError, Place};
use super::geometry::{Piece, counts};
use super::limits::{MeshBuilder, within};
use super::read::{MeshFacts, MeshFile, Unit, keep_name};
use super::scanner::Scanner;
use super::text::{CHUNK_BYTES, Lines, one_line, position, single, singles, words};
use super::{Format, Metadata, ReadLimits};
use glam::DVec3;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::io::{self, Read, Seek, SeekFrom, Write};

const HEADER_BYTES: usize = 80;
const PREFIX_BYTES: u64 = HEADER_BYTES as u64 + 4;
const FACET_BYTES: usize = 50;

/// The header: producer, unit and title as far as they fit, padded with spaces.
fn header(metadata: &Metadata<'_>) -> [u8; HEADER_BYTES] {
    let mut text = format!("{} units mm", one_line(metadata.application));
    if let Some(title) = metadata.title {
        text.push(' ');
        text.push_str(&one_line(title));
    }
    // An application called "solid ..." must not make the file look like text.
    if text.get(..5).is_some_and(|start| start.eq_ignore_ascii_case("solid")) {
        text.insert(0, '_');
    }
    let mut header = [b' '; HEADER_BYTES];
    for (byte, character) in header.iter_mut().zip(text.chars()) {
        *byte = if character.is_ascii() { character as u8 } else { b'?' };
    }
    header
}

/// The unit normal by the right-hand rule, computed in double precision; zero without an area.
fn normal(corners: [DVec3; 3]) -> [f32; 3] {
    singles(&(corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero())
}

/// Writes 84 + 50 n bytes.
pub(crate) fn write<W: Write>(pieces: &[Piece<'_>], metadata: &Metadata<'_>, sink: &mut W) -> Result<(), FormatError> {
    let facets = counts(pieces).triangles;
    let count = u32::try_from(facets).map_err(|_| FormatError::limit(Place::File, "triangles", facets, u64::from(u32::MAX)))?;
    sink.write_all(&header(metadata))?;
    sink.write_all(&count.to_le_bytes())?;
    let mut chunk = vec![0_u8; CHUNK_BYTES / FACET_BYTES * FACET_BYTES];
    for piece in pieces {
        for triangles in piece.triangles.chunks(CHUNK_BYTES / FACET_BYTES) {
            let filled = &mut chunk[..triangles.len() * FACET_BYTES];
            for (facet, triangle) in filled.as_chunks_mut::<FACET_BYTES>().0.iter_mut().zip(triangles) {
                write_facet(facet, triangle.map(|index| piece.vertices[index as usize]));
            }
            sink.write_all(filled)?;
        }
    }
    sink.flush()?;
    Ok(())
}

#[inline]
fn write_facet(facet: &mut [u8; FACET_BYTES], corners: [DVec3; 3]) {
    let numbers = [normal(corners), singles(&corners[0]), singles(&corners[1]), singles(&corners[2])];
    for (four, number) in facet.as_chunks_mut::<4>().0.iter_mut().zip(numbers.as_flattened()) {
        *four = number.to_le_bytes();
    }
    // The two attribute bytes were zero when the chunk was made and stay so.
}

/// Whether the length is that of a binary file with the count that stands at byte 80.
pub(crate) fn is_binary(bytes: &[u8]) -> bool {
    announced_bytes(bytes).is_some_and(|(_, whole)| bytes.len() as u64 == whole)
}

/// The count that stands at byte 80, and the length of a binary file with so many facets.
pub(crate) fn announced_bytes(bytes: &[u8]) -> Option<(u64, u64)> {
    announced(bytes).map(|facets| (facets, PREFIX_BYTES + facets * FACET_BYTES as u64))
}

/// Whether the bytes begin as the text form does.
pub(crate) fn looks_like_text(bytes: &[u8]) -> bool {
    let start = bytes.get(..1024).unwrap_or(bytes).trim_ascii_start().to_ascii_lowercase();
    let contains = |word: &[u8]| start.windows(word.len()).any(|candidate| candidate == word);
    start.starts_with(b"solid") && (contains(b"facet") || contains(b"endsolid"))
}

fn announced(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER_BYTES..)?.first_chunk::<4>()?;
    Some(u64::from(u32::from_le_bytes(*count)))
}

/// Reads either form; vertices with equal coordinates become one.
pub(crate) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<MeshFile, FormatError> {
    if is_binary(bytes) {
        return read_binary(bytes, limits);
    }
    if looks_like_text(bytes) {
        return read_text(bytes, limits);
    }
    let needed = announced(bytes).map_or(PREFIX_BYTES, |facets| PREFIX_BYTES + facets * FACET_BYTES as u64);
    let found = bytes.len() as u64;
    if found < needed {
        return Err(FormatError::Truncated { format: Format::Stl, place: Place::Byte(found), needed, found });
    }
    Err(FormatError::malformed(Format::Stl, Place::Byte(needed), "the end of the file", &bytes[needed as usize..]))
}

fn read_binary(bytes: &[u8], limits: &ReadLimits) -> Result<MeshFile, FormatError> {
    let facets = announced(bytes).unwrap_or(0);
    let mut joined = Joined::new(limits);
    joined.announce(facets, &Place::Byte(HEADER_BYTES as u64))?;
    let mut whole = BlankHeader { bytes, at: 0 };
    for (facet, triangle) in stl_io::create_stl_reader(&mut whole)?.enumerate() {
        let place = || Place::Byte(PREFIX_BYTES + (facet * FACET_BYTES) as u64);
        joined.facet(triangle?.vertices.map(|vertex| vertex.0.map(f64::from)), &place)?;
    }
    let mut facts = MeshFacts::of(Format::Stl, "binary");
    let header = String::from_utf8_lossy(&bytes[..HEADER_BYTES]).to_ascii_lowercase();
    if ["units mm", "units=mm", "unit: mm"].iter().any(|words| header.contains(words)) {
        facts.unit = Some(Unit::Millimetre);
    }
    Ok(joined.finish(facts))
}

/// A binary file whose header is shown as empty lines, because `stl_io` takes a file for text if
/// its header says "solid", and looks for the end of the first line to find out.
struct BlankHeader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Read for BlankHeader<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = if self.at < HEADER_BYTES {
            let count = buffer.len().min(HEADER_BYTES - self.at);
            buffer[..count].fill(b'\n');
            count
        } else {
            self.bytes.get(self.at..).unwrap_or_default().read(buffer)?
        };
        self.at += count;
        Ok(count)
    }
}

impl Seek for BlankHeader<'_> {
    /// Only the way back that `stl_io` takes.
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        match position {
            SeekFrom::Start(0) => {
                self.at = 0;
                Ok(0)
            }
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}

fn read_text(bytes: &[u8], limits: &ReadLimits) -> Result<MeshFile, FormatError> {
    let mut joined = Joined::new(limits);
    let mut facts = MeshFacts::of(Format::Stl, "ascii");
    let mut corners: Vec<DVec3> = Vec::new();
    let mut closed = false;
    let mut lines = Lines::new(bytes);
    while let Some(line) = lines.next() {
        let mut words = words(line);
        let Some(keyword) = words.next() else { continue };
        match keyword.to_ascii_lowercase().as_slice() {
            b"solid" => {
                closed = false;
                keep_name(&mut facts, &line.trim_ascii_start()[keyword.len()..]);
            }
            b"vertex" if corners.len() < 3 => corners.push(position(&mut words, Format::Stl, || lines.place())?),
            b"endfacet" => {
                let Ok(three) = <[DVec3; 3]>::try_from(corners.as_slice()) else {
                    return Err(FormatError::malformed(Format::Stl, lines.place(), "three vertices in a facet", line));
                };
                joined.facet(three.map(|corner| corner.to_array()), &|| lines.place())?;
                corners.clear();
            }
            b"endsolid" => closed = true,
            b"facet" | b"outer" | b"endloop" if !closed => {}
            _ => return Err(FormatError::malformed(Format::Stl, lines.place(), "a line of a facet", line)),
        }
    }
    if !closed || !corners.is_empty() {
        let found = bytes.len() as u64;
        let needed = found + "endsolid".len() as u64;
        return Err(FormatError::Truncated { format: Format::Stl, place: lines.place(), needed, found });
    }
    Ok(joined.finish(facts))
}

/// Joins vertices with equal coordinates, in the order of their first appearance.
struct Joined<'a> {
    builder: MeshBuilder<'a>,
    limits: &'a ReadLimits,
    known: HashMap<[u64; 3], u32>,
}

impl<'a> Joined<'a> {
    fn new(limits: &'a ReadLimits) -> Self {
        Self { builder: MeshBuilder::new(limits), limits, known: HashMap::new() }
    }

    /// The count has been checked against the file's length; vertices are half of it in a closed mesh.
    fn announce(&mut self, facets: u64, place: &Place) -> Result<(), FormatError> {
        within(place.clone(), "triangles", facets, self.limits.triangles)?;
        let vertices = usize::try_from(facets / 2).unwrap_or(usize::MAX);
        let asked = (vertices as u64).saturating_mul(40);
        self.known.try_reserve(vertices).map_err(|_| FormatError::OutOfMemory { place: place.clone(), bytes: asked })?;
        self.builder.announce(facets / 2, facets, facets * FACET_BYTES as u64, place)
    }

    fn facet(&mut self, corners: [[f64; 3]; 3], place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        let mut triangle = [0; 3];
        for (index, corner) in triangle.iter_mut().zip(corners) {
            // Adding zero makes -0 and 0 one number.
            let next = self.builder.vertex_count();
            if self.known.len() == self.known.capacity() {
                self.known.try_reserve(next.max(1024)).map_err(|_| FormatError::OutOfMemory { place: place(), bytes: next as u64 * 40 })?;
            }
            *index = match self.known.entry(corner.map(|value| (value + 0.0).to_bits())) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(vacant) => {
                    self.builder.vertex(DVec3::from_array(corner) + DVec3::ZERO, place)?;
                    let index =
                        u32::try_from(next).map_err(|_| FormatError::limit(place(), "vertices", next as u64, u64::from(u32::MAX)))?;
                    *vacant.insert(index)
                }
            };
        }
        self.builder.triangle(triangle, place)
    }

    fn finish(self, facts: MeshFacts) -> MeshFile {
        MeshFile::new(self.builder, facts)
    }
}

/// Compares facet by facet; normals are those that [`write()`] computes.
pub(crate) fn verify<R: Read>(pieces: &[Piece<'_>], source: &mut R) -> Result<(), FormatError> {
    let mut scanner = Scanner::new(source, Format::Stl);
    let header = scanner.bytes::<HEADER_BYTES>()?;
    if header.starts_with(b"solid") {
        return Err(scanner.differs("a header that does not begin with solid", "solid"));
    }
    let facets = counts(pieces).triangles;
    let count = u64::from(u32::from_le_bytes(scanner.bytes::<4>()?));
    if count != facets {
        return Err(scanner.differs(format!("{facets} facets"), format!("{count} facets")));
    }
    let mut expected = [0; FACET_BYTES];
    let triangles = pieces.iter().flat_map(|piece| piece.triangles.iter().map(|triangle| (piece.vertices, triangle)));
    for (facet, (vertices, triangle)) in (0..).zip(triangles) {
        scanner.element = Place::Triangle(facet);
        write_facet(&mut expected, triangle.map(|index| vertices[index as usize]));
        let found = scanner.bytes::<FACET_BYTES>()?;
        if found != expected {
            return Err(scanner.differs(shown(&expected), shown(&found)));
        }
    }
    scanner.end()
}

/// Normal and corners of a facet, and its attribute bytes, for a message.
fn shown(facet: &[u8; FACET_BYTES]) -> String {
    let (numbers, attribute) = facet.as_chunks::<4>();
    let numbers: Vec<f32> = numbers.iter().map(|four| single(f64::from(f32::from_le_bytes(*four)))).collect();
    format!("{numbers:?}, attribute {attribute:?}")
}

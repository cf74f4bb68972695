//! Reading polygon files, whatever properties their elements have.

use super::super::error::{FormatError, Place};
use super::super::limits::MeshBuilder;
use super::super::read::{MeshFacts, MeshFile, Unit};
use super::super::text::{Lines, decimal, words};
use super::super::{Format, ReadLimits};
use glam::DVec3;

/// How the values of the body are written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// A type of the format.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_word(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// What a property is for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    /// A coordinate: 0, 1 or 2.
    Coordinate(usize),
    /// The corners of a face.
    Corners,
    /// An end of an edge: 0 or 1.
    End(usize),
    /// Nothing that is read.
    Other,
}

struct Property {
    role: Role,
    /// Type of the length, for a list.
    length: Option<Scalar>,
    scalar: Scalar,
}

struct Element {
    is_vertex: bool,
    is_face: bool,
    is_edge: bool,
    count: u64,
    properties: Vec<Property>,
}

struct Header {
    encoding: Encoding,
    unit: Option<Unit>,
    elements: Vec<Element>,
}

fn malformed(place: Place, expected: &'static str, found: &[u8]) -> FormatError {
    FormatError::malformed(Format::Ply, place, expected, found)
}

fn read_header(lines: &mut Lines<'_>) -> Result<Header, FormatError> {
    /// More than any file in use has; each costs a pass over the others.
    const MOST_ELEMENTS: usize = 64;
    const MOST_PROPERTIES: usize = 256;
    let mut encoding = None;
    let mut unit = None;
    let mut elements: Vec<Element> = Vec::new();
    if lines.next() != Some(b"ply") {
        return Err(malformed(lines.place(), "ply", lines.rest()));
    }
    while let Some(line) = lines.next() {
        let parts: Vec<&[u8]> = words(line).take(8).collect();
        match parts.as_slice() {
            [b"format", kind, ..] => {
                encoding = match *kind {
                    b"ascii" => Some(Encoding::Text),
                    b"binary_little_endian" => Some(Encoding::LittleEndian),
                    b"binary_big_endian" => Some(Encoding::BigEndian),
                    _ => None,
                }
            }
            [b"comment" | b"obj_info", ..] => {
                if line.ends_with(b"units mm") {
                    unit = Some(Unit::Millimetre);
                }
            }
            [b"element", name, count] if elements.len() < MOST_ELEMENTS => {
                let count = std::str::from_utf8(count).ok().and_then(|count| count.parse().ok());
                let count = count.ok_or_else(|| malformed(lines.place(), "a number of elements", line))?;
                let (is_vertex, is_face, is_edge) = (*name == b"vertex", *name == b"face", *name == b"edge");
                elements.push(Element { is_vertex, is_face, is_edge, count, properties: Vec::new() });
            }
            [b"property", ..] => {
                let property = property(&parts).ok_or_else(|| malformed(lines.place(), "a property", line))?;
                match elements.last_mut() {
                    Some(element) if element.properties.len() < MOST_PROPERTIES => element.properties.push(property),
                    _ => return Err(malformed(lines.place(), "an element before its properties", line)),
                }
            }
            [b"end_header"] => {
                let encoding = encoding.ok_or_else(|| malformed(lines.place(), "a known format before", line))?;
                return Ok(Header { encoding, unit, elements });
            }
            [] => {}
            _ => return Err(malformed(lines.place(), "a line of the header", line)),
        }
    }
    Err(malformed(lines.place(), "end_header", b""))
}

fn property(parts: &[&[u8]]) -> Option<Property> {
    match parts {
        [_, b"list", length, scalar, name] => {
            let role = if matches!(*name, b"vertex_indices" | b"vertex_index") { Role::Corners } else { Role::Other };
            let length = Scalar::from_word(length).filter(|scalar| !matches!(scalar, Scalar::F32 | Scalar::F64))?;
            Some(Property { role, length: Some(length), scalar: Scalar::from_word(scalar)? })
        }
        [_, scalar, name] => {
            let role = match *name {
                b"x" => Role::Coordinate(0),
                b"y" => Role::Coordinate(1),
                b"z" => Role::Coordinate(2),
                b"vertex1" => Role::End(0),
                b"vertex2" => Role::End(1),
                _ => Role::Other,
            };
            Some(Property { role, length: None, scalar: Scalar::from_word(scalar)? })
        }
        _ => None,
    }
}

/// The values of the body, one after the other.
struct Body<'a> {
    encoding: Encoding,
    bytes: &'a [u8],
    at: usize,
}

impl Body<'_> {
    fn place(&self) -> Place {
        Place::Byte(self.at as u64)
    }

    fn truncated(&self, needed: u64) -> FormatError {
        let found = (self.bytes.len() - self.at) as u64;
        FormatError::Truncated { format: Format::Ply, place: self.place(), needed, found }
    }

    fn value(&mut self, scalar: Scalar) -> Result<f64, FormatError> {
        let rest = &self.bytes[self.at..];
        if self.encoding == Encoding::Text {
            let start = rest.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(rest.len());
            let word = &rest[start..];
            let word = &word[..word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len())];
            if word.is_empty() {
                return Err(self.truncated(1));
            }
            let value = decimal(word).ok_or_else(|| malformed(self.place(), "a number", word))?;
            self.at += start + word.len();
            return Ok(value);
        }
        let width = scalar.bytes();
        // A number of up to eight bytes, brought to little-endian order.
        let Some(found) = rest.get(..width) else {
            return Err(self.truncated(width as u64));
        };
        let mut eight = [0; 8];
        eight[..width].copy_from_slice(found);
        if self.encoding == Encoding::BigEndian {
            eight[..width].reverse();
        }
        self.at += width;
        let [a, b, c, d, ..] = eight;
        Ok(match scalar {
            Scalar::I8 => f64::from(i8::from_le_bytes([a])),
            Scalar::U8 => f64::from(a),
            Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
            Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
            Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Scalar::F64 => f64::from_le_bytes(eight),
        })
    }

    fn whole(&mut self, scalar: Scalar) -> Result<i64, FormatError> {
        let place = self.place();
        let value = self.value(scalar)?;
        #[expect(clippy::cast_possible_truncation, reason = "whole and small, by the test")]
        if value.fract() == 0.0 && value.abs() < 9e15 {
            Ok(value as i64)
        } else {
            Err(malformed(place, "a whole number", value.to_string().as_bytes()))
        }
    }

    /// The length of a list, which the rest of the file must have room for.
    fn length(&mut self, length: Scalar, item: Scalar) -> Result<usize, FormatError> {
        let place = self.place();
        let count = self.whole(length)?;
        let count = usize::try_from(count).map_err(|_| malformed(place, "a length", count.to_string().as_bytes()))?;
        let width = if self.encoding == Encoding::Text { 2 } else { item.bytes() };
        let needed = (count as u64).saturating_mul(width as u64);
        // The last word of a text needs no blank after it.
        if needed > (self.bytes.len() - self.at) as u64 + 1 {
            return Err(self.truncated(needed));
        }
        Ok(count)
    }
}

pub(crate) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<MeshFile, FormatError> {
    let mut lines = Lines::new(bytes);
    let header = read_header(&mut lines)?;
    let mut body = Body { encoding: header.encoding, bytes, at: bytes.len() - lines.rest().len() };
    let mut builder = MeshBuilder::new(limits);
    let mut faces_seen = false;
    for element in &header.elements {
        refuse_unbacked(element, &body)?;
        let left = (bytes.len() - body.at) as u64;
        let place = body.place();
        if element.is_vertex && faces_seen {
            return Err(malformed(place, "vertices before faces", b"vertices after faces"));
        }
        faces_seen |= element.is_face || element.is_edge;
        builder.announce(
            if element.is_vertex { element.count } else { 0 },
            if element.is_face { element.count } else { 0 },
            left,
            &place,
        )?;
        read_element(element, &mut body, &mut builder)?;
    }
    // A cloud of points has vertices alone.
    if !header.elements.iter().any(|element| (element.is_face || element.is_edge) && element.count > 0) {
        builder.points_alone(&|| body.place())?;
    }
    let encoding = match header.encoding {
        Encoding::Text => "ascii",
        Encoding::LittleEndian => "binary",
        Encoding::BigEndian => "binary big-endian",
    };
    let mut facts = MeshFacts::of(Format::Ply, encoding);
    facts.unit = header.unit;
    Ok(MeshFile::new(builder, facts))
}

/// A count that the rest of the file has no bytes for is a lie, or an endless loop over elements
/// without properties.
fn refuse_unbacked(element: &Element, body: &Body<'_>) -> Result<(), FormatError> {
    let width: u64 = match body.encoding {
        Encoding::Text => element.properties.len() as u64,
        _ => element.properties.iter().map(|property| property.length.unwrap_or(property.scalar).bytes() as u64).sum(),
    };
    let needed = element.count.saturating_mul(width.max(1));
    if needed > (body.bytes.len() - body.at) as u64 { Err(body.truncated(needed)) } else { Ok(()) }
}

fn read_element(element: &Element, body: &mut Body<'_>, builder: &mut MeshBuilder<'_>) -> Result<(), FormatError> {
    let has = |role| element.properties.iter().any(|property| property.role == role);
    if element.is_vertex && !(0..3).all(|axis| has(Role::Coordinate(axis))) {
        return Err(malformed(body.place(), "the properties x, y and z", b""));
    }
    if element.is_edge && !(0..2).all(|end| has(Role::End(end))) {
        return Err(malformed(body.place(), "the properties vertex1 and vertex2", b""));
    }
    let mut corners = Vec::new();
    for _ in 0..element.count {
        let place = body.place();
        let (mut position, mut ends) = ([0.0; 3], [0; 2]);
        corners.clear();
        for property in &element.properties {
            let Some(length) = property.length else {
                match property.role {
                    Role::Coordinate(axis) => position[axis] = body.value(property.scalar)?,
                    Role::End(end) if element.is_edge => ends[end] = body.whole(property.scalar)?,
                    _ => {
                        body.value(property.scalar)?;
                    }
                }
                continue;
            };
            for _ in 0..body.length(length, property.scalar)? {
                if property.role == Role::Corners {
                    corners.push(body.whole(property.scalar)?);
                } else {
                    body.value(property.scalar)?;
                }
            }
        }
        if element.is_vertex {
            builder.vertex(DVec3::from_array(position), &|| place.clone())?;
        } else if element.is_face {
            builder.polygon(&corners, &|| place.clone())?;
        } else if element.is_edge {
            builder.polygon(&ends, &|| place.clone())?;
        }
    }
    Ok(())
}

//! Binary glTF 2.0 for viewers.
//!
//! Format: Khronos, glTF 2.0 Specification (ISO/IEC 12113:2022), sections 3.6 (accessors), 3.7
//! (meshes) and 4 (GLB). glTF is in metres with Y up. The buffer keeps the millimetres and the Z
//! axis of the mesh, so that its numbers are the proven ones, and the root node scales and turns.
//! Normals are left out unless the geometry has some: a viewer then shades the facets as they are, which the specification
//! demands of it.

use super::error::{FormatError, Place};
use super::geometry::{Piece, Split, counts};
use super::off::flush_full;
use super::scanner::Scanner;
use super::text::{CHUNK_BYTES, singles};
use super::{Format, Metadata};
use serde_json::{Value, json};
use std::io::{Read, Write};

const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";
/// File header and two chunk headers.
const FRAME_BYTES: u64 = 12 + 8 + 8;

// Values of the specification's enumerations.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const POINTS: u32 = 0;
const LINES: u32 = 1;
const TRIANGLES: u32 = 4;

/// A quarter turn about X that brings Z up to Y up, as a unit quaternion.
const Z_UP_TO_Y_UP: [f64; 4] = [-std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2];
const METRES_PER_MILLIMETRE: f64 = 0.001;

/// Accessors and buffer views under construction; both stand one to one.
#[derive(Default)]
struct Layout {
    accessors: Vec<Value>,
    views: Vec<Value>,
    bytes: u64,
}

impl Layout {
    /// Adds a run of `bytes` to the buffer and returns its accessor.
    fn add(&mut self, bytes: u64, target: u32, accessor: Value) -> usize {
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes, "byteLength": bytes, "target": target }));
        self.accessors.push(accessor);
        self.bytes += bytes;
        self.accessors.len() - 1
    }

    fn normals(&mut self, count: usize) -> usize {
        let accessor = json!({ "bufferView": self.views.len(), "componentType": FLOAT, "count": count, "type": "VEC3" });
        self.add(count as u64 * 12, ARRAY_BUFFER, accessor)
    }

    fn positions(&mut self, piece: &Piece<'_>, count: usize) -> usize {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for vertex in piece.vertices {
            for (axis, value) in singles(vertex).into_iter().enumerate() {
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
            }
        }
        let accessor = json!({
            "bufferView": self.views.len(), "componentType": FLOAT, "count": count, "type": "VEC3",
            "min": low, "max": high,
        });
        self.add(count as u64 * 12, ARRAY_BUFFER, accessor)
    }

    fn indices(&mut self, count: usize) -> usize {
        let accessor = json!({
            "bufferView": self.views.len(), "componentType": UNSIGNED_INT, "count": count, "type": "SCALAR",
        });
        self.add(count as u64 * 4, ELEMENT_ARRAY_BUFFER, accessor)
    }
}

fn document(pieces: &[Piece<'_>], splits: &[Option<Split>], metadata: &Metadata<'_>) -> Result<(Value, u64), FormatError> {
    let mut layout = Layout::default();
    let (mut meshes, mut nodes) = (Vec::new(), Vec::new());
    let root_name = metadata.title.unwrap_or("model");
    let children: Vec<usize> = (1..=pieces.len()).collect();
    let scale = [METRES_PER_MILLIMETRE; 3];
    nodes.push(json!({
        "name": root_name, "rotation": Z_UP_TO_Y_UP, "scale": scale, "children": children,
    }));
    for (number, piece) in pieces.iter().enumerate() {
        let split = splits[number].as_ref();
        let position = layout.positions(piece, split.map_or(piece.vertices.len(), |split| split.normals.len()));
        let normal = split.map(|split| layout.normals(split.normals.len()));
        let mut primitives = Vec::new();
        for (mode, count) in [(TRIANGLES, piece.triangles.len() * 3), (LINES, piece.segments.len() * 2), (POINTS, piece.points.len())] {
            if count > 0 {
                let indices = layout.indices(count);
                let mut attributes = json!({ "POSITION": position });
                if let Some(normal) = normal.filter(|_| mode == TRIANGLES) {
                    attributes["NORMAL"] = json!(normal);
                }
                primitives.push(json!({ "attributes": attributes, "indices": indices, "mode": mode, "material": 0 }));
            }
        }
        let name = piece.name.map_or_else(|| format!("part {}", number + 1), str::to_owned);
        nodes.push(json!({ "name": name, "mesh": number }));
        meshes.push(json!({ "name": name, "primitives": primitives }));
    }
    let mut extras = json!({ "unit_of_buffer": "millimetre" });
    if let Some(certificate) = metadata.certificate {
        extras["certificate"] = serde_json::to_value(certificate)?;
    }
    let document = json!({
        "asset": { "version": "2.0", "generator": metadata.application, "extras": extras },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [{
            "name": "print",
            // Open surfaces are seen from both sides.
            "doubleSided": true,
            "pbrMetallicRoughness": { "baseColorFactor": [0.80, 0.79, 0.76, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7 },
        }],
        "accessors": layout.accessors,
        "bufferViews": layout.views,
        "buffers": [{ "byteLength": layout.bytes }],
    });
    Ok((document, layout.bytes))
}

pub(crate) fn write<W: Write>(pieces: &[Piece<'_>], metadata: &Metadata<'_>, sink: &mut W) -> Result<(), FormatError> {
    let splits: Vec<Option<Split>> = pieces.iter().map(Split::of).collect();
    let (document, binary_bytes) = document(pieces, &splits, metadata)?;
    let mut words = serde_json::to_vec(&document)?;
    while !words.len().is_multiple_of(4) {
        words.push(b' ');
    }
    let total = FRAME_BYTES + words.len() as u64 + binary_bytes;
    let length = |bytes: u64| u32::try_from(bytes).map_err(|_| FormatError::limit(Place::File, "file_bytes", total, u64::from(u32::MAX)));
    let mut bytes = Vec::with_capacity(CHUNK_BYTES + 4096);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&VERSION.to_le_bytes());
    bytes.extend_from_slice(&length(total)?.to_le_bytes());
    bytes.extend_from_slice(&length(words.len() as u64)?.to_le_bytes());
    bytes.extend_from_slice(JSON_CHUNK);
    bytes.extend_from_slice(&words);
    bytes.extend_from_slice(&length(binary_bytes)?.to_le_bytes());
    bytes.extend_from_slice(BINARY_CHUNK);
    for (piece, split) in pieces.iter().zip(&splits) {
        let (copies, normals) = split.as_ref().map_or((&[][..], &[][..]), |split| (&split.copies[..], &split.normals[..]));
        let copies = copies.iter().map(|&vertex| &piece.vertices[vertex as usize]);
        for vector in piece.vertices.iter().chain(copies).chain(normals) {
            for number in singles(vector) {
                bytes.extend_from_slice(&number.to_le_bytes());
            }
            flush_full(&mut bytes, sink)?;
        }
        let triangles = split.as_ref().map_or(piece.triangles, |split| &split.triangles);
        for run in [triangles.as_flattened(), piece.segments.as_flattened(), piece.points] {
            for index in run {
                bytes.extend_from_slice(&index.to_le_bytes());
                flush_full(&mut bytes, sink)?;
            }
        }
    }
    sink.write_all(&bytes)?;
    sink.flush()?;
    Ok(())
}

pub(crate) fn verify<R: Read>(pieces: &[Piece<'_>], source: &mut R) -> Result<(), FormatError> {
    let mut frame = [0; 20];
    source.read_exact(&mut frame)?;
    let word = |at: usize| u32::from_le_bytes([frame[at], frame[at + 1], frame[at + 2], frame[at + 3]]);
    let counts = counts(pieces);
    let binary_bytes = counts.vertices * 12 + counts.triangles * 12;
    let expected = FRAME_BYTES + u64::from(word(12)) + binary_bytes;
    let mut words = Vec::new();
    source.by_ref().take(u64::from(word(12))).read_to_end(&mut words)?;
    let mut scanner = Scanner::new(source, Format::Glb);
    if !frame.starts_with(MAGIC) || word(4) != VERSION || u64::from(word(8)) != expected || &frame[16..] != JSON_CHUNK {
        return Err(scanner.differs(format!("a header for {expected} bytes"), format!("{frame:02x?}")));
    }
    verify_layout(pieces, &words, &scanner)?;
    let binary = scanner.bytes::<8>()?;
    if u64::from(u32::from_le_bytes([binary[0], binary[1], binary[2], binary[3]])) != binary_bytes || &binary[4..] != BINARY_CHUNK {
        return Err(scanner.differs(format!("a binary chunk of {binary_bytes} bytes"), format!("{binary:02x?}")));
    }
    let (mut vertex_number, mut triangle_number) = (0, 0);
    for piece in pieces {
        for vertex in piece.vertices {
            scanner.element = Place::Vertex(vertex_number);
            scanner.binary_numbers(singles(vertex))?;
            vertex_number += 1;
        }
        for triangle in piece.triangles {
            scanner.element = Place::Triangle(triangle_number);
            let found = scanner.bytes::<12>()?;
            let found = [0, 4, 8].map(|at| u32::from_le_bytes([found[at], found[at + 1], found[at + 2], found[at + 3]]));
            if found != *triangle {
                return Err(scanner.differs(format!("{triangle:?}"), format!("{found:?}")));
            }
            triangle_number += 1;
        }
    }
    scanner.end()
}

/// The document must place the runs of the buffer where the pieces have them.
fn verify_layout<R: Read>(pieces: &[Piece<'_>], words: &[u8], scanner: &Scanner<R>) -> Result<(), FormatError> {
    let found: Value = serde_json::from_slice(words)?;
    let mut layout = Layout::default();
    for piece in pieces {
        layout.positions(piece, piece.vertices.len());
        layout.indices(piece.triangles.len() * 3);
    }
    for (name, expected) in [("accessors", Value::from(layout.accessors)), ("bufferViews", Value::from(layout.views))] {
        // Through text, as the file's numbers were.
        let expected: Value = serde_json::from_str(&expected.to_string())?;
        if found[name] != expected {
            return Err(scanner.differs(format!("the {name} of the mesh"), "others"));
        }
    }
    Ok(())
}

//! 3D Manufacturing Format.
//!
//! Format: 3MF Consortium, Core Specification 1.4, and the Open Packaging Conventions below it.
//! What binds a producer here: the unit is written out; an object of type `model` is a closed,
//! consistently oriented 2-manifold with at least four triangles; a triangle's indices are
//! distinct; XML is UTF-8 without a document type definition; parts are deflated or stored; a
//! metadata name that the specification does not list carries the prefix of a declared namespace.

mod archive;
mod read;
mod verify;
mod xml;

pub(super) use xml::escape;

pub(crate) use read::read;
pub(crate) use verify::verify;

use super::error::{FormatError, Place};
use super::geometry::{Piece, counts};
use super::text::{push_integer, push_number, singles};
use super::{Format, Metadata};
use archive::{Archive, Deflated};
use rayon::prelude::*;
use std::io::{Seek, Write};

const MODEL_PART: &str = "3D/3dmodel.model";
const THUMBNAIL_PART: &str = "Metadata/thumbnail.png";
const RELATIONSHIPS_PART: &str = "_rels/.rels";
const CORE_NAMESPACE: &str = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
const MODEL_RELATIONSHIP: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
const THUMBNAIL_RELATIONSHIP: &str = "http://schemas.openxmlformats.org/package/2006/relationships/metadata/thumbnail";
/// A name, not an address: the namespace of our metadata.
const LACUNA_NAMESPACE: &str = "urn:lacuna:3mf:2026";

const VERTICES_START: &[u8] = b"<vertices>\n";
const VERTICES_END: &[u8] = b"</vertices>\n<triangles>\n";
const OBJECT_END: &[u8] = b"</triangles>\n</mesh>\n</object>\n";
const BUILD_START: &[u8] = b"</resources>\n<build>\n";
const MODEL_END: &[u8] = b"</build>\n</model>\n";

/// Elements in a block that is deflated by itself: about a megabyte of text, so that starting
/// afresh costs the ratio nothing that can be measured, and a block per thread is a few megabytes.
const BLOCK_ELEMENTS: usize = 24_576;
/// Longest text of a vertex (three numbers of at most twenty bytes) or a triangle.
const LONGEST_ELEMENT_BYTES: u64 = 85;

/// A run of text that is deflated by itself. What is in which block depends on the geometry alone.
#[derive(Clone, Copy)]
enum Block<'a> {
    Words(&'a [u8]),
    Vertices(&'a [glam::DVec3]),
    Triangles(&'a [[u32; 3]]),
}

impl Block<'_> {
    fn text(self) -> Vec<u8> {
        match self {
            Block::Words(words) => words.to_vec(),
            Block::Vertices(vertices) => {
                let mut text = Vec::with_capacity(vertices.len() * 48);
                for vertex in vertices {
                    let [x, y, z] = singles(vertex);
                    text.extend_from_slice(b"<vertex x=\"");
                    push_number(&mut text, x);
                    text.extend_from_slice(b"\" y=\"");
                    push_number(&mut text, y);
                    text.extend_from_slice(b"\" z=\"");
                    push_number(&mut text, z);
                    text.extend_from_slice(b"\"/>\n");
                }
                text
            }
            Block::Triangles(triangles) => {
                let mut text = Vec::with_capacity(triangles.len() * 48);
                for [a, b, c] in triangles {
                    text.extend_from_slice(b"<triangle v1=\"");
                    push_integer(&mut text, u64::from(*a));
                    text.extend_from_slice(b"\" v2=\"");
                    push_integer(&mut text, u64::from(*b));
                    text.extend_from_slice(b"\" v3=\"");
                    push_integer(&mut text, u64::from(*c));
                    text.extend_from_slice(b"\"/>\n");
                }
                text
            }
        }
    }
}

/// Writes the archive: content types, relationships, the picture if there is one, the model.
pub(crate) fn write<W: Write + Seek>(pieces: &[Piece<'_>], metadata: &Metadata<'_>, sink: &mut W) -> Result<(), FormatError> {
    for piece in pieces {
        check_countable(piece)?;
    }
    let thumbnail = metadata.thumbnail_png;
    let mut archive = Archive::new(sink)?;
    archive.entry("[Content_Types].xml", content_types(thumbnail.is_some()).as_bytes())?;
    archive.entry(RELATIONSHIPS_PART, relationships(thumbnail.is_some()).as_bytes())?;
    if let Some(picture) = thumbnail {
        archive.entry(THUMBNAIL_PART, picture)?;
    }
    let head = head(metadata)?;
    let objects: Vec<Vec<u8>> = pieces.iter().enumerate().map(|(number, piece)| object_start(number, piece.name)).collect();
    let tail = tail(pieces.len());
    let counts = counts(pieces);
    let words = head.len() + tail.len() + objects.iter().map(|start| start.len() + 100).sum::<usize>();
    let longest = (counts.vertices + counts.triangles) * LONGEST_ELEMENT_BYTES + words as u64;
    archive.begin(MODEL_PART, longest)?;
    let blocks = blocks(&head, &objects, pieces);
    // Two blocks for each thread at a time: the threads seldom wait, and memory stays flat.
    for batch in blocks.chunks(2 * rayon::current_num_threads()) {
        let deflated: Result<Vec<Deflated>, FormatError> = batch.par_iter().map(|block| Deflated::new(&block.text(), false)).collect();
        for block in deflated? {
            archive.append(&block)?;
        }
    }
    archive.append(&Deflated::new(&tail, true)?)?;
    archive.end()?;
    archive.finish()
}

fn check_countable(piece: &Piece<'_>) -> Result<(), FormatError> {
    /// The specification counts in signed 32-bit integers.
    const MOST: u64 = (1 << 31) - 1;
    for (limit, count) in [("vertices", piece.vertices.len()), ("triangles", piece.triangles.len())] {
        if count as u64 > MOST {
            return Err(FormatError::limit(Place::File, limit, count as u64, MOST));
        }
    }
    Ok(())
}

fn blocks<'a>(head: &'a [u8], objects: &'a [Vec<u8>], pieces: &[Piece<'a>]) -> Vec<Block<'a>> {
    let mut blocks = vec![Block::Words(head)];
    for (start, piece) in objects.iter().zip(pieces) {
        blocks.push(Block::Words(start));
        blocks.extend(piece.vertices.chunks(BLOCK_ELEMENTS).map(Block::Vertices));
        blocks.push(Block::Words(VERTICES_END));
        blocks.extend(piece.triangles.chunks(BLOCK_ELEMENTS).map(Block::Triangles));
        blocks.push(Block::Words(OBJECT_END));
    }
    blocks
}

fn content_types(thumbnail: bool) -> String {
    let picture = if thumbnail { "<Default Extension=\"png\" ContentType=\"image/png\"/>" } else { "" };
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">\
         <Default Extension=\"rels\" ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>\
         <Default Extension=\"model\" ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/>\
         {picture}</Types>\n"
    )
}

fn relationships(thumbnail: bool) -> String {
    let picture = if thumbnail {
        format!("<Relationship Target=\"/{THUMBNAIL_PART}\" Id=\"rel1\" Type=\"{THUMBNAIL_RELATIONSHIP}\"/>")
    } else {
        String::new()
    };
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">\
         <Relationship Target=\"/{MODEL_PART}\" Id=\"rel0\" Type=\"{MODEL_RELATIONSHIP}\"/>{picture}</Relationships>\n"
    )
}

fn head(metadata: &Metadata<'_>) -> Result<Vec<u8>, FormatError> {
    let mut head = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <model unit=\"millimeter\" xml:lang=\"en-US\" xmlns=\"{CORE_NAMESPACE}\" xmlns:lacuna=\"{LACUNA_NAMESPACE}\">\n"
    );
    let mut entry = |name: &str, value: &str| {
        head.push_str("<metadata name=\"");
        head.push_str(name);
        head.push_str("\">");
        xml::escape(value, &mut head);
        head.push_str("</metadata>\n");
    };
    if let Some(title) = metadata.title {
        entry("Title", title);
    }
    entry("Application", metadata.application);
    if let Some(certificate) = metadata.certificate {
        entry("lacuna:certificate", &serde_json::to_string(certificate)?);
    }
    head.push_str("<resources>\n");
    Ok(head.into_bytes())
}

fn object_start(number: usize, name: Option<&str>) -> Vec<u8> {
    let mut start = format!("<object id=\"{}\" type=\"model\"", number + 1);
    if let Some(name) = name {
        start.push_str(" name=\"");
        xml::escape(name, &mut start);
        start.push('"');
    }
    start.push_str(">\n<mesh>\n");
    let mut start = start.into_bytes();
    start.extend_from_slice(VERTICES_START);
    start
}

fn tail(objects: usize) -> Vec<u8> {
    let mut tail = BUILD_START.to_vec();
    for number in 1..=objects {
        tail.extend_from_slice(b"<item objectid=\"");
        push_integer(&mut tail, number as u64);
        tail.extend_from_slice(b"\"/>\n");
    }
    tail.extend_from_slice(MODEL_END);
    tail
}

/// A grammar error in a part.
fn malformed(part: &str, byte: u64, expected: &'static str, found: &[u8]) -> FormatError {
    FormatError::malformed(Format::ThreeMf, Place::Part { name: part.to_owned(), byte }, expected, found)
}

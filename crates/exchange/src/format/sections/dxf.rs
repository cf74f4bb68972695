//! Sections as a drawing exchange file of release 12 (Autodesk, "AutoCAD Release 12 Customization Manual", 1992, chapter 11): the
//! version that every reader takes, and the last one whose files need no handles and no tables.
//!
//! The version has no variable for units, so a comment says that they are millimetres. Layers are made by being named.

use super::{Out, push_number};
use crate::format::Metadata;
use crate::format::error::FormatError;
use glam::DVec3;
use lacuna_kernel::measure::section::Section;
use std::io::Write;

pub(super) const END: &[u8] = b"0\nENDSEC\n0\nEOF\n";

/// Letters of a layer's name, and of a line of text.
const NAME_LETTERS: usize = 31;
const LINE_LETTERS: usize = 255;

pub(super) fn start([low, high]: [DVec3; 2], metadata: &Metadata<'_>, text: &mut Vec<u8>) {
    comment(text, metadata.title.unwrap_or("sections"));
    comment(text, metadata.application);
    comment(text, "lengths in millimetres");
    text.extend_from_slice(b"0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n9\n$EXTMIN\n");
    position(text, low);
    text.extend_from_slice(b"9\n$EXTMAX\n");
    position(text, high);
    text.extend_from_slice(b"0\nENDSEC\n0\nSECTION\n2\nENTITIES\n");
}

/// The layer of a height: names are of capitals, digits and `$-_`, and short. Heights of too many digits are numbered.
pub(super) fn layer(height: &str, number: usize) -> String {
    let name = format!("Z_{}", height.replace('.', "_"));
    if name.len() <= NAME_LETTERS { name } else { format!("SECTION_{number}") }
}

/// A closed plane polyline for each loop, outer ones counter-clockwise.
pub(super) fn section<W: Write>(section: &Section, layer: &str, out: &mut Out<'_, W>) -> Result<(), FormatError> {
    for points in section.loops() {
        out.text.extend_from_slice(format!("0\nPOLYLINE\n8\n{layer}\n66\n1\n70\n1\n").as_bytes());
        position(out.text, DVec3::new(0.0, 0.0, section.offset_mm));
        out.each(points, |_, point, text| {
            text.extend_from_slice(b"0\nVERTEX\n8\n");
            text.extend_from_slice(layer.as_bytes());
            text.push(b'\n');
            position(text, point.extend(section.offset_mm));
        })?;
        out.text.extend_from_slice(format!("0\nSEQEND\n8\n{layer}\n").as_bytes());
    }
    Ok(())
}

fn position(text: &mut Vec<u8>, position: DVec3) {
    for (code, value) in [b"10\n", b"20\n", b"30\n"].into_iter().zip(position.to_array()) {
        text.extend_from_slice(code);
        push_number(text, value);
        text.push(b'\n');
    }
}

/// Words that readers skip, on one line of ASCII: other characters by their number, as AutoCAD writes them.
fn comment(text: &mut Vec<u8>, words: &str) {
    text.extend_from_slice(b"999\n");
    let end = text.len() + LINE_LETTERS;
    for letter in words.chars() {
        let code = u32::from(letter);
        let shown = if letter.is_control() {
            " ".to_owned()
        } else if letter.is_ascii() {
            letter.to_string()
        } else {
            format!("\\U+{code:04X}")
        };
        if text.len() + shown.len() > end {
            break;
        }
        text.extend_from_slice(shown.as_bytes());
    }
    text.push(b'\n');
}

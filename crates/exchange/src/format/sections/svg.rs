//! Sections as Scalable Vector Graphics (SVG 1.1, second edition, W3C 2011). One user unit is one millimetre.

use super::{Out, push_number};
use crate::format::Metadata;
use crate::format::error::FormatError;
use crate::format::threemf::escape;
use glam::{DVec2, DVec3};
use lacuna_kernel::measure::section::Section;
use std::io::Write;

pub(super) const END: &[u8] = b"</g>\n</svg>\n";

/// The head. The page is the box; its second axis points down, so v is written with the other sign.
pub(super) fn start([low, high]: [DVec3; 2], metadata: &Metadata<'_>, text: &mut Vec<u8>) {
    let size = high - low;
    text.extend_from_slice(
        b"<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" version=\"1.1\" width=\"",
    );
    push_number(text, size.x);
    text.extend_from_slice(b"mm\" height=\"");
    push_number(text, size.y);
    text.extend_from_slice(b"mm\" viewBox=\"");
    push_pair(text, low.x, -high.y);
    text.push(b' ');
    push_pair(text, size.x, size.y);
    let mut words = String::from("\">\n<title>");
    escape(metadata.title.unwrap_or("sections"), &mut words);
    words.push_str("</title>\n<desc>");
    escape(metadata.application, &mut words);
    words.push_str("</desc>\n<g fill=\"#222222\" fill-opacity=\"0.2\" fill-rule=\"evenodd\" ");
    words.push_str("stroke=\"#222222\" stroke-width=\"0.1\" stroke-linejoin=\"round\">\n");
    text.extend_from_slice(words.as_bytes());
}

/// A group named by its height; the second and later ones of a height have their number after it, because names are unique.
pub(super) fn section<W: Write>(section: &Section, name: &str, uses: usize, out: &mut Out<'_, W>) -> Result<(), FormatError> {
    let more = if uses > 1 { format!("_{uses}") } else { String::new() };
    out.text.extend_from_slice(format!("<g id=\"z_{name}{more}\">\n").as_bytes());
    for polygon in &section.polygons {
        path(polygon.loops(), "", out)?;
    }
    for hole in &section.unmatched {
        path(std::iter::once(hole.as_slice()), " class=\"unmatched\" fill=\"none\"", out)?;
    }
    out.text.extend_from_slice(b"</g>\n");
    Ok(())
}

/// One path: every loop is closed, and by even and odd the holes are left out.
fn path<'a, W: Write>(loops: impl Iterator<Item = &'a [DVec2]>, attributes: &str, out: &mut Out<'_, W>) -> Result<(), FormatError> {
    out.text.extend_from_slice(format!("<path{attributes} d=\"").as_bytes());
    for points in loops {
        out.each(points, |index, point, text| {
            text.push(if index == 0 { b'M' } else { b'L' });
            push_pair(text, point.x, -point.y);
        })?;
        out.text.push(b'z');
    }
    out.text.extend_from_slice(b"\"/>\n");
    Ok(())
}

fn push_pair(text: &mut Vec<u8>, x: f64, y: f64) {
    push_number(text, x);
    text.push(b' ');
    push_number(text, y);
}

//! The little of XML that a 3MF file needs: escaping out, and a guarded event stream in.

use super::super::error::{FormatError, Place};
use super::super::limits::within;
use super::malformed;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::io::{self, BufRead, BufReader, Read};

/// Appends text with the five predefined entities, legal in content and in attributes. Characters
/// that XML 1.0 has no form for become the replacement character.
pub(in crate::format) fn escape(text: &str, into: &mut String) {
    for character in text.chars() {
        match character {
            '&' => into.push_str("&amp;"),
            '<' => into.push_str("&lt;"),
            '>' => into.push_str("&gt;"),
            '"' => into.push_str("&quot;"),
            '\'' => into.push_str("&apos;"),
            '\n' | '\r' | '\t' => into.push(' '),
            '\u{fffe}' | '\u{ffff}' => into.push('\u{fffd}'),
            other if other.is_control() => into.push('\u{fffd}'),
            other => into.push(other),
        }
    }
}

/// What is left to inflate, in the archive and in one element.
pub(super) struct Allowance {
    /// Bytes that the archive may still inflate to.
    pub(super) archive_left: u64,
    /// The bound that was set on them, for the message.
    pub(super) archive_most: u64,
    /// How deep elements may lie in each other.
    pub(super) depth_most: u64,
}

/// Longest tag or text: a certificate in the metadata has a few kilobytes.
const LONGEST_EVENT_BYTES: u64 = 16 << 20;

/// Counts bytes as they are inflated, because the sizes in an archive's directory are claims.
struct Counted<'a, R> {
    source: BufReader<R>,
    allowance: &'a mut Allowance,
    event_left: u64,
    exceeded: Option<(&'static str, u64)>,
}

impl<R: Read> Read for Counted<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl<R: Read> BufRead for Counted<'_, R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.event_left == 0 {
            self.exceeded = Some(("xml_element_bytes", LONGEST_EVENT_BYTES));
        } else if self.allowance.archive_left == 0 {
            self.exceeded = Some(("inflated_bytes", self.allowance.archive_most));
        }
        if self.exceeded.is_some() {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        self.source.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        self.event_left = self.event_left.saturating_sub(count as u64);
        self.allowance.archive_left = self.allowance.archive_left.saturating_sub(count as u64);
        self.source.consume(count);
    }
}

/// A tag as the visitor sees it.
pub(super) enum Tag<'a, 'b> {
    /// A start tag, or one that ends itself.
    Start(&'a BytesStart<'b>),
    /// The name of an end tag, or of a tag that ended itself.
    End(&'a str),
}

/// Goes through the tags of a part. Document type definitions are refused; text is skipped.
pub(super) fn visit<R: Read>(
    source: R,
    part: &str,
    allowance: &mut Allowance,
    visitor: &mut dyn FnMut(Tag<'_, '_>, u64) -> Result<(), FormatError>,
) -> Result<(), FormatError> {
    let depth_most = allowance.depth_most;
    let counted = Counted { source: BufReader::with_capacity(64 << 10, source), allowance, event_left: 0, exceeded: None };
    let mut reader = Reader::from_reader(counted);
    let mut buffer = Vec::new();
    let mut depth = 0_u64;
    let mut elements = 0_u64;
    loop {
        let byte = reader.buffer_position();
        let place = || Place::Part { name: part.to_owned(), byte };
        buffer.clear();
        reader.get_mut().event_left = LONGEST_EVENT_BYTES;
        let event = match reader.read_event_into(&mut buffer) {
            Ok(event) => event,
            Err(error) => {
                return Err(match reader.get_mut().exceeded {
                    Some((limit, most)) => FormatError::limit(place(), limit, most.saturating_add(1), most),
                    None => malformed(part, byte, "well-formed XML", error.to_string().as_bytes()),
                });
            }
        };
        match event {
            Event::Start(start) => {
                depth += 1;
                elements += 1;
                within(place(), "xml_depth", depth, depth_most)?;
                visitor(Tag::Start(&start), byte)?;
            }
            Event::Empty(start) => {
                elements += 1;
                visitor(Tag::Start(&start), byte)?;
                visitor(Tag::End(start.name().0), byte)?;
            }
            Event::End(end) => {
                depth = depth.saturating_sub(1);
                visitor(Tag::End(end.name().0), byte)?;
            }
            Event::DocType(_) => return Err(FormatError::Refused { place: place(), what: "a document type definition" }),
            Event::Eof if depth == 0 && elements > 0 => return Ok(()),
            Event::Eof => return Err(malformed(part, byte, "the end of every element", b"the end of the part")),
            _ => {}
        }
    }
}

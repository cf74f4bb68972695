//! Numbers and words as text, out and in.

use super::Format;
use super::error::{FormatError, Place};
use glam::DVec3;
use std::borrow::Cow;

/// Bytes that an encoder gathers before it hands them to the sink: large enough that the calls
/// do not count, small enough to stay in the second-level cache.
pub(crate) const CHUNK_BYTES: usize = 256 << 10;

/// The nearest single-precision number; a zero comes out positive.
#[expect(clippy::cast_possible_truncation, reason = "rounding is what it is for")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32 + 0.0
}

/// [`single`] of every coordinate.
pub(crate) fn singles(position: &DVec3) -> [f32; 3] {
    position.to_array().map(single)
}

/// Appends the shortest decimal that reads back as the same single-precision number.
pub(crate) fn push_number(text: &mut Vec<u8>, value: f32) {
    let mut buffer = zmij::Buffer::new();
    let shortest = buffer.format_finite(value).as_bytes();
    // Whole numbers come with ".0": two bytes that no reader needs.
    text.extend_from_slice(shortest.strip_suffix(b".0").unwrap_or(shortest));
}

/// Appends a whole number.
pub(crate) fn push_integer(text: &mut Vec<u8>, value: u64) {
    text.extend_from_slice(itoa::Buffer::new().format(value).as_bytes());
}

/// Appends the three coordinates with spaces between.
pub(crate) fn push_position(text: &mut Vec<u8>, position: &DVec3) {
    let [x, y, z] = singles(position);
    push_number(text, x);
    text.push(b' ');
    push_number(text, y);
    text.push(b' ');
    push_number(text, z);
}

/// Words on one line: what would end a comment or hide the rest of it becomes a space.
pub(crate) fn one_line(words: &str) -> Cow<'_, str> {
    if words.contains(char::is_control) { Cow::Owned(words.replace(char::is_control, " ")) } else { Cow::Borrowed(words) }
}

/// The lines of a text with their numbers, the first being 1; either convention of line ends.
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    pub(crate) number: u64,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(text: &'a [u8]) -> Self {
        Self { rest: text, number: 0 }
    }

    /// Where the last line was.
    pub(crate) fn place(&self) -> Place {
        Place::Line(self.number)
    }

    /// Bytes that are still to come.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let end = self.rest.iter().position(|&byte| byte == b'\n');
        let (line, rest) = match end {
            Some(end) => (&self.rest[..end], &self.rest[end + 1..]),
            None => (self.rest, &self.rest[self.rest.len()..]),
        };
        self.rest = rest;
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }
}

/// The words of a line.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// A decimal number; infinities and NaN are numbers here and refused where they are used.
pub(crate) fn decimal(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// A whole number.
pub(crate) fn integer(word: &[u8]) -> Option<i64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Three decimals from the next words of a line.
pub(crate) fn position<'a>(
    words: &mut impl Iterator<Item = &'a [u8]>,
    format: Format,
    place: impl Fn() -> Place,
) -> Result<DVec3, FormatError> {
    let mut coordinates = [0.0; 3];
    for coordinate in &mut coordinates {
        let word = words.next().unwrap_or_default();
        *coordinate = decimal(word).ok_or_else(|| FormatError::malformed(format, place(), "a coordinate", word))?;
    }
    Ok(DVec3::from_array(coordinates))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn numbers_read_back_bit_for_bit() {
        let mut bits: u32 = 1;
        for _ in 0..200_000 {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let value = f32::from_bits(bits);
            if !value.is_finite() {
                continue;
            }
            let mut text = Vec::new();
            push_number(&mut text, value);
            let back: f32 = std::str::from_utf8(&text).unwrap().parse().unwrap();
            assert_eq!(back.to_bits(), value.to_bits(), "{}", String::from_utf8_lossy(&text));
            assert!(text.len() <= 20, "{}", String::from_utf8_lossy(&text));
        }
    }

    #[test]
    fn a_negative_zero_is_written_as_zero() {
        let mut text = Vec::new();
        push_position(&mut text, &DVec3::new(-0.0, 40.0, -1.5));
        assert_eq!(text, b"0 40 -1.5");
    }

    #[test]
    fn lines_are_counted_with_either_ending() {
        let mut lines = Lines::new(b"a\r\nb\n\nc");
        assert_eq!((lines.next(), lines.number), (Some(b"a".as_slice()), 1));
        assert_eq!(lines.by_ref().collect::<Vec<_>>(), [b"b".as_slice(), b"", b"c"]);
        assert_eq!(lines.number, 4);
    }
}

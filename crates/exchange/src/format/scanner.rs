//! A strict scanner over a byte stream, for files that this crate wrote itself.
//!
//! It holds one window of the stream and asks for the expected words in order. That is several
//! times faster than a general parser, and stricter: any other form than ours is a difference.

use super::Format;
use super::error::{FormatError, Place};
use std::io::{ErrorKind, Read};

/// Longest element that is scanned at once: a vertex or a triangle in XML is under 80 bytes.
const LONGEST: usize = 256;
const WINDOW_BYTES: usize = 256 << 10;

/// The window and its place in the stream.
pub(crate) struct Scanner<R> {
    source: R,
    format: Format,
    window: Vec<u8>,
    start: usize,
    end: usize,
    /// Stream position of the window's first byte.
    before: u64,
    /// Elements expected so far, for messages.
    pub(crate) element: Place,
}

impl<R: Read> Scanner<R> {
    pub(crate) fn new(source: R, format: Format) -> Self {
        Self { source, format, window: vec![0; WINDOW_BYTES], start: 0, end: 0, before: 0, element: Place::File }
    }

    /// Moves the rest to the window's front and fills it, unless enough is there.
    fn fill(&mut self) -> Result<(), FormatError> {
        if self.end - self.start >= LONGEST {
            return Ok(());
        }
        self.window.copy_within(self.start..self.end, 0);
        self.before += self.start as u64;
        self.end -= self.start;
        self.start = 0;
        while self.end < self.window.len() {
            match self.source.read(&mut self.window[self.end..]) {
                Ok(0) => break,
                Ok(count) => self.end += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    pub(crate) fn differs(&self, expected: impl Into<String>, found: impl Into<String>) -> FormatError {
        let place = match self.element {
            Place::File => Place::Byte(self.before + self.start as u64),
            ref element => element.clone(),
        };
        FormatError::Differs { format: self.format, place, expected: expected.into(), found: found.into() }
    }

    fn shown(&self) -> String {
        let rest = &self.window[self.start..self.end];
        String::from_utf8_lossy(rest.get(..40).unwrap_or(rest)).into_owned()
    }

    /// Steps over `word`, which must come next.
    #[inline]
    pub(crate) fn expect(&mut self, word: &[u8]) -> Result<(), FormatError> {
        self.fill()?;
        if self.window[self.start..self.end].starts_with(word) {
            self.start += word.len();
            return Ok(());
        }
        Err(self.differs(String::from_utf8_lossy(word), self.shown()))
    }

    /// The bytes up to `delimiter`, which is stepped over.
    #[inline]
    fn until(&mut self, delimiter: u8) -> Result<&str, FormatError> {
        self.fill()?;
        let rest = &self.window[self.start..self.end];
        let rest = rest.get(..LONGEST).unwrap_or(rest);
        let Some(length) = rest.iter().position(|&byte| byte == delimiter) else {
            return Err(self.differs("a number", self.shown()));
        };
        let first = self.start;
        self.start += length + 1;
        Ok(std::str::from_utf8(&self.window[first..first + length]).unwrap_or_default())
    }

    /// A number that must parse to exactly `expected`, and the delimiter after it.
    #[inline]
    pub(crate) fn number(&mut self, expected: f32, delimiter: u8) -> Result<(), FormatError> {
        let word = self.until(delimiter)?;
        match word.parse::<f32>() {
            Ok(value) if value.to_bits() == expected.to_bits() => Ok(()),
            _ => {
                let found = word.to_owned();
                Err(self.differs(expected.to_string(), found))
            }
        }
    }

    /// An index that must be exactly `expected`, and the delimiter after it.
    #[inline]
    pub(crate) fn index(&mut self, expected: u64, delimiter: u8) -> Result<(), FormatError> {
        let word = self.until(delimiter)?;
        match word.parse::<u64>() {
            Ok(value) if value == expected => Ok(()),
            _ => {
                let found = word.to_owned();
                Err(self.differs(expected.to_string(), found))
            }
        }
    }

    /// The next `LENGTH` bytes.
    #[inline]
    pub(crate) fn bytes<const LENGTH: usize>(&mut self) -> Result<[u8; LENGTH], FormatError> {
        const { assert!(LENGTH <= LONGEST) };
        self.fill()?;
        let bytes: Option<[u8; LENGTH]> = self.window[self.start..self.end].first_chunk::<LENGTH>().copied();
        let Some(bytes) = bytes else {
            return Err(self.differs(format!("{LENGTH} bytes"), format!("{} bytes", self.end - self.start)));
        };
        self.start += LENGTH;
        Ok(bytes)
    }

    /// Single-precision numbers, little-endian, that must be exactly `expected`.
    #[inline]
    pub(crate) fn binary_numbers(&mut self, expected: [f32; 3]) -> Result<(), FormatError> {
        let found = self.bytes::<12>()?;
        let mut wanted = [0; 12];
        for (four, value) in wanted.chunks_exact_mut(4).zip(expected) {
            four.copy_from_slice(&value.to_le_bytes());
        }
        if found == wanted { Ok(()) } else { Err(self.differs(format!("{expected:?}"), format!("the bytes {found:02x?}"))) }
    }

    /// Steps over everything up to and including `word`, at most `limit` bytes.
    pub(crate) fn skip_past(&mut self, word: &[u8], limit: u64) -> Result<(), FormatError> {
        let first = self.before + self.start as u64;
        loop {
            self.fill()?;
            let rest = &self.window[self.start..self.end];
            if let Some(at) = rest.windows(word.len()).position(|candidate| candidate == word) {
                self.start += at + word.len();
                return Ok(());
            }
            let skipped = rest.len().saturating_sub(word.len() - 1);
            if skipped == 0 || self.before + self.start as u64 - first > limit {
                return Err(self.differs(String::from_utf8_lossy(word), self.shown()));
            }
            self.start += skipped;
        }
    }

    /// The stream must be at its end.
    pub(crate) fn end(&mut self) -> Result<(), FormatError> {
        self.element = Place::File;
        self.fill()?;
        if self.start == self.end { Ok(()) } else { Err(self.differs("the end of the file", self.shown())) }
    }
}

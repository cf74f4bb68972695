//! The words of a scene: blanks, commas and comments are gone, lines are counted.

use super::super::Format;
use super::super::error::{FormatError, Place};

/// A piece of the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Token<'a> {
    /// `{`
    Open,
    /// `}`
    Close,
    /// `[`
    ListOpen,
    /// `]`
    ListClose,
    /// A string; what it says is nowhere needed.
    Text,
    /// A name, a keyword or a number.
    Word(&'a [u8]),
    /// The end of the file.
    End,
}

/// The text, with one token seen ahead.
pub(super) struct Scan<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
    ahead: Option<Token<'a>>,
    /// Whether a comment names millimetres as the unit.
    pub(super) says_millimetres: bool,
}

impl<'a> Scan<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let at = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
        Self { bytes, at, line: 1, ahead: None, says_millimetres: false }
    }

    /// The line of the last token.
    pub(super) fn place(&self) -> Place {
        Place::Line(self.line)
    }

    pub(super) fn line(&self) -> u64 {
        self.line
    }

    /// The next token, left where it is.
    pub(super) fn peek(&mut self) -> Result<Token<'a>, FormatError> {
        if let Some(token) = self.ahead {
            return Ok(token);
        }
        let token = self.scan()?;
        self.ahead = Some(token);
        Ok(token)
    }

    pub(super) fn next(&mut self) -> Result<Token<'a>, FormatError> {
        let token = self.peek()?;
        self.ahead = None;
        Ok(token)
    }

    /// The error of something else than `expected`.
    pub(super) fn malformed(&self, expected: &'static str, found: Token<'_>) -> FormatError {
        let shown: &[u8] = match found {
            Token::Open => b"{",
            Token::Close => b"}",
            Token::ListOpen => b"[",
            Token::ListClose => b"]",
            Token::Text => b"a string",
            Token::Word(word) => word,
            Token::End => return self.truncated(),
        };
        FormatError::malformed(Format::Vrml, self.place(), expected, shown)
    }

    fn truncated(&self) -> FormatError {
        let found = self.bytes.len() as u64;
        FormatError::Truncated { format: Format::Vrml, place: self.place(), needed: found + 1, found }
    }

    fn scan(&mut self) -> Result<Token<'a>, FormatError> {
        self.skip_blanks();
        let Some(&byte) = self.bytes.get(self.at) else { return Ok(Token::End) };
        let single = match byte {
            b'{' => Token::Open,
            b'}' => Token::Close,
            b'[' => Token::ListOpen,
            b']' => Token::ListClose,
            b'"' => return self.text(),
            _ => {
                let rest = &self.bytes[self.at..];
                // C libraries print NaN as 1.#IND: no comment begins there.
                let ends = |at: usize| ends_word(rest[at]) && !(rest[at] == b'#' && at > 0 && rest[at - 1] == b'.');
                let length = (0..rest.len()).find(|&at| ends(at)).unwrap_or(rest.len());
                self.at += length;
                return Ok(Token::Word(&rest[..length]));
            }
        };
        self.at += 1;
        Ok(single)
    }

    /// Steps over blanks, commas, what joins the flags of version 1.0, and comments.
    fn skip_blanks(&mut self) {
        while let Some(&byte) = self.bytes.get(self.at) {
            match byte {
                b'\n' => self.line += 1,
                b'#' => {
                    let rest = &self.bytes[self.at..];
                    let length = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
                    self.says_millimetres |= rest[..length].trim_ascii_end().ends_with(b"units mm");
                    self.at += length;
                    continue;
                }
                _ if is_blank(byte) => {}
                _ => return,
            }
            self.at += 1;
        }
    }

    /// Steps over a string, which may run over lines; a backslash saves the character after it.
    fn text(&mut self) -> Result<Token<'a>, FormatError> {
        self.at += 1;
        while let Some(&byte) = self.bytes.get(self.at) {
            self.at += 1;
            match byte {
                b'"' => return Ok(Token::Text),
                b'\\' => {
                    self.line += u64::from(self.bytes.get(self.at) == Some(&b'\n'));
                    self.at += 1;
                }
                b'\n' => self.line += 1,
                _ => {}
            }
        }
        self.at = self.bytes.len();
        Err(self.truncated())
    }
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | b',' | b'(' | b')' | b'|' | 0x0b | 0x0c)
}

fn ends_word(byte: u8) -> bool {
    is_blank(byte) || matches!(byte, b'{' | b'}' | b'[' | b']' | b'"' | b'#')
}

/// A number: decimal in any form that Rust or C prints, or hexadecimal. Infinities and NaN are numbers
/// here, and refused where they are used.
pub(super) fn number(word: &[u8]) -> Option<f64> {
    let digits = word.strip_prefix(b"-").or_else(|| word.strip_prefix(b"+")).unwrap_or(word);
    if let Some(hexadecimal) = digits.strip_prefix(b"0x").or_else(|| digits.strip_prefix(b"0X")) {
        let value = u32::from_str_radix(std::str::from_utf8(hexadecimal).ok()?, 16).ok()?;
        return Some(if word[0] == b'-' { -f64::from(value) } else { f64::from(value) });
    }
    super::super::text::decimal(word)
}

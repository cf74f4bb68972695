//! From text to a [`Node`] tree, after RFC 8259.
//!
//! A parser of its own, because a general one gives up at the first `1e999` or `NaN`, keeps one of two
//! members of the same name, and forgets places. Here what can be stepped over (a number without a
//! finite value, a repeated name) is reported with its pointer and reading goes on; what cannot (a
//! missing comma, the end of the text) is reported once and ends the reading. Recursion is bounded by
//! the nesting limit, memory by the size of the text and the limit on values.

use std::borrow::Cow;

use super::DocumentLimits;
use super::node::{Node, Path, Value, quoted};
use super::report::Report;
use crate::diagnostic::code;

/// Nesting that the stack bears whatever the limits say: reading and walking recurse once per level.
const NESTING_CEILING: usize = 256;

/// Reading ended; why has been reported.
struct Ended;

/// Reads one JSON value. `None` when reading ended early; the report may have faults in either case.
pub(super) fn parse<'t>(text: &'t str, limits: &DocumentLimits, report: &mut Report) -> Option<Node<'t>> {
    let nesting = limits.nesting.min(NESTING_CEILING);
    let mut parser = Parser { text, at: 0, depth: 0, nesting, values_left: limits.values, report };
    parser.document().ok()
}

struct Parser<'t, 'r> {
    text: &'t str,
    at: usize,
    depth: usize,
    nesting: usize,
    values_left: usize,
    report: &'r mut Report,
}

impl<'t> Parser<'t, '_> {
    fn document(&mut self) -> Result<Node<'t>, Ended> {
        self.skip_space();
        if self.peek().is_none() {
            return self.end(&Path::ROOT, code::NO_CONTENT, || "the document is empty; expected a JSON object".into());
        }
        let node = self.value(&Path::ROOT)?;
        self.skip_space();
        if self.peek().is_some() {
            let found = self.next_character();
            return self.end(&Path::ROOT, code::TRAILING_CONTENT, || {
                format!("{found} follows the document; a document is one JSON value and nothing after it")
            });
        }
        Ok(node)
    }

    fn value(&mut self, path: &Path<'_>) -> Result<Node<'t>, Ended> {
        self.skip_space();
        let offset = self.offset();
        let value = match self.peek() {
            Some(b'{') => self.object(path)?,
            Some(b'[') => self.array(path)?,
            Some(b'"') => match self.string(path)? {
                Cow::Borrowed(text) => Value::Text(text),
                Cow::Owned(text) => Value::Unescaped(text.into_boxed_str()),
            },
            Some(b'-' | b'0'..=b'9') => self.number(path)?,
            Some(byte) if byte.is_ascii_alphabetic() => self.word(path)?,
            _ => return self.unexpected(path, "a value"),
        };
        Ok(Node { offset, value })
    }

    fn array(&mut self, path: &Path<'_>) -> Result<Value<'t>, Ended> {
        let offset = self.offset();
        self.enter(path)?;
        let mut numbers: Vec<f64> = Vec::new();
        let mut nodes: Vec<Node<'t>> = Vec::new();
        self.skip_space();
        if self.peek() == Some(b']') {
            self.leave();
            return Ok(Value::Numbers(Box::default()));
        }
        loop {
            let node = self.value(&path.index(numbers.len() + nodes.len()))?;
            match node.value {
                Value::Number(number) if nodes.is_empty() => numbers.push(number),
                _ => {
                    if nodes.is_empty() {
                        self.count(path, numbers.len())?;
                        nodes.extend(numbers.drain(..).map(|number| Node { offset, value: Value::Number(number) }));
                    }
                    self.count(path, 1)?;
                    nodes.push(node);
                }
            }
            self.skip_space();
            match self.peek() {
                Some(b',') => self.at += 1,
                Some(b']') => break,
                _ => return self.unexpected(path, "`,` or `]`"),
            }
        }
        self.leave();
        Ok(if nodes.is_empty() { Value::Numbers(numbers.into_boxed_slice()) } else { Value::Array(nodes.into_boxed_slice()) })
    }

    fn object(&mut self, path: &Path<'_>) -> Result<Value<'t>, Ended> {
        self.enter(path)?;
        let mut members: Vec<(Cow<'t, str>, Node<'t>)> = Vec::new();
        self.skip_space();
        if self.peek() == Some(b'}') {
            self.leave();
            return Ok(Value::Object(Box::default()));
        }
        loop {
            self.skip_space();
            if self.peek() != Some(b'"') {
                return self.unexpected(path, "a member's name in double quotes");
            }
            let name = self.string(path)?;
            self.skip_space();
            if self.peek() != Some(b':') {
                return self.unexpected(path, "`:` after a member's name");
            }
            self.at += 1;
            let node = self.value(&path.member(&name))?;
            self.count(path, 1)?;
            members.push((name, node));
            self.skip_space();
            match self.peek() {
                Some(b',') => self.at += 1,
                Some(b'}') => break,
                _ => return self.unexpected(path, "`,` or `}`"),
            }
        }
        self.leave();
        self.report_duplicates(path, &members);
        Ok(Value::Object(members.into_boxed_slice()))
    }

    /// Sorts only what is long: objects of models have a handful of members, hostile ones a million.
    fn report_duplicates(&mut self, path: &Path<'_>, members: &[(Cow<'t, str>, Node<'t>)]) {
        let mut repeated: Vec<usize> = Vec::new();
        if members.len() <= 16 {
            repeated.extend((1..members.len()).filter(|&later| members[..later].iter().any(|(name, _)| *name == members[later].0)));
        } else {
            let mut order: Vec<usize> = (0..members.len()).collect();
            order.sort_by(|&one, &other| members[one].0.cmp(&members[other].0));
            repeated.extend(order.windows(2).filter(|pair| members[pair[0]].0 == members[pair[1]].0).map(|pair| pair[1]));
        }
        for index in repeated {
            let (name, node) = &members[index];
            self.report.add(&path.member(name), node.offset, code::DUPLICATE_MEMBER, || {
                format!("the member {} occurs twice in one object; keep one of them", quoted(name))
            });
        }
    }

    fn string(&mut self, path: &Path<'_>) -> Result<Cow<'t, str>, Ended> {
        self.at += 1;
        let mut owned: Option<String> = None;
        let mut start = self.at;
        loop {
            match self.peek() {
                Some(b'"') => {
                    let rest = self.slice(start, self.at);
                    self.at += 1;
                    return Ok(match owned {
                        None => Cow::Borrowed(rest),
                        Some(text) => Cow::Owned(text + rest),
                    });
                }
                Some(b'\\') => {
                    let before = self.slice(start, self.at);
                    let character = self.escape(path)?;
                    let text = owned.get_or_insert_default();
                    text.push_str(before);
                    text.push(character);
                    start = self.at;
                }
                Some(0..0x20) => return self.unexpected(path, "a string without control characters (write them as escapes)"),
                Some(_) => self.at += 1,
                None => return self.unexpected(path, "the end of a string"),
            }
        }
    }

    fn escape(&mut self, path: &Path<'_>) -> Result<char, Ended> {
        self.at += 1;
        let character = match self.peek() {
            Some(b'"') => '"',
            Some(b'\\') => '\\',
            Some(b'/') => '/',
            Some(b'b') => '\u{8}',
            Some(b'f') => '\u{c}',
            Some(b'n') => '\n',
            Some(b'r') => '\r',
            Some(b't') => '\t',
            Some(b'u') => return self.unicode_escape(path),
            _ => return self.unexpected(path, "an escape: one of \\\" \\\\ \\/ \\b \\f \\n \\r \\t \\uXXXX"),
        };
        self.at += 1;
        Ok(character)
    }

    fn unicode_escape(&mut self, path: &Path<'_>) -> Result<char, Ended> {
        let first = self.four_digits(path)?;
        let scalar = if (0xD800..0xDC00).contains(&first) && self.text.as_bytes()[self.at..].starts_with(b"\\u") {
            self.at += 1;
            let second = self.four_digits(path)?;
            if (0xDC00..0xE000).contains(&second) { 0x10000 + ((first - 0xD800) << 10) + (second - 0xDC00) } else { first }
        } else {
            first
        };
        match char::from_u32(scalar) {
            Some(character) => Ok(character),
            None => self.end(path, code::SYNTAX, || {
                format!("\\u{first:04x} is half of a surrogate pair; write both halves or the character itself")
            }),
        }
    }

    /// Reads `uXXXX`.
    fn four_digits(&mut self, path: &Path<'_>) -> Result<u32, Ended> {
        self.at += 1;
        let mut number = 0;
        for _ in 0..4 {
            match self.peek().and_then(|byte| char::from(byte).to_digit(16)) {
                Some(digit) => number = number * 16 + digit,
                None => return self.unexpected(path, "four hexadecimal digits after \\u"),
            }
            self.at += 1;
        }
        Ok(number)
    }

    fn number(&mut self, path: &Path<'_>) -> Result<Value<'t>, Ended> {
        let start = self.at;
        if self.peek() == Some(b'-') {
            self.at += 1;
            if self.peek().is_some_and(|byte| byte.is_ascii_alphabetic()) {
                return self.word_from(start, path);
            }
        }
        let leading_zero = self.peek() == Some(b'0');
        let digits = self.digits();
        if digits == 0 || (leading_zero && digits > 1) {
            return self.unexpected(path, "a JSON number (no leading zeros, a digit before the point)");
        }
        if self.peek() == Some(b'.') {
            self.at += 1;
            if self.digits() == 0 {
                return self.unexpected(path, "a digit after the decimal point");
            }
        }
        if matches!(self.peek(), Some(b'e' | b'E')) {
            self.at += 1;
            if matches!(self.peek(), Some(b'+' | b'-')) {
                self.at += 1;
            }
            if self.digits() == 0 {
                return self.unexpected(path, "a digit in the exponent");
            }
        }
        let literal = self.slice(start, self.at);
        match literal.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Value::Number(number)),
            _ => Ok(self.not_finite(path, start)),
        }
    }

    fn digits(&mut self) -> usize {
        let start = self.at;
        while self.peek().is_some_and(|byte| byte.is_ascii_digit()) {
            self.at += 1;
        }
        self.at - start
    }

    fn word(&mut self, path: &Path<'_>) -> Result<Value<'t>, Ended> {
        self.word_from(self.at, path)
    }

    /// A bare word: a literal, or a spelling of a number that JSON does not have.
    fn word_from(&mut self, start: usize, path: &Path<'_>) -> Result<Value<'t>, Ended> {
        while self.peek().is_some_and(|byte| byte.is_ascii_alphabetic()) {
            self.at += 1;
        }
        match self.slice(start, self.at) {
            "null" => Ok(Value::Null),
            "true" => Ok(Value::Flag(true)),
            "false" => Ok(Value::Flag(false)),
            word if ["nan", "inf", "infinity"].contains(&word.trim_start_matches('-').to_ascii_lowercase().as_str()) => {
                Ok(self.not_finite(path, start))
            }
            word if self.peek().is_none() && ["null", "true", "false"].iter().any(|literal| literal.starts_with(word)) => {
                self.unexpected(path, "the rest of a literal")
            }
            word => {
                let found = quoted(word);
                self.at = start;
                self.end(path, code::SYNTAX, || format!("{found} is not JSON; expected a value (strings are in double quotes)"))
            }
        }
    }

    fn not_finite(&mut self, path: &Path<'_>, start: usize) -> Value<'t> {
        let literal = quoted(self.slice(start, self.at)).replace('"', "");
        self.report.add(path, offset_of(start), code::NOT_FINITE, || {
            format!("{literal} is not a finite number in double precision; write one between -1.79e308 and 1.79e308")
        });
        Value::Reported
    }

    fn enter(&mut self, path: &Path<'_>) -> Result<(), Ended> {
        if self.depth == self.nesting {
            let nesting = self.nesting;
            return self.end(path, code::TOO_DEEP, || {
                format!(
                    "arrays and objects are nested more than {nesting} deep; a model needs far less, and a group of groups can be flattened"
                )
            });
        }
        self.depth += 1;
        self.at += 1;
        Ok(())
    }

    fn leave(&mut self) {
        self.depth -= 1;
        self.at += 1;
    }

    fn count(&mut self, path: &Path<'_>, values: usize) -> Result<(), Ended> {
        match self.values_left.checked_sub(values) {
            Some(left) => {
                self.values_left = left;
                Ok(())
            }
            None => self.end(path, code::TOO_MANY_VALUES, || "the document holds more values than the limit; send a smaller model".into()),
        }
    }

    /// Reports what stands where something else was expected, the end of the text included.
    fn unexpected<T>(&mut self, path: &Path<'_>, expected: &str) -> Result<T, Ended> {
        let Some(byte) = self.peek() else {
            return self.end(path, code::TRUNCATED, || format!("the document ends where {expected} was expected; was it sent completely?"));
        };
        let hint = match byte {
            b']' | b'}' => " (a comma before a closing bracket is one too many)",
            b'/' | b'#' => " (JSON has no comments)",
            b'\'' => " (JSON has double quotes only)",
            b'+' | b'.' => " (a number starts with a digit or a minus sign)",
            _ => "",
        };
        let found = self.next_character();
        self.end(path, code::SYNTAX, || format!("found {found} where {expected} was expected{hint}"))
    }

    fn end<T>(&mut self, path: &Path<'_>, code: &'static str, message: impl FnOnce() -> String) -> Result<T, Ended> {
        self.report.add(path, self.offset(), code, message);
        Err(Ended)
    }

    fn next_character(&self) -> String {
        self.text
            .get(self.at..)
            .and_then(|rest| rest.chars().next())
            .map_or_else(|| "a broken character".into(), |found| quoted(&found.to_string()))
    }

    fn skip_space(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t' | b'\n' | b'\r')) {
            self.at += 1;
        }
    }

    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    fn slice(&self, start: usize, end: usize) -> &'t str {
        // why: both ends are next to ASCII characters, so they are character boundaries
        self.text.get(start..end).unwrap_or_default()
    }

    fn offset(&self) -> u32 {
        offset_of(self.at)
    }
}

/// Places beyond 4 GiB are all told as its end; the size limit is far below.
fn offset_of(at: usize) -> u32 {
    u32::try_from(at).unwrap_or(u32::MAX)
}

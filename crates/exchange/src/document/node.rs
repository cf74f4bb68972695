//! A JSON document as a tree that forgets nothing a diagnostic needs: order, repeated names, places.

use std::borrow::Cow;
use std::fmt::Write as _;

/// A value with the byte at which it starts.
#[derive(Debug)]
pub(super) struct Node<'t> {
    pub(super) offset: u32,
    pub(super) value: Value<'t>,
}

/// A JSON value. An array of numbers alone is kept as numbers: models are mostly coordinates, and a
/// node for each would cost four times the memory.
#[derive(Debug)]
pub(super) enum Value<'t> {
    Null,
    Flag(bool),
    Number(f64),
    Text(&'t str),
    /// A string that had escapes.
    Unescaped(Box<str>),
    Numbers(Box<[f64]>),
    Array(Box<[Node<'t>]>),
    Object(Box<[(Cow<'t, str>, Node<'t>)]>),
    /// Already reported by the parser: whoever meets it stays silent.
    Reported,
}

impl<'t> Node<'t> {
    /// The string, if it is one.
    pub(super) fn text(&self) -> Option<&str> {
        match &self.value {
            Value::Text(text) => Some(text),
            Value::Unescaped(text) => Some(text),
            _ => None,
        }
    }

    /// What the value is, in words short enough for a message.
    pub(super) fn describe(&self) -> String {
        match &self.value {
            Value::Null => "null".into(),
            Value::Flag(flag) => flag.to_string(),
            Value::Number(number) => number_text(*number),
            Value::Text(_) | Value::Unescaped(_) => format!("the string {}", quoted(self.text().unwrap_or_default())),
            Value::Numbers(elements) => list_text(elements.len()),
            Value::Array(elements) => list_text(elements.len()),
            Value::Object(_) => "an object".into(),
            Value::Reported => "illegal".into(),
        }
    }
}

fn list_text(length: usize) -> String {
    match length {
        0 => "an empty array".into(),
        1 => "an array of 1 element".into(),
        _ => format!("an array of {length} elements"),
    }
}

/// A number as a person would write it.
pub(super) fn number_text(number: f64) -> String {
    if number != 0.0 && !(1e-4..1e9).contains(&number.abs()) { format!("{number:e}") } else { number.to_string() }
}

/// Characters of a name or a value that a message repeats.
const QUOTED_LENGTH: usize = 48;

/// A text in quotes, control characters escaped, cut after [`QUOTED_LENGTH`] characters.
pub(super) fn quoted(text: &str) -> String {
    let mut short: String = text.chars().take(QUOTED_LENGTH).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    format!("{short:?}")
}

/// One step from a container to an element.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step<'p> {
    Root,
    Member(&'p str),
    Index(usize),
}

/// The way to a value: a list of steps on the stack, written out only when something is wrong there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path<'p> {
    pub(super) parent: Option<&'p Path<'p>>,
    pub(super) step: Step<'p>,
}

/// Bytes of a name up to which it may be part of a pointer.
const POINTER_NAME_LENGTH: usize = 256;

impl<'p> Path<'p> {
    /// The document itself.
    pub(super) const ROOT: Self = Self { parent: None, step: Step::Root };

    /// The path of a member.
    pub(super) fn member(&'p self, name: &'p str) -> Self {
        Self { parent: Some(self), step: Step::Member(name) }
    }

    /// The path of an element.
    pub(super) fn index(&'p self, index: usize) -> Self {
        Self { parent: Some(self), step: Step::Index(index) }
    }

    /// The JSON pointer.
    pub(super) fn pointer(&self) -> String {
        let mut steps = Vec::new();
        let mut place = Some(self);
        while let Some(path) = place {
            steps.push(path.step);
            place = path.parent;
        }
        let mut pointer = String::new();
        for step in steps.iter().rev() {
            match step {
                Step::Root => {}
                Step::Index(index) => {
                    // why: writing to a string does not fail
                    let _ = write!(pointer, "/{index}");
                }
                Step::Member(name) if name.len() > POINTER_NAME_LENGTH => break,
                Step::Member(name) => {
                    pointer.push('/');
                    pointer.push_str(&name.replace('~', "~0").replace('/', "~1"));
                }
            }
        }
        pointer
    }
}

/// A value and the way to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place<'p> {
    pub(super) node: &'p Node<'p>,
    pub(super) path: Path<'p>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pointers_are_escaped_and_bounded() {
        let shape = Path::ROOT.member("a/b~c");
        let element = shape.index(3);
        assert_eq!(Path::ROOT.pointer(), "");
        assert_eq!(element.pointer(), "/a~1b~0c/3");
        let long = "x".repeat(1000);
        let member = element.member(&long);
        assert_eq!(member.index(1).pointer(), "/a~1b~0c/3");
    }

    #[test]
    fn nodes_stay_small() {
        assert!(size_of::<Node<'_>>() <= 32);
    }

    #[test]
    fn values_are_described_shortly() {
        assert_eq!(quoted("a\nb"), "\"a\\nb\"");
        assert!(quoted(&"é".repeat(4000)).len() < 200);
        assert_eq!(number_text(0.25), "0.25");
        assert_eq!(number_text(1e300), "1e300");
        assert_eq!(number_text(-0.0), "-0");
    }
}

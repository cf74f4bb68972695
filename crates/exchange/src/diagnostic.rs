//! What is wrong with a document: where, under which stable code, and how to mend it.

use serde::Serialize;

/// One fault of a document.
///
/// `pointer` is a JSON pointer (RFC 6901) into the document as it was sent: to the value at fault, or to
/// the object that lacks a member. The root is the empty string. A pointer stops at the last container
/// whose names are of a sane length, so that a hostile document cannot inflate its own refusal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Diagnostic {
    /// Where, as a JSON pointer.
    pub pointer: String,
    /// Stable code, one of [`CODES`] or of the kernel's.
    pub code: &'static str,
    /// The value, what is expected, and the way out.
    pub message: String,
    /// Line of the value in the text, from 1, when the text is at hand.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<u64>,
    /// Column of the value in its line, in characters, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<u64>,
}

impl std::fmt::Display for Diagnostic {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let place = if self.pointer.is_empty() { "the document" } else { &self.pointer };
        match (self.line, self.column) {
            (Some(line), Some(column)) => write!(formatter, "{place} ({line}:{column}): {} [{}]", self.message, self.code),
            _ => write!(formatter, "{place}: {} [{}]", self.message, self.code),
        }
    }
}

macro_rules! codes {
    ($($(#[doc = $meaning:literal])+ $name:ident = $code:literal;)+) => {
        /// The codes, as constants: a code never changes its meaning.
        pub mod code {
            $($(#[doc = $meaning])+ pub const $name: &str = $code;)+
        }

        /// Every code that reading a document may give, with its meaning.
        pub const CODES: &[(&str, &str)] = &[$(($code, concat!($($meaning),+)),)+];
    };
}

codes! {
    /// The document has more bytes than the limit; nothing of it was read.
    TOO_LARGE = "document.too-large";
    /// The document is empty.
    NO_CONTENT = "document.no-content";
    /// The document starts with a byte order mark.
    BYTE_ORDER_MARK = "document.byte-order-mark";
    /// The bytes are not UTF-8.
    NOT_UTF8 = "document.not-utf8";
    /// The text is not JSON.
    SYNTAX = "document.syntax";
    /// The document ends in the middle of a value.
    TRUNCATED = "document.truncated";
    /// Something follows the document's value.
    TRAILING_CONTENT = "document.trailing-content";
    /// Arrays and objects are nested deeper than the limit.
    TOO_DEEP = "document.too-deep";
    /// The document holds more values than the limit.
    TOO_MANY_VALUES = "document.too-many-values";
    /// A name occurs twice in one object.
    DUPLICATE_MEMBER = "document.duplicate-member";
    /// A number is infinite, not a number, or too large for double precision.
    NOT_FINITE = "document.not-finite";
    /// A number is written as a string.
    NUMBER_AS_STRING = "document.number-as-string";
    /// An object has a member that its kind does not know.
    UNKNOWN_MEMBER = "document.unknown-member";
    /// An object lacks a member that it needs.
    MISSING_MEMBER = "document.missing-member";
    /// Two members say the same thing, or exclude each other.
    CONFLICTING_MEMBERS = "document.conflicting-members";
    /// A value is of another JSON type than expected.
    WRONG_TYPE = "document.wrong-type";
    /// An array has another length than expected.
    WRONG_LENGTH = "document.wrong-length";
    /// An array has fewer elements than the shape needs.
    TOO_FEW = "document.too-few";
    /// A number that must be positive is not.
    NOT_POSITIVE = "document.not-positive";
    /// A number that must be a non-negative integer is not.
    NOT_AN_INDEX = "document.not-an-index";
    /// An index points past the end of what it indexes.
    INDEX_OUT_OF_RANGE = "document.index-out-of-range";
    /// An element of a set occurs twice.
    REPEATED_ELEMENT = "document.repeated-element";
    /// A word is not among the words allowed.
    UNKNOWN_VALUE = "document.unknown-value";
    /// A name is empty, too long or has control characters.
    BAD_NAME = "document.bad-name";
    /// A name is given twice.
    DUPLICATE_NAME = "document.duplicate-name";
    /// An entry of a matrix names a parameter that the model does not declare.
    UNKNOWN_PARAMETER = "document.unknown-parameter";
    /// An axis of rotation has length zero.
    ZERO_AXIS = "document.zero-axis";
    /// The document's version is not one that this program reads.
    UNSUPPORTED_VERSION = "document.unsupported-version";
    /// The kind of job belongs to the grammar and cannot be done yet.
    KIND_NOT_AVAILABLE = "document.kind-not-available";
    /// A document names a file, and it comes without a folder, as over HTTP.
    FILE_NOT_AVAILABLE = "document.file-not-available";
    /// A document names a file outside of its folder.
    FILE_OUTSIDE = "document.file-outside";
    /// A file that a document names is not there, or holds no mesh.
    FILE_NOT_READ = "document.file-not-read";
    /// The model has more states than the limit.
    TOO_MANY_STATES = "document.too-many-states";
    /// The model has more transitions than the limit.
    TOO_MANY_TRANSITIONS = "document.too-many-transitions";
    /// There are more faults than are listed.
    MORE_DIAGNOSTICS = "document.more-diagnostics";
    /// A state's name is not that of a state of the model.
    UNKNOWN_STATE = "automaton.unknown-state";
    /// The text is no address of a cell or point.
    BAD_ADDRESS = "address.syntax";
    /// A job refers to a model that is not stored.
    UNKNOWN_MODEL = "job.unknown-model";
    /// A limit that a job asks for is above what the service allows.
    LIMIT_TOO_HIGH = "job.limit-too-high";
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn codes_are_unique_and_say_what_they_mean() {
        let unique: BTreeSet<_> = CODES.iter().map(|(code, _)| code).collect();
        assert_eq!(unique.len(), CODES.len());
        assert!(CODES.iter().all(|(code, meaning)| code.contains('.') && meaning.len() > 10));
    }

    #[test]
    fn a_diagnostic_reads_as_a_sentence() {
        let diagnostic =
            Diagnostic { pointer: "/shape".into(), code: code::WRONG_TYPE, message: "is null".into(), line: Some(3), column: Some(7) };
        assert_eq!(diagnostic.to_string(), "/shape (3:7): is null [document.wrong-type]");
    }
}

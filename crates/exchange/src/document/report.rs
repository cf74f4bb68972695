//! Collects faults: all of them are counted, the first hundred are kept and told in the text's order.

use super::node::Path;
use crate::diagnostic::{Diagnostic, code};

/// A fault before its byte is turned into a line and a column.
struct Finding {
    offset: u32,
    pointer: String,
    code: &'static str,
    message: String,
}

/// The faults found so far.
pub(super) struct Report {
    findings: Vec<Finding>,
    listed: usize,
    unlisted: u64,
}

impl Report {
    /// A report that lists up to `listed` faults.
    pub(super) fn new(listed: usize) -> Self {
        Self { findings: Vec::new(), listed: listed.max(1), unlisted: 0 }
    }

    /// Notes a fault. The message is made only if it will be read: a hostile document may have millions.
    pub(super) fn add(&mut self, path: &Path<'_>, offset: u32, code: &'static str, message: impl FnOnce() -> String) {
        if self.findings.len() < self.listed {
            self.findings.push(Finding { offset, pointer: path.pointer(), code, message: message() });
        } else {
            self.unlisted += 1;
        }
    }

    /// Whether nothing is wrong.
    pub(super) fn is_clean(&self) -> bool {
        self.findings.is_empty()
    }

    /// The faults in the order of the text, with lines and columns, and a last one for those not listed.
    pub(super) fn into_diagnostics(mut self, text: &str) -> Vec<Diagnostic> {
        self.findings.sort_by_key(|finding| finding.offset);
        let mut cursor = Cursor { text: text.as_bytes(), offset: 0, line: 1, column: 1 };
        let mut diagnostics: Vec<_> = self
            .findings
            .into_iter()
            .map(|Finding { offset, pointer, code, message }| {
                cursor.advance(offset as usize);
                Diagnostic { pointer, code, message, line: Some(cursor.line), column: Some(cursor.column) }
            })
            .collect();
        if self.unlisted > 0 {
            let (listed, unlisted) = (diagnostics.len(), self.unlisted);
            diagnostics.push(Diagnostic {
                pointer: String::new(),
                code: code::MORE_DIAGNOSTICS,
                message: format!("{unlisted} more faults are not listed; mend the {listed} above and send the document again"),
                line: None,
                column: None,
            });
        }
        diagnostics
    }
}

/// Walks the text once to turn bytes into lines and columns.
struct Cursor<'t> {
    text: &'t [u8],
    offset: usize,
    line: u64,
    column: u64,
}

impl Cursor<'_> {
    fn advance(&mut self, offset: usize) {
        let end = offset.min(self.text.len());
        for byte in self.text.get(self.offset..end).unwrap_or_default() {
            if *byte == b'\n' {
                self.line += 1;
                self.column = 1;
            } else if byte & 0b1100_0000 != 0b1000_0000 {
                // why: a continuation byte belongs to the character before it
                self.column += 1;
            }
        }
        self.offset = self.offset.max(end);
    }
}

/// One fault of bytes that are not yet known to be text.
pub(super) fn single(text_before: &[u8], code: &'static str, message: String) -> Vec<Diagnostic> {
    let mut cursor = Cursor { text: text_before, offset: 0, line: 1, column: 1 };
    cursor.advance(text_before.len());
    vec![Diagnostic { pointer: String::new(), code, message, line: Some(cursor.line), column: Some(cursor.column) }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_sorted_located_and_capped() {
        let mut report = Report::new(2);
        for offset in [7, 2, 3, 4] {
            report.add(&Path::ROOT, offset, code::SYNTAX, || format!("at {offset}"));
        }
        let diagnostics = report.into_diagnostics("é\nab\ncd");
        assert_eq!(diagnostics.len(), 3);
        assert_eq!((diagnostics[0].message.as_str(), diagnostics[0].line, diagnostics[0].column), ("at 2", Some(1), Some(2)));
        assert_eq!((diagnostics[1].line, diagnostics[1].column), (Some(3), Some(2)));
        assert_eq!(diagnostics[2].code, code::MORE_DIAGNOSTICS);
        assert!(diagnostics[2].message.starts_with("2 more"));
    }
}

//! Reports: a table for people, JSON for programs, JUnit for CI systems.

use std::fmt::Write as _;
use std::time::Duration;

use serde::Serialize;

/// What became of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// It holds.
    Passed,
    /// It does not hold.
    Failed,
    /// There was nothing to compare with: no pass, and no failure.
    NotCompared,
    /// It is told, and decides nothing.
    Reported,
}

/// One comparison.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What is compared.
    pub field: String,
    /// What must come out.
    pub expected: String,
    /// What came out.
    pub got: String,
    /// By how much it differs, if that is a number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference: Option<f64>,
    /// How much it may differ, if that is a number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub allowed: Option<f64>,
    /// Whether it holds: false, too, of what was not compared or is only told.
    pub passed: bool,
    /// What became of it.
    pub standing: Standing,
}

impl Row {
    /// A comparison that holds or not, without a distance.
    #[must_use]
    pub fn verdict(field: &str, expected: &str, got: &str, passed: bool) -> Self {
        Self::standing(field, expected, got, if passed { Standing::Passed } else { Standing::Failed })
    }

    /// A comparison and what became of it.
    #[must_use]
    pub fn standing(field: &str, expected: &str, got: &str, standing: Standing) -> Self {
        let passed = standing == Standing::Passed;
        Self {
            field: field.to_owned(),
            expected: expected.to_owned(),
            got: got.to_owned(),
            difference: None,
            allowed: None,
            passed,
            standing,
        }
    }

    /// Whether it speaks against the case.
    #[must_use]
    pub fn failed(&self) -> bool {
        self.standing == Standing::Failed
    }

    /// Whether it is to be told though it speaks neither for nor against the case.
    fn is_noted(&self) -> bool {
        matches!(self.standing, Standing::NotCompared | Standing::Reported)
    }

    /// A comparison that does not hold.
    #[must_use]
    pub fn failure(field: &str, expected: &str, got: &str) -> Self {
        Self::verdict(field, expected, got, false)
    }

    /// A comparison by distance; without a distance there was no number to compare.
    #[must_use]
    pub fn measured(field: &str, expected: &str, got: &str, difference: Option<f64>, allowed: f64) -> Self {
        // Written so that a NaN fails.
        let passed = difference.is_some_and(|difference| difference <= allowed);
        Self { difference, allowed: Some(allowed), ..Self::verdict(field, expected, got, passed) }
    }

    /// How bad it is: shares of the allowance, and what cannot be measured above all.
    fn badness(&self) -> f64 {
        match (!self.failed(), self.difference, self.allowed) {
            (true, Some(difference), Some(allowed)) if allowed > 0.0 => difference / allowed,
            (true, ..) => 0.0,
            (false, Some(difference), Some(allowed)) => 1.0 + difference / allowed.max(f64::MIN_POSITIVE),
            (false, ..) => f64::INFINITY,
        }
    }
}

/// One case.
#[derive(Clone, Debug, Serialize)]
pub struct CaseReport {
    /// Its folder.
    pub case: String,
    /// What it guards.
    pub about: String,
    /// Whether all its comparisons hold.
    pub passed: bool,
    /// How long it took.
    pub seconds: f64,
    /// Its comparisons, the worst first.
    pub rows: Vec<Row>,
}

impl CaseReport {
    /// A case with its comparisons.
    #[must_use]
    pub fn new(case: String, about: String, mut rows: Vec<Row>, time: Duration) -> Self {
        rows.sort_by(|a, b| b.badness().total_cmp(&a.badness()));
        // A case that compared nothing has shown nothing.
        let passed = rows.iter().any(|row| row.passed) && !rows.iter().any(Row::failed);
        Self { case, about, passed, seconds: time.as_secs_f64(), rows }
    }

    /// What was not compared and what is only told, as a table; nothing without such.
    fn noted(&self) -> String {
        let mut noted = self.rows.iter().filter(|row| row.is_noted()).peekable();
        if noted.peek().is_none() { String::new() } else { compared(noted) }
    }
}

/// All cases.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The cases, sorted by folder.
    pub cases: Vec<CaseReport>,
}

impl Report {
    /// The report as text: failed cases with their failed comparisons, and the others by name unless `brief`.
    #[must_use]
    pub fn table(&self, brief: bool) -> String {
        let mut text = String::new();
        for case in &self.cases {
            if case.passed {
                if !brief {
                    let passed = case.rows.iter().filter(|row| row.passed).count();
                    let _ = writeln!(text, "ok    {} ({passed} checks, {:.2} s)", case.case, case.seconds);
                    text.push_str(&case.noted());
                }
                continue;
            }
            let _ = writeln!(text, "FAIL  {}: {}", case.case, case.about);
            text.push_str(&compared(case.rows.iter().filter(|row| row.failed())));
            text.push_str(&case.noted());
        }
        let failed = self.cases.iter().filter(|case| !case.passed).count();
        let not_compared = self.cases.iter().flat_map(|case| &case.rows).filter(|row| row.standing == Standing::NotCompared).count();
        let rest = if not_compared > 0 { format!(", {not_compared} comparisons not made") } else { String::new() };
        let _ = writeln!(text, "{} cases, {failed} failed{rest}", self.cases.len());
        text
    }

    /// The report as JUnit XML.
    #[must_use]
    pub fn junit(&self) -> String {
        let failed = self.cases.iter().filter(|case| !case.passed).count();
        let seconds: f64 = self.cases.iter().map(|case| case.seconds).sum();
        let mut text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"lacuna verify\" tests=\"{}\" failures=\"{failed}\" time=\"{seconds:.3}\">\n",
            self.cases.len()
        );
        for case in &self.cases {
            let (folder, name) = case.case.rsplit_once('/').unwrap_or(("", &case.case));
            let _ = write!(text, "  <testcase classname=\"{}\" name=\"{}\" time=\"{:.3}\"", escaped(folder), escaped(name), case.seconds);
            let noted = escaped(&case.noted());
            if case.passed && noted.is_empty() {
                text.push_str("/>\n");
                continue;
            }
            text.push_str(">\n");
            if !case.passed {
                let table = escaped(&compared(case.rows.iter().filter(|row| row.failed())));
                let _ = writeln!(text, "    <failure message=\"{}\">\n{table}</failure>", escaped(&case.about));
            }
            if !noted.is_empty() {
                let _ = writeln!(text, "    <system-out>\n{noted}</system-out>");
            }
            text.push_str("  </testcase>\n");
        }
        text.push_str("</testsuite>\n");
        text
    }
}

/// Comparisons as a table.
fn compared<'a>(rows: impl Iterator<Item = &'a Row>) -> String {
    let line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.6e}"));
    let heading = ["field", "expected", "got", "diff", "allowed"].map(str::to_owned);
    let rows = rows.map(|row| [line(&row.field), line(&row.expected), line(&row.got), number(row.difference), number(row.allowed)]);
    aligned(std::iter::once(heading).chain(rows), 6)
}

/// Lines of cells in columns, behind so many spaces.
pub(super) fn aligned<const COLUMNS: usize>(lines: impl Iterator<Item = [String; COLUMNS]>, indent: usize) -> String {
    let lines: Vec<[String; COLUMNS]> = lines.collect();
    let widths: Vec<usize> = (0..COLUMNS).map(|column| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0)).collect();
    let mut text = String::new();
    for line in &lines {
        let cells: Vec<String> = line.iter().zip(&widths).map(|(cell, &width)| format!("{cell:<width$}")).collect();
        let _ = writeln!(text, "{:indent$}{}", "", cells.join("  ").trim_end());
    }
    text
}

/// Text for XML: markup is escaped, and what XML 1.0 cannot hold becomes a question mark.
fn escaped(text: &str) -> String {
    text.chars().fold(String::with_capacity(text.len()), |mut out, c| {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\t' => out.push(c),
            c if c.is_control() => out.push('?'),
            c => out.push(c),
        }
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> Report {
        let rows = vec![
            Row::measured("near", "1", "1.0", Some(0.0), 0.1),
            Row::measured("off", "1", "2", Some(1.0), 0.1),
            Row::failure("absent", "1 < 2", "absent"),
        ];
        let fine = CaseReport::new("a/fine".into(), "x".into(), vec![Row::verdict("f", "1", "1", true)], Duration::ZERO);
        Report { cases: vec![fine, CaseReport::new("a/bad".into(), "y".into(), rows, Duration::ZERO)] }
    }

    #[test]
    fn the_worst_comes_first_and_columns_align() {
        let text = report().table(false);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("ok    a/fine") && lines[1].starts_with("FAIL  a/bad"));
        assert!(lines[3].trim_start().starts_with("absent") && lines[4].trim_start().starts_with("off"));
        assert_eq!(lines[2].find("expected"), lines[4].find("1 "));
        assert_eq!(lines.last(), Some(&"2 cases, 1 failed"));
        assert!(!report().table(true).contains("fine"));
    }

    #[test]
    fn what_was_not_compared_is_told_and_is_no_pass() {
        let fine = || Row::verdict("f", "1", "1", true);
        let stale = || Row::standing("digest stl", "a", "not compared: < 2", Standing::NotCompared);
        let case = |rows| CaseReport::new("a/case".into(), "x".into(), rows, Duration::ZERO);
        assert!(!case(vec![stale()]).passed, "nothing was compared");
        let report = Report { cases: vec![case(vec![fine(), stale()])] };
        assert!(report.cases[0].passed);
        let table = report.table(false);
        assert!(table.contains("(1 checks") && table.contains("digest stl") && table.contains("1 comparisons not made"), "{table}");
        assert!(report.junit().contains("<system-out>") && report.junit().contains("not compared: &lt; 2"));
        let failed = Report { cases: vec![case(vec![Row::failure("g", "1", "2"), stale()])] };
        let junit = failed.junit();
        let failure = &junit[junit.find("<failure").unwrap()..junit.find("</failure>").unwrap()];
        assert!(!failure.contains("digest") && junit.contains("<system-out>"), "{junit}");
    }

    #[test]
    fn junit_is_escaped() {
        let xml = report().junit();
        assert!(xml.contains("failures=\"1\"") && xml.contains("1 &lt; 2") && !xml.contains("1 < 2"));
    }

    #[test]
    fn nothing_compared_and_nan_fail() {
        assert!(!CaseReport::new("c".into(), String::new(), vec![], Duration::ZERO).passed);
        assert!(!Row::measured("f", "1", "NaN", Some(f64::NAN), 1.0).passed);
    }
}

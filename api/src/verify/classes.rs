//! The classes of `expected.toml` that look at files and at time: the distance from a reference mesh, the digests of outputs, and a budget of seconds.

use std::collections::BTreeMap;
use std::path::Path;
use std::{fs, io};

use lacuna_exchange::format::{Format, ReadLimits};
use lacuna_fabrication::{Input, Job, JobKind, Params};
use lacuna_kernel::budget::Limits;
use serde::Deserialize;

use super::performer::{Made, Performer};
use super::report::{Row, Standing};
use super::told;
use crate::digest::Digest;
use crate::documents;
use crate::problem::Problem;

/// The format in which a result is held against its reference, unless the case says another.
pub(super) const SHAPE_FORMAT: &str = "stl";

/// `[shape]`: how far the result may be from a coarse mesh, both ways.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExpectedShape {
    /// A mesh file beside the case.
    pub(super) reference: String,
    /// The Hausdorff distance that is allowed, in mm.
    pub(super) within_mm: f64,
    /// The format in which the result is taken.
    pub(super) format: Option<String>,
    #[serde(rename = "source")]
    _source: String,
    #[serde(rename = "reason")]
    _reason: String,
}

/// `[digest]`: the bytes of outputs as one version of the kernel makes them.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExpectedDigest {
    /// The version; outputs of another are not compared.
    pub(super) kernel_version: String,
    /// Digests by the names of the outputs.
    pub(super) outputs: BTreeMap<String, String>,
    #[serde(rename = "source")]
    _source: String,
    #[serde(rename = "reason")]
    _reason: String,
}

/// `[perf]`: how long the work may take.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExpectedPerf {
    /// Seconds of wall time for the job, its files included.
    pub(super) seconds: f64,
    /// Whether a case fails that takes longer; else the time is told beside the budget.
    #[serde(default)]
    pub(super) gating: bool,
    #[serde(rename = "source")]
    _source: String,
    #[serde(rename = "reason")]
    _reason: String,
}

/// The three tables of a case.
#[derive(Clone, Copy, Debug)]
pub(super) struct Classes<'m> {
    pub(super) shape: Option<&'m ExpectedShape>,
    pub(super) digest: Option<&'m ExpectedDigest>,
    pub(super) perf: Option<&'m ExpectedPerf>,
}

impl ExpectedShape {
    /// The ending of the format in which the result is taken.
    pub(super) fn format(&self) -> &str {
        self.format.as_deref().unwrap_or(SHAPE_FORMAT)
    }

    fn check(&self) -> Result<(), String> {
        if !(self.within_mm.is_finite() && self.within_mm > 0.0) {
            return Err(format!("[shape] has within_mm = {}, and a length in mm above zero is needed", self.within_mm));
        }
        if !Format::from_name(self.format()).is_some_and(|format| format.facts().reads && format.facts().ending == self.format()) {
            return Err(format!(
                "[shape] has format = \"{}\", which is no mesh file that is read; say \"stl\", \"obj\" or \"ply\"",
                self.format()
            ));
        }
        let is_plain = Path::new(&self.reference).file_name().is_some_and(|name| name == self.reference.as_str());
        if is_plain {
            Ok(())
        } else {
            Err(format!("[shape] has reference = \"{}\", and a file beside expected.toml is needed", self.reference))
        }
    }
}

impl ExpectedDigest {
    fn check(&self) -> Result<(), String> {
        if self.outputs.is_empty() {
            return Err("[digest] has no outputs: name at least one, as outputs = {stl = \"sha256:...\"}".into());
        }
        for (name, digest) in &self.outputs {
            if Format::from_name(name).is_none_or(|format| format.facts().ending != name) {
                return Err(format!("[digest] names the output \"{name}\", which is the ending of no format"));
            }
            if digest.parse::<Digest>().is_err() {
                return Err(format!("[digest] has {name} = \"{digest}\", and sha256: with 64 hex digits is needed"));
            }
        }
        Ok(())
    }
}

impl Classes<'_> {
    /// Whether a table that says what comes out is there: bytes are that of one version only, and time says nothing of a result.
    pub(super) fn state_a_result(&self) -> bool {
        self.shape.is_some()
    }

    /// Whether none of the tables is there.
    pub(super) fn is_empty(&self) -> bool {
        self.shape.is_none() && self.digest.is_none() && self.perf.is_none()
    }

    /// What the grammar of the tables cannot say.
    pub(super) fn check(&self) -> Result<(), String> {
        self.shape.map_or(Ok(()), ExpectedShape::check)?;
        self.digest.map_or(Ok(()), ExpectedDigest::check)?;
        match self.perf {
            Some(perf) if !(perf.seconds.is_finite() && perf.seconds > 0.0) => {
                Err(format!("[perf] has seconds = {}, and a time above zero is needed", perf.seconds))
            }
            _ => Ok(()),
        }
    }

    /// The job with the outputs that the tables look at.
    pub(super) fn with_outputs(&self, job: &Job) -> Job {
        let shape = self.shape.map(ExpectedShape::format).into_iter();
        with_outputs(job, shape.chain(self.digest.iter().flat_map(|digest| digest.outputs.keys().map(String::as_str))))
    }

    /// The comparisons.
    pub(super) fn rows(&self, folder: &Path, made: &Made, performer: &dyn Performer) -> Vec<Row> {
        let mut rows = Vec::new();
        rows.extend(self.shape.map(|shape| shape_row(shape, fs::read(folder.join(&shape.reference)), made, performer)));
        rows.extend(self.digest.iter().flat_map(|digest| digest_rows(digest, made)));
        rows.extend(self.perf.map(|perf| perf_row(perf, made.seconds)));
        rows
    }
}

/// A job with more outputs, each once.
pub(super) fn with_outputs<'n>(job: &Job, names: impl Iterator<Item = &'n str>) -> Job {
    let mut job = job.clone();
    for name in names {
        if !job.outputs.iter().any(|output| output == name) {
            job.outputs.push(name.to_owned());
        }
    }
    job
}

/// The first comparison is as exact as this share of the distance that is allowed.
const FIRST_SHARE: f64 = 0.125;
/// How much more exact the next one is.
const STEP: f64 = 0.125;
/// Comparisons that are tried until the interval of the distance lies on one side of what is allowed.
const MOST_ROUNDS: usize = 4;

/// The distance of the result from a reference, refined until it is decided.
pub(super) fn shape_row(expected: &ExpectedShape, reference: io::Result<Vec<u8>>, made: &Made, performer: &dyn Performer) -> Row {
    const FIELD: &str = "shape";
    let words = format!("within {} mm of {}", expected.within_mm, expected.reference);
    let Some(result) = made.files.get(expected.format()) else { return Row::failure(FIELD, &words, "absent") };
    let reference = match reference {
        Ok(bytes) => bytes,
        Err(error) => return Row::failure(FIELD, &words, &format!("{}: {error}", expected.reference)),
    };
    let input = |name: &str, bytes: &[u8]| {
        let model = documents::mesh_model(bytes, None, &ReadLimits::default())?;
        Ok::<_, Problem>(Input { name: name.to_owned(), model, radius_mm: None })
    };
    let inputs = match input("result", result).and_then(|result| Ok(vec![result, input("reference", &reference)?])) {
        Ok(inputs) => inputs,
        Err(problem) => return Row::failure(FIELD, &words, &told(&problem)),
    };
    let mut tolerance_mm = FIRST_SHARE * expected.within_mm;
    let mut reached = String::new();
    for _ in 0..MOST_ROUNDS {
        let job = Job {
            kind: JobKind::Measure,
            inputs: inputs.clone(),
            params: Params::new(tolerance_mm),
            outputs: Vec::new(),
            limits: Limits::default(),
        };
        let found = match performer.certificate(&job) {
            Ok(certificate) => certificate.hausdorff,
            Err(problem) => return Row::failure(FIELD, &words, &told(&problem)),
        };
        let Some(found) = found else { return Row::failure(FIELD, &words, "a comparison without a distance") };
        let [low, high] = found.distance_mm;
        reached = format!("[{low}, {high}] mm");
        if let Some(row) = decided(FIELD, &words, [low, high], expected.within_mm) {
            return row;
        }
        if !found.complete {
            break;
        }
        tolerance_mm *= STEP;
    }
    Row::failure(FIELD, &words, &format!("undecided: {reached} holds the distance; allow a little more or less"))
}

/// What an interval that holds a distance says of what is allowed, if it does.
fn decided(field: &str, words: &str, [low, high]: [f64; 2], within_mm: f64) -> Option<Row> {
    let got = format!("[{low}, {high}] mm");
    if !(low <= high && high.is_finite()) {
        return Some(Row::failure(field, words, &got));
    }
    if high <= within_mm {
        return Some(Row::measured(field, words, &got, Some(high), within_mm));
    }
    (low > within_mm).then(|| Row::measured(field, words, &got, Some(low), within_mm))
}

fn digest_rows(expected: &ExpectedDigest, made: &Made) -> Vec<Row> {
    let version = &made.certificate.kernel_version;
    let row = |(name, digest): (&String, &String)| {
        let field = format!("digest {name}");
        match made.files.get(name).map(|bytes| Digest::of(bytes).to_string()) {
            None => Row::failure(&field, digest, "absent"),
            Some(got) if *version == expected.kernel_version => Row::verdict(&field, digest, &got, got == *digest),
            Some(_) => {
                let words = format!("not compared: made by kernel {version}, and the digest is of {}", expected.kernel_version);
                Row::standing(&field, digest, &words, Standing::NotCompared)
            }
        }
    };
    expected.outputs.iter().map(row).collect()
}

fn perf_row(expected: &ExpectedPerf, seconds: Option<f64>) -> Row {
    const FIELD: &str = "perf seconds";
    let budget = format!("at most {} s", expected.seconds);
    let Some(seconds) = seconds else {
        return Row::standing(FIELD, &budget, "not compared: the service had done the work before", Standing::NotCompared);
    };
    let row = Row::measured(FIELD, &budget, &format!("{seconds:.3} s"), Some(seconds), expected.seconds);
    if expected.gating {
        return row;
    }
    let word = if row.standing == Standing::Passed { "within the budget" } else { "OVER THE BUDGET" };
    Row { passed: false, standing: Standing::Reported, got: format!("{seconds:.3} s, {word}"), ..row }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn perf(gating: bool) -> ExpectedPerf {
        ExpectedPerf { seconds: 1.0, gating, _source: String::new(), _reason: String::new() }
    }

    #[test]
    fn time_decides_only_where_the_case_says_so() {
        let standing = |gating, seconds| perf_row(&perf(gating), seconds).standing;
        assert_eq!([standing(false, Some(0.5)), standing(false, Some(2.0))], [Standing::Reported; 2]);
        assert_eq!([standing(true, Some(0.5)), standing(true, Some(2.0))], [Standing::Passed, Standing::Failed]);
        assert_eq!(standing(true, Some(f64::NAN)), Standing::Failed);
        assert_eq!(standing(true, None), Standing::NotCompared, "an answer from memory took no time");
        assert!(perf_row(&perf(false), Some(2.0)).got.contains("OVER"));
    }

    #[test]
    fn intervals_decide_or_ask_for_more() {
        let standing = |low, high| decided("shape", "w", [low, high], 1.0).map(|row| row.standing);
        assert_eq!(standing(0.2, 1.0), Some(Standing::Passed));
        assert_eq!(standing(1.1, 1.3), Some(Standing::Failed));
        assert_eq!(standing(0.9, 1.1), None);
        for bad in [[f64::NAN, 0.5], [0.5, f64::NAN], [0.1, f64::INFINITY], [0.5, 0.1]] {
            assert_eq!(standing(bad[0], bad[1]), Some(Standing::Failed), "{bad:?}");
        }
    }
}

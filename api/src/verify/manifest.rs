//! `expected.toml`: what is done with a case's model and what must come out.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use lacuna_fabrication::JobKind;
use serde::Deserialize;

use super::classes::{Classes, ExpectedDigest, ExpectedPerf, ExpectedShape};

/// A case.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    pub(super) about: String,
    pub(super) kind: CaseKind,
    pub(super) tolerance_mm: Option<f64>,
    pub(super) radius_mm: Option<f64>,
    /// Whether the topology at radii nearby is examined.
    #[serde(default)]
    pub(super) stability: bool,
    pub(super) exact: Option<Exact>,
    #[serde(default)]
    pub(super) scalar: BTreeMap<String, Scalar>,
    #[serde(rename = "box")]
    pub(super) bounding_box: Option<BoundingBox>,
    /// Points of the shape by their address.
    #[serde(default)]
    pub(super) point: BTreeMap<String, ExpectedPoint>,
    pub(super) refused: Option<Refused>,
    pub(super) shape: Option<ExpectedShape>,
    pub(super) digest: Option<ExpectedDigest>,
    pub(super) perf: Option<ExpectedPerf>,
    /// Values chosen for free parameters.
    #[serde(default)]
    pub(super) values: BTreeMap<String, f64>,
    /// Entries of the solution by their place.
    #[serde(default)]
    pub(super) entry: BTreeMap<String, ExpectedEntry>,
}

/// What is done with a case's model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum CaseKind {
    Evaluate,
    Solidify,
    Measure,
    Solve,
    /// A whole job document instead of a model.
    Job,
}

impl CaseKind {
    /// The kind of job, if it is one.
    pub(super) fn job(self) -> Option<JobKind> {
        match self {
            Self::Evaluate => Some(JobKind::Evaluate),
            Self::Solidify => Some(JobKind::Solidify),
            Self::Measure => Some(JobKind::Measure),
            Self::Solve | Self::Job => None,
        }
    }
}

/// An entry of a solution.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExpectedEntry {
    pub(super) value: f64,
    /// Where all parameters are 0, as a fraction.
    pub(super) constant: Option<String>,
    /// Fractions by the name of the parameter.
    pub(super) coefficients: Option<BTreeMap<String, String>>,
    #[serde(rename = "source")]
    _source: String,
}

/// Members of the certificate that must be equal.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Exact {
    #[serde(rename = "source")]
    _source: String,
    #[serde(flatten)]
    pub(super) members: BTreeMap<String, toml::Value>,
}

/// A member of the certificate that must be near or between.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Scalar {
    pub(super) value: Option<f64>,
    #[serde(default)]
    pub(super) absolute: f64,
    #[serde(default)]
    pub(super) relative: f64,
    pub(super) lower: Option<f64>,
    pub(super) upper: Option<f64>,
    #[serde(rename = "source")]
    _source: String,
    #[serde(rename = "reason")]
    _reason: String,
}

/// The exact bounding box.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BoundingBox {
    pub(super) lower: [f64; 3],
    pub(super) upper: [f64; 3],
    #[serde(default)]
    pub(super) absolute: f64,
    #[serde(rename = "source")]
    _source: String,
    #[serde(rename = "reason")]
    _reason: String,
}

/// The point at an address.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExpectedPoint {
    pub(super) value: [f64; 3],
    /// Allowed distance as a share of the point's distance from the origin.
    pub(super) relative: f64,
    #[serde(rename = "source")]
    _source: String,
}

/// The refusal that must come.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Refused {
    pub(super) code: String,
    pub(super) pointer: Option<String>,
    /// The places of all findings, in order; only of a `solve`.
    pub(super) pointers: Option<Vec<String>>,
}

impl Manifest {
    /// The case in a folder. One that is blessed, or about to be, need not state anything itself.
    pub(super) fn of(folder: &Path, blessed: bool) -> Result<Self, String> {
        let text = fs::read_to_string(folder.join("expected.toml")).map_err(|error| error.to_string())?;
        Self::read(&text, blessed)
    }

    /// Reads a case and checks what its grammar cannot say.
    pub(super) fn read(text: &str, blessed: bool) -> Result<Self, String> {
        let manifest: Self = toml::from_str(text).map_err(|error| error.to_string())?;
        manifest.check(blessed).map(|()| manifest)
    }

    /// The tables that look at files and at time.
    pub(super) fn classes(&self) -> Classes<'_> {
        Classes { shape: self.shape.as_ref(), digest: self.digest.as_ref(), perf: self.perf.as_ref() }
    }

    fn check(&self, blessed: bool) -> Result<(), String> {
        if self.about.trim().is_empty() {
            return Err("`about` is empty".into());
        }
        match (self.kind, self.radius_mm) {
            (CaseKind::Solidify, None) => return Err("`solidify` needs radius_mm".into()),
            (CaseKind::Evaluate | CaseKind::Solve | CaseKind::Job, Some(_)) => {
                return Err("`evaluate` and `solve` have no radius_mm, and a job states its own".into());
            }
            _ => {}
        }
        if self.stability && self.kind != CaseKind::Solidify {
            return Err("only `solidify` has stability".into());
        }
        let solves = self.kind == CaseKind::Solve;
        if (solves || self.kind == CaseKind::Job) == self.tolerance_mm.is_some() {
            return Err("`solve` has no tolerance_mm, a job states its own, everything else needs it".into());
        }
        if self.kind == CaseKind::Job && (self.bounding_box.is_some() || !self.point.is_empty()) {
            return Err("a job has no [box] and no [point.*]".into());
        }
        let of_solve = !self.values.is_empty() || !self.entry.is_empty() || self.refused.as_ref().is_some_and(|r| r.pointers.is_some());
        if of_solve && !solves || solves && (self.bounding_box.is_some() || !self.point.is_empty()) {
            return Err("[values], [entry.*] and refused.pointers belong to `solve`, which has no [box] and no [point.*]".into());
        }
        let classes = self.classes();
        classes.check()?;
        if (solves || self.refused.is_some()) && !classes.is_empty() {
            return Err("[shape], [digest] and [perf] are of results with files: not of `solve`, and not beside [refused]".into());
        }
        let measured = classes.state_a_result() || self.exact.is_some() || !self.scalar.is_empty() || self.bounding_box.is_some();
        let states = measured || !self.entry.is_empty() || !self.point.is_empty();
        if states && self.refused.is_some() || !(states || blessed) && self.refused.is_none() {
            return Err(
                "either [refused], or at least one of [exact], [scalar.*], [entry.*], [point.*], [shape] and [box], or a blessing".into()
            );
        }
        let number = |point: &ExpectedPoint| point.relative >= 0.0 && point.value.iter().all(|x| x.is_finite());
        if let Some((address, _)) = self.point.iter().find(|(_, point)| !number(point)) {
            return Err(format!("[point.\"{address}\"] has a number that is no width or value"));
        }
        for (name, scalar) in &self.scalar {
            let finite = [scalar.value, scalar.lower, scalar.upper, Some(scalar.absolute), Some(scalar.relative)];
            if finite.into_iter().flatten().any(|number| !number.is_finite()) || scalar.absolute < 0.0 || scalar.relative < 0.0 {
                return Err(format!("[scalar.{name}] has a number that is no width or value"));
            }
            match (scalar.value, scalar.lower, scalar.upper) {
                (Some(_), None, None) => {}
                (None, Some(lower), Some(upper)) if lower <= upper => {}
                _ => return Err(format!("[scalar.{name}] has either value, or lower and upper in this order")),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "about = \"x\"\nkind = \"measure\"\ntolerance_mm = 1\n";

    #[test]
    fn cases_of_solve() {
        let read = |rest: &str| Manifest::read(&format!("about = \"x\"\nkind = \"solve\"\n{rest}"), false);
        let entry = "[entry.\"/shape/x\"]\nvalue = 1\nconstant = \"1\"\ncoefficients = {a = \"-1/2\"}\nsource = \"s\"\n";
        assert!(read(entry).is_ok());
        assert!(read(&format!("[values]\na = 0.25\n{entry}")).is_ok());
        assert!(read("[refused]\ncode = \"c\"\npointers = [\"/shape\"]").is_ok());
        for bad in [
            "",
            "[values]\na = 1",
            "[entry.x]\nvalue = 1",
            "tolerance_mm = 1\n[exact]\nsource = \"s\"",
            "radius_mm = 1\n[refused]\ncode = \"c\"",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
        assert!(Manifest::read(&format!("{HEAD}{entry}"), false).is_err());
        assert!(Manifest::read(&HEAD.replace("tolerance_mm = 1", "[refused]\ncode = \"c\""), false).is_err());
    }

    #[test]
    fn a_blessed_case_need_not_state_anything() {
        assert!(Manifest::read(HEAD, true).is_ok());
        assert!(Manifest::read(HEAD, false).is_err());
        assert!(Manifest::read(&format!("{HEAD}[refused]\ncode = \"c\"\n[exact]\nsource = \"s\""), true).is_err());
    }

    #[test]
    fn cases_of_jobs() {
        let read = |rest: &str| Manifest::read(&format!("about = \"x\"\nkind = \"job\"\n{rest}"), false);
        assert!(read("[exact]\n\"split.keys\" = 1\nsource = \"s\"").is_ok());
        assert!(read("[refused]\ncode = \"c\"").is_ok());
        for bad in [
            "",
            "tolerance_mm = 1\n[refused]\ncode = \"c\"",
            "radius_mm = 1\n[refused]\ncode = \"c\"",
            "stability = true\n[refused]\ncode = \"c\"",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn tables_of_files_and_time() {
        let read = |rest: &str| Manifest::read(&format!("{HEAD}[exact]\ngenus = 0\nsource = \"s\"\n{rest}"), false);
        let why = "source = \"s\"\nreason = \"r\"\n";
        let shape = format!("[shape]\nreference = \"a.stl\"\nwithin_mm = 0.5\n{why}");
        let digest = format!("[digest]\nkernel_version = \"1\"\noutputs = {{stl = \"sha256:{}\"}}\n{why}", "0".repeat(64));
        let perf = format!("[perf]\nseconds = 1\ngating = true\n{why}");
        assert!(read(&format!("{shape}{digest}{perf}")).is_ok());
        assert!(Manifest::read(&format!("{HEAD}{shape}"), false).is_ok(), "a shape is a result");
        for bad in [
            shape.replace("0.5", "0"),
            shape.replace("0.5", "nan"),
            shape.replace("a.stl", "../a.stl"),
            shape.replace("reference", "file"),
            shape.replace(why, "source = \"s\"\n"),
            format!("{shape}format = \"svg\"\n"),
            digest.replace("sha256:0", "sha256:"),
            digest.replace("{stl", "{png5"),
            digest.replace("kernel_version", "version"),
            perf.replace("seconds = 1", "seconds = inf"),
            perf.replace("seconds = 1", "seconds = -1"),
            perf.replace("gating", "gate"),
        ] {
            assert!(read(&bad).is_err(), "{bad}");
        }
        for alone in [digest, perf] {
            assert!(Manifest::read(&format!("{HEAD}{alone}"), false).is_err(), "{alone}");
            assert!(Manifest::read(&format!("{HEAD}{alone}[refused]\ncode = \"c\""), false).is_err());
        }
    }

    #[test]
    fn legal_and_illegal_cases() {
        let read = |rest: &str| Manifest::read(&format!("{HEAD}{rest}"), false);
        assert!(read("[exact]\ncomponents = 1\nsource = \"s\"").is_ok());
        assert!(read("[scalar.volume_mm3]\nvalue = 1\nsource = \"s\"\nreason = \"r\"").is_ok());
        assert!(read("[refused]\ncode = \"c\"").is_ok());
        assert!(read("[point.\"0: 1 (0)\"]\nvalue = [1, 2, 3]\nrelative = 1e-12\nsource = \"s\"").is_ok());
        for bad in [
            "",
            "[exact]\ncomponents = 1",
            "[refused]\ncode = \"c\"\nplace = \"p\"",
            "[refused]\ncode = \"c\"\n[exact]\ngenus = 0\nsource = \"s\"",
            "[scalar.volume_mm3]\nvalue = 1\nlower = 0\nsource = \"s\"\nreason = \"r\"",
            "[scalar.volume_mm3]\nvalue = nan\nsource = \"s\"\nreason = \"r\"",
            "[point.\"0\"]\nvalue = [1, 2, 3]\nrelative = -1\nsource = \"s\"",
            "[point.\"0\"]\nvalue = [1, 2]\nrelative = 0\nsource = \"s\"",
            "colour = \"red\"\n[refused]\ncode = \"c\"",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }
}

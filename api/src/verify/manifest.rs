//! `expected.toml`: what is done with a case's model and what must come out.

use std::collections::BTreeMap;

use lacuna_fabrication::JobKind;
use serde::Deserialize;

/// A case.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    pub(super) about: String,
    pub(super) kind: JobKind,
    pub(super) tolerance_mm: f64,
    pub(super) radius_mm: Option<f64>,
    pub(super) exact: Option<Exact>,
    #[serde(default)]
    pub(super) scalar: BTreeMap<String, Scalar>,
    #[serde(rename = "box")]
    pub(super) bounding_box: Option<BoundingBox>,
    pub(super) refused: Option<Refused>,
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

/// The refusal that must come.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Refused {
    pub(super) code: String,
    pub(super) pointer: Option<String>,
}

impl Manifest {
    /// Reads a case and checks what its grammar cannot say.
    pub(super) fn read(text: &str) -> Result<Self, String> {
        let manifest: Self = toml::from_str(text).map_err(|error| error.to_string())?;
        manifest.check().map(|()| manifest)
    }

    fn check(&self) -> Result<(), String> {
        if self.about.trim().is_empty() {
            return Err("`about` is empty".into());
        }
        match (self.kind, self.radius_mm) {
            (JobKind::Solidify, None) => return Err("`solidify` needs radius_mm".into()),
            (JobKind::Evaluate, Some(_)) => return Err("`evaluate` has no radius_mm".into()),
            _ => {}
        }
        let stated = self.exact.is_some() || !self.scalar.is_empty() || self.bounding_box.is_some();
        if stated == self.refused.is_some() {
            return Err("either [refused], or at least one of [exact], [scalar.*] and [box]".into());
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
    fn legal_and_illegal_cases() {
        let read = |rest: &str| Manifest::read(&format!("{HEAD}{rest}"));
        assert!(read("[exact]\ncomponents = 1\nsource = \"s\"").is_ok());
        assert!(read("[scalar.volume_mm3]\nvalue = 1\nsource = \"s\"\nreason = \"r\"").is_ok());
        assert!(read("[refused]\ncode = \"c\"").is_ok());
        for bad in [
            "",
            "[exact]\ncomponents = 1",
            "[refused]\ncode = \"c\"\nplace = \"p\"",
            "[refused]\ncode = \"c\"\n[exact]\ngenus = 0\nsource = \"s\"",
            "[scalar.volume_mm3]\nvalue = 1\nlower = 0\nsource = \"s\"\nreason = \"r\"",
            "[scalar.volume_mm3]\nvalue = nan\nsource = \"s\"\nreason = \"r\"",
            "colour = \"red\"\n[refused]\ncode = \"c\"",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }
}

//! The cases of `fixtures/`, read independently of `lacuna verify`; the format is described in `fixtures/README.md`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::root;

/// A scalar expectation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scalar {
    /// The exact value.
    pub value: Option<f64>,
    /// Absolute width.
    #[serde(default)]
    pub absolute: f64,
    /// Relative width.
    #[serde(default)]
    pub relative: f64,
    /// Least value.
    pub lower: Option<f64>,
    /// Greatest value.
    pub upper: Option<f64>,
    /// Where the value comes from.
    pub source: String,
    /// Why the width.
    pub reason: String,
}

/// The exact box.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExactBox {
    /// Lower corner.
    pub lower: [f64; 3],
    /// Upper corner.
    pub upper: [f64; 3],
    /// Allowance for the source's digits.
    #[serde(default)]
    pub absolute: f64,
    /// Where it comes from.
    pub source: String,
    /// Why the allowance.
    pub reason: String,
}

/// The point at an address.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Where it is.
    pub value: [f64; 3],
    /// Allowed distance as a share of the point's distance from the origin.
    pub relative: f64,
    /// Where it comes from.
    pub source: String,
}

/// A refusal.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Refused {
    /// Stable code.
    pub code: String,
    /// Place in the document.
    pub pointer: Option<String>,
    /// The places of all findings of a `solve`.
    pub pointers: Option<Vec<String>>,
}

/// An entry of a solution.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Its value.
    pub value: f64,
    /// Where all parameters are 0, as a fraction.
    pub constant: Option<String>,
    /// Fractions by the name of the parameter.
    pub coefficients: Option<BTreeMap<String, String>>,
    /// Where they come from.
    pub source: String,
}

/// `expected.toml`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expected {
    /// What the case guards.
    pub about: String,
    /// `evaluate`, `solidify`, `measure`, `solve` or `job`.
    pub kind: String,
    /// The tolerance; 0 for `solve`, which has none, and for `job`, which states its own.
    #[serde(default)]
    pub tolerance_mm: f64,
    /// The radius.
    pub radius_mm: Option<f64>,
    /// Whether the stability of the topology is examined.
    #[serde(default)]
    pub stability: bool,
    /// Exact members of the certificate, and their source.
    #[serde(default)]
    pub exact: BTreeMap<String, toml::Value>,
    /// Scalars of the certificate.
    #[serde(default)]
    pub scalar: BTreeMap<String, Scalar>,
    /// The box.
    #[serde(rename = "box")]
    pub exact_box: Option<ExactBox>,
    /// Points by their address.
    #[serde(default)]
    pub point: BTreeMap<String, Point>,
    /// The refusal instead.
    pub refused: Option<Refused>,
    /// The distance from a reference mesh.
    pub shape: Option<toml::Value>,
    /// The bytes of outputs.
    pub digest: Option<toml::Value>,
    /// The budget of time.
    pub perf: Option<toml::Value>,
    /// Values chosen for free parameters.
    #[serde(default)]
    pub values: BTreeMap<String, f64>,
    /// Entries of the solution by their place.
    #[serde(default)]
    pub entry: BTreeMap<String, Entry>,
}

impl Expected {
    /// An exact count, if the case states it.
    #[must_use]
    pub fn count(&self, name: &str) -> Option<i64> {
        self.exact.get(name).and_then(toml::Value::as_integer)
    }
}

/// A case.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its folder.
    pub folder: PathBuf,
    /// `family/case`.
    pub name: String,
    /// What must come out.
    pub expected: Expected,
}

impl Case {
    /// The model document, or that of the whole job.
    #[must_use]
    pub fn model(&self) -> PathBuf {
        self.folder.join(if self.expected.kind == "job" { "job.json" } else { "model.json" })
    }
}

/// `fixtures/`.
#[must_use]
pub fn folder() -> PathBuf {
    root().join("fixtures")
}

/// Every case, by name.
///
/// # Panics
/// When a case cannot be read.
#[must_use]
pub fn all() -> Vec<Case> {
    let mut folders = Vec::new();
    collect(&folder(), &mut folders);
    folders.sort();
    folders.iter().map(|folder| read(folder)).collect()
}

/// The case with a name.
///
/// # Panics
/// When there is none.
#[must_use]
pub fn named(name: &str) -> Case {
    read(&folder().join(name))
}

/// The model document of the case with a name.
///
/// # Panics
/// When there is none.
#[must_use]
pub fn model(name: &str) -> serde_json::Value {
    serde_json::from_slice(&fs::read(named(name).model()).unwrap()).unwrap()
}

/// A job document for minutes on two cores that is accepted in a moment, another one for every number: a Sierpinski
/// tetrahedron with a thin wall, of 40 million triangles before they are made fewer.
#[must_use]
pub fn long_job(number: u32) -> serde_json::Value {
    serde_json::json!({ "lacuna": 1, "kind": "solidify", "model": model("ifs/sierpinski_tetrahedron"), "outputs": ["stl"],
        "params": { "tolerance_mm": 0.04 + f64::from(number) / 1e7, "radius_mm": 0.4 }, "limits": { "triangles": 40_000_000 } })
}

/// A job document for some seconds that is accepted at once, another one for every number: how far two fractals are apart,
/// for a tolerance that the search does not reach.
#[must_use]
pub fn search_job(number: u32) -> serde_json::Value {
    let input = |name: &str, path: &str| serde_json::json!({ "name": name, "model": model(path) });
    serde_json::json!({ "lacuna": 1, "kind": "measure", "params": { "tolerance_mm": 1e-6 + f64::from(number) / 1e10 },
        "inputs": [input("a", "ifs/sierpinski_tetrahedron"), input("b", "ifs/menger_sponge")] })
}

/// The cases that make a solid.
#[must_use]
pub fn solids() -> Vec<Case> {
    all().into_iter().filter(|case| case.expected.kind == "solidify" && case.expected.refused.is_none()).collect()
}

fn collect(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, into);
        } else if path.file_name().is_some_and(|name| name == "expected.toml") {
            into.push(folder.to_path_buf());
        }
    }
}

fn read(path: &Path) -> Case {
    let file = path.join("expected.toml");
    let text = fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let expected = toml::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let name = path.strip_prefix(folder()).unwrap().to_string_lossy().replace('\\', "/");
    Case { folder: path.to_path_buf(), name, expected }
}

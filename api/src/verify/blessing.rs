//! `blessed.json`: the certificate of a case as somebody has approved of it, with the reason.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use lacuna_fabrication::Certificate;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::files;
use crate::problem::Problem;

/// The file's name, beside `expected.toml`.
pub(super) const FILE: &str = "blessed.json";

/// An approval.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Blessing {
    /// Why the result is right, or why it may be another one than before.
    pub(super) reason: String,
    /// When.
    pub(super) blessed: String,
    /// By which version.
    pub(super) version: String,
    /// What it is that was approved of; files were not looked at.
    pub(super) certificate: Certificate,
}

impl Blessing {
    /// The approval of a case, if there is one.
    pub(super) fn of(folder: &Path) -> Result<Option<Self>, String> {
        match fs::read(folder.join(FILE)) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error.to_string()),
            Ok(bytes) => serde_json::from_slice(&bytes).map(Some).map_err(|error| error.to_string()),
        }
    }

    /// Approves of a certificate, here and now.
    pub(super) fn now(reason: &str, certificate: Certificate) -> Self {
        Self { reason: reason.to_owned(), blessed: crate::clock::now(), version: env!("CARGO_PKG_VERSION").to_owned(), certificate }
    }

    /// Writes it into a case's folder, in full or not at all.
    pub(super) fn keep(&self, folder: &Path) -> Result<(), Problem> {
        let mut bytes = serde_json::to_vec_pretty(self).map_err(|error| Problem::internal(error.to_string()))?;
        bytes.push(b'\n');
        let path = folder.join(FILE);
        files::write_whole(&path, &bytes).map_err(|error| Problem::io(path.display(), &error))
    }

    /// The certificate as it is compared.
    pub(super) fn value(&self) -> Result<Value, Problem> {
        serde_json::to_value(&self.certificate).map_err(|error| Problem::internal(error.to_string()))
    }
}

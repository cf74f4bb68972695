//! The configuration file: settings by the names of their variables without `LACUNA_`, in lower case, and keys by digest.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::Path;

use serde::Deserialize;
use toml::{Table, Value};

use crate::config::BadSetting;
use crate::digest::Digest;

/// What a key may do; each includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scope {
    /// Look at what is the key's own: `GET` and `HEAD`.
    Read,
    /// Also store, submit, stop and forget, and ask what takes work to answer.
    Run,
    /// Also what is about everybody: the metrics.
    Admin,
}

/// A key as the service knows it: never itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    /// Its digest.
    pub digest: Digest,
    /// What it may do.
    pub scope: Scope,
}

/// A key as the file states it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StatedKey {
    /// For people.
    #[serde(rename = "name")]
    _name: Option<String>,
    sha256: String,
    scope: Scope,
}

/// A file of settings.
#[derive(Debug, Default)]
pub(crate) struct ConfigFile {
    path: String,
    table: Table,
    /// What was asked for: the rest of the file is unknown.
    asked: RefCell<BTreeSet<String>>,
}

impl ConfigFile {
    /// Reads a file.
    pub(crate) fn read(path: &Path) -> Result<Self, BadSetting> {
        let bad = |why: String| Self::bad(&path.display().to_string(), &why);
        let text = std::fs::read_to_string(path).map_err(|error| bad(error.to_string()))?;
        Self::parse(&path.display().to_string(), &text)
    }

    fn parse(path: &str, text: &str) -> Result<Self, BadSetting> {
        // The parser's words hold the line, and may hold a value of it: keys are digests, so nothing secret is told.
        let table = text.parse().map_err(|error: toml::de::Error| Self::bad(path, &error.to_string()))?;
        Ok(Self { path: path.to_owned(), table, asked: RefCell::default() })
    }

    fn bad(path: &str, why: &str) -> BadSetting {
        let expected = "a file of TOML is expected, with settings as `workers = 2` and keys as `[[keys]]` with sha256 and scope";
        BadSetting { name: "LACUNA_CONFIG", value: format!("{path}: {}", why.trim()), expected }
    }

    /// The text of a setting by its variable's name.
    pub(crate) fn text(&self, variable: &str) -> Option<String> {
        let name = variable.strip_prefix("LACUNA_").unwrap_or(variable).to_ascii_lowercase();
        let value = self.table.get(&name)?;
        let text = word(value)?;
        self.asked.borrow_mut().insert(name);
        Some(text)
    }

    /// The keys.
    pub(crate) fn keys(&self) -> Result<Vec<Key>, BadSetting> {
        let Some(stated) = self.table.get("keys") else { return Ok(Vec::new()) };
        self.asked.borrow_mut().insert("keys".to_owned());
        let bad = |why: &str| Self::bad(&self.path, &format!("keys: {why}"));
        let stated: Vec<StatedKey> = stated.clone().try_into().map_err(|error: toml::de::Error| bad(&error.to_string()))?;
        let key = |key: StatedKey| {
            let digest = format!("sha256:{}", key.sha256.trim_start_matches("sha256:"));
            let digest =
                digest.parse().map_err(|_| bad("sha256 has 64 lower-case hex digits, as `printf %s KEY | sha256sum` prints them"))?;
            Ok(Key { digest, scope: key.scope })
        };
        stated.into_iter().map(key).collect()
    }

    /// Refuses what nobody asked for: a misspelt setting must not silently be its default.
    pub(crate) fn check_known(&self) -> Result<(), BadSetting> {
        let asked = self.asked.borrow();
        match self.table.keys().find(|name| !asked.contains(*name)) {
            None => Ok(()),
            Some(name) => Err(Self::bad(&self.path, &format!("{name} is no setting, or has no value of a setting's kind"))),
        }
    }
}

/// A value as the environment would hold it.
fn word(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Some(value.to_string()),
        Value::Array(items) => items.iter().map(|item| item.as_str()).collect::<Option<Vec<_>>>().map(|items| items.join(",")),
        Value::Datetime(_) | Value::Table(_) => None,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn settings_and_keys_of_a_file() {
        let digest = Digest::of(b"secret");
        let text = format!(
            "workers = 3\nlimit_seconds = 7.5\ncors_origins = [\"https://a\", \"https://b\"]\n[[keys]]\nname = \"ci\"\nsha256 = \"{}\"\nscope = \"run\"\n",
            digest.hex()
        );
        let file = ConfigFile::parse("x.toml", &text).unwrap();
        assert_eq!(file.text("LACUNA_WORKERS").as_deref(), Some("3"));
        assert_eq!(file.text("LACUNA_CORS_ORIGINS").as_deref(), Some("https://a,https://b"));
        assert_eq!(file.keys().unwrap(), [Key { digest, scope: Scope::Run }]);
        assert!(file.check_known().unwrap_err().value.contains("limit_seconds"));
        assert_eq!(file.text("LACUNA_LIMIT_SECONDS").as_deref(), Some("7.5"));
        assert_eq!(file.check_known(), Ok(()));
        assert!(Scope::Read < Scope::Run && Scope::Run < Scope::Admin);
    }

    #[test]
    fn files_that_say_nothing_sensible_are_refused() {
        for text in [
            "workers",
            "[[keys]]\nsha256 = \"abc\"\nscope = \"run\"",
            "[[keys]]\nscope = \"root\"",
            "keys = 7",
            "[[keys]]\nsha256 = \"\"\nscope = \"run\"\ncolour = 1",
        ] {
            let refused = ConfigFile::parse("x.toml", text).and_then(|file| file.keys().map(drop));
            assert!(refused.unwrap_err().value.starts_with("x.toml: "), "{text}");
        }
        assert!(ConfigFile::read(Path::new("/none/x.toml")).unwrap_err().value.contains("/none/x.toml"));
    }
}

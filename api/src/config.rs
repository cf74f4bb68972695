//! Settings of the service, each with the origin of its value: flag, environment, file or default.

use std::net::SocketAddr;
use std::path::PathBuf;

use lacuna_kernel::budget::Limits;
use tracing_subscriber::filter::LevelFilter;

use crate::config_file::{ConfigFile, Key, Scope};
use crate::digest::Digest;

/// Where a value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// The command line.
    Flag,
    /// A variable of the environment.
    Environment,
    /// The configuration file.
    File,
    /// Nobody said otherwise.
    Default,
}

/// What a process does of the service's work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// All of it.
    All,
    /// It answers requests; workers elsewhere do the jobs.
    Front,
    /// It does jobs, and answers only how it is.
    Worker,
}

impl Role {
    /// Whether it answers requests.
    #[must_use]
    pub fn answers(self) -> bool {
        self != Self::Worker
    }

    /// Whether it does jobs.
    #[must_use]
    pub fn works(self) -> bool {
        self != Self::Front
    }
}

impl std::str::FromStr for Role {
    type Err = ();

    fn from_str(word: &str) -> Result<Self, ()> {
        [Self::All, Self::Front, Self::Worker].into_iter().find(|role| role.to_string() == word).ok_or(())
    }
}

impl std::fmt::Display for Role {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::All => "all",
            Self::Front => "front",
            Self::Worker => "worker",
        })
    }
}

/// A text that is not shown.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(pub String);

impl std::fmt::Debug for Secret {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("***")
    }
}

/// What several processes share.
#[derive(Clone, Debug)]
pub struct SharedPlaces {
    /// Address of the database, with a password perhaps.
    pub database: Secret,
    /// Address of the bucket.
    pub objects: String,
}

/// What the command line of `serve` may say.
#[derive(Clone, Debug, Default)]
pub struct Flags {
    /// `--config`.
    pub config: Option<PathBuf>,
    /// `--bind`.
    pub bind: Option<String>,
    /// `--data`.
    pub data: Option<PathBuf>,
    /// `--workers`.
    pub workers: Option<usize>,
    /// `--threads`.
    pub threads: Option<usize>,
    /// `--role`.
    pub role: Option<Role>,
    /// `--objects-url`.
    pub objects: Option<String>,
    /// `--host-names`; none when nothing was said.
    pub host_names: Vec<String>,
    /// `--log-format`.
    pub log_json: Option<bool>,
}

/// Settings of the service.
#[derive(Clone, Debug)]
pub struct Config {
    /// Address and port to listen on; port 0 takes a free one.
    pub bind: SocketAddr,
    /// Address and port on which probes and metrics are answered without a key, if there is one.
    pub metrics_bind: Option<SocketAddr>,
    /// Address of a collector of traces, if there is one.
    pub traces_url: Option<String>,
    /// The data folder; where things are shared it only holds what is being written.
    pub data: PathBuf,
    /// What this process does.
    pub role: Role,
    /// What it shares with other processes, if it does.
    pub shared: Option<SharedPlaces>,
    /// Time after which a worker that was not heard of counts as gone, in seconds.
    pub lease_seconds: u64,
    /// Jobs that are done at the same time.
    pub workers: usize,
    /// Threads that they share; 0 for one per core.
    pub threads: usize,
    /// Connections that are open at the same time; who comes then waits.
    pub connections: usize,
    /// The keys; without any, everybody who reaches the address is the same owner.
    pub keys: Vec<Key>,
    /// Origins whose pages may call the service.
    pub cors_origins: Vec<String>,
    /// Names beside those of this machine under which a service without keys answers, in lower case.
    pub host_names: Vec<String>,
    /// Longest JSON body in bytes.
    pub body_bytes: usize,
    /// Time for a request's head, in seconds.
    pub header_seconds: u64,
    /// Time for a request's body, in seconds.
    pub body_seconds: u64,
    /// Longest mesh file that is taken, in bytes.
    pub upload_bytes: u64,
    /// Models and mesh files that one key may keep, in bytes.
    pub stored_bytes: u64,
    /// Time for a whole upload, in seconds; between two pieces of it `body_seconds` may pass.
    pub upload_seconds: u64,
    /// Time for an answer, in seconds; longer than the longest `Prefer: wait`.
    pub answer_seconds: u64,
    /// Jobs that may wait.
    pub queued: usize,
    /// Unfinished jobs that one key may have.
    pub jobs_per_key: usize,
    /// Submissions per minute that one key may make.
    pub submissions_per_minute: u32,
    /// Other calls per minute that one key may make.
    pub calls_per_minute: u32,
    /// Time to end what runs when the service stops, in seconds.
    pub drain_seconds: u64,
    /// Age at which ended jobs expire: what they made is given up; in hours.
    pub retention_hours: u64,
    /// Time after that for which is kept that there was such a job, in hours.
    pub expired_hours: u64,
    /// Most expired jobs of which that is kept.
    pub expired_jobs: usize,
    /// The most that a job may ask for; the default of what it does not ask for.
    pub job_limits: Limits,
    /// How much is logged: `error`, `warn`, `info`, `debug`, `trace` or `off`.
    pub log: LevelFilter,
    /// Whether the log is JSON.
    pub log_json: bool,
}

/// A value that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{name} is {value:?}: {expected}")]
pub struct BadSetting {
    /// The setting.
    pub name: &'static str,
    /// What was said.
    pub value: String,
    /// What is expected.
    pub expected: &'static str,
}

/// A setting as `lacuna doctor` tells it.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Told {
    /// Its name, the variable's.
    pub name: &'static str,
    /// Its value in words; secrets are counted, not shown.
    pub value: String,
    /// Who said so.
    pub origin: Origin,
}

/// Reads settings and keeps where each came from.
struct Reader<'a> {
    environment: &'a dyn Fn(&str) -> Option<String>,
    file: ConfigFile,
    told: Vec<Told>,
}

impl Reader<'_> {
    /// What the environment says, or else the file.
    fn stated(&self, name: &str) -> Option<(String, Origin)> {
        // The file is asked in any case: what the environment overrides is no unknown setting.
        let filed = self.file.text(name);
        (self.environment)(name).map(|text| (text, Origin::Environment)).or(filed.map(|text| (text, Origin::File)))
    }

    fn take<T: ToString + std::str::FromStr>(
        &mut self,
        name: &'static str,
        flag: Option<T>,
        default: T,
        expected: &'static str,
    ) -> Result<T, BadSetting> {
        self.take_if(name, flag, default, expected, |_| true)
    }

    /// A number of something that there must be.
    fn positive<T: ToString + std::str::FromStr + From<u8> + PartialOrd>(
        &mut self,
        name: &'static str,
        default: T,
    ) -> Result<T, BadSetting> {
        self.take_if(name, None, default, "a whole number from 1 on is expected", |value| *value >= T::from(1))
    }

    /// A value that passes a test.
    fn take_if<T: ToString + std::str::FromStr>(
        &mut self,
        name: &'static str,
        flag: Option<T>,
        default: T,
        expected: &'static str,
        fits: impl Fn(&T) -> bool,
    ) -> Result<T, BadSetting> {
        let (value, origin) = match (flag, self.stated(name)) {
            (Some(value), _) => (value, Origin::Flag),
            (None, Some((text, origin))) => {
                let value = text.trim().parse().map_err(|_| BadSetting { name, value: text, expected })?;
                (value, origin)
            }
            (None, None) => (default, Origin::Default),
        };
        if !fits(&value) {
            return Err(BadSetting { name, value: value.to_string(), expected });
        }
        self.told.push(Told { name, value: value.to_string(), origin });
        Ok(value)
    }

    /// A text that may be absent; `shown` makes of it what may be told.
    fn perhaps(&mut self, name: &'static str, flag: Option<String>, shown: fn(&str) -> String) -> Option<String> {
        let (value, origin) = match (flag, self.stated(name)) {
            (Some(value), _) => (Some(value), Origin::Flag),
            (None, Some((text, origin))) => (Some(text), origin),
            (None, None) => (None, Origin::Default),
        };
        let value = value.map(|text| text.trim().to_owned()).filter(|text| !text.is_empty());
        self.told.push(Told { name, value: value.as_deref().map(shown).unwrap_or_default(), origin });
        value
    }

    fn list(&mut self, name: &'static str, flag: &[String], secret: bool) -> Vec<String> {
        let stated = self.stated(name).unwrap_or((String::new(), Origin::Default));
        let (text, origin) = if flag.is_empty() { stated } else { (flag.join(","), Origin::Flag) };
        let items: Vec<String> = text.split(',').map(str::trim).filter(|item| !item.is_empty()).map(str::to_owned).collect();
        let value = if secret { format!("{} set", items.len()) } else { items.join(", ") };
        self.told.push(Told { name, value, origin });
        items
    }
}

impl Config {
    /// Settings from flags and the environment, and where each came from.
    ///
    /// # Errors
    /// When a value cannot be read, or the address is public and there is no key.
    pub fn read(flags: &Flags, environment: &dyn Fn(&str) -> Option<String>) -> Result<(Self, Vec<Told>), BadSetting> {
        const COUNT: &str = "a whole number is expected";
        let named = flags.config.clone().map(|path| (path, Origin::Flag));
        let named = named.or_else(|| environment("LACUNA_CONFIG").map(|path| (PathBuf::from(path), Origin::Environment)));
        let file = named.as_ref().map(|(path, _)| ConfigFile::read(path)).transpose()?.unwrap_or_default();
        let (value, origin) = named.map_or((String::new(), Origin::Default), |(path, origin)| (path.display().to_string(), origin));
        let filed_keys = file.keys()?;
        let mut reader = Reader { environment, file, told: vec![Told { name: "LACUNA_CONFIG", value, origin }] };
        let bind = reader.take("LACUNA_BIND", flags.bind.clone(), "127.0.0.1:7878".to_owned(), "")?;
        let address = bind.parse::<SocketAddr>().map_err(|_| BadSetting {
            name: "LACUNA_BIND",
            value: bind.clone(),
            expected: "an address and a port are expected, for example 127.0.0.1:7878 or [::1]:7878",
        })?;
        let metrics_bind = reader.perhaps("LACUNA_METRICS_BIND", None, str::to_owned);
        let metrics_bind = metrics_bind.map(|text| {
            let expected = "an address and a port are expected, for example 127.0.0.1:9090; leave it out for none";
            text.parse().map_err(|_| BadSetting { name: "LACUNA_METRICS_BIND", value: text.clone(), expected })
        });
        let data = reader.take("LACUNA_DATA", flags.data.as_ref().map(|d| d.display().to_string()), "lacuna-data".to_owned(), "")?;
        let shared = read_shared(&mut reader, flags)?;
        let defaults = Limits::default();
        let config = Self {
            role: reader.take("LACUNA_ROLE", flags.role, Role::All, "all, front or worker is expected")?,
            shared,
            lease_seconds: reader.take_if("LACUNA_LEASE_SECONDS", None, 15, "a whole number from 1 to 3600 is expected", |seconds| {
                (1..=3600).contains(seconds)
            })?,
            bind: address,
            metrics_bind: metrics_bind.transpose()?,
            traces_url: read_traces(&mut reader)?,
            data: PathBuf::from(data),
            workers: reader.take_if("LACUNA_WORKERS", flags.workers, 2, "a whole number from 1 to 256 is expected", |count| {
                (1..=256).contains(count)
            })?,
            connections: reader.positive("LACUNA_CONNECTIONS", 2048)?,
            threads: reader.take("LACUNA_THREADS", flags.threads, 0, COUNT)?,
            keys: read_keys(&mut reader, filed_keys),
            cors_origins: reader.list("LACUNA_CORS_ORIGINS", &[], false),
            host_names: read_host_names(&mut reader, flags)?,
            body_bytes: reader.positive("LACUNA_BODY_BYTES", 8 << 20)?,
            header_seconds: reader.positive("LACUNA_HEADER_SECONDS", 10)?,
            body_seconds: reader.positive("LACUNA_BODY_SECONDS", 30)?,
            upload_bytes: reader.positive("LACUNA_UPLOAD_BYTES", 256 << 20)?,
            stored_bytes: reader.positive("LACUNA_STORED_BYTES_PER_KEY", 8 << 30)?,
            upload_seconds: reader.positive("LACUNA_UPLOAD_SECONDS", 600)?,
            answer_seconds: reader.positive("LACUNA_ANSWER_SECONDS", 60)?,
            queued: reader.positive("LACUNA_QUEUED", 256)?,
            jobs_per_key: reader.positive("LACUNA_JOBS_PER_KEY", 128)?,
            submissions_per_minute: reader.positive("LACUNA_SUBMISSIONS_PER_MINUTE", 600)?,
            calls_per_minute: reader.positive("LACUNA_CALLS_PER_MINUTE", 6000)?,
            drain_seconds: reader.take("LACUNA_DRAIN_SECONDS", None, 20, COUNT)?,
            retention_hours: reader.take("LACUNA_RETENTION_HOURS", None, 72, COUNT)?,
            expired_hours: reader.take("LACUNA_EXPIRED_HOURS", None, 720, COUNT)?,
            expired_jobs: reader.take("LACUNA_EXPIRED_JOBS", None, 10_000, COUNT)?,
            job_limits: Limits {
                seconds: reader.take_if("LACUNA_LIMIT_SECONDS", None, 3600.0, "seconds above 0 are expected", |seconds: &f64| {
                    seconds.is_finite() && *seconds > 0.0
                })?,
                memory_bytes: reader.positive("LACUNA_LIMIT_MEMORY_BYTES", defaults.memory_bytes)?,
                triangles: reader.positive("LACUNA_LIMIT_TRIANGLES", 50_000_000)?,
                output_bytes: reader.positive("LACUNA_LIMIT_OUTPUT_BYTES", 8 << 30)?,
                ..defaults
            },
            log: reader.take("LACUNA_LOG", None, LevelFilter::INFO, "error, warn, info, debug, trace or off is expected")?,
            log_json: reader.take("LACUNA_LOG_JSON", flags.log_json, false, "true or false is expected")?,
        };
        config.check(&bind)?;
        reader.file.check_known()?;
        Ok((config, reader.told))
    }

    /// A service on the network with nobody to ask for a key is an accident, not a setting; so is a part without a whole.
    fn check(&self, bind: &str) -> Result<(), BadSetting> {
        if self.shared.is_none() && self.role != Role::All {
            return Err(BadSetting {
                name: "LACUNA_ROLE",
                value: self.role.to_string(),
                expected: "without LACUNA_DATABASE_URL and LACUNA_OBJECTS_URL one process does all: leave it out, or set both",
            });
        }
        if self.keys.is_empty() && !self.bind.ip().is_loopback() {
            return Err(BadSetting {
                name: "LACUNA_BIND",
                value: bind.to_owned(),
                expected: "an address beyond this machine needs keys: set LACUNA_API_KEYS, or bind to 127.0.0.1",
            });
        }
        Ok(())
    }
}

/// Keys of the environment, which may do everything, and those of the file, which have a scope.
fn read_keys(reader: &mut Reader<'_>, filed: Vec<Key>) -> Vec<Key> {
    let plain = reader.list("LACUNA_API_KEYS", &[], true);
    if !filed.is_empty() {
        reader.told.push(Told { name: "keys", value: format!("{} set", filed.len()), origin: Origin::File });
    }
    let plain = plain.iter().map(|key| Key { digest: Digest::of(key.as_bytes()), scope: Scope::Admin });
    plain.chain(filed).collect()
}

/// Names as a request's `Host` has them, without what else an address has: one that no request can have would silently do nothing.
fn read_host_names(reader: &mut Reader<'_>, flags: &Flags) -> Result<Vec<String>, BadSetting> {
    const NAME: &str = "LACUNA_HOST_NAMES";
    let expected = "names are expected, separated by commas, without scheme, port or wildcard: cad.example,[fd00::7]";
    let read = |item: String| {
        let name = item.trim_end_matches('.').to_ascii_lowercase();
        let labels = !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-._".contains(&byte));
        let address = name.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')?.parse::<std::net::Ipv6Addr>().ok());
        if labels || address.is_some() { Ok(name) } else { Err(BadSetting { name: NAME, value: item, expected }) }
    };
    reader.list(NAME, &flags.host_names, false).into_iter().map(read).collect()
}

/// The collector's address: ours, or else the name that all programs share.
fn read_traces(reader: &mut Reader<'_>) -> Result<Option<String>, BadSetting> {
    let (ours, shared) = ("LACUNA_TRACES_URL", "OTEL_EXPORTER_OTLP_ENDPOINT");
    let (own, common) = (reader.perhaps(ours, None, without_password), reader.perhaps(shared, None, without_password));
    let (name, url) = match (own, common) {
        (Some(url), _) => (ours, url),
        (None, Some(url)) => (shared, url),
        (None, None) => return Ok(None),
    };
    let host = url.strip_prefix("http://").or_else(|| url.strip_prefix("https://"));
    if host.is_none_or(str::is_empty) {
        return Err(BadSetting { name, value: url, expected: "the address of a collector is expected, for example http://127.0.0.1:4318" });
    }
    Ok(Some(url))
}

/// Database and object store: both or neither.
fn read_shared(reader: &mut Reader<'_>, flags: &Flags) -> Result<Option<SharedPlaces>, BadSetting> {
    // No flag: everybody on a machine can read the command lines of its processes.
    let database = reader.perhaps("LACUNA_DATABASE_URL", None, without_password);
    let objects = reader.perhaps("LACUNA_OBJECTS_URL", flags.objects.clone(), str::to_owned);
    for name in ["AWS_ENDPOINT_URL", "AWS_REGION"] {
        reader.perhaps(name, None, str::to_owned);
    }
    for name in ["AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"] {
        reader.perhaps(name, None, |_| "set".to_owned());
    }
    let bad = |name, value: &str, expected| Err(BadSetting { name, value: value.to_owned(), expected });
    match (database, objects) {
        (None, None) => Ok(None),
        (Some(database), Some(objects)) => {
            if !database.starts_with("postgres://") && !database.starts_with("postgresql://") {
                return bad("LACUNA_DATABASE_URL", "***", "postgres://USER:PASSWORD@HOST:PORT/DATABASE is expected");
            }
            if !objects.strip_prefix("s3://").is_some_and(|rest| !rest.is_empty() && !rest.starts_with('/')) {
                return bad("LACUNA_OBJECTS_URL", &objects, "s3://BUCKET or s3://BUCKET/FOLDER is expected");
            }
            Ok(Some(SharedPlaces { database: Secret(database), objects }))
        }
        (Some(_), None) => bad("LACUNA_OBJECTS_URL", "", "with LACUNA_DATABASE_URL it must name a bucket: s3://BUCKET/FOLDER"),
        (None, Some(objects)) => bad("LACUNA_DATABASE_URL", "", "with LACUNA_OBJECTS_URL it must name a database: postgres://...")
            .map_err(|error| BadSetting { value: objects, ..error }),
    }
}

/// A database's address as it may be told: without the password and without parameters, which may hold one.
fn without_password(address: &str) -> String {
    let plain = address.split('?').next().unwrap_or_default();
    let Some((scheme, rest)) = plain.split_once("://") else { return "***".to_owned() };
    match rest.rsplit_once('@') {
        Some((user, host)) => format!("{scheme}://{}:***@{host}", user.split(':').next().unwrap_or_default()),
        None => format!("{scheme}://{rest}"),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_flag_goes_before_the_environment_and_that_before_the_default() {
        let environment = |name: &str| (name == "LACUNA_WORKERS" || name == "LACUNA_QUEUED").then(|| "7".to_owned());
        let flags = Flags { workers: Some(3), ..Flags::default() };
        let (config, told) = Config::read(&flags, &environment).unwrap();
        assert_eq!((config.workers, config.queued, config.jobs_per_key), (3, 7, 128));
        let origin = |name| told.iter().find(|t| t.name == name).unwrap().origin;
        assert_eq!(origin("LACUNA_WORKERS"), Origin::Flag);
        assert_eq!(origin("LACUNA_QUEUED"), Origin::Environment);
        assert_eq!(origin("LACUNA_JOBS_PER_KEY"), Origin::Default);
    }

    #[test]
    fn a_public_address_needs_keys() {
        let flags = Flags { bind: Some("0.0.0.0:80".into()), ..Flags::default() };
        assert!(Config::read(&flags, &|_| None).unwrap_err().expected.contains("LACUNA_API_KEYS"));
        let keys = |name: &str| (name == "LACUNA_API_KEYS").then(|| "secret, other".to_owned());
        let (config, told) = Config::read(&flags, &keys).unwrap();
        assert_eq!(config.keys.len(), 2);
        assert!(told.iter().all(|t| !t.value.contains("secret")));
    }

    #[test]
    fn a_file_stands_between_the_environment_and_the_defaults() {
        let path = std::env::temp_dir().join(format!("lacuna-config-{}.toml", uuid::Uuid::now_v7()));
        let key = Digest::of(b"secret").hex();
        let text = format!("workers = 5\nqueued = 9\nbind = \"0.0.0.0:80\"\n[[keys]]\nsha256 = \"{key}\"\nscope = \"read\"\n");
        std::fs::write(&path, &text).unwrap();
        let environment = |name: &str| (name == "LACUNA_QUEUED").then(|| "7".to_owned());
        let flags = Flags { config: Some(path.clone()), ..Flags::default() };
        let (config, told) = Config::read(&flags, &environment).unwrap();
        assert_eq!((config.workers, config.queued, config.keys.len(), config.keys[0].scope), (5, 7, 1, Scope::Read));
        let origin = |name| told.iter().find(|t| t.name == name).unwrap().origin;
        assert_eq!(
            (origin("LACUNA_WORKERS"), origin("LACUNA_QUEUED"), origin("LACUNA_CONFIG")),
            (Origin::File, Origin::Environment, Origin::Flag)
        );
        std::fs::write(&path, text + "[colour]\n").unwrap();
        assert!(Config::read(&flags, &environment).unwrap_err().value.contains("colour"));
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_part_of_a_service_needs_what_it_shares() {
        let with = |pairs: &'static [(&str, &str)]| {
            let find = |name: &str| pairs.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned());
            Config::read(&Flags::default(), &find)
        };
        const DATABASE: (&str, &str) = ("LACUNA_DATABASE_URL", "postgres://ada:s3cret@db.example:5432/lacuna?sslmode=require");
        const OBJECTS: (&str, &str) = ("LACUNA_OBJECTS_URL", "s3://parts/lacuna");
        assert_eq!(with(&[("LACUNA_ROLE", "front")]).unwrap_err().name, "LACUNA_ROLE");
        assert_eq!(with(&[("LACUNA_ROLE", "boss"), DATABASE, OBJECTS]).unwrap_err().value, "boss");
        assert_eq!(with(&[DATABASE]).unwrap_err().name, "LACUNA_OBJECTS_URL");
        assert_eq!(with(&[OBJECTS]).unwrap_err().name, "LACUNA_DATABASE_URL");
        assert_eq!(with(&[DATABASE, ("LACUNA_OBJECTS_URL", "/parts")]).unwrap_err().name, "LACUNA_OBJECTS_URL");
        let (config, told) = with(&[DATABASE, OBJECTS, ("LACUNA_ROLE", "worker"), ("AWS_SECRET_ACCESS_KEY", "s3cret")]).unwrap();
        assert!(config.role.works() && !config.role.answers());
        assert_eq!(told.iter().find(|t| t.name == DATABASE.0).unwrap().value, "postgres://ada:***@db.example:5432/lacuna");
        assert!(!format!("{config:?}{told:?}").contains("s3cret"));
    }

    #[test]
    fn names_of_the_host_are_names_and_nothing_else() {
        let with = |value: &'static str| Config::read(&Flags::default(), &move |name| (name == "LACUNA_HOST_NAMES").then(|| value.into()));
        assert_eq!(with("CAD.example., box-7,[FD00::7],10.0.0.7").unwrap().0.host_names, ["cad.example", "box-7", "[fd00::7]", "10.0.0.7"]);
        for bad in ["http://cad.example", "cad.example:80", "*", "*.example", "a b", "[cad]", "."] {
            assert_eq!(with(bad).unwrap_err().name, "LACUNA_HOST_NAMES", "{bad}");
        }
        let flags = Flags { host_names: vec!["a".into(), "b".into()], ..Flags::default() };
        let (config, told) = Config::read(&flags, &|name| (name == "LACUNA_HOST_NAMES").then(|| "c".into())).unwrap();
        let told = told.iter().find(|told| told.name == "LACUNA_HOST_NAMES").unwrap();
        assert_eq!((config.host_names.len(), told.value.as_str(), told.origin), (2, "a, b", Origin::Flag));
    }

    #[test]
    fn metrics_have_an_address_of_their_own_or_none() {
        let with =
            |value: &'static str| Config::read(&Flags::default(), &move |name| (name == "LACUNA_METRICS_BIND").then(|| value.into()));
        assert_eq!(with("0.0.0.0:9090").unwrap().0.metrics_bind.unwrap().port(), 9090);
        assert_eq!(with(" ").unwrap().0.metrics_bind, None);
        assert_eq!(with("9090").unwrap_err().name, "LACUNA_METRICS_BIND");
    }

    #[test]
    fn traces_have_one_collector() {
        let with = |pairs: &'static [(&str, &str)]| {
            let find = |name: &str| pairs.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned());
            Config::read(&Flags::default(), &find).map(|(config, _)| config.traces_url)
        };
        const COMMON: (&str, &str) = ("OTEL_EXPORTER_OTLP_ENDPOINT", "http://collector:4318");
        assert_eq!(with(&[]).unwrap(), None);
        assert_eq!(with(&[COMMON]).unwrap().as_deref(), Some("http://collector:4318"));
        assert_eq!(with(&[COMMON, ("LACUNA_TRACES_URL", "https://own:4318")]).unwrap().as_deref(), Some("https://own:4318"));
        assert_eq!(with(&[("LACUNA_TRACES_URL", "collector:4318")]).unwrap_err().name, "LACUNA_TRACES_URL");
    }

    #[test]
    fn nonsense_is_named() {
        let error = Config::read(&Flags::default(), &|name| (name == "LACUNA_QUEUED").then(|| "many".into())).unwrap_err();
        assert_eq!((error.name, error.value.as_str()), ("LACUNA_QUEUED", "many"));
    }

    #[test]
    fn numbers_that_would_stop_everything_are_refused() {
        let with =
            |name: &'static str, value: &'static str| Config::read(&Flags::default(), &move |asked| (asked == name).then(|| value.into()));
        for (name, value) in [
            ("LACUNA_WORKERS", "0"),
            ("LACUNA_WORKERS", "257"),
            ("LACUNA_LEASE_SECONDS", "0"),
            ("LACUNA_LEASE_SECONDS", "3601"),
            ("LACUNA_CONNECTIONS", "0"),
            ("LACUNA_BODY_SECONDS", "0"),
            ("LACUNA_QUEUED", "-1"),
            ("LACUNA_CALLS_PER_MINUTE", "0"),
            ("LACUNA_LIMIT_TRIANGLES", "0"),
            ("LACUNA_LIMIT_SECONDS", "0"),
            ("LACUNA_LIMIT_SECONDS", "-3"),
            ("LACUNA_LIMIT_SECONDS", "NaN"),
            ("LACUNA_LIMIT_SECONDS", "inf"),
        ] {
            let error = with(name, value).unwrap_err();
            assert_eq!((error.name, error.value.as_str()), (name, value));
        }
        assert_eq!(with("LACUNA_EXPIRED_JOBS", "0").unwrap().0.expired_jobs, 0);
        let flags = Flags { workers: Some(0), ..Flags::default() };
        assert_eq!(Config::read(&flags, &|_| None).unwrap_err().name, "LACUNA_WORKERS");
    }
}

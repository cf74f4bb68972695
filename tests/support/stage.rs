//! What a service of several processes stands on: a real PostgreSQL, an S3 server, and a folder for scratch files.

use super::objects::Objects;
use super::postgres::Postgres;
use super::scratch::Scratch;
use super::service::Service;

/// Seconds of a worker's lease: short, so that tests need not wait long for a dead one.
pub const LEASE: &str = "2";

/// A database, an object store and a folder for scratch files.
pub struct Stage {
    /// The database.
    pub database: Postgres,
    /// The object store.
    pub objects: Objects,
    /// The folder.
    pub scratch: Scratch,
}

impl Stage {
    /// Starts both; none where a program is missing.
    #[must_use]
    pub fn set() -> Option<Self> {
        Some(Self { database: Postgres::start()?, objects: Objects::start()?, scratch: Scratch::new() })
    }

    /// Starts a process with a role and a name of its own.
    #[must_use]
    pub fn start(&self, role: &str, name: &str) -> Service {
        self.start_with(role, name, &[])
    }

    /// Starts a process with more variables of the environment.
    #[must_use]
    pub fn start_with(&self, role: &str, name: &str, more: &[(&str, &str)]) -> Service {
        let (database, endpoint) = (self.database.url(), self.objects.endpoint());
        let mut environment = vec![
            ("LACUNA_ROLE", role),
            ("LACUNA_DATABASE_URL", database.as_str()),
            ("LACUNA_OBJECTS_URL", "s3://parts/lacuna"),
            ("AWS_ENDPOINT_URL", endpoint.as_str()),
            ("AWS_REGION", "us-east-1"),
            ("AWS_ACCESS_KEY_ID", "tests"),
            ("AWS_SECRET_ACCESS_KEY", "hidden-from-everybody"),
            ("LACUNA_LEASE_SECONDS", LEASE),
            ("LACUNA_WORKERS", "1"),
            ("LACUNA_DRAIN_SECONDS", "1"),
            ("LACUNA_SUBMISSIONS_PER_MINUTE", "100000"),
        ];
        environment.extend_from_slice(more);
        Service::start_with(&self.scratch.join(name), &environment)
    }
}

//! Doors and machine room: the HTTP service and the `lacuna` command over one engine.
//!
//! In order of a request: [`http`] (router and layers) and [`routes`] take bytes, [`documents`] makes jobs of
//! them, [`jobs`] keeps, queues and does them through [`production`], and [`store`] hands the files out.
//! [`cli`] does the same without a service. [`problem`] is the only file with status and exit codes.

use std::sync::{Mutex, MutexGuard, PoisonError};

pub mod addresses;
pub mod cli;
pub mod clock;
pub mod config;
pub mod config_file;
pub mod digest;
pub mod documents;
pub mod files;
pub mod http;
pub mod inspection;
pub mod jobs;
pub mod metrics;
pub mod openapi;
pub mod orders;
pub mod problem;
pub mod production;
pub mod program;
pub mod questions;
pub mod routes;
pub mod store;
pub mod traces;
pub mod trades;
pub mod trust;
pub mod verify;

/// Locks a mutex whose data stays whole even if a holder panicked: every change under our locks is one
/// assignment or one call of a collection.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

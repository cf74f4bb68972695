//! The machine room: jobs are accepted by the desk, kept in a ledger, and done by workers, each a thread with a process
//! of its own. Questions are answered and uploads read in such processes, too.
//!
//! The ledger is the one seam between one process and many: `embedded.rs` keeps everything in memory and in the data
//! folder, `shared/` in a database that several processes use. What a change does to a job stands in [`record`], once.

pub mod apart;
pub mod asked;
pub mod batch;
pub mod desk;
mod embedded;
pub mod events;
mod journal;
pub mod live;
mod making;
mod memory;
pub(crate) mod messages;
pub mod process;
pub mod readers;
pub mod record;
mod refusal;
mod shared;
pub mod watchdog;
pub mod worker;

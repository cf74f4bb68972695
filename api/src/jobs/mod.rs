//! The machine room: jobs are accepted by the desk, wait in the queue and are done by worker threads.

pub mod desk;
pub mod events;
pub mod live;
pub mod queue;
pub mod record;
pub mod watchdog;
pub mod worker;

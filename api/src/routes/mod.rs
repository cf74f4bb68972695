//! The resources, one file each.

pub mod batches;
pub mod capabilities;
pub mod docs;
pub mod events;
pub mod health;
pub mod jobs;
pub mod library;
pub mod models;
pub mod problems;
pub mod results;
pub mod shortcuts;
pub mod studies;
pub mod trades;
pub mod uploads;

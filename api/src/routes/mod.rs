//! The resources, one file each.

pub mod capabilities;
pub mod docs;
pub mod events;
pub mod health;
pub mod jobs;
pub mod library;
pub mod models;
pub mod results;
pub mod studies;
pub mod uploads;

#![allow(clippy::unwrap_used)]

mod cases;
mod files;
mod properties;
mod reading;
mod schemes;

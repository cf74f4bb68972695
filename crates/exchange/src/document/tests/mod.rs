#![allow(clippy::unwrap_used)]

mod cases;
mod properties;
mod reading;
mod schemes;

//! The HTTP door: router, layers and everything that is not about one resource.

pub mod accept;
pub mod auth;
pub mod body;
pub mod compression;
mod connection;
pub mod headers;
pub mod hosts;
pub mod layers;
mod places;
pub mod range;
pub mod router;
pub mod serve;
pub mod state;

#[cfg(test)]
mod tests;

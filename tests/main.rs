//! One test binary for the whole house; run with `cargo test --workspace`.
//!
//! | module | asks |
//! |---|---|
//! | `booleans` | do combined solids hold what their certificates say? |
//! | `contacts` | are distances, places of contact and comparisons of shapes those of closed forms? |
//! | `corpus` | does every case of `fixtures/` hold, through the real command? |
//! | `independent` | do other people's libraries find in the files what the cases and the certificates say? |
//! | `measures` | are dimensions, centroids and inertia those of closed forms? |
//! | `properties` | do the laws of dilation hold on random sets, against brute force? |
//! | `determinism` | the same bytes for one thread and for two? |
//! | `contract` | is the committed OpenAPI what the service says, and does it keep its promises on paper? |
//! | `slices` | are plane sections the drawings that they should be? |
//! | `faults` | what does one process lose when it is killed, its disk is full, its clients misbehave? |
//! | `distributed` | and several, with their database and object store? |
//! | `service` | does the running service keep them? |
//! | `architecture` | are the crates, the folders and the map what they claim to be? |
//! | `container` | do the container's files say what they must? |

#![allow(clippy::unwrap_used, clippy::print_stderr)]

mod architecture;
mod booleans;
mod contacts;
mod container;
mod contract;
mod corpus;
mod determinism;
mod distributed;
mod faults;
mod independent;
mod measures;
mod properties;
mod service;
mod slices;

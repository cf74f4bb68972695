//! The one door to Manifold: unions, intersections and differences of closed triangle meshes.
//!
//! [`BooleanEngine`] is what the rest of the house knows. [`ManifoldRust`] implements it with a pure Rust port of
//! Manifold, in double precision; nothing of that library is seen outside of this crate. An engine takes meshes
//! and gives meshes: whoever receives one proves it a solid again.
//!
//! Architecture invariant: every handle of the library is made and dropped inside of one call.
//!
//! ```
//! use lacuna_boolean::{BooleanEngine, ManifoldRust};
//! use lacuna_kernel::budget::CancelToken;
//! use lacuna_kernel::solid::TriMesh;
//!
//! let tetrahedron = |shift: f64| TriMesh {
//!     vertices: [[0., 0., 0.], [4., 0., 0.], [0., 4., 0.], [0., 0., 4.]].map(|p| (shift + glam::DVec3::from(p))).to_vec(),
//!     triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
//! };
//! let both = ManifoldRust.intersection(&[&tetrahedron(0.0), &tetrahedron(1.0)], &CancelToken::new())?;
//! // The small tetrahedron x, y, z >= 1, x + y + z <= 4.
//! assert_eq!(both.triangles.len(), 4);
//! # Ok::<(), lacuna_boolean::BooleanError>(())
//! ```

mod engine;
mod error;
mod manifold_rust_engine;
mod operand;

pub use engine::{BooleanEngine, Operation};
pub use error::{BooleanError, Fault};
pub use manifold_rust_engine::ManifoldRust;
pub use operand::Operand;

#[cfg(test)]
mod contract;

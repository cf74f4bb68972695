//! The mathematics of lacuna: from a model to an automaton, an attractor, a proven solid and
//! measured intervals.

pub mod attractor;
pub mod automaton;
pub mod budget;
mod de_casteljau;
pub mod dilation;
pub mod error;
mod groups;
pub mod levels;
pub mod measure;
pub mod model;
mod order;
pub mod solid;
mod split_mix;
pub mod tessellation;
pub mod tolerance;

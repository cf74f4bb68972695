//! The mathematics of lacuna: from a model to an automaton, an attractor, a proven solid and
//! measured intervals.

pub mod budget;
pub mod error;
pub mod model;
pub mod solid;
pub mod tessellation;
pub mod tolerance;

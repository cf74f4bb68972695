//! One test binary for what the kernel offers, so that it is linked once and all tests share the processors.
//!
//! Each module says in its head what it asks and where its expected values come from; `oracle`, `cages`, `schemes`, `agreement` and `automata` are what they share.
#![allow(clippy::unwrap_used)]

mod address;
mod agreement;
mod area;
mod automata;
mod bounding_box;
mod cages;
mod certificate;
mod complex;
mod contact;
mod convergence;
mod crossings;
mod curve_schemes;
mod enclosed;
mod half_edge;
mod hausdorff;
mod joins;
mod leaf_error;
mod leaf_limit;
mod levels;
mod mass;
mod oracle;
mod oriented_box;
mod polygons;
mod products;
mod progress;
mod repair;
mod schemes;
mod sections;
mod self_contact;
mod simplification;
mod solve;
mod spline_surfaces;
mod splines;
mod stability;
mod streaming;
mod subdivision;
mod subdivision_peer;
mod subdivision_precision;
mod thickness;
mod trim;
mod trimmed_box;

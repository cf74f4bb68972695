//! What the tests and benches share: the real command, the fixtures, a running service, the Python environment of
//! the independent checks, and sets of points, segments and triangles with their exact distance.

pub mod support;

//! The one door to Manifold.

//! Why there is no solid.

use crate::attractor::RefineError;
use crate::budget::Stopped;
use crate::error::{Kind, LimitFacts};
use crate::solid::SolidError;

/// Why there is no solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DilationError {
    /// Somebody stopped it.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// More triangles than allowed.
    #[error("the tolerance of {tolerance_mm} mm needs more than the {allowed} triangles that are allowed")]
    Triangles {
        /// What was asked.
        tolerance_mm: f64,
        /// The limit. How many were made when it was hit is a matter of chance.
        allowed: u64,
    },
    /// More leaf cells than allowed.
    #[error("the tolerance of {tolerance_mm} mm needs more than the {allowed} leaf cells that are allowed near the surface")]
    LeafCells {
        /// What was asked.
        tolerance_mm: f64,
        /// The limit. How many were expanded when it was hit is a matter of chance.
        allowed: u64,
    },
    /// Single precision cannot carry the tolerance at these coordinates.
    #[error(
        "single-precision files cannot carry a tolerance of {tolerance_mm} mm at coordinates up to {extent_mm:.1} mm; {reachable_mm:.6} mm can be carried, or a shape nearer to the origin"
    )]
    Precision {
        /// What was asked.
        tolerance_mm: f64,
        /// Largest coordinate.
        extent_mm: f64,
        /// The finest tolerance that can be carried.
        reachable_mm: f64,
    },
    /// The tolerance cannot be reached with cells of the allowed depth.
    #[error(
        "cells of depth {allowed} are still {reached_mm:.3e} mm large, and the tolerance of {tolerance_mm} mm needs {needed_mm:.3e} mm: the maps contract too slowly"
    )]
    Depth {
        /// The limit.
        allowed: u32,
        /// What was asked.
        tolerance_mm: f64,
        /// Error that leaves must have.
        needed_mm: f64,
        /// Error of a cell at the limit.
        reached_mm: f64,
    },
    /// Cells overlap so much that too many matter at one place.
    #[error(
        "the cells overlap so much that more than {allowed} of them matter at one place; use fewer maps, maps that contract more, or a larger tolerance"
    )]
    Cells {
        /// The limit, from the memory that is allowed.
        allowed: usize,
    },
    /// A closed mesh given as a solid has no well-defined inside.
    #[error(
        "a closed mesh is taken as a solid, and crosses itself or has faces without area, so that its inside is not defined; mend it, or say \"interior\": \"surface\""
    )]
    Inside,
    /// An inward wall meets itself everywhere.
    #[error(
        "a wall of {thickness_mm} mm leaves no hollow: the largest ball inside the solid has a radius between {:.4} and {:.4} mm, so that a wall up to {:.4} mm leaves one; the solid itself is what a thicker wall is",
        .largest_mm[0], .largest_mm[1], .largest_mm[0]
    )]
    NoHollow {
        /// What was asked.
        thickness_mm: f64,
        /// The radius of the largest ball inside, between these.
        largest_mm: [f64; 2],
    },
    /// Trimmed surfaces, or parts whose radius varies, cannot be drawn as finely as their share of the tolerance asks.
    #[error("trimmed surfaces and parts whose radius varies are drawn within a share of {share} of the tolerance: {error}")]
    Drawn {
        /// What happened.
        error: RefineError,
        /// The share.
        share: f64,
    },
    /// The mesh is no closed manifold: our bug.
    #[error("the extracted surface is not a closed manifold: {0}")]
    Defect(SolidError),
}

impl From<SolidError> for DilationError {
    fn from(error: SolidError) -> Self {
        match error {
            SolidError::Stopped(stopped) => Self::Stopped(stopped),
            other => Self::Defect(other),
        }
    }
}

impl DilationError {
    /// How to react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Stopped(stopped) => stopped.kind(),
            Self::Drawn { error, .. } => error.kind(),
            Self::Triangles { .. } | Self::LeafCells { .. } | Self::Depth { .. } | Self::Cells { .. } => Kind::Limit,
            Self::Precision { .. } | Self::NoHollow { .. } => Kind::Unreachable,
            Self::Inside => Kind::Invalid,
            Self::Defect(_) => Kind::Defect,
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Stopped(stopped) => stopped.code(),
            Self::Drawn { error, .. } => error.code(),
            Self::Triangles { .. } => "limit-triangles",
            Self::Precision { .. } => "tolerance-unreachable",
            Self::Inside => "mesh.inside-undefined",
            Self::NoHollow { .. } => "wall.no-hollow",
            Self::Depth { .. } => "limit-depth",
            Self::LeafCells { .. } | Self::Cells { .. } => "limit-cells",
            Self::Defect(_) => "nonmanifold",
        }
    }

    /// The limit that was hit; what would pass, where the work tells: [`predict`](super::predict()) tells what another tolerance needs.
    #[must_use]
    pub fn limit(&self) -> Option<LimitFacts> {
        match *self {
            Self::Drawn { ref error, share } => error.limit().map(|facts| LimitFacts {
                // What was asked of them is a share of the tolerance.
                remedy: facts.remedy.map(|(name, value)| (name, if name == "tolerance_mm" { value / share } else { value })),
                ..facts
            }),
            Self::Stopped(_) | Self::Defect(_) | Self::Inside => None,
            Self::Cells { allowed } => {
                Some(LimitFacts { limit: "cells", asked: allowed as f64 + 1.0, allowed: allowed as f64, remedy: None })
            }
            Self::LeafCells { allowed, .. } => {
                Some(LimitFacts { limit: "cells", asked: allowed as f64 + 1.0, allowed: allowed as f64, remedy: None })
            }
            Self::Triangles { allowed, .. } => {
                Some(LimitFacts { limit: "triangles", asked: allowed as f64 + 1.0, allowed: allowed as f64, remedy: None })
            }
            Self::Precision { tolerance_mm, reachable_mm, .. } => Some(LimitFacts {
                limit: "tolerance_mm",
                asked: tolerance_mm,
                allowed: reachable_mm,
                remedy: Some(("tolerance_mm", reachable_mm)),
            }),
            Self::NoHollow { thickness_mm, largest_mm } => {
                let (asked, allowed) = (thickness_mm, largest_mm[0]);
                Some(LimitFacts { limit: "wall_mm", asked, allowed, remedy: Some(("wall_mm", 0.9 * allowed)) })
            }
            Self::Depth { allowed, .. } => {
                Some(LimitFacts { limit: "depth", asked: f64::from(allowed) + 1.0, allowed: f64::from(allowed), remedy: None })
            }
        }
    }
}

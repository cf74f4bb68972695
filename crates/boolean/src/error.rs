//! Why solids could not be combined.

use lacuna_kernel::budget::Stopped;
use lacuna_kernel::error::Kind;
use lacuna_kernel::solid::MisplacedShell;

/// What keeps a mesh from being an operand.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Fault {
    /// A triangle names a vertex that is not there, or the same one twice.
    #[error("triangle {triangle} names a vertex that does not exist, or one vertex twice")]
    Index {
        /// Index of the triangle.
        triangle: usize,
    },
    /// A coordinate is not a finite number.
    #[error("vertex {vertex} has a coordinate that is not a finite number")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// The edge from one vertex to another is not matched by exactly one triangle that runs along it the other way.
    #[error("the edge between vertices {from} and {to} does not belong to exactly two triangles of one orientation")]
    NotClosed {
        /// Start of the edge.
        from: u32,
        /// End of the edge.
        to: u32,
    },
    /// The mesh encloses no positive volume: its triangles face inwards, or it is flat.
    #[error("its triangles face inwards")]
    InsideOut,
    /// Two of its triangles cross, overlap or coincide.
    #[error("its triangles intersect each other")]
    SelfIntersecting,
    /// Its shells are not nested as those of a solid are.
    #[error("{0}")]
    MisplacedShell(MisplacedShell),
}

/// Why there is no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BooleanError {
    /// An operand is not a closed, outward mesh without self-intersections.
    #[error("operand {operand} is not a solid: {fault}")]
    NotASolid {
        /// Index of the operand.
        operand: usize,
        /// What is wrong with it.
        fault: Fault,
    },
    /// An operand has more vertices than the engine can number.
    #[error("operand {operand} has {count} corners, more than can be numbered with 31 bits")]
    TooLarge {
        /// Index of the operand.
        operand: usize,
        /// Corners of its triangles.
        count: usize,
    },
    /// The result would be larger than the engine can number.
    #[error("the result is larger than the engine can number")]
    ResultTooLarge,
    /// Nothing to combine.
    #[error("an intersection or a difference needs an operand")]
    NoOperand,
    /// A plane to cut with has no direction or no place.
    #[error("the plane's normal has no direction, or its offset is not finite")]
    NoPlane,
    /// The token was fired.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The engine failed on operands that it should have taken.
    #[error("the boolean engine failed: {0}")]
    Engine(String),
}

impl BooleanError {
    /// How a caller should react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::NotASolid { .. } | Self::NoOperand | Self::NoPlane => Kind::Invalid,
            Self::TooLarge { .. } | Self::ResultTooLarge => Kind::Limit,
            Self::Stopped(stopped) => match stopped.reason {
                lacuna_kernel::budget::StopReason::Cancelled => Kind::Cancelled,
                lacuna_kernel::budget::StopReason::Deadline => Kind::Limit,
            },
            Self::Engine(_) => Kind::Defect,
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::NotASolid { fault, .. } => match fault {
                Fault::Index { .. } => "boolean.index",
                Fault::NotFinite { .. } => "boolean.not-finite",
                Fault::NotClosed { .. } => "boolean.not-closed",
                Fault::InsideOut => "boolean.inside-out",
                Fault::SelfIntersecting => "boolean.self-intersecting",
                Fault::MisplacedShell(_) => "boolean.misplaced-shell",
            },
            Self::TooLarge { .. } => "boolean.operand-too-large",
            Self::ResultTooLarge => "boolean.result-too-large",
            Self::NoOperand => "boolean.no-operand",
            Self::NoPlane => "boolean.no-plane",
            Self::Stopped(_) => "boolean.stopped",
            Self::Engine(_) => "boolean.engine",
        }
    }
}

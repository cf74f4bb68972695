//! Where two shapes come together, and how far they are apart: pairs of cells, refined where they are near.
//!
//! A pair of cells is refined, the larger cell first, unless it is proven farther apart than matters; see `body` for
//! the bounds of a pair and `search` for the order. What remains are pairs of cells as small as the resolution, or of
//! simplices, which are exact. A shape is its points: a model that stands for a solid is the solid's surface.

mod body;
mod pieces;
mod place;
mod primitive;
mod search;
mod tree;

use super::Interval;
use crate::attractor::cell::{Ball, Point};
use crate::attractor::{Address, Attractor};
use crate::budget::{Budget, Stopped};
use crate::error::Kind;
use crate::tolerance::{NotPositive, Tolerance};
pub(crate) use body::{Body, Nature, closest_on_segments, corners};
pub use primitive::Primitive;
pub(crate) use tree::{NodeId, Tree};

/// What is sought of two shapes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactQuery {
    /// Cells are refined until their balls have this radius; pairs as near as this are places.
    pub resolution: Tolerance,
    /// Pairs of cells to find at most.
    pub most: usize,
}

/// Two cells, the first of the first shape, and how far they are from each other.
#[derive(Clone, Debug, PartialEq)]
pub struct CellPair {
    /// Address of the first.
    pub first: Address,
    /// Address of the second; none of a primitive.
    pub second: Option<Address>,
    /// A ball that contains the first.
    pub first_cell: Ball,
    /// A ball that contains the second, or the part of a primitive that the shape may come near to.
    pub second_cell: Ball,
    /// A point of each. Of given triangles, segments and points, and of primitives, it is the nearest to the other cell's; of other cells it is the one that their address leads to,
    /// wherever in the cell that is.
    pub points: [Point; 2],
    /// How far these may be off, in mm: rounding.
    pub off_mm: [f64; 2],
    /// Their distance lies in this interval, in mm.
    pub distance_mm: Interval,
}

/// Where the shapes come within the resolution: pairs of cells whose boxes are within it of each other, and those of one
/// cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Lower corner of a box that contains all points of the first shape's cells, in the place's pairs, that are within
    /// the resolution of the second's.
    pub low: Point,
    /// Its upper corner.
    pub high: Point,
    /// The pair of the least upper end, and among these of the least lower.
    pub pair: CellPair,
    /// Pairs of cells that make up the place.
    pub pairs: usize,
    /// The distance of the shapes at the place lies in this interval, in mm.
    pub distance_mm: Interval,
}

/// What is proven of two shapes, or of a shape at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// They have no common point.
    Disjoint,
    /// They are within the upper end of the distance; whether they have a common point is not known.
    Near,
    /// They have a common point.
    Touching,
}

impl Verdict {
    fn of(distance_mm: Interval) -> Self {
        if distance_mm.low > 0.0 {
            Self::Disjoint
        } else if distance_mm.high > 0.0 {
            Self::Near
        } else {
            Self::Touching
        }
    }
}

impl Place {
    /// What is proven here.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        Verdict::of(self.distance_mm)
    }
}

/// The answer to a [`ContactQuery`].
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// The distance of the shapes lies in this interval, in mm. Its upper end is 0 only when a common point is proven: by
    /// exact signs for given triangles, segments and points, by points of a connected cell on both sides of a plane, by
    /// points within a box or ball.
    pub distance_mm: Interval,
    /// The pair of cells of the least upper end that was looked at.
    pub nearest: CellPair,
    /// The places where they come within the resolution, by lower ends along the axis on which they are spread most.
    pub places: Vec<Place>,
    /// Pairs of cells whose distance was bounded: what the search cost.
    pub pairs_looked_at: u64,
    /// Whether there are no other places, and the distance is as narrow as the resolution allows: five times as wide, or
    /// less. Else a limit ended the search; what is told holds.
    pub complete: bool,
}

impl Contact {
    /// What is proven.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        Verdict::of(self.distance_mm)
    }
}

/// Why shapes are not compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// A number is not usable.
    #[error("{name} is {value}, and must be {expected}")]
    Query {
        /// Which.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// The resolution is no length.
    #[error(transparent)]
    Resolution(#[from] NotPositive),
    /// Cells of trimmed surfaces are not searched.
    #[error("a model has a trimmed surface, whose cells cannot be searched; remove \"trim\" to compare the whole surface")]
    Trimmed,
    /// Nothing of a shape can touch anything of it at this resolution.
    #[error(
        "at a tolerance of {resolution_mm} mm the shape is one piece, or pieces that declared boundaries join near each other: there are no two that could touch; a smaller tolerance looks closer"
    )]
    Whole {
        /// The resolution, in mm.
        resolution_mm: f64,
    },
    /// A limit ended the search before there was anything to tell.
    #[error(
        "a limit ended the search at a tolerance of {resolution_mm} mm before two pieces were found that nothing joins; give a larger tolerance"
    )]
    Unsettled {
        /// The resolution, in mm.
        resolution_mm: f64,
    },
    /// Somebody stopped the search.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl ContactError {
    /// How to react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Stopped(stopped) => stopped.kind(),
            Self::Unsettled { .. } => Kind::Limit,
            _ => Kind::Invalid,
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Query { .. } => "contact.query",
            Self::Resolution(_) => "params.not-a-length",
            Self::Trimmed => "contact.trimmed",
            Self::Whole { .. } => "contact.whole",
            Self::Unsettled { .. } => "contact.unsettled",
            Self::Stopped(stopped) => stopped.code(),
        }
    }
}

/// The tree of a shape that can be searched.
pub(crate) fn tree<'a>(attractor: &'a Attractor, budget: &Budget) -> Result<Tree<'a>, ContactError> {
    if attractor.trimmed().is_empty() { Ok(Tree::new(attractor, budget)?) } else { Err(ContactError::Trimmed) }
}

/// Where two shapes come within the resolution of each other, and their distance.
///
/// Cost: proportional to the pairs of cells, of all sizes, that are as near as the nearest or as the resolution.
///
/// # Errors
/// [`ContactError`] for a query that is not usable, a trimmed surface, or when stopped. Limits are no errors.
pub fn intersect(a: &Attractor, b: &Attractor, query: &ContactQuery, budget: &Budget) -> Result<Contact, ContactError> {
    search::search(tree(a, budget)?, tree(b, budget)?, query, budget)
}

/// Where a shape comes within the resolution of a primitive, and their distance. A point of which a shape is proven to be
/// [`Verdict::Disjoint`] is outside; else it belongs to the shape up to the distance that is told.
///
/// Cells that are proven to lie in a box or ball are not refined.
///
/// # Errors
/// As [`intersect`].
pub fn intersect_primitive(
    shape: &Attractor,
    primitive: &Primitive,
    query: &ContactQuery,
    budget: &Budget,
) -> Result<Contact, ContactError> {
    let tree = tree(shape, budget)?;
    let (body, size) = primitive.body(&tree.node(0).body.ball)?;
    search::search(tree, Tree::of_primitive(body, size), query, budget)
}

/// Where a shape comes within the resolution of itself although nothing declares it, and the distance of its pieces that
/// nothing joins.
///
/// Let t be the resolution. The shape is cut into *pieces*: the first cells, from the roots on, whose balls have a radius of
/// at most 4 t, and simplices of any size. Two different pieces are *joined*
///
/// * when they share a cell of their boundaries: the B-rep of the model says so, whose incidences, adjacencies and gluings
///   are followed exactly; corners of given simplices are shared when their coordinates are the same numbers. Of
///   triangles and segments it must be all that they have in common, which exact signs decide;
/// * or when they have no proven common point, and a chain of pieces leads from one to the other, each of which shares such a
///   cell with the next, and all but the two lie in the ball of radius 16 t around the middle of the closest points of what
///   stands for the two: simplices, chords, polygons, or the centres of their balls.
///
/// All other pairs of pieces count, and the answer is that of [`intersect`] for them: places where two of them come within t,
/// and the least of their distances, which lies in the interval that is told. [`Verdict::Disjoint`] is the proof that none of
/// them meet. A model that declares no boundaries, as plain iterated function systems do, has no joined pieces: all of its
/// contacts count. Folds and loops smaller than pieces are not seen. Arms of an angle below about 1 / 16 count as near, as the
/// way around by their tip is long. Where a shape hangs together, pieces farther along it than the chains reach are not joined,
/// so that their least distance is at most about 32 t; a model that declares boundaries is searched beyond t only as far as
/// some thousand pairs take, which may leave the interval wide.
///
/// Cost: proportional to the pieces, and to the pairs of cells that are as near as the nearest or as the resolution.
///
/// # Errors
/// As [`intersect`], and when no two pieces are apart, or a limit ended the search before two were found.
pub fn intersect_self(shape: &Attractor, query: &ContactQuery, budget: &Budget) -> Result<Contact, ContactError> {
    search::search_self(tree(shape, budget)?, query, budget)
}

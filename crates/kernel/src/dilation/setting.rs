//! Numbers that all parts of a dilation share.

use super::block::WITNESS;
use super::lattice::{ENCLOSING, LEVELS, Lattice};
use super::outside::MOST;
use super::smooth::MOST_NOISE;
use crate::measure::bounds::AxisBox;
use crate::solid::rounding;

/// Numbers that all blocks share, in mm or mm^2.
#[derive(Clone, Debug)]
pub(crate) struct Setting {
    pub(super) lattice: Lattice,
    /// sqrt(theta) = r: sites nearer than this cover a vertex.
    pub(super) reach: f64,
    /// Sites farther than this from all vertices of a tetrahedron do not matter in it: sqrt(outer^2 + R^2).
    pub(super) near: f64,
    /// Vertices farther than this from all sites have no covered neighbour: r + a, or r + gap + a.
    pub(super) horizon: f64,
    /// Sites are known this far around places whose distance from the sites is asked.
    pub(super) sight: f64,
    /// (r + a)^2 less theta as an integer, rounded up.
    pub(super) far: i64,
    /// The surface is nowhere nearer to a site than this: sqrt(theta - R^2) or less, what simplification may use of the tolerance.
    pub(super) least: f64,
    /// `least` in space, for the sites whose balls are the smallest.
    pub(super) thinnest: f64,
    /// The surface is nowhere farther from the sites than this: what simplification may use of the tolerance.
    pub(super) outer: f64,
    /// f less theta where a gap was closed: the surface passes near the vertex.
    pub(super) filled_value: i64,
    /// outer^2 + R^2 less theta by level, as an integer.
    pub(super) bands: [i64; LEVELS as usize + 1],
    /// R^2 by level.
    pub(super) inner_bands: [i64; LEVELS as usize + 1],
    /// A site nearer than this to a vertex covers all tetrahedra there.
    pub(super) deep: f64,
    /// 1 / q, with q the unit in which squared distances are compared.
    pub(super) inverse_unit: f64,
    /// The largest value of a site that matters.
    pub(super) most: i64,
    /// Rounding of positions and distances: far above what double precision loses, far below everything else.
    pub(super) slack: f64,
    /// How far a position moves when it becomes a single-precision number.
    pub(super) rounding: f64,
    /// A power of two: coordinates in single precision may be multiples of it, and those at the shape's extent are.
    pub(super) unit: f64,
    /// Whether sites are too many to be told apart: all tetrahedra are marched, and refined where what that fills is not near a site, see `block`.
    pub(super) dense: bool,
    /// Radius of the ball that closes gaps among dense sites, and how wide a neck the lattice sees there.
    pub(super) gap: f64,
    pub(super) neck: f64,
    /// outer - r.
    pub(super) close: f64,
    /// How far beyond the balls in space the solid may reach, whatever their radii: at least `close`.
    pub(super) close_in_space: f64,
    /// Whether simplification only removes what cannot be a solid.
    pub(super) clean_only: bool,
    /// What was asked, of the smallest balls.
    pub(super) tolerance: f64,
    /// How far places of the shape that sites stand for are from these, and sites from it, at most: 0 where sites are the shape.
    pub(super) off: f64,
    /// The axis along which the shape's box has its least side, how long this is at most, and where its middle is.
    pub(super) thin: usize,
    pub(super) width: f64,
    pub(super) middle: f64,
    /// Whether sheets along the sites may serve.
    pub(super) has_sheets: bool,
    /// Cells that one cube of space may hold at once; a block, whose cells are smaller, four times as many.
    pub(super) cells: usize,
}

impl Setting {
    pub(super) fn new(radius: f64, outer: f64, tolerance: f64, pitch: f64, cells: usize, bounds: &AxisBox) -> Self {
        let extent = extent(bounds, radius + 2.0 * pitch);
        let margin = radius + 2.5 * pitch;
        // An origin that no model's own planes are likely to meet: ties are legal, but cost time.
        let origin = std::array::from_fn(|axis| bounds.low[axis].low - margin - pitch * [0.137, 0.291, 0.413][axis]);
        let (theta, enclosing) = (radius * radius, (ENCLOSING * pitch).powi(2));
        let near = (outer * outer + enclosing).sqrt();
        let horizon = near.max(radius + 1.001 * pitch);
        // Beside larger cubes there are tetrahedra on half a face: the ball around the face's diagonal holds them.
        let enclosing_of = |level: usize| if level == 0 { enclosing } else { 0.5 * pitch * pitch * 0.25_f64.powi(level as i32) };
        // Values of sites that matter are within -theta and (near + a)^2 - theta.
        let largest = ((near + 1.001 * pitch).powi(2) - theta).max(theta);
        let inverse_unit = (MOST - 2 * MOST_NOISE) as f64 / largest;
        let integer = |square: f64| (square * inverse_unit).ceil() as i64;
        let side = |axis: usize| bounds.high[axis].high - bounds.low[axis].low;
        let thin = if side(0) <= side(1).min(side(2)) { 0 } else { 1 + usize::from(side(2) < side(1)) };
        Self {
            lattice: Lattice { origin, pitch },
            reach: radius,
            near,
            horizon,
            sight: (2.0 * WITNESS * radius).max(horizon + radius) * 1.001,
            far: integer((radius + 1.001 * pitch).powi(2) - theta),
            least: least(radius, pitch),
            thinnest: least(radius, pitch),
            outer,
            filled_value: -1,
            bands: std::array::from_fn(|level| integer(outer * outer - theta + enclosing_of(level))),
            inner_bands: std::array::from_fn(|level| integer(enclosing_of(level))),
            deep: (radius - pitch * 1.000_1).max(0.0),
            inverse_unit,
            most: integer(largest),
            slack: 1e-13 * extent,
            rounding: rounding(self::extent(bounds, 3.0 * radius)),
            unit: unit(self::extent(bounds, 3.0 * radius)),
            dense: false,
            gap: 0.0,
            neck: 0.0,
            close: outer - radius,
            close_in_space: outer - radius,
            clean_only: false,
            tolerance,
            off: 0.0,
            thin,
            width: side(thin),
            middle: 0.5 * (bounds.low[thin].low + bounds.high[thin].high),
            has_sheets: true,
            cells,
        }
    }

    /// The same for sites no place of which is farther than `moved` from those that are meant, nor one of these from them, with more slack for rounding. Tetrahedra do not fit it.
    pub(super) fn narrower(&self, moved: f64, slack: f64) -> Self {
        Self { least: self.least + moved, outer: self.outer - moved, off: self.off + moved, slack, ..self.clone() }
    }

    /// What the surface may be off d = r at least, inwards and outwards.
    pub(super) fn half_band(&self) -> f64 {
        (self.outer - self.reach).min(self.reach - self.least)
    }

    /// A squared distance less theta as an integer, never 0.
    #[inline]
    pub(super) fn integer(&self, distance_squared: f64) -> i64 {
        let scaled = (distance_squared - self.reach * self.reach) * self.inverse_unit;
        // Saturates; far sites cover nothing.
        let value = (scaled + 0.5_f64.copysign(scaled)) as i64;
        if value == 0 { 1 } else { value }
    }
}

/// sqrt(theta - R^2), rounded down.
pub(super) fn least(radius: f64, pitch: f64) -> f64 {
    (radius * radius - (ENCLOSING * pitch).powi(2)).max(0.0).sqrt() * (1.0 - 1e-12)
}

/// Largest coordinate of the box grown by `margin`.
pub(super) fn extent(bounds: &AxisBox, margin: f64) -> f64 {
    (0..3).map(|axis| bounds.low[axis].low.abs().max(bounds.high[axis].high.abs()) + margin).fold(0.0, f64::max)
}

/// The largest step between single-precision numbers below the least power of two above an extent, which is a normal number: half of it is no more than the extent's half unit in the last place.
pub(super) fn unit(extent: f64) -> f64 {
    let power = f64::from_bits((extent.to_bits() >> 52) << 52);
    2.0 * power / f64::from(1 << f32::MANTISSA_DIGITS)
}

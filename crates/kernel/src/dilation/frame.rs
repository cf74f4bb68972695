//! A tetrahedron of the lattice, and what is known of its vertices.

use super::convex::{Convex, SiteSearch};
use super::lattice::{Cube, ENCLOSING, Number, UNITS};
use super::setting::Setting;
use super::tree::{NodeId, SiteId, Tree, in_space};
use crate::attractor::cell::{Point, distance_squared};

/// The ball around a tetrahedron has at most this radius, in units of its longest edge: sqrt(3 / 8) (Jung, 1901).
const JUNG: f64 = 0.612_373;
/// Value of a vertex not evaluated yet.
pub(super) const UNKNOWN: f64 = f64::NAN;
/// Value of a vertex so near to a site that it covers every tetrahedron there.
pub(super) const DEEP: f64 = f64::NEG_INFINITY;
/// Value of a vertex that no site covers.
pub(super) const FAR: f64 = f64::INFINITY;

/// The four vertices of a tetrahedron in the order of their numbers.
pub(super) struct Frame {
    pub(super) numbers: [Number; 4],
    pub(super) positions: [Point; 4],
    pub(super) values: [Value; 4],
    /// Which vertices are covered: their least squared distance is below theta.
    pub(super) covered: u8,
    /// A point beyond the surface over every vertex, and its squared distance from the sites, or a smaller number.
    pub(super) witnesses: [(Point, f64); 4],
    /// The finer level of the two cubes.
    pub(super) level: u32,
    /// Whether the order turned the tetrahedron inside out.
    pub(super) mirrored: bool,
}

impl Frame {
    /// Whether the tetrahedron is so small that what is filled of it is within `outer`.
    ///
    /// Where the interpolant of squares d(v)^2 with weights w is at most s^2, the mean of d(v) is at most s, and that of |x - v| at most R, the radius of a ball around the
    /// tetrahedron: d(x) <= s + R, the distance growing by no more than the way. s is r, or r + gap where the value of a vertex in a gap was lowered. All that holds for
    /// the distance whose square is less by the least deficit of the nearest sites, too, among sites with no smaller deficit, and r in space.
    pub(super) fn is_close(&self, setting: &Setting, tree: &Tree<'_>) -> bool {
        if self.is_around_a_site(setting, tree) {
            return true;
        }
        let deficit = self.values.iter().filter(|value| value.square.is_finite()).map(|value| tree.site(value.site).deficit);
        let deficit = deficit.fold(f64::INFINITY, f64::min);
        let close = if self.values.iter().all(|value| value.square.is_finite()) && deficit > 0.0 {
            in_space(setting.outer, deficit) - in_space(setting.reach, deficit)
        } else {
            setting.close
        };
        let edges = (0..4).flat_map(|p| (0..p).map(move |q| (p, q)));
        let longest = edges.map(|(p, q)| distance_squared(&self.positions[p], &self.positions[q])).fold(0.0, f64::max).sqrt();
        let is_filled = |value: &Value| value.least < 0 && value.square > setting.reach * setting.reach;
        let gap = if self.values.iter().any(is_filled) { setting.gap } else { 0.0 };
        // At level 0 the lattice's own bound is sharper.
        let around = (JUNG * longest).min(ENCLOSING * setting.lattice.pitch);
        around + gap + setting.slack < close
    }

    /// Whether the nearest site of some vertex is so near to it that the whole tetrahedron is close to that site in space: the distance grows by no more than the way.
    fn is_around_a_site(&self, setting: &Setting, tree: &Tree<'_>) -> bool {
        (0..4).filter(|&k| self.values[k].square.is_finite()).any(|k| {
            let site = tree.site(self.values[k].site);
            let beyond = site.in_space(self.values[k].square.sqrt()) - site.in_space(setting.reach);
            let way = self.positions.iter().map(|x| distance_squared(x, &self.positions[k])).fold(0.0, f64::max).sqrt();
            beyond + way + setting.slack < setting.close_in_space
        })
    }

    /// The cubes of its level that have their centres among its vertices.
    pub(super) fn cubes(&self) -> impl Iterator<Item = Cube> {
        let edge = UNITS >> self.level;
        self.numbers
            .into_iter()
            .filter(move |number| number.iter().all(|&x| i64::from(x).rem_euclid(edge) == edge / 2))
            .map(move |number| Cube { level: self.level, index: number.map(|x| i64::from(x).div_euclid(edge)) })
    }

    /// The values of V of a simplex.
    pub(super) fn values_of(&self, simplex: u8) -> [i64; 4] {
        std::array::from_fn(|k| if simplex >> k & 1 == 1 { self.values[k].least } else { self.values[k].far })
    }
}

/// What is known of a vertex.
#[derive(Clone, Copy)]
pub(super) struct Value {
    /// f, or [`DEEP`] or [`FAR`].
    pub(super) square: f64,
    /// The nearest site, and its closest point.
    pub(super) site: SiteId,
    pub(super) closest: Point,
    pub(super) node: NodeId,
    /// f less theta as V has it, never 0: see `smooth`.
    pub(super) least: i64,
    /// W less theta.
    pub(super) far: i64,
    /// The squared distance of the witness from the sites, once it was asked for.
    pub(super) witness: f64,
}

/// A vertex that is not evaluated yet.
pub(super) const NOTHING: Value =
    Value { square: UNKNOWN, site: SiteId::Listed(0), closest: [0.0; 3], node: 0, least: 1, far: 1, witness: UNKNOWN };

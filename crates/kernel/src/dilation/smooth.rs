//! Where one site nearly serves a whole simplex of the lattice, the least squared distance alone decides.
//!
//! Let f be the least squared distance from the sites at the lattice's vertices, and L_f affine on a tetrahedron K with these values. As f <= d_i^2 at the
//! vertices, L_f <= L_i for every site: what L_f < theta covers contains all that sites cover. For a simplex s of K let V_s be affine on K with the values of f at the
//! vertices of s and W = (r + a)^2 at the others. s is *smooth* when a site i, the nearest at one of its vertices, has d_i <= outer at all corners of the polytope in K where
//! V_s < theta. These are the covered vertices of s, the points on its edges that V_s cuts, where d_i^2 <= L_i, and for a covered v of s those on the edges that
//! leave s, a share t = (theta - f) / (W - f) of the way, where d_i <= d_i(v) + t a. d_i being convex, all of the polytope is then in D(outer).
//!
//! So the solid may take it: its part of K is the union of L_i < theta for all sites and V_s < theta for all smooth s. Whether s is smooth depends on its vertices alone, and V_s on a face F is V of the
//! common simplex of s and F (where they have none, it covers nothing): neighbours agree on faces. Where K itself is smooth, V_K = L_f covers all that the others do, and
//! the surface is that of marching tetrahedra; no other site has to be known.
//!
//! Values of f in V are an integer below those of sites, another one at every vertex, so that ties between V's and sites do not follow from their definition.

use super::convex::{Convex, SiteSearch};
use super::frame::Frame;
use super::lattice::{Number, UNITS};
use super::setting::Setting;
use super::tree::Tree;
use crate::attractor::cell::distance_squared;

/// How far below the least squared distance the values of V are, at most, in units.
pub(super) const MOST_NOISE: i64 = 32;

/// Masks of vertices: every simplex follows its own simplices.
const SIMPLICES: [u8; 11] = [0b0011, 0b0101, 0b1001, 0b0110, 0b1010, 0b1100, 0b0111, 0b1011, 0b1101, 0b1110, 0b1111];
/// The tetrahedron itself.
pub(super) const WHOLE: u8 = 0b1111;

/// The simplices of a tetrahedron that one of some sites serves, besides those `known` to be: bit s for the simplex with mask s. Those that cover nothing need no site.
pub(super) fn served(setting: &Setting, frame: &Frame, squares: &[[f64; 4]], known: u16) -> u16 {
    let covered = |v: usize| frame.covered >> v & 1 == 1;
    let shares: [f64; 4] = std::array::from_fn(|v| share(frame.values[v].least, frame.values[v].far));
    let outer = setting.outer * (1.0 - 1e-9) - setting.slack;
    let square = outer * outer;
    let theta = setting.reach * setting.reach;
    let serves = |s: u8, site: usize| {
        // What is covered at all vertices must be covered by the site alone: else V would be a bridge over a valley that others leave open.
        let square = if s & !frame.covered == 0 && !setting.dense { theta } else { square };
        (0..4).filter(|v| s >> v & 1 == 1 && covered(*v)).all(|v| {
            let own = squares[site][v];
            let leaves = s == WHOLE || own.sqrt() + shares[v] * setting.lattice.pitch <= outer;
            leaves
                && own <= square
                && (0..4).filter(|w| s >> w & 1 == 1 && !covered(*w)).all(|w| {
                    let t = share(frame.values[v].least, frame.values[w].least);
                    own + t * (squares[site][w] - own) <= square
                })
        })
    };
    let near = |site: usize| (0..4).any(|v| covered(v) && squares[site][v] <= square);
    let mut result = known;
    if frame.covered != 0 && !(0..squares.len()).any(near) {
        return result;
    }
    for s in SIMPLICES.into_iter().filter(|s| known >> s & 1 == 0) {
        let nothing = (0..4).all(|v| s >> v & 1 == 0 || !covered(v));
        let is_steep = |site: usize| setting.dense || is_steep(setting, frame, &squares[site], s);
        let may_be = setting.dense || is_long(&frame.numbers, s);
        result |= u16::from(nothing || (may_be && (0..squares.len()).any(|site| serves(s, site) && is_steep(site)))) << s;
    }
    result
}

/// The smooth simplices, from those that are served by any site: all of their own simplices must be, too.
pub(super) fn smooth(served: u16) -> u16 {
    let own = |result: u16, s: u8| SIMPLICES.iter().all(|&part| part == s || part & s != part || result >> part & 1 == 1);
    SIMPLICES.into_iter().fold(VERTICES, |result, s| result | u16::from(served >> s & 1 == 1 && own(result, s)) << s)
}

/// Whether the distance grows at a rate above [`LEAST_RATE`] towards one point, everywhere in what a site leaves of a simplex.
///
/// The rate at x is the distance of x from the hull of its closest points, over d. Where it is at most m, some closest point z has (z - x) . w >= -m d for a unit vector w: then
/// d(y)^2 <= d^2 + |y - x|^2 + 2 m d |y - x| for y = x + |y - x| w. A larger d(y) tells that the rate is larger. V fills valleys up to `outer`, here and not there: where
/// the distance hardly changes along them that would make handles.
fn is_steep(setting: &Setting, frame: &Frame, squares: &[f64; 4], s: u8) -> bool {
    let theta = setting.reach * setting.reach;
    let (mut rest, mut count) = ([[0.0; 3]; 8], 0);
    for p in (0..4).filter(|p| s >> p & 1 == 1) {
        if squares[p] >= theta {
            rest[count] = frame.positions[p];
            count += 1;
        }
        for q in (p + 1..4).filter(|q| s >> q & 1 == 1 && (squares[p] < theta) != (squares[*q] < theta)) {
            let t = (theta - squares[p]) / (squares[q] - squares[p]);
            rest[count] = std::array::from_fn(|axis| frame.positions[p][axis] + t * (frame.positions[q][axis] - frame.positions[p][axis]));
            count += 1;
        }
    }
    (0..4).filter(|v| s >> v & 1 == 1).any(|v| {
        let (y, square) = frame.witnesses[v];
        rest[..count].iter().all(|x| {
            let way = distance_squared(x, &y);
            square > setting.outer * setting.outer + way + 2.0 * LEAST_RATE * setting.outer * way.sqrt()
        })
    })
}

/// See [`is_steep`].
const LEAST_RATE: f64 = 0.15;

/// The largest smooth simplices that cover something: none contains another.
pub(super) fn largest(smooth: u16, covered: u8) -> impl Iterator<Item = u8> {
    let is_smooth = move |s: u8| smooth >> s & 1 == 1;
    (1..=WHOLE).filter(move |&s| s & covered != 0 && is_smooth(s) && (0..4).all(|v| s >> v & 1 == 1 || !is_smooth(s | 1 << v)))
}

/// All simplices but the whole tetrahedron, where only that one is asked for.
pub(super) const PARTS: u16 = !(1 << WHOLE);

/// The vertices, which are smooth.
pub(super) const VERTICES: u16 = 1 << 0b0001 | 1 << 0b0010 | 1 << 0b0100 | 1 << 0b1000;

/// Where an affine function with these values at two vertices is zero, as a share of the way.
fn share(from: i64, to: i64) -> f64 {
    from as f64 / (from - to) as f64
}

/// Squared distances of the vertices from each vertex's nearest site; infinite where there is none.
pub(super) fn squares(tree: &Tree<'_>, frame: &Frame) -> [[f64; 4]; 4] {
    let mut squares = [[f64::INFINITY; 4]; 4];
    for (site, value) in frame.values.iter().enumerate().filter(|(_, value)| value.square.is_finite()) {
        let same = |&other: &usize| squares[other][other].is_finite() && frame.values[other].site == value.site;
        squares[site] = if let Some(same) = (0..site).find(same) {
            squares[same]
        } else {
            let shape = tree.site(value.site);
            std::array::from_fn(|v| if v == site { value.square } else { shape.distance_squared(&frame.positions[v]) })
        };
    }
    squares
}

/// Whether all edges of a simplex are those of cubes that are not subdivided: a, or sqrt(3) / 2 a.
fn is_long(numbers: &[Number; 4], s: u8) -> bool {
    let long = |p: usize, q: usize| {
        let square: i64 = (0..3).map(|axis| i64::from(numbers[p][axis] - numbers[q][axis]).pow(2)).sum();
        10 * square > 7 * UNITS * UNITS
    };
    (0..4).all(|p| s >> p & 1 == 0 || (p + 1..4).all(|q| s >> q & 1 == 0 || long(p, q)))
}

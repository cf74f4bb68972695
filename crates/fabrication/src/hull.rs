//! The volume of the hull of exact solids, from the hull of the meshes that stand for them.
//!
//! Let H be the hull of the exact solids and K that of their meshes, h their support functions. A mesh M of an input with D(r - inner) in M in D(r + outer) has
//! h(D(r)) <= h(M) + inner and h(M) <= h(D(r)) + outer, and so does one whose surface is within those of the exact one; the hull's support function is the largest of its parts'. Hence with B the unit ball
//!
//!   H in K + inner B   and   K in H + outer B.
//!
//! For a convex K with the volume V, the area A and the integral M of its mean curvature Steiner's formula says V(K + e B) = V + A e + M e^2 + 4/3 pi e^3, A(K + e B) = A + 2 M e + 4 pi e^2 and
//! M(K + e B) = M + 4 pi e (R. Schneider, "Convex Bodies: The Brunn-Minkowski Theory", 2014, 4.2). All of them grow with the set. M is 2 pi times the mean width, which is at most the diameter.

use std::f64::consts::PI;

use glam::DVec3;
use lacuna_kernel::budget::{Budget, Stopped};
use lacuna_kernel::measure::mass::{area_within, volume_within};
use lacuna_kernel::solid::{Inside, TriMesh};

use crate::certificate::Interval;

/// Relative rounding of the formulas.
const ROUNDING: f64 = 1e-12;
/// Relative rounding of distances of points from a hull, of their largest coordinates.
const DISTANCE_ROUNDING: f64 = 1e-14;
/// Points looked at between two looks at the budget.
const CHUNK: usize = 1 << 14;

/// The hull of meshes, and how far these reach beyond it.
pub(crate) struct Hull {
    volume: Interval,
    area: f64,
    diameter: f64,
    /// No point of the meshes is farther from the hull than this.
    excess: f64,
}

impl Hull {
    /// Measures a convex mesh that an engine made of others. Engines leave out points that are near to it: how near is measured.
    pub(crate) fn of<'m>(mesh: &TriMesh, inputs: impl Iterator<Item = &'m TriMesh>, budget: &Budget) -> Result<Self, Stopped> {
        let (volume, inside) = (volume_within(mesh), Inside::new(mesh));
        let mut corners = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        corners = mesh.vertices.iter().fold(corners, |[low, high], &vertex| [low.min(vertex), high.max(vertex)]);
        let mut excess = 0.0_f64;
        for points in inputs.flat_map(|input| input.vertices.chunks(CHUNK)) {
            budget.cancel.check()?;
            excess = excess.max(inside.farthest(points));
        }
        let largest = corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
        Ok(Self {
            volume: [volume.low, volume.high],
            area: area_within(mesh).high,
            diameter: corners[0].distance(corners[1]),
            excess: excess + DISTANCE_ROUNDING * largest,
        })
    }

    /// The volume of the hull of the exact solids.
    pub(crate) fn exact_volume(&self, inner: f64, outer: f64) -> Interval {
        let (i, o, a, m) = (inner + self.excess, outer, self.area, 2.0 * PI * self.diameter);
        let ball = 4.0 / 3.0 * PI;
        let above = a * i + m * i * i + ball * i.powi(3);
        // V(K) <= V(H + o B) with the area and the mean curvature of H at most those of K + i B.
        let below = (a + 2.0 * m * i + 4.0 * PI * i * i) * o + (m + 4.0 * PI * i) * o * o + ball * o.powi(3);
        let [low, high] = self.volume;
        [(low - below * (1.0 + ROUNDING)).next_down().max(0.0), (high + above * (1.0 + ROUNDING)).next_up()]
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_cube_and_what_is_near_to_it() {
        let vertices = (0..8).map(|code| DVec3::new(f64::from(code & 1), f64::from(code >> 1 & 1), f64::from(code >> 2)) * 10.0).collect();
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let cube = TriMesh { vertices, triangles };
        let hull = Hull::of(&cube, std::iter::once(&cube), &Budget::default()).unwrap();
        let exact = hull.exact_volume(0.0, 0.0);
        assert!(exact[0] <= 1000.0 && 1000.0 <= exact[1] && exact[1] - exact[0] < 1e-9, "{exact:?}");
        // The cube grown by balls of 0.1, and the one whose dilation by 0.1 lies in it.
        let [low, high] = hull.exact_volume(0.1, 0.1);
        let grown = 1000.0 + 60.0 + 30.0 * PI * 0.01 + 4.0 / 3.0 * PI * 0.001;
        assert!(low <= 9.8_f64.powi(3) && grown <= high && high - low < 125.0, "[{low}, {high}]");
        // A point that the hull leaves out by 0.1.
        let mut more = cube.clone();
        more.vertices.push(DVec3::new(5.0, 5.0, 10.1));
        let left_out = Hull::of(&cube, std::iter::once(&more), &Budget::default()).unwrap().exact_volume(0.0, 0.0);
        assert!(left_out[1] >= 1000.0 + 100.0 * 0.1 / 3.0, "{left_out:?}");
    }
}

//! Points that stand for cells, as of most fractals: where they are in one plane, what is around them needs no lattice, see `planar`.

use super::planar::{self, Thinned, Thinning};
use super::{Arrangement, BYTES_PER_POINT, Copies, Sites, most_of};
use crate::attractor::sites::SiteRule;
use crate::budget::{Budget, Stopped};
use crate::dilation::setting::Setting;
use crate::dilation::tree::Candidates;
use std::sync::Arc;

/// How far points may be off a plane, as a share of half the band.
const FLAT: f64 = 1.0 / 256.0;
/// How far they are moved, likewise: those that are closer are one.
const CLOSE: f64 = 1.0 / 64.0;
/// The share of what sites may be off that cells use: what is left is for points that are between others.
const OF_CELLS: f64 = 0.6;

impl Arrangement {
    /// What lies in one plane of dense sites; none where they do not, or it does not come out.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn of_dense(
        setting: &Setting,
        rule: &SiteRule<'_>,
        candidates: &Candidates,
        budget: &Budget,
    ) -> Result<Option<Self>, Stopped> {
        if !is_thin(setting) {
            return Ok(None);
        }
        let most = (budget.limits.memory_bytes as f64 / BYTES_PER_POINT) as usize;
        let Some((mut sites, _)) = Sites::of(&rule.finer(OF_CELLS), candidates, most_of(most, budget), budget)? else { return Ok(None) };
        let (room, least_square) = (rule.room(), rule.least_square());
        let thinning = Thinning {
            axis: setting.thin,
            flat: FLAT * setting.half_band(),
            close: CLOSE * setting.half_band(),
            between: (least_square - sites.error.square).max(0.0).sqrt(),
            among: room.sqrt(),
        };
        let Some(Thinned { figures, moved }) = thinning.of(&sites.list, budget)? else { return Ok(None) };
        let thinned = std::mem::replace(&mut sites.list, figures).len();
        // All that sites may be off is used.
        sites.error.inner_square = sites.error.inner_square.max(room);
        sites.error.square = sites.error.square.max(least_square);
        // What they are off tells nothing of the topology: see `flow`.
        let setting = Setting { off: f64::INFINITY, ..setting.narrower(moved, setting.slack) };
        let copies = Copies::default();
        let Some(flat) = planar::surface(&sites.list, &setting, |x| copies.rounded(x), budget)? else { return Ok(None) };
        let mut arrangement = Self::empty(sites, setting, Vec::new(), Arc::new(copies));
        arrangement.take(flat);
        arrangement.thinned = thinned;
        Ok(Some(arrangement))
    }
}

/// Whether a shape's box is so thin that it may lie in a plane.
pub(in crate::dilation) fn is_thin(setting: &Setting) -> bool {
    setting.width <= FLAT * setting.half_band()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{
        arranged, arranged_unless_left, assert_limited, assert_steady, centres, holds_everywhere, is_flat, on_coarse_lattice, points,
        system, topology,
    };
    use crate::attractor::Attractor;
    use crate::attractor::cell::{Cell, ControlPoint, distance_squared};
    use crate::budget::Budget;
    use crate::dilation::dilate;
    use crate::model::AffineMap;
    use crate::solid::Inside;
    use crate::split_mix::Random;
    use crate::tolerance::{Radius, Tolerance};
    use glam::{DMat3, DVec3};

    /// Copies of the plane across an axis at a height, by a share, turned, to places.
    fn copies(maps: &[(f64, f64, [f64; 2])], axis: usize, height: f64) -> Attractor {
        let axes = [(axis + 1) % 3, (axis + 2) % 3];
        let map = |&(share, turn, to): &(f64, f64, [f64; 2])| {
            let (sine, cosine) = turn.sin_cos();
            let mut linear = [[0.0; 3]; 3];
            (linear[axes[0]][axes[0]], linear[axes[0]][axes[1]]) = (share * cosine, share * sine);
            (linear[axes[1]][axes[0]], linear[axes[1]][axes[1]]) = (-share * sine, share * cosine);
            linear[axis][axis] = share;
            let mut translation = DVec3::ZERO;
            (translation[axes[0]], translation[axes[1]], translation[axis]) = (to[0], to[1], (1.0 - share) * height);
            AffineMap { linear: DMat3::from_cols_array_2d(&linear), translation }
        };
        system(maps.iter().map(map).collect())
    }

    /// Copies to the corners of a triangle with sides of 100 mm.
    fn triangle() -> Attractor {
        copies(&[(0.5, 0.0, [0.0, 0.0]), (0.5, 0.0, [50.0, 0.0]), (0.5, 0.0, [25.0, 1_875.0_f64.sqrt()])], 2, 0.0)
    }

    /// How far a place is from an attractor, or farther by so little: no farther than from the far side of any cell's ball. Those go that are not nearer by more.
    fn distance(attractor: &Attractor, x: DVec3, little: f64) -> f64 {
        let roots = attractor.roots().iter().enumerate();
        let mut open: Vec<(Cell, Vec<ControlPoint>)> =
            roots.map(|(index, root)| (attractor.root_cell(index), root.points.clone())).collect();
        let from = |cell: &Cell| distance_squared(&x.to_array(), &cell.ball.centre).sqrt();
        let mut best = f64::INFINITY;
        while let Some((cell, points)) = open.pop() {
            if from(&cell) - cell.ball.radius >= best - little {
                continue;
            }
            best = best.min(from(&cell) + cell.ball.radius);
            let mut children: Vec<_> = attractor.children(&cell, &points).collect();
            children.sort_by(|a, b| from(&b.0).total_cmp(&from(&a.0)));
            open.extend(children);
        }
        best
    }

    /// Some maps, which shrink by half or so.
    fn some(random: &mut Random) -> Vec<(f64, f64, [f64; 2])> {
        let count = 2 + random.next() % 3;
        let turn = |random: &mut Random| [0.0, 1.0, std::f64::consts::FRAC_PI_2, 6.0 * random.share()][(random.next() % 4) as usize];
        (0..count).map(|_| (0.3 + 0.35 * random.share(), turn(random), [40.0 * random.share(), 40.0 * random.share()])).collect()
    }

    #[test]
    fn random_systems_in_a_plane_keep_their_bounds_and_have_the_topology_of_small_balls() {
        let mut random = Random(3);
        let (mut told, mut compared) = (0, 0);
        let turned = DMat3::from_rotation_z(0.3) * DMat3::from_rotation_x(0.7);
        for round in 0..15 {
            let shape = copies(&some(&mut random), round % 3, [0.0, 0.1, -40.3][round / 3 % 3]);
            let (radius, share) = ([4.0, 7.0, 12.0][round / 2 % 3], [0.1, 0.05][round % 2]);
            let tolerance = share * radius;
            if !is_flat(&shape, radius, tolerance) {
                continue;
            }
            let made = arranged(&shape, radius, tolerance);
            assert!(made.inner_mm <= tolerance && made.outer_mm <= tolerance && made.pitch_mm.is_none(), "{round}");
            // Nothing crosses, and no place is beyond the bounds but for what is not known of the distance.
            let little = 0.01 * tolerance;
            let [inner, outer] = [radius - made.inner_mm - little, radius + made.outer_mm + little];
            let within = |x: DVec3| if (inner..=outer).contains(&distance(&shape, x, little)) { radius } else { f64::INFINITY };
            assert!(holds_everywhere(&made, radius, within, &mut random), "{round}");
            let inside = Inside::new(made.solid.mesh());
            for _ in 0..100 {
                let x = DVec3::from_array(std::array::from_fn(|_| 120.0 * random.share() - 40.0));
                let d = distance(&shape, x, little);
                let expected = if d < inner { Some(1) } else { (d > outer).then_some(0) };
                assert!(expected.is_none_or(|expected| inside.winding(x) == expected), "{round}: {x}, {d}");
            }
            told += usize::from(made.topology_exact);
            // By the centres of small balls, out of the plane.
            let Some(centres) = centres(&shape, 0.02 * radius, 400).filter(|_| made.topology_exact) else { continue };
            let centres: Vec<DVec3> = centres.into_iter().map(|at| turned * at).collect();
            let other = on_coarse_lattice(&points(&centres), radius, 0.1 * radius);
            if other.topology_exact {
                assert_eq!(topology(&made), topology(&other), "{round}");
                compared += 1;
            }
        }
        assert!(told >= 10 && compared >= 2, "{told} told, {compared} compared");
    }

    /// Sierpinski's triangle leaves the triangles open whose inscribed circle is wider than the ball: a side of 100 mm / 2^k has one of 100 mm / (2^k 2 sqrt 3).
    #[test]
    fn a_triangle_leaves_as_many_holes_as_circles_fit_in() {
        let shape = triangle();
        let inscribed = |k: i32| 100.0 / (2.0_f64.powi(k) * 12.0_f64.sqrt());
        for (radius, holes) in [(1.03 * inscribed(1), 0), (0.97 * inscribed(1), 1), (1.03 * inscribed(3), 4), (0.97 * inscribed(3), 13)] {
            let made = arranged_unless_left(&shape, radius, 0.1 * radius).unwrap_or_else(|| panic!("{radius}"));
            assert!(made.topology_exact, "{radius}");
            assert_eq!(topology(&made), (1, 0, 2 - 2 * holes), "{radius}");
        }
        // Nothing is told where a hole opens just there.
        assert!(arranged_unless_left(&shape, inscribed(3), 0.1).is_none_or(|made| !made.topology_exact));
    }

    #[test]
    fn what_lies_in_a_plane_does_not_depend_on_threads_and_keeps_limits() {
        let shape = triangle();
        assert!(is_flat(&shape, 4.0, 0.4));
        assert_steady(&shape, 4.0, 0.4);
        assert_limited(&shape, 4.0, 0.4);
    }

    /// The attractor of one map, and of two that are the same, is a point.
    #[test]
    fn a_point_is_a_ball() {
        for count in [1, 2] {
            let shape = copies(&vec![(0.5, 1.0, [3.0, 4.0]); count], 2, 0.0);
            let made = dilate(&shape, Radius::new(2.0).unwrap(), Tolerance::new(0.1).unwrap(), &Budget::default()).unwrap();
            assert_eq!(topology(&made), (1, 0, 2));
        }
    }

    #[test]
    fn what_leaves_its_plane_is_left_to_the_lattice() {
        let map = |to: [f64; 3]| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(0.5)), translation: DVec3::from_array(to) };
        assert!(!is_flat(&system(vec![map([0.0; 3]), map([50.0, 0.0, 0.0]), map([20.0, 40.0, 0.5])]), 4.0, 0.4));
        assert!(is_flat(&system(vec![map([0.0; 3]), map([50.0, 0.0, 0.0]), map([20.0, 40.0, 0.0])]), 4.0, 0.4));
    }
}

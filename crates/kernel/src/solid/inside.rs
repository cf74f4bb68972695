//! How often a closed mesh winds around a point, exactly.

use super::TriMesh;
use super::box_tree::{Box32, BoxTree};
use crate::measure::triangle::closest_on_triangle;
use glam::DVec3;
use rayon::prelude::*;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// The least sine of a triangle's angle at its first corner by which its plane tells whether it meets a box: with any direction n, a corner a and a place y of the triangle in the box, |n . a| is no more than n . y reaches in
/// the box and |n . (a - y)|, which is small where n is the plane's normal up to rounding.
const LEAST_SINE: f64 = 1e-4;
/// Rounding of places, as a share of their distance from the box's middle.
const NOISE: f64 = 1e-10;

/// A closed mesh that tells which points it encloses.
#[derive(Debug)]
pub struct Inside<'a> {
    mesh: &'a TriMesh,
    tree: BoxTree,
}

impl<'a> Inside<'a> {
    /// Prepares a mesh. Cost: n log n.
    #[must_use]
    pub fn new(mesh: &'a TriMesh) -> Self {
        let mut tree = BoxTree::default();
        tree.build(mesh.triangles.len(), |triangle| Some(Box32::of(&mesh.points_of(triangle))), true);
        Self { mesh, tree }
    }

    /// The winding number of the surface around x: 1 inside a solid, 0 outside, and more where solids overlap. Meaningless on the surface itself. Exact: the
    /// sum over all triangles above x of how often their projections to the plane z = 0 wind around that of x, where an edge is crossed by a ray along +x of that
    /// plane if y of the ray is at least that of its lower end and less than that of its upper end, so that neighbours never count a ray twice. Cost: that of
    /// the triangles whose boxes are above x.
    #[must_use]
    pub fn winding(&self, x: DVec3) -> i64 {
        self.winding_of(x, |_| true)
    }

    /// How far a point is from what the surface encloses: 0 inside, else the distance of the nearest triangle, up to a few roundings of the coordinates. Cost: log n or so.
    #[must_use]
    pub fn distance(&self, x: DVec3) -> f64 {
        if self.mesh.triangles.is_empty() || self.winding(x) > 0 { 0.0 } else { self.surface_distance(x) }
    }

    /// How far a point is from the surface, up to a few roundings of the coordinates; infinitely far from none. Cost: log n or so.
    pub(crate) fn surface_distance(&self, x: DVec3) -> f64 {
        let mut nearest = f64::INFINITY;
        let entry = |around: &Box32| {
            let [low, high] = [around.low, around.high].map(|end| end.as_dvec3());
            // The box of nothing is nowhere.
            (low.x <= high.x).then(|| x.distance(x.clamp(low, high)))
        };
        self.tree.nearest(f64::INFINITY, entry, |leaf| {
            for &triangle in self.tree.items(leaf) {
                let [a, b, c] = self.mesh.points_of(triangle);
                nearest = nearest.min(x.distance(closest_on_triangle(&x.to_array(), &a, &b, &c).into()));
            }
            nearest
        });
        nearest
    }

    /// The largest distance of some points, as [`Inside::distance`] tells them.
    #[must_use]
    pub fn farthest(&self, points: &[DVec3]) -> f64 {
        points.par_iter().map(|&point| self.distance(point)).reduce(|| 0.0, f64::max)
    }

    /// How the surface lies across a box along orthonormal axes: the sum of the lengths that unit normals have along these, over all triangles that may meet the box; none where the box is free of the surface. Cost: that
    /// of the triangles whose boxes meet the one around it.
    pub(crate) fn across(&self, axes: &[DVec3; 3], low: DVec3, high: DVec3) -> Option<DVec3> {
        let along = |x: DVec3| DVec3::from_array(axes.map(|axis| axis.dot(x)));
        let at = |x: DVec3| axes[0] * x.x + axes[1] * x.y + axes[2] * x.z;
        let (centre, half) = (0.5 * (low + high), 0.5 * (high - low));
        let reach = axes[0].abs() * half.x + axes[1].abs() * half.y + axes[2].abs() * half.z;
        let around = Box32::of(&[at(centre) - reach, at(centre) + reach].map(|corner| corner.to_array()));
        let mut across = None;
        self.tree.query(&around, 0, |leaf| {
            for (&triangle, _) in self.tree.items(leaf).iter().zip(self.tree.boxes(leaf)).filter(|(_, bounds)| bounds.meets(&around)) {
                let corners = self.mesh.triangles[triangle as usize].map(|corner| along(self.mesh.vertices[corner as usize]) - centre);
                let [a, b, c] = corners;
                let noise = NOISE * (centre.abs() + a.abs()).max_element();
                let is_beside = (a.min(b).min(c) - noise).cmpgt(half).any() || (a.max(b).max(c) + noise).cmplt(-half).any();
                let (ab, ac) = (b - a, c - a);
                let normal = ab.cross(ac);
                // Needles have no normal to rely on.
                let is_needle = normal.length() <= LEAST_SINE * ab.length() * ac.length();
                let normal = normal.normalize_or_zero();
                if !is_beside && (is_needle || normal.dot(a).abs() <= normal.abs().dot(half) + noise) {
                    *across.get_or_insert(DVec3::ZERO) += normal.abs();
                }
            }
            true
        });
        across
    }

    /// That of the triangles that are counted.
    pub(super) fn winding_of(&self, x: DVec3, is_counted: impl Fn(u32) -> bool) -> i64 {
        if self.mesh.triangles.is_empty() {
            return 0;
        }
        let point = Box32::of(&[x.to_array()]);
        let above = Box32 { low: point.low, high: point.high.with_z(f32::INFINITY) };
        let mut winding = 0;
        self.tree.query(&above, 0, |leaf| {
            for (&triangle, bounds) in self.tree.items(leaf).iter().zip(self.tree.boxes(leaf)) {
                if bounds.meets(&above) && is_counted(triangle) {
                    winding += around(&self.mesh.triangles[triangle as usize].map(|corner| self.mesh.vertices[corner as usize]), x);
                }
            }
            true
        });
        winding
    }
}

/// How often the projection of a triangle winds around that of x, if the triangle is above.
fn around(corners: &[DVec3; 3], x: DVec3) -> i64 {
    let flat = |p: DVec3| Coord { x: p.x, y: p.y };
    let mut turns = 0;
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let (rises, falls) = (a.y <= x.y && x.y < b.y, b.y <= x.y && x.y < a.y);
        // Whether x is left of the edge as it rises, so that a ray along +x meets it.
        if rises && orient2d(flat(a), flat(b), flat(x)) > 0.0 {
            turns += 1;
        } else if falls && orient2d(flat(b), flat(a), flat(x)) > 0.0 {
            turns -= 1;
        }
    }
    if turns == 0 {
        return 0;
    }
    let space = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    // Positive where x is on the side from which the corners run clockwise: below, if they wind counter-clockwise seen from above.
    let side = orient3d(space(corners[0]), space(corners[1]), space(corners[2]), space(x));
    if side * turns as f64 > 0.0 { turns } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_about_a_tetrahedron() {
        let vertices = vec![DVec3::ZERO, 3.0 * DVec3::X, 3.0 * DVec3::Y, 3.0 * DVec3::Z];
        let mesh = TriMesh { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] };
        let inside = Inside::new(&mesh);
        let windings = [5.0, 1.5, 1.0 + f64::EPSILON, 1.0 - f64::EPSILON, 0.9, f64::MIN_POSITIVE].map(|x| inside.winding(DVec3::splat(x)));
        assert_eq!(windings, [0, 0, 0, 1, 1, 1]);
        // Inside, at a corner, beyond a face, beyond the slope x + y + z = 3.
        let distances = [DVec3::splat(0.5), DVec3::X * 3.0, DVec3::new(1.0, 1.0, -2.0), DVec3::splat(2.0)].map(|x| inside.distance(x));
        for (found, exact) in distances.into_iter().zip([0.0, 0.0, 2.0, 3.0_f64.sqrt()]) {
            assert!((found - exact).abs() < 1e-12, "{distances:?}");
        }
    }
}

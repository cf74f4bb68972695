//! On which side of a triangle the material lies, exactly: where a line that leaves the triangle passes through the rest of the surface an odd number of times.

use super::super::TriMesh;
use super::super::box_tree::{Box32, BoxTree};
use super::super::contact::turn;
use crate::attractor::cell::Point;
use num_bigint::BigInt;
use num_rational::Ratio;

/// A closed surface of any orientation that does not cross itself.
pub(super) struct Facing<'a> {
    mesh: &'a TriMesh,
    tree: BoxTree,
}

impl<'a> Facing<'a> {
    /// Prepares a mesh. Cost: n log n.
    pub(super) fn new(mesh: &'a TriMesh) -> Self {
        let mut tree = BoxTree::default();
        tree.build(mesh.triangles.len(), |triangle| Some(Box32::of(&mesh.points_of(triangle))), true);
        Self { mesh, tree }
    }

    /// Whether a triangle looks outward, with the material behind it. Every other triangle across a line along an axis through it is before or behind it, exactly;
    /// neighbours never count a line twice, as an edge belongs to those points of the projection whose ray it meets from its lower end up to below its upper one.
    /// `None` where double precision knows no point within the triangle's projection. Cost: that of the triangles whose boxes the line meets.
    pub(super) fn looks_outward(&self, triangle: u32) -> Option<bool> {
        let own = self.mesh.points_of(triangle);
        let turned = |axis: usize, x: &Point| {
            (0..3)
                .map(|k| turn(axis, &own[k], &own[(k + 1) % 3], x))
                .fold([true; 2], |[left, right], side| [left && side > 0.0, right && side < 0.0])
        };
        let middle: Point = std::array::from_fn(|axis| own.iter().map(|corner| corner[axis] / 3.0).sum());
        let (axis, faces_along) = (0..3).find_map(|axis| match turned(axis, &middle) {
            [true, _] => Some((axis, true)),
            [_, true] => Some((axis, false)),
            _ => None,
        })?;
        let mut line = Box32::of(&[middle]);
        (line.low[axis], line.high[axis]) = (Box32::of(&own).low[axis], f32::INFINITY);
        let mut before = 0_u64;
        self.tree.query(&line, 0, |leaf| {
            for (&other, bounds) in self.tree.items(leaf).iter().zip(self.tree.boxes(leaf)) {
                if other != triangle && bounds.meets(&line) {
                    let others = self.mesh.points_of(other);
                    before += u64::from(is_crossed(axis, &others, &middle) && is_farther(axis, &others, &own, &middle));
                }
            }
            true
        });
        Some(before.is_multiple_of(2) == faces_along)
    }
}

/// Whether the line along an axis through x crosses a triangle: whether a ray in the projection crosses its edges an odd number of times.
fn is_crossed(axis: usize, triangle: &[Point; 3], x: &Point) -> bool {
    let v = (axis + 2) % 3;
    let crosses = |k: usize| {
        let (a, b) = (&triangle[k], &triangle[(k + 1) % 3]);
        let (rises, falls) = (a[v] <= x[v] && x[v] < b[v], b[v] <= x[v] && x[v] < a[v]);
        (rises && turn(axis, a, b, x) > 0.0) || (falls && turn(axis, b, a, x) > 0.0)
    };
    (0..3).filter(|&k| crosses(k)).count() == 1
}

/// Whether the line along an axis through x meets one triangle farther along the axis than another.
fn is_farther(axis: usize, one: &[Point; 3], other: &[Point; 3], x: &Point) -> bool {
    let least = |triangle: &[Point; 3]| triangle.iter().map(|corner| corner[axis]).fold(f64::INFINITY, f64::min);
    let most = |triangle: &[Point; 3]| triangle.iter().map(|corner| corner[axis]).fold(f64::NEG_INFINITY, f64::max);
    if least(one) > most(other) || most(one) < least(other) {
        return least(one) > most(other);
    }
    height(axis, one, x) > height(axis, other, x)
}

/// Where the line along an axis through x meets the plane of a triangle; `None` for a plane along the axis.
fn height(axis: usize, triangle: &[Point; 3], x: &Point) -> Option<Ratio<BigInt>> {
    let exact = |value: f64| Ratio::from_float(value).unwrap_or_default();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let from = |point: &Point, k: usize| exact(point[k]) - exact(triangle[0][k]);
    let [p, q] = [&triangle[1], &triangle[2]].map(|corner| [u, v, axis].map(|k| from(corner, k)));
    let normal = [&p[1] * &q[2] - &p[2] * &q[1], &p[2] * &q[0] - &p[0] * &q[2], &p[0] * &q[1] - &p[1] * &q[0]];
    let rise = &normal[0] * from(x, u) + &normal[1] * from(x, v);
    (normal[2] != Ratio::default()).then(|| exact(triangle[0][axis]) - rise / &normal[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn sheets_closer_than_rounding() {
        // Two tetrahedra on one base, whose apexes differ by the least that doubles tell, along every axis.
        let (low, high) = (1.0, 1.0 + f64::EPSILON);
        for axis in 0..3 {
            let place = |p: [f64; 3]| DVec3::from_array(std::array::from_fn(|k| p[(k + 3 - axis) % 3]));
            let vertices = [[3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 0.0], [0.7, 0.7, low], [0.7, 0.7, high]].map(place).to_vec();
            let mesh = TriMesh { vertices, triangles: vec![[0, 1, 4], [1, 2, 4], [2, 0, 4], [1, 0, 3], [2, 1, 3], [0, 2, 3]] };
            let facing = Facing::new(&mesh);
            assert_eq!([0, 1, 2, 3, 4, 5].map(|triangle| facing.looks_outward(triangle)), [Some(true); 6], "axis {axis}");
        }
    }
}

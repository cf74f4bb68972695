//! Volume, area and moments of meshes, each within an interval that is proven, and what they say of the exact shape.
//!
//! Terms of a mesh far from itself, or of a thin one, are larger than their sum by many orders. So they are summed with twice the precision
//! (`double`), and what rounding can be at most follows from the sizes of the terms.

use super::double::{Double, Vector};
use crate::attractor::Attractor;
use crate::automaton::LeafPrimitive;
use crate::measure::Interval;
use crate::solid::TriMesh;
use glam::DVec3;
use rayon::prelude::*;

/// Triangles summed together: sums of one chunk are added in order, so results do not depend on threads.
const CHUNK: usize = 1 << 15;

/// A sum, and what it may be off.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    value: Double,
    /// The sum of the sizes of the terms.
    size: f64,
}

/// What a sum may be off, relative to the sizes of its terms: each is worked out in fewer than 60 operations that lose 7 u^2 of its size at most, and every step of at
/// most 2^15 in a chunk, and as many chunks as memory holds, fewer than 2^17, loses 3 u^2 of what was summed. 420 + 3 (2^15 + 2^17) < 2^19, u^2 = 2^-106; twice that is for the rounding of sizes.
const LOST: f64 = 1.0 / (1_u128 << 86) as f64;
/// What underflow takes at most, in mm to whatever power.
const TINY: f64 = 1e-250;

impl Sum {
    fn add(&mut self, term: Double, size: f64) {
        self.value = self.value + term;
        self.size += size;
    }

    fn joined(self, other: Self) -> Self {
        Self { value: self.value + other.value, size: self.size + other.size }
    }

    /// What it may be off.
    fn error(&self) -> f64 {
        LOST * self.size + TINY
    }

    /// `share` of it.
    fn scaled(self, share: Double) -> Self {
        Self { value: self.value * share, size: self.size * share.nearest().abs() }
    }

    /// Where the exact sum is.
    fn within(&self) -> Interval {
        around(self.value.nearest(), self.error())
    }
}

/// Where a number is that was rounded to the nearest one of double precision, and may be off by an error besides.
fn around(value: f64, error: f64) -> Interval {
    let off = (f64::EPSILON * value.abs() + error) * (1.0 + 4.0 * f64::EPSILON);
    Interval { low: value - off, high: value + off }
}

/// Sums over triangles.
fn sums<const N: usize>(vertices: &[DVec3], triangles: &[[u32; 3]], add: impl Fn([DVec3; 3], &mut [Sum; N]) + Sync) -> [Sum; N] {
    let chunk = |triangles: &[[u32; 3]]| {
        let mut sums = [Sum::default(); N];
        triangles.iter().for_each(|corners| add(corners.map(|index| vertices[index as usize]), &mut sums));
        sums
    };
    let parts: Vec<[Sum; N]> = triangles.par_chunks(CHUNK).map(chunk).collect();
    parts.into_iter().fold([Sum::default(); N], |all, part| std::array::from_fn(|index| all[index].joined(part[index])))
}

/// det(a, b, c) for the corners of a triangle seen from an origin, as a . ((b - a) x (c - a)), which is a sum of smaller terms; and their size.
fn determinant([a, b, c]: [DVec3; 3], origin: DVec3) -> (Double, f64) {
    let (from, p, q) = (Vector::between(origin, a), Vector::between(a, b), Vector::between(a, c));
    (from.dot(&p.cross(&q)), 2.0 * from.length * p.length * q.length)
}

/// Six times the volume.
fn six_volumes(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Sum {
    let Some(&origin) = vertices.first() else { return Sum::default() };
    let [sum] = sums(vertices, triangles, |corners, [sum]| {
        let (six, size) = determinant(corners, origin);
        sum.add(six, size);
    });
    sum
}

/// Signed volume that a closed mesh encloses, in mm^3, to the last digit or so: sum of det(a, b, c) / 6, from the first vertex as the origin.
#[must_use]
pub fn volume(mesh: &TriMesh) -> f64 {
    six_volumes(&mesh.vertices, &mesh.triangles).value.nearest() / 6.0
}

/// Signed volume that a closed mesh encloses, in mm^3. Cost: linear.
#[must_use]
pub fn volume_within(mesh: &TriMesh) -> Interval {
    enclosed_by(&mesh.vertices, &mesh.triangles)
}

/// The same of triangles with these vertices.
pub(crate) fn enclosed_by(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Interval {
    six_volumes(vertices, triangles).scaled(one_of(6.0)).within()
}

/// 1 / n.
fn one_of(n: f64) -> Double {
    Double::from(1.0) / Double::from(n)
}

/// Twice the area.
fn two_areas(mesh: &TriMesh) -> Sum {
    let [sum] = sums(&mesh.vertices, &mesh.triangles, |[a, b, c], [sum]| {
        let (p, q) = (Vector::between(a, b), Vector::between(a, c));
        // Its length loses as much of itself as `area_within` allows for, and of p and q what the sum does.
        let length = DVec3::from_array(p.cross(&q).map(Double::nearest)).length();
        sum.add(Double::from(length), 4.0 * p.length * q.length);
    });
    sum
}

/// Area of a mesh, in mm^2, to the last digits.
#[must_use]
pub fn area(mesh: &TriMesh) -> f64 {
    0.5 * two_areas(mesh).value.nearest()
}

/// Area of a mesh, in mm^2. Cost: linear.
#[must_use]
pub fn area_within(mesh: &TriMesh) -> Interval {
    let two = two_areas(mesh);
    // Three squares, their sum and its root, from parts that were rounded: 4 u of each length.
    let Interval { low, high } = around(0.5 * two.value.nearest(), 0.5 * two.error() + 4.0 * f64::EPSILON * two.value.nearest());
    Interval { low: low.max(0.0), high }
}

/// Relative rounding of the formulas below.
const ROUNDING: f64 = 1e-14;

/// Volume of D_r, from the volume of a mesh M with D(r - inner) in M in D(r + outer).
///
/// V(s) / s^3 does not increase with s (Kneser, "Ueber den Rand von Parallelkoerpern", Math. Nachr. 5,
/// 1951: a union of balls loses volume when its centres contract), so V(r) <= (r / (r - inner))^3 V(r - inner)
/// <= (r / (r - inner))^3 V(M), and V(r) >= (r / (r + outer))^3 V(M). Where radii differ, r is the least: the dilation whose radii are all t times those of D_r is
/// t times a union of the same balls with their centres contracted by t, which continuously moving together loses volume (B. Csikos, "On the volume of the union
/// of balls", Discrete Comput. Geom. 20, 1998), so V(t) / t^3 does not increase; and that with t = 1 - inner / r lies in M.
#[must_use]
pub fn dilated_volume(mesh_volume: Interval, radius: f64, inner: f64, outer: f64) -> Interval {
    let low = mesh_volume.low.max(0.0) * (radius / (radius + outer)).powi(3) * (1.0 - ROUNDING);
    let high = if inner < radius { mesh_volume.high * (radius / (radius - inner)).powi(3) * (1.0 + ROUNDING) } else { f64::INFINITY };
    Interval { low, high }
}

/// Area of the boundary of D_r, from an interval of its volume.
///
/// S(s) / s^2 does not increase (Kneser again, S = V'; where radii differ, V' = the integral of the radii over the boundary is at most 3 V and at least r S), so V(r) >= integral of S(r) (s / r)^2 = S(r) r / 3; and no
/// set of volume V has less area than the ball ([`isoperimetric`]).
#[must_use]
pub fn dilated_area(volume: Interval, radius: f64) -> Interval {
    Interval { low: isoperimetric(volume.low), high: 3.0 * volume.high / radius * (1.0 + ROUNDING) }
}

/// The least area of the boundary of a set with this volume or a larger one: that of a ball.
#[must_use]
pub fn isoperimetric(volume: f64) -> f64 {
    (36.0 * std::f64::consts::PI * volume * volume).cbrt() * (1.0 - ROUNDING)
}

/// The volume between D_r and a mesh M with D(r - inner) in M in D(r + outer) is at most this, in mm^3; infinite when inner reaches r.
///
/// Both lie between D(r - inner) and D(r + outer), and V(r + outer) <= ((r + outer) / (r - inner))^3 V(r - inner), see [`dilated_volume`], with
/// V(r - inner) <= V(M).
#[must_use]
pub fn dilated_difference(mesh_volume: Interval, radius: f64, inner: f64, outer: f64) -> f64 {
    if inner >= radius {
        return f64::INFINITY;
    }
    // (1 + x)^3 - 1 without the digits that cancel.
    let x = (inner + outer) / (radius - inner);
    x * (3.0 + x * (3.0 + x)) * mesh_volume.high * (1.0 + ROUNDING)
}

/// Volume, centroid and inertia of a body of density 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// In mm^3.
    pub volume: Interval,
    /// In mm.
    pub centroid: [Interval; 3],
    /// The inertia tensor about the centroid: integral of |x|^2 1 - x x^T, row by row, in mm^5.
    pub inertia: [[Interval; 3]; 3],
}

/// Of what a closed mesh encloses: sums over the tetrahedra of its triangles with its first vertex as the origin. For a tetrahedron with corners 0, a, b, c, of volume v:
/// integral of x = v (a + b + c) / 4, and of x x^T = v (a a^T + b b^T + c c^T + s s^T) / 20 with s = a + b + c. `None` when the volume is not proven to be above 0. Cost: linear.
#[must_use]
pub fn mass_properties(mesh: &TriMesh) -> Option<MassProperties> {
    let &origin = mesh.vertices.first()?;
    let moments: [Sum; 10] = sums(&mesh.vertices, &mesh.triangles, |corners, sums| {
        let (six, size) = determinant(corners, origin);
        let [a, b, c] = corners.map(|corner| Vector::between(origin, corner));
        let s: [Double; 3] = std::array::from_fn(|axis| a.at[axis] + b.at[axis] + c.at[axis]);
        let reach = a.length + b.length + c.length;
        sums[0].add(six, size);
        for (sum, s) in sums[1..4].iter_mut().zip(s) {
            sum.add(six * s, size * reach);
        }
        for (sum, [i, j]) in sums[4..].iter_mut().zip(PAIRS) {
            let products = a.at[i] * a.at[j] + b.at[i] * b.at[j] + c.at[i] * c.at[j] + s[i] * s[j];
            sum.add(six * products, 2.0 * size * reach * reach);
        }
    });
    let [volume, first @ .., _, _, _, _, _, _] = moments;
    let volume = volume.scaled(one_of(6.0));
    let (least, lost) = (volume.value.nearest() - 2.0 * volume.error(), volume.error());
    if least.is_nan() || least <= 0.0 {
        return None;
    }
    // The offset of the centroid from the origin, and what each of its coordinates may be off: |m / v - m' / v'| <= (|m - m'| + |m'| |v - v'| / v') / v.
    let offset = first.map(|sum| {
        let sum = sum.scaled(one_of(24.0));
        let at = sum.value / volume.value;
        (at, (sum.error() + at.nearest().abs() * lost) / least * (1.0 + ROUNDING) + 1e-30 * at.nearest().abs())
    });
    let central = |index: usize| {
        let [i, j] = PAIRS[index];
        let sum = moments[4 + index].scaled(one_of(120.0));
        let ((x, off_x), (y, off_y)) = (offset[i], offset[j]);
        let (reach_x, reach_y) = (x.nearest().abs() + off_x, y.nearest().abs() + off_y);
        let about_origin = volume.value * x * y;
        // v x y with all that each of the three may be off.
        let most = volume.value.nearest() + 2.0 * lost;
        let off = lost * reach_x * reach_y + most * (off_x * reach_y + reach_x * off_y);
        (sum.value - about_origin, (sum.error() + off) * (1.0 + ROUNDING) + 1e-30 * most * reach_x * reach_y)
    };
    let second: [(Double, f64); 6] = std::array::from_fn(central);
    let plus = |index: usize, other: usize| {
        let ((a, off_a), (b, off_b)) = (second[index], second[other]);
        around((a + b).nearest(), off_a + off_b)
    };
    let minus = |index: usize| around(-second[index].0.nearest(), second[index].1);
    // Diagonal entries are the sums of the other two squares.
    let [xx, yy, zz, xy, xz, yz] = [plus(1, 2), plus(0, 2), plus(0, 1), minus(3), minus(4), minus(5)];
    Some(MassProperties {
        volume: volume.within(),
        centroid: std::array::from_fn(|axis| {
            let (at, off) = offset[axis];
            around((Double::from(origin[axis]) + at).nearest(), off)
        }),
        inertia: [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]],
    })
}

/// The second moments, in the order in which they are summed.
const PAIRS: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]];

/// Volume and area of a shape that is one mesh of triangles: of the solid and its surface when the mesh
/// stands for a solid, else no volume and the sheet's area (one side). `None` for other shapes.
#[must_use]
pub fn mesh_measures(attractor: &Attractor) -> Option<(Interval, Interval)> {
    let (mesh, is_solid) = mesh_of(attractor)?;
    let enclosed = if is_solid { volume_within(&mesh) } else { Interval { low: 0.0, high: 0.0 } };
    Some((enclosed, area_within(&mesh)))
}

/// The triangles of a shape that is one mesh of them, unjoined, and whether it stands for the solid that it bounds.
#[must_use]
pub fn mesh_of(attractor: &Attractor) -> Option<(TriMesh, bool)> {
    let roots = attractor.roots();
    let triangle = |state| {
        matches!(attractor.automaton().state(state).leaf, LeafPrimitive::Simplex) && attractor.automaton().state(state).dimension == 3
    };
    let solid = roots.first()?.solid;
    if roots.iter().any(|root| !triangle(root.state) || root.rational || root.solid != solid) || attractor.solids().len() > 1 {
        return None;
    }
    let mut mesh = TriMesh::default();
    for root in roots {
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(root.points.iter().map(|point| DVec3::new(point[0], point[1], point[2])));
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    Some((mesh, solid.is_some()))
}

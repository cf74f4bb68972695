//! Volume and area of meshes, and what they say of the exact shape.

use crate::attractor::Attractor;
use crate::automaton::LeafPrimitive;
use crate::measure::Interval;
use crate::solid::TriMesh;
use glam::DVec3;
use rayon::prelude::*;

/// Triangles summed together: sums of one chunk are added in order, so results do not depend on threads.
const CHUNK: usize = 1 << 15;

fn sum(mesh: &TriMesh, term: impl Fn(DVec3, DVec3, DVec3) -> f64 + Sync) -> f64 {
    let corner = |index: u32| mesh.vertices[index as usize];
    let chunk = |triangles: &[[u32; 3]]| triangles.iter().map(|&[a, b, c]| term(corner(a), corner(b), corner(c))).sum::<f64>();
    let parts: Vec<f64> = mesh.triangles.par_chunks(CHUNK).map(chunk).collect();
    parts.iter().sum()
}

/// Signed volume that a closed mesh encloses, in mm^3: sum of det(a, b, c) / 6, from the first vertex as
/// the origin to keep digits far from zero.
#[must_use]
pub fn volume(mesh: &TriMesh) -> f64 {
    let Some(&origin) = mesh.vertices.first() else { return 0.0 };
    sum(mesh, |a, b, c| (a - origin).dot((b - origin).cross(c - origin))) / 6.0
}

/// Area of a mesh, in mm^2.
#[must_use]
pub fn area(mesh: &TriMesh) -> f64 {
    0.5 * sum(mesh, |a, b, c| (b - a).cross(c - a).length())
}

/// Relative rounding of a sum over any mesh that fits in memory.
const ROUNDING: f64 = 1e-10;

/// Volume of D_r, from the volume of a mesh M with D(r - inner) in M in D(r + outer).
///
/// V(s) / s^3 does not increase with s (Kneser, "Ueber den Rand von Parallelkoerpern", Math. Nachr. 5,
/// 1951: a union of balls loses volume when its centres contract), so V(r) <= (r / (r - inner))^3 V(r - inner)
/// <= (r / (r - inner))^3 V(M), and V(r) >= (r / (r + outer))^3 V(M). Where radii differ, r is the least: the dilation whose radii are all t times those of D_r is
/// t times a union of the same balls with their centres contracted by t, which continuously moving together loses volume (B. Csikos, "On the volume of the union
/// of balls", Discrete Comput. Geom. 20, 1998), so V(t) / t^3 does not increase; and that with t = 1 - inner / r lies in M.
#[must_use]
pub fn dilated_volume(mesh_volume: f64, radius: f64, inner: f64, outer: f64) -> Interval {
    let low = mesh_volume * (radius / (radius + outer)).powi(3) * (1.0 - ROUNDING);
    let high = if inner < radius { mesh_volume * (radius / (radius - inner)).powi(3) * (1.0 + ROUNDING) } else { f64::INFINITY };
    Interval { low, high }
}

/// Area of the boundary of D_r, from an interval of its volume.
///
/// S(s) / s^2 does not increase (Kneser again, S = V'; where radii differ, V' = the integral of the radii over the boundary is at most 3 V and at least r S), so V(r) >= integral of S(r) (s / r)^2 = S(r) r / 3; and no
/// set of volume V has less area than the ball: S >= (36 pi V^2)^(1/3).
#[must_use]
pub fn dilated_area(volume: Interval, radius: f64) -> Interval {
    let low = (36.0 * std::f64::consts::PI * volume.low * volume.low).cbrt() * (1.0 - ROUNDING);
    Interval { low, high: 3.0 * volume.high / radius * (1.0 + ROUNDING) }
}

/// The volume between D_r and a mesh M with D(r - inner) in M in D(r + outer) is at most this, in mm^3; infinite when inner reaches r.
///
/// Both lie between D(r - inner) and D(r + outer), and V(r + outer) <= ((r + outer) / (r - inner))^3 V(r - inner), see [`dilated_volume`], with
/// V(r - inner) <= V(M).
#[must_use]
pub fn dilated_difference(mesh_volume: f64, radius: f64, inner: f64, outer: f64) -> f64 {
    if inner >= radius {
        return f64::INFINITY;
    }
    (((radius + outer) / (radius - inner)).powi(3) - 1.0) * mesh_volume * (1.0 + ROUNDING)
}

/// Volume, centroid and inertia of a body of density 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// In mm^3.
    pub volume: f64,
    /// In mm.
    pub centroid: DVec3,
    /// The inertia tensor about the centroid: integral of |x|^2 1 - x x^T, row by row, in mm^5.
    pub inertia: [[f64; 3]; 3],
}

/// Of what a closed mesh encloses: sums over the tetrahedra of its triangles with its first vertex as the origin. For a tetrahedron with corners 0, a, b, c, of volume v:
/// integral of x = v (a + b + c) / 4, and of x x^T = v (a a^T + b b^T + c c^T + s s^T) / 20 with s = a + b + c. `None` without volume. Cost: linear.
#[must_use]
pub fn mass_properties(mesh: &TriMesh) -> Option<MassProperties> {
    let &origin = mesh.vertices.first()?;
    let det = |a: DVec3, b: DVec3, c: DVec3| a.dot(b.cross(c)) / 6.0;
    let first = |axis: usize| sum(mesh, |a, b, c| det(a - origin, b - origin, c - origin) * (a + b + c - 3.0 * origin)[axis]) / 4.0;
    let volume = volume(mesh);
    if volume <= 0.0 {
        return None;
    }
    let offset = DVec3::new(first(0), first(1), first(2)) / volume;
    let second = |i: usize, j: usize| {
        let about_origin = sum(mesh, |a, b, c| {
            let (a, b, c) = (a - origin, b - origin, c - origin);
            let s = a + b + c;
            det(a, b, c) * (a[i] * a[j] + b[i] * b[j] + c[i] * c[j] + s[i] * s[j])
        }) / 20.0;
        about_origin - volume * offset[i] * offset[j]
    };
    let squares = [second(0, 0), second(1, 1), second(2, 2)];
    let total: f64 = squares.iter().sum();
    let (xy, xz, yz) = (second(0, 1), second(0, 2), second(1, 2));
    let inertia = [[total - squares[0], -xy, -xz], [-xy, total - squares[1], -yz], [-xz, -yz, total - squares[2]]];
    Some(MassProperties { volume, centroid: origin + offset, inertia })
}

/// Volume and area of a shape that is one mesh of triangles: of the solid and its surface when the mesh
/// stands for a solid, else no volume and the sheet's area (one side). `None` for other shapes.
#[must_use]
pub fn mesh_measures(attractor: &Attractor) -> Option<(Interval, Interval)> {
    let (mesh, is_solid) = mesh_of(attractor)?;
    let around = |value: f64| Interval::new(value * (1.0 - ROUNDING), value * (1.0 + ROUNDING));
    // Terms may cancel: the rounding is that of their sizes.
    let origin = mesh.vertices.first().copied().unwrap_or_default();
    let size = sum(&mesh, |a, b, c| (a - origin).length() * (b - origin).length() * (c - origin).length());
    let rounding = 16.0 * f64::EPSILON * size;
    let enclosed = if is_solid {
        Interval { low: volume(&mesh) - rounding, high: volume(&mesh) + rounding }
    } else {
        Interval { low: 0.0, high: 0.0 }
    };
    Some((enclosed, around(area(&mesh))))
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

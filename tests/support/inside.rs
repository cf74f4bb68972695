//! Which points a mesh encloses.

use glam::DVec3;

/// Whether a point lies inside: the sum of the solid angles of the triangles is 4 pi there and 0 outside.
#[must_use]
pub fn contains(vertices: &[DVec3], triangles: &[[u32; 3]], p: DVec3) -> bool {
    let solid_angle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|corner| vertices[corner as usize] - p);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let scale = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(scale)
    };
    triangles.iter().map(solid_angle).sum::<f64>() > std::f64::consts::TAU
}

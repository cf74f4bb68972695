//! Brute force: shapes as lists of simplices whose error is known, distances and winding numbers by definition.

use glam::DVec3;
use lacuna_kernel::solid::TriMesh;

/// A generator of numbers that are the same everywhere.
pub struct Random(pub u64);

impl Random {
    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1_u32 << 31)
    }

    /// In [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// In the cube [-size, size]^3.
    pub fn point(&mut self, size: f64) -> DVec3 {
        DVec3::new(self.between(-size, size), self.between(-size, size), self.between(-size, size))
    }
}

/// A shape A, known as a union S of simplices (one, two or three corners).
pub struct Oracle {
    pub simplices: Vec<Vec<DVec3>>,
    /// Every point of A is this near to S.
    pub uncovered: f64,
    /// Every point of S is this near to A.
    pub astray: f64,
}

impl Oracle {
    /// The distance of x from S: that from A is at least this minus `uncovered`, at most this plus `astray`.
    pub fn distance(&self, x: DVec3) -> f64 {
        self.simplices.iter().map(|simplex| distance(x, simplex)).fold(f64::INFINITY, f64::min)
    }
}

fn to_segment(x: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let square = along.length_squared();
    let t = if square > 0.0 { ((x - a).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    x.distance(a + t * along)
}

/// The distance of x from a simplex: the foot on the plane if the triangle holds it, else the sides.
pub fn distance(x: DVec3, simplex: &[DVec3]) -> f64 {
    match *simplex {
        [a] => x.distance(a),
        [a, b] => to_segment(x, a, b),
        [a, b, c] => {
            let normal = (b - a).cross(c - a);
            let within = |p: DVec3, q: DVec3| (q - p).cross(x - p).dot(normal) >= 0.0;
            if normal.length_squared() > 0.0 && within(a, b) && within(b, c) && within(c, a) {
                return ((x - a).dot(normal) / normal.length()).abs();
            }
            to_segment(x, a, b).min(to_segment(x, b, c)).min(to_segment(x, c, a))
        }
        _ => f64::NAN,
    }
}

/// How often a closed mesh winds around x, by solid angles (Van Oosterom and Strackee).
pub fn winding(mesh: &TriMesh, x: DVec3) -> f64 {
    let angle = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|k| mesh.vertices[k as usize] - x);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(below)
    };
    mesh.triangles.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

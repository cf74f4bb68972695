//! Random sets with an exact distance: the brute-force truth that results are held against.

use glam::DVec3;

/// The generator splitmix64: the same numbers on every machine.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        // 53 bits: every value is a double.
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in the cube of a side about the origin.
    pub fn point(&mut self, side: f64) -> DVec3 {
        (DVec3::new(self.unit(), self.unit(), self.unit()) - 0.5) * side
    }
}

/// A set of points, segments and triangles: each piece has 1, 2 or 3 corners.
#[derive(Clone, Debug, Default)]
pub struct Pieces(pub Vec<Vec<DVec3>>);

impl Pieces {
    /// Random pieces with so many corners each, in a cube.
    #[must_use]
    pub fn random(seed: u64, count: usize, corners: usize, side: f64) -> Self {
        let mut random = Random(seed);
        Self((0..count).map(|_| (0..corners).map(|_| random.point(side)).collect()).collect())
    }

    /// The exact distance of a point to the set.
    #[must_use]
    pub fn distance(&self, p: DVec3) -> f64 {
        self.0.iter().map(|piece| distance_to(piece, p)).fold(f64::INFINITY, f64::min)
    }

    /// A random point of the set.
    pub fn sample(&self, random: &mut Random) -> DVec3 {
        let piece = &self.0[(random.unit() * self.0.len() as f64) as usize];
        let weights: Vec<f64> = piece.iter().map(|_| -(1.0 - random.unit()).ln()).collect();
        let total: f64 = weights.iter().sum();
        piece.iter().zip(&weights).map(|(p, w)| *p * (w / total)).sum()
    }

    /// The set under a map of points.
    #[must_use]
    pub fn map(&self, map: impl Fn(DVec3) -> DVec3) -> Self {
        Self(self.0.iter().map(|piece| piece.iter().map(|p| map(*p)).collect()).collect())
    }
}

fn distance_to(piece: &[DVec3], p: DVec3) -> f64 {
    match *piece {
        [a] => p.distance(a),
        [a, b] => to_segment(p, a, b),
        [a, b, c] => to_triangle(p, a, b, c),
        _ => panic!("a piece has 1, 2 or 3 corners"),
    }
}

fn to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let t = if along == DVec3::ZERO { 0.0 } else { ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0) };
    p.distance(a + along * t)
}

/// The plane's distance where the foot lies inside, else that of the nearest side.
fn to_triangle(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let normal = (b - a).cross(c - a);
    let inside = [(a, b), (b, c), (c, a)].iter().all(|&(from, to)| normal.cross(to - from).dot(p - from) >= 0.0);
    if inside && normal != DVec3::ZERO {
        (p - a).dot(normal.normalize()).abs()
    } else {
        to_segment(p, a, b).min(to_segment(p, b, c)).min(to_segment(p, c, a))
    }
}

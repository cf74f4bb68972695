//! A triangle mesh whose edges can be collapsed: half-edges 3 t + k of triangle t, from its corner k to the next.

use crate::attractor::cell::Point;

/// No half-edge, vertex or triangle.
pub(crate) const NONE: u32 = u32::MAX;

/// See the module's comment. Closed or with borders; edges have two triangles at most.
#[derive(Clone, Debug, Default)]
pub(crate) struct HalfEdges {
    pub(crate) points: Vec<Point>,
    /// Where a half-edge starts; `NONE` in triangles that are gone.
    corners: Vec<u32>,
    /// The other half, or `NONE` on a border.
    twins: Vec<u32>,
    /// A half-edge that starts at a vertex.
    leaving: Vec<u32>,
    /// Triangles left.
    pub(crate) alive: usize,
}

/// The next half-edge of the triangle.
#[inline]
pub(crate) fn next(half: u32) -> u32 {
    if half % 3 == 2 { half - 2 } else { half + 1 }
}

/// The one before.
#[inline]
pub(crate) fn previous(half: u32) -> u32 {
    if half.is_multiple_of(3) { half + 2 } else { half - 1 }
}

/// The triangles of a star of `count` that are kept when its vertex moves to ring m, or elsewhere.
pub(crate) fn kept(m: Option<usize>, count: usize) -> impl Iterator<Item = usize> {
    (0..count).filter(move |&k| m.is_none_or(|m| k != m && (k + 1) % count != m))
}

/// The closed fan of triangles around a vertex v: triangle k is (v, ring k, ring k + 1).
#[derive(Debug, Default)]
pub(crate) struct Star {
    /// From v to ring k.
    pub(crate) halves: Vec<u32>,
    pub(crate) ring: Vec<u32>,
}

impl HalfEdges {
    pub(crate) fn new(points: Vec<Point>, triangles: &[[u32; 3]]) -> Self {
        let corners: Vec<u32> = triangles.iter().flatten().copied().collect();
        let mut leaving = vec![NONE; points.len()];
        for (half, &corner) in corners.iter().enumerate() {
            leaving[corner as usize] = half as u32;
        }
        let mut result = Self { points, twins: vec![NONE; corners.len()], corners, leaving, alive: triangles.len() };
        result.pair();
        result
    }

    /// Finds the twins: half-edges are listed at their end of lower number, in the order of the other.
    fn pair(&mut self) {
        let mut starts = vec![0_u32; self.points.len() + 1];
        let ends_of = |half: u32, corners: &[u32]| {
            let [a, b] = [half, next(half)].map(|half| corners[half as usize]);
            [a.min(b), a.max(b)]
        };
        let halves = self.corners.len() as u32;
        for half in 0..halves {
            starts[ends_of(half, &self.corners)[0] as usize + 1] += 1;
        }
        for index in 1..starts.len() {
            starts[index] += starts[index - 1];
        }
        let mut ends = starts.clone();
        let mut listed = vec![0_u32; self.corners.len()];
        for half in 0..halves {
            let end = &mut ends[ends_of(half, &self.corners)[0] as usize];
            listed[*end as usize] = half;
            *end += 1;
        }
        for vertex in 0..self.points.len() {
            let own = &mut listed[starts[vertex] as usize..starts[vertex + 1] as usize];
            own.sort_unstable_by_key(|&half| (ends_of(half, &self.corners)[1], half));
            for edge in own.chunk_by(|&a, &b| ends_of(a, &self.corners)[1] == ends_of(b, &self.corners)[1]) {
                for (index, &half) in edge.iter().enumerate() {
                    // Each has one twin at most, where more than two triangles meet, too.
                    if self.twins[half as usize] != NONE {
                        continue;
                    }
                    let from = self.corners[half as usize];
                    let is_twin = |&&other: &&u32| self.twins[other as usize] == NONE && self.corners[other as usize] != from;
                    if let Some(&other) = edge[index + 1..].iter().find(is_twin) {
                        self.twins[half as usize] = other;
                        self.twins[other as usize] = half;
                    }
                }
            }
        }
    }

    /// Where a half-edge ends.
    #[inline]
    pub(crate) fn end(&self, half: u32) -> u32 {
        self.corners[next(half) as usize]
    }

    /// How many triangles there were.
    pub(crate) fn triangles(&self) -> u32 {
        (self.corners.len() / 3) as u32
    }

    /// The corners of a triangle, if it is still there.
    #[inline]
    pub(crate) fn triangle(&self, triangle: u32) -> Option<[u32; 3]> {
        let first = 3 * triangle as usize;
        let corners = [self.corners[first], self.corners[first + 1], self.corners[first + 2]];
        (corners[0] != NONE).then_some(corners)
    }

    /// Whether a vertex still has triangles.
    pub(crate) fn is_used(&self, vertex: u32) -> bool {
        self.leaving[vertex as usize] != NONE
    }

    /// Fills the star of a vertex; false on a border or with more than `most` triangles.
    #[inline]
    pub(crate) fn star(&self, vertex: u32, most: usize, star: &mut Star) -> bool {
        star.halves.clear();
        star.ring.clear();
        let start = self.leaving[vertex as usize];
        if start == NONE {
            return false;
        }
        let mut half = start;
        loop {
            star.halves.push(half);
            star.ring.push(self.end(half));
            half = self.twins[previous(half) as usize];
            if half == start {
                return true;
            }
            if half == NONE || star.ring.len() == most {
                return false;
            }
        }
    }

    /// The other half of an edge, or `NONE`.
    #[inline]
    pub(crate) fn twin(&self, half: u32) -> u32 {
        self.twins[half as usize]
    }

    /// Turns the edge between two triangles (a, b, c) and (b, a, d) into cd: the half-edge from a becomes that from d to c. Its twin must be there, and no
    /// edge cd.
    pub(crate) fn flip(&mut self, half: u32) {
        let twin = self.twins[half as usize];
        // Around the square: b c, c a, a d, d b.
        let (bc, ca, ad, db) = (next(half), previous(half), next(twin), previous(twin));
        let [a, b, c, d] = [half, twin, ca, db].map(|half| self.corners[half as usize]);
        let outer = [bc, ca, ad, db].map(|half| self.twins[half as usize]);
        // Triangle of `half`: (d, c, a); of `twin`: (c, d, b).
        let slots = [half, bc, ca, twin, ad, db];
        for (slot, corner) in slots.into_iter().zip([d, c, a, c, d, b]) {
            self.corners[slot as usize] = corner;
            self.leaving[corner as usize] = slot;
        }
        // (d c), (c a), (a d); (c d), (d b), (b c).
        for (slot, other) in [(bc, outer[1]), (ca, outer[2]), (ad, outer[3]), (db, outer[0])] {
            self.twins[slot as usize] = other;
            if other != NONE {
                self.twins[other as usize] = slot;
            }
        }
    }

    /// Removes a vertex by collapsing its edge to ring m into that neighbour.
    pub(crate) fn collapse(&mut self, vertex: u32, star: &Star, m: usize) {
        let count = star.ring.len();
        let (before, after) = ((m + count - 1) % count, (m + 1) % count);
        let target = star.ring[m];
        let (half, other) = (star.halves[m], star.halves[before]);
        let pairs = [(self.twins[next(half) as usize], star.halves[after]), (self.twins[next(other) as usize], self.twins[other as usize])];
        for (p, q) in pairs {
            if p != NONE {
                self.twins[p as usize] = q;
            }
            self.twins[q as usize] = p;
        }
        for &half in &star.halves {
            self.corners[half as usize] = target;
        }
        for dead in [half, other] {
            let first = (dead - dead % 3) as usize;
            self.corners[first..first + 3].fill(NONE);
        }
        self.leaving[target as usize] = star.halves[after];
        self.leaving[star.ring[before] as usize] = pairs[1].1;
        self.leaving[star.ring[after] as usize] = next(star.halves[after]);
        self.leaving[vertex as usize] = NONE;
        self.alive -= 2;
    }

    /// What is left: points, triangles, and the new number of every old point, or `NONE`.
    pub(crate) fn compact(&self) -> (Vec<Point>, Vec<[u32; 3]>, Vec<u32>) {
        let mut numbers = vec![NONE; self.points.len()];
        let mut points = Vec::new();
        for vertex in (0..self.points.len()).filter(|&vertex| self.is_used(vertex as u32)) {
            numbers[vertex] = points.len() as u32;
            points.push(self.points[vertex]);
        }
        let triangles = (0..self.triangles()).filter_map(|t| self.triangle(t)).map(|t| t.map(|corner| numbers[corner as usize]));
        let triangles = triangles.collect();
        (points, triangles, numbers)
    }
}

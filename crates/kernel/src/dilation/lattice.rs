//! The body-centred cubic lattice, graded: cubes that are subdivided where that is asked, and the tetrahedra between.
//!
//! A cube of level l has edge a / 2^l. Vertices are the corners and centres of leaves (cubes that are not subdivided). Between
//! two leaves of one size that share a face lie the tetrahedra of the body-centred lattice: both centres and an edge of the face, or half of it where the
//! edge's middle is a vertex. Between a leaf and a larger one lie, on either side, the two halves of the smaller
//! face, joined to the leaf's centre. Leaves that touch differ by one level at most, so that this fits together (Labelle and
//! Shewchuk, "Isosurface stuffing", 2007). The smallest ball around each of these tetrahedra has radius sqrt(5)/4 of the larger leaf's edge
//! at most.

use super::surface::NameHasher;
use crate::attractor::cell::Point;
use std::collections::HashSet;
use std::hash::BuildHasherDefault;

/// Radius of a tetrahedron's smallest enclosing ball, in units of the larger leaf's edge.
pub const ENCLOSING: f64 = 0.559_016_994_374_947_5;
/// Finest level.
pub const LEVELS: u32 = 6;
/// Units of coordinates along a cube of level 0: centres of the finest cubes are whole.
pub const UNITS: i64 = 1 << (LEVELS + 1);

/// Coordinates of a vertex in units of a / [`UNITS`]: what it is called in all blocks.
pub type Number = [i32; 3];

/// A cube: its level and its place in units of its edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Cube {
    /// l.
    pub level: u32,
    /// Its corner, in units of a / 2^l.
    pub index: [i64; 3],
}

impl Cube {
    /// Its edge in units.
    fn edge(self) -> i64 {
        UNITS >> self.level
    }

    /// Its corner, moved by an offset in units of its edge.
    pub(super) fn corner(self, offset: [i64; 3]) -> Number {
        std::array::from_fn(|axis| ((self.index[axis] + offset[axis]) * self.edge()) as i32)
    }

    pub(super) fn centre(self) -> Number {
        self.index.map(|x| (x * self.edge() + self.edge() / 2) as i32)
    }

    /// The cube of its size at an offset in units of its edge.
    pub(super) fn moved(self, offset: [i64; 3]) -> Self {
        Self { level: self.level, index: std::array::from_fn(|axis| self.index[axis] + offset[axis]) }
    }

    pub(super) fn parent(self) -> Option<Self> {
        (self.level > 0).then(|| Self { level: self.level - 1, index: self.index.map(|x| x >> 1) })
    }

    /// Its eight halves.
    pub fn children(self) -> impl Iterator<Item = Self> {
        (0..8).map(move |octant: i64| Self {
            level: self.level + 1,
            index: std::array::from_fn(|axis| 2 * self.index[axis] + (octant >> axis & 1)),
        })
    }

    /// The cube of a level that contains a point, given in units of the pitch.
    pub fn containing(level: u32, point: [f64; 3]) -> Self {
        let scale = f64::from(1_u32 << level);
        Self { level, index: point.map(|x| (x * scale).floor() as i64) }
    }

    /// The cube of level 0 that it lies in.
    pub fn base(self) -> [i64; 3] {
        self.index.map(|x| x >> self.level)
    }
}

/// A place and the 26 that touch it.
pub(super) fn around(at: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(move |code| std::array::from_fn(|axis| at[axis] + code / [1, 3, 9][axis] % 3 - 1))
}

/// See [`Grading::plain`].
#[derive(Clone, Debug, Default)]
pub(super) struct Plain {
    side: usize,
    /// Whether a cube is none of them; empty when all are.
    touched: Vec<bool>,
}

impl Plain {
    fn place(&self, local: [i64; 3]) -> usize {
        local.iter().rev().fold(0, |place, &x| place * self.side + x as usize)
    }

    /// Whether a cube is one of them, by its offset from the first.
    #[inline]
    pub(super) fn contains(&self, local: [i64; 3]) -> bool {
        self.side > 0 && (self.touched.is_empty() || !self.touched[self.place(local)])
    }
}

/// The cubes that are subdivided.
#[derive(Clone, Debug, Default)]
pub struct Grading {
    subdivided: HashSet<Cube, BuildHasherDefault<NameHasher>>,
}

impl Grading {
    /// Subdivides a cube, those it lies in, and as many around it as keep leaves that touch within one level of each other. The
    /// cubes that were subdivided are added to `new`.
    pub fn subdivide(&mut self, cube: Cube, new: &mut Vec<Cube>) {
        let mut open = vec![cube];
        while let Some(cube) = open.pop() {
            if cube.level >= LEVELS || !self.subdivided.insert(cube) {
                continue;
            }
            new.push(cube);
            open.extend(around(cube.index).filter_map(|index| Cube { index, ..cube }.parent()));
        }
    }

    /// Whether a cube is.
    #[inline]
    pub fn is_subdivided(&self, cube: Cube) -> bool {
        !self.subdivided.is_empty() && self.subdivided.contains(&cube)
    }

    /// The leaf that holds a place, given in units of the pitch, unless it is as small as may be.
    pub(super) fn leaf_at(&self, place: Point) -> Option<Cube> {
        (0..LEVELS).map(|level| Cube::containing(level, place)).find(|&cube| !self.is_subdivided(cube))
    }

    /// The cubes of level 0, `side` along each axis from `first` on, that are leaves and touch leaves of their size only.
    pub(super) fn plain(&self, first: [i64; 3], side: usize) -> Plain {
        let mut plain = Plain { side, touched: Vec::new() };
        if self.subdivided.is_empty() {
            return plain;
        }
        let grown = side as i64 + 2;
        for code in 0..grown.pow(3) {
            let local = [code % grown - 1, code / grown % grown - 1, code / grown / grown - 1];
            let index = std::array::from_fn(|axis| first[axis] + local[axis]);
            if self.subdivided.contains(&Cube { level: 0, index }) {
                plain.touched.resize(side.pow(3), false);
                for near in around(local).filter(|near| near.iter().all(|&x| 0 <= x && x < side as i64)) {
                    let place = plain.place(near);
                    plain.touched[place] = true;
                }
            }
        }
        plain
    }

    /// The leaves of a cube.
    pub fn leaves(&self, cube: Cube, leaves: &mut Vec<Cube>) {
        if self.is_subdivided(cube) {
            cube.children().for_each(|child| self.leaves(child, leaves));
        } else {
            leaves.push(cube);
        }
    }

    /// Calls `emit` with the vertices of every tetrahedron that belongs to a leaf: those towards the next leaf of its size
    /// along every axis, and its own side of faces between different sizes.
    pub fn tetrahedra(&self, leaf: Cube, emit: &mut impl FnMut([Number; 4])) {
        for axis in 0..3 {
            for side in [0, 1] {
                let mut across = [0; 3];
                across[axis] = 2 * side - 1;
                let other = leaf.moved(across);
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                // Offset of a point of the face in units of half an edge.
                let on_face = |du: i64, dv: i64| -> Number {
                    let mut at = [0; 3];
                    (at[axis], at[u], at[v]) = (2 * side, du, dv);
                    let half = leaf.edge() / 2;
                    std::array::from_fn(|k| (leaf.index[k] * leaf.edge() + at[k] * half) as i32)
                };
                if self.is_subdivided(other) {
                    for (du, dv) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                        // The diagonal joins the middle of the larger face with its corner.
                        let (inner, outer) = (on_face(1, 1), on_face(2 * du, 2 * dv));
                        for third in [on_face(2 * du, 1), on_face(1, 2 * dv)] {
                            emit([leaf.centre(), inner, outer, third]);
                        }
                    }
                } else if other.parent().is_some_and(|parent| !self.is_subdivided(parent)) {
                    // The larger face's middle is the corner whose coordinates are odd in units of this leaf.
                    let odd = |k: usize| 2 * (1 - (leaf.index[k] & 1));
                    let (du, dv) = (odd(u), odd(v));
                    for third in [on_face(2 - du, dv), on_face(du, 2 - dv)] {
                        emit([leaf.centre(), on_face(du, dv), on_face(2 - du, 2 - dv), third]);
                    }
                } else if side == 1 {
                    self.between(leaf, other, (axis, u, v), emit);
                }
            }
        }
    }

    /// The tetrahedra between two leaves of one size.
    fn between(&self, leaf: Cube, other: Cube, (axis, u, v): (usize, usize, usize), emit: &mut impl FnMut([Number; 4])) {
        for step in 0..4 {
            let corner = |step: usize| {
                let (du, dv) = [(0, 0), (1, 0), (1, 1), (0, 1)][step % 4];
                let mut offset = [0; 3];
                (offset[axis], offset[u], offset[v]) = (1, du, dv);
                leaf.corner(offset)
            };
            // The cubes on the other side of the edge.
            let mut beyond = [0; 3];
            (beyond[u], beyond[v]) = [(0, -1), (1, 0), (0, 1), (-1, 0)][step];
            let (p, q) = (corner(step), corner(step + 1));
            if self.is_subdivided(leaf.moved(beyond)) || self.is_subdivided(other.moved(beyond)) {
                let middle: Number = std::array::from_fn(|k| (p[k] + q[k]) / 2);
                emit([leaf.centre(), other.centre(), p, middle]);
                emit([leaf.centre(), other.centre(), middle, q]);
            } else {
                emit([leaf.centre(), other.centre(), p, q]);
            }
        }
    }
}

/// Position and pitch of the lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Corner vertex of cube (0, 0, 0), in mm.
    pub origin: Point,
    /// a, in mm.
    pub pitch: f64,
}

impl Lattice {
    /// Position of a corner of a cube of level 0.
    #[inline]
    #[must_use]
    pub fn corner(&self, index: [i64; 3]) -> Point {
        self.position(index.map(|x| (x * UNITS) as i32))
    }

    /// A place in units of the pitch.
    #[inline]
    pub(super) fn within(&self, place: &Point) -> Point {
        std::array::from_fn(|axis| (place[axis] - self.origin[axis]) / self.pitch)
    }

    /// Position of a vertex. A function of the number alone: every block computes the same bits.
    #[inline]
    #[must_use]
    pub fn position(&self, number: Number) -> Point {
        let unit = self.pitch / UNITS as f64;
        std::array::from_fn(|axis| self.origin[axis] + unit * f64::from(number[axis]))
    }
}

/// Whether det(v1 - v0, v2 - v0, v3 - v0) < 0.
#[must_use]
pub fn is_mirrored(numbers: &[Number; 4]) -> bool {
    let edge = |k: usize| -> [i64; 3] { std::array::from_fn(|axis| i64::from(numbers[k][axis]) - i64::from(numbers[0][axis])) };
    let (a, b, c) = (edge(1), edge(2), edge(3));
    let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
    a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2] < 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn volume(numbers: &[Number; 4]) -> i64 {
        let edge = |k: usize| -> [i64; 3] { std::array::from_fn(|axis| i64::from(numbers[k][axis] - numbers[0][axis])) };
        let (a, b, c) = (edge(1), edge(2), edge(3));
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    }

    /// A graded piece of lattice: faces match in pairs save on its border, and nothing overlaps or is left out.
    #[test]
    fn graded_tetrahedra_fit_together() {
        let mut grading = Grading::default();
        let mut new = Vec::new();
        for (level, index) in [(0, [3, 3, 3]), (1, [7, 6, 6]), (2, [14, 12, 13]), (0, [5, 4, 3]), (1, [10, 9, 7]), (3, [28, 25, 26])] {
            grading.subdivide(Cube { level, index }, &mut new);
        }
        assert!(new.len() > 6);
        let size = 9_i64;
        let (mut faces, mut total) = (HashMap::<[Number; 3], i32>::new(), 0_i64);
        let mut leaves = Vec::new();
        for code in 0..size.pow(3) {
            grading.leaves(Cube { level: 0, index: [code % size, code / size % size, code / size / size] }, &mut leaves);
        }
        for leaf in leaves {
            grading.tetrahedra(leaf, &mut |mut numbers| {
                numbers.sort_unstable();
                let signed = volume(&numbers);
                assert!(signed != 0 && (signed < 0) == is_mirrored(&numbers));
                total += signed.abs();
                for left_out in 0..4 {
                    let mut face: Vec<Number> = numbers.to_vec();
                    face.remove(left_out);
                    *faces.entry([face[0], face[1], face[2]]).or_default() += 1;
                }
            });
        }
        let inside = |number: &Number| number.iter().all(|&x| i64::from(x) > UNITS && i64::from(x) < (size - 1) * UNITS);
        for (face, count) in &faces {
            assert!(*count <= 2 && (*count == 2 || !face.iter().all(inside)), "{face:?} {count}");
        }
        // Every cube of the inside is covered once: 12 tetrahedra of a^3 / 12 to a cube, or their parts.
        let cubes = total as f64 / (6.0 * (UNITS as f64).powi(3));
        let border = (size as f64).powi(3) - (size as f64 - 1.0).powi(3);
        assert!((cubes - (size as f64).powi(3)).abs() < border, "{cubes}");
    }
}

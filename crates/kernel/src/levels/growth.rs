//! From the surface of one level to that of the next: copied by every map, and what occurs twice with opposite orientation is gone.

use super::LevelError;
use super::lattice::{Lattice, Point};
use crate::budget::{Budget, Stopped};
use crate::solid::TriMesh;
use rayon::prelude::*;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Polygons over lattice points: triangles, or strictly convex in a plane.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    pub(super) points: Vec<Point>,
    /// Corners of all polygons, one after the other.
    corners: Vec<u32>,
    /// Where each polygon's corners end.
    ends: Vec<u32>,
}

impl Surface {
    /// The primitive: faces that are strictly convex polygons in a plane stay whole, others are fanned from their first corner.
    pub(super) fn new(points: Vec<Point>, faces: &[Vec<u32>]) -> Self {
        let mut surface = Self { points, ..Self::default() };
        for face in faces {
            if surface.is_convex(face) {
                surface.push(face);
            } else {
                (2..face.len()).for_each(|k| surface.push(&[face[0], face[k - 1], face[k]]));
            }
        }
        surface
    }

    fn push(&mut self, corners: &[u32]) {
        self.corners.extend(corners);
        self.ends.push(self.corners.len() as u32);
    }

    /// Every three corners in a row turn to the side of the first three, and all lie in their plane.
    fn is_convex(&self, face: &[u32]) -> bool {
        if face.len() == 3 {
            return true;
        }
        let point = |k: usize| self.points[face[k % face.len()] as usize].map(i128::from);
        let along = |from: usize, to: usize| -> [i128; 3] { std::array::from_fn(|axis| point(to)[axis] - point(from)[axis]) };
        let cross = |a: [i128; 3], b: [i128; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let dot = |a: [i128; 3], b: [i128; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let normal = cross(along(0, 1), along(1, 2));
        // A loop that turns to one side everywhere may still run around twice: corners are seen from the first in order.
        (0..face.len()).all(|k| dot(along(0, k), normal) == 0 && dot(cross(along(k, k + 1), along(k + 1, k + 2)), normal) > 0)
            && (1..face.len() - 1).all(|k| dot(cross(along(0, k), along(0, k + 1)), normal) > 0)
    }

    /// The polygons.
    pub(super) fn loops(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.ends.len()).map(|index| self.polygon(index))
    }

    #[inline]
    fn polygon(&self, index: usize) -> &[u32] {
        let start = if index == 0 { 0 } else { self.ends[index - 1] };
        &self.corners[start as usize..self.ends[index] as usize]
    }

    /// Every polygon fanned from its first corner.
    pub(super) fn triangles(&self) -> Vec<[u32; 3]> {
        let fan = |corners: &'_ [u32]| (2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]).collect::<Vec<_>>();
        let mut triangles = Vec::with_capacity(self.triangle_count());
        for corners in self.loops() {
            match *corners {
                [a, b, c] => triangles.push([a, b, c]),
                [a, b, c, d] => triangles.extend([[a, b, c], [a, c, d]]),
                _ => triangles.extend(fan(corners)),
            }
        }
        triangles
    }

    fn triangle_count(&self) -> usize {
        self.corners.len() - 2 * self.ends.len()
    }

    /// The primitive's mesh in mm.
    pub(super) fn placed(&self, lattice: &Lattice) -> TriMesh {
        let unit = lattice.unit(0);
        TriMesh { vertices: self.points.iter().map(|point| lattice.place(point, unit)).collect(), triangles: self.triangles() }
    }
}

/// A polygon by its corners whatever it starts with and wherever it turns: its smallest corner and that one's neighbours, the smaller first; and its number.
/// Polygons that agree in these are compared whole.
type Entry = ([u32; 3], u32);

/// Copies of a system, level by level.
pub(super) struct Growth<'l> {
    lattice: &'l Lattice,
    /// Which maps may come, and the set after each map.
    sets: Vec<Vec<usize>>,
    after: Vec<usize>,
    /// Of every set of maps: the surface of the level reached, the number of copies, and the sum of their determinants.
    states: Vec<State>,
    level: u32,
    /// Triangles of the first set's surface, level by level.
    counted: Vec<f64>,
    /// Faces that went in the last step, of the first set's surface.
    pub(super) cancelled: u64,
    /// The most bytes that a step held.
    held: f64,
}

#[derive(Clone)]
struct State {
    surface: Surface,
    copies: f64,
    determinants: f64,
}

/// Polygons between two looks at the budget.
const CHUNK: usize = 1 << 14;
/// Bytes held for a copied point: itself, and its name; and for a copied corner: itself, its polygon's entry and end.
const POINT_BYTES: f64 = 24.0 + 56.0;
const CORNER_BYTES: f64 = 4.0 + 8.0;

impl<'l> Growth<'l> {
    pub(super) fn new(lattice: &'l Lattice, primitive: &Surface, (sets, after): (Vec<Vec<usize>>, Vec<usize>)) -> Self {
        let first = State { surface: primitive.clone(), copies: 1.0, determinants: 1.0 };
        let states = vec![first; sets.len()];
        Self { lattice, sets, after, states, level: 0, counted: vec![primitive.triangle_count() as f64], cancelled: 0, held: 0.0 }
    }

    /// Bytes that the next step holds.
    pub(super) fn bytes(&self) -> f64 {
        let of = |surface: &Surface| POINT_BYTES * surface.points.len() as f64 + CORNER_BYTES * surface.corners.len() as f64;
        let next = |set: &Vec<usize>| set.iter().map(|&map| of(&self.states[self.after[map]].surface)).sum::<f64>();
        self.states.iter().map(|state| of(&state.surface)).sum::<f64>() + self.sets.iter().map(next).sum::<f64>()
    }

    /// Refuses to go on where the next step, or surely the result, is beyond the limits.
    pub(super) fn check(&self, level: u32, budget: &Budget) -> Result<(), LevelError> {
        let (bytes, allowed) = (self.bytes(), budget.limits.memory_bytes);
        if bytes > allowed as f64 {
            let asked = bytes * self.growth().powi((level - self.level) as i32 - 1);
            return Err(LevelError::Memory { level, asked, allowed, passes: self.level });
        }
        // The growth of levels changes slowly; what is close to the limit is counted.
        let next = self.counted[self.level as usize] * self.growth();
        if self.level > 0 && next > 1.5 * budget.limits.triangles as f64 {
            return Err(self.too_many(level, budget));
        }
        self.check_result(level, budget)
    }

    /// Refuses a surface that has more triangles than allowed.
    pub(super) fn check_result(&self, level: u32, budget: &Budget) -> Result<(), LevelError> {
        let excess = self.counted[self.level as usize] > budget.limits.triangles as f64;
        if excess { Err(self.too_many(level, budget)) } else { Ok(()) }
    }

    fn too_many(&self, level: u32, budget: &Budget) -> LevelError {
        let allowed = budget.limits.triangles;
        let passes = self.counted.iter().rposition(|count| *count <= allowed as f64).unwrap_or(0) as u32;
        LevelError::Triangles { level, asked: self.prediction(level).triangles, allowed, passes }
    }

    /// How many times more triangles the next level has: as many as this one has more than the one before.
    fn growth(&self) -> f64 {
        match self.counted.as_slice() {
            [.., before, last] => last / before,
            _ => self.sets[0].len() as f64,
        }
    }

    /// What a level costs, by the growth so far.
    pub(super) fn prediction(&self, level: u32) -> super::LevelPrediction {
        let more = self.growth().powi(level.saturating_sub(self.level) as i32);
        let last = self.counted[self.level as usize];
        // Of the steps to come the last holds the most.
        let to_come = if level > self.level { self.bytes() * more / self.growth() } else { 0.0 };
        super::LevelPrediction { triangles: last * more, memory_bytes: to_come.max(self.held) }
    }

    /// Goes to the next level.
    pub(super) fn step(&mut self, budget: &Budget) -> Result<(), Stopped> {
        self.held = self.held.max(self.bytes());
        let scale = self.lattice.ratio.pow(self.level + 1);
        let mut states = Vec::with_capacity(self.states.len());
        for (index, set) in self.sets.iter().enumerate() {
            let (mut copied, mut copies, mut determinants) = (Surface::default(), 0.0, 0.0);
            let mut names = Names::with_capacity_and_hasher(
                set.iter().map(|&map| self.states[self.after[map]].surface.points.len()).sum(),
                BuildHasherDefault::default(),
            );
            for &map in set {
                let (state, map) = (&self.states[self.after[map]], &self.lattice.maps[map]);
                copies += state.copies;
                determinants += state.determinants * map.determinant.abs();
                copy(&state.surface, |point| Lattice::image(map, point, scale), map.determinant < 0.0, &mut copied, &mut names, budget)?;
            }
            drop(names);
            let faces = copied.ends.len();
            let surface = cancelled(copied, budget)?;
            if index == 0 {
                self.cancelled = (faces - surface.ends.len()) as u64;
                self.counted.push(surface.triangle_count() as f64);
            }
            states.push(State { surface, copies, determinants });
        }
        self.states = states;
        self.level += 1;
        // Copies on the lattice are exact; what single precision moves them by is known when they are written.
        budget.prove(0.0);
        budget.report("refine", 0.0, self.counted[self.level as usize] as u64);
        Ok(())
    }

    /// The surface of the level reached, the number of copies, and the sum of their determinants.
    pub(super) fn finish(mut self) -> (Surface, f64, f64) {
        let State { surface, copies, determinants } = self.states.swap_remove(0);
        (surface, copies, determinants)
    }
}

/// Numbers of points by their coordinates.
type Names = HashMap<Point, u32, BuildHasherDefault<Mixer>>;

/// Mixes coordinates into a hash; nothing is ever listed in its order.
#[derive(Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 29
    }

    fn write(&mut self, bytes: &[u8]) {
        // Points come as three whole words.
        for word in bytes.chunks(8) {
            let mut whole = [0; 8];
            whole[..word.len()].copy_from_slice(word);
            self.write_u64(u64::from_le_bytes(whole));
        }
    }

    fn write_u64(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(23) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn write_usize(&mut self, _length: usize) {
        // All points have three coordinates.
    }
}

/// Adds the image of a surface; points that are known keep their number.
fn copy(
    from: &Surface,
    image: impl Fn(&Point) -> Point,
    reverses: bool,
    to: &mut Surface,
    names: &mut Names,
    budget: &Budget,
) -> Result<(), Stopped> {
    let mut numbers = Vec::with_capacity(from.points.len());
    for points in from.points.chunks(CHUNK) {
        budget.cancel.check()?;
        numbers.extend(points.iter().map(|point| {
            let point = image(point);
            *names.entry(point).or_insert_with(|| {
                to.points.push(point);
                to.points.len() as u32 - 1
            })
        }));
    }
    for corners in from.loops() {
        let start = to.corners.len();
        to.corners.extend(corners.iter().map(|corner| numbers[*corner as usize]));
        if reverses {
            to.corners[start..].reverse();
        }
        to.ends.push(to.corners.len() as u32);
    }
    Ok(())
}

/// What is left when polygons that occur in both orientations cancel.
fn cancelled(surface: Surface, budget: &Budget) -> Result<Surface, Stopped> {
    let mut entries: Vec<Entry> = (0..surface.ends.len())
        .into_par_iter()
        .with_min_len(CHUNK)
        .map(|index| {
            let corners = surface.polygon(index);
            let (at, smallest) = lowest(corners);
            let (one, other) = (corners[(at + 1) % corners.len()], corners[(at + corners.len() - 1) % corners.len()]);
            ([smallest, one.min(other), one.max(other)], index as u32)
        })
        .collect();
    budget.cancel.check()?;
    entries.par_sort_unstable();
    budget.cancel.check()?;
    let mut stays = vec![true; surface.ends.len()];
    let mut start = 0;
    while start < entries.len() {
        let key = entries[start].0;
        let end = start + entries[start..].iter().take_while(|entry| entry.0 == key).count();
        for first in start..end {
            let one = entries[first].1 as usize;
            let partner = (first + 1..end)
                .map(|other| entries[other].1 as usize)
                .find(|&other| stays[one] && stays[other] && are_opposite(surface.polygon(one), surface.polygon(other)));
            if let Some(other) = partner {
                (stays[one], stays[other]) = (false, false);
            }
        }
        start = end;
    }
    drop(entries);
    const UNUSED: u32 = u32::MAX;
    let mut numbers = vec![UNUSED; surface.points.len()];
    let mut left = Surface::default();
    for (index, _) in stays.iter().enumerate().filter(|(_, stays)| **stays) {
        for &corner in surface.polygon(index) {
            let number = &mut numbers[corner as usize];
            if *number == UNUSED {
                *number = left.points.len() as u32;
                left.points.push(surface.points[corner as usize]);
            }
            left.corners.push(*number);
        }
        left.ends.push(left.corners.len() as u32);
    }
    Ok(left)
}

/// Where a polygon has its smallest corner, and which that is.
#[inline]
fn lowest(corners: &[u32]) -> (usize, u32) {
    let mut best = (0, corners[0]);
    for (index, &corner) in corners.iter().enumerate().skip(1) {
        if corner < best.1 {
            best = (index, corner);
        }
    }
    best
}

/// Whether two polygons have the same corners, in opposite order.
fn are_opposite(one: &[u32], other: &[u32]) -> bool {
    let count = one.len();
    let (at, from) = (lowest(one).0, lowest(other).0);
    count == other.len() && (0..count).all(|k| one[(at + k) % count] == other[(from + count - k) % count])
}

//! What cuts leave that has to go: slivers and short sides, whose normals are noise, and folds.

use super::Around;
use super::outcome::BACK;
use super::skin::upright;
use crate::attractor::cell::{Point, distance_squared, dot};
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::between::Memory;
use crate::dilation::surface::BlockSurface;
use crate::measure::triangle::closest_on_triangle;
use crate::solid::half_edges::{HalfEdges, NONE, kept, next};
use crate::solid::mend::{MOST_AROUND, Mender};

/// Sides that are no longer than this share of half the band are short.
const SHORT: f64 = 0.02;
/// The cosine by which triangles may turn.
const TURN: f64 = 0.5;
/// The same for those of folds, which turn as they have to.
const BACKWARDS: f64 = -2.0;
/// Sweeps at most.
const SWEEPS: usize = 3;

impl Around<'_> {
    /// Moves vertices to neighbours that are near to them, and turns the longest sides of slivers, as long as no other triangle turns much, and what is moved stays between the distances.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn tidy(&self, surface: &mut BlockSurface, budget: &Budget) -> Result<(), Stopped> {
        let short = SHORT * self.half();
        let mut tidying = Tidying::new(self, surface);
        for _ in 0..SWEEPS {
            let mut is_changed = false;
            for triangle in 0..tidying.mesh.triangles() {
                let Some(corners) = tidying.mesh.triangle(triangle) else { continue };
                let places = corners.map(|corner| tidying.mesh.points[corner as usize]);
                let long = |k: usize| distance_squared(&places[k], &places[(k + 1) % 3]);
                let [shortest, longest] = (1..3).fold([0; 2], |[least, most], k| {
                    [if long(k) < long(least) { k } else { least }, if long(k) > long(most) { k } else { most }]
                });
                let is_short = long(shortest) <= short * short;
                let is_sliver = upright(&places).is_none();
                if !is_short && !is_sliver {
                    continue;
                }
                budget.cancel.check()?;
                let [a, b] = [corners[shortest], corners[(shortest + 1) % 3]];
                is_changed |= (is_short && (tidying.collapse(a, b) || tidying.collapse(b, a)))
                    || (is_sliver && tidying.flip(3 * triangle + longest as u32));
            }
            if !is_changed {
                break;
            }
        }
        (surface.vertices, surface.triangles, _) = tidying.mesh.compact();
        Ok(())
    }

    /// Moves corners of triangles to neighbours where fewer triangles look back then, and what is moved stays between the distances.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn unfold(&self, surface: &mut BlockSurface, triangles: &[u32], budget: &Budget) -> Result<(), Stopped> {
        let mut folded: Vec<u32> = triangles.iter().flat_map(|&triangle| surface.triangles[triangle as usize]).collect();
        folded.sort_unstable();
        folded.dedup();
        let mut tidying = Tidying::new(self, surface);
        for _ in 0..SWEEPS {
            let mut is_changed = false;
            for &vertex in &folded {
                budget.cancel.check()?;
                is_changed |= tidying.unfold(vertex);
            }
            if !is_changed {
                break;
            }
        }
        (surface.vertices, surface.triangles, _) = tidying.mesh.compact();
        Ok(())
    }
}

/// A surface that is tidied.
struct Tidying<'a> {
    around: &'a Around<'a>,
    mesh: HalfEdges,
    mender: Mender,
    memory: Memory,
}

impl<'a> Tidying<'a> {
    fn new(around: &'a Around<'a>, surface: &mut BlockSurface) -> Self {
        let mesh = HalfEdges::new(std::mem::take(&mut surface.vertices), &surface.triangles);
        let mut mender = Mender::default();
        mender.start(&mesh);
        Self { around, mesh, mender, memory: Memory::default() }
    }

    /// Moves a vertex to the neighbour with which fewest triangles around it look back, of those that serve and with which fewer do so than before; whether there is one.
    fn unfold(&mut self, vertex: u32) -> bool {
        if !self.mesh.star(vertex, MOST_AROUND, &mut self.mender.star) {
            return false;
        }
        let ring = &self.mender.star.ring;
        let back = |apex: u32, gone: Option<usize>| {
            let corners = |k: usize| [apex, ring[k], ring[(k + 1) % ring.len()]].map(|corner| self.at(corner));
            kept(gone, ring.len()).filter(|&k| self.around.leads(&corners(k)) < BACK).count()
        };
        let before = back(vertex, None);
        if before == 0 {
            return false;
        }
        let with = (0..ring.len()).map(|m| (back(ring[m], Some(m)), m));
        let mut better: Vec<(usize, usize)> = with.filter(|own| own.0 < before).collect();
        better.sort_unstable();
        better.into_iter().any(|(_, m)| self.moves(vertex, m, BACKWARDS))
    }

    fn at(&self, vertex: u32) -> Point {
        self.mesh.points[vertex as usize]
    }

    /// Moves a vertex to a neighbour, if that serves; whether it does.
    fn collapse(&mut self, from: u32, to: u32) -> bool {
        if !self.mesh.star(from, MOST_AROUND, &mut self.mender.star) {
            return false;
        }
        let m = self.mender.star.ring.iter().position(|&other| other == to);
        m.is_some_and(|m| self.moves(from, m, TURN))
    }

    /// Moves a vertex to the neighbour at a place of its ring, if no triangle turns so much that a cosine is less, and what is moved stays between the distances; whether it does.
    fn moves(&mut self, from: u32, m: usize, turn: f64) -> bool {
        let ring = self.mender.star.ring.clone();
        let serves = self.mender.keeps_manifold(&self.mesh, m)
            && kept(Some(m), ring.len()).all(|k| {
                let [old, fresh] = [from, ring[m]].map(|apex| [apex, ring[k], ring[(k + 1) % ring.len()]].map(|corner| self.at(corner)));
                let Some(normal) = upright(&fresh) else { return false };
                upright(&old).is_none_or(|own| dot(&own, &normal) > turn) && self.stays(fresh, Some(old), 0.0)
            });
        if serves {
            self.mesh.collapse(from, &self.mender.star, m);
        }
        serves
    }

    /// Turns the side between two triangles, if that serves; whether it does.
    fn flip(&mut self, half: u32) -> bool {
        let twin = self.mesh.twin(half);
        if twin == NONE {
            return false;
        }
        let names = [self.mesh.end(twin), self.mesh.end(half), self.mesh.end(next(half)), self.mesh.end(next(twin))];
        let [a, b, c, d] = names.map(|corner| self.at(corner));
        let fresh = [[d, c, a], [c, d, b]];
        let Some(normal) = upright(&[b, a, d]) else { return false };
        // What is between old and new is no farther from what is new than the sliver is high.
        let high = distance_squared(&c, &closest_on_triangle(&c, &a, &b, &b)).sqrt();
        let serves = fresh.iter().all(|own| upright(own).is_some_and(|own| dot(&own, &normal) > TURN) && self.stays(*own, None, high))
            && self.mesh.star(names[2], MOST_AROUND, &mut self.mender.star)
            && !self.mender.star.ring.contains(&names[3]);
        if serves {
            self.mesh.flip(half);
        }
        serves
    }

    /// Whether a triangle is between the distances, and what is between it and what it was, or as far from it as told, no farther than the outer one but for what may move.
    fn stays(&mut self, triangle: [Point; 3], feet: Option<[Point; 3]>, beyond: f64) -> bool {
        let Around { inner, outer, moved, .. } = *self.around;
        self.around.is_between(triangle, feet, [inner, outer - moved - beyond], &mut self.memory)
    }
}

//! A sheet above a graph: a triangulation of the plane with heights.
//!
//! Places are added where samples are far off the sheet (Garland, Heckbert, "Fast polygonal approximation of terrains and height fields", 1995), on creases as on all else, and then where triangles are nearer to the graph or farther from it than they may be, each held against all of it.

use super::super::between::{Memory, middle};
use super::super::faces::{Faces, Fault};
use super::super::plane::{self, Mesh, corners, handle, inside, key};
use super::field::Field;
use super::ground::Base;
use super::samples::Samples;
use super::{Limits, Place};
use crate::attractor::cell::{Point, distance_squared};
use crate::budget::{Budget, Stopped};
use crate::dilation::surface::NameMap;
use crate::solid::half_edges::NONE;
use rayon::prelude::*;
use spade::{HasPosition, Point2, Triangulation};

/// Rounds in which places are added by samples.
const SAMPLED: usize = 48;
/// How far samples may be off the sheet, in units of half the band.
const OFF: f64 = 0.9;
/// How far out in the band a place is added where the sheet is too near, and where it is too far.
const OUT: [f64; 2] = [0.7, 0.55];
/// How far out vertices of the border are: what is closest to them there is to be near to the strip beside them, too.
const POST: f64 = 0.3;
/// Places that are added are no farther out than this in units of the border's distance, but at the border.
const INSIDE: f64 = 0.99;
/// How much farther from what is close a place is added at most than the fault is.
const FARTHEST: f64 = 2.0;
/// Triangles that are looked at in a row.
const IN_A_ROW: usize = 32;

#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    at: Place,
    height: f64,
    /// A triangle of the graph, or a ray, that is closest.
    owner: u32,
}

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0], self.at[1])
    }
}

/// What a check finds: the posts after which the border is to be led over a place, and whether all is as it should be.
#[derive(Default)]
pub(super) struct Found {
    pub(super) bends: Vec<(u32, Place)>,
    pub(super) is_done: bool,
}

/// A sheet, with the graph and what is known of it.
pub(super) struct Sheet<'a> {
    pub(super) base: &'a Base,
    pub(super) field: Field,
    pub(super) faces: Faces,
    /// Places that are not higher may be nearer to what faces stand for than these tell.
    pub(super) floor: f64,
    mesh: Mesh<Vertex>,
    numbers: NameMap<[u64; 2], u32>,
    /// Triangles that were found to be as they should be.
    known: NameMap<u128, ()>,
    /// Of vertices at the border, the posts; the border's edges are the only ones that are held.
    posts: Vec<u32>,
    /// Vertices that were added since triangles were looked at.
    fresh: Vec<u32>,
}

impl<'a> Sheet<'a> {
    /// One without places over a part of the plane, above some faces, which tell nothing of what is below a floor.
    pub(super) fn new(base: &'a Base, field: Field, faces: Faces, floor: f64) -> Self {
        Self {
            base,
            field,
            faces,
            floor,
            mesh: Mesh::new(),
            numbers: NameMap::default(),
            known: NameMap::default(),
            posts: Vec::new(),
            fresh: Vec::new(),
        }
    }

    /// The number of its vertices.
    pub(super) fn len(&self) -> usize {
        self.mesh.num_vertices()
    }

    pub(super) fn point(&self, number: u32) -> Point {
        let Vertex { at, height, .. } = *self.mesh.vertex(handle(number)).data();
        [at[0], at[1], height]
    }

    /// Adds a vertex over a place, next to another if one is known; none where there is one, or no graph is below.
    pub(super) fn raise(&mut self, at: Place, out: f64, hint: Option<u32>, limits: &Limits<'_>) -> Option<u32> {
        let at = at.map(|x| limits.rounded(x));
        if self.numbers.contains_key(&at.map(f64::to_bits)) {
            return None;
        }
        let top = self.field.top(at, limits.at(out)).filter(|top| top.height.is_finite())?;
        let vertex = Vertex { at, height: limits.rounded(top.height), owner: top.owner };
        let inserted = match hint {
            Some(hint) => self.mesh.insert_with_hint(vertex, handle(hint)),
            None => self.mesh.insert(vertex),
        };
        let number = inserted.ok()?.index() as u32;
        self.numbers.insert(at.map(f64::to_bits), number);
        self.posts.resize(self.mesh.num_vertices(), NONE);
        self.fresh.push(number);
        Some(number)
    }

    /// Adds a vertex of the border.
    pub(super) fn raise_post(&mut self, at: Place, post: u32, limits: &Limits<'_>) -> Option<u32> {
        let number = self.raise(at, POST, None, limits)?;
        self.posts[number as usize] = post;
        Some(number)
    }

    /// Makes an edge of the border; false where it would cross another.
    pub(super) fn join(&mut self, from: u32, to: u32) -> bool {
        plane::join(&mut self.mesh, handle(from), handle(to))
    }

    /// Takes an edge of the border out.
    pub(super) fn part(&mut self, from: u32, to: u32) -> bool {
        let edge = self.mesh.get_edge_from_neighbors(handle(from), handle(to)).map(|edge| edge.as_undirected().fix());
        edge.is_some_and(|edge| self.mesh.remove_constraint_edge(edge))
    }

    /// The triangles within the border, counter-clockwise; none where it is not closed.
    pub(super) fn base(&self) -> Option<Vec<[u32; 3]>> {
        inside(&self.mesh, |edge| edge.is_constraint_edge())
    }

    /// The same, if each was found to be as it should be.
    pub(super) fn known_base(&self) -> Option<Vec<[u32; 3]>> {
        self.base().filter(|base| base.iter().all(|triangle| self.known.contains_key(&key(triangle))))
    }

    /// Whether a triangle is still there.
    fn has(&self, triangle: &[u32; 3]) -> bool {
        let [a, b, c] = triangle.map(handle);
        self.mesh.get_edge_from_neighbors(a, b).is_some_and(|edge| {
            let mut faces = [edge, edge.rev()].into_iter().filter_map(|edge| edge.face().as_inner());
            faces.any(|face| face.vertices().iter().any(|vertex| vertex.fix() == c))
        })
    }

    /// Triangles that are not known: those around vertices that were added, or, where that is asked or these have none, of all.
    fn unknown(&mut self, all: bool) -> Vec<[u32; 3]> {
        let mut new: Vec<(usize, [u32; 3])> = Vec::new();
        for &vertex in self.fresh.iter().filter(|_| !all) {
            let faces = self.mesh.vertex(handle(vertex)).out_edges().filter_map(|edge| edge.face().as_inner());
            // What has corners at the border alone may be outside.
            let is_inside = |triangle: &[u32; 3]| triangle.iter().any(|&corner| self.posts[corner as usize] == NONE);
            new.extend(faces.map(|face| (face.fix().index(), corners(face))).filter(|(_, triangle)| is_inside(triangle)));
        }
        self.fresh.clear();
        new.sort_unstable();
        new.dedup();
        let mut new: Vec<[u32; 3]> = new.into_iter().map(|(_, triangle)| triangle).collect();
        let is_new = |triangle: &[u32; 3]| !self.known.contains_key(&key(triangle));
        new.retain(is_new);
        if new.is_empty() {
            new = self.base().unwrap_or_default();
            new.retain(is_new);
        }
        // What is near to each other in a row.
        new.sort_unstable_by_key(|triangle| (self.mesh.vertex(handle(triangle[0])).data().owner, *triangle));
        new
    }

    /// Adds places until no sample is far off, or there are as many vertices as may be.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn sample(&mut self, most: usize, limits: &Limits<'_>, budget: &Budget) -> Result<(), Stopped> {
        let half = 0.5 * (limits.outer - limits.inner);
        let samples = Samples::new(&self.field, limits.inner + half, self.faces.all.len(), budget)?;
        for round in 0..SAMPLED {
            budget.cancel.check()?;
            let new = self.unknown(round == 0);
            let worst = |some: &[[u32; 3]]| -> Result<Vec<Option<(f64, Place)>>, Stopped> {
                budget.cancel.check()?;
                Ok(some.iter().map(|triangle| samples.worst(&triangle.map(|corner| self.point(corner)))).collect())
            };
            let all = new.par_chunks(IN_A_ROW).map(worst).collect::<Result<Vec<_>, Stopped>>()?.concat();
            let mut open: Vec<(f64, Place, [u32; 3])> = Vec::new();
            for (triangle, worst) in new.iter().zip(all) {
                match worst.filter(|(off, _)| off.abs() > OFF * half) {
                    Some((off, at)) => open.push((off, at, *triangle)),
                    None => {
                        self.known.insert(key(triangle), ());
                    }
                }
            }
            if open.is_empty() || self.len() > most {
                break;
            }
            open.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
            for (number, (off, at, triangle)) in open.into_iter().enumerate() {
                if number.is_multiple_of(IN_A_ROW) {
                    budget.cancel.check()?;
                }
                if self.has(&triangle) && self.raise(at, OUT[usize::from(off > 0.0)], Some(triangle[0]), limits).is_none() {
                    self.known.insert(key(&triangle), ());
                }
            }
        }
        self.known.clear();
        Ok(())
    }

    /// Holds what is not known against the graph, and adds places where it is not as it should be; given the next post of each.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn check(&mut self, next: &[u32], all: bool, limits: &Limits<'_>, budget: &Budget) -> Result<Found, Stopped> {
        let new = self.unknown(all);
        let check = |some: &[[u32; 3]]| -> Result<Vec<Option<Fault>>, Stopped> {
            budget.cancel.check()?;
            let mut memory = Memory::default();
            let fault = |triangle: &[u32; 3]| {
                let owners = triangle.map(|vertex| self.mesh.vertex(handle(vertex)).data().owner);
                let question = limits.question(triangle.map(|vertex| self.point(vertex)), owners);
                self.faces.fault(&self.field, &question, &mut memory)
            };
            Ok(some.iter().map(fault).collect())
        };
        let faults: Vec<Option<Fault>> = new.par_chunks(IN_A_ROW).map(check).collect::<Result<Vec<_>, Stopped>>()?.concat();
        let mut found = Found { is_done: true, ..Found::default() };
        for (number, (triangle, fault)) in new.iter().zip(faults).enumerate() {
            if number.is_multiple_of(IN_A_ROW) {
                budget.cancel.check()?;
            }
            let Some(fault) = fault else {
                self.known.insert(key(triangle), ());
                continue;
            };
            found.is_done = false;
            if self.has(triangle) {
                found.bends.extend(self.mend(triangle, &fault, next, limits));
            }
        }
        Ok(found)
    }

    /// Adds a place where a triangle has a fault; or tells after which post the border has to be led over it.
    fn mend(&mut self, triangle: &[u32; 3], fault: &Fault, next: &[u32], limits: &Limits<'_>) -> Option<(u32, Place)> {
        let (at, out) = match fault {
            Fault::Near(x, close) => {
                // As far out as it should be, away from what is close.
                let share = limits.at(OUT[0]) / distance_squared(x, close).sqrt();
                let share = if share < FARTHEST { share } else { 1.0 };
                ([0, 1].map(|axis| close[axis] + share * (x[axis] - close[axis])), OUT[0])
            }
            Fault::Far(x) => ([x[0], x[1]], OUT[1]),
        };
        if self.base.away(at).0 > INSIDE * limits.border
            && let Some(post) = self.post_before(triangle, next)
        {
            return Some((post, at));
        }
        let [x, y, _] = middle(&triangle.map(|corner| self.point(corner)));
        let at = self.base.inward(at, INSIDE * limits.border);
        let is_beyond = self.mesh.intersects_constraint(Point2::new(x, y), Point2::new(at[0], at[1]));
        // A neighbour's fault may have been there, too.
        if is_beyond || self.raise(at, out, Some(triangle[0]), limits).is_none() {
            self.raise([x, y], out, Some(triangle[0]), limits);
        }
        None
    }

    /// The post before a triangle's side that is at the border.
    fn post_before(&self, triangle: &[u32; 3], next: &[u32]) -> Option<u32> {
        let own = triangle.map(|corner| self.posts[corner as usize]);
        let sides = (0..3).flat_map(|k| [[own[k], own[(k + 1) % 3]], [own[(k + 1) % 3], own[k]]]);
        sides.filter(|[from, to]| *from != NONE && *to != NONE).find(|&[from, to]| next[from as usize] == to).map(|[from, _]| from)
    }
}

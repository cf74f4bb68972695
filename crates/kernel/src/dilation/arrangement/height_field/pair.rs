//! The sheets above and below a graph, and the strip around, which joins them in the rim.
//!
//! Both sheets end at a border beside the graph, not farther from its part of the plane than the inner distance; the rim is beyond that. Between them is a strip of two triangles after each post, on either side, with the same edges seen from above.

use super::super::Flat;
use super::super::between::Memory;
use super::super::faces::Fault;
use super::ground::{border, turned_left};
use super::sheet::{Found, Sheet};
use super::{Limits, Place};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::surface::BlockSurface;
use crate::solid::contact::turn;
use crate::solid::half_edges::{HalfEdges, NONE};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Rounds in which places are added.
const ROUNDS: usize = 48;
/// How far out the rim is between the inner distance and the farthest that it may be, along straight sides, and at most around corners.
const RIM: [f64; 2] = [0.4, 0.7];
/// Sides of the rim around a corner at most.
const MOST_STEPS: f64 = 10_000.0;
/// How far the border is from where it may be at most, as a share of that, and in units of rounding.
const BORDER: f64 = 1e-4;
const ROUNDINGS: f64 = 4.0;
/// The rim is bent no nearer to posts than by this share of the way between them.
const LEAST_SHARE: f64 = 0.1;
/// Triangles for each vertex of a sheet, about.
const PER_VERTEX: f64 = 2.0;
/// Bytes held at most for each triangle of the graph, or ray, and for each vertex of a sheet.
pub(super) const BYTES_PER_FACE: f64 = 1_600.0;
const BYTES_PER_VERTEX: f64 = 400.0;

/// A place of the rim, and the vertices of both sheets at the border next to it.
#[derive(Clone, Copy, Debug)]
struct Post {
    rim: Point,
    ends: [u32; 2],
    /// Whether the strip after it was found to be as it should be.
    is_known: bool,
}

/// Both sheets, the lower one upside down, and the posts.
pub(super) struct Pair<'a> {
    sheets: [Sheet<'a>; 2],
    posts: Vec<Post>,
    /// Of every post, the next.
    next: Vec<u32>,
    limits: &'a Limits<'a>,
}

/// A polygon around a convex one, between two distances from it: its sides touch what is as far as the first. None where it would have very many sides.
pub(super) fn rim(corners: &[Place], limits: &Limits<'_>) -> Option<Vec<Place>> {
    let [near, far] = RIM.map(|share| limits.inner + share * (limits.rim - limits.inner));
    let widest = 2.0 * (near / far).acos();
    let count = corners.len();
    let mut rim = Vec::new();
    for k in 0..count {
        let [a, b, c] = [k + count - 1, k, k + 1].map(|k| corners[k % count]);
        let (before, after) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
        let (first, turn) = ((-before[0]).atan2(before[1]), turned_left(before, after));
        let steps = (turn / widest).ceil().max(1.0);
        (steps <= MOST_STEPS).then_some(())?;
        let reach = near / (0.5 * turn / steps).cos();
        for step in 0..steps as u32 {
            let (sine, cosine) = (first + turn * (f64::from(step) + 0.5) / steps).sin_cos();
            rim.push([b[0] + reach * cosine, b[1] + reach * sine]);
        }
    }
    Some(rim)
}

impl<'a> Pair<'a> {
    /// Both sheets, which have no places yet.
    pub(super) fn new(sheets: [Sheet<'a>; 2], limits: &'a Limits<'a>) -> Self {
        Self { sheets, posts: Vec::new(), next: Vec::new(), limits }
    }

    /// The surface in the frame of the graph, once all of it is between the distances; none where places do not make it so, or there is no room for it.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn run(mut self, budget: &Budget) -> Result<Option<Flat>, Stopped> {
        let limits = self.limits;
        let most = 2.0 * budget.limits.triangles as f64;
        let faces = self.sheets.iter().map(|sheet| sheet.faces.all.len()).max().unwrap_or(0);
        let most_vertices = (budget.limits.memory_bytes as f64 - BYTES_PER_FACE * faces as f64) / BYTES_PER_VERTEX;
        if self.begin().is_none() {
            return Ok(None);
        }
        // Samples alone make neither sheet have more than may be of both.
        let vertices = (most / PER_VERTEX).min(most_vertices).min(f64::from(u32::MAX >> 2)) as usize;
        let [above, below] = &mut self.sheets;
        let (first, second) = rayon::join(|| above.sample(vertices, limits, budget), || below.sample(vertices, limits, budget));
        first.and(second)?;
        if PER_VERTEX * self.vertices() > most {
            return Ok(Some(Flat::Beyond(PER_VERTEX * self.vertices())));
        }
        let mut all = true;
        for _ in 0..ROUNDS {
            // Places without end are no reason to refuse what others may do.
            if PER_VERTEX * self.vertices() > most || self.vertices() > most_vertices {
                return Ok(None);
            }
            let ([above, below], next) = (&mut self.sheets, &self.next);
            let (first, second) = rayon::join(|| above.check(next, all, limits, budget), || below.check(next, all, limits, budget));
            let [first, second] = [first?, second?];
            let is_done = first.is_done && second.is_done;
            let of_sheets = [first, second].into_iter().flat_map(|Found { bends, .. }| bends);
            let bends: Vec<(u32, Place)> = of_sheets.chain(self.check_strip(budget)?).collect();
            // What is new was looked at; what had faults before may still be there.
            if is_done && bends.is_empty() && all {
                return Ok(self.finish().map(|surface| Flat::Made(Box::new(surface))));
            }
            all = is_done || !bends.is_empty();
            let mut is_bent = vec![false; self.posts.len()];
            for (post, at) in bends {
                if !std::mem::replace(&mut is_bent[post as usize], true) && self.bend(post, at).is_none() {
                    return Ok(None);
                }
            }
        }
        Ok(None)
    }

    /// The number of vertices of both sheets.
    fn vertices(&self) -> f64 {
        self.sheets.iter().map(Sheet::len).sum::<usize>() as f64
    }

    /// Makes the first posts.
    fn begin(&mut self) -> Option<()> {
        let rim = rim(&self.sheets[0].base.corners, self.limits)?;
        for &at in &rim {
            self.post(at)?;
        }
        let count = rim.len() as u32;
        (0..count).try_for_each(|post| self.join(post, (post + 1) % count))
    }

    /// Adds a post at a place.
    fn post(&mut self, at: Place) -> Option<u32> {
        let limits = self.limits;
        let at = at.map(|x| limits.rounded(x));
        let [above, below] = self.sheets.each_ref().map(|sheet| sheet.field.top(at, limits.outer));
        // In the middle of what is over the place.
        let rim = [at[0], at[1], limits.rounded(0.5 * (above?.height - below?.height))];
        let post = self.posts.len() as u32;
        let border = self.sheets[0].base.inward(at, limits.border * (1.0 - BORDER) - ROUNDINGS * limits.rounding);
        let mut ends = [NONE; 2];
        for (sheet, end) in self.sheets.iter_mut().zip(&mut ends) {
            *end = sheet.raise_post(border, post, limits)?;
        }
        self.posts.push(Post { rim, ends, is_known: false });
        self.next.push(NONE);
        Some(post)
    }

    fn join(&mut self, from: u32, to: u32) -> Option<()> {
        self.next[from as usize] = to;
        self.posts[from as usize].is_known = false;
        let [a, b] = [from, to].map(|post| self.posts[post as usize].ends);
        self.sheets.iter_mut().zip(a.into_iter().zip(b)).all(|(sheet, (a, b))| sheet.join(a, b)).then_some(())
    }

    /// Adds a post between one and the next, beside a place.
    fn bend(&mut self, post: u32, at: Place) -> Option<()> {
        let next = self.next[post as usize];
        let [from, to] = [post, next].map(|post| self.posts[post as usize]);
        let way = [0, 1].map(|axis| to.rim[axis] - from.rim[axis]);
        let share = [0, 1].map(|axis| (at[axis] - from.rim[axis]) * way[axis]).iter().sum::<f64>() / (way[0] * way[0] + way[1] * way[1]);
        let share = share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
        for (sheet, (from, to)) in self.sheets.iter_mut().zip(from.ends.into_iter().zip(to.ends)) {
            sheet.part(from, to).then_some(())?;
        }
        let new = self.post([0, 1].map(|axis| from.rim[axis] + share * way[axis]))?;
        self.join(post, new)?;
        self.join(new, next)
    }

    /// The triangles of a side's strip after a post, counter-clockwise from above, upside down on the second side.
    fn strip(&self, side: usize, post: u32) -> [[Point; 3]; 2] {
        let [from, to] = [post, self.next[post as usize]].map(|post| &self.posts[post as usize]);
        let sign = [1.0, -1.0][side];
        let [a, b] = [from, to].map(|Post { rim: [x, y, z], .. }| [*x, *y, sign * z]);
        let [c, d] = [to, from].map(|post| self.sheets[side].point(post.ends[side]));
        [[a, b, c], [a, c, d]]
    }

    /// Holds the parts of the strip that are not known against the graph: the posts after which the rim is to be bent, and where.
    ///
    /// # Errors
    /// [`Stopped`].
    fn check_strip(&mut self, budget: &Budget) -> Result<Vec<(u32, Place)>, Stopped> {
        let open: Vec<u32> = (0..self.posts.len() as u32).filter(|&post| !self.posts[post as usize].is_known).collect();
        let fault = |&post: &u32| {
            budget.cancel.check()?;
            let mut memory = Memory::default();
            let mut all = [0, 1].into_iter().flat_map(|side| self.strip(side, post).map(|triangle| (side, triangle)));
            Ok(all.find_map(|(side, triangle)| {
                let Sheet { faces, field, .. } = &self.sheets[side];
                faces.fault(field, &self.limits.question(triangle, [NONE; 3]), &mut memory)
            }))
        };
        let faults: Vec<Option<Fault>> = open.par_iter().map(fault).collect::<Result<_, Stopped>>()?;
        let mut bends = Vec::new();
        for (post, fault) in open.into_iter().zip(faults) {
            match fault {
                None => self.posts[post as usize].is_known = true,
                Some(Fault::Near(x, _) | Fault::Far(x)) => bends.push((post, [x[0], x[1]])),
            }
        }
        Ok(bends)
    }

    /// The surface, if it is as it is proven to be: see the head of the module.
    fn finish(&self) -> Option<BlockSurface> {
        let mut order = vec![0];
        while let Some(&post) = self.next.get(order[order.len() - 1] as usize).filter(|&&post| post != 0) {
            order.push(post);
            (order.len() <= self.posts.len()).then_some(())?;
        }
        let rim: Vec<Point> = order.iter().map(|&post| self.posts[post as usize].rim).collect();
        let mut surface = BlockSurface { vertices: rim.clone(), ..BlockSurface::default() };
        let count = rim.len() as u32;
        for (side, sheet) in self.sheets.iter().enumerate() {
            let mut numbers = vec![NONE; sheet.len()];
            let (mut is_above, sign) = (false, [1.0, -1.0][side]);
            let mut lowest = rim.iter().map(|place| sign * place[2]).fold(f64::INFINITY, f64::min);
            let highest = sheet.faces.highest();
            let mut number = |corner: u32| {
                let number = &mut numbers[corner as usize];
                if *number == NONE {
                    let [x, y, height] = sheet.point(corner);
                    is_above |= height > highest;
                    lowest = lowest.min(height);
                    *number = surface.vertices.len() as u32;
                    surface.vertices.push([x, y, sign * height]);
                }
                *number
            };
            let mut own: Vec<[u32; 3]> = sheet.known_base()?.iter().map(|triangle| triangle.map(&mut number)).collect();
            for (k, &post) in (0..).zip(&order) {
                let next = (k + 1) % count;
                let [c, d] = [order[next as usize], post].map(|post| number(self.posts[post as usize].ends[side]));
                own.extend([[k, next, c], [k, c, d]]);
            }
            is_above &= lowest > sheet.floor;
            // The sheet is within its border, and so as near to the part, which is convex, as that.
            let mut border = self.posts.iter().map(|post| sheet.point(post.ends[side]));
            let is_inside = border.all(|[x, y, _]| sheet.base.away([x, y]).0 < self.limits.border);
            (is_above && is_inside && is_plane(&surface.vertices, &own, &rim)).then_some(())?;
            if side == 1 {
                own.iter_mut().for_each(|triangle| triangle.swap(1, 2));
            }
            surface.triangles.extend(own);
        }
        Some(surface)
    }
}

/// Whether triangles cover the inside of a rim, whose places are the first ones, once, and nothing else; seen from above. The rim turns once around a place, and all triangles turn the same way.
pub(super) fn is_plane(places: &[Point], triangles: &[[u32; 3]], rim: &[Point]) -> bool {
    let middle = [0, 1].map(|axis| rim.iter().map(|place| place[axis]).sum::<f64>() / rim.len() as f64);
    let middle = [middle[0], middle[1], 0.0];
    let mut turned = 0.0;
    for (k, a) in rim.iter().enumerate() {
        let b = &rim[(k + 1) % rim.len()];
        if turn(2, &middle, a, b) <= 0.0 {
            return false;
        }
        let [from, to] = [a, b].map(|place| [place[0] - middle[0], place[1] - middle[1]]);
        turned += turned_left(from, to);
    }
    let turns = |&[a, b, c]: &[u32; 3]| turn(2, &places[a as usize], &places[b as usize], &places[c as usize]) > 0.0;
    let is_around = |border: Vec<u32>| is_same(&border, rim.len() as u32);
    turned < 1.5 * TAU && triangles.iter().all(turns) && border(&HalfEdges::new(places.to_vec(), triangles)).is_some_and(is_around)
}

/// Whether a cycle is that of the first numbers.
fn is_same(border: &[u32], count: u32) -> bool {
    let first = border.first().copied().unwrap_or(NONE);
    border.len() == count as usize && (0..count).zip(border).all(|(k, &place)| first < count && place == (first + k) % count)
}

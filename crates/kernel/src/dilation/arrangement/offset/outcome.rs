//! What is left of sheets that were cut, and what of it is not as it has to be.

use super::crossed::Pieces;
use super::sheets::Sheets;
use super::ways::Ways;
use super::{Around, IN_A_ROW};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::between::{Memory, middle};
use crate::dilation::arrangement::faces::numbered;
use crate::dilation::setting::Setting;
use crate::dilation::surface::{BlockSurface, NameMap};
use crate::groups::Groups;
use crate::solid::half_edges::{HalfEdges, NONE, next};
use crate::solid::mend::{Mended, NUDGE, mend};
use crate::solid::topology::Incidence;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashSet};

/// The cosine from which on a triangle looks back.
pub(super) const BACK: f64 = 0.05;
/// By how many times fewer triangles are not as they have to be after each round of unfolding, and of lids, at least.
const FEWER: usize = 2;
/// Of so many triangles one may be folded before, and one may be covered by lids.
const FOLDED: usize = 4;
const SPARSE: usize = 8;
/// How many times lids are shaken until they cross what is there without touching it.
const TRIES: usize = 3;

/// A closed surface, and of places of sheets the vertices of the surface that these are out from, and the ways from there.
pub(super) struct Outcome {
    pub(super) surface: BlockSurface,
    from: NameMap<[u64; 3], (u32, Point)>,
    /// Triangles that are known to be between the distances.
    good: HashSet<[[u64; 3]; 3]>,
    /// How far it is from where it was cut at most, all in all.
    pub(super) off: f64,
    is_cut: bool,
    /// How many times lids were tried: they are shaken in another way each time.
    lids: u64,
}

/// What is not as it has to be: triangles that are nearer or farther, those that look back, those at vertices whose triangles are no single ring, and those at which no way out is found.
#[derive(Default)]
pub(super) struct Flaws {
    pub(super) off: Vec<u32>,
    back: Vec<u32>,
    pinched: Vec<u32>,
    pub(super) not_left: Vec<u32>,
}

impl Flaws {
    /// Looking back is none where ways out are found.
    pub(super) fn is_none(&self) -> bool {
        self.count() == 0
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.off.len() + self.pinched.len() + self.not_left.len()
    }

    /// Where they are: what is not left is beside what looks back, mostly.
    pub(super) fn triangles(&self) -> Vec<u32> {
        let all: BTreeSet<u32> = self.off.iter().chain(&self.back).chain(&self.pinched).copied().collect();
        if all.is_empty() { self.not_left.clone() } else { all.into_iter().collect() }
    }
}

impl Outcome {
    /// Given the triangles of sheets that have faults: pieces of others are between the distances.
    pub(super) fn new(sheets: &Sheets, pieces: Pieces, faults: &[(u32, bool)]) -> Self {
        let places = sheets.vertices.iter().map(|vertex| vertex.map(f64::to_bits));
        let from = places.zip(sheets.feet.iter().copied().zip(sheets.ways.iter().copied())).collect();
        let is_fault: HashSet<u32> = faults.iter().map(|fault| fault.0).collect();
        let Pieces { vertices, triangles, owners, off, is_cut } = pieces;
        let surface = BlockSurface { vertices, triangles, ..BlockSurface::default() };
        let good = (0..).zip(owners).filter(|(_, owner)| !is_fault.contains(owner));
        let good = good.map(|(piece, _)| name(surface.corners(piece))).collect();
        Self { surface, from, good, off, is_cut, lids: 0 }
    }

    /// The vertices of the surface that some of its triangles are out from.
    pub(super) fn feet(&self, triangles: &[u32]) -> BTreeSet<u32> {
        let corners = triangles.iter().flat_map(|&triangle| self.surface.corners(triangle));
        corners.filter_map(|corner| self.from.get(&corner.map(f64::to_bits))).map(|own| own.0).collect()
    }

    /// The middles of what is not as it has to be.
    pub(super) fn places(&self, flaws: &Flaws) -> Vec<Point> {
        flaws.triangles().into_iter().map(|triangle| middle(&self.surface.corners(triangle))).collect()
    }

    /// Mends it, if it was cut, and looks for what is not as it has to be.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn flaws(&mut self, around: &Around<'_>, ways: &Ways<'_>, setting: &Setting, budget: &Budget) -> Result<Flaws, Stopped> {
        let mut flaws = Flaws::default();
        if self.is_cut {
            let mut surface = std::mem::take(&mut self.surface);
            split(&mut surface);
            flaws.pinched = doubled(&surface.triangles);
            if flaws.pinched.is_empty() {
                let Mended { points, triangles, .. } = mend(surface.vertices, surface.triangles, setting.rounding, budget)?;
                self.off += NUDGE * setting.rounding;
                (self.surface.vertices, self.surface.triangles) = (points, triangles);
                around.tidy(&mut self.surface, budget)?;
                // Vertices at one place are one, and pinched.
                let corners: Vec<[Point; 3]> = self.numbers().map(|triangle| self.surface.corners(triangle)).collect();
                (self.surface.vertices, self.surface.triangles) = numbered(&corners);
                let is_pinched = pinched(&self.surface);
                let at = |corner: u32| is_pinched.contains(&corner);
                flaws.pinched = self.numbers().filter(|&triangle| self.surface.triangles[triangle as usize].into_iter().any(at)).collect();
            } else {
                self.surface = surface;
            }
        }
        flaws.off = self.look(around, budget)?;
        let way = |vertex: &Point| self.from.get(&vertex.map(f64::to_bits)).map(|own| own.1);
        let all: Vec<Option<Point>> = self.surface.vertices.iter().map(way).collect();
        flaws.not_left = ways.not_left(&self.surface, &all, budget)?;
        let is_back = |triangle: &&u32| around.leads(&self.surface.corners(**triangle)) < BACK;
        flaws.back = flaws.not_left.par_iter().filter(is_back).copied().collect();
        Ok(flaws)
    }

    /// Takes folds away, and covers with lids what is left of them, with coordinates that are rounded, as long as there is less afterwards; tells what is left of it. None where lids are needed, but no rounding is told, as there is no room for what they move.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn close(
        &mut self,
        mut flaws: Flaws,
        around: &Around<'_>,
        ways: &Ways<'_>,
        round: Option<&(impl Fn(f64) -> f64 + Sync)>,
        setting: &Setting,
        budget: &Budget,
    ) -> Result<Option<Flaws>, Stopped> {
        let mut before = usize::MAX;
        while !flaws.is_none() && flaws.count() <= self.surface.triangles.len() / FOLDED {
            flaws = self.unfold(flaws, around, ways, setting, budget)?;
            if flaws.is_none() {
                break;
            }
            let Some(round) = round else { return Ok(None) };
            // Where they would be everywhere, or do not leave much less, lids do not help.
            let is_hopeless = flaws.count() > (before / FEWER).min(self.surface.triangles.len() / SPARSE);
            before = flaws.count();
            if is_hopeless || !self.cover(around, &flaws, round, budget)? {
                break;
            }
            flaws = self.flaws(around, ways, setting, budget)?;
        }
        Ok(Some(flaws))
    }

    /// Takes folds away as long as that leaves much less that is not as it has to be, and tells what is left of it.
    ///
    /// # Errors
    /// [`Stopped`].
    fn unfold(
        &mut self,
        mut flaws: Flaws,
        around: &Around<'_>,
        ways: &Ways<'_>,
        setting: &Setting,
        budget: &Budget,
    ) -> Result<Flaws, Stopped> {
        let mut before = usize::MAX;
        while !flaws.is_none() && flaws.count() <= before / FEWER {
            before = flaws.count();
            // Vertices are moved with all of their triangles.
            split(&mut self.surface);
            if !doubled(&self.surface.triangles).is_empty() {
                break;
            }
            around.unfold(&mut self.surface, &flaws.triangles(), budget)?;
            flaws = self.flaws(around, ways, setting, budget)?;
        }
        Ok(flaws)
    }

    /// Adds lids over what is not as it has to be; false where these cannot be cut.
    ///
    /// # Errors
    /// [`Stopped`].
    fn cover(
        &mut self,
        around: &Around<'_>,
        flaws: &Flaws,
        round: &(impl Fn(f64) -> f64 + Sync),
        budget: &Budget,
    ) -> Result<bool, Stopped> {
        let triangles = flaws.triangles();
        let mut found = None;
        for _ in 0..TRIES {
            self.lids += 1;
            let mesh = around.with_lids(&self.surface, &triangles, self.lids, round, budget)?;
            found = Pieces::outer(&mesh, 0, round, budget)?;
            if found.is_some() {
                break;
            }
        }
        let Some(mut pieces) = found else { return Ok(false) };
        pieces.fill(|part| around.is_filled(part, budget))?;
        self.off += pieces.off;
        self.is_cut = true;
        (self.surface.vertices, self.surface.triangles) = (pieces.vertices, pieces.triangles);
        Ok(true)
    }

    fn numbers(&self) -> std::ops::Range<u32> {
        0..self.surface.triangles.len() as u32
    }

    /// The triangles that are nearer or farther than they have to be, of those that are not known to be good.
    fn look(&mut self, around: &Around<'_>, budget: &Budget) -> Result<Vec<u32>, Stopped> {
        let open: Vec<u32> = self.numbers().filter(|&triangle| !self.good.contains(&name(self.surface.corners(triangle)))).collect();
        let look = |row: &[u32]| {
            budget.cancel.check()?;
            let mut memory = Memory::default();
            let mut is_off =
                |&triangle: &u32| !around.is_between(self.surface.corners(triangle), None, [around.inner, around.outer], &mut memory);
            Ok(row.iter().map(&mut is_off).collect())
        };
        let found: Vec<Vec<bool>> = open.par_chunks(IN_A_ROW).map(look).collect::<Result<_, Stopped>>()?;
        let (off, good): (Vec<_>, Vec<_>) = open.into_iter().zip(found.into_iter().flatten()).partition(|(_, is_off)| *is_off);
        self.good.extend(good.into_iter().map(|(triangle, _)| name(self.surface.corners(triangle))));
        Ok(off.into_iter().map(|(triangle, _)| triangle).collect())
    }
}

/// What a triangle is called.
fn name(places: [Point; 3]) -> [[u64; 3]; 3] {
    places.map(|place| place.map(f64::to_bits))
}

/// Gives each ring of triangles at a vertex a vertex of its own.
fn split(surface: &mut BlockSurface) {
    let mesh = HalfEdges::new(surface.vertices.clone(), &surface.triangles);
    let mut groups = Groups::new(3 * surface.triangles.len());
    for half in 0..3 * mesh.triangles() {
        let twin = mesh.twin(half);
        if twin != NONE {
            groups.join(half as usize, next(twin) as usize);
        }
    }
    let groups = groups.all();
    let mut numbers = vec![NONE; groups.len()];
    let mut is_used = vec![false; surface.vertices.len()];
    for (corner, &group) in surface.triangles.iter_mut().flatten().zip(&groups) {
        let number = &mut numbers[group as usize];
        if *number == NONE {
            *number = *corner;
            if std::mem::replace(&mut is_used[*corner as usize], true) {
                *number = surface.vertices.len() as u32;
                surface.vertices.push(surface.vertices[*corner as usize]);
            }
        }
        *corner = *number;
    }
}

/// The triangles with a side that another one has in the same direction: more than two meet there.
fn doubled(triangles: &[[u32; 3]]) -> Vec<u32> {
    let sides = |own: &[u32; 3], triangle: u32| [0, 1, 2].map(|k| ([own[k], own[(k + 1) % 3]], triangle));
    let mut all: Vec<([u32; 2], u32)> = triangles.iter().zip(0..).flat_map(|(own, triangle)| sides(own, triangle)).collect();
    all.par_sort_unstable();
    let found: BTreeSet<u32> = all.chunk_by(|a, b| a.0 == b.0).filter(|own| own.len() > 1).flatten().map(|own| own.1).collect();
    found.into_iter().collect()
}

/// The vertices whose triangles are no single ring.
fn pinched(surface: &BlockSurface) -> HashSet<u32> {
    let around = Incidence::new(surface.vertices.len(), &surface.triangles);
    let all = 0..surface.vertices.len() as u32;
    let is_pinched = |link: &mut Vec<(u32, u32)>, vertex: u32| (!around.is_ring(&surface.triangles, vertex, link)).then_some(vertex);
    all.into_par_iter().map_init(Vec::new, is_pinched).flatten().collect()
}

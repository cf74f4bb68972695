//! Fewer triangles for a mesh that is finer than its dilation can show, as scanned ones and those of marching cubes are: what is made of them costs as much as they tell within the tolerance.
//!
//! Sides are collapsed into one of their ends as long as no vertex that is gone is farther from the triangles that are left than it may be (Klein, Liebich and Strasser, "Mesh reduction with error control", 1996). Nothing of that is taken on trust: in the end each triangle of either mesh is shown to be nowhere farther from the other
//! one than the bound (`cover`), so that their Hausdorff distance is no more than that.
//!
//! Where a mesh is the surface of a solid, so is what is left of it, if that is embedded. Both solids are the same but for places close to the surface: let f(v) be the vertex that v became in the end, and f map each triangle as that says. Each collapse maps what bounds a solid to what is left, as triangles that lose
//! their area add nothing: so f maps the mesh to what is left of it. Straight from x to f(x) no place moves by more than the corners of its triangle do. So windings around all places are the same that are farther from the mesh than any vertex is from what it became (homotopy in the complement of a place).

mod cover;
#[cfg(test)]
mod tests;

use super::arrangement::Faces;
use super::removed::Removed;
use crate::attractor::cell::{Point, between, closest_on_segment, cross, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::measure::triangle::closest_on_triangle;
use crate::solid::half_edges::{HalfEdges, NONE, kept, next};
use crate::solid::mend::{MOST_AROUND, Mender};
use crate::solid::topology::Incidence;
use crate::solid::{Crossings, TriMesh};
use cover::uncovered;
use glam::DVec3;
use std::collections::HashSet;

/// How far vertices that are gone may be from what is left, in units of the bound, pass by pass: between them a mesh may be farther.
const PASSES: [f64; 4] = [0.05, 0.15, 0.4, 0.75];
/// Sides that are shorter than this, as a share of the longest one around a vertex, go before others.
const SHORT: f64 = 0.2;
/// The cosine of the angle between a triangle and the normals of its corners, and its height as a share of its longest side, at least: or as much as there was before.
const FAIR: Quality = Quality { lean: 0.94, height: 0.1 };
/// The same where short sides go; and of the cosine unless there was less before, as beside sharp edges.
const POOR: Quality = Quality { lean: 0.5, height: 1e-4 };
/// The cosine in any case: nothing turns over, however often it becomes a little worse.
const LEAST_LEAN: f64 = 0.1;
/// What rounding may take of the cosine.
const ROUNDED: f64 = 1e-3;
/// Rounds in which vertices may be half as far away as before where meshes were found to be too far from each other.
const ROUNDS: usize = 4;
/// How many times as many triangles are left at most, of meshes that were tried, than there had to be of one that is curved alike everywhere.
const MISSED: f64 = 4.0;
/// Vertices that are looked at before a stop is noticed.
const IN_A_ROW: u32 = 256;

/// The mesh with fewer triangles, no place of either farther from the other one than `most`; none where that does not come out, or more than one of `worth` triangles is left. `farthest` is infinite for surfaces; for the surface of a solid it is how far vertices may be from what they become.
///
/// Cost: some microseconds for each triangle.
///
/// # Errors
/// [`Stopped`].
pub(super) fn decimated(mesh: &TriMesh, most: f64, farthest: f64, worth: usize, budget: &Budget) -> Result<Option<TriMesh>, Stopped> {
    if !is_finer(mesh, most, worth) {
        return Ok(None);
    }
    budget.cancel.check()?;
    let faces = Faces::of_mesh(mesh);
    let mut may_be_off = vec![most; mesh.vertices.len()];
    for _ in 0..ROUNDS {
        let mut decimation = Decimation::new(mesh, &faces, farthest);
        decimation.sweep(&may_be_off, PASSES[PASSES.len() - 1], SHORT, budget)?;
        for share in PASSES {
            decimation.sweep(&may_be_off, share, 1.0, budget)?;
        }
        let (fewer, names) = decimation.left();
        if worth * fewer.triangles.len() > mesh.triangles.len() {
            return Ok(None);
        }
        let of_mesh = uncovered(mesh, &Faces::of_mesh(&fewer), most, budget)?;
        let of_fewer = uncovered(&fewer, &faces, most, budget)?;
        if of_mesh.is_empty() && of_fewer.is_empty() {
            let serves = farthest == f64::INFINITY || (is_closed(&fewer) && Crossings::of(&fewer, budget)?.count == 0);
            return Ok(serves.then_some(fewer));
        }
        let mut is_nearer = vec![false; may_be_off.len()];
        of_mesh.iter().flat_map(|&triangle| mesh.triangles[triangle as usize]).for_each(|corner| is_nearer[corner as usize] = true);
        of_fewer.iter().for_each(|&triangle| decimation.each_vertex(names[triangle as usize], |vertex| is_nearer[vertex as usize] = true));
        may_be_off.iter_mut().zip(is_nearer).filter(|(_, is_nearer)| *is_nearer).for_each(|(most, _)| *most *= 0.5);
    }
    Ok(None)
}

/// Whether of a mesh one of `worth` triangles may be enough: triangles of a smooth surface are off by an eighth of what their neighbours' corners are off their planes, and there are as many times more of them as they are less off. That is so of at least half of them, by the median: edges, as around the ends of cylinders and between cones, tell nothing of it.
pub(super) fn is_finer(mesh: &TriMesh, most: f64, worth: usize) -> bool {
    let joined = HalfEdges::new(mesh.vertices.iter().map(|vertex| vertex.to_array()).collect(), &mesh.triangles);
    let off = |triangle: u32| {
        let [a, b, c] = mesh.points_of(triangle);
        let up = unit(&cross(&subtract(&b, &a), &subtract(&c, &a)));
        let twins = [0, 1, 2].map(|k| joined.twin(3 * triangle + k)).into_iter().filter(|&twin| twin != NONE);
        twins.map(move |twin| (up, a, twin))
    };
    let height = |(up, a, twin): (Point, Point, u32)| dot(&up, &subtract(&joined.points[joined.end(next(twin)) as usize], &a)).abs();
    let mut all: Vec<f64> = (0..joined.triangles()).flat_map(off).map(height).collect();
    if all.is_empty() {
        return false;
    }
    let middle = all.len() / 2;
    let (_, &mut median, _) = all.select_nth_unstable_by(middle, f64::total_cmp);
    8.0 * most >= MISSED * worth as f64 * median
}

/// Whether each side has two triangles, one in either direction.
fn is_closed(mesh: &TriMesh) -> bool {
    let joined = HalfEdges::new(vec![[0.0; 3]; mesh.vertices.len()], &mesh.triangles);
    (0..3 * joined.triangles()).all(|half| is_joined(&joined, half))
}

/// Whether a half of a side has one in the other direction, which has no other one.
fn is_joined(mesh: &HalfEdges, half: u32) -> bool {
    let twin = mesh.twin(half);
    twin != NONE && mesh.twin(twin) == half
}

/// How good a triangle is.
#[derive(Clone, Copy)]
struct Quality {
    /// The least cosine of the angle between it and the normals of its corners.
    lean: f64,
    /// Its height as a share of its longest side.
    height: f64,
}

/// A mesh of which vertices are removed.
struct Decimation<'a> {
    /// What there was at first.
    faces: &'a Faces,
    /// Joined where neighbours have a side in opposite directions, and behind them a triangle for each other side, with a corner that all of these have and no other: so that nearly all that is around a vertex is closed.
    mesh: HalfEdges,
    /// That corner.
    beyond: u32,
    /// Unit normals of vertices.
    ups: Vec<Point>,
    is_border: Vec<bool>,
    /// Vertices all of whose triangles are around them one after the other, and have no side that is not one of two triangles.
    may_move: Vec<bool>,
    /// How far vertices may be from what they become; no less than how far those are that became one; and of those the next one, around a ring.
    farthest: f64,
    moved: Vec<f64>,
    next_of: Vec<u32>,
    /// How good triangles have to be, unless those before were as bad.
    least: Quality,
    mender: Mender,
    removed: Removed,
    /// Of a star: what may come to be, what there is before, and the neighbours, nearest first.
    fresh: Vec<Fresh>,
    old: Vec<Option<Fresh>>,
    lengths: Vec<(f64, usize)>,
}

/// What of some stands for a place: it is no farther than `most`. That is what the place is deepest in, seen along its normal, or where that is too far, as on the other side of a sharp edge, what is closest.
fn standing<'a>(all: impl Iterator<Item = &'a Fresh> + Clone, x: &Point, is_border: bool, most: f64) -> Option<usize> {
    let deepest = all.clone().enumerate().map(|(index, own)| (index, own.depth(x, is_border), own)).max_by(|a, b| a.1.total_cmp(&b.1));
    let (index, depth, own) = deepest?;
    if own.distance(x, depth) <= most {
        return Some(index);
    }
    let others = all.enumerate().filter(|(_, own)| own.may_be_within(x, is_border, most));
    let distances = others.map(|(index, own)| (index, own.distance(x, own.depth(x, is_border))));
    distances.filter(|&(_, distance)| distance <= most).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(index, _)| index)
}

/// What may come to be: a triangle, or a side of the border.
enum Fresh {
    Triangle(Facet),
    Side([Point; 2]),
}

impl Fresh {
    /// How well it stands for a vertex: for those of the border a side does.
    fn depth(&self, x: &Point, is_border: bool) -> f64 {
        match self {
            Self::Triangle(_) if is_border => f64::NEG_INFINITY,
            Self::Triangle(own) => own.depth(x),
            Self::Side(_) if is_border => f64::INFINITY,
            Self::Side(_) => f64::NEG_INFINITY,
        }
    }

    /// Whether it may stand for a vertex that is no farther than `most` from it: at a glance, its plane is not.
    fn may_be_within(&self, x: &Point, is_border: bool, most: f64) -> bool {
        match self {
            Self::Triangle(own) => !is_border && dot(&own.normal, &subtract(x, &own.corners[0])).abs() <= most,
            Self::Side(_) => is_border,
        }
    }

    /// How far a place is from it, given how deep inside of it that is.
    fn distance(&self, x: &Point, depth: f64) -> f64 {
        match self {
            Self::Triangle(own) if depth >= 0.0 => dot(&own.normal, &subtract(x, &own.corners[0])).abs(),
            Self::Triangle(Facet { corners: [a, b, c], .. }) => distance_squared(x, &closest_on_triangle(x, a, b, c)).sqrt(),
            Self::Side([a, b]) => distance_squared(x, &closest_on_segment(x, a, b)).sqrt(),
        }
    }
}

/// A triangle with its unit normal, twice its area, and how good it is.
struct Facet {
    corners: [Point; 3],
    normal: Point,
    double: f64,
    quality: Quality,
}

impl Facet {
    /// None without area.
    fn new(corners: [Point; 3], ups: [&Point; 3]) -> Option<Self> {
        let [a, b, c] = &corners;
        let raw = cross(&subtract(b, a), &subtract(c, a));
        let double = dot(&raw, &raw).sqrt();
        let longest_squared = distance_squared(a, b).max(distance_squared(b, c)).max(distance_squared(c, a));
        let normal = raw.map(|part| part / double);
        let lean = ups.iter().map(|up| dot(&normal, up)).fold(1.0, f64::min);
        (double > 0.0).then(|| Self { normal, double, quality: Quality { lean, height: double / longest_squared }, corners })
    }

    /// Whether it is as good as it has to be, or as what was there before: beside sharp edges triangles lean from the normals there.
    fn serves(&self, least: Quality, old: Option<&Self>) -> bool {
        let own = self.quality;
        let Some(Quality { lean, height }) = old.map(|old| old.quality) else {
            return own.lean >= least.lean && own.height >= least.height;
        };
        let lean = (lean.min(least.lean) - ROUNDED).max(POOR.lean.min(lean - ROUNDED)).max(LEAST_LEAN);
        own.lean >= lean && own.height >= height.min(least.height)
    }

    /// How far inside a place is, seen along the normal: the least of its shares in the corners.
    fn depth(&self, x: &Point) -> f64 {
        let share = |k: usize| {
            let (a, b) = (&self.corners[k], &self.corners[(k + 1) % 3]);
            dot(&self.normal, &cross(&subtract(b, a), &subtract(x, a)))
        };
        share(0).min(share(1)).min(share(2)) / self.double
    }
}

impl<'a> Decimation<'a> {
    fn new(mesh: &TriMesh, faces: &'a Faces, farthest: f64) -> Self {
        let beyond = mesh.vertices.len() as u32;
        let points: Vec<Point> = mesh.vertices.iter().map(|vertex| vertex.to_array()).chain([[0.0; 3]]).collect();
        let joined = HalfEdges::new(points.clone(), &mesh.triangles);
        let singles = (0..3 * joined.triangles()).filter(|&half| joined.twin(half) == NONE);
        let sides: Vec<[u32; 2]> = singles.map(|half| [mesh.triangles[half as usize / 3][half as usize % 3], joined.end(half)]).collect();
        let all: Vec<[u32; 3]> = mesh.triangles.iter().copied().chain(sides.iter().map(|&[a, b]| [b, a, beyond])).collect();
        let mut is_border = vec![false; points.len()];
        sides.iter().flatten().for_each(|&end| is_border[end as usize] = true);
        let mut ups = vec![[0.0; 3]; points.len()];
        for triangle in 0..mesh.triangles.len() as u32 {
            let corners = mesh.points_of(triangle);
            for (k, corner) in mesh.triangles[triangle as usize].into_iter().enumerate() {
                let [a, b] = [1, 2].map(|step| subtract(&corners[(k + step) % 3], &corners[k]));
                let raw = cross(&a, &b);
                // By the angle there: long needles on one side of a sharp edge tell no more than short ones on the other (Thuermer and Wuethrich, "Computing vertex normals from polygonal facets", 1998).
                let (normal, angle) = (unit(&raw), dot(&raw, &raw).sqrt().atan2(dot(&a, &b)));
                let up = &mut ups[corner as usize];
                *up = std::array::from_fn(|axis| up[axis] + angle * normal[axis]);
            }
        }
        ups.iter_mut().for_each(|up| *up = unit(up));
        let around = Incidence::new(points.len(), &all);
        let (count, joined) = (points.len(), HalfEdges::new(points, &all));
        let mut mender = Mender::default();
        mender.start(&joined);
        // Where sides have more triangles than two, none of these may change.
        let ends = |corners: &[u32; 3]| [0, 1, 2].map(|k| [corners[k], corners[(k + 1) % 3]]).map(|[a, b]| [a.min(b), a.max(b)]);
        let halves = (0..3 * joined.triangles()).filter(|&half| !is_joined(&joined, half));
        let odd: HashSet<[u32; 2]> = halves.map(|half| ends(&all[half as usize / 3])[half as usize % 3]).collect();
        let mut is_odd = vec![false; count];
        if !odd.is_empty() {
            let at_odd = all.iter().filter(|corners| ends(corners).iter().any(|ends| odd.contains(ends)));
            at_odd.flatten().for_each(|&corner| is_odd[corner as usize] = true);
        }
        let may_move = |vertex: u32| {
            !is_odd[vertex as usize]
                && joined.star(vertex, MOST_AROUND, &mut mender.star)
                && mender.star.halves.len() == around.at(vertex).len()
                && mender.star.ring.iter().filter(|&&other| other == beyond).count() <= 1
        };
        let may_move = (0..beyond).map(may_move).collect();
        let (removed, fresh, old, lengths) = (Removed::new(all.len(), beyond as usize), Vec::new(), Vec::new(), Vec::new());
        let (moved, next_of) = (vec![0.0; count], (0..count as u32).collect());
        Self {
            faces,
            mesh: joined,
            beyond,
            ups,
            is_border,
            may_move,
            farthest,
            moved,
            next_of,
            least: FAIR,
            mender,
            removed,
            fresh,
            old,
            lengths,
        }
    }

    /// Removes vertices as long as none that is gone is farther from what is left than a share of what it may be off, along sides that are no longer than a share of the longest one around it.
    fn sweep(&mut self, may_be_off: &[f64], share: f64, short: f64, budget: &Budget) -> Result<(), Stopped> {
        self.least = if short < 1.0 { POOR } else { FAIR };
        for vertex in 0..self.beyond {
            if vertex.is_multiple_of(IN_A_ROW) {
                budget.cancel.check()?;
            }
            if !self.may_move[vertex as usize] || !self.begin(vertex) {
                continue;
            }
            let longest = self.lengths.iter().map(|length| length.0).fold(0.0, f64::max);
            for index in 0..self.lengths.len() {
                let (length, m) = self.lengths[index];
                if length > short * short * longest {
                    break;
                }
                let Some(moved) = self.farthest_of(vertex, m) else { continue };
                if self.serves(m, may_be_off, share) && self.mender.keeps_manifold(&self.mesh, m) {
                    self.collapse(vertex, m, moved);
                    break;
                }
            }
        }
        Ok(())
    }

    /// None of what is beyond the border, which is nowhere.
    fn facet(&self, corners: [u32; 3]) -> Option<Facet> {
        if corners.contains(&self.beyond) {
            return None;
        }
        Facet::new(corners.map(|corner| self.mesh.points[corner as usize]), corners.map(|corner| &self.ups[corner as usize]))
    }

    /// Looks at what is around a vertex, and where it may move: what is on the border goes along it. False where it is gone.
    fn begin(&mut self, vertex: u32) -> bool {
        if !self.mesh.star(vertex, MOST_AROUND, &mut self.mender.star) {
            return false;
        }
        let mut old = std::mem::take(&mut self.old);
        let Self { mesh, beyond, mender, removed, lengths, .. } = &mut *self;
        let ring = &mender.star.ring;
        removed.look(vertex, &mender.star);
        let count = ring.len();
        lengths.clear();
        let at_beyond = ring.iter().position(|other| other == beyond);
        let may_go = |m: usize| at_beyond.is_none_or(|beyond| (m + 1) % count == beyond || (beyond + 1) % count == m);
        let all = ring.iter().enumerate().filter(|&(m, _)| may_go(m));
        lengths.extend(all.map(|(m, &other)| (distance_squared(&mesh.points[vertex as usize], &mesh.points[other as usize]), m)));
        lengths.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let ring = &self.mender.star.ring;
        old.clear();
        old.extend((0..count).map(|k| self.facet([vertex, ring[k], ring[(k + 1) % count]]).map(Fresh::Triangle)));
        self.old = old;
        true
    }

    /// What the star's triangle k becomes where its vertex moves to ring m; none where that does not serve.
    fn made(&self, m: usize, k: usize) -> Option<Fresh> {
        let ring = &self.mender.star.ring;
        let corners = [ring[m], ring[k], ring[(k + 1) % ring.len()]];
        if let Some(beyond) = corners.iter().position(|&corner| corner == self.beyond) {
            return Some(Fresh::Side([1, 2].map(|step| self.mesh.points[corners[(beyond + step) % 3] as usize])));
        }
        let facet = self.facet(corners)?;
        let old = match &self.old[k] {
            Some(Fresh::Triangle(old)) => Some(old),
            _ => None,
        };
        facet.serves(self.least, old).then_some(Fresh::Triangle(facet))
    }

    /// Whether the star's vertex may move to ring m: with nothing that is gone farther from what is left, nor the middles of sides before and after from each other, nor the latter from what there was at first: around a bore vertices that are gone lie in what is beside it, however far sides cut into it.
    fn serves(&mut self, m: usize, may_be_off: &[f64], share: f64) -> bool {
        let mut fresh = std::mem::take(&mut self.fresh);
        fresh.clear();
        let count = self.mender.star.ring.len();
        let is_made = kept(Some(m), count).all(|k| self.made(m, k).map(|own| fresh.push(own)).is_some());
        self.fresh = fresh;
        if !is_made {
            return false;
        }
        let Self { faces, mesh, beyond, is_border, removed, fresh, old, mender, .. } = self;
        let Removed { around, owners, .. } = removed;
        owners.clear();
        let serves = around.iter().all(|&vertex| {
            let most = share * may_be_off[vertex as usize];
            let owner = standing(fresh.iter(), &mesh.points[vertex as usize], is_border[vertex as usize], most);
            owners.extend(owner);
            owner.is_some()
        });
        let (ring, vertex) = (&mender.star.ring, around[0]);
        let most = share * may_be_off[vertex as usize];
        let middle = |a: u32, b: u32| between(&mesh.points[a as usize], &mesh.points[b as usize], 0.5);
        let are_before = || {
            ring.iter().filter(|other| *other != beyond).all(|&other| standing(fresh.iter(), &middle(vertex, other), false, most).is_some())
        };
        let mut others = (0..count).filter(|&k| k != m && (k + 1) % count != m && (m + 1) % count != k && ring[k] != *beyond);
        let is_after = |k: usize| {
            let middle = middle(ring[m], ring[k]);
            standing(old.iter().flatten(), &middle, false, most).is_some() && faces.have_within(&middle, most)
        };
        serves && are_before() && others.all(is_after)
    }

    /// No less than how far all that became the star's vertex is from ring m; none where that is too far.
    fn farthest_of(&self, vertex: u32, m: usize) -> Option<f64> {
        let at = |vertex: u32| &self.mesh.points[vertex as usize];
        let to = at(self.mender.star.ring[m]);
        let most = self.moved[vertex as usize] + distance_squared(at(vertex), to).sqrt();
        if most <= self.farthest {
            return Some(most);
        }
        let others = std::iter::successors(Some(vertex), |&other| Some(self.next_of[other as usize]).filter(|&next| next != vertex));
        let exact = others.map(|other| distance_squared(at(other), to)).fold(0.0, f64::max).sqrt();
        (exact <= self.farthest).then_some(exact)
    }

    /// Makes the star's vertex ring m, from which what became it is no farther than told.
    fn collapse(&mut self, vertex: u32, m: usize, moved: f64) {
        let target = self.mender.star.ring[m];
        let farthest = &mut self.moved[target as usize];
        *farthest = farthest.max(moved);
        self.next_of.swap(vertex as usize, target as usize);
        self.mesh.collapse(vertex, &self.mender.star, m);
        self.removed.remove(&self.mender.star, m);
    }

    /// What is left, and what its triangles are called here.
    fn left(&self) -> (TriMesh, Vec<u32>) {
        let (points, triangles, numbers) = self.mesh.compact();
        let beyond = numbers[self.beyond as usize];
        let is_left = |triangle: &u32| self.mesh.triangle(*triangle).is_some();
        let all = triangles.into_iter().zip((0..self.mesh.triangles()).filter(is_left));
        let (triangles, names) = all.filter(|(triangle, _)| !triangle.contains(&beyond)).unzip();
        (TriMesh { vertices: points.into_iter().map(DVec3::from_array).collect(), triangles }, names)
    }

    /// Calls `visit` with the corners of a triangle, and the vertices that it stands for.
    fn each_vertex(&self, triangle: u32, mut visit: impl FnMut(u32)) {
        self.mesh.triangle(triangle).into_iter().flatten().for_each(&mut visit);
        self.removed.each(triangle, visit);
    }
}

//! What of closed surfaces that cross themselves bounds all that they wind around.
//!
//! Two triangles cross along a segment. Its ends are where a side of one meets the other, or a corner of both; two segments of a triangle cross where three triangles do. The triangles are cut along all of these, so that pieces meet in common corners and sides alone, two at a side, or four where two triangles cross. There the numbers of times that the surface winds around
//! what is before and behind each piece follow from those of one; they are the same wherever pieces hang together. Kept are the pieces behind which it winds once more than told, and before which it does not.
//!
//! How often a surface that is everywhere as far out winds around a place is the Euler number of what the ball around that has of what it is out from (the normal cycle: Federer, "Curvature measures", 1959, 5.8). For a surface that is 0 or less where bumps reach through the ball; for a solid, and for what is outside it, seldom. So of closed surfaces the outer and the inner sheet are cut each by itself, the inner one with everything winding once more, and then together.
//!
//! Which sides meet which triangles is exact. Where an end is, and which segments of a triangle cross, is not: so all that is known of the outcome is how far its corners are from the triangles that they are said to be on, and whether numbers agree all around. Triangles that touch each other, or lie on each other, are not cut.

use super::sheets::{Name, Sheets};
use super::skin::{Edge, Skin, edges};
use crate::attractor::cell::{Point, between, cross, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::faces::Shares;
use crate::dilation::arrangement::plane::{Mesh, corners, handle, join};
use crate::dilation::surface::NameMap;
use crate::groups::Groups;
use crate::measure::triangle::closest_on_triangle;
use crate::solid::contact::side;
use crate::solid::half_edges::NONE;
use crate::solid::{Crossings, Inside, TriMesh};
use glam::DVec3;
use rayon::prelude::*;
use robust::{Coord, orient2d};
use spade::{Point2, Triangulation};
use std::collections::{BTreeMap, HashSet};

/// Pairs of triangles that cross at most, for each triangle.
const MOST_CROSSINGS: usize = 16;
/// How far before and behind a piece it is asked how often the surface winds around that, as shares of its longest side: the nearest that is not lost to rounding tells, as where sheets fold back others are near.
const BESIDE: [f64; 3] = [1e-10, 1e-8, 1e-6];
/// How long a piece is at least, as a share of coordinates, that it is asked at.
const TOLD: f64 = 1e-7;
/// Segments of a triangle at most.
const MOST_SEGMENTS: usize = 1_000;
/// Triangles one after the other.
const IN_A_ROW: usize = 16;
/// What is no volume, as a share of what its parts have.
const SAME: f64 = 1e-9;

/// Pieces of a surface.
pub(super) struct Pieces {
    /// The corners of the surface, and those of pieces.
    pub(super) vertices: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The triangle that each is of.
    pub(super) owners: Vec<u32>,
    /// How far corners are from triangles that they are on, at most.
    pub(super) off: f64,
    pub(super) is_cut: bool,
}

/// Where a triangle is cut, from vertex to vertex, and the other one that crosses it there.
#[derive(Clone, Copy)]
struct Segment {
    ends: [u32; 2],
    other: u32,
}

/// A surface that is cut.
struct Cutting<'a> {
    mesh: &'a TriMesh,
    vertices: Vec<Point>,
    /// Vertices on sides, with these and how far along.
    on_sides: NameMap<[u32; 2], Vec<(f64, u32)>>,
    /// Vertices by the side and the triangle that meet there, or by the three triangles.
    names: NameMap<[u32; 3], u32>,
    segments: Vec<Vec<Segment>>,
    /// Vertices where others cross the segment of two triangles, and how far along.
    on_segments: NameMap<[u32; 2], Vec<(f64, u32)>>,
    off: f64,
}

impl Pieces {
    /// What bounds all that sheets wind around, those that hang together each by itself first: those whose feet bound something as a surface seen from there, as the inner sheet of a closed surface does, wind around all that they do not. None where triangles touch each other, or lie on each other, or rounding hides how they cross.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn of(sheets: &Sheets, skin: &Skin, round: &(impl Fn(f64) -> f64 + Sync), budget: &Budget) -> Result<Option<Self>, Stopped> {
        let mut all = Self { vertices: sheets.vertices.clone(), triangles: Vec::new(), owners: Vec::new(), off: 0.0, is_cut: false };
        let parts = parts(sheets.vertices.len(), &sheets.triangles);
        let foot = |corner: u32| &skin.places[sheets.feet[corner as usize] as usize];
        for part in &parts {
            let corners = || part.iter().map(|&triangle| sheets.triangles[triangle as usize]);
            let volumes = corners().map(|[a, b, c]| dot(foot(a), &cross(foot(b), foot(c))));
            let (volume, size) = volumes.fold((0.0, 0.0), |(volume, size): (f64, f64), own| (volume + own, size + own.abs()));
            // Which of two sheets is the inner one has to be told; where both hang together, as around a border, none is.
            let owners = part.iter().map(|&triangle| sheets.owners[triangle as usize]).filter(|&owner| owner != NONE);
            let least = owners.clone().min();
            let is_double = owners.filter(|owner| Some(*owner) == least).count() > 1;
            if !is_double && volume.abs() <= SAME * size {
                return Ok(None);
            }
            let level = if !is_double && volume < 0.0 { -1 } else { 0 };
            let mut names: Vec<u32> = corners().flatten().collect();
            names.sort_unstable();
            names.dedup();
            let number = |corner: u32| names.partition_point(|&name| name < corner) as u32;
            let vertices = names.iter().map(|&name| DVec3::from_array(sheets.vertices[name as usize])).collect();
            let mesh = TriMesh { vertices, triangles: corners().map(|corners| corners.map(number)).collect() };
            let Some(pieces) = Self::outer(&mesh, level, round, budget)? else { return Ok(None) };
            let first = (all.vertices.len() - names.len()) as u32;
            all.vertices.extend_from_slice(&pieces.vertices[names.len()..]);
            let name = |corner: u32| names.get(corner as usize).copied().unwrap_or(first + corner);
            all.triangles.extend(pieces.triangles.iter().map(|corners| corners.map(name)));
            all.owners.extend(pieces.owners.iter().map(|&owner| part[owner as usize]));
            (all.off, all.is_cut) = (all.off.max(pieces.off), all.is_cut | pieces.is_cut);
        }
        if parts.len() < 2 {
            return Ok(Some(all));
        }
        let mesh = TriMesh { vertices: all.vertices.iter().copied().map(DVec3::from_array).collect(), triangles: all.triangles };
        let Some(pieces) = Self::outer(&mesh, 0, round, budget)? else { return Ok(None) };
        let owners = pieces.owners.iter().map(|&owner| all.owners[owner as usize]).collect();
        Ok(Some(Self { owners, off: all.off + pieces.off, is_cut: all.is_cut | pieces.is_cut, ..pieces }))
    }

    /// The pieces of a closed surface that bound all around which it winds more often than told, turned away from that, with coordinates that are rounded: all of it where it crosses itself nowhere. None as above.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn outer(
        mesh: &TriMesh,
        level: i64,
        round: &(impl Fn(f64) -> f64 + Sync),
        budget: &Budget,
    ) -> Result<Option<Self>, Stopped> {
        let number = mesh.triangles.len();
        let crossings = Crossings::among(mesh, MOST_CROSSINGS * number, budget)?;
        if crossings.count as usize > crossings.first.len() {
            return Ok(None);
        }
        let vertices = mesh.vertices.iter().map(DVec3::to_array).collect();
        if crossings.count == 0 {
            return Ok(Some(Self {
                vertices,
                triangles: mesh.triangles.clone(),
                owners: (0..number as u32).collect(),
                off: 0.0,
                is_cut: false,
            }));
        }
        let mut cutting = Cutting {
            mesh,
            vertices,
            on_sides: NameMap::default(),
            names: NameMap::default(),
            segments: vec![Vec::new(); number],
            on_segments: NameMap::default(),
            off: 0.0,
        };
        if crossings.first.iter().any(|pair| cutting.cross(*pair).is_none()) || !cutting.cross_segments(budget)? {
            return Ok(None);
        }
        for all in cutting.on_sides.values_mut().chain(cutting.on_segments.values_mut()) {
            all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
        let numbers: Vec<u32> = (0..number as u32).collect();
        let cut = |row: &[u32]| {
            budget.cancel.check()?;
            Ok(row.iter().map(|&triangle| cutting.pieces(triangle)).collect::<Option<Vec<_>>>())
        };
        let cut: Vec<Option<Vec<Vec<[u32; 3]>>>> = numbers.par_chunks(IN_A_ROW).map(cut).collect::<Result<_, Stopped>>()?;
        let Some(cut) = cut.into_iter().collect::<Option<Vec<_>>>() else { return Ok(None) };
        let (mut triangles, mut owners) = (Vec::new(), Vec::new());
        for (pieces, owner) in cut.into_iter().flatten().zip(0..) {
            owners.resize(owners.len() + pieces.len(), owner);
            triangles.extend(pieces);
        }
        let Cutting { mut vertices, mut off, .. } = cutting;
        let Some(labels) = labels(mesh, &vertices, &triangles, &owners, budget)? else { return Ok(None) };
        for vertex in &mut vertices[mesh.vertices.len()..] {
            let rounded = vertex.map(round);
            off = off.max(distance_squared(vertex, &rounded).sqrt());
            *vertex = rounded;
        }
        let kept = triangles.into_iter().zip(owners).zip(labels).filter(|(_, label)| *label == level).map(|(own, _)| own);
        let (triangles, owners): (Vec<[u32; 3]>, Vec<u32>) = kept.unzip();
        // Vertices that rounding brings together are one: triangles that lose their area with that have neighbours that come to have a common side.
        let mut first: NameMap<[u64; 3], u32> = NameMap::default();
        let numbers: Vec<u32> =
            (0..).zip(&vertices).map(|(number, vertex)| *first.entry(vertex.map(f64::to_bits)).or_insert(number)).collect();
        let one = |(corners, owner): ([u32; 3], u32)| {
            let [a, b, c] = corners.map(|corner| numbers[corner as usize]);
            (a != b && b != c && c != a).then_some(([a, b, c], owner))
        };
        let (triangles, owners) = triangles.into_iter().zip(owners).filter_map(one).unzip();
        Ok(Some(Self { vertices, triangles, owners, off, is_cut: true }))
    }

    /// Which triangles of sheets are left as they were.
    pub(super) fn whole(&self, sheets: &Sheets) -> Vec<bool> {
        let mut whole = vec![false; sheets.triangles.len()];
        for (piece, &owner) in self.triangles.iter().zip(&self.owners) {
            whole[owner as usize] = *piece == sheets.triangles[owner as usize];
        }
        whole
    }

    /// What the triangles of sheets are called that have no fault, and whether they are whole.
    pub(super) fn good(&self, sheets: &Sheets, faults: &[(u32, bool)]) -> HashSet<(Name, bool)> {
        let is_fault: HashSet<u32> = faults.iter().map(|fault| fault.0).collect();
        let all = (0..).zip(self.whole(sheets)).filter(|(triangle, _)| !is_fault.contains(triangle));
        all.map(|(triangle, is_whole)| (sheets.name(triangle), is_whole)).collect()
    }

    /// Takes away parts that hang together and bound nothing that is to be left out, if it was cut: told of each by its triangles.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn fill(&mut self, is_none: impl Fn(&[[Point; 3]]) -> Result<bool, Stopped> + Sync) -> Result<(), Stopped> {
        if !self.is_cut {
            return Ok(());
        }
        let parts = joined_at_sides(&self.triangles);
        let is_gone = |part: &Vec<u32>| is_none(&part.iter().map(|&piece| self.corners(piece)).collect::<Vec<_>>());
        let gone: Vec<bool> = parts.par_iter().map(is_gone).collect::<Result<_, Stopped>>()?;
        let mut is_kept = vec![true; self.triangles.len()];
        parts.iter().zip(gone).filter(|(_, gone)| *gone).flat_map(|(part, _)| part).for_each(|&piece| is_kept[piece as usize] = false);
        let both = self.triangles.iter().copied().zip(self.owners.iter().copied()).zip(is_kept);
        (self.triangles, self.owners) = both.filter(|(_, is_kept)| *is_kept).map(|(own, _)| own).unzip();
        Ok(())
    }

    pub(super) fn corners(&self, piece: u32) -> [Point; 3] {
        self.triangles[piece as usize].map(|corner| self.vertices[corner as usize])
    }
}

impl Cutting<'_> {
    fn at(&self, vertex: u32) -> &Point {
        &self.vertices[vertex as usize]
    }

    /// Finds where two triangles cross.
    fn cross(&mut self, [one, other]: [u32; 2]) -> Option<()> {
        let names = [one, other].map(|triangle| self.mesh.triangles[triangle as usize]);
        let shared: Vec<u32> = names[0].into_iter().filter(|corner| names[1].contains(corner)).collect();
        let mut ends = shared.clone();
        // With a common side they lie on each other, or have no area.
        if shared.len() > 1 {
            return Some(());
        }
        for (own, theirs, triangle) in [(names[0], names[1], other), (names[1], names[0], one)] {
            for k in 0..3 {
                let side = [own[k], own[(k + 1) % 3]];
                if !side.iter().any(|end| shared.contains(end)) && self.meets(side, &theirs)? {
                    ends.push(self.meet(side, triangle));
                }
            }
        }
        let ends: [u32; 2] = ends.try_into().ok()?;
        self.segments[one as usize].push(Segment { ends, other });
        self.segments[other as usize].push(Segment { ends, other: one });
        Some(())
    }

    /// Whether a side goes through the inside of a triangle; none where it touches its border, or ends on it.
    fn meets(&self, ends: [u32; 2], triangle: &[u32; 3]) -> Option<bool> {
        let ([p, q], [a, b, c]) = (ends.map(|end| self.at(end)), triangle.map(|corner| self.at(corner)));
        let sides = [side(a, b, c, p), side(a, b, c, q)];
        if sides[0] * sides[1] > 0.0 {
            return Some(false);
        }
        let turns = [side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)];
        if turns.iter().any(|&turn| turn > 0.0) && turns.iter().any(|&turn| turn < 0.0) {
            return Some(false);
        }
        (sides[0] * sides[1] < 0.0 && turns.iter().all(|&turn| turn != 0.0)).then_some(true)
    }

    /// The vertex where a side goes through a triangle.
    fn meet(&mut self, side_ends: [u32; 2], triangle: u32) -> u32 {
        let ends = [side_ends[0].min(side_ends[1]), side_ends[0].max(side_ends[1])];
        let name = [ends[0], ends[1], triangle];
        if let Some(&vertex) = self.names.get(&name) {
            return vertex;
        }
        let corners = self.mesh.triangles[triangle as usize].map(|corner| *self.at(corner));
        let [a, b, c] = &corners;
        let [p, q] = ends.map(|end| *self.at(end));
        let [own, other] = [side(a, b, c, &p), side(a, b, c, &q)];
        let share = own / (own - other);
        let at = between(&p, &q, share);
        let vertex = self.add(at, &[triangle]);
        self.names.insert(name, vertex);
        self.on_sides.entry(ends).or_default().push((share, vertex));
        vertex
    }

    fn add(&mut self, at: Point, on: &[u32]) -> u32 {
        for &triangle in on {
            let [a, b, c] = self.mesh.triangles[triangle as usize].map(|corner| *self.at(corner));
            self.off = self.off.max(distance_squared(&at, &closest_on_triangle(&at, &a, &b, &c)).sqrt());
        }
        self.vertices.push(at);
        self.vertices.len() as u32 - 1
    }

    /// Finds where three triangles cross: whether they do so the first of them tells. Whether all of them have such segments, and none has too many.
    fn cross_segments(&mut self, budget: &Budget) -> Result<bool, Stopped> {
        for triangle in 0..self.segments.len() as u32 {
            let count = self.segments[triangle as usize].len();
            if count > MOST_SEGMENTS {
                return Ok(false);
            }
            if count < 2 {
                continue;
            }
            budget.cancel.check()?;
            let Some(shares) = self.shares(triangle) else { return Ok(false) };
            let own: Vec<Segment> = self.segments[triangle as usize].iter().copied().filter(|own| own.other > triangle).collect();
            let flat: Vec<[[f64; 2]; 2]> = own.iter().map(|own| own.ends.map(|end| shares.of(self.at(end)))).collect();
            for (k, l) in (0..own.len()).flat_map(|l| (0..l).map(move |k| (k, l))) {
                if own[k].ends.iter().any(|end| own[l].ends.contains(end)) {
                    continue;
                }
                let Some(shares) = crossing(&flat[k], &flat[l]) else { continue };
                let others = [own[k].other, own[l].other];
                let Some(third) = self.segments[others[0] as usize].iter().find(|third| third.other == others[1]).copied() else {
                    return Ok(false);
                };
                let at = between(self.at(own[k].ends[0]), self.at(own[k].ends[1]), shares[0]);
                let vertex = self.add(at, &[triangle, others[0], others[1]]);
                let [from, to] = third.ends.map(|end| *self.at(end));
                let way = subtract(&to, &from);
                let share = dot(&subtract(&at, &from), &way) / dot(&way, &way);
                let pairs = [[triangle, others[0]], [triangle, others[1]], others];
                for (pair, share) in pairs.into_iter().zip([shares[0], shares[1], share]) {
                    self.on_segments.entry([pair[0].min(pair[1]), pair[0].max(pair[1])]).or_default().push((share, vertex));
                }
            }
        }
        Ok(true)
    }

    /// Coordinates in a triangle; none where it has no area.
    fn shares(&self, triangle: u32) -> Option<Shares> {
        Shares::new(&self.mesh.triangles[triangle as usize].map(|corner| *self.at(corner)))
    }

    /// The pieces of a triangle; none where rounding hides what these are.
    fn pieces(&self, triangle: u32) -> Option<Vec<[u32; 3]>> {
        let (names, segments) = (self.mesh.triangles[triangle as usize], &self.segments[triangle as usize]);
        if segments.is_empty() {
            return Some(vec![names]);
        }
        let mut plane = Plane::default();
        for (corner, place) in names.into_iter().zip([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]) {
            plane.add(corner, place)?;
        }
        plane.sides = vec![0b101, 0b011, 0b110];
        for k in 0..3 {
            let [from, to] = [names[k], names[(k + 1) % 3]];
            let ends = [from.min(to), from.max(to)];
            let mut chain = vec![ends[0]];
            for &(share, vertex) in self.on_sides.get(&ends).into_iter().flatten() {
                let along = if from < to { share } else { 1.0 - share };
                plane.add(vertex, [[along, 0.0], [1.0 - along, along], [0.0, 1.0 - along]][k])?;
                plane.sides.push(1 << k);
                chain.push(vertex);
            }
            chain.push(ends[1]);
            plane.join(&chain)?;
        }
        let shares = self.shares(triangle)?;
        for Segment { ends, other } in segments {
            let pair = [triangle.min(*other), triangle.max(*other)];
            let middle = self.on_segments.get(&pair).into_iter().flatten().map(|&(_, vertex)| vertex);
            let chain: Vec<u32> = std::iter::once(ends[0]).chain(middle).chain([ends[1]]).collect();
            for &vertex in &chain {
                if !plane.vertices.contains(&vertex) {
                    plane.add(vertex, shares.of(self.at(vertex)))?;
                    plane.sides.push(0);
                }
            }
            plane.join(&chain)?;
        }
        Some(plane.triangles())
    }
}

/// The triangles of each of the surfaces that hang together.
fn parts(vertices: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let groups = Groups::of_triangles(vertices, triangles).all();
    grouped(triangles.iter().map(|corners| groups[corners[0] as usize]))
}

/// The same of those that hang together at sides: what meets others at vertices alone is a part.
fn joined_at_sides(triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut groups = Groups::new(triangles.len());
    for pair in edges(triangles).windows(2).filter(|pair| pair[0].ends == pair[1].ends) {
        groups.join(pair[0].triangle as usize, pair[1].triangle as usize);
    }
    grouped(groups.all())
}

/// Numbers from 0 on by the group that each is in.
fn grouped(groups: impl IntoIterator<Item = u32>) -> Vec<Vec<u32>> {
    let mut all: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (number, group) in (0..).zip(groups) {
        all.entry(group).or_default().push(number);
    }
    all.into_values().collect()
}

/// How far along both of two segments they cross, if they do.
fn crossing(one: &[[f64; 2]; 2], other: &[[f64; 2]; 2]) -> Option<[f64; 2]> {
    let coordinate = |place: &[f64; 2]| Coord { x: place[0], y: place[1] };
    let turn = |line: &[[f64; 2]; 2], place: &[f64; 2]| orient2d(coordinate(&line[0]), coordinate(&line[1]), coordinate(place));
    let [of_one, of_other] = [(other, one), (one, other)].map(|(line, own)| own.each_ref().map(|place| turn(line, place)));
    let share = |turns: &[f64; 2]| turns[0] / (turns[0] - turns[1]);
    (of_one[0] * of_one[1] < 0.0 && of_other[0] * of_other[1] < 0.0).then(|| [share(&of_one), share(&of_other)])
}

/// A triangle that is cut along lines.
#[derive(Default)]
struct Plane {
    mesh: Mesh<Point2<f64>>,
    vertices: Vec<u32>,
    /// Which sides each is on.
    sides: Vec<u8>,
}

impl Plane {
    fn add(&mut self, vertex: u32, [x, y]: [f64; 2]) -> Option<()> {
        self.vertices.push(vertex);
        self.mesh.insert(Point2::new(x, y)).ok()?;
        (self.mesh.num_vertices() == self.vertices.len()).then_some(())
    }

    /// Makes edges along a chain of vertices.
    fn join(&mut self, chain: &[u32]) -> Option<()> {
        let number = |vertex: &u32| self.vertices.iter().position(|own| own == vertex).map(|number| handle(number as u32));
        let handles: Vec<_> = chain.iter().map(number).collect::<Option<_>>()?;
        for pair in handles.windows(2) {
            if !self.mesh.exists_constraint(pair[0], pair[1]) {
                join(&mut self.mesh, pair[0], pair[1]).then_some(())?;
            }
        }
        Some(())
    }

    /// All triangles but those that rounding makes along a side.
    fn triangles(&self) -> Vec<[u32; 3]> {
        let all = self.mesh.inner_faces().map(corners);
        let kept = all.filter(|corners| corners.iter().fold(0b111, |sides, &corner| sides & self.sides[corner as usize]) == 0);
        kept.map(|corners| corners.map(|corner| self.vertices[corner as usize])).collect()
    }
}

/// How often a surface winds around what is before each of its pieces; none where that is not the same all around one that hangs together.
fn labels(mesh: &TriMesh, vertices: &[Point], pieces: &[[u32; 3]], owners: &[u32], budget: &Budget) -> Result<Option<Vec<i64>>, Stopped> {
    let mut groups = Groups::new(pieces.len());
    // Two pieces on each side of an edge where two triangles cross: first what is before the other triangle.
    let mut crossed: Vec<[u32; 4]> = Vec::new();
    let normal = |triangle: u32| {
        let [a, b, c] = mesh.points_of(triangle);
        cross(&subtract(&b, &a), &subtract(&c, &a))
    };
    for edge in edges(pieces).chunk_by(|a, b| a.ends == b.ends) {
        let is_along = |own: &Edge| own.of(pieces)[0] == own.ends[0];
        match *edge {
            [one, other] if is_along(&one) != is_along(&other) => {
                groups.join(one.triangle as usize, other.triangle as usize);
            }
            [_, _, _, _] => {
                let owner = owners[edge[0].triangle as usize];
                let (mut own, mut others): (Vec<&Edge>, Vec<&Edge>) = edge.iter().partition(|edge| owners[edge.triangle as usize] == owner);
                let [first, second] = [&mut own, &mut others].map(|both| {
                    both.sort_by_key(|edge| !is_along(edge));
                    match both[..] {
                        [along, against] if is_along(along) && !is_along(against) => Some([along.triangle, against.triangle]),
                        _ => None,
                    }
                });
                let (Some(own), Some(others)) = (first, second) else { return Ok(None) };
                let way = subtract(&vertices[edge[0].ends[1] as usize], &vertices[edge[0].ends[0] as usize]);
                let [n, m] = [own[0], others[0]].map(|piece| normal(owners[piece as usize]));
                // Across the edge, from it over the piece that has it along its way.
                let is_before = dot(&cross(&n, &way), &m) > 0.0;
                let [a, b] = if is_before { own } else { [own[1], own[0]] };
                let [c, d] = if is_before { [others[1], others[0]] } else { others };
                crossed.push([a, b, c, d]);
            }
            _ => return Ok(None),
        }
    }
    budget.cancel.check()?;
    let groups = groups.all();
    let mut ways: Vec<Vec<(u32, i64)>> = vec![Vec::new(); pieces.len()];
    for all in crossed {
        let [a, b, c, d] = all.map(|piece| groups[piece as usize]);
        for (other, more) in [(b, 1), (c, 0), (d, 1)] {
            ways[a as usize].push((other, more));
            ways[other as usize].push((a, -more));
        }
    }
    let area = |piece: &u32| {
        let [a, b, c] = pieces[*piece as usize].map(|corner| &vertices[corner as usize]);
        let double = cross(&subtract(b, a), &subtract(c, a));
        dot(&double, &double)
    };
    // The largest piece of each group.
    let mut largest: Vec<u32> = (0..pieces.len() as u32).collect();
    for (piece, &group) in (0..).zip(&groups) {
        if area(&piece) > area(&largest[group as usize]) {
            largest[group as usize] = piece;
        }
    }
    let inside = Inside::new(mesh);
    let wide = vertices.iter().flatten().fold(0.0, |wide: f64, x| wide.max(x.abs()));
    let long = |piece: u32| {
        let [a, b, c] = pieces[piece as usize].map(|corner| &vertices[corner as usize]);
        distance_squared(a, b).max(distance_squared(b, c)).max(distance_squared(c, a)).sqrt()
    };
    // How often it winds just before a piece, where that is once less than behind it.
    let around = |piece: u32| {
        let [a, b, c] = pieces[piece as usize].map(|corner| &vertices[corner as usize]);
        let (up, long) = (unit(&normal(owners[piece as usize])), long(piece));
        let winding = |by: f64| {
            let beside = std::array::from_fn(|axis| (a[axis] + b[axis] + c[axis]) / 3.0 + by * long * up[axis]);
            inside.winding(DVec3::from_array(beside))
        };
        BESIDE.into_iter().find_map(|by| Some(winding(by)).filter(|before| winding(-by) == before + 1))
    };
    let mut labels: Vec<Option<i64>> = vec![None; pieces.len()];
    for first in 0..pieces.len() as u32 {
        if groups[first as usize] != first || labels[first as usize].is_some() {
            continue;
        }
        budget.cancel.check()?;
        let (mut all, mut next) = (vec![first], 0);
        labels[first as usize] = Some(0);
        while let Some(&group) = all.get(next) {
            next += 1;
            let own = labels[group as usize].unwrap_or_default();
            for &(other, more) in &ways[group as usize] {
                match labels[other as usize] {
                    None => {
                        labels[other as usize] = Some(own + more);
                        all.push(other);
                    }
                    Some(label) if label != own + more => return Ok(None),
                    Some(_) => {}
                }
            }
        }
        let Some(best) = all.iter().map(|&group| largest[group as usize]).max_by(|a, b| area(a).total_cmp(&area(b)).then(b.cmp(a))) else {
            continue;
        };
        let Some(before) = around(best) else { return Ok(None) };
        let more = before - labels[groups[best as usize] as usize].unwrap_or_default();
        // The others have to be so, too, as far as rounding lets it be told.
        let is_so = |&group: &u32| {
            let (piece, label) = (largest[group as usize], labels[group as usize].unwrap_or_default() + more);
            long(piece) < TOLD * wide || around(piece) == Some(label)
        };
        if !all.par_iter().all(is_so) {
            return Ok(None);
        }
        for group in all {
            labels[group as usize] = labels[group as usize].map(|label| label + more);
        }
    }
    Ok(groups.iter().map(|&group| labels[group as usize]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::Topology;
    use crate::split_mix::Random;
    use glam::DMat3;

    /// Cubes of side 1 with a corner at each of some places, all turned in the same way.
    fn cubes(corners: &[[f64; 3]], is_inward: bool) -> TriMesh {
        let turn = DMat3::from_rotation_x(0.3) * DMat3::from_rotation_y(0.7);
        let mut mesh = TriMesh { vertices: Vec::new(), triangles: Vec::new() };
        for corner in corners {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(
                (0..8)
                    .map(|k| turn * (DVec3::from_array(*corner) + DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)))),
            );
            for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
                let halves = [[a, b, c], [a, c, d]].map(|half| half.map(|k| k + first));
                mesh.triangles.extend(halves.map(|[a, b, c]| if is_inward { [a, c, b] } else { [a, b, c] }));
            }
        }
        mesh
    }

    fn cut(mesh: &TriMesh, level: i64) -> TriMesh {
        let pieces = Pieces::outer(mesh, level, &|x| x, &Budget::default()).unwrap().expect("nothing touches");
        assert!(pieces.off < 1e-12);
        TriMesh { vertices: pieces.vertices.into_iter().map(DVec3::from_array).collect(), triangles: pieces.triangles }
    }

    /// The volume inside, and whether it is a closed surface that meets itself nowhere but where several of its triangles end.
    fn volume(mesh: &TriMesh) -> f64 {
        let of = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| mesh.vertices[corner as usize]);
            a.dot(b.cross(c)) / 6.0
        };
        let topology = Topology::of(mesh, &Budget::default()).unwrap();
        assert!(topology.is_closed_manifold() && Crossings::of(mesh, &Budget::default()).unwrap().count == 0, "{topology:?}");
        mesh.triangles.iter().map(of).sum()
    }

    /// How much two cubes, or three, have in common, by the places of their corners.
    fn common(corners: &[[f64; 3]]) -> f64 {
        let wide = |axis: usize| {
            let own = corners.iter().map(|corner| corner[axis]);
            (1.0 + own.clone().fold(f64::INFINITY, f64::min) - own.fold(f64::NEG_INFINITY, f64::max)).max(0.0)
        };
        (0..3).map(wide).product()
    }

    #[test]
    fn what_cubes_bound_together_has_their_volume() {
        let mut random = Random(191);
        for _ in 0..100 {
            let all: [[f64; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| 0.9 * random.share()));
            let [a, b, c] = all;
            let pairs = common(&[a, b]) + common(&[b, c]) + common(&[c, a]);
            let of_all = 3.0 - pairs + common(&all);
            assert!((volume(&cut(&cubes(&all, false), 0)) - of_all).abs() < 1e-9);
            // What is inside two at least, and what is inside all.
            assert!((volume(&cut(&cubes(&all, false), 1)) - (pairs - 2.0 * common(&all))).abs() < 1e-9);
            assert!((volume(&cut(&cubes(&all, false), 2)) - common(&all)).abs() < 1e-9);
            // Outside of cubes that are turned inside out a surface winds once more than inside.
            assert!((volume(&cut(&cubes(&[a, b], true), -1)) + 2.0 - common(&[a, b])).abs() < 1e-9);
        }
    }

    #[test]
    fn what_touches_is_not_cut_and_what_is_apart_stays() {
        let apart = cubes(&[[0.0; 3], [1.5, 0.0, 0.0]], false);
        let pieces = Pieces::outer(&apart, 0, &|x| x, &Budget::default()).unwrap().unwrap();
        assert!(!pieces.is_cut && pieces.triangles == apart.triangles);
        let mut touching = cubes(&[[0.0; 3], [0.5, 0.0, 0.0]], false);
        touching.vertices.iter_mut().for_each(|vertex| *vertex = (*vertex * 1024.0).round() / 1024.0);
        if let Some(pieces) = Pieces::outer(&touching, 0, &|x| x, &Budget::default()).unwrap() {
            assert!(pieces.off < 1e-9);
        }
        let square = |x: f64| [[0.0, 0.0, x], [4.0, 0.0, x], [0.0, 4.0, x], [0.5, 0.5, x + 4.0]].map(DVec3::from_array);
        let triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let on_each_other = TriMesh {
            vertices: [square(0.0), square(0.0).map(|x| x + DVec3::new(0.25, 0.25, 0.0))].concat(),
            triangles: [triangles, triangles.map(|corners| corners.map(|corner| corner + 4))].concat(),
        };
        assert!(Pieces::outer(&on_each_other, 0, &|x| x, &Budget::default()).unwrap().is_none());
    }

    #[test]
    fn cutting_is_stopped() {
        let budget = Budget::default();
        budget.cancel.fire(crate::budget::StopReason::Cancelled);
        assert!(Pieces::outer(&cubes(&[[0.0; 3], [0.3, 0.4, 0.5]], false), 0, &|x| x, &budget).is_err());
    }
}

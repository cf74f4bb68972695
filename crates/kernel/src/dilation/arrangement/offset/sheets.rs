//! The sheets of a surface, one on each of its sides, strips around its border that join them, and strips along its seams that join those of its parts.

use super::coarse::lifted;
use super::seams::{Corner, Ring, Valleys, across};
use super::skin::{Skin, edges};
use crate::attractor::cell::{Point, cross, dot, subtract, unit};
use crate::dilation::surface::NameMap;
use crate::solid::half_edges::NONE;
use crate::split_mix::Random;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// The bits of where a triangle's corners are, and their feet.
pub(super) type Name = [([u64; 3], u32); 3];

/// A surface around triangles.
#[derive(Default)]
pub(super) struct Sheets {
    pub(super) vertices: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The vertices of the surface that those of the sheets are out from, and unit vectors from these.
    pub(super) feet: Vec<u32>,
    pub(super) ways: Vec<Point>,
    /// The triangle that each one is along, or none on a strip around a border.
    pub(super) owners: Vec<u32>,
}

/// How far out sheets and strips are, and by what angle a strip turns from row to row, and from column to column around a corner.
pub(super) struct Shape {
    pub(super) radius: f64,
    pub(super) rim: f64,
    pub(super) row: f64,
    pub(super) column: f64,
    /// The angle by which it turns from sheet to sheet without a row between.
    pub(super) fold: f64,
}

/// The rows of a strip at a vertex: of the side that comes first along the border, of what is around a corner, and of the other side.
struct Columns(Vec<Vec<u32>>);

/// A side that one triangle alone has, by its ends as that has them, and whether the triangle's normal is up at these.
type Outline = ([u32; 2], [bool; 2]);

/// A side of the border at one of its ends: where it leads away from the surface, seen with the vertex's normal up, for the side that comes there and the one that goes on.
#[derive(Clone, Copy, Default)]
struct Outward {
    comes: Option<Point>,
    goes: Option<Point>,
}

impl Shape {
    /// Rows of triangles along a strip.
    fn rows(&self) -> usize {
        (PI / self.row).ceil().max(2.0) as usize
    }

    /// About how many triangles sheets will have.
    pub(super) fn triangles(&self, skin: &Skin, triangles: &[[u32; 3]]) -> f64 {
        let mut borders: Vec<u32> = triangles.iter().flatten().copied().filter(|&corner| skin.is_border(corner)).collect();
        borders.sort_unstable();
        borders.dedup();
        let columns = borders.iter().map(|&corner| 1.0 + skin.turns[corner as usize].clamp(-1.0, 1.0).acos() / self.column);
        skin.sides.len() as f64 * (triangles.len() as f64 + self.rows() as f64 * columns.sum::<f64>())
    }
}

impl Sheets {
    /// The sheets along triangles of a surface; none where its border turns inward at a corner, or meets itself.
    pub(super) fn new(skin: &Skin, valleys: &Valleys, triangles: &[[u32; 3]], shape: &Shape, round: impl Fn(f64) -> f64) -> Option<Self> {
        let mut sheets = Self::default();
        let mut numbers = vec![[NONE; 2]; skin.places.len()];
        let mut is_used = vec![false; if skin.seams.all.is_empty() { 0 } else { skin.places.len() }];
        if !is_used.is_empty() {
            triangles.iter().flatten().for_each(|&corner| is_used[corner as usize] = true);
        }
        // Parts that hide each other have common corners.
        for (Ring { corners, .. }, valley) in skin.seams.rings.iter().zip(valleys) {
            if let Some(valley) = valley
                && is_used[corners[0].0 as usize]
            {
                let number = sheets.add(skin, corners[0].0, *valley, 1.0, &round);
                sheets.ways[number as usize] = unit(valley);
                corners.iter().for_each(|&(vertex, is_up)| numbers[vertex as usize][usize::from(is_up)] = number);
            }
        }
        let mut vertex = |sheets: &mut Self, foot: u32, is_up: bool| {
            let number = &mut numbers[foot as usize][usize::from(is_up)];
            if *number == NONE {
                let up = skin.ups[foot as usize];
                *number = sheets.add(skin, foot, if is_up { up } else { up.map(|part| -part) }, shape.radius, &round);
            }
            *number
        };
        let normal = |[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| &skin.places[*corner as usize]);
            unit(&cross(&subtract(b, a), &subtract(c, a)))
        };
        for (owner, corners) in (0..).zip(triangles) {
            let normal = normal(corners);
            for &side in skin.sides {
                let is_up = |corner: u32| side * dot(&normal, &skin.ups[corner as usize]) > 0.0;
                let [a, b, c] = corners.map(|corner| vertex(&mut sheets, corner, is_up(corner)));
                sheets.triangles.push(if side > 0.0 { [a, b, c] } else { [a, c, b] });
                sheets.owners.push(owner);
            }
        }
        let all = edges(triangles);
        let singles: Vec<Outline> = all
            .chunk_by(|a, b| a.ends == b.ends)
            .filter(|edge| edge.len() == 1)
            .map(|edge| {
                let normal = normal(&triangles[edge[0].triangle as usize]);
                let ends = edge[0].of(triangles);
                (ends, ends.map(|end| dot(&normal, &skin.ups[end as usize]) > 0.0))
            })
            .collect();
        // Those at the same places are of one seam; on the border a side may lead from seam to seam, too.
        let place = |ends: &[u32; 2]| {
            let [a, b] = ends.map(|end| skin.seams.first(end));
            [a.min(b), a.max(b)]
        };
        let mut at: BTreeMap<[u32; 2], Vec<Outline>> = BTreeMap::new();
        let mut borders = Vec::new();
        for side in singles {
            match side.0.iter().all(|&end| skin.seams.copies(end).is_some()) {
                true => at.entry(place(&side.0)).or_default().push(side),
                false => borders.push(side),
            }
        }
        let (seams, others): (Vec<_>, Vec<_>) = at.into_values().partition(|sides| sides.len() == 2);
        borders.extend(others.into_iter().flatten());
        let mut outward = vec![Outward::default(); if borders.is_empty() { 0 } else { skin.places.len() }];
        for ([a, b], is_up) in &borders {
            let way = subtract(&skin.places[*b as usize], &skin.places[*a as usize]);
            for (end, is_up, is_first) in [(a, is_up[0], true), (b, is_up[1], false)] {
                let way = if is_up { way } else { way.map(|part| -part) };
                let out = unit(&cross(&way, &skin.ups[*end as usize]));
                let Outward { comes, goes } = &mut outward[*end as usize];
                let slot = if is_up == is_first { goes } else { comes };
                if slot.replace(out).is_some() {
                    return None;
                }
            }
        }
        let mut at_seams = sheets.join(skin, &seams, &outward, shape, &mut vertex, &round)?;
        let mut columns = Vec::with_capacity(outward.len());
        for (foot, outward) in (0..).zip(&outward) {
            let Outward { comes: Some(comes), goes: Some(goes) } = outward else {
                columns.push(Columns(at_seams.remove(&foot).into_iter().collect()));
                continue;
            };
            let ends = [true, false].map(|is_up| vertex(&mut sheets, foot, is_up));
            columns.push(sheets.columns(skin, foot, [comes, goes], shape, ends, &round)?);
        }
        for ([a, b], is_up) in &borders {
            let column = |end: u32, is_up: bool, is_first: bool| {
                let Columns(all) = &columns[end as usize];
                let own = if is_up == is_first { all.last() } else { all.first() };
                own.map(|own| if is_up { own.clone() } else { own.iter().rev().copied().collect() })
            };
            let (from, to) = (column(*a, is_up[0], true)?, column(*b, is_up[1], false)?);
            sheets.strip(&from, &to);
        }
        for Columns(all) in &columns {
            all.windows(2).for_each(|pair| sheets.strip(&pair[0], &pair[1]));
        }
        Some(sheets)
    }

    /// Joins the sheets of parts along seams, each given by the sides of both parts, where there is room between them; none where that is so at one end alone. Returns the columns of what is on the border there.
    fn join(
        &mut self,
        skin: &Skin,
        seams: &[Vec<Outline>],
        outward: &[Outward],
        shape: &Shape,
        vertex: &mut impl FnMut(&mut Self, u32, bool) -> u32,
        round: &impl Fn(f64) -> f64,
    ) -> Option<BTreeMap<u32, Vec<u32>>> {
        // Seams that end at the border, where there is no room between parts, with the corner that these have there.
        let rings = skin.seams.rings.iter().filter(|ring| ring.is_hollow && ring.is_border && !outward.is_empty());
        let ends: Vec<(&Ring, u32)> = rings.map(|ring| (ring, vertex(self, ring.corners[0].0, ring.corners[0].1))).collect();
        let mut columns: NameMap<[Corner; 2], Vec<u32>> = NameMap::default();
        // From the sheet of one corner to that of another at the same place.
        let mut column = |sheets: &mut Self, ends: [Corner; 2]| {
            let [from, to] = ends;
            if let Some(own) = columns.get(&ends) {
                return own.clone();
            }
            let own = if from == to { vec![vertex(sheets, from.0, from.1)] } else { sheets.arc(skin, ends, shape, &mut *vertex, round) };
            columns.insert(ends, own.clone());
            columns.insert([to, from], own.iter().rev().copied().collect());
            own
        };
        for seam in seams {
            let &[(ends, is_up), (others, other_up)] = seam.as_slice() else { return None };
            let is_aligned = skin.seams.first(ends[0]) != skin.seams.first(others[0]);
            for is_above in skin.sides.iter().map(|&side| side > 0.0) {
                let corners = [0, 1].map(|k| {
                    let j = if is_aligned { 1 - k } else { k };
                    across([ends[k], others[j]], [is_up[k], other_up[j]], is_aligned, is_above)
                });
                let is_hollow = |corner: &Corner| {
                    skin.seams
                        .ring_of
                        .get(corner)
                        .map(|&ring| &skin.seams.rings[ring])
                        .filter(|ring| ring.corners.len() > 1)
                        .map(|ring| ring.is_hollow)
                };
                match corners.map(|own| is_hollow(&own[0])) {
                    [Some(true), Some(true) | None] | [None, Some(true)] => continue,
                    [Some(true), _] | [_, Some(true)] => return None,
                    _ => {}
                }
                let [from, to] = corners.map(|own| column(self, own));
                if is_above { self.strip(&from, &to) } else { self.strip(&to, &from) }
            }
        }
        // Between the columns around a place where more than two parts meet.
        for Ring { corners, is_hollow, .. } in &skin.seams.rings {
            if *is_hollow || corners.len() < 3 {
                continue;
            }
            let next = corners.iter().skip(1).chain(corners.first());
            let mut around = Vec::new();
            for (&from, &to) in corners.iter().zip(next) {
                let own = column(self, [from, to]);
                around.extend_from_slice(&own[..own.len() - 1]);
            }
            self.fill(skin, corners[0].0, &around, shape, round);
        }
        let mut at_border = BTreeMap::new();
        for (ring, top) in ends {
            let &[one, other] = ring.corners.as_slice() else { return None };
            let below = [one, other].map(|(foot, is_up)| (foot, !is_up));
            let arc = column(self, below);
            let own = self.ends_at_border(skin, ring, outward, [top, arc[0], *arc.last()?], shape, round)?;
            let [first, last] = &own;
            // What both have in common ends where they do.
            let shared = first.iter().zip(last).take_while(|(a, b)| a == b).count();
            let mut around = first[shared - 1..first.len() - 1].to_vec();
            around.extend_from_slice(&arc);
            around.extend(last[shared..last.len() - 1].iter().rev());
            self.fill(skin, one.0, &around, shape, round);
            for ((foot, is_up), mut rows) in ring.corners.iter().zip(own) {
                if !is_up {
                    rows.reverse();
                }
                at_border.insert(*foot, rows);
            }
        }
        Some(at_border)
    }

    /// The rows of both parts where a seam ends at the border: from where their sheets meet, as far as their borders are as near to both, and on to what is below each.
    fn ends_at_border(
        &mut self,
        skin: &Skin,
        ring: &Ring,
        outward: &[Outward],
        [top, below @ ..]: [u32; 3],
        shape: &Shape,
        round: &impl Fn(f64) -> f64,
    ) -> Option<[Vec<u32>; 2]> {
        let foot = ring.corners[0].0;
        let at = skin.places[foot as usize];
        let outs: Vec<Point> =
            ring.corners.iter().map(|(corner, _)| outward[*corner as usize]).map(|own| own.comes.or(own.goes)).collect::<Option<_>>()?;
        let out = unit(&lifted(&outs[0], &outs[1], 1.0));
        let up = subtract(&self.vertices[top as usize], &at);
        let rows = (0.5 * PI / shape.row).ceil().max(1.0) as usize;
        let mut common = vec![top];
        for row in 1..=rows {
            let (sine, cosine) = (0.5 * PI * row as f64 / rows as f64).sin_cos();
            let guess = std::array::from_fn(|axis| at[axis] + cosine * up[axis] + shape.rim * sine * out[axis]);
            let way = subtract(&skin.apart(ring, guess, shape.rim)?, &at);
            let number = self.add(skin, foot, way, 1.0, round);
            self.ways[number as usize] = unit(&way);
            common.push(number);
        }
        let last = self.ways[*common.last()? as usize];
        Some([0, 1].map(|k| {
            let to = self.ways[below[k] as usize];
            let mut own = common.clone();
            let ways = turned(&last, &to, |angle| (angle / shape.row).ceil().max(1.0) as usize);
            own.extend(ways.iter().map(|way| self.add(skin, foot, *way, shape.rim, round)));
            own.push(below[k]);
            own
        }))
    }

    /// The rows from the sheet of one part to that of another at a place of both.
    fn arc(
        &mut self,
        skin: &Skin,
        ends: [Corner; 2],
        shape: &Shape,
        vertex: &mut impl FnMut(&mut Self, u32, bool) -> u32,
        round: &impl Fn(f64) -> f64,
    ) -> Vec<u32> {
        let [first, last] = ends.map(|(foot, is_up)| vertex(self, foot, is_up));
        let [from, to] = ends.map(|end| skin.up(end));
        let ways = turned(&from, &to, |angle| if angle < shape.fold { 1 } else { (angle / shape.row).ceil().max(2.0) as usize });
        let mut all = vec![first];
        all.extend(ways.iter().map(|way| self.add(skin, ends[0].0, *way, shape.rim, round)));
        all.push(last);
        all
    }

    /// Fills what is between rows all around a place, by rings around the middle.
    fn fill(&mut self, skin: &Skin, foot: u32, around: &[u32], shape: &Shape, round: &impl Fn(f64) -> f64) {
        let ways: Vec<Point> = around.iter().map(|&number| self.ways[number as usize]).collect();
        let middle = unit(&ways.iter().fold([0.0; 3], |sum: Point, way| lifted(&sum, way, 1.0)));
        let least = ways.iter().map(|way| dot(way, &middle)).fold(1.0, f64::min);
        let rings = (least.clamp(-1.0, 1.0).acos() / shape.row).ceil().max(1.0) as usize;
        let mut outer = around.to_vec();
        for ring in 1..rings {
            let share = ring as f64 / rings as f64;
            let inner: Vec<u32> = ways
                .iter()
                .map(|way| {
                    let way = unit(&std::array::from_fn(|axis| (1.0 - share) * way[axis] + share * middle[axis]));
                    self.add(skin, foot, way, shape.rim, round)
                })
                .collect();
            for k in 0..outer.len() {
                let next = (k + 1) % outer.len();
                self.face_out(skin, foot, [outer[k], outer[next], inner[k]]);
                self.face_out(skin, foot, [outer[next], inner[next], inner[k]]);
            }
            outer = inner;
        }
        let last = self.add(skin, foot, middle, shape.rim, round);
        for k in 0..outer.len() {
            self.face_out(skin, foot, [outer[k], outer[(k + 1) % outer.len()], last]);
        }
    }

    /// Adds a triangle, turned away from a place.
    fn face_out(&mut self, skin: &Skin, foot: u32, [p, q, r]: [u32; 3]) {
        let [a, b, c] = [p, q, r].map(|number| &self.vertices[number as usize]);
        let is_out = dot(&cross(&subtract(b, a), &subtract(c, a)), &subtract(a, &skin.places[foot as usize])) > 0.0;
        self.triangles.push(if is_out { [p, q, r] } else { [p, r, q] });
        self.owners.push(NONE);
    }

    /// Moves all vertices by as much along each axis at most, so that none is on a plane or a line of others.
    pub(super) fn shake(&mut self, seed: u64, most: f64, round: impl Fn(f64) -> f64) {
        let mut random = Random(seed);
        self.vertices.iter_mut().for_each(|vertex| *vertex = shaken(vertex, most, &mut random).map(&round));
    }

    /// What a triangle is called.
    pub(super) fn name(&self, triangle: u32) -> Name {
        self.triangles[triangle as usize].map(|corner| (self.vertices[corner as usize].map(f64::to_bits), self.feet[corner as usize]))
    }

    fn add(&mut self, skin: &Skin, foot: u32, way: Point, distance: f64, round: impl Fn(f64) -> f64) -> u32 {
        self.vertices.push(lifted(&skin.places[foot as usize], &way, distance).map(round));
        self.feet.push(foot);
        self.ways.push(way);
        self.vertices.len() as u32 - 1
    }

    /// The rows at a vertex of the border, from what is up to what is down there.
    fn columns(
        &mut self,
        skin: &Skin,
        foot: u32,
        [comes, goes]: [&Point; 2],
        shape: &Shape,
        [first, last]: [u32; 2],
        round: impl Fn(f64) -> f64,
    ) -> Option<Columns> {
        let (up, rows) = (&skin.ups[foot as usize], shape.rows());
        let turn = dot(&cross(comes, goes), up).atan2(dot(comes, goes));
        // Where it turns inward strips would cross each other.
        if turn <= -shape.column {
            return None;
        }
        let count = if turn < shape.column { 0 } else { (turn / shape.column).ceil() as usize };
        let beside = cross(up, comes);
        let outs = (0..=count).map(|step| {
            let angle = if count == 0 { 0.5 * turn } else { turn * step as f64 / count as f64 };
            let (sine, cosine) = angle.sin_cos();
            std::array::from_fn(|axis| cosine * comes[axis] + sine * beside[axis])
        });
        let outs: Vec<Point> = outs.collect();
        let column = |out: &Point| {
            let between = (1..rows).map(|row| {
                let (sine, cosine) = (PI * row as f64 / rows as f64).sin_cos();
                let way = std::array::from_fn(|axis| cosine * up[axis] + sine * out[axis]);
                self.add(skin, foot, way, shape.rim, &round)
            });
            let mut all = vec![first];
            all.extend(between);
            all.push(last);
            all
        };
        Some(Columns(outs.iter().map(column).collect()))
    }

    /// The strip between two columns, which may have common ends, and numbers of rows of their own.
    fn strip(&mut self, from: &[u32], to: &[u32]) {
        let (mut i, mut j) = (0, 0);
        let [last, other_last] = [from.len() - 1, to.len() - 1];
        while i < last || j < other_last {
            let is_first = j == other_last || (i < last && (i + 1) * other_last <= (j + 1) * last);
            let ahead = if is_first { from[i + 1] } else { to[j + 1] };
            let [p, q, r] = [to[j], from[i], ahead];
            if p != q && q != r && r != p {
                self.triangles.push([p, q, r]);
                self.owners.push(NONE);
            }
            if is_first { i += 1 } else { j += 1 }
        }
    }
}

/// A place, moved by as much along each axis at most, as if by chance.
pub(super) fn shaken(x: &Point, most: f64, random: &mut Random) -> Point {
    x.map(|x| x + most * (2.0 * random.share() - 1.0))
}

/// Directions between two, evenly, in as many rows as the angle takes.
fn turned(from: &Point, to: &Point, rows: impl Fn(f64) -> usize) -> Vec<Point> {
    let cosine = dot(from, to);
    let angle = cosine.clamp(-1.0, 1.0).acos();
    let (rows, beside) = (rows(angle), unit(&lifted(to, from, -cosine)));
    let way = |row: usize| {
        let (sine, cosine) = (angle * row as f64 / rows as f64).sin_cos();
        std::array::from_fn(|axis| cosine * from[axis] + sine * beside[axis])
    };
    (1..rows).map(way).collect()
}

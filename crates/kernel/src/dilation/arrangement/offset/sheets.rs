//! Both sheets of a surface, and strips around its border that join them.

use super::coarse::lifted;
use super::skin::{Skin, edges};
use crate::attractor::cell::{Point, cross, dot, subtract, unit};
use crate::solid::half_edges::NONE;
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
}

/// The rows of a strip at a vertex: of the side that comes first along the border, of what is around a corner, and of the other side.
struct Columns(Vec<Vec<u32>>);

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
        2.0 * (triangles.len() as f64 + self.rows() as f64 * columns.sum::<f64>())
    }
}

impl Sheets {
    /// The sheets along triangles of a surface; none where its border turns inward at a corner, or meets itself.
    pub(super) fn new(skin: &Skin, triangles: &[[u32; 3]], shape: &Shape, round: impl Fn(f64) -> f64) -> Option<Self> {
        let mut sheets = Self::default();
        let mut numbers = vec![[NONE; 2]; skin.places.len()];
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
            let [upper, lower] = [true, false].map(|is_upper| {
                corners.map(|corner| vertex(&mut sheets, corner, (dot(&normal, &skin.ups[corner as usize]) > 0.0) == is_upper))
            });
            sheets.triangles.extend([upper, [lower[0], lower[2], lower[1]]]);
            sheets.owners.extend([owner; 2]);
        }
        // Of each side of the border: its ends as its triangle has them, and whether the triangle's normal is up there.
        let all = edges(triangles);
        let borders: Vec<([u32; 2], [bool; 2])> = all
            .chunk_by(|a, b| a.ends == b.ends)
            .filter(|edge| edge.len() == 1)
            .map(|edge| {
                let normal = normal(&triangles[edge[0].triangle as usize]);
                let ends = edge[0].of(triangles);
                (ends, ends.map(|end| dot(&normal, &skin.ups[end as usize]) > 0.0))
            })
            .collect();
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
        let mut columns = Vec::with_capacity(outward.len());
        for (foot, outward) in (0..).zip(&outward) {
            let Outward { comes: Some(comes), goes: Some(goes) } = outward else {
                columns.push(Columns(Vec::new()));
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

    /// The strip between two columns, which may have common ends.
    fn strip(&mut self, from: &[u32], to: &[u32]) {
        for (a, b) in from.windows(2).zip(to.windows(2)) {
            for triangle in [[b[0], a[0], a[1]], [b[0], a[1], b[1]]] {
                let [p, q, r] = triangle;
                if p != q && q != r && r != p {
                    self.triangles.push(triangle);
                    self.owners.push(NONE);
                }
            }
        }
    }
}

//! What the boundary of tubes is made of: cells that share whole facets, see `tubes`.
//!
//! A *seam* is a corner, or an edge, that cells have in common: it has one name, and an edge lies between a facet of one cell and one of another. Facets in common are inside of the union and none of its boundary. Their planes are the same numbers with other signs, so that what one cell covers of a line ends
//! where what the other one covers begins, to the last bit.

use super::cubes::Cube;
use super::figure::Figure;
use super::form::{Form, Kind};
use super::polytopes::{Plane, Polytope, Shell, beyond_place, edge_number, facet_number, normal};
use super::structure::{Edge, Structure};
use super::tubes::{Bend, Rod, Tubes};
use crate::attractor::cell::{Point, cross, dot, subtract, unit};
use rayon::iter::Either;
use rayon::prelude::*;
use std::sync::Arc;

/// What a cell has in common with others.
#[derive(Debug)]
pub(super) struct Seams {
    /// The names of its corners.
    pub(super) corners: Box<[u32]>,
    /// Of its edges.
    pub(super) edges: Box<[Seam]>,
    /// The facets that it has in common with others.
    pub(super) inside: Box<[u16]>,
    /// The cells that it has facets in common with.
    pub(super) beside: Box<[u32]>,
}

/// An edge's name, and the facets to its left and its right, of which one may be another cell's; none where that cell tells them, or both are inside of the union.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seam {
    pub(super) name: u32,
    pub(super) facets: Option<[u32; 2]>,
}

/// Where a corner of a ring is: on the side where the tube is turned away from, where it is turned to, or on the axis between.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Outer,
    Inner,
    Axis,
}

/// A corner of the ring at a bend.
#[derive(Clone, Copy, Debug)]
struct Node {
    part: Part,
    at: Point,
    /// That of the first segment's cell.
    name: u32,
}

/// The ring at a bend, in the order of the tube's strips.
struct Ring {
    nodes: Vec<Node>,
    /// The planes that end the first segment's cell, and the second one's, turned over, where the wedge is; and where the cells meet.
    planes: [Plane; 3],
}

impl Ring {
    /// The corners on one side, from one on the axis to the other, as strips go around.
    fn row(&self, part: Part) -> Option<Vec<usize>> {
        let count = self.nodes.len();
        let of = |place: usize| self.nodes[place % count].part;
        let start = (0..count).find(|&place| of(place) == Part::Axis && of(place + 1) == part)?;
        let length = 2 + self.nodes.iter().filter(|node| node.part == part).count();
        Some((start..start + length).map(|place| place % count).collect())
    }
}

/// A cell before its edges have names.
struct Raw {
    index: u32,
    facets: Vec<Vec<u16>>,
    planes: Vec<Plane>,
    corners: Vec<Point>,
    names: Vec<u32>,
    inside: Vec<u16>,
    beside: Vec<u32>,
}

impl Tubes {
    /// Makes the cells, and what the topology is told of instead, from polytopes that end at bends: to those of figures the wedges' are added.
    ///
    /// # Errors
    /// The figures whose cells cannot be.
    pub(super) fn build<'f>(
        &mut self,
        sites: &[Figure],
        polytopes: &mut Vec<Polytope>,
        form: impl Fn(Kind) -> Option<&'f Form> + Sync,
        slack: f64,
        shell: impl Fn(&Figure) -> Shell + Sync,
    ) -> Result<(), Vec<u32>> {
        let ring = |bend: &Bend| self.ring(bend, &polytopes[bend.rods[0] as usize], slack).ok_or(bend.rods[0]);
        let rings: Vec<Ring> = all(self.bends.par_iter().map(ring))?;
        let wedge = |&number: &usize| {
            let bend = &self.bends[number];
            let inner = shell(&sites[bend.rods[0] as usize]).inner;
            bend.wedge.and_then(|index| self.wedge_cell(index, bend, &rings[number], polytopes, inner)).ok_or(bend.rods[0])
        };
        let wedges: Vec<Raw> = all(self.wedges.par_iter().map(wedge))?;
        let rods: Vec<(u32, &Rod)> = (0..).zip(&self.rods).filter_map(|(index, rod)| Some((index, rod.as_ref()?))).collect();
        let cell = |&(index, rod): &(u32, &Rod)| {
            form(rod.kind).and_then(|form| self.cell(index, rod, &rings, &polytopes[index as usize], form)).ok_or(index)
        };
        let mut raw: Vec<Raw> = all(rods.par_iter().map(cell))?;
        let bodies: Vec<(u32, Polytope)> =
            rods.iter().filter_map(|&(index, rod)| Some((index, self.body(index, rod, polytopes, form(rod.kind)?)?))).collect();
        let around = |(&number, wedge): (&usize, &Raw)| {
            let bend = &self.bends[number];
            let strips = bend.rods.iter().flat_map(|&rod| self.strips(rod, polytopes)).copied();
            let facets = wedge.planes[wedge.inside.len()..].iter().copied();
            let cuts = bend.cuts();
            // Around the body, whose own corners are not needed.
            let cube = Cube { centre: bend.at, half: shell(&sites[bend.rods[0] as usize]).outer };
            let planes = strips.chain(facets).chain(cuts).collect();
            Polytope::with(Arc::default(), planes, cuts.into(), cube.corners().collect())
        };
        let added: Vec<Polytope> = self.wedges.iter().zip(&wedges).map(around).collect();
        raw.extend(wedges);
        self.cells = named(raw)?;
        polytopes.extend(added);
        bodies.into_iter().for_each(|(index, body)| polytopes[index as usize] = body);
        Ok(())
    }

    /// The ring at a bend, given what stands for the first segment; none where a corner is neither on the axis of its wedge nor clear of it.
    fn ring(&self, bend: &Bend, polytope: &Polytope, slack: f64) -> Option<Ring> {
        let (index, rod) = (bend.rods[0], self.rod(bend.rods[0])?);
        let (way, has_wedge) = (&bend.ways[0], bend.wedge.is_some());
        let (out, slope) = (bend.out(0), (0.5 * bend.turn).tan());
        let node = |corner: usize| {
            let place = rod.corner(1, corner);
            let at = &polytope.corners[place];
            let height = dot(&subtract(at, &bend.at), &out);
            let part = match height {
                _ if has_wedge && height.abs() <= ON_AXIS * slack => Part::Axis,
                _ if has_wedge && height.abs() <= CLEAR * rod.reach => return None,
                _ if height > 0.0 => Part::Outer,
                _ => Part::Inner,
            };
            let moved = if !has_wedge || part == Part::Inner { height * slope } else { 0.0 };
            let at = std::array::from_fn(|axis| at[axis] + moved * way[axis]);
            Some(Node { part, at, name: edge_number(index, place) })
        };
        let nodes: Vec<Node> = (0..rod.strips.len()).map(node).collect::<Option<_>>()?;
        let on_axis = nodes.iter().filter(|node| node.part == Part::Axis).count();
        if has_wedge && on_axis != 2 {
            return None;
        }
        let planes = [bend.ways[0], bend.ways[1], bend.middle()].map(|normal| beyond_place(normal, &bend.at, 0.0));
        Some(Ring { nodes, planes })
    }

    /// The cell of a segment.
    fn cell(&self, index: u32, rod: &Rod, rings: &[Ring], polytope: &Polytope, form: &Form) -> Option<Raw> {
        let shape = form.shape(rod.is_cut);
        let mut cell = Raw {
            index,
            facets: shape.facets.clone(),
            planes: polytope.planes.to_vec(),
            corners: polytope.corners.to_vec(),
            names: (0..polytope.corners.len()).map(|corner| edge_number(index, corner)).collect(),
            inside: Vec::new(),
            beside: Vec::new(),
        };
        for side in [0, 1] {
            let Some(number) = rod.bends[side] else { continue };
            let (bend, ring) = (&self.bends[number], &rings[number]);
            for (corner, node) in ring.nodes.iter().enumerate() {
                // Outer corners of the second segment are its own.
                if side == 1 || bend.wedge.is_none() || node.part != Part::Outer {
                    cell.corners[rod.corner(side, corner)] = node.at;
                    cell.names[rod.corner(side, corner)] = node.name;
                }
            }
            let flat = shape.flats[rod.end(side)]?;
            let turned = |plane: Plane| if side == 1 { plane } else { plane.map(|part| -part) };
            // Strips go counter-clockwise seen from where the tube goes on.
            let facet = |row: Vec<usize>| {
                let mut facet: Vec<u16> = row.into_iter().map(|corner| rod.corner(side, corner) as u16).collect();
                if side == 0 {
                    facet.reverse();
                }
                facet
            };
            cell.inside.push(flat as u16);
            cell.beside.push(bend.rods[side]);
            let Some(wedge) = bend.wedge else {
                cell.planes[flat] = turned(ring.planes[2]);
                continue;
            };
            cell.facets[flat] = facet(ring.row(Part::Outer)?);
            cell.planes[flat] = turned(ring.planes[1 - side]);
            cell.inside.push(cell.facets.len() as u16);
            cell.facets.push(facet(ring.row(Part::Inner)?));
            cell.planes.push(turned(ring.planes[2]));
            cell.beside.push(wedge);
        }
        Some(cell)
    }

    /// What stands for the dilation of a segment where its cell does not: it is cut beyond planes that bisect bends, and by the other segment's strips that are there. Its corners are those without these strips: they are around it.
    fn body(&self, index: u32, rod: &Rod, polytopes: &[Polytope], form: &Form) -> Option<Polytope> {
        let mitres = [0, 1].map(|side| rod.bends[side].map(|bend| &self.bends[bend]).filter(|bend| bend.wedge.is_none()));
        if mitres.iter().all(Option::is_none) {
            return None;
        }
        let (polytope, shape) = (&polytopes[index as usize], form.shape(rod.is_cut));
        let (mut planes, mut corners) = (polytope.planes.to_vec(), polytope.corners.to_vec());
        for (side, bend) in mitres.into_iter().enumerate().filter_map(|(side, bend)| Some((side, bend?))) {
            planes[shape.flats[rod.end(side)]?] = bend.mitre(1 - side);
            let (own, outs) =
                (bend.ways[1 - side].map(|part| if side == 1 { part } else { -part }), [1 - side, side].map(|which| bend.out(which)));
            planes.extend(self.strips(bend.rods[side], polytopes).iter().filter(|plane| dot(&normal(plane), &outs[1]) > 0.0));
            for corner in (0..rod.strips.len()).map(|corner| rod.corner(side, corner)) {
                let height = dot(&subtract(&corners[corner], &bend.at), &outs[0]);
                let moved = bend.beyond / (0.5 * bend.turn).cos() + height * (0.5 * bend.turn).tan();
                corners[corner] = std::array::from_fn(|axis| corners[corner][axis] + moved * own[axis]);
            }
        }
        let cuts = shape.flats.iter().flatten().map(|&flat| planes[flat]).collect();
        Some(Polytope::with(Arc::default(), planes.into(), cuts, corners.into()))
    }

    /// The planes of a segment's strips.
    fn strips<'p>(&self, rod: u32, polytopes: &'p [Polytope]) -> &'p [Plane] {
        &polytopes[rod as usize].planes[..self.rod(rod).map_or(0, |rod| rod.strips.len())]
    }

    /// The wedge of a bend, whose first two facets are those that it has in common with segments; none where a facet would be too near.
    fn wedge_cell(&self, index: u32, bend: &Bend, ring: &Ring, polytopes: &[Polytope], inner: f64) -> Option<Raw> {
        let (steps, next) = (bend.steps, bend.rods[1]);
        let rod = self.rod(next)?;
        let row = ring.row(Part::Outer)?;
        let last = row.len() - 1;
        // The ends of the row, then what is between them, step by step.
        let ends = [row[0], row[last]].map(|corner| &ring.nodes[corner]);
        let (mut corners, mut names) = (ends.map(|node| node.at).to_vec(), ends.map(|node| node.name).to_vec());
        for step in 0..=steps {
            for &corner in &row[1..last] {
                let node = &ring.nodes[corner];
                let (at, name) = if step == 0 {
                    (node.at, node.name)
                } else if step == steps {
                    let place = rod.corner(0, corner);
                    (polytopes[next as usize].corners[place], edge_number(next, place))
                } else {
                    let from = bend.turned(&subtract(&node.at, &bend.at), step as f64 / steps as f64);
                    (std::array::from_fn(|axis| bend.at[axis] + from[axis]), edge_number(index, corners.len()))
                };
                corners.push(at);
                names.push(name);
            }
        }
        let place = |step: usize, along: usize| match along {
            0 => 0,
            _ if along == last => 1,
            _ => (1 + step * (last - 1) + along) as u16,
        };
        let whole = |step: usize| (0..=last).map(move |along| place(step, along));
        let mut facets: Vec<Vec<u16>> = vec![whole(0).rev().collect(), whole(steps).collect()];
        let mut planes = vec![ring.planes[0].map(|part| -part), ring.planes[1]];
        for step in 0..steps {
            for along in 0..last {
                let mut facet = vec![place(step, along), place(step, along + 1), place(step + 1, along + 1), place(step + 1, along)];
                facet.dedup();
                if along == 0 {
                    facet.pop();
                }
                let at = |k: usize| subtract(&corners[usize::from(facet[k])], &bend.at);
                // Across its diagonals, or two sides of a triangle.
                let normal = unit(&cross(&subtract(&at(2), &at(0)), &subtract(&at(facet.len() - 1), &at(1))));
                let offset = dot(&normal, &at(0));
                if offset < inner {
                    return None;
                }
                planes.push(beyond_place(normal, &bend.at, offset));
                facets.push(facet);
            }
        }
        Some(Raw { index, facets, planes, corners, names, inside: vec![0, 1], beside: bend.rods.to_vec() })
    }
}

/// Corners that are no farther from the axis of a wedge than this, in units of the slack, are on it; others are farther than this from it, in units of the ring's radius.
const ON_AXIS: f64 = 4.0;
const CLEAR: f64 = 0.01;

/// All of some, or what is told by those that are not.
fn all<T: Send>(some: impl ParallelIterator<Item = Result<T, u32>>) -> Result<Vec<T>, Vec<u32>> {
    let (found, failed): (Vec<T>, Vec<u32>) = some.partition_map(|one| match one {
        Ok(found) => Either::Left(found),
        Err(index) => Either::Right(index),
    });
    if failed.is_empty() { Ok(found) } else { Err(failed) }
}

/// The cells, with the names of their edges.
///
/// # Errors
/// The cells that do not close, are not convex, or have an edge in common with none or several.
fn named(raw: Vec<Raw>) -> Result<Vec<(u32, Polytope)>, Vec<u32>> {
    let structure = |cell: &Raw| {
        let structure = Structure::closed(&cell.facets, cell.corners.len());
        structure.filter(|structure| structure.is_convex(&cell.planes, &cell.corners, 0.0)).ok_or(cell.index)
    };
    let structures: Vec<Structure> = all(raw.par_iter().map(structure))?;
    // The edges of every seam by its ends: those of one cell, then of the other.
    let mut seams: Vec<([u32; 2], u32, u16)> = Vec::new();
    for (place, (cell, structure)) in (0..).zip(raw.iter().zip(&structures)) {
        for (number, Edge { corners, facets }) in (0..).zip(&structure.edges) {
            if facets.iter().filter(|facet| cell.inside.contains(facet)).count() == 1 {
                let [p, q] = corners.map(|corner| cell.names[usize::from(corner)]);
                seams.push(([p.min(q), p.max(q)], place, number));
            }
        }
    }
    seams.par_sort_unstable();
    let own = |(cell, structure): (&Raw, &Structure)| {
        let seam = |(number, edge): (usize, &Edge)| {
            let is_inside = edge.facets.iter().any(|facet| cell.inside.contains(facet));
            let facets = edge.facets.map(|facet| facet_number(cell.index, usize::from(facet)));
            Seam { name: edge_number(cell.index, number), facets: (!is_inside).then_some(facets) }
        };
        structure.edges.iter().enumerate().map(seam).collect::<Vec<Seam>>()
    };
    let mut edges: Vec<Vec<Seam>> = raw.iter().zip(&structures).map(own).collect();
    for both in seams.chunk_by(|a, b| a.0 == b.0) {
        let places = || both.iter().map(|&(_, place, number)| (place as usize, usize::from(number)));
        let outside = |(place, number): (usize, usize)| {
            let (cell, facets) = (&raw[place], structures[place].edges[number].facets);
            let facet = facets.into_iter().find(|facet| !cell.inside.contains(facet));
            facet.map(|facet| (facet_number(cell.index, usize::from(facet)), facet == facets[0]))
        };
        let found: Vec<(u32, bool)> = places().filter_map(outside).collect();
        let (&[(ours, is_left), (other, _)], Some((first, number)), Some((second, theirs))) =
            (found.as_slice(), places().next(), places().nth(1))
        else {
            return Err(both.iter().map(|&(_, place, _)| raw[place as usize].index).collect());
        };
        edges[first][number].facets = Some(if is_left { [ours, other] } else { [other, ours] });
        edges[second][theirs].name = edges[first][number].name;
    }
    let cell = |((cell, structure), edges): ((Raw, Structure), Vec<Seam>)| {
        let Raw { index, planes, corners, names, inside, beside, .. } = cell;
        let mut polytope = Polytope::with(Arc::new(structure), planes.into(), Box::default(), corners.into());
        polytope.seams = Some(Box::new(Seams { corners: names.into(), edges: edges.into(), inside: inside.into(), beside: beside.into() }));
        (index, polytope)
    };
    Ok(raw.into_iter().zip(structures).zip(edges).map(cell).collect())
}

#[cfg(test)]
mod tests {
    use super::super::polytopes::{Cut, height};
    use super::super::tubes::Loose;
    use super::*;
    use crate::attractor::cell::Site;
    use crate::dilation::convex::Convex;
    use crate::dilation::tree::Weighted;
    use crate::split_mix::Random;

    /// The corners of a path, and whether it goes back to the first.
    fn path(kind: usize, random: &mut Random) -> (Vec<Point>, bool) {
        let mut number = |low: f64, high: f64| low + (high - low) * random.share();
        let (mut at, mut way) = ([3.0, -2.0, 1.0], [1.0, 0.0, 0.0]);
        let mut path = vec![at];
        for step in 0..7 {
            let any = unit(&[number(-1.0, 1.0), number(-1.0, 1.0), number(-1.0, 1.0)]);
            way = match kind {
                // Right angles, little by little, in a plane, anyhow; a ring comes below.
                0 => std::array::from_fn(|axis| if axis == (step + usize::from(any[0] > 0.0)) % 3 { any[1].signum() } else { 0.0 }),
                1 | 5 => unit(&std::array::from_fn(|axis| way[axis] + 0.2 * any[axis])),
                2 => unit(&[way[0] + 1.5 * any[0], way[1] + 1.5 * any[1], 0.0]),
                _ => unit(&std::array::from_fn(|axis| way[axis] + 1.2 * any[axis])),
            };
            // Some are as short as may be.
            let length = if kind == 5 { number(0.6, 1.2) } else { number(2.0, 6.0) };
            at = std::array::from_fn(|axis| at[axis] + length * way[axis]);
            path.push(at);
        }
        if kind == 4 {
            let (corners, tilt) = (3.0 + (12.0 * number(0.0, 1.0)).floor(), number(0.0, 1.0));
            let corner = |k: f64| {
                let (sine, cosine) = (std::f64::consts::TAU * k / corners).sin_cos();
                [6.0 * cosine, 6.0 * sine, 6.0 * tilt * cosine]
            };
            return ((0..corners as usize).map(|k| corner(k as f64)).collect(), true);
        }
        (path, false)
    }

    /// Cells have the same union as the bodies that the topology is told of, both are between the dilations by both ends of the band, each body stands for its own, and all of these together are the path's.
    #[test]
    fn cells_and_bodies_are_between_the_dilations() {
        let mut random = Random(37);
        let [mut wedges, mut mitres, mut rings, mut places] = [0; 4];
        for round in 0..160 {
            let (corners, is_ring) = path(round % 6, &mut random);
            let shell = [(0.9, 1.1), (0.975, 1.025), (0.7, 1.4), (0.5, 1.5)][round / 6 % 4];
            let shell = Shell { inner: shell.0, outer: shell.1 };
            let count = if is_ring { corners.len() } else { corners.len() - 1 };
            let ends = |k: usize| [corners[k], corners[(k + 1) % corners.len()]];
            let mut figures: Vec<Figure> =
                (0..count).map(|k| Figure::from(Weighted { site: Site::Segment(ends(k)), deficit: 0.0 })).collect();
            let shift = random.next() as usize % count;
            figures.rotate_left(shift);
            let forms = [Kind::Rod, Kind::Flat, Kind::Square].map(|kind| (kind, Form::within(shell.reach(), kind)));
            let form = |kind: Kind| forms.iter().find(|(own, _)| *own == kind).and_then(|(_, form)| form.as_ref());
            let mut beyond: Vec<Box<[Option<f64>]>> = (0..count).map(|_| Box::new([None; 2]) as Box<[Option<f64>]>).collect();
            let slack = 1e-12;
            let mut tubes = Tubes::of(&figures, &mut beyond, &Loose::new(), form, slack, |_| shell);
            let polytope = |index: usize| {
                let cut = Cut { beyond: [beyond[index][0], beyond[index][1]], most: shell.outer };
                let rod = tubes.rod(index as u32)?;
                Polytope::new(&figures[index], form(rod.kind)?, shell, cut, Some(rod), index as u64)
            };
            let mut polytopes: Vec<Polytope> = (0..count).filter(|&k| tubes.rod(k as u32).is_some()).filter_map(polytope).collect();
            // Not all bends are tubes; here those are looked at that are nothing else.
            if polytopes.len() < count {
                continue;
            }
            assert!(tubes.build(&figures, &mut polytopes, form, slack, |_| shell).is_ok(), "{round}");
            wedges += tubes.wedges.len();
            mitres += tubes.bends.len() - tubes.wedges.len();
            rings += usize::from(tubes.bends.len() == count);
            let all: Vec<Figure> = figures.iter().cloned().chain(tubes.points(&figures)).collect();
            assert_eq!(all.len(), polytopes.len());
            let is_in = |polytope: &Polytope, x: &Point, spare: f64| polytope.planes.iter().all(|plane| height(plane, x) <= spare);
            for _ in 0..3_000 {
                let bend = &tubes.bends[random.next() as usize % tubes.bends.len()];
                let mut number = || 2.0 * random.share() - 1.0;
                let away = unit(&[number(), number(), number()]);
                let far = 1.3 * shell.outer * number().abs().sqrt();
                let along = number();
                let on = bend.ways[usize::from(along > 0.0)].map(|part| 1.2 * along * part);
                let x: Point = std::array::from_fn(|axis| bend.at[axis] + on[axis] + far * away[axis]);
                let of = |figure: &Figure| figure.distance_squared(&x).sqrt();
                let distance = figures.iter().map(of).fold(f64::INFINITY, f64::min);
                let in_cells = |spare: f64| tubes.cells.iter().any(|(_, cell)| is_in(cell, &x, spare));
                let in_bodies = |spare: f64| polytopes.iter().any(|body| is_in(body, &x, spare));
                let tiny = 1e-9;
                assert!(!in_cells(-tiny) || in_bodies(tiny), "{round}: {x:?} is in a cell and in no body");
                assert!(!in_bodies(-tiny) || in_cells(tiny), "{round}: {x:?} is in a body and in no cell");
                assert!(distance > shell.inner - tiny || in_cells(tiny), "{round}: {x:?} is {distance} from the path");
                assert!(distance < shell.outer + tiny || !in_cells(-tiny), "{round}: {x:?} is {distance} from the path");
                let is_kept = |body: &Polytope, spare: f64| body.cuts.iter().all(|plane| height(plane, &x) <= spare);
                let mut is_one_s = false;
                for (figure, body) in all.iter().zip(&polytopes) {
                    assert!(of(figure) > shell.inner - tiny || !is_kept(body, -tiny) || is_in(body, &x, tiny), "{round}: {x:?}");
                    assert!(!is_in(body, &x, -tiny) || (of(figure) < shell.outer + tiny && is_kept(body, tiny)), "{round}: {x:?}");
                    is_one_s |= of(figure) <= distance + tiny && is_kept(body, tiny);
                }
                assert!(distance > shell.outer || is_one_s, "{round}: {x:?} is in no dilation");
                places += usize::from(in_cells(0.0));
            }
        }
        assert!(wedges > 150 && mitres > 100 && rings > 15 && places > 30_000, "{wedges} {mitres} {rings} {places}");
    }
}

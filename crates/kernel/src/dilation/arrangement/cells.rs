//! What the boundary of tubes is made of: cells that share whole facets, see `tubes`.
//!
//! A *seam* is a corner, or an edge, that cells have in common: it has one name, and an edge lies between a facet of one cell and one of another. Facets in common are inside of the union and none of its boundary. Their planes are the same numbers with other signs, so that what one cell covers of a line ends
//! where what the other one covers begins, to the last bit.

use super::figure::Figure;
use super::form::Form;
use super::polytopes::{Plane, Polytope, Shell, edge_number, facet_number};
use super::structure::{Edge, Structure};
use super::tubes::{Bend, Rod, Tubes};
use crate::attractor::cell::{Point, between, cross, dot, subtract, unit};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Corners that are no farther from the axis of a bend than the first are on it, and none may be as near as the second but farther, in units of the radius.
const ON_AXIS: [f64; 2] = [1e-9, 1e-4];

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
    /// Its number in the tube's ring; none of what is added on the axis.
    corner: Option<usize>,
    /// Its name: the first segment's cell has it first.
    name: u32,
}

/// The ring at a bend, in the order of the tube's strips.
struct Ring {
    nodes: Vec<Node>,
    /// The planes that end the first segment's cell, and the second one's, turned over, where the wedge is; and where the cells meet.
    planes: [Plane; 3],
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
    /// Makes the bodies of bends, which are added to those of all figures, and the cells.
    ///
    /// # Errors
    /// The bends that leave no room for theirs.
    pub(super) fn build(
        &mut self,
        sites: &[Figure],
        polytopes: &mut Vec<Polytope>,
        form: &Form,
        shell: impl Fn(&Figure) -> Shell,
    ) -> Result<(), Vec<usize>> {
        let shell = |bend: &Bend| shell(&sites[bend.rods[0] as usize]);
        let all = |made: &dyn Fn(usize) -> bool| (0..self.bends.len()).filter(|&number| !made(number)).collect::<Vec<usize>>();
        let rings: Vec<Option<Ring>> = self.bends.iter().map(|bend| self.ring(bend, polytopes, shell(bend).outer)).collect();
        let failed = all(&|number| rings[number].is_some());
        if !failed.is_empty() {
            return Err(failed);
        }
        let rings: Vec<Ring> = rings.into_iter().flatten().collect();
        let wedge = |(number, bend): (usize, &Bend)| self.wedge(number, bend, &rings[number], polytopes, shell(bend).inner);
        let wedges: Vec<Option<Raw>> = self.bends.iter().enumerate().map(wedge).collect();
        let failed = all(&|number| wedges[number].is_some() || self.bends[number].steps == 0);
        if !failed.is_empty() {
            return Err(failed);
        }
        let body = |(bend, wedge): (&Bend, &Option<Raw>)| {
            let strips = bend.rods.iter().flat_map(|&rod| &polytopes[rod as usize].planes[..form.covering.belt]).copied();
            let facets = wedge.iter().flat_map(|wedge| &wedge.planes[wedge.inside.len()..]).copied();
            let cuts = bend.cuts();
            let most = shell(bend).outer;
            let around = |corner: usize| std::array::from_fn(|axis| bend.at[axis] + if corner >> axis & 1 == 1 { most } else { -most });
            let planes = strips.chain(facets).chain(cuts).collect();
            Polytope::with(Arc::new(Structure::default()), planes, cuts.into(), (0..8).map(around).collect())
        };
        let bodies: Vec<Polytope> = self.bends.iter().zip(&wedges).map(body).collect();
        let rods = (0..).zip(&self.rods).filter_map(|(index, rod)| Some((index, rod.as_ref()?)));
        let cell = |(index, rod): (u32, &Rod)| self.cell(index, rod, &rings, &polytopes[index as usize], form);
        let raw: Option<Vec<Raw>> = rods.map(cell).chain(wedges.into_iter().filter(Option::is_some)).collect();
        let Some(mut cells) = raw.and_then(named) else { return Err((0..self.bends.len()).collect()) };
        // Where cells of segments meet, there is nothing between them.
        for (number, bend) in self.bends.iter().enumerate().filter(|(_, bend)| bend.steps == 0) {
            let nothing = Polytope::with(Arc::new(Structure::default()), Box::default(), Box::default(), Box::new([bend.at]));
            cells.push((self.figure(number), nothing));
        }
        polytopes.extend(bodies);
        self.cells = cells;
        Ok(())
    }

    /// The ring at a bend; none where a corner is neither on its axis nor clear of it.
    fn ring(&self, bend: &Bend, polytopes: &[Polytope], outer: f64) -> Option<Ring> {
        let (index, rod) = (bend.rods[0], self.rod(bend.rods[0])?);
        let (belt, way, polytope) = (rod.strips.len(), &bend.ways[0], &polytopes[index as usize]);
        let has_wedge = bend.steps > 0;
        let place = |corner: usize| rod.corner(corner) + rod.end(1) * belt;
        // How far out of the turn.
        let out = cross(way, &bend.axis);
        let height = |at: &Point| dot(&subtract(at, &bend.at), &out);
        let slope = (0.5 * bend.turn).tan();
        let mut nodes: Vec<Node> = Vec::with_capacity(belt + 2);
        for corner in 0..belt {
            let at = &polytope.corners[place(corner)];
            let height = height(at);
            let part = match height {
                _ if height.abs() <= ON_AXIS[0] * outer => Part::Axis,
                _ if height.abs() <= ON_AXIS[1] * outer && has_wedge => return None,
                _ if height > 0.0 => Part::Outer,
                _ => Part::Inner,
            };
            let moved = if !has_wedge || part == Part::Inner { height * slope } else { 0.0 };
            let at = std::array::from_fn(|axis| at[axis] + moved * way[axis]);
            nodes.push(Node { part, at, corner: Some(corner), name: edge_number(index, place(corner)) });
        }
        if has_wedge {
            let mut added = 0;
            for corner in (0..belt).rev() {
                let next = (corner + 1) % belt;
                // What was added is behind both.
                let parts = [corner, next].map(|corner| nodes.iter().find(|node| node.corner == Some(corner)).map(|node| node.part));
                if matches!(parts, [Some(Part::Outer), Some(Part::Inner)] | [Some(Part::Inner), Some(Part::Outer)]) {
                    let [p, q] = [corner, next].map(|corner| &polytope.corners[place(corner)]);
                    let at = between(p, q, height(p) / (height(p) - height(q)));
                    let name = edge_number(index, polytope.corners.len() + added);
                    nodes.insert(corner + 1, Node { part: Part::Axis, at, corner: None, name });
                    added += 1;
                }
            }
            let first = nodes.iter().position(|node| node.part == Part::Axis)?;
            nodes.rotate_left(first);
            if nodes.iter().filter(|node| node.part == Part::Axis).count() != 2 {
                return None;
            }
        }
        let plane = |normal: Point| [normal[0], normal[1], normal[2], dot(&normal, &bend.at)];
        let middle = unit(&std::array::from_fn(|k| bend.ways[0][k] + bend.ways[1][k]));
        Some(Ring { nodes, planes: [plane(bend.ways[0]), plane(bend.ways[1]), plane(middle)] })
    }

    /// The cell of a segment.
    fn cell(&self, index: u32, rod: &Rod, rings: &[Ring], polytope: &Polytope, form: &Form) -> Option<Raw> {
        let belt = rod.strips.len();
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
        // Where it goes on first: so what is added there has the numbers that its ring gives it.
        for side in [1, 0] {
            let Some(number) = rod.bends[side] else { continue };
            let (bend, ring, end) = (&self.bends[number], &rings[number], rod.end(side));
            let has_wedge = bend.steps > 0;
            let place = |corner: usize| rod.corner(corner) + end * belt;
            let mut around: Vec<(u16, Part)> = Vec::with_capacity(ring.nodes.len());
            for node in &ring.nodes {
                let own = node.corner.map_or(cell.corners.len(), place);
                if node.corner.is_none() {
                    cell.corners.push(node.at);
                    cell.names.push(node.name);
                } else if side == 1 || !has_wedge || node.part != Part::Outer {
                    cell.corners[own] = node.at;
                    cell.names[own] = node.name;
                }
                around.push((own as u16, node.part));
            }
            // Seen from outside, strips go clockwise around the end where a segment begins.
            if end == 0 {
                around.reverse();
            }
            if rod.is_reversed {
                around.reverse();
            }
            let count = around.len();
            for place in 0..count {
                let [before, (own, _), after] = [count - 1, 0, 1].map(|step| around[(place + step) % count]);
                if usize::from(own) >= polytope.corners.len() {
                    let strip = cell.facets[..belt].iter_mut().find(|strip| strip.contains(&before.0) && strip.contains(&after.0))?;
                    let at = strip.iter().position(|&corner| corner == after.0)?;
                    // Against the way around the end.
                    strip.insert(at + 1, own);
                }
            }
            let flat = shape.flats[end]?;
            let turned = |plane: Plane| if side == 1 { plane } else { plane.map(|part| -part) };
            let [first, second, middle] = ring.planes;
            let other = bend.rods[side];
            cell.beside.push(other);
            cell.inside.push(flat as u16);
            if !has_wedge {
                cell.facets[flat] = around.iter().map(|&(corner, _)| corner).collect();
                cell.planes[flat] = turned(middle);
                continue;
            }
            let of = |part: Part| {
                // From one corner on the axis to the other.
                let start = (0..count).find(|&place| around[place].1 == Part::Axis && around[(place + 1) % count].1 == part)?;
                let length = 2 + around.iter().filter(|(_, own)| *own == part).count();
                Some((0..length).map(|step| around[(start + step) % count].0).collect::<Vec<u16>>())
            };
            cell.facets[flat] = of(Part::Outer)?;
            cell.planes[flat] = turned([first, second][1 - side]);
            cell.inside.push(cell.facets.len() as u16);
            cell.facets.push(of(Part::Inner)?);
            cell.planes.push(turned(middle));
            cell.beside.push(self.figure(number));
        }
        Some(cell)
    }

    /// The wedge of a bend, whose first two facets are those that it has in common with segments; none where there is none, or where a facet would be too near.
    fn wedge(&self, number: usize, bend: &Bend, ring: &Ring, polytopes: &[Polytope], inner: f64) -> Option<Raw> {
        let (steps, index, [_, next]) = (bend.steps, self.figure(number), bend.rods);
        let rod = self.rod(next)?;
        let second = |corner: usize| rod.corner(corner) + rod.end(0) * rod.strips.len();
        let count = ring.nodes.len();
        let start =
            (0..count).find(|&place| ring.nodes[place].part == Part::Axis && ring.nodes[(place + 1) % count].part == Part::Outer)?;
        let length = 2 + ring.nodes.iter().filter(|node| node.part == Part::Outer).count();
        let row: Vec<&Node> = (0..length).map(|step| &ring.nodes[(start + step) % count]).collect();
        // The ends of the row, then what is between them, step by step.
        let (mut corners, mut names) = (vec![row[0].at, row[length - 1].at], vec![row[0].name, row[length - 1].name]);
        for step in 0..=steps {
            for node in &row[1..length - 1] {
                let at = second(node.corner?);
                if step == steps {
                    corners.push(polytopes[next as usize].corners[at]);
                    names.push(edge_number(next, at));
                    continue;
                }
                let from = bend.turned(&subtract(&node.at, &bend.at), step as f64 / steps as f64);
                let own = if step == 0 { node.name } else { edge_number(index, corners.len()) };
                corners.push(if step == 0 { node.at } else { std::array::from_fn(|axis| bend.at[axis] + from[axis]) });
                names.push(own);
            }
        }
        let place = |step: usize, along: usize| match along {
            0 => 0,
            _ if along == length - 1 => 1,
            _ => (2 + step * (length - 2) + along - 1) as u16,
        };
        let whole = |step: usize| (0..length).map(move |along| place(step, along));
        let (mut from, mut to): (Vec<u16>, Vec<u16>) = (whole(0).collect(), whole(steps).collect());
        // As the tube's strips go around, which is counter-clockwise seen from where it goes to.
        from.reverse();
        let (mut facets, mut planes) = (Vec::new(), Vec::new());
        facets.push(std::mem::take(&mut from));
        facets.push(std::mem::take(&mut to));
        planes.extend([ring.planes[0].map(|part| -part), ring.planes[1]]);
        for step in 0..steps {
            for along in 0..length - 1 {
                let mut facet = vec![place(step, along), place(step, along + 1), place(step + 1, along + 1), place(step + 1, along)];
                facet.dedup();
                if facet[0] == facet[facet.len() - 1] {
                    facet.pop();
                }
                let at = |k: usize| subtract(&corners[usize::from(facet[k])], &bend.at);
                let last = facet.len() - 1;
                // Across its diagonals, or two sides.
                let normal = unit(&cross(&subtract(&at(2), &at(0)), &subtract(&at(last), &at(1))));
                let offset = dot(&normal, &at(0));
                if offset < inner {
                    return None;
                }
                planes.push([normal[0], normal[1], normal[2], offset + dot(&normal, &bend.at)]);
                facets.push(facet);
            }
        }
        Some(Raw { index, facets, planes, corners, names, inside: vec![0, 1], beside: bend.rods.to_vec() })
    }
}

/// The cells, with the names of their edges; none where they do not close, or are not convex.
fn named(raw: Vec<Raw>) -> Option<Vec<(u32, Polytope)>> {
    let mut structures = Vec::with_capacity(raw.len());
    // Of every seam the edges that are one.
    let mut seams: BTreeMap<[u32; 2], Vec<(usize, usize)>> = BTreeMap::new();
    for (place, cell) in raw.iter().enumerate() {
        let structure = Structure::closed(&cell.facets, cell.corners.len())?;
        if !structure.is_convex(&cell.planes, &cell.corners, 0.0) {
            return None;
        }
        for (number, Edge { corners, facets }) in structure.edges.iter().enumerate() {
            if facets.iter().filter(|facet| cell.inside.contains(facet)).count() == 1 {
                let [p, q] = corners.map(|corner| cell.names[usize::from(corner)]);
                seams.entry([p.min(q), p.max(q)]).or_default().push((place, number));
            }
        }
        structures.push(structure);
    }
    let own = |(cell, structure): (&Raw, &Structure)| {
        let seam = |(number, edge): (usize, &Edge)| {
            let is_inside = edge.facets.map(|facet| cell.inside.contains(&facet));
            let facets = edge.facets.map(|facet| facet_number(cell.index, usize::from(facet)));
            Seam { name: edge_number(cell.index, number), facets: (is_inside == [false; 2]).then_some(facets) }
        };
        structure.edges.iter().enumerate().map(seam).collect::<Vec<Seam>>()
    };
    let mut edges: Vec<Vec<Seam>> = raw.iter().zip(&structures).map(own).collect();
    for both in seams.values() {
        let &[(first, own), (second, theirs)] = both.as_slice() else { return None };
        let outside = |place: usize, number: usize| {
            let facets = structures[place].edges[number].facets;
            facets
                .into_iter()
                .find(|facet| !raw[place].inside.contains(facet))
                .map(|facet| facet_number(raw[place].index, usize::from(facet)))
        };
        let (ours, other) = (outside(first, own)?, outside(second, theirs)?);
        let is_left = !raw[first].inside.contains(&structures[first].edges[own].facets[0]);
        edges[first][own].facets = Some(if is_left { [ours, other] } else { [other, ours] });
        edges[second][theirs].name = edges[first][own].name;
    }
    let cell = |((cell, structure), edges): ((Raw, Structure), Vec<Seam>)| {
        let Raw { index, planes, corners, names, inside, beside, .. } = cell;
        let mut polytope = Polytope::with(Arc::new(structure), planes.into(), Box::default(), corners.into());
        polytope.seams = Some(Box::new(Seams { corners: names.into(), edges: edges.into(), inside: inside.into(), beside: beside.into() }));
        (index, polytope)
    };
    Some(raw.into_iter().zip(structures).zip(edges).map(cell).collect())
}

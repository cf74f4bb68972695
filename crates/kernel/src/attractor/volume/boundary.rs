//! The faces of volumes that are glued to no other, as a surface whose faces are glued where they meet.

use super::super::cell::{ControlPoint, Point, child_points, distance_squared};
use super::super::complex::Start;
use super::super::{Attractor, Gluing, OwnRadius, Root};
use crate::automaton::StateId;
use crate::automaton::topology::View;
use crate::groups::Groups;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Volumes that hang together through faces.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Group {
    pub(super) roots: Vec<usize>,
    /// Faces that belong to one of them only: the root, and which of its boundaries they are.
    outer: Vec<(usize, usize)>,
}

/// Points are one place when closer than this share of the largest coordinate, as where products are lowered.
const SAME: f64 = 1e-12;
/// The same of faces that are glued.
const ALIKE: f64 = 4e-12;

/// A face in the making: of which root it is which boundary, its control points, and of its sides at both ends of the first and the second direction the cell of the complex.
struct Face {
    state: StateId,
    points: Vec<ControlPoint>,
    rational: bool,
    sides: [[u32; 2]; 2],
    /// Of both directions, whether all points along it are one place, and by how much these may differ.
    constant: [bool; 2],
    limit: f64,
    /// Of the sides, whether all points of it are one place.
    collapsed: [[bool; 2]; 2],
}

/// Boundaries of products are listed from the last direction to the first, each with its start and its end: the number of one, of `count` directions.
fn boundary(count: usize, direction: usize, end: usize) -> usize {
    2 * (count - 1 - direction) + end
}

/// The sign of a boundary in that of a cube with three directions.
fn sign(boundary: usize) -> bool {
    (boundary / 2 + boundary).is_multiple_of(2)
}

/// Whether control points are the same but for a factor, as those of faces are that are one.
fn are_alike(one: &[ControlPoint], other: &[ControlPoint]) -> bool {
    let largest = one.iter().flat_map(|point| [0, 1, 2].map(|k| point[k] / point[3])).fold(0.0_f64, |most, x| most.max(x.abs()));
    let is_same = |(a, b): (&ControlPoint, &ControlPoint)| {
        let scale = one[0][3] / other[0][3];
        (0..4).all(|k| (a[k] - scale * b[k]).abs() <= ALIKE * if k < 3 { largest * a[3].abs() } else { a[3].abs() })
    };
    one.len() == other.len() && one.iter().zip(other).all(is_same)
}

impl Attractor {
    /// Groups of volumes that are products of three curves, that hang together and have one radius; none of what is glued otherwise than products are.
    pub(super) fn groups_of_volumes(&self) -> Vec<Group> {
        let Some((topology, start)) = self.brep() else { return Vec::new() };
        let is_volume = |root: &usize| {
            let state = self.roots[*root].state;
            topology.state(state).dimension == 3 && self.automaton.factors(state).len() == 3
        };
        let mut places: BTreeMap<u32, Vec<(usize, usize)>> = BTreeMap::new();
        let mut groups = Groups::new(self.roots.len());
        let mut fits: Vec<bool> = (0..self.roots.len()).map(|root| is_volume(&root)).collect();
        for root in (0..self.roots.len()).filter(is_volume) {
            for (number, &(cell, view)) in topology.state(self.roots[root].state).closure.boundaries.iter().enumerate() {
                let (id, seen) = start.cell_of(root, cell);
                fits[root] &= view == View::SAME && seen == View::SAME;
                places.entry(id).or_default().push((root, number));
            }
        }
        let mut outer = Vec::new();
        for place in places.values() {
            match place.as_slice() {
                [own] => outer.push(*own),
                [(a, first), (b, second)] => {
                    groups.join(*a, *b);
                    let nets = [(*a, *first), (*b, *second)].map(|place| self.face_points(place));
                    fits[*a] &= sign(*first) != sign(*second) && are_alike(&nets[0], &nets[1]);
                }
                more => more.iter().for_each(|(root, _)| fits[*root] = false),
            }
        }
        let mut list: BTreeMap<u32, Group> = BTreeMap::new();
        for root in (0..self.roots.len()).filter(is_volume) {
            list.entry(groups.of(root)).or_insert_with(|| Group { roots: Vec::new(), outer: Vec::new() }).roots.push(root);
        }
        outer.sort_unstable();
        for place in outer {
            if let Some(group) = list.get_mut(&groups.of(place.0)) {
                group.outer.push(place);
            }
        }
        let has_one_radius = |group: &Group| {
            let own = self.own_radius(group.roots[0]);
            let is_one = own.is_none_or(|own| matches!(own, OwnRadius::Constant(_)));
            is_one && group.roots.iter().all(|&root| self.own_radius(root) == own)
        };
        list.into_values().filter(|group| group.roots.iter().all(|&root| fits[root]) && has_one_radius(group)).collect()
    }

    /// The boundary of a group as a surface; none where it does not hang together as that of products.
    ///
    /// Faces that are lines or points, as at the axis of a cylinder, are left out: two sides of theirs at which they end are one.
    pub(super) fn boundary_of(&self, group: &Group) -> Option<Self> {
        let (topology, start) = self.brep()?;
        let faces: Vec<Face> = group.outer.iter().map(|&place| self.face(start, place)).collect::<Option<_>>()?;
        let (mut sides, mut seam_mm) = (Groups::new(start.count()), self.seam_mm);
        for face in &faces {
            for direction in (0..2).filter(|&direction| face.constant[direction]) {
                let [from, to] = face.sides[direction];
                sides.join(from as usize, to as usize);
                seam_mm = seam_mm.max(face.limit);
            }
        }
        let (mut roots, mut gluings, mut collapsed) = (Vec::new(), Vec::new(), Vec::new());
        let mut firsts: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
        for face in faces.into_iter().filter(|face| face.constant == [false; 2]) {
            let own = roots.len();
            for (direction, end) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let place = (own, boundary(2, direction, end));
                let first = *firsts.entry(sides.of(face.sides[direction][end] as usize)).or_insert(place);
                if first != place {
                    gluings.push(Gluing { between: [first, place], permutation: None });
                }
                if face.collapsed[direction][end] {
                    collapsed.push(place);
                }
            }
            roots.push(Root { state: face.state, points: face.points, rational: face.rational, solid: None });
        }
        let mut topology = topology.clone();
        let start = Start::new(&mut topology, &self.automaton, &roots, &gluings, &collapsed).ok()?;
        let brep = Some((Arc::new(topology), start));
        let surface =
            Self { roots, solids: Vec::new(), brep, trimmed: Vec::new(), trims: Vec::new(), radii: Vec::new(), seam_mm, ..self.clone() };
        surface.is_surface().then_some(surface)
    }

    /// The control points of a boundary of a root.
    fn face_points(&self, (root, number): (usize, usize)) -> Vec<ControlPoint> {
        let Root { state, points, .. } = &self.roots[root];
        let incidence = &self.automaton.state(*state).boundaries[number].incidence;
        let mut own = vec![[0.0; 4]; incidence.columns()];
        child_points(points, incidence, &mut own);
        own
    }

    /// One face; none where its sides are not those of a product.
    fn face(&self, start: &Start, (root, number): (usize, usize)) -> Option<Face> {
        let (topology, _) = self.brep()?;
        let root_cell = &self.roots[root];
        let closure = &topology.state(root_cell.state).closure;
        let own = &closure.cells[closure.boundaries[number].0];
        let points = self.face_points((root, number));
        let &[u, v] = self.automaton.factors(own.state) else { return None };
        let [rows, columns] = [u, v].map(|factor| self.automaton.state(factor).dimension);
        let mut sides = [[0; 2]; 2];
        for (direction, end) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let (inner, view) = *topology.state(own.state).closure.boundaries.get(boundary(2, direction, end))?;
            let (cell, seen) = own.cells[inner];
            let (id, shown) = start.cell_of(root, cell);
            if [view, seen, shown] != [View::SAME; 3] {
                return None;
            }
            sides[direction][end] = id;
        }
        let places: Vec<Point> = points.iter().map(|point| std::array::from_fn(|k| point[k] / point[3])).collect();
        let limit = SAME * places.iter().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
        let are_one = |a: &Point, b: &Point| distance_squared(a, b) <= limit * limit;
        let at = |i: usize, j: usize| &places[i * columns + j];
        let constant = [
            (0..columns).all(|j| (1..rows).all(|i| are_one(at(i, j), at(0, j)))),
            (0..rows).all(|i| (1..columns).all(|j| are_one(at(i, j), at(i, 0)))),
        ];
        // With weights that are no products such a face is no line.
        let weight = |i: usize, j: usize| points[i * columns + j][3];
        let is_product = |i: usize, j: usize| {
            let [one, other] = [weight(i, j) * weight(0, 0), weight(i, 0) * weight(0, j)];
            (one - other).abs() <= SAME * one.abs()
        };
        if constant != [false; 2] && !(0..rows).all(|i| (0..columns).all(|j| is_product(i, j))) {
            return None;
        }
        // Pieces of splines that are not clamped end between their points: the ends are asked of the sides themselves.
        let collapsed = [0, 1].map(|direction| {
            [0, 1].map(|end| {
                let side = &self.automaton.state(own.state).boundaries[boundary(2, direction, end)].incidence;
                let mut ends = vec![[0.0; 4]; side.columns()];
                child_points(&points, side, &mut ends);
                let ends: Vec<Point> = ends.iter().map(|point| std::array::from_fn(|k| point[k] / point[3])).collect();
                ends.iter().all(|end| are_one(end, &ends[0]))
            })
        });
        Some(Face { state: own.state, rational: root_cell.rational, points, sides, constant, limit, collapsed })
    }
}

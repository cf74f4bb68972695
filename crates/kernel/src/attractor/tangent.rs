//! Tangent planes at the corners of smooth faces.
//!
//! Let v be a corner of a face of state s. One child has it as a corner again, and so on; the states on this way come to a
//! cycle, at s* say, with the product T of operators along it. T fixes the corner, and on columns of sum 0 let X (n x 2)
//! span the invariant subspace of its two largest eigenvalues, T X = X M, all other eigenvalues being smaller. With P the
//! control points at s*, the cell after k turns is P T^k, and for every z of sum 0, P T^k z = P X M^k Y z + o(|M^k|) with
//! Y X = I, Y T = M Y: seen from the corner the cell flattens into the plane spanned by P X. So the columns of X are
//! *tangent masks*, and with K the product of operators from s to s*, K X are those of s. At a smooth vertex M is a
//! multiple of the identity, and X holds the classical limit tangent masks (Halstead, Kass, DeRose, "Efficient, fair
//! interpolation using Catmull-Clark surfaces", SIGGRAPH 1993); at creases, boundaries and corners the face has the plane
//! of its own side. For polynomial patches X gives the partial derivatives.
//!
//! That the planes belong to the surface, and not to one corner of a fractal, needs more. What is verified: the gap behind
//! the second eigenvalue, and that all children of a face that meet in a vertex have the same tangent masks there, K X
//! spanning the same plane of barycentric vectors. Both are necessary for surfaces that are C1 inside faces, for all
//! control points; injectivity of the characteristic map (Reif, CAGD 12, 1995) is not examined. Single points without a
//! plane are exceptions: cones at vertices that stay, and the end of a smooth boundary with one face, whose eigenvalues
//! 1/2, 1/4, 1/4 (a Jordan block) show no plane. A state that comes back to itself and has no plane at any corner has none
//! anywhere.

use super::Attractor;
use super::cell::{ControlPoint, Point, cross, dot};
use super::invariant::dominant;
use crate::automaton::topology::{Source, Topology};
use crate::automaton::{Automaton, LeafPrimitive, StateId, SubdivisionOperator};

/// Why a shape has no normals.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoTangentPlane {
    /// It has no faces, or some that are not bounded by curves.
    #[error("the shape has no surface that is evaluated as one complex")]
    NoSurface,
    /// A corner's eigenvalues do not single out a plane.
    #[error("state '{state}' has no tangent plane at its corner {corner}: {reason}")]
    Corner {
        /// The face's state.
        state: String,
        /// Which corner.
        corner: usize,
        /// What is missing.
        reason: String,
    },
    /// Neighbouring children have different planes.
    #[error("state '{state}' has creases inside: its children {} and {} meet in a vertex with different tangent planes", children[0], children[1])]
    Crease {
        /// The face's state.
        state: String,
        /// The children.
        children: [usize; 2],
    },
}

/// Barycentric weights of two tangents; their vector product is the normal, as the outline runs.
type Masks = [Vec<f64>; 2];

/// Tangent masks of every face state.
#[derive(Clone, Debug)]
pub struct TangentPlanes {
    /// By state and corner; none where there is no tangent plane.
    corners: Vec<Vec<Option<Masks>>>,
    /// At the middles of faces.
    middles: Vec<Option<Masks>>,
    /// The first corner without plane.
    exception: Option<NoTangentPlane>,
}

/// Eigenvalues whose sizes differ by less than this share are not told apart.
const GAP: f64 = 1e-3;
/// Planes whose angle has a smaller sine are the same.
const SAME: f64 = 1e-6;
/// Steps of the iteration: the gap makes what is left of the third eigenvector small only if it is wide, so the residual
/// is measured.
const STEPS: usize = 400;

impl Attractor {
    /// The tangent masks of all faces that the roots reach.
    ///
    /// Cost: for each corner of each state a few hundred products of its operators with vectors.
    ///
    /// # Errors
    /// [`NoTangentPlane`] where there is no surface, or one that is not smooth inside its faces.
    pub fn tangent_planes(&self) -> Result<TangentPlanes, NoTangentPlane> {
        let Some((topology, start)) = &self.brep else { return Err(NoTangentPlane::NoSurface) };
        let automaton = &self.automaton;
        let mut needed = vec![false; automaton.states().len()];
        for root in &self.roots {
            if topology.state(root.state).dimension == 2 && start.is_drawn(root.state) {
                super::sites::reachable(automaton, root.state).into_iter().for_each(|state| needed[state] = true);
            }
        }
        if !needed.contains(&true) {
            return Err(NoTangentPlane::NoSurface);
        }
        let mut planes = TangentPlanes { corners: vec![Vec::new(); needed.len()], middles: vec![None; needed.len()], exception: None };
        let faces: Vec<usize> = (0..needed.len()).filter(|&index| needed[index]).collect();
        for &index in &faces {
            let id = StateId::new(index);
            let found = corners(automaton, topology, id);
            let reason = found.iter().find_map(|corner| corner.as_ref().err()).cloned();
            planes.corners[index] = found.into_iter().map(Result::ok).collect();
            let recurs = || automaton.state(id).transitions.iter().any(|t| super::sites::reachable(automaton, t.to).contains(&index));
            if let Some(reason) = reason {
                if planes.corners[index].iter().all(Option::is_none) && recurs() {
                    return Err(reason);
                }
                planes.exception.get_or_insert(reason);
            }
        }
        for &index in &faces {
            planes.same_inside(automaton, topology, StateId::new(index))?;
        }
        for &index in &faces {
            planes.middles[index] = planes.middle(automaton, topology, StateId::new(index), 2);
        }
        Ok(planes)
    }
}

impl TangentPlanes {
    /// Why some points have no tangent plane, if there are such points.
    #[must_use]
    pub fn exception(&self) -> Option<&NoTangentPlane> {
        self.exception.as_ref()
    }

    /// The unit normals at a face's corners, in the order of its outline; zero where the tangents are parallel.
    pub(super) fn normals(&self, state: StateId, points: &[ControlPoint], rational: bool, polygon: &[Point], out: &mut Vec<Point>) {
        for (masks, corner) in self.corners[state.index()].iter().zip(polygon) {
            out.push(masks.as_ref().map_or([0.0; 3], |masks| normal(masks, points, rational, corner)));
        }
    }

    /// As [`Self::normals`] at the middle of a face.
    pub(super) fn middle_normal(&self, state: StateId, points: &[ControlPoint], rational: bool, middle: &Point) -> Point {
        self.middles[state.index()].as_ref().map_or([0.0; 3], |masks| normal(masks, points, rational, middle))
    }

    /// Whether all children that meet in a vertex have one plane there.
    fn same_inside(&self, automaton: &Automaton, topology: &Topology, id: StateId) -> Result<(), NoTangentPlane> {
        let split = &topology.state(id).split;
        let transitions = &automaton.state(id).transitions;
        let mut met: Vec<(Source, usize, Masks)> = Vec::new();
        for (child, transition) in transitions.iter().enumerate() {
            for (corner, &vertex) in corner_cells(topology, transition.to).iter().enumerate() {
                let source = split.children[child][vertex];
                let Some(masks) = &self.corners[transition.to.index()][corner] else { continue };
                let masks = masks.each_ref().map(|mask| transition.operator.apply(mask));
                if let Some((_, other, theirs)) = met.iter().find(|(known, ..)| known.is_cell_of(&source)) {
                    if !same_plane(theirs, &masks) {
                        return Err(NoTangentPlane::Crease { state: automaton.state(id).name.clone(), children: [*other, child] });
                    }
                } else {
                    met.push((source, child, masks));
                }
            }
        }
        Ok(())
    }

    /// The masks at the middle of a face: a corner of a child, or of a child's child.
    fn middle(&self, automaton: &Automaton, topology: &Topology, id: StateId, depth: usize) -> Option<Masks> {
        let middle = &topology.state(id).middle;
        if middle.is_empty() {
            return None;
        }
        let mut level: Vec<(StateId, SubdivisionOperator)> = vec![(id, SubdivisionOperator::identity(automaton.state(id).dimension))];
        for _ in 0..depth {
            let mut next = Vec::new();
            for (state, word) in &level {
                for transition in &automaton.state(*state).transitions {
                    let word = word.times(&transition.operator);
                    let LeafPrimitive::Polygon(polygon) = &automaton.state(transition.to).leaf else { return None };
                    for (corner, masks) in polygon.iter().zip(&self.corners[transition.to.index()]) {
                        let off = word.apply(corner).iter().zip(middle).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                        if off < 1e-9 {
                            return masks.as_ref().map(|masks| masks.each_ref().map(|mask| word.apply(mask)));
                        }
                    }
                    next.push((transition.to, word));
                }
            }
            level = next;
        }
        None
    }
}

/// (P a) x (P b), made a unit vector; with weights, of the derivatives after projection.
fn normal(masks: &Masks, points: &[ControlPoint], rational: bool, at: &Point) -> Point {
    let [a, b] = masks.each_ref().map(|mask| {
        let mut sum = [0.0; 4];
        for (point, &weight) in points.iter().zip(mask) {
            sum.iter_mut().zip(point).for_each(|(total, &coordinate)| *total += weight * coordinate);
        }
        // (N / w)' is N' - (N / w) w', over w.
        let weight = if rational { sum[3] } else { 0.0 };
        [sum[0] - at[0] * weight, sum[1] - at[1] * weight, sum[2] - at[2] * weight]
    });
    let normal = cross(&a, &b);
    let length = dot(&normal, &normal).sqrt();
    // Masks are orthonormal but for the way to the cycle; parallel tangents give what rounding leaves.
    if length > 1e-9 * (dot(&a, &a) * dot(&b, &b)).sqrt() { normal.map(|x| x / length) } else { [0.0; 3] }
}

/// Corners of a face's outline, as cells of its closure.
fn corner_cells(topology: &Topology, id: StateId) -> Vec<usize> {
    let own = topology.state(id);
    let corner = |&(position, backwards): &(usize, bool)| {
        let edge = &own.closure.cells[position];
        let [start, end] = topology.ends(edge.state)?;
        Some(edge.cells[if backwards { end } else { start }].0)
    };
    own.outline.iter().flatten().filter_map(corner).collect()
}

fn corners(automaton: &Automaton, topology: &Topology, id: StateId) -> Vec<Result<Masks, NoTangentPlane>> {
    let cells = corner_cells(topology, id);
    let masks = |(corner, &cell): (usize, &usize)| {
        corner_masks(automaton, topology, id, cell).map_err(|reason| {
            let state = automaton.state(id).name.clone();
            NoTangentPlane::Corner { state, corner, reason: reason.into() }
        })
    };
    cells.iter().enumerate().map(masks).collect()
}

/// The child that has a corner of the parent, and which of its cells that is.
fn follow(topology: &Topology, id: StateId, cell: usize) -> Option<(usize, usize)> {
    let mut found = None;
    for (child, sources) in topology.state(id).split.children.iter().enumerate() {
        for (inner, source) in sources.iter().enumerate() {
            if *source == (Source::Vertex { cell }) {
                if found.is_some() {
                    return None;
                }
                found = Some((child, inner));
            }
        }
    }
    found
}

fn corner_masks(automaton: &Automaton, topology: &Topology, id: StateId, cell: usize) -> Result<Masks, &'static str> {
    let mut way = vec![(id, cell)];
    let mut operators: Vec<&SubdivisionOperator> = Vec::new();
    let first = loop {
        let (state, cell) = way[way.len() - 1];
        let (child, inner) = follow(topology, state, cell).ok_or("several children meet there")?;
        let transition = &automaton.state(state).transitions[child];
        operators.push(&transition.operator);
        let next = (transition.to, inner);
        if let Some(first) = way.iter().position(|known| *known == next) {
            break first;
        }
        way.push(next);
    };
    let product = |range: std::ops::Range<usize>, from: StateId| {
        let start = SubdivisionOperator::identity(automaton.state(from).dimension);
        operators[range].iter().fold(start, |word, operator| word.times(operator))
    };
    let (to, from) = way[first];
    let cycle = product(first..operators.len(), to);
    let mut tangents = plane(&cycle)?;
    // As the outline runs: seen in the plane, the next corner comes before the middle.
    let LeafPrimitive::Polygon(polygon) = &automaton.state(to).leaf else { return Err("it is no polygon") };
    let corner = corner_cells(topology, to).iter().position(|&other| other == from).ok_or("it is on no outline")?;
    if orientation(&cycle, polygon, corner, &tangents).ok_or("its plane has no orientation")? {
        tangents.swap(0, 1);
    }
    let way = product(0..first, id);
    Ok(tangents.map(|tangent| way.apply(&tangent)))
}

/// The invariant subspace of columns of sum 0 that belongs to the two largest eigenvalues.
fn plane(cycle: &SubdivisionOperator) -> Result<Masks, &'static str> {
    let n = cycle.rows();
    let start = |seed: f64| (0..n).map(|k| (seed * (k + 1) as f64).sin()).collect::<Vec<f64>>();
    let mut basis = [start(1.7), start(2.3), start(3.1)];
    let mut sizes = [0.0; 3];
    for step in 0..STEPS {
        if step > 0 {
            basis = basis.map(|column| cycle.apply(&column));
        }
        for k in 0..3 {
            let mean = basis[k].iter().sum::<f64>() / n as f64;
            basis[k].iter_mut().for_each(|x| *x -= mean);
            for _ in 0..2 {
                for j in 0..k {
                    let share: f64 = basis[k].iter().zip(&basis[j]).map(|(a, b)| a * b).sum();
                    let other = basis[j].clone();
                    basis[k].iter_mut().zip(other).for_each(|(x, y)| *x -= share * y);
                }
            }
            sizes[k] = basis[k].iter().map(|x| x * x).sum::<f64>().sqrt();
            // Nilpotent directions vanish: what is left is rounding.
            let scale = if sizes[k] > 1e-14 { 1.0 / sizes[k] } else { 0.0 };
            basis[k].iter_mut().for_each(|x| *x *= scale);
        }
    }
    let [first, second, _] = basis;
    if sizes[1] <= 1e-12 {
        return Err("its cells shrink to a curve");
    }
    if sizes[2] >= sizes[1] * (1.0 - GAP) {
        return Err("three eigenvalues or more are of the same size");
    }
    let off = |column: &Vec<f64>| {
        let mut image = cycle.apply(column);
        for other in [&first, &second] {
            let share: f64 = image.iter().zip(other).map(|(a, b)| a * b).sum();
            image.iter_mut().zip(other).for_each(|(x, y)| *x -= share * y);
        }
        image.iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    if off(&first).max(off(&second)) > 1e-11 * sizes[1] {
        return Err("its eigenvalues do not single out a plane");
    }
    Ok([first, second])
}

/// Whether the masks are to be exchanged; `None` when the polygon is seen edge-on.
fn orientation(cycle: &SubdivisionOperator, polygon: &[Vec<f64>], corner: usize, tangents: &Masks) -> Option<bool> {
    let rows = dominant(cycle)?;
    let seen = |z: &[f64]| [1, 2].map(|k| rows[k].iter().zip(z).map(|(a, b)| a * b).sum::<f64>());
    let determinant = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let from = &polygon[corner];
    let next: Vec<f64> = polygon[(corner + 1) % polygon.len()].iter().zip(from).map(|(a, b)| a - b).collect();
    let mut middle: Vec<f64> = from.iter().map(|x| -x).collect();
    for other in polygon {
        middle.iter_mut().zip(other).for_each(|(sum, x)| *sum += x / polygon.len() as f64);
    }
    let (turn, sense) = (determinant(seen(&next), seen(&middle)), determinant(seen(&tangents[0]), seen(&tangents[1])));
    (turn.abs() > 1e-9 && sense.abs() > 1e-9).then_some((turn > 0.0) != (sense > 0.0))
}

/// Whether two pairs of vectors span the same plane.
fn same_plane(a: &Masks, b: &Masks) -> bool {
    let product = |u: &[f64], v: &[f64]| u.iter().zip(v).map(|(x, y)| x * y).sum::<f64>();
    let unit = |masks: &Masks| -> Option<Masks> {
        let [mut u, mut v] = masks.clone();
        let size = product(&u, &u).sqrt();
        u.iter_mut().for_each(|x| *x /= size);
        let share = product(&u, &v);
        v.iter_mut().zip(&u).for_each(|(x, y)| *x -= share * y);
        let size = product(&v, &v).sqrt();
        v.iter_mut().for_each(|x| *x /= size);
        u.iter().chain(&v).all(|x| x.is_finite()).then_some([u, v])
    };
    let (Some(a), Some(b)) = (unit(a), unit(b)) else { return false };
    b.iter().all(|v| {
        let inside: f64 = a.iter().map(|u| product(u, v).powi(2)).sum();
        (1.0 - inside).max(0.0).sqrt() <= SAME
    })
}

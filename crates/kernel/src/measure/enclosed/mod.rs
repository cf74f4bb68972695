//! The volume that a closed surface encloses, from its control points alone: of any surface with a B-rep, rough ones included.
//!
//! Let P be a cell's control points, Q their differences from one of them, the base c. The integral of x x dx / 2 along an edge, E, is a bilinear form of Q and the
//! ends' differences from c; the vector area of a face, A, the sum of its edges', depends on Q alone; the volume of the cone over a face from the origin is
//! F(Q) + c . A(Q) / 3 with a trilinear F. All are sums of the same forms of the children, with their signs, so that
//!
//!   e_s = sum of +-(T e_c T^T + (t u^T - u t^T) / 2),   F_s = sum of +-((T x T x T) F_c + alt(t, T a_c T^T) / 3),
//!
//! T taking differences of the parent to those of the child, t being the child's base and u its end less its start as the parent sees them, and alt(t, b)_ijk =
//! t_i b_jk + t_j b_ki + t_k b_ij. Where these linear systems converge (`forms`) their solutions are the limits of what polyhedra with vertices on the surface give. The
//! sum over all faces of a closed surface is its volume (Hakenberg, Reif, Schaefer, Warren, "Volume enclosed by subdivision surfaces", 2014, find the trilinear forms
//! of the classical schemes from their eigenvectors).
//!
//! The interval holds what rounding can do. Entries of operators within their last bits of a fraction with a small denominator are taken to be that fraction, others to be
//! off by as much. Incidences that hold to few digits only, as a file may state them, are measured, and refused.

mod double;
mod forms;
mod orientation;

use super::Interval;
use crate::attractor::cell::ControlPoint;
use crate::attractor::{Attractor, Root};
use crate::automaton::topology::Topology;
use crate::automaton::{Automaton, StateId, SubdivisionOperator, Transition};
use crate::budget::{Budget, Stopped};
use double::{Double, UNIT};
use forms::{Equation, Form, Matrix, Part, Unsolved, add, norm_of, solve};
use orientation::{children_turned, roots_turned};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Why a shape encloses no volume that is known exactly.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotEnclosed {
    /// Some of it is no surface of cells with a B-rep.
    #[error("some of it is no surface whose cells state their boundaries")]
    NoSurface,
    /// An edge belongs to one face, or to more than two.
    #[error("the surface does not close: {0} edges do not belong to two faces")]
    Open(u64),
    /// It has one side, or the children of a face are joined in a way that has.
    #[error("the surface has no inside: {0}")]
    OneSided(String),
    /// Several closed surfaces.
    #[error("it consists of {0} closed surfaces, of which nobody said what is inside of what: measure one at a time")]
    Pieces(usize),
    /// Weights.
    #[error("control points have different weights: the volume of rational cells is no polynomial in their control points")]
    Rational,
    /// The sums do not converge, or not within the search's work.
    #[error(
        "the volume under cells of state '{state}' is not proven to converge: the factors of the finest subdivision that was examined add up to {sum:.3}, and must come below 0.5"
    )]
    Divergent {
        /// The state.
        state: String,
        /// What the factors add up to.
        sum: f64,
    },
    /// Forms of more control points are too large.
    #[error("state '{state}' has {points} control points, and forms of {MOST_POINTS} at most are computed")]
    TooLarge {
        /// The state.
        state: String,
        /// Its control points.
        points: usize,
    },
    /// Children do not tile their parent's boundary to rounding.
    #[error(
        "the boundary of state '{state}' differs from that of its children by {off:.1e} of its size: operators that are given with more digits would do"
    )]
    Inexact {
        /// The state.
        state: String,
        /// How far, as a share.
        off: f64,
    },
    /// Somebody stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// Control points of a state at most: a form's coefficients grow with their cube.
const MOST_POINTS: usize = 40;
/// Roots that are measured between two looks at the budget.
const CHUNK: usize = 1 << 12;
/// Boundaries that differ by more than this share are no rounding.
const INEXACT: f64 = 1e-10;

/// The volume that a closed surface encloses, in mm^3: where it passes through itself, parts are counted as often as it winds around them.
///
/// Cost: for every state with n control points some 100 n^4 operations, and for every root n^3.
///
/// # Errors
/// [`NotEnclosed`].
pub fn enclosed_volume(attractor: &Attractor, budget: &Budget) -> Result<Interval, NotEnclosed> {
    let roots = attractor.roots();
    if roots.iter().any(|root| root.rational && root.points.iter().any(|point| point[3] != root.points[0][3])) {
        return Err(NotEnclosed::Rational);
    }
    let Some((topology, _)) = attractor.brep() else { return Err(NotEnclosed::NoSurface) };
    let surface = |(index, root): (usize, &Root)| {
        attractor.has_brep(index)
            && topology.state(root.state).outline.is_some()
            && attractor.trim_of(index).is_none()
            && root.points.len() > 2
    };
    if roots.is_empty() || !roots.iter().enumerate().all(surface) {
        return Err(NotEnclosed::NoSurface);
    }
    let turned = roots_turned(attractor)?;
    let faces = Faces::new(attractor, topology, budget)?;
    // Seen from some point of the surface, coordinates are as small as they can be.
    let origin = position(&roots[0], 0);
    let cone = |root: &Root| {
        // Divisions by a common weight are off as control points may be.
        let largest = (0..root.points.len()).flat_map(|k| position(root, k)).fold(0.0, |largest: f64, x| largest.max(x.abs()));
        let divided = if root.rational { f64::EPSILON * largest } else { 0.0 };
        faces.volume(root, &origin, attractor.seam_mm() + divided)
    };
    let (mut sum, mut error) = (Double::default(), 0.0);
    for (roots, turned) in roots.chunks(CHUNK).zip(turned.chunks(CHUNK)) {
        budget.cancel.check()?;
        let cones: Vec<(Double, f64)> = roots.par_iter().map(cone).collect();
        for ((volume, off), &turned) in cones.into_iter().zip(turned) {
            sum = sum + volume * Double::from(if turned { -1.0 } else { 1.0 });
            error += off;
        }
    }
    let [volume, error] = [sum.high.abs(), error * (1.0 + 1e-9)];
    Ok(Interval { low: (volume - error).next_down().max(0.0), high: (volume + error).next_up() })
}

/// A control point less its weight.
fn position(root: &Root, index: usize) -> [f64; 3] {
    let point: &ControlPoint = &root.points[index];
    std::array::from_fn(|axis| if root.rational { point[axis] / point[3] } else { point[axis] })
}

/// The forms of all face states that the roots reach.
struct Faces {
    /// The base of every state.
    bases: BTreeMap<StateId, usize>,
    areas: BTreeMap<StateId, Form>,
    volumes: BTreeMap<StateId, Form>,
}

/// A curve as a form of its state's differences: e, and its end less its start.
struct Curve {
    bend: Form,
    reach: Form,
}

/// All states of one dimension that some lead to, in the order of their ids.
fn below(automaton: &Automaton, from: impl Iterator<Item = StateId>) -> Vec<StateId> {
    let mut waiting: Vec<StateId> = from.collect();
    let mut seen = BTreeSet::new();
    while let Some(id) = waiting.pop() {
        if seen.insert(id) {
            waiting.extend(automaton.state(id).transitions.iter().map(|transition| transition.to));
        }
    }
    seen.into_iter().collect()
}

/// The control point that lies in the middle of a cell's corners: seen from it the others are near.
fn base(automaton: &Automaton, topology: &Topology, id: StateId) -> usize {
    let own = topology.state(id);
    let corners = own.closure.cells.iter().map(|cell| &cell.point).chain(std::iter::once(&own.limit));
    let weights = corners.fold(vec![0.0; automaton.state(id).dimension], |mut sum, corner| {
        sum.iter_mut().zip(corner).for_each(|(sum, x)| *sum += x);
        sum
    });
    (0..weights.len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap_or(0)
}

/// What all stages share.
struct Setting<'a> {
    automaton: &'a Automaton,
    topology: &'a Topology,
    budget: &'a Budget,
    bases: BTreeMap<StateId, usize>,
}

impl Setting<'_> {
    fn matrix(&self, operator: &SubdivisionOperator, from: StateId, to: StateId) -> Matrix {
        Matrix::new(operator, [self.bases[&from], self.bases[&to]])
    }

    /// Solves the equations of some states.
    fn solved(&self, degree: usize, states: &[StateId], equations: &[Equation]) -> Result<BTreeMap<StateId, Form>, NotEnclosed> {
        let forms = solve(degree, equations, self.budget).map_err(|error| match error {
            Unsolved::Stopped(stopped) => NotEnclosed::Stopped(stopped),
            Unsolved::Divergent { unknown, sum } => {
                NotEnclosed::Divergent { state: self.automaton.state(states[unknown]).name.clone(), sum }
            }
        })?;
        Ok(states.iter().copied().zip(forms).collect())
    }

    /// The children's shares in the equation of a state, those that are turned with a minus sign.
    fn parts(&self, id: StateId, states: &[StateId], turned: &[bool]) -> Vec<Part> {
        let place = |to: StateId| states.binary_search(&to).expect("descendants were listed");
        let transitions = self.automaton.state(id).transitions.iter().zip(turned);
        let part = |(transition, &turned): (&Transition, &bool)| Part {
            child: place(transition.to),
            sign: if turned { -1.0 } else { 1.0 },
            matrix: self.matrix(&transition.operator, id, transition.to),
        };
        transitions.map(part).collect()
    }

    /// The limit points of vertices: p_s = T p_c + t.
    fn vertices(&self, states: &[StateId]) -> Result<BTreeMap<StateId, Form>, NotEnclosed> {
        let equation = |&id: &StateId| {
            let parts = self.parts(id, states, &[false]);
            let nothing = vec![Double::default(); self.automaton.state(id).dimension - 1];
            let constant = parts.first().map_or(nothing, |part| part.matrix.offset.clone());
            let error = parts.first().map_or(0.0, |part| part.matrix.offset_error());
            Equation { constant, error, parts }
        };
        let equations: Vec<Equation> = states.iter().map(equation).collect();
        self.solved(1, states, &equations)
    }

    /// e and u of all edges.
    fn curves(&self, states: &[StateId], vertices: &BTreeMap<StateId, Form>) -> Result<BTreeMap<StateId, Curve>, NotEnclosed> {
        let mut reaches: BTreeMap<StateId, Form> = BTreeMap::new();
        let mut segments: BTreeMap<StateId, (Vec<Double>, f64)> = BTreeMap::new();
        for &id in states {
            let own = self.topology.state(id);
            let ends = self.topology.ends(id).ok_or(NotEnclosed::NoSurface)?;
            let [start, end] = ends.map(|cell| {
                let cell = &own.closure.cells[cell];
                let (matrix, vertex) = (self.matrix(&cell.embedding, id, cell.state), &vertices[&cell.state]);
                let mut point = matrix.push(1, &vertex.coefficients);
                add(&mut point, 1.0, &matrix.offset);
                Form { coefficients: point, error: matrix.error(1, &vertex.coefficients, vertex.error) + matrix.offset_error() }
            });
            if self.automaton.state(id).transitions.is_empty() {
                let error = start.error * (norm_of(&end.coefficients) + end.error) + end.error * norm_of(&start.coefficients);
                segments.insert(id, (bivector(&start.coefficients, &end.coefficients), error));
            }
            let mut reach = end.coefficients;
            add(&mut reach, -1.0, &start.coefficients);
            reaches.insert(id, Form { coefficients: reach, error: start.error + end.error });
        }
        let mut equations = Vec::with_capacity(states.len());
        for &id in states {
            if let Some((constant, error)) = segments.remove(&id) {
                equations.push(Equation { constant, error, parts: Vec::new() });
                continue;
            }
            let chain = self.topology.state(id).chain.as_ref().ok_or(NotEnclosed::NoSurface)?;
            let turned: Vec<bool> = chain.iter().map(|&(_, backwards)| backwards).collect();
            let parts = self.parts(id, states, &turned);
            let side = self.automaton.state(id).dimension - 1;
            let mut equation = Equation { constant: vec![Double::default(); side * side], error: 0.0, parts };
            for part in &equation.parts {
                let (shift, error) = shifted(&part.matrix, &reaches[&states[part.child]]);
                add(&mut equation.constant, part.sign, &shift);
                equation.error += error;
            }
            equations.push(equation);
        }
        let bends = self.solved(2, states, &equations)?;
        let curve = |(id, bend): (StateId, Form)| Some((id, Curve { bend, reach: reaches.remove(&id)? }));
        Ok(bends.into_iter().filter_map(curve).collect())
    }

    /// The vector area of a face: the sum of its edges', as its outline runs.
    fn area(&self, id: StateId, curves: &BTreeMap<StateId, Curve>) -> Result<Form, NotEnclosed> {
        let own = self.topology.state(id);
        let side = self.automaton.state(id).dimension - 1;
        let mut area = Form { coefficients: vec![Double::default(); side * side], error: 0.0 };
        for &(cell, backwards) in own.outline.as_ref().ok_or(NotEnclosed::NoSurface)? {
            let cell = &own.closure.cells[cell];
            let (matrix, curve) = (self.matrix(&cell.embedding, id, cell.state), &curves[&cell.state]);
            let sign = if backwards { -1.0 } else { 1.0 };
            let (shift, error) = shifted(&matrix, &curve.reach);
            add(&mut area.coefficients, sign, &shift);
            add(&mut area.coefficients, sign, &matrix.push(2, &curve.bend.coefficients));
            area.error += error + matrix.error(2, &curve.bend.coefficients, curve.bend.error);
        }
        Ok(area)
    }
}

/// (t u^T - u t^T) / 2, and its error, with the offset t of a matrix T and u = T reach.
fn shifted(matrix: &Matrix, reach: &Form) -> (Vec<Double>, f64) {
    let (moved, off) = (matrix.push(1, &reach.coefficients), matrix.error(1, &reach.coefficients, reach.error));
    let error = off * (norm_of(&matrix.offset) + matrix.offset_error()) + matrix.offset_error() * norm_of(&moved);
    (bivector(&matrix.offset, &moved), error)
}

/// (a b^T - b a^T) / 2.
fn bivector(a: &[Double], b: &[Double]) -> Vec<Double> {
    let [half, minus] = [0.5, -0.5].map(Double::from);
    let row = |i: usize| (0..b.len()).map(move |j| half * a[i] * b[j] + minus * b[i] * a[j]);
    (0..a.len()).flat_map(row).collect()
}

/// alt(t, b) / 3.
fn trivector(t: &[Double], b: &[Double]) -> Vec<Double> {
    let (n, third) = (t.len(), Double::quotient(1.0, 3.0));
    let mut form = Vec::with_capacity(n * n * n);
    for i in 0..n {
        for j in 0..n {
            form.extend((0..n).map(|k| third * (t[i] * b[j * n + k] + t[j] * b[k * n + i] + t[k] * b[i * n + j])));
        }
    }
    form
}

impl Faces {
    fn new(attractor: &Attractor, topology: &Topology, budget: &Budget) -> Result<Self, NotEnclosed> {
        let automaton = attractor.automaton();
        let faces = below(automaton, attractor.roots().iter().map(|root| root.state));
        let boundaries = |states: &[StateId], dimension: usize| -> Vec<StateId> {
            let cells = states.iter().flat_map(|&id| &topology.state(id).closure.cells).map(|cell| cell.state);
            below(automaton, cells.filter(|&id| topology.state(id).dimension == dimension))
        };
        let edges = boundaries(&faces, 1);
        let vertices = boundaries(&edges, 0);
        let all = || faces.iter().chain(&edges).chain(&vertices);
        for &id in all() {
            let state = automaton.state(id);
            if state.dimension > MOST_POINTS {
                return Err(NotEnclosed::TooLarge { state: state.name.clone(), points: state.dimension });
            }
        }
        let bases = all().map(|&id| (id, base(automaton, topology, id))).collect();
        let setting = Setting { automaton, topology, budget, bases };
        let limits = setting.vertices(&vertices)?;
        let curves = setting.curves(&edges, &limits)?;
        let mut areas: BTreeMap<StateId, Form> = BTreeMap::new();
        for &id in &faces {
            areas.insert(id, setting.area(id, &curves)?);
        }
        let mut equations = Vec::with_capacity(faces.len());
        for &id in &faces {
            let turned = children_turned(topology, id).ok_or_else(|| {
                NotEnclosed::OneSided(format!("the children of state '{}' are not joined like faces of one side", automaton.state(id).name))
            })?;
            equations.push(Equation { parts: setting.parts(id, &faces, &turned), ..Equation::default() });
        }
        let gaps: Vec<f64> = faces.iter().zip(&equations).map(|(id, own)| gap(&areas[id], own, &faces, &areas)).collect();
        for (id, gap) in faces.iter().zip(gaps) {
            let area = areas.entry(*id).or_default();
            let size = norm_of(&area.coefficients);
            if gap > INEXACT * size {
                return Err(NotEnclosed::Inexact { state: automaton.state(*id).name.clone(), off: gap / size });
            }
            area.error += gap;
        }
        equations.iter_mut().zip(&faces).for_each(|(own, id)| add_cones(own, automaton.state(*id).dimension - 1, &faces, &areas));
        let volumes = setting.solved(3, &faces, &equations)?;
        Ok(Self { bases: setting.bases, areas, volumes })
    }

    /// The volume of the cone over a root from a point, and what it may be off, control points being off by `seam`.
    fn volume(&self, root: &Root, origin: &[f64; 3], seam: f64) -> (Double, f64) {
        let (form, area, base) = (&self.volumes[&root.state], &self.areas[&root.state], self.bases[&root.state]);
        let difference = |a: &[f64; 3], b: &[f64; 3]| -> [Double; 3] { std::array::from_fn(|k| Double::from(a[k]) + Double::from(-b[k])) };
        let centre = position(root, base);
        let others = (0..root.points.len()).filter(|&index| index != base);
        let sides: Vec<[Double; 3]> = others.map(|index| difference(&position(root, index), &centre)).collect();
        let (n, from) = (sides.len(), difference(&centre, origin));
        let (mut volume, mut vector) = (Double::default(), [Double::default(); 3]);
        for i in 0..n {
            for j in i + 1..n {
                let product = cross(&sides[i], &sides[j]);
                let mut inner = [Double::default(); 3];
                for (side, &weight) in sides[j + 1..].iter().zip(&form.coefficients[(i * n + j) * n + j + 1..]) {
                    inner.iter_mut().zip(side).for_each(|(sum, &x)| *sum = *sum + weight * x);
                }
                volume = volume + dot(&inner, &product);
                let weight = area.coefficients[i * n + j];
                vector.iter_mut().zip(product).for_each(|(sum, x)| *sum = *sum + weight * x);
            }
        }
        let size = |x: &[Double; 3]| x.iter().map(|x| x.high * x.high).sum::<f64>().sqrt();
        let (reach, away) = (sides.iter().map(size).fold(0.0, f64::max), size(&from));
        let (of_form, of_area) = (norm_of(&form.coefficients), norm_of(&area.coefficients));
        let rounding = 1e3 * UNIT * (of_form * reach.powi(3) + away * of_area * reach.powi(2));
        let forms = form.error * reach.powi(3) / 6.0 + away * area.error * reach.powi(2) / 6.0;
        let wide = reach + 2.0 * seam;
        let seams =
            seam * wide.powi(2) * (of_form + form.error) + seam * wide * (wide + 2.0 * away + 2.0 * seam) * (of_area + area.error) / 3.0;
        (volume + Double::quotient(1.0, 3.0) * dot(&from, &vector), rounding + forms + seams)
    }
}

/// How far a face's vector area is from the sum of its children's.
fn gap(area: &Form, own: &Equation, faces: &[StateId], areas: &BTreeMap<StateId, Form>) -> f64 {
    // A face that does not subdivide is a triangle.
    if own.parts.is_empty() {
        return 0.0;
    }
    let mut rest = area.coefficients.clone();
    for part in &own.parts {
        add(&mut rest, -part.sign, &part.matrix.push(2, &areas[&faces[part.child]].coefficients));
    }
    norm_of(&rest)
}

/// Completes the equation of a face's volume by the cones from its base over its children. (A triangle has none: its base lies in its plane.)
fn add_cones(own: &mut Equation, side: usize, faces: &[StateId], areas: &BTreeMap<StateId, Form>) {
    own.constant = vec![Double::default(); side.pow(3)];
    for part in &own.parts {
        let (area, matrix) = (&areas[&faces[part.child]], &part.matrix);
        let (moved, off) = (matrix.push(2, &area.coefficients), matrix.error(2, &area.coefficients, area.error));
        add(&mut own.constant, part.sign, &trivector(&matrix.offset, &moved));
        own.error += off * (norm_of(&matrix.offset) + matrix.offset_error()) + matrix.offset_error() * norm_of(&moved);
    }
}

fn cross(a: &[Double; 3], b: &[Double; 3]) -> [Double; 3] {
    let minus = Double::from(-1.0);
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i] * b[j] + minus * a[j] * b[i]
    })
}

fn dot(a: &[Double; 3], b: &[Double; 3]) -> Double {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

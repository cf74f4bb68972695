//! From a model to its equations.

use super::rational::Rational;
use super::system::{Array, Cell, Constraint, Equations, Place, System, Unknown};
use super::{ConflictingConstraint, SolveError};
use crate::automaton::operator::COLUMN_SUM_CORRECTED;
use crate::model::bcifs::{Bcifs, CellKind, Entry, Matrix, RESIDUAL_ALLOWED, Side};
use crate::model::lower::Finding;
use std::collections::BTreeMap;

/// Glued boundaries may differ by this share of the model's size.
pub(in crate::model) const GLUE_ALLOWED: f64 = 1e-6;

/// Unknowns that a model may have.
const UNKNOWNS: usize = 20_000;

/// Reads the model; `values` are what the caller chooses, by name.
pub(super) fn read(model: &Bcifs, values: &BTreeMap<String, f64>) -> Result<System, SolveError> {
    let mut reader = Reader {
        model,
        index: model.index(),
        reachable: if model.cells.is_empty() { vec![true; model.states.len()] } else { model.reachable() },
        system: System::default(),
        keys: Vec::new(),
        declared: BTreeMap::new(),
        operators: Vec::new(),
        embeddings: Vec::new(),
        points: Vec::new(),
        findings: Vec::new(),
    };
    reader.states();
    let size = reader.control_points();
    reader.incidences();
    reader.adjacencies();
    reader.relations();
    reader.glue(size);
    if !reader.findings.is_empty() {
        return Err(SolveError::Invalid(reader.findings));
    }
    if reader.system.unknowns.len() > UNKNOWNS {
        return Err(SolveError::Limit { what: "unknowns", asked: reader.system.unknowns.len() as u64, allowed: UNKNOWNS as u64 });
    }
    reader.choose(values)?;
    Ok(reader.sorted())
}

/// How much an unknown should stay free: chosen ones, declared ones, then by kind; smaller is freer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    Chosen,
    Declared(usize),
    Operator(CellKind),
    Embedding(CellKind),
    Coordinate,
}

struct Reader<'a> {
    model: &'a Bcifs,
    index: BTreeMap<&'a str, usize>,
    reachable: Vec<bool>,
    system: System,
    /// Rank of every unknown.
    keys: Vec<Rank>,
    /// Unknowns that stand for declared parameters.
    declared: BTreeMap<&'a str, u32>,
    /// Arrays by state and transition; `None` if ill-formed in a state that nothing reaches.
    operators: Vec<Vec<Option<usize>>>,
    embeddings: Vec<Vec<Option<usize>>>,
    points: Vec<Option<usize>>,
    findings: Vec<Finding>,
}

/// A product of arrays: their indices and the state where it ends.
type Product = (Vec<usize>, usize);

impl<'a> Reader<'a> {
    fn fault(&mut self, pointer: String, code: &'static str, message: String) {
        self.findings.push(Finding { pointer, code, message, warning: false });
    }

    fn unknown(&mut self, rank: Rank, name: String, pointer: String, declared: Option<f64>, near: f64) -> u32 {
        self.keys.push(rank);
        self.system.unknowns.push(Unknown { name, pointer, declared, chosen: None, near });
        (self.keys.len() - 1) as u32
    }

    fn states(&mut self) {
        let model = self.model;
        for (s, state) in model.states.iter().enumerate() {
            let mut arrays = Vec::new();
            for (t, transition) in state.transitions.iter().enumerate() {
                let place = format!("/states/{s}/transitions/{t}");
                let name = format!("{}.{t}", state.name);
                let words = format!("the columns of the operator of child {t} of state '{}' sum to 1", state.name);
                let source = Source { s, to: &transition.to, place, member: "operator", name, words, rank: Rank::Operator(state.cell) };
                arrays.push(self.matrix(&source, &transition.operator, Place::Operator(s, t)));
            }
            self.operators.push(arrays);
            let mut arrays = Vec::new();
            for (b, boundary) in state.boundaries.iter().enumerate() {
                let place = format!("/states/{s}/boundaries/{b}");
                let name = format!("{}.boundary{b}", state.name);
                let words = format!("the columns of the embedding of boundary {b} of state '{}' sum to 1", state.name);
                let source = Source { s, to: &boundary.state, place, member: "incidence", name, words, rank: Rank::Embedding(state.cell) };
                arrays.push(self.matrix(&source, &boundary.incidence, Place::Embedding(s, b)));
            }
            self.embeddings.push(arrays);
        }
    }

    /// Ill-formed matrices of states that nothing reaches are left out.
    fn matrix(&mut self, source: &Source<'_>, matrix: &'a Matrix, place: Place) -> Option<usize> {
        let Some(&target) = self.index.get(source.to) else {
            if self.reachable[source.s] {
                self.fault(source.place.clone(), "automaton.unknown-state", format!("state '{}' does not exist", source.to));
            }
            return None;
        };
        let pointer = format!("{}/{}", source.place, source.member);
        let (rows, columns) = (self.model.states[source.s].dimension, self.model.states[target].dimension);
        if matrix.rows.len() != rows || matrix.rows.iter().any(|row| row.len() != columns) {
            if self.reachable[source.s] {
                let found = matrix.rows.first().map_or(0, Vec::len);
                let (from, to) = (&self.model.states[source.s].name, source.to);
                let found = format!("the matrix is {} x {found}, and must be {rows} x {columns}", matrix.rows.len());
                let message = format!("{found}: state '{from}' has {rows} control points, '{to}' has {columns}");
                self.fault(pointer, "automaton.dimension-mismatch", message);
            }
            return None;
        }
        let mut cells = Vec::with_capacity(rows * columns);
        for (i, row) in matrix.rows.iter().enumerate() {
            for (j, entry) in row.iter().enumerate() {
                let cell = self.cell(source, &pointer, (i, j), entry);
                cells.push(cell);
            }
        }
        let mut array = Array { rows, columns, cells, place };
        let rounding = correct_columns(&mut array);
        if rounding.is_finite() {
            self.system.rounding = self.system.rounding.max(rounding);
        }
        let given = !array.cells.iter().any(|cell| matches!(cell, Cell::Unknown(_)));
        let tolerance = if given { COLUMN_SUM_CORRECTED } else { RESIDUAL_ALLOWED };
        let index = self.system.arrays.len();
        self.system.arrays.push(array);
        // Given columns are corrected, or too far off.
        if !given || (self.reachable[source.s] && !rounding.is_finite()) {
            self.constraint(pointer, source.words.clone(), Equations::ColumnSums(index), tolerance, 1.0);
        }
        Some(index)
    }

    fn cell(&mut self, source: &Source<'_>, pointer: &str, (i, j): (usize, usize), entry: &'a Entry) -> Cell {
        let place = format!("{pointer}/{i}/{j}");
        match entry {
            Entry::Number(value) => Cell::Number(Rational::simplest(*value).unwrap_or_else(|| {
                self.fault(place, "model.not-finite", format!("the entry is {value}, and must be finite"));
                Rational::ZERO
            })),
            Entry::Unknown => Cell::Unknown(self.unknown(source.rank, format!("{}[{i}][{j}]", source.name), place, None, 0.0)),
            Entry::Parameter(name) => {
                if let Some(&known) = self.declared.get(name.as_str()) {
                    return Cell::Unknown(known);
                }
                let Some(position) = self.model.parameters.iter().position(|(known, _)| known == name) else {
                    self.fault(place, "automaton.unknown-parameter", format!("parameter '{name}' does not exist"));
                    return Cell::Number(Rational::ZERO);
                };
                let value = self.model.parameters[position].1;
                let pointer = format!("/parameters/{}", name.replace('~', "~0").replace('/', "~1"));
                if !value.is_finite() {
                    self.fault(pointer.clone(), "model.not-finite", format!("parameter '{name}' is {value}, and must be finite"));
                }
                let unknown = self.unknown(Rank::Declared(position), name.clone(), pointer, Some(value), value);
                self.declared.insert(name, unknown);
                Cell::Unknown(unknown)
            }
        }
    }

    /// Reads the root cells and returns the size of the model: the largest extent of its given points.
    fn control_points(&mut self) -> f64 {
        let model = self.model;
        let given = || model.cells.iter().flat_map(|cell| cell.control_points.iter().flatten());
        let varies = |cell: &crate::model::RootCell| {
            let mut weights = cell.control_points.iter().flatten().map(|point| point.w);
            weights.next().is_some_and(|first| weights.any(|weight| weight != first))
        };
        let rational = model.cells.iter().any(varies);
        let count = given().count().max(1) as f64;
        let centre = given().map(|point| point.truncate()).sum::<glam::DVec3>() / count;
        let size = given().map(|point| (point.truncate() - centre).abs().max_element()).fold(0.0, f64::max) * 2.0;
        for (c, cell) in model.cells.iter().enumerate() {
            let array = self.points_of(c, cell, rational, centre);
            self.points.push(array);
        }
        if size > 0.0 && size.is_finite() { size } else { 1.0 }
    }

    fn points_of(&mut self, c: usize, cell: &crate::model::RootCell, rational: bool, centre: glam::DVec3) -> Option<usize> {
        let Some(&state) = self.index.get(cell.state.as_str()) else {
            self.fault(format!("/cells/{c}/state"), "automaton.unknown-state", format!("state '{}' does not exist", cell.state));
            return None;
        };
        let (found, wanted) = (cell.control_points.len(), self.model.states[state].dimension);
        if found != wanted {
            let message = format!("{found} control points, and state '{}' has {wanted}", cell.state);
            self.fault(format!("/cells/{c}/control_points"), "automaton.dimension-mismatch", message);
            return None;
        }
        // Weights that are all the same are 1: see the lowering of root cells.
        let mut weights = cell.control_points.iter().flatten().map(|point| point.w);
        let uniform = weights.next().is_none_or(|first| weights.all(|weight| weight == first));
        let place = Place::Points(c);
        let rows = if rational { 4 } else { 3 };
        let mut cells = Vec::with_capacity(rows * found);
        for row in 0..rows {
            for (p, point) in cell.control_points.iter().enumerate() {
                let cell = match point {
                    Some(point) => {
                        let weight = if uniform { 1.0 } else { point.w };
                        let value = if row == 3 { weight } else { weight * point[row] };
                        Cell::Number(Rational::simplest(value).unwrap_or_else(|| {
                            let message = format!("control point {p} is {point}: coordinates must be finite and the weight positive");
                            self.fault(format!("/cells/{c}/control_points/{p}"), "model.not-finite", message);
                            Rational::ZERO
                        }))
                    }
                    None => {
                        let near = if row == 3 { 1.0 } else { centre[row] };
                        let name = format!("cell{c}.point{p}.{}", ["x", "y", "z", "w"][row]);
                        Cell::Unknown(self.unknown(Rank::Coordinate, name, place.pointer(row, p), None, near))
                    }
                };
                cells.push(cell);
            }
        }
        self.system.arrays.push(Array { rows, columns: found, cells, place });
        Some(self.system.arrays.len() - 1)
    }

    fn constraint(&mut self, pointer: String, words: String, equations: Equations, tolerance: f64, scale: f64) {
        let named = ConflictingConstraint { pointer, words };
        self.system.constraints.push(Constraint { named, equations, tolerance: tolerance * scale, scale });
    }

    /// The product along a word of transitions and then one of boundaries.
    fn product(&self, mut state: usize, path: &[usize], boundaries: &[usize]) -> Result<Product, String> {
        let states = &self.model.states;
        let mut factors = Vec::with_capacity(path.len() + boundaries.len());
        for (what, word, arrays) in [("child", path, &self.operators), ("boundary", boundaries, &self.embeddings)] {
            for &label in word {
                let missing = || format!("state '{}' has no {what} {label}", states[state].name);
                let unusable = || format!("{what} {label} of state '{}' is not well formed", states[state].name);
                let factor = arrays[state].get(label).ok_or_else(missing)?.ok_or_else(unusable)?;
                let next = match what {
                    "child" => &states[state].transitions[label].to,
                    _ => &states[state].boundaries[label].state,
                };
                factors.push(factor);
                state = *self.index.get(next.as_str()).ok_or_else(unusable)?;
            }
        }
        Ok((factors, state))
    }

    fn state_of(&self, name: &str) -> Result<usize, String> {
        self.index.get(name).copied().ok_or_else(|| format!("state '{name}' does not exist"))
    }

    fn incidences(&mut self) {
        for (index, incidence) in self.model.incidences.iter().enumerate() {
            let k = incidence.boundary;
            let edge = self.state_of(&incidence.state).and_then(|state| {
                let (_, edge) = self.product(state, &[], &[k])?;
                let (found, wanted) = (incidence.children.len(), self.model.states[edge].transitions.len());
                if found != wanted {
                    return Err(format!("{found} children are listed, and state '{}' has {wanted}", self.model.states[edge].name));
                }
                Ok((state, edge))
            });
            let statement = |place, words| Statement {
                place,
                code: "automaton.incidence-mismatch",
                words,
                state: Some(&incidence.state),
                one_state: true,
                orientation: (false, None),
                size: None,
            };
            let (state, edge) = match edge {
                Ok(found) => found,
                Err(message) => {
                    self.equal(statement(format!("/incidences/{index}"), String::new()), Err(message));
                    continue;
                }
            };
            for (j, &(i, m)) in incidence.children.iter().enumerate() {
                let words = format!("child {j} of boundary {k} of state '{}' is boundary {m} of child {i}", incidence.state);
                let sides = self.product(edge, &[j], &[]).and_then(|(inner, to)| {
                    let (mut left, _) = self.product(state, &[], &[k])?;
                    left.extend(inner);
                    Ok([(left, to), self.product(state, &[i], &[m])?])
                });
                self.equal(statement(format!("/incidences/{index}/children/{j}"), words), sides);
            }
        }
    }

    fn adjacencies(&mut self) {
        for (index, adjacency) in self.model.adjacencies.iter().enumerate() {
            let [(i, m), (j, n)] = adjacency.between;
            let orientation = (adjacency.reversed, adjacency.permutation.as_deref());
            let how = order(orientation);
            let statement = Statement {
                place: format!("/adjacencies/{index}"),
                code: "automaton.adjacency-mismatch",
                words: format!("boundary {m} of child {i} of state '{}' is boundary {n} of child {j}{how}", adjacency.state),
                state: Some(&adjacency.state),
                one_state: true,
                orientation,
                size: None,
            };
            let sides = self.state_of(&adjacency.state).and_then(|s| Ok([self.product(s, &[i], &[m])?, self.product(s, &[j], &[n])?]));
            self.equal(statement, sides);
        }
    }

    fn relations(&mut self) {
        for (index, relation) in self.model.relations.iter().enumerate() {
            let [first, second] = &relation.equal;
            let statement = Statement {
                place: format!("/relations/{index}"),
                code: "automaton.relation-mismatch",
                words: format!("in state '{}', {} is {}", relation.state, side(first), side(second)),
                state: Some(&relation.state),
                one_state: false,
                orientation: (false, None),
                size: None,
            };
            let of = |s: usize, side: &Side| {
                if side.path.is_empty() && side.boundary.is_empty() {
                    return Err("a side names neither a child nor a boundary".into());
                }
                self.product(s, &side.path, &side.boundary)
            };
            let sides = self.state_of(&relation.state).and_then(|s| Ok([of(s, first)?, of(s, second)?]));
            self.equal(statement, sides);
        }
    }

    fn glue(&mut self, size: f64) {
        for (index, glue) in self.model.glue.iter().enumerate() {
            let [(c, m), (d, n)] = glue.between;
            let orientation = (glue.reversed, glue.permutation.as_deref());
            let statement = Statement {
                place: format!("/glue/{index}"),
                code: "automaton.glue-mismatch",
                words: format!("boundary {m} of root cell {c} is boundary {n} of root cell {d}{}", order(orientation)),
                state: None,
                one_state: true,
                orientation,
                size: Some(size),
            };
            let of = |cell: usize, boundary: usize| {
                let points = *self.points.get(cell).ok_or_else(|| format!("there is no root cell {cell}"))?;
                let points = points.ok_or_else(|| format!("root cell {cell} is not well formed"))?;
                let (factors, end) = self.product(self.state_of(&self.model.cells[cell].state)?, &[], &[boundary])?;
                Ok(([vec![points], factors].concat(), end))
            };
            let sides = of(c, m).and_then(|first| Ok([first, of(d, n)?]));
            self.equal(statement, sides);
        }
    }

    /// States that two products are equal, or why they cannot be compared.
    fn equal(&mut self, statement: Statement<'_>, sides: Result<[Product; 2], String>) {
        let Statement { place, code, words, state, one_state, orientation: (reversed, permutation), size } = statement;
        let checked = sides.and_then(|[(left, first), (right, second)]| {
            let states = &self.model.states;
            let count = states[first].dimension;
            if one_state && first != second {
                return Err(format!("{words}: the two are of different states, '{}' and '{}'", states[first].name, states[second].name));
            }
            if count != states[second].dimension {
                return Err(format!("{words}: the two have {count} and {} control points", states[second].dimension));
            }
            Ok(Equations::Equal { left, right, permutation: permutation_of(reversed, permutation, count)? })
        });
        let (tolerance, scale) = size.map_or((RESIDUAL_ALLOWED, 1.0), |size| (GLUE_ALLOWED, size));
        match checked {
            Ok(equations) => self.constraint(place, words, equations, tolerance, scale),
            Err(message) => {
                // A state that nothing reaches need not be well formed.
                let index = state.and_then(|name| self.index.get(name));
                if index.is_none_or(|&index| self.reachable[index]) {
                    self.fault(place, code, message);
                }
            }
        }
    }

    fn choose(&mut self, values: &BTreeMap<String, f64>) -> Result<(), SolveError> {
        let index = self.system.index();
        let mut chosen = Vec::with_capacity(values.len());
        for (name, &value) in values {
            if !value.is_finite() {
                return Err(SolveError::NotFinite { name: name.clone(), value });
            }
            let Some(&unknown) = index.get(name.as_str()) else {
                let known = self.system.unknowns.iter().take(8).map(|unknown| unknown.name.clone()).collect();
                return Err(SolveError::UnknownName { name: name.clone(), known });
            };
            chosen.push((unknown as usize, value));
        }
        for (unknown, value) in chosen {
            self.system.unknowns[unknown].chosen = Some(value);
            self.keys[unknown] = Rank::Chosen;
        }
        Ok(())
    }

    /// Numbers the unknowns by rank, then by place.
    fn sorted(self) -> System {
        let Self { mut system, keys, .. } = self;
        let mut order: Vec<usize> = (0..keys.len()).collect();
        order.sort_by_key(|&index| (keys[index], index));
        let mut position = vec![0; order.len()];
        order.iter().enumerate().for_each(|(new, &old)| position[old] = new as u32);
        for cell in system.arrays.iter_mut().flat_map(|array| &mut array.cells) {
            if let Cell::Unknown(index) = cell {
                *index = position[*index as usize];
            }
        }
        system.unknowns = order.iter().map(|&old| system.unknowns[old].clone()).collect();
        system
    }
}

/// Where a matrix comes from, for names and messages.
struct Source<'a> {
    s: usize,
    to: &'a str,
    place: String,
    member: &'static str,
    name: String,
    words: String,
    rank: Rank,
}

/// A constraint "these two products are equal".
struct Statement<'a> {
    place: String,
    code: &'static str,
    words: String,
    /// The state that it is about.
    state: Option<&'a str>,
    /// Whether both sides must end in one state.
    one_state: bool,
    /// Whether the second is reversed, or permuted.
    orientation: (bool, Option<&'a [usize]>),
    /// The size of the model if the products are control points.
    size: Option<f64>,
}

/// Spreads the excess of given columns that are off by rounding, as the operators' constructor does; the
/// largest excess, infinite if one is too far off.
fn correct_columns(array: &mut Array) -> f64 {
    let mut rounding = 0.0_f64;
    for column in 0..array.columns {
        let indices = (0..array.rows).map(|row| row * array.columns + column);
        let mut excess = Rational::from(-1);
        let mut given = true;
        for index in indices.clone() {
            match &array.cells[index] {
                Cell::Number(value) => excess = excess.plus(value),
                Cell::Unknown(_) => given = false,
            }
        }
        if given && excess.magnitude() > COLUMN_SUM_CORRECTED {
            rounding = f64::INFINITY;
        } else if given && !excess.is_zero() {
            rounding = rounding.max(excess.magnitude());
            let share = excess.times(&Rational::from(-(array.rows as i64)).inverse());
            for index in indices {
                if let Cell::Number(value) = &mut array.cells[index] {
                    *value = value.plus(&share);
                }
            }
        }
    }
    rounding
}

fn order((reversed, permutation): (bool, Option<&[usize]>)) -> String {
    match permutation {
        Some(permutation) => format!(" with its control points in the order {permutation:?}"),
        None if reversed => " reversed".into(),
        None => String::new(),
    }
}

fn side(side: &Side) -> String {
    let word = |labels: &[usize]| labels.iter().map(usize::to_string).collect::<Vec<_>>().join(" ");
    match (side.path.is_empty(), side.boundary.is_empty()) {
        (true, _) => format!("boundary {}", word(&side.boundary)),
        (false, true) => format!("descendant {}", word(&side.path)),
        (false, false) => format!("boundary {} of descendant {}", word(&side.boundary), word(&side.path)),
    }
}

/// The permutation that an adjacency or a glue states for `count` control points.
pub(in crate::model) fn permutation_of(reversed: bool, permutation: Option<&[usize]>, count: usize) -> Result<Option<Vec<usize>>, String> {
    let Some(permutation) = permutation else { return Ok(reversed.then(|| (0..count).rev().collect())) };
    if reversed {
        return Err("both 'reversed' and 'permutation' are given; keep one".into());
    }
    let mut sorted = permutation.to_vec();
    sorted.sort_unstable();
    if !sorted.iter().copied().eq(0..count) {
        return Err(format!("{permutation:?} is not a permutation of the {count} control points 0 to {}", count.saturating_sub(1)));
    }
    Ok(Some(permutation.to_vec()))
}

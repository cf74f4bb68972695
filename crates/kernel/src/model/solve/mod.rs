//! Unknown entries of a boundary controlled system, solved from its constraints.
//!
//! Constraints are polynomial equations between the entries of operators and embeddings and the coordinates of
//! control points. While each of their terms has one unknown factor they are linear, and are eliminated exactly
//! (`linear`); products become linear when a factor is found and substituted. What stays nonlinear is solved near
//! deterministic starts (`local`). The result is affine, T = T0 + sum p_k N_k, with the free parameters p_k named
//! after the entries that stay free.

mod choose;
mod conflict;
mod linear;
mod local;
mod polynomial;
mod propagate;
mod rational;
mod read;
mod system;

pub use rational::Rational;
pub(super) use read::{GLUE_ALLOWED, permutation_of};

use super::bcifs::Bcifs;
use super::lower::Finding;
use crate::budget::{CancelToken, Stopped};
use crate::error::Kind;
use choose::Point;
use propagate::Knowledge;
use std::collections::{BTreeMap, BTreeSet};
use system::{Cell, Constraint, Equations, System, Unknown};

/// An unknown that the constraints leave free.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeParameter {
    /// The model's name of the parameter, or the entry's own: `face.1[2][0]` (state, transition, row, column),
    /// `face.boundary0[1][0]`, `cell0.point3.x`.
    pub name: String,
    /// Its value in the filled model.
    pub value: f64,
    /// Whether the model declares it.
    pub declared: bool,
    /// Where: `/parameters/NAME`, or the entry, as a JSON pointer below the shape.
    pub pointer: String,
}

/// An exact affine function of the free parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearForm {
    /// Its value where all parameters are 0.
    pub constant: Rational,
    /// Pairs (index into [`Solution::parameters`], coefficient), ascending; no coefficient is 0.
    pub terms: Vec<(usize, Rational)>,
}

/// An entry that was unknown or a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct SolvedEntry {
    /// Where, as a JSON pointer below the shape: `/states/0/transitions/1/operator/2/0`. Coordinates of control points
    /// of rational cells are homogeneous (multiplied by the weight).
    pub pointer: String,
    /// What it is called: see [`FreeParameter::name`]; the parameter's name if it is one.
    pub name: String,
    /// How it depends on the free parameters; `None` where it does so nonlinearly.
    pub form: Option<LinearForm>,
    /// Its value in the filled model.
    pub value: f64,
}

/// How the solution was found, and so what it tells.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// By elimination in rational numbers (see [`Rational`] for their limit): the parameters describe every solution.
    Exact,
    /// Equations between products of unknowns were left: one solution was found, and the parameters are coordinates
    /// of the solutions near it.
    Local {
        /// Unknowns that occur in the equations left.
        unknowns: usize,
        /// Number of those equations.
        equations: usize,
        /// Rank of their Jacobian at the solution: this many of the unknowns depend on the others near it.
        rank: usize,
        /// Starts tried until the solution was found.
        starts: usize,
    },
}

/// The solutions of a system, and one of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The free parameters, in order: declared ones, then entries of operators (vertices, edges, faces, volumes), of
    /// embeddings, and coordinates.
    pub parameters: Vec<FreeParameter>,
    /// Every entry that was unknown or a parameter, in the document's order.
    pub entries: Vec<SolvedEntry>,
    /// Declared parameters that the constraints determine to another value than the document's: name, document's
    /// value, solved value.
    pub determined: Vec<(String, f64, f64)>,
    /// How it was found.
    pub method: Method,
    /// Largest difference between the two sides of a constraint in the filled model; for glued boundaries relative to
    /// the size of the model.
    pub residual: f64,
    /// The model with the chosen values: no unknown left.
    pub model: Bcifs,
    /// [lower, upper] bounds of the joint spectral radius of the filled model, if it forms an automaton; it converges
    /// if the upper is below 1.
    pub contraction: Option<[f64; 2]>,
}

impl Solution {
    /// Number of independent choices that the constraints leave.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> usize {
        self.parameters.len()
    }
}

/// A constraint that takes part in a contradiction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConflictingConstraint {
    /// Where it stands, as a JSON pointer below the shape.
    pub pointer: String,
    /// What it says, in the model's names.
    pub words: String,
}

/// Why a system is not solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The model is not well formed.
    #[error("{}", .0.iter().map(|finding| format!("{}: {}", finding.pointer, finding.message)).collect::<Vec<_>>().join("; "))]
    Invalid(Vec<Finding>),
    /// A value was given for something that is neither a parameter in use nor an unknown entry.
    #[error("'{name}' is neither a parameter that an entry uses nor the name of an unknown entry; {}", listed(.known))]
    UnknownName {
        /// The name.
        name: String,
        /// Some names that would do.
        known: Vec<String>,
    },
    /// A value that is not finite was given.
    #[error("the value {value} of '{name}' is not finite")]
    NotFinite {
        /// The name.
        name: String,
        /// The value.
        value: f64,
    },
    /// The constraints contradict each other. The set is irreducible: without any one of them the rest do not.
    #[error("these constraints contradict each other: {}", .constraints.iter().map(|c| c.words.as_str()).collect::<Vec<_>>().join("; "))]
    Contradiction {
        /// The constraints, in the order in which the model states them.
        constraints: Vec<ConflictingConstraint>,
    },
    /// Nonlinear equations for which no start led to a solution.
    #[error(
        "no solution found from {starts} starts; the best leaves a residual of {best_residual:.3e}. This does not prove that there is none: \
         give values to some unknown entries, best those of embeddings"
    )]
    NotFound {
        /// Largest violation of an equation at the best point.
        best_residual: f64,
        /// Starts tried.
        starts: usize,
    },
    /// The system is too large.
    #[error("{what}: {asked} needed, {allowed} allowed; give values to more entries or split the model")]
    Limit {
        /// What is limited.
        what: &'static str,
        /// What the system needs (at least).
        asked: u64,
        /// What is allowed.
        allowed: u64,
    },
    /// The caller stopped it.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { "the model has no unknown".into() } else { format!("known are {}", names.join(", ")) }
}

impl SolveError {
    /// How to react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Invalid(_) | Self::UnknownName { .. } | Self::NotFinite { .. } | Self::Contradiction { .. } => Kind::Invalid,
            Self::NotFound { .. } => Kind::Unreachable,
            Self::Limit { .. } => Kind::Limit,
            Self::Stopped(stopped) => stopped.kind(),
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Invalid(findings) => findings.first().map_or("automaton.invalid", |finding| finding.code),
            Self::UnknownName { .. } => "solve.unknown-name",
            Self::NotFinite { .. } => "solve.not-finite",
            Self::Contradiction { .. } => "automaton.contradiction",
            Self::NotFound { .. } => "solve.not-found",
            Self::Limit { .. } => "limit-solve",
            Self::Stopped(stopped) => stopped.code(),
        }
    }
}

impl Bcifs {
    /// Solves the unknown entries, parameters and control points from the constraints. `values` chooses free parameters,
    /// or any other unknown entries, by name; what is not chosen has its document's value if declared, else the entries
    /// become as small as possible (least squares), or as close to contracting as a few tries find.
    ///
    /// Declared parameters are unknown here: the document's values are defaults, and constraints may determine them.
    /// Inconsistencies up to 1e-4 (glue: 1e-6 of the model's size) count as rounding of the given numbers and show in
    /// [`Solution::residual`].
    ///
    /// Cost: sparse exact elimination, milliseconds for hundreds of unknowns; all loops are limited.
    ///
    /// # Errors
    /// [`SolveError`].
    pub fn solve(&self, values: &BTreeMap<String, f64>, cancel: &CancelToken) -> Result<Solution, SolveError> {
        let mut system = read::read(self, values)?;
        let all: Vec<usize> = (0..system.constraints.len()).collect();
        let general = match Knowledge::of(&system, &all, cancel)? {
            Ok(general) => general,
            Err(support) => return Err(conflict::contradiction(&system, &support, cancel)?),
        };
        let special = with_values(&mut system, &general, cancel)?;
        let (point, method, dependent) = if general.pending.is_empty() {
            (choose::point(self, &system, &choose::forms(&special), &defaults(&system, &special), cancel)?, Method::Exact, BTreeSet::new())
        } else {
            let (point, starts) = nonlinear(self, &system, &special, cancel)?;
            let structure = local::structure(&general, &point.values, cancel)?;
            let (unknowns, equations, rank) = (structure.unknowns, structure.equations, structure.dependent.len());
            (point, Method::Local { unknowns, equations, rank, starts }, structure.dependent)
        };
        Ok(describe(self, &system, &general, &dependent, point, method))
    }
}

/// What is known once the chosen values are constraints too.
fn with_values(system: &mut System, general: &Knowledge, cancel: &CancelToken) -> Result<Knowledge, SolveError> {
    let mut special = general.clone();
    for unknown in 0..system.unknowns.len() {
        let Some((value, exact)) = system.unknowns[unknown].chosen.and_then(|value| Some((value, Rational::simplest(value)?))) else {
            continue;
        };
        let Unknown { name, pointer, .. } = &system.unknowns[unknown];
        let named = ConflictingConstraint { pointer: pointer.clone(), words: format!("'{name}' is chosen to be {value}") };
        let tolerance = propagate::VALUE_ALLOWED * value.abs().max(1.0);
        let equations = Equations::Value(unknown as u32, exact.clone());
        system.constraints.push(Constraint { named, equations, tolerance, scale: 1.0 });
        if let Err(support) = special.assign(unknown as u32, &exact, system.constraints.len() - 1, cancel)? {
            return Err(conflict::contradiction(system, &support, cancel)?);
        }
    }
    match special.advance(cancel)? {
        Some(support) => Err(conflict::contradiction(system, &support, cancel)?),
        None => Ok(special),
    }
}

/// The document's values of declared parameters that are free.
fn defaults(system: &System, knowledge: &Knowledge) -> BTreeMap<u32, f64> {
    let declared = |(index, unknown): (usize, &Unknown)| Some((index as u32, unknown.declared?));
    let free = |(index, _): &(u32, f64)| knowledge.echelon.row(*index).is_none();
    system.unknowns.iter().enumerate().filter_map(declared).filter(free).collect()
}

/// A solution with the declared parameters at their document's values if one is found, else with any.
fn nonlinear(model: &Bcifs, system: &System, special: &Knowledge, cancel: &CancelToken) -> Result<(Point, usize), SolveError> {
    let find = |knowledge: &Knowledge, fixed: &BTreeMap<u32, f64>| -> Result<(Point, usize), SolveError> {
        if knowledge.pending.is_empty() {
            return Ok((choose::point(model, system, &choose::forms(knowledge), fixed, cancel)?, 1));
        }
        local::find(model, system, knowledge, fixed, cancel).map(|found| (found.point, found.starts))
    };
    let fixed = defaults(system, special);
    let mut held = special.clone();
    let mut consistent = true;
    for (&unknown, &value) in &fixed {
        let Some(value) = Rational::simplest(value) else { continue };
        // Contradictions are no error here, so nobody asks for their constraints.
        consistent &= held.assign(unknown, &value, 0, cancel)?.is_ok();
    }
    if consistent && held.advance(cancel)?.is_none() {
        match find(&held, &BTreeMap::new()) {
            Err(SolveError::NotFound { .. }) if !fixed.is_empty() => {}
            found => return found,
        }
    }
    find(special, &fixed)
}

/// The solution's public form. `dependent` are those free unknowns of the linear part that are not free.
fn describe(model: &Bcifs, system: &System, general: &Knowledge, dependent: &BTreeSet<u32>, point: Point, method: Method) -> Solution {
    let free: Vec<u32> = (0..system.unknowns.len() as u32)
        .filter(|unknown| general.echelon.row(*unknown).is_none() && !dependent.contains(unknown))
        .collect();
    let parameter = |&unknown: &u32| {
        let Unknown { name, pointer, declared, .. } = &system.unknowns[unknown as usize];
        FreeParameter { name: name.clone(), value: point.values[unknown as usize], declared: declared.is_some(), pointer: pointer.clone() }
    };
    let form = |unknown: u32| {
        let index = |other: &u32| free.binary_search(other).ok();
        match general.echelon.row(unknown) {
            None => index(&unknown).map(|own| LinearForm { constant: Rational::ZERO, terms: vec![(own, Rational::ONE)] }),
            Some(row) => {
                let terms = row.terms[..row.terms.len() - 1].iter().map(|(other, c)| Some((index(other)?, c.negated())));
                Some(LinearForm { constant: row.constant.negated(), terms: terms.collect::<Option<_>>()? })
            }
        }
    };
    let mut entries = Vec::new();
    for array in &system.arrays {
        for (position, cell) in array.cells.iter().enumerate() {
            if let Cell::Unknown(unknown) = cell {
                let pointer = array.place.pointer(position / array.columns, position % array.columns);
                let (name, value) = (system.unknowns[*unknown as usize].name.clone(), point.values[*unknown as usize]);
                entries.push(SolvedEntry { pointer, name, form: form(*unknown), value });
            }
        }
    }
    let moved = |(unknown, &value): (&Unknown, &f64)| {
        let stated = unknown.declared.filter(|stated| unknown.chosen.is_none() && (stated - value).abs() > propagate::VALUE_ALLOWED)?;
        Some((unknown.name.clone(), stated, value))
    };
    Solution {
        parameters: free.iter().map(parameter).collect(),
        entries,
        determined: system.unknowns.iter().zip(&point.values).filter_map(moved).collect(),
        method,
        residual: system.constraints.iter().map(|constraint| system.residual(constraint, &point.values)).fold(0.0, f64::max),
        model: choose::fill(model, system, &point.values),
        contraction: point.contraction,
    }
}

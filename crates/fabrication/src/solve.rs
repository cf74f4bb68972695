//! Unknown entries of a model, solved: the solution space as a document tells it, and the filled model.

use std::collections::BTreeMap;

use lacuna_kernel::budget::Budget;
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::model::solve::{LinearForm, Method, Rational, Solution, SolveError};
use lacuna_kernel::model::{Bcifs, Entry, Model, Shape};

use crate::JobError;
use crate::run::ModelDiagnostic;

/// Terms of all entries that are told: a solution space may have millions, and a document of them helps nobody.
const TERMS: usize = 500_000;

/// An exact number.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
pub struct ExactNumber {
    /// As a fraction in lowest terms, for example `-3/4`; a decimal where the fraction outgrew 256 bits.
    pub exact: String,
    /// The nearest double.
    pub value: f64,
}

/// An unknown that the constraints leave free.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
pub struct FreeParameter {
    /// The model's parameter, or the entry that stays free: `face.1[2][0]` (state, transition, row, column),
    /// `face.boundary0[1][0]`, `cell0.point3.x`. A value is chosen under this name.
    pub name: String,
    /// Its value in the filled model.
    pub value: f64,
    /// Whether the model declares it in `parameters`.
    pub declared: bool,
    /// JSON pointer into the model document.
    pub pointer: String,
}

/// An entry that was unknown or a parameter: constant + sum of coefficients times parameters.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
pub struct SolvedEntry {
    /// JSON pointer into the model document. Coordinates of control points with weights are multiplied by the weight.
    pub pointer: String,
    /// What it is called.
    pub name: String,
    /// Its value in the filled model.
    pub value: f64,
    /// Its value where all parameters are 0; absent if it depends on the parameters in another way than affinely.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub constant: Option<ExactNumber>,
    /// Coefficients by the name of the free parameter, none of them 0; absent together with `constant`.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub coefficients: Option<BTreeMap<String, ExactNumber>>,
}

/// A declared parameter that the constraints determine.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
pub struct DeterminedParameter {
    /// Its name.
    pub name: String,
    /// The document's value.
    pub stated: f64,
    /// The only value that satisfies the constraints.
    pub value: f64,
}

/// How a solution was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(rename_all = "snake_case"))]
pub enum SolutionMethod {
    /// In rational numbers: the parameters describe every solution.
    Exact,
    /// Products of unknowns were left: one solution was found, and the parameters are coordinates of those near it.
    Local,
}

/// What is known of a solution that was found locally.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
pub struct LocalSolution {
    /// Unknowns in the equations that were left.
    pub unknowns: u64,
    /// Equations that were left.
    pub equations: u64,
    /// Rank of their Jacobian at the solution.
    pub rank: u64,
    /// Starts tried until the solution was found.
    pub starts: u64,
}

/// The solutions of a model with unknowns.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
pub struct SolutionSpace {
    /// Number of independent choices that the constraints leave: the number of parameters.
    pub degrees_of_freedom: u64,
    /// The free parameters.
    pub parameters: Vec<FreeParameter>,
    /// Every entry that was unknown or a parameter, in the document's order.
    pub entries: Vec<SolvedEntry>,
    /// Declared parameters that the constraints determine to another value than the document's.
    pub determined: Vec<DeterminedParameter>,
    /// How it was found.
    pub method: SolutionMethod,
    /// Facts of a local solution.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub local: Option<LocalSolution>,
    /// Largest violation of a constraint in the filled model.
    pub residual: f64,
    /// `[lower, upper]` bounds of the joint spectral radius of the filled model, which converges if the upper is below
    /// 1; `null` for a bound that is not known, absent if the filled model is no automaton.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub spectral_radius: Option<[Option<f64>; 2]>,
}

/// A model without unknowns, and what else would have been possible.
#[derive(Clone, Debug, PartialEq)]
pub struct Solved {
    /// All solutions.
    pub space: SolutionSpace,
    /// The one for the chosen values.
    pub model: Model,
}

/// Why a model is not solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveRefusal {
    /// The model is at fault, or the work was stopped.
    #[error(transparent)]
    Model(#[from] JobError),
    /// A chosen value is at fault.
    #[error("{message}")]
    Value {
        /// The name under which it was chosen.
        name: String,
        /// Stable code.
        code: &'static str,
        /// What is wrong, in words.
        message: String,
    },
}

/// Solves the unknown entries of a `bcifs`; `values` are chosen for parameters by name. Models without unknowns are
/// solved too: their parameters are what is left.
///
/// # Errors
/// Constraints that contradict each other, each with its place; no solution found; a limit; a stop; a value for a
/// name that there is not.
pub fn solve(model: &Model, values: &BTreeMap<String, f64>, budget: &Budget) -> Result<Solved, SolveRefusal> {
    let Shape::Bcifs(bcifs) = &model.shape else {
        let message = "only a model of the family \"bcifs\" has operators to solve; solve the parts of a group one by one".to_owned();
        return Err(JobError::new(Kind::Invalid, "solve.no-operators", message).into());
    };
    let solution = bcifs.solve(values, &budget.cancel).map_err(refusal)?;
    let space = space(&solution)?;
    Ok(Solved { space, model: Model { name: model.name.clone(), shape: Shape::Bcifs(solution.model) } })
}

fn refusal(error: SolveError) -> SolveRefusal {
    let (code, message) = (error.code(), error.to_string());
    match error {
        SolveError::UnknownName { name, .. } | SolveError::NotFinite { name, .. } => SolveRefusal::Value { name, code, message },
        error => JobError::from(error).into(),
    }
}

impl From<SolveError> for JobError {
    /// Every constraint of a contradiction is a diagnostic with its place.
    fn from(error: SolveError) -> Self {
        let plain = Self::new(error.kind(), error.code(), error.to_string());
        match error {
            SolveError::Invalid(findings) => Self::model(findings),
            SolveError::Contradiction { constraints } => {
                let code = plain.code;
                let diagnostics = constraints.into_iter();
                let diagnostics = diagnostics.map(|c| ModelDiagnostic { pointer: c.pointer, code, message: c.words, warning: false });
                Self { diagnostics: diagnostics.collect(), ..plain }
            }
            // why: counts are far below 2^53
            #[allow(clippy::cast_precision_loss)]
            SolveError::Limit { asked, allowed, .. } => {
                Self { limit: Some(LimitFacts { limit: "solve", asked: asked as f64, allowed: allowed as f64, remedy: None }), ..plain }
            }
            _ => plain,
        }
    }
}

fn space(solution: &Solution) -> Result<SolutionSpace, JobError> {
    let terms: usize = solution.entries.iter().filter_map(|entry| entry.form.as_ref()).map(|form| form.terms.len()).sum();
    if terms > TERMS {
        let message = format!("the solution space has {terms} coefficients; {TERMS} are told at most: give values to more entries");
        // why: counts are far below 2^53
        #[allow(clippy::cast_precision_loss)]
        let facts = LimitFacts { limit: "coefficients", asked: terms as f64, allowed: TERMS as f64, remedy: None };
        return Err(JobError { limit: Some(facts), ..JobError::new(Kind::Limit, "limit-solve", message) });
    }
    let (method, local) = match solution.method {
        Method::Exact => (SolutionMethod::Exact, None),
        Method::Local { unknowns, equations, rank, starts } => {
            let [unknowns, equations, rank, starts] = [unknowns, equations, rank, starts].map(|count| count as u64);
            (SolutionMethod::Local, Some(LocalSolution { unknowns, equations, rank, starts }))
        }
    };
    let parameters = solution.parameters.iter().map(|parameter| FreeParameter {
        name: parameter.name.clone(),
        value: parameter.value,
        declared: parameter.declared,
        pointer: format!("/shape{}", parameter.pointer),
    });
    let determined =
        solution.determined.iter().map(|(name, stated, value)| DeterminedParameter { name: name.clone(), stated: *stated, value: *value });
    let entries = solution.entries.iter().map(|entry| SolvedEntry {
        pointer: format!("/shape{}", entry.pointer),
        name: entry.name.clone(),
        value: entry.value,
        constant: entry.form.as_ref().map(|form| exact(&form.constant)),
        coefficients: entry.form.as_ref().map(|form| coefficients(form, solution)),
    });
    Ok(SolutionSpace {
        degrees_of_freedom: solution.degrees_of_freedom() as u64,
        parameters: parameters.collect(),
        entries: entries.collect(),
        determined: determined.collect(),
        method,
        local,
        residual: solution.residual,
        spectral_radius: solution.contraction.map(|bounds| bounds.map(|bound| bound.is_finite().then_some(bound))),
    })
}

fn exact(number: &Rational) -> ExactNumber {
    ExactNumber { exact: number.to_string(), value: number.to_f64() }
}

fn coefficients(form: &LinearForm, solution: &Solution) -> BTreeMap<String, ExactNumber> {
    form.terms.iter().map(|(index, coefficient)| (solution.parameters[*index].name.clone(), exact(coefficient))).collect()
}

/// What the unknowns of a model leave open, for [`crate::validate`].
#[derive(Debug)]
pub(crate) struct Freedom {
    /// Number of independent choices besides the declared parameters; `None` if it could not be found.
    pub(crate) degrees: Option<u64>,
    /// States of the parts with unknowns.
    pub(crate) states: u64,
    /// Constraints that contradict each other, but for the first of each part: that one lowering has told.
    pub(crate) conflicts: Vec<ModelDiagnostic>,
}

/// Degrees of freedom of the unknown entries of a shape, those of a group's parts added; `None` if none is unknown.
pub(crate) fn freedom(shape: &Shape, budget: &Budget) -> Option<Freedom> {
    let mut systems = Vec::new();
    unknown_systems(shape, "", &mut systems);
    if systems.is_empty() {
        return None;
    }
    let mut freedom = Freedom { degrees: Some(0), states: 0, conflicts: Vec::new() };
    for (place, system) in systems {
        freedom.states += system.states.len() as u64;
        match system.solve(&BTreeMap::new(), &budget.cancel) {
            Ok(solution) => {
                let free = solution.parameters.iter().filter(|parameter| !parameter.declared).count() as u64;
                freedom.degrees = freedom.degrees.map(|degrees| degrees + free);
            }
            Err(error) => {
                freedom.degrees = None;
                let placed = |d: ModelDiagnostic| ModelDiagnostic { pointer: format!("{place}{}", d.pointer), ..d };
                if let SolveError::Contradiction { .. } = error {
                    freedom.conflicts.extend(JobError::from(error).diagnostics.into_iter().skip(1).map(placed));
                }
            }
        }
    }
    Some(freedom)
}

/// The systems that have unknowns, and where they stand.
fn unknown_systems<'m>(shape: &'m Shape, place: &str, systems: &mut Vec<(String, &'m Bcifs)>) {
    match shape {
        Shape::Bcifs(bcifs) if has_unknowns(bcifs) => systems.push((place.to_owned(), bcifs)),
        Shape::Group(group) => {
            for (index, part) in group.parts.iter().enumerate() {
                unknown_systems(&part.shape, &format!("{place}/parts/{index}/shape"), systems);
            }
        }
        _ => {}
    }
}

fn has_unknowns(bcifs: &Bcifs) -> bool {
    let transitions = bcifs.states.iter().flat_map(|state| state.transitions.iter().map(|transition| &transition.operator));
    let boundaries = bcifs.states.iter().flat_map(|state| state.boundaries.iter().map(|boundary| &boundary.incidence));
    let mut entries = transitions.chain(boundaries).flat_map(|matrix| matrix.rows.iter().flatten());
    entries.any(|entry| *entry == Entry::Unknown) || bcifs.cells.iter().any(|cell| cell.control_points.contains(&None))
}

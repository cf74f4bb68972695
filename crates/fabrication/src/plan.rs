//! What a job costs, before it is done: from the automaton and a sample of the lattice. A plan that exceeds the limits for certain says so, with what would pass.

use crate::effort;
use crate::repair::repaired;
use crate::run::{JobError, lower, radius, split_of};
use crate::{Job, JobKind, Operation, boolean, convert, level, slice, split};
use lacuna_kernel::attractor::{Attractor, RefineError, count_cells};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::dilation::{Prediction, predict};
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::tolerance::{Radius, Tolerance};
use std::collections::BTreeMap;

/// What a job is predicted to cost.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
pub struct Plan {
    /// Leaf cells of the whole shape at its share of the tolerance; `solidify` expands only those that
    /// the boundary of the result needs.
    pub leaf_cells: f64,
    /// Triangles of the result without simplification, which leaves a tenth to a hundredth of them. Of an operation on solids: those of its result.
    pub triangles: f64,
    /// Triangles against which the limit of triangles is held: those of the lattices as they are first made.
    #[cfg_attr(feature = "wire", serde(default))]
    pub counted_triangles: f64,
    /// Leaf cells against which the limit of cells is held: of an evaluation all of the shape's, of a dilation those that its surface needs, one again in every block of the lattice that
    /// needs it. Of several solids those of the largest, as each is held against the limit by itself.
    #[cfg_attr(feature = "wire", serde(default))]
    pub counted_cells: f64,
    /// Peak memory of the process that does the job, in bytes. 0 where nothing is predicted.
    pub memory_bytes: f64,
    /// Bytes of a binary STL file with so many `triangles`; of sections, those of all drawings that are asked for, or else of one in SVG. `null` for sections of what is thickened first, and where nothing is predicted.
    pub output_bytes: Option<f64>,
    /// Edge of the lattice's cubes. `null` where points, segments and triangles are thickened without a lattice, and where nothing is thickened.
    pub lattice_pitch_mm: Option<f64>,
    /// Seconds that one core takes, an estimate for a machine like that on which the constants were measured: `fixtures/ESTIMATES.md`. Reading and lowering the models, which a plan
    /// takes as long for, are not in it. `null` where they are not predicted: comparisons, sections, and what is searched for besides (`stability`, `thickness`, `oriented_box`, the other surface of
    /// a wall, the closing of gaps).
    pub cpu_seconds: Option<f64>,
    /// The result is nowhere thinner than this, in mm: of a dilation 2 (r - tolerance) with the least radius r, and never less than r; of a wall its thickness less the tolerance. The certificate's
    /// `thickness_min_mm` is this or more. `null` where nothing is proven before the work: meshes as they are, booleans, levels, closed gaps.
    pub smallest_feature_mm: Option<f64>,
    /// The limit of the job that it exceeds for certain: estimates are within a factor of 2, so one that is more than twice the limit. A service refuses such a job.
    #[cfg_attr(feature = "wire", serde(default, skip_serializing_if = "Option::is_none"))]
    pub exceeds: Option<Excess>,
}

/// A limit that a plan exceeds.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
pub struct Excess {
    /// Its name among the limits of a job: `cells`, `triangles`, `memory_bytes` or `output_bytes`.
    pub limit: String,
    /// What is predicted.
    pub asked: f64,
    /// What is allowed.
    pub allowed: f64,
    /// A parameter of the job, or the limit where no tolerance is enough, and a value that would pass. Empty when the search for one took too long.
    pub remedy: BTreeMap<String, f64>,
}

/// Bytes of a binary STL file with so many triangles.
pub(crate) fn stl_bytes(triangles: f64) -> f64 {
    84.0 + 50.0 * triangles
}

/// What a process holds for each byte that a lattice is accounted for where its mesh is left as it is: found on the fixtures, as is the next.
/// `fixtures/ESTIMATES.md` shows how well they do.
const HELD_PER_BYTE: f64 = 1.4;
/// Threads that simplify at a time, each with memory of its own. The machine of the process that does the job may have more.
const THREADS: f64 = 2.0;
/// What a process holds that does next to nothing, in bytes: the program, its threads and their stacks.
const PROCESS_BYTES: f64 = 18e6;

/// Peak memory of a dilation. Blocks that are simplified shrink before they are joined: then what is held is the lattice once, and what simplification takes.
pub(crate) fn held_bytes(prediction: &Prediction, simplify: bool) -> f64 {
    if simplify { prediction.memory_bytes + THREADS * prediction.simplifying_bytes } else { HELD_PER_BYTE * prediction.memory_bytes }
}

/// Bytes that an evaluation holds for each leaf cell that is drawn by itself, and for each that becomes part of a conforming complex. Found on the fixtures, too.
const BYTES_PER_CELL: f64 = 64.0;
const BYTES_PER_FACE: f64 = 400.0;
/// Estimates are within this factor of the truth: what is predicted to be more than so many limits exceeds the limit, and what is predicted to be less than such a share of it does not.
const CERTAIN: f64 = 2.0;
/// A tolerance that would pass is looked for in so many steps of this factor, and then between the last two by so many halvings of their ratio's logarithm.
const STEPS: u32 = 12;
const STEP: f64 = 8.0;
const HALVINGS: u32 = 4;

/// Predicts the cost of the job, and holds it against the budget's limits.
///
/// # Errors
/// As [`run`](crate::run()), for what shows before the work.
pub fn plan(job: &Job, budget: &Budget) -> Result<Plan, JobError> {
    let (job, _) = repaired(job, budget)?;
    let plan = planned(&job, budget).map_err(|error| with_remedy(&job, error, budget))?;
    let exceeds = plan.counts(job.kind, &budget.limits).into_iter().find(|(_, asked, allowed)| *asked > CERTAIN * allowed);
    let exceeds = exceeds.map(|(limit, asked, allowed)| {
        let remedy = remedy(&job, Some(&plan), limit, budget).map(|(name, value)| (name.to_owned(), value));
        Excess { limit: limit.to_owned(), asked, allowed, remedy: remedy.into_iter().collect() }
    });
    let memory_bytes = if plan.memory_bytes > 0.0 { PROCESS_BYTES + plan.memory_bytes } else { 0.0 };
    Ok(Plan { memory_bytes, exceeds, ..plan })
}

/// An error of a limit with what the plan knows: how much the job takes, and a value that would pass. Cost: some plans.
pub(crate) fn with_remedy(job: &Job, mut error: JobError, budget: &Budget) -> JobError {
    // Of previews nothing is planned.
    let known = |facts: &&mut LimitFacts| facts.remedy.is_none() && PLANNED.contains(&facts.limit) && !job.params.preview;
    if let Some(facts) = error.limit.as_mut().filter(known) {
        let plan = planned(job, &quiet(budget)).ok();
        // What is stopped says nothing.
        if budget.cancel.check().is_err() {
            return error;
        }
        // Who works until a limit is hit knows only that there is more, and by how much is another number every time.
        let asked = plan.as_ref().and_then(|plan| plan.count(job.kind, &budget.limits, facts.limit));
        facts.asked = asked.map_or(facts.asked, |asked| asked.round().max(facts.asked));
        facts.remedy = remedy(job, plan.as_ref(), facts.limit, budget);
    }
    error
}

/// A budget for searches that nobody is told of.
fn quiet(budget: &Budget) -> Budget {
    Budget { progress: None, ..budget.clone() }
}

/// The limits that plans tell of.
const PLANNED: [&str; 4] = ["cells", "triangles", "memory_bytes", "output_bytes"];

impl Plan {
    /// What is held against limits: their names, what is predicted and what is allowed.
    fn counts(&self, kind: JobKind, limits: &Limits) -> [(&'static str, f64, f64); 4] {
        // The triangles of an operation's result are counted, too.
        let triangles = if kind == JobKind::Intersect { self.counted_triangles.max(self.triangles) } else { self.counted_triangles };
        // Those of meshes are of one format of many, and of triangles most of which simplification saves.
        let output_bytes = if kind == JobKind::Slice { self.output_bytes.unwrap_or(0.0) } else { 0.0 };
        let asked = [self.counted_cells, triangles, self.memory_bytes, output_bytes];
        let allowed = [limits.cells as f64, limits.triangles as f64, limits.memory_bytes as f64, limits.output_bytes as f64];
        std::array::from_fn(|index| (PLANNED[index], asked[index], allowed[index]))
    }

    /// What is held against one of the limits.
    fn count(&self, kind: JobKind, limits: &Limits, limit: &str) -> Option<f64> {
        self.counts(kind, limits).into_iter().find(|&(name, ..)| name == limit).map(|(_, asked, _)| asked)
    }
}

/// A value that would pass where a plan, or the job itself, exceeds a limit: of the tolerance, or of the limit where no tolerance is enough. `None` when
/// somebody stops the search, or there is no plan.
fn remedy(job: &Job, plan: Option<&Plan>, limit: &'static str, budget: &Budget) -> Option<(&'static str, f64)> {
    let quiet = quiet(budget);
    let (mut job, kind, mut fails) = (job.clone(), job.kind, job.params.tolerance_mm);
    let mut at = |tolerance_mm: f64| {
        job.params.tolerance_mm = tolerance_mm;
        let found = planned(&job, &quiet).ok();
        // What a search that is stopped finds says nothing.
        budget.cancel.check().ok().map(|()| found)
    };
    let passes = |plan: &Plan| plan.counts(kind, &budget.limits).iter().all(|(_, asked, allowed)| CERTAIN * asked <= *allowed);
    let asked = |plan: &Plan| plan.count(kind, &budget.limits, limit);
    let needed = plan.and_then(asked);
    let mut last = needed;
    for _ in 0..STEPS {
        let tolerance_mm = STEP * fails;
        let found = at(tolerance_mm)?;
        if found.as_ref().is_some_and(passes) {
            let mut enough = tolerance_mm;
            for _ in 0..HALVINGS {
                let middle = (fails * enough).sqrt();
                if at(middle)?.as_ref().is_some_and(passes) { enough = middle } else { fails = middle }
            }
            return Some(("tolerance_mm", enough));
        }
        let now = found.as_ref().and_then(asked);
        // Beyond the size of the ball, or of the shape, a tolerance changes nothing.
        if now.is_some() && now == last {
            break;
        }
        (fails, last) = (tolerance_mm, now.or(last));
    }
    needed.map(|asked| (limit, (CERTAIN * asked).ceil()))
}

/// The plan of a job whose meshes are as they shall be. Its memory is what the work takes beside the process that does it, as limits of memory count it.
fn planned(job: &Job, budget: &Budget) -> Result<Plan, JobError> {
    if let (JobKind::Solidify, Some(level)) = (job.kind, job.params.level) {
        return level::plan(job, level, budget);
    }
    let tolerance = Tolerance::new(job.params.tolerance_mm)?;
    match job.kind {
        // It keeps to limits of its own, and a plan would take as long.
        JobKind::Evaluate | JobKind::Solidify if job.params.preview => return Ok(Plan::default()),
        JobKind::Intersect if job.params.operation == Some(Operation::Split) => {
            let how = split_of(job)?;
            return boolean::plan(job, tolerance, budget, |tolerance, budget| split::split(job, &how, tolerance, budget));
        }
        JobKind::Intersect if job.params.operation.is_some() => {
            let operation = job.params.operation.unwrap_or(Operation::Union);
            return boolean::plan(job, tolerance, budget, |tolerance, budget| boolean::combine(job, operation, tolerance, budget));
        }
        JobKind::Slice => return slice::plan(job, tolerance, budget),
        // Nothing is made, and what a search costs shows in the search.
        JobKind::Intersect => return Ok(Plan::default()),
        JobKind::Measure if job.inputs.len() > 1 => return Ok(Plan::default()),
        JobKind::Convert => {
            if let Some(mesh) = convert::polygons(job) {
                return Ok(convert::plan(mesh));
            }
        }
        JobKind::Evaluate | JobKind::Solidify | JobKind::Measure => {}
    }
    let radius = radius(job)?;
    let lowered = lower(job, budget)?;
    let attractor = &lowered.attractor;
    let leaf_cells = predict_cells(attractor, tolerance, budget)?;
    // A wall's other surface is made like the dilation of the first.
    let radius = match (radius, job.params.wall) {
        (None, Some(wall)) => Some(Radius::new(wall.thickness_mm)?),
        (radius, _) => radius,
    };
    if job.kind == JobKind::Evaluate || radius.is_none() {
        let counted = if matches!(job.kind, JobKind::Evaluate | JobKind::Convert) { leaf_cells } else { 0.0 };
        let joined = (0..attractor.roots().len()).any(|root| attractor.has_brep(root));
        let memory_bytes = counted * if joined { BYTES_PER_FACE } else { BYTES_PER_CELL };
        let evaluated = matches!(job.kind, JobKind::Evaluate | JobKind::Convert);
        let cpu_seconds = evaluated.then(|| effort::of_cells(leaf_cells, joined));
        return Ok(Plan { leaf_cells, counted_cells: counted, memory_bytes, cpu_seconds, ..Plan::default() });
    }
    let Some(radius) = radius else { return Err(JobError::new(Kind::Defect, "internal", "a radius was there".into())) };
    let simplify = job.kind == JobKind::Solidify && job.params.simplify;
    let prediction = predict(attractor, radius, tolerance, simplify, budget)?;
    Ok(Plan {
        leaf_cells,
        triangles: prediction.triangles,
        counted_triangles: prediction.counted_triangles,
        counted_cells: prediction.leaf_cells,
        memory_bytes: held_bytes(&prediction, simplify),
        output_bytes: Some(stl_bytes(prediction.triangles)),
        lattice_pitch_mm: prediction.pitch_mm,
        cpu_seconds: (!searches_more(job)).then(|| effort::of_dilation(&prediction, simplify)),
        smallest_feature_mm: match job.params.wall {
            // The wall's bounds are those of a dilation by its thickness.
            Some(wall) => Some(wall.thickness_mm - tolerance.mm().min(0.5 * wall.thickness_mm)),
            None => job.params.closing_mm.is_none().then_some(prediction.least_thickness_mm),
        },
        exceeds: None,
    })
}

/// Whether a job with a ball does more than to dilate: searches, which take as long as they take, and surfaces after the first.
fn searches_more(job: &Job) -> bool {
    let params = &job.params;
    params.stability || params.thickness || params.oriented_box || params.wall.is_some() || params.closing_mm.is_some()
}

/// Leaf cells that a prediction visits at most.
const COUNTED_CELLS: u64 = 400_000;

/// Leaf cells at a tolerance: counted when few, else extrapolated by the growth between two coarser
/// tolerances, N ~ tolerance^-dimension.
fn predict_cells(attractor: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<f64, JobError> {
    // A tolerance larger than the shape leaves the roots.
    let roots = attractor.roots().len();
    let limits = Limits { cells: COUNTED_CELLS + roots as u64, ..budget.limits };
    let counted = Budget { limits, progress: None, ..budget.clone() };
    let mut coarse = tolerance.mm();
    let mut known: Vec<(f64, f64)> = Vec::new();
    for _ in 0..200 {
        match count_cells(attractor, Tolerance::new(coarse)?, &counted) {
            Ok(count) => known.push((coarse, count as f64)),
            Err(RefineError::Cells { .. } | RefineError::Memory { .. } | RefineError::Depth { .. }) => {}
            Err(stopped @ RefineError::Stopped(_)) => return Err(stopped.into()),
        }
        match known.as_slice() {
            [(first, count), ..] if *first == tolerance.mm() => return Ok(*count),
            [(fine, many), .., (rough, few)] if *rough >= 4.0 * fine => {
                let dimension = (many / few).ln() / (rough / fine).ln();
                return Ok(many * (fine / tolerance.mm()).powf(dimension.max(0.0)));
            }
            _ => coarse *= 2.0,
        }
    }
    Ok(known.first().map_or(roots as f64, |(_, count)| *count))
}

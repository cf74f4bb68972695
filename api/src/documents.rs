//! Documents at the doors: bytes to typed models and jobs, all findings as one problem, and the digest of
//! what was meant.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::Read;
use std::path::Path;

use lacuna_exchange::diagnostic::{Diagnostic, code};
use lacuna_exchange::document::{self, BatchEntry, DocumentLimits, JobDocument, ModelSource, Sought};
use lacuna_exchange::format::automaton::Diagram;
use lacuna_exchange::format::{FORMATS, Format, MeshFile, ReadLimits, read as read_mesh};
use lacuna_fabrication::{Job, JobKind, SolutionSpace, Solved};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::error::LimitFacts;
use lacuna_kernel::model::{Interior, Model, PolygonMesh, Shape};
use serde::{Deserialize, Serialize, Serializer};
use utoipa::ToSchema;

use crate::digest::{Digest, DigestSink};
use crate::files;
use crate::inspection;
use crate::problem::{Finding, Problem, ProblemKind};
use crate::production;

/// What is kept under an id.
pub enum Stored {
    /// A model document.
    Document(Vec<u8>),
    /// A mesh file.
    Mesh(StoredMesh),
}

/// A mesh file that somebody uploaded.
pub struct StoredMesh {
    /// What to call it.
    pub name: Option<String>,
    /// As what to read it.
    pub format: Format,
    /// The file.
    pub bytes: Vec<u8>,
    /// The word by which a worker finds it again: it depends on the contents alone.
    pub reference: String,
}

/// Finds what is stored under an id.
pub type ModelFinder<'a> = &'a dyn Fn(&str) -> Option<Stored>;

/// A job that was read, and by which words a worker finds the mesh files among its inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// The job, every model in it.
    pub job: Job,
    references: Vec<Option<String>>,
    /// The id of a job that this one replaces.
    pub supersedes: Option<String>,
}

impl Order {
    /// A job, and by which words whoever does it finds the inputs that have one.
    #[must_use]
    pub fn new(job: Job, references: Vec<Option<String>>) -> Self {
        Self { job, references, supersedes: None }
    }

    /// The document from which a worker does the job: canonical, limits complete, models in full but for uploaded mesh
    /// files, which stay where they are.
    #[must_use]
    pub fn document(&self) -> String {
        document::write_order(&self.job, &self.references)
    }
}

/// What `validate` says of a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ValidationReport {
    /// Whether the model can be evaluated.
    pub valid: bool,
    /// What is wrong or odd, with places.
    pub diagnostics: Vec<Remark>,
    /// Number of states of the automaton, once the document is legal.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub states: Option<u64>,
    /// Degrees of freedom of the unknown operators: 0 when none is unknown, absent when they could not be found.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub degrees_of_freedom: Option<u64>,
    /// Largest violation of a constraint.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub constraint_residual: Option<f64>,
    /// `[lower, upper]` bounds of the joint spectral radius; `null` for a bound that is not known.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub spectral_radius: Option<[Option<f64>; 2]>,
}

/// How much a remark matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The model cannot be evaluated.
    Error,
    /// It deserves attention.
    Warning,
}

/// One remark about a model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Remark {
    /// JSON pointer into the model document.
    pub pointer: String,
    /// Stable code.
    pub code: String,
    /// What, in words, with the values.
    pub message: String,
    /// How much it matters.
    pub severity: Severity,
    /// Line of the value, from 1.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub line: Option<u64>,
    /// Column of the value, from 1.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub column: Option<u64>,
}

/// The word of a kind of job in documents.
#[must_use]
pub fn kind_word(kind: JobKind) -> &'static str {
    match kind {
        JobKind::Evaluate => "evaluate",
        JobKind::Solidify => "solidify",
        JobKind::Measure => "measure",
        JobKind::Intersect => "intersect",
        JobKind::Slice => "slice",
        JobKind::Convert => "convert",
    }
}

/// Reads a model document.
///
/// # Errors
/// All findings, as one problem.
pub fn read_model(bytes: &[u8]) -> Result<Model, Problem> {
    production::guarded(|| document::read_model(bytes, &DocumentLimits::default()))?.map_err(refused)
}

/// Reads a model document that may name mesh files of its folder.
///
/// # Errors
/// All findings, as one problem.
pub fn read_model_in(bytes: &[u8], folder: Option<&Path>) -> Result<Model, Problem> {
    model_in(bytes, folder)?.map_err(refused)
}

fn model_in(bytes: &[u8], folder: Option<&Path>) -> Result<Result<Model, Vec<Diagnostic>>, Problem> {
    let Some(folder) = folder else { return production::guarded(|| document::read_model(bytes, &DocumentLimits::default())) };
    production::guarded(|| document::read_model_beside(bytes, &DocumentLimits::default(), &|name| mesh_in(folder, name)))
}

/// Reads a mesh file below a folder. Neither its name nor a link leads out of the folder.
fn mesh_in(folder: &Path, name: &str) -> Result<MeshFile, String> {
    let failed = |error: std::io::Error| error.to_string();
    let inside = folder.canonicalize().map_err(failed)?;
    let path = inside.join(name).canonicalize().map_err(failed)?;
    if !path.starts_with(&inside) {
        return Err("it lies outside of the document's folder".to_owned());
    }
    // A pipe or a device may never end.
    if !path.is_file() {
        return Err("it is no file".to_owned());
    }
    let limits = ReadLimits::default();
    let mut bytes = Vec::new();
    File::open(&path).and_then(|file| file.take(limits.file_bytes + 1).read_to_end(&mut bytes)).map_err(failed)?;
    read_mesh(&bytes, None, &limits).map_err(|error| error.to_string())
}

/// A mesh file as a model: its polygons, which are a solid if they are closed.
///
/// # Errors
/// When the file cannot be read within the limits.
pub fn mesh_model(bytes: &[u8], format: Option<Format>, limits: &ReadLimits) -> Result<Model, Problem> {
    let file = inspection::read(bytes, format, limits)?;
    let faces = file.faces();
    Ok(Model { name: None, shape: Shape::Mesh(PolygonMesh { faces, vertices: file.mesh.vertices, interior: Interior::Auto }) })
}

fn model_of(stored: Stored) -> Result<Model, Problem> {
    match stored {
        Stored::Document(bytes) => read_model(&bytes),
        Stored::Mesh(mesh) => {
            let model = mesh_model(&mesh.bytes, Some(mesh.format), &ReadLimits::default())?;
            Ok(Model { name: mesh.name, ..model })
        }
    }
}

/// Reads a job document, fetches the stored models and meshes that it names, and completes its limits.
///
/// # Errors
/// All findings, as one problem.
pub fn read_order(bytes: &[u8], most: &Limits, find: ModelFinder<'_>) -> Result<Order, Problem> {
    complete(production::guarded(|| document::read_job(bytes, &DocumentLimits::default()))?.map_err(refused)?, most, find)
}

/// Reads a batch; [`complete`] makes an order of each of its jobs.
///
/// # Errors
/// All findings, as one problem.
pub fn read_batch(bytes: &[u8]) -> Result<Vec<BatchEntry>, Problem> {
    production::guarded(|| document::read_batch(bytes, &DocumentLimits::default()))?.map_err(refused)
}

/// Reads a batch whose jobs may name mesh files of its folder, and no stored models.
///
/// # Errors
/// All findings of reading, or else those of the first job that cannot be completed, as one problem.
pub fn read_batch_in(bytes: &[u8], most: &Limits, folder: Option<&Path>) -> Result<Vec<(Option<String>, Job)>, Problem> {
    let entries = match folder {
        None => read_batch(bytes)?,
        Some(folder) => {
            let read = || document::read_batch_beside(bytes, &DocumentLimits::default(), &|name| mesh_in(folder, name));
            production::guarded(read)?.map_err(refused)?
        }
    };
    entries.into_iter().map(|entry| Ok((entry.name, complete(entry.job, most, &|_| None)?.job))).collect()
}

/// The document of a batch whose mesh files are in it.
///
/// # Errors
/// As [`read_batch_in`].
pub fn whole_batch(bytes: &[u8], folder: Option<&Path>) -> Result<String, Problem> {
    let most = Limits::MOST;
    let unfit = |error: serde_json::Error| Problem::internal(format!("a job is no JSON: {error}"));
    let of_entry = |(name, job): (Option<String>, Job)| {
        let job: serde_json::Value = serde_json::from_str(&Order::new(job, Vec::new()).document()).map_err(unfit)?;
        Ok(match name {
            Some(name) => serde_json::json!({ "name": name, "job": job }),
            None => serde_json::json!({ "job": job }),
        })
    };
    let jobs: Vec<serde_json::Value> = read_batch_in(bytes, &most, folder)?.into_iter().map(of_entry).collect::<Result<_, Problem>>()?;
    serde_json::to_string(&serde_json::json!({ "lacuna": 1, "jobs": jobs })).map_err(unfit)
}

/// Reads a job document that may name mesh files of its folder, and no stored models.
///
/// # Errors
/// All findings, as one problem.
pub fn read_job_in(bytes: &[u8], most: &Limits, folder: Option<&Path>) -> Result<Job, Problem> {
    let Some(folder) = folder else { return here(read_order(bytes, most, &|_| None)?) };
    let read = || document::read_job_beside(bytes, &DocumentLimits::default(), &|name| mesh_in(folder, name));
    here(complete(production::guarded(read)?.map_err(refused)?, most, &|_| None)?)
}

/// A job that is done at once, by whoever reads it.
fn here(order: Order) -> Result<Job, Problem> {
    match order.supersedes {
        None => Ok(order.job),
        Some(_) => Err(one_finding("/supersedes", UNKNOWN_JOB, "there is no other job to be replaced; a service has jobs")),
    }
}

/// The code of an id that is no job's.
const UNKNOWN_JOB: &str = "job.unknown-job";

/// A job to be replaced is not there.
#[must_use]
pub fn unknown_job(id: &str) -> Problem {
    let shown: String = id.chars().take(80).collect();
    one_finding("/supersedes", UNKNOWN_JOB, &format!("there is no job {shown:?} to be replaced; leave \"supersedes\" out"))
}

/// A job document without its kind, completed; every place in it stays where it was.
#[must_use]
pub fn of_kind(body: &[u8], kind: JobKind) -> Vec<u8> {
    let (Some(first), Some(last)) = (body.iter().position(|&byte| byte == b'{'), body.iter().rposition(|&byte| byte == b'}')) else {
        // No object: the reader says what it is instead.
        return body.to_vec();
    };
    if last < first {
        return body.to_vec();
    }
    let comma = if body[first + 1..last].iter().all(u8::is_ascii_whitespace) { "" } else { "," };
    let member = format!("{comma}\"kind\":\"{}\"", kind_word(kind));
    [&body[..last], member.as_bytes(), &body[last..]].concat()
}

/// Fetches what a job names, and remembers what of it are mesh files.
struct Fetcher<'a> {
    find: ModelFinder<'a>,
    references: HashMap<String, String>,
    triangles: u64,
    most_triangles: u64,
    refusal: Option<Problem>,
}

impl Fetcher<'_> {
    fn fetch(&mut self, id: &str) -> Option<Model> {
        if self.refusal.is_some() {
            return None;
        }
        let stored = (self.find)(id)?;
        if let Stored::Mesh(mesh) = &stored {
            self.references.insert(id.to_owned(), mesh.reference.clone());
        }
        match model_of(stored).and_then(|model| self.count(model)) {
            Ok(model) => Some(model),
            Err(problem) => {
                self.refusal = Some(problem);
                None
            }
        }
    }

    /// A short job can name a large mesh a thousand times, and every input is a mesh of its own in memory.
    fn count(&mut self, model: Model) -> Result<Model, Problem> {
        if let Shape::Mesh(mesh) = &model.shape {
            self.triangles += mesh.faces.len() as u64;
        }
        if self.triangles <= self.most_triangles {
            return Ok(model);
        }
        #[expect(clippy::cast_precision_loss, reason = "limits are shown, not computed with")]
        let facts =
            LimitFacts { limit: "referenced_faces", asked: self.triangles as f64, allowed: self.most_triangles as f64, remedy: None };
        let detail = format!("the meshes that the job names have more than {} faces together", self.most_triangles);
        Err(Problem::new(ProblemKind::Limit, detail).code("limit.referenced-faces").limit(&facts))
    }
}

/// Fetches the stored models and meshes that a job names, and completes its limits.
///
/// # Errors
/// All findings, as one problem.
pub fn complete(read: JobDocument, most: &Limits, find: ModelFinder<'_>) -> Result<Order, Problem> {
    let ids: Vec<Option<String>> = read.inputs.iter().map(|input| input.reference().map(str::to_owned)).collect();
    let (supersedes, place) = (read.supersedes.clone(), read.pointer.clone());
    let mut fetcher = Fetcher { find, references: HashMap::new(), triangles: 0, most_triangles: most.triangles, refusal: None };
    let resolved = read.resolve(&within(&Limits::default(), most), most, |id| fetcher.fetch(id));
    if let Some(problem) = fetcher.refusal {
        return Err(problem);
    }
    let mut job = resolved.map_err(refused)?;
    let references: Vec<Option<String>> = ids.into_iter().map(|id| fetcher.references.get(&id?).cloned()).collect();
    // A mesh file's name has named its input. The model itself has none, whoever reads it: equal work has one digest.
    for (input, _) in job.inputs.iter_mut().zip(&references).filter(|(_, reference)| reference.is_some()) {
        input.model.name = None;
    }
    if job.outputs.is_empty() {
        job.outputs = default_outputs(&job).iter().map(|&name| name.to_owned()).collect();
    }
    for (index, name) in job.outputs.iter().enumerate() {
        format(name).map_err(|problem| one_finding(&format!("{place}/outputs/{index}"), &problem.code, &problem.detail))?;
    }
    Ok(Order { job, references, supersedes })
}

/// Reads a request to solve a model, and fetches the model if it is stored.
///
/// # Errors
/// All findings, as one problem.
pub fn read_solve(bytes: &[u8], find: ModelFinder<'_>) -> Result<(Model, BTreeMap<String, f64>), Problem> {
    let read = production::guarded(|| document::read_solve(bytes, &DocumentLimits::default()))?.map_err(refused)?;
    let model = read.input.resolve(|id| find(id).and_then(|stored| model_of(stored).ok()));
    Ok((model.map_err(|diagnostic| refused(vec![diagnostic]))?, read.values))
}

/// A solved model: the solution space, and the model document for the chosen values.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct SolveReport {
    /// All solutions.
    #[serde(flatten)]
    pub space: SolutionSpace,
    /// The model for the chosen values, without unknowns, lengths in mm.
    #[schema(value_type = crate::openapi::Model)]
    #[serde(serialize_with = "as_document")]
    pub model: Model,
}

fn as_document<S: Serializer>(model: &Model, serializer: S) -> Result<S::Ok, S::Error> {
    document::model_value(model).serialize(serializer)
}

impl SolveReport {
    /// What is told of a solved model.
    ///
    /// # Errors
    /// When a number in it is not finite, which JSON cannot carry.
    pub fn of(solved: Solved) -> Result<Self, Problem> {
        let Solved { space, model } = solved;
        match space.entries.iter().find(|entry| !entry.value.is_finite()) {
            None if space.residual.is_finite() => Ok(Self { space, model }),
            None => Err(Problem::internal("the residual of a solution is not finite")),
            Some(entry) => {
                let detail = format!("the entry {} has no finite value for the chosen parameters; choose smaller ones", entry.name);
                Err(one_finding(&entry.pointer, "solve.not-finite", &detail))
            }
        }
    }
}

/// What a job makes when it asks for no format: what printers read, and what carries wires.
fn default_outputs(job: &Job) -> &'static [&'static str] {
    match job.kind {
        _ if job.params.preview => &["glb"],
        JobKind::Intersect if job.params.operation.is_none() => &[],
        JobKind::Solidify | JobKind::Intersect => &["3mf"],
        JobKind::Evaluate | JobKind::Convert => &["obj"],
        JobKind::Slice => &["svg"],
        JobKind::Measure => &[],
    }
}

/// What the files of a job are called before their endings: as its first input; a preview is not to be taken for what it stands for.
#[must_use]
pub fn file_stem(job: &Job) -> String {
    let stem = files::safe_stem(job.inputs.first().map_or("result", |input| &input.name));
    if job.params.preview { format!("{stem}-preview") } else { stem }
}

/// The defaults, but nowhere above the most that is allowed.
#[must_use]
pub fn within(default: &Limits, most: &Limits) -> Limits {
    Limits {
        seconds: default.seconds.min(most.seconds),
        memory_bytes: default.memory_bytes.min(most.memory_bytes),
        cells: default.cells.min(most.cells),
        triangles: default.triangles.min(most.triangles),
        depth: default.depth.min(most.depth),
        output_bytes: default.output_bytes.min(most.output_bytes),
    }
}

/// Digest of the canonical job document with the default limits: equal where the same is meant, whatever it may use.
#[must_use]
pub fn job_digest(job: &Job) -> Digest {
    let mut sink = DigestSink::default();
    // A digest takes everything.
    let _ = document::write_job_to(job, &Limits::default(), &mut sink);
    sink.finish()
}

/// The canonical document of a model.
#[must_use]
pub fn model_document(model: &Model) -> String {
    document::write_model(model)
}

/// The canonical document of a model for people: indented, with a line end.
#[must_use]
pub fn model_file(model: &Model) -> String {
    let mut text = document::write_model_indented(model);
    text.push('\n');
    text
}

/// Reads a question about addresses, and fetches the stored model that it may name.
///
/// # Errors
/// All findings, as one problem.
pub fn read_address_question(bytes: &[u8], find: ModelFinder<'_>) -> Result<(Model, Sought), Problem> {
    let read = production::guarded(|| document::read_address_question(bytes, &DocumentLimits::default()))?.map_err(refused)?;
    let model = match read.input.source {
        ModelSource::Inline(model) => *model,
        ModelSource::Stored(id) => {
            let stored = find(&id).ok_or_else(|| {
                let message = format!("no model is stored as {id:?}; store it first, or send it as \"model\"");
                one_finding(&read.input.pointer, code::UNKNOWN_MODEL, &message)
            })?;
            model_of(stored)?
        }
    };
    Ok((model, read.sought))
}

/// The automaton of a model, to be drawn, whether or not the model can be evaluated.
///
/// # Errors
/// When the document is not legal, or the kernel has a defect.
pub fn read_diagram(bytes: &[u8]) -> Result<Diagram, Problem> {
    let model = read_model(bytes)?;
    production::guarded(|| Diagram::of(&model))
}

/// Reads and examines a model; the budget bounds the search for degrees of freedom.
///
/// # Errors
/// When the bytes are not a JSON text at all, or the kernel has a defect.
pub fn validate(bytes: &[u8], budget: &Budget) -> Result<ValidationReport, Problem> {
    validate_in(bytes, None, budget)
}

/// Reads and examines a model that may name mesh files of its folder.
///
/// # Errors
/// As [`validate`].
pub fn validate_in(bytes: &[u8], folder: Option<&Path>, budget: &Budget) -> Result<ValidationReport, Problem> {
    let model = match model_in(bytes, folder)? {
        Ok(model) => model,
        Err(diagnostics) if diagnostics.iter().any(is_about_the_text) => return Err(refused(diagnostics)),
        Err(diagnostics) => {
            let diagnostics = diagnostics.into_iter().map(remark).collect();
            let unknown = (None, None, None, None);
            let (states, degrees_of_freedom, constraint_residual, spectral_radius) = unknown;
            return Ok(ValidationReport { valid: false, diagnostics, states, degrees_of_freedom, constraint_residual, spectral_radius });
        }
    };
    let found = production::validate(&model, budget)?;
    let diagnostics = found.diagnostics.into_iter().map(|d| Remark {
        pointer: format!("/shape{}", d.pointer),
        code: d.code.to_owned(),
        message: d.message,
        severity: if d.warning { Severity::Warning } else { Severity::Error },
        line: None,
        column: None,
    });
    Ok(ValidationReport {
        valid: found.valid,
        diagnostics: diagnostics.collect(),
        states: Some(found.states),
        degrees_of_freedom: found.degrees_of_freedom,
        constraint_residual: Some(found.constraint_residual),
        spectral_radius: found.spectral_radius.map(|bounds| bounds.map(|bound| bound.is_finite().then_some(bound))),
    })
}

fn remark(diagnostic: Diagnostic) -> Remark {
    let Diagnostic { pointer, code, message, line, column } = diagnostic;
    Remark { pointer, code: code.to_owned(), message, severity: Severity::Error, line, column }
}

/// Whether the bytes are no JSON text: then nothing can be said of a model.
fn is_about_the_text(diagnostic: &Diagnostic) -> bool {
    const TEXT: [&str; 6] =
        [code::NO_CONTENT, code::BYTE_ORDER_MARK, code::NOT_UTF8, code::SYNTAX, code::TRUNCATED, code::TRAILING_CONTENT];
    TEXT.contains(&diagnostic.code)
}

/// All findings of a document as one problem, with the first one's words and code in front.
fn refused(diagnostics: Vec<Diagnostic>) -> Problem {
    let kind = if diagnostics.iter().any(is_about_the_text) {
        ProblemKind::MalformedJson
    } else if diagnostics.iter().any(|d| d.code == code::TOO_LARGE) {
        ProblemKind::BodyTooLarge
    } else {
        ProblemKind::InvalidModel
    };
    let others = match diagnostics.len() {
        0 | 1 => String::new(),
        count => format!(" (and {} more)", count - 1),
    };
    let first = diagnostics.first().map_or_else(|| "the document is refused".to_owned(), ToString::to_string);
    let code = diagnostics.first().map_or("invalid-model", |d| d.code);
    let findings = diagnostics.iter().map(|d| Finding {
        pointer: d.pointer.clone(),
        code: d.code.to_owned(),
        message: d.message.clone(),
        line: d.line,
        column: d.column,
    });
    Problem::new(kind, format!("{first}{others}")).code(code).errors(findings.collect())
}

fn one_finding(pointer: &str, code: &str, message: &str) -> Problem {
    let finding = Finding { pointer: pointer.to_owned(), code: code.to_owned(), message: message.to_owned(), line: None, column: None };
    Problem::new(ProblemKind::InvalidModel, message).code(code).errors(vec![finding])
}

/// The format of an output's name.
///
/// # Errors
/// When there is none, with the names there are.
pub fn format(name: &str) -> Result<Format, Problem> {
    FORMATS.iter().find(|row| row.ending == name).map(|row| row.format).ok_or_else(|| {
        let names: Vec<&str> = FORMATS.iter().map(|row| row.ending).collect();
        let detail = format!("there is no format {name:?}; there are {}", names.join(", "));
        Problem::new(ProblemKind::InvalidModel, detail).code("job.unknown-format")
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const JOB: &str = r#"{"lacuna":1,"kind":"KIND","model":{"lacuna":1,"units":"UNITS","shape":{"family":"mesh",
        "vertices":[[0,0,0],[LENGTH,0,0]],"faces":[[0,1]]}},"params":{"tolerance_mm":0.1 RADIUS} REST}"#;

    fn job(kind: &str, units: &str, length: &str, radius: &str, rest: &str) -> Result<Job, Problem> {
        let text = JOB.replace("KIND", kind).replace("UNITS", units).replace("LENGTH", length);
        read_order(text.replace("RADIUS", radius).replace("REST", rest).as_bytes(), &Limits::default(), &|_| None).map(|order| order.job)
    }

    #[test]
    fn equal_work_has_one_digest() {
        let cm = job("measure", "cm", "1", "", "").unwrap();
        let mm = job("measure", "mm", "10", "", r#","limits":{"seconds":5}"#).unwrap();
        assert_eq!(job_digest(&cm), job_digest(&mm));
        assert_ne!(document::write_job(&cm), document::write_job(&mm));
        assert_ne!(job_digest(&cm), job_digest(&job("measure", "mm", "11", "", "").unwrap()));
    }

    #[test]
    fn a_preview_is_other_work_and_a_glb_alone() {
        let (result, seen) = (job("evaluate", "mm", "1", "", ""), job("evaluate", "mm", "1", r#","preview":true"#, ""));
        let (result, seen) = (result.unwrap(), seen.unwrap());
        assert_ne!(job_digest(&result), job_digest(&seen));
        assert_eq!(
            (seen.outputs.as_slice(), file_stem(&seen), file_stem(&result)),
            (&["glb".to_owned()][..], "shape-preview".into(), "shape".into())
        );
        let plain = job("evaluate", "mm", "1", r#","preview":false"#, "").unwrap();
        assert_eq!(job_digest(&result), job_digest(&plain));
        for (kind, more, rest) in [
            ("evaluate", "", r#","outputs":["glb","stl"]"#),
            ("measure", "", ""),
            ("convert", "", ""),
            ("solidify", r#","radius_mm":1,"stability":true"#, ""),
            ("solidify", r#","radius_mm":1,"closing_mm":1"#, ""),
            ("solidify", r#","wall_mm":1"#, ""),
        ] {
            let refused = job(kind, "mm", "1", &format!(r#","preview":true{more}"#), rest).unwrap_err();
            assert_eq!((refused.errors.len(), refused.code.as_ref()), (1, code::CONFLICTING_MEMBERS), "{kind} {more} {rest}");
        }
    }

    #[test]
    fn a_worker_reads_the_same_job() {
        let first = job("solidify", "in", "1", r#","radius_mm":0.4"#, "").unwrap();
        assert_eq!(first.outputs, ["3mf"]);
        let again = read_order(document::write_job(&first).as_bytes(), &Limits::default(), &|_| None).unwrap().job;
        assert_eq!(first, again);
    }

    #[test]
    fn findings_carry_their_places() {
        let unknown = job("measure", "mm", "1", "", r#","colour":"red""#).unwrap_err();
        assert_eq!((unknown.kind, unknown.errors[0].pointer.as_str()), (ProblemKind::InvalidModel, "/colour"));
        let format = job("evaluate", "mm", "1", "", r#","outputs":["obj","dwg"]"#).unwrap_err();
        assert_eq!(format.errors[0].pointer, "/outputs/1");
        let limit = job("evaluate", "mm", "1", "", r#","limits":{"triangles":1000000000000}"#).unwrap_err();
        assert_eq!(limit.errors[0].pointer, "/limits/triangles");
        assert_eq!(read_model(b"{").unwrap_err().kind, ProblemKind::MalformedJson);
    }
}

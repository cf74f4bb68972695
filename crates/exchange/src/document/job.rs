//! Reads jobs: what to do, with which models, how precisely, and within which limits.

use std::collections::HashSet;

use glam::DVec3;

use lacuna_fabrication::job::{CutPlane, Input, Job, JobKind, Operation, Params, Planes, Split, SplitKey, WallOrder, WallSide, With};
use lacuna_kernel::budget::Limits;
use lacuna_kernel::model::Model;

use super::grammar::{JOB, JOB_INPUT, JOB_LIMITS, JOB_PARAMS, LATER_KINDS, MOST_LEVEL, OPERATIONS, WALL_SIDES};
use super::model::{model, version};
use super::node::{Place, quoted};
use super::walk::{Members, Walker, length, suggestion};
use super::with::with;
use crate::diagnostic::{Diagnostic, code};
use crate::format::{FORMATS, Format};

/// A job as its document states it: legal, with references to stored models still to be resolved and
/// limits still to be completed from the service's.
#[derive(Clone, Debug, PartialEq)]
pub struct JobDocument {
    /// What to do.
    pub kind: JobKind,
    /// With what.
    pub inputs: Vec<InputDocument>,
    /// How.
    pub params: Params,
    /// Names (endings) of the formats wanted, each once and each in [`FORMATS`].
    pub outputs: Vec<String>,
    /// What may be used, as far as the document says.
    pub limits: RequestedLimits,
    /// The id of the job that this one replaces.
    pub supersedes: Option<String>,
    /// JSON pointer to the job: empty where it is the whole document.
    pub pointer: String,
}

/// A model that a job uses.
#[derive(Clone, Debug, PartialEq)]
pub struct InputDocument {
    /// The name that the job gives it, if it does.
    pub name: Option<String>,
    /// The model, or where it is stored.
    pub source: ModelSource,
    /// JSON pointer to the model or the reference.
    pub pointer: String,
    /// Radius of its own ball in mm, if it has one.
    pub radius_mm: Option<f64>,
}

/// A model in full, or the id of a stored one.
#[derive(Clone, Debug, PartialEq)]
pub enum ModelSource {
    /// The model.
    Inline(Box<Model>),
    /// The id.
    Stored(String),
}

/// Limits that a document asks for; the service's own where it says nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RequestedLimits {
    /// Wall time in seconds.
    pub seconds: Option<f64>,
    /// Accounted memory in bytes.
    pub memory_bytes: Option<u64>,
    /// Leaf cells.
    pub cells: Option<u64>,
    /// Triangles of the result.
    pub triangles: Option<u64>,
    /// Length of the longest address.
    pub depth: Option<u32>,
    /// Bytes of all files of the result.
    pub output_bytes: Option<u64>,
}

impl RequestedLimits {
    /// The limits of the job: what was asked, `default` where nothing was.
    ///
    /// # Errors
    /// A diagnostic for each limit asked above `most`.
    pub fn resolve(&self, default: &Limits, most: &Limits) -> Result<Limits, Vec<Diagnostic>> {
        let limits = Limits {
            seconds: self.seconds.unwrap_or(default.seconds),
            memory_bytes: self.memory_bytes.unwrap_or(default.memory_bytes),
            cells: self.cells.unwrap_or(default.cells),
            triangles: self.triangles.unwrap_or(default.triangles),
            depth: self.depth.unwrap_or(default.depth),
            output_bytes: self.output_bytes.unwrap_or(default.output_bytes),
        };
        let excesses = [
            ("seconds", self.seconds.is_some() && limits.seconds > most.seconds, limits.seconds.to_string(), most.seconds.to_string()),
            ("memory_bytes", limits.memory_bytes > most.memory_bytes, limits.memory_bytes.to_string(), most.memory_bytes.to_string()),
            ("cells", limits.cells > most.cells, limits.cells.to_string(), most.cells.to_string()),
            ("triangles", limits.triangles > most.triangles, limits.triangles.to_string(), most.triangles.to_string()),
            ("depth", limits.depth > most.depth, limits.depth.to_string(), most.depth.to_string()),
            ("output_bytes", limits.output_bytes > most.output_bytes, limits.output_bytes.to_string(), most.output_bytes.to_string()),
        ];
        let diagnostics: Vec<_> = excesses
            .into_iter()
            .filter(|(_, exceeded, _, _)| *exceeded)
            .map(|(name, _, asked, allowed)| Diagnostic {
                pointer: format!("/limits/{name}"),
                code: code::LIMIT_TOO_HIGH,
                message: format!("is {asked}; at most {allowed} is allowed"),
                line: None,
                column: None,
            })
            .collect();
        if diagnostics.is_empty() { Ok(limits) } else { Err(diagnostics) }
    }
}

/// The model itself, fetched by `find` if it is stored.
fn fetched(source: ModelSource, pointer: String, find: &mut impl FnMut(&str) -> Option<Model>) -> Result<Model, Diagnostic> {
    match source {
        ModelSource::Inline(model) => Ok(*model),
        ModelSource::Stored(id) => find(&id).ok_or_else(|| {
            let message = format!("no model is stored as {}; store it first, or send it as \"model\"", quoted(&id));
            Diagnostic { pointer, code: code::UNKNOWN_MODEL, message, line: None, column: None }
        }),
    }
}

impl InputDocument {
    /// The id of the stored model that it refers to, if it does.
    #[must_use]
    pub fn reference(&self) -> Option<&str> {
        match &self.source {
            ModelSource::Stored(id) => Some(id),
            ModelSource::Inline(_) => None,
        }
    }

    /// The model, fetched by `find` if it is stored.
    ///
    /// # Errors
    /// A diagnostic when `find` does not know it.
    pub fn resolve(self, mut find: impl FnMut(&str) -> Option<Model>) -> Result<Model, Diagnostic> {
        fetched(self.source, self.pointer, &mut find)
    }
}

impl JobDocument {
    /// The ids of stored models that the job refers to.
    pub fn references(&self) -> impl Iterator<Item = &str> {
        self.inputs.iter().filter_map(InputDocument::reference)
    }

    /// The job, with stored models fetched by `find` and limits that are absent taken from `default`.
    /// An input without a name is called as its model, or `shape`.
    ///
    /// # Errors
    /// A diagnostic for each reference that `find` does not know, and each limit above `most`.
    pub fn resolve(self, default: &Limits, most: &Limits, mut find: impl FnMut(&str) -> Option<Model>) -> Result<Job, Vec<Diagnostic>> {
        let mut diagnostics = Vec::new();
        let mut inputs = Vec::with_capacity(self.inputs.len());
        for InputDocument { name, source, pointer, radius_mm } in self.inputs {
            let model = fetched(source, pointer, &mut find).map_err(|diagnostic| diagnostics.push(diagnostic)).ok();
            if let Some(model) = model {
                let name = name.or_else(|| model.name.clone()).unwrap_or_else(|| "shape".into());
                inputs.push(Input { name, model, radius_mm });
            }
        }
        match self.limits.resolve(default, most) {
            Ok(limits) if diagnostics.is_empty() => Ok(Job { kind: self.kind, inputs, params: self.params, outputs: self.outputs, limits }),
            Ok(_) => Err(diagnostics),
            Err(excesses) => {
                let placed = |excess: Diagnostic| Diagnostic { pointer: format!("{}{}", self.pointer, excess.pointer), ..excess };
                diagnostics.extend(excesses.into_iter().map(placed));
                Err(diagnostics)
            }
        }
    }
}

/// A job document.
pub(super) fn job(walker: &mut Walker<'_>, place: Place<'_>) -> Option<JobDocument> {
    let members = walker.object(place, &JOB)?;
    if let Some(place) = members.get("lacuna") {
        version(walker, place);
    }
    let kind = members.get("kind").and_then(|place| kind(walker, place));
    let inputs = inputs(walker, &members, kind);
    let params = members.get("params").and_then(|place| params(walker, place, kind));
    let outputs = members.get("outputs").map_or(Some(Vec::new()), |place| outputs(walker, place, kind));
    let limits = members.get("limits").map_or(Some(RequestedLimits::default()), |place| limits(walker, place));
    let supersedes = stated(members.get("supersedes").map(|place| walker.name(place, "the id of a job")));
    let document = JobDocument {
        kind: kind?,
        inputs: inputs?,
        params: params?,
        outputs: outputs?,
        limits: limits?,
        supersedes: supersedes?,
        pointer: place.path.pointer(),
    };
    settle(walker, &members, &document)?;
    Some(document)
}

/// What a measure delivers.
const MEASURED: &str =
    "measure delivers numbers, and with \"thickness\" the output \"ply\", its map on the surface; remove all other \"outputs\"";

/// What a preview delivers.
const PREVIEWED: &str = "a preview is for the eye, and comes as \"glb\" alone; remove all other \"outputs\", or \"preview\"";

/// What depends on several members: an operation takes two inputs or more; two shapes, or one and a primitive, are held against each other as they are,
/// and make no file.
fn settle(walker: &mut Walker<'_>, members: &Members<'_>, document: &JobDocument) -> Option<()> {
    let (count, Params { operation, with, .. }) = (document.inputs.len(), &document.params);
    let place = members.get("inputs").unwrap_or(members.place);
    let wanted = match (document.kind, operation, with) {
        (JobKind::Intersect, Some(Operation::Trim | Operation::Split), _) if count != 1 => Some("one to be cut"),
        (JobKind::Intersect, Some(Operation::Union | Operation::Intersection | Operation::Difference), _) if count < 2 => {
            Some("two or more for an operation")
        }
        (JobKind::Intersect, None, None) if count != 2 => {
            Some("two to be held against each other; three or more need an \"operation\", one a \"with\"")
        }
        (JobKind::Intersect, None, Some(_)) if count != 1 => Some("one to be held against what \"with\" says"),
        _ => None,
    };
    if let Some(wanted) = wanted {
        walker.fault(&place, code::WRONG_LENGTH, || format!("there are {count} inputs; expected {wanted}"));
        return None;
    }
    if let (true, Some(place)) = (document.params.preview, members.get("outputs"))
        && document.outputs.iter().any(|name| name != Format::Glb.facts().ending)
    {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || PREVIEWED.into());
        return None;
    }
    let compares = match document.kind {
        JobKind::Intersect => operation.is_none(),
        JobKind::Measure => count > 1,
        _ => false,
    };
    if !compares {
        let mapped = document.params.thickness || document.outputs.is_empty();
        if let (JobKind::Measure, Some(place), false) = (document.kind, members.get("outputs"), mapped) {
            walker.fault(&place, code::CONFLICTING_MEMBERS, || MEASURED.into());
            return None;
        }
        return Some(());
    }
    if let (Some(place), false) = (members.get("outputs"), document.outputs.is_empty()) {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || "a comparison delivers numbers and no files; remove \"outputs\"".into());
        return None;
    }
    let Params { radius_mm, density_g_cm3, direction, oriented_box, thickness, .. } = document.params;
    if oriented_box
        || direction.is_some()
        || thickness
        || radius_mm.is_some()
        || density_g_cm3.is_some()
        || document.inputs.iter().any(|input| input.radius_mm.is_some())
    {
        let place = members.get("params").unwrap_or(members.place);
        walker.fault(&place, code::CONFLICTING_MEMBERS, || {
            "shapes are compared as they are: remove \"radius_mm\", \"density_g_cm3\", \"direction\", \"oriented_box\" and \"thickness\", or ask for an \"operation\"".into()
        });
        return None;
    }
    Some(())
}

fn kind(walker: &mut Walker<'_>, place: Place<'_>) -> Option<JobKind> {
    const KINDS: [(&str, JobKind); 6] = [
        ("evaluate", JobKind::Evaluate),
        ("solidify", JobKind::Solidify),
        ("measure", JobKind::Measure),
        ("intersect", JobKind::Intersect),
        ("slice", JobKind::Slice),
        ("convert", JobKind::Convert),
    ];
    let text = walker.text(place, "the name of a kind of job")?;
    if let Some((_, kind)) = KINDS.iter().find(|(word, _)| *word == text) {
        return Some(*kind);
    }
    let available = || KINDS.iter().map(|(word, _)| *word);
    if LATER_KINDS.contains(&text) {
        walker.fault(&place, code::KIND_NOT_AVAILABLE, || {
            format!("jobs of kind \"{text}\" are not available yet; available are {}", available().collect::<Vec<_>>().join(", "))
        });
    } else {
        walker.fault(&place, code::UNKNOWN_VALUE, || format!("{} is not a kind of job; {}", quoted(text), suggestion(text, available())));
    }
    None
}

/// Exactly one of `model`, `model_ref` and `inputs`.
fn inputs(walker: &mut Walker<'_>, members: &Members<'_>, kind: Option<JobKind>) -> Option<Vec<InputDocument>> {
    one_of(walker, members, &["model", "model_ref", "inputs"], "a job")?;
    let Some(place) = members.get("inputs") else {
        return Some(vec![InputDocument { name: None, ..source(walker, members)? }]);
    };
    let mut names: HashSet<String> = HashSet::new();
    let inputs = walker.each_of(place, 1, "an array of inputs", |walker, place| {
        let members = walker.object(place, &JOB_INPUT)?;
        let name = members.get("name").and_then(|place| {
            let name = walker.name(place, "the name of an input")?;
            if !names.insert(name.clone()) {
                walker.fault(&place, code::DUPLICATE_NAME, || format!("another input is called {} already", quoted(&name)));
                return None;
            }
            Some(name)
        });
        let radius = members.get("radius_mm").map(|place| radius(walker, place, kind));
        let source = one_of(walker, &members, &["model", "model_ref"], "an input").and_then(|()| source(walker, &members));
        Some(InputDocument { name: Some(name?), radius_mm: stated(radius)?, ..source? })
    });
    // How many an intersect takes depends on its operation, which the job itself settles.
    match (length(place.node), kind) {
        (_, Some(JobKind::Intersect)) => inputs,
        (Some(found), Some(JobKind::Measure)) if found > 2 => walker.wrong_length(&place, found, "one input, or two to compare"),
        (_, Some(JobKind::Measure)) => inputs,
        (Some(found), _) if found > 1 => {
            walker.wrong_length(&place, found, "one input: evaluate, solidify, slice and convert take one model")
        }
        _ => inputs,
    }
}

/// The radius of an input's own ball; 0 for the solid itself.
fn radius(walker: &mut Walker<'_>, place: Place<'_>, kind: Option<JobKind>) -> Option<f64> {
    if kind.is_some_and(|kind| kind != JobKind::Intersect) {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || {
            "only inputs of intersect have a radius of their own; give it as \"radius_mm\" of \"params\"".into()
        });
        return None;
    }
    let radius = walker.number(place)?;
    if radius < 0.0 {
        walker.fault(&place, code::NOT_POSITIVE, || format!("is {radius}; expected a radius in mm, or 0 for the solid itself"));
        return None;
    }
    Some(radius)
}

/// Reports unless exactly one of the members is there.
pub(super) fn one_of(walker: &mut Walker<'_>, members: &Members<'_>, names: &[&str], title: &str) -> Option<()> {
    let listed = || names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
    let mut stated = names.iter().filter(|name| members.has(name));
    let Some(first) = stated.next() else {
        walker.fault(&members.place, code::MISSING_MEMBER, || format!("{title} needs one of the members {}", listed()));
        return None;
    };
    let mut alone = Some(());
    for other in stated {
        if let Some(conflict) = members.get(other) {
            walker.fault(&conflict, code::CONFLICTING_MEMBERS, || {
                format!("\"{other}\" and \"{first}\" exclude each other; keep one of {}", listed())
            });
        }
        alone = None;
    }
    alone
}

/// The model, or the reference to it.
pub(super) fn source(walker: &mut Walker<'_>, members: &Members<'_>) -> Option<InputDocument> {
    if let Some(place) = members.get("model") {
        let source = ModelSource::Inline(Box::new(model(walker, place, true)?));
        return Some(InputDocument { name: None, source, pointer: place.path.pointer(), radius_mm: None });
    }
    let place = members.get("model_ref")?;
    let source = ModelSource::Stored(walker.name(place, "the id of a stored model")?);
    Some(InputDocument { name: None, source, pointer: place.path.pointer(), radius_mm: None })
}

fn params(walker: &mut Walker<'_>, place: Place<'_>, kind: Option<JobKind>) -> Option<Params> {
    let members = walker.object(place, &JOB_PARAMS)?;
    let level = level(walker, &members, kind)?;
    let tolerance = match members.get("tolerance_mm") {
        Some(place) => walker.positive(place, "a tolerance in mm"),
        // A level is exact but for the files' precision.
        None if level.is_some() => Some(0.0),
        None => {
            walker.fault(&place, code::MISSING_MEMBER, || {
                "params needs the member \"tolerance_mm\": the Hausdorff bound on the result, in mm, above zero".into()
            });
            None
        }
    };
    let radius = members.get("radius_mm").map(|place| walker.positive(place, "a radius in mm"));
    match (kind, members.get("radius_mm")) {
        (Some(JobKind::Solidify), None) if level.is_none() && !members.has("wall_mm") => {
            walker.fault(&place, code::MISSING_MEMBER, || {
                "solidify needs the member \"radius_mm\", the radius of the dilating ball in mm, or \"wall_mm\", the thickness of a wall along a closed surface, or for an ifs \"level\"".into()
            });
            return None;
        }
        (Some(kind @ (JobKind::Evaluate | JobKind::Convert)), Some(radius)) => {
            let word = if kind == JobKind::Evaluate { "evaluate" } else { "convert" };
            walker.fault(&radius, code::CONFLICTING_MEMBERS, || {
                format!("{word} dilates nothing and takes no \"radius_mm\"; remove it, or ask for the kind \"solidify\"")
            });
            return None;
        }
        _ => {}
    }
    let radius_mm = match radius {
        Some(radius) => Some(radius?),
        None => None,
    };
    let (operation, with) = operation(walker, &members, kind)?;
    let (plane, split) = cutting(walker, &members, kind, operation)?;
    let density = owned(walker, &members, kind, "density_g_cm3", (JobKind::Measure, "measure"))?;
    let density_g_cm3 = stated(density.map(|place| walker.positive(place, "a density in g/cm3")))?;
    let planes = planes(walker, &members, kind)?;
    let measured = (JobKind::Measure, "measure");
    let along = owned(walker, &members, kind, "direction", measured)?;
    let along = stated(along.map(|place| direction(walker, place, "the direction along which the shape is measured")))?;
    let oriented_box = flag_of(walker, &members, kind, "oriented_box", measured, false)?;
    let thickness = flag_of(walker, &members, kind, "thickness", measured, false)?;
    let normals = flag_of(walker, &members, kind, "normals", (JobKind::Evaluate, "evaluate"), false)?;
    let simplify = flag_of(walker, &members, kind, "simplify", (JobKind::Solidify, "solidify"), true)?;
    let stability = flag_of(walker, &members, kind, "stability", (JobKind::Solidify, "solidify"), false)?;
    let repair = repair(walker, &members, kind)?;
    let preview = preview(walker, &members, kind)?;
    let tolerance_mm = tolerance?;
    let closing_mm = closing(walker, &members, kind, stability)?;
    let wall = wall(walker, &members, kind)?;
    Some(Params {
        tolerance_mm,
        preview,
        level,
        repair,
        radius_mm,
        closing_mm,
        wall,
        operation,
        with,
        plane,
        split,
        planes,
        direction: along,
        oriented_box,
        thickness,
        density_g_cm3,
        normals,
        simplify,
        stability,
    })
}

/// Whether a preview is enough, of the shape itself or with its ball and nothing besides.
fn preview(walker: &mut Walker<'_>, members: &Members<'_>, kind: Option<JobKind>) -> Option<bool> {
    let Some(place) = members.get("preview") else { return Some(false) };
    if kind.is_some_and(|kind| !matches!(kind, JobKind::Evaluate | JobKind::Solidify)) {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || {
            "only evaluate and solidify have a preview; remove it, or ask for one of these kinds".into()
        });
        return None;
    }
    if let Some(name) = ["level", "closing_mm", "wall_mm", "stability"].into_iter().find(|name| members.has(name)) {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || {
            format!("a preview is of the shape with its ball and nothing besides; remove it, or \"{name}\"")
        });
        return None;
    }
    walker.flag(place)
}

/// Whether meshes are repaired, which an evaluation, taking a mesh as it is, does not.
fn repair(walker: &mut Walker<'_>, members: &Members<'_>, kind: Option<JobKind>) -> Option<bool> {
    let Some(place) = members.get("repair") else { return Some(false) };
    if kind == Some(JobKind::Evaluate) {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || {
            "evaluate takes meshes as they are and no \"repair\"; remove it, or ask for the kind \"convert\"".into()
        });
        return None;
    }
    walker.flag(place)
}

/// The width of gaps that are filled, which a dilation alone takes, and not together with an examination of its topology.
#[allow(clippy::option_option)]
fn closing(walker: &mut Walker<'_>, members: &Members<'_>, kind: Option<JobKind>, stability: bool) -> Option<Option<f64>> {
    let Some(place) = owned(walker, members, kind, "closing_mm", (JobKind::Solidify, "solidify"))? else { return Some(None) };
    let width = walker.positive(place, "the width of a gap in mm")?;
    let conflict = match (members.has("radius_mm"), stability) {
        (false, _) => "\"closing_mm\" fills gaps of a dilated shape; add \"radius_mm\"",
        (true, true) => "\"stability\" is of the dilation, which \"closing_mm\" changes; remove one of the two",
        (true, false) => return Some(Some(width)),
    };
    walker.fault(&place, code::CONFLICTING_MEMBERS, || conflict.into());
    None
}

/// The wall, which solidify alone takes.
#[allow(clippy::option_option)]
fn wall(walker: &mut Walker<'_>, members: &Members<'_>, kind: Option<JobKind>) -> Option<Option<WallOrder>> {
    let owner = (JobKind::Solidify, "solidify");
    let (thickness, side) = (owned(walker, members, kind, "wall_mm", owner)?, owned(walker, members, kind, "side", owner)?);
    match (thickness, side) {
        (None, None) => Some(None),
        (None, Some(side)) => {
            walker.fault(&side, code::CONFLICTING_MEMBERS, || "only a wall has a side; add \"wall_mm\"".into());
            None
        }
        (Some(thickness), side) => {
            let thickness = walker.positive(thickness, "a thickness in mm");
            let side = side.map_or(Some(WallSide::Inward), |place| walker.word(place, "a side", &WALL_SIDES));
            Some(Some(WallOrder { thickness_mm: thickness?, side: side? }))
        }
    }
}

/// The level, which stands instead of what a dilation takes.
#[allow(clippy::option_option)]
fn level(walker: &mut Walker<'_>, members: &Members<'_>, kind: Option<JobKind>) -> Option<Option<u32>> {
    let Some(place) = owned(walker, members, kind, "level", (JobKind::Solidify, "solidify"))? else { return Some(None) };
    let mut legal = true;
    for name in ["radius_mm", "closing_mm", "wall_mm", "side", "simplify", "stability"] {
        if let Some(conflict) = members.get(name) {
            walker.fault(&conflict, code::CONFLICTING_MEMBERS, || {
                format!("a level joins copies and dilates nothing: \"{name}\" does not go with \"level\"; keep one of them")
            });
            legal = false;
        }
    }
    let number = walker.integer(place, "the level of copies")?;
    if number > MOST_LEVEL {
        walker.fault(&place, code::INDEX_OUT_OF_RANGE, || format!("is {number}; expected {MOST_LEVEL} at most"));
        return None;
    }
    legal.then_some(Some(number as u32))
}

/// The plane of a trim, and how a split is made: each operation takes its own, and no other takes any.
#[allow(clippy::type_complexity)]
fn cutting(
    walker: &mut Walker<'_>,
    members: &Members<'_>,
    kind: Option<JobKind>,
    operation: Option<Operation>,
) -> Option<(Option<CutPlane>, Option<Split>)> {
    let mut legal = true;
    for (name, owner, word) in [
        ("plane", Operation::Trim, "trim"),
        ("volume_mm", Operation::Split, "split"),
        ("cuts_mm", Operation::Split, "split"),
        ("key_mm", Operation::Split, "split"),
        ("clearance_mm", Operation::Split, "split"),
    ] {
        let Some(place) = owned(walker, members, kind, name, (JobKind::Intersect, "intersect")) else {
            legal = false;
            continue;
        };
        if let Some(place) = place.filter(|_| operation != Some(owner)) {
            walker.fault(&place, code::CONFLICTING_MEMBERS, || {
                format!("only the operation \"{word}\" takes \"{name}\"; remove it, or ask for that operation")
            });
            legal = false;
        }
    }
    if !legal {
        return None;
    }
    match operation {
        Some(Operation::Trim) => Some((Some(cut_plane(walker, members)?), None)),
        Some(Operation::Split) => Some((None, Some(split(walker, members)?))),
        _ => Some((None, None)),
    }
}

fn cut_plane(walker: &mut Walker<'_>, members: &Members<'_>) -> Option<CutPlane> {
    let Some(place) = members.get("plane") else {
        walker.fault(&members.place, code::MISSING_MEMBER, || "trim needs the member \"plane\": a normal and an offset in mm".into());
        return None;
    };
    let [x, y, z, offset_mm] = walker.numbers(place, "the three numbers of a normal, and an offset in mm")?;
    let normal = DVec3::new(x, y, z);
    if normal == DVec3::ZERO {
        walker.fault(&place, code::NOT_POSITIVE, || "has a normal without length; expected the direction of what is taken away".into());
        return None;
    }
    Some(CutPlane { normal, offset_mm })
}

fn split(walker: &mut Walker<'_>, members: &Members<'_>) -> Option<Split> {
    if !members.has("volume_mm") && !members.has("cuts_mm") {
        walker.fault(&members.place, code::MISSING_MEMBER, || {
            "split needs the member \"volume_mm\", the size that every part fits, or \"cuts_mm\", where to cut across x, y and z".into()
        });
        return None;
    }
    let volume = members.get("volume_mm").map(|place| {
        let volume: [f64; 3] = walker.numbers(place, "three lengths in mm")?;
        if volume.iter().any(|length| *length <= 0.0) {
            walker.fault(&place, code::NOT_POSITIVE, || "has a length that is not above zero; expected a build volume in mm".into());
            return None;
        }
        Some(volume)
    });
    let cuts = members.get("cuts_mm").map_or(Some(Default::default()), |place| {
        const EXPECTED: &str = "three arrays of offsets in mm: across x, y and z";
        let arrays = walker
            .each(place, EXPECTED, |walker, place| walker.each(place, "an array of offsets in mm", |walker, place| walker.number(place)))?;
        let found = arrays.len();
        <[Vec<f64>; 3]>::try_from(arrays).ok().or_else(|| walker.wrong_length(&place, found, EXPECTED))
    });
    let key = match (members.get("key_mm"), members.get("clearance_mm")) {
        (None, None) => Some(None),
        (Some(width), Some(clearance)) => {
            let width_mm = walker.positive(width, "the width of a key in mm");
            let clearance_mm = walker.number(clearance).filter(|x| *x >= 0.0).or_else(|| {
                walker.fault(&clearance, code::NOT_POSITIVE, || "is no clearance; expected a length in mm, or 0".into());
                None
            });
            Some(Some(SplitKey { width_mm: width_mm?, clearance_mm: clearance_mm? }))
        }
        (Some(place), None) | (None, Some(place)) => {
            walker.fault(&place, code::MISSING_MEMBER, || "keys need both \"key_mm\", their width, and \"clearance_mm\"".into());
            None
        }
    };
    Some(Split { volume_mm: stated(volume)?, cuts_mm: cuts?, key: key? })
}

/// The operation, and what a shape is held against, which intersect alone takes, and of which one rules out the other.
#[allow(clippy::type_complexity)]
fn operation(walker: &mut Walker<'_>, members: &Members<'_>, kind: Option<JobKind>) -> Option<(Option<Operation>, Option<With>)> {
    let owner = (JobKind::Intersect, "intersect");
    let places = [owned(walker, members, kind, "operation", owner), owned(walker, members, kind, "with", owner)];
    let mut legal = places.iter().all(Option::is_some);
    if let [Some(Some(_)), Some(Some(place))] = places {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || {
            "an operation combines inputs, and takes no \"with\"; remove one of the two".into()
        });
        legal = false;
    }
    let operation = members.get("operation").map(|place| walker.word(place, "an operation", &OPERATIONS));
    let against = members.get("with").map(|place| with(walker, place));
    let (operation, against) = (stated(operation)?, stated(against)?);
    legal.then_some((operation, against))
}

/// The planes, which slice needs and no other kind takes.
#[allow(clippy::option_option)]
fn planes(walker: &mut Walker<'_>, members: &Members<'_>, kind: Option<JobKind>) -> Option<Option<Planes>> {
    let mut legal = true;
    for name in ["normal", "offsets_mm", "step_mm"] {
        legal &= owned(walker, members, kind, name, (JobKind::Slice, "slice")).is_some();
    }
    if kind != Some(JobKind::Slice) {
        return legal.then_some(None);
    }
    let normal = members.get("normal").map_or(Some(DVec3::Z), |place| direction(walker, place, "the direction across the planes"));
    one_of(walker, members, &["offsets_mm", "step_mm"], "slice")?;
    let offsets = members
        .get("offsets_mm")
        .map_or(Some(Vec::new()), |place| walker.each_of(place, 1, "an array of offsets in mm", |walker, place| walker.number(place)));
    let step = members.get("step_mm").map(|place| walker.positive(place, "the height of a layer in mm"));
    Some(Some(Planes { normal: normal?, offsets_mm: offsets?, step_mm: stated(step)? }))
}

/// A vector that has a direction.
fn direction(walker: &mut Walker<'_>, place: Place<'_>, expected: &str) -> Option<DVec3> {
    let vector = DVec3::from_array(walker.numbers(place, "a vector of three numbers")?);
    if vector == DVec3::ZERO {
        walker.fault(&place, code::NOT_POSITIVE, || format!("has no length; expected {expected}"));
        return None;
    }
    Some(vector)
}

/// A flag that one kind of job takes, what that kind is called, and what the flag is when absent.
fn flag_of(
    walker: &mut Walker<'_>,
    members: &Members<'_>,
    kind: Option<JobKind>,
    name: &str,
    (owner, word): (JobKind, &str),
    absent: bool,
) -> Option<bool> {
    owned(walker, members, kind, name, (owner, word))?.map_or(Some(absent), |place| walker.flag(place))
}

/// The place of a member that one kind of job takes, and what that kind is called: absent is legal, and so is every member while the kind is not known.
#[allow(clippy::option_option)]
fn owned<'m>(
    walker: &mut Walker<'_>,
    members: &'m Members<'_>,
    kind: Option<JobKind>,
    name: &str,
    (owner, word): (JobKind, &str),
) -> Option<Option<Place<'m>>> {
    let Some(place) = members.get(name) else { return Some(None) };
    if kind.is_some_and(|kind| kind != owner) {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || {
            format!("only {word} takes \"{name}\"; remove it, or ask for the kind \"{word}\"")
        });
        return None;
    }
    Some(Some(place))
}

fn outputs(walker: &mut Walker<'_>, place: Place<'_>, kind: Option<JobKind>) -> Option<Vec<String>> {
    let formats = FORMATS.map(|format| (format.ending, format.ending));
    let mut seen: Vec<&str> = Vec::new();
    let outputs = walker.each(place, "an array of names of formats", |walker, place| {
        let name = walker.word(place, "a format", &formats)?;
        if seen.contains(&name) {
            walker.fault(&place, code::REPEATED_ELEMENT, || format!("\"{name}\" is asked for twice; ask for it once"));
            return None;
        }
        seen.push(name);
        Some(name.to_owned())
    })?;
    if kind == Some(JobKind::Measure) && outputs.iter().any(|name| name != Format::Ply.facts().ending) {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || MEASURED.into());
        return None;
    }
    for (index, name) in outputs.iter().enumerate() {
        let drawing = Format::from_name(name).is_some_and(Format::is_drawing);
        if kind.is_some_and(|kind| (kind == JobKind::Slice) != drawing) {
            let wanted =
                FORMATS.iter().map(|row| row.format).filter(|format| format.is_drawing() != drawing).map(|format| format.facts().ending);
            let wanted = wanted.collect::<Vec<_>>().join(", ");
            walker.fault(&place, code::CONFLICTING_MEMBERS, || {
                format!("output {index} is \"{name}\"; this kind of job is written as {wanted}")
            });
            return None;
        }
    }
    Some(outputs)
}

fn limits(walker: &mut Walker<'_>, place: Place<'_>) -> Option<RequestedLimits> {
    let members = walker.object(place, &JOB_LIMITS)?;
    let seconds = members.get("seconds").map(|place| walker.positive(place, "a time in seconds"));
    let mut count = |name: &str, most: u64| {
        let place = members.get(name)?;
        let number = walker.positive(place, "a limit").and_then(|_| walker.integer(place, "a limit"));
        Some(number.and_then(|number| {
            if number <= most {
                return Some(number);
            }
            walker.fault(&place, code::INDEX_OUT_OF_RANGE, || format!("is {number}; expected {most} at most"));
            None
        }))
    };
    let memory_bytes = count("memory_bytes", u64::MAX);
    let cells = count("cells", u64::MAX);
    let triangles = count("triangles", u64::MAX);
    let depth = count("depth", u64::from(u32::MAX));
    let output_bytes = count("output_bytes", u64::MAX);
    // why: the outer option says whether the member is there, the inner whether it is legal
    Some(RequestedLimits {
        seconds: stated(seconds)?,
        memory_bytes: stated(memory_bytes)?,
        cells: stated(cells)?,
        triangles: stated(triangles)?,
        depth: stated(depth)?.and_then(|depth| u32::try_from(depth).ok()),
        output_bytes: stated(output_bytes)?,
    })
}

/// Absent is legal, wrong is not.
#[allow(clippy::option_option)]
fn stated<T>(member: Option<Option<T>>) -> Option<Option<T>> {
    match member {
        None => Some(None),
        Some(value) => value.map(Some),
    }
}

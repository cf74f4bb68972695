//! `lacuna convert`: a mesh file in other formats.

use std::io::{BufWriter, Write};
use std::path::Path;

use lacuna_exchange::format::{self, Format, Geometry, MeshFile, Metadata};

use lacuna_fabrication::{JobError, repaired_mesh};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::model::{Interior, PolygonMesh};

use super::args::ConvertArgs;
use super::inspect::mesh_file;
use super::output::{check_distinct, finish, start, targets};
use crate::inspection;
use crate::problem::{Problem, ProblemKind};
use crate::production::{format_problem, guarded};

/// Faces without an inside are listed up to this number.
const MOST_FINDINGS: usize = 20;

/// Reads a mesh and writes it, repaired only if that is asked for. All files are written before the first one takes its place.
pub(super) fn convert(args: &ConvertArgs) -> Result<(), Problem> {
    let targets = targets(&args.outputs, args.format.as_deref())?;
    check_distinct(targets.iter().map(|target| target.path.as_path()))?;
    let (mut file, _) = mesh_file(&args.file)?;
    for (word, count) in &file.facts.left_out {
        // With stderr gone there is nobody left to tell.
        let _ = writeln!(std::io::stderr(), "warning: {count} shapes of the kind {word} hold no polygons and were left out");
    }
    let title = title(&args.file, &file.facts.object_names);
    if args.repair {
        repair(&mut file, &title)?;
    }
    filled(&file)?;
    let closed = inspection::topology(&file)?.is_closed_manifold();
    let mut pending = Vec::with_capacity(targets.len());
    for target in &targets {
        let mut part = start(&target.path)?;
        write(target.format, &file, &title, closed, &mut part)?;
        pending.push((part, &target.path));
    }
    pending.into_iter().try_for_each(|(part, path)| finish(part, path))
}

/// Refuses polygons that no triangles fill: whoever reads them would have to guess.
fn filled(file: &MeshFile) -> Result<(), Problem> {
    let mut findings = inspection::unfilled(file);
    if findings.is_empty() {
        return Ok(());
    }
    findings.truncate(MOST_FINDINGS);
    Err(Problem::new(ProblemKind::InvalidFile, findings[0].message.clone()).code(findings[0].code.clone()).errors(findings))
}

/// Makes the mesh a solid and says what was done to it.
fn repair(file: &mut MeshFile, title: &str) -> Result<(), Problem> {
    let mesh = PolygonMesh { vertices: file.mesh.vertices.clone(), faces: file.faces(), interior: Interior::Auto };
    let (made, statement) = guarded(|| repaired_mesh(title, &mesh, &Budget::default()))??;
    if let Some(PolygonMesh { vertices, faces, .. }) = made {
        let cut = PolygonMesh { vertices, faces, interior: Interior::Auto }.cut().map_err(JobError::model)?;
        (file.mesh, file.polygons) = (cut.mesh, cut.polygons);
    }
    for warning in statement.warnings() {
        let _ = writeln!(std::io::stderr(), "warning: {warning}");
    }
    Ok(())
}

/// What a mesh is called: as its first object, else as its file.
pub(super) fn title(path: &Path, objects: &[String]) -> String {
    let stem = path.file_stem().filter(|_| path != Path::new("-")).map(|stem| stem.to_string_lossy().into_owned());
    objects.first().cloned().or(stem).unwrap_or_else(|| "mesh".to_owned())
}

fn write(format: Format, file: &MeshFile, title: &str, closed: bool, part: &mut crate::files::PendingFile) -> Result<(), Problem> {
    let metadata = Metadata { title: Some(title), ..Metadata::default() };
    let mut sink = BufWriter::with_capacity(1 << 16, part);
    let wires = file.wires();
    let geometry = match &wires {
        Some(wires) => Geometry::from(wires),
        None => Geometry::Polygons { mesh: &file.mesh, polygons: &file.polygons, closed },
    };
    let written = guarded(|| format::write(format, geometry, &metadata, &mut sink))?;
    written.map_err(|error| match error {
        // The file is at fault, not a model.
        format::FormatError::CannotCarry { .. } => Problem { kind: ProblemKind::InvalidFile, ..format_problem(&error) },
        error => format_problem(&error),
    })?;
    sink.flush().map_err(|error| Problem::io("the file could not be written", &error))
}

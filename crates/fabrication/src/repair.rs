//! Mesh inputs made solids where the job asks for it, before anything else looks at them.

use std::borrow::Cow;

use lacuna_kernel::budget::Budget;
use lacuna_kernel::error::Kind;
use lacuna_kernel::model::{Interior, PolygonMesh, Shape};
use lacuna_kernel::solid::{Repair, RepairError, Repaired, repair};

use crate::run::JobError;
use crate::{Certificate, Job};

/// What a repair did to an input that is a mesh. No point of the surface was moved. All counts but that of the crossings are 0 where the mesh
/// was left as it is.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct RepairStatement {
    /// Name of the input.
    pub input: String,
    /// Whether anything was done; if not, the mesh is used as it came.
    pub changed: bool,
    /// Vertices that became one with another at the same place.
    pub joined_vertices: u64,
    /// Triangles without area that were taken away; those across their longest edge were cut where that was needed.
    pub removed_flat_triangles: u64,
    /// Triangles with the corners of another that were taken away, and walls between pieces that fill the space on both sides.
    pub removed_copies: u64,
    /// Holes that were closed by triangles between their corners, of at most 64 edges each and a quarter of the surface's area together.
    pub closed_holes: u64,
    /// Triangles that close them. None meets another one elsewhere than in common corners and edges.
    pub closing_triangles: u64,
    /// Edges around the longest of these holes.
    pub longest_hole_edges: u64,
    /// Edges of four triangles or more, around which those were joined that bound the same wedge of material.
    pub parted_edges: u64,
    /// Vertices that were doubled, so that parts that meet there only are not joined.
    pub doubled_vertices: u64,
    /// Triangles that were turned so that the material is behind them: a shell within another is a void.
    pub turned_triangles: u64,
    /// Shells within others whose triangles looked outward for the most part, and which were taken as voids. Where such a shell is material, take the union of
    /// both: a job of kind `intersect` with `"operation": "union"`, each shell an input of its own.
    pub shells_made_voids: u64,
    /// Pairs of triangles that meet elsewhere than in common corners and edges. No repair changes them.
    pub crossings: u64,
}

impl RepairStatement {
    fn of(input: &str, repair: &Repair) -> Self {
        Self {
            input: input.to_owned(),
            changed: repair.is_change(),
            joined_vertices: repair.joined_vertices,
            removed_flat_triangles: repair.flat_triangles,
            removed_copies: repair.copied_triangles,
            closed_holes: repair.filled_holes,
            closing_triangles: repair.filling_triangles,
            longest_hole_edges: repair.longest_hole_edges,
            parted_edges: repair.parted_edges,
            doubled_vertices: repair.doubled_vertices,
            turned_triangles: repair.turned_triangles,
            shells_made_voids: repair.shells_made_voids,
            crossings: repair.crossings,
        }
    }

    /// What the user should know, in words: nothing where nothing was done.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let done = [
            (self.joined_vertices, "vertices joined"),
            (self.removed_flat_triangles, "triangles without area removed"),
            (self.removed_copies, "copies of triangles removed"),
            (self.closed_holes, "holes closed"),
            (self.closing_triangles, "triangles added to close them"),
            (self.parted_edges, "edges of more than two triangles parted"),
            (self.doubled_vertices, "vertices doubled"),
            (self.turned_triangles, "triangles turned"),
        ];
        let done: Vec<String> = done.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
        let mut warnings = Vec::new();
        if self.changed {
            warnings.push(format!("input '{}' was repaired: {}", self.input, done.join(", ")));
        }
        if self.shells_made_voids > 0 {
            warnings.push(format!(
                "{} shells of input '{}' lie within others and looked outward: the repair took them as voids; where they are material, give each shell as an input of its own to a job of kind intersect with \"operation\": \"union\"",
                self.shells_made_voids, self.input
            ));
        }
        if self.crossings > 0 {
            warnings.push(format!(
                "{} pairs of triangles of input '{}' cross or touch where they are not joined, which no repair changes; its shells are taken as they run",
                self.crossings, self.input
            ));
        }
        warnings
    }
}

impl Certificate {
    /// Says what was repaired before the work began.
    pub(crate) fn state_repairs(&mut self, statements: Vec<RepairStatement>) {
        let told = statements.iter().flat_map(RepairStatement::warnings);
        self.warnings = told.chain(std::mem::take(&mut self.warnings)).collect();
        self.repair = statements;
    }
}

/// Repairs a mesh: triangles in its place, or `None` where it is a solid and stays as it is, polygons and all.
///
/// # Errors
/// What keeps it from being repaired, with the place and the way out.
pub fn repaired_mesh(name: &str, mesh: &PolygonMesh, budget: &Budget) -> Result<(Option<PolygonMesh>, RepairStatement), JobError> {
    if mesh.interior == Interior::Surface {
        let message = format!("a repair makes a solid, and input '{name}' says \"interior\": \"surface\"; leave out one of the two");
        return Err(JobError::new(Kind::Invalid, "repair.surface", message));
    }
    let triangles = mesh.cut().map_err(JobError::model)?.mesh;
    let Repaired { solid, repair } = repair(&triangles, budget).map_err(|error| match error {
        RepairError::Stopped(stopped) => stopped.into(),
        other => {
            let way_out = "mend it where it was made, or leave out the repair and give a radius_mm, and its surface is dilated";
            JobError::new(Kind::Invalid, other.code(), format!("input '{name}' cannot be repaired: {other}; {way_out}"))
        }
    })?;
    let mesh = solid.map(|solid| {
        let made = solid.into_mesh();
        let faces = made.triangles.iter().map(|corners| corners.to_vec()).collect();
        PolygonMesh { vertices: made.vertices, faces, interior: mesh.interior }
    });
    Ok((mesh, RepairStatement::of(name, &repair)))
}

/// The job with its meshes repaired, and what was done to each; the job itself where it asks for no repair.
pub(crate) fn repaired<'a>(job: &'a Job, budget: &Budget) -> Result<(Cow<'a, Job>, Vec<RepairStatement>), JobError> {
    let (mut result, mut statements) = (Cow::Borrowed(job), Vec::new());
    if !job.params.repair {
        return Ok((result, statements));
    }
    for (index, input) in job.inputs.iter().enumerate() {
        let Shape::Mesh(mesh) = &input.model.shape else { continue };
        let (made, statement) = repaired_mesh(&input.name, mesh, budget).map_err(|error| JobError { input: Some(index), ..error })?;
        statements.push(statement);
        if let Some(made) = made {
            result.to_mut().inputs[index].model.shape = Shape::Mesh(made);
        }
    }
    if statements.is_empty() {
        let message = "a repair is of meshes, and no input is one; leave it out";
        return Err(JobError::new(Kind::Invalid, "repair.no-mesh", message.into()));
    }
    Ok((result, statements))
}

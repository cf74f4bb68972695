//! A solid split into parts that fit a build volume, along planes across the axes, with keys that put the parts together again.
//!
//! The parts are what lies between the planes. A key is a peg of one part in a socket of the next: a tapered pentagon without symmetry, so that it goes in one
//! way. It stands where the section of the solid is wide enough, and only where a body around the socket lies in the one part and one below the peg in
//! the other; so pegs and sockets are whole, and the volumes of the parts add up to that of the solid, plus pegs, less sockets.

mod cuts;
mod key;

use glam::DVec3;
use lacuna_boolean::{BooleanEngine, ManifoldRust};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::measure::mass::volume;
use lacuna_kernel::measure::section::{PlaneFrame, Section, SectionError, sections};
use lacuna_kernel::solid::{Rounded, Solid, TriMesh, carried};
use lacuna_kernel::tolerance::Tolerance;

use crate::job::Split;
use crate::operand::{Source, at_fault, operand, rounded, share};
use crate::run::{JobError, Outcome};
use crate::{Geometry, Job, Part, certificate};
use cuts::Cuts;
use key::Key;

/// A part of a solid that was split.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct PartStatement {
    /// Its name in the files: its place along x, y and z, from 1.
    pub name: String,
    /// Lower and upper corner of its box where it lies in the files, pegs included.
    pub bbox_mm: [[f64; 3]; 2],
    /// How far it was moved from where it belongs.
    pub moved_mm: [f64; 3],
    /// Volume that its mesh encloses.
    pub mesh_volume_mm3: f64,
    /// Its triangles.
    pub triangles: u64,
    /// Its pieces.
    pub components: u64,
    /// Its pegs.
    pub pegs: u64,
    /// Its sockets.
    pub sockets: u64,
}

/// A solid in parts. Counts beside it are those of all parts together; its bounds are those of the solid before it was split, and hold for the parts but for
/// pegs and sockets.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct SplitStatement {
    /// Where planes across x, y and z cut.
    pub cuts_mm: [Vec<f64>; 3],
    /// The build volume, if the parts had to fit one.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub volume_mm: Option<[f64; 3]>,
    /// Volume that the mesh of the whole solid enclosed.
    pub whole_volume_mm3: f64,
    /// Keys that were placed, each a peg and a socket.
    pub keys: u64,
    /// Volume of one peg beyond its part.
    pub peg_volume_mm3: f64,
    /// Volume of one socket.
    pub socket_volume_mm3: f64,
    /// The parts.
    pub parts: Vec<PartStatement>,
}

/// What lies between planes.
struct Cell {
    index: [usize; 3],
    mesh: TriMesh,
    pegs: u64,
    sockets: u64,
}

/// Does a job of kind `intersect` with the operation `split`.
pub(crate) fn split(job: &Job, split: &Split, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let source = Source::only(job, budget)?;
    let mut operand = operand(&source, share(std::slice::from_ref(&source), tolerance)?, budget)?;
    budget.prove(operand.statement.inner_bound_mm.max(operand.statement.outer_bound_mm));
    operand.join(budget)?;
    let whole = operand.meshes.pop().unwrap_or_default();
    let key = split.key.map(|key| Key::new(key.width_mm, key.clearance_mm));
    let ends = ends(&whole);
    // Parts are apart by twice the pegs, or by a twentieth of the largest side: no two touch in a file.
    let gap = key.as_ref().map_or(0.05 * (ends[1] - ends[0]).max_element(), |key| 2.0 * key.length);
    let gap = f64::from(gap as f32);
    let cuts = Cuts::new(split, ends, key.as_ref().map_or(0.0, |key| key.length), gap)?;
    let whole_volume_mm3 = volume(&whole);
    let mut cells = divide(whole, &cuts, budget)?;
    let (mut keys, mut warnings) = (0, operand.warnings.clone());
    warnings.extend_from_slice(&cuts.warnings);
    if let Some(key) = &key {
        (keys, warnings) = connect(&mut cells, &cuts, key, warnings, budget)?;
    }
    let (mut parts, mut statements) = (Vec::with_capacity(cells.len()), Vec::with_capacity(cells.len()));
    let (mut crossings, mut moved_mm) = (0, 0.0_f64);
    for cell in cells {
        let moved = DVec3::from_array(cell.index.map(|index| index as f64 * gap));
        let mesh = TriMesh { vertices: cell.mesh.vertices.iter().map(|&vertex| vertex + moved).collect(), triangles: cell.mesh.triangles };
        let Rounded { solid, crossings: own, moved_mm: rounding } = rounded(&mesh, budget)?;
        crossings += own;
        moved_mm = moved_mm.max(rounding);
        let name = format!("part-{}-{}-{}", cell.index[0] + 1, cell.index[1] + 1, cell.index[2] + 1);
        let [low, high] = self::ends(solid.mesh());
        if let Some(fits) = split.volume_mm.filter(|fits| (0..3).any(|axis| high[axis] - low[axis] > fits[axis])) {
            return Err(too_large(&name, high - low, fits));
        }
        let topology = solid.topology();
        if topology.components > 1 {
            warnings.push(format!("{name} is in {} pieces", topology.components));
        }
        statements.push(PartStatement {
            name: name.clone(),
            bbox_mm: [low.to_array(), high.to_array()],
            moved_mm: moved.to_array(),
            mesh_volume_mm3: volume(solid.mesh()),
            triangles: topology.triangles,
            components: topology.components,
            pegs: cell.pegs,
            sockets: cell.sockets,
        });
        parts.push(Part { name, solid });
    }
    let statement = SplitStatement {
        cuts_mm: cuts.offsets,
        volume_mm: split.volume_mm,
        whole_volume_mm3,
        keys,
        peg_volume_mm3: key.as_ref().map_or(0.0, Key::peg_volume),
        socket_volume_mm3: key.as_ref().map_or(0.0, Key::socket_volume),
        parts: statements,
    };
    operand.warnings = warnings;
    let certificate = certificate::of_split(&parts, crossings, moved_mm, &operand, statement, tolerance, budget)?;
    Ok(Outcome { geometry: Geometry::Parts(parts), certificate })
}

/// Least and greatest coordinates.
fn ends(mesh: &TriMesh) -> [DVec3; 2] {
    let low = mesh.vertices.iter().copied().reduce(DVec3::min).unwrap_or_default();
    [low, mesh.vertices.iter().copied().reduce(DVec3::max).unwrap_or_default()]
}

fn too_large(name: &str, size: DVec3, fits: [f64; 3]) -> JobError {
    let axis = (0..3).find(|&axis| size[axis] > fits[axis]).unwrap_or(0);
    let message = format!(
        "{name} is {} mm along {}, and {} fit; let the job choose the cuts there, or put them closer",
        size[axis],
        ["x", "y", "z"][axis],
        fits[axis]
    );
    let limit = LimitFacts { limit: "volume_mm", asked: size[axis], allowed: fits[axis], remedy: None };
    JobError { limit: Some(limit), ..JobError::new(Kind::Unreachable, "split.too-large", message) }
}

fn failed(error: lacuna_boolean::BooleanError) -> JobError {
    at_fault(error, |_| "part")
}

/// Cuts the solid along all planes; cells that hold nothing are left out.
fn divide(whole: TriMesh, cuts: &Cuts, budget: &Budget) -> Result<Vec<Cell>, JobError> {
    let mut cells = vec![Cell { index: [0; 3], mesh: whole, pegs: 0, sockets: 0 }];
    for axis in 0..3 {
        let mut divided = Vec::new();
        for mut cell in cells {
            for (place, &offset) in cuts.offsets[axis].iter().enumerate() {
                let [behind, beyond] = ManifoldRust.cut(&cell.mesh, DVec3::AXES[axis], offset, &budget.cancel).map_err(failed)?;
                let mut index = cell.index;
                index[axis] = place;
                divided.push(Cell { index, mesh: behind, pegs: 0, sockets: 0 });
                cell.index[axis] = place + 1;
                cell.mesh = beyond;
            }
            divided.push(cell);
        }
        cells = divided;
        cells.retain(|cell| !cell.mesh.triangles.is_empty());
        budget.report("combine", (axis + 1) as f64 / 6.0, cells.len() as u64);
    }
    Ok(cells)
}

/// Puts keys between all neighbours: how many there are, and what is to be said.
fn connect(cells: &mut [Cell], cuts: &Cuts, key: &Key, mut warnings: Vec<String>, budget: &Budget) -> Result<(u64, Vec<String>), JobError> {
    let mut keys = 0;
    for axis in 0..3 {
        let frame = PlaneFrame::new(DVec3::AXES[axis]).map_err(|error| JobError::new(Kind::Defect, "internal", error.to_string()))?;
        for (place, &offset) in cuts.offsets[axis].iter().enumerate() {
            for upper in 0..cells.len() {
                if cells[upper].index[axis] != place + 1 {
                    continue;
                }
                let mut below = cells[upper].index;
                below[axis] = place;
                let Some(lower) = cells.iter().position(|cell| cell.index == below) else { continue };
                let placed = join(cells, [lower, upper], &frame, offset, key, budget)?;
                keys += placed.keys;
                if placed.bare > 0 {
                    let (at, width) = (format!("across {} at {offset} mm", ["x", "y", "z"][axis]), key.width);
                    // The next cut is nearer than the end of the part.
                    let room = cuts.offsets[axis].get(place + 1).map_or(f64::INFINITY, |next| next - offset);
                    warnings.push(if room < key.depth() {
                        format!(
                            "the next cut is {room} mm beyond the one {at}, and a key of {width} mm takes {} mm there with its walls: nothing holds the parts there; take smaller keys or longer parts",
                            key.depth()
                        )
                    } else {
                        format!(
                            "{} of {} faces {at} are too small for a key of {width} mm with its walls: nothing holds the parts there",
                            placed.bare, placed.faces
                        )
                    });
                }
            }
        }
    }
    Ok((keys, warnings))
}

/// What was placed between two parts.
#[derive(Default)]
struct Placed {
    keys: u64,
    /// Connected faces that the parts have in common, as the upper one has them.
    faces: u64,
    /// Those without a key.
    bare: u64,
}

/// Keys of one face: two hold it against turning as a whole.
const MOST_KEYS: usize = 2;
/// Places that are tried in one face.
const MOST_TRIED: usize = 8;

/// Puts keys between two neighbours, the lower one's pegs in the upper one's sockets.
fn join(
    cells: &mut [Cell],
    [lower, upper]: [usize; 2],
    frame: &PlaneFrame,
    offset: f64,
    key: &Key,
    budget: &Budget,
) -> Result<Placed, JobError> {
    let mut placed = Placed::default();
    let mut face = Section::default();
    let solid =
        Solid::new(cells[upper].mesh.clone(), budget).map_err(|error| JobError::new(Kind::Defect, "internal", error.to_string()))?;
    sections::<SectionError>(&solid, frame, &[offset], budget, &mut |section| {
        face = section;
        Ok(())
    })?;
    for polygon in &face.polygons {
        budget.cancel.check()?;
        placed.faces += 1;
        let mut here = 0;
        for centre in key.places(polygon, budget)?.into_iter().take(MOST_TRIED) {
            let at = |mesh: TriMesh| Key::placed(mesh, frame, centre, offset);
            let within = |body: TriMesh, mesh: &TriMesh| -> Result<bool, JobError> {
                let left = ManifoldRust.difference(&body, &[mesh], &budget.cancel).map_err(failed)?;
                Ok(left.triangles.is_empty())
            };
            if !within(at(key.around_socket()), &cells[upper].mesh)? || !within(at(key.below_peg()), &cells[lower].mesh)? {
                continue;
            }
            cells[upper].mesh = ManifoldRust.difference(&cells[upper].mesh, &[&at(key.socket())], &budget.cancel).map_err(failed)?;
            cells[lower].mesh = ManifoldRust.union(&[&cells[lower].mesh, &at(key.peg())], &budget.cancel).map_err(failed)?;
            cells[upper].sockets += 1;
            cells[lower].pegs += 1;
            here += 1;
            if here == MOST_KEYS {
                break;
            }
        }
        placed.keys += here as u64;
        placed.bare += u64::from(here == 0);
    }
    Ok(placed)
}

/// What rounding takes from a build volume on both sides.
fn margin(ends: [DVec3; 2]) -> f64 {
    4.0 * carried(ends[0].abs().max(ends[1].abs()).max_element() * 2.0)
}

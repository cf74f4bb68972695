//! Measures of one shape, or of its dilation.

use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::dilation::dilate_unsimplified;
use lacuna_kernel::error::Kind;
use lacuna_kernel::measure::mass::{area_within, dilated_difference, isoperimetric, mesh_of, volume_within};
use lacuna_kernel::measure::{AxisBox, Dimension, Interval, Overlaps, bounding_box, dimension};
use lacuna_kernel::solid::{Crossings, TriMesh};
use lacuna_kernel::tolerance::{Radius, Tolerance};

use crate::certificate::DimensionStatement;
use crate::operand::{is_solid, miscounted};
use crate::run::{Geometry, JobError, Outcome, lower, radius};
use crate::shape_measures::{extent, no_solid, smallest_box, walls_and_gaps};
use crate::{Certificate, Job, certificate};

/// Shapes are measured up to this coordinate, and from the inverse of it on: moments of inertia grow with its fifth power.
const LARGEST_MM: f64 = 1e50;

/// Does a job of kind `measure` of one input.
pub(crate) fn measure(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let radius = radius(job)?;
    let attractor = &lower(job, budget)?.attractor;
    match radius {
        Some(radius) => of_dilation(job, attractor, radius, tolerance, budget),
        None => of_shape(job, attractor, tolerance, budget),
    }
}

fn of_shape(job: &Job, attractor: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let (mut geometry, density) = (Geometry::None, job.params.density_g_cm3);
    let bounds = measurable_box(attractor, budget)?;
    let mut certificate = certificate::of_shape(attractor, &bounds, tolerance);
    budget.prove(certificate.achieved_bound_mm);
    let mut known = dimension(attractor, budget)?;
    certificate.state_meshes(attractor, &bounds, density, budget)?;
    certificate.state_surface_area(attractor, budget)?;
    certificate.state_enclosed(attractor, &bounds, tolerance, density, budget)?;
    if certificate.enclosed.as_ref().is_some_and(|found| found.volume_mm3[0] > 0.0 || found.volume_mm3[1] < 0.0) {
        known = known.parting_space();
    }
    certificate.dimension = Some(DimensionStatement::of(known));
    if density.is_some() && certificate.mass_g.is_none() {
        let reason = match certificate.volume_mm3 {
            Some(_) => "the shape has no volume",
            None => "no volume of the shape is known",
        };
        certificate
            .warnings
            .push(format!("a density is given, and no mass is told: {reason}; give \"radius_mm\", and its dilation is measured"));
    }
    if job.params.thickness {
        let surfaces = if is_solid(attractor) { attractor.surfaces() } else { Vec::new() };
        let [mesh] = surfaces.as_slice() else { return Err(no_solid()) };
        let (least, map) = walls_and_gaps(mesh, 0.0, is_mapped(job), budget)?;
        certificate.warnings.extend(least.folds(tolerance));
        (certificate.thickness, geometry) = (Some(least), map);
    }
    if let Some(direction) = job.params.direction {
        certificate.extent = Some(extent(attractor, direction, [0.0; 2], budget)?);
    }
    if job.params.oriented_box {
        certificate.oriented_box = smallest_box(attractor, 0.0, tolerance, budget)?;
    }
    Ok(Outcome { geometry, certificate })
}

fn of_dilation(job: &Job, attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let mut geometry = Geometry::None;
    let dilation = dilate_unsimplified(attractor, radius, tolerance, budget)?;
    let mut certificate = certificate::of_dilation(attractor, &dilation, tolerance);
    let mesh = dilation.solid.mesh();
    let difference = dilated_difference(volume_within(mesh), dilation.least_radius_mm, dilation.inner_mm, dilation.outer_mm);
    certificate.state_moments(mesh, difference, &dilation.bounds.grown(dilation.outer_mm));
    if let Some(volume) = certificate.volume_mm3 {
        certificate.state_mass(volume, job.params.density_g_cm3);
    }
    certificate.dimension = Some(DimensionStatement::of(Dimension::SOLID));
    if let Some(direction) = job.params.direction {
        certificate.extent = Some(extent(attractor, direction, attractor.radii(radius.mm()), budget)?);
    }
    if job.params.oriented_box {
        certificate.oriented_box = smallest_box(attractor, radius.mm(), tolerance, budget)?;
    }
    if job.params.thickness {
        let error_mm = dilation.inner_mm.max(dilation.outer_mm);
        let (least, map) = walls_and_gaps(mesh, error_mm, is_mapped(job), budget)?;
        (certificate.thickness, geometry) = (Some(least), map);
    }
    Ok(Outcome { geometry, certificate })
}

/// Whether a map of thickness is wanted: it is all that there is of a measure to write.
fn is_mapped(job: &Job) -> bool {
    !job.outputs.is_empty()
}

/// The box of a shape whose moments are numbers.
fn measurable_box(attractor: &Attractor, budget: &Budget) -> Result<AxisBox, JobError> {
    let bounds = bounding_box(attractor, budget)?;
    let extent = bounds.extent();
    if extent > LARGEST_MM {
        let message =
            format!("the shape reaches to {extent:e} mm, and beyond {LARGEST_MM:e} mm its moments are no numbers; give a smaller shape");
        return Err(JobError::new(Kind::Invalid, "measure.too-large", message));
    }
    let has_size = (0..3).any(|axis| bounds.high[axis].low > bounds.low[axis].high);
    if has_size && extent < 1.0 / LARGEST_MM {
        let least = 1.0 / LARGEST_MM;
        let message = format!(
            "the shape lies within {extent:e} mm of the origin, and below {least:e} mm its moments are no numbers; give a larger shape"
        );
        return Err(JobError::new(Kind::Invalid, "measure.too-small", message));
    }
    Ok(bounds)
}

impl Certificate {
    /// Adds what is known of a shape that consists of triangles: of solids, of several solids, or of sheets.
    fn state_meshes(
        &mut self,
        attractor: &Attractor,
        bounds: &AxisBox,
        density_g_cm3: Option<f64>,
        budget: &Budget,
    ) -> Result<(), JobError> {
        match mesh_of(attractor) {
            Some((mesh, true)) => {
                self.state_moments(&mesh, 0.0, bounds);
                // Its triangles, joined.
                for surface in attractor.surfaces() {
                    self.warnings.extend(miscounted(&surface, Crossings::of(&surface, budget)?.count));
                }
            }
            Some((mesh, false)) => self.state_overlaps(&mesh, budget)?,
            None if is_solid(attractor) => self.state_solids(&attractor.surfaces(), bounds, budget)?,
            None => {}
        }
        if let Some(volume) = self.volume_mm3.filter(|_| is_solid(attractor)) {
            self.state_mass(volume, density_g_cm3);
        }
        Ok(())
    }

    /// Widens the area of sheets that lie on each other: the sum over triangles counts what they share more than once.
    fn state_overlaps(&mut self, mesh: &TriMesh, budget: &Budget) -> Result<(), JobError> {
        let overlaps = Overlaps::of(mesh, budget)?;
        if let Some([low, high]) = self.area_mm2.filter(|_| overlaps.pairs > 0) {
            let low = (low - overlaps.most_mm2).next_down().max(0.0);
            self.area_mm2 = Some([low, high]);
            self.warnings.push(format!(
                "{} pairs of triangles lie on each other: the sum of all areas, {high} mm2, counts what they share twice; the area of what they cover is {low} mm2 at least",
                overlaps.pairs
            ));
        }
        Ok(())
    }

    /// Adds volume, area and moments of several solids together: sums, where they are proven to have nothing in common, else bounds.
    fn state_solids(&mut self, surfaces: &[TriMesh], bounds: &AxisBox, budget: &Budget) -> Result<(), JobError> {
        let mut all = TriMesh::default();
        surfaces.iter().for_each(|surface| all.append(surface));
        let (volume, area) = (volume_within(&all), area_within(&all));
        let together = miscounted(&all, Crossings::of(&all, budget)?.count);
        if together.is_none() {
            // Nothing meets, and everything is wound around once or not at all.
            (self.volume_mm3, self.area_mm2) = (Some([volume.low, volume.high]), Some([area.low, area.high]));
            self.state_moments(&all, 0.0, bounds);
            return Ok(());
        }
        for surface in surfaces {
            if let Some(fault) = miscounted(surface, Crossings::of(surface, budget)?.count) {
                self.warnings.push(format!("volume and area are not known: in one of {} solids, {fault}", surfaces.len()));
                return Ok(());
            }
        }
        let largest = surfaces.iter().map(|surface| volume_within(surface).low).fold(0.0, f64::max);
        // Boundaries of the union are parts of the solids', and no set of its volume has less than a ball.
        self.area_mm2 = Some([isoperimetric(largest).min(area.high), area.high]);
        if have_boxes_apart(surfaces) {
            self.volume_mm3 = Some([volume.low, volume.high]);
            self.state_moments(&all, 0.0, bounds);
            self.warnings.push("solids touch each other: where they share parts of faces, the area, of what is not inside, is less than the sum of theirs, the upper end; take their union for more".into());
        } else {
            self.volume_mm3 = Some([largest, volume.high]);
            self.warnings.push(format!(
                "solids touch or overlap, or lie in each other: volume, area and mass lie between those of the largest and the sum, {} mm3 and {} mm2, and no centroid is told; take their union (intersect with \"operation\": \"union\"), and measure that",
                volume.high, area.high
            ));
        }
        Ok(())
    }
}

/// Whether no two of the meshes' boxes have an inner point in common: then nor have what the meshes enclose.
fn have_boxes_apart(surfaces: &[TriMesh]) -> bool {
    let ends = |mesh: &TriMesh| {
        let start = [Interval { low: f64::INFINITY, high: f64::NEG_INFINITY }; 3];
        mesh.vertices.iter().fold(start, |ends, vertex| {
            std::array::from_fn(|axis| Interval { low: ends[axis].low.min(vertex[axis]), high: ends[axis].high.max(vertex[axis]) })
        })
    };
    let boxes: Vec<[Interval; 3]> = surfaces.iter().map(ends).collect();
    let apart = |a: &[Interval; 3], b: &[Interval; 3]| (0..3).any(|axis| a[axis].high <= b[axis].low || b[axis].high <= a[axis].low);
    boxes.iter().enumerate().all(|(index, one)| boxes[index + 1..].iter().all(|other| apart(one, other)))
}

//! Plane sections of solids as polygons with holes.
//!
//! A vertex at the height of a plane counts as below it (symbolic perturbation: Edelsbrunner and Muecke, "Simulation of simplicity",
//! 1990). Every triangle then crosses a plane along one segment or not at all, and the segments close to loops along the mesh's own edges:
//! a point of a section is named by the edge it lies on, and no two points are ever compared to find out what is joined. Comparisons
//! of heights are made once per vertex: its rank among the offsets says of which planes it is above.
//!
//! Guaranteed: the sections of a [`Solid`] are closed loops with the material on their left, whose areas, over all planes, make
//! up its volume. If its mesh does not cross itself, they are the polygons that bound the solid in the plane.
//!
//! ```
//! use lacuna_kernel::budget::Budget;
//! use lacuna_kernel::measure::section::{PlaneFrame, Section, SectionError, sections};
//! use lacuna_kernel::solid::{Solid, TriMesh};
//! use glam::DVec3;
//!
//! let tetrahedron = TriMesh {
//!     vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
//!     triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
//! };
//! let solid = Solid::new(tetrahedron, &Budget::default())?;
//! let mut areas = Vec::new();
//! sections::<SectionError>(&solid, &PlaneFrame::HORIZONTAL, &[0.0, 0.5, 1.0], &Budget::default(), &mut |section: Section| {
//!     areas.push(section.area_mm2());
//!     Ok(())
//! })?;
//! assert_eq!(areas, [0.5, 0.125, 0.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod frame;
mod level;
mod nesting;
mod ring;
mod stabbing;

pub use frame::{NoDirection, PlaneFrame};
pub use level::{Grazed, grazed};

use crate::budget::{Budget, Stopped};
use crate::error::Kind;
use crate::solid::{Solid, TriMesh};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use ring::Cut;
use stabbing::{Span, Stabbing};

/// A loop with the material on its outer side cut out of one with the material on its inner side.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygon {
    /// The outer loop, counter-clockwise, in mm; the last point is joined to the first.
    pub outer: Vec<DVec2>,
    /// Loops within it, clockwise.
    pub holes: Vec<Vec<DVec2>>,
}

/// The section of a solid with one plane, in the coordinates (u, v) of its [`PlaneFrame`].
///
/// It is the limit of the sections just above: a bottom face gives its polygon, a top face nothing. At heights where no vertex is, it is
/// the solid cut by the plane. Empty where the plane misses the solid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Where the plane is along the normal, in mm.
    pub offset_mm: f64,
    /// What the plane cuts. Loops do not cross if the mesh does not; they may touch where vertices lie in the plane. Corners on straight
    /// runs are kept, points equal to the one before are not, nor are loops without area, nor pairs of them that run along the same points both ways.
    pub polygons: Vec<Polygon>,
    /// Clockwise loops within no outer loop: a mesh that crosses itself may have some. Their area counts as negative.
    pub unmatched: Vec<Vec<DVec2>>,
}

impl Polygon {
    /// The outer loop, then the holes.
    pub fn loops(&self) -> impl Iterator<Item = &[DVec2]> {
        std::iter::once(self.outer.as_slice()).chain(self.holes.iter().map(Vec::as_slice))
    }

    /// Area of the outer loop less those of the holes, in mm^2.
    #[must_use]
    pub fn area_mm2(&self) -> f64 {
        self.loops().map(signed_area_mm2).sum()
    }

    /// Length of all loops, in mm.
    #[must_use]
    pub fn perimeter_mm(&self) -> f64 {
        self.loops().map(length_mm).sum()
    }
}

impl Section {
    /// Whether the plane cuts nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.polygons.is_empty() && self.unmatched.is_empty()
    }

    /// All loops, polygon by polygon.
    pub fn loops(&self) -> impl Iterator<Item = &[DVec2]> {
        self.polygons.iter().flat_map(Polygon::loops).chain(self.unmatched.iter().map(Vec::as_slice))
    }

    /// Area, in mm^2.
    #[must_use]
    pub fn area_mm2(&self) -> f64 {
        self.loops().map(signed_area_mm2).sum()
    }

    /// Length of all loops, in mm.
    #[must_use]
    pub fn perimeter_mm(&self) -> f64 {
        self.loops().map(length_mm).sum()
    }
}

/// Half the sum of the cross products of consecutive points, from the first as the origin, in mm^2: positive if counter-clockwise.
#[must_use]
pub fn signed_area_mm2(points: &[DVec2]) -> f64 {
    ring::shoelace(points).0
}

/// Length of a closed loop, in mm.
#[must_use]
pub fn length_mm(points: &[DVec2]) -> f64 {
    ring::sides(points).map(|[a, b]| a.distance(b)).sum()
}

/// Why there are no sections.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SectionError {
    /// An offset is not a number, or infinite.
    #[error("offset {index} is {value_mm}, and must be a number of mm")]
    Offset {
        /// Its place among the offsets.
        index: usize,
        /// What was given.
        value_mm: f64,
    },
    /// There are more planes than ranks.
    #[error("{0} planes are more than can be counted")]
    Planes(usize),
    /// A coordinate is not a number or so large that areas are not numbers.
    #[error("vertex {vertex} has the coordinate {value_mm} mm")]
    Vertex {
        /// The vertex.
        vertex: usize,
        /// Its largest coordinate.
        value_mm: f64,
    },
    /// Somebody stopped the work.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl SectionError {
    /// How a caller should react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Offset { .. } | Self::Vertex { .. } => Kind::Invalid,
            Self::Planes(_) => Kind::Limit,
            Self::Stopped(stopped) => stopped.kind(),
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Offset { .. } => "section.offset",
            Self::Planes(_) => "section.planes",
            Self::Vertex { .. } => "section.vertex",
            Self::Stopped(stopped) => stopped.code(),
        }
    }
}

/// Largest coordinate, in mm: fourth powers of it, which exact predicates form, stay numbers.
const LARGEST_MM: f64 = 1e75;
/// Triangles that are cut before sections are handed on: enough to keep all threads busy, and some hundred megabytes at most, unless one
/// section alone cuts more.
const BATCH: u64 = 1 << 20;

/// Cuts a solid with parallel planes and hands the sections to `sink` in the order of the offsets, which may be any and repeat.
///
/// Let M be the solid with D(r - inner) in M in D(r + outer), as its certificate says. In every plane the section of M then lies between
/// those of the two, up to rounding: coordinates are right to some units in the last place of the mesh's largest coordinate, and so are the
/// heights of vertices unless the normal is a coordinate axis, along which they are exact.
///
/// Cost: n log n for n triangles, 48 bytes each; then m log m for each section that cuts m of them. Sections are made in parallel, as many
/// at a time as cut a million triangles; the result does not depend on the number of threads.
///
/// # Errors
/// [`SectionError`], or what `sink` returns.
pub fn sections<E: From<SectionError>>(
    solid: &Solid,
    frame: &PlaneFrame,
    offsets_mm: &[f64],
    budget: &Budget,
    sink: &mut dyn FnMut(Section) -> Result<(), E>,
) -> Result<(), E> {
    let knife = Knife::new(solid.mesh(), frame, offsets_mm, budget)?;
    let mut first = 0;
    while first < offsets_mm.len() {
        budget.report("section", first as f64 / offsets_mm.len() as f64, first as u64);
        let mut load = 0;
        let fits = |&index: &usize| {
            load += knife.loads[knife.numbers[index] as usize];
            load <= BATCH
        };
        let end = (first + 1).max(first + (first..offsets_mm.len()).take_while(fits).count());
        let made: Vec<Result<Section, Stopped>> =
            (first..end).into_par_iter().map(|index| knife.section(offsets_mm[index], knife.numbers[index], budget)).collect();
        for section in made {
            sink(section.map_err(SectionError::from)?)?;
        }
        first = end;
    }
    budget.report("section", 1.0, offsets_mm.len() as u64);
    Ok(())
}

/// A vertex as the planes see it.
#[derive(Clone, Copy, Debug)]
struct Placed {
    point: DVec2,
    height: f64,
    /// Number of offsets below the height: it is above the planes of the numbers 1 to rank.
    rank: u32,
}

/// A mesh and planes across it, numbered from 1 by ascending offset.
struct Knife<'a> {
    triangles: &'a [[u32; 3]],
    vertices: Vec<Placed>,
    /// The number of each offset.
    numbers: Vec<u32>,
    /// How many triangles the plane of each number cuts.
    loads: Vec<u64>,
    crossed: Stabbing,
}

impl<'a> Knife<'a> {
    fn new(mesh: &'a TriMesh, frame: &PlaneFrame, offsets_mm: &[f64], budget: &Budget) -> Result<Self, SectionError> {
        if let Some((index, &value_mm)) = offsets_mm.iter().enumerate().find(|(_, offset)| !offset.is_finite()) {
            return Err(SectionError::Offset { index, value_mm });
        }
        // One number is left for the end of the last interval.
        let most = u32::try_from(offsets_mm.len()).ok().filter(|&most| most < u32::MAX).ok_or(SectionError::Planes(offsets_mm.len()))?;
        let too_large = |vertex: &DVec3| !(vertex.abs().max_element() <= LARGEST_MM && vertex.is_finite());
        if let Some(vertex) = mesh.vertices.par_iter().position_first(too_large) {
            return Err(SectionError::Vertex { vertex, value_mm: mesh.vertices[vertex].abs().max_element() });
        }
        let mut order: Vec<u32> = (0..most).collect();
        order.par_sort_unstable_by(|&a, &b| offsets_mm[a as usize].total_cmp(&offsets_mm[b as usize]).then(a.cmp(&b)));
        let mut numbers = vec![0; offsets_mm.len()];
        (1..).zip(&order).for_each(|(number, &index)| numbers[index as usize] = number);
        let place = |&vertex: &DVec3| {
            let height = frame.offset(vertex);
            let rank = order.partition_point(|&index| offsets_mm[index as usize] < height) as u32;
            Placed { point: frame.project(vertex), height, rank }
        };
        let vertices: Vec<Placed> = mesh.vertices.par_iter().map(place).collect();
        budget.cancel.check()?;
        let span = |(item, corners): (usize, &[u32; 3])| {
            let [a, b, c] = corners.map(|corner| vertices[corner as usize].rank);
            let (low, high) = (a.min(b).min(c) + 1, a.max(b).max(c));
            (low <= high).then_some(Span { low, high, item: item as u32 })
        };
        let spans: Vec<Span> = mesh.triangles.par_iter().enumerate().filter_map(span).collect();
        budget.cancel.check()?;
        let mut changes = vec![0_i64; offsets_mm.len() + 2];
        for span in &spans {
            changes[span.low as usize] += 1;
            changes[span.high as usize + 1] -= 1;
        }
        let total = |sum: &mut i64, change: i64| {
            *sum += change;
            Some(sum.unsigned_abs())
        };
        let loads = changes.into_iter().scan(0, total).collect();
        let crossed = Stabbing::new(spans, most);
        budget.cancel.check()?;
        Ok(Self { triangles: &mesh.triangles, vertices, numbers, loads, crossed })
    }

    fn section(&self, offset_mm: f64, number: u32, budget: &Budget) -> Result<Section, Stopped> {
        budget.cancel.check()?;
        let mut cuts = Vec::with_capacity(self.loads[number as usize] as usize);
        self.crossed.each(number, |triangle| cuts.push(self.cut(triangle, number)));
        budget.cancel.check()?;
        let rings = ring::rings(cuts, |name| self.point(name, offset_mm));
        budget.cancel.check()?;
        let (polygons, unmatched) = nesting::nest(rings);
        Ok(Section { offset_mm, polygons, unmatched })
    }

    /// The passage through a triangle that the plane crosses.
    fn cut(&self, triangle: u32, number: u32) -> Cut {
        let corners = self.triangles[triangle as usize];
        let above = corners.map(|corner| self.vertices[corner as usize].rank >= number);
        let mut cut = Cut { from: 0, to: 0 };
        for k in 0..3 {
            let l = (k + 1) % 3;
            let name = |below: u32, above: u32| u64::from(below) << 32 | u64::from(above);
            match (above[k], above[l]) {
                (true, false) => cut.from = name(corners[l], corners[k]),
                (false, true) => cut.to = name(corners[k], corners[l]),
                _ => {}
            }
        }
        cut
    }

    /// Where the plane meets an edge: the same bits for both triangles, and its lower vertex where that lies in the plane.
    fn point(&self, name: u64, offset_mm: f64) -> DVec2 {
        let below = &self.vertices[(name >> 32) as usize];
        let above = &self.vertices[(name & u64::from(u32::MAX)) as usize];
        below.point + (offset_mm - below.height) / (above.height - below.height) * (above.point - below.point)
    }
}

#[cfg(test)]
mod tests;

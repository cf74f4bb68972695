//! Plane sections as drawings: for lasers, routers, plotters and templates.
//!
//! A file is written as sections come, and holds none of them: what it says in advance, the box of the drawing, is that of the mesh in
//! the frame of the planes. Lengths are millimetres, and each coordinate is the shortest decimal that reads back as the same
//! double-precision number.
//!
//! ```
//! use lacuna_exchange::format::Metadata;
//! use lacuna_exchange::format::Format;
//! use lacuna_exchange::format::sections::SectionFile;
//! use lacuna_kernel::measure::section::{Polygon, Section};
//! use glam::{DVec2, DVec3};
//!
//! let triangle = Polygon { outer: vec![DVec2::ZERO, DVec2::X, DVec2::Y], holes: vec![] };
//! let section = Section { offset_mm: 0.25, polygons: vec![triangle], unmatched: vec![] };
//! let mut bytes = Vec::new();
//! let mut file = SectionFile::start(Format::Svg, &mut bytes, [DVec3::ZERO, DVec3::ONE], &[0.25], &Metadata::default())?;
//! file.push(&section)?;
//! file.finish()?;
//! assert!(String::from_utf8_lossy(&bytes).contains("<g id=\"z_0.250\">\n<path d=\"M0 0L1 0L0 -1z\"/>\n</g>"));
//! # Ok::<(), lacuna_exchange::format::FormatError>(())
//! ```

mod dxf;
mod svg;

use super::error::{FormatError, Place};
use super::off::flush_full;
use super::text::CHUNK_BYTES;
use super::{Format, Metadata};
use glam::{DVec2, DVec3};
use lacuna_kernel::measure::section::Section;
use std::collections::BTreeMap;
use std::io::Write;

/// A drawing that is being written: sections go through it one by one.
///
/// The bytes depend on what is pushed alone. Memory: a chunk of text and the names of the sections.
pub struct SectionFile<W> {
    format: Format,
    sink: W,
    text: Vec<u8>,
    /// The number of each height's name, and how many sections have had it.
    names: BTreeMap<String, [usize; 2]>,
    /// Of a DXF file.
    handles: Option<dxf::Handles>,
    points: u64,
}

impl<W: Write> SectionFile<W> {
    /// Starts a drawing of sections at some offsets, in any order, between the lower and the upper corner (u, v, offset), as
    /// [`PlaneFrame::bounds`](lacuna_kernel::measure::section::PlaneFrame::bounds) gives them, in mm. What lies beyond is written too.
    ///
    /// # Errors
    /// [`FormatError::CannotDraw`] for a format that is no drawing, [`FormatError::NotFinite`] for the corners and offsets, [`FormatError::Stream`] when the sink fails.
    pub fn start(
        format: Format,
        mut sink: W,
        bounds: [DVec3; 2],
        offsets_mm: &[f64],
        metadata: &Metadata<'_>,
    ) -> Result<Self, FormatError> {
        if !format.is_drawing() {
            return Err(FormatError::CannotDraw { format });
        }
        for value in bounds.iter().flat_map(DVec3::to_array).chain(offsets_mm.iter().copied()) {
            check(value, Place::File)?;
        }
        let (mut names, mut layers) = (BTreeMap::new(), Vec::new());
        for name in offsets_mm.iter().map(|&offset| height_name(offset)) {
            let number = names.len() + 1;
            names.entry(name).or_insert_with_key(|name| {
                layers.push(dxf::layer(name, number));
                [number, 0]
            });
        }
        let mut text = Vec::with_capacity(CHUNK_BYTES + 4096);
        let handles = match format {
            Format::Svg => {
                svg::start(bounds, metadata, &mut text);
                None
            }
            _ => Some(dxf::start(bounds, &layers, metadata, &mut Out { text: &mut text, sink: &mut sink })?),
        };
        Ok(Self { format, sink, text, names, handles, points: 0 })
    }

    /// Adds a section at one of the offsets. One that is empty has an empty group in SVG, and nothing but its layer in DXF.
    ///
    /// # Errors
    /// [`FormatError::UnknownPlane`] for another offset, [`FormatError::NotFinite`] for a coordinate, its place being the number of the point among all; [`FormatError::Stream`] when the
    /// sink fails.
    pub fn push(&mut self, section: &Section) -> Result<(), FormatError> {
        check(section.offset_mm, Place::File)?;
        for (vertex, point) in (self.points..).zip(section.loops().flatten()) {
            check(point.x, Place::Vertex(vertex))?;
            check(point.y, Place::Vertex(vertex))?;
        }
        self.points += section.loops().map(|points| points.len() as u64).sum::<u64>();
        let name = height_name(section.offset_mm);
        let unknown = FormatError::UnknownPlane { offset_mm: section.offset_mm };
        let [number, uses] = self.names.get_mut(&name).ok_or(unknown)?;
        *uses += 1;
        let mut out = Out { text: &mut self.text, sink: &mut self.sink };
        match &mut self.handles {
            None => svg::section(section, &name, *uses, &mut out),
            Some(handles) => dxf::section(section, &dxf::layer(&name, *number), handles, &mut out),
        }
    }

    /// Writes the end, and what is still kept.
    ///
    /// # Errors
    /// [`FormatError::Stream`] when the sink fails.
    pub fn finish(mut self) -> Result<(), FormatError> {
        self.text.extend_from_slice(match self.format {
            Format::Svg => svg::END,
            _ => dxf::END,
        });
        self.sink.write_all(&self.text)?;
        self.sink.flush()?;
        Ok(())
    }
}

/// Text, and where it goes.
struct Out<'a, W> {
    text: &'a mut Vec<u8>,
    sink: &'a mut W,
}

impl<W: Write> Out<'_, W> {
    /// Writes each point of a loop, handing text on as it grows: loops may be of any length.
    fn each(&mut self, points: &[DVec2], write: impl Fn(usize, &DVec2, &mut Vec<u8>)) -> Result<(), FormatError> {
        points.iter().enumerate().try_for_each(|(index, point)| {
            write(index, point, self.text);
            flush_full(self.text, self.sink)
        })
    }
}

fn check(value: f64, place: Place) -> Result<(), FormatError> {
    if value.is_finite() { Ok(()) } else { Err(FormatError::NotFinite { place, value }) }
}

/// Appends the shortest decimal that reads back as the same number; a zero comes out positive.
fn push_number(text: &mut Vec<u8>, value: f64) {
    let mut buffer = zmij::Buffer::new();
    let shortest = buffer.format_finite(value + 0.0).as_bytes();
    text.extend_from_slice(shortest.strip_suffix(b".0").unwrap_or(shortest));
}

/// A height in mm as its shortest decimal without exponent, with three digits after the point or more: equal heights and no others have
/// equal names.
fn height_name(offset_mm: f64) -> String {
    let shortest = format!("{}", offset_mm + 0.0);
    let (whole, part) = shortest.split_once('.').unwrap_or((&shortest, ""));
    format!("{whole}.{part:0<3}")
}

#[cfg(test)]
mod tests;

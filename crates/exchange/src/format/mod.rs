//! Mesh files out and in, and pictures of what they hold.
//!
//! One table, [`FORMATS`], says what each format can carry; [`write()`], [`read()`] and
//! [`verify_written`] are the only doors. Lengths are millimetres throughout; every coordinate
//! that is written is a single-precision number, and a zero is never negative, so that programs
//! which join vertices by their bits join the same ones as those which compare numbers.
//!
//! ```
//! use lacuna_exchange::format::{Format, Metadata, ReadLimits, read, verify_written, write};
//! use lacuna_kernel::solid::TriMesh;
//! use glam::DVec3;
//!
//! let tetrahedron = TriMesh {
//!     vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
//!     triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
//! };
//! let mut file = std::io::Cursor::new(Vec::new());
//! write(Format::ThreeMf, &tetrahedron, &Metadata::default(), &mut file)?;
//! verify_written(Format::ThreeMf, &mut file, &tetrahedron)?;
//! assert_eq!(read(file.get_ref(), None, &ReadLimits::default())?.mesh, tetrahedron);
//! # Ok::<(), lacuna_exchange::format::FormatError>(())
//! ```

mod addresses;
pub mod automaton;
mod error;
mod geometry;
mod glb;
mod limits;
mod obj;
mod off;
mod ply;
pub mod preview;
mod read;
mod scanner;
pub mod sections;
mod stl;
mod text;
mod threemf;
mod vrml;

pub use error::{FormatError, Place};
pub use geometry::{Geometry, NamedMesh};
pub use limits::ReadLimits;
pub use ply::{PointFile, ScalarField, write_fields};
pub use read::{MeshFacts, MeshFile, Unit, detect, read};

use geometry::Piece;
use lacuna_fabrication::certificate::Certificate;
use std::fmt;
use std::io::{Read, Seek, Write};

/// A file format of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Format {
    /// Binary stereolithography file.
    Stl,
    /// 3D Manufacturing Format, core specification 1.4.
    ThreeMf,
    /// Binary glTF 2.0.
    Glb,
    /// Wavefront OBJ.
    Obj,
    /// Polygon file, binary little-endian.
    Ply,
    /// Object file format of Geomview.
    Off,
    /// Virtual reality modelling language, the polygons of both versions.
    Vrml,
    /// A picture.
    Png,
    /// The addresses of an evaluation's cells, as comma-separated values.
    Addresses,
    /// Scalable Vector Graphics 1.1: plane sections.
    Svg,
    /// Drawing exchange file of AutoCAD 2000: plane sections.
    Dxf,
}

/// The kinds of content that a geometry holds or a format has room for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Carries {
    /// Closed triangle meshes that bound material.
    pub solid: bool,
    /// Triangles that need not be closed.
    pub surface: bool,
    /// Segments.
    pub wires: bool,
    /// Vertices that stand alone.
    pub points: bool,
}

/// A row of the table of formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FormatFacts {
    /// The format.
    pub format: Format,
    /// The name that users know.
    pub name: &'static str,
    /// Ending of file names, without the dot.
    pub ending: &'static str,
    /// Media type in HTTP.
    pub media_type: &'static str,
    /// What it can carry out.
    pub carries: Carries,
    /// Whether [`read()`] takes it.
    pub reads: bool,
}

const EVERYTHING: Carries = Carries { solid: true, surface: true, wires: true, points: true };

/// What holds no geometry of space: tables and drawings.
const NOTHING: Carries = Carries { solid: false, surface: false, wires: false, points: false };

/// Every format, the two for fabrication first.
///
/// STL and OFF are lists of faces; 3MF objects of type `model` must be closed, and a printer's
/// file that is not is a trap, so open surfaces are refused there although the format has a type
/// for them.
pub const FORMATS: [FormatFacts; 11] = [
    FormatFacts {
        format: Format::Stl,
        name: "STL",
        ending: "stl",
        media_type: "model/stl",
        carries: Carries { wires: false, points: false, ..EVERYTHING },
        reads: true,
    },
    FormatFacts {
        format: Format::ThreeMf,
        name: "3MF",
        ending: "3mf",
        media_type: "model/3mf",
        carries: Carries { solid: true, surface: false, wires: false, points: false },
        reads: true,
    },
    FormatFacts { format: Format::Glb, name: "GLB", ending: "glb", media_type: "model/gltf-binary", carries: EVERYTHING, reads: false },
    FormatFacts { format: Format::Obj, name: "OBJ", ending: "obj", media_type: "model/obj", carries: EVERYTHING, reads: true },
    FormatFacts {
        format: Format::Ply,
        name: "PLY",
        ending: "ply",
        media_type: "application/octet-stream",
        carries: EVERYTHING,
        reads: true,
    },
    FormatFacts {
        format: Format::Off,
        name: "OFF",
        ending: "off",
        media_type: "application/octet-stream",
        carries: Carries { wires: false, ..EVERYTHING },
        reads: true,
    },
    FormatFacts { format: Format::Vrml, name: "VRML", ending: "wrl", media_type: "model/vrml", carries: EVERYTHING, reads: true },
    FormatFacts { format: Format::Png, name: "PNG", ending: "png", media_type: "image/png", carries: EVERYTHING, reads: false },
    FormatFacts {
        format: Format::Addresses,
        name: "CSV",
        ending: "csv",
        media_type: "text/csv",
        // No geometry: a table beside it.
        carries: NOTHING,
        reads: false,
    },
    FormatFacts { format: Format::Svg, name: "SVG", ending: "svg", media_type: "image/svg+xml", carries: NOTHING, reads: false },
    FormatFacts { format: Format::Dxf, name: "DXF", ending: "dxf", media_type: "image/vnd.dxf", carries: NOTHING, reads: false },
];

impl Format {
    /// Its row of the table.
    #[must_use]
    pub fn facts(self) -> &'static FormatFacts {
        // The table is in the order of the enum; a test holds it there.
        &FORMATS[self as usize]
    }

    /// Whether it holds plane sections: see [`sections`].
    #[must_use]
    pub fn is_drawing(self) -> bool {
        matches!(self, Self::Svg | Self::Dxf)
    }

    /// The format of a file name's ending or of a media type, in any letter case; the media type
    /// that 3MF had before its registration counts.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        const OLDER_3MF: &str = "application/vnd.ms-package.3dmanufacturing-3dmodel+xml";
        let name = name.trim().trim_start_matches('.');
        if name.eq_ignore_ascii_case(OLDER_3MF) {
            return Some(Self::ThreeMf);
        }
        let named = |row: &&FormatFacts| {
            let media_type_is_its_own = row.media_type != "application/octet-stream";
            row.ending.eq_ignore_ascii_case(name) || media_type_is_its_own && row.media_type.eq_ignore_ascii_case(name)
        };
        FORMATS.iter().find(named).map(|row| row.format)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.facts().name)
    }
}

impl Carries {
    /// Whether everything of `content` is among it.
    #[must_use]
    pub fn covers(self, content: Self) -> bool {
        content.beyond(self) == Self::default()
    }

    /// What it has and `other` has not.
    #[must_use]
    pub fn beyond(self, other: Self) -> Self {
        Self {
            solid: self.solid && !other.solid,
            surface: self.surface && !other.surface,
            wires: self.wires && !other.wires,
            points: self.points && !other.points,
        }
    }

    /// Its members in words, joined by `and`.
    #[must_use]
    pub fn words(self) -> String {
        let all = [(self.solid, "solids"), (self.surface, "surfaces"), (self.wires, "wires"), (self.points, "points")];
        let present: Vec<&str> = all.into_iter().filter_map(|(present, word)| present.then_some(word)).collect();
        if present.is_empty() { "nothing".to_owned() } else { present.join(" and ") }
    }
}

/// What a file says about itself. No time and no host: the same input gives the same bytes.
#[derive(Clone, Copy, Debug)]
pub struct Metadata<'a> {
    /// A title, in any characters; each format escapes what it must.
    pub title: Option<&'a str>,
    /// The producer and its version. Default: `lacuna` and the version of this crate.
    pub application: &'a str,
    /// The statement of bounds; carried by 3MF and GLB.
    pub certificate: Option<&'a Certificate>,
    /// A picture as PNG, shown by file managers; carried by 3MF.
    pub thumbnail_png: Option<&'a [u8]>,
}

impl Default for Metadata<'_> {
    fn default() -> Self {
        Self { title: None, application: concat!("lacuna ", env!("CARGO_PKG_VERSION")), certificate: None, thumbnail_png: None }
    }
}

/// Writes `geometry` in `format`.
///
/// Memory stays flat: at most a few megabytes beyond the geometry, whatever its size. The sink
/// must seek because a 3MF archive's sizes are known after its content; the other formats write
/// straight through. The bytes depend on the arguments alone, not on the number of threads.
///
/// # Errors
/// [`FormatError::CannotCarry`] if the format has no room for what the geometry holds,
/// [`FormatError::Empty`], [`FormatError::NotSinglePrecision`], [`FormatError::NotFinite`],
/// [`FormatError::IndexOutOfRange`] if the geometry is not fit for a file,
/// [`FormatError::NoAddresses`] for a table of addresses of a shape without B-rep, [`FormatError::Limit`] beyond what the format can count, [`FormatError::Stream`] if the sink fails.
pub fn write<'a, W: Write + Seek>(
    format: Format,
    geometry: impl Into<Geometry<'a>>,
    metadata: &Metadata<'_>,
    sink: &mut W,
) -> Result<(), FormatError> {
    let geometry = geometry.into();
    if format == Format::Addresses {
        return addresses::write(&geometry, sink);
    }
    let pieces = fit_pieces(format, &geometry)?;
    match format {
        Format::Stl => stl::write(&pieces, metadata, sink),
        Format::ThreeMf => threemf::write(&pieces, metadata, sink),
        Format::Glb => glb::write(&pieces, metadata, sink),
        Format::Obj => obj::write(&pieces, metadata, sink),
        Format::Ply => ply::write(&pieces, metadata, sink),
        Format::Off => off::write(&pieces, metadata, sink),
        Format::Vrml => vrml::write(&pieces, metadata, sink),
        Format::Png => preview::write(geometry, &preview::PreviewOptions::default(), sink),
        Format::Addresses => Err(FormatError::NoAddresses),
        Format::Svg | Format::Dxf => Err(FormatError::Empty),
    }
}

/// The pieces of a geometry, if the format carries them and they are fit for a file.
fn fit_pieces<'a>(format: Format, geometry: &Geometry<'a>) -> Result<Vec<Piece<'a>>, FormatError> {
    let content = geometry.content();
    if content == Carries::default() {
        return Err(FormatError::Empty);
    }
    let facts = format.facts();
    if !facts.carries.covers(content) {
        let instead = FORMATS.iter().filter(|row| row.carries.covers(content)).map(|row| row.format).collect();
        return Err(FormatError::CannotCarry { format, content: content.beyond(facts.carries), instead });
    }
    let pieces = geometry.pieces();
    geometry::check(&pieces)?;
    Ok(pieces)
}

/// Proves that a file carries exactly the triangles of `geometry`, in their order, with the same
/// single-precision coordinates bit for bit and, where the format has indices, the same indices:
/// what is proven of the mesh's topology then holds for the file.
///
/// The file is parsed, not compared with a second writing; it must be in the form that [`write()`]
/// gives it. Linear time, flat memory. Reads from the source's start.
///
/// # Errors
/// [`FormatError::Differs`] names the first difference; [`FormatError::CannotVerify`] for
/// pictures and evaluations, of which nothing is proven that a file could carry on.
pub fn verify_written<'a, R: Read + Seek>(format: Format, source: &mut R, geometry: impl Into<Geometry<'a>>) -> Result<(), FormatError> {
    let geometry = geometry.into();
    if matches!(geometry, Geometry::Sample(_) | Geometry::Polygons { .. }) || format == Format::Png {
        return Err(FormatError::CannotVerify { format });
    }
    let pieces = fit_pieces(format, &geometry)?;
    source.rewind()?;
    match format {
        Format::Stl => stl::verify(&pieces, source),
        Format::ThreeMf => threemf::verify(&pieces, source),
        Format::Glb => glb::verify(&pieces, source),
        Format::Obj => obj::verify(&pieces, source),
        Format::Ply => ply::verify(&pieces, source),
        Format::Off => off::verify(&pieces, source),
        Format::Vrml => vrml::verify(&pieces, source),
        Format::Png | Format::Addresses | Format::Svg | Format::Dxf => Err(FormatError::CannotVerify { format }),
    }
}

#[cfg(test)]
mod tests;

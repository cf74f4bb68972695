//! Reading: which format the bytes are in, and what was found in them.

use super::error::FormatError;
use super::error::Place;
use super::limits::{MeshBuilder, Read, within};
use super::{FORMATS, Format, ReadLimits, obj, off, ply, stl, threemf, vrml};
use lacuna_kernel::model::polygon::{PolygonFault, PolygonRun};
use lacuna_kernel::solid::TriMesh;
use lacuna_kernel::tessellation::Tessellation;
use std::convert::Infallible;

/// A unit of length that a file names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unit {
    /// 0.001 mm.
    Micron,
    /// 1 mm.
    Millimetre,
    /// 10 mm.
    Centimetre,
    /// 25.4 mm.
    Inch,
    /// 304.8 mm.
    Foot,
    /// 1000 mm.
    Metre,
}

impl Unit {
    /// Its length in mm.
    #[must_use]
    pub fn millimetres(self) -> f64 {
        match self {
            Self::Micron => 0.001,
            Self::Millimetre => 1.0,
            Self::Centimetre => 10.0,
            Self::Inch => 25.4,
            Self::Foot => 304.8,
            Self::Metre => 1000.0,
        }
    }
}

/// What was found in a file besides its mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFacts {
    /// The format it was read as.
    pub format: Format,
    /// `binary`, `binary big-endian`, `ascii` or `xml`.
    pub encoding: &'static str,
    /// The unit that the file names; the mesh is in mm already. Without one, the file's numbers
    /// were taken for mm.
    pub unit: Option<Unit>,
    /// Names of objects, at most [`MeshFacts::NAMES`], each cut to [`MeshFacts::NAME_CHARACTERS`].
    pub object_names: Vec<String>,
    /// What holds no polygons and was left out, by the word for its kind, with its number: shapes of VRML, and `segments` and `points` beside
    /// faces, which many programs write only to show their edges.
    pub left_out: Vec<(&'static str, u64)>,
}

impl MeshFacts {
    /// At most so many names are kept.
    pub const NAMES: usize = 1000;
    /// Names are cut to so many characters.
    pub const NAME_CHARACTERS: usize = 256;

    pub(crate) fn of(format: Format, encoding: &'static str) -> Self {
        Self { format, encoding, unit: None, object_names: Vec::new(), left_out: Vec::new() }
    }
}

/// A mesh that was read. Nothing is proven of it.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFile {
    /// The mesh, in mm, polygons cut into triangles.
    pub mesh: TriMesh,
    /// Which triangles are polygons, in order.
    pub polygons: Vec<PolygonRun>,
    /// Polygons that no triangles fill, by the number of their face, in order: in the mesh they are fans that fold. They may be
    /// faces of a cage all the same.
    pub unfilled: Vec<(u64, PolygonFault)>,
    /// Segments, where there are no faces.
    pub segments: Vec<[u32; 2]>,
    /// Points, where there are no faces.
    pub points: Vec<u32>,
    /// What else the file said.
    pub facts: MeshFacts,
}

impl MeshFile {
    pub(crate) fn new(builder: MeshBuilder<'_>, mut facts: MeshFacts) -> Self {
        let Read { mesh, polygons, unfilled, mut segments, mut points } = builder.finish();
        if !mesh.triangles.is_empty() {
            let beside = [("segments", segments.len()), ("points", points.len())];
            facts.left_out.extend(beside.into_iter().filter(|&(_, count)| count > 0).map(|(word, count)| (word, count as u64)));
            (segments, points) = (Vec::new(), Vec::new());
        }
        Self { mesh, polygons, unfilled, segments, points, facts }
    }

    /// Whether there are no faces, segments or points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.mesh.triangles.is_empty() && self.segments.is_empty() && self.points.is_empty()
    }

    /// Its segments and points as they are written, where there are no faces but some of these.
    #[must_use]
    pub fn wires(&self) -> Option<Tessellation> {
        let has_wires = !(self.segments.is_empty() && self.points.is_empty());
        has_wires.then(|| Tessellation {
            vertices: self.mesh.vertices.clone(),
            segments: self.segments.clone(),
            points: self.points.clone(),
            ..Tessellation::default()
        })
    }

    /// The faces as the file has them: its polygons whole, their corners in its order. Where there are none, its segments and then its points, as faces with two corners and one.
    #[must_use]
    pub fn faces(&self) -> Vec<Vec<u32>> {
        let mut faces = Vec::with_capacity(face_count(&self.mesh.triangles, &self.polygons) as usize);
        faces.extend(self.segments.iter().map(|ends| ends.to_vec()));
        faces.extend(self.points.iter().map(|&point| vec![point]));
        let Ok(()) = each_face(&self.mesh.triangles, &self.polygons, |face| {
            faces.push(face.to_vec());
            Ok::<(), Infallible>(())
        });
        faces
    }
}

/// How many faces there are.
pub(crate) fn face_count(triangles: &[[u32; 3]], polygons: &[PolygonRun]) -> u64 {
    triangles.len() as u64 - polygons.iter().map(|polygon| u64::from(polygon.count) - 1).sum::<u64>()
}

/// Hands over the corners of every face in turn.
pub(crate) fn each_face<E>(
    triangles: &[[u32; 3]],
    polygons: &[PolygonRun],
    mut take: impl FnMut(&[u32]) -> Result<(), E>,
) -> Result<(), E> {
    let (mut at, mut corners) = (0, Vec::new());
    for polygon in polygons {
        triangles[at..polygon.first as usize].iter().try_for_each(|triangle| take(triangle))?;
        polygon.corners(triangles, &mut corners);
        take(&corners)?;
        at = (polygon.first + polygon.count) as usize;
    }
    triangles[at..].iter().try_for_each(|triangle| take(triangle))
}

/// Keeps a name, if there is one and there is room.
pub(crate) fn keep_name(facts: &mut MeshFacts, name: &[u8]) {
    let name = name.trim_ascii();
    if name.is_empty() || facts.object_names.len() >= MeshFacts::NAMES {
        return;
    }
    // Four bytes at most for a character: no more than these need decoding.
    let start = name.get(..4 * MeshFacts::NAME_CHARACTERS).unwrap_or(name);
    facts.object_names.push(String::from_utf8_lossy(start).chars().take(MeshFacts::NAME_CHARACTERS).collect());
}

/// The format that the bytes are in, by their first ones and, for binary STL, by their number.
#[must_use]
pub fn detect(bytes: &[u8]) -> Option<Format> {
    let marks: [(&[u8], Format); 5] = [
        (b"PK\x03\x04", Format::ThreeMf),
        (b"glTF", Format::Glb),
        (b"\x89PNG", Format::Png),
        (b"ply\n", Format::Ply),
        (b"ply\r", Format::Ply),
    ];
    if let Some((_, format)) = marks.iter().find(|(mark, _)| bytes.starts_with(mark)) {
        return Some(*format);
    }
    if vrml::looks_like(bytes) {
        return Some(Format::Vrml);
    }
    if stl::is_binary(bytes) || stl::looks_like_text(bytes) {
        return Some(Format::Stl);
    }
    if off::looks_like(bytes) {
        return Some(Format::Off);
    }
    obj::looks_like(bytes).then_some(Format::Obj)
}

/// What is said of bytes that fit no format: most often a file that was not written to its end.
fn unknown(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "the file is empty".to_owned();
    }
    let names: Vec<&str> = FORMATS.iter().filter(|facts| facts.reads).map(|facts| facts.name).collect();
    let known = format!("the bytes fit none of the formats that are read: {}", names.join(", "));
    match stl::announced_bytes(bytes) {
        Some((facets, whole)) if std::str::from_utf8(bytes).is_err() => {
            let length = bytes.len();
            format!(
                "{known}; as a binary STL file of the {facets} triangles that it announces it would have {whole} bytes, and it has {length}: is all of it there, and nothing more?"
            )
        }
        _ => known,
    }
}

/// Reads a mesh. The format is detected unless it is given.
///
/// Polygons become triangles of which is known where they belong, units become mm, the objects of a 3MF file are placed where its build
/// puts them, and vertices of an STL file with equal coordinates become one. A decimal is read as
/// the nearest double. Nothing is repaired.
///
/// # Errors
/// Every [`FormatError`] of kind `Invalid` or `Limit`, with the place in the file; never a panic,
/// and never more memory than the limits and the file's own length justify.
pub fn read(bytes: &[u8], format: Option<Format>, limits: &ReadLimits) -> Result<MeshFile, FormatError> {
    within(Place::File, "file_bytes", bytes.len() as u64, limits.file_bytes)?;
    let format = format.or_else(|| detect(bytes)).ok_or_else(|| FormatError::UnknownFormat(unknown(bytes)))?;
    match format {
        Format::Stl => stl::read(bytes, limits),
        Format::ThreeMf => threemf::read(bytes, limits),
        Format::Obj => obj::read(bytes, limits),
        Format::Ply => ply::read(bytes, limits),
        Format::Off => off::read(bytes, limits),
        Format::Vrml => vrml::read(bytes, limits),
        Format::Glb | Format::Png | Format::Addresses | Format::Svg | Format::Dxf => Err(FormatError::CannotRead { format }),
    }
}

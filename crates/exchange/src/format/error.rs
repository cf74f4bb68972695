//! What can go wrong between a geometry and a file, with the place where it did.

use super::{Carries, Format};
use lacuna_kernel::error::{Kind, LimitFacts};
use std::fmt;

/// A place in a file, in the coordinates that suit its format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// Bytes from the start of the file.
    Byte(u64),
    /// A line of a text file, the first being 1.
    Line(u64),
    /// Bytes from the start of a part of an archive, after inflating.
    Part {
        /// Name of the part.
        name: String,
        /// Bytes from its start.
        byte: u64,
    },
    /// A vertex, the first being 0.
    Vertex(u64),
    /// A triangle, the first being 0.
    Triangle(u64),
    /// The file as a whole.
    File,
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(byte) => write!(formatter, "byte {byte}"),
            Self::Line(line) => write!(formatter, "line {line}"),
            Self::Part { name, byte } => write!(formatter, "part {name}, byte {byte}"),
            Self::Vertex(vertex) => write!(formatter, "vertex {vertex}"),
            Self::Triangle(triangle) => write!(formatter, "triangle {triangle}"),
            Self::File => formatter.write_str("the file as a whole"),
        }
    }
}

/// A refusal to write, read or vouch for a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The format has no room for what the geometry holds, for example wires in an STL file.
    #[error("{format} cannot carry {}; {} can", .content.words(), list(.instead))]
    CannotCarry {
        /// The format that was asked.
        format: Format,
        /// What it has no room for.
        content: Carries,
        /// Formats that carry everything this geometry holds.
        instead: Vec<Format>,
    },
    /// Lacuna writes this format and does not read it.
    #[error("{format} files are written, not read")]
    CannotRead {
        /// The format that was asked.
        format: Format,
    },
    /// A picture, or an evaluation without a proof that could carry over, was to be verified.
    #[error("there is no proof to carry over into this {format} file")]
    CannotVerify {
        /// The format that was asked.
        format: Format,
    },
    /// Sections were to be written into something else than a drawing.
    #[error("a {format} file has no room for plane sections; SVG and DXF files have")]
    CannotDraw {
        /// The format that was asked.
        format: Format,
    },
    /// A section of a plane that the drawing was not started with.
    #[error("the drawing has no plane at {offset_mm} mm; start it with all offsets")]
    UnknownPlane {
        /// Where the plane is along the normal.
        offset_mm: f64,
    },
    /// A table of addresses was asked of a shape whose cells have none.
    #[error(
        "there are no addresses to write: the shape, or a part of it, has no B-rep; addresses are known for curves between vertices and for faces with edges"
    )]
    NoAddresses,
    /// No format of the table fits the bytes.
    #[error("{0}")]
    UnknownFormat(String),
    /// There is nothing to write.
    #[error("the geometry is empty")]
    Empty,
    /// A solid's coordinate is not a single-precision number: the file would hold another mesh
    /// than the one that was proven.
    #[error("vertex {vertex} has the coordinate {value_mm} mm, which single precision cannot hold")]
    NotSinglePrecision {
        /// The vertex, the first being 0, counted through all parts.
        vertex: u64,
        /// The coordinate in mm.
        value_mm: f64,
    },
    /// A coordinate is not a number, infinite, or beyond what the format's numbers hold.
    #[error("{place}: coordinate {value:e} {}", if .value.is_finite() { "is beyond single precision, whose numbers end at 3.4e38" } else { "is not finite" })]
    NotFinite {
        /// Where.
        place: Place,
        /// What was found.
        value: f64,
    },
    /// A triangle or a segment names a vertex that does not exist.
    #[error("{place}: vertex index {index} with {vertices} vertices")]
    IndexOutOfRange {
        /// Where.
        place: Place,
        /// The index as the file writes it.
        index: i64,
        /// How many vertices there are.
        vertices: u64,
    },
    /// The file ends before it has said what it announced.
    #[error("{place}: the {format} file needs {needed} bytes there and has {found}")]
    Truncated {
        /// The format it was read as.
        format: Format,
        /// Where.
        place: Place,
        /// Bytes that the announced content needs at least.
        needed: u64,
        /// Bytes that are there.
        found: u64,
    },
    /// The file breaks its format's grammar.
    #[error("{place}: {format} expects {expected}, found {found:?}")]
    Malformed {
        /// The format it was read as.
        format: Format,
        /// Where.
        place: Place,
        /// What the grammar expects there.
        expected: &'static str,
        /// The start of what is there.
        found: String,
    },
    /// The file is well-formed and asks for something that is refused on purpose: a document type
    /// definition, a path out of the archive, an external part.
    #[error("{place}: refused: {what}")]
    Refused {
        /// Where.
        place: Place,
        /// What is refused.
        what: &'static str,
    },
    /// The file needs more than [`super::ReadLimits`] allow, or a format more than it can count.
    #[error("{place}: {} is {}, at most {} is allowed", .facts.limit, .facts.asked, .facts.allowed)]
    Limit {
        /// Where it was noticed.
        place: Place,
        /// Which limit, what was asked, what is allowed.
        facts: LimitFacts,
    },
    /// The operating system would not give the memory for what a checked count announced.
    #[error("{place}: no memory for {bytes} bytes")]
    OutOfMemory {
        /// Where.
        place: Place,
        /// Bytes that were asked.
        bytes: u64,
    },
    /// A written file does not carry the mesh it was written from.
    #[error("{place}: the written {format} file differs from the mesh: expected {expected}, found {found}")]
    Differs {
        /// The format of the file.
        format: Format,
        /// Where.
        place: Place,
        /// What the mesh has there.
        expected: String,
        /// What the file has there.
        found: String,
    },
    /// The sink or the source failed.
    #[error("the byte stream failed")]
    Stream(#[from] std::io::Error),
    /// The archive of a 3MF file cannot be opened.
    #[error("{place}: not a usable archive")]
    Archive {
        /// Where.
        place: Place,
        /// What the archive reader said.
        #[source]
        source: zip::result::ZipError,
    },
    /// The picture could not be encoded.
    #[error("the picture could not be encoded")]
    Picture(#[from] png::EncodingError),
    /// The certificate could not be put in words.
    #[error("the certificate could not be written as JSON")]
    Certificate(#[from] serde_json::Error),
}

impl FormatError {
    /// How the caller should react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::CannotCarry { .. }
            | Self::CannotRead { .. }
            | Self::CannotVerify { .. }
            | Self::CannotDraw { .. }
            | Self::NoAddresses
            | Self::UnknownFormat(_)
            | Self::Empty
            | Self::NotFinite { .. }
            | Self::IndexOutOfRange { .. }
            | Self::Truncated { .. }
            | Self::Malformed { .. }
            | Self::Refused { .. }
            | Self::Archive { .. } => Kind::Invalid,
            Self::NotSinglePrecision { .. } => Kind::Unreachable,
            Self::Limit { .. } | Self::OutOfMemory { .. } => Kind::Limit,
            Self::Stream(error) => match error.kind() {
                std::io::ErrorKind::StorageFull | std::io::ErrorKind::OutOfMemory => Kind::Limit,
                _ => Kind::Defect,
            },
            Self::Differs { .. } | Self::UnknownPlane { .. } | Self::Picture(_) | Self::Certificate(_) => Kind::Defect,
        }
    }

    /// A stable name for programs.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::CannotCarry { .. } => "format.cannot-carry",
            Self::CannotRead { .. } => "format.cannot-read",
            Self::CannotVerify { .. } => "format.cannot-verify",
            Self::CannotDraw { .. } => "format.cannot-draw",
            Self::UnknownPlane { .. } => "format.unknown-plane",
            Self::NoAddresses => "format.no-addresses",
            Self::UnknownFormat(_) => "format.unknown",
            Self::Empty => "format.empty-geometry",
            Self::NotSinglePrecision { .. } => "format.not-single-precision",
            Self::NotFinite { .. } => "format.not-finite",
            Self::IndexOutOfRange { .. } => "format.index-out-of-range",
            Self::Truncated { .. } => "format.truncated",
            Self::Malformed { .. } => "format.malformed",
            Self::Refused { .. } => "format.refused",
            Self::Limit { .. } => "format.limit",
            Self::OutOfMemory { .. } => "format.out-of-memory",
            Self::Differs { .. } => "format.written-file-differs",
            Self::Stream(_) => "format.stream",
            Self::Archive { .. } => "format.archive",
            Self::Picture(_) => "format.picture",
            Self::Certificate(_) => "format.certificate",
        }
    }

    /// The limit that was hit, if one was.
    #[must_use]
    pub fn limit_facts(&self) -> Option<&LimitFacts> {
        match self {
            Self::Limit { facts, .. } => Some(facts),
            _ => None,
        }
    }

    /// A grammar error whose `found` is cut to a length fit for a message.
    pub(crate) fn malformed(format: Format, place: Place, expected: &'static str, found: &[u8]) -> Self {
        const SHOWN: usize = 40;
        let shown = found.get(..SHOWN).unwrap_or(found);
        Self::Malformed { format, place, expected, found: String::from_utf8_lossy(shown).into_owned() }
    }

    /// A limit without a known remedy.
    #[expect(clippy::cast_precision_loss, reason = "limits are shown, not computed with")]
    pub(crate) fn limit(place: Place, limit: &'static str, asked: u64, allowed: u64) -> Self {
        let facts = LimitFacts { limit, asked: asked as f64, allowed: allowed as f64, remedy: None };
        Self::Limit { place, facts }
    }
}

fn list(formats: &[Format]) -> String {
    if formats.is_empty() {
        return "no format".to_owned();
    }
    formats.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

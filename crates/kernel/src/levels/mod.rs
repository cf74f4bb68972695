//! Iterated function systems as exact solids: all copies of a closed primitive along addresses of one length, joined.
//!
//! Level n of the system T_1 ... T_m with the primitive P is U_n = union of T_i U_(n-1), U_0 = P. In the affine frame of P's first corner and three edges
//! there, maps of most classics are matrices of small fractions: they are read as such (how far this moves anything is part of the bound), and corners of all
//! copies have integer coordinates on one lattice. Corners are the same where their integers are, and no distance is ever compared.
//!
//! The surface of U_n is made from that of U_(n-1): it is copied by every map, and faces that occur twice with opposite orientation cancel. That the result
//! bounds the union rests on two proofs. The copies' insides are disjoint: a convex body C that holds P (P itself, or its box in the frame) has T_i C in C and
//! planes between all pairs T_i C, T_j C, exactly, which by induction holds along all addresses (the open set condition: Hutchinson, "Fractals and
//! self-similarity", 1981). And faces that overlap coincide: either all copies are cells of one grid, or the finished surface is searched, exactly, for faces
//! that meet elsewhere than in common corners and edges.
//!
//! Cost: linear in the faces of level n - 1 times the maps, which follows the surface of the result and not the number of copies.

mod disjoint;
mod growth;
mod lattice;

use crate::budget::{Budget, Stopped};
use crate::error::{Kind, LimitFacts};
use crate::measure::mass::{area_within, volume_within};
use crate::measure::{AxisBox, Interval};
use crate::model::polygon;
use crate::model::{Ifs, Primitive};
use crate::solid::{BOX_FACES, Crossings, Solid, SolidError, TriMesh, fans, rounding};
use disjoint::Body;
use glam::DVec3;
use growth::{Growth, Surface};
use lattice::Lattice;

/// What stands at the leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LevelPrimitive {
    /// The model's own solid.
    Stated,
    /// The model has none: the box of its attractor, each end the shortest decimal number within the interval that is proven for it.
    Box,
}

/// A level of a system, joined.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidLevel {
    /// The solid, in single precision. Its faces are those of copies: faces in one plane stay apart.
    pub solid: Solid,
    /// What was copied.
    pub primitive: LevelPrimitive,
    /// Copies that were joined.
    pub copies: f64,
    /// Faces that cancelled in pairs, in the last step.
    pub cancelled_faces: u64,
    /// Corners that were doubled, because parts meet there, or along edges there, without being joined.
    pub doubled_vertices: u64,
    /// Pairs of triangles of the written mesh that meet elsewhere than where they are joined: contacts of doubled corners, and what rounding makes.
    pub contacts: u64,
    /// Volume of the exact solid, in mm^3.
    pub volume: Interval,
    /// Area of its surface, in mm^2.
    pub area: Interval,
    /// Its box.
    pub bounds: AxisBox,
    /// No point is farther from where the model's own numbers put it, in mm: what reading them as fractions and rounding to single precision takes.
    pub moved_mm: f64,
}

/// Why a level is no solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LevelError {
    /// There is no solid to copy.
    #[error("the model has no \"primitive\" with a \"solid\", and {reason}")]
    NoPrimitive {
        /// Why nothing stands for it.
        reason: &'static str,
    },
    /// The primitive is no solid.
    #[error("the primitive is no solid: {0}")]
    OpenPrimitive(SolidError),
    /// Faces of the primitive cross or touch.
    #[error("the primitive is no solid: its faces meet elsewhere than in common corners and edges")]
    CrossedPrimitive,
    /// A map is not a matrix of small fractions in the primitive's frame.
    #[error(
        "map {map} is not made of fractions with denominators up to {} in the frame of the primitive's edges, so that copies have no common lattice; give the model a primitive of its own that its maps move by such fractions, or a radius instead of a level",
        lattice::MOST_DENOMINATOR
    )]
    NoLattice {
        /// The map.
        map: usize,
    },
    /// A map takes volume to none.
    #[error("map {map} flattens the primitive: its determinant is 0")]
    Flattens {
        /// The map.
        map: usize,
    },
    /// A copy is not within the primitive.
    #[error(
        "copy {map} of the primitive is not within it (nor within its box), so that copies of copies are not known to be apart; give a primitive that holds its copies, or a radius instead of a level"
    )]
    Leaves {
        /// The map.
        map: usize,
    },
    /// Two copies overlap.
    #[error(
        "copies {first} and {second} of the primitive (or of its box) are not proven to be apart; give a smaller primitive, or a radius instead of a level"
    )]
    Overlaps {
        /// A map.
        first: usize,
        /// Another.
        second: usize,
    },
    /// Faces of copies overlap without being the same.
    #[error(
        "{pairs} pairs of faces meet elsewhere than in common corners and edges: copies touch along parts of faces; give the primitive smaller faces, or a radius instead of a level"
    )]
    PartialFaces {
        /// How many.
        pairs: u64,
    },
    /// Parts meet in an edge whose ends are joined otherwise.
    #[error(
        "at level {level} parts meet along edges so that no doubling of corners makes a manifold surface; give a radius instead of a level"
    )]
    Pinched {
        /// The level.
        level: u32,
    },
    /// The lattice is too fine for double or single precision.
    #[error("level {level} has coordinates that {digits} cannot tell apart; level {passes} would pass")]
    TooFine {
        /// What was asked.
        level: u32,
        /// Which numbers.
        digits: &'static str,
        /// The last level that is possible.
        passes: u32,
    },
    /// More triangles than allowed.
    #[error("level {level} has about {asked:.3e} triangles, and {allowed} are allowed; level {passes} would pass")]
    Triangles {
        /// What was asked.
        level: u32,
        /// Triangles, extrapolated.
        asked: f64,
        /// The limit.
        allowed: u64,
        /// The last level within it.
        passes: u32,
    },
    /// More memory than allowed.
    #[error("level {level} needs about {asked:.3e} bytes, and {allowed} are allowed; level {passes} would pass")]
    Memory {
        /// What was asked.
        level: u32,
        /// Bytes, extrapolated.
        asked: f64,
        /// The limit.
        allowed: u64,
        /// The last level within it.
        passes: u32,
    },
    /// Somebody stopped the work.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl LevelError {
    /// How a caller should react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::NoPrimitive { .. } | Self::OpenPrimitive(_) | Self::CrossedPrimitive | Self::Flattens { .. } => Kind::Invalid,
            Self::TooFine { .. } | Self::Triangles { .. } | Self::Memory { .. } => Kind::Limit,
            Self::Stopped(stopped) => stopped.kind(),
            _ => Kind::Unreachable,
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoPrimitive { .. } => "level.no-primitive",
            Self::OpenPrimitive(_) | Self::CrossedPrimitive => "level.open-primitive",
            Self::NoLattice { .. } => "level.no-lattice",
            Self::Flattens { .. } => "level.flat-map",
            Self::Leaves { .. } => "level.copy-outside",
            Self::Overlaps { .. } => "level.overlap",
            Self::PartialFaces { .. } => "level.partial-faces",
            Self::Pinched { .. } => "level.pinched",
            Self::TooFine { .. } => "limit.depth",
            Self::Triangles { .. } => "limit.triangles",
            Self::Memory { .. } => "limit.memory",
            Self::Stopped(stopped) => stopped.code(),
        }
    }

    /// The limit that was hit, with the level that would pass.
    #[must_use]
    pub fn limit(&self) -> Option<LimitFacts> {
        let facts =
            |limit, asked, allowed, passes: u32| Some(LimitFacts { limit, asked, allowed, remedy: Some(("level", f64::from(passes))) });
        match *self {
            Self::TooFine { level, passes, .. } => facts("level", f64::from(level), f64::from(passes), passes),
            Self::Triangles { asked, allowed, passes, .. } => facts("triangles", asked, allowed as f64, passes),
            Self::Memory { asked, allowed, passes, .. } => facts("memory_bytes", asked, allowed as f64, passes),
            _ => None,
        }
    }
}

/// What [`predict`] says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelPrediction {
    /// Triangles: counted for small levels, else extrapolated from the growth of the last two that were counted.
    pub triangles: f64,
    /// Peak of the memory that is accounted, in bytes.
    pub memory_bytes: f64,
}

/// The level of a system as a solid. `bounds` is the box of its attractor, for models without a primitive.
///
/// # Errors
/// [`LevelError`].
pub fn solid_level(ifs: &Ifs, bounds: &AxisBox, level: u32, budget: &Budget) -> Result<SolidLevel, LevelError> {
    let start = Start::new(ifs, bounds, level, budget)?;
    let mut growth = Growth::new(&start.lattice, &start.surface, sets(ifs));
    for _ in 0..level {
        growth.check(level, budget)?;
        growth.step(budget)?;
    }
    growth.check_result(level, budget)?;
    let cancelled_faces = growth.cancelled;
    let (surface, copies, determinants) = growth.finish();
    start.finish(level, &surface, copies, determinants, cancelled_faces, budget)
}

/// What [`solid_level`] would cost. Levels are counted up to some hundred thousand faces.
///
/// # Errors
/// As [`solid_level`], for what shows before the surface is made; limits are not errors here.
pub fn predict(ifs: &Ifs, bounds: &AxisBox, level: u32, budget: &Budget) -> Result<LevelPrediction, LevelError> {
    let start = Start::new(ifs, bounds, level, budget)?;
    let mut growth = Growth::new(&start.lattice, &start.surface, sets(ifs));
    for _ in 0..level {
        if growth.bytes() > COUNTED_BYTES {
            break;
        }
        growth.step(budget)?;
    }
    Ok(growth.prediction(level))
}

/// Memory up to which levels are counted for a prediction.
const COUNTED_BYTES: f64 = 2e7;

/// Which maps come first, and which after each: sets by number, and the number of the set after each map.
fn sets(ifs: &Ifs) -> (Vec<Vec<usize>>, Vec<usize>) {
    let count = ifs.maps.len();
    let Some(graph) = &ifs.graph else {
        // A map that repeats another adds nothing to the union.
        let distinct = (0..count).filter(|&i| ifs.maps[..i].iter().all(|map| map != &ifs.maps[i])).collect();
        return (vec![distinct], vec![0; count]);
    };
    let mut sets: Vec<Vec<usize>> = vec![(0..count).collect()];
    let after = graph
        .iter()
        .map(|row| {
            let mut row = row.clone();
            row.sort_unstable();
            row.dedup();
            sets.iter().position(|known| *known == row).unwrap_or_else(|| {
                sets.push(row);
                sets.len() - 1
            })
        })
        .collect();
    (sets, after)
}

/// The triangles of faces. Faces that are not star-shaped from their first corner become their triangles.
fn cut(vertices: &[DVec3], faces: &mut Vec<Vec<u32>>) -> Result<Vec<[u32; 3]>, LevelError> {
    let (mut triangles, mut pieces) = (Vec::new(), Vec::with_capacity(faces.len()));
    for face in faces.drain(..) {
        let first = triangles.len();
        polygon::cut(vertices, &face, &mut triangles)
            .map_err(|_| LevelError::NoPrimitive { reason: "one of its faces meets itself; split it into faces that do not" })?;
        if polygon::is_fan(&triangles[first..]) {
            pieces.push(face);
        } else {
            pieces.extend(triangles[first..].iter().map(|corners| corners.to_vec()));
        }
    }
    *faces = pieces;
    Ok(triangles)
}

/// What is known before anything is copied.
struct Start {
    lattice: Lattice,
    body: Body,
    surface: Surface,
    primitive: LevelPrimitive,
}

impl Start {
    fn new(ifs: &Ifs, bounds: &AxisBox, level: u32, budget: &Budget) -> Result<Self, LevelError> {
        let (vertices, mut faces, primitive) = match &ifs.primitive {
            Some(Primitive::Solid { vertices, faces }) => (vertices.clone(), faces.clone(), LevelPrimitive::Stated),
            Some(_) => return Err(LevelError::NoPrimitive { reason: "points, polylines and surfaces enclose nothing" }),
            None => {
                let (vertices, faces) = default_box(bounds)?;
                (vertices, faces, LevelPrimitive::Box)
            }
        };
        let triangles = cut(&vertices, &mut faces)?;
        let mesh = TriMesh { vertices, triangles };
        Solid::new(mesh.clone(), budget).map_err(|error| match error {
            SolidError::Stopped(stopped) => LevelError::Stopped(stopped),
            other => LevelError::OpenPrimitive(other),
        })?;
        if Crossings::of(&mesh, budget)?.count > 0 {
            return Err(LevelError::CrossedPrimitive);
        }
        let (lattice, corners) = Lattice::read(&ifs.maps, &mesh, &faces)?;
        let surface = Surface::new(corners, &faces);
        let body = disjoint::prove(&lattice, &surface, &sets(ifs).0, budget)?;
        lattice.check_depth(level)?;
        Ok(Self { lattice, body, surface, primitive })
    }

    /// The surface as a proven solid in mm.
    fn finish(
        self,
        level: u32,
        surface: &Surface,
        copies: f64,
        determinants: f64,
        cancelled_faces: u64,
        budget: &Budget,
    ) -> Result<SolidLevel, LevelError> {
        let Self { lattice, body, surface: first, primitive } = self;
        let grid = disjoint::is_grid(&lattice, &first);
        let mut triangles = surface.triangles();
        if !grid {
            // Integers below 2^53 are exact as numbers of double precision, and so are the signs that are looked at.
            let exact = TriMesh { vertices: surface.points.iter().map(|p| DVec3::from_array(p.map(|x| x as f64))).collect(), triangles };
            let found = Crossings::of(&exact, budget)?;
            if found.count > 0 {
                return Err(LevelError::PartialFaces { pairs: found.count });
            }
            triangles = exact.triangles;
        }
        let unit = lattice.unit(level);
        let place = |p: &lattice::Point| lattice.place(p, unit);
        let exact_mesh = TriMesh { vertices: surface.points.iter().map(place).collect(), triangles };
        let exact_area = area_within(&exact_mesh);
        let bounds = box_of(&exact_mesh.vertices);
        let narrow = |vertices: &[DVec3]| -> Vec<DVec3> { vertices.iter().map(|p| p.as_vec3().as_dvec3()).collect() };
        let mut mesh = TriMesh { vertices: narrow(&exact_mesh.vertices), triangles: exact_mesh.triangles };
        let parallel = grid && lattice.is_parallel();
        if parallel && !lattice.is_told_apart(level) {
            return Err(lattice.too_fine_for_singles(level));
        }
        let mut doubled_vertices = 0;
        let solid = match Solid::new(mesh, budget) {
            Ok(solid) => solid,
            Err(SolidError::NotManifold(topology)) if topology.degenerate_triangles == 0 => {
                // Coordinates are integers below 2^53.
                let exact = |corner: u32| surface.points[corner as usize].map(|x| x as f64);
                let apart = fans::part(&exact, &surface.triangles(), budget)?;
                doubled_vertices = (apart.origins.len() - surface.points.len()) as u64;
                let places: Vec<DVec3> = apart.origins.iter().map(|&corner| place(&surface.points[corner as usize])).collect();
                let vertices = narrow(&places);
                mesh = TriMesh { vertices, triangles: apart.triangles };
                Solid::new(mesh, budget).map_err(|error| match error {
                    SolidError::Stopped(stopped) => LevelError::Stopped(stopped),
                    _ => LevelError::Pinched { level },
                })?
            }
            Err(SolidError::Stopped(stopped)) => return Err(stopped.into()),
            Err(_) => return Err(lattice.too_fine_for_singles(level)),
        };
        // On a grid along the axes, rounding keeps the order of the planes of the grid: rectangles stay rectangles, and meet only as before.
        let contacts = if parallel && doubled_vertices == 0 { 0 } else { Crossings::of(solid.mesh(), budget)?.count };
        let enclosed = volume_within(&first.placed(&lattice));
        let extent = solid.mesh().vertices.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let moved_mm = lattice.moved_mm(&body.corners, level) + rounding(extent);
        let relative = |low: f64, high: f64| Interval { low: low * (1.0 - CORNERS), high: high * (1.0 + CORNERS) };
        Ok(SolidLevel {
            solid,
            primitive,
            copies,
            cancelled_faces,
            doubled_vertices,
            contacts,
            volume: relative(enclosed.low * determinants, enclosed.high * determinants),
            area: relative(exact_area.low, exact_area.high),
            bounds,
            moved_mm,
        })
    }
}

/// Relative rounding of what is measured on corners that were rounded: each is off by some 8 roundings of the whole shape, which has fewer than 2^13 faces side by side.
const CORNERS: f64 = 66_000.0 * f64::EPSILON;

fn box_of(points: &[DVec3]) -> AxisBox {
    let low = points.iter().copied().reduce(DVec3::min).unwrap_or_default();
    let high = points.iter().copied().reduce(DVec3::max).unwrap_or_default();
    // A corner is the sum of four products.
    let slack = 8.0 * f64::EPSILON * (low.abs().max(high.abs()).max_element() + (high - low).max_element());
    let around = |corner: DVec3| corner.to_array().map(|x| Interval { low: x - slack, high: x + slack });
    AxisBox { low: around(low), high: around(high) }
}

/// A box as a primitive: corners and outward faces.
fn default_box(bounds: &AxisBox) -> Result<(Vec<DVec3>, Vec<Vec<u32>>), LevelError> {
    let ends = [bounds.low, bounds.high].map(|corner| DVec3::from_array(corner.map(shortest)));
    if ends[0].cmpge(ends[1]).any() {
        return Err(LevelError::NoPrimitive { reason: "its attractor is flat, so that its box encloses nothing either" });
    }
    let corner = |code: usize| DVec3::from_array(std::array::from_fn(|axis| ends[code >> axis & 1][axis]));
    Ok(((0..8).map(corner).collect(), BOX_FACES.map(|face| face.to_vec()).to_vec()))
}

/// The number with the fewest decimals in an interval; its middle where it holds none with 15.
fn shortest(interval: Interval) -> f64 {
    let middle = 0.5 * (interval.low + interval.high);
    let decimals = (0..16).map(|digits| {
        let scale = 10.0_f64.powi(digits);
        (middle * scale).round() / scale
    });
    decimals.into_iter().find(|x| interval.low <= *x && *x <= interval.high).map_or(middle, |x| x + 0.0)
}

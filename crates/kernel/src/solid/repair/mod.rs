//! A mesh that is no solid made one, where what is meant leaves no doubt: names of vertices, copies, directions of triangles, small holes.
//!
//! The points of the surface stay where they are: nothing is moved, and only small holes are filled, between corners that are there. Which side of it is material follows from the surface alone, whatever way its
//! triangles run: a line from there to infinity passes through it an odd number of times. So shells within shells are voids, and solids in voids are solids.

mod clean;
mod facing;
mod fill;

use super::shells::Shells;
use super::{Crossings, Solid, SolidError, TriMesh, fans};
use crate::budget::{Budget, Stopped};
use clean::{is_without_area, join, remove_collapsed, remove_copies, remove_flat};
use facing::Facing;
use fill::{Filled, fill};
use glam::DVec3;
use rayon::prelude::*;

/// What a repair did. All counts but that of the crossings are 0 for a mesh that was left as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Repair {
    /// Vertices that became one with another at the same place.
    pub joined_vertices: u64,
    /// Triangles without area that were taken away.
    pub flat_triangles: u64,
    /// Triangles with the corners of another that were taken away, and walls between pieces that fill the space on both sides.
    pub copied_triangles: u64,
    /// Holes that were closed.
    pub filled_holes: u64,
    /// Triangles that close them.
    pub filling_triangles: u64,
    /// Edges around the longest of the holes.
    pub longest_hole_edges: u64,
    /// Edges of four triangles or more, around which those were joined that bound the same wedge of material.
    pub parted_edges: u64,
    /// Vertices that were doubled, so that parts that meet there only are not joined.
    pub doubled_vertices: u64,
    /// Triangles that were turned around.
    pub turned_triangles: u64,
    /// Shells within others most of whose triangles looked outward, as those of material do, and which became voids, unless the whole mesh was inside out.
    pub shells_made_voids: u64,
    /// Pairs of triangles that meet elsewhere than in common corners and edges, which no repair changes.
    pub crossings: u64,
}

impl Repair {
    /// Whether anything was done.
    #[must_use]
    pub fn is_change(&self) -> bool {
        *self != Self { crossings: self.crossings, ..Self::default() }
    }
}

/// A mesh after its repair.
#[derive(Clone, Debug, PartialEq)]
pub struct Repaired {
    /// The solid, its triangles in their order; `None` when the mesh that was given is one and was left as it is.
    pub solid: Option<Solid>,
    /// What was done.
    pub repair: Repair,
}

/// Why a mesh cannot be repaired.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RepairError {
    /// No triangle bounds anything.
    #[error("no triangle is left that bounds a volume")]
    Empty,
    /// Triangles without area that cannot be taken away without a crack.
    #[error("{count} triangles without area cannot be taken away without a crack, the first at {at}")]
    Flat {
        /// How many.
        count: u64,
        /// A corner of the first.
        at: DVec3,
    },
    /// The surface has a border.
    #[error("{boundary} edges have one triangle only and {odd} have three, five or more, the first from {from} to {to}")]
    Open {
        /// Edges with one triangle.
        boundary: u64,
        /// Edges with another odd number.
        odd: u64,
        /// Where the first of all starts.
        from: DVec3,
        /// Where it ends.
        to: DVec3,
    },
    /// A hole that is not closed.
    #[error("the hole of {edges} edges at {at} is not closed: {reason}")]
    Hole {
        /// Edges around it.
        edges: u64,
        /// A corner of it.
        at: DVec3,
        /// Why.
        reason: Unfilled,
    },
    /// A surface with one side.
    #[error("the surface around {at} has one side only, as a Moebius strip has, so that nothing is within it")]
    OneSided {
        /// A corner of it.
        at: DVec3,
    },
    /// Triangles cross, and the sides of the surface are not known from their directions.
    #[error(
        "{count} pairs of triangles meet elsewhere than in common corners and edges, the first at {at}, so that inside and outside are not defined"
    )]
    Crossing {
        /// How many pairs.
        count: u64,
        /// A corner of the first.
        at: DVec3,
    },
    /// Triangles so narrow that no line through them is known.
    #[error("all triangles around {at} are too narrow for double precision")]
    Narrow {
        /// A corner of one.
        at: DVec3,
    },
    /// What is left after all that is no solid.
    #[error("after the repair the mesh is still no solid: {0}")]
    NoSolid(SolidError),
    /// Somebody stopped it.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// Why a hole is not closed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Unfilled {
    /// It is long.
    #[error("holes of at most {most} edges are")]
    Long {
        /// Edges, at most.
        most: u64,
    },
    /// It is large.
    #[error("triangles across all holes would have {share:.3} of the area of the surface, and may have {most}")]
    Large {
        /// Area of all fillings, against the surface.
        share: f64,
        /// That share, at most.
        most: f64,
    },
    /// No way to close it was found.
    #[error("no triangles between its corners were found that meet neither each other nor the rest of the surface")]
    Crossing,
}

impl RepairError {
    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Empty => "repair.empty",
            Self::Flat { .. } => "repair.flat",
            Self::Open { .. } => "repair.open",
            Self::Hole { .. } => "repair.hole",
            Self::OneSided { .. } => "repair.one-sided",
            Self::Crossing { .. } => "repair.crossing",
            Self::Narrow { .. } => "repair.narrow",
            Self::NoSolid(_) => "repair.no-solid",
            Self::Stopped(stopped) => stopped.code(),
        }
    }
}

/// Repairs a mesh: vertices at the same place are joined, triangles without area and copies are taken away, small holes are closed, triangles are turned so that material lies behind them,
/// and corners are doubled where parts meet in edges or corners only. A mesh that is a solid already and whose shells look where they should is left as it is.
/// Cost: n log n.
///
/// # Errors
/// [`RepairError`] with the first place, and a corner that names no vertex as [`RepairError::NoSolid`].
pub fn repair(mesh: &TriMesh, budget: &Budget) -> Result<Repaired, RepairError> {
    let given = match Solid::new(mesh.clone(), budget) {
        Err(SolidError::Stopped(stopped)) => return Err(stopped.into()),
        Err(error @ SolidError::Index { .. }) => return Err(RepairError::NoSolid(error)),
        given => given.is_ok(),
    };
    let mut clean = mesh.clone();
    let joined_vertices = join(&clean.vertices, &mut clean.triangles);
    let collapsed = remove_collapsed(&mut clean.triangles);
    let mut copied_triangles = remove_copies(&mut clean.triangles);
    let in_a_line = remove_flat(&clean.vertices, &mut clean.triangles);
    if in_a_line > 0 {
        // What was cut may have become what was there already.
        copied_triangles += remove_copies(&mut clean.triangles);
    }
    let flat_triangles = collapsed + in_a_line;
    budget.cancel.check()?;
    if clean.triangles.is_empty() {
        return Err(RepairError::Empty);
    }
    let flat: Vec<u32> = (0..clean.triangles.len() as u32)
        .into_par_iter()
        .filter(|&t| is_without_area(&clean.vertices, clean.triangles[t as usize]))
        .collect();
    if let Some(&first) = flat.first() {
        return Err(RepairError::Flat { count: flat.len() as u64, at: first_corner(&clean, first) });
    }
    let Filled { holes: filled_holes, triangles: filling_triangles, longest: longest_hole_edges } =
        fill(&clean.vertices, &mut clean.triangles, budget)?;
    let Patches { patches, against, parted_edges } = Patches::of(&clean)?;
    let found = Crossings::of(&clean, budget)?;
    let turned = match found.first.first() {
        None => turned(&clean, &patches, &against, budget)?,
        // Where nothing has to be decided, nothing is.
        Some(_) if parted_edges == 0 && against.iter().all(|&against| !against) => against,
        Some(pair) => return Err(RepairError::Crossing { count: found.count, at: first_corner(&clean, pair[0]) }),
    };
    let turned_triangles = turned.iter().filter(|&&turned| turned).count() as u64;
    if given && flat_triangles + copied_triangles + turned_triangles == 0 {
        return Ok(Repaired { solid: None, repair: Repair { crossings: found.count, ..Repair::default() } });
    }
    clean.triangles.iter_mut().zip(&turned).filter(|(_, turned)| **turned).for_each(|(corners, _)| corners.swap(1, 2));
    let parted = fans::part(&|vertex| clean.vertices[vertex as usize].to_array(), &clean.triangles, budget)?;
    let mut used = vec![false; clean.vertices.len()];
    clean.triangles.iter().flatten().for_each(|&corner| used[corner as usize] = true);
    let doubled_vertices = (parted.origins.len() - used.iter().filter(|&&used| used).count()) as u64;
    let vertices = parted.origins.iter().map(|&vertex| clean.vertices[vertex as usize]).collect();
    let solid = Solid::new(TriMesh { vertices, triangles: parted.triangles }, budget).map_err(|error| match error {
        SolidError::Stopped(stopped) => RepairError::Stopped(stopped),
        other => RepairError::NoSolid(other),
    })?;
    let repair = Repair {
        joined_vertices,
        flat_triangles,
        copied_triangles,
        filled_holes,
        filling_triangles,
        longest_hole_edges,
        parted_edges,
        doubled_vertices,
        turned_triangles,
        shells_made_voids: shells_made_voids(solid.mesh(), &turned),
        crossings: found.count,
    };
    Ok(Repaired { solid: Some(solid), repair })
}

/// How many shells became voids whose triangles, which are in their order, were turned for the most part.
fn shells_made_voids(mesh: &TriMesh, turned: &[bool]) -> u64 {
    if turned.iter().all(|&turned| turned) {
        return 0;
    }
    let shells = Shells::of(mesh);
    let mut surplus = vec![0_i64; shells.volumes.len()];
    for (corners, &turned) in mesh.triangles.iter().zip(turned) {
        surplus[shells.with(corners[0])] += if turned { 1 } else { -1 };
    }
    surplus.iter().zip(&shells.volumes).filter(|&(&surplus, &volume)| surplus > 0 && volume < 0.0).count() as u64
}

fn first_corner(mesh: &TriMesh, triangle: u32) -> DVec3 {
    mesh.vertices[mesh.triangles[triangle as usize][0] as usize]
}

/// Parts of a surface whose triangles hang together by edges of two.
struct Patches {
    /// The triangles of every part.
    patches: Vec<Vec<u32>>,
    /// Of every triangle, whether it runs against the first one of its part.
    against: Vec<bool>,
    /// Edges of four triangles or more.
    parted_edges: u64,
}

impl Patches {
    fn of(mesh: &TriMesh) -> Result<Self, RepairError> {
        let triangles = &mesh.triangles;
        let corner = |half: u32| triangles[half as usize / 3][half as usize % 3];
        let end = |half: u32| triangles[half as usize / 3][(half as usize + 1) % 3];
        let edge_of = |half: u32| [corner(half).min(end(half)), corner(half).max(end(half))];
        let mut halves: Vec<([u32; 2], u32)> = (0..3 * triangles.len() as u32).into_par_iter().map(|half| (edge_of(half), half)).collect();
        halves.par_sort_unstable();
        let mut twins = vec![u32::MAX; halves.len()];
        let (mut boundary, mut odd, mut parted_edges, mut first) = (0, 0, 0, None);
        for edge in halves.chunk_by(|p, q| p.0 == q.0) {
            match edge {
                [(_, one), (_, other)] => (twins[*one as usize], twins[*other as usize]) = (*other, *one),
                _ if edge.len().is_multiple_of(2) => parted_edges += 1,
                _ => {
                    first.get_or_insert(edge[0].0);
                    if edge.len() == 1 { boundary += 1 } else { odd += 1 }
                }
            }
        }
        if let Some(ends) = first {
            let [from, to] = ends.map(|vertex| mesh.vertices[vertex as usize]);
            return Err(RepairError::Open { boundary, odd, from, to });
        }
        let (mut against, mut met) = (vec![false; triangles.len()], vec![false; triangles.len()]);
        let mut patches = Vec::new();
        for start in 0..triangles.len() as u32 {
            if met[start as usize] {
                continue;
            }
            met[start as usize] = true;
            let (mut patch, mut next) = (vec![start], 0);
            while let Some(&triangle) = patch.get(next) {
                next += 1;
                for half in 3 * triangle..3 * triangle + 3 {
                    let twin = twins[half as usize];
                    if twin == u32::MAX {
                        continue;
                    }
                    let neighbour = twin / 3;
                    // Neighbours that agree run along their edge in opposite directions.
                    let wanted = against[triangle as usize] != (corner(half) == corner(twin));
                    if !met[neighbour as usize] {
                        met[neighbour as usize] = true;
                        against[neighbour as usize] = wanted;
                        patch.push(neighbour);
                    } else if against[neighbour as usize] != wanted {
                        return Err(RepairError::OneSided { at: mesh.vertices[corner(half) as usize] });
                    }
                }
            }
            patches.push(patch);
        }
        Ok(Self { patches, against, parted_edges })
    }
}

/// Which triangles have to be turned so that material lies behind all.
fn turned(mesh: &TriMesh, patches: &[Vec<u32>], against: &[bool], budget: &Budget) -> Result<Vec<bool>, RepairError> {
    let facing = Facing::new(mesh);
    let inward = |patch: &Vec<u32>| {
        budget.cancel.check()?;
        let told = patch.iter().find_map(|&triangle| Some(facing.looks_outward(triangle)? == against[triangle as usize]));
        told.ok_or_else(|| RepairError::Narrow { at: mesh.vertices[mesh.triangles[patch[0] as usize][0] as usize] })
    };
    // In their order, so that the first one at fault is told whatever the number of threads.
    let inward: Vec<Result<bool, RepairError>> = patches.par_iter().map(inward).collect();
    let mut turned = against.to_vec();
    for (patch, inward) in patches.iter().zip(inward) {
        if inward? {
            patch.iter().for_each(|&triangle| turned[triangle as usize] ^= true);
        }
    }
    Ok(turned)
}

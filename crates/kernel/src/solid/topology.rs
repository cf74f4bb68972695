//! Counting a triangle mesh's topology, from the triangles around each vertex.

use super::shells::Shells;
use super::{SolidError, TriMesh};
use crate::budget::Budget;
use glam::DVec3;
use rayon::prelude::*;

/// Counts of a triangle mesh's topology.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// Vertices that triangles use.
    pub vertices: u64,
    /// Edges.
    pub edges: u64,
    /// Triangles.
    pub triangles: u64,
    /// Connected surfaces (connected through vertices).
    pub shells: u64,
    /// Shells of negative volume: sealed voids.
    pub cavities: u64,
    /// Connected pieces of material: the other shells.
    pub components: u64,
    /// Sum of the shells' genera: shells - euler / 2. Meaningful for closed manifolds.
    pub genus: i64,
    /// vertices - edges + triangles.
    pub euler: i64,
    /// Edges with one triangle.
    pub boundary_edges: u64,
    /// Edges with three triangles or more.
    pub nonmanifold_edges: u64,
    /// Vertices whose triangles form several fans.
    pub nonmanifold_vertices: u64,
    /// Edges with two triangles that run along them in the same direction.
    pub flipped_pairs: u64,
    /// Triangles with a repeated corner or no area.
    pub degenerate_triangles: u64,
}

/// Vertices handled together.
const CHUNK: usize = 1 << 14;

impl Topology {
    /// Counts a mesh. Cost: linear in the triangles; 20 bytes a triangle of working memory.
    ///
    /// # Errors
    /// [`SolidError::Index`] for a corner without vertex, [`SolidError::Stopped`].
    pub fn of(mesh: &TriMesh, budget: &Budget) -> Result<Self, SolidError> {
        let count = mesh.vertices.len();
        let missing = |(triangle, corners): (usize, &[u32; 3])| {
            let vertex = corners.iter().copied().find(|&corner| corner as usize >= count)?;
            Some(SolidError::Index { triangle, vertex, vertices: count })
        };
        if let Some(error) = mesh.triangles.par_iter().enumerate().find_map_first(missing) {
            return Err(error);
        }
        budget.report("verify", 0.0, 0);
        let around = Incidence::new(mesh.vertices.len(), &mesh.triangles);
        budget.cancel.check()?;
        let chunks = count.div_ceil(CHUNK);
        let mut topology = (0..chunks)
            .into_par_iter()
            .map(|chunk| {
                let mut part = Self::default();
                let mut link = Vec::new();
                for vertex in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
                    around.link(&mesh.triangles, vertex as u32, &mut link);
                    part.add_vertex(vertex as u32, &mut link);
                }
                part
            })
            .reduce(Self::default, Self::plus);
        drop(around);
        budget.cancel.check()?;
        budget.report("verify", 0.5, mesh.triangles.len() as u64);
        topology.triangles = mesh.triangles.len() as u64;
        topology.degenerate_triangles = mesh.triangles.par_iter().filter(|corners| is_degenerate(mesh, corners)).count() as u64;
        topology.euler = topology.vertices as i64 - topology.edges as i64 + topology.triangles as i64;
        topology.count_shells(mesh);
        topology.genus = topology.shells as i64 - topology.euler.div_euclid(2);
        budget.cancel.check()?;
        budget.report("verify", 1.0, mesh.triangles.len() as u64);
        Ok(topology)
    }

    /// Whether the mesh is a closed, oriented 2-manifold without degenerate triangles.
    #[must_use]
    pub fn is_closed_manifold(&self) -> bool {
        let faults = self.boundary_edges + self.nonmanifold_edges + self.nonmanifold_vertices + self.flipped_pairs;
        faults + self.degenerate_triangles == 0 && self.triangles > 0
    }

    fn plus(mut self, other: Self) -> Self {
        self.vertices += other.vertices;
        self.edges += other.edges;
        self.boundary_edges += other.boundary_edges;
        self.nonmanifold_edges += other.nonmanifold_edges;
        self.nonmanifold_vertices += other.nonmanifold_vertices;
        self.flipped_pairs += other.flipped_pairs;
        self
    }

    /// Adds a vertex whose triangles are (vertex, b, c) for the pairs (b, c) of `link`, and the edges to
    /// vertices of higher index.
    fn add_vertex(&mut self, vertex: u32, link: &mut [(u32, u32)]) {
        if link.is_empty() {
            return;
        }
        self.vertices += 1;
        if is_cycle(link) {
            self.edges += link.iter().filter(|&&(b, _)| b > vertex).count() as u64;
            return;
        }
        // (neighbour, whether the edge leaves the vertex), sorted: runs are edges.
        let mut ends: Vec<(u32, bool)> = link.iter().flat_map(|&(b, c)| [(b, true), (c, false)]).collect();
        ends.sort_unstable();
        for run in ends.chunk_by(|p, q| p.0 == q.0) {
            if run[0].0 > vertex {
                self.edges += 1;
                match run {
                    [_] => self.boundary_edges += 1,
                    [p, q] => self.flipped_pairs += u64::from(p.1 == q.1),
                    _ => self.nonmanifold_edges += 1,
                }
            }
        }
        self.nonmanifold_vertices += u64::from(fans(link) > 1);
    }

    /// The sign of each shell's volume tells cavities.
    fn count_shells(&mut self, mesh: &TriMesh) {
        let volumes = Shells::of(mesh).volumes;
        self.shells = volumes.len() as u64;
        self.cavities = volumes.iter().filter(|&&volume| volume < 0.0).count() as u64;
        self.components = self.shells - self.cavities;
    }
}

fn is_degenerate(mesh: &TriMesh, &[a, b, c]: &[u32; 3]) -> bool {
    a == b || b == c || c == a || has_no_area([a, b, c].map(|corner| mesh.vertices[corner as usize]))
}

/// Whether the area of a triangle vanishes in double precision: such triangles are counted as degenerate.
pub(crate) fn has_no_area([a, b, c]: [DVec3; 3]) -> bool {
    (b - a).cross(c - a).length_squared() <= 0.0
}

/// Whether the pairs (b, c) are the steps of one cycle that comes nowhere twice: a closed, oriented, manifold fan. Sorts them, because one vertex
/// may be a corner of all triangles.
fn is_cycle(link: &mut [(u32, u32)]) -> bool {
    link.sort_unstable();
    // Where two steps begin at the same neighbour, four triangles meet in the edge to it.
    if link.windows(2).any(|pair| pair[0].0 == pair[1].0) {
        return false;
    }
    let start = link[0].0;
    let mut current = link[0].1;
    for _ in 1..link.len() {
        if current == start {
            return false;
        }
        let Ok(next) = link.binary_search_by_key(&current, |step| step.0) else { return false };
        current = link[next].1;
    }
    current == start
}

/// Number of connected groups of triangles around a vertex, joined by common neighbours.
fn fans(link: &[(u32, u32)]) -> usize {
    let mut groups: Vec<usize> = (0..link.len()).collect();
    let mut ends: Vec<(u32, usize)> = link.iter().enumerate().flat_map(|(index, &(b, c))| [(b, index), (c, index)]).collect();
    ends.sort_unstable();
    let root = |groups: &mut Vec<usize>, mut index: usize| {
        while groups[index] != index {
            groups[index] = groups[groups[index]];
            index = groups[index];
        }
        index
    };
    for pair in ends.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        let (p, q) = (root(&mut groups, pair[0].1), root(&mut groups, pair[1].1));
        groups[p.max(q)] = p.min(q);
    }
    (0..link.len()).filter(|&index| groups[index] == index).count()
}

/// The triangles at each vertex.
#[derive(Clone)]
pub(crate) struct Incidence {
    offsets: Vec<u32>,
    triangles: Vec<u32>,
}

impl Incidence {
    /// Those of triangles over so many vertices.
    pub(crate) fn new(vertices: usize, all: &[[u32; 3]]) -> Self {
        let mut offsets = vec![0_u32; vertices + 1];
        for corner in all.iter().flatten() {
            offsets[*corner as usize + 1] += 1;
        }
        for index in 1..offsets.len() {
            offsets[index] += offsets[index - 1];
        }
        let mut triangles = vec![0_u32; all.len() * 3];
        // Filling from the end of each list leaves the offsets at their starts.
        let mut ends = offsets[1..].to_vec();
        for (triangle, corners) in all.iter().enumerate().rev() {
            for &corner in corners {
                ends[corner as usize] -= 1;
                triangles[ends[corner as usize] as usize] = triangle as u32;
            }
        }
        Self { offsets, triangles }
    }

    /// How many triangles are at a vertex at most.
    pub(crate) fn most(&self) -> usize {
        self.offsets.windows(2).map(|pair| (pair[1] - pair[0]) as usize).max().unwrap_or(0)
    }

    /// The triangles at a vertex, in their order.
    pub(crate) fn at(&self, vertex: u32) -> &[u32] {
        &self.triangles[self.offsets[vertex as usize] as usize..self.offsets[vertex as usize + 1] as usize]
    }

    /// Whether a vertex's triangles are one closed fan, or it has none; `link` is working memory.
    pub(crate) fn is_ring(&self, triangles: &[[u32; 3]], vertex: u32, link: &mut Vec<(u32, u32)>) -> bool {
        self.link(triangles, vertex, link);
        link.is_empty() || is_cycle(link)
    }

    fn link(&self, triangles: &[[u32; 3]], vertex: u32, link: &mut Vec<(u32, u32)>) {
        link.clear();
        link.extend(self.at(vertex).iter().map(|&triangle| {
            let corners = triangles[triangle as usize];
            let at = corners.iter().position(|&corner| corner == vertex).unwrap_or(0);
            (corners[(at + 1) % 3], corners[(at + 2) % 3])
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk about vertex 0, its triangles in an order that a search from the front finds last: it would take most of a minute.
    #[test]
    fn a_vertex_of_all_triangles_is_counted() {
        const RIM: u32 = 300_000;
        let mut vertices = vec![DVec3::ZERO];
        vertices.extend(
            (0..RIM).map(|k| (std::f64::consts::TAU * f64::from(k) / f64::from(RIM)).sin_cos()).map(|(y, x)| DVec3::new(x, y, 0.0)),
        );
        let triangles = (0..RIM).rev().map(|k| [0, k + 1, (k + 1) % RIM + 1]).collect();
        let topology = Topology::of(&TriMesh { vertices, triangles }, &Budget::default()).expect("indices are valid");
        assert_eq!((topology.edges, topology.boundary_edges, topology.nonmanifold_vertices), (2 * u64::from(RIM), u64::from(RIM), 0));
    }

    /// Two tetrahedra on one edge: around its ends the triangles can be walked once through all, twice through the edge.
    #[test]
    fn an_edge_of_four_triangles_is_found_whatever_their_order() {
        let tetrahedron = |[a, b, c, d]: [u32; 4]| [[a, c, b], [a, b, d], [b, c, d], [a, d, c]];
        let all = [tetrahedron([0, 1, 2, 3]), tetrahedron([0, 1, 4, 5])].concat();
        let vertices: Vec<DVec3> = [[0, 0, 0], [0, 0, 9], [9, 0, 0], [0, 9, 0], [-9, 0, 0], [0, -9, 0]]
            .map(|at: [i32; 3]| DVec3::from_array(at.map(f64::from)))
            .to_vec();
        for turn in 0..all.len() {
            for turned in [false, true] {
                let mut triangles = all.clone();
                triangles.rotate_left(turn);
                if turned {
                    triangles.reverse();
                }
                let mesh = TriMesh { vertices: vertices.clone(), triangles };
                let topology = Topology::of(&mesh, &Budget::default()).expect("indices are valid");
                assert_eq!((topology.nonmanifold_edges, topology.edges), (1, 11), "turn {turn}, {turned}");
            }
        }
    }
}

//! Terrain by random midpoint displacement.
//!
//! Source: A. Fournier, D. Fussell, L. Carpenter, Computer rendering of stochastic models, Comm. ACM 25(6), 1982:
//! triangles are cut in four at the midpoints of their sides, and every midpoint's height moves at random, by less
//! and less from level to level.

use super::lower::Draft;
use super::mesh::{Interior, PolygonMesh};
use crate::split_mix;
use glam::DVec3;

/// A surface of triangles: a coarse one, cut in four `levels` times, midpoints moved along z.
///
/// The midpoint that is new at level k (from 1) moves by u s r^k, where r is the roughness, s half the length of the
/// longest coarse edge, and u uniform in [-1, 1), drawn for the place of the midpoint in the finest lattice: sides
/// that two triangles share are cut alike, and the same seed gives the same terrain. The surface is exact at its
/// finest level: finitely many triangles, none of them moved afterwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    /// The coarse surface.
    pub base: TerrainBase,
    /// r, at least 0 (flat) and below 1; 1/2 halves displacements with the edges.
    pub roughness: f64,
    /// How often triangles are cut in four.
    pub levels: u32,
    /// Which of the terrains.
    pub random_seed: u64,
}

/// What a terrain starts from, in mm.
#[derive(Clone, Debug, PartialEq)]
pub enum TerrainBase {
    /// One triangle.
    Triangle([DVec3; 3]),
    /// Rows of points, two or more of two or more; every square is cut along the diagonal from its first point.
    Grid(Vec<Vec<DVec3>>),
}

/// Triangles that a terrain may have; each is a cell of its own.
const MOST_TRIANGLES: u64 = 1 << 20;

impl Terrain {
    /// The mesh is the shape: O(4^levels) time and memory for each coarse triangle.
    pub(super) fn lower(&self, draft: &mut Draft) {
        let Some([rows, columns]) = self.checked(draft) else { return };
        let mesh = Lattice { terrain: self, rows, columns, cut: 1 << self.levels }.mesh();
        mesh.lower(draft);
    }

    /// The number of rows and columns, 2 and 2 for a triangle; `None` after an error.
    fn checked(&self, draft: &mut Draft) -> Option<[usize; 2]> {
        let before = draft.findings.len();
        let (sizes, member) = match &self.base {
            TerrainBase::Triangle(_) => ([2, 2], "triangle"),
            TerrainBase::Grid(rows) => ([rows.len(), rows.first().map_or(0, Vec::len)], "grid"),
        };
        if let TerrainBase::Grid(rows) = &self.base {
            if sizes[0] < 2 || sizes[1] < 2 {
                draft.error("/grid", "terrain.grid", format!("the grid is {} x {}, and needs two rows of two points", sizes[0], sizes[1]));
            }
            if let Some((index, row)) = rows.iter().enumerate().find(|(_, row)| row.len() != sizes[1]) {
                let message = format!("row {index} has {} points, and the first has {}; make them equal", row.len(), sizes[1]);
                draft.error(&format!("/grid/{index}"), "terrain.grid", message);
            }
        }
        if let Some((place, point)) = self.base.points().find(|(_, point)| !point.is_finite()) {
            draft.error(&format!("/{member}{place}"), "model.not-finite", format!("the point is {point}, and must be finite"));
        }
        if !(0.0..1.0).contains(&self.roughness) {
            draft.error(
                "/roughness",
                "terrain.roughness",
                format!("the roughness is {}, and must be at least 0 and below 1", self.roughness),
            );
        }
        let coarse = if matches!(self.base, TerrainBase::Triangle(_)) {
            1
        } else {
            2 * (sizes[0].saturating_sub(1) as u64).saturating_mul(sizes[1].saturating_sub(1) as u64)
        };
        // 4^levels, beyond any limit where it overflows.
        let pieces = 1_u64.checked_shl(self.levels.saturating_mul(2)).unwrap_or(u64::MAX);
        if coarse.saturating_mul(pieces) > MOST_TRIANGLES {
            let fits = (MOST_TRIANGLES / coarse.max(1)).checked_ilog(4);
            let way_out = fits.map_or("use a coarser grid".to_owned(), |levels| format!("use {levels} levels or fewer"));
            let message = format!("{coarse} x 4^{} triangles are more than the {MOST_TRIANGLES} allowed; {way_out}", self.levels);
            draft.error("/levels", "terrain.too-large", message);
        }
        (draft.findings.len() == before).then_some(sizes)
    }
}

impl TerrainBase {
    /// Every point with its place below the member.
    fn points(&self) -> impl Iterator<Item = (String, DVec3)> + '_ {
        let (corners, rows): (&[DVec3], &[Vec<DVec3>]) = match self {
            Self::Triangle(corners) => (corners, &[]),
            Self::Grid(rows) => (&[], rows),
        };
        let of_rows =
            rows.iter().enumerate().flat_map(|(i, row)| row.iter().enumerate().map(move |(j, &point)| (format!("/{i}/{j}"), point)));
        corners.iter().enumerate().map(|(index, &point)| (format!("/{index}"), point)).chain(of_rows)
    }
}

/// The finest lattice: vertex (i, j) is in row i and column j, i + j <= cut for a triangle, whose corners are (0, 0),
/// (0, cut) and (cut, 0). Of every square the diagonal from (i, j + 1) to (i + 1, j) is an edge in a triangle; in a
/// grid it is that from (i, j) to (i + 1, j + 1).
struct Lattice<'a> {
    terrain: &'a Terrain,
    rows: usize,
    columns: usize,
    /// Pieces of a coarse edge, a power of two.
    cut: usize,
}

impl Lattice<'_> {
    fn is_triangle(&self) -> bool {
        matches!(self.terrain.base, TerrainBase::Triangle(_))
    }

    fn height(&self) -> usize {
        (self.rows - 1) * self.cut + 1
    }

    fn width(&self) -> usize {
        (self.columns - 1) * self.cut + 1
    }

    fn contains(&self, i: usize, j: usize) -> bool {
        i < self.height() && j < self.width() && (!self.is_triangle() || i + j <= self.cut)
    }

    fn coarse(&self, i: usize, j: usize) -> DVec3 {
        match &self.terrain.base {
            TerrainBase::Triangle([a, b, c]) => [[*a, *b], [*c, *c]][i][j],
            TerrainBase::Grid(rows) => rows[i][j],
        }
    }

    /// Half the length of the longest coarse edge.
    fn first_scale(&self) -> f64 {
        let mut longest = 0.0_f64;
        let mut edge = |a: DVec3, b: DVec3| longest = longest.max((a - b).length());
        if let TerrainBase::Triangle([a, b, c]) = self.terrain.base {
            edge(a, b);
            edge(b, c);
            edge(c, a);
        } else {
            for (i, j) in (0..self.rows).flat_map(|i| (0..self.columns).map(move |j| (i, j))) {
                let here = self.coarse(i, j);
                let beside = [(i + 1, j), (i, j + 1), (i + 1, j + 1)];
                beside.into_iter().filter(|&(i, j)| i < self.rows && j < self.columns).for_each(|(i, j)| edge(here, self.coarse(i, j)));
            }
        }
        0.5 * longest
    }

    /// All positions, row by row; of a triangle's square half is unused.
    fn positions(&self) -> Vec<DVec3> {
        let width = self.width();
        let mut positions = vec![DVec3::ZERO; self.height() * width];
        for i in (0..self.height()).step_by(self.cut) {
            for j in (0..width).step_by(self.cut) {
                positions[i * width + j] = self.coarse(i / self.cut, j / self.cut);
            }
        }
        let mut scale = self.first_scale();
        let mut step = self.cut;
        while step > 1 {
            let half = step / 2;
            scale *= self.terrain.roughness;
            for i in (0..self.height()).step_by(half) {
                for j in (0..width).step_by(half) {
                    // A midpoint is odd in one index at least; its edge runs along the odd ones.
                    let (odd_i, odd_j) = (!i.is_multiple_of(step), !j.is_multiple_of(step));
                    if !(odd_i || odd_j) || !self.contains(i, j) {
                        continue;
                    }
                    let (di, dj) = (if odd_i { half } else { 0 }, if odd_j { half } else { 0 });
                    let ends = if self.is_triangle() { [(i - di, j + dj), (i + di, j - dj)] } else { [(i - di, j - dj), (i + di, j + dj)] };
                    let middle = ends.map(|(i, j)| positions[i * width + j]).iter().sum::<DVec3>() / 2.0;
                    positions[i * width + j] = middle + scale * self.displacement(i, j) * DVec3::Z;
                }
            }
            step = half;
        }
        positions
    }

    /// u in [-1, 1) for the midpoint at (i, j): two rounds of `SplitMix64` over the seed, the row and the column. Which
    /// level it is new at, and how fine the lattice is, has no say, so a terrain of more levels refines one of fewer.
    fn displacement(&self, i: usize, j: usize) -> f64 {
        // Places in units of the finest lattice that any terrain has.
        let unit = (1_u64 << 32) / self.cut as u64;
        let word = split_mix::number(split_mix::number(self.terrain.random_seed ^ (i as u64 * unit)) ^ (j as u64 * unit));
        (word >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn mesh(&self) -> PolygonMesh {
        let width = self.width();
        let at = |i: usize, j: usize| i * width + j;
        let mut number = vec![u32::MAX; self.height() * width];
        let mut vertices = Vec::new();
        for (index, position) in self.positions().into_iter().enumerate() {
            if self.contains(index / width, index % width) {
                number[index] = vertices.len() as u32;
                vertices.push(position);
            }
        }
        let mut faces = Vec::new();
        for i in 0..self.height() - 1 {
            for j in 0..width - 1 {
                let square = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)].map(|index| number[index]);
                let [a, b, c, d] = square;
                let halves = if self.is_triangle() { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] };
                faces.extend(halves.iter().filter(|half| !half.contains(&u32::MAX)).map(|half| half.to_vec()));
            }
        }
        PolygonMesh { vertices, faces, interior: Interior::Surface }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::model::HalfEdgeMesh;

    fn lattice(terrain: &Terrain) -> Lattice<'_> {
        let [rows, columns] = terrain.checked(&mut Draft::default()).unwrap();
        Lattice { terrain, rows, columns, cut: 1 << terrain.levels }
    }

    fn triangle(roughness: f64, levels: u32, random_seed: u64) -> Terrain {
        let corners = [DVec3::ZERO, DVec3::X * 100.0, DVec3::new(50.0, 80.0, 10.0)];
        Terrain { base: TerrainBase::Triangle(corners), roughness, levels, random_seed }
    }

    fn grid(roughness: f64, levels: u32) -> Terrain {
        let row = |i: i32| (0..4).map(|j| DVec3::new(f64::from(j) * 30.0, f64::from(i) * 30.0, f64::from(i * j % 3))).collect();
        Terrain { base: TerrainBase::Grid((0..3).map(row).collect()), roughness, levels, random_seed: 7 }
    }

    #[test]
    fn a_terrain_is_a_disc_of_the_right_size() {
        for terrain in [triangle(0.5, 0, 1), triangle(0.5, 4, 1), grid(0.5, 0), grid(0.6, 3)] {
            let mesh = lattice(&terrain).mesh();
            let coarse = if matches!(terrain.base, TerrainBase::Triangle(_)) { 1 } else { 12 };
            assert_eq!(mesh.faces.len(), coarse << (2 * terrain.levels));
            let connected = HalfEdgeMesh::new(mesh.vertices.len(), &mesh.faces).unwrap();
            assert_eq!((connected.euler(), connected.boundary_loops().len()), (1, 1));
            // Counter-clockwise seen from above.
            let corner = |k: u32| mesh.vertices[k as usize];
            assert!(mesh.faces.iter().all(|f| (corner(f[1]) - corner(f[0])).cross(corner(f[2]) - corner(f[0])).z > 0.0));
        }
    }

    #[test]
    fn no_roughness_is_flat_and_displacements_keep_their_bound() {
        let flat = triangle(0.0, 5, 3);
        for vertex in lattice(&flat).mesh().vertices {
            assert!((vertex.z - vertex.y / 8.0).abs() < 1e-12, "{vertex}");
        }
        // |z - flat| <= s (r + r^2 + ...), attained to a good part over many seeds.
        let mut largest = 0.0_f64;
        for seed in 0..40 {
            let rough = triangle(0.5, 5, seed);
            largest = lattice(&rough).mesh().vertices.iter().map(|vertex| (vertex.z - vertex.y / 8.0).abs()).fold(largest, f64::max);
        }
        let bound = 50.0 * (0.5 + 0.25 + 0.125 + 0.0625 + 0.03125);
        assert!(largest <= bound && largest > 0.6 * bound, "{largest} of {bound}");
    }

    #[test]
    fn more_levels_refine_and_seeds_differ() {
        let (coarse, fine) = (triangle(0.6, 3, 9), triangle(0.6, 5, 9));
        let fine = lattice(&fine).mesh().vertices;
        assert!(lattice(&coarse).mesh().vertices.iter().all(|vertex| fine.contains(vertex)));
        assert_eq!(lattice(&triangle(0.6, 5, 9)).mesh().vertices, fine);
        assert_ne!(lattice(&triangle(0.6, 5, 10)).mesh().vertices, fine);
    }

    #[test]
    fn faults_are_named() {
        let code = |terrain: &Terrain| {
            let mut draft = Draft::default();
            assert_eq!(terrain.checked(&mut draft), None);
            (draft.findings[0].pointer.clone(), draft.findings[0].code)
        };
        assert_eq!(code(&triangle(1.0, 1, 1)), ("/roughness".into(), "terrain.roughness"));
        assert_eq!(code(&triangle(f64::NAN, 1, 1)), ("/roughness".into(), "terrain.roughness"));
        assert_eq!(code(&triangle(0.5, 11, 1)), ("/levels".into(), "terrain.too-large"));
        assert_eq!(code(&triangle(0.5, u32::MAX, 1)), ("/levels".into(), "terrain.too-large"));
        assert!(triangle(0.5, 10, 1).checked(&mut Draft::default()).is_some());
        let with = |rows| Terrain { base: TerrainBase::Grid(rows), ..grid(0.5, 1) };
        assert_eq!(code(&with(vec![vec![DVec3::ZERO; 3]])), ("/grid".into(), "terrain.grid"));
        assert_eq!(code(&with(vec![vec![DVec3::ZERO; 3], vec![DVec3::ZERO; 2]])), ("/grid/1".into(), "terrain.grid"));
        assert_eq!(code(&with(vec![vec![DVec3::ZERO; 2], vec![DVec3::NAN; 2]])), ("/grid/1/0".into(), "model.not-finite"));
        assert_eq!(code(&with(Vec::new())), ("/grid".into(), "terrain.grid"));
    }
}

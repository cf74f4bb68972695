//! The body-centred cubic lattice and its tetrahedra.
//!
//! Cube (i, j, k) has edge a, its corner vertex at `origin + a (i, j, k)` and its centre vertex half a cube
//! farther. Every tetrahedron joins two centres that are neighbours along an axis with two neighbouring
//! corners of the square between them: two edges of length a, four of sqrt(3)/2 a, twelve tetrahedra to a
//! cube. Its smallest enclosing ball has radius sqrt(5)/4 a, with its centre inside (the middle of the
//! segment between the middles of the two long edges).

use crate::attractor::cell::Point;

/// Radius of a tetrahedron's smallest enclosing ball, in units of a.
pub const ENCLOSING: f64 = 0.559_016_994_374_947_5;
/// Edges that belong to a cube: three between corners, three between centres, eight from the centre to
/// the corners.
pub const EDGES: usize = 14;

/// Position and pitch of the lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Corner vertex of cube (0, 0, 0), in mm.
    pub origin: Point,
    /// a, in mm.
    pub pitch: f64,
}

impl Lattice {
    /// Position of a corner vertex. A function of the indices alone: every block computes the same bits.
    #[inline]
    #[must_use]
    pub fn corner(&self, index: [i64; 3]) -> Point {
        std::array::from_fn(|axis| self.origin[axis] + self.pitch * index[axis] as f64)
    }

    /// Position of a centre vertex.
    #[inline]
    #[must_use]
    pub fn centre(&self, index: [i64; 3]) -> Point {
        std::array::from_fn(|axis| self.origin[axis] + self.pitch * (index[axis] as f64 + 0.5))
    }
}

/// One of a tetrahedron's four vertices relative to its cube.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatticeVertex {
    /// Whether it is a centre.
    pub centre: bool,
    /// Offset of its cube from the tetrahedron's.
    pub offset: [u8; 3],
}

/// An edge relative to the tetrahedron's cube: the cube that owns it and its number there. Numbers 0 to 2
/// join the corner to the next along an axis, 3 to 5 the centre likewise, 6 + x + 2 y + 4 z the centre to
/// the corner at (x, y, z).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatticeEdge {
    /// Offset of the owning cube.
    pub offset: [u8; 3],
    /// Number in that cube.
    pub number: u8,
}

/// A tetrahedron of a cube, positively oriented: det(v1 - v0, v2 - v0, v3 - v0) > 0.
#[derive(Clone, Copy, Debug)]
pub struct Tetrahedron {
    /// Its vertices; the first is the centre of its cube.
    pub vertices: [LatticeVertex; 4],
    /// Its edges, between the vertices of [`EDGE_ENDS`].
    pub edges: [LatticeEdge; 6],
}

/// Vertices that the six edges of a tetrahedron join.
pub const EDGE_ENDS: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// The edges that triangles of a tetrahedron cut, for each set of inside vertices (bit v for vertex v), in
/// pieces counter-clockwise seen from outside: three edges a triangle, four a quadrilateral.
pub const CUTS: [&[usize]; 16] = [
    &[],
    &[0, 1, 2],
    &[0, 4, 3],
    &[1, 2, 4, 3],
    &[1, 3, 5],
    &[2, 0, 3, 5],
    &[0, 4, 5, 1],
    &[2, 4, 5],
    &[2, 5, 4],
    &[1, 5, 4, 0],
    &[5, 3, 0, 2],
    &[5, 3, 1],
    &[3, 4, 2, 1],
    &[3, 4, 0],
    &[2, 1, 0],
    &[],
];

/// The twelve tetrahedra of a cube, four around each axis.
#[must_use]
pub fn tetrahedra() -> Vec<Tetrahedron> {
    let mut list = Vec::with_capacity(12);
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |step: usize| {
            let (du, dv) = [(0, 0), (1, 0), (1, 1), (0, 1)][step % 4];
            let mut offset = [0_u8; 3];
            (offset[axis], offset[u], offset[v]) = (1, du, dv);
            LatticeVertex { centre: false, offset }
        };
        let own = LatticeVertex { centre: true, offset: [0; 3] };
        let mut next = own;
        next.offset[axis] = 1;
        for step in 0..4 {
            let mut vertices = [own, next, corner(step), corner(step + 1)];
            if orientation(&vertices) < 0.0 {
                vertices.swap(2, 3);
            }
            let edges = EDGE_ENDS.map(|(p, q)| edge_between(vertices[p], vertices[q]));
            list.push(Tetrahedron { vertices, edges });
        }
    }
    list
}

fn unit_position(vertex: LatticeVertex) -> glam::DVec3 {
    let offset = vertex.offset.map(f64::from);
    glam::DVec3::from_array(offset) + glam::DVec3::splat(if vertex.centre { 0.5 } else { 0.0 })
}

fn orientation(vertices: &[LatticeVertex; 4]) -> f64 {
    let [a, b, c, d] = vertices.map(unit_position);
    (b - a).dot((c - a).cross(d - a))
}

fn edge_between(p: LatticeVertex, q: LatticeVertex) -> LatticeEdge {
    if p.centre == q.centre {
        let offset: [u8; 3] = std::array::from_fn(|i| p.offset[i].min(q.offset[i]));
        let axis = (0..3).find(|&i| p.offset[i] != q.offset[i]).unwrap_or(0) as u8;
        return LatticeEdge { offset, number: if p.centre { 3 + axis } else { axis } };
    }
    let (centre, corner) = if p.centre { (p, q) } else { (q, p) };
    let bit = |i: usize| corner.offset[i] - centre.offset[i];
    LatticeEdge { offset: centre.offset, number: 6 + bit(0) + 2 * bit(1) + 4 * bit(2) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn tetrahedra_fill_the_cube_and_fit_their_ball() {
        let mut volume = 0.0;
        for tetrahedron in tetrahedra() {
            let corners = tetrahedron.vertices.map(unit_position);
            volume += orientation(&tetrahedron.vertices) / 6.0;
            let long: Vec<(usize, usize)> =
                EDGE_ENDS.iter().copied().filter(|&(p, q)| (corners[p].distance(corners[q]) - 1.0).abs() < 1e-12).collect();
            assert_eq!(long.len(), 2);
            let middle: DVec3 = corners.iter().sum::<DVec3>() / 4.0;
            for corner in corners {
                assert!((corner.distance(middle) - ENCLOSING).abs() < 1e-12);
            }
        }
        assert!((volume - 1.0).abs() < 1e-12);
    }

    /// The triangles of every case face away from the inside vertices.
    #[test]
    fn cuts_face_outwards() {
        let tetrahedron = tetrahedra()[0];
        let corners = tetrahedron.vertices.map(unit_position);
        for (inside, cut) in CUTS.iter().enumerate() {
            let middle = |edge: usize| {
                let (p, q) = EDGE_ENDS[edge];
                0.5 * (corners[p] + corners[q])
            };
            for &edge in *cut {
                let (p, q) = EDGE_ENDS[edge];
                assert_ne!(inside >> p & 1, inside >> q & 1, "case {inside} cuts edge {edge}");
            }
            for k in 1..cut.len().saturating_sub(1) {
                let (a, b, c) = (middle(cut[0]), middle(cut[k]), middle(cut[k + 1]));
                let normal = (b - a).cross(c - a);
                for (vertex, corner) in corners.iter().enumerate() {
                    let side = normal.dot(*corner - a);
                    assert!(if inside >> vertex & 1 == 1 { side < 1e-12 } else { side > -1e-12 }, "case {inside}");
                }
            }
        }
    }
}

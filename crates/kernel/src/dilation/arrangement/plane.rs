//! Triangulated planes: Delaunay triangulations with edges that are held, and what they enclose.

use spade::handles::{DirectedEdgeHandle, FaceHandle, FixedVertexHandle, InnerTag};
use spade::{CdtEdge, ConstrainedDelaunayTriangulation, HasPosition, Triangulation};

/// See the module's comment.
pub(super) type Mesh<V> = ConstrainedDelaunayTriangulation<V>;

/// An edge of a plane, from one end to the other.
pub(super) type Edge<'a, V> = DirectedEdgeHandle<'a, V, (), CdtEdge<()>, ()>;

/// What a triangle is called.
pub(super) fn key(triangle: &[u32; 3]) -> u128 {
    let mut sorted = *triangle;
    sorted.sort_unstable();
    sorted.iter().fold(0, |key, &vertex| key << 32 | u128::from(vertex))
}

/// The corners of a face.
pub(super) fn corners<V>(face: FaceHandle<'_, InnerTag, V, (), CdtEdge<()>, ()>) -> [u32; 3] {
    face.vertices().map(|vertex| vertex.fix().index() as u32)
}

/// The vertex with a number.
pub(super) fn handle(number: u32) -> FixedVertexHandle {
    FixedVertexHandle::from_index(number as usize)
}

/// Makes an edge between vertices that is held, unless it would cross another.
pub(super) fn join<V: HasPosition<Scalar = f64>>(mesh: &mut Mesh<V>, from: FixedVertexHandle, to: FixedVertexHandle) -> bool {
    mesh.can_add_constraint(from, to) && mesh.add_constraint(from, to)
}

/// The triangles within an odd number of borders, counter-clockwise; none where a border is not closed.
pub(super) fn inside<V: HasPosition<Scalar = f64>>(mesh: &Mesh<V>, is_border: impl Fn(&Edge<'_, V>) -> bool) -> Option<Vec<[u32; 3]>> {
    let mut sides: Vec<Option<bool>> = vec![None; mesh.num_all_faces()];
    let mut open = vec![mesh.outer_face().fix()];
    sides[open[0].index()] = Some(false);
    let hull: Vec<_> = mesh.convex_hull().collect();
    while let Some(face) = open.pop() {
        let own = sides[face.index()] == Some(true);
        let inner = mesh.face(face).as_inner().map(|inner| inner.adjacent_edges());
        for edge in inner.as_ref().map_or(&hull[..], |edges| &edges[..]) {
            let (other, theirs) = (edge.rev().face().fix(), own != is_border(edge));
            match sides[other.index()] {
                None => {
                    sides[other.index()] = Some(theirs);
                    open.push(other);
                }
                Some(known) if known != theirs => return None,
                Some(_) => {}
            }
        }
    }
    let inside = mesh.inner_faces().filter(|face| sides[face.fix().index()] == Some(true));
    Some(inside.map(corners).collect())
}

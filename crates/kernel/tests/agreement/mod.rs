//! The comparison of a drawn mesh with its complex, for all tests of conforming evaluation.

use lacuna_kernel::budget::Budget;
use lacuna_kernel::solid::{Topology, TriMesh};
use lacuna_kernel::tessellation::Tessellation;

/// The mesh's own count agrees with the complex's; returns (euler, boundary loops, components).
pub fn agreed(tessellation: &Tessellation) -> (i64, u64, u64) {
    let mesh = TriMesh { vertices: tessellation.vertices.clone(), triangles: tessellation.triangles.clone() };
    let counted = Topology::of(&mesh, &Budget::default()).expect("indices are valid");
    let complex = tessellation.complex.as_ref().expect("a B-rep");
    assert_eq!(counted.euler, complex.euler);
    assert_eq!(counted.shells, complex.components);
    assert_eq!(counted.boundary_edges, complex.boundary_edges, "a crack or a T-junction");
    assert_eq!((counted.nonmanifold_edges, counted.nonmanifold_vertices, counted.flipped_pairs), (0, 0, 0));
    assert_eq!(counted.degenerate_triangles, 0);
    (complex.euler, complex.boundary_loops, complex.components)
}

//! The limit of leaf cells of a dilation: it counts what the result says that it expanded, on a lattice and without one, and for any number of threads.

use glam::{DMat3, DVec3};
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::dilation::{Dilation, DilationError, dilate_unsimplified};
use lacuna_kernel::error::Kind;
use lacuna_kernel::model::{AffineMap, Ifs, Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::tolerance::{Radius, Tolerance};

fn lowered(shape: Shape) -> Attractor {
    Model { name: None, shape }.lower().unwrap().attractor
}

fn mesh(vertices: &[[f64; 3]], faces: &[&[u32]]) -> Attractor {
    let vertices = vertices.iter().map(|&vertex| vertex.into()).collect();
    let faces = faces.iter().map(|face| face.to_vec()).collect();
    lowered(Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Surface }))
}

fn tetrahedral_dust() -> Attractor {
    let corners = [[0.0; 3], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
    let map = |corner| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(0.5)), translation: 0.5 * DVec3::from_array(corner) };
    lowered(Shape::Ifs(Ifs { maps: corners.map(map).to_vec(), primitive: None, graph: None }))
}

fn within(shape: &Attractor, cells: u64) -> Result<Dilation, DilationError> {
    let budget = Budget { limits: Limits { cells, ..Limits::default() }, ..Budget::default() };
    dilate_unsimplified(shape, Radius::new(1.0).unwrap(), Tolerance::new(0.25).unwrap(), &budget)
}

#[test]
fn the_limit_is_the_number_of_leaf_cells_that_the_result_tells() {
    let corners = [[0.0; 3], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
    let rods = mesh(&corners, &[&[0, 1], &[0, 2], &[0, 3], &[1, 2]]);
    // Two plates nearly as far apart as the ball is wide: the lattice is refined between them.
    let plates =
        mesh(&[[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 2.3], [4.0, 0.0, 1.8], [0.0, 4.0, 2.1]], &[&[0, 1, 2], &[3, 4, 5]]);
    for (name, shape) in [("dust", tetrahedral_dust()), ("rods", rods), ("plates", plates)] {
        let counted = within(&shape, u64::MAX).unwrap();
        assert!(counted.leaf_cells > 1, "{name}: {}", counted.leaf_cells);
        let allowed = within(&shape, counted.leaf_cells).unwrap();
        assert_eq!(allowed.solid.mesh(), counted.solid.mesh(), "{name}");
        for cells in [counted.leaf_cells - 1, 1] {
            let error = within(&shape, cells).unwrap_err();
            assert_eq!(error, DilationError::LeafCells { tolerance_mm: 0.25, allowed: cells }, "{name}");
            assert_eq!((error.kind(), error.code()), (Kind::Limit, "limit-cells"));
            let facts = error.limit().unwrap();
            assert_eq!((facts.limit, facts.allowed), ("cells", cells as f64));
            assert!(facts.asked > facts.allowed);
        }
    }
}

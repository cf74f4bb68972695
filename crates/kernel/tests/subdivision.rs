//! Subdivision surfaces: dimensions of states, limit points, volumes, boundaries, creases, and evaluation without
//! cracks. Expected values: closed forms and CASES E (Stam 1998, Hakenberg and Reif 2014, OpenSubdiv's shapes).

mod cages;

use cages::{attractor, cube, evaluated, grid, model, patches, tetrahedron, torus};
use glam::DVec3;
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::model::{BoundaryRule, CellKind, Corner, Crease, Scheme, Subdivision};
use lacuna_kernel::solid::{Topology, TriMesh};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::tessellation::Tessellation;

/// Volume by the divergence theorem on the bilinear patches, extrapolated from three depths: the error of smooth
/// surfaces is a power series in 4^-depth.
fn volume(attractor: &Attractor, depth: usize) -> f64 {
    let at = |depth: usize| -> f64 {
        let triangle = |a: DVec3, b: DVec3, c: DVec3| a.dot(b.cross(c)) / 6.0;
        patches(attractor, depth)
            .iter()
            .map(|p| match p.as_slice() {
                [a, b, c] => triangle(*a, *b, *c),
                [a, b, c, d] => {
                    0.5 * (triangle(*a, *b, *c) + triangle(*a, *c, *d) + triangle(*a, *b, *d) + triangle(*b, *c, *d))
                }
                _ => panic!("triangles and quads"),
            })
            .sum()
    };
    let (a, b, c) = (at(depth - 2), at(depth - 1), at(depth));
    let (d, e) = ((4.0 * b - a) / 3.0, (4.0 * c - b) / 3.0);
    (16.0 * e - d) / 15.0
}

fn has_point(tessellation: &Tessellation, point: DVec3) -> bool {
    tessellation.vertices.iter().any(|vertex| vertex.distance(point) < 1e-9)
}

/// The mesh's own count agrees with the complex's; returns (euler, boundary loops, components).
fn agreed(tessellation: &Tessellation) -> (i64, u64, u64) {
    let mesh = TriMesh { vertices: tessellation.vertices.clone(), triangles: tessellation.triangles.clone() };
    let counted = Topology::of(&mesh, &Budget::default()).expect("indices are valid");
    let complex = tessellation.complex.as_ref().expect("a B-rep");
    assert_eq!((counted.euler, counted.shells, counted.boundary_edges), (complex.euler, complex.components, complex.boundary_edges));
    assert_eq!((counted.nonmanifold_edges, counted.nonmanifold_vertices, counted.flipped_pairs), (0, 0, 0));
    (complex.euler, complex.boundary_loops, complex.components)
}

/// Dimensions of all states of a kind, each once.
fn dimensions(attractor: &Attractor, kind: CellKind) -> Vec<usize> {
    let mut all: Vec<usize> = attractor.automaton().states().iter().filter(|s| s.kind == Some(kind)).map(|s| s.dimension).collect();
    all.sort_unstable();
    all.dedup();
    all
}

#[test]
fn regular_dimensions_are_those_of_the_box_splines() {
    for (scheme, face, edge, vertex) in
        [(Scheme::CatmullClark, 16, 12, 9), (Scheme::DooSabin, 9, 6, 4), (Scheme::Loop, 12, 10, 7)]
    {
        let attractor = attractor(torus(scheme, 6, 6));
        assert_eq!(dimensions(&attractor, CellKind::Face), [face], "{scheme:?}");
        assert_eq!(dimensions(&attractor, CellKind::Edge), [edge], "{scheme:?}");
        assert_eq!(dimensions(&attractor, CellKind::Vertex), [vertex], "{scheme:?}");
        assert_eq!(agreed(&evaluated(&attractor, 1.0)), (0, 0, 1), "{scheme:?}");
    }
}

#[test]
fn catmull_clark_cube() {
    let attractor = attractor(cube(Scheme::CatmullClark));
    eprintln!("{} states", attractor.automaton().states().len());
    let coarse = evaluated(&attractor, 0.1);
    assert_eq!(agreed(&coarse), (2, 0, 1));
    assert!(has_point(&coarse, DVec3::splat(0.5)));
    assert!(has_point(&coarse, DVec3::new(395.0 / 648.0, -395.0 / 648.0, 0.0)));
    assert!(has_point(&coarse, DVec3::new(0.0, 68.0 / 81.0, 0.0)));
    let v = volume(&attractor, 6);
    assert!((v - 2.620_419_033).abs() < 1e-7, "{v}");
}

#[test]
fn loop_tetrahedron() {
    let attractor = attractor(tetrahedron(Scheme::Loop));
    let tessellation = evaluated(&attractor, 0.05);
    assert_eq!(agreed(&tessellation), (2, 0, 1));
    assert!(has_point(&tessellation, DVec3::new(-0.2, -0.2, 0.2)));
    let v = volume(&attractor, 7);
    assert!((v - 0.102_993_11).abs() < 1e-7, "{v}");
}

#[test]
fn doo_sabin_cube() {
    let attractor = attractor(cube(Scheme::DooSabin));
    let tessellation = evaluated(&attractor, 0.1);
    assert_eq!(agreed(&tessellation), (2, 0, 1));
    for point in [DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.75, 0.75, 0.0), DVec3::splat(2.0 / 3.0)] {
        assert!(has_point(&tessellation, point), "{point}");
    }
    let v = volume(&attractor, 7);
    assert!((v - 8.0 * 6241.0 / 9920.0).abs() < 1e-6, "{v}");
}

#[test]
fn a_cage_of_a_hundred_thousand_faces_converts_in_seconds() {
    let surface = cages::inset_torus(300, 330, 790);
    let faces = surface.faces.len();
    let clock = std::time::Instant::now();
    let attractor = attractor(surface);
    let states = attractor.automaton().states().len();
    eprintln!("{faces} faces: {states} states in {:.2} s", clock.elapsed().as_secs_f64());
    // Regular faces, and those with one vertex of valence 3 or 5: 2 k + 8.
    let faces = dimensions(&attractor, CellKind::Face);
    assert!([14, 16, 18].iter().all(|n| faces.contains(n)), "{faces:?}");
    assert!(states <= 20, "{states}");
}

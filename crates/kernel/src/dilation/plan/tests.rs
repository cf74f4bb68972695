//! Lattices, and what is left of rounding.

use super::*;
use crate::model::{Interior, Model, PolygonMesh, Shape};
use crate::tolerance::Radius;

/// Two rods side by side, 3 mm apart, and a rod by itself.
fn rods() -> Attractor {
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let vertices =
        vec![at(0.0, 0.0, 0.0), at(20.0, 0.0, 0.0), at(0.0, 3.0, 0.0), at(20.0, 3.0, 0.0), at(0.0, 40.0, 0.0), at(20.0, 40.0, 0.0)];
    let shape = Shape::Mesh(PolygonMesh { vertices, faces: vec![vec![0, 1], vec![2, 3], vec![4, 5]], interior: Interior::Surface });
    Model { name: None, shape }.lower().unwrap().attractor
}

/// What is left of a surface with a tetrahedron of the given size at a place, besides a larger one, and how many shells went in doubt.
fn without_dust(at: Point, size: f64) -> (usize, usize) {
    let (surface, doubtful) = dusted(at, size, false, [0, 1, 2]);
    (surface.triangles.len(), doubtful)
}

/// The same with the tetrahedron's corners in some order, and whether the topology was proven.
fn dusted(at: Point, size: f64, is_proven: bool, order: [usize; 3]) -> (BlockSurface, usize) {
    let (attractor, budget) = (rods(), Budget::default());
    let balls = Balls { least: Radius::new(1.4).unwrap().mm(), most: 1.4 };
    let plan = Plan::new(&attractor, balls, Tolerance::new(0.14).unwrap(), true, 1.0, &budget).unwrap();
    let setting = plan.setting(plan.pitch, &budget);
    let tetrahedron = |first: Point, size: f64| -> [Point; 4] {
        let corner = |axis: usize| std::array::from_fn(|other| first[other] + if other == axis { size } else { 0.0 });
        [first, corner(0), corner(1), corner(2)].map(|x: Point| x.map(|x| f64::from(x as f32)))
    };
    // Counter-clockwise seen from within: a void, unless it has no volume.
    let faces = |first: u32| [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]].map(|face: [u32; 3]| face.map(|corner| first + corner));
    let mut surface = BlockSurface {
        vertices: tetrahedron([5.0, -10.0, 0.0], 8.0).into_iter().chain(tetrahedron(at, size)).collect(),
        triangles: faces(0).into_iter().chain(faces(4).map(|face| order.map(|corner| face[corner]))).collect(),
        ..BlockSurface::default()
    };
    let doubtful = dust::remove(&setting, &plan.rule, &plan.space(&setting).candidates, is_proven, &mut surface);
    (surface, doubtful)
}

/// A part of a pot, and the ends of its box: its dilation's surface passes a vertex of the lattice within rounding, where all of some twenty triangles are no more than that.
#[test]
fn what_passes_a_vertex_within_rounding_crosses_nothing() {
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) * 100.0;
    let vertices = vec![
        at(-1.972_710_538_648_750_7, -0.101_647_686_003_419_3, 1.160_540_771_484_375_2),
        at(-1.966_728_210_449_218_8, 0.0, 1.205_294_036_865_234_3),
        at(-1.965_082_609_819_543_7, -0.201_960_983_382_444_7, 1.160_540_771_484_375),
        at(-1.964_169_115_905_860_3, -0.101_207_572_849_470_99, 1.205_294_036_865_234_3),
        at(-1.957_031_25, 0.0, 1.250_390_625),
        at(-1.956_574_214_408_087_5, -0.201_086_534_698_123_51, 1.205_294_036_865_234_3),
        at(-1.954_484_773_081_406_1, -0.100_708_568_550_926_55, 1.250_390_625),
        at(-1.946_927_318_272_528_9, -0.200_095_076_822_308_12, 1.250_390_625),
        at(-1.946_235_656_738_281_2, 0.0, 1.295_816_802_978_515_8),
        at(-1.943_703_226_978_649_6, -0.100_153_028_753_569_85, 1.295_816_802_978_515_8),
        at(-3.050_000_000_000_000_3, -2.0, 0.0),
        at(3.172, 2.0, 3.15),
    ];
    let triangles = [[9, 5, 7], [9, 7, 10], [10, 7, 8], [5, 2, 4], [5, 4, 7], [7, 4, 6], [7, 6, 8], [2, 1, 4], [4, 1, 3], [4, 3, 6]];
    let faces = triangles.iter().map(|face| face.iter().map(|corner| corner - 1).collect()).chain([vec![10], vec![11]]).collect();
    let attractor =
        Model { name: None, shape: Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Surface }) }.lower().unwrap().attractor;
    let (radius, budget) = (Radius::new(4.823).unwrap().mm(), Budget::default());
    let plan = Plan::new(&attractor, Balls { least: radius, most: radius }, Tolerance::new(0.4823).unwrap(), true, 1.0, &budget).unwrap();
    let setting = plan.setting(plan.pitch, &budget);
    let made = plan.on_lattice(&setting, &plan.space(&setting), &budget).unwrap();
    assert_eq!((made.crossings, made.uncertain, made.solid.topology().components), (0, 0, 3));
}

/// Two plates of 12 x 4 mm in several blocks of a lattice, about two radii apart: all between them is critical, and decided by levels of cubes where it can be.
#[test]
fn plates_about_two_radii_apart_are_one_or_two_or_in_doubt() {
    let made = |gap: f64| {
        let plate = |z: f64| [[0.0, 0.0], [12.0, 0.0], [12.0, 4.0], [0.0, 4.0]].map(|[x, y]| DVec3::new(x, y, z + 0.01 * x));
        let shape = Shape::Mesh(PolygonMesh {
            vertices: [plate(0.0), plate(gap)].concat(),
            faces: vec![vec![0, 1, 2], vec![0, 2, 3], vec![4, 5, 6], vec![4, 6, 7]],
            interior: Interior::Surface,
        });
        let attractor = Model { name: None, shape }.lower().unwrap().attractor;
        let (radius, budget) = (Radius::new(1.0).unwrap().mm(), Budget::default());
        let plan = Plan::new(&attractor, Balls { least: radius, most: radius }, Tolerance::new(0.1).unwrap(), true, 1.0, &budget).unwrap();
        let setting = plan.setting(plan.pitch, &budget);
        let made = plan.on_lattice(&setting, &plan.space(&setting), &budget).unwrap();
        (made.uncertain > 0, made.topology_exact, made.solid.topology().components)
    };
    // The plates are tilted: their distance is gap / sqrt(1 + 0.01^2).
    let radii = |share: f64| 2.0 * share * (1.0 + 1e-4_f64).sqrt();
    assert_eq!(made(radii(0.99)), (false, true, 1));
    assert_eq!(made(radii(1.01)), (false, true, 2));
    let (in_doubt, is_exact, _) = made(radii(1.0));
    assert!(in_doubt && !is_exact);
}

/// Two rods that are alike, and what is made of one of them in coordinates that are not congruent elsewhere: both are looked at where they are.
#[test]
fn what_is_not_congruent_is_mended_where_it_is() {
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.1);
    let vertices = vec![at(0.3, 0.0), at(20.3, 0.0), at(0.3, 40.0), at(20.3, 40.0)];
    let shape = Shape::Mesh(PolygonMesh { vertices, faces: vec![vec![0, 1], vec![2, 3]], interior: Interior::Surface });
    let attractor = Model { name: None, shape }.lower().unwrap().attractor;
    let budget = Budget::default();
    let plan = Plan::new(&attractor, Balls { least: 1.0, most: 1.0 }, Tolerance::new(0.1).unwrap(), true, 1.0, &budget).unwrap();
    let setting = plan.setting(plan.pitch, &budget);
    let space = plan.space(&setting);
    let mut arrangement = Arrangement::new(&setting, &plan.rule, &space.candidates, &budget).unwrap().unwrap();
    let surface = arrangement.run(&budget).unwrap().unwrap().surface;
    let (_, _, copies) = arrangement.into_index();
    for is_congruent in [true, false] {
        let mut surface = surface.alone();
        copies.round(&mut surface);
        if !is_congruent {
            surface.vertices.iter_mut().for_each(|vertex| vertex[1] = f64::from((vertex[1] + 1e-7 * vertex[0]) as f32));
        }
        let triangles = surface.triangles.len();
        assert_eq!(copies.are_whole(&surface), is_congruent);
        let mended = plan.put(&setting, &space, surface, &copies, 0, &budget).unwrap();
        assert_eq!((mended.surface.triangles.len(), mended.uncertain, mended.crossings), (2 * triangles, 0, 0));
        assert_eq!(plan.certify(&setting, mended, true, None, &budget).unwrap().solid.topology().components, 2);
    }
}

#[test]
fn shells_no_larger_than_rounding_go_and_may_be_in_doubt() {
    // Beyond one rod: nothing there could be a void.
    assert_eq!(without_dust([10.0, 41.400_001, 0.0], 0.0), (4, 0));
    assert_eq!(without_dust([10.0, 41.400_001, 0.0], 4e-6), (4, 0));
    // Between two, as far from both: it may have been one.
    assert_eq!(without_dust([10.0, 1.5, 0.0], 0.0), (4, 1));
    // A void that can be seen there stays.
    assert_eq!(without_dust([10.0, 1.5, 0.0], 0.02), (8, 0));
}

#[test]
fn proven_voids_stay_and_are_turned_back() {
    // In what one rod covers: no void of the dilation, unless it is what simplification left of one.
    let at = [10.0, 0.8, 0.0];
    assert_eq!(without_dust(at, 0.02), (4, 0));
    let (void, doubtful) = dusted(at, 0.02, true, [0, 1, 2]);
    assert_eq!((void.triangles.len(), doubtful), (8, 0));
    let (turned, doubtful) = dusted(at, 0.02, true, [0, 2, 1]);
    assert_eq!(doubtful, 0);
    let directed = |surface: &BlockSurface| -> BTreeSet<[u32; 2]> {
        surface.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect()
    };
    assert_eq!(directed(&void), directed(&turned));
    // A piece too narrow for one without the proof.
    assert_eq!(dusted(at, 0.02, false, [0, 2, 1]).0.triangles.len(), 4);
}

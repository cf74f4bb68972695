//! Evaluation in pieces gives what evaluation as a whole gives, for any number of threads, within its limits.

use glam::{DMat3, DVec3};
use lacuna_kernel::attractor::{Attractor, RefineError, Streamed, count_cells, refine, stream};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::model::{AffineMap, CornerCutting, Ifs, Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::Tolerance;

fn attractor(shape: Shape) -> Attractor {
    Model { name: None, shape }.lower().unwrap().attractor
}

/// Homotheties of different ratios: pieces of very different sizes.
fn uneven() -> Attractor {
    let maps = [0.75, 0.5, 0.1, 0.02].iter().enumerate().map(|(k, &ratio)| {
        let target = DVec3::new(k as f64, (k * k) as f64, 1.0) * 10.0;
        AffineMap { linear: DMat3::from_diagonal(DVec3::splat(ratio)), translation: target * (1.0 - ratio) }
    });
    attractor(Shape::Ifs(Ifs { maps: maps.collect(), primitive: None, graph: None }))
}

fn curve() -> Attractor {
    let points = vec![DVec3::ZERO, DVec3::new(50.0, 80.0, 0.0), DVec3::new(100.0, 0.0, 30.0), DVec3::new(120.0, 60.0, 0.0)];
    attractor(Shape::CornerCutting(CornerCutting { control_points: points, a: 0.25, b: 0.25, closed: false }))
}

fn mesh() -> Attractor {
    let vertices = (0..400).map(|k| DVec3::new(f64::from(k % 20), f64::from(k / 20), 0.0)).collect();
    let faces = (0..19).flat_map(|i| (0..19).map(move |j| vec![20 * i + j, 20 * i + j + 1, 20 * i + j + 21, 20 * i + j + 20])).collect();
    attractor(Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Surface }))
}

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

fn pieces(attractor: &Attractor, tolerance: Tolerance, threads: usize) -> (Vec<Tessellation>, Streamed) {
    on_threads(threads, || {
        let mut pieces = Vec::new();
        let streamed = stream(attractor, tolerance, &Budget::default(), &mut |piece| -> Result<(), RefineError> {
            pieces.push(piece);
            Ok(())
        });
        (pieces, streamed.unwrap())
    })
}

/// Positions of what is drawn, in order.
fn drawn(piece: &Tessellation) -> Vec<DVec3> {
    let indices = piece.points.iter().chain(piece.segments.as_flattened()).chain(piece.triangles.as_flattened());
    indices.map(|&index| piece.vertices[index as usize]).collect()
}

#[test]
fn pieces_are_the_whole() {
    for (shape, tolerance) in [(uneven(), 0.05), (curve(), 1e-3), (mesh(), 0.1)] {
        let tolerance = Tolerance::new(tolerance).unwrap();
        let whole = on_threads(1, || refine(&shape, tolerance, &Budget::default()).unwrap());
        assert_eq!(whole, on_threads(3, || refine(&shape, tolerance, &Budget::default()).unwrap()));
        let (parts, streamed) = pieces(&shape, tolerance, 3);
        assert_eq!(parts, pieces(&shape, tolerance, 1).0);
        assert!(parts.len() > 1);
        // Successive chords end and begin at one point of the curve, computed twice.
        let (one, other) = (drawn(&whole), parts.iter().flat_map(drawn).collect::<Vec<_>>());
        assert_eq!(one.len(), other.len());
        assert!(one.iter().zip(&other).all(|(a, b)| a.distance(*b) <= 1e-11 * a.length()));
        assert_eq!((whole.leaf_cells, whole.deviation_mm), (streamed.leaf_cells, streamed.deviation_mm));
        assert_eq!(whole.leaf_cells, parts.iter().map(|part| part.leaf_cells).sum::<u64>());
        assert_eq!(whole.leaf_cells, count_cells(&shape, tolerance, &Budget::default()).unwrap());
    }
}

/// No piece is larger than what a place goes on for, whatever the shape: that bounds the memory.
#[test]
fn pieces_are_small() {
    let (parts, streamed) = pieces(&uneven(), Tolerance::new(0.02).unwrap(), 2);
    assert!(streamed.leaf_cells > 100_000, "{streamed:?}");
    assert!(parts.iter().all(|part| part.leaf_cells <= 8192 && part.vertices.len() <= 8192));
}

#[test]
fn limits_and_failures_end_a_stream() {
    let tolerance = Tolerance::new(1e-6).unwrap();
    let few = Budget { limits: Limits { cells: 50_000, ..Limits::default() }, ..Budget::default() };
    let shallow = Budget { limits: Limits { depth: 5, ..Limits::default() }, ..Budget::default() };
    let mut taken = 0;
    let mut take = |piece: Tessellation| -> Result<(), RefineError> {
        taken += piece.leaf_cells;
        Ok(())
    };
    assert!(matches!(stream(&uneven(), tolerance, &few, &mut take), Err(RefineError::Cells { allowed: 50_000, .. })));
    assert!(matches!(stream(&uneven(), tolerance, &shallow, &mut take), Err(RefineError::Depth { allowed: 5, .. })));
    assert!(taken <= 1 << 20);
    let mut refuse = |_: Tessellation| Err(RefineError::Depth { allowed: 0, tolerance_mm: 0.0, reached_mm: 0.0 });
    assert!(matches!(stream(&uneven(), tolerance, &Budget::default(), &mut refuse), Err(RefineError::Depth { allowed: 0, .. })));
}

//! The error bound that is told with the progress: none before there is one, true of what has been made, and in the end that of the result.

use glam::{DMat3, DVec3};
use lacuna_kernel::attractor::{Attractor, refine, stream};
use lacuna_kernel::budget::{Budget, PHASES, Progress, StopReason};
use lacuna_kernel::dilation::{DilationError, Side, close, dilate, wall};
use lacuna_kernel::levels::solid_level;
use lacuna_kernel::measure::{ContactQuery, bounding_box, hausdorff, intersect};
use lacuna_kernel::model::{
    AffineMap, BezierCurve, ControlNet, Curve, CurveScheme, Ifs, Interior, Model, PolygonMesh, Primitive, Shape, Sum,
};
use lacuna_kernel::tolerance::{Radius, Tolerance};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// What a computation tells, from the first word to the last.
#[derive(Default)]
struct Heard(Arc<Mutex<Vec<Progress>>>);

impl Heard {
    fn budget(&self) -> Budget {
        let heard = Arc::clone(&self.0);
        Budget { progress: Some(Arc::new(move |progress: &Progress| heard.lock().unwrap().push(progress.clone()))), ..Budget::default() }
    }

    fn all(&self) -> Vec<Progress> {
        let all = self.0.lock().unwrap().clone();
        assert!(all.iter().all(|told| PHASES.contains(&told.phase)), "{all:?}");
        assert!(all.iter().filter_map(|told| told.bound_mm).all(|bound| bound.is_finite() && bound >= 0.0), "{all:?}");
        all
    }

    #[track_caller]
    fn last(&self) -> f64 {
        self.all().last().unwrap().bound_mm.unwrap()
    }
}

fn lowered(shape: Shape) -> Attractor {
    Model { name: None, shape }.lower().unwrap().attractor
}

fn mesh(vertices: &[[f64; 3]], faces: &[&[u32]]) -> Shape {
    let vertices = vertices.iter().map(|&vertex| vertex.into()).collect();
    Shape::Mesh(PolygonMesh { vertices, faces: faces.iter().map(|face| face.to_vec()).collect(), interior: Interior::Surface })
}

fn triangle(height: f64) -> Attractor {
    lowered(mesh(&[[0.0, 0.0, height], [10.0, 0.0, height], [0.0, 10.0, height]], &[&[0, 1, 2]]))
}

fn parabola() -> Attractor {
    let points = vec![DVec3::ZERO, DVec3::new(5.0, 10.0, 0.0), DVec3::new(10.0, 0.0, 0.0)];
    lowered(Shape::BezierCurve(BezierCurve { control_points: points, weights: None }))
}

/// Half a cube's corners: copies of a tetrahedron, or dust.
fn sierpinski() -> Ifs {
    let corners = [[0.0; 3], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
    let maps =
        corners.map(|corner| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(0.5)), translation: 0.5 * DVec3::from_array(corner) });
    Ifs { maps: maps.to_vec(), primitive: None, graph: None }
}

fn mm(length: f64) -> Tolerance {
    Tolerance::new(length).unwrap()
}

#[test]
fn an_evaluation_ends_with_its_deviation() {
    let heard = Heard::default();
    let whole = refine(&parabola(), mm(0.01), &heard.budget()).unwrap();
    assert_eq!(heard.last().to_bits(), whole.deviation_mm.to_bits());
    assert_eq!(heard.all()[0].bound_mm, None, "nothing is proven at the start");
    let heard = Heard::default();
    let streamed = stream::<lacuna_kernel::attractor::RefineError>(&parabola(), mm(0.01), &heard.budget(), &mut |_| Ok(())).unwrap();
    assert_eq!(heard.last().to_bits(), streamed.deviation_mm.to_bits());
}

#[test]
fn a_dilation_tells_the_bound_of_the_lattice_before_it_is_simplified_and_of_the_result_in_the_end() {
    let corner = mesh(&[[0.0; 3], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0]], &[&[0, 1], &[0, 2]]);
    for (shape, tolerance) in [(triangle(0.0), 0.05), (lowered(Shape::Ifs(sierpinski())), 0.3), (lowered(corner), 0.05), (parabola(), 0.05)]
    {
        let heard = Heard::default();
        let found = dilate(&shape, Radius::new(1.0).unwrap(), mm(tolerance), &heard.budget()).unwrap();
        let reached = found.inner_mm.max(found.outer_mm);
        assert_eq!(heard.last().to_bits(), reached.to_bits());
        let all = heard.all();
        let made = all.iter().position(|told| told.phase == "stitch").unwrap();
        assert!(all[..made].iter().all(|told| told.bound_mm.is_none()), "{all:?}");
        // Simplification keeps what the lattice has; sites that it meets besides may have larger errors.
        let before = all[made].bound_mm.unwrap();
        assert!(before > 0.0 && before <= reached && reached <= tolerance, "{before} {reached}");
    }
}

#[test]
fn stages_that_are_not_the_result_do_not_speak_for_it() {
    let heard = Heard::default();
    let radius = |mm: f64| Radius::new(mm).unwrap();
    let closed = close(&parabola(), radius(1.0), radius(0.5), mm(0.1), true, &heard.budget()).unwrap();
    // It is proven when both dilations of which it is made are.
    assert!(heard.all().iter().all(|told| told.bound_mm.is_none()));
    let budget = heard.budget();
    budget.prove(closed.inner_mm);
    let wall = wall(&closed.solid, Side::Inward, radius(0.3), mm(0.1), true, &budget).unwrap();
    assert!(wall.outer_mm > 0.0);
    assert_eq!(heard.last().to_bits(), closed.inner_mm.to_bits());
}

#[test]
fn comparisons_tell_how_narrow_the_distance_is() {
    let (first, second) = (lowered(Shape::Ifs(sierpinski())), triangle(0.25));
    let heard = Heard::default();
    let found = hausdorff(&first, &second, mm(0.01), &heard.budget()).unwrap();
    assert_eq!(heard.last().to_bits(), found.distance_mm().width().to_bits());
    let first_told = heard.all().iter().find_map(|told| told.bound_mm).unwrap();
    assert!(first_told > heard.last(), "it was wider at first: {first_told}");

    let heard = Heard::default();
    let query = ContactQuery { resolution: mm(0.001), most: 100_000 };
    let found = intersect(&parabola(), &second, &query, &heard.budget()).unwrap();
    assert_eq!(heard.last().to_bits(), found.distance_mm.width().to_bits());
}

#[test]
fn copies_on_a_lattice_are_exact() {
    let heard = Heard::default();
    let ifs = sierpinski();
    let bounds = bounding_box(&lowered(Shape::Ifs(ifs.clone())), &Budget::default()).unwrap();
    let vertices = vec![DVec3::ZERO, DVec3::X * 10.0, DVec3::Y * 10.0, DVec3::Z * 10.0];
    let faces = vec![vec![0, 2, 1], vec![0, 1, 3], vec![1, 2, 3], vec![0, 3, 2]];
    let ifs = Ifs { primitive: Some(Primitive::Solid { vertices, faces }), ..ifs };
    solid_level(&ifs, &bounds, 2, &heard.budget()).unwrap();
    let refined: Vec<_> = heard.all().into_iter().filter(|told| told.phase == "refine").map(|told| told.bound_mm).collect();
    assert_eq!(refined, [Some(0.0); 2]);
}

/// A tetrahedron of the lattice may hold so many sites that it takes seconds, and its block minutes.
#[test]
fn a_block_that_is_full_of_sites_is_stopped() {
    let curve = |scheme: CurveScheme, points: [[f64; 3]; 3]| Curve {
        scheme,
        control_points: ControlNet { size: vec![3], points: points.map(DVec3::from_array).to_vec(), weights: None },
    };
    let takagi = CurveScheme::Interpolation { vertical_scaling: vec![0.5, 0.5] };
    let sum = lowered(Shape::Sum(Sum {
        u: curve(takagi, [[0.0; 3], [15.0, 0.0, 15.0], [30.0, 0.0, 0.0]]),
        v: curve(CurveScheme::Bezier, [[0.0; 3], [0.0, 15.0, 30.0], [0.0, 30.0, 0.0]]),
    }));
    let budget = Budget::default();
    let cancel = budget.cancel.clone();
    let firing = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(4));
        cancel.fire(StopReason::Cancelled);
        Instant::now()
    });
    let stopped = dilate(&sum, Radius::new(3.0).unwrap(), mm(0.003), &budget);
    assert!(matches!(stopped, Err(DilationError::Stopped(_))), "{stopped:?}");
    // It is asked within milliseconds; whoever asks between blocks alone takes some minutes.
    assert!(firing.join().unwrap().elapsed() < Duration::from_secs(20));
}

//! Volumes that surfaces enclose, from their control points alone: closed forms, published digits, and polyhedra.

use crate::cages;
use crate::cages::{attractor, cube, grid, head, tetrahedron, torus};
use glam::{DMat3, DQuat, DVec3};
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::{Budget, CancelToken, StopReason};
use lacuna_kernel::measure::{Interval, NotEnclosed, enclosed_volume};
use lacuna_kernel::model::{
    Coefficients, ControlNet, Corner, Crease, CurveScheme, Interior, Model, PolygonMesh, Scheme, Shape, Subdivision, TensorProduct,
};

fn measured(attractor: &Attractor) -> Interval {
    enclosed_volume(attractor, &Budget::default()).unwrap()
}

fn volume(surface: Subdivision) -> Interval {
    measured(&attractor(surface))
}

fn refused(attractor: &Attractor) -> NotEnclosed {
    enclosed_volume(attractor, &Budget::default()).unwrap_err()
}

/// The interval holds a number, and is as narrow as numbers are there.
#[track_caller]
fn assert_exact(found: Interval, exact: f64) {
    let rounding = 1e-12 * exact;
    assert!(found.low <= exact + rounding / 1e3 && exact - rounding / 1e3 <= found.high, "{exact} is not in {found:?}");
    assert!(found.width() <= rounding, "{found:?}");
}

/// Hakenberg, Reif, Schaefer, Warren 2014: Doo and Sabin's surface of the unit cube encloses 6241/9920.
#[test]
fn doo_sabin_of_the_cube() {
    assert_exact(volume(cube(Scheme::DooSabin)), 8.0 * 6241.0 / 9920.0);
}

/// The published digits of cases 51 and 54, and polyhedra of the surface, extrapolated.
#[test]
fn catmull_clark_and_loop() {
    for (surface, digits, known) in [
        (cube(Scheme::CatmullClark), 2.620419033, 1e-8),
        (tetrahedron(Scheme::Loop), 0.10299311, 1e-7),
        (cube(Scheme::Loop), f64::NAN, 0.0),
    ] {
        let attractor = attractor(surface);
        let found = measured(&attractor);
        assert!(found.width() <= 1e-12 * found.high, "{found:?}");
        let extrapolated = cages::volume(&attractor, 6);
        assert!((found.low - extrapolated).abs() < 1e-6 * extrapolated, "{found:?} {extrapolated}");
        assert!(digits.is_nan() || (found.low - digits).abs() <= known, "{found:?} {digits}");
    }
}

/// Regular, extraordinary, of genus 1 and 2, with creases.
#[test]
fn against_polyhedra() {
    let mut creased = cube(Scheme::CatmullClark);
    creased.creases =
        vec![Crease { edge: [0, 1], sharpness: 1.5 }, Crease { edge: [1, 3], sharpness: 10.0 }, Crease { edge: [3, 2], sharpness: 10.0 }];
    let five = cages::cage(Scheme::DooSabin, prism(5), prism_faces(5));
    for surface in [torus(Scheme::CatmullClark, 6, 7), torus(Scheme::DooSabin, 5, 6), torus(Scheme::Loop, 6, 6), creased, five] {
        let attractor = attractor(surface);
        let (found, extrapolated) = (measured(&attractor), cages::volume(&attractor, 5).abs());
        assert!((found.low - extrapolated).abs() < 1e-5 * extrapolated, "{found:?} {extrapolated}");
        // Masks of cosines are off by their last bits, and so is what is proven.
        assert!(found.width() <= 1e-6 * found.high, "{found:?}");
    }
}

fn prism(sides: u32) -> Vec<DVec3> {
    let ring = |z: f64| (0..sides).map(move |k| (f64::from(k) * std::f64::consts::TAU / f64::from(sides), z));
    ring(-1.0).chain(ring(1.0)).map(|(angle, z)| DVec3::new(angle.cos(), angle.sin(), z)).collect()
}

fn prism_faces(sides: u32) -> Vec<Vec<u32>> {
    let side = |k: u32| vec![k, (k + 1) % sides, sides + (k + 1) % sides, sides + k];
    (0..sides).map(side).chain([(0..sides).rev().collect(), (sides..2 * sides).collect()]).collect()
}

/// All edges and corners sharp for ever: the cube itself.
#[test]
fn a_cube_that_stays_one() {
    let mut sharp = cube(Scheme::CatmullClark);
    let edges = sharp.faces.iter().flat_map(|face| (0..4).map(|k| [face[k], face[(k + 1) % 4]])).filter(|[a, b]| a < b);
    sharp.creases = edges.map(|edge| Crease { edge, sharpness: 10.0 }).collect();
    sharp.corners = (0..8).map(|vertex| Corner { vertex, sharpness: 10.0 }).collect();
    assert_exact(volume(sharp), 8.0);
}

/// An affine map multiplies volumes by its determinant; inside out they are the same.
#[test]
fn affine_images() {
    let map = DMat3::from_cols_array(&[1.0, 0.5, 0.0, -0.25, 2.0, 0.5, 0.0, 1.0, 1.5]) * DMat3::from_quat(DQuat::from_rotation_x(1.0));
    let mut surface = head();
    let before = volume(surface.clone());
    surface.vertices.iter_mut().for_each(|vertex| *vertex = map * *vertex + DVec3::new(300.0, -200.0, 100.0));
    let after = volume(surface.clone());
    let expected = before.low * map.determinant();
    assert!((after.low - expected).abs() <= 1e-11 * expected && after.width() <= 1e-11 * expected, "{after:?} {expected}");
    surface.faces.iter_mut().for_each(|face| face.reverse());
    let turned = volume(surface);
    assert!((turned.low - after.low).abs() <= 1e-12 * after.low);
}

/// Polyhedra with vertices on the surface, whose volumes change in steps that shrink like a geometric series: the last, and what is left of the series.
fn polyhedra(attractor: &Attractor) -> (f64, f64) {
    let at = |depth: usize| -> f64 {
        let cone = |corners: &Vec<DVec3>| {
            let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
            (0..corners.len()).map(|k| middle.dot(corners[k].cross(corners[(k + 1) % corners.len()])) / 6.0).sum::<f64>()
        };
        cages::patches(attractor, depth).iter().map(cone).sum()
    };
    let volumes: Vec<f64> = (4..8).map(at).collect();
    let steps: Vec<f64> = volumes.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let ratio = (steps[1] / steps[0]).abs().max((steps[2] / steps[1]).abs());
    assert!(ratio < 0.7, "{steps:?}");
    (volumes[3].abs(), steps[2].abs() * ratio / (1.0 - ratio))
}

/// Surfaces that are rough at every scale.
#[test]
fn rough_surfaces() {
    let mut texture = cube(Scheme::DooSabin);
    texture.coefficients = vec![Coefficients { faces: None, weights: vec![vec![0.49, 0.21, 0.09, 0.21], vec![0.6, 0.2, 0.2]] }];
    for rough in [attractor(texture), rings(CurveScheme::CornerCutting { a: 0.35, b: 0.1, closed: true })] {
        let (found, (last, rest)) = (measured(&rough), polyhedra(&rough));
        assert!((found.low - last).abs() <= 2.0 * rest, "{found:?} {last} {rest}");
        assert!(found.width() <= 1e-6 * found.high, "{found:?}");
    }
}

/// The product of a closed curve scheme with Chaikin's, on the net of `torus`.
fn rings(scheme: CurveScheme) -> Attractor {
    let points = torus(Scheme::DooSabin, 5, 6).vertices;
    let chaikin = CurveScheme::CornerCutting { a: 0.25, b: 0.25, closed: true };
    let product = TensorProduct {
        schemes: vec![scheme, chaikin],
        control_points: ControlNet { size: vec![5, 6], points, weights: None },
        separate: true,
        trim: None,
    };
    Model { name: None, shape: Shape::TensorProduct(product) }.lower().unwrap().attractor
}

/// Two ways to one surface: the product of closed quadratic splines, and Doo and Sabin's on a regular mesh.
#[test]
fn a_product_of_curves() {
    let (product, mesh) =
        (measured(&rings(CurveScheme::CornerCutting { a: 0.25, b: 0.25, closed: true })), volume(torus(Scheme::DooSabin, 5, 6)));
    assert!((product.low - mesh.low).abs() <= 1e-12 * mesh.low, "{product:?} {mesh:?}");
}

#[test]
fn what_encloses_nothing_says_why() {
    assert_eq!(refused(&attractor(grid(Scheme::CatmullClark, 3, 2, |x, y| x * y))), NotEnclosed::Open(10));
    // Two cubes, one within the other or beside it: nobody said which.
    let (mut two, other) = (cube(Scheme::CatmullClark), cube(Scheme::CatmullClark));
    two.vertices.extend(other.vertices.iter().map(|vertex| *vertex * 0.25));
    two.faces.extend(other.faces.iter().map(|face| face.iter().map(|corner| corner + 8).collect::<Vec<_>>()));
    assert_eq!(refused(&attractor(two)), NotEnclosed::Pieces(2));
    let many = cages::cage(Scheme::CatmullClark, prism(40), prism_faces(40));
    assert!(matches!(refused(&attractor(many)), NotEnclosed::TooLarge { points, .. } if points > 40));
    // Faces whose children are nearly as large as themselves: dimension above 3.
    let mut wild = cube(Scheme::DooSabin);
    wild.coefficients = vec![Coefficients { faces: None, weights: vec![vec![0.85, 0.05, 0.05, 0.05]] }];
    assert!(matches!(refused(&attractor(wild)), NotEnclosed::Divergent { sum, .. } if sum > 0.5));
    let mesh = PolygonMesh { vertices: prism(3), faces: prism_faces(3), interior: Interior::Auto };
    let mesh = Model { name: None, shape: Shape::Mesh(mesh) }.lower().unwrap().attractor;
    assert_eq!(refused(&mesh), NotEnclosed::NoSurface);
    let cancel = CancelToken::new();
    cancel.fire(StopReason::Cancelled);
    let budget = Budget { cancel, ..Budget::default() };
    assert!(matches!(enclosed_volume(&attractor(cube(Scheme::Loop)), &budget), Err(NotEnclosed::Stopped(_))));
}

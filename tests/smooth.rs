//! Curves and surfaces that are smooth: bounds and topology against closed forms.

use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

use glam::DVec3;
use lacuna_exchange::document::{DocumentLimits, read_model};
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::{Budget, CancelToken, Limits, StopReason};
use lacuna_kernel::dilation::{Dilation, DilationError, dilate, dilate_unsimplified, predict};
use lacuna_kernel::tolerance::{Radius, Tolerance};
use lacuna_tests::support::cases;
use lacuna_tests::support::random::Random;
use serde_json::{Value, json};

/// A circle of rational arcs around the z axis, or one in the x-z plane around the place (far, 0): Bezier points with weights, in homogeneous coordinates (x, z, w).
fn arcs(far: f64, radius: f64) -> Vec<[f64; 3]> {
    let corner = |k: i32| {
        let (sine, cosine) = (0.25 * PI * f64::from(k)).sin_cos();
        let (out, weight) = if k % 2 == 0 { (radius, 1.0) } else { (SQRT_2 * radius, 1.0 / SQRT_2) };
        [weight * (far + out * cosine), weight * out * sine, weight]
    };
    (0..9).map(corner).collect()
}

const KNOTS: [f64; 12] = [0.0, 0.0, 0.0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0, 1.0, 1.0];

fn lowered(shape: &Value) -> Attractor {
    let text = json!({"lacuna": 1, "shape": shape}).to_string();
    read_model(text.as_bytes(), &DocumentLimits::default()).unwrap().lower().unwrap().attractor
}

fn circle(radius: f64) -> Attractor {
    let all = arcs(0.0, radius);
    let points: Vec<[f64; 3]> = all.iter().map(|[x, y, w]| [x / w, y / w, 0.0]).collect();
    let weights: Vec<f64> = all.iter().map(|point| point[2]).collect();
    lowered(&json!({"family": "nurbs_curve", "degree": 2, "knots": KNOTS, "control_points": points, "weights": weights}))
}

/// A cylinder's side around the z axis.
fn cylinder(radius: f64, ends: [f64; 2]) -> Attractor {
    let all = arcs(0.0, radius);
    let points = ends.map(|z| all.iter().map(|[x, y, w]| [x / w, y / w, z]).collect::<Vec<_>>());
    let weights: Vec<f64> = all.iter().map(|point| point[2]).collect();
    lowered(&json!({
        "family": "nurbs_surface", "degree": [1, 2], "knots": [[0.0, 0.0, 1.0, 1.0], KNOTS],
        "control_points": points, "weights": [weights, weights],
    }))
}

fn torus(far: f64, radius: f64) -> Attractor {
    let (section, turn) = (arcs(far, radius), arcs(0.0, 1.0));
    let point = |[x, z, w]: &[f64; 3], [cosine, sine, v]: &[f64; 3]| [x / w * cosine / v, x / w * sine / v, z / w];
    let rows = |of: &dyn Fn(&[f64; 3], &[f64; 3]) -> Value| -> Vec<Value> {
        section.iter().map(|own| turn.iter().map(|by| of(own, by)).collect()).collect()
    };
    let points = rows(&|own, by| json!(point(own, by)));
    let weights = rows(&|own, by| json!(own[2] * by[2]));
    lowered(&json!({"family": "nurbs_surface", "degree": [2, 2], "knots": [KNOTS, KNOTS], "control_points": points, "weights": weights}))
}

fn made(shape: &Attractor, radius: f64, tolerance: f64) -> Dilation {
    let made = dilate(shape, Radius::new(radius).unwrap(), Tolerance::new(tolerance).unwrap(), &Budget::default()).unwrap();
    assert!(made.inner_mm <= tolerance && made.outer_mm <= tolerance && made.crossings == 0);
    made
}

/// Components, handles and cavities.
fn topology(made: &Dilation) -> (u64, i64, u64) {
    let topology = made.solid.topology();
    (topology.components, topology.genus, topology.cavities)
}

/// Asserts that all corners, and places on sides and in triangles, are as far from the shape as the bounds say.
#[track_caller]
fn assert_bounds(made: &Dilation, radius: f64, distance: impl Fn(DVec3) -> f64) {
    let mesh = made.solid.mesh();
    let within = radius - made.inner_mm..=radius + made.outer_mm;
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|corner| mesh.vertices[corner as usize]);
        for x in [a, a.midpoint(b), b.midpoint(c), c.midpoint(a), (a + b + c) / 3.0] {
            assert!(within.contains(&distance(x)), "{x} is {} from the shape", distance(x));
        }
    }
}

/// The dilation of a circle of radius R has a handle if r < R. What is claimed is true however near r is to R, and is claimed where it is not.
#[test]
fn a_dilated_circle_has_a_handle_below_its_radius() {
    let mut random = Random(1);
    let mut claimed = 0;
    for round in 0..60 {
        let is_near = round >= 20;
        let r = if is_near { 1.0 + (random.unit() - 0.5) * 10.0_f64.powi(-(round % 5)) } else { 0.2 + 0.7 * random.unit() };
        let made = made(&circle(1.0), r, r * if is_near { [0.01, 0.02, 0.03] } else { [0.03, 0.1, 0.3] }[round as usize % 3]);
        assert_bounds(&made, r, |x| (x.truncate().length() - 1.0).hypot(x.z));
        if made.topology_exact {
            claimed += 1;
            assert_eq!(topology(&made), (1, i64::from(r < 1.0), 0), "{r}");
        }
        // Nothing is near to critical there.
        assert!(made.topology_exact || r > 0.7 || round % 3 == 2, "{r}");
    }
    assert!(claimed > 20, "{claimed}");
}

/// Beside the radius where the handle goes, too, segments tell it that are few: where those that are fewest do not, finer ones do, with as much of the tolerance left for triangles.
#[test]
fn few_segments_tell_the_handle_of_a_dilated_circle() {
    for share in [0.9, 0.99, 1.01, 1.1] {
        let (r, e) = (share, 0.1 * share);
        let few = made(&circle(1.0), r, e);
        assert_bounds(&few, r, |x| (x.truncate().length() - 1.0).hypot(x.z));
        assert_eq!((topology(&few), few.topology_exact, few.pitch_mm), ((1, i64::from(r < 1.0), 0), true, None), "{r}");
        let many = dilate_unsimplified(&circle(1.0), Radius::new(r).unwrap(), Tolerance::new(e).unwrap(), &Budget::default()).unwrap();
        let [few, many] = [few, many].map(|made| made.solid.mesh().triangles.len());
        assert!(10 * few <= many, "{r}: {few} of {many}");
    }
}

/// A cylinder whose bore is a little wider than the ball, so that all of its sites are near to each other there: what that would take to tell is left in doubt, but for the bounds.
#[test]
fn crowded_sites_are_left_in_doubt() {
    let made = made(&cylinder(1.002, [0.0, 5.0]), 1.0, 0.1);
    assert_bounds(&made, 1.0, |x| (x.truncate().length() - 1.002).hypot((-x.z).max(x.z - 5.0).max(0.0)));
    assert!(!made.topology_exact || topology(&made) == (1, 1, 0));
}

/// The dilation of a torus with the radii a < R has a void if r < a, and the hole of the torus if r < R - a.
#[test]
fn a_dilated_torus_has_its_void_and_its_hole_as_long_as_there_is_room() {
    let mut random = Random(2);
    let shape = torus(10.0, 3.0);
    let mut claimed = [0; 3];
    for round in 0..12 {
        let r = match round % 4 {
            0 => 0.3 + 2.0 * random.unit(),
            1 => 3.0 + 0.6 * (random.unit() - 0.5),
            2 => 3.5 + 3.0 * random.unit(),
            _ => 7.0 + 1.4 * (random.unit() - 0.5),
        };
        let made = made(&shape, r, 0.1 * r);
        assert_bounds(&made, r, |x| ((x.truncate().length() - 10.0).hypot(x.z) - 3.0).abs());
        if made.topology_exact {
            let kind = usize::from(r > 3.0) + usize::from(r > 7.0);
            claimed[kind] += 1;
            assert_eq!(topology(&made), [(1, 2, 1), (1, 1, 0), (1, 0, 0)][kind], "{r}");
        }
        assert!(made.topology_exact || r > 2.5, "{r}");
    }
    assert!(claimed[0] >= 3, "{claimed:?}");
}

/// At least ten times fewer triangles than those of the lattice, within the same tolerance.
#[test]
fn smooth_surfaces_have_few_triangles() {
    let all = [
        ("nurbs/torus", 1.0),
        ("nurbs/sphere", 1.0),
        ("nurbs/bezier_saddle", 0.2),
        ("subdivision/catmull_clark_cube", 0.1),
        // Its curvature has no bound at its corners.
        ("subdivision/loop_tetrahedron", 0.03),
    ];
    for (name, radius) in all {
        let text = std::fs::read(cases::folder().join(name).join("model.json")).unwrap();
        let shape = read_model(&text, &DocumentLimits::default()).unwrap().lower().unwrap().attractor;
        let [r, e] = [radius, 0.1 * radius];
        let few = made(&shape, r, e);
        let many = dilate_unsimplified(&shape, Radius::new(r).unwrap(), Tolerance::new(e).unwrap(), &Budget::default()).unwrap();
        let [few_triangles, many_triangles] = [&few, &many].map(|made| made.solid.mesh().triangles.len());
        assert!(10 * few_triangles <= many_triangles, "{name}: {few_triangles} of {many_triangles}");
        assert!(few.topology_exact && few.pitch_mm.is_none(), "{name}");
        // What is predicted is made.
        let predicted = predict(&shape, Radius::new(r).unwrap(), Tolerance::new(e).unwrap(), true, &Budget::default()).unwrap();
        assert_eq!(predicted.triangles, few_triangles as f64, "{name}");
        assert!(2.0 * (radius - few.inner_mm) >= predicted.least_thickness_mm, "{name}");
    }
}

/// A cylinder's side: a surface with a border, whose dilation is a ring.
#[test]
fn borders_of_smooth_surfaces_are_rounded() {
    let made = made(&cylinder(5.0, [-4.0, 4.0]), 1.0, 0.1);
    assert_bounds(&made, 1.0, |x| (x.truncate().length() - 5.0).hypot((x.z.abs() - 4.0).max(0.0)));
    assert_eq!((topology(&made), made.topology_exact), ((1, 1, 0), true));
    // A wall of 2 mm around a circle of 5 mm, 8 mm high, and half of a ring's section on either end.
    let volume = 2.0 * PI * 5.0 * (2.0 * 8.0 + PI);
    let mesh = made.solid.mesh();
    let own: f64 = mesh
        .triangles
        .iter()
        .map(|corners| {
            let [a, b, c] = corners.map(|corner| mesh.vertices[corner as usize]);
            a.dot(b.cross(c)) / 6.0
        })
        .sum();
    let area = 4.0 * PI * 5.0 * (8.0 + FRAC_PI_2);
    assert!((own - volume).abs() < 0.1 * area, "{own} {volume}");
}

#[test]
fn smooth_surfaces_are_stopped_and_limited() {
    let shape = torus(10.0, 3.0);
    let dilated = |budget: &Budget| dilate(&shape, Radius::new(1.0).unwrap(), Tolerance::new(0.1).unwrap(), budget);
    let cancel = CancelToken::new();
    cancel.fire(StopReason::Cancelled);
    let stopped = dilated(&Budget { cancel, ..Budget::default() });
    assert!(matches!(stopped, Err(DilationError::Stopped(_))), "{stopped:?}");
    let with = |limits: Limits| dilated(&Budget { limits, ..Budget::default() });
    let made = with(Limits::default()).unwrap().solid.mesh().triangles.len() as u64;
    assert!(with(Limits { triangles: made, ..Limits::default() }).is_ok());
    let refused = with(Limits { triangles: made / 3, ..Limits::default() });
    assert!(matches!(refused, Err(DilationError::Triangles { .. })), "{refused:?}");
    // Drawn with fewer cells than triangles: where either are too many, another way does it with as few as are allowed.
    let drawn = with(Limits::default()).unwrap().leaf_cells;
    for cells in [drawn, drawn - 1, drawn / 2] {
        match with(Limits { cells, ..Limits::default() }) {
            Ok(made) => assert!(made.leaf_cells <= cells, "{} of {cells}", made.leaf_cells),
            Err(refused) => assert!(cells < drawn && matches!(refused, DilationError::LeafCells { .. }), "{refused}"),
        }
    }
    let refused = with(Limits { cells: 50, ..Limits::default() });
    assert!(matches!(refused, Err(DilationError::LeafCells { .. })), "{refused:?}");
}

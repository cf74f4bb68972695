//! The smallest box: closed forms, and random points against boxes turned at random.

use crate::oracle::Random;
use glam::{DMat3, DQuat, DVec3};
use lacuna_kernel::budget::{Budget, CancelToken, StopReason};
use lacuna_kernel::measure::{OrientedBox, oriented_box};

fn found(points: &[DVec3], grown: f64, relative: f64) -> OrientedBox {
    oriented_box(points, grown, 0.0, relative, &Budget::default()).unwrap().unwrap()
}

fn corners(sizes: DVec3) -> Vec<DVec3> {
    (0..8).map(|code| sizes * (DVec3::new((code & 1) as f64, (code >> 1 & 1) as f64, (code >> 2) as f64) - 0.5)).collect()
}

/// Every point is in the box, up to rounding.
fn assert_holds(found: &OrientedBox, points: &[DVec3]) {
    for (axis, size) in found.axes.iter().zip(found.sizes) {
        assert!((axis.length() - 1.0).abs() < 1e-12);
        for point in points {
            assert!((*point - found.centre).dot(*axis).abs() <= 0.5 * size + 1e-9, "{point}");
        }
    }
    let volume: f64 = found.sizes.iter().product();
    assert!((volume - found.volume.high).abs() <= 1e-9 * volume);
    assert!(found.volume.low <= found.volume.high);
}

#[test]
fn a_turned_box_is_its_own_box() {
    let turn = DMat3::from_quat(DQuat::from_rotation_x(0.7) * DQuat::from_rotation_y(-1.9) * DQuat::from_rotation_z(0.3));
    let points: Vec<DVec3> = corners(DVec3::new(10.0, 4.0, 1.0)).into_iter().map(|p| turn * p + DVec3::new(5.0, -70.0, 3.0)).collect();
    let found = found(&points, 0.0, 1e-3);
    assert_holds(&found, &points);
    assert!(found.complete);
    assert!(found.volume.low <= 40.0 && 40.0 <= found.volume.high && found.volume.width() <= 0.05, "{:?}", found.volume);
    assert!((found.volume.high - 40.0).abs() < 1e-6, "{}", found.volume.high);
}

#[test]
fn tetrahedra_balls_and_segments() {
    // The smallest box of the regular tetrahedron in a cube of edge 2 is that cube (O'Rourke 1985: one face flush with two edges each).
    let tetrahedron = [DVec3::ONE, DVec3::new(1.0, -1.0, -1.0), DVec3::new(-1.0, 1.0, -1.0), DVec3::new(-1.0, -1.0, 1.0)];
    let cube = found(&tetrahedron, 0.0, 1e-2);
    assert_holds(&cube, &tetrahedron);
    assert!(
        cube.volume.low <= 8.0 && 8.0 <= cube.volume.high * (1.0 + 1e-12) && (cube.volume.high - 8.0).abs() < 1e-6,
        "{:?}",
        cube.volume
    );
    // A ball around a point: a cube whichever way it is turned.
    let ball = found(&[DVec3::new(1.0, 2.0, 3.0)], 6.0, 1e-3);
    assert!((ball.volume.low - 216.0).abs() < 0.3 && (ball.volume.high - 216.0).abs() < 1e-6, "{:?}", ball.volume);
    // A capsule: its own box.
    let capsule = found(&[DVec3::ZERO, DVec3::new(3.0, 4.0, 12.0)], 2.0, 1e-2);
    assert!(capsule.volume.low <= 4.0 * 15.0 && (capsule.volume.high - 60.0).abs() < 1e-4, "{:?}", capsule.volume);
    assert!(oriented_box(&[], 0.0, 0.0, 0.1, &Budget::default()).unwrap().is_none());
    // A segment has no volume.
    assert!(found(&[DVec3::ZERO, DVec3::ONE], 0.0, 1e-2).volume.low == 0.0);
}

#[test]
fn a_search_ends_when_it_is_stopped() {
    let cancel = CancelToken::new();
    cancel.fire(StopReason::Deadline);
    assert!(oriented_box(&corners(DVec3::ONE), 0.0, 0.0, 1e-3, &Budget { cancel, ..Budget::default() }).is_err());
}

#[test]
fn no_box_is_smaller_than_the_bound() {
    let mut random = Random(5);
    for case in 0..24 {
        let count = 4 + 2 * case;
        let points: Vec<DVec3> = (0..count).map(|_| random.point(1.0) * DVec3::new(1.0, 0.6, 0.3)).collect();
        let grown = 0.3 * random.unit();
        let found = found(&points, grown, 2e-2);
        assert_holds(&found, &points);
        for _ in 0..300 {
            let part = random.point(1.0);
            let axes = DMat3::from_quat(DQuat::from_vec4(part.extend(2.0 * random.unit() - 1.0).normalize()));
            let volume: f64 = (0..3)
                .map(|k| {
                    let heights = points.iter().map(|point| point.dot(axes.col(k)));
                    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
                    high - low + grown
                })
                .product();
            assert!(volume >= found.volume.low * (1.0 - 1e-12), "{volume} < {:?}", found.volume);
        }
    }
}

/// Many points: of a turned box, whose corners alone matter; of a long and thin ellipsoid, whose own box is the smallest (its widths along any three axes at right
/// angles multiply to at least those along its own, by Hadamard's inequality); and of a ball.
#[test]
fn many_points_have_the_box_of_their_hull() {
    let mut random = Random(8);
    let turn = DMat3::from_quat(DQuat::from_rotation_x(0.7) * DQuat::from_rotation_y(-1.9) * DQuat::from_rotation_z(0.3));
    let place = DVec3::new(5.0, -70.0, 3.0);
    let mut points: Vec<DVec3> = corners(DVec3::new(10.0, 4.0, 1.0));
    points.extend((0..60_000).map(|_| DVec3::new(10.0, 4.0, 1.0) * 0.5 * random.point(1.0)));
    // On the faces, and in rows.
    points.extend((0..30_000).map(|k| {
        DVec3::new(5.0, 2.0, 0.5) * [DVec3::X, DVec3::Y, DVec3::Z][k % 3] + [DVec3::Y, DVec3::Z, DVec3::X][k % 3] * 0.5 * random.unit()
    }));
    let points: Vec<DVec3> = points.into_iter().map(|p| turn * p + place).collect();
    let box_of = found(&points, 0.0, 1e-3);
    assert_holds(&box_of, &points);
    assert!(box_of.complete && box_of.volume.low <= 40.0 && (box_of.volume.high - 40.0).abs() < 1e-6, "{:?}", box_of.volume);

    let ball: Vec<DVec3> = (0..60_000).map(|_| random.point(1.0).normalize_or(DVec3::X)).collect();
    let sizes = DVec3::new(10.0, 4.0, 1.0);
    let ellipsoid: Vec<DVec3> = ball.iter().map(|p| turn * (sizes * *p) + place).collect();
    let box_of = found(&ellipsoid, 0.0, 1e-2);
    assert_holds(&box_of, &ellipsoid);
    let exact = 8.0 * sizes.element_product();
    assert!(box_of.complete, "{:?}", box_of.volume);
    // Points on it are not all of it.
    assert!(box_of.volume.low <= exact && box_of.volume.high >= 0.99 * exact && box_of.volume.high <= 1.01 * exact, "{:?}", box_of.volume);

    let box_of = found(&ball, 0.5, 2e-2);
    assert_holds(&box_of, &ball);
    assert!(box_of.volume.low <= 2.5_f64.powi(3) && box_of.volume.high >= 2.49_f64.powi(3), "{:?}", box_of.volume);
}

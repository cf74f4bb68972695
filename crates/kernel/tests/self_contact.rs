//! Where shapes come near themselves, against closed forms, polygons that are drawn by hand and fine samples.

use crate::oracle::Random;
use glam::{DMat3, DVec3};
use lacuna_kernel::attractor::{Address, Attractor, point_at};
use lacuna_kernel::budget::{Budget, StopReason};
use lacuna_kernel::error::Kind;
use lacuna_kernel::measure::{Contact, ContactError, ContactQuery, Verdict, intersect_self};
use lacuna_kernel::model::{
    AffineMap, BezierCurve, BoundaryRule, ControlNet, CornerCutting, Curve, CurveScheme, Ifs, Interior, Model, PolygonMesh, Scheme, Shape,
    Subdivision,
};
use lacuna_kernel::tolerance::Tolerance;

fn attractor(shape: Shape) -> Attractor {
    Model { name: None, shape }.lower().unwrap().attractor
}

fn ifs(maps: Vec<AffineMap>) -> Attractor {
    attractor(Shape::Ifs(Ifs { maps, primitive: None, graph: None }))
}

fn scaled(ratio: f64, corners: &[DVec3]) -> Attractor {
    ifs(corners.iter().map(|&translation| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(ratio)), translation }).collect())
}

fn mesh(vertices: Vec<[f64; 3]>, faces: Vec<Vec<u32>>) -> Attractor {
    let vertices = vertices.into_iter().map(DVec3::from_array).collect();
    attractor(Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Surface }))
}

fn query(resolution: f64) -> ContactQuery {
    ContactQuery { resolution: Tolerance::new(resolution).unwrap(), most: 1_000_000 }
}

fn ask(shape: &Attractor, resolution: f64) -> Contact {
    let found = intersect_self(shape, &query(resolution), &Budget::default()).unwrap();
    // Beyond the resolution the search may end early.
    let narrow = found.distance_mm.low > resolution || found.distance_mm.width() <= 5.0 * resolution;
    assert!(found.complete && narrow, "{:?}", found.distance_mm);
    found
}

/// Proven not to touch itself, and what is not joined is farther apart than the resolution.
#[track_caller]
fn is_free(shape: &Attractor, resolution: f64) -> Contact {
    let found = ask(shape, resolution);
    assert_eq!((found.verdict(), found.places.len()), (Verdict::Disjoint, 0), "{:?} {:?}", found.distance_mm, found.places.first());
    assert!(found.distance_mm.low > resolution);
    found
}

fn is_in_a_place(found: &Contact, point: DVec3) -> bool {
    found
        .places
        .iter()
        .any(|place| point.cmpge(DVec3::from_array(place.low) - 1e-9).all() && point.cmple(DVec3::from_array(place.high) + 1e-9).all())
}

const HEIGHT: f64 = 0.866_025_403_784_438_6;

/// The maps of a curve in the plane whose parts run from point to point, each turned and scaled.
fn generator(points: &[[f64; 2]]) -> (Vec<DVec3>, Vec<AffineMap>) {
    let points: Vec<DVec3> = points.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect();
    let whole = points[points.len() - 1] - points[0];
    let maps = points.windows(2).map(|ends| {
        let along = ends[1] - ends[0];
        let (cosine, sine) = (along.dot(whole) / whole.length_squared(), whole.cross(along).z / whole.length_squared());
        let ratio = cosine.hypot(sine);
        let linear = DMat3::from_cols(DVec3::new(cosine, sine, 0.0), DVec3::new(-sine, cosine, 0.0), DVec3::new(0.0, 0.0, ratio));
        AffineMap { linear, translation: ends[0] - linear * points[0] }
    });
    let maps = maps.collect();
    (points, maps)
}

fn koch() -> (Vec<DVec3>, Vec<AffineMap>) {
    let third = 100.0 / 3.0;
    generator(&[[0.0, 0.0], [third, 0.0], [50.0, third * HEIGHT], [2.0 * third, 0.0], [100.0, 0.0]])
}

/// The curve whose parts are declared to share their ends.
fn joined((points, maps): (Vec<DVec3>, Vec<AffineMap>)) -> Attractor {
    let scheme = CurveScheme::AffineInterpolation { maps };
    attractor(Shape::Curve(Curve { scheme, control_points: ControlNet::line(points) }))
}

#[test]
fn cantors_set_does_not_touch_itself() {
    // Cells of 81 / 3^k; those of more than 2.8 are in two, the smallest 9 mm long with a gap of 3.
    let set = scaled(1.0 / 3.0, &[DVec3::ZERO, DVec3::new(54.0, 0.0, 0.0)]);
    let found = is_free(&set, 0.7);
    assert!(found.distance_mm.low <= 3.0 && found.distance_mm.high >= 3.0, "{:?}", found.distance_mm);
    // A resolution at which the whole is one piece has nothing to tell.
    let error = intersect_self(&set, &query(20.0), &Budget::default()).unwrap_err();
    assert_eq!((error.clone(), error.kind()), (ContactError::Whole { resolution_mm: 20.0 }, Kind::Invalid));
}

#[test]
fn sierpinskis_triangle_touches_itself_at_all_corners() {
    let side = 40.0;
    let triangle = scaled(0.5, &[DVec3::ZERO, DVec3::new(0.5 * side, 0.0, 0.0), DVec3::new(0.25 * side, 0.5 * HEIGHT * side, 0.0)]);
    // Radii are side / sqrt(3) / 2^k or a little more, so that all cells down to k = 5 are cut at 0.1: the middles of their sides.
    let found = ask(&triangle, 0.1);
    assert_eq!(found.verdict(), Verdict::Near);
    let (mut corners, mut size) = (vec![(0.0, 0.0)], 1.0);
    for _ in 0..=5 {
        let half = 0.5 * size;
        for &(x, y) in &corners {
            for (u, v) in [(half, 0.0), (0.5 * half, half), (1.5 * half, half)] {
                let point = DVec3::new((x + u) * side, (y + v) * HEIGHT * side, 0.0);
                assert!(is_in_a_place(&found, point), "{point}");
            }
        }
        corners = corners.iter().flat_map(|&(x, y)| [(x, y), (x + half, y), (x + 0.5 * half, y + half)]).collect();
        size = half;
    }
    for place in &found.places {
        let (first, second) = (&place.pair.first, place.pair.second.as_ref().unwrap());
        let length = first.prefix.len().min(second.prefix.len());
        assert_ne!(first.prefix[..length], second.prefix[..length], "{first} {second}");
    }
}

#[test]
fn declared_ends_do_not_count() {
    // As maps nothing says that the parts of Koch's curve share their ends: 4^k - 1 contacts.
    let (_, maps) = koch();
    let bare = ask(&ifs(maps), 0.5);
    assert_eq!((bare.verdict(), bare.places.len()), (Verdict::Near, 4_usize.pow(3) - 1));
    for resolution in [2.0, 0.5, 0.1] {
        is_free(&joined(koch()), resolution);
    }
    // Smooth ones, open and closed, and one with a corner at which it ends.
    let corners = [[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
    for closed in [false, true] {
        let cutting = CornerCutting { control_points: corners.to_vec(), a: 0.25, b: 0.25, closed };
        is_free(&attractor(Shape::CornerCutting(cutting)), 0.05);
    }
}

/// The ends of the parts of a curve of so many levels, in order.
fn polygon((points, maps): &(Vec<DVec3>, Vec<AffineMap>), levels: usize) -> Vec<DVec3> {
    (0..levels).fold(vec![points[0], points[points.len() - 1]], |line, _| {
        let mut finer = Vec::new();
        for map in maps {
            finer.pop();
            finer.extend(line.iter().map(|&x| map.linear * x + map.translation));
        }
        finer
    })
}

/// Points that the polygon of Levy's dragon visits again after a long way are contacts, and each is told.
#[test]
fn a_dragon_touches_itself_where_its_polygon_does() {
    let resolution = 2.0;
    let levy = generator(&[[0.0, 0.0], [30.0, 30.0], [60.0, 0.0]]);
    let found = ask(&joined(levy.clone()), resolution);
    let line = polygon(&levy, 9);
    let mut visited = 0;
    for first in 0..line.len() {
        for second in first + 1..line.len() {
            // The way around must leave the ball of chains, whatever pieces it is made of.
            let far = line[first..second].iter().any(|x| x.distance(line[first]) > 16.0 * resolution);
            if far && line[first].distance(line[second]) < 1e-9 {
                visited += 1;
                assert!(is_in_a_place(&found, line[first]), "{}", line[first]);
            }
        }
    }
    assert!(visited > 0 && found.verdict() == Verdict::Near, "{visited}");
}

#[test]
fn a_loop_crosses_itself_once() {
    // x = 25 s^3 - 15 s and y = 22.5 (1 - s^2) with s = 2 t - 1: the crossing is where s^2 = 3/5.
    let points = [[-10.0, 0.0], [30.0, 30.0], [-30.0, 30.0], [10.0, 0.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
    for resolution in [0.1, 1e-2, 1e-3] {
        let curve = attractor(Shape::BezierCurve(BezierCurve { control_points: points.to_vec(), weights: None }));
        let found = ask(&curve, resolution);
        assert_eq!((found.verdict(), found.places.len()), (Verdict::Near, 1), "{resolution}");
        assert!(is_in_a_place(&found, DVec3::new(0.0, 9.0, 0.0)), "{:?}", found.places);
        let size = DVec3::from_array(found.places[0].high) - DVec3::from_array(found.places[0].low);
        assert!(size.max_element() < 40.0 * resolution, "{size}");
    }
    // Lifted, so that the strands pass each other: z = 8 s is 8 sqrt(3/5) twice over where they cross from above.
    let lifted: Vec<DVec3> = points.iter().zip([-8.0, -8.0 / 3.0, 8.0 / 3.0, 8.0]).map(|(p, z)| p.with_z(z)).collect();
    let curve = attractor(Shape::BezierCurve(BezierCurve { control_points: lifted, weights: None }));
    is_free(&curve, 0.05);
}

#[test]
fn surfaces_without_contact() {
    let corner = |k: u32| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) * 20.0;
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    for scheme in [Scheme::CatmullClark, Scheme::DooSabin] {
        let surface = Subdivision {
            scheme,
            vertices: (0..8).map(corner).collect(),
            faces: faces.iter().map(|face| face.to_vec()).collect(),
            creases: vec![],
            corners: vec![],
            boundary: BoundaryRule::default(),
            coefficients: vec![],
        };
        is_free(&attractor(Shape::Subdivision(surface)), 0.2);
    }
}

#[test]
fn triangles_of_a_mesh() {
    let ask = |vertices: &[[f64; 3]], faces: &[[u32; 3]]| {
        intersect_self(&mesh(vertices.to_vec(), faces.iter().map(|face| face.to_vec()).collect()), &query(0.01), &Budget::default())
    };
    let base = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0]];
    let with = |more: &[[f64; 3]]| [&base, more].concat();
    // They share an edge, or a corner, and nothing else: no pair is left.
    for (more, face) in [([[9.0, 9.0, 3.0], [0.0; 3]], [1, 3, 2]), ([[-5.0, -1.0, 0.0], [-1.0, -5.0, 2.0]], [0, 3, 4])] {
        assert!(matches!(ask(&with(&more), &[[0, 1, 2], face]), Err(ContactError::Whole { .. })), "{face:?}");
    }
    // They share an edge and lie on each other; a corner, and one passes through the other; nothing, and cross.
    for (more, face) in [
        ([[1.0, 1.0, 0.0], [0.0; 3], [0.0; 3]], [1, 3, 2]),
        ([[5.0, 1.0, 3.0], [5.0, 3.0, -3.0], [0.0; 3]], [0, 3, 4]),
        ([[2.0, 2.0, -1.0], [2.0, 2.0, 5.0], [3.0, 9.0, 1.0]], [3, 4, 5]),
    ] {
        let found = ask(&with(&more), &[[0, 1, 2], face]).unwrap();
        assert_eq!((found.verdict(), found.places.len()), (Verdict::Touching, 1), "{face:?}");
        assert_eq!((found.distance_mm.low, found.distance_mm.high), (0.0, 0.0));
        assert!(found.complete && found.nearest.first.root + found.nearest.second.unwrap().root == 1);
    }
    // Above each other.
    let found = ask(&with(&[[1.0, 1.0, 4.0], [3.0, 1.0, 4.0], [1.0, 3.0, 6.0]]), &[[0, 1, 2], [3, 4, 5]]).unwrap();
    assert!(found.complete && found.distance_mm.low <= 4.0 && 4.0 <= found.distance_mm.high && found.distance_mm.width() < 1e-9);
    // A wire whose first and third segment are 3 apart, and one that crosses itself.
    let wire = |points: &[[f64; 2]]| {
        let faces = (1..points.len() as u32).map(|k| vec![k - 1, k]).collect();
        mesh(points.iter().map(|&[x, y]| [x, y, 0.0]).collect(), faces)
    };
    let found = is_free(&wire(&[[0.0, 0.0], [10.0, 0.0], [10.0, 3.0], [0.0, 3.0]]), 0.01);
    assert!((found.distance_mm.low - 3.0).abs() < 1e-9 && (found.distance_mm.high - 3.0).abs() < 1e-9);
    let found = self::ask(&wire(&[[0.0, 0.0], [10.0, 0.0], [10.0, 3.0], [4.0, -3.0]]), 0.01);
    assert_eq!((found.verdict(), found.places.len()), (Verdict::Near, 1));
    assert!(is_in_a_place(&found, DVec3::new(7.0, 0.0, 0.0)));
}

#[test]
fn random_systems_against_fine_samples() {
    let (mut random, mut complete) = (Random(11), 0);
    for round in 0..24 {
        let map = |random: &mut Random| {
            let turn = DMat3::from_axis_angle(random.point(1.0).normalize_or(DVec3::Z), random.between(0.0, 6.0));
            let stretch = DMat3::from_diagonal(DVec3::new(random.between(0.2, 0.6), random.between(0.1, 0.6), random.between(0.05, 0.5)));
            AffineMap { linear: turn * stretch, translation: random.point(10.0) }
        };
        let shape = ifs((0..3).map(|_| map(&mut random)).collect());
        let resolution = 0.3;
        let found = intersect_self(&shape, &query(resolution), &Budget::default()).unwrap();
        complete += usize::from(found.complete);
        let point = |address: &Address| DVec3::from_array(point_at(&shape, address, &Budget::default()).unwrap().point);
        // The pair that is told is of two cells, neither of which is in the other, and as far apart as it says.
        let (first, second) = (&found.nearest.first, found.nearest.second.as_ref().unwrap());
        let length = first.prefix.len().min(second.prefix.len());
        assert_ne!(first.prefix[..length], second.prefix[..length], "{round}");
        let anchors = point(first).distance(point(second));
        let spread = 2.0 * (found.nearest.first_cell.radius + found.nearest.second_cell.radius);
        assert!(found.nearest.distance_mm.low <= anchors + 1e-9 && anchors <= found.nearest.distance_mm.high + spread, "{round}");
        // Points under different maps are in different pieces: none nearer than is told, and those within the resolution are in places.
        let sample: Vec<Vec<DVec3>> = (0..3)
            .map(|map| {
                let words = 0..3_usize.pow(6);
                words
                    .map(|code| {
                        let prefix = std::iter::once(map).chain((0..6).map(|k| code / 3_usize.pow(k) % 3)).collect();
                        point(&Address { root: 0, prefix, period: vec![0] })
                    })
                    .collect()
            })
            .collect();
        for [a, b] in [[0, 1], [0, 2], [1, 2]] {
            for x in &sample[a] {
                let least = sample[b].iter().map(|y| x.distance(*y)).fold(f64::INFINITY, f64::min);
                assert!(found.distance_mm.low <= least + 1e-9, "{round}: {:?} {least}", found.distance_mm);
                assert!(least > resolution || !found.complete || is_in_a_place(&found, *x), "{round}: {x}");
            }
        }
    }
    assert!(complete >= 12, "{complete}");
}

#[test]
fn limits_cancellation_and_the_same_answer() {
    let curve = joined(koch());
    assert_eq!(ask(&curve, 0.5), ask(&curve, 0.5));
    let mut budget = Budget::default();
    budget.limits.cells = 1;
    let halves = BezierCurve { control_points: vec![DVec3::ZERO, DVec3::new(9.0, 9.0, 0.0), DVec3::new(18.0, 0.0, 0.0)], weights: None };
    let unsettled = intersect_self(&attractor(Shape::BezierCurve(halves)), &query(0.1), &budget).unwrap_err();
    assert_eq!((unsettled.clone(), unsettled.kind()), (ContactError::Unsettled { resolution_mm: 0.1 }, Kind::Limit));
    assert!(matches!(intersect_self(&curve, &query(0.1), &budget), Err(ContactError::Unsettled { .. })));
    // There are 4^5 pieces, and more pairs.
    budget.limits.cells = 3000;
    let (_, maps) = koch();
    let found = intersect_self(&ifs(maps), &query(0.1), &budget).unwrap();
    assert!(!found.complete && found.distance_mm.low == 0.0);
    let mut shallow = Budget::default();
    shallow.limits.depth = 2;
    let (_, maps) = koch();
    assert!(!intersect_self(&ifs(maps), &query(0.01), &shallow).unwrap().complete);
    let none = ContactQuery { most: 0, ..query(0.1) };
    assert!(matches!(intersect_self(&curve, &none, &Budget::default()), Err(ContactError::Query { name: "most", .. })));
    budget.cancel.fire(StopReason::Cancelled);
    assert!(matches!(intersect_self(&curve, &query(0.1), &budget), Err(ContactError::Stopped(_))));
}

/// Segments of a wire that go on from their common end, and those that go back.
#[test]
fn segments_that_go_back_are_told() {
    let wire = |points: &[[f64; 3]]| mesh(points.to_vec(), (1..points.len() as u32).map(|k| vec![k - 1, k]).collect());
    // On in a line, around a corner, and back beside the way: the ends are apart by 1.
    is_free(&wire(&[[0.0; 3], [10.0, 0.0, 0.0], [20.0, 0.0, 0.0], [20.0, 10.0, 0.0], [0.0, 10.0, 0.0]]), 0.01);
    // Back on itself, by less, by as much and by more than it came; and aslant, where rounding would not tell.
    for back in [4.0, 0.0, -5.0] {
        let found = ask(&wire(&[[0.0; 3], [10.0, 0.0, 0.0], [back, 0.0, 0.0], [back, 30.0, 0.0]]), 0.01);
        assert_eq!((found.verdict(), found.distance_mm.high), (Verdict::Touching, 0.0));
        assert!(is_in_a_place(&found, DVec3::new(8.0, 0.0, 0.0)));
    }
    let found = ask(&wire(&[[1.0, 2.0, 3.0], [4.0, 8.0, 12.0], [2.0, 4.0, 6.0], [2.0, -40.0, 6.0]]), 0.01);
    assert_eq!(found.verdict(), Verdict::Touching);
    // A copy of a segment.
    let copied = mesh(vec![[0.0; 3], [10.0, 0.0, 0.0], [0.0, 5.0, 0.0]], vec![vec![0, 1], vec![1, 0], vec![0, 2]]);
    assert_eq!(ask(&copied, 0.01).verdict(), Verdict::Touching);
    // An angle of 1e-9 is no overlap, though arms so near count as near.
    let sharp =
        intersect_self(&wire(&[[0.0; 3], [10.0, 0.0, 0.0], [0.0, 1e-8, 0.0], [0.0, 40.0, 0.0]]), &query(0.01), &Budget::default()).unwrap();
    assert_ne!(sharp.verdict(), Verdict::Touching);
}

#[test]
fn segments_along_a_triangle_from_its_corner_are_told() {
    // The triangle lies in z = x + 2 y: sums of whole numbers, so that the plane is exact. A segment leaves the corner (1, 1) for (x, y), raised.
    let at = |x: f64, y: f64| [x, y, x + 2.0 * y];
    let with = |[x, y]: [f64; 2], raised: f64, turned: bool| {
        let end = at(x, y);
        let segment = if turned { vec![3, 0] } else { vec![0, 3] };
        // A second triangle far away: there is something to compare with even where all that is near is joined.
        let far = [at(900.0, 0.0), at(910.0, 0.0), at(900.0, 10.0)];
        let vertices = [vec![at(1.0, 1.0), at(9.0, 1.0), at(1.0, 9.0), [end[0], end[1], end[2] + raised]], far.to_vec()].concat();
        mesh(vertices, vec![vec![0, 1, 2], segment, vec![4, 5, 6]])
    };
    for turned in [false, true] {
        // Inside, past the opposite side, and along a side by less and by more than it is long.
        for end in [[3.0, 2.0], [20.0, 30.0], [4.0, 1.0], [30.0, 1.0], [1.0, 5.0], [1.0, 12.0]] {
            let found = ask(&with(end, 0.0, turned), 0.01);
            assert_eq!((found.verdict(), found.distance_mm.high), (Verdict::Touching, 0.0), "{end:?}");
            assert!(is_in_a_place(&found, DVec3::from_array(at(1.0, 1.0))), "{end:?}");
            // Off the plane by one unit in the last place it is only joined.
            assert_ne!(ask(&with(end, 1e-14, turned), 0.01).verdict(), Verdict::Touching, "{end:?} raised");
        }
        // Outside the angle, on the line of a side the other way, and the side itself.
        for end in [[-3.0, -2.0], [-4.0, 1.0], [1.0, -5.0], [30.0, 0.0], [0.0, 9.0], [9.0, 1.0]] {
            assert_ne!(ask(&with(end, 0.0, turned), 0.01).verdict(), Verdict::Touching, "{end:?}");
        }
    }
}

//! Walls and gaps: closed forms, and random solids against rays.

use crate::oracle::Random;
use glam::{DMat3, DVec3};
use lacuna_kernel::budget::{Budget, CancelToken, StopReason};
use lacuna_kernel::measure::{Side, Thickness, ThicknessMap, thickness, thickness_map};
use lacuna_kernel::solid::TriMesh;
use std::f64::consts::FRAC_1_SQRT_2;

fn cuboid(low: DVec3, high: DVec3) -> TriMesh {
    let ends = [low, high];
    let corner = |code: usize| DVec3::from_array(std::array::from_fn(|axis| ends[code >> axis & 1][axis]));
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh { vertices: (0..8).map(corner).collect(), triangles }
}

fn joined(meshes: &[TriMesh]) -> TriMesh {
    let mut all = TriMesh::default();
    for mesh in meshes {
        let first = all.vertices.len() as u32;
        all.vertices.extend(&mesh.vertices);
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|corner| corner + first)));
    }
    all
}

fn turned_inside_out(mut mesh: TriMesh) -> TriMesh {
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh
}

/// Points of latitude and longitude on a sphere.
fn sphere(radius: f64, rings: u32, sectors: u32) -> TriMesh {
    let mut mesh = TriMesh { vertices: vec![DVec3::Z * radius, -DVec3::Z * radius], triangles: Vec::new() };
    let at = |ring: u32, sector: u32| 2 + ring * sectors + sector % sectors;
    for ring in 0..rings {
        let polar = std::f64::consts::PI * f64::from(ring + 1) / f64::from(rings + 1);
        for sector in 0..sectors {
            let angle = std::f64::consts::TAU * f64::from(sector) / f64::from(sectors);
            mesh.vertices.push(radius * DVec3::new(polar.sin() * angle.cos(), polar.sin() * angle.sin(), polar.cos()));
        }
    }
    for sector in 0..sectors {
        mesh.triangles.push([0, at(0, sector), at(0, sector + 1)]);
        mesh.triangles.push([1, at(rings - 1, sector + 1), at(rings - 1, sector)]);
        for ring in 0..rings - 1 {
            mesh.triangles.push([at(ring, sector), at(ring + 1, sector), at(ring + 1, sector + 1)]);
            mesh.triangles.push([at(ring, sector), at(ring + 1, sector + 1), at(ring, sector + 1)]);
        }
    }
    mesh
}

fn least(mesh: &TriMesh, side: Side) -> Option<Thickness> {
    thickness(mesh, side, 0.0, &Budget::default()).unwrap()
}

fn map(mesh: &TriMesh, side: Side) -> ThicknessMap {
    thickness_map(mesh, side, 0.0, &Budget::default()).unwrap()
}

#[track_caller]
fn assert_is(found: Option<Thickness>, exact: f64) {
    let found = found.unwrap();
    assert!(found.least.low <= exact && exact <= found.least.high && found.least.width() < 1e-9, "{exact}: {found:?}");
    assert!((found.between[0].distance(found.between[1]) - exact).abs() < 1e-9, "{found:?}");
}

#[test]
fn slabs_and_plates() {
    let slab = cuboid(DVec3::new(-5.0, 2.0, 1.0), DVec3::new(45.0, 32.0, 1.75));
    assert_is(least(&slab, Side::Wall), 0.75);
    assert_eq!(least(&slab, Side::Gap), None);
    // Turned, rounding is all that is lost.
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.8);
    let turned = TriMesh { vertices: slab.vertices.iter().map(|p| turn * *p).collect(), ..slab };
    assert_is(least(&turned, Side::Wall), 0.75);
    // Two plates of 2 and 3 at a gap of 0.3, the second beside most of the first.
    let plates =
        joined(&[cuboid(DVec3::ZERO, DVec3::new(10.0, 10.0, 2.0)), cuboid(DVec3::new(9.0, 0.0, 2.3), DVec3::new(20.0, 10.0, 5.3))]);
    assert_is(least(&plates, Side::Wall), 2.0);
    assert_is(least(&plates, Side::Gap), 0.3);
    // Side by side without anything of one over the other: no gap along normals.
    let apart = joined(&[cuboid(DVec3::ZERO, DVec3::ONE), cuboid(DVec3::new(1.5, 1.5, 1.5), DVec3::splat(2.5))]);
    assert_eq!(least(&apart, Side::Gap), None);
}

/// A corner of the lid that is up to a nanometre from an edge makes a needle, and sides that are along the lid's normals but for rounding.
#[test]
fn plates_with_needles() {
    let turn = DMat3::from_axis_angle(DVec3::new(2.0, -1.0, 3.0).normalize(), 0.6);
    for height in [1e-3, 1e-4, 1e-5, 1e-6] {
        let corners = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]];
        let at = |z: f64| corners.map(|[x, y]| turn * DVec3::new(x, y, z));
        let vertices = [at(0.0).as_slice(), &at(10.0), &[turn * DVec3::new(37.0, height, 10.0)]].concat();
        let sides = [[0, 3, 2], [0, 2, 1], [0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]];
        let lid = [[4, 5, 8], [5, 6, 8], [6, 7, 8], [7, 4, 8]];
        assert_is(least(&TriMesh { vertices, triangles: [sides.as_slice(), &lid].concat() }, Side::Wall), 10.0);
    }
}

#[test]
fn wedges_are_thinnest_where_faces_without_a_common_corner_are() {
    // A lid over a box at a slope: z from 1 at x = 0 to 3 at x = 10, thinnest at the low end, seen from the bottom along z and from the lid along its normal.
    let mut wedge = cuboid(DVec3::ZERO, DVec3::new(10.0, 4.0, 1.0));
    for vertex in &mut wedge.vertices {
        if vertex.z > 0.5 {
            vertex.z = 1.0 + 0.2 * vertex.x;
        }
    }
    // From the bottom the way is 1 at x = 0. From the lid the normal leans away from x = 0: through (x, 1 + x / 5) it meets the bottom after sqrt(1.04) (1 + x / 5).
    assert_is(least(&wedge, Side::Wall), 1.0);
}

#[test]
fn balls_and_shells() {
    let ball = sphere(5.0, 23, 48);
    let found = least(&ball, Side::Wall).unwrap();
    // Faces of the polyhedron across each other are at most the diameter apart, and not much less.
    assert!(found.least.high <= 10.0 && found.least.low >= 9.9, "{found:?}");
    assert_eq!(least(&ball, Side::Gap), None);
    let shell = joined(&[sphere(5.0, 47, 96), turned_inside_out(sphere(4.0, 47, 96))]);
    let found = least(&shell, Side::Wall).unwrap();
    // The outer polyhedron is within the outer sphere by 5 (1 - cos(pi / 96)^2) at most.
    assert!(found.least.high <= 1.0 && found.least.low >= 1.0 - 0.011, "{found:?}");
    // Through the hollow: its diameter.
    let found = least(&shell, Side::Gap).unwrap();
    assert!(found.least.high <= 8.0 && found.least.low >= 7.97, "{found:?}");
}

/// The faces of a box are as thick as the box is along their normals, its corners as its least edge; nothing lies outside.
#[test]
fn the_map_of_a_cuboid() {
    let size = DVec3::new(3.0, 5.0, 7.5);
    let slab = cuboid(DVec3::new(-1.0, 2.0, 4.0), DVec3::new(-1.0, 2.0, 4.0) + size);
    // Two triangles for each face, in the order of `cuboid`.
    let exact = [3.0, 3.0, 5.0, 5.0, 7.5, 7.5].map(|edge| [edge; 2]);
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, -2.0, 3.0).normalize(), 0.8);
    let turned = TriMesh { vertices: slab.vertices.iter().map(|p| turn * *p).collect(), ..slab.clone() };
    for mesh in [slab, turned] {
        let wall = map(&mesh, Side::Wall);
        for (found, exact) in wall.faces.iter().zip(exact.as_flattened()) {
            assert!((found - exact).abs() < 1e-12, "{:?}", wall.faces);
        }
        assert!(wall.vertices.iter().all(|found| (found - 3.0).abs() < 1e-12), "{:?}", wall.vertices);
        let gap = map(&mesh, Side::Gap);
        assert_eq!((gap.faces, gap.vertices), (vec![f64::INFINITY; 12], vec![f64::INFINITY; 8]));
    }
}

/// Of a hollow ball all faces have the wall between both spheres, and only those inside have a gap, its diameter.
#[test]
fn the_map_of_a_hollow_ball() {
    let (outer, inner) = (sphere(5.0, 47, 96), turned_inside_out(sphere(4.0, 47, 96)));
    let (count, vertices) = (outer.triangles.len(), outer.vertices.len());
    let shell = joined(&[outer, inner]);
    // Faces are within their sphere by 1 - cos(pi / 96)^2 of its radius at most, and the corners of one of 0.33 by 0.33 are 0.24 from its middle, where the other
    // sphere is farther by 0.24^2 / 8.
    let flat = 1.0 - (std::f64::consts::PI / 96.0).cos().powi(2);
    let wall = map(&shell, Side::Wall);
    for found in wall.faces.iter().chain(&wall.vertices) {
        assert!((1.0 - 5.0 * flat..=1.0 + 4.0 * flat + 0.008).contains(found), "{found}");
    }
    let gap = map(&shell, Side::Gap);
    assert!(gap.faces[..count].iter().chain(&gap.vertices[..vertices]).all(|found| *found == f64::INFINITY));
    for found in gap.faces[count..].iter().chain(&gap.vertices[vertices..]) {
        assert!((8.0 * (1.0 - flat) - 0.02..=8.0).contains(found), "{found}");
    }
}

#[test]
fn a_search_ends_when_it_is_stopped() {
    let cancel = CancelToken::new();
    cancel.fire(StopReason::Cancelled);
    let budget = Budget { cancel, ..Budget::default() };
    assert!(thickness(&sphere(1.0, 20, 20), Side::Wall, 0.0, &budget).is_err());
    assert!(thickness_map(&sphere(1.0, 20, 20), Side::Gap, 0.0, &budget).is_err());
}

/// No ray along a normal that leaves through a face that looks at its own is shorter than the thickness over that, some are hardly longer, and the least of the map is the least thickness.
#[test]
fn rays_are_as_long_as_the_map_says() {
    let mut random = Random(17);
    let mut attained = 0;
    for _ in 0..32 {
        // A star-shaped lump, and the same one turned beside it: faces do not cross.
        let mut lump = sphere(1.0, 12, 14);
        for vertex in lump.vertices.iter_mut().skip(2) {
            *vertex *= 0.5 + random.unit();
        }
        let gap = 0.05 + 0.45 * random.unit();
        let moved = TriMesh { vertices: lump.vertices.iter().map(|p| DVec3::new(3.0 + gap - p.x, -p.y, p.z)).collect(), ..lump.clone() };
        let mesh = joined(&[lump, moved]);
        for side in [Side::Wall, Side::Gap] {
            let map = map(&mesh, side);
            assert_eq!(map.least, least(&mesh, side));
            let thinnest = least(&mesh, side).map_or(f64::INFINITY, |found| f64::midpoint(found.least.low, found.least.high));
            for values in [&map.faces, &map.vertices] {
                let found = values.iter().copied().fold(f64::INFINITY, f64::min);
                assert!(found == thinnest || (found - thinnest).abs() < 1e-12, "{side:?}: {found} and {thinnest}");
            }
            for (number, (own, least)) in mesh.triangles.iter().zip(&map.faces).enumerate() {
                let [a, b, c] = own.map(|corner| mesh.vertices[corner as usize]);
                let normal = (b - a).cross(c - a).normalize();
                let direction = if side == Side::Wall { -normal } else { normal };
                for _ in 0..4 {
                    let (s, t) = (random.unit(), random.unit());
                    let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                    let origin = a + (b - a) * s + (c - a) * t;
                    let others = mesh.triangles.iter().enumerate().filter(|&(other, _)| other != number);
                    let hits = others.filter_map(|(_, other)| {
                        let corners = other.map(|corner| mesh.vertices[corner as usize]);
                        let theirs = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
                        let looks = -normal.dot(theirs) >= FRAC_1_SQRT_2 && !other.iter().any(|corner| own.contains(corner));
                        hit(origin, direction, corners).map(|length| (length, looks))
                    });
                    let Some((length, looks)) = hits.min_by(|one, other| one.0.total_cmp(&other.0)) else { continue };
                    assert!(!looks || length >= *least - 1e-9, "{side:?}: a ray of {length} is shorter than {least}");
                    attained += usize::from(looks && length < *least * 1.05);
                }
            }
        }
    }
    assert!(attained > 1000, "{attained}");
}

/// A way that leaves through a slope is no wall, whatever lies beyond: below an arm it is not counted up to the arm's top, though that looks at the bottom.
#[test]
fn what_a_slope_hides_is_not_seen() {
    let outline = [[0.0, 0.0], [10.0, 0.0], [6.0, 8.0], [12.0, 8.6], [12.0, 9.4], [0.0, 10.0]];
    let count = outline.len() as u32;
    let vertices = [0.0, 20.0].iter().flat_map(|&z| outline.map(|[x, y]| DVec3::new(x, y, z))).collect();
    let sides = (0..count).flat_map(|k| {
        let next = (k + 1) % count;
        [[k, next, next + count], [k, next + count, k + count]]
    });
    let caps = [[0, 1, 2], [0, 2, 5], [2, 3, 4], [2, 4, 5]];
    let ends = caps.iter().flat_map(|&[a, b, c]| [[a, c, b], [a + count, b + count, c + count]]);
    let mesh = TriMesh { vertices, triangles: sides.chain(ends).collect() };
    assert!(lacuna_kernel::measure::mass::volume_within(&mesh).low > 0.0);
    // The top falls from 10 by 0.6 over 12; the slope begins at x = 10 and hides all beyond x = 6, where the top is at 9.7.
    let wall = map(&mesh, Side::Wall);
    assert!(wall.faces[..2].iter().all(|found| (found - 9.7).abs() < 1e-12), "{:?}", &wall.faces[..2]);
    // The thinnest is the arm at its end, seen from its underside, along whose normal the top is nearest there.
    let (up, fall) = (0.6 / 6.0, 0.6 / 12.0);
    let exact = 0.8 * f64::sqrt(1.0 + up * up) / (1.0 - up * fall);
    let arm = wall.least.unwrap().least;
    assert!(arm.low <= exact + 0.05 && arm.high <= exact, "{arm:?} {exact}");
    // Between slope and underside is a gap that ends in nothing at their common edge, and opens by more than 45 degrees.
    assert_eq!(least(&mesh, Side::Gap), None);
}

/// A needle whose corner is off its plane by less than the mesh may be tells no direction.
#[test]
fn needles_of_no_direction_are_left_out() {
    let corners = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]];
    let at = |z: f64| corners.map(|[x, y]| DVec3::new(x, y, z));
    // A corner of the lid is near an edge, and higher: the needle beside it leans outwards, and its inward normal meets the lid's edge region at once.
    let vertices = [at(0.0).as_slice(), &at(10.0), &[DVec3::new(37.0, 0.01, 10.02), DVec3::new(63.0, 0.012, 10.0)]].concat();
    let sides = [[0, 3, 2], [0, 2, 1], [0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]];
    let lid = [[4, 5, 8], [8, 5, 9], [5, 6, 9], [6, 8, 9], [6, 7, 8], [7, 4, 8]];
    let mesh = TriMesh { vertices, triangles: [sides.as_slice(), &lid].concat() };
    let found = thickness_map(&mesh, Side::Wall, 0.01, &Budget::default()).unwrap();
    assert!((found.least.unwrap().least.low - 10.0).abs() < 1e-3, "{:?}", found.least);
    assert!(found.faces.iter().all(|height| (*height - 10.0).abs() < 1e-3 || *height > 99.0), "{:?}", found.faces);
}

/// The distance along a ray to a triangle (Moeller and Trumbore, 1997).
fn hit(origin: DVec3, direction: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (p, q) = (b - a, c - a);
    let across = direction.cross(q);
    let determinant = p.dot(across);
    if determinant.abs() < 1e-12 {
        return None;
    }
    let from = origin - a;
    let u = from.dot(across) / determinant;
    let turned = from.cross(p);
    let v = direction.dot(turned) / determinant;
    let t = q.dot(turned) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-9).then_some(t)
}

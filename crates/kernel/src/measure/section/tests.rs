#![allow(clippy::unwrap_used)]
use super::*;
use crate::budget::StopReason;
use crate::measure::mass::volume;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

fn cut(mesh: &TriMesh, normal: [f64; 3], offsets_mm: &[f64]) -> Vec<Section> {
    let solid = Solid::new(mesh.clone(), &Budget::default()).unwrap();
    let mut made = Vec::new();
    let frame = PlaneFrame::new(DVec3::from_array(normal)).unwrap();
    sections::<SectionError>(&solid, &frame, offsets_mm, &Budget::default(), &mut |section| {
        made.push(section);
        Ok(())
    })
    .unwrap();
    for (section, offset) in made.iter().zip(offsets_mm) {
        assert_eq!(section.offset_mm.to_bits(), offset.to_bits());
        for polygon in &section.polygons {
            assert!(signed_area_mm2(&polygon.outer) > 0.0 && polygon.holes.iter().all(|hole| signed_area_mm2(hole) < 0.0));
        }
    }
    assert_eq!(made.len(), offsets_mm.len());
    made
}

fn close(value: f64, wanted: f64) {
    assert!((value - wanted).abs() <= 1e-12 * wanted.abs().max(1.0), "{value} against {wanted}");
}

/// (holes of each polygon, area).
fn shape(section: &Section) -> (Vec<usize>, f64) {
    (section.polygons.iter().map(|polygon| polygon.holes.len()).collect(), section.area_mm2())
}

/// The surface of a set of unit cubes: a solid where cubes meet in whole faces or are apart.
fn cubes(filled: impl IntoIterator<Item = [i32; 3]>) -> TriMesh {
    let filled: BTreeSet<[i32; 3]> = filled.into_iter().collect();
    let mut names = BTreeMap::new();
    let mut mesh = TriMesh::default();
    for &cube in &filled {
        for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let mut beyond = cube;
            beyond[axis] += 2 * side - 1;
            if filled.contains(&beyond) {
                continue;
            }
            let mut corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[p, q]| {
                let mut corner = cube;
                corner[axis] += side;
                corner[(axis + 1) % 3] += p;
                corner[(axis + 2) % 3] += q;
                *names.entry(corner).or_insert_with(|| {
                    mesh.vertices.push(DVec3::from_array(corner.map(f64::from)));
                    mesh.vertices.len() as u32 - 1
                })
            });
            if side == 0 {
                corners.reverse();
            }
            let [a, b, c, d] = corners;
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

fn block(low: [i32; 3], high: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    (low[0]..high[0]).flat_map(move |x| (low[1]..high[1]).flat_map(move |y| (low[2]..high[2]).map(move |z| [x, y, z])))
}

/// A torus around z with an n-gon of m-gons, each vertex moved outwards by `bump` of its two numbers.
fn torus(n: u32, m: u32, [large, small]: [f64; 2], bump: impl Fn(u32, u32) -> f64) -> TriMesh {
    let mut mesh = TriMesh::default();
    for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(n)).sin_cos();
        let (up, out) = (TAU * f64::from(j) / f64::from(m)).sin_cos();
        let radius = small + bump(i, j);
        mesh.vertices.push(DVec3::new((large + radius * out) * cos, (large + radius * out) * sin, radius * up));
        let corner = |i: u32, j: u32| i % n * m + j % m;
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// Numbers in [0, 1) that look random.
fn noise(seed: u64) -> f64 {
    let mut bits = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((bits ^ (bits >> 29)) >> 11) as f64 / (1_u64 << 53) as f64
}

fn bumpy() -> TriMesh {
    torus(23, 17, [10.0, 4.0], |i, j| 0.8 * noise(u64::from(100 * i + j)))
}

#[test]
fn frames_are_orthonormal_and_right_handed() {
    let axes = |normal: [f64; 3]| PlaneFrame::new(DVec3::from_array(normal)).map(|frame| [frame.u(), frame.v()]).unwrap();
    assert_eq!(PlaneFrame::new(DVec3::Z * 7.0), Ok(PlaneFrame::HORIZONTAL));
    assert_eq!(axes([0.0, 0.0, -1e-300]), [DVec3::X, DVec3::NEG_Y]);
    assert_eq!(axes([1e300, 0.0, 0.0]), [DVec3::Y, DVec3::Z]);
    assert_eq!(axes([-3.0, 0.0, 0.0]), [DVec3::NEG_Y, DVec3::Z]);
    assert_eq!(axes([0.0, 0.1, 0.0]), [DVec3::NEG_X, DVec3::Z]);
    assert_eq!(axes([0.0, -5e-324, 0.0]), [DVec3::X, DVec3::Z]);
    for seed in 0..1000 {
        let size = 10_f64.powf(480.0 * noise(seed) - 240.0);
        let normal =
            DVec3::new(noise(3 * seed) - 0.5, noise(3 * seed + 1) - 0.5, (noise(3 * seed + 2) - 0.5) * 10_f64.powi(seed as i32 % 40));
        let frame = PlaneFrame::new(normal * size).unwrap();
        assert!((frame.normal() - normal.normalize()).length() < 1e-15);
        assert!((frame.u().cross(frame.v()) - frame.normal()).length() < 1e-15 && frame.v().z >= 0.0);
        assert!(frame.u().dot(frame.normal()).abs() < 1e-15 && (frame.u().length() - 1.0).abs() < 1e-15);
    }
    for wrong in [[0.0; 3], [f64::NAN, 1.0, 0.0], [0.0, f64::INFINITY, 0.0]] {
        assert!(PlaneFrame::new(DVec3::from_array(wrong)).is_err());
    }
}

#[test]
fn a_cube_gives_its_square_from_the_bottom_up_to_below_the_top() {
    let cube = cubes([[0, 0, 0]]);
    for normal in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        let made = cut(&cube, normal, &[-0.1, 0.0, 0.25, 1.0_f64.next_down(), 1.0, 7.0]);
        let areas: Vec<f64> = made.iter().map(Section::area_mm2).collect();
        assert_eq!(areas, [0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
        assert!(made[0].is_empty() && made[4].is_empty() && !made[1].is_empty());
        assert_eq!(made[2].perimeter_mm(), 4.0);
    }
    // Downwards the top is the bottom.
    assert_eq!(cut(&cube, [0.0, 0.0, -1.0], &[-1.0, 0.0]).iter().map(Section::area_mm2).collect::<Vec<_>>(), [1.0, 0.0]);
}

#[test]
fn oblique_planes() {
    let cube = cubes(block([0; 3], [5; 3]));
    let middle = 7.5 / 3.0_f64.sqrt();
    let hexagon = &cut(&cube, [2.0; 3], &[middle])[0];
    close(hexagon.area_mm2(), 25.0 * 0.75 * 3.0_f64.sqrt());
    close(hexagon.perimeter_mm(), 15.0 * 2.0_f64.sqrt());
    let tetrahedron =
        TriMesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] };
    let heights = [0.1, 0.2, 0.5, 0.9];
    for (section, h) in cut(&tetrahedron, [0.0, 0.0, 1.0], &heights).iter().zip(heights) {
        close(section.area_mm2(), 0.5 * (1.0 - h) * (1.0 - h));
    }
    // Across (1, 1, 1) it is an equilateral triangle of side s sqrt(2) at x + y + z = s.
    for (section, s) in cut(&tetrahedron, [1.0; 3], &heights.map(|h| h / 3.0_f64.sqrt())).iter().zip(heights) {
        close(section.area_mm2(), 0.5 * 3.0_f64.sqrt() * s * s);
    }
}

/// The sides of the mesh are plane trapezoids, so its sections along z are regular polygons.
#[test]
fn a_torus_gives_rings() {
    let (n, m) = (48, 24);
    let mesh = torus(n, m, [10.0, 3.0], |_, _| 0.0);
    let heights: Vec<f64> = (-29..=29).map(|step| 0.1 * f64::from(step)).collect();
    for (section, z) in cut(&mesh, [0.0, 0.0, 1.0], &heights).iter().zip(&heights) {
        let corner = |j: u32| (TAU * f64::from(j) / f64::from(m)).sin_cos();
        let j = (0..m / 4).find(|&j| 3.0 * corner(j + 1).0 > z.abs()).unwrap();
        let [(up, out), (next_up, next_out)] = [corner(j), corner(j + 1)];
        let reach = 3.0 * (out + (z.abs() / 3.0 - up) / (next_up - up) * (next_out - out));
        // (10 + reach)^2 - (10 - reach)^2 = 40 reach.
        let area = 0.5 * f64::from(n) * (TAU / f64::from(n)).sin() * 40.0 * reach;
        assert!((section.area_mm2() - area).abs() < 1e-9 && shape(section).0 == [1], "{z}: {} against {area}", section.area_mm2());
    }
    // Across, two pieces; along its tangent plane at the inside, one that touches itself or nearly.
    assert_eq!(shape(&cut(&mesh, [1.0, 0.0, 0.0], &[0.01])[0]).0, [0, 0]);
    assert_eq!(shape(&cut(&mesh, [1.0, 0.0, 0.0], &[9.0])[0]).0, [0]);
}

#[test]
fn planes_through_many_vertices() {
    // A stair of 4, 3, 2, 1 squared cubes, on the lattice: every offset is the height of vertices.
    let stair = cubes((0..4).flat_map(|z| block([0, 0, z], [4 - z, 4 - z, z + 1])));
    let offsets: Vec<f64> = (0..=4).map(f64::from).collect();
    let areas = |normal| cut(&stair, normal, &offsets).iter().map(Section::area_mm2).collect::<Vec<_>>();
    assert_eq!(areas([0.0, 0.0, 1.0]), [16.0, 9.0, 4.0, 1.0, 0.0]);
    assert_eq!(areas([1.0, 0.0, 0.0]), [10.0, 9.0, 7.0, 4.0, 0.0]);
    assert_eq!(areas([0.0, 1.0, 0.0]), [10.0, 9.0, 7.0, 4.0, 0.0]);
    // A groove's bottom, a hollow's floor and a ridge lie in the plane.
    let bottom = cubes(block([0; 3], [5, 5, 3]).filter(|&[x, y, z]| !(z >= 1 && (x == 2 || (y == 2 && x == 4)))));
    assert_eq!(
        cut(&bottom, [0.0, 0.0, 1.0], &[0.0, 1.0, 2.0, 3.0]).iter().map(shape).collect::<Vec<_>>(),
        [(vec![0], 25.0), (vec![0, 0], 19.0), (vec![0, 0], 19.0), (vec![], 0.0)]
    );
}

#[test]
fn holes_belong_to_the_smallest_loop_around_them() {
    // Cubes within cubes, filled and empty by turns: 9, 7, 5, 3 and 1 across.
    let layer = |[x, y, z]: [i32; 3]| x.abs().max(y.abs()).max(z.abs());
    let nested = cubes(block([-4; 3], [5; 3]).filter(|&cube| layer(cube) % 2 == 0));
    let shapes: Vec<_> = cut(&nested, [0.0, 0.0, 1.0], &[-2.5, -2.0, 0.5, 0.0, 4.5]).iter().map(shape).collect();
    let (flat, ring, core) = (81.0, 81.0 - 49.0, 25.0 - 9.0);
    assert_eq!((&shapes[0], &shapes[4]), (&(vec![1], ring), &(vec![0], flat)));
    assert_eq!(shapes[1], (vec![1, 0], ring + 25.0));
    let mut holes = shapes[2].0.clone();
    holes.sort_unstable();
    assert_eq!((holes, shapes[2].1), (vec![0, 1, 1], ring + core + 1.0));
    assert_eq!(shapes[2], shapes[3]);
    for section in cut(&nested, [0.0, 0.0, 1.0], &[0.5]) {
        let mut areas: Vec<f64> = section.polygons.iter().map(Polygon::area_mm2).collect();
        areas.sort_unstable_by(f64::total_cmp);
        assert_eq!(areas, [1.0, core, ring]);
    }
    // A sieve, and beside it another.
    let sieve = |x: i32| block([x, 0, 0], [x + 81, 81, 1]).filter(move |&[u, v, _]| (u - x) % 2 == 0 || v % 2 == 0);
    let (count, area) = (40 * 40, 2.0 * (81.0 * 81.0 - 1600.0));
    assert_eq!(shape(&cut(&cubes(sieve(0).chain(sieve(100))), [0.0, 0.0, 1.0], &[0.5])[0]), (vec![count, count], area));
}

/// Areas are quadratic between heights of vertices, where two points of Gauss integrate cubic polynomials exactly.
#[test]
fn areas_sum_to_the_volume() {
    let mesh = bumpy();
    for normal in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.3, -0.5, 0.7], [-1.0, 1e-9, 0.0]] {
        let frame = PlaneFrame::new(DVec3::from_array(normal)).unwrap();
        let mut heights: Vec<f64> = mesh.vertices.iter().map(|&vertex| frame.offset(vertex)).collect();
        heights.sort_unstable_by(f64::total_cmp);
        let node = 0.5 - 0.5 / 3.0_f64.sqrt();
        let nodes: Vec<f64> =
            heights.windows(2).flat_map(|pair| [pair[0] + node * (pair[1] - pair[0]), pair[1] - node * (pair[1] - pair[0])]).collect();
        let areas = cut(&mesh, normal, &nodes);
        assert!(areas.iter().all(|section| section.unmatched.is_empty()));
        let sum: f64 =
            areas.chunks(2).zip(heights.windows(2)).map(|(two, h)| 0.5 * (h[1] - h[0]) * (two[0].area_mm2() + two[1].area_mm2())).sum();
        assert!((sum / volume(&mesh) - 1.0).abs() < 1e-11, "{normal:?}: {sum} against {}", volume(&mesh));
    }
}

#[test]
fn sections_follow_the_offsets_and_turn_with_the_mesh() {
    let mesh = bumpy();
    let sorted: Vec<f64> = (0..300).map(|step| -5.0 + f64::from(step) / 30.0).collect();
    let made = cut(&mesh, [0.0, 0.0, 1.0], &sorted);
    // In any order, with repetitions, in any number of threads, next to other planes or alone.
    let order: Vec<usize> = (0..700).map(|seed| (300.0 * noise(seed)) as usize).collect();
    let offsets: Vec<f64> = order.iter().map(|&index| sorted[index]).collect();
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = alone.install(|| cut(&mesh, [0.0, 0.0, 1.0], &offsets));
    assert!(order.iter().zip(&again).all(|(&index, section)| made[index] == *section));
    assert_eq!(cut(&mesh, [0.0, 0.0, 1.0], &sorted[77..78])[0], made[77]);
    let turned = TriMesh { vertices: mesh.vertices.iter().map(|v| DVec3::new(v.z, v.x, v.y)).collect(), triangles: mesh.triangles.clone() };
    assert_eq!(cut(&turned, [1.0, 0.0, 0.0], &sorted), made);
    let moved = TriMesh { vertices: mesh.vertices.iter().map(|v| DVec3::new(v.x, -v.z, v.y)).collect(), triangles: mesh.triangles };
    for (a, b) in cut(&moved, [0.0, -1.0, 0.0], &sorted).iter().zip(&made) {
        close(a.area_mm2(), b.area_mm2());
        assert_eq!(shape(a).0, shape(b).0);
    }
}

#[test]
fn a_cavity_outside_the_material_is_unmatched() {
    let mut mesh = cubes(block([0; 3], [2; 3]));
    let inward = cubes([[5, 0, 0]]);
    let before = mesh.vertices.len() as u32;
    mesh.vertices.extend(inward.vertices);
    mesh.triangles.extend(inward.triangles.iter().map(|&[a, b, c]| [before + a, before + c, before + b]));
    let section = &cut(&mesh, [0.0, 0.0, 1.0], &[0.5])[0];
    assert_eq!((shape(section), section.unmatched.len()), ((vec![0], 3.0), 1));
}

#[test]
fn what_cannot_be_cut_is_refused() {
    let solid = Solid::new(cubes([[0, 0, 0]]), &Budget::default()).unwrap();
    let run = |solid: &Solid, offsets: &[f64], budget: &Budget, wanted: usize| {
        let mut count = 0;
        sections(solid, &PlaneFrame::HORIZONTAL, offsets, budget, &mut |_| {
            count += 1;
            if count > wanted { Err(SectionError::Planes(count)) } else { Ok(()) }
        })
    };
    let budget = Budget::default();
    assert_eq!(run(&solid, &[], &budget, 0), Ok(()));
    assert_eq!(run(&solid, &[0.5; 5], &budget, 3), Err(SectionError::Planes(4)));
    assert_eq!(run(&solid, &[-f64::MAX, f64::MAX], &budget, 2), Ok(()));
    assert!(matches!(run(&solid, &[0.5, f64::NAN], &budget, 9), Err(SectionError::Offset { index: 1, .. })));
    for wrong in [f64::NAN, f64::INFINITY, 1e80] {
        let mut mesh = solid.mesh().clone();
        mesh.vertices[7].z = wrong;
        if let Ok(strange) = Solid::new(mesh, &budget) {
            assert!(matches!(run(&strange, &[0.5], &budget, 9), Err(SectionError::Vertex { vertex: 7, .. })), "{wrong}");
        }
    }
    budget.cancel.fire(StopReason::Deadline);
    assert_eq!(run(&solid, &[0.5], &budget, 9).map_err(|error| error.code()), Err("limit-time"));
}

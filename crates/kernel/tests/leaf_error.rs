//! Errors of what stands for leaf cells, needles and smooth cells, against much finer evaluations, and their cost.

use crate::oracle::{Oracle, Random, distance};
use glam::{DMat3, DVec3, DVec4};
use lacuna_kernel::attractor::{Attractor, count_cells, refine};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::dilation::dilate;
use lacuna_kernel::model::{
    AffineMap, Bcifs, BcifsState, BoundarySpec, CellKind, CornerCutting, Entry, Ifs, Matrix, Model, RootCell, Shape, TransitionSpec,
};
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::{Radius, Tolerance};

fn attractor(shape: Shape) -> Attractor {
    Model { name: None, shape }.lower().unwrap().attractor
}

fn system(maps: Vec<AffineMap>) -> Attractor {
    attractor(Shape::Ifs(Ifs { maps, primitive: None, graph: None }))
}

fn simplices(drawn: &Tessellation) -> Vec<Vec<DVec3>> {
    let at = |k: u32| drawn.vertices[k as usize];
    let points = drawn.points.iter().map(|&a| vec![at(a)]);
    let segments = drawn.segments.iter().map(|ends| ends.map(at).to_vec());
    points.chain(segments).chain(drawn.triangles.iter().map(|corners| corners.map(at).to_vec())).collect()
}

/// The Hausdorff distance of an evaluation from one that is `finer` times finer is at most the sum of their deviations.
fn attack(name: &str, shape: &Attractor, tolerance: f64, finer: f64, random: &mut Random) {
    let evaluate = |mm: f64| refine(shape, Tolerance::new(mm).unwrap(), &Budget::default()).unwrap();
    let (coarse, fine) = (evaluate(tolerance), evaluate(tolerance / finer));
    let allowed = coarse.deviation_mm + fine.deviation_mm;
    assert!(coarse.deviation_mm <= tolerance + 1e-9, "{name}");
    let (drawn, exact) = (simplices(&coarse), simplices(&fine));
    for (from, to, what) in [(&drawn, &exact, "drawn"), (&exact, &drawn, "exact")] {
        let to = Oracle { simplices: to.clone(), uncovered: 0.0, astray: 0.0 };
        for sample in 0..400 {
            let simplex = &from[(random.unit() * from.len() as f64) as usize];
            // Corners and points between them.
            let mut shares: Vec<f64> = simplex.iter().map(|_| random.unit()).collect();
            if sample % 2 == 0 {
                shares = (0..simplex.len()).map(|k| f64::from(u8::from(k == sample / 2 % simplex.len()))).collect();
            }
            let total: f64 = shares.iter().sum();
            let x = simplex.iter().zip(&shares).map(|(corner, share)| *corner * (share / total)).sum::<DVec3>();
            let d = to.distance(x);
            assert!(d <= allowed * (1.0 + 1e-9) + 1e-9, "{name}: {what} {x} is {d} off, {allowed} allowed");
        }
    }
}

/// Graphs over the square of side `size`, s the ratio of heights: f = s f(4 children) + slopes.
fn takagi(size: f64, ratio: f64, slopes: [f64; 2]) -> Attractor {
    let map = |k: usize| {
        let (i, j) = (k % 2, k / 2);
        let slope = |side: usize, slope: f64| if side == 0 { slope } else { -slope };
        let linear = DMat3::from_cols(
            DVec3::new(0.5, 0.0, slope(i, slopes[0])),
            DVec3::new(0.0, 0.5, slope(j, slopes[1])),
            DVec3::new(0.0, 0.0, ratio),
        );
        let (x, y) = (i as f64, j as f64);
        AffineMap { linear, translation: size * DVec3::new(0.5 * x, 0.5 * y, slopes[0] * x + slopes[1] * y) }
    };
    system((0..4).map(map).collect())
}

/// Koch's curve times a segment, cut into thirds along the curve and halves across.
fn koch(size: f64) -> Attractor {
    let third = size / 3.0;
    let turn = std::f64::consts::FRAC_PI_3;
    let top = DVec3::new(1.5 * third, third * turn.sin(), 0.0);
    let pieces = [(0.0, DVec3::ZERO), (turn, DVec3::X * third), (-turn, top), (0.0, DVec3::X * 2.0 * third)];
    let map = |k: usize| {
        let (angle, at) = pieces[k / 2];
        let linear = DMat3::from_rotation_z(angle) * DMat3::from_diagonal(DVec3::new(1.0 / 3.0, 1.0 / 3.0, 0.5));
        AffineMap { linear, translation: at + DVec3::Z * (0.5 * size * (k % 2) as f64) }
    };
    system((0..8).map(map).collect())
}

/// Fractal interpolation (Barnsley, Constr. Approx. 2, 1986): the curve through points with increasing x whose pieces
/// are its images, with any contraction of y and z.
fn interpolation(random: &mut Random) -> Attractor {
    let count = 2 + (random.unit() * 3.0) as usize;
    let points: Vec<DVec3> =
        (0..=count).map(|k| DVec3::new(30.0 * k as f64 / count as f64, random.between(-5.0, 5.0), random.between(-5.0, 5.0))).collect();
    let whole = points[count] - points[0];
    let map = |pair: &[DVec3]| {
        let turn = DMat3::from_rotation_x(random.between(0.0, 6.0));
        let sizes = [random.between(0.3, 0.75), random.between(0.05, 0.75)];
        let block = turn * DMat3::from_diagonal(DVec3::new(0.0, sizes[0], sizes[1]));
        // The column of x takes the ends to the ends.
        let column = (pair[1] - pair[0] - block * whole) / whole.x;
        let linear = DMat3::from_cols(column, block.y_axis, block.z_axis);
        AffineMap { linear, translation: pair[0] - linear * points[0] }
    };
    system(points.windows(2).map(map).collect())
}

#[test]
fn needles_keep_their_bounds() {
    let mut random = Random(7);
    for round in 0..8 {
        attack(&format!("interpolation {round}"), &interpolation(&mut random), 0.8, 6.0, &mut random);
    }
    for round in 0..6 {
        let slopes = [random.between(-0.8, 0.8), random.between(-0.8, 0.8)];
        let ratio = random.between(0.3, 0.65);
        let shape = takagi(20.0, ratio, slopes);
        attack(&format!("takagi {round}: {ratio} {slopes:?}"), &shape, 1.5, 3.0, &mut random);
    }
    attack("koch", &koch(20.0), 1.0, 3.0, &mut random);
}

/// The cells of a surface over a square of 100 mm are those of a grid: four times as many at half the tolerance,
/// where balls need (1/0.6)^2 of them along each needle too; Koch's cells go with 8^(log 2 / log 3).
#[test]
fn needles_are_counted_across() {
    let cells = |shape: &Attractor, mm: f64| count_cells(shape, Tolerance::new(mm).unwrap(), &Budget::default()).unwrap() as f64;
    let (half, steep, surface) = (takagi(100.0, 0.5, [0.5; 2]), takagi(100.0, 0.6, [0.5; 2]), koch(100.0));
    // Cells of half diagonal 0.8 mm are 1.13 mm wide: 88^2 of them, and at most one level more.
    assert!(cells(&half, 0.8) <= 16_384.0);
    assert!(cells(&half, 0.2) <= 16.0 * 16_384.0);
    assert!(cells(&steep, 0.8) <= 65_536.0 && cells(&steep, 0.4) <= 262_144.0);
    assert!(cells(&surface, 0.8) <= 4096.0 && cells(&surface, 0.8 / 3.0) <= 32_768.0);
}

/// Neither bounded along nor across are points that are not connected: they must stay points.
#[test]
fn dust_is_no_needle() {
    let map = |x: f64, z: f64| AffineMap { linear: DMat3::from_diagonal(DVec3::new(0.3, 0.3, 0.45)), translation: DVec3::new(x, 0.0, z) };
    let shape = system(vec![map(0.0, 0.0), map(7.0, 0.0), map(0.0, 11.0), map(7.0, 11.0)]);
    let drawn = refine(&shape, Tolerance::new(0.5).unwrap(), &Budget::default()).unwrap();
    assert!(drawn.segments.is_empty() && !drawn.points.is_empty());
    attack("dust", &shape, 0.5, 3.0, &mut Random(3));
}

#[test]
fn dilated_needles_are_one_piece() {
    let shape = takagi(20.0, 0.5, [0.5; 2]);
    let result = dilate(&shape, Radius::new(3.0).unwrap(), Tolerance::new(0.6).unwrap(), &Budget::default()).unwrap();
    assert_eq!(result.solid.topology().components, 1);
    assert!(result.leaf_cells < 200_000, "{}", result.leaf_cells);
}

type Columns = Vec<Vec<f64>>;

/// Operators of the two halves, columns of children's control points, and the points at the two ends.
fn curve_scheme(kind: usize) -> ([Columns; 2], [Vec<f64>; 2]) {
    let half = |n: usize| -> Columns {
        let choose = |n: usize, k: usize| (0..k).fold(1.0, |value, i| value * (n - i) as f64 / (i + 1) as f64);
        (0..n).map(|j| (0..n).map(|k| if k <= j { choose(j, k) * 0.5_f64.powi(j as i32) } else { 0.0 }).collect()).collect()
    };
    let mirrored = |columns: &Columns| -> Columns { columns.iter().rev().map(|column| column.iter().rev().copied().collect()).collect() };
    let unit = |n: usize, k: usize| (0..n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<f64>>();
    match kind {
        0 | 1 => {
            let left = half(kind + 3);
            ([left.clone(), mirrored(&left)], [unit(kind + 3, 0), unit(kind + 3, kind + 2)])
        }
        2 => {
            let left = vec![vec![0.75, 0.25, 0.0], vec![0.25, 0.75, 0.0], vec![0.0, 0.75, 0.25]];
            ([left.clone(), mirrored(&left)], [vec![0.5, 0.5, 0.0], vec![0.0, 0.5, 0.5]])
        }
        3 => {
            let e = 0.125;
            let left = vec![vec![0.5, 0.5, 0.0, 0.0], vec![e, 0.75, e, 0.0], vec![0.0, 0.5, 0.5, 0.0], vec![0.0, e, 0.75, e]];
            let s = 1.0 / 6.0;
            ([left.clone(), mirrored(&left)], [vec![s, 4.0 * s, s, 0.0], vec![0.0, s, 4.0 * s, s]])
        }
        _ => {
            // Catmull-Rom: Bezier points B = Q C, so Q T = (Q C) H C^-1 with Q_1 = 6 (B_1 - B_0)... solved for by hand:
            // Q_0 = B_3 - 6 (B_1 - B_0), Q_1 = B_0, Q_2 = B_3, Q_3 = B_0 + 6 (B_3 - B_2).
            let s = 1.0 / 6.0;
            let to: Columns = vec![unit(4, 1), vec![-s, 1.0, s, 0.0], vec![0.0, s, 1.0, -s], unit(4, 2)];
            let times = |a: &Columns, b: &Columns| -> Columns {
                b.iter().map(|column| (0..4).map(|i| (0..4).map(|k| a[k][i] * column[k]).sum()).collect()).collect()
            };
            let back: Columns = vec![vec![6.0, -6.0, 0.0, 1.0], unit(4, 0), unit(4, 3), vec![1.0, 0.0, -6.0, 6.0]];
            let left = times(&times(&to, &half(4)), &back);
            ([left.clone(), mirrored(&left)], [unit(4, 1), unit(4, 2)])
        }
    }
}

fn matrix(columns: &Columns) -> Matrix {
    let rows = (0..columns[0].len()).map(|i| columns.iter().map(|column| Entry::Number(column[i])).collect()).collect();
    Matrix { rows }
}

/// Point i + n j of the tensor product.
fn tensor(u: &[f64], v: &[f64]) -> Vec<f64> {
    v.iter().flat_map(|b| u.iter().map(move |a| a * b)).collect()
}

/// A face with control points given, the tensor product of a scheme with another.
fn face(kinds: [usize; 2], points: &dyn Fn(usize, usize) -> DVec3) -> Attractor {
    let schemes = kinds.map(curve_scheme);
    let sizes = [schemes[0].1[0].len(), schemes[1].1[0].len()];
    let transition = |to: &str, columns: &Columns| TransitionSpec { to: to.into(), operator: matrix(columns) };
    let boundary = |state: &str, columns: &Columns| BoundarySpec { state: state.into(), incidence: matrix(columns) };
    let all = |u: &Columns, v: &Columns| -> Columns { v.iter().flat_map(|b| u.iter().map(move |a| tensor(a, b))).collect() };
    let mut faces = Vec::new();
    let identity = |n: usize| -> Columns { (0..n).map(|k| (0..n).map(|i| f64::from(u8::from(i == k))).collect()).collect() };
    for v in &schemes[1].0 {
        faces.extend(schemes[0].0.iter().map(|u| transition("face", &all(u, v))));
    }
    let along = |end: usize| boundary("u", &all(&identity(sizes[0]), &vec![schemes[1].1[end].clone()]));
    let across = |end: usize| boundary("v", &all(&vec![schemes[0].1[end].clone()], &identity(sizes[1])));
    let mut states = vec![BcifsState {
        name: "face".into(),
        cell: CellKind::Face,
        dimension: sizes[0] * sizes[1],
        transitions: faces,
        boundaries: vec![along(0), across(1), along(1), across(0)],
    }];
    for (name, (halves, ends)) in ["u", "v"].into_iter().zip(&schemes) {
        states.push(BcifsState {
            name: name.into(),
            cell: CellKind::Edge,
            dimension: ends[0].len(),
            transitions: halves.iter().map(|columns| transition(name, columns)).collect(),
            boundaries: ends.iter().map(|end| boundary("vertex", &vec![end.clone()])).collect(),
        });
    }
    states.push(BcifsState {
        name: "vertex".into(),
        cell: CellKind::Vertex,
        dimension: 1,
        transitions: vec![transition("vertex", &vec![vec![1.0]])],
        boundaries: Vec::new(),
    });
    let control_points =
        (0..sizes[1]).flat_map(|j| (0..sizes[0]).map(move |i| (i, j))).map(|(i, j)| points(i, j).extend(1.0)).collect::<Vec<DVec4>>();
    let cells = vec![RootCell { state: "face".into(), control_points: control_points.into_iter().map(Some).collect() }];
    attractor(Shape::Bcifs(Bcifs { states, cells, ..Bcifs::default() }))
}

#[test]
fn smooth_cells_keep_their_bounds() {
    let mut random = Random(17);
    for kinds in [[0, 0], [1, 0], [2, 2], [3, 2], [3, 3], [4, 4], [4, 1]] {
        let points: Vec<DVec3> = (0..25).map(|_| random.point(6.0)).collect();
        let shape = face(kinds, &|i, j| points[i + 5 * j]);
        let precision = shape.precision(shape.roots()[0].state).unwrap_or_else(|| panic!("{kinds:?} has linear precision"));
        assert!(precision.domain.len() == 4 && precision.residual < 1e-4);
        attack(&format!("face {kinds:?}"), &shape, 0.5, 6.0, &mut random);
    }
    for round in 0..6 {
        let (a, b) = if round < 3 { (0.25, 0.25) } else { (random.between(0.1, 0.3), random.between(0.1, 0.3)) };
        let control_points = (0..4).map(|_| random.point(10.0)).collect();
        let shape = attractor(Shape::CornerCutting(CornerCutting { control_points, a, b, closed: false }));
        attack(&format!("corner cutting {a} {b}"), &shape, 0.1, 20.0, &mut random);
    }
}

/// Ten times the tolerance, root of ten fewer cells of a curve and a tenth of a face: one level more at most.
#[test]
fn smooth_cells_are_of_second_order() {
    let control_points = vec![DVec3::ZERO, DVec3::new(30.0, 60.0, 0.0), DVec3::new(80.0, -20.0, 10.0), DVec3::new(100.0, 0.0, 30.0)];
    let curve = attractor(Shape::CornerCutting(CornerCutting { control_points, a: 0.25, b: 0.25, closed: false }));
    let bump = |i: usize, j: usize| DVec3::new(30.0 * i as f64, 30.0 * j as f64, [0.0, 20.0, -10.0, 5.0][(i + 2 * j) % 4]);
    let (spline, bezier) = (face([3, 3], &bump), face([1, 1], &bump));
    for (shape, growth) in [(&curve, 10.0), (&spline, 100.0), (&bezier, 100.0)] {
        let cells = |mm: f64| count_cells(shape, Tolerance::new(mm).unwrap(), &Budget::default()).unwrap() as f64;
        let counts = [1e-1, 1e-3].map(cells);
        println!("{:?}", [1e-1, 1e-2, 1e-3, 1e-4].map(cells));
        assert!(counts[1] <= 1.7 * growth * counts[0], "{counts:?}");
    }
}

/// The distance of a point from a segment, so that the tests above rest on something.
#[test]
fn the_oracle_measures() {
    let segment = [DVec3::ZERO, DVec3::X];
    assert!((distance(DVec3::new(0.5, 2.0, 0.0), &segment) - 2.0).abs() < 1e-15);
}

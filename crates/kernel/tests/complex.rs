//! Evaluations of shapes with a B-rep: conforming, counted, addressed. Expected counts come from combinatorics:
//! Euler numbers of discs, tori and Sierpinski triangles.

use crate::agreement::agreed;
use glam::{DVec3, DVec4};
use lacuna_kernel::attractor::{Attractor, refine};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::model::{
    Adjacency, Bcifs, BcifsState, BoundarySpec, CellKind, CornerCutting, Entry, Glue, Matrix, Model, RootCell, Shape, TransitionSpec,
};
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::Tolerance;

type Rows = Vec<Vec<f64>>;

fn matrix(rows: &Rows) -> Matrix {
    Matrix { rows: rows.iter().map(|row| row.iter().map(|&x| Entry::Number(x)).collect()).collect() }
}

/// The Kronecker product: row (i, k) is i * rows(b) + k.
fn kronecker(a: &Rows, b: &Rows) -> Rows {
    a.iter().flat_map(|p| b.iter().map(move |q| p.iter().flat_map(|x| q.iter().map(move |y| x * y)).collect())).collect()
}

fn identity(n: usize) -> Rows {
    (0..n).map(|i| (0..n).map(|j| f64::from(i == j)).collect()).collect()
}

/// The last or first `p` columns of the identity.
fn end(n: usize, p: usize, last: bool) -> Rows {
    (0..n).map(|i| (0..p).map(|j| f64::from(i == if last { n - p + j } else { j })).collect()).collect()
}

fn state(name: &str, cell: CellKind, dimension: usize, transitions: &[(&str, Rows)], boundaries: &[(&str, Rows)]) -> BcifsState {
    BcifsState {
        name: name.into(),
        cell,
        dimension,
        transitions: transitions.iter().map(|(to, rows)| TransitionSpec { to: (*to).into(), operator: matrix(rows) }).collect(),
        boundaries: boundaries.iter().map(|(to, rows)| BoundarySpec { state: (*to).into(), incidence: matrix(rows) }).collect(),
    }
}

/// The uniform quadratic B-spline: T_0, T_1, and the vertex operator of its two ends.
fn quadratic() -> (Rows, Rows, Rows) {
    let t0 = vec![vec![0.75, 0.25, 0.0], vec![0.25, 0.75, 0.75], vec![0.0, 0.0, 0.25]];
    let t1 = vec![vec![0.25, 0.0, 0.0], vec![0.75, 0.75, 0.25], vec![0.0, 0.25, 0.75]];
    (t0, t1, vec![vec![0.75, 0.25], vec![0.25, 0.75]])
}

/// The biquadratic B-spline face: 9 points (i, k) -> 3 i + k, with i along u; edges of 6, vertices of 4. With
/// `cyclic`, the edges run round the face and neighbours see them turned by half a turn.
fn biquadratic(cyclic: bool, patches: Vec<Vec<DVec3>>) -> Bcifs {
    let (t0, t1, ts) = quadratic();
    let (first, last) = (end(3, 2, false), end(3, 2, true));
    // Edge points: (along, across) -> 2 along + across.
    let along_u = |across: &Rows| kronecker(&identity(3), across);
    let along_v = |across: &Rows| {
        // (across, along) reordered to (along, across).
        let rows = kronecker(across, &identity(3));
        rows.iter().map(|row| (0..3).flat_map(|k| [row[k], row[3 + k]]).collect::<Vec<f64>>()).collect::<Rows>()
    };
    let sides = [along_u(&first), along_v(&last), along_u(&last), along_v(&first)];
    let sides: Vec<(&str, Rows)> = if cyclic {
        // Turning the square by a quarter: (i, k) -> (2 - k, i).
        let turn = |rows: &Rows| -> Rows { (0..9).map(|row| rows[3 * (row % 3) + 2 - row / 3].clone()).collect() };
        std::iter::successors(Some(sides[0].clone()), |side| Some(turn(side))).take(4).map(|side| ("edge", side)).collect()
    } else {
        sides.into_iter().map(|side| ("edge", side)).collect()
    };
    let face: Vec<(&str, Rows)> =
        [(&t0, &t0), (&t1, &t0), (&t0, &t1), (&t1, &t1)].into_iter().map(|(u, v)| ("face", kronecker(u, v))).collect();
    let ends = [("vertex", kronecker(&first, &identity(2))), ("vertex", kronecker(&last, &identity(2)))];
    let states = vec![
        state("face", CellKind::Face, 9, &face, &sides),
        state("edge", CellKind::Edge, 6, &[("edge", kronecker(&t0, &ts)), ("edge", kronecker(&t1, &ts))], &ends),
        state("vertex", CellKind::Vertex, 4, &[("vertex", kronecker(&ts, &ts))], &[]),
    ];
    let adjacency = |a, b| Adjacency { state: "face".into(), between: [a, b], reversed: cyclic, permutation: None };
    let adjacencies = vec![adjacency((0, 1), (1, 3)), adjacency((2, 1), (3, 3)), adjacency((0, 2), (2, 0)), adjacency((1, 2), (3, 0))];
    let cells = patches
        .into_iter()
        .map(|points| RootCell { state: "face".into(), control_points: points.into_iter().map(|p| Some(p.extend(1.0))).collect() })
        .collect();
    Bcifs { states, adjacencies, cells, ..Bcifs::default() }
}

fn attractor(bcifs: Bcifs) -> Attractor {
    let lowered = Model { name: None, shape: Shape::Bcifs(bcifs) }.lower();
    lowered.unwrap_or_else(|findings| panic!("{findings:?}")).attractor
}

fn evaluated(attractor: &Attractor, tolerance: f64) -> Tessellation {
    refine(attractor, Tolerance::new(tolerance).expect("positive"), &Budget::default()).expect("refines")
}

fn patch(height: impl Fn(f64, f64) -> f64) -> Vec<DVec3> {
    (0..9).map(|k| (f64::from(k / 3), f64::from(k % 3))).map(|(u, v)| DVec3::new(10.0 * u, 10.0 * v, height(u, v))).collect()
}

#[test]
fn an_adaptive_patch_is_a_disc_without_cracks() {
    for cyclic in [false, true] {
        // A bump at one corner: cells of many sizes.
        let patch = patch(|u, v| if u + v > 3.5 { 40.0 } else { 0.0 });
        let attractor = attractor(biquadratic(cyclic, vec![patch]));
        for tolerance in [3.0, 0.7, 0.2] {
            let tessellation = evaluated(&attractor, tolerance);
            assert_eq!(agreed(&tessellation), (1, 1, 1), "cyclic {cyclic}, tolerance {tolerance}");
        }
    }
}

/// Nine patches on a torus of 3 x 3 faces, each with the 3 x 3 control points around its face.
fn torus(cyclic: bool, glued: bool) -> Bcifs {
    let point = |i: usize, k: usize| {
        let (a, b) = ((i % 3) as f64 * std::f64::consts::TAU / 3.0, (k % 3) as f64 * std::f64::consts::TAU / 3.0);
        DVec3::new((30.0 + 10.0 * b.cos()) * a.cos(), (30.0 + 10.0 * b.cos()) * a.sin(), 10.0 * b.sin())
    };
    let patches = (0..9).map(|f| (0..9).map(|k| point(f / 3 + k / 3, f % 3 + k % 3)).collect()).collect();
    let mut bcifs = biquadratic(cyclic, patches);
    if glued {
        for f in 0..9 {
            let (next_u, next_v) = ((f + 3) % 9, f / 3 * 3 + (f % 3 + 1) % 3);
            bcifs.glue.push(Glue { between: [(f, 1), (next_u, 3)], reversed: cyclic, permutation: None });
            bcifs.glue.push(Glue { between: [(f, 2), (next_v, 0)], reversed: cyclic, permutation: None });
        }
    }
    bcifs
}

#[test]
fn glued_patches_close_to_a_torus() {
    for cyclic in [false, true] {
        let tessellation = evaluated(&attractor(torus(cyclic, true)), 0.5);
        assert_eq!(agreed(&tessellation), (0, 0, 1), "cyclic {cyclic}");
        let apart = evaluated(&attractor(torus(cyclic, false)), 0.5);
        assert_eq!(agreed(&apart), (9, 9, 9));
    }
}

#[test]
fn every_vertex_and_triangle_has_the_address_of_its_place() {
    let attractor = attractor(torus(true, true));
    let tessellation = evaluated(&attractor, 2.0);
    let complex = tessellation.complex.as_ref().expect("a B-rep");
    let mut seen = std::collections::BTreeSet::new();
    for vertex in 0..tessellation.vertices.len() {
        let address = complex.vertex_address(vertex).expect("an address");
        assert!(seen.insert(address.clone()), "{address} twice");
    }
    for triangle in 0..tessellation.triangles.len() {
        let address = complex.triangle_address(triangle).expect("an address");
        assert!(address.root < 9 && !address.steps.is_empty());
    }
}

#[test]
fn a_sierpinski_triangle_keeps_its_holes() {
    // Barycentric: child i is the parent shrunk to corner i.
    let child = |corner: usize| -> Rows {
        (0..3).map(|row| (0..3).map(|column| 0.5 * f64::from(row == column) + 0.5 * f64::from(row == corner)).collect()).collect()
    };
    let side = |a: usize, b: usize| -> Rows { (0..3).map(|row| vec![f64::from(row == a), f64::from(row == b)]).collect() };
    let faces: Vec<(&str, Rows)> = (0..3).map(|corner| ("face", child(corner))).collect();
    let states = vec![
        state("face", CellKind::Face, 3, &faces, &[("edge", side(0, 1)), ("edge", side(1, 2)), ("edge", side(2, 0))]),
        state(
            "edge",
            CellKind::Edge,
            2,
            &[("edge", vec![vec![1.0, 0.5], vec![0.0, 0.5]]), ("edge", vec![vec![0.5, 0.0], vec![0.5, 1.0]])],
            &[("vertex", vec![vec![1.0], vec![0.0]]), ("vertex", vec![vec![0.0], vec![1.0]])],
        ),
        state("vertex", CellKind::Vertex, 1, &[("vertex", vec![vec![1.0]])], &[]),
    ];
    let points = [DVec3::ZERO, DVec3::new(64.0, 0.0, 0.0), DVec3::new(32.0, 55.4, 0.0)];
    let cells = vec![RootCell { state: "face".into(), control_points: points.map(|p| Some(p.extend(1.0))).to_vec() }];
    let attractor = attractor(Bcifs { states, cells, ..Bcifs::default() });
    let tessellation = evaluated(&attractor, 20.0);
    let complex = tessellation.complex.as_ref().expect("a B-rep");
    let level = complex.faces.ilog(3);
    assert_eq!(complex.faces, 3_u64.pow(level));
    assert_eq!(complex.vertices, (3_u64.pow(level + 1) + 3) / 2);
    assert_eq!(complex.edges, 3_u64.pow(level + 1));
    assert_eq!(complex.components, 1);
}

#[test]
fn a_closed_curve_is_one_loop_whose_spans_share_their_ends() {
    let control_points = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]].map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec();
    for closed in [true, false] {
        let curve = CornerCutting { control_points: control_points.clone(), a: 0.25, b: 0.25, closed };
        let model = Model { name: None, shape: Shape::CornerCutting(curve) };
        let tessellation = evaluated(&model.lower().expect("legal").attractor, 0.01);
        let complex = tessellation.complex.as_ref().expect("a B-rep");
        assert_eq!(complex.components, 1);
        assert_eq!(complex.euler, i64::from(!closed));
        assert_eq!(tessellation.vertices.len() as u64, complex.vertices);
    }
}

#[test]
fn a_wire_that_branches_shares_its_fork() {
    // A cross: four arms from the middle of four ends, which halve towards the ends.
    let ends: Vec<(&str, Rows)> = (0..4).map(|k| ("vertex", (0..4).map(|row| vec![f64::from(row == k)]).collect())).collect();
    let arms: Vec<(&str, Rows)> = (0..4).map(|k| ("arm", (0..4).map(|row| vec![0.25, f64::from(row == k)]).collect())).collect();
    let states = vec![
        state("cross", CellKind::Edge, 4, &arms, &ends),
        state(
            "arm",
            CellKind::Edge,
            2,
            &[("arm", vec![vec![1.0, 0.5], vec![0.0, 0.5]]), ("arm", vec![vec![0.5, 0.0], vec![0.5, 1.0]])],
            &[("vertex", vec![vec![1.0], vec![0.0]]), ("vertex", vec![vec![0.0], vec![1.0]])],
        ),
        state("vertex", CellKind::Vertex, 1, &[("vertex", vec![vec![1.0]])], &[]),
    ];
    let points = [[-10.0, 0.0], [10.0, 0.0], [0.0, 10.0], [0.0, -10.0]].map(|[x, y]| DVec4::new(x, y, 0.0, 1.0));
    let cells = vec![RootCell { state: "cross".into(), control_points: points.map(Some).to_vec() }];
    let tessellation = evaluated(&attractor(Bcifs { states, cells, ..Bcifs::default() }), 0.1);
    let complex = tessellation.complex.as_ref().expect("a B-rep");
    assert_eq!((complex.components, complex.euler), (1, 1));
    let degree = |vertex: usize| tessellation.segments.iter().flatten().filter(|&&end| end as usize == vertex).count();
    assert_eq!((0..tessellation.vertices.len()).filter(|&vertex| degree(vertex) == 4).count(), 1);
    assert_eq!((0..tessellation.vertices.len()).filter(|&vertex| degree(vertex) == 1).count(), 4);
}

#[test]
fn a_boundary_seen_backwards_must_be_alike_backwards() {
    // Corner cutting with a != b is not symmetric: two such faces cannot share an edge turned round.
    let mut bcifs = biquadratic(false, vec![patch(|_, _| 0.0)]);
    let (a, b) = (0.3, 0.2);
    let t0 = vec![vec![1.0 - a, b, 0.0], vec![a, 1.0 - b, 1.0 - a], vec![0.0, 0.0, a]];
    let t1 = vec![vec![b, 0.0, 0.0], vec![1.0 - b, 1.0 - a, b], vec![0.0, a, 1.0 - b]];
    let ts = vec![vec![1.0 - a, b], vec![a, 1.0 - b]];
    let face: Vec<(&str, Rows)> =
        [(&t0, &t0), (&t1, &t0), (&t0, &t1), (&t1, &t1)].into_iter().map(|(u, v)| ("face", kronecker(u, v))).collect();
    for (transition, (_, rows)) in bcifs.states[0].transitions.iter_mut().zip(&face) {
        transition.operator = matrix(rows);
    }
    for (transition, rows) in bcifs.states[1].transitions.iter_mut().zip([kronecker(&t0, &ts), kronecker(&t1, &ts)]) {
        transition.operator = matrix(&rows);
    }
    bcifs.states[2].transitions[0].operator = matrix(&kronecker(&ts, &ts));
    let tessellation = evaluated(&attractor(bcifs.clone()), 1.0);
    assert_eq!(agreed(&tessellation), (1, 1, 1));
    // Glue the patch's side 0 to a copy's side 0, turned round.
    let mut copy = bcifs.cells[0].clone();
    // Half a turn about the middle of the edge's points, so that they agree.
    for point in copy.control_points.iter_mut().flatten() {
        (point.x, point.y) = (20.0 - point.x, 10.0 - point.y);
    }
    bcifs.cells.push(copy);
    bcifs.glue.push(Glue { between: [(0, 0), (1, 0)], reversed: true, permutation: None });
    let findings = Model { name: None, shape: Shape::Bcifs(bcifs) }.lower().expect_err("the edge is not symmetric");
    assert!(findings.iter().any(|finding| finding.code == "automaton.asymmetric-boundary"), "{findings:?}");
}

#[test]
fn memory_beyond_the_limit_is_refused() {
    let attractor = attractor(torus(false, true));
    let limits = Limits { memory_bytes: 4 << 20, ..Limits::default() };
    let budget = Budget { limits, ..Budget::default() };
    let error = refine(&attractor, Tolerance::new(1e-5).expect("positive"), &budget).expect_err("too fine");
    assert_eq!(error.code(), "limit-memory");
    let facts = error.limit().expect("a limit");
    assert_eq!((facts.limit, facts.allowed), ("memory_bytes", 4_194_304.0));
    assert!(refine(&attractor, Tolerance::new(0.5).expect("positive"), &budget).is_ok());
}

#[test]
fn boundaries_are_of_lower_dimension() {
    let mut bcifs = biquadratic(false, vec![patch(|_, _| 0.0)]);
    bcifs.states[1].boundaries.push(BoundarySpec { state: "edge".into(), incidence: matrix(&identity(6)) });
    let findings = Model { name: None, shape: Shape::Bcifs(bcifs) }.lower().expect_err("an edge bounds itself");
    assert!(findings.iter().any(|finding| finding.code == "automaton.boundary-dimension"), "{findings:?}");
}

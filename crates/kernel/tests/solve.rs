//! Constraints solved: degrees of freedom against MATH.md, published operators recovered, contradictions reduced.

use lacuna_kernel::budget::CancelToken;
use lacuna_kernel::model::solve::{Method, Rational, Solution, SolveError};
use lacuna_kernel::model::{Adjacency, Bcifs, BcifsState, BoundarySpec, CellKind, Entry, Incidence, Matrix, RootCell, TransitionSpec};
use std::collections::BTreeMap;

fn unknown(rows: usize, columns: usize) -> Matrix {
    Matrix { rows: vec![vec![Entry::Unknown; columns]; rows] }
}

/// The embedding whose columns are the unit vectors of these indices.
fn selection(rows: usize, indices: &[usize]) -> Matrix {
    let entry = |row, column: &usize| Entry::Number(if row == *column { 1.0 } else { 0.0 });
    Matrix { rows: (0..rows).map(|row| indices.iter().map(|column| entry(row, column)).collect()).collect() }
}

fn transition(to: &str, operator: Matrix) -> TransitionSpec {
    TransitionSpec { to: to.into(), operator }
}

fn boundary(state: &str, incidence: Matrix) -> BoundarySpec {
    BoundarySpec { state: state.into(), incidence }
}

fn points(count: usize) -> Vec<Option<glam::DVec4>> {
    (0..count).map(|k| Some(glam::DVec4::new(10.0 * k as f64, (k * k) as f64, 0.0, 1.0))).collect()
}

/// The curve of n control points whose end vertices depend on p of them, everything else unknown.
fn curve(n: usize, p: usize) -> Bcifs {
    let first: Vec<usize> = (0..p).collect();
    let last: Vec<usize> = (n - p..n).collect();
    let edge = BcifsState {
        name: "edge".into(),
        cell: CellKind::Edge,
        dimension: n,
        transitions: vec![transition("edge", unknown(n, n)), transition("edge", unknown(n, n))],
        boundaries: vec![boundary("vertex", selection(n, &first)), boundary("vertex", selection(n, &last))],
    };
    let vertex = BcifsState {
        name: "vertex".into(),
        cell: CellKind::Vertex,
        dimension: p,
        transitions: vec![transition("vertex", unknown(p, p))],
        boundaries: Vec::new(),
    };
    let incidence = |boundary, child| Incidence { state: "edge".into(), boundary, children: vec![(child, boundary)] };
    Bcifs {
        states: vec![edge, vertex],
        incidences: vec![incidence(0, 0), incidence(1, 1)],
        adjacencies: vec![Adjacency { state: "edge".into(), between: [(0, 1), (1, 0)], reversed: false, permutation: None }],
        cells: vec![RootCell { state: "edge".into(), control_points: points(n) }],
        ..Bcifs::default()
    }
}

fn solve(model: &Bcifs) -> Result<Solution, SolveError> {
    model.solve(&BTreeMap::new(), &CancelToken::new())
}

/// MATH.md 2.
#[test]
fn curves_have_the_degrees_of_freedom_of_the_literature() {
    for (n, p, wanted) in [(2, 1, 1), (3, 1, 6), (3, 2, 2), (4, 1, 15), (4, 2, 8), (4, 3, 3)] {
        let solution = solve(&curve(n, p)).unwrap();
        assert_eq!(solution.degrees_of_freedom(), wanted, "({n}, {p})");
        assert_eq!(solution.method, Method::Exact);
        assert!(solution.residual < 1e-12, "{}", solution.residual);
        assert!(solution.contraction.unwrap()[1] < 1.0, "({n}, {p}): {:?}", solution.contraction);
    }
}

/// MATH.md 2: T_0 and T_1 of corner cutting, symbolically, and Chaikin's numbers.
#[test]
fn corner_cutting_is_recovered() {
    let mut model = curve(3, 2);
    model.parameters = vec![("a".into(), 0.25), ("b".into(), 0.25)];
    model.states[0].transitions[0].operator.rows[1][0] = Entry::Parameter("a".into());
    model.states[0].transitions[0].operator.rows[0][1] = Entry::Parameter("b".into());
    let solution = solve(&model).unwrap();
    let names: Vec<&str> = solution.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
    assert_eq!(names, ["a", "b"]);
    // (constant, a, b) of every entry.
    let one_less_a = (1, -1, 0);
    let one_less_b = (1, 0, -1);
    let (a, b, zero) = ((0, 1, 0), (0, 0, 1), (0, 0, 0));
    let published = [
        [[one_less_a, b, zero], [a, one_less_b, one_less_a], [zero, zero, a]],
        [[b, zero, zero], [one_less_b, one_less_a, b], [zero, a, one_less_b]],
    ];
    for (t, rows) in published.iter().enumerate() {
        for (i, row) in rows.iter().enumerate() {
            for (j, &(constant, in_a, in_b)) in row.iter().enumerate() {
                let pointer = format!("/states/0/transitions/{t}/operator/{i}/{j}");
                let entry = solution.entries.iter().find(|entry| entry.pointer == pointer).unwrap();
                let form = entry.form.as_ref().unwrap();
                assert_eq!(form.constant, Rational::from(constant), "{pointer}");
                let terms: Vec<(usize, Rational)> =
                    [in_a, in_b].into_iter().enumerate().filter(|(_, c)| *c != 0).map(|(k, c)| (k, Rational::from(c))).collect();
                assert_eq!(form.terms, terms, "{pointer}");
            }
        }
    }
    assert!((solution.contraction.unwrap()[0] - 0.5).abs() < 1e-9);
}

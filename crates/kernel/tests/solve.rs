//! Constraints solved: degrees of freedom against MATH.md, published operators recovered, contradictions reduced.

use lacuna_kernel::budget::CancelToken;
use lacuna_kernel::model::solve::{Method, Rational, Solution, SolveError};
use lacuna_kernel::model::{
    Adjacency, Bcifs, BcifsState, BoundarySpec, CellKind, Entry, Glue, Incidence, Matrix, Relation, RootCell, Side, TransitionSpec,
};
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

/// A quad on a grid of g x g control points: 4 for cubic (Catmull-Clark), 3 for quadratic (Doo-Sabin). Edges see g
/// points along and h = g - 1 across, vertices h x h; everything is unknown. Corners, edges and children go around
/// counterclockwise; `turned` children begin at the corner that they share with the parent, others are parallel to it.
fn quad(g: usize, turned: bool) -> Bcifs {
    let h = g - 1;
    let rotated = |k: usize, (x, y): (usize, usize)| (0..k).fold((x, y), |(x, y), _| (g - 1 - y, x));
    let side = |k: usize| {
        let places: Vec<usize> =
            (0..h).flat_map(|s| (0..g).map(move |a| (a, s))).map(|place| rotated(k, place)).map(|(x, y)| y * g + x).collect();
        selection(g * g, &places)
    };
    let end = |first: usize| selection(g * h, &(0..h).flat_map(|s| (0..h).map(move |a| s * g + a + first)).collect::<Vec<_>>());
    let state = |name: &str, cell, dimension: usize, children: usize, boundaries| BcifsState {
        name: name.into(),
        cell,
        dimension,
        transitions: (0..children).map(|_| transition(name, unknown(dimension, dimension))).collect(),
        boundaries,
    };
    let states = vec![
        state("face", CellKind::Face, g * g, 4, (0..4).map(|k| boundary("edge", side(k))).collect()),
        state("edge", CellKind::Edge, g * h, 2, vec![boundary("vertex", end(0)), boundary("vertex", end(1))]),
        state("vertex", CellKind::Vertex, h * h, 1, Vec::new()),
    ];
    // Side of child c that lies on side k of its parent, or `from` the common edge onwards.
    let of = |child: usize, side: usize| if turned { (side + 4 - child) % 4 } else { side % 4 };
    let mut incidences: Vec<Incidence> = (0..4)
        .map(|k| Incidence { state: "face".into(), boundary: k, children: vec![(k, of(k, k)), ((k + 1) % 4, of((k + 1) % 4, k))] })
        .collect();
    incidences.extend((0..2).map(|k| Incidence { state: "edge".into(), boundary: k, children: vec![(k, k)] }));
    let adjacency = |state: &str, between, reversed| Adjacency { state: state.into(), between, reversed, permutation: None };
    let mut adjacencies: Vec<Adjacency> = (0..4)
        .map(|k| {
            let next = (k + 1) % 4;
            adjacency("face", [(k, of(k, k + 1)), (next, of(next, k + 3))], true)
        })
        .collect();
    adjacencies.push(adjacency("edge", [(0, 1), (1, 0)], false));
    let control_points =
        (0..g * g).map(|k| Some(glam::DVec4::new(10.0 * (k % g) as f64, 10.0 * (k / g) as f64, (k * k % 7) as f64, 1.0))).collect();
    Bcifs { states, incidences, adjacencies, cells: vec![RootCell { state: "face".into(), control_points }], ..Bcifs::default() }
}

/// MATH.md 2 and ALGORITHMS.md 5.4: 4 for the cyclic Catmull-Clark quad, of 1393 unknown entries.
#[test]
fn the_cyclic_catmull_clark_quad_has_four_degrees_of_freedom() {
    for turned in [false, true] {
        let solution = solve(&quad(4, turned)).unwrap();
        assert_eq!((solution.degrees_of_freedom(), solution.method), (4, Method::Exact));
        assert_eq!(solution.entries.len(), 4 * 256 + 2 * 144 + 81);
        assert!(solution.residual < 1e-12 && solution.contraction.unwrap()[1] < 1.0);
    }
}

/// Rows of the matrix whose columns are the tensor product of the columns: entry (y g + x, t h + s) is `along_y[y][t] along_x[x][s]`.
fn tensor(along_y: &[Vec<f64>], along_x: &[Vec<f64>]) -> Vec<Vec<f64>> {
    along_y
        .iter()
        .flat_map(|row_y| along_x.iter().map(move |row_x| row_y.iter().flat_map(|y| row_x.iter().map(move |x| x * y)).collect()))
        .collect()
}

fn given(rows: &[Vec<f64>]) -> Matrix {
    Matrix { rows: rows.iter().map(|row| row.iter().map(|&value| Entry::Number(value)).collect()).collect() }
}

fn numbers(matrix: &Matrix) -> Vec<Vec<f64>> {
    let number = |entry: &Entry| if let Entry::Number(value) = entry { *value } else { panic!("{entry:?} is no number") };
    matrix.rows.iter().map(|row| row.iter().map(number).collect()).collect()
}

fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    assert_eq!((a.len(), a[0].len()), (b.len(), b[0].len()));
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The uniform cubic B-spline's refinement of 4 control points.
fn cubic() -> [Vec<Vec<f64>>; 2] {
    let (half, eighth, most) = (0.5, 0.125, 0.75);
    [
        vec![vec![half, eighth, 0.0, 0.0], vec![half, most, half, eighth], vec![0.0, eighth, half, most], vec![0.0, 0.0, 0.0, eighth]],
        vec![vec![eighth, 0.0, 0.0, 0.0], vec![most, half, eighth, 0.0], vec![eighth, half, most, half], vec![0.0, 0.0, eighth, half]],
    ]
}

/// Corner cutting with a = b.
fn quadratic(a: f64) -> [Vec<Vec<f64>>; 2] {
    [
        vec![vec![1.0 - a, a, 0.0], vec![a, 1.0 - a, 1.0 - a], vec![0.0, 0.0, a]],
        vec![vec![a, 0.0, 0.0], vec![1.0 - a, 1.0 - a, a], vec![0.0, a, 1.0 - a]],
    ]
}

/// The quad's child at corner k is at (x, y) of its parent's halves.
const CORNERS: [(usize, usize); 4] = [(0, 0), (1, 0), (1, 1), (0, 1)];

/// The four values of the bicubic B-spline's vertex give the Catmull-Clark masks of regular faces in all operators.
#[test]
fn the_four_values_of_the_bicubic_spline_give_its_operators() {
    let vertex = [vec![0.5, 0.125, 0.0], vec![0.5, 0.75, 0.5], vec![0.0, 0.125, 0.5]];
    let vertex = tensor(&vertex, &vertex);
    let model = quad(4, false);
    let values: BTreeMap<String, f64> =
        [(0, 1), (0, 3), (0, 4), (1, 4)].into_iter().map(|(i, j)| (format!("vertex.0[{i}][{j}]"), vertex[i][j])).collect();
    let solution = model.solve(&values, &CancelToken::new()).unwrap();
    let (curve, states) = (cubic(), &solution.model.states);
    assert!(difference(&numbers(&states[2].transitions[0].operator), &vertex) < 1e-15);
    for (child, (x, y)) in CORNERS.into_iter().enumerate() {
        let wanted = tensor(&curve[y], &curve[x]);
        assert!(difference(&numbers(&states[0].transitions[child].operator), &wanted) < 1e-15, "child {child}");
    }
}

/// ALGORITHMS.md 6: the masks {9/16, 3/16, 3/16, 1/16} of Doo and Sabin and the arbitrary {.49, .21, .21, .09} both satisfy the
/// system, and determine the operators of edges and vertices.
#[test]
fn doo_sabin_masks_satisfy_the_quad() {
    for (a, masks) in [(0.25, [9.0 / 16.0, 3.0 / 16.0, 1.0 / 16.0]), (0.3, [0.49, 0.21, 0.09])] {
        let mut model = quad(3, false);
        let free = solve(&model).unwrap();
        let curve = quadratic(a);
        for (child, (x, y)) in CORNERS.into_iter().enumerate() {
            model.states[0].transitions[child].operator = given(&tensor(&curve[y], &curve[x]));
        }
        let column: Vec<f64> = numbers(&model.states[0].transitions[0].operator).iter().map(|row| row[0]).collect();
        assert!((column[0] - masks[0]).abs() + (column[1] - masks[1]).abs() + (column[4] - masks[2]).abs() < 1e-15, "{column:?}");
        let solution = solve(&model).unwrap();
        assert_eq!((solution.degrees_of_freedom(), solution.method), (0, Method::Exact));
        assert!(solution.residual < 1e-15, "{}", solution.residual);
        let edge = &solution.model.states[1].transitions;
        let across: Vec<Vec<f64>> = curve[0][..2].iter().map(|row| row[..2].to_vec()).collect();
        for half in 0..2 {
            assert!(difference(&numbers(&edge[half].operator), &tensor(&across, &curve[half])) < 1e-15);
        }
        // The masks lie in the space of solutions that is found without them: its parameters at their values give them.
        let values = free.parameters.iter().map(|parameter| {
            let place = model_entry(&solution.model, &parameter.pointer);
            (parameter.name.clone(), place)
        });
        let again = quad(3, false).solve(&values.collect(), &CancelToken::new()).unwrap();
        assert!(difference(&numbers(&again.model.states[0].transitions[2].operator), &tensor(&curve[1], &curve[1])) < 1e-14);
    }
}

fn model_entry(model: &Bcifs, pointer: &str) -> f64 {
    let parts: Vec<&str> = pointer.split('/').collect();
    let at = |k: usize| parts[k].parse::<usize>().expect("an index");
    assert_eq!((parts[1], parts[3], parts[5]), ("states", "transitions", "operator"));
    numbers(&model.states[at(2)].transitions[at(4)].operator)[at(6)][at(7)]
}

fn words(error: &SolveError) -> Vec<(String, String)> {
    let SolveError::Contradiction { constraints } = error else { panic!("{error}") };
    constraints.iter().map(|constraint| (constraint.pointer.clone(), constraint.words.clone())).collect()
}

/// A curve of two points whose halves would have to join at 0.7 and at 0.5.
#[test]
fn a_contradiction_names_what_is_needed_for_it() {
    let mut model = curve(2, 1);
    model.states[0].transitions[0].operator.rows[1][1] = Entry::Number(0.3);
    model.states[0].transitions[1].operator.rows[0][0] = Entry::Number(0.5);
    let found = words(&solve(&model).unwrap_err());
    let join = ("/adjacencies/0".to_string(), "boundary 1 of child 0 of state 'edge' is boundary 0 of child 1".to_string());
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found.contains(&join), "{found:?}");
    assert!(found.iter().any(|(_, words)| words.starts_with("the columns of the operator of child")), "{found:?}");
    // Without the joint both halves are free to stand where they are.
    model.adjacencies.clear();
    assert!(solve(&model).is_ok());
    let error = curve(2, 1).solve(&[("edge.0[0][0]".to_string(), 0.5)].into(), &CancelToken::new()).unwrap_err();
    assert!(words(&error).iter().any(|(pointer, words)| pointer == "/states/0/transitions/0/operator/0/0" && words.contains("chosen")));
    assert_eq!(error.code(), "automaton.contradiction");
}

/// The end vertex of a curve that is given is the fixed point of its first operator: (1/2, 1/2, 0) for Chaikin's curve,
/// (1/6, 2/3, 1/6, 0) for the cubic spline.
#[test]
fn unknown_embeddings_are_fixed_points() {
    let cases = [(quadratic(0.25), vec!["1/2", "1/2", "0"]), (cubic(), vec!["1/6", "2/3", "1/6", "0"])];
    for (operators, wanted) in cases {
        let n = wanted.len();
        let mut model = curve(n, 1);
        for (transition, rows) in model.states[0].transitions.iter_mut().zip(&operators) {
            transition.operator = given(rows);
        }
        model.states[0].boundaries.iter_mut().for_each(|boundary| boundary.incidence = unknown(n, 1));
        model.states[1].transitions[0].operator = unknown(1, 1);
        // One entry that another constraint gives makes b T = T b bilinear at first.
        model.states[0].transitions[0].operator.rows[1][0] = Entry::Unknown;
        let solution = solve(&model).unwrap();
        assert_eq!((solution.degrees_of_freedom(), &solution.method), (0, &Method::Exact));
        for (row, wanted) in wanted.iter().enumerate() {
            let pointer = format!("/states/0/boundaries/0/incidence/{row}/0");
            let entry = solution.entries.iter().find(|entry| entry.pointer == pointer).unwrap();
            assert_eq!(entry.form.as_ref().unwrap().constant.to_string(), *wanted);
        }
    }
}

/// A strip between a cubic curve and a quadratic one (ALGORITHMS.md 5.3): what its children do is determined by its sides, block by block.
#[test]
fn a_strip_between_two_kinds_of_curves_is_determined() {
    let mut model = strip();
    let solution = solve(&model).unwrap();
    assert_eq!((solution.degrees_of_freedom(), &solution.method), (0, &Method::Exact));
    let (left, right) = (cubic(), quadratic(0.25));
    for half in 0..2 {
        let operator = numbers(&solution.model.states[0].transitions[half].operator);
        for (i, row) in operator.iter().enumerate() {
            for (j, &value) in row.iter().enumerate() {
                let wanted = if i < 4 && j < 4 {
                    left[half][i][j]
                } else if i >= 4 && j >= 4 {
                    right[half][i - 4][j - 4]
                } else {
                    0.0
                };
                assert_eq!(value, wanted);
            }
        }
    }
    // Nothing brings its sides together: it is a strip of constant width, and lowering finds the cycle.
    assert!(solution.contraction.unwrap()[0] > 1.0 - 1e-9, "{:?}", solution.contraction);
    assert!(lower(&model).unwrap_err()[0].code.contains("contractive"));
    model.incidences.pop();
    let findings = lower(&model).unwrap_err();
    assert_eq!(findings[0].code, "automaton.underdetermined");
    assert!(findings[0].message.contains("36 degrees of freedom"), "{}", findings[0].message);
}

fn lower(model: &Bcifs) -> Result<lacuna_kernel::model::Lowered, Vec<lacuna_kernel::model::Finding>> {
    lacuna_kernel::model::Model { name: None, shape: lacuna_kernel::model::Shape::Bcifs(model.clone()) }.lower()
}

fn strip() -> Bcifs {
    let curve = |name: &str, operators: [Vec<Vec<f64>>; 2]| BcifsState {
        name: name.into(),
        cell: CellKind::Edge,
        dimension: operators[0].len(),
        transitions: operators.iter().map(|rows| transition(name, given(rows))).collect(),
        boundaries: Vec::new(),
    };
    let face = BcifsState {
        name: "strip".into(),
        cell: CellKind::Face,
        dimension: 7,
        transitions: vec![transition("strip", unknown(7, 7)), transition("strip", unknown(7, 7))],
        boundaries: vec![boundary("cubic", selection(7, &[0, 1, 2, 3])), boundary("quadratic", selection(7, &[4, 5, 6]))],
    };
    Bcifs {
        states: vec![face, curve("cubic", cubic()), curve("quadratic", quadratic(0.25))],
        incidences: (0..2).map(|k| Incidence { state: "strip".into(), boundary: k, children: vec![(0, k), (1, k)] }).collect(),
        cells: vec![RootCell { state: "strip".into(), control_points: points(7) }],
        ..Bcifs::default()
    }
}

/// A cubic curve goes on where a quadratic one ends: P_0 (0, 1/2, 1/2) = P_1 (1/6, 2/3, 1/6, 0), with the embeddings
/// unknown too.
#[test]
fn control_points_are_placed_to_share_a_border() {
    let mut model = strip();
    for (state, n) in [(1, 4), (2, 3)] {
        model.states[state].boundaries = vec![boundary("end", unknown(n, 1)), boundary("end", unknown(n, 1))];
    }
    model.states.push(BcifsState {
        name: "end".into(),
        cell: CellKind::Vertex,
        dimension: 1,
        transitions: vec![transition("end", given(&[vec![1.0]]))],
        boundaries: Vec::new(),
    });
    for name in ["cubic", "quadratic"] {
        model.incidences.extend((0..2).map(|k| Incidence { state: name.into(), boundary: k, children: vec![(k, k)] }));
    }
    let (first, mut second) = (points(3), points(4));
    second[1] = None;
    model.cells = vec![
        RootCell { state: "quadratic".into(), control_points: first.clone() },
        RootCell { state: "cubic".into(), control_points: second.clone() },
    ];
    model.glue = vec![Glue { between: [(0, 1), (1, 0)], reversed: false, permutation: None }];
    let solution = solve(&model).unwrap();
    assert_eq!((solution.degrees_of_freedom(), &solution.method), (0, &Method::Exact));
    let known = |point: &Option<glam::DVec4>| point.unwrap().truncate();
    let joint = 0.5 * (known(&first[1]) + known(&first[2]));
    let wanted = (joint - (known(&second[0]) + known(&second[2])) / 6.0) * 1.5;
    assert!((known(&solution.model.cells[1].control_points[1]) - wanted).length() < 1e-13);
    assert!(solution.residual < 1e-15);
    // A model that is not placed is placed when lowered; one that is placed wrongly is refused.
    assert!(lower(&model).is_ok());
    model.cells[1].control_points[1] = Some((wanted + glam::DVec3::new(0.001, 0.0, 0.0)).extend(1.0));
    assert_eq!(solve(&model).unwrap_err().code(), "automaton.contradiction");
    let mut filled = solution.model;
    assert!(lower(&filled).is_ok());
    filled.cells[1].control_points[1] = model.cells[1].control_points[1];
    let findings = lower(&filled).unwrap_err();
    let errors: Vec<_> =
        findings.iter().filter(|finding| !finding.warning).map(|finding| (finding.pointer.as_str(), finding.code)).collect();
    assert_eq!(errors, [("/glue/0", "automaton.glue-mismatch")]);
}

/// T_0 T_0 = T_1 with T_0 = [[1, 1 - s], [0, s]] and T_1 = [[1, 1 - square], [0, square]]: s^2 = square.
fn square_root(square: f64) -> Bcifs {
    let mut model = curve(2, 1);
    model.incidences.clear();
    model.adjacencies.clear();
    model.states[0].transitions[0].operator =
        Matrix { rows: vec![vec![Entry::Number(1.0), Entry::Unknown], vec![Entry::Number(0.0), Entry::Unknown]] };
    model.states[0].transitions[1].operator = given(&[vec![1.0, 1.0 - square], vec![0.0, square]]);
    model.states[1].transitions[0].operator = given(&[vec![1.0]]);
    let side = |path: &[usize]| Side { path: path.to_vec(), boundary: Vec::new() };
    model.relations = vec![Relation { state: "edge".into(), equal: [side(&[0, 0]), side(&[1])] }];
    model
}

#[test]
fn longer_relations_are_solved_near_a_start_or_honestly_not() {
    let solution = solve(&square_root(0.25)).unwrap();
    assert_eq!(solution.degrees_of_freedom(), 0);
    assert!(matches!(solution.method, Method::Local { rank: 1, .. }), "{:?}", solution.method);
    let root = model_entry(&solution.model, "/states/0/transitions/0/operator/1/1");
    assert!((root.abs() - 0.5).abs() < 1e-12 && solution.residual < 1e-12, "{root}");
    assert!(lower(&square_root(0.25)).is_ok());
    let error = solve(&square_root(-0.25)).unwrap_err();
    // The least |s^2 + 1/4| is 1/4.
    assert!(matches!(error, SolveError::NotFound { best_residual, .. } if best_residual > 0.1), "{error}");
    assert_eq!(lower(&square_root(-0.25)).unwrap_err()[0].code, "solve.not-found");
}

/// T_1 = T_0 T_0 with both unknown: T_0 is free, T_1 depends on it. 3 x 3 entries less 3 column sums are 6 degrees of freedom.
#[test]
fn the_jacobian_tells_the_local_degrees_of_freedom() {
    let mut model = square_root(0.25);
    model.states[0].dimension = 3;
    model.states[0].transitions.iter_mut().for_each(|transition| transition.operator = unknown(3, 3));
    model.states[0].boundaries.clear();
    model.cells[0].control_points = points(3);
    let solution = solve(&model).unwrap();
    assert_eq!(solution.degrees_of_freedom(), 6);
    assert!(matches!(solution.method, Method::Local { rank: 6, unknowns: 12, .. }), "{:?}", solution.method);
    assert!(solution.parameters.iter().all(|parameter| parameter.name.starts_with("edge.0")));
    let names = solution.parameters.iter().map(|parameter| (parameter.name.clone(), 0.25));
    let chosen = model.solve(&names.collect(), &CancelToken::new()).unwrap();
    assert_eq!(chosen.degrees_of_freedom(), 6);
    assert!(chosen.parameters.iter().all(|parameter| parameter.value == 0.25) && chosen.residual < 1e-12);
}

/// Everything of a curve with point ends is unknown, embeddings too. For independent ends b_0, b_1 (2 choices each) the rest is linear
/// and leaves the 6 of MATH.md 2, so 10 together.
#[test]
fn unknown_embeddings_and_operators_are_solved_together() {
    let mut model = curve(3, 1);
    model.states[0].boundaries.iter_mut().for_each(|boundary| boundary.incidence = unknown(3, 1));
    let solution = solve(&model).unwrap();
    assert_eq!(solution.degrees_of_freedom(), 10);
    assert!(matches!(solution.method, Method::Local { rank: 6, .. }), "{:?}", solution.method);
    assert!(solution.residual < 1e-12, "{}", solution.residual);
    // Once the ends are chosen the rest is linear; what is free stays where it is put.
    let ends = [("edge.boundary0", [1.0, 0.0]), ("edge.boundary1", [0.25, 0.25])];
    let values: BTreeMap<String, f64> =
        ends.iter().flat_map(|(name, rows)| rows.iter().enumerate().map(move |(k, &value)| (format!("{name}[{k}][0]"), value))).collect();
    let chosen = model.solve(&values, &CancelToken::new()).unwrap();
    assert_eq!(chosen.degrees_of_freedom(), 10);
    assert!(chosen.residual < 1e-12 && chosen.contraction.unwrap()[1] < 1.0);
    assert_eq!(numbers(&chosen.model.states[0].boundaries[1].incidence), vec![vec![0.25], vec![0.25], vec![0.5]]);
}

#[test]
fn a_declared_parameter_may_be_determined() {
    let mut model = curve(2, 1);
    model.parameters = vec![("a".into(), 0.5)];
    model.states[0].transitions[0].operator =
        Matrix { rows: vec![vec![Entry::Unknown, Entry::Parameter("a".into())], vec![Entry::Unknown, Entry::Number(0.3)]] };
    let solution = solve(&model).unwrap();
    assert_eq!(solution.determined, vec![("a".to_string(), 0.5, 0.7)]);
    assert_eq!(solution.model.parameters, vec![("a".to_string(), 0.7)]);
    let error = model.solve(&[("a".to_string(), 0.5)].into(), &CancelToken::new()).unwrap_err();
    assert!(words(&error).iter().any(|(place, words)| place == "/parameters/a" && words == "'a' is chosen to be 0.5"));
    // Lowering keeps what the document says.
    assert_eq!(lower(&model).unwrap_err()[0].code, "automaton.contradiction");
}

#[test]
fn what_is_not_well_formed_is_named() {
    let mut model = curve(3, 2);
    model.states[0].boundaries[0].incidence.rows.pop();
    model.adjacencies[0].permutation = Some(vec![0, 0]);
    model.relations = vec![Relation {
        state: "edge".into(),
        equal: [Side { path: vec![0, 5], boundary: vec![] }, Side { path: vec![0], boundary: vec![] }],
    }];
    model.cells[0].control_points[1] = Some(glam::DVec4::NAN);
    let SolveError::Invalid(findings) = solve(&model).unwrap_err() else { panic!() };
    let places: Vec<(&str, &str)> = findings.iter().map(|finding| (finding.pointer.as_str(), finding.code)).collect();
    for wanted in [
        ("/states/0/boundaries/0/incidence", "automaton.dimension-mismatch"),
        ("/adjacencies/0", "automaton.adjacency-mismatch"),
        ("/relations/0", "automaton.relation-mismatch"),
        ("/cells/0/control_points/1", "model.not-finite"),
    ] {
        assert!(places.contains(&wanted), "{places:?}");
    }
    let values = [("edge.9[0][0]".to_string(), 1.0)].into();
    assert!(matches!(curve(3, 2).solve(&values, &CancelToken::new()), Err(SolveError::UnknownName { .. })));
    let token = CancelToken::new();
    token.fire(lacuna_kernel::budget::StopReason::Cancelled);
    assert!(matches!(curve(3, 2).solve(&BTreeMap::new(), &token), Err(SolveError::Stopped(_))));
}

/// Six digits of 1/3 and 2/3 are accepted, and what they leave is told.
#[test]
fn rounded_operators_are_rounding_and_not_contradictions() {
    let mut model = curve(3, 2);
    let values = [("vertex.0[0][0]".to_string(), 2.0 / 3.0), ("vertex.0[0][1]".to_string(), 1.0 / 3.0)].into();
    let exact = model.solve(&values, &CancelToken::new()).unwrap();
    for (transition, filled) in model.states[0].transitions.iter_mut().zip(&exact.model.states[0].transitions) {
        let rounded: Vec<Vec<f64>> =
            numbers(&filled.operator).iter().map(|row| row.iter().map(|value| (value * 1e6).trunc() / 1e6).collect()).collect();
        transition.operator = given(&rounded);
    }
    let solution = solve(&model).unwrap();
    assert_eq!(solution.degrees_of_freedom(), 0);
    assert!(solution.residual > 1e-8 && solution.residual < 3e-6, "{}", solution.residual);
    let vertex = numbers(&solution.model.states[1].transitions[0].operator);
    assert!((vertex[0][0] - 2.0 / 3.0).abs() < 3e-6, "{vertex:?}");
}

/// Numbers in [-1, 1): half of them with all their digits, half with three decimals.
struct Numbers(u64);

impl Numbers {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 11
    }

    fn next(&mut self) -> f64 {
        let value = self.bits() as f64 / (1_u64 << 52) as f64 - 1.0;
        if self.bits().is_multiple_of(2) { value } else { (value * 1000.0).round() / 1000.0 }
    }
}

/// Random solutions of which random entries are forgotten are found again, with all constraints kept for any choice of
/// what is free.
#[test]
fn constraints_hold_for_every_choice_of_parameters() {
    let mut numbers = Numbers(7);
    for round in 0..36 {
        let blank = match round % 6 {
            0 => curve(3, 1),
            1 => curve(3, 2),
            2 => curve(4, 2),
            3 => curve(4, 3),
            4 => quad(3, false),
            _ => quad(3, true),
        };
        let space = solve(&blank).unwrap();
        let values = space.parameters.iter().map(|parameter| (parameter.name.clone(), numbers.next())).collect();
        let mut model = blank.solve(&values, &CancelToken::new()).unwrap().model;
        for state in &mut model.states {
            for entry in state.transitions.iter_mut().flat_map(|transition| transition.operator.rows.iter_mut().flatten()) {
                if numbers.bits().is_multiple_of(2) {
                    *entry = Entry::Unknown;
                }
            }
        }
        let space = solve(&model).unwrap();
        let values: BTreeMap<String, f64> = space.parameters.iter().map(|parameter| (parameter.name.clone(), numbers.next())).collect();
        let solution = model.solve(&values, &CancelToken::new()).unwrap();
        assert_eq!(solution.degrees_of_freedom(), space.degrees_of_freedom());
        assert!(solution.residual < 1e-10, "round {round}: {}", solution.residual);
        assert!(solution.parameters.iter().all(|parameter| parameter.value == values[&parameter.name]));
        // Measured by the lowering too, which knows nothing of the solver.
        match lower(&solution.model) {
            Ok(lowered) => assert!(lowered.constraint_residual < 1e-10),
            // Random edges are not alike backwards and random operators may diverge; neither is a constraint.
            Err(findings) => {
                let other = |code: &str| !code.contains("contract") && code != "automaton.asymmetric-boundary";
                assert!(findings.iter().all(|finding| finding.warning || !other(finding.code)), "{findings:?}");
            }
        }
    }
}

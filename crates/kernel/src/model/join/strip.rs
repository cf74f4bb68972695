//! The strip between a bicubic and a biquadratic surface, after Podkorytov, Gentil, Sokolov and Lanquetin, "Joining
//! primal/dual subdivision surfaces" (Mathematical Methods for Curves and Surfaces, LNCS 8177, 2014).
//!
//! A cell of the strip has 18 control points: three columns of four along the cubic border, as a bicubic patch beyond it
//! would have, and two columns of three along the quadratic one. Its left edge depends on the first twelve alone, its right
//! edge on the last six, and its rungs to the next cells on 13. It subdivides into strips on the left and biquadratic patches
//! on the right. Incidences and adjacencies determine all operators but the new quadratic control points of a rung, which
//! have 24 degrees of freedom. They are chosen to depend on the cubic points alone and so that the strip between two parts
//! of one biquadratic surface is that surface; the solver finds that this leaves nothing free.
//!
//! The strip meets both surfaces with their tangent planes. On the right it consists of biquadratic patches whose last two
//! columns are the neighbour's first two, refined. On the left, let e be the distance of its quadratic columns from where
//! the linear parts of the cubic ones would put them. A subdivision replaces the first of the two columns by cubic points
//! and the second by 3/4 of the first and 1/4 of the second: e goes to at most e / 4 + O(4^-k) on cells of size 2^-k, so
//! e = O(k 4^-k) is of higher order than the cells, and what remains is the cubic surface's tangent plane.

use super::border::{Chain, align};
use super::fit::{Net, beside};
use super::limits::Limits;
use crate::budget::CancelToken;
use crate::model::bcifs::{
    Adjacency, Bcifs, BcifsState, BoundarySpec, CellKind, Entry, Glue, Incidence, Matrix, Relation, RootCell, Side, TransitionSpec,
};
use crate::model::lower::Draft;
use glam::{DVec3, DVec4};
use std::collections::BTreeMap;

type Rows = Vec<Vec<f64>>;

const LEFT: usize = 0;
const BOTTOM: usize = 1;
const RIGHT: usize = 2;
const TOP: usize = 3;

/// The name of the state that the solver needs to know biquadratics.
const WHOLE: &str = "biquadratic";

/// Operators of a cubic and a quadratic B-spline, by rows: two children, and what an end depends on.
const CUBIC: [[[f64; 4]; 4]; 2] = [
    [[0.5, 0.125, 0.0, 0.0], [0.5, 0.75, 0.5, 0.125], [0.0, 0.125, 0.5, 0.75], [0.0, 0.0, 0.0, 0.125]],
    [[0.125, 0.0, 0.0, 0.0], [0.75, 0.5, 0.125, 0.0], [0.125, 0.5, 0.75, 0.5], [0.0, 0.0, 0.125, 0.5]],
];
const CUBIC_END: [[f64; 3]; 3] = [[0.5, 0.125, 0.0], [0.5, 0.75, 0.5], [0.0, 0.125, 0.5]];
const QUADRATIC: [[[f64; 3]; 3]; 2] =
    [[[0.75, 0.25, 0.0], [0.25, 0.75, 0.75], [0.0, 0.0, 0.25]], [[0.25, 0.0, 0.0], [0.75, 0.75, 0.25], [0.0, 0.25, 0.75]]];
const QUADRATIC_END: [[f64; 2]; 2] = [[0.75, 0.25], [0.25, 0.75]];

fn rows<const N: usize>(matrix: &[[f64; N]; N]) -> Rows {
    matrix.iter().map(|row| row.to_vec()).collect()
}

fn kronecker(a: &Rows, b: &Rows) -> Rows {
    a.iter().flat_map(|p| b.iter().map(move |q| p.iter().flat_map(|x| q.iter().map(move |y| x * y)).collect())).collect()
}

fn given(rows: &Rows) -> Matrix {
    Matrix { rows: rows.iter().map(|row| row.iter().map(|&x| Entry::Number(x)).collect()).collect() }
}

fn unknown(rows: usize, columns: usize) -> Matrix {
    Matrix { rows: vec![vec![Entry::Unknown; columns]; rows] }
}

/// An embedding that selects control points.
fn selection(rows: usize, points: &[usize]) -> Matrix {
    let entry = |row: usize, &point: &usize| Entry::Number(f64::from(u8::from(row == point)));
    Matrix { rows: (0..rows).map(|row| points.iter().map(|point| entry(row, point)).collect()).collect() }
}

fn state(name: &str, cell: CellKind, dimension: usize, children: Vec<(&str, Matrix)>, boundaries: Vec<(&str, Matrix)>) -> BcifsState {
    let transitions = children.into_iter().map(|(to, operator)| TransitionSpec { to: to.into(), operator }).collect();
    let boundaries = boundaries.into_iter().map(|(state, incidence)| BoundarySpec { state: state.into(), incidence }).collect();
    BcifsState { name: name.into(), cell, dimension, transitions, boundaries }
}

/// Points (i, k) of a net, i across the strip and k along it, in the order of an edge: along it first.
fn edge(width: usize, height: usize, across_strip: bool, place: &dyn Fn(usize, usize) -> usize) -> Vec<usize> {
    let (long, short) = if across_strip { (width, height) } else { (height, width) };
    let point = |along: usize, beside: usize| if across_strip { place(along, beside) } else { place(beside, along) };
    (0..long).flat_map(|along| (0..short).map(move |beside| (along, beside))).map(|(along, beside)| point(along, beside)).collect()
}

/// Edges and vertices of the surfaces, and the biquadratic patch.
fn known_states() -> Vec<BcifsState> {
    let cubic_end = rows(&CUBIC_END);
    let end = rows(&QUADRATIC_END);
    let range = |rows: usize, first: usize, count: usize| selection(rows, &(first..first + count).collect::<Vec<_>>());
    let cubic_edge = |half: &[[f64; 4]; 4]| ("cubic edge", given(&kronecker(&rows(half), &cubic_end)));
    let quadratic_edge = |half: &[[f64; 3]; 3]| ("quadratic edge", given(&kronecker(&rows(half), &end)));
    let place = |i: usize, k: usize| 3 * i + k;
    let patch_edges = [(0, 0, false), (0, 0, true), (1, 0, false), (0, 1, true)].map(|(i, k, across)| {
        let (width, height) = if across { (3, 2) } else { (2, 3) };
        ("quadratic edge", selection(9, &edge(width, height, across, &|a, b| place(i + a, k + b))))
    });
    vec![
        state(
            "cubic edge",
            CellKind::Edge,
            12,
            CUBIC.iter().map(cubic_edge).collect(),
            [0, 3].map(|k| ("cubic vertex", range(12, k, 9))).into(),
        ),
        state("cubic vertex", CellKind::Vertex, 9, vec![("cubic vertex", given(&kronecker(&cubic_end, &cubic_end)))], Vec::new()),
        state("quadratic patch", CellKind::Face, 9, faces("quadratic patch"), patch_edges.into()),
        state(
            "quadratic edge",
            CellKind::Edge,
            6,
            QUADRATIC.iter().map(quadratic_edge).collect(),
            [0, 2].map(|k| ("quadratic vertex", range(6, k, 4))).into(),
        ),
        state("quadratic vertex", CellKind::Vertex, 4, vec![("quadratic vertex", given(&kronecker(&end, &end)))], Vec::new()),
    ]
}

/// The children of a biquadratic patch: left and right below, left and right above.
fn faces(to: &str) -> Vec<(&str, Matrix)> {
    let pairs = QUADRATIC.iter().flat_map(|v| QUADRATIC.iter().map(move |u| (u, v)));
    pairs.map(|(u, v)| (to, given(&kronecker(&rows(u), &rows(v))))).collect()
}

/// The 18 control points of a strip that is part of a biquadratic, in the biquadratic's nine: its cubic points by raising the
/// degree, F(a, b, c) = (f(a, b) + f(a, c) + f(b, c)) / 3 for the blossoms at three successive integers.
fn raised() -> Rows {
    // f(a, b) in f(-1, 0), f(0, 1) and f(1, 2).
    let blossom = |a: f64, b: f64| [(a * b - a - b + 1.0) / 2.0, (a + b + 1.0) / 2.0 - a * b, a * b / 2.0];
    let cubic = |i: f64| -> Vec<f64> {
        let pairs = [blossom(i - 1.0, i), blossom(i - 1.0, i + 1.0), blossom(i, i + 1.0)];
        (0..3).map(|k| pairs.iter().map(|pair| pair[k]).sum::<f64>() / 3.0).collect()
    };
    let own = |i: usize| (0..3).map(|k| f64::from(u8::from(k == i))).collect::<Vec<f64>>();
    let cubics = [-1.0, 0.0, 1.0].into_iter().flat_map(|i| [-1.0, 0.0, 1.0, 2.0].map(|k| (cubic(i), cubic(k))));
    let columns: Vec<Vec<f64>> = cubics
        .chain([1, 2].into_iter().flat_map(|i| [0, 1, 2].map(|k| (own(i), own(k)))))
        .map(|(u, v)| u.iter().flat_map(|x| v.iter().map(move |y| x * y)).collect())
        .collect();
    (0..9).map(|row| columns.iter().map(|column| column[row]).collect()).collect()
}

/// The strip with its unknown operators, and one cell of it.
fn stated() -> Bcifs {
    let cubic = |i: usize, k: usize| 4 * i + k;
    let quadratic = |i: usize, k: usize| 12 + 3 * i + k;
    let rung = |first: usize| {
        let near = (0..9).map(|n| cubic(n / 3, first + n % 3));
        selection(18, &near.chain((0..4).map(|n| quadratic(n / 2, first + n % 2))).collect::<Vec<_>>())
    };
    let children = (0..4).map(|child| if child % 2 == 0 { ("strip", unknown(18, 18)) } else { ("quadratic patch", unknown(18, 9)) });
    let sides = vec![
        ("cubic edge", selection(18, &edge(3, 4, false, &cubic))),
        ("rung", rung(0)),
        ("quadratic edge", selection(18, &edge(2, 3, false, &quadratic))),
        ("rung", rung(1)),
    ];
    let mut near = unknown(13, 13);
    // The new quadratic points depend on the cubic ones alone.
    (9..13).for_each(|row| (9..11).for_each(|column| near.rows[row][column] = Entry::Number(0.0)));
    let ends = vec![
        ("cubic vertex", selection(13, &(0..9).collect::<Vec<_>>())),
        ("quadratic vertex", selection(13, &(9..13).collect::<Vec<_>>())),
    ];
    let mut states = vec![
        state("strip", CellKind::Face, 18, children.collect(), sides),
        state("rung", CellKind::Edge, 13, vec![("rung", near), ("quadratic edge", unknown(13, 6))], ends),
    ];
    states.extend(known_states());
    let mut whole = faces(WHOLE);
    whole.push(("strip", given(&raised())));
    states.push(state(WHOLE, CellKind::Face, 9, whole, Vec::new()));
    let incidence =
        |state: &str, boundary: usize, children: &[(usize, usize)]| Incidence { state: state.into(), boundary, children: children.into() };
    let adjacency =
        |(state, between): (&str, [(usize, usize); 2])| Adjacency { state: state.into(), between, reversed: false, permutation: None };
    let side = |path: [usize; 2]| Side { path: path.into(), boundary: Vec::new() };
    Bcifs {
        states,
        incidences: vec![
            incidence("strip", LEFT, &[(0, LEFT), (2, LEFT)]),
            incidence("strip", BOTTOM, &[(0, BOTTOM), (1, BOTTOM)]),
            incidence("strip", RIGHT, &[(1, RIGHT), (3, RIGHT)]),
            incidence("strip", TOP, &[(2, TOP), (3, TOP)]),
            incidence("rung", 0, &[(0, 0)]),
            incidence("rung", 1, &[(1, 1)]),
        ],
        adjacencies: [
            ("strip", [(0, RIGHT), (1, LEFT)]),
            ("strip", [(2, RIGHT), (3, LEFT)]),
            ("strip", [(0, TOP), (2, BOTTOM)]),
            ("strip", [(1, TOP), (3, BOTTOM)]),
            ("rung", [(0, 1), (1, 0)]),
        ]
        .map(adjacency)
        .into(),
        relations: [0, 2].map(|child| Relation { state: WHOLE.into(), equal: [side([4, child]), side([child, 4])] }).into(),
        cells: vec![RootCell { state: "strip".into(), control_points: vec![Some(DVec4::W); 18] }],
        ..Bcifs::default()
    }
}

/// The strip with the operators that the solver finds.
fn solved() -> Result<Bcifs, String> {
    let solution = stated().solve(&BTreeMap::new(), &CancelToken::new()).map_err(|error| error.to_string())?;
    let mut model = solution.model;
    // What was needed to find the operators is no part of the shape.
    model.relations.clear();
    model.states.retain(|state| state.name != WHOLE);
    reduce(&mut model);
    Ok(model)
}

/// Edges and vertices that depend on several columns of control points draw curves of one column, and points: they are
/// replaced by these, so that surfaces of any kind can share them.
fn reduce(model: &mut Bcifs) {
    let cubic = [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0];
    let (quadratic, none) = ([0.5; 2], [0.0]);
    let columns = |weights: &[f64], count: usize| -> Rows {
        let row = |k: usize, weight: f64| (0..count).map(|j| if j == k { weight } else { 0.0 }).collect();
        (0..count).flat_map(|k| weights.iter().map(move |&weight| row(k, weight))).collect()
    };
    let column = |entries: &[f64]| -> Rows { entries.iter().map(|&entry| vec![entry]).collect() };
    let product = |weights: &[f64]| column(&weights.iter().flat_map(|a| weights.iter().map(move |b| a * b)).collect::<Vec<_>>());
    let changes = BTreeMap::from([
        ("cubic edge", columns(&cubic, 4)),
        ("cubic vertex", product(&cubic)),
        ("quadratic edge", columns(&quadratic, 3)),
        ("quadratic vertex", product(&quadratic)),
    ]);
    for state in model.states.iter_mut().filter(|state| !changes.contains_key(state.name.as_str())) {
        let links = state.transitions.iter_mut().map(|link| (&link.to, &mut link.operator));
        for (to, matrix) in links.chain(state.boundaries.iter_mut().map(|link| (&link.state, &mut link.incidence))) {
            if let Some(change) = changes.get(to.as_str()) {
                *matrix = times(matrix, change);
            }
        }
    }
    let ends = |name: &'static str, weights: &[f64]| -> Vec<(&str, Matrix)> {
        [[weights, &none].concat(), [&none, weights].concat()].map(|end| (name, given(&column(&end)))).into()
    };
    let cubics = CUBIC.iter().map(|half| ("cubic edge", given(&rows(half)))).collect();
    let quadratics = QUADRATIC.iter().map(|half| ("quadratic edge", given(&rows(half)))).collect();
    // Points have no children whose incidence could be stated; that of the rungs' ends is seen from their places.
    model.incidences.retain(|incidence| incidence.state != "rung");
    model.states.retain(|state| !changes.contains_key(state.name.as_str()));
    model.states.extend([
        state("cubic edge", CellKind::Edge, 4, cubics, ends("cubic vertex", &cubic)),
        state("cubic vertex", CellKind::Vertex, 1, Vec::new(), Vec::new()),
        state("quadratic edge", CellKind::Edge, 3, quadratics, ends("quadratic vertex", &quadratic)),
        state("quadratic vertex", CellKind::Vertex, 1, Vec::new(), Vec::new()),
    ]);
}

/// A product of a solved matrix.
fn times(matrix: &Matrix, other: &Rows) -> Matrix {
    let value = |entry: &Entry| if let Entry::Number(value) = entry { *value } else { f64::NAN };
    let entry = |row: &[Entry], j: usize| Entry::Number(row.iter().zip(other).map(|(entry, own)| value(entry) * own[j]).sum());
    Matrix { rows: matrix.rows.iter().map(|row| (0..other[0].len()).map(|j| entry(row, j)).collect()).collect() }
}

/// Adds the strip between two borders; returns its own borders, that along the first and that along the second.
pub(super) fn lower(chains: &[Chain; 2], limits: Limits<'_>, allowed: f64, place: &str, draft: &mut Draft) -> Option<[Chain; 2]> {
    let [left, right] = &super::shapes(chains, place, allowed, limits, draft)?;
    let count = chains[0].spans.len();
    let order = align(left, right, allowed);
    let own: Vec<Option<Net>> = (0..count).map(|k| beside(limits, draft, chains[0].spans[k], left.backwards[k])).collect();
    let other: Vec<Option<Net>> =
        order.iter().map(|&(k, turned)| beside(limits, draft, chains[1].spans[k], right.backwards[k] != turned)).collect();
    for (side, nets) in [(0, &own), (1, &other)] {
        let degree = |net: &Option<Net>| net.as_ref().map(|net| net.degree);
        if let Some(k) = nets.iter().position(|net| net.is_none() || degree(net) != degree(&nets[0])) {
            let message = format!(
                "{}: the patch at span {k} is not, as those beside it, bicubic or biquadratic; a strip needs regular patches along the border",
                chains[side].words
            );
            draft.error(&format!("{place}/between/{side}"), "join.strip-patch", message);
            return None;
        }
    }
    let (own, other): (Vec<Net>, Vec<Net>) = (own.into_iter().flatten().collect(), other.into_iter().flatten().collect());
    let (cubic, quadratic) = match (own[0].degree, other[0].degree) {
        (3, 2) => (&own, &other),
        (2, 3) => (&other, &own),
        (degree, _) => {
            let message =
                format!("both surfaces are of degree {degree} beside the border: a strip joins a bicubic and a biquadratic surface");
            draft.error(place, "join.strip-degrees", message);
            return None;
        }
    };
    let closed = left.closed && right.closed;
    for nets in [cubic, quadratic] {
        if let Some(k) = uneven(nets, closed, allowed) {
            let message = format!(
                "the control points of spans {k} and {} along the border do not agree: its knots are not uniform there; insert knots, or use uniform ones",
                (k + 1) % count
            );
            draft.error(place, "join.strip-knots", message);
            return None;
        }
    }
    let first = draft.roots.len();
    let mut model = match solved() {
        Ok(model) => model,
        Err(message) => {
            draft.error(place, "join.strip", message);
            return None;
        }
    };
    model.cells = cubic.iter().zip(quadratic).map(|(cubic, quadratic)| cell(cubic, quadratic)).collect();
    let next = (1..count).map(|k| (k - 1, k)).chain(closed.then_some((count - 1, 0)));
    model.glue = next.map(|(k, next)| Glue { between: [(k, TOP), (next, BOTTOM)], reversed: false, permutation: None }).collect();
    let inner = format!("{}{place}/strip", draft.place);
    let outer = std::mem::replace(&mut draft.place, inner);
    model.lower(draft);
    draft.place = outer;
    let sides = if own[0].degree == 3 { [LEFT, RIGHT] } else { [RIGHT, LEFT] };
    Some(sides.map(|side| Chain { spans: (0..count).map(|k| (first + k, side)).collect(), words: "the strip".into() }))
}

/// A cell of the strip: cubic columns from the inside out, then quadratic ones from the outside in.
fn cell(cubic: &Net, quadratic: &Net) -> RootCell {
    let columns = [2, 1, 0].iter().flat_map(|&i: &usize| &cubic.points[i]).chain([0, 1].iter().flat_map(|&i: &usize| &quadratic.points[i]));
    let point = |p: &[f64; 4]| Some((DVec3::new(p[0], p[1], p[2]) / p[3]).extend(p[3]));
    RootCell { state: "strip".into(), control_points: columns.map(point).collect() }
}

/// The first span whose control points are not, moved by one, those of the next.
fn uneven(nets: &[Net], closed: bool, allowed: f64) -> Option<usize> {
    let steps = if closed { nets.len() } else { nets.len() - 1 };
    let place = |p: &[f64; 4]| DVec3::new(p[0], p[1], p[2]) / p[3];
    let used = if nets[0].degree == 3 { 3 } else { 2 };
    (0..steps).find(|&k| {
        let next = &nets[(k + 1) % nets.len()];
        let pairs = nets[k].points.iter().take(used).zip(&next.points);
        let far = |(a, b): (&[f64; 4], &[f64; 4])| !(place(a).distance(place(b)) <= allowed && (a[3] - b[3]).abs() <= 1e-9 * a[3].abs());
        pairs.into_iter().any(|(own, next)| own[1..].iter().zip(next).any(far))
    })
}

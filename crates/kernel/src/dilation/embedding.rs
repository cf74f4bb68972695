//! How thin the pieces are into which the surface cuts a tetrahedron of the lattice, measured on all mixed cases, and
//! what that says of rounding.
//!
//! Vertices moved by at most delta leave a tetrahedron positively oriented if no plane is within delta of all four of
//! them: if its *width*, the least distance of two parallel planes that enclose it, exceeds 2 delta. The width is the
//! least of the four heights and of the three distances between lines through opposite edges.
//!
//! Measured: with t the clamp, widths are at least 0.79 t^2 times the shortest edge, of *second* order in t. The least
//! is attained by two vertices u, v inside, two w, x outside, all edges cut at t but u x at 1 - t: w is within about
//! t^2 of the plane through the cuts at v and that at x. So delta < 0.34 t^2 a keeps the surface embedded, and a
//! displacement of first order, t a / 14, does not.
//!
//! The complex that is moved must be conforming: faces of the lattice are cut by a rule of the face alone, the
//! surface's quadrilaterals by their shorter diagonal.

use super::lattice::{CUTS, EDGE_ENDS, LatticeVertex, Tetrahedron, tetrahedra};
use glam::DVec3;
use std::collections::BTreeMap;

/// Length of the lattice's shortest edges, in units of a.
const SHORTEST: f64 = 0.866_025_403_784_438_6;

fn position(vertex: LatticeVertex) -> DVec3 {
    DVec3::from_array(vertex.offset.map(f64::from)) + DVec3::splat(if vertex.centre { 0.5 } else { 0.0 })
}

/// (height, width): the least height, and the least of the heights and of the distances of opposite edges' lines.
fn widths([a, b, c, d]: [DVec3; 4]) -> (f64, f64) {
    let six = (b - a).dot((c - a).cross(d - a)).abs();
    let faces = [[a, b, c], [a, b, d], [a, c, d], [b, c, d]];
    let height = faces.iter().map(|[p, q, r]| six / (*q - *p).cross(*r - *p).length()).fold(f64::INFINITY, f64::min);
    let pairs = [[b - a, d - c], [c - a, d - b], [d - a, c - b]];
    let apart = pairs.iter().map(|[e, f]| six / e.cross(*f).length()).fold(f64::INFINITY, f64::min);
    (height, height.min(apart))
}

/// A triangulation of a prism whose lateral edges join `bottom[k]` and `top[k]`. `down(i, j)` tells whether the
/// diagonal of the side over bottom corners i and j leaves bottom corner i. Where the diagonals run in a circle no
/// triangulation exists without a further point: the middle is joined to the boundary.
fn prism(bottom: [DVec3; 3], top: [DVec3; 3], down: impl Fn(usize, usize) -> bool) -> Vec<[DVec3; 4]> {
    let wins = |i: usize| (0..3).filter(|&j| j != i && down(i, j)).count();
    let order = [2, 1, 0].map(|count| (0..3).find(|&i| wins(i) == count));
    if let [Some(i), Some(j), Some(k)] = order {
        return vec![
            [bottom[i], bottom[j], bottom[k], top[k]],
            [bottom[i], bottom[j], top[j], top[k]],
            [bottom[i], top[i], top[j], top[k]],
        ];
    }
    let middle = (bottom.iter().sum::<DVec3>() + top.iter().sum::<DVec3>()) / 6.0;
    let mut list = vec![[middle, bottom[0], bottom[1], bottom[2]], [middle, top[0], top[1], top[2]]];
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let (i, j) = if down(i, j) { (i, j) } else { (j, i) };
        list.push([middle, bottom[i], bottom[j], top[j]]);
        list.push([middle, bottom[i], top[i], top[j]]);
    }
    list
}

/// The sub-tetrahedra of both parts for the vertices in `inside`, cut at share `at[e]` of edge e, from the edge's
/// inside end.
fn parts(tetrahedron: &Tetrahedron, inside: usize, at: &[f64; 6]) -> Vec<[DVec3; 4]> {
    let mut order = [0, 1, 2, 3];
    order.sort_by_key(|&v| (tetrahedron.vertices[v].centre, tetrahedron.vertices[v].offset));
    let corner = |v: usize| position(tetrahedron.vertices[v]);
    let is_in = |v: usize| inside >> v & 1 == 1;
    let share = |u: usize, v: usize| at[EDGE_ENDS.iter().position(|&ends| ends == (u.min(v), u.max(v))).expect("an edge")];
    let cut = |u: usize, v: usize| {
        let (from, to) = if is_in(u) { (u, v) } else { (v, u) };
        corner(from).lerp(corner(to), share(u, v))
    };
    let rank = |v: usize| order.iter().position(|&w| w == v);
    // In the face of two corners p, q on one side and `apex` on the other: the diagonal leaves the corner whose cut
    // is nearer to the apex. A rule of the face alone.
    let leaves = |p: usize, q: usize, apex: usize| {
        let from_apex = |v: usize| if is_in(apex) { share(v, apex) } else { 1.0 - share(v, apex) };
        (from_apex(p), rank(p)) < (from_apex(q), rank(q))
    };
    let side = |wanted: bool| -> Vec<usize> { order.iter().copied().filter(|&v| is_in(v) == wanted).collect() };
    let (own, other) = (side(true), side(false));
    let mut list = Vec::new();
    if let ([apex], [a, b, c]) | ([a, b, c], [apex]) = (own.as_slice(), other.as_slice()) {
        let base = [*a, *b, *c];
        let top = base.map(|v| cut(*apex, v));
        list.push([corner(*apex), top[0], top[1], top[2]]);
        list.extend(prism(base.map(corner), top, |i, j| leaves(base[i], base[j], *apex)));
        return list;
    }
    // The surface's diagonal, as `block` chooses it: by the corners' order in CUTS.
    let ends: Vec<(usize, usize)> = CUTS[inside].iter().map(|&edge| EDGE_ENDS[edge]).collect();
    let quadrilateral: Vec<DVec3> = ends.iter().map(|&(p, q)| cut(p, q)).collect();
    let first = quadrilateral[0].distance_squared(quadrilateral[2]) <= quadrilateral[1].distance_squared(quadrilateral[3]);
    let diagonal = if first { (ends[0], ends[2]) } else { (ends[1], ends[3]) };
    for (near, far) in [(&own, &other), (&other, &own)] {
        // The part of `near` is a prism with the lateral edges u v, (u w)(v w) and (u x)(v x); the surface's diagonal
        // joins cut (u w) to cut (v x).
        let (u, v) = (near[0], near[1]);
        let at_u = if [diagonal.0.0, diagonal.0.1].contains(&u) { diagonal.0 } else { diagonal.1 };
        let w = if at_u.0 == u { at_u.1 } else { at_u.0 };
        let x = if far[0] == w { far[1] } else { far[0] };
        let down = |i: usize, j: usize| match (i, j) {
            (0, 1) => leaves(u, v, w),
            (1, 0) => !leaves(u, v, w),
            (0, 2) => leaves(u, v, x),
            (2, 0) => !leaves(u, v, x),
            (i, j) => i < j,
        };
        list.extend(prism([corner(u), cut(u, w), cut(u, x)], [corner(v), cut(v, w), cut(v, x)], down));
    }
    list
}

/// Least (height, width) over all cases, in units of t times the shortest edge.
fn least(t: f64, random: usize) -> (f64, f64) {
    let mut seed = 7_u64;
    let mut uniform = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / f64::from(1_u32 << 31)
    };
    let mut best = (f64::INFINITY, f64::INFINITY);
    for tetrahedron in tetrahedra() {
        let volume: f64 = 1.0 / 12.0;
        for inside in 1..15 {
            let mut visit = |at: &[f64; 6]| {
                let mut sum = 0.0;
                for piece in parts(&tetrahedron, inside, at) {
                    let (height, width) = widths(piece);
                    let [a, b, c, d] = piece;
                    sum += (b - a).dot((c - a).cross(d - a)).abs() / 6.0;
                    best = (best.0.min(height), best.1.min(width));
                }
                assert!((sum - volume).abs() < 1e-12, "the pieces of case {inside} fill the tetrahedron: {sum}");
            };
            for code in 0..729_usize {
                let mut rest = code;
                let at = std::array::from_fn(|_| {
                    let share = [t, 0.5, 1.0 - t][rest % 3];
                    rest /= 3;
                    share
                });
                visit(&at);
            }
            for _ in 0..random {
                // Half of the shares close to the ends, where the pieces are thin.
                let at = std::array::from_fn(|_| {
                    let (where_to, share) = (uniform(), t + (1.0 - 2.0 * t) * uniform());
                    if where_to < 0.25 {
                        t + (share - t) * t * 4.0
                    } else if where_to < 0.5 {
                        1.0 - t - (share - t) * t * 4.0
                    } else {
                        share
                    }
                });
                visit(&at);
            }
        }
    }
    (best.0 / (t * SHORTEST), best.1 / (t * SHORTEST))
}

#[test]
fn widths_are_of_second_order_in_the_clamp() {
    for t in [super::LEAST_CLAMP, 1.0 / 128.0, super::MOST_CLAMP] {
        let (height, width) = least(t, 1000);
        assert!(width > 0.79 * t && width <= height && height < 0.9 * t, "t {t}: heights {height} t, widths {width} t");
    }
}

/// The surface triangles of 2 x 2 x 2 cubes, with vertices displaced by up to `delta` in every coordinate.
fn patch(t: f64, delta: f64, uniform: &mut impl FnMut() -> f64) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let mut labels: BTreeMap<(bool, [u8; 3]), bool> = BTreeMap::new();
    let mut cuts: BTreeMap<([u8; 3], u8), usize> = BTreeMap::new();
    let (mut exact, mut moved, mut triangles) = (Vec::<DVec3>::new(), Vec::new(), Vec::new());
    for code in 0..8_u8 {
        let cube = [code & 1, code >> 1 & 1, code >> 2 & 1];
        let placed = |offset: [u8; 3]| -> [u8; 3] { std::array::from_fn(|axis| cube[axis] + offset[axis]) };
        for tetrahedron in tetrahedra() {
            let vertices = tetrahedron.vertices.map(|v| LatticeVertex { centre: v.centre, offset: placed(v.offset) });
            let inside = vertices.map(|v| *labels.entry((v.centre, v.offset)).or_insert_with(|| uniform() < 0.5));
            let case = (0..4).fold(0, |bits, v| bits | usize::from(inside[v]) << v);
            let corners: Vec<usize> = CUTS[case]
                .iter()
                .map(|&edge| {
                    let name = (placed(tetrahedron.edges[edge].offset), tetrahedron.edges[edge].number);
                    *cuts.entry(name).or_insert_with(|| {
                        let share = [t, 1.0 - t, t + (1.0 - 2.0 * t) * uniform()][(uniform() * 3.0) as usize];
                        let (p, q) = EDGE_ENDS[edge];
                        let point = position(vertices[p]).lerp(position(vertices[q]), share);
                        exact.push(point);
                        // The corners of the cube are the worst that rounding does.
                        let mut shift = || if uniform() < 0.5 { -delta } else { delta };
                        moved.push(point + DVec3::new(shift(), shift(), shift()));
                        exact.len() - 1
                    })
                })
                .collect();
            match corners.as_slice() {
                [a, b, c] => triangles.push([*a, *b, *c]),
                [a, b, c, d] if exact[*a].distance_squared(exact[*c]) <= exact[*b].distance_squared(exact[*d]) => {
                    triangles.extend([[*a, *b, *c], [*a, *c, *d]]);
                }
                [a, b, c, d] => triangles.extend([[*b, *c, *d], [*b, *d, *a]]),
                _ => {}
            }
        }
    }
    (moved, triangles)
}

/// Whether the segment pq passes through the interior of the triangle.
fn pierces(p: DVec3, q: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let six = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).dot((c - a).cross(d - a));
    let sides = [six(p, q, a, b), six(p, q, b, c), six(p, q, c, a)];
    six(a, b, c, p) * six(a, b, c, q) < 0.0 && (sides.iter().all(|&x| x > 0.0) || sides.iter().all(|&x| x < 0.0))
}

/// Crossings among triangles of random patches: every edge against every triangle with which it shares no corner.
fn crossings(t: f64, delta: f64, patches: usize) -> usize {
    let mut seed = 9_u64;
    let mut uniform = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / f64::from(1_u32 << 31)
    };
    let mut count = 0;
    for _ in 0..patches {
        let (vertices, triangles) = patch(t, delta, &mut uniform);
        let boxes: Vec<(DVec3, DVec3)> = triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|k| vertices[k]);
                (a.min(b).min(c), a.max(b).max(c))
            })
            .collect();
        for (i, own) in triangles.iter().enumerate() {
            for (j, other) in triangles.iter().enumerate() {
                if i == j || boxes[i].0.cmpgt(boxes[j].1).any() || boxes[j].0.cmpgt(boxes[i].1).any() {
                    continue;
                }
                for k in 0..3 {
                    let (p, q) = (own[k], own[(k + 1) % 3]);
                    if !other.contains(&p) && !other.contains(&q) {
                        count += usize::from(pierces(vertices[p], vertices[q], other.map(|k| vertices[k])));
                    }
                }
            }
        }
    }
    count
}

/// Within the bound that widths give no triangles cross; at a displacement of first order they do.
#[test]
fn displacements_within_the_width_make_no_crossing() {
    for t in [super::LEAST_CLAMP, super::MOST_CLAMP] {
        // Along each axis; the length of the whole displacement is sqrt(3) times that.
        let found = crossings(t, 0.34 * t * t / 3.0_f64.sqrt(), 150);
        assert_eq!(found, 0, "t {t}: {found} crossings");
        assert!(crossings(t, t / 14.0 / 3.0_f64.sqrt(), 300) > 0, "t {t}");
    }
}

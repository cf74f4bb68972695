//! Self-intersections, on constructed cases and against separating axes in integers.

use glam::DVec3;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::solid::{Crossings, TriMesh};

fn count(points: &[[i64; 3]], triangles: &[[u32; 3]]) -> u64 {
    let vertices = points.iter().map(|p| DVec3::new(p[0] as f64, p[1] as f64, p[2] as f64)).collect();
    Crossings::of(&TriMesh { vertices, triangles: triangles.to_vec() }, &Budget::default()).expect("not stopped").count
}

#[test]
fn constructed_cases() {
    let base = [[0, 0, 0], [4, 0, 0], [0, 4, 0]];
    let with = |others: &[[i64; 3]]| -> Vec<[i64; 3]> { base.iter().chain(others).copied().collect() };
    let apart = [[0, 1, 2], [3, 4, 5]];
    for (others, wanted, name) in [
        ([[1, 1, -1], [1, 1, 1], [5, 5, 1]], 1, "pierced"),
        ([[1, 1, 1], [1, 2, 3], [5, 5, 1]], 0, "above"),
        ([[1, 1, 0], [1, 2, 3], [5, 5, 1]], 1, "a corner on the face"),
        ([[2, 0, 0], [2, -2, 3], [5, -5, 1]], 1, "a corner on an edge"),
        ([[4, 0, 0], [8, 0, 3], [5, -5, 1]], 1, "another corner at the same place"),
        ([[1, 1, 0], [2, 1, 0], [1, 2, 0]], 1, "inside in the plane"),
        ([[-1, 1, 0], [9, 1, 0], [9, 2, 0]], 1, "across in the plane"),
        ([[9, 1, 0], [12, 1, 0], [9, 2, 0]], 0, "beside in the plane"),
        ([[-4, 0, 0], [8, 0, 0], [0, -4, 0]], 1, "along an edge in the plane"),
        ([[1, 0, -1], [1, 0, 1], [1, -3, 0]], 1, "an edge through an edge"),
    ] {
        assert_eq!(count(&with(&others), &apart), wanted, "{name}");
    }
    for (others, triangle, wanted, name) in [
        (vec![[0, 0, 4]], [1, 0, 3], 0, "a fold at an edge"),
        (vec![[0, -4, 0]], [1, 0, 3], 0, "flat across an edge"),
        (vec![[1, 1, 0]], [1, 0, 3], 1, "folded over an edge in the plane"),
        (vec![[-1, -1, 1], [-2, -1, 0]], [0, 3, 4], 0, "a corner shared"),
        (vec![[4, 4, 1], [4, 4, -1]], [0, 3, 4], 1, "a corner shared and a cut from it"),
        (vec![[4, 0, 2], [2, 2, -2]], [0, 3, 4], 1, "a corner shared, an edge pierced"),
        (vec![[1, 1, 0], [2, 1, 0]], [0, 3, 4], 1, "a corner shared, overlapping in the plane"),
        (vec![[-1, -1, 0], [-2, -1, 0]], [0, 3, 4], 0, "a corner shared, opposite in the plane"),
        (vec![[8, 0, 0], [8, -1, 0]], [0, 3, 4], 1, "a corner shared, along an edge"),
        (vec![], [0, 2, 1], 1, "twice the same"),
    ] {
        assert_eq!(count(&with(&others), &[[0, 1, 2], triangle]), wanted, "{name}");
    }
    assert_eq!(count(&[[0, 0, 0], [1, 1, 1], [2, 2, 2]], &[[0, 1, 2]]), 1, "without area");
}

fn minus(a: [i64; 3], b: [i64; 3]) -> [i64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [i64; 3], b: [i64; 3]) -> [i64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Two triangles are apart if and only if the origin is outside a facet of their Minkowski difference: its normals are those of the triangles,
/// products of edges, and for triangles in one plane the edges' normals in it.
fn are_apart(p: &[[i64; 3]; 3], q: &[[i64; 3]; 3]) -> bool {
    let edges = |t: &[[i64; 3]; 3]| [minus(t[1], t[0]), minus(t[2], t[1]), minus(t[0], t[2])];
    let (e, f) = (edges(p), edges(q));
    let (m, n) = (cross(e[0], e[1]), cross(f[0], f[1]));
    let mut axes = vec![m, n];
    axes.extend(e.iter().flat_map(|&a| f.iter().map(move |&b| cross(a, b))));
    axes.extend(e.iter().map(|&a| cross(m, a)));
    axes.extend(f.iter().map(|&b| cross(n, b)));
    axes.iter().any(|axis| {
        let along = |x: &[i64; 3]| axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2];
        let (first, second): (Vec<i64>, Vec<i64>) = (p.iter().map(along).collect(), q.iter().map(along).collect());
        first.iter().max() < second.iter().min() || second.iter().max() < first.iter().min()
    })
}

/// Triangles on a small grid: most pairs are degenerate in some way.
#[test]
fn triangles_on_a_grid() {
    let mut state = 5_u64;
    let mut next = |size: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % size) as i64
    };
    for (size, triangles) in [(3, 40), (5, 80), (12, 150), (60, 300)] {
        for _ in 0..10 {
            let mut soup: Vec<[[i64; 3]; 3]> = Vec::new();
            while soup.len() < triangles {
                let triangle: [[i64; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| next(size)));
                if cross(minus(triangle[1], triangle[0]), minus(triangle[2], triangle[0])) != [0; 3] {
                    soup.push(triangle);
                }
            }
            let wanted = (0..soup.len()).flat_map(|i| (0..i).map(move |j| (i, j))).filter(|&(i, j)| !are_apart(&soup[i], &soup[j])).count();
            let points: Vec<[i64; 3]> = soup.iter().flatten().copied().collect();
            let corners: Vec<[u32; 3]> = (0..soup.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            assert_eq!(count(&points, &corners), wanted as u64);
        }
    }
}

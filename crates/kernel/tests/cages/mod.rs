//! Cages for tests of subdivision surfaces.
#![allow(dead_code)]

use glam::DVec3;
use lacuna_kernel::attractor::{Attractor, refine};
use lacuna_kernel::automaton::{LeafPrimitive, StateId};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::model::{BoundaryRule, Model, Scheme, Shape, Subdivision};
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::Tolerance;

pub fn cage(scheme: Scheme, vertices: Vec<DVec3>, faces: Vec<Vec<u32>>) -> Subdivision {
    Subdivision {
        scheme,
        vertices,
        faces,
        creases: Vec::new(),
        corners: Vec::new(),
        boundary: BoundaryRule::Smooth,
        coefficients: Vec::new(),
    }
}

pub fn model(surface: Subdivision) -> Model {
    Model { name: None, shape: Shape::Subdivision(surface) }
}

pub fn attractor(surface: Subdivision) -> Attractor {
    model(surface).lower().unwrap_or_else(|findings| panic!("{findings:?}")).attractor
}

pub fn evaluated(attractor: &Attractor, tolerance: f64) -> Tessellation {
    refine(attractor, Tolerance::new(tolerance).expect("positive"), &Budget::default()).expect("refines")
}

/// [-1, 1]^3.
pub fn cube(scheme: Scheme) -> Subdivision {
    let vertices = (0..8).map(|k| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) * 2.0 - 1.0).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces: Vec<Vec<u32>> = faces.iter().map(|face| face.to_vec()).collect();
    cage(scheme, vertices, if scheme == Scheme::Loop { triangulated(&faces) } else { faces })
}

/// Case 54's.
pub fn tetrahedron(scheme: Scheme) -> Subdivision {
    let vertices = vec![DVec3::new(-1.0, -1.0, 1.0), DVec3::new(1.0, -1.0, -1.0), DVec3::new(1.0, 1.0, 1.0), DVec3::new(-1.0, 1.0, -1.0)];
    cage(scheme, vertices, vec![vec![0, 1, 2], vec![0, 2, 3], vec![0, 3, 1], vec![1, 3, 2]])
}

pub fn triangulated(faces: &[Vec<u32>]) -> Vec<Vec<u32>> {
    faces.iter().flat_map(|face| (1..face.len() - 1).map(|k| vec![face[0], face[k], face[k + 1]]).collect::<Vec<_>>()).collect()
}

/// n x m quads round a torus; triangles for Loop.
pub fn torus(scheme: Scheme, n: u32, m: u32) -> Subdivision {
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for i in 0..n {
        for k in 0..m {
            let (a, b) = (f64::from(i) * std::f64::consts::TAU / f64::from(n), f64::from(k) * std::f64::consts::TAU / f64::from(m));
            vertices.push(DVec3::new((30.0 + 10.0 * b.cos()) * a.cos(), (30.0 + 10.0 * b.cos()) * a.sin(), 10.0 * b.sin()));
            let at = |i: u32, k: u32| (i % n) * m + k % m;
            faces.push(vec![at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)]);
        }
    }
    cage(scheme, vertices, if scheme == Scheme::Loop { triangulated(&faces) } else { faces })
}

/// An n x m grid of quads, with heights.
pub fn grid(scheme: Scheme, n: u32, m: u32, height: impl Fn(f64, f64) -> f64) -> Subdivision {
    let vertices = (0..(n + 1) * (m + 1)).map(|v| {
        let (x, y) = (f64::from(v / (m + 1)), f64::from(v % (m + 1)));
        DVec3::new(x, y, height(x, y))
    });
    let at = |i: u32, k: u32| i * (m + 1) + k;
    let quads = (0..n).flat_map(|i| (0..m).map(move |k| (i, k)));
    let faces: Vec<Vec<u32>> = quads.map(|(i, k)| vec![at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)]).collect();
    cage(scheme, vertices.collect(), if scheme == Scheme::Loop { triangulated(&faces) } else { faces })
}

/// A torus of n x m quads, in which every `period`-th face has a smaller one inset: eight extraordinary vertices each.
pub fn inset_torus(n: u32, m: u32, period: usize) -> Subdivision {
    let mut surface = torus(Scheme::CatmullClark, n, m);
    let faces = std::mem::take(&mut surface.faces);
    for (index, face) in faces.into_iter().enumerate() {
        if index % period != 0 {
            surface.faces.push(face);
            continue;
        }
        let first = surface.vertices.len() as u32;
        let at = |k: usize| surface.vertices[face[k % 4] as usize];
        let centre = (0..4).map(at).sum::<DVec3>() * 0.25;
        let inner: Vec<DVec3> = (0..4).map(|k| centre + (at(k) - centre) * 0.5).collect();
        surface.vertices.extend(inner);
        surface.faces.push((first..first + 4).collect());
        surface.faces.extend((0..4).map(|k| vec![face[k], face[(k + 1) % 4], first + (k as u32 + 1) % 4, first + k as u32]));
    }
    surface
}

/// The corners of all patches at a depth: points of the limit surface.
pub fn patches(attractor: &Attractor, depth: usize) -> Vec<Vec<DVec3>> {
    fn descend(attractor: &Attractor, id: StateId, points: &[DVec3], depth: usize, out: &mut Vec<Vec<DVec3>>) {
        let state = attractor.automaton().state(id);
        let combine = |weights: &[f64]| points.iter().zip(weights).map(|(p, w)| *p * *w).sum::<DVec3>();
        if depth == 0 {
            let LeafPrimitive::Polygon(corners) = &state.leaf else { panic!("a patch is a polygon: {state:?}") };
            out.push(corners.iter().map(|corner| combine(corner)).collect());
            return;
        }
        for transition in &state.transitions {
            let child: Vec<DVec3> = (0..transition.operator.columns()).map(|j| combine(transition.operator.column(j))).collect();
            descend(attractor, transition.to, &child, depth - 1, out);
        }
    }
    let mut out = Vec::new();
    for root in attractor.roots() {
        let points: Vec<DVec3> = root.points.iter().map(|p| DVec3::new(p[0], p[1], p[2])).collect();
        descend(attractor, root.state, &points, depth, &mut out);
    }
    out
}

/// Volume by the divergence theorem on the bilinear patches, extrapolated from three depths: the error of smooth
/// surfaces is a power series in 4^-depth.
pub fn volume(attractor: &Attractor, depth: usize) -> f64 {
    let at = |depth: usize| -> f64 {
        let triangle = |a: DVec3, b: DVec3, c: DVec3| a.dot(b.cross(c)) / 6.0;
        patches(attractor, depth)
            .iter()
            .map(|p| match p.as_slice() {
                [a, b, c] => triangle(*a, *b, *c),
                [a, b, c, d] => 0.5 * (triangle(*a, *b, *c) + triangle(*a, *c, *d) + triangle(*a, *b, *d) + triangle(*b, *c, *d)),
                _ => panic!("triangles and quads"),
            })
            .sum()
    };
    let (a, b, c) = (at(depth - 2), at(depth - 1), at(depth));
    let (d, e) = ((4.0 * b - a) / 3.0, (4.0 * c - b) / 3.0);
    (16.0 * e - d) / 15.0
}

/// The surface of a set of unit cells, as quads seen from outside, with vertices where it meets itself doubled never:
/// the cells must not touch along edges or at corners alone.
pub fn polycube(size: [i32; 3], filled: impl Fn(i32, i32, i32) -> bool) -> Subdivision {
    let inside = |c: [i32; 3]| (0..3).all(|axis| c[axis] >= 0 && c[axis] < size[axis]) && filled(c[0], c[1], c[2]);
    let mut known = std::collections::BTreeMap::new();
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let cells = (0..size[0]).flat_map(|x| (0..size[1]).flat_map(move |y| (0..size[2]).map(move |z| [x, y, z])));
    for cell in cells.filter(|&cell| inside(cell)) {
        for (axis, step) in (0..3).flat_map(|axis| [(axis, 1), (axis, -1)]) {
            let mut beside = cell;
            beside[axis] += step;
            if inside(beside) {
                continue;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[i, k]| {
                let mut corner = cell;
                corner[axis] += i32::from(step == 1);
                corner[u] += i;
                corner[v] += k;
                corner
            });
            if step == -1 {
                corners.reverse();
            }
            faces.push(
                corners
                    .iter()
                    .map(|&corner| {
                        *known.entry(corner).or_insert_with(|| {
                            vertices.push(DVec3::new(f64::from(corner[0]), f64::from(corner[1]), f64::from(corner[2])));
                            vertices.len() as u32 - 1
                        })
                    })
                    .collect(),
            );
        }
    }
    cage(Scheme::CatmullClark, vertices, faces)
}

/// A head of unit cells with ears, muzzle and two tunnels for eyes: 468 quads of genus 2.
pub fn head() -> Subdivision {
    polycube([12, 8, 8], |x, y, z| {
        let (x, y) = (x - 2, y - 2);
        let within = |a: i32, low: i32, high: i32| a >= low && a < high;
        let tunnel = within(y, 0, 6) && within(z, 5, 7) && (within(x, 1, 3) || within(x, 5, 7));
        let skull = within(x, 0, 8) && within(y, 0, 6);
        let ears = (within(x, -2, 0) || within(x, 8, 10)) && within(y, 2, 4) && within(z, 3, 6);
        let muzzle = within(x, 2, 6) && within(y, -2, 0) && within(z, 0, 3);
        !tunnel && (skull || ears || muzzle)
    })
}

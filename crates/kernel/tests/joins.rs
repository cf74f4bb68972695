//! Parts joined along borders. Expected values: Euler numbers of unions, B-splines in closed form, polynomials.

use crate::agreement::agreed;
use crate::schemes::*;
use glam::DVec3;
use lacuna_kernel::model::{
    Border, BorderPath, BoundaryRule, ControlNet, CurveScheme, Finding, Group, Join, Part, Scheme, Shape, Subdivision,
};
use lacuna_kernel::tessellation::Tessellation;

/// A uniform spline surface; `points[i][j]`.
fn uniform(degree: usize, points: &[Vec<DVec3>]) -> Shape {
    let knots = |count: usize| (0..count + degree + 1).map(|k| k as f64).collect();
    let size = vec![points.len(), points[0].len()];
    let schemes = size.iter().map(|&count| CurveScheme::Nurbs { degree, knots: knots(count) }).collect();
    product(schemes, ControlNet { size, points: points.concat(), weights: None })
}

fn cage(scheme: Scheme, vertices: Vec<DVec3>, faces: Vec<Vec<u32>>) -> Shape {
    let (creases, corners, coefficients) = (Vec::new(), Vec::new(), Vec::new());
    Shape::Subdivision(Subdivision { scheme, vertices, faces, creases, corners, boundary: BoundaryRule::Smooth, coefficients })
}

fn side(part: usize, direction: usize, last: bool) -> Border {
    Border { part, path: BorderPath::Side { direction, last } }
}

fn vertices(part: usize, list: impl IntoIterator<Item = u32>) -> Border {
    Border { part, path: BorderPath::Vertices(list.into_iter().collect()) }
}

fn join(between: [Border; 2]) -> Join {
    Join { between, strip: false }
}

fn group(shapes: Vec<Shape>, joins: Vec<Join>) -> Shape {
    let parts = shapes.into_iter().map(|shape| Part { name: None, transform: None, shape, radius: None }).collect();
    Shape::Group(Group { parts, joins })
}

fn assert_only(findings: &[Finding], code: &str, pointer: &str) {
    assert_eq!(
        findings.iter().map(|finding| (finding.code, finding.pointer.as_str())).collect::<Vec<_>>(),
        [(code, pointer)],
        "{findings:?}"
    );
}

/// The uniform B-spline of degree 2 or 3 with these control points, at t in [0, number of spans].
fn spline(degree: usize, points: &[DVec3], t: f64) -> DVec3 {
    let first = (t.floor() as usize).min(points.len() - degree - 1);
    let (t, s) = (t - first as f64, 1.0 - (t - first as f64));
    let weights = if degree == 2 {
        vec![s * s / 2.0, (1.0 + 2.0 * t * s) / 2.0, t * t / 2.0]
    } else {
        [s * s * s, 3.0 * t * t * t - 6.0 * t * t + 4.0, 3.0 * s * s * s - 6.0 * s * s + 4.0, t * t * t].map(|x| x / 6.0).to_vec()
    };
    weights.into_iter().zip(&points[first..]).map(|(weight, &point)| weight * point).sum()
}

fn holds(tessellation: &Tessellation, point: DVec3) -> usize {
    tessellation.vertices.iter().filter(|vertex| vertex.distance(point) <= 1e-12 * point.length().max(1.0)).count()
}

/// A tube of rings of eight points, radius and height from ring to ring; the last ring first in `u` if reversed.
fn rings(list: &[(f64, f64)], turn: f64) -> Vec<Vec<DVec3>> {
    let point = |&(radius, z): &(f64, f64), k: usize| {
        let angle = turn + k as f64 * std::f64::consts::FRAC_PI_4;
        DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
    };
    list.iter().map(|ring| (0..8).map(|k| point(ring, k)).collect()).collect()
}

/// Each ring closed by its first `degree` points.
fn wrapped(rings: &[Vec<DVec3>], degree: usize) -> Vec<Vec<DVec3>> {
    rings.iter().map(|ring| ring.iter().chain(&ring[..degree]).copied().collect()).collect()
}

/// A cage of rings: quads between them, one polygon that closes the last when `capped`.
fn tube(scheme: Scheme, rings: &[Vec<DVec3>], capped: bool, flipped: bool) -> Shape {
    let quad = |i: u32, k: u32| [(i, k), (i, k + 1), (i + 1, k + 1), (i + 1, k)].map(|(i, k)| 8 * i + k % 8).to_vec();
    let count = rings.len() as u32;
    let mut faces: Vec<Vec<u32>> = (0..count - 1).flat_map(|i| (0..8).map(move |k| quad(i, k))).collect();
    if capped {
        faces.push((0..8).map(|k| 8 * (count - 1) + k).collect());
    }
    if flipped {
        faces.iter_mut().for_each(|face| face.reverse());
    }
    cage(scheme, rings.concat(), faces)
}

/// The border polygon of a cubic tube at its last ring: what a Catmull-Clark cage's border must be.
fn end(rings: &[Vec<DVec3>]) -> Vec<DVec3> {
    let [.., a, b, c] = rings else { panic!("three rings") };
    (0..8).map(|k| (a[k] + 4.0 * b[k] + c[k]) / 6.0).collect()
}

#[test]
fn a_spline_tube_is_closed_by_a_subdivision_cap() {
    let cubic = rings(&[(9.0, 0.0), (9.0, 4.0), (10.0, 8.0), (9.0, 12.0)], 0.0);
    for (start, backwards, flipped) in [(0, false, false), (3, false, true), (5, true, false), (7, true, true)] {
        let mut border = end(&cubic);
        border.rotate_left(start);
        if backwards {
            border.reverse();
        }
        let next: Vec<DVec3> = border.iter().map(|p| DVec3::new(0.6 * p.x, 0.6 * p.y, p.z + 6.0)).collect();
        let cap = tube(Scheme::CatmullClark, &[border.clone(), next], true, flipped);
        let loop_ = vertices(1, (0..8).chain([0]));
        let shape = group(vec![uniform(3, &wrapped(&cubic, 3)), cap], vec![join([side(0, 0, true), loop_])]);
        let lowered = lower(shape);
        for tolerance in [3.0, 1.0] {
            let tessellation = evaluated(&lowered.attractor, tolerance);
            assert_eq!(agreed(&tessellation), (1, 1, 1), "a disc, at {tolerance}");
            // Points of the seam exist once; where they are is the cubic B-spline of the border polygon.
            let polygon: Vec<DVec3> = end(&cubic).into_iter().cycle().take(11).collect();
            for k in 0..8 {
                assert_eq!(holds(&tessellation, spline(3, &polygon, f64::from(k))), 1);
            }
        }
    }
}

/// The product of splines on any knots.
fn spline_surface(degrees: [usize; 2], knots: [Vec<f64>; 2], points: &[Vec<DVec3>]) -> Shape {
    let schemes = degrees.into_iter().zip(knots).map(|(degree, knots)| CurveScheme::Nurbs { degree, knots }).collect();
    product(schemes, ControlNet { size: vec![points.len(), points[0].len()], points: points.concat(), weights: None })
}

/// A grid of `width` x `height` quads whose first column of vertices is given; vertex (i, k) is i (height + 1) + k.
fn sheet(border: &[DVec3], width: u32, step: DVec3) -> Shape {
    let rows = border.len() as u32;
    let point = |(i, k): (u32, usize)| border[k] + f64::from(i) * step + DVec3::new(0.0, 0.0, 0.3 * f64::from(i * i) * (k % 2) as f64);
    let points = (0..=width).flat_map(|i| (0..border.len()).map(move |k| (i, k))).map(point).collect();
    let quad = |(i, k): (u32, u32)| vec![i * rows + k, (i + 1) * rows + k, (i + 1) * rows + k + 1, i * rows + k + 1];
    cage(Scheme::CatmullClark, points, (0..width).flat_map(|i| (0..rows - 1).map(move |k| (i, k))).map(quad).collect())
}

/// Points of uneven columns.
fn net(random: &mut Random, columns: usize, rows: usize) -> Vec<Vec<DVec3>> {
    let mut point = |i: usize, k: usize| DVec3::new(8.0 * i as f64, 8.0 * k as f64, random.between(-3.0, 3.0));
    (0..columns).map(|i| (0..rows).map(|k| point(i, k)).collect()).collect()
}

#[test]
fn part_of_a_border_is_joined_and_the_rest_stays_open() {
    let mut random = Random(4);
    for reversed in [false, true] {
        let points = net(&mut random, 4, 6);
        // The cage's border goes on at both ends; its three middle spans are the surface's.
        let border: Vec<DVec3> = (0..6).map(|k| (points[1][k] + 4.0 * points[2][k] + points[3][k]) / 6.0).collect();
        let cage = sheet(&border, 2, DVec3::new(6.0, 0.0, 0.0));
        let points: Vec<Vec<DVec3>> = points.into_iter().map(|row| if reversed { row.into_iter().rev().collect() } else { row }).collect();
        let shape = group(vec![uniform(3, &points), cage], vec![join([vertices(1, [1, 2, 3, 4]), side(0, 0, true)])]);
        let tessellation = evaluated(&lower(shape).attractor, 1.0);
        assert_eq!(agreed(&tessellation), (1, 1, 1));
        for k in 0..=3 {
            assert_eq!(holds(&tessellation, spline(3, &border, f64::from(k))), 1, "where spans meet");
        }
    }
}

#[test]
fn knots_that_are_not_uniform_are_joined_if_they_draw_the_same_spans() {
    // A cubic on [0, 1]: the uniform spline's middle span, by its Bezier points and with clamped or uneven knots.
    let border: Vec<DVec3> = [(0.0, 0.0), (2.0, 6.0), (-1.0, 12.0), (3.0, 18.0)].map(|(z, y)| DVec3::new(0.0, y, z)).into();
    let [a, b, c, d] = border[..] else { panic!("four points") };
    let bezier = [(a + 4.0 * b + c) / 6.0, (2.0 * b + c) / 3.0, (b + 2.0 * c) / 3.0, (b + 4.0 * c + d) / 6.0];
    let cage = sheet(&border, 1, DVec3::new(7.0, 0.0, 0.0));
    let clamped = |list: &[DVec3]| vec![list.iter().map(|p| *p - DVec3::X * 9.0).collect::<Vec<_>>(), list.to_vec()];
    let linear = || vec![0.0, 0.0, 1.0, 1.0];
    let shape = spline_surface([1, 3], [linear(), vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]], &clamped(&bezier));
    let joined =
        |shape: Shape, path: &[u32]| group(vec![cage.clone(), shape], vec![join([vertices(0, path.iter().copied()), side(1, 0, true)])]);
    let tessellation = evaluated(&lower(joined(shape, &[1, 2])).attractor, 1.0);
    assert_eq!(agreed(&tessellation), (1, 1, 1));
    // The same points on uneven knots are another curve, and the place is told.
    let uneven = spline_surface([1, 3], [linear(), vec![0.0, 1.0, 2.0, 3.0, 4.5, 5.5, 6.5, 7.5]], &clamped(&border));
    let findings = refused(joined(uneven, &[1, 2]));
    assert_only(&findings, "join.apart", "/joins/0");
    assert!(findings[0].message.contains("mm apart at (0.000000, "), "{}", findings[0].message);
    // A quadratic is no cubic, even if this one is.
    let raised = [bezier[0], DVec3::new(0.0, 9.0, 1.0), bezier[3]];
    let quadratic = spline_surface([1, 2], [linear(), vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0]], &clamped(&raised));
    let other: Vec<DVec3> = {
        let cubic = [raised[0], (raised[0] + 2.0 * raised[1]) / 3.0, (2.0 * raised[1] + raised[2]) / 3.0, raised[2]];
        vec![
            6.0 * cubic[0] - 7.0 * cubic[1] + 2.0 * cubic[2],
            2.0 * cubic[1] - cubic[2],
            2.0 * cubic[2] - cubic[1],
            6.0 * cubic[3] - 7.0 * cubic[2] + 2.0 * cubic[1],
        ]
    };
    let shape = group(vec![sheet(&other, 1, DVec3::new(7.0, 0.0, 0.0)), quadratic], vec![join([vertices(0, [1, 2]), side(1, 0, true)])]);
    assert_only(&refused(shape), "join.kind", "/joins/0");
}

#[test]
fn hostile_joins_are_refused_where_they_are_wrong() {
    let mut random = Random(9);
    let points = net(&mut random, 4, 6);
    let border: Vec<DVec3> = (0..6).map(|k| (points[1][k] + 4.0 * points[2][k] + points[3][k]) / 6.0).collect();
    let shapes = vec![uniform(3, &points), sheet(&border, 1, DVec3::new(6.0, 0.0, 0.0))];
    let refused = |joins: Vec<Join>| refused(group(shapes.clone(), joins));
    let good = || join([side(0, 0, true), vertices(1, [1, 2, 3, 4])]);
    for (joins, code, pointer) in [
        (vec![good(), good()], "join.twice", "/joins/1/between/0"),
        (vec![join([side(0, 0, true), side(0, 0, true)])], "join.twice", "/joins/0/between/1"),
        (vec![join([side(0, 0, true), vertices(1, [1, 2, 3])])], "join.length", "/joins/0"),
        (vec![join([side(0, 0, false), vertices(1, [1, 2, 3, 4])])], "join.apart", "/joins/0"),
        (vec![join([side(0, 0, true), vertices(1, [1, 2, 9, 4])])], "join.border", "/joins/0/between/1/vertices/2"),
        (vec![join([side(0, 0, true), vertices(1, [1, 2, u32::MAX])])], "join.border", "/joins/0/between/1/vertices/2"),
        (vec![join([side(0, 0, true), vertices(1, [1])])], "join.border", "/joins/0/between/1/vertices"),
        (vec![join([side(0, 0, true), vertices(1, [])])], "join.border", "/joins/0/between/1/vertices"),
        (vec![join([side(0, 0, true), vertices(7, [1, 2])])], "join.part", "/joins/0/between/1/part"),
        (vec![join([side(1, 0, true), vertices(0, [1, 2])])], "join.border", "/joins/0/between/0"),
        (vec![join([side(0, 5, true), vertices(1, [1, 2, 3, 4])])], "join.border", "/joins/0/between/0/side"),
        (vec![Join { strip: true, ..join([side(0, 0, true), vertices(1, [1, 2, 3, 4])]) }], "join.strip-degrees", "/joins/0"),
    ] {
        let findings = refused(joins);
        assert!(findings.iter().any(|finding| finding.code == code && finding.pointer == pointer), "{code} at {pointer}: {findings:?}");
    }
}

fn strip(between: [Border; 2]) -> Join {
    Join { between, strip: true }
}

/// Cubic and quadratic nets of these rows' spans beside each other, the cubic's last column and the quadratic's first one
/// unit apart in the parameters: at x = -3, ..., 1 and 1/2, ..., 5/2.
fn beside(spans: usize, place: impl Fn(f64, f64) -> [DVec3; 2]) -> [Vec<Vec<DVec3>>; 2] {
    let rows = |count: usize, first: f64| move |x: f64| (0..count).map(|k| (x, first + k as f64)).collect::<Vec<_>>();
    let cubic = [-3.0, -2.0, -1.0, 0.0, 1.0].map(rows(spans + 3, -1.0));
    let quadratic = [0.5, 1.5, 2.5].map(rows(spans + 2, -0.5));
    let net = |columns: Vec<Vec<(f64, f64)>>, which: usize| {
        columns.iter().map(|column| column.iter().map(|&(x, y)| place(x, y)[which]).collect()).collect()
    };
    [net(cubic.to_vec(), 0), net(quadratic.to_vec(), 1)]
}

#[test]
fn a_strip_between_parts_of_a_biquadratic_is_the_biquadratic() {
    // z = f(x, y) with a polynomial of degree 2 in each; the control points are blossoms: f less a sixth and an eighth of
    // its second derivatives' sum, per direction.
    let f = |x: [f64; 3], y: [f64; 3]| {
        0.4 + 0.7 * x[1] - 0.3 * y[1] + 0.2 * x[2] - 0.5 * y[2] + 0.6 * x[1] * y[1] - 0.15 * x[2] * y[1] + 0.1 * x[2] * y[2]
    };
    let powers = |t: f64, lowered: f64| [1.0, t, t * t - lowered];
    let place = |x: f64, y: f64| [1.0 / 3.0, 0.25].map(|lowered| DVec3::new(x, y, f(powers(x, lowered), powers(y, lowered))));
    for turned in [false, true] {
        let [cubic, mut quadratic] = beside(3, place);
        if turned {
            quadratic.iter_mut().for_each(|row| row.reverse());
        }
        let shape = group(vec![uniform(2, &quadratic), uniform(3, &cubic)], vec![strip([side(1, 0, true), side(0, 0, false)])]);
        let lowered = lower(shape);
        assert!(lowered.constraint_residual < 1e-15, "{:e}", lowered.constraint_residual);
        let tessellation = evaluated(&lowered.attractor, 0.02);
        assert_eq!(agreed(&tessellation), (1, 1, 1));
        let within = tessellation.vertices.iter().filter(|p| p.x > 1e-9 && p.x < 1.0 - 1e-9).count();
        assert!(within > 100, "{within} points inside the strip");
        let off = |p: &DVec3| (p.z - f(powers(p.x, 0.0), powers(p.y, 0.0))).abs();
        let worst = tessellation.vertices.iter().map(off).fold(0.0, f64::max);
        assert!(worst < 2e-14, "{worst:e}");
    }
}

/// The angle between two directions, up to sign.
fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b).abs())
}

/// First derivatives of a bicubic or biquadratic uniform spline patch at (u, v) of its first span, from its net.
fn tangents(degree: usize, net: &[Vec<DVec3>], u: f64, v: f64) -> [DVec3; 2] {
    let weights = |t: f64, derived: bool| -> Vec<f64> {
        let s = 1.0 - t;
        match (degree, derived) {
            (2, false) => vec![s * s / 2.0, (1.0 + 2.0 * t * s) / 2.0, t * t / 2.0],
            (2, true) => vec![-s, s - t, t],
            (_, false) => {
                [s * s * s, 3.0 * t * t * t - 6.0 * t * t + 4.0, 3.0 * s * s * s - 6.0 * s * s + 4.0, t * t * t].map(|x| x / 6.0).to_vec()
            }
            (_, true) => [-s * s, 3.0 * t * t - 4.0 * t, -3.0 * s * s + 4.0 * s, t * t].map(|x| x / 2.0).to_vec(),
        }
    };
    [(true, false), (false, true)].map(|(du, dv)| {
        let (a, b) = (weights(u, du), weights(v, dv));
        (0..=degree).flat_map(|i| (0..=degree).map(move |k| (i, k))).map(|(i, k)| a[i] * b[k] * net[i][k]).sum()
    })
}

#[test]
fn a_strip_meets_both_surfaces_with_their_tangent_planes() {
    let mut random = Random(2014);
    let mut jumps = [0.0_f64; 2];
    for _ in 0..20 {
        // Nets that have nothing to do with each other.
        let mut bumpy = |columns: usize, rows: usize, x: f64| -> Vec<Vec<DVec3>> {
            let mut point = |i: usize, k: usize| {
                DVec3::new(x + i as f64, k as f64, 0.0) + 0.3 * random.points(1)[0] / 9.0 + DVec3::Z * random.between(-1.0, 1.0)
            };
            (0..columns).map(|i| (0..rows).map(|k| point(i, k)).collect()).collect()
        };
        let (cubic, quadratic) = (bumpy(4, 4, -3.0), bumpy(3, 3, 1.5));
        let shape = group(vec![uniform(3, &cubic), uniform(2, &quadratic)], vec![strip([side(0, 0, true), side(1, 0, false)])]);
        let attractor = lower(shape).attractor;
        let automaton = attractor.automaton();
        let root = &attractor.roots()[2];
        assert_eq!((automaton.state(root.state).name.as_str(), attractor.roots().len()), ("strip", 3));
        for _ in 0..20 {
            // Down a random way along each edge; the rows of the edge say where it ends.
            for right in [false, true] {
                let (mut state, mut points) = (root.state, root.points.clone());
                let (mut low, mut width) = (0.0, 1.0);
                for _ in 0..22 {
                    let upper = random.below(2);
                    let child = &automaton.state(state).transitions[2 * upper + usize::from(right)];
                    let image = |j: usize| -> [f64; 4] {
                        let terms = points.iter().zip(child.operator.column(j));
                        terms.fold([0.0; 4], |sum, (p, w)| std::array::from_fn(|axis| sum[axis] + w * p[axis]))
                    };
                    points = (0..child.operator.columns()).map(image).collect();
                    state = child.to;
                    width /= 2.0;
                    low += width * upper as f64;
                }
                // Ends of the cell's sides, from the limits of its corners.
                let boundaries = &automaton.state(state).boundaries;
                let corner = |boundary: usize, end: usize| -> DVec3 {
                    let edge = &boundaries[boundary];
                    let vertex = &automaton.state(edge.state).boundaries[end];
                    let weights = edge.incidence.apply(vertex.incidence.column(0));
                    let sum = |axis: usize| points.iter().zip(&weights).map(|(p, w)| w * p[axis]).sum::<f64>();
                    DVec3::new(sum(0), sum(1), sum(2))
                };
                // left, bottom, right, top
                let (near, along, across) =
                    if right { (corner(2, 0), corner(2, 1), corner(1, 0)) } else { (corner(0, 0), corner(0, 1), corner(1, 1)) };
                let normal = (along - near).cross(across - near);
                let (degree, net, u) = if right { (2, &quadratic, 0.0) } else { (3, &cubic, 1.0) };
                let [du, dv] = tangents(degree, net, u, low + width / 2.0);
                let jump = angle(normal, du.cross(dv));
                jumps[usize::from(right)] = jumps[usize::from(right)].max(jump);
            }
        }
    }
    // Chords over 2^-22 turn by the curvature times that.
    println!("largest angles of normals: cubic side {:e}, quadratic side {:e}", jumps[0], jumps[1]);
    assert!(jumps.iter().all(|&jump| jump < 1e-4), "{jumps:?}");
}

#[test]
fn strips_close_around_tubes_of_meshes_and_splines() {
    let lower_rings = rings(&[(9.0, 0.0), (9.5, 4.0), (10.0, 8.0)], 0.0);
    for (turn, start, backwards) in [(0.0, 0, false), (0.3, 2, true)] {
        let mut upper = rings(&[(9.0, 14.0), (8.0, 18.0), (8.5, 22.0)], turn);
        for ring in &mut upper {
            ring.rotate_left(start);
            if backwards {
                ring.reverse();
            }
        }
        let around = |part: usize, ring: u32| vertices(part, (0..8).chain([0]).map(|k| 8 * ring + k));
        let primal = tube(Scheme::CatmullClark, &lower_rings, false, backwards);
        let dual = tube(Scheme::DooSabin, &upper, false, false);
        let spline = uniform(2, &wrapped(&upper, 2));
        for (shapes, borders) in [
            (vec![primal.clone(), dual.clone()], [around(0, 2), around(1, 0)]),
            (vec![primal.clone(), spline], [around(0, 2), side(1, 0, false)]),
            (
                vec![
                    uniform(3, &wrapped(&lower_rings[..], 3).iter().chain([&wrapped(&lower_rings, 3)[2]]).cloned().collect::<Vec<_>>()),
                    dual,
                ],
                [side(0, 0, true), around(1, 0)],
            ),
        ] {
            let lowered = lower(group(shapes, vec![strip(borders)]));
            for tolerance in [4.0, 2.0] {
                let tessellation = evaluated(&lowered.attractor, tolerance);
                assert_eq!(agreed(&tessellation), (0, 2, 1), "an annulus");
            }
        }
    }
}

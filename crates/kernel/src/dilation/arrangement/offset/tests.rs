use super::super::testing::{
    arranged, assert_bounds, assert_limited, assert_steady, distance_of_triangles, holds_everywhere, is_flat, lowered, lowered_as,
    on_coarse_lattice, place, plan, topology,
};
use super::skin::{BOTH_SIDES, Skin};
use super::{solid_of, surface, with_seams};
use crate::attractor::Attractor;
use crate::attractor::cell::{Point, Site, dot, subtract, unit};
use crate::budget::Budget;
use crate::dilation::arrangement::figure::Figure;
use crate::dilation::tree::Weighted;
use crate::measure::triangle::closest_on_triangle;
use crate::model::Interior;
use crate::solid::{Inside, TriMesh, repair};
use crate::split_mix::Random;
use glam::{DMat3, DVec3};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// Vertices and triangles.
#[derive(Clone, Default)]
struct Mesh {
    vertices: Vec<DVec3>,
    faces: Vec<Vec<u32>>,
}

impl Mesh {
    /// A grid of squares halved over the unit square, whose corners at one place are one.
    fn of(along: usize, across: usize, at: impl Fn(f64, f64) -> DVec3) -> Self {
        let (mut mesh, mut numbers) = (Self::default(), HashMap::new());
        let mut number = |i: usize, j: usize| {
            let x = at(i as f64 / along as f64, j as f64 / across as f64);
            *numbers.entry(x.to_array().map(|x| (x * 1e7).round() as i64)).or_insert_with(|| {
                mesh.vertices.push(x);
                mesh.vertices.len() as u32 - 1
            })
        };
        for (i, j) in (0..along).flat_map(|i| (0..across).map(move |j| (i, j))) {
            let [a, b, c, d] = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)];
            // The halves of squares at a pole may be lines.
            let halves = [[a, b, c], [a, c, d]].into_iter().filter(|[p, q, r]| p != q && q != r && r != p);
            mesh.faces.extend(halves.map(|half| half.to_vec()));
        }
        mesh
    }

    fn torus(around: usize, across: usize, radii: [f64; 2]) -> Self {
        Self::of(around, across, |u, v| {
            let (ring, height) = (radii[0] + radii[1] * (TAU * v).cos(), radii[1] * (TAU * v).sin());
            DVec3::new(ring * (TAU * u).cos(), ring * (TAU * u).sin(), height)
        })
    }

    /// A ball with bumps as high as a share of its radius.
    fn ball(around: usize, across: usize, radius: f64, bumps: f64) -> Self {
        Self::of(around, across, |u, v| {
            let (u, v) = (TAU * u, PI * v);
            let own = radius * (1.0 + bumps * (3.0 * u).sin() * v.sin().powi(3) * (2.0 * v).cos());
            own * DVec3::new(v.sin() * u.cos(), v.sin() * u.sin(), v.cos())
        })
    }

    /// A strip that comes back to its beginning after some half turns.
    fn strip(along: usize, across: usize, radius: f64, wide: f64, turns: f64) -> Self {
        Self::of(along, across, |u, v| {
            let (out, up) = ((PI * turns * u).cos(), (PI * turns * u).sin());
            let own = wide * (v - 0.5);
            DVec3::new((radius + own * out) * (TAU * u).cos(), (radius + own * out) * (TAU * u).sin(), own * up)
        })
    }

    /// A quarter of a pipe, with corners.
    fn vault(along: usize, across: usize, radius: f64, long: f64) -> Self {
        Self::of(along, across, |u, v| {
            let angle = PI * (0.25 + 0.5 * v);
            DVec3::new(long * u, radius * angle.cos(), radius * angle.sin() + 0.3 * (3.0 * u).sin())
        })
    }

    /// A wide ring whose outer border is bent down by less than the radius that it is thickened by.
    fn brim(around: usize, across: usize, bend: f64, brim: f64) -> Self {
        let (wide, to) = (10.0, 0.5);
        let arcs = [wide * to, bend * (0.5 * PI - to)];
        Self::of(around, across, |u, v| {
            let way = v * (arcs[0] + arcs[1] + brim);
            let angle = if way < arcs[0] { way / wide } else { (to + (way - arcs[0]) / bend).min(0.5 * PI) };
            let own = if way < arcs[0] { wide } else { bend };
            let ring = 8.0 + (wide - own) * to.sin() + own * angle.sin();
            let height = (wide - own) * to.cos() + own * angle.cos() - (way - arcs[0] - arcs[1]).max(0.0);
            DVec3::new(ring * (TAU * u).cos(), ring * (TAU * u).sin(), height)
        })
    }

    /// Two caps of balls that meet at a rim, each as wide as an angle.
    fn lens(around: usize, across: usize, radius: f64, angle: f64) -> Self {
        let cap = |side: f64| {
            Self::of(around, across, |u, v| {
                let (u, v) = (TAU * u, angle * v);
                let height = side * (v.cos() - angle.cos());
                radius * DVec3::new(v.sin() * u.cos(), v.sin() * u.sin(), height)
            })
        };
        cap(1.0).and(cap(-1.0)).welded()
    }

    /// A barrel with domes, which turn outwards or inwards.
    fn drum(around: usize, across: usize, radius: f64, domes: f64) -> Self {
        let side = Self::of(around, across, |u, v| {
            let own = radius * (1.0 + 0.2 * (PI * v).sin());
            DVec3::new(own * (TAU * u).cos(), own * (TAU * u).sin(), 2.0 * radius * v)
        });
        let dome = |height: f64, side: f64| {
            Self::of(around, across, |u, v| {
                let own = radius * v;
                DVec3::new(own * (TAU * u).cos(), own * (TAU * u).sin(), height + side * domes * (1.0 - v * v))
            })
        };
        side.and(dome(0.0, -1.0)).and(dome(2.0 * radius, 1.0)).welded()
    }

    /// A cube with bulging faces: seams, and corners where three of them meet.
    fn cushion(along: usize, half: f64, bulge: f64) -> Self {
        let face = |axis: usize, side: f64| {
            Self::of(along, along, |u, v| {
                let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
                let mut x = [0.0; 3];
                (x[axis], x[(axis + 1) % 3], x[(axis + 2) % 3]) =
                    (side * (half + bulge * (1.0 - a * a) * (1.0 - b * b)), half * a * side, half * b);
                DVec3::from_array(x)
            })
        };
        (0..3).flat_map(|axis| [face(axis, 1.0), face(axis, -1.0)]).reduce(Self::and).unwrap().welded()
    }

    /// A wide arch with a fold along it, from border to border.
    fn fold(along: usize, across: usize, slope: f64) -> Self {
        Self::of(along, across, |u, v| {
            let (angle, beside) = (4.2 * (u - 0.5), v - 0.5);
            let own = 12.0 + 12.0 * slope * beside.abs() * (1.0 + 0.5 * beside.abs());
            DVec3::new(own * angle.sin(), 12.0 * beside, own * angle.cos())
        })
    }

    /// The same with two folds, between which the border is straight.
    fn folds(along: usize, across: usize) -> Self {
        Self::of(along, across, |u, v| {
            let (angle, beside) = (4.2 * (u - 0.5), v - 0.5);
            let up = (beside.abs() - 0.2).max(0.0);
            let own = 12.0 + 9.0 * up * (1.0 + 0.5 * up) + 0.02 * (4.0 * angle).sin();
            DVec3::new(own * angle.sin(), 12.0 * beside, own * angle.cos())
        })
    }

    /// The same with one vertex for all at a place.
    fn welded(self) -> Self {
        let (mut mesh, mut numbers) = (Self::default(), HashMap::new());
        for face in &self.faces {
            let corners = face.iter().map(|&corner| {
                let x = self.vertices[corner as usize];
                *numbers.entry(x.to_array().map(|x| (x * 1e7).round() as i64)).or_insert_with(|| {
                    mesh.vertices.push(x);
                    mesh.vertices.len() as u32 - 1
                })
            });
            mesh.faces.push(corners.collect());
        }
        mesh
    }

    /// The same with vertices on some sides, close to one of their ends or at the same place, as marching cubes leave them.
    fn with_short_sides(mut self, random: &mut Random) -> Self {
        for _ in 0..self.faces.len() / 8 {
            let own = random.next() as usize % self.faces.len();
            let [a, b, c] = [0, 1, 2].map(|k| self.faces[own][k]);
            let [from, to, beside] = [a, b, c].map(|end| self.vertices[end as usize]);
            let is_other = |face: &Vec<u32>| (0..3).any(|k| face[k] == b && face[(k + 1) % 3] == a);
            let Some(other) = self.faces.iter().position(is_other) else { continue };
            let d = self.faces[other].iter().copied().find(|&corner| corner != a && corner != b).unwrap();
            let beyond = self.vertices[d as usize];
            if [to - from, beside - from, beside - to, beyond - from, beyond - to].iter().any(|side| side.length() < 0.2) {
                continue;
            }
            let new = self.vertices.len() as u32;
            self.vertices.push(from.lerp(to, [0.0, 1e-4, 3e-3, 0.03][random.next() as usize % 4]));
            (self.faces[own], self.faces[other]) = (vec![new, b, c], vec![b, new, d]);
            self.faces.extend([vec![a, new, c], vec![new, a, d]]);
        }
        self
    }

    /// Where a function is zero, by marching tetrahedra over so many cubes along each side of a box, halved along their diagonals (Kuhn): with short sides and slivers all over.
    fn level_set(cubes: u32, reach: f64, value: impl Fn(DVec3) -> f64) -> Self {
        let at = |corner: [u32; 3]| reach * (2.0 * DVec3::from_array(corner.map(f64::from)) / f64::from(cubes) - DVec3::ONE);
        let (mut mesh, mut numbers) = (Self::default(), HashMap::new());
        let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        for (first, order) in (0..cubes.pow(3)).flat_map(|cube| orders.map(|order| (cube, order))) {
            let mut corner = [first % cubes, first / cubes % cubes, first / cubes.pow(2)];
            let mut corners = vec![corner];
            for axis in order {
                corner[axis] += 1;
                corners.push(corner);
            }
            let (low, high): (Vec<[u32; 3]>, Vec<[u32; 3]>) = corners.into_iter().partition(|&corner| value(at(corner)) < 0.0);
            let pairs = match (low.len(), high.len()) {
                (0, _) | (_, 0) => continue,
                (2, _) => vec![[low[0], high[0]], [low[0], high[1]], [low[1], high[1]], [low[1], high[0]]],
                _ => low.iter().flat_map(|&low| high.iter().map(move |&high| [low, high])).collect(),
            };
            let vertices = pairs.iter().map(|&ends| {
                *numbers.entry(ends).or_insert_with(|| {
                    let [low, high] = ends.map(at);
                    let [below, above] = [low, high].map(&value);
                    mesh.vertices.push(low.lerp(high, below / (below - above)));
                    mesh.vertices.len() as u32 - 1
                })
            });
            let vertices: Vec<u32> = vertices.collect();
            let out = high.iter().map(|&high| at(high)).sum::<DVec3>() / high.len() as f64 - at(low[0]);
            for k in 2..vertices.len() {
                let [a, b, c] = [0, k - 1, k].map(|k| vertices[k]);
                let [p, q, r] = [a, b, c].map(|vertex| mesh.vertices[vertex as usize]);
                mesh.faces.push(if (q - p).cross(r - p).dot(out) > 0.0 { vec![a, b, c] } else { vec![a, c, b] });
            }
        }
        mesh
    }

    fn and(mut self, other: Self) -> Self {
        let first = self.vertices.len() as u32;
        self.vertices.extend(other.vertices);
        self.faces.extend(other.faces.into_iter().map(|face| face.into_iter().map(|corner| corner + first).collect()));
        self
    }

    fn moved(mut self, by: DVec3) -> Self {
        self.vertices.iter_mut().for_each(|x| *x += by);
        self
    }

    fn turned(mut self, random: &mut Random) -> Self {
        let axis = (place(random, 2.0) - DVec3::ONE).normalize();
        let turn = DMat3::from_axis_angle(axis, TAU * random.share());
        let by = place(random, 50.0);
        self.vertices.iter_mut().for_each(|x| *x = turn * *x + by);
        self
    }

    fn lowered(&self) -> Attractor {
        lowered(&self.vertices, self.faces.clone())
    }

    fn corners(&self) -> Vec<[Point; 3]> {
        self.faces.iter().map(|face| [0, 1, 2].map(|k| self.vertices[face[k] as usize].to_array())).collect()
    }

    /// What it bounds, with its triangles outwards: so that the orientation is not that of how it was made.
    fn solid(&self) -> (Self, Attractor) {
        let triangles = self.faces.iter().map(|face| [0, 1, 2].map(|k| face[k])).collect();
        let mesh = TriMesh { vertices: self.vertices.clone(), triangles };
        let mesh = repair(&mesh, &Budget::default()).unwrap().solid.map_or(mesh, |solid| solid.into_mesh());
        let faces: Vec<Vec<u32>> = mesh.triangles.iter().map(|corners| corners.to_vec()).collect();
        let shape = lowered_as(Interior::Solid, &mesh.vertices, faces.clone()).unwrap();
        (Self { vertices: mesh.vertices, faces }, shape)
    }

    /// Whether sheets are made around it.
    fn is_made(&self, radius: f64, tolerance: f64) -> bool {
        self.is_made_around(&self.lowered(), radius, tolerance)
    }

    /// The same around a shape that it is the surface of.
    fn is_made_around(&self, shape: &Attractor, radius: f64, tolerance: f64) -> bool {
        let budget = Budget::default();
        let plan = plan(shape, radius, tolerance);
        let setting = plan.setting(plan.pitch(), &budget);
        let figures: Vec<Figure> =
            self.corners().into_iter().map(|corners| Weighted { site: Site::Triangle(corners), deficit: 0.0 }.into()).collect();
        surface(&figures, &shape.surfaces(), &setting, |x| f64::from(x as f32), &budget).unwrap().is_some()
    }

    fn distance(&self) -> impl Fn(DVec3) -> f64 {
        distance_of_triangles(&self.vertices, &self.faces)
    }

    /// A place about as far from it as a radius.
    fn near(&self, radius: f64, random: &mut Random) -> DVec3 {
        let face = &self.faces[random.next() as usize % self.faces.len()];
        let on = self.vertices[face[0] as usize].lerp(self.vertices[face[1] as usize], random.share());
        let on = on.lerp(self.vertices[face[2] as usize], random.share());
        on + radius * (0.7 + 0.6 * random.share()) * (place(random, 2.0) - DVec3::ONE).normalize_or_zero()
    }
}

/// A shape, with the components, the cavities and the Euler number of its dilation.
fn shape(case: usize, random: &mut Random) -> (Mesh, (u64, u64, i64)) {
    match case % 7 {
        0 => (Mesh::torus(40, 24, [15.0, 6.0]), (1, 1, 0)),
        1 => (Mesh::ball(36, 18, 12.0, 0.05 * random.share()), (1, 1, 4)),
        2 => (Mesh::strip(60, 4, 15.0, 6.0, 1.0), (1, 0, 0)),
        3 => (Mesh::strip(90, 6, 15.0, 6.0, 2.0), (1, 0, 0)),
        4 => (Mesh::vault(20, 16, 12.0, 20.0), (1, 0, 2)),
        5 => (Mesh::ball(36, 18, 12.0, 0.0).and(Mesh::ball(36, 18, 7.5, 0.0)), (2, 2, 8)),
        _ => (Mesh::torus(60, 32, [15.0, 4.0]).and(Mesh::torus(60, 32, [15.0, 4.0]).moved(DVec3::new(45.0, 0.0, 3.0))), (2, 2, 0)),
    }
}

/// What is made keeps its bounds everywhere, at some places for which it is asked, too, and has the topology that is known of the surface.
fn assert_made(case: usize, mesh: &Mesh, [radius, tolerance]: [f64; 2], expected: (u64, u64, i64), places: u32, random: &mut Random) {
    let mesh = mesh.clone().turned(random);
    let attractor = mesh.lowered();
    assert!(mesh.is_made(radius, tolerance) && is_flat(&attractor, radius, tolerance), "{case} {radius} {tolerance}");
    let dilation = arranged(&attractor, radius, tolerance);
    assert!(dilation.topology_exact && dilation.inner_mm <= tolerance && dilation.outer_mm <= tolerance, "{case}");
    assert_eq!(topology(&dilation), expected, "{case}");
    let (inside, distance) = (Inside::new(dilation.solid.mesh()), mesh.distance());
    assert!(holds_everywhere(&dilation, radius, &distance, random), "{case}");
    for _ in 0..places {
        let x = mesh.near(radius, random);
        assert_bounds(case, &inside, &dilation, radius, x, distance(x));
    }
}

#[test]
fn sheets_keep_their_bounds_and_have_the_surface_s_topology() {
    let mut random = Random(113);
    for case in 0..14 {
        let (mesh, expected) = shape(case, &mut random);
        let (radius, share) = ([1.0, 0.6, 1.4][case % 3], [0.1, 0.2][case % 2]);
        assert_made(case, &mesh, [radius, share * radius], expected, 300, &mut random);
    }
}

/// Triangles that are short, or no more than sides of others, are in the way of none.
#[test]
fn sheets_follow_meshes_with_short_sides() {
    let mut random = Random(173);
    let shapes = [(Mesh::torus(80, 48, [15.0, 6.0]), (1, 1, 0)), (Mesh::ball(80, 40, 12.0, 0.05), (1, 1, 4))];
    for (case, (mesh, expected)) in shapes.into_iter().enumerate() {
        let mesh = mesh.with_short_sides(&mut random);
        for (radius, share) in [(1.0, 0.1), (1.4, 0.2), (3.0, 0.1)] {
            assert_made(case, &mesh, [radius, share * radius], expected, 100, &mut random);
        }
    }
}

/// A body of a level set: short sides have noise for normals, along which sheets would fold.
#[test]
fn sheets_follow_level_sets() {
    let mut random = Random(179);
    let wave = |x: DVec3| 1.2 * (0.22 * x.x + 1.0).sin() * (0.22 * x.y).cos() + (0.3 * x.z + 0.15 * x.x).sin();
    let pebble = |cubes: u32| Mesh::level_set(cubes, 15.6, |x| x.length() - 12.0 + wave(x));
    for (cubes, radius, share) in [(30, 0.6, 0.1), (30, 1.0, 0.05), (40, 2.0, 0.1)] {
        assert_made(cubes as usize, &pebble(cubes), [radius, share * radius], (1, 1, 4), 50, &mut random);
    }
}

/// A ball with bumps that bend by more than the radius: sheets cross themselves there.
#[test]
fn sheets_may_cross_themselves() {
    let mut random = Random(181);
    let bumpy = |cubes: u32, bend: f64| {
        let wave = move |x: DVec3| 0.8 * (bend * x.x + 0.4).sin() * (bend * x.y + 0.2).sin() * (bend * x.z).cos();
        Mesh::level_set(cubes, 15.6, |x| x.length() - 12.0 + wave(x))
    };
    assert_made(60, &bumpy(60, 0.7), [1.5, 0.15], (1, 1, 4), 50, &mut random);
    // Parts that overlap are one.
    let sheet = Mesh::vault(20, 16, 12.0, 20.0);
    let double = sheet.clone().and(sheet.moved(DVec3::new(0.0, 0.0, 2.0_f64.sqrt())));
    assert_made(1, &double, [1.0, 0.1], (1, 0, 2), 300, &mut random);
    assert_steady(&double.turned(&mut random).lowered(), 1.0, 0.1);
}

/// Near borders that are bent by less than the radius, sheets fold.
#[test]
fn folds_are_taken_away() {
    let mut random = Random(191);
    let brims = [(120, 0.9, 0.01), (120, 0.9, 0.1), (120, 0.9, 0.3), (120, 0.9, 0.6), (200, 0.7, 0.6)];
    for (case, (around, bend, brim)) in brims.into_iter().enumerate() {
        assert_made(case, &Mesh::brim(around, 40, bend, brim), [1.0, 0.1], (1, 0, 0), 100, &mut random);
    }
    // Turned like this, a tangle is left at first, which has to be made anew.
    assert!(Mesh::brim(200, 40, 0.9, 0.6).turned(&mut Random(14)).is_made(1.0, 0.1));
}

/// A shape with seams, with the components, the cavities and the Euler number of its dilation.
fn seamed(case: usize) -> (Mesh, (u64, u64, i64)) {
    // For the lesser tolerance, finer ones.
    let fine = 1 + case / 9;
    match case % 9 {
        0 => (Mesh::lens(60 * fine, 20 * fine, 12.0, 0.9), (1, 1, 4)),
        1 => (Mesh::drum(48 * fine, 12 * fine, 8.0, 2.0), (1, 1, 4)),
        2 => (Mesh::drum(48 * fine, 12 * fine, 8.0, -2.0), (1, 1, 4)),
        3 => (Mesh::cushion(20 * fine, 10.0, 1.5), (1, 1, 4)),
        4 => (Mesh::fold(48 * fine, 16 * fine, 0.7), (1, 0, 2)),
        5 => (Mesh::fold(48 * fine, 16 * fine, -0.7), (1, 0, 2)),
        6 => (Mesh::lens(60 * fine, 30 * fine, 14.0, 0.7), (1, 1, 4)),
        7 => (Mesh::folds(48 * fine, 20 * fine), (1, 0, 2)),
        _ => (Mesh::cushion(16 * fine, 8.0, -1.0), (1, 1, 4)),
    }
}

/// Where the surface turns much at seams: closed ones and such that end at the border, hollow on either side, and corners.
#[test]
fn sheets_meet_at_seams() {
    let mut random = Random(149);
    for case in 0..15 {
        let (mesh, expected) = seamed(case);
        let (radius, share) = ([1.0, 0.7, 1.2][case % 3], [0.1, 0.05][case / 9]);
        assert_made(case, &mesh, [radius, share * radius], expected, 100, &mut random);
    }
    // Triangles at the rim go by where both caps meet inside: what is over the rim along normals there is farther off than may be.
    assert_made(15, &Mesh::lens(128, 48, 15.6, 0.877), [0.36, 0.0045], (1, 1, 4), 100, &mut random);
}

/// Random sheets, strips around which turn more or less: those that are made have the topology that a lattice has, which tells sites apart.
#[test]
fn sheets_agree_with_the_lattice() {
    let mut random = Random(127);
    let mut made = 0;
    for case in 0..16 {
        let waves: [f64; 4] = std::array::from_fn(|_| random.share());
        let mesh = Mesh::of(24, 12, |u, v| {
            let height = 1.5 * waves[0] * (4.0 * u + 3.0 * waves[1]).sin() + waves[2] * (5.0 * v + 2.0 * u).cos();
            DVec3::new(20.0 * u, 10.0 * v + 2.0 * waves[3] * (3.0 * u).sin(), 2.0 * height)
        });
        let mesh = if case % 2 == 0 { mesh.clone().and(mesh.moved(DVec3::new(0.0, 0.0, 1.5 + 3.0 * random.share()))) } else { mesh };
        let mesh = mesh.turned(&mut random);
        let (radius, tolerance) = (0.8, 0.1);
        if !mesh.is_made(radius, tolerance) {
            continue;
        }
        made += 1;
        let dilation = arranged(&mesh.lowered(), radius, tolerance);
        let lattice = on_coarse_lattice(&mesh.lowered(), radius, tolerance);
        assert!(dilation.topology_exact && lattice.topology_exact, "{case}");
        assert_eq!(topology(&dilation), topology(&lattice), "{case}");
        assert!(holds_everywhere(&dilation, radius, mesh.distance(), &mut random), "{case}");
    }
    assert!((8..16).contains(&made), "{made}");
}

/// Sheets that come so near to each other that their dilations touch within the band are left to others, and so is what is filled at the radius; where they overlap by more they are cut.
#[test]
fn sheets_that_touch_are_left_to_others() {
    let mut random = Random(131);
    for (gap, is_made) in [(3.0, true), (2.45, true), (2.15, true), (2.0, false), (1.85, false), (1.0, true), (0.0, false)] {
        let sheet = Mesh::vault(20, 16, 12.0, 20.0);
        let mesh = sheet.clone().and(sheet.moved(DVec3::new(0.0, 0.0, 2.0_f64.sqrt() * gap))).turned(&mut random);
        assert_eq!(mesh.is_made(1.0, 0.1), is_made, "{gap}");
    }
    // Pipes that are as wide as the ball, or less.
    for (wide, is_made) in [(2.0, true), (1.05, false), (0.95, false), (0.7, false)] {
        let mesh = Mesh::torus(80, 48, [15.0, wide]).turned(&mut random);
        assert_eq!(mesh.is_made(1.0, 0.1), is_made, "{wide}");
    }
}

/// What turns too much, or hangs together otherwise than a surface does, is left to others.
#[test]
fn what_is_no_smooth_surface_is_left_to_others() {
    let vault = Mesh::vault(20, 16, 12.0, 20.0);
    assert!(vault.is_made(1.0, 0.1));
    // The same a second time, in other directions, with a third sheet along its border, with a corner that turns inward, and folded.
    let twice = Mesh {
        faces: vault.faces.iter().cloned().chain(vault.faces.iter().map(|face| face.iter().rev().copied().collect())).collect(),
        ..vault.clone()
    };
    let mut winged = vault.clone();
    let (a, b) = (winged.faces[100][0], winged.faces[100][1]);
    winged.vertices.push(0.5 * (winged.vertices[a as usize] + winged.vertices[b as usize]) + DVec3::new(0.0, 0.0, 9.0));
    winged.faces.push(vec![a, b, winged.vertices.len() as u32 - 1]);
    let mut notched = vault.clone();
    notched.faces.drain(..40);
    notched.faces.drain(..20);
    let folded = Mesh::of(20, 8, |u, v| DVec3::new(20.0 * (2.0 * u - 1.0).abs(), 10.0 * v, 4.0 * (u - 0.5).powi(2)));
    let roof = Mesh::of(20, 20, |u, v| DVec3::new(20.0 * u, 10.0 * v, 6.0 * (u - 0.5).abs()));
    let crossed = Mesh::vault(20, 16, 12.0, 20.0).and(Mesh::vault(20, 16, 12.0, 20.0).moved(DVec3::new(0.0, 5.0, 0.0)));
    // Three folds that meet at a place, of which two are hollow on one side and one on the other; and a blade.
    let bracket = Mesh::of(24, 24, |u, v| {
        let (x, y) = (20.0 * (u - 0.5), 20.0 * (v - 0.5));
        DVec3::new(x, y, if x > 0.0 && y > 0.0 { 1.2 * x.min(y) } else { 0.0 } + 0.02 * (x * x + 0.5 * x * y))
    });
    let blade = Mesh::lens(60, 20, 40.0, 0.2);
    for (case, mesh) in [twice, winged, notched, folded, roof, crossed, bracket, blade].iter().enumerate() {
        assert!(!mesh.is_made(1.0, 0.1), "{case}");
    }
    // Directions of faces do not matter.
    let mut random = Random(137);
    let mut mixed = vault;
    mixed.faces.iter_mut().filter(|_| random.share() < 0.5).for_each(|face| face.reverse());
    assert!(mixed.is_made(1.0, 0.1));
    let dilation = arranged(&mixed.lowered(), 1.0, 0.1);
    assert!(dilation.topology_exact && topology(&dilation) == (1, 0, 2));
    assert!(holds_everywhere(&dilation, 1.0, mixed.distance(), &mut random));
}

/// A solid, with the components, the cavities and the Euler number of its dilation by a radius, and that: inside of most of them a sheet would fold, or meet itself.
fn solid(case: usize) -> (Mesh, (u64, u64, i64), f64) {
    let hollow = || Mesh::ball(36, 18, 12.0, 0.0).and(Mesh::ball(36, 18, 7.5, 0.0));
    let wave = |x: DVec3| 0.8 * (0.6 * x.x + 0.4).sin() * (0.6 * x.y + 0.2).sin() * (0.6 * x.z).cos();
    match case {
        0 => (Mesh::torus(40, 24, [15.0, 6.0]), (1, 0, 0), 1.0),
        1 => (Mesh::torus(80, 48, [15.0, 1.0]), (1, 0, 0), 1.0),
        2 => (Mesh::torus(80, 48, [15.0, 0.7]), (1, 0, 0), 2.0),
        3 => (Mesh::ball(36, 18, 12.0, 0.05), (1, 0, 2), 1.4),
        4 => (hollow(), (1, 1, 4), 1.0),
        5 => (Mesh::lens(60, 20, 12.0, 0.9), (1, 0, 2), 1.0),
        6 => (Mesh::lens(60, 20, 12.0, 0.5), (1, 0, 2), 3.0),
        7 => (Mesh::drum(48, 12, 8.0, 2.0), (1, 0, 2), 0.7),
        8 => (Mesh::drum(48, 12, 8.0, -2.0), (1, 0, 2), 6.0),
        9 => (Mesh::cushion(20, 10.0, 1.5), (1, 0, 2), 1.2),
        10 => (Mesh::cushion(16, 8.0, -1.0), (1, 0, 2), 5.0),
        11 => (Mesh::level_set(60, 15.6, |x| x.length() - 12.0 + wave(x)), (1, 0, 2), 1.5),
        _ => (Mesh::torus(60, 32, [15.0, 4.0]).and(Mesh::torus(60, 32, [15.0, 4.0]).moved(DVec3::new(45.0, 0.0, 3.0))), (2, 0, 0), 0.6),
    }
}

/// Around solids there is a sheet outside alone, whatever is inside.
#[test]
fn sheets_around_solids_are_outside() {
    let mut random = Random(191);
    for case in 0..13 {
        let (mesh, expected, radius) = solid(case);
        let tolerance = [0.1, 0.2][case % 2] * radius;
        let (mesh, shape) = mesh.turned(&mut random).solid();
        assert!(mesh.is_made_around(&shape, radius, tolerance) && is_flat(&shape, radius, tolerance), "{case}");
        let dilation = arranged(&shape, radius, tolerance);
        assert!(dilation.topology_exact && dilation.inner_mm <= tolerance && dilation.outer_mm <= tolerance, "{case}");
        assert_eq!(topology(&dilation), expected, "{case}");
        let surfaces = shape.surfaces();
        let solids: Vec<Inside> = surfaces.iter().map(Inside::new).collect();
        let distance = |x: DVec3| solids.iter().map(|solid| solid.distance(x)).fold(f64::INFINITY, f64::min);
        assert!(holds_everywhere(&dilation, radius, distance, &mut random), "{case}");
        let inside = Inside::new(dilation.solid.mesh());
        for _ in 0..300 {
            let x = mesh.near(radius, &mut random);
            assert_bounds(case, &inside, &dilation, radius, x, distance(x));
            let within = mesh.vertices[random.next() as usize % mesh.vertices.len()].lerp(x, random.share());
            assert_bounds(case, &inside, &dilation, radius, within, distance(within));
        }
    }
}

/// Where what is hidden inside of seams is in the way outside, each side has a sheet with triangles of its own, whichever way the surface's faces run.
#[test]
fn sides_of_closed_surfaces_are_made_apart() {
    let mut random = Random(197);
    // As in the comparison with peers, where triangles for both sides are too coarse for the outer one.
    let mut mesh = Mesh::cushion(48, 10.0, 2.5).turned(&mut random);
    mesh.faces.iter_mut().filter(|_| random.share() < 0.5).for_each(|face| face.reverse());
    let (radius, tolerance) = (0.433, 0.433 / 40.0);
    let (shape, budget) = (mesh.lowered(), Budget::default());
    let plan = plan(&shape, radius, tolerance);
    let setting = plan.setting(plan.pitch(), &budget);
    let band = [setting.least + setting.slack, setting.outer - setting.slack];
    let of_both = with_seams(&mesh.corners(), BOTH_SIDES, band, &setting, &|x| f64::from(x as f32), &budget).unwrap();
    assert!(matches!(of_both, (None, true)) && mesh.is_made(radius, tolerance));
    let dilation = arranged(&shape, radius, tolerance);
    assert!(dilation.topology_exact && dilation.inner_mm <= tolerance && dilation.outer_mm <= tolerance);
    assert_eq!(topology(&dilation), (1, 1, 4));
    let surface = mesh.solid().1.surfaces().swap_remove(0);
    let surface = Inside::new(&surface);
    assert!(holds_everywhere(&dilation, radius, |x| surface.surface_distance(x), &mut random));
    let inside = Inside::new(dilation.solid.mesh());
    for _ in 0..1_000 {
        let x = mesh.near(radius, &mut random);
        assert_bounds(0, &inside, &dilation, radius, x, surface.surface_distance(x));
    }
}

/// What is no solid, so that one side is not asked for alone: a tube that meets itself, a ball with another one in it, and a ball inside out.
#[test]
fn what_meets_itself_is_no_solid() {
    let budget = Budget::default();
    let is_solid = |mesh: &Mesh| solid_of(&mesh.corners(), &budget).unwrap().is_some();
    assert!(is_solid(&Mesh::torus(40, 24, [15.0, 6.0]).solid().0));
    let spindle = Mesh::torus(40, 24, [3.0, 6.0]).solid().0;
    let ball = |radius: f64| Mesh::ball(24, 12, radius, 0.0).solid().0;
    let mut inward = ball(5.0);
    inward.faces.iter_mut().for_each(|face| face.reverse());
    assert!(is_solid(&ball(9.0).and(inward.clone())));
    for (case, mesh) in [spindle, ball(9.0).and(ball(5.0)), inward].iter().enumerate() {
        assert!(!is_solid(mesh), "{case}");
    }
}

#[test]
fn sheets_around_solids_do_not_depend_on_threads() {
    assert_steady(&Mesh::drum(48, 12, 8.0, -2.0).solid().1, 1.0, 0.1);
    assert_limited(&Mesh::cushion(20, 10.0, 1.5).solid().1, 1.0, 0.1);
}

/// Few triangles are left of a fine mesh: as many as the tolerance asks for.
#[test]
fn fine_meshes_become_few_triangles() {
    let count = |around: usize, tolerance: f64| {
        let mesh = Mesh::torus(2 * around, around, [15.0, 6.0]);
        (mesh.faces.len(), arranged(&mesh.lowered(), 1.0, tolerance).solid.mesh().triangles.len())
    };
    let [(_, coarse), (fine, few), (_, more)] = [count(32, 0.2), count(64, 0.2), count(64, 0.05)];
    assert!(few < fine / 2 && few < 3 * coarse / 2 && more > 2 * few, "{coarse} {few} {more} {fine}");
}

/// The way to a face across sides ends at the closest one, where the surface turns little.
#[test]
fn faces_below_places_are_found() {
    let mut random = Random(139);
    let mesh = Mesh::torus(40, 24, [15.0, 6.0]);
    let corners = mesh.corners();
    let skin = Skin::new(&corners, BOTH_SIDES, 1.0, 0.03, 2.0, 1e-9).unwrap();
    let mut found = 0;
    for _ in 0..300 {
        let from = random.next() as u32 % corners.len() as u32;
        let face = &corners[random.next() as usize % corners.len()];
        let up = unit(&std::array::from_fn(|axis| skin.normals[from as usize][axis] + random.share() - 0.5));
        let x: Point = std::array::from_fn(|axis| face[0][axis] + up[axis]);
        let square = |face: &[Point; 3]| {
            let way = subtract(&x, &closest_on_triangle(&x, &face[0], &face[1], &face[2]));
            dot(&way, &way)
        };
        let least = corners.iter().map(square).fold(f64::INFINITY, f64::min);
        found += u32::from(square(&corners[skin.near(from, &x) as usize]) < 1.02 * least + 1e-9);
    }
    assert!(found > 200, "{found}");
}

#[test]
fn sheets_do_not_depend_on_threads_and_can_be_stopped() {
    assert_steady(&Mesh::strip(60, 4, 15.0, 6.0, 1.0).lowered(), 1.0, 0.1);
    assert_steady(&Mesh::cushion(20, 10.0, 1.5).lowered(), 1.0, 0.1);
}

#[test]
fn limits_hold_for_sheets() {
    assert_limited(&Mesh::torus(40, 24, [15.0, 6.0]).lowered(), 1.0, 0.1);
}

//! Volumes, areas and moments against whole-number arithmetic, on meshes whose terms cancel.

use glam::DVec3;
use lacuna_kernel::measure::Interval;
use lacuna_kernel::measure::mass::{area_within, mass_properties, volume_within};
use lacuna_kernel::solid::TriMesh;

type Whole = [i128; 3];

fn random(state: &mut u64, digits: u32) -> i128 {
    // Knuth's linear congruential generator: its upper bits will do.
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    i128::from((*state as i64) >> (63 - digits))
}

fn vector(state: &mut u64, digits: u32) -> Whole {
    std::array::from_fn(|_| random(state, digits))
}

fn minus(a: Whole, b: Whole) -> Whole {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn cross(a: Whole, b: Whole) -> Whole {
    std::array::from_fn(|axis| a[(axis + 1) % 3] * b[(axis + 2) % 3] - a[(axis + 2) % 3] * b[(axis + 1) % 3])
}

fn dot(a: Whole, b: Whole) -> i128 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
}

/// A mesh with whole corners.
struct WholeMesh {
    corners: Vec<Whole>,
    triangles: Vec<[u32; 3]>,
}

impl WholeMesh {
    /// Parallelepipeds with edges of so many binary digits, at places of so many.
    fn parallelepipeds(state: &mut u64, count: u32, edges: u32, places: u32) -> Self {
        let mut mesh = Self { corners: Vec::new(), triangles: Vec::new() };
        while (mesh.corners.len() as u32) < 8 * count {
            let (place, [u, v, w]) = (vector(state, places), std::array::from_fn(|_| vector(state, edges)));
            let determinant = dot(u, cross(v, w));
            if determinant == 0 {
                continue;
            }
            let first = mesh.corners.len() as u32;
            let corner = |code: i128| {
                std::array::from_fn(|axis| place[axis] + (code & 1) * u[axis] + (code >> 1 & 1) * v[axis] + (code >> 2) * w[axis])
            };
            mesh.corners.extend((0..8).map(corner));
            for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
                for [a, b, c] in [[a, b, c], [a, c, d]] {
                    let turned = if determinant > 0 { [a, b, c] } else { [a, c, b] };
                    mesh.triangles.push(turned.map(|corner: u32| first + corner));
                }
            }
        }
        mesh
    }

    fn rounded(&self) -> TriMesh {
        let place = |corner: &Whole| DVec3::from_array(corner.map(|x| x as f64));
        TriMesh { vertices: self.corners.iter().map(place).collect(), triangles: self.triangles.clone() }
    }

    /// Six times the volume, 24 times the first moments and 120 times the second ones, about the first corner.
    fn moments(&self) -> (i128, Whole, [Whole; 3]) {
        let (mut six, mut first, mut second) = (0, [0; 3], [[0; 3]; 3]);
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|corner| minus(self.corners[corner as usize], self.corners[0]));
            let (own, s): (i128, Whole) = (dot(a, cross(b, c)), std::array::from_fn(|axis| a[axis] + b[axis] + c[axis]));
            six += own;
            for i in 0..3 {
                first[i] += own * s[i];
                for j in 0..3 {
                    second[i][j] += own * (a[i] * a[j] + b[i] * b[j] + c[i] * c[j] + s[i] * s[j]);
                }
            }
        }
        (six, first, second)
    }
}

/// That a quotient of whole numbers lies in an interval, up to the rounding of the quotient itself, and that the interval is narrow.
fn assert_holds(interval: Interval, over: i128, under: i128, widest: f64, what: &str) {
    let (whole, rest) = (over.div_euclid(under), over.rem_euclid(under));
    let exact = whole as f64 + rest as f64 / under as f64;
    let rounding = 2.0 * f64::EPSILON * exact.abs();
    assert!(interval.low - rounding <= exact && exact <= interval.high + rounding, "{what}: {exact:e} is not in {interval:?}");
    assert!(interval.width() <= widest, "{what}: {interval:?} around {exact:e} is {:e} wide, not {widest:e}", interval.width());
}

/// Bodies of some 60 mm that are up to 30 m apart.
#[test]
fn moments_of_bodies_far_apart() {
    let mut state = 1;
    for count in [1, 2, 3].repeat(100) {
        let mesh = WholeMesh::parallelepipeds(&mut state, count, 6, 14);
        let (six, first, second) = mesh.moments();
        let found = mass_properties(&mesh.rounded()).unwrap();
        let volume = six as f64 / 6.0;
        assert_holds(found.volume, six, 6, 1e-12 * volume, "volume");
        for axis in 0..3 {
            assert_holds(found.centroid[axis], mesh.corners[0][axis] * 4 * six + first[axis], 4 * six, 1e-11 * 32768.0, "centroid");
            for other in 0..3 {
                // v q - m m / v, with what they are multiples of.
                let central = |i: usize, j: usize| 4 * second[i][j] * six - 5 * first[i] * first[j];
                let own = if axis == other { (0..3).map(|k| central(k, k)).sum() } else { 0 };
                assert_holds(
                    found.inertia[axis][other],
                    own - central(axis, other),
                    480 * six,
                    1e-11 * volume * 32768.0_f64.powi(2),
                    "inertia",
                );
            }
        }
    }
}

/// Cubes of a metre and less that are up to a thousand kilometres apart: in single sums every digit of the volume is lost.
#[test]
fn volumes_of_bodies_very_far_apart() {
    let mut state = 2;
    for count in [1, 2, 5].repeat(100) {
        let mesh = WholeMesh::parallelepipeds(&mut state, count, 9, 30);
        let six = mesh.moments().0;
        assert_holds(volume_within(&mesh.rounded()), six, 6, 1e-12 * six as f64 + 1e-2, "volume");
    }
}

/// Triangles a kilometre long and as high as an atom.
#[test]
fn areas_of_needles() {
    let mut state = 3;
    for _ in 0..1000 {
        let (along, off) = (vector(&mut state, 12), vector(&mut state, 2));
        let far: Whole = std::array::from_fn(|axis| along[axis] << 14);
        let beside: Whole = std::array::from_fn(|axis| along[axis] * 9973 + off[axis]);
        let normal = cross(far, beside);
        let place = |corner: Whole| DVec3::from_array(corner.map(|x| x as f64));
        let mesh = TriMesh { vertices: vec![DVec3::ZERO, place(far), place(beside)], triangles: vec![[0, 1, 2]] };
        let exact = 0.5 * (dot(normal, normal) as f64).sqrt();
        let found = area_within(&mesh);
        assert!(found.low - f64::EPSILON * exact <= exact && exact <= found.high + f64::EPSILON * exact, "{exact:e} is not in {found:?}");
        assert!(found.width() <= 1e-14 * exact + 1e-9, "{found:?} around {exact:e}");
    }
}

/// What is proven to be nothing has no centroid.
#[test]
fn what_has_no_volume_has_no_moments() {
    let mesh = TriMesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y], triangles: vec![[0, 1, 2], [0, 2, 1]] };
    assert!(mass_properties(&mesh).is_none() && volume_within(&mesh).low <= 0.0 && volume_within(&mesh).high >= 0.0);
    assert!(mass_properties(&TriMesh::default()).is_none());
}

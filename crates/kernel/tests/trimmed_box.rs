//! Boxes of trimmed surfaces: random patches and loops against samples that climb within what is kept.

use crate::schemes::{Random, blossom_point, homogeneous, lower, project};
use glam::{DVec2, DVec3};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::measure::{Interval, extent_along};
use lacuna_kernel::model::{AffineMap, ControlNet, CurveScheme, Group, Part, Shape, TensorProduct, Trim, TrimCurve};
use std::f64::consts::TAU;

/// A spline surface of clamped or open knots.
struct Patch {
    degrees: [usize; 2],
    knots: [Vec<f64>; 2],
    size: [usize; 2],
    points: Vec<DVec3>,
    weights: Option<Vec<f64>>,
}

impl Patch {
    fn random(random: &mut Random, round: usize) -> Self {
        let degrees = [0, 1].map(|_| 1 + random.below(3));
        let size = degrees.map(|degree| degree + 1 + random.below(3));
        let knots = [0, 1].map(|k| {
            // Kinks and smooth borders of spans, and whole patches.
            let (degree, count) = (degrees[k], size[k]);
            let mut knots: Vec<f64> = (0..=count + degree).map(|j| (j.clamp(degree, count) - degree) as f64).collect();
            if round.is_multiple_of(3) {
                (0..knots.len()).for_each(|j| knots[j] = j as f64 + random.between(0.0, 0.9));
            } else if round % 3 == 1 && count > degree + 1 {
                let inner = knots[degree + 1];
                knots[degree + 1..(2 * degree + 1).min(count)].fill(inner);
            }
            knots
        });
        let count = size[0] * size[1];
        let mut points = random.points(count);
        if round % 4 == 1 {
            // A sheet that is nearly flat: what it reaches is on the loops.
            for (index, point) in points.iter_mut().enumerate() {
                *point = DVec3::new((index / size[1]) as f64, (index % size[1]) as f64, 0.0) * 5.0 + 0.02 * *point;
            }
        }
        if round % 4 == 2 {
            // Level along u.
            (0..count).for_each(|index| points[index].z = points[index % size[1]].z);
        }
        let weights = (round % 5 > 2).then(|| (0..count).map(|_| random.between(0.3, 3.0)).collect());
        Self { degrees, knots, size, points, weights }
    }

    fn domain(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|k| [self.knots[k][self.degrees[k]], self.knots[k][self.size[k]]])
    }

    fn at(&self, parameter: DVec2) -> DVec3 {
        let row = |i: usize| {
            let points: Vec<[f64; 4]> = (i * self.size[1]..(i + 1) * self.size[1])
                .map(|k| homogeneous(self.points[k], self.weights.as_ref().map_or(1.0, |weights| weights[k])))
                .collect();
            blossom_point(self.degrees[1], &self.knots[1], &points, parameter.y)
        };
        let column: Vec<[f64; 4]> = (0..self.size[0]).map(row).collect();
        project(blossom_point(self.degrees[0], &self.knots[0], &column, parameter.x))
    }

    fn trimmed(&self, trim: Trim) -> Shape {
        let schemes = [0, 1].map(|k| CurveScheme::Nurbs { degree: self.degrees[k], knots: self.knots[k].clone() }).to_vec();
        let control_points = ControlNet { size: self.size.to_vec(), points: self.points.clone(), weights: self.weights.clone() };
        Shape::TensorProduct(TensorProduct { schemes, control_points, separate: false, trim: Some(trim) })
    }
}

/// What is kept: a disc, its hole, both stretched; or the polygon of its rim.
struct Kept {
    centre: DVec2,
    radii: DVec2,
    /// Share of the radii where it starts.
    inner: f64,
    corners: Option<usize>,
}

impl Kept {
    /// The parameter at a share of the radius and an angle, both as shares.
    fn place(&self, [radius, turn]: [f64; 2]) -> DVec2 {
        let corner = |k: f64| DVec2::from_angle(TAU * k);
        let rim = match self.corners {
            None => corner(turn),
            Some(count) => {
                let step = (turn.rem_euclid(1.0) * count as f64).clamp(0.0, count as f64 * (1.0 - f64::EPSILON));
                let (first, share) = (step.floor(), step.fract());
                corner(first / count as f64).lerp(corner((first + 1.0) / count as f64), share)
            }
        };
        self.centre + self.radii * (self.inner + (1.0 - self.inner) * radius.clamp(0.0, 1.0)) * rim
    }

    /// Whether a parameter is kept.
    fn holds(&self, parameter: DVec2) -> bool {
        let place = (parameter - self.centre) / self.radii;
        let rim = self.corners.map_or(1.0, |count| {
            let sector = TAU / count as f64;
            (0.5 * sector).cos() / (place.to_angle().rem_euclid(sector) - 0.5 * sector).cos()
        });
        (self.inner * rim..=rim).contains(&place.length())
    }

    fn loop_at(&self, share: f64) -> Vec<TrimCurve> {
        let radii = self.radii * share;
        if let Some(count) = self.corners {
            let corner = |k: usize| self.centre + radii * DVec2::from_angle(TAU * (k % count) as f64 / count as f64);
            return vec![TrimCurve::Polyline((0..=count).map(corner).collect())];
        }
        let points = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)];
        let control_points = points.map(|(x, y)| self.centre + radii * DVec2::new(f64::from(x), f64::from(y))).to_vec();
        let knots = vec![0.0, 0.0, 0.0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0, 1.0, 1.0];
        let weights = Some((0..9).map(|k| if k % 2 == 0 { 1.0 } else { 0.5_f64.sqrt() }).collect());
        vec![TrimCurve::Spline { scheme: CurveScheme::Nurbs { degree: 2, knots }, control_points, weights }]
    }

    fn trim(&self) -> Trim {
        Trim { outer: Some(self.loop_at(1.0)), inner: if self.inner > 0.0 { vec![self.loop_at(self.inner)] } else { Vec::new() } }
    }
}

/// The most that a function of [0, 1] x R reaches, from a grid's best places.
fn climbed(value: &dyn Fn([f64; 2]) -> f64) -> f64 {
    const RADII: usize = 24;
    const TURNS: usize = 160;
    let place = |i: usize, j: usize| [i as f64 / RADII as f64, j as f64 / TURNS as f64];
    let grid: Vec<Vec<f64>> = (0..=RADII).map(|i| (0..TURNS).map(|j| value(place(i, j))).collect()).collect();
    // From wherever neighbours are lower.
    let mut best = Vec::new();
    // At the centre all turns are one place.
    for i in 1..=RADII {
        for j in 0..TURNS {
            let around = ((i - 1).max(1)..=(i + 1).min(RADII)).flat_map(|i| [TURNS - 1, 0, 1].map(|by| grid[i][(j + by) % TURNS]));
            if around.fold(f64::NEG_INFINITY, f64::max) <= grid[i][j] {
                best.push((grid[i][j], place(i, j)));
            }
        }
    }
    best.sort_by(|a: &(f64, [f64; 2]), b| b.0.total_cmp(&a.0));
    best.truncate(4);
    // Grids around the best, finer where nothing is higher.
    let climb = |&(mut most, mut centre): &(f64, [f64; 2])| {
        let mut reach = [1.5 / RADII as f64, 8.0 / TURNS as f64];
        // Bounded: a ridge may be long.
        for _ in 0..400 {
            let (before, from) = (most, centre);
            let around =
                (0..81).map(|k| [from[0] + reach[0] * f64::from(k / 9 - 4) / 4.0, from[1] + reach[1] * f64::from(k % 9 - 4) / 4.0]);
            for place in around.map(|place| [place[0].clamp(0.0, 1.0), place[1]]) {
                let higher = value(place);
                if higher > most {
                    (most, centre) = (higher, place);
                }
            }
            if most == before {
                reach = reach.map(|length| 0.5 * length);
                if reach[0] < 1e-10 {
                    break;
                }
            }
        }
        most
    };
    best.iter().map(climb).fold(f64::NEG_INFINITY, f64::max)
}

/// The most that a function reaches in [0, 1].
fn climbed_along(value: &dyn Fn(f64) -> f64) -> f64 {
    const STEPS: i32 = 600;
    let at = |k: i32| f64::from(k) / f64::from(STEPS);
    let grid: Vec<f64> = (0..=STEPS).map(|k| value(at(k))).collect();
    // From wherever neighbours are lower.
    let is_top = |k: usize| grid[k] >= grid[k.saturating_sub(1)] && grid[k] >= grid[(k + 1).min(grid.len() - 1)];
    let climb = |k: usize| {
        let (mut most, mut centre) = (grid[k], at(k as i32));
        let mut reach = 2.0 / f64::from(STEPS);
        while reach > 1e-10 {
            let from = centre;
            for t in (-8..=8).map(|k| (from + reach * f64::from(k) / 8.0).clamp(0.0, 1.0)) {
                let higher = value(t);
                if higher > most {
                    (most, centre) = (higher, t);
                }
            }
            reach *= 0.7;
        }
        most
    };
    (0..grid.len()).filter(|&k| grid[k] > f64::NEG_INFINITY && is_top(k)).map(climb).fold(f64::NEG_INFINITY, f64::max)
}

fn assert_is(found: Interval, reached: f64, what: &str) {
    assert!(reached <= found.high + 1e-11, "{what}: {reached} is above {found:?}");
    assert!(found.low <= reached + 1e-6, "{what}: {found:?} is above {reached}");
    assert!(found.width() <= 2e-9, "{what}: {found:?} is wide");
}

#[test]
fn trimmed_patches_reach_as_far_as_samples_climb() {
    let mut random = Random(31);
    for round in 0..36 {
        let patch = Patch::random(&mut random, round);
        let domain = patch.domain();
        let [low, high] = [0, 1].map(|end| DVec2::new(domain[0][end], domain[1][end]));
        // Loops that touch the border of the domain, too.
        let radii =
            (high - low) * if round % 7 == 0 { DVec2::splat(0.5) } else { DVec2::new(random.between(0.1, 0.5), random.between(0.1, 0.5)) };
        let room = high - low - 2.0 * radii;
        let centre = low + radii + DVec2::new(random.between(0.0, 1.0), random.between(0.0, 1.0)) * room;
        let inner = if round % 2 == 0 { 0.0 } else { random.between(0.2, 0.9) };
        let corners = (round % 3 == 2).then(|| 3 + random.below(6));
        let kept = Kept { centre, radii, inner, corners };
        let attractor = lower(patch.trimmed(kept.trim())).attractor;
        let at = |place: [f64; 2]| patch.at(kept.place(place).clamp(low, high));
        for direction in [DVec3::X, DVec3::Y, DVec3::Z, random.points(1)[0].normalize()] {
            let found = extent_along(&attractor, direction, &Budget::default()).unwrap();
            // Along creases no sample climbs: these are sampled by themselves.
            let reached = |sign: f64| {
                let on_crease = |k: usize, knot: f64, t: f64| {
                    let mut parameter = low.lerp(high, t);
                    parameter[k] = knot;
                    if kept.holds(parameter) { sign * patch.at(parameter).dot(direction) } else { f64::NEG_INFINITY }
                };
                let knots = (0..2)
                    .flat_map(|k| patch.knots[k].iter().filter(move |&&knot| low[k] < knot && knot < high[k]).map(move |&knot| (k, knot)));
                let along_creases = knots.map(|(k, knot)| climbed_along(&|t| on_crease(k, knot, t))).fold(f64::NEG_INFINITY, f64::max);
                along_creases.max(climbed(&|place| sign * at(place).dot(direction)))
            };
            let (most, least) = (reached(1.0), -reached(-1.0));
            assert_is(found[1], most, &format!("round {round}, {direction}"));
            assert_is(Interval::new(-found[0].high, -found[0].low), -least, &format!("round {round}, -{direction}"));
        }
    }
}

#[test]
fn a_hole_on_a_hilltop_leaves_its_rim() {
    // z = 1 - x^2 - y^2 on [-1, 1]^2 as a Bezier patch; the hole's rim is a circle, level all around, away from the grid of halves.
    let bend = [-1.0, 1.0, -1.0];
    let point = |i: usize, j: usize| DVec3::new(i as f64 - 1.0, j as f64 - 1.0, 1.0 + bend[i] + bend[j]);
    let points = (0..9).map(|k| point(k / 3, k % 3)).collect();
    let kept = Kept { centre: DVec2::splat(0.5), radii: DVec2::splat(0.45), inner: 0.37, corners: None };
    let schemes = vec![CurveScheme::Bezier; 2];
    let shape = |weights| {
        let control_points = ControlNet { size: vec![3, 3], points: Vec::clone(&points), weights };
        Shape::TensorProduct(TensorProduct { schemes: schemes.clone(), control_points, separate: false, trim: Some(kept.trim()) })
    };
    // Bezier points -1, 1, -1 are those of -(2 t - 1)^2: -x^2 and -y^2 with a top of 0 each.
    let top = 1.0 - (2.0 * 0.45 * 0.37_f64).powi(2);
    let tilt = AffineMap { linear: glam::DMat3::from_rotation_y(0.3), translation: DVec3::new(1e3, 0.0, 0.0) };
    let part = |transform| Part { name: None, transform, shape: shape(None), radius: None };
    for (shape, direction, shift) in [
        (shape(None), DVec3::Z, 0.0),
        (Shape::Group(Group { parts: vec![part(None)], joins: Vec::new() }), DVec3::Z, 0.0),
        (
            Shape::Group(Group { parts: vec![part(Some(tilt))], joins: Vec::new() }),
            tilt.linear * DVec3::Z,
            (tilt.linear * DVec3::Z).x * 1e3,
        ),
    ] {
        let found = extent_along(&lower(shape).attractor, direction, &Budget::default()).unwrap()[1];
        assert!(found.low <= top + shift && top + shift <= found.high && found.width() <= 1e-8, "{top} {found:?}");
    }
}

//! Whether the topology of a dilation is that of another one of sites that are nearly the same.
//!
//! Let f be the distance from the sites S, and g that from others S', where every place of each is within e of one of the other, so that |f - g| <= e everywhere. Where min(f, g) <= r <= max(f, g), both are within e of r. Let every place x there have a unit vector v with
//! v . (x - c) > 0 for all places c of S and of S' that are closest to x. Closest places depend on x upper semicontinuously: so that holds around all these x, for a smooth field of directions. Along it f and g rise, faster than some rate as the set is compact,
//! and against it they fall: so what is in one of both dilations goes, within this set, to where it is in both, and what was in both stays. Each dilation is retracted to their intersection: both have its topology. Along the field their complements are, to the complement of their union. Where solids are filled, the same holds outside of
//! these.
//!
//! A place c of S closest to x is within e of one of S' that is no farther from x than r + 2 e, and v . (x - c) is no less than there but for e. So only S' is asked, a union of convex figures, none of which is nearer to x than r - e. Let d be how far x is from one of them, along the unit vector u from the closest place.
//! What x is from other places of it has a part of d at least along u: those no farther than r + 2 e are off d u by s = sqrt((r + 2 e)^2 - (r - e)^2) at most. So v . u > (s + e) / (r - e) must hold for all figures that are within r + 2 e of x; of a point, which has no other places, s is 0. For one figure alone u itself will do.
//!
//! That is asked cube by cube. From the centre y of one to another place x, h from it, the direction from a figure changes by no more than h / t, with t the lesser of both distances: on the surface of a convex set's dilation by t normals turn by as much as the way over t, and projecting places farther out onto it brings them
//! closer together. Distances here are those in space: with deficits squares only differ by the same.

use super::cubes::Cube;
use super::figure::{Figure, Outline, box_of};
use crate::attractor::cell::{Point, between, cross, distance_squared, dot, subtract};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::solid::Inside;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Halves of the diagonals of cubes in which directions are looked for, and of those that are halved no more, in units of the radius.
const WIDEST: f64 = 1.0;
const NARROWEST: f64 = 1.0 / 512.0;
/// Looks at figures at most: in any case, and for each of them.
const FEW_LOOKS: usize = 1_000_000;
const LOOKS: usize = 4_000;
/// Of more figures pairs are not looked at; of few the cones around all triples of directions away from them are, too.
const MANY: usize = 64;
const FEW: usize = 10;
/// Steps to a direction.
const STEPS: u32 = 24;
/// Sums of directions that are longer than this have a direction of their own.
const LEAST_SUM: f64 = 1e-6;
/// The cosine of the angle between ways from two figures that a place may be between.
const OPPOSITE: f64 = -0.7;
/// Ways that are longer than this, in units of the radius, have a direction.
const LEAST_WAY: f64 = 1e-3;

/// Figures whose dilation is compared with that of sites that are nearly the same.
pub(super) struct Steady<'a> {
    pub(super) figures: &'a [Figure],
    /// r: the radius, with deficits.
    pub(super) radius: f64,
    /// e: how far places of figures and of sites are from each other at most, and what rounding adds.
    pub(super) moved: f64,
    /// What these enclose is filled.
    pub(super) solids: &'a [Inside<'a>],
}

/// A figure that comes so near to a cube that it matters there.
struct Near<'a> {
    figure: &'a Figure,
    /// The unit vector from its closest place to the cube's centre, and how far that is; 0 where it is too near to have one.
    away: Point,
    distance: f64,
}

impl Steady<'_> {
    /// Whether the sites' dilation has the topology of the figures' own. False where that is not shown.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn is_shown(&self, budget: &Budget) -> Result<bool, Stopped> {
        // One figure alone must tell, see above.
        if self.figures.iter().any(|figure| self.aside(figure) + self.moved >= figure.in_space(self.radius - self.moved)) {
            return Ok(false);
        }
        let [low, high] = box_of(self.figures.iter().flat_map(Figure::corners));
        let side = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        let cube = Cube { centre: between(&low, &high, 0.5), half: 0.5 * side + self.radius + 2.0 * self.moved };
        let all: Vec<&Figure> = self.figures.iter().collect();
        self.holds(&cube, &all, &AtomicUsize::new(FEW_LOOKS + LOOKS * self.figures.len()), budget)
    }

    /// s: how far closest places may be off the way from a figure; a point has no others.
    fn aside(&self, figure: &Figure) -> f64 {
        if matches!(figure.outline, Outline::Point(_)) {
            return 0.0;
        }
        (3.0 * self.moved * (2.0 * self.radius + self.moved)).sqrt()
    }

    /// Whether it is shown in a cube, which some figures may reach; as long as some looks at figures are `left`.
    fn holds(&self, cube: &Cube, figures: &[&Figure], left: &AtomicUsize, budget: &Budget) -> Result<bool, Stopped> {
        budget.cancel.check()?;
        if left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(figures.len())).is_err() {
            left.store(0, Ordering::Relaxed);
            return Ok(false);
        }
        let Self { radius, moved, .. } = *self;
        let half = cube.half_diagonal();
        let mut near = Vec::new();
        let mut is_in_question = false;
        for &figure in figures {
            let way = subtract(&cube.centre, &figure.closest(&cube.centre));
            let distance = dot(&way, &way).sqrt();
            if distance + half < figure.in_space(radius - moved) {
                // All places are farther within than any in question.
                return Ok(true);
            }
            let away = if distance > LEAST_WAY * radius { way.map(|part| part / distance) } else { [0.0; 3] };
            // The distance is convex, and so no less than it grows along the way.
            let least = distance - if away == [0.0; 3] { half } else { cube.half_along(&away) };
            if least <= figure.in_space(radius + 2.0 * moved) {
                is_in_question |= least <= figure.in_space(radius + moved);
                near.push(Near { figure, away, distance });
            }
        }
        // Else all places are farther out than any in question, or one figure tells.
        if !is_in_question || near.len() == 1 {
            return Ok(true);
        }
        if half <= WIDEST * radius
            && (self.is_told(cube, &near) || (near.len() <= MANY && self.is_between(cube, &near)) || self.is_filled(cube, &near))
        {
            return Ok(true);
        }
        if half <= NARROWEST * radius {
            left.store(0, Ordering::Relaxed);
            return Ok(false);
        }
        let figures: Vec<&Figure> = near.iter().map(|near| near.figure).collect();
        let parts = (0..8).into_par_iter().map(|number| self.holds(&cube.part(number), &figures, left, budget));
        parts.try_reduce(|| true, |a, b| Ok(a && b))
    }

    /// Whether a direction is found for all figures that matter in a cube, or for each of them one for all that may matter together with it.
    fn is_told(&self, cube: &Cube, near: &[Near<'_>]) -> bool {
        let all: Vec<&Near<'_>> = near.iter().collect();
        self.have_direction(cube, &all)
            || near.len() <= MANY
                && near.iter().all(|own| {
                    let with: Vec<&Near<'_>> = near.iter().filter(|other| !self.are_apart(cube, own, other)).collect();
                    with.len() < all.len() && self.have_direction(cube, &with)
                })
    }

    /// Whether a direction is found in which all of some figures are left behind: of few, the middle of the narrowest cone around the directions away from them is looked for, on whose rim two or three of these are.
    fn have_direction(&self, cube: &Cube, near: &[&Near<'_>]) -> bool {
        let (half, low) = (cube.half_diagonal(), |direction: &Point| dot(direction, &cube.centre) - cube.half_along(direction));
        let leads_all = |towards: &Point| {
            let length = dot(towards, towards).sqrt();
            let direction = towards.map(|part| part / length);
            let low = low(&direction);
            length > LEAST_SUM
                && near.iter().all(|near| self.leads(near, &direction, half) || low - near.figure.highest(&direction) > self.moved)
        };
        let away = |place: usize| &near[place].away;
        let sum = |places: &[usize]| -> Point { std::array::from_fn(|axis| places.iter().map(|&place| away(place)[axis]).sum()) };
        let count = near.len();
        let pairs = || (0..count).flat_map(|q| (0..q).map(move |p| (p, q)));
        let widest = || pairs().min_by(|a, b| dot(away(a.0), away(a.1)).total_cmp(&dot(away(b.0), away(b.1))));
        let across = |p: usize, q: usize, r: usize| {
            let normal = cross(&subtract(away(q), away(p)), &subtract(away(r), away(p)));
            if dot(&normal, away(p)) < 0.0 { normal.map(|part| -part) } else { normal }
        };
        // Towards the figure that is left behind least, again and again: to the middle of the cone (Badoiu and Clarkson, on the sphere).
        let led = || {
            let mut towards = sum(&(0..count).collect::<Vec<usize>>());
            for step in 0..STEPS {
                let length = dot(&towards, &towards).sqrt();
                if length <= LEAST_SUM {
                    return false;
                }
                if leads_all(&towards) {
                    return true;
                }
                let least = near.iter().min_by(|a, b| dot(&towards, &a.away).total_cmp(&dot(&towards, &b.away)));
                let Some(least) = least else { return false };
                let share = 1.0 / f64::from(step + 2);
                towards = std::array::from_fn(|axis| towards[axis] / length + share * (least.away[axis] - towards[axis] / length));
            }
            false
        };
        led()
            || (count <= MANY && widest().is_some_and(|(p, q)| leads_all(&sum(&[p, q]))))
            || (count <= FEW && pairs().any(|(p, q)| (0..p).any(|r| leads_all(&across(r, p, q)))))
    }

    /// Whether a direction leads away from a figure, wherever in a cube, half of whose diagonal is `half`, this matters.
    fn leads(&self, near: &Near<'_>, direction: &Point, half: f64) -> bool {
        let Self { radius, moved, .. } = *self;
        let least = near.figure.in_space(radius - moved);
        let turned = half / near.distance.min(least);
        // The angle by which unit vectors differ that are so far from each other.
        let angle = dot(direction, &near.away).clamp(-1.0, 1.0).acos() + 2.0 * (0.5 * turned).min(1.0).asin();
        near.away != [0.0; 3] && angle < ((self.aside(near.figure) + moved) / least).min(1.0).acos()
    }

    /// Whether linear functions below both distances show that no place in a cube is so near to two figures that both matter.
    fn are_apart(&self, cube: &Cube, own: &Near<'_>, other: &Near<'_>) -> bool {
        let beyond = |near: &Near<'_>| near.distance - near.figure.in_space(self.radius + 2.0 * self.moved);
        let slope = std::array::from_fn(|axis| own.away[axis] + other.away[axis]);
        own.away != [0.0; 3] && other.away != [0.0; 3] && beyond(own) + beyond(other) > cube.half_along(&slope)
    }

    /// Whether two figures are so near to each other that one of them is nearer than any in question, wherever in a cube: the sum of their distances is convex, and so nowhere more than at a corner.
    fn is_between(&self, cube: &Cube, near: &[Near<'_>]) -> bool {
        let least = |figure: &Figure| figure.in_space(self.radius - self.moved);
        let distance = |figure: &Figure, x: &Point| distance_squared(x, &figure.closest(x)).sqrt();
        let are_near = |one: &Figure, other: &Figure| {
            let sum = least(one) + least(other);
            cube.corners().all(|corner| distance(one, &corner) + distance(other, &corner) < sum)
        };
        let pairs = near.iter().enumerate().flat_map(|(place, one)| near[..place].iter().map(move |other| (one, other)));
        let mut opposite = pairs.filter(|(one, other)| {
            dot(&one.away, &other.away) < OPPOSITE && one.distance + other.distance < least(one.figure) + least(other.figure)
        });
        opposite.any(|(one, other)| are_near(one.figure, other.figure))
    }

    /// Whether all of a cube is inside of a solid, whose surface is among the figures but for what was moved.
    fn is_filled(&self, cube: &Cube, near: &[Near<'_>]) -> bool {
        let is_clear = || near.iter().all(|near| near.distance > cube.half_diagonal() + self.moved);
        !self.solids.is_empty() && is_clear() && self.solids.iter().any(|solid| solid.winding(DVec3::from_array(cube.centre)) > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::critical_values;
    use super::*;
    use crate::attractor::cell::{Site, unit};
    use crate::dilation::tree::Weighted;
    use crate::split_mix::Random;

    fn is_shown(figures: &[Figure], moved: f64, solids: &[Inside<'_>]) -> bool {
        Steady { figures, radius: 1.0, moved, solids }.is_shown(&Budget::default()).unwrap()
    }

    fn vector(random: &mut Random) -> Point {
        std::array::from_fn(|_| 2.0 * random.share() - 1.0)
    }

    /// Of points, with deficits or without, whose critical values are known from closed forms: never where one is as near to the radius as what is off, and nearly always where none is near.
    #[test]
    fn nothing_is_shown_beside_a_critical_value() {
        let mut random = Random(17);
        let (mut beside, mut shown, mut clear) = (0, 0, 0);
        for round in 0..3_000 {
            let count = 2 + round % 6;
            let mut points: Vec<(Point, f64)> = (0..count)
                .map(|_| {
                    let deficit = if round % 2 == 0 { 0.0 } else { 0.4 * random.share() };
                    (vector(&mut random).map(|x| 1.4 * x), deficit)
                })
                .collect();
            let moved = [1e-6, 1e-4, 1e-3][round % 3];
            // One of the critical values where it is wanted: all lengths, and squares of deficits, in proportion.
            let values = critical_values(&points);
            if let Some(&(value, _)) = values.get((random.next() % 8) as usize)
                && value > 0.3
            {
                let share = (1.0 + moved * [0.9, -0.9, 3.0, -3.0, 30.0, 0.0][round % 6]) / value;
                points.iter_mut().for_each(|(at, deficit)| (*at, *deficit) = (at.map(|x| x * share), *deficit * share * share));
            }
            let values = critical_values(&points);
            let figures: Vec<Figure> = points.iter().map(|&(at, deficit)| Weighted { site: Site::Point(at), deficit }.into()).collect();
            let is_near = |by: f64| values.iter().any(|(value, _)| (value - 1.0).abs() <= by);
            let told = is_shown(&figures, moved, &[]);
            if is_near(moved) {
                beside += 1;
                assert!(!told, "{round}: {values:?}, {moved}");
            } else if !is_near(0.02) {
                clear += 1;
                shown += usize::from(told);
            }
        }
        assert!(beside > 600 && clear > 600 && 20 * shown > 19 * clear, "{beside} beside one, {shown} of {clear} shown");
    }

    /// Points that are moved by no more than is told: where it is shown, the alternating sum of critical points below the radius, the Euler number of the union of balls, stays; and it often does not where it is not shown.
    #[test]
    fn what_is_moved_keeps_its_euler_number() {
        let mut random = Random(19);
        let euler = |points: &[(Point, f64)]| {
            let below = critical_values(points).into_iter().filter(|&(value, _)| value < 1.0);
            let signs = below.map(|(_, count)| if count % 2 == 0 { -1 } else { 1 });
            points.len() as i64 + signs.sum::<i64>()
        };
        let (mut shown, mut differ) = (0, 0);
        for round in 0..2_000 {
            let size = 1.0 + random.share();
            let points: Vec<(Point, f64)> = (0..3 + round % 5).map(|_| (vector(&mut random).map(|x| size * x), 0.0)).collect();
            let moved = [0.001, 0.01, 0.02][round % 3];
            let others: Vec<(Point, f64)> = points
                .iter()
                .map(|(at, _)| {
                    let way = unit(&vector(&mut random)).map(|x| moved * x);
                    (std::array::from_fn(|axis| at[axis] + way[axis]), 0.0)
                })
                .collect();
            let figures: Vec<Figure> = others.iter().map(|&(at, deficit)| Weighted { site: Site::Point(at), deficit }.into()).collect();
            let is_same = euler(&points) == euler(&others);
            differ += usize::from(!is_same);
            if is_shown(&figures, moved, &[]) {
                shown += 1;
                assert!(is_same, "{round}: {points:?}, {moved}");
            }
        }
        assert!(shown > 1_000 && differ > 20, "{shown} shown, {differ} differ");
        // What is moved by as much as the radius, or nearly, tells nothing; nor do balls of no radius.
        let one = |deficit: f64| -> [Figure; 1] { [Weighted { site: Site::Point([0.0; 3]), deficit }.into()] };
        assert!(is_shown(&one(0.0), 0.01, &[]) && !is_shown(&one(0.0), 0.5, &[]) && !is_shown(&one(1.0 - 1e-6), 1e-5, &[]));
    }

    /// Two plates, wires, or a wire and a plate, as far from each other as nearly two radii: never shown where they may touch, and mostly where they do or do not for sure. Also where they cross, bend, or end.
    #[test]
    fn walls_and_wires_are_told() {
        let mut random = Random(23);
        let plate = |z: f64| -> [Figure; 2] {
            let at = |x: f64, y: f64| [x, y, z];
            [[at(0.0, 0.0), at(9.0, 0.0), at(9.0, 7.0)], [at(0.0, 0.0), at(9.0, 7.0), at(0.0, 7.0)]]
                .map(|corners| Weighted { site: Site::Triangle(corners), deficit: 0.0 }.into())
        };
        let wire = |ends: [Point; 2]| -> Figure { Weighted { site: Site::Segment(ends), deficit: 0.0 }.into() };
        let (mut clear, mut shown) = (0, 0);
        for round in 0..60 {
            let moved = [1e-6, 1e-4][round % 2];
            for (gap, is_told) in [(0.0, false), (1.0, false), (-1.5, false), (200.0, true), (-200.0, true)] {
                let height = 2.0 + gap * moved;
                let slope = 0.3 * random.share();
                let [low, high] = [[1.0, 2.0, height], [8.0, 2.0 + 3.0 * random.share(), height]];
                let figures: Vec<Figure> = match round % 3 {
                    0 => plate(0.0).into_iter().chain(plate(height)).collect(),
                    1 => plate(0.0).into_iter().chain([wire([low, high])]).collect(),
                    _ => vec![wire([[0.0, 0.0, 0.0], [9.0, slope, 0.0]]), wire([[4.0, -4.0, height], [5.0, 4.0, height]])],
                };
                let told = is_shown(&figures, moved, &[]);
                assert!(is_told || !told, "{round}: {gap}, {moved}");
                (clear, shown) = (clear + u32::from(is_told), shown + u32::from(told));
            }
            // A bent wire, plates at an angle, and a wire through a plate.
            let way = unit(&[-0.8, random.share(), random.share()]);
            let bent = [wire([[0.0; 3], [5.0, 0.0, 0.0]]), wire([[0.0; 3], way.map(|x| 5.0 * x)])];
            let through = plate(0.0).into_iter().chain([wire([[3.0, 3.0, -4.0], [4.0, 4.0, 5.0]])]).collect::<Vec<Figure>>();
            assert!(is_shown(&bent, moved, &[]) && is_shown(&through, moved, &[]), "{round}");
        }
        assert!(clear == 120 && shown > 100, "{shown} of {clear} shown");
    }

    /// A plate as thick as two radii: critical places are inside, which matters for its surface alone.
    #[test]
    fn what_is_filled_does_not_matter() {
        let corner = |k: usize| -> Point { std::array::from_fn(|axis| if k >> axis & 1 == 1 { [9.0, 7.0, 2.0][axis] } else { 0.0 }) };
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles: Vec<[u32; 3]> = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let figures: Vec<Figure> = triangles
            .iter()
            .map(|corners| Weighted { site: Site::Triangle(corners.map(|k| corner(k as usize))), deficit: 0.0 }.into())
            .collect();
        let mesh = crate::solid::TriMesh { vertices: (0..8).map(|k| DVec3::from_array(corner(k))).collect(), triangles };
        assert!(!is_shown(&figures, 1e-5, &[]));
        assert!(is_shown(&figures, 1e-5, &[Inside::new(&mesh)]));
    }
}

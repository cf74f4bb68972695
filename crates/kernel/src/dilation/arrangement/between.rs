//! Whether a triangle is between two distances from convex bodies.

use super::super::convex::Convex;
use crate::attractor::cell::{Point, between, distance_squared, dot, subtract, unit};
use crate::measure::contact::closest_on_segments;
use crate::measure::triangle::closest_on_triangle;

/// How often a triangle is halved at most that bodies are not shown to be near to, how many parts are looked at, how many times the reach the longest side of one is at least that is halved unasked, and how many corners what is left of one may have.
const DEPTH: u32 = 24;
const MOST_PARTS: u32 = 1 << 18;
const WIDE: f64 = 4.0;
const MOST_CORNERS: usize = 16;
/// How many times the most that is left of a squared distance the longest side's square is at least where a triangle is halved unasked: one body is near to little of it.
const ASKED: f64 = 10.0;
/// What rounding adds to a radius at most, as a share of it.
const ROUNDED: f64 = 1e-12;

/// The hull of a segment's ends, or of a triangle's corners.
pub(super) trait Body: Convex {
    fn corners(&self) -> impl AsRef<[Point]>;

    /// Whether it may be as near to a place as a distance, at a glance.
    #[inline]
    fn may_reach(&self, _: &Point, _: f64) -> bool {
        true
    }

    /// Whether a plane across a direction parts it from a triangle by a distance.
    #[inline]
    fn is_parted(&self, triangle: &[Point; 3], direction: &Point, least: f64) -> bool {
        lowest(triangle, direction) - self.highest(direction) >= least
    }

    /// Where a triangle is nearer to it than a distance, and what is close to that place, unless a plane parts them by as much: the one across the way between their closest places, which are at a corner of either or on two sides.
    fn too_near(&self, triangle: &[Point; 3], least: f64) -> Option<[Point; 2]> {
        let ([a, b, c], theirs) = (triangle, self.corners());
        let theirs = theirs.as_ref();
        let corners = triangle.iter().map(|corner| [*corner, self.closest(corner)]);
        let of_theirs = theirs.iter().map(|corner| [closest_on_triangle(corner, a, b, c), *corner]);
        let side = |corners: &[Point], k: usize| [corners[k], corners[(k + 1) % corners.len()]];
        let count = if theirs.len() > 2 { theirs.len() } else { 1 };
        let sides = (0..3 * count).map(|k| {
            let (q, p) = closest_on_segments(&side(triangle, k / count), &side(theirs, k % count));
            [q, p]
        });
        let all = corners.chain(of_theirs).chain(sides);
        let [q, p] = all.min_by(|[a, b], [c, d]| distance_squared(a, b).total_cmp(&distance_squared(c, d)))?;
        (!self.is_parted(triangle, &unit(&subtract(&q, &p)), least)).then_some([q, p])
    }
}

pub(super) fn middle(triangle: &[Point; 3]) -> Point {
    std::array::from_fn(|axis| (triangle[0][axis] + triangle[1][axis] + triangle[2][axis]) / 3.0)
}

/// The least value of some points along a direction.
pub(super) fn lowest(points: &[Point], direction: &Point) -> f64 {
    points.iter().map(|corner| dot(direction, corner)).fold(f64::INFINITY, f64::min)
}

/// How far the corners of a triangle are from a place at most.
pub(super) fn radius(triangle: &[Point; 3], centre: &Point) -> f64 {
    triangle.iter().map(|corner| distance_squared(corner, centre)).fold(0.0, f64::max).sqrt() * (1.0 + ROUNDED)
}

/// A place of a triangle that may be farther than a distance from all bodies: those of a list, and those that are offered as what may be closest to a place. Squared distances are what `square` says, which has to be convex on the triangle for each body, and
/// no less than the body's own. Cost: about a tenth of a microsecond for each body and part that is looked at.
pub(super) fn too_far<B: Body>(
    bodies: &[B],
    square: impl Fn(u32, &Point) -> f64,
    listed: impl IntoIterator<Item = u32>,
    offer: impl Fn(&Point) -> Option<u32>,
    triangle: &[Point; 3],
    most: f64,
    memory: &mut Memory,
) -> Option<Point> {
    let centre = middle(triangle);
    let wide = radius(triangle, &centre);
    memory.seen.clear();
    memory.squares.clear();
    let near = listed.into_iter().filter(|&item| bodies[item as usize].may_reach(&centre, most + wide));
    let all = near.map(|item| Seen::new(item, &square, triangle));
    memory.seen.extend(all.filter(|seen| seen.squares[0] <= (most + 2.0 * wide).powi(2)));
    Cover { bodies, square, offer, most, parts: MOST_PARTS, memory }.far(0, triangle, DEPTH)
}

/// A body, and its squared distances from the corners of a triangle.
#[derive(Clone, Copy)]
struct Seen {
    item: u32,
    squares: [f64; 3],
}

impl Seen {
    fn new(item: u32, square: &impl Fn(u32, &Point) -> f64, triangle: &[Point; 3]) -> Self {
        Self { item, squares: triangle.each_ref().map(|corner| square(item, corner)) }
    }
}

/// Working memory of [`too_far`].
#[derive(Default)]
pub(super) struct Memory {
    /// The bodies near to a triangle, and then those near to its parts; and their squared distances from where these are halved.
    seen: Vec<Seen>,
    squares: Vec<f64>,
}

/// Whether bodies are near to all of a triangle.
struct Cover<'a, B, S, F> {
    bodies: &'a [B],
    square: S,
    offer: F,
    most: f64,
    /// Parts that may be looked at.
    parts: u32,
    memory: &'a mut Memory,
}

/// What is known of a triangle: bodies are near to all of it, none is to a place, or neither.
enum Known {
    Near,
    Far(Point),
    Nothing,
}

impl<B: Body, S: Fn(u32, &Point) -> f64, F: Fn(&Point) -> Option<u32>> Cover<'_, B, S, F> {
    /// A place of a triangle that may be farther from all of the last bodies, given the first of these, and all that are offered.
    fn far(&mut self, first: usize, triangle: &[Point; 3], depth: u32) -> Option<Point> {
        let most = self.most;
        self.parts = self.parts.saturating_sub(1);
        if depth == 0 || self.parts == 0 {
            return Some(middle(triangle));
        }
        let long = |k: usize| distance_squared(&triangle[k], &triangle[(k + 1) % 3]);
        let k = (1..3).fold(0, |best, k| if long(k) >= long(best) { k } else { best });
        // Nothing much is near to all of what is much wider than the reach.
        let close = self.memory.seen[first..].iter().flat_map(|seen| seen.squares).fold(most * most, f64::min);
        if long(k) < (WIDE * most).powi(2) && (long(k) < ASKED * (most * most - close) || close == most * most) {
            match self.look(first, triangle) {
                Known::Near => return None,
                Known::Far(place) => return Some(place),
                Known::Nothing => {}
            }
        }
        let order = [k, (k + 1) % 3, (k + 2) % 3];
        let [a, b, c] = order.map(|k| triangle[k]);
        let half = between(&a, &b, 0.5);
        // What is beyond this is near to no place of a half.
        let reach = most + [a, c].iter().map(|corner| distance_squared(corner, &half)).fold(0.0, f64::max).sqrt() * (1.0 + ROUNDED);
        let Memory { seen, squares } = &mut *self.memory;
        let (end, from) = (seen.len(), squares.len());
        squares.extend(seen[first..].iter().map(|seen| {
            let body = &self.bodies[seen.item as usize];
            if body.may_reach(&half, reach) { (self.square)(seen.item, &half) } else { f64::INFINITY }
        }));
        let found = [[a, half, c], [half, b, c]].iter().zip([1, 0]).find_map(|(part, new)| {
            let Memory { seen, squares } = &mut *self.memory;
            for (place, &square) in (first..end).zip(&squares[from..]).filter(|(_, square)| **square <= reach * reach) {
                let Seen { item, squares } = seen[place];
                let mut squares = order.map(|k| squares[k]);
                squares[new] = square;
                seen.push(Seen { item, squares });
            }
            let found = self.far(end, part, depth - 1);
            self.memory.seen.truncate(end);
            found
        });
        self.memory.squares.truncate(from);
        found
    }

    /// What the last bodies tell of a triangle without halving it. Those that are offered for what the others leave of it are among them then.
    fn look(&mut self, first: usize, triangle: &[Point; 3]) -> Known {
        let (most, seen, mut rest) = (self.most * self.most, &mut self.memory.seen, Rest::all());
        if seen[first..].iter().any(|seen| rest.is_gone_with(&seen.squares, most)) {
            return Known::Near;
        }
        let mut place = rest.middle(triangle);
        let is_near = |item: u32, place: &Point| (self.square)(item, place) <= most;
        while let Some(item) = (self.offer)(&place)
            && seen[first..].iter().all(|seen| seen.item != item)
            && is_near(item, &place)
        {
            let new = Seen::new(item, &self.square, triangle);
            if rest.is_gone_with(&new.squares, most) {
                return Known::Near;
            }
            seen.push(new);
            place = rest.middle(triangle);
        }
        if seen[first..].iter().any(|seen| is_near(seen.item, &place)) { Known::Nothing } else { Known::Far(place) }
    }
}

/// What is left of a triangle without what bodies are shown to be near to: a convex polygon, whose corners are given by the shares that the triangle's have in them.
struct Rest {
    corners: [Point; MOST_CORNERS],
    count: usize,
}

impl Rest {
    fn all() -> Self {
        let mut corners = [[0.0; 3]; MOST_CORNERS];
        (0..3).for_each(|corner| corners[corner][corner] = 1.0);
        Self { corners, count: 3 }
    }

    /// Takes away where a body is as near as the root of `most`, given its squared distances from the triangle's corners, as far as these tell; and returns whether nothing is left.
    ///
    /// The squared distance from a convex set is convex, so at most what it would be if it were affine: where that is small enough is a half-plane. Squares are at most some 100 times `most`, as bodies are near to some place of a triangle that is not wide, so that
    /// rounding moves its border, and with it what is left, by some 100 roundings of the distance: less than the slack of all bounds.
    fn is_gone_with(&mut self, squares: &[f64; 3], most: f64) -> bool {
        let mut beyond = [0.0; MOST_CORNERS];
        for (beyond, shares) in beyond.iter_mut().zip(&self.corners[..self.count]) {
            *beyond = dot(shares, squares) - most;
        }
        let (own, beyond) = (&self.corners[..self.count], &beyond[..self.count]);
        let is_kept = |k: usize| beyond[k % beyond.len()] > 0.0;
        let kept = (0..self.count).filter(|&k| is_kept(k)).count();
        let ends = (0..self.count).filter(|&k| is_kept(k) != is_kept(k + 1)).count();
        // Where rounding makes more of a line than two ends, or there are too many corners, nothing is taken away: what is left too much is no harm.
        if kept == 0 || ends != 2 || kept + ends > MOST_CORNERS {
            return kept == 0;
        }
        let mut cut = [[0.0; 3]; MOST_CORNERS];
        let mut count = 0;
        for k in 0..self.count {
            let next = (k + 1) % self.count;
            if is_kept(k) {
                cut[count] = own[k];
                count += 1;
            }
            if is_kept(k) != is_kept(next) {
                cut[count] = between(&own[k], &own[next], beyond[k] / (beyond[k] - beyond[next]));
                count += 1;
            }
        }
        (self.corners, self.count) = (cut, count);
        false
    }

    /// The mean of its corners.
    fn middle(&self, triangle: &[Point; 3]) -> Point {
        let own = &self.corners[..self.count];
        let shares: Point = std::array::from_fn(|k| own.iter().map(|corner| corner[k]).sum::<f64>() / own.len() as f64);
        std::array::from_fn(|axis| (0..3).map(|k| shares[k] * triangle[k][axis]).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::Random;

    struct Dot(Point);

    impl Convex for Dot {
        fn deficit(&self) -> f64 {
            0.0
        }

        fn closest(&self, _: &Point) -> Point {
            self.0
        }

        fn highest(&self, direction: &Point) -> f64 {
            dot(&self.0, direction)
        }
    }

    impl Body for Dot {
        fn corners(&self) -> impl AsRef<[Point]> {
            [self.0]
        }
    }

    fn at(random: &mut Random, wide: f64) -> Point {
        std::array::from_fn(|_| wide * (random.share() - 0.5))
    }

    /// Against the distances of many places: dots that are listed, that are offered as they should be, or as they should not.
    #[test]
    fn what_is_too_far_from_dots_is_found() {
        let (mut random, mut memory, mut counts) = (Random(11), Memory::default(), [[0; 2]; 3]);
        for round in 0..3_000 {
            let triangle = [3.0, 3.0, 9.0].map(|wide| at(&mut random, wide));
            let dots: Vec<Dot> = (0..1 + round % 9).map(|_| Dot(at(&mut random, 4.0))).collect();
            let most = 0.4 + 3.5 * random.share();
            let distance = |x: &Point| dots.iter().map(|dot| distance_squared(&dot.0, x)).fold(f64::INFINITY, f64::min).sqrt();
            let mut farthest = 0.0_f64;
            for (i, j) in (0..=30).flat_map(|i| (0..=30 - i).map(move |j| (i, j))) {
                let shares = [i, j, 30 - i - j].map(|share| f64::from(share) / 30.0);
                let x = std::array::from_fn(|axis| (0..3).map(|k| shares[k] * triangle[k][axis]).sum());
                farthest = farthest.max(distance(&x));
            }
            let all = 0..dots.len() as u32;
            let nearest = |x: &Point| {
                let square = |&item: &u32| distance_squared(&dots[item as usize].0, x);
                all.clone().min_by(|a, b| square(a).total_cmp(&square(b)))
            };
            let any = |x: &Point| Some((x[0].to_bits() >> 8) as u32 % dots.len() as u32);
            let square = |item: u32, x: &Point| dots[item as usize].distance_squared(x);
            let found = [
                too_far(&dots, square, all.clone(), |_| None, &triangle, most, &mut memory),
                too_far(&dots, square, [], nearest, &triangle, most, &mut memory),
                too_far(&dots, square, [0], any, &triangle, most, &mut memory),
            ];
            for (way, (found, count)) in found.iter().zip(&mut counts).enumerate() {
                match found {
                    None => assert!(farthest <= most + 1e-12, "{round} {way}: {farthest} for {most}"),
                    // What is offered wrongly may be missed.
                    Some(x) => assert!(way == 2 || distance(x) > most - 1e-6, "{round} {way}: {} for {most}", distance(x)),
                }
                count[usize::from(found.is_some())] += 1;
            }
        }
        assert!(counts.iter().flatten().all(|&count| count > 200), "{counts:?}");
    }

    /// A disc is left by the half-planes around it, as many as there may be.
    #[test]
    fn what_is_left_has_all_that_should_be() {
        let (triangle, middle, radius) = ([[0.0; 3], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0]], [2.0, 2.0, 0.0], 1.5);
        let mut rest = Rest::all();
        for k in 0..40 {
            let (sine, cosine) = f64::from(k * 7 % 40).mul_add(0.157, 0.05).sin_cos();
            let inwards = triangle.map(|corner: Point| 10.0 - (corner[0] - middle[0]) * cosine - (corner[1] - middle[1]) * sine);
            assert!(!rest.is_gone_with(&inwards, 10.0 - radius));
            for step in 0..40 {
                let (sine, cosine) = (0.157 * f64::from(step)).sin_cos();
                let x = [middle[0] + 0.999 * radius * cosine, middle[1] + 0.999 * radius * sine];
                let place = |k: usize| [0, 1].map(|axis| 8.0 * rest.corners[k % rest.count][1 + axis]);
                let is_left = |k: usize| {
                    let ([ax, ay], [bx, by]) = (place(k), place(k + 1));
                    (bx - ax) * (x[1] - ay) - (by - ay) * (x[0] - ax) >= 0.0
                };
                assert!((0..rest.count).all(is_left), "{k} {step}");
            }
        }
        assert!(rest.count > 12 && distance_squared(&rest.middle(&triangle), &middle) < 0.01, "{}", rest.count);
        assert!(rest.is_gone_with(&[1.0; 3], 2.0));
        // No convex polygon, but what rounding may make of one.
        let corners = std::array::from_fn(|k| [0.5 - 0.1 * (k % 2) as f64, 0.5, 0.1 * (k % 2) as f64]);
        let mut zigzag = Rest { corners, count: 14 };
        assert!(!zigzag.is_gone_with(&[1.0, 0.0, 0.0], 0.45) && zigzag.count == 14 && zigzag.corners == corners);
    }
}

//! What is within a distance of a ray that leads down from a place, and whether it is within another distance of other such rays.
//!
//! All of it is below a half-ball, and so is what is within a distance of the others below their own. So the half-ball alone is held against balls around places of these: each has a cap of it, of directions u with u way >= least. Nothing is left of the half-ball if each direction where the circles around two caps meet, one of
//! each circle, and one at all, are in some cap: what is left has a corner, or all of a circle as its border, or none. So caps are added one after the other: for a direction that is left that of the ray that is closest there, until nothing is left, or none is close enough.

use super::squares::Squares;
use crate::attractor::cell::{Point, cross, dot};

/// How far rays are at first that may be close, in units of their distance.
const NEXT: f64 = 0.7;
/// By what share of its square places have to be within the distance, so that what is on a circle is not taken for what is within it.
const WITHIN: f64 = 1e-9;
/// Ways are parallel up to this sine: with less, what circles have in common is rounded by more than what is left may be wide.
const PARALLEL: f64 = 1e-5;
/// Caps at most.
const MOST_CAPS: usize = 48;
/// Squares that rays are sorted into, at most, and how wide they are in units of the distance.
const MOST_SQUARES: f64 = 1e6;
const PITCH: f64 = 0.5;

/// Upper ends of rays that lead down, in squares of the plane.
pub(super) struct Cover {
    radius: f64,
    squares: Squares,
    /// Those in each square.
    ends: Vec<Vec<Point>>,
}

impl Cover {
    /// No rays yet, over the box of some places, which are held against what is within a radius of them.
    pub(super) fn new(places: &[[f64; 2]], radius: f64) -> Self {
        let side = |axis: usize| places.iter().map(move |place| place[axis]);
        let low = [0, 1].map(|axis| side(axis).fold(f64::INFINITY, f64::min));
        let high = [0, 1].map(|axis| side(axis).fold(f64::NEG_INFINITY, f64::max));
        let squares = Squares::new([low, high], PITCH * radius, MOST_SQUARES);
        let count = squares.size[0] * squares.size[1];
        Self { radius, squares, ends: vec![Vec::new(); count] }
    }

    pub(super) fn add(&mut self, end: Point) {
        self.ends[self.squares.of([end[0], end[1]])].push(end);
    }

    /// The rays' ends, square by square.
    pub(super) fn ends(self) -> Vec<Point> {
        self.ends.concat()
    }

    /// Whether all within a distance of the ray below a place is within the radius of the rays. Cost: about a microsecond.
    pub(super) fn hides(&self, place: &Point, distance: f64) -> bool {
        if distance >= self.radius {
            return false;
        }
        let mut ball = HalfBall::new(distance, self.radius);
        for within in [NEXT * self.radius, self.radius + distance] {
            ball.near.clear();
            let [columns, rows] =
                [0, 1].map(|axis| self.squares.place(place[axis] - within, axis)..=self.squares.place(place[axis] + within, axis));
            for first in rows.map(|row| row * self.squares.size[0]) {
                for end in self.ends[first + columns.start()..=first + columns.end()].iter().flatten() {
                    let way: Point = std::array::from_fn(|k| end[k] - place[k]);
                    let (flat, down) = (way[0] * way[0] + way[1] * way[1], way[2].min(0.0));
                    if flat < within * within && flat + down * down < (self.radius + distance).powi(2) {
                        ball.near.push(way);
                    }
                }
            }
            if ball.is_gone() {
                return true;
            }
        }
        false
    }
}

/// Directions u with u way > least.
#[derive(Clone, Copy, Debug)]
struct Cap {
    way: Point,
    least: f64,
}

/// What circles around two caps have in common.
enum Meet {
    Nothing,
    At([Point; 2]),
    /// They are nearly the same.
    Unclear,
}

/// What may be left of a half-ball.
struct HalfBall {
    distance: f64,
    /// The square of the other balls' radius.
    square: f64,
    /// Ways to the upper ends of rays.
    near: Vec<Point>,
    /// The caps that are taken out.
    caps: Vec<Cap>,
    /// Directions that may be left.
    left: Vec<Point>,
}

impl HalfBall {
    fn new(distance: f64, radius: f64) -> Self {
        // What is below the equator is below what is above it: that is a cap, too.
        let below = Cap { way: [0.0, 0.0, -1.0], least: 0.0 };
        let (mut caps, mut left) = (Vec::with_capacity(16), Vec::with_capacity(32));
        caps.push(below);
        left.extend([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        Self { distance, square: radius * radius, near: Vec::with_capacity(64), caps, left }
    }

    /// Whether nothing is left of it, given the rays that are near.
    fn is_gone(&mut self) -> bool {
        while let Some(u) = self.left.pop() {
            // What is on a circle is not in the cap, as far as can be told.
            let margin = 0.5 * WITHIN * self.square / self.distance;
            if self.caps[1..].iter().any(|cap| dot(&cap.way, &u) > cap.least + margin) {
                continue;
            }
            let x = u.map(|part| self.distance * part);
            let square = |way: &Point| (x[0] - way[0]).powi(2) + (x[1] - way[1]).powi(2) + (x[2] - way[2]).max(0.0).powi(2);
            let (mut least, mut closest) = (f64::INFINITY, [0.0; 3]);
            for way in &self.near {
                let own = square(way);
                if own < least {
                    (least, closest) = (own, *way);
                }
            }
            if least >= self.square * (1.0 - WITHIN) || self.caps.len() > MOST_CAPS {
                self.left.push(u);
                return false;
            }
            // The ray's place that is closest.
            let way = [closest[0], closest[1], closest[2].min(x[2])];
            let away = dot(&way, &way);
            let cap = Cap { way, least: (away + self.distance * self.distance - self.square) / (2.0 * self.distance) };
            if cap.least < 0.0 && away <= cap.least * cap.least {
                return true;
            }
            self.left.extend(cap.on_circle());
            for other in &self.caps {
                match other.meet(&cap) {
                    Meet::Nothing => {}
                    // Directions on the equator are rounded to either side of it.
                    Meet::At(both) => self.left.extend(both.into_iter().filter(|u| u[2] >= -WITHIN)),
                    Meet::Unclear => {
                        self.left.push(u);
                        return false;
                    }
                }
            }
            self.caps.push(cap);
        }
        true
    }
}

impl Cap {
    /// The highest direction on the circle around it, unless that is below the equator, or there is no circle.
    fn on_circle(&self) -> Option<Point> {
        let Self { way, least } = self;
        let square = dot(way, way);
        let rest = 1.0 - least * least / square;
        if rest <= 0.0 {
            return None;
        }
        let flat = way[0] * way[0] + way[1] * way[1];
        let up = [-way[0] * way[2], -way[1] * way[2], flat].map(|part| part / square);
        let length = dot(&up, &up).sqrt();
        // Around the axis all are as high.
        let up = if length > WITHIN { up.map(|part| part / length) } else { [1.0, 0.0, 0.0] };
        let u: Point = std::array::from_fn(|k| way[k] * least / square + rest.sqrt() * up[k]);
        (u[2] >= -WITHIN).then_some(u)
    }

    /// The directions on the circles around both.
    fn meet(&self, other: &Self) -> Meet {
        let line = cross(&self.way, &other.way);
        let (square, own, theirs) = (dot(&line, &line), dot(&self.way, &self.way), dot(&other.way, &other.way));
        if square <= PARALLEL * PARALLEL * own * theirs {
            // Around nearly the same axis: apart where they are not as far along it.
            let sign = dot(&self.way, &other.way).signum();
            let apart = self.least / own.sqrt() - sign * other.least / theirs.sqrt();
            return if apart.abs() > 4.0 * PARALLEL { Meet::Nothing } else { Meet::Unclear };
        }
        let (first, second) = (cross(&other.way, &line), cross(&line, &self.way));
        let middle: Point = std::array::from_fn(|k| (self.least * first[k] + other.least * second[k]) / square);
        let rest = 1.0 - dot(&middle, &middle);
        if rest < 0.0 {
            return Meet::Nothing;
        }
        let share = (rest / square).sqrt();
        Meet::At([share, -share].map(|share| std::array::from_fn(|k| middle[k] + share * line[k])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::Random;

    fn direction(random: &mut Random) -> Point {
        loop {
            let u: Point = std::array::from_fn(|_| 2.0 * random.share() - 1.0);
            let length = dot(&u, &u).sqrt();
            if length > 0.1 && length < 1.0 {
                return [u[0] / length, u[1] / length, (u[2] / length).abs()];
            }
        }
    }

    /// What is said to be hidden has no place that is farther than the radius from all rays, of many that were tried; what is said not to be has one nearly as far.
    #[test]
    fn what_is_hidden_is_near_to_rays() {
        let (mut random, mut counts) = (Random(5), [0; 2]);
        for round in 0..4_000 {
            let radius = 1.0;
            let distance = radius - 0.3 * random.share();
            let wide = 0.2 + random.share();
            let mut cover = Cover::new(&[[-2.0, -2.0], [2.0, 2.0]], radius);
            let ends: Vec<Point> = (0..1 + round % 24)
                .map(|_| {
                    [0, 1, 2].map(|axis| if axis == 2 { 1.5 * wide * (random.share() - 0.3) } else { 2.0 * wide * (random.share() - 0.5) })
                })
                .collect();
            ends.iter().for_each(|end| cover.add(*end));
            let place = [0.1 * random.share(), 0.0, 0.2 * random.share() - 0.1];
            let away = |x: &Point| {
                let square = |end: &Point| (x[0] - end[0]).powi(2) + (x[1] - end[1]).powi(2) + (x[2] - end[2]).max(0.0).powi(2);
                ends.iter().map(square).fold(f64::INFINITY, f64::min).sqrt()
            };
            let at = |u: &Point| -> Point { std::array::from_fn(|k| place[k] + distance * u[k]) };
            let mut worst = [0.0, 0.0, 1.0];
            let mut farthest = away(&at(&worst));
            // From the farthest of many to what is farther near it.
            for step in 0..1_500 {
                let (u, size) = (direction(&mut random), if step < 500 { 1.0 } else { 0.3 * 0.995_f64.powi(step - 500) });
                let near: Point =
                    std::array::from_fn(|k| worst[k] * (1.0 - size) + size * if step < 500 { u[k] } else { worst[k] + u[k] - 0.5 });
                let length = dot(&near, &near).sqrt();
                let near = [near[0] / length, near[1] / length, (near[2] / length).max(0.0)];
                let length = dot(&near, &near).sqrt();
                let near = near.map(|part| part / length);
                if away(&at(&near)) > farthest {
                    (worst, farthest) = (near, away(&at(&near)));
                }
            }
            let is_hidden = cover.hides(&place, distance);
            counts[usize::from(is_hidden)] += 1;
            assert!(!is_hidden || farthest <= radius, "{round}: {farthest}");
            assert!(is_hidden || farthest > radius - 2e-2, "{round}: {farthest}");
        }
        assert!(counts.iter().all(|&count| count > 400), "{counts:?}");
    }
}

//! What polytopes that stand for points and segments are like: the hulls of a covering of the sphere at each end.
//!
//! With corners at the outer end of the band and triangles touching the inner one, a ball has half the triangles of a polytope with as many facets as it has corners, whose facets would touch the inner end.

use super::covering::Covering;
use super::polytopes::MOST_FACETS;
use super::structure::Structure;
use std::sync::Arc;

/// Directions at most: of a segment's polytope, the facets are twice as many less four, and those of the belt.
const MOST_DIRECTIONS: usize = 7 * MOST_FACETS / 16;

/// How many directions a strip of a rod is worth: it is as long as the segment, and crossed by more others.
const STRIP_WEIGHT: usize = 2;

/// A covering, and the polytopes that it makes.
#[derive(Debug)]
pub(super) struct Form {
    pub(super) covering: Covering,
    /// Of a point one, of a segment along the axis four, by the ends where it is cut: neither, the first, the second, both.
    shapes: Vec<Shape>,
}

/// What a form is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Ball,
    Rod,
    /// A rod in a tube with wedges in one plane, or at right angles: corners of its belt are on all their axes.
    Flat,
    Square,
}

/// The share of the band that a rod's form leaves. Where tubes meet, corners lie all over it, and the more of it is left, the more of them are saved later; a ball by itself is best as it is.
const LEFT_BY_RODS: f64 = 0.13;

/// The corners and facets of a polytope. Of a segment's, the ring of the belt at its first end comes first, then that at its second end, and strips along it, as many as the belt has directions, are the first facets.
#[derive(Debug)]
pub(super) struct Shape {
    pub(super) corners: Vec<Spot>,
    /// Their corners, counter-clockwise seen from outside.
    pub(super) facets: Vec<Vec<u16>>,
    /// The end of every facet, that of strips being the first.
    pub(super) ends: Vec<usize>,
    pub(super) structure: Arc<Structure>,
    /// Those across the axis, at the ends where it is cut.
    pub(super) flats: [Option<usize>; 2],
}

/// What a corner is above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub(super) direction: usize,
    pub(super) end: usize,
}

impl Form {
    /// One with few corners whose hull, scaled by at most `most`, is around the unit ball; none where that takes too many.
    pub(super) fn within(most: f64, kind: Kind) -> Option<Self> {
        if kind == Kind::Ball {
            let covering = Covering::within(most, MOST_DIRECTIONS, 0, 1)?;
            let shapes = vec![Shape::ball(&covering)?];
            return Some(Self { covering, shapes });
        }
        let (left, step) = match kind {
            Kind::Ball | Kind::Rod => (LEFT_BY_RODS, 1),
            Kind::Flat => (0.0, 2),
            Kind::Square => (0.0, 4),
        };
        let covering = Covering::within(1.0 + (1.0 - left) * (most - 1.0), MOST_DIRECTIONS, STRIP_WEIGHT, step)?;
        let shapes = (0..4).map(|cut| Shape::rod(&covering, [cut & 1 != 0, cut & 2 != 0])).collect::<Option<_>>()?;
        Some(Self { covering, shapes })
    }

    /// The polytope of a segment that is cut at some ends, or of a point.
    pub(super) fn shape(&self, cut: [bool; 2]) -> &Shape {
        &self.shapes[usize::from(cut[0]) + 2 * usize::from(cut[1])]
    }
}

impl Shape {
    fn ball(covering: &Covering) -> Option<Self> {
        let corners: Vec<Spot> = covering.ends.iter().enumerate().map(|(direction, &end)| Spot { direction, end }).collect();
        let facets = covering.triangles.iter().map(|triangle| triangle.to_vec()).collect();
        Self::new(corners, facets, [None; 2])
    }

    fn rod(covering: &Covering, cut: [bool; 2]) -> Option<Self> {
        let Covering { belt, ref ends, ref triangles, .. } = *covering;
        let mut corners: Vec<Spot> = (0..2 * belt).map(|corner| Spot { direction: corner % belt, end: corner / belt }).collect();
        let caps = (belt..ends.len()).filter(|&direction| !cut[ends[direction]]);
        corners.extend(caps.map(|direction| Spot { direction, end: ends[direction] }));
        let name = |direction: u16, end: usize| {
            if usize::from(direction) < belt {
                return Some(direction as usize + end * belt);
            }
            corners.iter().skip(2 * belt).position(|spot| spot.direction == usize::from(direction)).map(|place| place + 2 * belt)
        };
        let ring = |end: usize| (0..belt as u16).map(move |corner| corner + (end * belt) as u16);
        let strip = |from: usize| {
            let to = (from + 1) % belt;
            [from, to, to + belt, from + belt].map(|corner| corner as u16).to_vec()
        };
        let mut facets: Vec<Vec<u16>> = (0..belt).map(strip).collect();
        for triangle in triangles {
            let end = triangle.iter().map(|&direction| usize::from(direction)).find(|&direction| direction >= belt).map(|d| ends[d])?;
            if !cut[end] {
                facets.push(triangle.iter().map(|&direction| name(direction, end).map(|corner| corner as u16)).collect::<Option<_>>()?);
            }
        }
        let mut flats = [None; 2];
        for end in (0..2).filter(|&end| cut[end]) {
            flats[end] = Some(facets.len());
            // Seen along the axis the belt goes clockwise.
            facets.push(if end == 1 { ring(1).collect() } else { ring(0).rev().collect() });
        }
        Self::new(corners, facets, flats)
    }

    fn new(corners: Vec<Spot>, facets: Vec<Vec<u16>>, flats: [Option<usize>; 2]) -> Option<Self> {
        let structure = Arc::new(Structure::closed(&facets, corners.len())?);
        // Those of the belt are at both ends.
        let end = |facet: &Vec<u16>| facet.iter().map(|&corner| corners[usize::from(corner)].end).min().unwrap_or_default();
        let ends = facets.iter().map(end).collect();
        Some(Self { corners, facets, ends, structure, flats })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_run_along_the_axis_and_all_else_stays_at_its_end() {
        for most in [1.9, 1.22, 1.05] {
            let [ball, rod] = [Kind::Ball, Kind::Rod].map(|kind| Form::within(most, kind).expect("coarse enough"));
            assert_eq!(ball.shape([false; 2]).facets.len() + 4, 2 * ball.covering.directions.len());
            let (belt, count) = (rod.covering.belt, rod.covering.directions.len());
            for (number, shape) in rod.shapes.iter().enumerate() {
                let caps = 2 - number.count_ones() as usize;
                assert_eq!(shape.facets.len(), belt + caps * (count - 2) + (2 - caps));
                assert_eq!(shape.flats.iter().flatten().count(), 2 - caps);
                for edge in &shape.structure.edges {
                    let ends = edge.corners.map(|corner| shape.corners[usize::from(corner)].end);
                    let are_strips = edge.facets.iter().all(|&facet| usize::from(facet) < belt);
                    assert_eq!(ends[0] != ends[1], are_strips);
                }
            }
        }
        assert!([Kind::Ball, Kind::Rod].into_iter().all(|kind| Form::within(1.001, kind).is_none()));
    }
}

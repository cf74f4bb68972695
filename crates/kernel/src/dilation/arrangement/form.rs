//! What polytopes that stand for points and segments are like: the hulls of a covering of the sphere at each end.
//!
//! With corners at the outer end of the band and triangles touching the inner one, a ball has half the triangles of a polytope with as many facets as it has corners, whose facets would touch the inner end.

use super::covering::Covering;
use super::polytopes::MOST_FACETS;
use super::structure::Structure;
use std::sync::Arc;

/// Directions at most: of a segment's polytope, the facets are twice as many less four, and those of the belt.
const MOST_DIRECTIONS: usize = 7 * MOST_FACETS / 16;

/// A covering, and what polytopes have with it.
#[derive(Debug)]
pub(super) struct Form {
    pub(super) covering: Covering,
    ball: Shape,
    /// Of a segment along the axis, by the ends where it is cut: neither, the first, the second, both.
    rods: [Shape; 4],
}

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
    /// The one with the fewest corners whose hull, scaled by at most `most`, is around the unit ball.
    pub(super) fn within(most: f64) -> Option<Self> {
        let covering = Covering::within(most, MOST_DIRECTIONS)?;
        let ball = Shape::ball(&covering)?;
        let rod = |cut: usize| Shape::rod(&covering, [cut & 1 != 0, cut & 2 != 0]);
        let rods = [rod(0)?, rod(1)?, rod(2)?, rod(3)?];
        Some(Self { covering, ball, rods })
    }

    /// The polytope of a point.
    pub(super) fn ball(&self) -> &Shape {
        &self.ball
    }

    /// The polytope of a segment, cut at some ends.
    pub(super) fn rod(&self, cut: [bool; 2]) -> &Shape {
        &self.rods[usize::from(cut[0]) + 2 * usize::from(cut[1])]
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
            let Some(form) = Form::within(most) else { panic!("{most}") };
            let (belt, count) = (form.covering.belt, form.covering.directions.len());
            assert_eq!(form.ball().facets.len() + 4, 2 * count);
            for (number, shape) in form.rods.iter().enumerate() {
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
        assert!(Form::within(1.001).is_none());
    }
}

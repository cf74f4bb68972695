//! How the facets of a polytope hang together.

use super::polytopes::{Mask, Plane, height, normal};
use crate::attractor::cell::{Point, cross, dot, subtract};

/// The edges of a polytope, and how many facets and corners it has.
#[derive(Debug, Default)]
pub(super) struct Structure {
    pub(super) facets: usize,
    pub(super) corners: usize,
    pub(super) edges: Vec<Edge>,
}

/// An edge.
#[derive(Debug)]
pub(super) struct Edge {
    /// From the first corner to the second,
    pub(super) corners: [u16; 2],
    /// counter-clockwise on the first facet seen from outside, clockwise on the second.
    pub(super) facets: [u16; 2],
}

/// See [`Structure::cut`].
pub(super) struct CutOff {
    pub(super) structure: Structure,
    pub(super) facets: Vec<u16>,
    pub(super) corners: Vec<usize>,
    pub(super) made: Vec<([u16; 2], f64)>,
}

impl Structure {
    /// That of a polytope whose facets have these corners, counter-clockwise seen from outside; none where they do not close, or not to a sphere.
    pub(super) fn closed(facets: &[Vec<u16>], corners: usize) -> Option<Self> {
        let mut sides = Vec::new();
        for (facet, around) in (0..).zip(facets) {
            let next = around.iter().skip(1).chain(around.first());
            sides.extend(around.iter().zip(next).map(|(&from, &to)| ([from.min(to), from.max(to)], from > to, facet)));
        }
        sides.sort_unstable();
        let edge = |pair: &[([u16; 2], bool, u16)]| match *pair {
            [(corners, false, left), (_, true, right)] => Some(Edge { corners, facets: [left, right] }),
            _ => None,
        };
        let edges = sides.chunk_by(|a, b| a.0 == b.0).map(edge).collect::<Option<Vec<_>>>()?;
        (corners + facets.len() == edges.len() + 2).then_some(Self { facets: facets.len(), corners, edges })
    }

    /// That of a simple polytope, of whose corners each is on three planes: edges join those that have two in common. None where something is missing.
    pub(super) fn simple(planes: &[Plane], corners: &[[u16; 3]], places: &[Point]) -> Option<Self> {
        let mut edges = Vec::new();
        for (p, one) in corners.iter().enumerate() {
            for (q, other) in corners.iter().enumerate().skip(p + 1) {
                let mut common = one.iter().copied().filter(|facet| other.contains(facet));
                let (Some(first), Some(second)) = (common.next(), common.next()) else { continue };
                let along = subtract(&places[q], &places[p]);
                let left = cross(&normal(&planes[usize::from(first)]), &along);
                // The facet lies to the left of its edges.
                let is_left = dot(&left, &normal(&planes[usize::from(second)])) < 0.0;
                edges.push(Edge { corners: [p as u16, q as u16], facets: if is_left { [first, second] } else { [second, first] } });
            }
        }
        let structure = Self { facets: planes.len(), corners: corners.len(), edges };
        let is_whole = 2 * structure.edges.len() == 3 * corners.len() && corners.len() + planes.len() == structure.edges.len() + 2;
        is_whole.then_some(structure)
    }

    /// What is left of a polytope below a plane, with a facet there, which comes last: the numbers of the facets and corners that are left, and between which two corners new ones lie, each followed by how far along the way. None where a corner is
    /// no farther from the plane than `noise`, or nothing is cut off or left.
    pub(super) fn cut(&self, plane: &Plane, places: &[Point], noise: f64) -> Option<CutOff> {
        let heights: Vec<f64> = places.iter().map(|place| height(plane, place)).collect();
        let kept: Vec<usize> = (0..self.corners).filter(|&corner| heights[corner] < 0.0).collect();
        if heights.iter().any(|height| height.abs() <= noise) || kept.is_empty() || kept.len() == self.corners {
            return None;
        }
        let mut edges: Vec<Edge> = Vec::new();
        // Where the outline of every facet goes above the plane, and where it comes back.
        let (mut ways, mut made) = (vec![[None; 2]; self.facets], Vec::new());
        for Edge { corners, facets } in &self.edges {
            let is_kept = corners.map(|corner| heights[usize::from(corner)] < 0.0);
            if is_kept == [false; 2] {
                continue;
            }
            let mut own = corners.map(|corner| kept.binary_search(&usize::from(corner)).map_or(u16::MAX, |place| place as u16));
            if let Some(lost) = is_kept.iter().position(|is_kept| !is_kept) {
                let number = (kept.len() + made.len()) as u16;
                let [from, to] = corners.map(|corner| heights[usize::from(corner)]);
                made.push((*corners, from / (from - to)));
                own[lost] = number;
                // The first facet has the edge in its own direction, the second against it.
                ways[usize::from(facets[0])][1 - lost] = Some(number);
                ways[usize::from(facets[1])][lost] = Some(number);
            }
            edges.push(Edge { corners: own, facets: *facets });
        }
        for (facet, way) in (0..).zip(&ways) {
            match *way {
                [Some(up), Some(down)] => edges.push(Edge { corners: [up, down], facets: [facet, self.facets as u16] }),
                [None, None] => {}
                _ => return None,
            }
        }
        let mut left: Vec<u16> = edges.iter().flat_map(|edge| edge.facets).collect();
        left.sort_unstable();
        left.dedup();
        for edge in &mut edges {
            edge.facets = edge.facets.map(|facet| left.binary_search(&facet).map_or(u16::MAX, |place| place as u16));
        }
        let structure = Self { facets: left.len(), corners: kept.len() + made.len(), edges };
        left.pop();
        let is_whole = structure.corners + structure.facets == structure.edges.len() + 2;
        is_whole.then_some(CutOff { structure, facets: left, corners: kept, made })
    }

    /// Whether all corners, which are on the planes of their own facets, are deeper than `least` below all others: then the polytope is what is below all planes.
    pub(super) fn is_convex(&self, planes: &[Plane], places: &[Point], least: f64) -> bool {
        let mut own = vec![Mask::default(); self.corners];
        for edge in &self.edges {
            for corner in edge.corners {
                edge.facets.iter().for_each(|&facet| own[usize::from(corner)].add(usize::from(facet)));
            }
        }
        own.iter()
            .zip(places)
            .all(|(own, place)| planes.iter().enumerate().all(|(facet, plane)| height(plane, place) < -least || own.has(facet)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::cell::{between, unit};
    use crate::split_mix::Random;

    /// The facets of a cube, across each axis the lower one first; the bits of a corner's number are its coordinates.
    fn cube() -> Vec<Vec<u16>> {
        vec![vec![0, 4, 6, 2], vec![1, 3, 7, 5], vec![0, 1, 5, 4], vec![2, 6, 7, 3], vec![0, 2, 3, 1], vec![4, 5, 7, 6]]
    }

    #[test]
    fn only_closed_facets_around_a_ball_have_a_structure() {
        let cube = cube();
        let structure = Structure::closed(&cube, 8).expect("a cube is closed");
        assert_eq!((structure.facets, structure.corners, structure.edges.len()), (6, 8, 12));
        for edge in &structure.edges {
            let [left, right] = edge.facets.map(|facet| &cube[usize::from(facet)]);
            let has = |around: &[u16], [from, to]: [u16; 2]| (0..4).any(|k| around[k] == from && around[(k + 1) % 4] == to);
            assert!(has(left, edge.corners) && has(right, [edge.corners[1], edge.corners[0]]), "{edge:?}");
        }
        // A facet is missing, is there twice, or is turned over; two cubes; the sides of a ring of four.
        assert!(Structure::closed(&cube[1..], 8).is_none());
        assert!(Structure::closed(&[&cube[..], &cube[..1]].concat(), 8).is_none());
        let mut turned = cube.clone();
        turned[0].reverse();
        assert!(Structure::closed(&turned, 8).is_none());
        let other = cube.iter().map(|around| around.iter().map(|corner| corner + 8).collect());
        assert!(Structure::closed(&cube.iter().cloned().chain(other).collect::<Vec<_>>(), 16).is_none());
        let ring = |k: u16| (0..4).map(move |side| [4 * k, 4 * ((k + 1) % 4)].map(|first| [first + side, first + (side + 1) % 4]));
        let sides: Vec<Vec<u16>> = (0..4).flat_map(ring).map(|[[a, b], [c, d]]| vec![a, b, d, c]).collect();
        assert!(Structure::closed(&sides, 16).is_none());
    }

    /// Cubes that are cut again and again: corners, edges and facets close, edges turn as they should, and what is left is what lies below all planes.
    #[test]
    fn what_is_left_below_planes_is_a_polytope() {
        let corner = |code: usize| -> Point { std::array::from_fn(|axis| if code >> axis & 1 == 1 { 1.0 } else { -1.0 }) };
        let cube = cube();
        let mut random = Random(41);
        let (mut cuts, mut gone) = (0, 0);
        for _ in 0..60 {
            let mut structure = Structure::closed(&cube, 8).expect("a cube is closed");
            let mut corners: Vec<Point> = (0..8).map(corner).collect();
            let plane = |facet: usize| -> Plane {
                let side = if facet % 2 == 1 { 1.0 } else { -1.0 };
                std::array::from_fn(|k| if k == 3 { 1.0 } else { side * f64::from(u8::from(k == facet / 2)) })
            };
            let mut planes: Vec<Plane> = (0..6).map(plane).collect();
            for _ in 0..12 {
                let up: Point = unit(&std::array::from_fn(|_| 2.0 * random.share() - 1.0));
                let plane = [up[0], up[1], up[2], 0.6 + 0.6 * random.share()];
                planes.push(plane);
                let Some(CutOff { structure: left, facets, corners: kept, made }) = structure.cut(&plane, &corners, 1e-9) else {
                    assert!(corners.iter().all(|corner| height(&plane, corner) < 0.0));
                    planes.pop();
                    continue;
                };
                (cuts, gone) = (cuts + 1, gone + structure.facets + 1 - left.facets);
                let new = made.iter().map(|&(ends, share)| between(&corners[usize::from(ends[0])], &corners[usize::from(ends[1])], share));
                corners = kept.iter().map(|&corner| corners[corner]).chain(new).collect();
                planes = facets.iter().map(|&facet| planes[usize::from(facet)]).chain([plane]).collect();
                structure = left;
                assert_eq!((structure.facets, structure.corners), (planes.len(), corners.len()));
                assert!(structure.is_convex(&planes, &corners, 0.0));
                for Edge { corners: ends, facets } in &structure.edges {
                    let along = subtract(&corners[usize::from(ends[1])], &corners[usize::from(ends[0])]);
                    let [left, right] = facets.map(|facet| super::normal(&planes[usize::from(facet)]));
                    assert!(dot(&cross(&left, &along), &right) < 0.0);
                    let on = |corner: u16, facet: u16| height(&planes[usize::from(facet)], &corners[usize::from(corner)]).abs() < 1e-12;
                    assert!(ends.iter().all(|&corner| facets.iter().all(|&facet| on(corner, facet))));
                }
            }
        }
        assert!(cuts > 300 && gone > 20, "{cuts} {gone}");
        // Nothing is left, or all, or a corner is on the plane.
        let (structure, corners) = (Structure::closed(&cube, 8).expect("a cube is closed"), (0..8).map(corner).collect::<Vec<_>>());
        for offset in [-2.0, 2.0, 1.0] {
            assert!(structure.cut(&[1.0, 0.0, 0.0, offset], &corners, 1e-9).is_none());
        }
    }
}

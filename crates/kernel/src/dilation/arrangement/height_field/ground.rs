//! Triangles as the graph of a function over a convex part of a plane.

use super::super::figure::{Figure, Outline};
use super::Place;
use super::check::Faces;
use crate::attractor::cell::{Point, cross, dot, subtract, unit};
use crate::dilation::surface::NameMap;
use crate::groups::Groups;
use crate::solid::box_tree::{Box32, BoxTree};
use crate::solid::contact::turn;
use std::f64::consts::TAU;

/// Corners at most of the part of the plane: what is asked of all of them is asked of each place.
const MOST_CORNERS: usize = 2_048;
/// Triangles that tell how many parts are near to each other.
const SAMPLE: usize = 256;

/// A surface with one height over each place of a convex part of the plane, with the third axis up.
pub(super) struct Ground {
    pub(super) places: Vec<Point>,
    /// Corners, counter-clockwise from above.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The triangles across their sides, of which the first goes from the first corner to the second; [`NONE`] at the border.
    pub(super) across: Vec<[u32; 3]>,
    /// The corners of the part, counter-clockwise, but for those at which it goes straight on.
    pub(super) corners: Vec<Place>,
}

impl Ground {
    /// The graph of figures seen along an axis; none where they are none.
    ///
    /// No two corners are over each other, all triangles turn the same way, no two have a side in common in the same direction, and the sides that one alone has are a convex polygon: so its inside is covered once (a map of a surface that keeps directions covers a place as often as its border winds around it).
    pub(super) fn new(figures: &[Figure], place: impl Fn(&Point) -> Point) -> Option<Self> {
        let mut numbers: NameMap<[u64; 2], u32> = NameMap::default();
        numbers.reserve(figures.len());
        let mut places: Vec<Point> = Vec::new();
        let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(figures.len());
        for figure in figures {
            let Outline::Polygon(polygon) = &figure.outline else { return None };
            let &[a, b, c] = &polygon.corners[..] else { return None };
            if figure.deficit != 0.0 {
                return None;
            }
            let mut triangle = [0; 3];
            for (number, corner) in triangle.iter_mut().zip([a, b, c]) {
                let at = place(&corner).map(|x| x + 0.0);
                *number = *numbers.entry([at[0].to_bits(), at[1].to_bits()]).or_insert_with(|| {
                    places.push(at);
                    places.len() as u32 - 1
                });
                if places[*number as usize][2] != at[2] {
                    return None;
                }
            }
            let [a, b, c] = triangle.map(|corner| &places[corner as usize]);
            let area = turn(2, a, b, c);
            if area == 0.0 {
                return None;
            }
            if area < 0.0 {
                triangle.swap(1, 2);
            }
            triangles.push(triangle);
        }
        let mut tree = BoxTree::default();
        let of = |triangle: u32| triangles[triangle as usize].map(|corner| places[corner as usize]);
        tree.build(triangles.len(), |triangle| Some(Box32::of(&of(triangle))), false);
        // What is near to each other is close in memory, too.
        let triangles: Vec<[u32; 3]> =
            (0..tree.leaves()).flat_map(|leaf| tree.items(leaf)).map(|&triangle| triangles[triangle as usize]).collect();
        let across = across(&triangles)?;
        let corners = border(&places, &triangles, &across)?;
        Some(Self { places, triangles, across, corners })
    }

    /// The same upside down.
    pub(super) fn turned(&self) -> Self {
        Self {
            places: self.places.iter().map(|&[x, y, z]| [x, y, -z]).collect(),
            triangles: self.triangles.clone(),
            across: self.across.clone(),
            corners: self.corners.clone(),
        }
    }

    /// How many parts, of triangles in one plane each, are near to a triangle in the mean, from a sample; given how far off a plane corners may be, how far what is near is, and what finds it.
    pub(super) fn crowding(&self, flatness: f64, faces: &Faces, distance: f64) -> f64 {
        let count = self.triangles.len();
        let mut groups = Groups::new(count);
        for (number, (triangle, across)) in self.triangles.iter().zip(&self.across).enumerate() {
            let [a, b, c] = self.points(number);
            let normal = unit(&cross(&subtract(&b, &a), &subtract(&c, &a)));
            for other in across.iter().copied().filter(|&other| other != NONE && other as usize > number) {
                let beyond = self.triangles[other as usize].into_iter().find(|corner| !triangle.contains(corner));
                if beyond.is_some_and(|corner| dot(&normal, &subtract(&self.places[corner as usize], &a)).abs() <= flatness) {
                    groups.join(number, other as usize);
                }
            }
        }
        let (step, mut near, mut total) = (count.div_ceil(SAMPLE), Vec::new(), 0);
        for triangle in (0..count).step_by(step) {
            near.clear();
            faces.around(&self.points(triangle), distance, |other| {
                near.push(groups.of(other as usize));
                true
            });
            near.sort_unstable();
            near.dedup();
            total += near.len();
        }
        total as f64 / count.div_ceil(step) as f64
    }

    /// A place, or one between it and the closest of the part below the surface, no farther from that than a distance.
    pub(super) fn inward(&self, at: Place, most: f64) -> Place {
        let (distance, foot) = self.away(at);
        let share = most / distance;
        if share < 1.0 { [0, 1].map(|axis| foot[axis] + share * (at[axis] - foot[axis])) } else { at }
    }

    pub(super) fn points(&self, triangle: usize) -> [Point; 3] {
        self.triangles[triangle].map(|corner| self.places[corner as usize])
    }

    /// How far a place is from the part below the surface, and the closest place of that.
    pub(super) fn away(&self, at: Place) -> (f64, Place) {
        let count = self.corners.len();
        let (mut best, mut is_inside) = ((f64::INFINITY, at), true);
        for k in 0..count {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % count]);
            let (way, own) = ([b[0] - a[0], b[1] - a[1]], [at[0] - a[0], at[1] - a[1]]);
            is_inside &= way[0] * own[1] - way[1] * own[0] >= 0.0;
            let share = ((way[0] * own[0] + way[1] * own[1]) / (way[0] * way[0] + way[1] * way[1])).clamp(0.0, 1.0);
            let closest = [a[0] + share * way[0], a[1] + share * way[1]];
            let square = (at[0] - closest[0]).powi(2) + (at[1] - closest[1]).powi(2);
            if square < best.0 {
                best = (square, closest);
            }
        }
        if is_inside { (0.0, at) } else { (best.0.sqrt(), best.1) }
    }
}

/// No triangle.
pub(super) const NONE: u32 = u32::MAX;

/// The ends of a triangle's sides.
pub(super) fn sides(&[a, b, c]: &[u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// The triangles across the sides of others; none where two have one in the same direction.
fn across(triangles: &[[u32; 3]]) -> Option<Vec<[u32; 3]>> {
    let name = |[from, to]: [u32; 2]| u64::from(from) << 32 | u64::from(to);
    let mut owners: NameMap<u64, u32> = NameMap::default();
    owners.reserve(3 * triangles.len());
    for (number, triangle) in (0..).zip(triangles) {
        if sides(triangle).into_iter().any(|side| owners.insert(name(side), number).is_some()) {
            return None;
        }
    }
    let other = |[from, to]: [u32; 2]| owners.get(&name([to, from])).copied().unwrap_or(NONE);
    Some(triangles.iter().map(|triangle| sides(triangle).map(other)).collect())
}

/// The cycle of sides that one triangle alone has, once around; none where there are others, or two triangles have a side in common in the same direction.
pub(super) fn border_of(triangles: &[[u32; 3]]) -> Option<Vec<u32>> {
    cycle(triangles, &across(triangles)?)
}

/// The cycle of sides that nothing is across of; none where there are several.
fn cycle(triangles: &[[u32; 3]], across: &[[u32; 3]]) -> Option<Vec<u32>> {
    let mut next: NameMap<u64, u32> = NameMap::default();
    let mut first = None;
    for (triangle, across) in triangles.iter().zip(across) {
        for ([from, to], _) in sides(triangle).into_iter().zip(across).filter(|(_, other)| **other == NONE) {
            first = first.or(Some(from));
            if next.insert(u64::from(from), to).is_some() {
                return None;
            }
        }
    }
    let first = first?;
    let mut all = vec![first];
    while let Some(&to) = next.get(&u64::from(*all.last()?)).filter(|&&to| to != first) {
        all.push(to);
        if all.len() > next.len() {
            return None;
        }
    }
    (all.len() == next.len()).then_some(all)
}

/// The corners of the polygon that triangles cover; none where it is not convex, or they do not cover it once.
fn border(places: &[Point], triangles: &[[u32; 3]], across: &[[u32; 3]]) -> Option<Vec<Place>> {
    let all = cycle(triangles, across)?;
    let (mut corners, mut turned) = (Vec::new(), 0.0);
    for k in 0..all.len() {
        let [a, b, c] = [k + all.len() - 1, k, k + 1].map(|k| &places[all[k % all.len()] as usize]);
        let sign = turn(2, a, b, c);
        let (before, after) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
        if sign < 0.0 || (sign == 0.0 && before[0] * after[0] + before[1] * after[1] < 0.0) {
            return None;
        }
        if sign > 0.0 {
            turned += (before[0] * after[1] - before[1] * after[0]).atan2(before[0] * after[0] + before[1] * after[1]);
            corners.push([b[0], b[1]]);
        }
    }
    (turned < 1.5 * TAU && corners.len() <= MOST_CORNERS).then_some(corners)
}

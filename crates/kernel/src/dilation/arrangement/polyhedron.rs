//! Convex polyhedra, for which polygons stand that are all of their faces.
//!
//! Let C be the union of these faces, and H the polyhedron. If no place in H is farther than s from C, D_t(H) = D_t(C) for all t from s on: so what is thickened by more may be taken for solid. With the volume V and the area A of H that is so where 3 V / A <= s: were a ball with a larger radius in it, each of
//! the pyramids from its centre to the faces would be higher than that, and V, which is a third of all heights times areas, more.

use super::figure::{Figure, Outline, Polygon, Side, box_of, leave_out, order};
use super::polytopes::{Plane, height, normal};
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract};
use crate::budget::{Budget, Stopped};
use crate::groups::Groups;
use crate::measure::triangle::closest_on_triangle;

/// Faces of a polyhedron at most.
const MOST_FACES: usize = 32;
/// What three times the volume over the area is at least, in units of the box's diagonal: what is flatter has no inside to speak of, and faces whose planes rounding turns.
const LEAST_DEPTH: f64 = 1e-6;
/// How far below a face's plane a place may be that counts as on it, in units of how far corners may be off planes: more than the rounding of heights.
const ON_FACE: f64 = 8.0;

/// A convex polyhedron.
#[derive(Clone, Debug)]
pub(super) struct Polyhedron {
    pub(super) corners: Box<[Point]>,
    /// Its faces in triangles, with their planes, whose normals are unit vectors out of it.
    triangles: Box<[(Plane, [u8; 3])]>,
    /// How far below a face's plane places are that count as on it.
    tolerance: f64,
}

impl Polyhedron {
    /// The one with some faces, in whose inside no place is farther from these than `least`; none where they are not all of a convex polyhedron's, or it is flat. Corners may be above the planes of others, and off their own, by `flatness`.
    fn of(faces: &[&Polygon], least: f64, flatness: f64) -> Option<Self> {
        let mut corners: Vec<Point> = faces.iter().flat_map(|face| &face.corners).copied().collect();
        corners.sort_unstable_by(order);
        corners.dedup();
        let count = corners.len();
        let middle: Point = std::array::from_fn(|axis| corners.iter().map(|corner| corner[axis]).sum::<f64>() / count as f64);
        let mut triangles = Vec::new();
        let (mut sides, mut area, mut volume) = (Vec::new(), 0.0, 0.0);
        for face in faces {
            let name = |corner: &Point| corners.binary_search_by(|own| order(own, corner)).ok().and_then(|place| u8::try_from(place).ok());
            let mut around: Vec<u8> = face.corners.iter().map(name).collect::<Option<_>>()?;
            let (first, mut up) = (&face.corners[0], face.up);
            if dot(&up, &subtract(&middle, first)) > 0.0 {
                around.reverse();
                up = up.map(|part| -part);
            }
            let height_of = |corner: &Point| dot(&up, &subtract(corner, first));
            // Normals of slivers are off by rounding: their corners are, too.
            let is_on = |corner: &Point| height_of(corner).abs() <= flatness;
            if up == [0.0; 3] || corners.iter().any(|corner| height_of(corner) > flatness) || !face.corners.iter().all(is_on) {
                return None;
            }
            let (plane, own) = ([up[0], up[1], up[2], dot(&up, first)], 0.5 * face.double());
            (area, volume) = (area + own, volume - own * height_of(&middle) / 3.0);
            triangles.extend(around[1..].windows(2).map(|pair| (plane, [around[0], pair[0], pair[1]])));
            sides.extend(around.iter().zip(around.iter().cycle().skip(1)).map(|(&from, &to)| [from, to]));
        }
        // Every side is there once each way, so that the faces close; up to flatness, convex ones about one place do it once.
        sides.sort_unstable();
        let is_closed = sides.windows(2).all(|pair| pair[0] != pair[1])
            && sides.iter().all(|&[from, to]| sides.binary_search(&[to, from]).is_ok())
            && count + faces.len() == sides.len() / 2 + 2;
        let [low, high] = box_of(&corners);
        let depths = [LEAST_DEPTH * distance_squared(&low, &high).sqrt(), least].map(|depth| depth * area);
        let has_depth = (depths[0]..=depths[1]).contains(&(3.0 * volume));
        (is_closed && has_depth).then(|| Self { corners: corners.into(), triangles: triangles.into(), tolerance: ON_FACE * flatness })
    }

    /// The same with all places less `origin`.
    pub(super) fn from(&self, origin: &Point) -> Self {
        let moved = |plane: &Plane| [plane[0], plane[1], plane[2], plane[3] - dot(&normal(plane), origin)];
        Self {
            corners: self.corners.iter().map(|corner| subtract(corner, origin)).collect(),
            triangles: self.triangles.iter().map(|(plane, corners)| (moved(plane), *corners)).collect(),
            tolerance: self.tolerance,
        }
    }

    /// Its closest point to x: on a face that x is above, or hardly below, or x itself.
    pub(super) fn closest(&self, x: &Point) -> Point {
        let mut best = (f64::INFINITY, *x);
        for (plane, corners) in &self.triangles {
            let height = height(plane, x);
            // No nearer than the plane. What is on a face may be a little above the plane of another beside it.
            if height >= -self.tolerance && height.max(0.0).powi(2) < best.0 {
                let [a, b, c] = self.places(corners);
                let on = closest_on_triangle(x, a, b, c);
                let square = distance_squared(x, &on);
                if square < best.0 {
                    best = (square, on);
                }
            }
        }
        best.1
    }

    fn places(&self, corners: &[u8; 3]) -> [&Point; 3] {
        corners.map(|corner| &self.corners[usize::from(corner)])
    }

    /// Its area.
    pub(super) fn area(&self) -> f64 {
        let double = |(_, corners): &(Plane, [u8; 3])| {
            let [a, b, c] = self.places(corners);
            let across = cross(&subtract(b, a), &subtract(c, a));
            dot(&across, &across).sqrt()
        };
        0.5 * self.triangles.iter().map(double).sum::<f64>()
    }

    /// The unit normals of its faces, in the order of its triangles.
    pub(super) fn normals(&self) -> impl Iterator<Item = Point> {
        self.triangles.iter().map(|(plane, _)| normal(plane))
    }
}

/// Figures with those polygons of one radius replaced by polyhedra that are all faces of one, in whose inside no place is farther from them than `least` tells of a figure.
///
/// # Errors
/// [`Stopped`].
pub(super) fn closed(
    mut figures: Vec<Figure>,
    least: impl Fn(&Figure) -> f64,
    flatness: f64,
    budget: &Budget,
) -> Result<Vec<Figure>, Stopped> {
    budget.cancel.check()?;
    let sides = Side::of_all(&figures);
    let mut groups = Groups::new(figures.len());
    for around in sides.chunk_by(|a, b| a.ends == b.ends) {
        if let [one, other] = around
            && one.ends[0] != one.ends[1]
            && figures[one.figure as usize].deficit.to_bits() == figures[other.figure as usize].deficit.to_bits()
        {
            groups.join(one.figure as usize, other.figure as usize);
        }
    }
    let groups = groups.all();
    let mut sorted: Vec<u32> = (0..figures.len() as u32).collect();
    sorted.sort_unstable_by_key(|&figure| (groups[figure as usize], figure));
    let mut gone = vec![false; figures.len()];
    for group in sorted.chunk_by(|&a, &b| groups[a as usize] == groups[b as usize]) {
        if !(4..=MOST_FACES).contains(&group.len()) {
            continue;
        }
        budget.cancel.check()?;
        let first = group[0] as usize;
        let faces: Vec<&Polygon> = group.iter().filter_map(|&figure| figures[figure as usize].polygon()).collect();
        let Some(polyhedron) = Polyhedron::of(&faces, least(&figures[first]), flatness) else { continue };
        figures[first].outline = Outline::Polyhedron(polyhedron);
        group[1..].iter().for_each(|&figure| gone[figure as usize] = true);
    }
    leave_out(&mut figures, gone);
    Ok(figures)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::cell::{Site, between, unit};
    use crate::dilation::convex::Convex;
    use crate::dilation::tree::Weighted;
    use crate::split_mix::Random;

    fn triangles(faces: &[[Point; 3]]) -> Vec<Figure> {
        faces.iter().map(|corners| Weighted { site: Site::Triangle(*corners), deficit: 0.0 }.into()).collect()
    }

    fn closed_of(faces: &[[Point; 3]], least: f64) -> Vec<Figure> {
        closed(triangles(faces), |_| least, 1e-12, &Budget::default()).unwrap()
    }

    /// The faces of a tetrahedron, or of a cuboid with two triangles for each of its six, along axes that are turned.
    fn faces(random: &mut Random, is_cuboid: bool, size: f64) -> Vec<[Point; 3]> {
        let mut vector = || -> Point { std::array::from_fn(|_| 2.0 * random.share() - 1.0) };
        let (origin, x) = (vector().map(|x| 10.0 * x), unit(&vector()));
        let y = unit(&cross(&x, &vector()));
        let z = cross(&x, &y);
        let lengths = vector().map(|length| size * (0.5 + length.abs()));
        let at = |code: usize| -> Point {
            let share = |axis: usize| if code >> axis & 1 == 1 { lengths[axis] } else { 0.0 };
            std::array::from_fn(|k| origin[k] + share(0) * x[k] + share(1) * y[k] + share(2) * z[k])
        };
        if !is_cuboid {
            return [[0, 2, 1], [0, 1, 4], [0, 4, 2], [1, 2, 4]].iter().map(|face| face.map(at)).collect();
        }
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|face| face.map(at)).collect()
    }

    /// Whatever way faces are turned: outside and on them polyhedra are as far as their faces, also at corners, on edges and in the planes of faces, and no place inside is farther from them than was told.
    #[test]
    fn faces_of_a_polyhedron_are_one_where_its_inside_is_near() {
        let mut random = Random(61);
        let (mut made, mut left) = (0, 0);
        for round in 0..600 {
            // Also plates.
            let mut faces = faces(&mut random, round % 2 == 1, [1.0, 0.1, 1e-4][round / 2 % 3]);
            for face in &mut faces {
                if random.next().is_multiple_of(2) {
                    face.swap(0, 1);
                }
            }
            let least = 0.05 + 0.8 * random.share();
            let figures = closed_of(&faces, least);
            if figures.len() > 1 {
                left += 1;
                assert_eq!(figures.len(), faces.len(), "{round}");
            } else {
                made += 1;
            }
            // With a larger radius they are one.
            let [polyhedron] = &*closed_of(&faces, 3.0) else { panic!("{round}") };
            let (all, of_faces) = (polyhedron.bounds(), triangles(&faces));
            let middle: Point =
                std::array::from_fn(|axis| faces.iter().flatten().map(|at| at[axis]).sum::<f64>() / (3 * faces.len()) as f64);
            for place in 0..400 {
                let [a, b, c] = faces[place % faces.len()];
                let x: Point = match place % 5 {
                    0 => a,
                    1 => between(&a, &b, random.share()),
                    2 => between(&between(&a, &b, random.share()), &c, random.share()),
                    // In the plane of a face, and beyond it.
                    3 => between(&between(&a, &b, 3.0 * random.share() - 1.0), &c, 3.0 * random.share() - 1.0),
                    _ => std::array::from_fn(|axis| {
                        let [low, high] = [all[0][axis] - 0.5, all[1][axis] + 0.5];
                        low + (high - low) * random.share()
                    }),
                };
                let of_faces = of_faces.iter().map(|face| face.distance_squared(&x)).fold(f64::INFINITY, f64::min).sqrt();
                let own = polyhedron.distance_squared(&x).sqrt();
                // On one side of every face as the middle is.
                let is_inside = faces.iter().all(|[p, q, r]| {
                    let up = cross(&subtract(q, p), &subtract(r, p));
                    let side = |at: &Point| dot(&up, &subtract(at, p));
                    side(&x) * side(&middle) > 0.0
                });
                if is_inside {
                    assert!(own < 1e-9 && of_faces <= 3.0 && (figures.len() > 1 || of_faces <= least), "{round}: {own} {of_faces}");
                } else {
                    assert!((own - of_faces).abs() < 1e-9, "{round}: {own} {of_faces}");
                }
            }
        }
        assert!(made > 200 && left > 50, "{made} {left}");
    }

    /// Flat ones, whose faces lie in a plane or rounding turns, two that share a face or an edge, and one radius of their own.
    #[test]
    fn what_is_flat_or_shares_sides_stays_as_it_is() {
        let square: [Point; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        for lift in [0.0, 1e-16, 1e-9] {
            let at = |corner: usize| -> Point {
                std::array::from_fn(|axis| square[corner][axis] + if axis == 2 && corner == 3 { lift } else { 0.0 })
            };
            let flat = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|face| face.map(at));
            assert_eq!(closed_of(&flat, 3.0).len(), 4, "{lift}");
        }
        let mut random = Random(73);
        let whole = faces(&mut random, false, 1.0);
        // On the other side of its last face, and around the last edge of that.
        let [a, b, c] = whole[3];
        let mirrored: Point = std::array::from_fn(|axis| (2.0 * (a[axis] + b[axis] + c[axis])) / 3.0 - whole[0][0][axis]);
        let other = |from: Point| vec![[a, b, c], [a, b, from], [b, c, from], [c, a, from]];
        assert_eq!(closed_of(&[whole.clone(), other(mirrored)].concat(), 3.0).len(), 8, "a face is there twice, and sides four times");
        let outer = [&whole[..3], &other(mirrored)[1..]].concat();
        assert!(closed_of(&outer, 3.0).len() <= 6);
        let graded: Vec<Figure> = triangles(&whole).into_iter().map(|figure| Figure { deficit: 0.2, ..figure }).collect();
        let [one] = &*closed(graded, |_| 3.0, 1e-12, &Budget::default()).unwrap() else { panic!("all have one radius") };
        assert_eq!(one.deficit.to_bits(), 0.2_f64.to_bits());
    }

    /// A face is missing, is there twice, or is bent; a dent; two radii; and two that touch at a corner are two.
    #[test]
    fn what_is_no_polyhedron_stays_as_it_is() {
        let mut random = Random(67);
        let whole = faces(&mut random, true, 1.0);
        assert_eq!(closed_of(&whole, 3.0).len(), 1);
        assert_eq!(closed_of(&whole[1..], 3.0).len(), 11);
        assert_eq!(closed_of(&[&whole[..], &whole[..1]].concat(), 3.0).len(), 13);
        // Its last corner, moved outwards or inwards.
        let (corner, middle) = (whole[11][1], between(&whole[0][0], &whole[11][1], 0.5));
        for by in [1e-3, -1e-3, -0.6] {
            let moved = between(&corner, &middle, -by);
            let bent: Vec<[Point; 3]> = whole.iter().map(|face| face.map(|at| if at == corner { moved } else { at })).collect();
            assert!(bent != whole);
            // All three diagonals of the faces around the corner end there: outwards they are edges of a convex one.
            assert_eq!(closed_of(&bent, 3.0).len(), if by > 0.0 { 1 } else { 12 }, "{by}");
        }
        let two: Vec<Figure> =
            (0..).zip(triangles(&whole)).map(|(k, figure)| Figure { deficit: 0.1 * f64::from(k % 2), ..figure }).collect();
        assert_eq!(closed(two, |_| 3.0, 1e-12, &Budget::default()).unwrap().len(), 12);
        let one = faces(&mut random, false, 1.0);
        let way = subtract(&one[3][0], &one[0][0]);
        let moved = one.iter().map(|face| face.map(|at| std::array::from_fn(|axis| at[axis] + way[axis])));
        // The corner where they touch has the same bits in both.
        let other: Vec<[Point; 3]> = moved
            .map(|face| face.map(|at: Point| if subtract(&at, &one[3][0]).iter().all(|x| x.abs() < 1e-12) { one[3][0] } else { at }))
            .collect();
        assert_eq!(closed_of(&[one, other].concat(), 3.0).len(), 2);
    }
}

//! Convex polyhedra, for which polygons stand that are all of their faces.
//!
//! Let C be the union of these faces, and H the polyhedron. If no place in H is farther than s from C, D_t(H) = D_t(C) for all t from s on: so what is thickened by more may be taken for solid. With the volume V and the area A of H that is so where 3 V / A <= s: were a ball with a larger radius in it, each of
//! the pyramids from its centre to the faces would be higher than that, and V, which is a third of all heights times areas, more.

use super::figure::{Figure, Outline, Side, order};
use super::polytopes::{Plane, height, normal};
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract};
use crate::budget::{Budget, Stopped};
use crate::groups::Groups;
use crate::measure::triangle::closest_on_triangle;

/// Faces of a polyhedron at most.
const MOST_FACES: usize = 32;

/// A convex polyhedron.
#[derive(Clone, Debug)]
pub(super) struct Polyhedron {
    pub(super) corners: Box<[Point]>,
    /// Its faces in triangles, with their planes, whose normals are unit vectors out of it.
    triangles: Box<[(Plane, [u8; 3])]>,
}

impl Polyhedron {
    /// The one with some faces, in whose inside no place is farther from these than `least`; none where they are not all of a convex polyhedron's. Corners may be above the planes of others by `flatness`.
    fn of(faces: &[&[Point]], least: f64, flatness: f64) -> Option<Self> {
        let mut corners: Vec<Point> = faces.iter().copied().flatten().copied().collect();
        corners.sort_unstable_by(order);
        corners.dedup();
        let count = corners.len();
        let middle: Point = std::array::from_fn(|axis| corners.iter().map(|corner| corner[axis]).sum::<f64>() / count as f64);
        let mut triangles = Vec::new();
        let (mut sides, mut area, mut volume) = (Vec::new(), 0.0, 0.0);
        for face in faces {
            let name = |corner: &Point| corners.binary_search_by(|own| order(own, corner)).ok().and_then(|place| u8::try_from(place).ok());
            let mut around: Vec<u8> = face.iter().map(name).collect::<Option<_>>()?;
            let first = &face[0];
            let across = face[1..].windows(2).fold([0.0; 3], |sum: Point, pair| {
                let part = cross(&subtract(&pair[0], first), &subtract(&pair[1], first));
                std::array::from_fn(|axis| sum[axis] + part[axis])
            });
            let double = dot(&across, &across).sqrt();
            if double <= 0.0 {
                return None;
            }
            let mut up = across.map(|part| part / double);
            if dot(&up, &subtract(&middle, first)) > 0.0 {
                around.reverse();
                up = up.map(|part| -part);
            }
            // No corner is above it; but rounding may make one of its own lower than others.
            let highest = corners.iter().map(|corner| dot(&up, &subtract(corner, first))).fold(0.0, f64::max);
            if highest > flatness {
                return None;
            }
            let plane = [up[0], up[1], up[2], dot(&up, first)];
            (area, volume) = (area + 0.5 * double, volume - 0.5 * double * height(&plane, &middle) / 3.0);
            triangles.extend(around[1..].windows(2).map(|pair| (plane, [around[0], pair[0], pair[1]])));
            sides.extend(around.iter().zip(around.iter().cycle().skip(1)).map(|(&from, &to)| [from, to]));
        }
        // Every side is there once each way, so that the faces close; convex ones about one place do it once.
        sides.sort_unstable();
        let is_closed = sides.windows(2).all(|pair| pair[0] != pair[1])
            && sides.iter().all(|&[from, to]| sides.binary_search(&[to, from]).is_ok())
            && count + faces.len() == sides.len() / 2 + 2;
        (is_closed && 3.0 * volume <= least * area).then(|| Self { corners: corners.into(), triangles: triangles.into() })
    }

    /// The same with all places less `origin`.
    pub(super) fn from(&self, origin: &Point) -> Self {
        let moved = |plane: &Plane| [plane[0], plane[1], plane[2], plane[3] - dot(&normal(plane), origin)];
        Self {
            corners: self.corners.iter().map(|corner| subtract(corner, origin)).collect(),
            triangles: self.triangles.iter().map(|(plane, corners)| (moved(plane), *corners)).collect(),
        }
    }

    /// Its closest point to x: on a face that x is above, or x itself.
    pub(super) fn closest(&self, x: &Point) -> Point {
        let mut best = (f64::INFINITY, *x);
        for (plane, corners) in &self.triangles {
            let height = height(plane, x);
            // No nearer than the plane.
            if height > 0.0 && height * height < best.0 {
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

    /// Twice the area of a triangle.
    fn double(&self, corners: &[u8; 3]) -> f64 {
        let [a, b, c] = self.places(corners);
        let across = cross(&subtract(b, a), &subtract(c, a));
        dot(&across, &across).sqrt()
    }

    /// Its area.
    pub(super) fn area(&self) -> f64 {
        0.5 * self.triangles.iter().map(|(_, corners)| self.double(corners)).sum::<f64>()
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
            && figures[one.figure as usize].deficit.to_bits() == figures[other.figure as usize].deficit.to_bits()
        {
            groups.join(one.figure as usize, other.figure as usize);
        }
    }
    let groups = groups.all();
    let mut order: Vec<u32> = (0..figures.len() as u32).collect();
    order.sort_unstable_by_key(|&figure| (groups[figure as usize], figure));
    let mut gone = vec![false; figures.len()];
    for group in order.chunk_by(|&a, &b| groups[a as usize] == groups[b as usize]) {
        if !(4..=MOST_FACES).contains(&group.len()) {
            continue;
        }
        budget.cancel.check()?;
        let first = group[0] as usize;
        let faces: Vec<&[Point]> = group.iter().map(|&figure| figures[figure as usize].corners()).collect();
        let Some(polyhedron) = Polyhedron::of(&faces, least(&figures[first]), flatness) else { continue };
        figures[first].outline = Outline::Polyhedron(polyhedron);
        group[1..].iter().for_each(|&figure| gone[figure as usize] = true);
    }
    let mut gone = gone.into_iter();
    figures.retain(|_| !gone.next().unwrap_or_default());
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

    /// Whatever way faces are turned: from outside they are as far as the polyhedron, and no place inside is farther from them than was told.
    #[test]
    fn faces_of_a_polyhedron_are_one_where_its_inside_is_near() {
        let mut random = Random(61);
        let (mut made, mut left) = (0, 0);
        for round in 0..400 {
            let mut faces = faces(&mut random, round % 2 == 1, 1.0);
            for face in &mut faces {
                if random.next().is_multiple_of(2) {
                    face.swap(0, 1);
                }
            }
            let least = 0.05 + 0.8 * random.share();
            let figures = closed_of(&faces, least);
            let figures = if figures.len() > 1 {
                left += 1;
                assert_eq!(figures.len(), faces.len(), "{round}");
                // With a larger radius they are one.
                closed_of(&faces, 3.0)
            } else {
                made += 1;
                figures
            };
            let [polyhedron] = &*figures else { panic!("{round}: {}", figures.len()) };
            let (all, of_faces) = (polyhedron.bounds(), triangles(&faces));
            let mut is_far = false;
            for _ in 0..200 {
                let x: Point = std::array::from_fn(|axis| {
                    let [low, high] = [all[0][axis] - 0.5, all[1][axis] + 0.5];
                    low + (high - low) * random.share()
                });
                let of_faces = of_faces.iter().map(|face| face.distance_squared(&x)).fold(f64::INFINITY, f64::min).sqrt();
                let own = polyhedron.distance_squared(&x).sqrt();
                if own > 0.0 {
                    assert!((own - of_faces).abs() < 1e-9, "{round}: {own} {of_faces}");
                } else {
                    is_far |= of_faces > least;
                }
            }
            assert!(!is_far || closed_of(&faces, least).len() > 1, "{round}");
        }
        assert!(made > 100 && left > 100, "{made} {left}");
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
            // Faces around a corner that is moved outwards are convex with one of two diagonals only.
            let count = closed_of(&bent, 3.0).len();
            assert!(by > 0.0 || count == 12, "{by}: {count}");
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

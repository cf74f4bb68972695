//! The part of a mesh around some of its vertices, as a mesh of its own: what is mended there costs no more than that part.

use super::box_tree::{Box32, BoxTree};
use super::half_edges::{HalfEdges, NONE};
use crate::attractor::cell::Point;
use std::collections::HashSet;

/// See the module's comment.
pub(crate) struct Around {
    pub(crate) mesh: HalfEdges,
    /// The whole mesh's number of every vertex.
    pub(crate) numbers: Vec<u32>,
    /// Whether all triangles of a vertex are here.
    pub(crate) is_whole: Vec<bool>,
    /// Of the whole mesh's triangles, those that are here.
    taken: Vec<bool>,
}

impl Around {
    /// All triangles that come within `width` of the boxes of those around `corners`: of the corners and their neighbours none is missing.
    pub(crate) fn of(points: &[Point], triangles: &[[u32; 3]], corners: &HashSet<u32>, width: f64) -> Self {
        let at = |corner: u32| points[corner as usize];
        let near: Vec<Box32> = triangles
            .iter()
            .filter(|triangle| triangle.iter().any(|corner| corners.contains(corner)))
            .map(|triangle| grown(&triangle.map(at), width))
            .collect();
        let mut tree = BoxTree::default();
        tree.build(near.len(), |item| near.get(item as usize).copied(), false);
        let is_near = |triangle: &[u32; 3]| {
            let (own, mut found) = (Box32::of(&triangle.map(at)), false);
            tree.query(&own, 0, |leaf| {
                found = tree.boxes(leaf).iter().any(|other| own.meets(other));
                !found
            });
            found
        };
        let taken: Vec<bool> = triangles.iter().map(is_near).collect();
        let (mut numbers, mut triangles_here) = (Vec::new(), Vec::new());
        let mut places = vec![NONE; points.len()];
        for (triangle, _) in triangles.iter().zip(&taken).filter(|(_, taken)| **taken) {
            triangles_here.push(triangle.map(|corner| {
                let place = &mut places[corner as usize];
                if *place == NONE {
                    *place = numbers.len() as u32;
                    numbers.push(corner);
                }
                *place
            }));
        }
        let mut is_whole = vec![true; numbers.len()];
        for corner in triangles.iter().zip(&taken).filter(|(_, taken)| !**taken).flat_map(|(triangle, _)| triangle) {
            if let Some(is_whole) = is_whole.get_mut(places[*corner as usize] as usize) {
                *is_whole = false;
            }
        }
        let points = numbers.iter().map(|&number| at(number)).collect();
        Self { mesh: HalfEdges::new(points, &triangles_here), numbers, is_whole, taken }
    }

    /// Puts what is left back in its place: the new number of every old vertex of the whole mesh, or `NONE`. Other triangles come first, in their order.
    pub(crate) fn write(self, points: &mut Vec<Point>, triangles: &mut Vec<[u32; 3]>) -> Vec<u32> {
        let Self { mesh, numbers, taken, .. } = self;
        let mut taken = taken.into_iter();
        triangles.retain(|_| taken.next() == Some(false));
        triangles.extend((0..mesh.triangles()).filter_map(|t| mesh.triangle(t)).map(|t| t.map(|corner| numbers[corner as usize])));
        let mut new = vec![0; points.len()];
        for (vertex, &number) in (0..).zip(&numbers) {
            points[number as usize] = mesh.points[vertex as usize];
            if !mesh.is_used(vertex) {
                new[number as usize] = NONE;
            }
        }
        close_up(points, triangles, &mut new);
        new
    }
}

/// Removes the vertices whose number is `NONE`, which no triangle has, and numbers the others anew, in their order.
pub(crate) fn close_up(points: &mut Vec<Point>, triangles: &mut [[u32; 3]], numbers: &mut [u32]) {
    let mut stays = numbers.iter().map(|&number| number != NONE);
    points.retain(|_| stays.next() == Some(true));
    numbers.iter_mut().filter(|number| **number != NONE).zip(0..).for_each(|(number, count)| *number = count);
    triangles.iter_mut().flatten().for_each(|corner| *corner = numbers[*corner as usize]);
}

/// The box of a triangle and what is within `width` of it.
fn grown(points: &[Point; 3], width: f64) -> Box32 {
    let ends = |sign: f64| points.map(|point| point.map(|x| x + sign * width));
    Box32::of(ends(1.0).as_slice()).union(&Box32::of(ends(-1.0).as_slice()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of n by n squares halved.
    fn sheet(n: u32) -> (Vec<Point>, Vec<[u32; 3]>) {
        let points = (0..(n + 1) * (n + 1)).map(|k| [f64::from(k % (n + 1)), f64::from(k / (n + 1)), 0.0]).collect();
        let corner = |i: u32, j: u32| j * (n + 1) + i;
        let halves =
            |(i, j)| [[corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)], [corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)]];
        (points, (0..n * n).map(|k| (k % n, k / n)).flat_map(halves).collect())
    }

    #[test]
    fn neighbours_have_all_their_triangles_and_what_is_far_stays_away() {
        let (points, triangles) = sheet(20);
        let around = Around::of(&points, &triangles, &HashSet::from([10 * 21 + 10]), 0.0);
        assert!(around.numbers.len() < 30, "{} vertices", around.numbers.len());
        for (&number, is_whole) in around.numbers.iter().zip(&around.is_whole) {
            let [x, y, _] = points[number as usize];
            assert_eq!(*is_whole, (x - 10.0).abs() <= 1.0 && (y - 10.0).abs() <= 1.0, "{x}, {y}");
        }
    }

    #[test]
    fn what_was_collapsed_is_gone_and_all_else_stays() {
        let (mut points, mut triangles) = sheet(20);
        let before = (points.clone(), triangles.clone());
        let middle = 10 * 21 + 10;
        let untouched = Around::of(&points, &triangles, &HashSet::from([middle]), 0.0);
        let numbers = untouched.write(&mut points, &mut triangles);
        assert!(numbers.iter().zip(0..).all(|(&number, k)| number == k));
        let sorted = |triangles: &[[u32; 3]]| {
            let mut sorted = triangles.to_vec();
            sorted.sort_unstable();
            sorted
        };
        assert_eq!((&points, sorted(&triangles)), (&before.0, sorted(&before.1)));

        let mut around = Around::of(&points, &triangles, &HashSet::from([middle]), 0.0);
        let vertex = around.numbers.iter().position(|&number| number == middle).unwrap() as u32;
        let mut star = super::super::half_edges::Star::default();
        assert!(around.mesh.star(vertex, 8, &mut star));
        around.mesh.collapse(vertex, &star, 0);
        let numbers = around.write(&mut points, &mut triangles);
        assert_eq!((points.len(), triangles.len(), numbers[middle as usize]), (before.0.len() - 1, before.1.len() - 2, NONE));
        let area = |points: &[Point], triangles: &[[u32; 3]]| -> f64 {
            let twice = |[a, b, c]: [Point; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            triangles.iter().map(|triangle| twice(triangle.map(|corner| points[corner as usize]))).sum()
        };
        assert!((area(&points, &triangles) - 800.0).abs() < 1e-9);
    }
}

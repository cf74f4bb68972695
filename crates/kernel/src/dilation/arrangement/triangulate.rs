//! Triangles of what loops bound in a plane, by ear clipping: holes are joined to what is around them, and the best ear goes first.

use robust::{Coord, orient2d};

/// A place in the plane.
type Place = [f64; 2];

/// Working memory.
#[derive(Default)]
pub(super) struct Planar {
    /// Vertices of loops, with what they bound to the left: counter-clockwise, or clockwise around holes.
    pub(super) loops: Vec<Vec<u32>>,
    bridges: Vec<(f64, usize, usize)>,
}

/// A vertex with its place.
type Vertex = (u32, Place);

/// Twice the area of a triangle, positive if it is counter-clockwise; the sign is exact.
fn area(a: &Place, b: &Place, c: &Place) -> f64 {
    let coordinate = |place: &Place| Coord { x: place[0], y: place[1] };
    orient2d(coordinate(a), coordinate(b), coordinate(c))
}

fn distance_squared(a: &Place, b: &Place) -> f64 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
}

/// Twice the area of a loop.
fn signed_area(vertices: &[Vertex]) -> f64 {
    (1..vertices.len() - 1).map(|k| area(&vertices[0].1, &vertices[k].1, &vertices[k + 1].1)).sum()
}

/// Whether a place is inside a loop.
fn contains(vertices: &[Vertex], x: &Place) -> bool {
    let crosses = |p: &Place, q: &Place| (p[1] > x[1]) != (q[1] > x[1]) && (area(p, q, x) > 0.0) == (q[1] > p[1]);
    (0..vertices.len()).filter(|&k| crosses(&vertices[k].1, &vertices[(k + 1) % vertices.len()].1)).count() % 2 == 1
}

/// Vertices of a facet at most: cost grows with the square.
const MOST_VERTICES: usize = 20_000;

/// Adds triangles that fill the loops; whether there are such.
pub(super) fn triangulate(planar: &mut Planar, flat: impl Fn(u32) -> Place, triangles: &mut Vec<[u32; 3]>) -> bool {
    let Planar { loops, bridges } = planar;
    if loops.iter().map(Vec::len).sum::<usize>() > MOST_VERTICES {
        return false;
    }
    if let [own] = &loops[..]
        && own.len() == 3
    {
        triangles.push([own[0], own[1], own[2]]);
        return true;
    }
    let placed = loops.iter().map(|own| own.iter().map(|&vertex| (vertex, flat(vertex))).collect::<Vec<Vertex>>());
    let (mut outer, mut holes): (Vec<_>, Vec<_>) = placed.map(|own| (signed_area(&own), own)).partition(|(area, _)| *area > 0.0);
    // The rightmost first: a bridge from a hole never meets one that is joined later.
    let right = |own: &[Vertex]| own.iter().map(|vertex| vertex.1[0]).fold(f64::NEG_INFINITY, f64::max);
    holes.sort_by(|a, b| right(&b.1).total_cmp(&right(&a.1)));
    while let Some((_, hole)) = holes.first() {
        let around = outer.iter().enumerate().filter(|(_, (_, own))| contains(own, &hole[0].1));
        let Some((index, _)) = around.min_by(|a, b| a.1.0.total_cmp(&b.1.0)) else { return false };
        let Some((k, m)) = bridge(&outer[index].1, hole, &holes[1..], bridges) else { return false };
        let own = &outer[index].1;
        outer[index].1 = own[..=k].iter().chain(&hole[m..]).chain(&hole[..=m]).chain(&own[k..]).copied().collect();
        holes.remove(0);
    }
    outer.into_iter().all(|(_, own)| clip(own, triangles))
}

/// The shortest way from a loop to a hole in it that crosses neither, nor another hole.
fn bridge(
    own: &[Vertex],
    hole: &[Vertex],
    others: &[(f64, Vec<Vertex>)],
    bridges: &mut Vec<(f64, usize, usize)>,
) -> Option<(usize, usize)> {
    bridges.clear();
    for (k, p) in own.iter().enumerate() {
        bridges.extend(hole.iter().enumerate().map(|(m, q)| (distance_squared(&p.1, &q.1), k, m)));
    }
    bridges.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let is_free = |&&(_, k, m): &&(f64, usize, usize)| {
        let (p, q) = (&own[k], &hole[m]);
        let crosses = |a: &Vertex, b: &Vertex| {
            let is_common = [a.0, b.0].iter().any(|end| *end == p.0 || *end == q.0);
            !is_common
                && (area(&p.1, &q.1, &a.1) >= 0.0) != (area(&p.1, &q.1, &b.1) >= 0.0)
                && (area(&a.1, &b.1, &p.1) >= 0.0) != (area(&a.1, &b.1, &q.1) >= 0.0)
        };
        let is_crossed = |vertices: &[Vertex]| (0..vertices.len()).any(|at| crosses(&vertices[at], &vertices[(at + 1) % vertices.len()]));
        // A vertex that other bridges made is there twice: the way must begin in the corner that it has here.
        let (before, after) = (&own[(k + own.len() - 1) % own.len()].1, &own[(k + 1) % own.len()].1);
        is_within_corner(before, &p.1, after, &q.1)
            && !is_crossed(own)
            && !is_crossed(hole)
            && !others.iter().any(|(_, other)| is_crossed(other))
    };
    bridges.iter().find(is_free).map(|&(_, k, m)| (k, m))
}

/// Whether the way from b to x begins between the edges at b of a loop that is counter-clockwise.
fn is_within_corner(a: &Place, b: &Place, c: &Place, x: &Place) -> bool {
    if area(a, b, c) > 0.0 { area(a, b, x) >= 0.0 && area(b, c, x) >= 0.0 } else { area(a, b, x) >= 0.0 || area(b, c, x) >= 0.0 }
}

/// Cuts the ears of a loop, the best ones first; whether there always was one.
fn clip(own: Vec<Vertex>, triangles: &mut Vec<[u32; 3]>) -> bool {
    let count = own.len();
    let (mut before, mut after): (Vec<usize>, Vec<usize>) = (0..count).map(|k| ((k + count - 1) % count, (k + 1) % count)).unzip();
    let mut open: Vec<usize> = (0..count).collect();
    // No other corner is in an ear of a convex loop: one that turns left everywhere, and goes around once.
    let turns_left = (0..count).all(|k| area(&own[before[k]].1, &own[k].1, &own[after[k]].1) > 0.0);
    let goes_back = |k: usize| own[after[k]].1[0] < own[k].1[0];
    let is_convex = turns_left && (0..count).filter(|&k| goes_back(k) && !goes_back(before[k])).count() == 1;
    let quality = |[a, b, c]: [usize; 3], open: &[usize]| -> Option<f64> {
        let [p, q, r] = [a, b, c].map(|k| &own[k].1);
        let twice = area(p, q, r);
        let is_clear = |&k: &usize| {
            let vertex = &own[k];
            let is_corner = [a, b, c].iter().any(|&corner| own[corner].0 == vertex.0);
            is_corner || area(p, q, &vertex.1) < 0.0 || area(q, r, &vertex.1) < 0.0 || area(r, p, &vertex.1) < 0.0
        };
        let sides = distance_squared(p, q) + distance_squared(q, r) + distance_squared(r, p);
        (twice > 0.0 && (is_convex || open.iter().all(is_clear))).then(|| twice / sides)
    };
    let mut qualities: Vec<Option<f64>> = (0..count).map(|k| quality([before[k], k, after[k]], &open)).collect();
    while open.len() > 3 {
        let best = (0..open.len())
            .filter_map(|place| qualities[open[place]].map(|quality| (quality, place)))
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let Some((_, place)) = best else { return false };
        let ear = open.remove(place);
        let (a, c) = (before[ear], after[ear]);
        triangles.push([own[a].0, own[ear].0, own[c].0]);
        (after[a], before[c]) = (c, a);
        for k in [a, c] {
            qualities[k] = quality([before[k], k, after[k]], &open);
        }
        // Others were no ears because of this vertex alone, perhaps.
        if open.len() > 3 && !open.iter().any(|&k| qualities[k].is_some()) {
            open.iter().for_each(|&k| qualities[k] = quality([before[k], k, after[k]], &open));
        }
    }
    triangles.push([own[open[0]].0, own[open[1]].0, own[open[2]].0]);
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::Random;

    /// The triangles of loops, and whether they fill what these bound without a gap or an overlap.
    fn fills(loops: &[Vec<Place>]) -> bool {
        let places: Vec<Place> = loops.iter().flatten().copied().collect();
        let (mut planar, mut next) = (Planar::default(), 0);
        planar.loops = loops
            .iter()
            .map(|own| {
                own.iter()
                    .map(|_| {
                        next += 1;
                        next - 1
                    })
                    .collect()
            })
            .collect();
        let mut triangles = Vec::new();
        let loops = planar.loops.clone();
        if !triangulate(&mut planar, |vertex| places[vertex as usize], &mut triangles) {
            return false;
        }
        // Every edge has another one backwards, but for those of the loops, and no triangle is clockwise: that covers all points as often as the loops wind around them.
        let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]).collect();
        edges.extend(loops.iter().flat_map(|own| (0..own.len()).map(|k| [own[(k + 1) % own.len()], own[k]])));
        let mut back: Vec<[u32; 2]> = edges.iter().map(|[a, b]| [*b, *a]).collect();
        edges.sort_unstable();
        back.sort_unstable();
        edges == back && triangles.iter().all(|t| area(&places[t[0] as usize], &places[t[1] as usize], &places[t[2] as usize]) > 0.0)
    }

    #[test]
    fn stars_with_holes_are_filled() {
        let mut random = Random(1);
        let mut number = || (random.next() >> 11) as f64 / (1_u64 << 53) as f64;
        for round in 0..400 {
            let star = |x: f64, y: f64, scale: f64, count: usize, number: &mut dyn FnMut() -> f64| -> Vec<Place> {
                (0..count)
                    .map(|k| {
                        let (sine, cosine) = (std::f64::consts::TAU * (k as f64 + 0.8 * number()) / count as f64).sin_cos();
                        let long = scale * (0.4 + 0.6 * number());
                        [x + long * cosine, y + long * sine]
                    })
                    .collect()
            };
            let mut loops = vec![star(0.0, 0.0, 10.0, 5 + round % 20, &mut number)];
            for (x, y) in [(0.0, 0.0), (1.5, 0.1), (-1.4, 0.3), (0.2, 1.4), (0.1, -1.5)].into_iter().take(round % 6) {
                let mut hole = star(x, y, 0.6, 3 + round % 5, &mut number);
                hole.reverse();
                loops.push(hole);
            }
            assert!(fills(&loops), "{round}: {loops:?}");
        }
    }

    #[test]
    fn convex_loops_are_filled_and_those_that_wind_twice_are_not_taken_for_such() {
        for count in [3, 4, 7, 40] {
            let circle = |k: usize, radius: f64, turns: f64| -> Place {
                let (sine, cosine) = (turns * std::f64::consts::TAU * (k as f64 + 0.3) / count as f64).sin_cos();
                [radius * cosine, radius * sine]
            };
            assert!(fills(&[(0..count).map(|k| circle(k, 1.0, 1.0)).collect()]), "{count}");
        }
        // It turns left everywhere; cut as a convex one, it has triangles that are clockwise.
        let twice = |k: usize| -> Place {
            let angle = 2.0 * std::f64::consts::TAU * k as f64 / 24.0;
            let (sine, cosine) = angle.sin_cos();
            let radius = 1.0 + 1.6 * (0.5 * angle).cos().powi(2);
            [radius * cosine, radius * sine]
        };
        let own: Vec<Vertex> = (0..24).map(|k| (k, twice(k as usize))).collect();
        let mut triangles = Vec::new();
        let is_cut = clip(own, &mut triangles);
        let turned = |t: &[u32; 3]| area(&twice(t[0] as usize), &twice(t[1] as usize), &twice(t[2] as usize)) <= 0.0;
        assert!(!is_cut || !triangles.iter().any(turned));
    }
}

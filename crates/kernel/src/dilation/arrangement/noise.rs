//! What is flat, or straight, but for noise is made so: in single precision, or with few digits, no two triangles of a face that is not along the axes lie in a plane, and a straight wire bends at every vertex.
//!
//! Vertices are moved to the planes of flat regions that they are on, and what is between the ends of a straight wire goes. Every triangle is mapped by the affine map of its corners, and every part of a wire by that of its ends: so no place of the sites is
//! farther from the new ones than vertices were moved, nor one of these from the sites. Bounds are narrower by as much, and `steady` tells whether the topology is the same.

use super::figure::{Figure, Outline, Polygon, order};
use super::polytopes::{Plane, height, normal};
use crate::attractor::cell::{Point, closest_on_segment, cross, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};

/// A region's plane while it grows may be off by so many times more than at last.
const GROWING: f64 = 4.0;
/// Planes through places are off these by some roundings: vertices that move by so many times what is flat had no noise.
const NOTHING: f64 = 64.0;
/// Triangles at a vertex, and segments, at most through which regions and wires go on.
const MOST_TRIANGLES: usize = 64;
const MOST_SEGMENTS: usize = 16;
/// How far vertices may be moved, in units of what planes may be off: where planes meet at a small angle, more than these.
const FARTHEST: f64 = 4.0;
/// The least sine of the angle between a plane and those that a vertex is on already, by which the vertex can be moved to it, too.
const LEAST_SINE: f64 = 0.05;
/// Corrections of a vertex, each of which leaves some roundings.
const CORRECTIONS: usize = 3;
/// Times that vertices are placed, after each of which regions that could not have all of theirs are given up: in the second half all that such a vertex is in.
const ROUNDS: usize = 32;
/// The least cosine by which a wire goes on, and its parts at most.
const STRAIGHT: f64 = 0.99;
const MOST_PARTS: usize = 512;
/// Times that ends of wires are moved to others, which may have moved themselves.
const SWEEPS: usize = 3;

/// Figures without noise.
pub(super) struct Cleared {
    pub(super) figures: Vec<Figure>,
    /// How far a place was moved at most.
    pub(super) moved: f64,
}

/// Points, segments and triangles made flat and straight where they are but for `most`; none where nothing was off by much more than `flatness`, or places for vertices could not be found. Vertices are on their planes up to `exact`.
///
/// # Errors
/// [`Stopped`].
pub(super) fn cleared(figures: &[Figure], most: f64, [flatness, exact]: [f64; 2], budget: &Budget) -> Result<Option<Cleared>, Stopped> {
    let net = Net::of(figures);
    let regions = net.regions(most, budget)?;
    let Some(mut places) = net.placed(regions, most, exact, budget)? else { return Ok(None) };
    net.straighten(&mut places, most, budget)?;
    let wires = net.wires(most, budget)?;
    net.place_between(&wires, &mut places);
    let mut square = places.at.iter().zip(&net.places).map(|(to, from)| distance_squared(to, from)).fold(0.0, f64::max);
    for wire in &wires {
        let [first, last] = wire.ends().map(|end| &places.at[end as usize]);
        let moved = wire.vertices.iter().map(|&vertex| &net.places[vertex as usize]);
        square = moved.map(|from| distance_squared(from, &closest_on_segment(from, first, last))).fold(square, f64::max);
    }
    let moved = square.sqrt();
    if moved <= NOTHING * flatness || moved > FARTHEST * most {
        return Ok(None);
    }
    Ok(Some(Cleared { figures: net.moved(figures, &wires, &places.at), moved }))
}

/// The vertices of some figures, and what is at each.
struct Net {
    /// In their order, each once.
    places: Vec<Point>,
    /// Of every figure, its vertices.
    corners: Vec<Box<[u32]>>,
    deficits: Vec<f64>,
    /// Of every vertex, the triangles and the segments there.
    triangles: Vec<Vec<u32>>,
    segments: Vec<Vec<u32>>,
}

/// Triangles that are flat together.
struct Region {
    plane: Plane,
    members: Vec<u32>,
    area: f64,
}

/// Where vertices are, and the regions that they are in, each with its plane.
struct Places {
    at: Vec<Point>,
    planes: Vec<Plane>,
    of_vertex: Vec<Vec<u32>>,
}

/// Segments that are straight together: the vertices from one end to the other.
struct Wire {
    vertices: Vec<u32>,
    deficit: f64,
}

impl Wire {
    fn ends(&self) -> [u32; 2] {
        [self.vertices[0], self.vertices[self.vertices.len() - 1]]
    }

    /// What is between the ends.
    fn between(&self) -> &[u32] {
        &self.vertices[1..self.vertices.len() - 1]
    }
}

/// A sum of triangles' planes.
#[derive(Clone, Copy, Default)]
struct Sum {
    /// Twice the area along the normal.
    across: Point,
    /// Of centres, times twice the area.
    centre: Point,
    double: f64,
}

impl Sum {
    fn plane(&self) -> Plane {
        let up = unit(&self.across);
        [up[0], up[1], up[2], dot(&up, &self.centre) / self.double]
    }

    /// With a triangle more, whichever way this is turned.
    fn with(&self, [a, b, c]: [&Point; 3]) -> Self {
        let across = cross(&subtract(b, a), &subtract(c, a));
        let (double, side) = (dot(&across, &across).sqrt(), if dot(&across, &self.across) < 0.0 { -1.0 } else { 1.0 });
        Self {
            across: std::array::from_fn(|axis| self.across[axis] + side * across[axis]),
            centre: std::array::from_fn(|axis| self.centre[axis] + double * (a[axis] + b[axis] + c[axis]) / 3.0),
            double: self.double + double,
        }
    }
}

impl Net {
    fn of(figures: &[Figure]) -> Self {
        let mut places: Vec<Point> = figures.iter().flat_map(Figure::corners).copied().collect();
        places.sort_unstable_by(order);
        places.dedup();
        let name = |corner: &Point| places.binary_search_by(|own| order(own, corner)).unwrap_or_default() as u32;
        let corners: Vec<Box<[u32]>> = figures.iter().map(|figure| figure.corners().iter().map(name).collect()).collect();
        let (mut triangles, mut segments) = (vec![Vec::new(); places.len()], vec![Vec::new(); places.len()]);
        for (figure, (number, corners)) in figures.iter().zip((0..).zip(&corners)) {
            let at = match figure.outline {
                Outline::Polygon(_) => &mut triangles,
                Outline::Segment(_) => &mut segments,
                Outline::Point(_) | Outline::Polyhedron(_) => continue,
            };
            corners.iter().for_each(|&corner| at[corner as usize].push(number));
        }
        Self { places, corners, deficits: figures.iter().map(|figure| figure.deficit).collect(), triangles, segments }
    }

    fn triangle(&self, figure: u32) -> [&Point; 3] {
        let corners = &self.corners[figure as usize];
        [0, 1, 2].map(|k| &self.places[corners[k] as usize])
    }

    fn length_squared(&self, segment: u32) -> f64 {
        let [p, q] = [0, 1].map(|end| &self.places[self.corners[segment as usize][end] as usize]);
        distance_squared(p, q)
    }

    /// Regions of at least two triangles that hang together at vertices and lie in a plane but for `most`, the largest first. They grow around large triangles, whose planes are the most exact.
    fn regions(&self, most: f64, budget: &Budget) -> Result<Vec<Region>, Stopped> {
        let is_off = |plane: &Plane, figure: u32, by: f64| self.triangle(figure).iter().any(|corner| height(plane, corner).abs() > by);
        let mut seeds: Vec<(f64, u32)> = Vec::new();
        for figure in (0..self.corners.len() as u32).filter(|&figure| self.corners[figure as usize].len() == 3) {
            seeds.push((Sum::default().with(self.triangle(figure)).double, figure));
        }
        seeds.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut is_taken = vec![false; self.corners.len()];
        let (mut seen, mut found) = (vec![u32::MAX; self.places.len()], Vec::new());
        for &(_, seed) in seeds.iter().filter(|(double, _)| *double > 0.0) {
            if std::mem::replace(&mut is_taken[seed as usize], true) {
                continue;
            }
            budget.cancel.check()?;
            let mut sum = Sum::default().with(self.triangle(seed));
            let (mut plane, mut members, mut next) = (sum.plane(), vec![seed], 0);
            while next < members.len() {
                for &vertex in &self.corners[members[next] as usize] {
                    // Once for each seed; what goes on around a hub does so from its neighbours.
                    let is_known = std::mem::replace(&mut seen[vertex as usize], seed) == seed;
                    if is_known || self.triangles[vertex as usize].len() > MOST_TRIANGLES {
                        continue;
                    }
                    for &other in &self.triangles[vertex as usize] {
                        if !is_taken[other as usize] && !is_off(&plane, other, GROWING * most) {
                            is_taken[other as usize] = true;
                            sum = sum.with(self.triangle(other));
                            plane = sum.plane();
                            members.push(other);
                        }
                    }
                }
                next += 1;
            }
            let (kept, lost): (Vec<u32>, Vec<u32>) = members.into_iter().partition(|&figure| !is_off(&plane, figure, most));
            // What is no region's is left to others, unless there is so much that it might be looked at again and again.
            if lost.len() < kept.len() {
                lost.into_iter().for_each(|figure| is_taken[figure as usize] = false);
            }
            if kept.len() > 1 {
                found.push(Region { plane, members: kept, area: sum.double });
            }
        }
        found.sort_by(|a, b| b.area.total_cmp(&a.area));
        Ok(found)
    }

    /// Every vertex on the planes of all regions that it is in; small regions are given up where it cannot be. None where that takes too long.
    fn placed(&self, regions: Vec<Region>, most: f64, exact: f64, budget: &Budget) -> Result<Option<Places>, Stopped> {
        let mut of_vertex: Vec<Vec<u32>> = vec![Vec::new(); self.places.len()];
        for (number, region) in (0..).zip(&regions) {
            for &corner in region.members.iter().flat_map(|&figure| &*self.corners[figure as usize]) {
                let own = &mut of_vertex[corner as usize];
                if own.last() != Some(&number) {
                    own.push(number);
                }
            }
        }
        let mut at = self.places.clone();
        let mut is_gone = vec![false; regions.len()];
        let mut open: Vec<u32> = (0..self.places.len() as u32).filter(|&vertex| !of_vertex[vertex as usize].is_empty()).collect();
        for round in 0..ROUNDS {
            budget.cancel.check()?;
            let mut lost: Vec<u32> = Vec::new();
            for &vertex in &open {
                let own = &of_vertex[vertex as usize];
                let left: Vec<u32> = own.iter().copied().filter(|&region| !is_gone[region as usize]).collect();
                let planes: Vec<&Plane> = left.iter().map(|&region| &regions[region as usize].plane).collect();
                let from = &self.places[vertex as usize];
                let placed = on_planes(from, &planes, exact).filter(|to| distance_squared(from, to) <= (FARTHEST * most).powi(2));
                match placed {
                    Some(to) => at[vertex as usize] = to,
                    // The smallest one, as long as there is time for that.
                    None => lost.extend(&left[if round < ROUNDS / 2 { left.len() - 1 } else { 0 }..]),
                }
            }
            if lost.is_empty() {
                of_vertex.iter_mut().for_each(|own| own.retain(|&region| !is_gone[region as usize]));
                return Ok(Some(Places { at, planes: regions.iter().map(|region| region.plane).collect(), of_vertex }));
            }
            lost.iter().for_each(|&region| is_gone[region as usize] = true);
            open.retain(|&vertex| of_vertex[vertex as usize].iter().any(|&region| is_gone[region as usize]));
        }
        Ok(None)
    }

    /// Moves vertices that are in one region alone to the lines along its triangles' sides that go straight on there, two at most: along its plane, where noise would leave no two polygons' sides on a line.
    fn straighten(&self, places: &mut Places, most: f64, budget: &Budget) -> Result<(), Stopped> {
        let is_free = |vertex: u32| places.of_vertex[vertex as usize].len() == 1;
        let mut sides: Vec<(u32, [u32; 2])> = Vec::new();
        for corners in self.corners.iter().filter(|corners| corners.len() == 3 && corners.iter().any(|&corner| is_free(corner))) {
            for k in 0..3 {
                let [p, q] = [corners[k], corners[(k + 1) % 3]];
                let common = places.of_vertex[p as usize].iter().find(|region| places.of_vertex[q as usize].contains(region));
                sides.extend(common.filter(|_| is_free(p) || is_free(q)).map(|&region| (region, [p.min(q), p.max(q)])));
            }
        }
        sides.sort_unstable();
        sides.dedup();
        let mut segments = vec![Vec::new(); self.places.len()];
        for (number, (_, ends)) in (0..).zip(&sides) {
            ends.iter().for_each(|&end| segments[end as usize].push(number));
        }
        let own = Self {
            places: places.at.clone(),
            corners: sides.iter().map(|(_, ends)| Box::from(*ends)).collect(),
            // Lines stay in their region.
            deficits: sides.iter().map(|&(region, _)| f64::from(region)).collect(),
            triangles: Vec::new(),
            segments,
        };
        let mut lines = own.wires(most, budget)?;
        // Those with short parts first: what grids have beside their rows and columns are diagonals.
        lines.sort_by(|a, b| own.part(a).total_cmp(&own.part(b)));
        let mut of_vertex: Vec<Vec<u32>> = vec![Vec::new(); self.places.len()];
        for (number, line) in (0..).zip(&lines) {
            line.between().iter().filter(|&&vertex| is_free(vertex)).for_each(|&vertex| of_vertex[vertex as usize].push(number));
        }
        for _ in 0..SWEEPS {
            for (vertex, through) in of_vertex.iter().enumerate().filter(|(_, through)| !through.is_empty()) {
                let face = &places.planes[places.of_vertex[vertex][0] as usize];
                let upright = |&line: &u32| -> Plane {
                    let [first, last] = lines[line as usize].ends().map(|end| places.at[end as usize]);
                    let across = unit(&cross(&normal(face), &subtract(&last, &first)));
                    [across[0], across[1], across[2], dot(&across, &first)]
                };
                let planes: Vec<Plane> = std::iter::once(*face).chain(through.iter().take(2).map(upright)).collect();
                let placed = on_planes(&own.places[vertex], &planes.iter().collect::<Vec<&Plane>>(), f64::INFINITY);
                let is_near = |to: &Point| distance_squared(to, &self.places[vertex]) <= (FARTHEST * most).powi(2);
                if let Some(to) = placed.filter(is_near) {
                    places.at[vertex] = to;
                }
            }
        }
        Ok(())
    }

    /// Segments that go straight on, but for `most`, from vertex to vertex, as far as they do; the longest first.
    fn wires(&self, most: f64, budget: &Budget) -> Result<Vec<Wire>, Stopped> {
        let mut seeds: Vec<u32> = (0..self.corners.len() as u32).filter(|&figure| self.corners[figure as usize].len() == 2).collect();
        seeds.sort_unstable_by(|&a, &b| self.length_squared(b).total_cmp(&self.length_squared(a)).then(a.cmp(&b)));
        let mut is_taken = vec![false; self.corners.len()];
        let mut found = Vec::new();
        for seed in seeds {
            if std::mem::replace(&mut is_taken[seed as usize], true) {
                continue;
            }
            budget.cancel.check()?;
            let mut vertices = self.corners[seed as usize].to_vec();
            let deficit = self.deficits[seed as usize];
            for _ in 0..2 {
                while vertices.len() < MOST_PARTS {
                    let Some((segment, end)) = self.going_on(&vertices, deficit, most, &is_taken) else { break };
                    is_taken[segment as usize] = true;
                    vertices.push(end);
                }
                vertices.reverse();
            }
            if vertices.len() > 2 {
                found.push(Wire { vertices, deficit });
            }
        }
        let length = |wire: &Wire| self.part(wire) * wire.vertices.len() as f64;
        found.sort_by(|a, b| length(b).total_cmp(&length(a)));
        Ok(found)
    }

    /// About how long the parts of a wire are.
    fn part(&self, wire: &Wire) -> f64 {
        let [first, last] = wire.ends().map(|end| &self.places[end as usize]);
        distance_squared(first, last).sqrt() / wire.vertices.len() as f64
    }

    /// The segment by which a wire goes on straight at its last vertex, and where that ends; none where it would be off the line between both ends by more than `most`.
    fn going_on(&self, vertices: &[u32], deficit: f64, most: f64, is_taken: &[bool]) -> Option<(u32, u32)> {
        let [.., before, last] = *vertices else { return None };
        let [from, at] = [before, last].map(|vertex| &self.places[vertex as usize]);
        let way = unit(&subtract(at, from));
        let there = &self.segments[last as usize];
        if there.len() > MOST_SEGMENTS {
            return None;
        }
        let others =
            there.iter().filter(|&&segment| !is_taken[segment as usize] && self.deficits[segment as usize].to_bits() == deficit.to_bits());
        let with_end = |&segment: &u32| {
            let end = self.corners[segment as usize].iter().copied().find(|&end| end != last)?;
            (end != vertices[0]).then(|| (dot(&way, &unit(&subtract(&self.places[end as usize], at))), segment, end))
        };
        let (cosine, segment, end) = others.filter_map(with_end).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))?;
        let [first, to] = [vertices[0], end].map(|vertex| &self.places[vertex as usize]);
        let is_off = |vertex: &u32| {
            let on = &self.places[*vertex as usize];
            distance_squared(on, &closest_on_segment(on, first, to)) > most * most
        };
        (cosine > STRAIGHT && !vertices[1..].iter().any(is_off)).then_some((segment, end))
    }

    /// Moves what lies between the ends of a wire, and on no plane, to it.
    fn place_between(&self, wires: &[Wire], places: &mut Places) {
        let mut is_within = vec![false; self.places.len()];
        for _ in 0..SWEEPS {
            is_within.fill(false);
            for wire in wires {
                let [first, last] = wire.ends().map(|end| places.at[end as usize]);
                for &vertex in wire.between() {
                    // That of the longest wire.
                    if !std::mem::replace(&mut is_within[vertex as usize], true) && places.of_vertex[vertex as usize].is_empty() {
                        places.at[vertex as usize] = closest_on_segment(&self.places[vertex as usize], &first, &last);
                    }
                }
            }
        }
    }

    /// The figures with their vertices moved, and one segment for each wire.
    fn moved(&self, figures: &[Figure], wires: &[Wire], at: &[Point]) -> Vec<Figure> {
        let mut is_part = vec![false; figures.len()];
        for Wire { vertices, deficit } in wires {
            for pair in vertices.windows(2) {
                let parts = self.segments[pair[0] as usize].iter().map(|&segment| segment as usize);
                let own = parts.filter(|&part| self.corners[part].contains(&pair[1]) && self.deficits[part].to_bits() == deficit.to_bits());
                own.for_each(|part| is_part[part] = true);
            }
        }
        let place = |vertex: u32| at[vertex as usize].map(|x| x + 0.0);
        let whole = figures.iter().zip(&self.corners).zip(is_part).filter(|(_, is_part)| !is_part).map(|((figure, corners), _)| {
            let outline = match &figure.outline {
                Outline::Point(_) => Outline::Point(place(corners[0])),
                Outline::Segment(_) => Outline::Segment([place(corners[0]), place(corners[1])]),
                Outline::Polygon(_) => Outline::Polygon(Polygon::new(corners.iter().map(|&corner| place(corner)).collect())),
                Outline::Polyhedron(polyhedron) => Outline::Polyhedron(polyhedron.clone()),
            };
            Figure { outline, deficit: figure.deficit }
        });
        let straight = wires.iter().map(|wire| Figure { outline: Outline::Segment(wire.ends().map(place)), deficit: wire.deficit });
        whole.chain(straight).collect()
    }
}

/// The place on some planes, up to a part of `exact`, to which a place gets by a step for each that is not told by those before it; none where there is none.
fn on_planes(from: &Point, planes: &[&Plane], exact: f64) -> Option<Point> {
    let mut across: Vec<(usize, Point)> = Vec::new();
    for (place, plane) in planes.iter().enumerate() {
        if across.len() == 3 {
            break;
        }
        let up = normal(plane);
        let rest = across.iter().fold(up, |rest: Point, (_, way)| {
            let along = dot(&rest, way);
            std::array::from_fn(|axis| rest[axis] - along * way[axis])
        });
        if dot(&rest, &rest) > LEAST_SINE * LEAST_SINE {
            across.push((place, unit(&rest)));
        }
    }
    let mut to = *from;
    for _ in 0..CORRECTIONS {
        for (place, way) in &across {
            let plane = planes[*place];
            let by = height(plane, &to) / dot(&normal(plane), way);
            to = std::array::from_fn(|axis| to[axis] - by * way[axis]);
        }
    }
    planes.iter().all(|plane| height(plane, &to).abs() <= 0.25 * exact).then_some(to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::Attractor;
    use crate::attractor::cell::{Site, between};
    use crate::dilation::arrangement::Arrangement;
    use crate::dilation::arrangement::figure::joined;
    use crate::dilation::arrangement::testing::{arranged, lowered_as, plan, topology};
    use crate::dilation::convex::Convex;
    use crate::dilation::tree::Weighted;
    use crate::model::Interior;
    use crate::solid::Inside;
    use crate::split_mix::Random;
    use glam::DVec3;

    const FLAT: [f64; 2] = [1e-13, 1e-10];

    fn figure(site: Site) -> Figure {
        Weighted { site, deficit: 0.0 }.into()
    }

    fn cleared_of(figures: &[Figure], most: f64) -> Option<Cleared> {
        cleared(figures, most, FLAT, &Budget::default()).unwrap()
    }

    /// A place turned, and moved by noise.
    fn noisy(at: Point, noise: f64, random: &mut Random) -> Point {
        let x = unit(&[0.8, 0.3, -0.5]);
        let y = unit(&cross(&x, &[0.1, 0.9, 0.4]));
        let axes = [x, y, cross(&x, &y)];
        std::array::from_fn(|k| (0..3).map(|axis| at[axis] * axes[axis][k]).sum::<f64>() + noise * (2.0 * random.share() - 1.0))
    }

    /// The squares between the cells of a lattice that are full and those that are not, as two triangles each.
    fn voxels(size: i32, is_full: impl Fn([i32; 3]) -> bool, place: &mut impl FnMut([i32; 3]) -> Point) -> Vec<Figure> {
        let is_full = |cell: [i32; 3]| cell.iter().all(|x| (0..size).contains(x)) && is_full(cell);
        let mut figures = Vec::new();
        for number in 0..(size + 1).pow(3) {
            let cell = [number % (size + 1), number / (size + 1) % (size + 1), number / (size + 1).pow(2)];
            for axis in 0..3 {
                let before: [i32; 3] = std::array::from_fn(|k| cell[k] - i32::from(k == axis));
                if is_full(cell) == is_full(before) {
                    continue;
                }
                let corner = |code: usize| -> [i32; 3] {
                    std::array::from_fn(|k| {
                        cell[k] + i32::from(k == (axis + 1) % 3 && code & 1 == 1) + i32::from(k == (axis + 2) % 3 && code > 1)
                    })
                };
                // Counter-clockwise seen from outside.
                let [a, b, c, d] = (if is_full(cell) { [0, 2, 3, 1] } else { [0, 1, 3, 2] }).map(|code| place(corner(code)));
                figures.extend([[a, b, c], [a, c, d]].map(|corners| figure(Site::Triangle(corners))));
            }
        }
        figures
    }

    /// The greatest distance of places of some figures from others.
    fn farthest(of: &[Figure], from: &[Figure], random: &mut Random) -> f64 {
        let mut farthest = 0.0_f64;
        for figure in of.iter().flat_map(|figure| [figure; 4]) {
            let corners = figure.corners();
            let x = corners.iter().fold(corners[0], |x, corner| between(&x, corner, random.share()));
            let square = from.iter().map(|other| distance_squared(&x, &other.closest(&x))).fold(f64::INFINITY, f64::min);
            farthest = farthest.max(square.sqrt());
        }
        farthest
    }

    /// Blocks with tunnels and steps, turned, with noise: as many polygons as without, but for some, and no place farther off than is told.
    #[test]
    fn faces_are_flat_but_for_noise() {
        let mut random = Random(3);
        for round in 0..12 {
            let noise = [1e-7, 1e-5, 1e-3][round % 3];
            let is_gone: Vec<bool> = (0..125).map(|_| random.next().is_multiple_of(4)).collect();
            let is_full = |[x, y, z]: [i32; 3]| !is_gone[(x + 5 * (y + 5 * z)) as usize];
            let exact = voxels(5, is_full, &mut |at| at.map(|x| 7.0 * f64::from(x)));
            let mut places = std::collections::BTreeMap::new();
            let figures = voxels(5, is_full, &mut |at| {
                *places.entry(at).or_insert_with(|| noisy(at.map(|x| 7.0 * f64::from(x)), noise, &mut random))
            });
            assert!(cleared_of(&exact, 1e-3).is_none(), "nothing to do");
            let Cleared { figures: clear, moved } = cleared_of(&figures, 8.0 * noise).expect("noise");
            assert!(moved > 0.1 * noise && moved < 16.0 * noise, "{round}: {moved}");
            let [there, back] = [farthest(&figures, &clear, &mut random), farthest(&clear, &figures, &mut random)];
            assert!(there.max(back) <= moved * (1.0 + 1e-9), "{round}: {there} and {back}, told {moved}");
            let count = |figures: &[Figure], flatness| joined(figures.to_vec(), flatness, 1e-3, &Budget::default()).unwrap().len();
            let [before, after, least] = [count(&figures, FLAT[0]), count(&clear, FLAT[1]), count(&exact, FLAT[0])];
            assert!(2 * after < before && 2 * after < 3 * least, "{round}: {before} to {after}, {least} without noise");
        }
    }

    /// Grids of wires, turned, with noise: one segment for each, and ends on others stay on these.
    #[test]
    fn wires_are_straight_but_for_noise() {
        let mut random = Random(5);
        let place = |at: [i32; 3], random: &mut Random| noisy(at.map(|x| 3.0 * f64::from(x)), 1e-5, random);
        let places: Vec<Point> = (0..64).map(|k| place([k % 8, k / 8, 0], &mut random)).collect();
        let mut figures = Vec::new();
        for k in 0..64_usize {
            figures.extend((k % 8 < 7).then(|| figure(Site::Segment([places[k], places[k + 1]]))));
            figures.extend((k / 8 < 7).then(|| figure(Site::Segment([places[k + 8], places[k]]))));
        }
        // Upwards from the middle of a wire, in two parts.
        let up = [1, 2].map(|z| place([3, 3, z], &mut random));
        figures.extend([[places[27], up[0]], [up[1], up[0]]].map(|ends| figure(Site::Segment(ends))));
        let Cleared { figures: clear, moved } = cleared_of(&figures, 1e-4).expect("noise");
        assert_eq!(clear.len(), 17);
        let [there, back] = [farthest(&figures, &clear, &mut random), farthest(&clear, &figures, &mut random)];
        assert!(moved < 1e-4 && there.max(back) <= moved * (1.0 + 1e-9), "{there} and {back}, told {moved}");
        let ends = clear.iter().map(Figure::corners).find(|ends| ends.contains(&up[1])).expect("the one upwards");
        let low = ends.iter().find(|end| **end != up[1]).expect("another end");
        let on = clear.iter().filter(|wire| distance_squared(low, &wire.closest(low)) < 1e-24).count();
        assert!(on >= 2, "on {on} wires");
        // With other radii they are others.
        let graded: Vec<Figure> =
            figures.iter().enumerate().map(|(k, figure)| Figure { deficit: (k % 2) as f64, ..figure.clone() }).collect();
        assert!(cleared_of(&graded, 1e-4).is_none_or(|cleared| cleared.figures.len() > 60));
    }

    /// What bends by more than noise stays as it is.
    #[test]
    fn what_bends_stays() {
        let mut random = Random(7);
        let at = |i: i32, j: i32| -> Point {
            let [u, v] = [i, j].map(|k| 0.2 * f64::from(k));
            [10.0 * u.cos() * v.cos(), 10.0 * u.sin() * v.cos(), 10.0 * v.sin()]
        };
        let cells = (0..30).flat_map(|i| (-6..6).map(move |j| (i, j)));
        let ball: Vec<Figure> = cells
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .map(|corners| figure(Site::Triangle(corners)))
            .collect();
        assert!(cleared_of(&ball, 1e-6).is_none());
        let ring: Vec<Figure> = (0..31).map(|i| figure(Site::Segment([at(i, 0), at(i + 1, 0)]))).collect();
        assert!(cleared_of(&ring, 1e-6).is_none());
        let points: Vec<Figure> = (0..50).map(|k| figure(Site::Point(noisy([f64::from(k); 3], 1e-6, &mut random)))).collect();
        assert!(cleared_of(&points, 1e-3).is_none());
    }

    /// Flat faces with more noise than is taken for it, cones, and stars of segments, of which everything is beside everything: no more than a look at each of all that are beside it.
    #[test]
    fn what_is_beside_much_takes_no_longer() {
        let mut random = Random(11);
        let side = 120;
        let places: Vec<Point> =
            (0..side * side).map(|k| noisy([f64::from(k % side), f64::from(k / side), 0.0], 2e-3, &mut random)).collect();
        let squares = (0..side * (side - 1)).filter(|k| k % side + 1 < side).map(|k| k as usize);
        let [right, up] = [1, side as usize];
        let grid: Vec<Figure> = squares
            .flat_map(|k| [[k, k + right, k + right + up], [k, k + right + up, k + up]])
            .map(|corners| figure(Site::Triangle(corners.map(|k| places[k]))))
            .collect();
        let around = |k: u32, count: u32| -> Point {
            let (sine, cosine) = (std::f64::consts::TAU * f64::from(k) / f64::from(count)).sin_cos();
            [9.0 * cosine, 9.0 * sine, 0.0]
        };
        let top = [0.0, 0.0, 5.0];
        let count = 20_000;
        let cone: Vec<Figure> = (0..count).map(|k| figure(Site::Triangle([top, around(k, count), around(k + 1, count)]))).collect();
        let star: Vec<Figure> = (0..2 * count).map(|k| figure(Site::Segment([top, around(k, 2 * count)]))).collect();
        let fan: Vec<Figure> = (0..count).map(|k| figure(Site::Triangle([[0.0; 3], around(k, count), around(k + 1, count)]))).collect();
        assert!(cleared_of(&grid, 1e-3).is_none_or(|cleared| cleared.moved < 4e-3));
        assert!([cone, star, fan].iter().all(|figures| cleared_of(figures, 1e-6).is_none_or(|cleared| cleared.moved < 4e-6)));
    }

    /// A mesh with coordinates that are turned, moved and rounded to single precision, or as they are.
    fn mesh(figures: &[Figure], interior: Interior, is_rounded: bool) -> (Attractor, Vec<Figure>) {
        let rounded =
            |at: &Point| -> Point { if is_rounded { noisy(*at, 0.0, &mut Random(1)).map(|x| f64::from((x + 40.0) as f32)) } else { *at } };
        let places: Vec<Point> = figures.iter().flat_map(Figure::corners).map(rounded).collect();
        let mut vertices = places.clone();
        vertices.sort_unstable_by(order);
        vertices.dedup();
        let number = |at: &Point| vertices.binary_search_by(|own| order(own, at)).unwrap() as u32;
        let faces = places.chunks(3).map(|corners| corners.iter().map(number).collect()).collect();
        let own = places.chunks(3).map(|corners| figure(Site::Triangle([corners[0], corners[1], corners[2]]))).collect();
        let vertices: Vec<DVec3> = vertices.into_iter().map(DVec3::from_array).collect();
        (lowered_as(interior, &vertices, faces).unwrap(), own)
    }

    /// How many figures are left of a shape, and how much narrower its bounds are.
    fn narrowed(attractor: &Attractor, radius: f64, tolerance: f64) -> (usize, [f64; 2]) {
        let (plan, budget) = (plan(attractor, radius, tolerance), Budget::default());
        let setting = plan.setting(plan.pitch(), &budget);
        let made = Arrangement::new(&setting, plan.rule(), plan.space(&setting).candidates(), &budget).unwrap().unwrap();
        (made.sites.list.len(), [made.setting.least - setting.least, setting.outer - made.setting.outer])
    }

    /// A frame with steps, turned and rounded, its surface alone and filled: few bodies, within the bounds of what was given, with the topology of the exact one.
    #[test]
    fn noisy_frames_are_as_exact_ones() {
        let mut random = Random(13);
        let is_full = |[x, y, z]: [i32; 3]| z < 1 + x / 2 % 2 && !((1..4).contains(&x) && y == 2);
        let exact = voxels(5, is_full, &mut |at| at.map(|x| 3.0 * f64::from(x)));
        for (interior, radius, tolerance) in [(Interior::Surface, 0.5, 0.05), (Interior::Solid, 0.5, 0.005), (Interior::Solid, 0.7, 0.003)]
        {
            let (plain, _) = mesh(&exact, interior, false);
            let (noisy, figures) = mesh(&exact, interior, true);
            let (count, narrower) = narrowed(&noisy, radius, tolerance);
            let (least, none) = narrowed(&plain, radius, tolerance);
            assert!(none == [0.0; 2] && narrower.iter().all(|by| (1e-8..2e-5).contains(by)), "{narrower:?}");
            assert!(count < 2 * least && 2 * count < figures.len(), "{count} of {}, {least} exact", figures.len());
            let [made, expected] = [&noisy, &plain].map(|shape| arranged(shape, radius, tolerance));
            assert!(made.topology_exact && made.crossings == 0 && made.inner_mm.max(made.outer_mm) <= tolerance);
            assert_eq!(topology(&made), topology(&expected));
            let distance = |x: &Point| figures.iter().map(|figure| figure.distance_squared(x)).fold(f64::INFINITY, f64::min).sqrt();
            let vertices = &made.solid.mesh().vertices;
            let ends = vertices.iter().map(|vertex| distance(&vertex.to_array()));
            let [low, high] = ends.fold([f64::INFINITY, 0.0_f64], |[low, high], d| [low.min(d), high.max(d)]);
            assert!(low >= radius - made.inner_mm && high <= radius + made.outer_mm, "from {low} to {high}");
            let inside = Inside::new(made.solid.mesh());
            for _ in 0..400 {
                let near = figures[(random.next() % figures.len() as u64) as usize].corners()[0];
                let x = near.map(|x| x + 1.6 * radius * (2.0 * random.share() - 1.0));
                let d = distance(&x);
                let is_in = inside.winding(DVec3::from_array(x)) == 1;
                assert!(is_in || d > radius - made.inner_mm, "{x:?} is {d} away");
                let is_filled = interior == Interior::Solid;
                assert!(!is_in || is_filled || d < radius + made.outer_mm, "{x:?} is {d} away");
            }
        }
    }

    /// Two plates, as far from each other as two radii but for less than noise: the plates as they are. Farther, or nearer, flat ones.
    #[test]
    fn noise_stays_where_it_might_matter() {
        for (gap, is_cleared) in [(2.0, false), (2.000_000_01, false), (2.1, true), (1.9, true)] {
            let plate = |z: f64| {
                voxels(6, |[_, _, k]| k == 0, &mut |at| [f64::from(at[0]), f64::from(at[1]), if at[2] == 0 { z } else { f64::from(at[2]) }])
            };
            let low = |figure: &Figure| figure.corners().iter().all(|corner| corner[2] < 1.0);
            let [lower, upper] = [0.0, -gap].map(|z| plate(z).into_iter().filter(low).collect::<Vec<Figure>>());
            let (shape, figures) = mesh(&[lower, upper].concat(), Interior::Surface, true);
            let (count, narrower) = narrowed(&shape, 1.0, 0.1);
            assert_eq!((narrower != [0.0; 2], 2 * count < figures.len()), (is_cleared, is_cleared), "{gap}: {count} of {}", figures.len());
        }
    }
}

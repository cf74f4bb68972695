//! Which outer loop a hole belongs to.
//!
//! Each hole is asked at a point well inside it, on the line v = constant through the middle of its box. Which sides of loops cross
//! these lines an interval tree tells for all holes at once, so nothing is quadratic: a hole costs the sides on its line.

use super::Polygon;
use super::ring::{Ring, sides};
use super::stabbing::{Span, Stabbing};
use glam::DVec2;
use robust::{Coord, orient2d};
use std::collections::HashMap;

/// A side of a loop that crosses some line, from its lower end to its upper.
struct Side {
    ring: u32,
    ends: [DVec2; 2],
}

impl Side {
    /// Where it crosses v = `level`, which lies between its ends.
    fn at(&self, level: f64) -> f64 {
        let [low, high] = self.ends;
        low.x + (level - low.y) / (high.y - low.y) * (high.x - low.x)
    }

    /// Whether it passes on the side of lesser u, exactly.
    fn is_before(&self, point: DVec2) -> bool {
        let [low, high] = self.ends.map(|end| Coord { x: end.x, y: end.y });
        orient2d(low, high, Coord { x: point.x, y: point.y }) < 0.0
    }
}

/// Polygons in the order of their outer loops, and the holes in none. A hole goes to the smallest outer loop around it that is larger than
/// itself: what lies in the hole is not.
pub(super) fn nest(mut rings: Vec<Ring>) -> (Vec<Polygon>, Vec<Vec<DVec2>>) {
    cancel(&mut rings);
    let owners = owners(&rings);
    let mut place = vec![0; rings.len()];
    let mut polygons: Vec<Polygon> = Vec::new();
    let mut holes = Vec::new();
    for (index, ring) in rings.into_iter().enumerate() {
        if ring.area > 0.0 {
            place[index] = polygons.len();
            polygons.push(Polygon { outer: ring.points, holes: Vec::new() });
        } else {
            holes.push(ring.points);
        }
    }
    let mut unmatched = Vec::new();
    for (hole, owner) in holes.into_iter().zip(owners) {
        match owner {
            Some(ring) => polygons[place[ring as usize]].holes.push(hole),
            None => unmatched.push(hole),
        }
    }
    (polygons, unmatched)
}

/// Leaves out pairs of loops that run along the same points both ways: what the plane touches from below along a curve has no area.
fn cancel(rings: &mut Vec<Ring>) {
    // A loop from its least point on, the way around that an outer loop goes.
    let name = |ring: &Ring| -> Vec<[u64; 2]> {
        let mut points: Vec<DVec2> = ring.points.clone();
        if ring.area < 0.0 {
            points.reverse();
        }
        let order = |a: &DVec2, b: &DVec2| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y));
        let first = (0..points.len()).min_by(|&a, &b| order(&points[a], &points[b])).unwrap_or(0);
        points.rotate_left(first);
        // Zeros have two signs.
        points.iter().map(|point| point.to_array().map(|x| (x + 0.0).to_bits())).collect()
    };
    if rings.iter().all(|ring| ring.area > 0.0) {
        return;
    }
    // The box's corner and the number of points tell most loops apart.
    let key = |ring: &Ring| {
        let least = ring.points.iter().copied().reduce(DVec2::min).unwrap_or_default();
        (ring.points.len(), least.to_array().map(|x| (x + 0.0).to_bits()))
    };
    let mut outer: HashMap<_, Vec<usize>> = HashMap::new();
    for (index, ring) in rings.iter().enumerate().filter(|(_, ring)| ring.area > 0.0) {
        outer.entry(key(ring)).or_default().push(index);
    }
    let mut stays = vec![true; rings.len()];
    for (index, ring) in rings.iter().enumerate().filter(|(_, ring)| ring.area < 0.0) {
        let like = outer.get_mut(&key(ring));
        if let Some(like) = like
            && let Some(place) = like.iter().position(|&other| name(&rings[other]) == name(ring))
        {
            stays[index] = false;
            stays[like.remove(place)] = false;
        }
    }
    let mut stays = stays.into_iter();
    rings.retain(|_| stays.next().unwrap_or(true));
}

/// The outer loop around each hole.
fn owners(rings: &[Ring]) -> Vec<Option<u32>> {
    let holes: Vec<u32> = (0..rings.len() as u32).filter(|&ring| rings[ring as usize].area < 0.0).collect();
    let levels: Vec<f64> = holes.iter().map(|&ring| middle(&rings[ring as usize].points)).collect();
    let mut order: Vec<u32> = (0..holes.len() as u32).collect();
    order.sort_by(|&a, &b| levels[a as usize].total_cmp(&levels[b as usize]));
    let below = |v: f64| order.partition_point(|&hole| levels[hole as usize] < v) as u32;
    let mut crossing = Vec::new();
    let mut spans = Vec::new();
    if !holes.is_empty() {
        for (ring, side) in rings.iter().enumerate().flat_map(|(ring, one)| sides(&one.points).map(move |side| (ring, side))) {
            let ends = if side[0].y <= side[1].y { side } else { [side[1], side[0]] };
            // A line meets the lower end of a side and not the upper: each loop an even number of times.
            let (low, high) = (below(ends[0].y) + 1, below(ends[1].y));
            if low <= high {
                spans.push(Span { low, high, item: crossing.len() as u32 });
                crossing.push(Side { ring: ring as u32, ends });
            }
        }
    }
    let stabbing = Stabbing::new(spans, holes.len() as u32);
    let mut owners = vec![None; holes.len()];
    for (number, &hole) in (1..).zip(&order) {
        let mut met = Vec::new();
        stabbing.each(number, |item| met.push(&crossing[item as usize]));
        owners[hole as usize] = owner(rings, holes[hole as usize], levels[hole as usize], &met);
    }
    owners
}

/// The outer loop around a hole, from the sides that cross its line.
fn owner(rings: &[Ring], hole: u32, level: f64, met: &[&Side]) -> Option<u32> {
    let mut own: Vec<f64> = met.iter().filter(|side| side.ring == hole).map(|side| side.at(level)).collect();
    own.sort_unstable_by(f64::total_cmp);
    let widest = own.chunks_exact(2).max_by(|p, q| (p[1] - p[0]).total_cmp(&(q[1] - q[0])))?;
    let inside = DVec2::new(widest[0] + 0.5 * (widest[1] - widest[0]), level);
    let size = -rings[hole as usize].area;
    let around = met.iter().filter(|side| rings[side.ring as usize].area > size && side.is_before(inside));
    let mut around: Vec<u32> = around.map(|side| side.ring).collect();
    around.sort_unstable();
    let odd = around.chunk_by(|p, q| p == q).filter(|run| run.len() % 2 == 1).map(|run| run[0]);
    odd.min_by(|&p, &q| rings[p as usize].area.total_cmp(&rings[q as usize].area))
}

/// A second coordinate that sides of the loop cross: the middle of its box, below the upper end.
fn middle(points: &[DVec2]) -> f64 {
    let (low, high) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| (low.min(point.y), high.max(point.y)));
    let middle = low + 0.5 * (high - low);
    if middle < high { middle } else { low }
}

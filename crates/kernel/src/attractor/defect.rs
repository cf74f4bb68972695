//! How far a drawing is from the attractor of its state: the Hausdorff distance between the primitive of
//! an IFS and the limit set, as a proven upper bound, computed once per state. A leaf cell's error is then
//! this defect times the norm of the cell's frame.

use super::StateBound;
use super::cell::{Point, closest_on_segment, distance_squared};
use crate::automaton::{Automaton, Drawing, LeafPrimitive, StateId};
use crate::measure::triangle::closest_on_triangle;

/// Cells that stand for the attractor in the test.
const CELLS: usize = 1500;
/// Pieces into which the drawing may be split.
const PIECES: usize = 3000;

/// Fills in the defects of all drawings.
pub(super) fn measure_drawings(automaton: &mut Automaton, bounds: &[StateBound]) {
    for index in 0..automaton.states().len() {
        let id = StateId::new(index);
        let LeafPrimitive::Drawn(drawing) = &automaton.state(id).leaf else { continue };
        let balls = cover(automaton, bounds, id);
        let defect = to_drawing(&balls, drawing).max(to_attractor(&balls, drawing)) * (1.0 + 1e-9);
        let mut measured = drawing.clone();
        measured.defect = defect;
        automaton.set_leaf(id, LeafPrimitive::Drawn(measured));
    }
}

/// Balls that cover the attractor of a state, each of which meets it; all of about one size.
fn cover(automaton: &Automaton, bounds: &[StateBound], id: StateId) -> Vec<(Point, f64)> {
    let identity = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut level = vec![(id, identity, ball(&bounds[id.index()], &identity))];
    for _ in 0..200 {
        let largest = level.iter().map(|(_, _, (_, radius))| *radius).fold(0.0, f64::max);
        if level.len() >= CELLS || largest == 0.0 {
            break;
        }
        let mut next = Vec::new();
        for (state, frame, own) in &level {
            if own.1 < 0.5 * largest {
                next.push((*state, *frame, *own));
                continue;
            }
            for transition in &automaton.state(*state).transitions {
                let mut child = [[0.0; 3]; 4];
                for (column, point) in child.iter_mut().enumerate() {
                    for (weight, source) in transition.operator.column(column).iter().zip(frame) {
                        point.iter_mut().zip(source).for_each(|(sum, &x)| *sum += weight * x);
                    }
                }
                next.push((transition.to, child, ball(&bounds[transition.to.index()], &child)));
            }
        }
        level = next;
    }
    level.into_iter().map(|(_, _, own)| own).collect()
}

fn ball(bound: &StateBound, frame: &[Point; 4]) -> (Point, f64) {
    let StateBound::Frame { centre, reach, .. } = bound else { return ([0.0; 3], f64::INFINITY) };
    let map = |x: &Point| -> Point { std::array::from_fn(|i| (0..3).map(|j| (frame[j + 1][i] - frame[0][i]) * x[j]).sum()) };
    let offset = map(centre);
    let columns = [map(&reach[0]), map(&reach[1]), map(&reach[2])];
    let entry = |i: usize, j: usize| columns.iter().map(|column| column[i] * column[j]).sum::<f64>();
    let rows = (0..3).map(|i| (0..3).map(|j| entry(i, j).abs()).sum::<f64>()).fold(0.0, f64::max);
    let frobenius = (0..9).map(|k| entry(k / 3, k % 3).powi(2)).sum::<f64>().sqrt();
    (std::array::from_fn(|i| frame[0][i] + offset[i]), rows.min(frobenius).sqrt())
}

/// sup over the attractor of the distance to the drawing.
fn to_drawing(balls: &[(Point, f64)], drawing: &Drawing) -> f64 {
    balls.iter().map(|(centre, radius)| distance_to_drawing(drawing, centre) + radius).fold(0.0, f64::max)
}

fn distance_to_drawing(drawing: &Drawing, x: &Point) -> f64 {
    let vertex = |index: u32| &drawing.vertices[index as usize];
    let points = drawing.points.iter().map(|&a| distance_squared(x, vertex(a)));
    let segments = drawing.segments.iter().map(|&[a, b]| distance_squared(x, &closest_on_segment(x, vertex(a), vertex(b))));
    let triangles =
        drawing.triangles.iter().map(|&[a, b, c]| distance_squared(x, &closest_on_triangle(x, vertex(a), vertex(b), vertex(c))));
    points.chain(segments).chain(triangles).fold(f64::INFINITY, f64::min).sqrt()
}

/// sup over the drawing of the distance to the attractor: its elements are split at their longest side
/// until their size no longer matters.
fn to_attractor(balls: &[(Point, f64)], drawing: &Drawing) -> f64 {
    let near = |x: &Point| balls.iter().map(|(centre, radius)| distance_squared(x, centre).sqrt() + radius).fold(f64::INFINITY, f64::min);
    let vertex = |index: u32| drawing.vertices[index as usize];
    let mut pieces: Vec<[Point; 3]> = Vec::new();
    pieces.extend(drawing.points.iter().map(|&a| [vertex(a); 3]));
    pieces.extend(drawing.segments.iter().map(|&[a, b]| [vertex(a), vertex(b), vertex(b)]));
    pieces.extend(drawing.triangles.iter().map(|&[a, b, c]| [vertex(a), vertex(b), vertex(c)]));
    // (upper bound, lower bound, piece): the piece with the largest upper bound is split first.
    let measure = |piece: &[Point; 3]| {
        let centre: Point = std::array::from_fn(|i| (piece[0][i] + piece[1][i] + piece[2][i]) / 3.0);
        let size = piece.iter().map(|corner| distance_squared(corner, &centre)).fold(0.0, f64::max).sqrt();
        let distance = near(&centre);
        (distance + size, distance, *piece)
    };
    let mut queue: Vec<(f64, f64, [Point; 3])> = pieces.iter().map(measure).collect();
    let mut reached = queue.iter().map(|entry| entry.1).fold(0.0, f64::max);
    for _ in 0..PIECES {
        let Some(worst) = (0..queue.len()).max_by(|&a, &b| queue[a].0.total_cmp(&queue[b].0)) else { return 0.0 };
        if queue[worst].0 <= 1.02 * reached {
            break;
        }
        let piece = queue.swap_remove(worst).2;
        let side = (0..3).max_by(|&a, &b| {
            let length = |k: usize| distance_squared(&piece[k], &piece[(k + 1) % 3]);
            length(a).total_cmp(&length(b))
        });
        let k = side.unwrap_or(0);
        let (a, b, c) = (piece[k], piece[(k + 1) % 3], piece[(k + 2) % 3]);
        let middle: Point = std::array::from_fn(|i| 0.5 * (a[i] + b[i]));
        // A split segment keeps its repeated corner in the half that holds it.
        let halves = if b == c || a == c { [[a, middle, middle], [middle, b, b]] } else { [[a, middle, c], [middle, b, c]] };
        for half in &halves {
            let entry = measure(half);
            reached = reached.max(entry.1);
            queue.push(entry);
        }
    }
    queue.iter().map(|entry| entry.0).fold(0.0, f64::max)
}

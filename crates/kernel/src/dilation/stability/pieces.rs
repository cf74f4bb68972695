//! The radius from which on D(s) is one piece: half the longest edge of a minimum spanning tree of the pieces of A.
//!
//! Let A be drawn by figures K with errors e at most (see `cells`), and G_t join figures no farther apart than t. If D(s) is one piece, so is
//! G_{2s + 2e}: else the parts of A near its components would be farther than 2s apart. If s >= e and G_{2s - 2e} is one piece, so is D(s): it
//! contains every K, joins those with common points after growing by s - e, and every point of A is within e of a K. With b the longest
//! edge of the figures' minimum spanning tree, the radius lies between b/2 - e and max(e, b/2 + e).
//!
//! Cells are refined while that is too wide. At a radius L that is a lower bound, or small enough to stop at, figures that are surely joined get a
//! common label; below, only those matter that may be within reach of another label at the upper bound.

use super::cells::{Cells, Figure};
use super::cluster::solid_angle;
use super::spanning::{Edge, Item, Spanning};
use crate::attractor::Attractor;
use crate::attractor::cell::{Point, Site, dot, subtract};
use crate::budget::{Budget, Stopped};

/// Cells that are looked at together.
const MOST_CELLS: usize = 150_000;
/// Pairs of a component and a triangle whose solid angle is asked.
const MOST_ANGLES: usize = 100_000_000;

/// A cell with the label of all of its figures, if they have one.
#[derive(Clone, Copy, Debug)]
struct Member {
    node: u32,
    label: Option<u32>,
}

/// An interval that holds the smallest radius from which on D(s) is one piece.
pub(super) fn one_piece(
    attractor: &Attractor,
    deviation: f64,
    slack: f64,
    resolution: f64,
    most: usize,
    budget: &Budget,
) -> Result<[f64; 2], Stopped> {
    let mut cells = Cells::new(attractor, deviation, slack, most);
    let mut members: Vec<Member> = (0..attractor.roots().len() as u32).map(|node| Member { node, label: None }).collect();
    let (mut bounds, mut joined_at, mut is_first) = ([0.0_f64, f64::INFINITY], 0.0_f64, true);
    loop {
        let items = items(&cells, &members);
        let error = items.iter().map(|item| item.error).fold(0.0, f64::max);
        let mut spanning = Spanning::new(items);
        let edges = spanning.edges(budget)?;
        let longest = edges.iter().map(|edge| edge.length).fold(0.0, f64::max);
        if is_first && is_nested(&cells, &members, &spanning, &edges) {
            // Parts inside of solids are joined to them whatever the distance of the surfaces.
            return Ok([0.0, error.max(0.5 * longest + error)]);
        }
        is_first = false;
        bounds = [bounds[0].max(0.5 * longest - error), bounds[1].min(error.max(0.5 * longest + error).max(joined_at))];
        if bounds[1] - bounds[0] <= resolution {
            return Ok(bounds);
        }
        joined_at = bounds[0].max(0.5 * resolution);
        if !contract(&cells, &mut members, &mut spanning, &edges, joined_at, bounds[1], budget)? {
            return Ok([bounds[0], bounds[1].min(joined_at)]);
        }
        if !refine(&mut cells, &mut members, 0.5 * error) {
            return Ok(bounds);
        }
    }
}

fn items(cells: &Cells<'_>, members: &[Member]) -> Vec<Item> {
    let mut fresh = members.iter().filter_map(|member| member.label).max().map_or(0, |label| label + 1);
    let mut items = Vec::new();
    for member in members {
        for figure in cells.figures_of(member.node) {
            let Figure { site, error, .. } = *cells.figure(figure);
            let label = member.label.unwrap_or_else(|| {
                fresh += 1;
                fresh - 1
            });
            items.push(Item::new(site, error, label));
        }
    }
    items
}

/// Gives a common label to what is joined at the radius `level`, and keeps members that may be within reach of another label at the radius `most`; `false` if
/// there is one label only.
fn contract(
    cells: &Cells<'_>,
    members: &mut Vec<Member>,
    spanning: &mut Spanning,
    edges: &[Edge],
    level: f64,
    most: f64,
    budget: &Budget,
) -> Result<bool, Stopped> {
    let surely = |edge: &Edge| {
        let errors = edge.items.map(|item| spanning.item(item).error);
        errors.iter().all(|&error| error <= level) && edge.length + errors[0] + errors[1] <= 2.0 * level
    };
    let joined: Vec<Edge> = edges.iter().copied().filter(surely).collect();
    let far = spanning.join(&joined, 2.0 * most, budget)?;
    let mut next = 0;
    let mut kept = Vec::with_capacity(members.len());
    let mut labels = Vec::new();
    for member in members.iter() {
        let figures = next..next + cells.figures_of(member.node).len();
        next = figures.end;
        let first = spanning.label(figures.start);
        let is_joined = cells.error_of(member.node) <= level && figures.clone().all(|item| spanning.label(item) == first);
        labels.push(if is_joined { Some(first) } else { None });
        if !is_joined || !figures.clone().all(|item| far[item]) {
            kept.push(Member { node: member.node, label: if is_joined { Some(first) } else { None } });
        }
    }
    let is_one = labels.iter().all(|label| label.is_some() && *label == labels[0]);
    *members = kept;
    Ok(!is_one)
}

/// Expands members until their errors are below `target`; `false` where that is not possible.
fn refine(cells: &mut Cells<'_>, members: &mut Vec<Member>, target: f64) -> bool {
    let mut grown = false;
    loop {
        let mut expanded = false;
        let mut refined = Vec::with_capacity(members.len());
        for member in members.iter() {
            if cells.error_of(member.node) > target && cells.is_closed(member.node) && cells.expand(member.node) {
                expanded = true;
                refined.extend(cells.replaced(&[member.node]).into_iter().map(|node| Member { node, ..*member }));
            } else {
                refined.push(*member);
            }
        }
        if refined.len() > MOST_CELLS {
            return false;
        }
        *members = refined;
        grown |= expanded;
        if !expanded {
            return grown;
        }
    }
}

/// Whether a part may lie inside a solid that it does not touch.
fn is_nested(cells: &Cells<'_>, members: &[Member], spanning: &Spanning, edges: &[Edge]) -> bool {
    let attractor = cells.attractor();
    if attractor.solids().is_empty() {
        return false;
    }
    let touches = |edge: &&Edge| edge.length <= edge.items.iter().map(|&item| spanning.item(item).error).sum();
    let parts = spanning.joined(edges.iter().filter(touches));
    let mut points: Vec<Option<Point>> = vec![None; parts.len()];
    let mut triangles: Vec<(usize, [Point; 3])> = Vec::new();
    let mut next = 0;
    for member in members {
        let is_solid = attractor.roots()[cells.root_of(member.node) as usize].solid.is_some();
        for figure in cells.figures_of(member.node) {
            let part = parts[next];
            next += 1;
            // Parts that are not known exactly may be anywhere in their cells.
            if cells.is_closed(member.node) {
                return true;
            }
            let corner = match cells.figure(figure).site {
                Site::Point(a) | Site::Segment([a, _]) => a,
                Site::Triangle(corners) => {
                    if is_solid {
                        triangles.push((part, corners));
                    }
                    corners[0]
                }
            };
            points[part].get_or_insert(corner);
        }
    }
    let count = points.iter().flatten().count();
    if count * triangles.len() > MOST_ANGLES {
        return true;
    }
    points.iter().enumerate().any(|(part, point)| {
        let Some(x) = point else { return false };
        let unit = |corner: &Point| {
            let offset = subtract(corner, x);
            let length = dot(&offset, &offset).sqrt();
            offset.map(|x| x / length)
        };
        let angle = |corners: &[Point; 3]| {
            let [a, b, c] = [unit(&corners[0]), unit(&corners[1]), unit(&corners[2])];
            solid_angle(&a, &b, &c)
        };
        let turns: f64 = triangles.iter().filter(|(of, _)| *of != part).map(|(_, corners)| angle(corners)).sum();
        turns.abs() > std::f64::consts::PI
    })
}

//! Products of curve automata.
//!
//! A *factor* is a curve without control points: kinds of pieces, and the spans that a list of control points is made
//! into. A cell of a product is one piece per direction; its operators are the Kronecker products of theirs, for the
//! combinations that are reached, and kept as their factors: what is proven of the pieces holds for the products. The end of a piece is a point of its barycentric space, so a side of a product
//! cell is the product of the other directions' pieces: patches, curves and iso-parametric edges share states, and
//! neighbours share sides exactly.

use crate::attractor::{Gluing, Root};
use crate::automaton::{Boundary, Hull, LeafPrimitive, Smooth, State, StateId, SubdivisionOperator, Transition};
use crate::model::CellKind;
use crate::model::join::Borders;
use crate::model::lower::Draft;
use std::collections::BTreeMap;

/// A kind of curve piece.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::model) struct Piece {
    /// Its name, which tells its content: pieces of one name are one state.
    pub(super) name: String,
    /// n, the number of its control points.
    pub(super) dimension: usize,
    /// The pieces that it subdivides into, in order along the curve, and their operators.
    pub(super) children: Vec<(usize, SubdivisionOperator)>,
    /// Its two ends, in its barycentric space.
    pub(super) ends: [Vec<f64>; 2],
    /// Parameters of its control points, 0 and 1 at the ends, with which it has linear precision; empty if it has none.
    pub(super) parameters: Vec<f64>,
    /// Points in whose hull it lies, if that is smaller than its control points'.
    pub(super) hull: Option<Hull>,
}

/// A piece with its control points: combinations of the curve's, by index and weight.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::model) struct Span {
    pub(super) piece: usize,
    pub(super) controls: Vec<Vec<(usize, f64)>>,
}

/// A curve without control points.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::model) struct Factor {
    pub(super) pieces: Vec<Piece>,
    pub(super) spans: Vec<Span>,
    /// Spans of which the first ends where the second starts, whatever the control points.
    pub(super) joints: Vec<[usize; 2]>,
}

impl Factor {
    /// Joins every span to the next, and the last to the first when closed.
    pub(super) fn chain(pieces: Vec<Piece>, spans: Vec<Span>, closed: bool) -> Self {
        let count = spans.len();
        let mut joints: Vec<[usize; 2]> = (1..count).map(|next| [next - 1, next]).collect();
        if closed {
            joints.push([count - 1, 0]);
        }
        Self { pieces, spans, joints }
    }

    /// The largest number of control points of a piece.
    pub(super) fn dimension(&self) -> usize {
        self.pieces.iter().map(|piece| piece.dimension).max().unwrap_or(0)
    }
}

/// Homogeneous control points on a grid, the first index slowest.
pub(in crate::model) struct Grid {
    /// Points in each direction.
    pub(in crate::model) size: Vec<usize>,
    /// (w x, w y, w z, w).
    pub(in crate::model) points: Vec<[f64; 4]>,
    /// Whether weights differ.
    pub(in crate::model) rational: bool,
}

/// Points are one place when closer than this share of the largest coordinate: circles made of sines and cosines close
/// to rounding.
const CLOSED: f64 = 1e-12;

/// Where a product's cells went.
pub(super) struct Placed {
    /// The root of every cell, the last direction fastest; `None` for cells that are single points.
    pub(super) roots: Vec<Option<usize>>,
    /// For every direction and span, whether it is joined to the next, or the last one to the first.
    pub(super) joined: Vec<Vec<bool>>,
    /// For every cell of a surface, whether its sides at both ends of the first and the second direction are points.
    pub(super) collapsed: Vec<[bool; 4]>,
}

/// Adds the product's states and roots, glues its spans, closes it where its ends meet and collapses sides that are
/// single points.
pub(in crate::model) fn product(draft: &mut Draft, factors: &[Factor], grid: &Grid) -> Placed {
    let scale = grid.points.iter().flat_map(project).fold(0.0_f64, |a, x| a.max(x.abs()));
    let mut product = Product { draft, factors, states: BTreeMap::new(), waiting: Vec::new(), limit: CLOSED * scale };
    let counts: Vec<usize> = factors.iter().map(|factor| factor.spans.len()).collect();
    let cells: Vec<Cell> = combinations(&counts).map(|spans| product.cell(spans, grid)).collect();
    product.complete();
    let solid: Vec<usize> = (0..cells.len()).filter(|&cell| !product.is_point(&cells[cell].points)).collect();
    if solid.is_empty() {
        let state = product.draft.point_state();
        let points = cells.first().map_or_else(Vec::new, |cell| vec![cell.points[0]]);
        product.draft.roots.push(Root { state, points, rational: grid.rational, solid: None });
        let joined = counts.iter().map(|&count| vec![true; count]).collect();
        return Placed { roots: vec![None; cells.len()], joined, collapsed: vec![[true; 4]; cells.len()] };
    }
    let first = product.draft.roots.len();
    let mut place = vec![None; cells.len()];
    solid.iter().enumerate().for_each(|(position, &cell)| place[cell] = Some(first + position));
    let joined = (0..factors.len()).map(|direction| product.join(direction, &cells, &counts, &place)).collect();
    let collapsed = if factors.len() == 2 { product.collapse(&cells, &place) } else { Vec::new() };
    if let &[u, v] = counts.as_slice() {
        product.draft.borders = Borders::Grid { counts: [u, v], roots: place.clone() };
    }
    for cell in solid {
        let Cell { state, points, .. } = &cells[cell];
        product.draft.roots.push(Root { state: *state, points: points.clone(), rational: grid.rational, solid: None });
    }
    Placed { roots: place, joined, collapsed }
}

/// All index lists below the given counts, the last index fastest.
fn combinations(counts: &[usize]) -> impl Iterator<Item = Vec<usize>> {
    let counts = counts.to_vec();
    let total: usize = counts.iter().product();
    (0..total).map(move |mut index| {
        let mut list = vec![0; counts.len()];
        for (entry, &count) in list.iter_mut().zip(&counts).rev() {
            *entry = index % count;
            index /= count;
        }
        list
    })
}

fn project(point: &[f64; 4]) -> [f64; 3] {
    [point[0] / point[3], point[1] / point[3], point[2] / point[3]]
}

fn distance(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    let (a, b) = (project(a), project(b));
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
}

/// Sum of weighted points.
fn combine<'p>(terms: impl Iterator<Item = (&'p [f64; 4], f64)>) -> [f64; 4] {
    terms.fold([0.0; 4], |sum, (point, weight)| std::array::from_fn(|k| sum[k] + weight * point[k]))
}

/// A root in the making.
struct Cell {
    spans: Vec<usize>,
    state: StateId,
    points: Vec<[f64; 4]>,
}

/// A cell's pieces: (direction, piece).
type Pieces = Vec<(usize, usize)>;

struct Product<'a> {
    draft: &'a mut Draft,
    factors: &'a [Factor],
    states: BTreeMap<Pieces, StateId>,
    /// States whose content is to come.
    waiting: Vec<Pieces>,
    limit: f64,
}

impl Product<'_> {
    fn cell(&mut self, spans: Vec<usize>, grid: &Grid) -> Cell {
        let pieces = spans.iter().enumerate().map(|(direction, &span)| (direction, self.factors[direction].spans[span].piece)).collect();
        let state = self.intern(pieces);
        let controls: Vec<&Vec<Vec<(usize, f64)>>> =
            spans.iter().enumerate().map(|(direction, &span)| &self.factors[direction].spans[span].controls).collect();
        let counts: Vec<usize> = controls.iter().map(|list| list.len()).collect();
        let point = |index: Vec<usize>| {
            let lists: Vec<&Vec<(usize, f64)>> = index.iter().zip(&controls).map(|(&k, list)| &list[k]).collect();
            let sizes: Vec<usize> = lists.iter().map(|list| list.len()).collect();
            let term = |choice: Vec<usize>| {
                let (mut place, mut weight) = (0, 1.0);
                for (direction, &k) in choice.iter().enumerate() {
                    place = place * grid.size[direction] + lists[direction][k].0;
                    weight *= lists[direction][k].1;
                }
                (&grid.points[place], weight)
            };
            combine(combinations(&sizes).map(term))
        };
        Cell { spans, state, points: combinations(&counts).map(point).collect() }
    }

    fn piece(&self, (direction, piece): (usize, usize)) -> &Piece {
        &self.factors[direction].pieces[piece]
    }

    /// The state of these pieces, known already in this or another shape or new.
    fn intern(&mut self, pieces: Pieces) -> StateId {
        if pieces.is_empty() {
            return self.draft.point_state();
        }
        if let Some(&id) = self.states.get(&pieces) {
            return id;
        }
        let name = pieces.iter().map(|&piece| self.piece(piece).name.as_str()).collect::<Vec<_>>().join(" x ");
        let dimension = pieces.iter().map(|&piece| self.piece(piece).dimension).product();
        let (id, new) = self.draft.shared_state(&name, dimension);
        self.states.insert(pieces.clone(), id);
        if new {
            self.waiting.push(pieces);
        }
        id
    }

    /// Fills in the states that were met, and those that they lead to.
    fn complete(&mut self) {
        while let Some(pieces) = self.waiting.pop() {
            let id = self.states[&pieces];
            let state = self.state(&pieces);
            let name = std::mem::take(&mut self.draft.states[id.index()].name);
            self.draft.states[id.index()] = State { name, ..state };
            if let [piece] = pieces.as_slice() {
                let Piece { parameters, hull, .. } = self.piece(*piece);
                if !parameters.is_empty() {
                    let smooth = Smooth { parameters: parameters.clone(), hull: hull.clone() };
                    self.draft.smooth.insert(id, smooth);
                }
            } else {
                let factors = pieces.iter().map(|&piece| self.intern(vec![piece])).collect();
                self.draft.products.insert(id, factors);
            }
        }
    }

    fn state(&mut self, pieces: &Pieces) -> State {
        let own: Vec<Piece> = pieces.iter().map(|&piece| self.piece(piece).clone()).collect();
        let counts: Vec<usize> = own.iter().map(|piece| piece.children.len()).collect();
        let mut transitions = Vec::new();
        for (label, choice) in combinations(&counts).enumerate() {
            let chosen: Vec<&(usize, SubdivisionOperator)> = choice.iter().zip(&own).map(|(&k, piece)| &piece.children[k]).collect();
            let to = self.intern(chosen.iter().zip(pieces).map(|(child, &(direction, _))| (direction, child.0)).collect());
            let operator = SubdivisionOperator::product(chosen.iter().map(|child| child.1.clone()).collect());
            transitions.push(Transition { to, operator, label });
        }
        let mut boundaries = Vec::new();
        for position in (0..own.len()).rev() {
            for end in 0..2 {
                let mut others = pieces.clone();
                others.remove(position);
                let factor = |(k, piece): (usize, &Piece)| {
                    if k == position {
                        SubdivisionOperator::exact(piece.dimension, piece.ends[end].clone())
                    } else {
                        SubdivisionOperator::identity(piece.dimension)
                    }
                };
                let incidence = SubdivisionOperator::product(own.iter().enumerate().map(factor).collect());
                boundaries.push(Boundary { state: self.intern(others), incidence });
            }
        }
        let kind = [CellKind::Edge, CellKind::Face, CellKind::Volume][own.len() - 1];
        let dimension = own.iter().map(|piece| piece.dimension).product();
        State { name: String::new(), kind: Some(kind), dimension, transitions, boundaries, leaf: LeafPrimitive::Centre, frame: false }
    }

    /// The control points of a cell's side at an end of a direction.
    fn side(&self, cell: &Cell, direction: usize, end: usize) -> Vec<[f64; 4]> {
        let piece = |k: usize| self.piece((k, self.factors[k].spans[cell.spans[k]].piece));
        let inner: usize = (direction + 1..cell.spans.len()).map(|k| piece(k).dimension).product();
        let own = piece(direction);
        let outer = cell.points.len() / (inner * own.dimension);
        let point = |index: usize| {
            let (slow, fast) = (index / inner, index % inner);
            let place = |k: usize| &cell.points[(slow * own.dimension + k) * inner + fast];
            combine(own.ends[end].iter().enumerate().filter(|(_, weight)| **weight != 0.0).map(|(k, &weight)| (place(k), weight)))
        };
        (0..outer * inner).map(point).collect()
    }

    fn is_point(&self, points: &[[f64; 4]]) -> bool {
        points.iter().all(|point| distance(point, &points[0]) <= self.limit)
    }

    /// Glues the spans of one direction: those that meet whatever the control points, and ends that happen to meet. For
    /// every span, whether it is glued to the next one.
    fn join(&mut self, direction: usize, cells: &[Cell], counts: &[usize], place: &[Option<usize>]) -> Vec<bool> {
        let count = counts[direction];
        let stride: usize = counts[direction + 1..].iter().product();
        let rows: Vec<usize> = (0..cells.len()).filter(|&cell| cells[cell].spans[direction] == 0).collect();
        let boundary = |end: usize| 2 * (counts.len() - 1 - direction) + end;
        let mut joined = vec![false; count];
        for first in 0..count {
            let second = (first + 1) % count;
            let gaps: Vec<f64> = rows
                .iter()
                .map(|&row| {
                    let left = self.side(&cells[row + first * stride], direction, 1);
                    let right = self.side(&cells[row + second * stride], direction, 0);
                    left.iter().zip(&right).map(|(a, b)| distance(a, b)).fold(0.0, f64::max)
                })
                .collect();
            let widest = gaps.iter().copied().fold(0.0, f64::max);
            if !(self.factors[direction].joints.contains(&[first, second]) || widest <= self.limit) {
                continue;
            }
            joined[first] = true;
            self.draft.seam_mm = self.draft.seam_mm.max(widest);
            for &row in &rows {
                if let (Some(left), Some(right)) = (place[row + first * stride], place[row + second * stride]) {
                    self.draft.gluings.push(Gluing { between: [(left, boundary(1)), (right, boundary(0))], permutation: None });
                }
            }
        }
        joined
    }

    /// Notes the sides of patches that are single points.
    fn collapse(&mut self, cells: &[Cell], place: &[Option<usize>]) -> Vec<[bool; 4]> {
        let mut all = vec![[true; 4]; cells.len()];
        for (index, (cell, root)) in cells.iter().zip(place).enumerate().filter_map(|(index, (cell, root))| Some((index, (cell, (*root)?))))
        {
            for (direction, end) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let point = self.is_point(&self.side(cell, direction, end));
                all[index][2 * direction + end] = point;
                if point {
                    self.draft.collapsed.push((root, 2 * (1 - direction) + end));
                }
            }
        }
        all
    }
}

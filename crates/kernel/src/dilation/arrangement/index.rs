//! The figures of an arrangement by their places.

use super::figure::Figure;
use crate::attractor::cell::{Point, between, distance_squared};
use crate::attractor::sites::SiteError;
use crate::dilation::convex::{Ball, Convex, SiteSearch};
use crate::dilation::simplify::Core;
use crate::dilation::tree::{NodeId, SiteId};

/// Figures with their boxes. A node is a figure.
pub(in crate::dilation) struct Index {
    figures: Vec<Figure>,
    boxes: Vec<[Point; 2]>,
    /// How far figures may be from the sites that they stand for, but inside of polyhedra.
    slack: f64,
}

impl Index {
    pub(super) fn new(figures: Vec<Figure>, slack: f64) -> Self {
        let boxes = figures.iter().map(Figure::bounds).collect();
        Self { figures, boxes, slack }
    }

    /// The numbers of all figures.
    pub(in crate::dilation) fn all(&self) -> Vec<NodeId> {
        (0..self.figures.len() as NodeId).collect()
    }

    /// Those of some figures whose boxes come within a distance of a part of space.
    pub(in crate::dilation) fn near(&self, some: &[NodeId], core: &Core, distance: f64) -> Vec<NodeId> {
        let gap = |[low, high]: &[Point; 2], axis: usize| (low[axis] - core.high[axis]).max(core.low[axis] - high[axis]).max(0.0);
        let is_near = |id: &NodeId| {
            let own = &self.boxes[*id as usize];
            (0..3).map(|axis| gap(own, axis).powi(2)).sum::<f64>() <= distance * distance
        };
        some.iter().copied().filter(is_near).collect()
    }

    /// Whether the box of a figure has a place whose squared distance from x is no more than `limit`.
    #[inline]
    fn may_be_near(&self, id: NodeId, x: &Point, limit: f64) -> bool {
        let [low, high] = &self.boxes[id as usize];
        let in_box: Point = std::array::from_fn(|axis| x[axis].clamp(low[axis], high[axis]));
        distance_squared(x, &in_box) + self.figures[id as usize].deficit <= limit
    }

    /// The closest point of a figure to x and its squared distance, if that is no more than `limit`.
    #[inline]
    fn closest(&self, id: NodeId, x: &Point, limit: f64) -> Option<(Point, f64)> {
        if !self.may_be_near(id, x, limit) {
            return None;
        }
        let figure = &self.figures[id as usize];
        let closest = figure.closest(x);
        let square = distance_squared(x, &closest) + figure.deficit;
        (square <= limit).then_some((closest, square))
    }

    /// The greatest squared distance of what is `reach` away.
    fn limit(&self, reach: f64) -> f64 {
        (reach + self.slack).powi(2)
    }
}

impl SiteSearch for &Index {
    type Site<'b>
        = &'b Figure
    where
        Self: 'b;
    type Candidates = [NodeId];

    fn reset(&mut self, candidates: &[NodeId]) -> Vec<NodeId> {
        candidates.to_vec()
    }

    fn site(&self, id: SiteId) -> &Figure {
        let (SiteId::Listed(index) | SiteId::Point(index)) = id;
        &self.figures[index as usize]
    }

    #[inline]
    fn visit_near(&mut self, x: &Point, starts: &[NodeId], reach: f64, _: f64, mut visit: impl FnMut(SiteId, &Point, f64, Option<NodeId>)) {
        let limit = self.limit(reach);
        for &id in starts {
            if let Some((closest, square)) = self.closest(id, x, limit) {
                visit(SiteId::Listed(id), &closest, square, None);
            }
        }
    }

    fn ball(&self, node: NodeId) -> Ball {
        let [low, high] = &self.boxes[node as usize];
        let centre = between(low, high, 0.5);
        Ball { centre, radius: distance_squared(&centre, high).sqrt() + self.slack, deficit: self.figures[node as usize].deficit }
    }

    fn add_below(&mut self, node: NodeId, _: &mut Vec<NodeId>, sites: &mut Vec<SiteId>) {
        sites.push(SiteId::Listed(node));
    }

    fn gather(&mut self, x: &Point, starts: &[NodeId], reach: f64, found: &mut Vec<NodeId>) {
        let limit = self.limit(reach);
        found.clear();
        found.extend(starts.iter().copied().filter(|&id| self.may_be_near(id, x, limit)));
    }

    fn deviation(&self) -> f64 {
        self.slack
    }

    fn largest_error(&self) -> SiteError {
        SiteError::default()
    }

    fn is_exhausted(&self) -> bool {
        false
    }

    fn bytes(&self) -> usize {
        0
    }
}

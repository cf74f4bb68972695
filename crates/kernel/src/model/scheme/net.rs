//! Control points on a grid.

use super::factor::Grid;
use crate::model::WEIGHTS;
use crate::model::lower::Draft;
use glam::DVec3;

/// Control points on a grid of one, two or three directions, with optional weights.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct ControlNet {
    /// Points in each direction.
    pub size: Vec<usize>,
    /// The points in mm, the first direction's index slowest.
    pub points: Vec<DVec3>,
    /// Positive weights in the same order; all 1 when absent.
    pub weights: Option<Vec<f64>>,
}

impl ControlNet {
    /// The points of a curve.
    #[must_use]
    pub fn line(points: Vec<DVec3>) -> Self {
        Self { size: vec![points.len()], points, weights: None }
    }

    /// The JSON pointer of a point's place in nested lists.
    fn place(&self, index: usize) -> String {
        let (mut rest, mut place) = (index, String::new());
        for &size in self.size.iter().rev() {
            place = format!("/{}{place}", rest % size);
            rest /= size;
        }
        place
    }

    /// The points in homogeneous form; `None` after a fault of the points, which stand in `member`, or the weights.
    pub(super) fn grid(&self, draft: &mut Draft, directions: usize, member: &str) -> Option<Grid> {
        let count = self.size.iter().try_fold(1_usize, |total, &size| total.checked_mul(size));
        if self.size.len() != directions || count != Some(self.points.len()) || self.points.is_empty() {
            let message = format!("{} points do not fill a net of {:?} in {directions} directions", self.points.len(), self.size);
            draft.error(member, "net.size", message);
            return None;
        }
        let mut legal = true;
        for (index, point) in self.points.iter().enumerate().filter(|(_, point)| !point.is_finite()) {
            let place = self.place(index);
            draft.error(&format!("{member}{place}"), "model.not-finite", format!("the control point is {point}, and must be finite"));
            legal = false;
        }
        let uniform = Vec::new();
        let weights = self.weights.as_ref().unwrap_or(&uniform);
        if self.weights.is_some() && weights.len() != self.points.len() {
            draft.error("/weights", "net.weights", format!("{} weights for {} control points", weights.len(), self.points.len()));
            return None;
        }
        for (index, weight) in weights.iter().enumerate().filter(|(_, weight)| !WEIGHTS.contains(weight)) {
            let (least, most) = (WEIGHTS.start(), WEIGHTS.end());
            let message = format!("the weight is {weight:e}, and must be positive, from {least:e} to {most:e}");
            draft.error(&format!("/weights{}", self.place(index)), "net.weights", message);
            legal = false;
        }
        let rational = weights.iter().any(|&weight| weight != weights[0]);
        let homogeneous = |(index, p): (usize, &DVec3)| {
            let w = if rational { weights[index] } else { 1.0 };
            [w * p.x, w * p.y, w * p.z, w]
        };
        let points = self.points.iter().enumerate().map(homogeneous).collect();
        legal.then(|| Grid { size: self.size.clone(), points, rational })
    }
}

//! Places over which it is known how high a sheet should be, about.

use super::Place;
use super::field::{Field, MOST};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::squares::Squares;
use rayon::prelude::*;

/// How wide squares are that have a sample, in units of the distance.
const PITCH: f64 = 0.3;
/// How far creases are followed from a sample, in units of the pitch.
const ACROSS: f64 = 0.75;

/// A place, the height over it, and by how much the distance grows with the height there.
#[derive(Clone, Copy, Debug)]
struct Sample {
    at: Place,
    height: f64,
    up: f64,
}

/// Samples, sorted into squares.
pub(super) struct Samples {
    squares: Squares,
    starts: Vec<u32>,
    all: Vec<Sample>,
}

impl Samples {
    /// Samples of what is as far from a graph as a distance, in the middles of squares and on the creases next to them.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn new(field: &Field, distance: f64, faces: usize, budget: &Budget) -> Result<Self, Stopped> {
        let squares = Squares::new(field.bounds, PITCH * distance, MOST * faces as f64);
        let row = |y: usize| -> Result<Vec<Sample>, Stopped> {
            budget.cancel.check()?;
            let mut own = Vec::with_capacity(2 * squares.size[0]);
            for x in 0..squares.size[0] {
                let at = squares.middle(x, y);
                let Some(top) = field.top(at, distance) else { continue };
                own.push(Sample { at, height: top.height, up: top.out[2] });
                if let Some(at) = field.crease(at, &top, distance, ACROSS * squares.pitch())
                    && let Some(top) = field.top(at, distance)
                {
                    own.push(Sample { at, height: top.height, up: top.out[2] });
                }
            }
            Ok(own)
        };
        let rows: Vec<Vec<Sample>> = (0..squares.size[1]).into_par_iter().map(row).collect::<Result<_, Stopped>>()?;
        let all = rows.concat();
        let lists = squares.lists(all.len(), (0..).zip(&all).map(|(number, sample)| (number, [sample.at; 2])));
        let (starts, items) = lists.unwrap_or_default();
        let all = items.into_iter().map(|number| all[number as usize]).collect();
        Ok(Self { squares, starts, all })
    }

    /// The sample within a triangle from which it is off by most, and by how much; what is above is positive.
    pub(super) fn worst(&self, [a, b, c]: &[Point; 3]) -> Option<(f64, Place)> {
        let (ab, ac) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let area = ab[0] * ac[1] - ab[1] * ac[0];
        let range = |axis: usize| {
            let place = |x: f64| self.squares.place(x, axis);
            place(a[axis].min(b[axis]).min(c[axis]))..=place(a[axis].max(b[axis]).max(c[axis]))
        };
        let (mut worst, columns): (Option<(f64, Place)>, _) = (None, range(0));
        for row in range(1).map(|y| y * self.squares.size[0]) {
            let own = self.starts[row + columns.start()] as usize..self.starts[row + columns.end() + 1] as usize;
            for Sample { at, height, up } in &self.all[own] {
                let way = [at[0] - a[0], at[1] - a[1]];
                let s = (way[0] * ac[1] - way[1] * ac[0]) / area;
                let t = (ab[0] * way[1] - ab[1] * way[0]) / area;
                if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
                    let off = (a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]) - height) * up;
                    if worst.is_none_or(|(most, _)| off.abs() > most.abs()) {
                        worst = Some((off, *at));
                    }
                }
            }
        }
        worst
    }
}

//! Squares of a plane, and what is in each of them.

/// A place in the plane.
type Place = [f64; 2];

/// Squares that cover a box.
pub(super) struct Squares {
    low: Place,
    pitch: f64,
    /// How many there are along each axis.
    pub(super) size: [usize; 2],
}

impl Squares {
    /// Squares as wide as a pitch, or wider where there would be more than `most` of them.
    pub(super) fn new([low, high]: [Place; 2], pitch: f64, most: f64) -> Self {
        let wide = [0, 1].map(|axis| high[axis] - low[axis]);
        let pitch = pitch.max((wide[0] * wide[1] / most).sqrt()).max(wide[0].max(wide[1]) / most);
        Self { low, pitch, size: wide.map(|wide| (wide / pitch) as usize + 1) }
    }

    pub(super) fn pitch(&self) -> f64 {
        self.pitch
    }

    /// The middle of a square.
    pub(super) fn middle(&self, x: usize, y: usize) -> Place {
        [self.low[0] + (x as f64 + 0.5) * self.pitch, self.low[1] + (y as f64 + 0.5) * self.pitch]
    }

    /// Where a coordinate is along an axis: the first or the last, where it is beyond all.
    pub(super) fn place(&self, x: f64, axis: usize) -> usize {
        (((x - self.low[axis]) / self.pitch).max(0.0) as usize).min(self.size[axis] - 1)
    }

    /// The number of the square that has a place.
    pub(super) fn of(&self, at: Place) -> usize {
        self.place(at[1], 1) * self.size[0] + self.place(at[0], 0)
    }

    /// Numbers of what is in each square, in the order that they are given with their boxes: where the list of every square begins, and the lists. None where these have more than `most` numbers.
    pub(super) fn lists(&self, most: usize, boxes: impl Iterator<Item = (u32, [Place; 2])> + Clone) -> Option<(Vec<u32>, Vec<u32>)> {
        let squares = |[low, high]: [Place; 2]| {
            let [first, last] = [low, high].map(|at| [0, 1].map(|axis| self.place(at[axis], axis)));
            (first[1]..=last[1]).flat_map(move |y| (first[0]..=last[0]).map(move |x| y * self.size[0] + x))
        };
        let count = |[low, high]: [Place; 2]| -> usize {
            [0, 1].map(|axis| self.place(high[axis], axis) - self.place(low[axis], axis) + 1).iter().product()
        };
        let mut total = 0_usize;
        for (_, own) in boxes.clone() {
            total += count(own);
            (total <= most.min(u32::MAX as usize)).then_some(())?;
        }
        let mut starts = vec![0_u32; self.size[0] * self.size[1] + 1];
        boxes.clone().flat_map(|(_, own)| squares(own)).for_each(|square| starts[square + 1] += 1);
        for square in 0..self.size[0] * self.size[1] {
            starts[square + 1] += starts[square];
        }
        let (mut ends, mut items) = (starts.clone(), vec![0; starts[self.size[0] * self.size[1]] as usize]);
        for (number, own) in boxes {
            for square in squares(own) {
                items[ends[square] as usize] = number;
                ends[square] += 1;
            }
        }
        Some((starts, items))
    }
}

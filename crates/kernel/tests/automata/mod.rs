//! Automata by formula, for tests and benches: splines, subdivision surfaces, tensor products, random ones.
#![allow(dead_code, missing_docs, clippy::unwrap_used)]

use lacuna_kernel::automaton::{Automaton, LeafPrimitive, State, StateId, SubdivisionOperator, Transition};

/// An operator by columns.
pub type Columns = Vec<Vec<f64>>;

/// An automaton with the given states: for each its dimension, and its transitions.
pub fn automaton(states: Vec<(usize, Vec<(usize, Columns)>)>) -> Automaton {
    let state = |(index, (dimension, transitions)): (usize, (usize, Vec<(usize, Columns)>))| {
        let transition = |(label, (to, columns)): (usize, (usize, Columns))| {
            let (operator, _) = SubdivisionOperator::from_columns(dimension, columns.concat()).unwrap();
            Transition { to: StateId::new(to), operator, label }
        };
        State {
            name: format!("s{index}"),
            kind: None,
            dimension,
            transitions: transitions.into_iter().enumerate().map(transition).collect(),
            boundaries: Vec::new(),
            leaf: LeafPrimitive::Centre,
            frame: false,
        }
    };
    Automaton::new(states.into_iter().enumerate().map(state).collect()).unwrap()
}

/// One state with these operators.
pub fn iterated(operators: Vec<Columns>) -> Automaton {
    automaton(vec![(operators[0].len(), operators.into_iter().map(|columns| (0, columns)).collect())])
}

/// Corner cutting with parameters a and b (MATH.md 2).
pub fn corner_cutting(a: f64, b: f64) -> Vec<Columns> {
    vec![
        vec![vec![1.0 - a, a, 0.0], vec![b, 1.0 - b, 0.0], vec![0.0, 1.0 - a, a]],
        vec![vec![b, 1.0 - b, 0.0], vec![0.0, 1.0 - a, a], vec![0.0, b, 1.0 - b]],
    ]
}

/// The uniform cubic B-spline curve: new points are averages with the masks (1 1)/2 and (1 6 1)/8.
pub fn cubic() -> Vec<Columns> {
    let (edge, vertex) = (|k: usize| mask(k, &[0.5, 0.5]), |k: usize| mask(k, &[0.125, 0.75, 0.125]));
    vec![vec![edge(0), vertex(0), edge(1), vertex(1)], vec![vertex(0), edge(1), vertex(1), edge(2)]]
}

fn mask(first: usize, weights: &[f64]) -> Vec<f64> {
    let mut column = vec![0.0; 4];
    column[first..first + weights.len()].copy_from_slice(weights);
    column
}

/// The Kronecker products of all pairs: the tensor product surface of two curves.
pub fn tensor(left: &[Columns], right: &[Columns]) -> Vec<Columns> {
    let product = |a: &Vec<f64>, b: &Vec<f64>| a.iter().flat_map(|x| b.iter().map(move |y| x * y)).collect::<Vec<f64>>();
    let pair = |a: &Columns, b: &Columns| a.iter().flat_map(|x| b.iter().map(move |y| product(x, y))).collect::<Columns>();
    left.iter().flat_map(|a| right.iter().map(move |b| pair(a, b))).collect()
}

/// An operator whose restriction to differences e_j - e_0 is the given matrix, by rows.
pub fn extended(rows: &[&[f64]]) -> Columns {
    let n = rows.len();
    let first: Vec<f64> = (0..=n).map(|i| if i == 0 { 1.0 } else { 0.0 }).collect();
    let column = |j: usize| {
        let below: Vec<f64> = (0..n).map(|i| rows[i][j]).collect();
        std::iter::once(1.0 - below.iter().sum::<f64>()).chain(below).collect()
    };
    std::iter::once(first).chain((0..n).map(column)).collect()
}

/// A Catmull-Clark face beside one vertex of valence n, all others regular: 2 n + 8 control points, one child of
/// the same kind and three regular ones, which are uniform cubic B-spline faces. Masks are computed from faces
/// and edges by the rules of Catmull and Clark (1978).
pub fn catmull_clark(valence: usize) -> Automaton {
    let patch = Patch { valence };
    let irregular: Vec<(i32, i32)> = vec![(2, -1), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (-1, 2)];
    let mut first: Columns = vec![patch.vertex(0)];
    for i in 0..valence {
        first.push(patch.edge(0, patch.spoke(i)));
        first.push(patch.face(&patch.ring(i)));
    }
    first.extend(irregular.iter().map(|&place| patch.refined(place)));
    let grid = |x: i32, y: i32| -> Columns {
        (0..4).flat_map(|i| (0..4).map(move |j| (x + i, y + j))).map(|place| patch.refined(place)).collect()
    };
    let regular = tensor(&cubic(), &cubic()).into_iter().map(|columns| (1, columns)).collect();
    automaton(vec![(2 * valence + 8, vec![(0, first), (1, grid(0, -1)), (1, grid(0, 0)), (1, grid(-1, 0))]), (16, regular)])
}

/// Points: 0 is the irregular vertex, 1 + 2 i the end of its spoke i, 2 + 2 i the far corner of its face i, then
/// (2,-1), (2,0), (2,1), (2,2), (1,2), (0,2), (-1,2) in a grid where face 0 is the unit square at 0.
struct Patch {
    valence: usize,
}

impl Patch {
    fn spoke(&self, i: usize) -> usize {
        1 + 2 * (i % self.valence)
    }

    fn corner(&self, i: usize) -> usize {
        2 + 2 * (i % self.valence)
    }

    fn outer(&self, k: usize) -> usize {
        2 * self.valence + 1 + k
    }

    fn ring(&self, i: usize) -> [usize; 4] {
        [0, self.spoke(i), self.corner(i), self.spoke(i + 1)]
    }

    fn faces(&self) -> Vec<[usize; 4]> {
        let (a, b, c, o) = (self.spoke(0), self.spoke(1), self.corner(0), |k| self.outer(k));
        let mut faces: Vec<[usize; 4]> = (0..self.valence).map(|i| self.ring(i)).collect();
        faces.extend([
            [a, self.corner(self.valence - 1), o(0), o(1)],
            [a, o(1), o(2), c],
            [c, o(2), o(3), o(4)],
            [c, o(4), o(5), b],
            [b, o(5), o(6), self.corner(1)],
        ]);
        faces
    }

    fn mean(&self, points: &[Vec<f64>]) -> Vec<f64> {
        (0..2 * self.valence + 8).map(|i| points.iter().map(|point| point[i]).sum::<f64>() / points.len() as f64).collect()
    }

    fn point(&self, index: usize) -> Vec<f64> {
        (0..2 * self.valence + 8).map(|i| if i == index { 1.0 } else { 0.0 }).collect()
    }

    fn face(&self, corners: &[usize; 4]) -> Vec<f64> {
        self.mean(&corners.map(|corner| self.point(corner)))
    }

    fn edge(&self, from: usize, to: usize) -> Vec<f64> {
        let mut points = vec![self.point(from), self.point(to)];
        points.extend(self.faces().iter().filter(|face| face.contains(&from) && face.contains(&to)).map(|face| self.face(face)));
        assert_eq!(points.len(), 4, "an edge between two faces");
        self.mean(&points)
    }

    /// (F + 2 R + (n - 3) V) / n, with F the mean of the face points and R that of the edges' middles.
    fn vertex(&self, index: usize) -> Vec<f64> {
        let faces: Vec<[usize; 4]> = self.faces().into_iter().filter(|face| face.contains(&index)).collect();
        let n = faces.len() as f64;
        let mut neighbours: Vec<usize> = faces
            .iter()
            .flat_map(|face| {
                let at = face.iter().position(|&corner| corner == index).unwrap();
                [face[(at + 1) % 4], face[(at + 3) % 4]]
            })
            .collect();
        neighbours.sort_unstable();
        neighbours.dedup();
        let middle = |&to: &usize| self.mean(&[self.point(index), self.point(to)]);
        let f = self.mean(&faces.iter().map(|face| self.face(face)).collect::<Vec<_>>());
        let r = self.mean(&neighbours.iter().map(middle).collect::<Vec<_>>());
        let v = self.point(index);
        (0..v.len()).map(|i| (f[i] + 2.0 * r[i] + (n - 3.0) * v[i]) / n).collect()
    }

    /// The new point at a place of the refined grid.
    fn refined(&self, place: (i32, i32)) -> Vec<f64> {
        let (a, b, c, n) = (self.spoke(0), self.spoke(1), self.corner(0), self.valence);
        let faces = self.faces();
        match place {
            (0, 0) => self.vertex(0),
            (1, 0) => self.edge(0, a),
            (0, 1) => self.edge(0, b),
            (1, 1) => self.face(&faces[0]),
            (2, 0) => self.vertex(a),
            (0, 2) => self.vertex(b),
            (2, 2) => self.vertex(c),
            (2, 1) => self.edge(a, c),
            (1, 2) => self.edge(b, c),
            (0, -1) => self.edge(0, self.spoke(n - 1)),
            (-1, 0) => self.edge(0, self.spoke(2)),
            (1, -1) => self.face(&faces[n - 1]),
            (-1, 1) => self.face(&faces[1]),
            (2, -1) => self.edge(a, self.corner(n - 1)),
            (-1, 2) => self.edge(b, self.corner(1)),
            (3, 0) => self.edge(a, self.outer(1)),
            (3, 2) => self.edge(c, self.outer(2)),
            (2, 3) => self.edge(c, self.outer(4)),
            (0, 3) => self.edge(b, self.outer(5)),
            (3, -1) => self.face(&faces[n]),
            (3, 1) => self.face(&faces[n + 1]),
            (3, 3) => self.face(&faces[n + 2]),
            (1, 3) => self.face(&faces[n + 3]),
            (-1, 3) => self.face(&faces[n + 4]),
            _ => unreachable!("a place of a child"),
        }
    }
}

/// Numbers in [0, 1) (xorshift64*, Vigna 2016).
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }

    /// A column-stochastic matrix with about `filled` non-zero entries in a column.
    pub fn stochastic(&mut self, rows: usize, columns: usize, filled: usize) -> Columns {
        let column = |numbers: &mut Self| {
            let mut column = vec![0.0; rows];
            (0..filled).for_each(|_| column[numbers.below(rows)] += 0.05 + numbers.next());
            let sum: f64 = column.iter().sum();
            column.iter_mut().for_each(|x| *x /= sum);
            column
        };
        (0..columns).map(|_| column(self)).collect()
    }

    /// An operator whose restriction has random entries of both signs, of size `scale` / sqrt(n).
    pub fn signed(&mut self, n: usize, scale: f64) -> Columns {
        let size = scale * 3f64.sqrt() / ((n - 1) as f64).sqrt();
        let rows: Vec<Vec<f64>> = (1..n).map(|_| (1..n).map(|_| size * (2.0 * self.next() - 1.0)).collect()).collect();
        extended(&rows.iter().map(Vec::as_slice).collect::<Vec<_>>())
    }
}

/// States of dimension 16 with four children each, non-negative, as NURBS faces have them.
pub fn fifty_states(seed: u64) -> Automaton {
    let mut numbers = Numbers(seed);
    let transitions = |numbers: &mut Numbers| (0..4).map(|_| (numbers.below(50), numbers.stochastic(16, 16, 6))).collect();
    automaton((0..50).map(|_| (16, transitions(&mut numbers))).collect())
}

/// Bicubic NURBS faces on knots whose intervals are (x, 1, 1, y, ...) random: per axis the automaton of
/// MATH.md 4 follows the five intervals; here each is its own state up to ratios, and faces are their pairs.
pub fn nurbs(intervals: [f64; 5]) -> Automaton {
    let mut kinds: Vec<[f64; 5]> = vec![normal(intervals)];
    let mut children: Vec<[(usize, Columns); 2]> = Vec::new();
    while children.len() < kinds.len() {
        let own = kinds[children.len()];
        let pair = spans(own).map(|(child, columns)| {
            let child = normal(child);
            let near = |kind: &[f64; 5]| kind.iter().zip(child).all(|(a, b)| (a - b).abs() < 1e-9);
            let index = kinds.iter().position(near).unwrap_or_else(|| {
                kinds.push(child);
                kinds.len() - 1
            });
            (index, columns)
        });
        children.push(pair);
    }
    let n = kinds.len();
    let face = |index: usize| {
        let (u, v) = (&children[index / n], &children[index % n]);
        let pair = |a: &(usize, Columns), b: &(usize, Columns)| {
            let operator = tensor(std::slice::from_ref(&a.1), std::slice::from_ref(&b.1)).remove(0);
            (a.0 * n + b.0, operator)
        };
        u.iter().flat_map(|a| v.iter().map(move |b| pair(a, b))).collect::<Vec<_>>()
    };
    automaton((0..n * n).map(|index| (16, face(index))).collect())
}

fn normal(intervals: [f64; 5]) -> [f64; 5] {
    intervals.map(|interval| interval / intervals[2])
}

/// The two halves of a cubic span: their intervals, and their control points by blossoms.
fn spans(u: [f64; 5]) -> [([f64; 5], Columns); 2] {
    let mut knots = vec![0.0];
    u.iter().for_each(|interval| knots.push(knots.last().unwrap() + interval));
    let doubled: Vec<f64> = u.iter().flat_map(|interval| [0.5 * interval; 2]).collect();
    let mut places = vec![0.0];
    doubled.iter().for_each(|interval| places.push(places.last().unwrap() + interval));
    // The middle interval is doubled into 4 and 5.
    [4, 5].map(|middle| {
        let intervals: [f64; 5] = std::array::from_fn(|k| doubled[middle - 2 + k]);
        let columns = (0..4).map(|j| blossom(&knots, [places[middle - 2 + j], places[middle - 1 + j], places[middle + j]])).collect();
        (intervals, columns)
    })
}

/// Weights of the control points of the span [t_2, t_3] in the blossom at three arguments (de Boor).
fn blossom(knots: &[f64], at: [f64; 3]) -> Vec<f64> {
    let mut rows: Vec<Vec<f64>> = (0..4).map(|i| (0..4).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    for (level, x) in at.into_iter().enumerate() {
        rows = (0..3 - level)
            .map(|i| {
                let (low, high) = (knots[i + level], knots[i + 3]);
                let along = (x - low) / (high - low);
                (0..4).map(|k| (1.0 - along) * rows[i][k] + along * rows[i + 1][k]).collect()
            })
            .collect();
    }
    rows.remove(0)
}

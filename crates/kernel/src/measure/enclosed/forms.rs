//! Multilinear forms of control points that are sums of the same forms of the children's: x_s = b_s + sum over children c of
//! sign_c (T_c x T_c x ...) x_c, a linear system whose unknowns are the coefficients of all states.
//!
//! Norms: the sum of the absolute coefficients. T x T x ... multiplies it by |T|^degree at most, |T| being the largest absolute column sum. For a component of states
//! that reach each other, cut every state's tree of descendants somewhere: x_s is the sum over the cut's inner words of what they add, plus the forms at its ends. If
//! the ends' factors |T_w|^degree add up to less than 1/2 and those of the inner words to I, the system has one solution, it is the limit of the sums over all words
//! of a length, and what solves it but for a residual of norm r is within 2 I r of it.

use super::double::{Double, Number, UNIT};
use crate::automaton::SubdivisionOperator;
use crate::budget::{Budget, Stopped};
use crate::order::ordered_by;
use std::collections::BinaryHeap;

/// An operator on differences from one control point of the parent, its base, to those from one of the child.
#[derive(Clone, Debug)]
pub(super) struct Matrix {
    rows: usize,
    columns: usize,
    /// Column by column, the entries that are not zero and their rows.
    entries: Vec<Vec<(usize, Double)>>,
    /// From the parent's base to the child's.
    pub(super) offset: Vec<Double>,
    /// |T|.
    norm: f64,
    /// How far it may be from the operator that was meant, in the same norm.
    doubt: f64,
    /// As much of the offset.
    offset_doubt: f64,
}

/// What an entry was meant to be, and how far from that the first may be. Masks are fractions: an entry within its last bits of one with a small denominator is that
/// fraction. Others come from cosines or from a file.
fn meant(entry: f64) -> (Double, f64) {
    const MOST_DENOMINATOR: f64 = 4096.0;
    let near = 2f64.powi(-50) * entry.abs().max(0.25);
    // Convergents of the continued fraction.
    let ([mut before, mut last], mut rest) = ([(0.0, 1.0), (1.0, 0.0)], entry);
    for _ in 0..16 {
        let whole = rest.floor();
        let next: (f64, f64) = (whole * last.0 + before.0, whole * last.1 + before.1);
        if next.1 > MOST_DENOMINATOR {
            break;
        }
        if (entry - next.0 / next.1).abs() <= near {
            return (Double::quotient(next.0, next.1), 0.0);
        }
        (before, last, rest) = (last, next, 1.0 / (rest - whole));
    }
    (entry.into(), near)
}

impl Matrix {
    /// Of an operator between states with the given bases.
    pub(super) fn new(operator: &SubdivisionOperator, [base, child_base]: [usize; 2]) -> Self {
        let own = |row: usize| row - usize::from(row > base);
        let others = || (0..operator.rows()).filter(|&row| row != base);
        let column = |index: usize| -> Vec<(Double, f64)> { operator.column(index).iter().map(|&entry| meant(entry)).collect() };
        let origin = column(child_base);
        let rows = operator.rows() - 1;
        let offset = others().map(|row| origin[row].0).collect();
        let offset_doubt = others().map(|row| origin[row].1).sum();
        let mut matrix = Self { rows, columns: operator.columns() - 1, entries: Vec::new(), offset, norm: 0.0, doubt: 0.0, offset_doubt };
        let minus = Double::from(-1.0);
        for column in (0..operator.columns()).filter(|&index| index != child_base).map(column) {
            let differences = others().map(|row| (own(row), column[row].0 + minus * origin[row].0));
            let entries: Vec<(usize, Double)> = differences.filter(|(_, entry)| entry.high != 0.0).collect();
            matrix.norm = matrix.norm.max(entries.iter().map(|(_, entry)| entry.high.abs()).sum::<f64>() * ROUNDED_UP);
            matrix.doubt = matrix.doubt.max(others().map(|row| column[row].1 + origin[row].1).sum());
            matrix.entries.push(entries);
        }
        matrix
    }

    /// (T x T x ...) form.
    pub(super) fn push<N: Number>(&self, degree: usize, form: &[N]) -> Vec<N> {
        // Of a single point: nothing differs from it.
        if self.columns == 0 {
            return vec![N::default(); self.rows.pow(degree as u32)];
        }
        let (mut current, mut outer, mut inner) = (form.to_vec(), 1, form.len());
        for _ in 0..degree {
            inner /= self.columns;
            let mut image = vec![N::default(); outer * self.rows * inner];
            for block in 0..outer {
                for (column, entries) in self.entries.iter().enumerate() {
                    let source = &current[(block * self.columns + column) * inner..][..inner];
                    for &(row, entry) in entries {
                        let entry = N::of(entry);
                        let target = &mut image[(block * self.rows + row) * inner..][..inner];
                        target.iter_mut().zip(source).for_each(|(sum, &x)| *sum = *sum + entry * x);
                    }
                }
            }
            outer *= self.rows;
            current = image;
        }
        current
    }

    /// How far (T x T x ...) form may be from what was meant, the form itself being off by `error`.
    pub(super) fn error(&self, degree: usize, form: &[Double], error: f64) -> f64 {
        let (norm, degree) = (self.norm + self.doubt, degree as i32);
        let size = norm_of(form) + error;
        let rounding = UNIT * f64::from(degree) * (self.columns + 2) as f64;
        norm.powi(degree) * (error + rounding * size) + f64::from(degree) * self.doubt * norm.powi(degree - 1) * size
    }

    /// As [`Self::error`], of the offset.
    pub(super) fn offset_error(&self) -> f64 {
        self.offset_doubt
    }
}

/// What sums of so many positive terms may lose.
const ROUNDED_UP: f64 = 1.0 + 1e-12;

/// The sum of the absolute coefficients.
pub(super) fn norm_of(form: &[Double]) -> f64 {
    form.iter().map(|x| x.high.abs()).sum::<f64>() * ROUNDED_UP
}

/// A child's share in an equation.
#[derive(Debug)]
pub(super) struct Part {
    /// Which unknown.
    pub(super) child: usize,
    pub(super) sign: f64,
    pub(super) matrix: Matrix,
}

/// One state's equation.
#[derive(Debug, Default)]
pub(super) struct Equation {
    /// b, of norm off by `error` at most.
    pub(super) constant: Vec<Double>,
    pub(super) error: f64,
    pub(super) parts: Vec<Part>,
}

/// Coefficients, and a bound of the norm of what they are off.
#[derive(Clone, Debug, Default)]
pub(super) struct Form {
    pub(super) coefficients: Vec<Double>,
    pub(super) error: f64,
}

/// Why there are no forms.
#[derive(Debug)]
pub(super) enum Unsolved {
    /// The sums over words are not proven to converge: the factors at the ends of the deepest cut of this unknown's tree add up to so much.
    Divergent {
        unknown: usize,
        sum: f64,
    },
    Stopped(Stopped),
}

impl From<Stopped> for Unsolved {
    fn from(stopped: Stopped) -> Self {
        Self::Stopped(stopped)
    }
}

/// Solves the system, component by component.
pub(super) fn solve(degree: usize, equations: &[Equation], budget: &Budget) -> Result<Vec<Form>, Unsolved> {
    let mut forms: Vec<Form> =
        equations.iter().map(|own| Form { coefficients: vec![Double::default(); own.constant.len()], error: 0.0 }).collect();
    for component in components(equations) {
        let amplification = if component.is_recurrent { amplification(degree, equations, &component.members, budget)? } else { 1.0 };
        // Once for the solution, and once for what it is off.
        for _ in 0..2 {
            let residuals: Vec<Vec<Double>> = component.members.iter().map(|&s| residual(degree, &equations[s], &forms, s)).collect();
            for (&s, correction) in component.members.iter().zip(iterate(degree, equations, &component.members, &residuals, budget)?) {
                let corrected = forms[s].coefficients.iter().zip(correction).map(|(&x, y)| x + Double::from(y));
                forms[s].coefficients = corrected.collect();
            }
        }
        let mut worst = 0.0_f64;
        for &s in &component.members {
            let own = &equations[s];
            let rounding = UNIT * (own.parts.len() + 2) as f64 * (norm_of(&own.constant) + norm_of(&forms[s].coefficients));
            let parts = own.parts.iter().map(|part| part.matrix.error(degree, &forms[part.child].coefficients, forms[part.child].error));
            worst = worst.max(norm_of(&residual(degree, own, &forms, s)) + own.error + rounding + parts.sum::<f64>());
        }
        component.members.iter().for_each(|&s| forms[s].error = 2.0 * amplification * worst);
    }
    Ok(forms)
}

/// b + M x - x.
fn residual(degree: usize, own: &Equation, forms: &[Form], s: usize) -> Vec<Double> {
    let minus = Double::from(-1.0);
    let mut sum: Vec<Double> = own.constant.iter().zip(&forms[s].coefficients).map(|(&b, &x)| b + minus * x).collect();
    for part in &own.parts {
        add(&mut sum, part.sign, &part.matrix.push(degree, &forms[part.child].coefficients));
    }
    sum
}

/// sum += factor form.
pub(super) fn add<N: Number>(sum: &mut [N], factor: f64, form: &[N]) {
    let factor = N::of(factor.into());
    sum.iter_mut().zip(form).for_each(|(sum, &x)| *sum = *sum + factor * x);
}

/// Rounds of the iteration at most: each takes at least a hundredth of what is left, or the factors would not have added up to less than 1/2 by any affordable cut.
const MOST_ROUNDS: usize = 4000;

/// The solution of x = r + M x within a component, in doubles: sums over longer and longer words until nothing changes.
fn iterate(
    degree: usize,
    equations: &[Equation],
    members: &[usize],
    constants: &[Vec<Double>],
    budget: &Budget,
) -> Result<Vec<Vec<f64>>, Stopped> {
    let constants: Vec<Vec<f64>> = constants.iter().map(|own| own.iter().map(|x| x.high).collect()).collect();
    let mut current = constants.clone();
    for _ in 0..MOST_ROUNDS {
        budget.cancel.check()?;
        let (mut moved, mut size) = (0.0_f64, 0.0_f64);
        for (place, &s) in members.iter().enumerate() {
            let mut next = constants[place].clone();
            for part in &equations[s].parts {
                if let Some(child) = members.iter().position(|&other| other == part.child) {
                    add(&mut next, part.sign, &part.matrix.push(degree, &current[child]));
                }
            }
            moved = next.iter().zip(&current[place]).map(|(a, b)| (a - b).abs()).fold(moved, f64::max);
            size = next.iter().map(|x| x.abs()).fold(size, f64::max);
            current[place] = next;
        }
        if moved <= f64::EPSILON * size {
            break;
        }
    }
    Ok(current)
}

/// Unknowns that need each other.
struct Component {
    members: Vec<usize>,
    /// Whether they need themselves.
    is_recurrent: bool,
}

/// All components, each after those that it needs.
fn components(equations: &[Equation]) -> Vec<Component> {
    let needed = |from: usize| {
        let mut seen = vec![false; equations.len()];
        let mut waiting: Vec<usize> = equations[from].parts.iter().map(|part| part.child).collect();
        while let Some(next) = waiting.pop() {
            if !std::mem::replace(&mut seen[next], true) {
                waiting.extend(equations[next].parts.iter().map(|part| part.child));
            }
        }
        seen
    };
    let needs: Vec<Vec<bool>> = (0..equations.len()).map(needed).collect();
    // What is needed by another, and does not need it, is and needs less.
    let mut order: Vec<usize> = (0..equations.len()).collect();
    order.sort_by_key(|&s| needs[s].iter().enumerate().filter(|&(other, &needed)| needed || other == s).count());
    let mut components: Vec<Component> = Vec::new();
    for s in order {
        match components.iter_mut().find(|other| needs[s][other.members[0]] && needs[other.members[0]][s]) {
            Some(own) => own.members.push(s),
            None => components.push(Component { members: vec![s], is_recurrent: needs[s][s] }),
        }
    }
    components
}

struct Dense {
    rows: usize,
    entries: Vec<f64>,
}

impl Dense {
    fn identity(n: usize) -> Self {
        let mut entries = vec![0.0; n * n];
        (0..n).for_each(|i| entries[i * n + i] = 1.0);
        Self { rows: n, entries }
    }

    fn times(&self, matrix: &Matrix) -> Self {
        let mut entries = vec![0.0; self.rows * matrix.columns];
        for (own, target) in matrix.entries.iter().zip(entries.chunks_exact_mut(self.rows.max(1))) {
            for &(inner, entry) in own {
                let source = &self.entries[inner * self.rows..][..self.rows];
                target.iter_mut().zip(source).for_each(|(sum, &x)| *sum += entry.high * x);
            }
        }
        Self { rows: self.rows, entries }
    }

    fn norm(&self) -> f64 {
        let sums = self.entries.chunks_exact(self.rows.max(1)).map(|column| column.iter().map(|x| x.abs()).sum());
        sums.fold(0.0_f64, f64::max) * ROUNDED_UP
    }
}

/// A word of transitions, ordered by its factor.
struct Word {
    factor: f64,
    number: usize,
    at: usize,
    matrix: Dense,
}

ordered_by!(Word, |this, other| this.factor.total_cmp(&other.factor).then(other.number.cmp(&this.number)));

/// Entries of the matrices of all words that one search may form.
const MOST_ENTRIES: usize = 1 << 25;

/// I of the module's comment, the largest of the component's states.
fn amplification(degree: usize, equations: &[Equation], members: &[usize], budget: &Budget) -> Result<f64, Unsolved> {
    let mut largest = 0.0_f64;
    for &start in members {
        let (mut inner, mut ends, mut formed) = (0.0, 1.0, 0);
        let side = |s: usize| (equations[s].constant.len() as f64).powf(1.0 / degree as f64).round() as usize;
        let mut cut = BinaryHeap::from([Word { factor: 1.0, number: 0, at: start, matrix: Dense::identity(side(start)) }]);
        let mut number = 0;
        while ends >= 0.5 {
            let Some(word) = cut.pop() else { break };
            if formed > MOST_ENTRIES {
                return Err(Unsolved::Divergent { unknown: start, sum: ends });
            }
            if number % 256 == 0 {
                budget.cancel.check()?;
            }
            inner += word.factor;
            ends -= word.factor;
            for part in equations[word.at].parts.iter().filter(|part| members.contains(&part.child)) {
                number += 1;
                let matrix = word.matrix.times(&part.matrix);
                formed += matrix.entries.len();
                let factor = matrix.norm().powi(degree as i32);
                ends += factor;
                cut.push(Word { factor, number, at: part.child, matrix });
            }
        }
        largest = largest.max(inner);
    }
    Ok(largest)
}

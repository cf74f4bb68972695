//! Closed loops of a section: linked by the names of their edges, and on which side of them the material is.

use glam::DVec2;
use num_bigint::{BigInt, Sign};
use num_traits::float::FloatCore;

/// The passage of a section through one triangle, from the edge where the triangle's border goes down to the one where it goes up: the
/// material is on its left. An edge is named by its vertex below and its vertex above, in the higher and the lower half.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    pub(super) from: u64,
    pub(super) to: u64,
}

/// A closed loop that bounds some area.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    /// Three points or more; none equals the next, or the one after that.
    pub(super) points: Vec<DVec2>,
    /// Not zero; the sign is exact.
    pub(super) area: f64,
}

/// The loops of cuts, each from the least name on, in the order of these. Along a closed oriented surface every edge ends one cut and
/// starts another, so names pair all of them.
pub(super) fn rings(mut cuts: Vec<Cut>, point: impl Fn(u64) -> DVec2) -> Vec<Ring> {
    cuts.sort_unstable_by_key(|cut| cut.from);
    let mut ends: Vec<(u64, u32)> = cuts.iter().enumerate().map(|(index, cut)| (cut.to, index as u32)).collect();
    ends.sort_unstable();
    let mut next = vec![0_u32; cuts.len()];
    // The k-th name in order starts the k-th cut and ends the k-th of `ends`.
    ends.iter().enumerate().for_each(|(index, end)| next[end.1 as usize] = index as u32);
    let mut taken = vec![false; cuts.len()];
    let mut rings = Vec::new();
    for first in 0..cuts.len() {
        let mut points: Vec<DVec2> = Vec::new();
        let mut current = first;
        while !std::mem::replace(&mut taken[current], true) {
            points.push(point(cuts[current].from));
            current = next[current] as usize;
        }
        rings.extend(Ring::new(points));
    }
    rings
}

impl Ring {
    /// `None` if the loop bounds no area.
    fn new(points: Vec<DVec2>) -> Option<Self> {
        let points = without_spikes(points);
        if points.len() < 3 {
            return None;
        }
        let (area, error) = shoelace(&points);
        if area.abs() > error {
            return Some(Self { points, area });
        }
        // Rounding decides the size, but never the side.
        let size = area.abs().max(f64::MIN_POSITIVE);
        match exact_sign(&points) {
            Sign::Plus => Some(Self { points, area: size }),
            Sign::Minus => Some(Self { points, area: -size }),
            Sign::NoSign => None,
        }
    }
}

/// A loop without steps of no length and without steps that the next one takes back: what remains where a crease lies in the plane.
fn without_spikes(loop_points: Vec<DVec2>) -> Vec<DVec2> {
    let mut points: Vec<DVec2> = Vec::with_capacity(loop_points.len());
    for point in loop_points {
        if points.len() > 1 && points[points.len() - 2] == point {
            points.pop();
        } else if points.last() != Some(&point) {
            points.push(point);
        }
    }
    // The same where the end meets the start.
    let mut first = 0;
    while let [start, second, .., before, end] = &points[first..] {
        if end == start || before == start {
            points.pop();
        } else if second == end {
            first += 1;
        } else {
            break;
        }
    }
    points.drain(..first);
    points
}

/// The sides of a loop.
pub(super) fn sides(points: &[DVec2]) -> impl Iterator<Item = [DVec2; 2]> {
    points.iter().zip(points.iter().cycle().skip(1)).map(|(&a, &b)| [a, b])
}

/// (half the sum of cross products of consecutive points, a bound of its rounding), the first point being the origin: digits stay far from
/// zero.
pub(super) fn shoelace(points: &[DVec2]) -> (f64, f64) {
    let origin = points.first().copied().unwrap_or_default();
    let (mut sum, mut size) = (0.0, 0.0);
    for [a, b] in sides(points) {
        let (a, b) = (a - origin, b - origin);
        let (one, other) = (a.x * b.y, a.y * b.x);
        sum += one - other;
        size += one.abs() + other.abs();
    }
    // A sum of n terms rounds n times, each term four times; what falls below all normal numbers is added for each.
    let count = points.len() as f64 + 8.0;
    (0.5 * sum, count * (f64::EPSILON * size + f64::MIN_POSITIVE))
}

/// The sign of the area, in integers.
fn exact_sign(points: &[DVec2]) -> Sign {
    let whole = |value: f64| {
        let (mantissa, exponent, sign) = FloatCore::integer_decode(value);
        // No exponent is below -1075.
        BigInt::from(i64::from(sign) * mantissa as i64) << (i32::from(exponent) + 1075).max(0)
    };
    let exact: Vec<[BigInt; 2]> = points.iter().map(|point| [whole(point.x), whole(point.y)]).collect();
    let steps = exact.iter().zip(exact.iter().cycle().skip(1));
    steps.map(|([ax, ay], [bx, by])| ax * by - ay * bx).sum::<BigInt>().sign()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slivers_are_on_the_right_side() {
        let (a, b) = (DVec2::new(0.1, 0.1), DVec2::new(0.7, 0.7));
        // The middle is off the line by its own rounding, or by one unit in the last place.
        for (y, sign) in [(0.3_f64.next_up(), -1.0), (0.3, 0.0), (0.3_f64.next_down(), 1.0)] {
            let middle = DVec2::new(0.3, y);
            let area = |points: [DVec2; 3]| Ring::new(points.to_vec()).map_or(0.0, |ring| ring.area.signum());
            assert_eq!((area([a, middle, b]), area([b, middle, a])), (sign, -sign), "{y}");
        }
        let fold = [a, b, DVec2::new(1e100, -1e-100), b];
        assert!(Ring::new(fold.to_vec()).is_none());
        assert!(Ring::new(vec![a, a, b, b, a]).is_none());
    }

    #[test]
    fn spikes_are_cut_off_wherever_the_loop_starts() {
        let [a, b, c, d, e] = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [6.0, 5.0], [9.0, 9.0]].map(DVec2::from_array);
        let spiky = [a, a, b, c, d, d, e, d, c, c];
        for start in 0..spiky.len() {
            let turned = spiky.iter().cycle().skip(start).take(spiky.len()).copied().collect();
            let ring = Ring::new(turned).unwrap();
            assert_eq!((ring.points.len(), ring.area), (3, 8.0), "{start}");
            assert!(Ring::new([d, e, d, d, c, d].iter().cycle().skip(start % 6).take(6).copied().collect()).is_none());
        }
    }
}

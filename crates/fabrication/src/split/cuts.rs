//! Where a solid is cut.

use super::margin;
use crate::job::Split;
use crate::run::JobError;
use glam::DVec3;
use lacuna_kernel::error::{Kind, LimitFacts};

/// Planes across the axes.
pub(super) struct Cuts {
    /// Single-precision numbers, ascending: both parts of a cut then have the same plane in the files.
    pub(super) offsets: [Vec<f64>; 3],
    /// Stated cuts that are one as they are written.
    pub(super) warnings: Vec<String>,
}

/// Parts that a job may have: each has a line in the certificate.
const MOST_PARTS: f64 = 10_000.0;

impl Cuts {
    /// The cuts that the job states; along axes without any, as few as make parts that fit the volume, all of them equally long with their pegs, which
    /// reach `peg` beyond every part but the last. In the files, every part is moved by `gap` more than the one before it.
    pub(super) fn new(split: &Split, ends: [DVec3; 2], peg: f64, gap: f64) -> Result<Self, JobError> {
        let mut offsets: [Vec<f64>; 3] = Default::default();
        let mut warnings = Vec::new();
        for axis in 0..3 {
            let (low, high) = (ends[0][axis], ends[1][axis]);
            let name = ["x", "y", "z"][axis];
            let stated = &split.cuts_mm[axis];
            // As it will be in the files.
            let written = [low, high].map(|end| f64::from(end as f32));
            offsets[axis] = match split.volume_mm {
                _ if !stated.is_empty() => stated.clone(),
                Some(volume) if written[1] - written[0] > volume[axis] => {
                    let exact = automatic(written, volume[axis], peg, name).ok().filter(|cuts| fit(written, cuts, volume[axis], peg, gap));
                    exact.map_or_else(|| automatic([low, high], volume[axis] - margin(ends), peg, name), Ok)?
                }
                _ => Vec::new(),
            };
            offsets[axis].sort_by(f64::total_cmp);
            offsets[axis].dedup();
            for offset in &mut offsets[axis] {
                *offset = f64::from(*offset as f32);
            }
            for pair in offsets[axis].windows(2).filter(|pair| pair[0] == pair[1]) {
                warnings.push(format!("cuts across {name} at {} mm are one in single precision, in which parts are written", pair[0]));
            }
            offsets[axis].dedup();
            if let Some(outside) = offsets[axis].iter().find(|offset| !(low < **offset && **offset < high)) {
                let message = format!("a cut across {name} at {outside} mm misses the solid, which reaches from {low} to {high} mm");
                return Err(JobError::new(Kind::Invalid, "split.cut-outside", message));
            }
        }
        let parts: f64 = offsets.iter().map(|cuts| cuts.len() as f64 + 1.0).product();
        if parts > MOST_PARTS {
            let message = format!(
                "the job makes up to {parts:.0} parts, and at most {MOST_PARTS:.0} are possible; give a larger volume, or fewer cuts"
            );
            let limit = LimitFacts { limit: "parts", asked: parts, allowed: MOST_PARTS, remedy: None };
            return Err(JobError { limit: Some(limit), ..JobError::new(Kind::Limit, "limit.parts", message) });
        }
        Ok(Self { offsets, warnings })
    }
}

/// Cuts of a length L that is too long into k parts of u = (L + (k - 1) peg) / k each, of which the first k - 1 are u - peg and a peg: k is the least with u within `fits`.
fn automatic([low, high]: [f64; 2], fits: f64, peg: f64, name: &str) -> Result<Vec<f64>, JobError> {
    let length = high - low;
    if fits <= peg {
        let message = format!("parts may be {fits} mm along {name}, and pegs alone are {peg} mm; give a larger volume, or smaller keys");
        return Err(JobError::new(Kind::Invalid, "split.volume-too-small", message));
    }
    // (L + (k - 1) peg) / k <= fits.
    let count = ((length - peg) / (fits - peg)).ceil().max(2.0);
    if count > MOST_PARTS {
        let limit = LimitFacts { limit: "parts", asked: count, allowed: MOST_PARTS, remedy: None };
        let message =
            format!("the volume asks for {count:.0} parts along one axis, and at most {MOST_PARTS:.0} are possible; give a larger one");
        return Err(JobError { limit: Some(limit), ..JobError::new(Kind::Limit, "limit.parts", message) });
    }
    let each = (length + (count - 1.0) * peg) / count - peg;
    Ok((1..count as u32).map(|k| low + f64::from(k) * each).collect())
}

/// Whether parts without pegs fit as they are written, which they do when a whole number of them is as long as the solid and no number needs rounding.
fn fit([low, high]: [f64; 2], cuts: &[f64], volume: f64, peg: f64, gap: f64) -> bool {
    // What cutting loses of double precision goes the wrong way; the ends of the solid are as they are.
    let lost = 1e-12 * low.abs().max(high.abs());
    let cut = |index: usize, outwards: f64| f64::from(cuts[index] as f32) + outwards;
    peg == 0.0
        && (0..=cuts.len()).all(|index| {
            let from = if index == 0 { low } else { cut(index - 1, -lost) };
            let to = if index == cuts.len() { high } else { cut(index, lost) };
            let moved = index as f64 * gap;
            f64::from((to + moved) as f32) - f64::from((from + moved) as f32) <= volume
        })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn automatic_cuts_are_as_few_as_fit() {
        assert_eq!(automatic([0.0, 100.0], 60.0, 0.0, "x").unwrap(), [50.0]);
        // 100 + 10 in two: 55 each, the first 45 and a peg of 10.
        assert_eq!(automatic([0.0, 100.0], 55.0, 10.0, "x").unwrap(), [45.0]);
        assert_eq!(automatic([0.0, 100.0], 54.0, 10.0, "x").unwrap(), [30.0, 60.0]);
        assert_eq!(automatic([0.0, 100.0], 9.0, 10.0, "x").unwrap_err().code, "split.volume-too-small");
    }

    #[test]
    fn exact_parts_fit_if_they_are_written_so() {
        assert!(fit([0.0, 100.0], &[50.0], 50.0, 0.0, 5.0));
        assert!(!fit([0.0, 100.0], &[50.0], 50.0 - 1e-6, 0.0, 5.0));
        // 0.1 and its multiples are rounded up.
        assert!(!fit([0.0, 0.2], &[0.1], 0.1, 0.0, 0.01));
        assert!(!fit([0.0, 100.0], &[50.0], 50.0, 1.0, 5.0));
    }
}

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
}

/// Parts that a job may have: each has a line in the certificate.
const MOST_PARTS: f64 = 10_000.0;

impl Cuts {
    /// The cuts that the job states; along axes without any, as few as make parts that fit the volume, all of them equally long with their pegs, which
    /// reach `peg` beyond every part but the last.
    pub(super) fn new(split: &Split, ends: [DVec3; 2], peg: f64) -> Result<Self, JobError> {
        let mut offsets: [Vec<f64>; 3] = Default::default();
        for axis in 0..3 {
            let (low, high) = (ends[0][axis], ends[1][axis]);
            let stated = &split.cuts_mm[axis];
            // As it will be in the files.
            let written = f64::from(high as f32) - f64::from(low as f32);
            offsets[axis] = match split.volume_mm {
                _ if !stated.is_empty() => stated.clone(),
                Some(volume) if written > volume[axis] => automatic(low, high, volume[axis] - margin(ends), peg, axis)?,
                _ => Vec::new(),
            };
            for offset in &mut offsets[axis] {
                *offset = f64::from(*offset as f32);
            }
            offsets[axis].sort_by(f64::total_cmp);
            offsets[axis].dedup();
            if let Some(outside) = offsets[axis].iter().find(|offset| !(low < **offset && **offset < high)) {
                let message = format!(
                    "a cut across {} at {outside} mm misses the solid, which reaches from {low} to {high} mm",
                    ["x", "y", "z"][axis]
                );
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
        Ok(Self { offsets })
    }
}

/// Cuts of a length L that is too long into k parts of u = (L + (k - 1) peg) / k each, of which the first k - 1 are u - peg and a peg: k is the least with u within `fits`.
fn automatic(low: f64, high: f64, fits: f64, peg: f64, axis: usize) -> Result<Vec<f64>, JobError> {
    let length = high - low;
    if fits <= peg {
        let axis = ["x", "y", "z"][axis];
        let message = format!("parts may be {fits} mm along {axis}, and pegs alone are {peg} mm; give a larger volume, or smaller keys");
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn automatic_cuts_are_as_few_as_fit() {
        assert_eq!(automatic(0.0, 100.0, 60.0, 0.0, 0).unwrap(), [50.0]);
        // 100 + 10 in two: 55 each, the first 45 and a peg of 10.
        assert_eq!(automatic(0.0, 100.0, 55.0, 10.0, 0).unwrap(), [45.0]);
        assert_eq!(automatic(0.0, 100.0, 54.0, 10.0, 0).unwrap(), [30.0, 60.0]);
        assert_eq!(automatic(0.0, 100.0, 9.0, 10.0, 0).unwrap_err().code, "split.volume-too-small");
    }
}

//! What a computation may use, how it reports, and how it is stopped.
//!
//! The kernel has no clock: a deadline is a [`CancelToken`] that somebody outside fires. Every loop
//! of the kernel asks the token at least every few milliseconds of work.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};

/// Why a computation was asked to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The caller no longer wants the result.
    Cancelled,
    /// The time limit has passed.
    Deadline,
}

/// A flag shared between a computation and whoever may stop it. Cloning shares the flag.
#[derive(Clone, Debug, Default)]
pub struct CancelToken(Arc<AtomicU8>);

impl CancelToken {
    /// A token that nobody has fired yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks the computation to stop. The first reason stays.
    pub fn fire(&self, reason: StopReason) {
        let code = match reason {
            StopReason::Cancelled => 1,
            StopReason::Deadline => 2,
        };
        let _ = self.0.compare_exchange(0, code, Ordering::Relaxed, Ordering::Relaxed);
    }

    /// Why to stop, if to stop.
    #[must_use]
    pub fn reason(&self) -> Option<StopReason> {
        match self.0.load(Ordering::Relaxed) {
            0 => None,
            1 => Some(StopReason::Cancelled),
            _ => Some(StopReason::Deadline),
        }
    }

    /// # Errors
    /// [`Stopped`] when the token was fired.
    pub fn check(&self) -> Result<(), Stopped> {
        self.reason().map_or(Ok(()), |reason| Err(Stopped { reason }))
    }
}

/// A computation stopped because its token was fired.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("stopped: {}", match .reason { StopReason::Cancelled => "cancelled by the caller", StopReason::Deadline => "the time limit has passed" })]
pub struct Stopped {
    /// Who asked.
    pub reason: StopReason,
}

/// Upper limits of one computation. Every one is finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Wall time in seconds. Kept by the caller, who fires the token; named here so that errors can say it.
    pub seconds: f64,
    /// Memory of the results and working sets that grow with the input, in bytes (accounted, not measured).
    pub memory_bytes: u64,
    /// Leaf cells that may be expanded: all of the shape for an evaluation, and for each dilation those that its surface needs, one again in every block of
    /// the lattice that needs it, as certificates count them. A search that compares shapes looks at no more nodes than this, and ends there with what it knows.
    pub cells: u64,
    /// Triangles of the result.
    pub triangles: u64,
    /// Length of the longest address.
    pub depth: u32,
    /// Bytes of all that is written of the result. Kept by the caller, who writes it; named here so that errors can say it.
    pub output_bytes: u64,
}

impl Default for Limits {
    /// 300 s, 4 GiB of memory, 10^8 cells, 5 million triangles, addresses of length 256, 4 GiB to write.
    fn default() -> Self {
        Self { seconds: 300.0, memory_bytes: 4 << 30, cells: 100_000_000, triangles: 5_000_000, depth: 256, output_bytes: 4 << 30 }
    }
}

impl Limits {
    /// The most that each can be: where limits are only read, or kept by somebody else.
    pub const MOST: Self =
        Self { seconds: f64::MAX, memory_bytes: u64::MAX, cells: u64::MAX, triangles: u64::MAX, depth: u32::MAX, output_bytes: u64::MAX };
}

impl Stopped {
    /// Cancelled, or a limit of time.
    #[must_use]
    pub fn kind(&self) -> crate::error::Kind {
        match self.reason {
            StopReason::Cancelled => crate::error::Kind::Cancelled,
            StopReason::Deadline => crate::error::Kind::Limit,
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self.reason {
            StopReason::Cancelled => "cancelled",
            StopReason::Deadline => "limit-time",
        }
    }
}

/// How far a computation has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Name of the phase: one of [`PHASES`].
    pub phase: &'static str,
    /// Share of the phase that is done, in [0, 1].
    pub fraction: f64,
    /// Triangles or cells made so far, by phase.
    pub count: u64,
    /// The error bound, in mm, that is proven of what has been made so far, as far as any is: 0 or more, and no wish. It may grow when more has been made.
    pub bound_mm: Option<f64>,
}

/// The phases, in the order in which a job may have them.
pub const PHASES: [&str; 12] =
    ["validate", "refine", "dilate", "stitch", "verify", "combine", "intersect", "compare", "section", "stability", "certify", "write"];

/// The error bound that is proven of what a computation has made so far. Cloning shares it.
#[derive(Clone, Debug, Default)]
pub struct Reached {
    /// One more than the bound's digits in binary, 0 for none: those of numbers that are not negative are in their order.
    bits: Arc<AtomicU64>,
    /// Whether what is made is no part of the result.
    is_aside: bool,
}

impl Reached {
    fn mm(&self) -> Option<f64> {
        self.bits.load(Ordering::Relaxed).checked_sub(1).map(f64::from_bits)
    }

    fn set(&self, bound_mm: f64) {
        let known = Some(bound_mm).filter(|bound| bound.is_finite() && *bound >= 0.0);
        self.bits.store(known.map_or(0, |bound| (bound + 0.0).to_bits() + 1), Ordering::Relaxed);
    }
}

/// Who is told about progress.
pub type ProgressSink = Arc<dyn Fn(&Progress) + Send + Sync>;

/// Limits, stop flag and progress sink of one computation: the only side channel of the kernel.
#[derive(Clone, Default)]
pub struct Budget {
    /// What may be used.
    pub limits: Limits,
    /// How to stop.
    pub cancel: CancelToken,
    /// Who is told.
    pub progress: Option<ProgressSink>,
    /// The bound that is told with the progress.
    pub reached: Reached,
}

impl Budget {
    /// Tells the sink, if there is one.
    pub fn report(&self, phase: &'static str, fraction: f64, count: u64) {
        if let Some(sink) = &self.progress {
            sink(&Progress { phase, fraction, count, bound_mm: self.reached.mm() });
        }
    }

    /// Takes note of the error bound, in mm, that is proven of all that has been made so far. It is told with the progress from then on, until another takes its place;
    /// one that is not finite is none.
    pub fn prove(&self, bound_mm: f64) {
        if self.progress.is_some() && !self.reached.is_aside {
            self.reached.set(bound_mm);
        }
    }

    /// The same budget for work whose bounds are not those of the result: it tells of its progress beside the bound that is known without it.
    #[must_use]
    pub fn aside(&self) -> Self {
        Self { reached: Reached { is_aside: true, ..self.reached.clone() }, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    /// A budget and what it told: phases and bounds.
    fn overheard() -> (Budget, Arc<Mutex<Vec<Option<f64>>>>) {
        let heard: Arc<Mutex<Vec<Option<f64>>>> = Arc::default();
        let listener = Arc::clone(&heard);
        let sink = move |progress: &Progress| listener.lock().unwrap().push(progress.bound_mm);
        (Budget { progress: Some(Arc::new(sink)), ..Budget::default() }, heard)
    }

    #[test]
    fn a_bound_is_told_once_it_is_proven_and_until_it_is_replaced() {
        let (budget, heard) = overheard();
        let tell = |budget: &Budget| budget.report("refine", 0.0, 0);
        tell(&budget);
        budget.prove(0.0);
        tell(&budget);
        budget.prove(1.0);
        tell(&budget);
        budget.aside().prove(7.0);
        tell(&budget.aside());
        budget.aside().aside().prove(7.0);
        tell(&budget);
        budget.prove(f64::INFINITY);
        tell(&budget);
        assert_eq!(*heard.lock().unwrap(), [None, Some(0.0), Some(1.0), Some(1.0), Some(1.0), None]);
    }

    #[test]
    fn what_nobody_listens_to_leaves_no_bound_behind() {
        let (budget, heard) = overheard();
        Budget { progress: None, ..budget.clone() }.prove(3.0);
        budget.report("validate", 0.0, 0);
        assert_eq!(*heard.lock().unwrap(), [None]);
    }
}

//! What a computation may use, how it reports, and how it is stopped.
//!
//! The kernel has no clock: a deadline is a [`CancelToken`] that somebody outside fires. Every loop
//! of the kernel asks the token at least every few milliseconds of work.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

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
    /// Leaf cells that an evaluation may produce.
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
    /// Name of the phase: `validate`, `refine`, `dilate`, `stitch`, `verify`, `section`, `write`.
    pub phase: &'static str,
    /// Share of the phase that is done, in [0, 1].
    pub fraction: f64,
    /// Triangles or cells made so far, by phase.
    pub count: u64,
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
}

impl Budget {
    /// Tells the sink, if there is one.
    pub fn report(&self, phase: &'static str, fraction: f64, count: u64) {
        if let Some(sink) = &self.progress {
            sink(&Progress { phase, fraction, count });
        }
    }
}

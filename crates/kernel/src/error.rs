//! What kind of failure an error is, in words that no protocol owns, and the facts that a
//! refusal carries.

/// How a caller should react to an error. The HTTP status and the exit code are chosen from
/// this alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// The input is wrong: mend the document or the file.
    Invalid,
    /// The input is legal but what was asked cannot be reached (no convergence, a tolerance that
    /// single precision cannot carry).
    Unreachable,
    /// A limit of the caller or of the service was hit: time, memory, triangles, depth.
    Limit,
    /// Someone asked to stop.
    Cancelled,
    /// Our bug.
    Defect,
}

/// A limit that was hit: which one, what was asked, what is allowed, and a change that passes.
///
/// `asked` and `allowed` are in the unit that ends the limit's name (`triangles`, `memory_bytes`,
/// `tolerance_mm`).
#[derive(Clone, Debug, PartialEq)]
pub struct LimitFacts {
    /// Stable name of the limit, for example `triangles`.
    pub limit: &'static str,
    /// The value that the request needs.
    pub asked: f64,
    /// The value that is allowed.
    pub allowed: f64,
    /// Name of a parameter and a value of it that would pass, when one is known.
    pub remedy: Option<(&'static str, f64)>,
}

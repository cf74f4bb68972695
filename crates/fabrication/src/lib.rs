//! Turns a job into geometry and one certificate. Knows neither bytes, nor paths, nor HTTP.

mod boolean;
pub mod certificate;
pub mod job;
pub mod run;
pub mod solve;

pub use certificate::Certificate;
pub use job::{Input, Job, JobKind, Operation, Params};
pub use run::{Geometry, JobError, Outcome, Plan, StreamError, Validation, plan, run, stream_points, validate};
pub use solve::{SolutionSpace, SolveRefusal, Solved, solve};

//! Turns a job into geometry and one certificate. Knows neither bytes, nor paths, nor HTTP.

mod boolean;
pub mod certificate;
mod contact;
mod convert;
pub mod job;
mod operand;
pub mod run;
mod slice;
pub mod solve;

pub use certificate::Certificate;
pub use job::{Input, Job, JobKind, Operation, Params, Planes};
pub use run::{Geometry, JobError, Outcome, Plan, StreamError, Validation, plan, run, stream_points, validate};
pub use slice::Stack;
pub use solve::{SolutionSpace, SolveRefusal, Solved, solve};

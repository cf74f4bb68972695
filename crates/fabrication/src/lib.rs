//! Turns a job into geometry and one certificate. Knows neither bytes, nor paths, nor HTTP.

mod boolean;
pub mod certificate;
mod contact;
mod convert;
mod effort;
pub mod enclosed;
mod hull;
pub mod job;
pub mod level;
mod measure;
mod operand;
pub mod plan;
pub mod preview;
pub mod repair;
pub mod run;
pub mod shape_measures;
mod slice;
pub mod solidify;
pub mod solve;
pub mod split;
mod surface_area;

pub use certificate::Certificate;
pub use job::{CutPlane, Input, Job, JobKind, Operation, Params, Planes, Split, SplitKey, WallOrder, WallSide};
pub use plan::{Excess, Plan, plan};
pub use preview::PreviewStatement;
pub use repair::{RepairStatement, repaired_mesh};
pub use run::{Geometry, JobError, Outcome, Part, StreamError, Validation, run, stream_points, validate};
pub use slice::Stack;
pub use solve::{SolutionSpace, SolveRefusal, Solved, solve};

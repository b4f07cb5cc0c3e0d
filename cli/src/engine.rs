//! What the verbs ask of the planner and the simulator.

use std::io::Write;
use std::path::Path;

use crate::args::{CompareArgs, PlanArgs, RunArgs};
use crate::failure::Failure;
use crate::json::{CompareJson, InspectJson, PlanJson, VerifyJson};
use crate::progress::Progress;
use crate::report::model::{Axis, Motion, Report};

/// A planned job, and everything there is to tell of it.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The numbers; `files` is filled in when they are written.
    pub json: PlanJson,
    /// What the report shows.
    pub report: Report,
    /// The feed table file.
    pub feed: Vec<u8>,
}

/// One job, planned by several methods.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The numbers; `files` is filled in when they are written.
    pub json: CompareJson,
    /// The axes, in the machine's order.
    pub axes: Vec<Axis>,
    /// The motion of each method in `json`; `None` where there is none.
    pub motions: Vec<Option<Motion>>,
}

/// The work behind the verbs.
pub trait Engine {
    /// Plans and certifies a job.
    ///
    /// # Errors
    /// Bad input, or the solver fails.
    fn plan(&self, args: &PlanArgs, progress: &mut Progress) -> Result<Outcome, Failure>;

    /// Plans a job and plays it on simulated drives; writes set-points to `trace` as CSV.
    ///
    /// # Errors
    /// As [`Engine::plan`], or a drive refuses the table, or `trace` cannot be written.
    fn run(&self, args: &RunArgs, trace: &mut dyn Write, progress: &mut Progress)
    -> Result<Outcome, Failure>;

    /// Plans a job by several methods.
    ///
    /// # Errors
    /// Bad input, or no method finds a motion.
    fn compare(&self, args: &CompareArgs, progress: &mut Progress) -> Result<Compared, Failure>;

    /// Proves a feed table file against the limits it carries.
    ///
    /// # Errors
    /// The file is no feed table.
    fn verify(&self, file: &Path, progress: &mut Progress) -> Result<VerifyJson, Failure>;

    /// Reads what a feed table file says of itself.
    ///
    /// # Errors
    /// The file is no feed table.
    fn inspect(&self, file: &Path) -> Result<InspectJson, Failure>;
}

//! The planner and the simulator of this workspace, behind the verbs.

mod compare;
pub(crate) mod files;
mod fitting;
pub(crate) mod job;
mod outcome;
mod playback;
mod points;
mod program;
mod walk;

use std::io::Write;
use std::path::Path;

use crate::args::{CompareArgs, PlanArgs, RunArgs};
use crate::engine::{Compared, Engine, Outcome};
use crate::failure::Failure;
use crate::json::{InspectJson, VerifyJson};
use crate::progress::Progress;

/// Planner, certificate and simulated drives in this process.
#[derive(Clone, Copy, Debug)]
pub struct Local;

impl Engine for Local {
    fn plan(&self, args: &PlanArgs, progress: &mut Progress) -> Result<Outcome, Failure> {
        let fitted = fitting::plan(args, progress)?;
        let motion = playback::planned(&fitted);
        outcome::assemble(args, &fitted, motion, None)
    }

    fn run(
        &self,
        args: &RunArgs,
        trace: &mut dyn Write,
        progress: &mut Progress,
    ) -> Result<Outcome, Failure> {
        let fitted = fitting::plan(&args.plan, progress)?;
        let played = playback::simulated(&fitted, args.trace_every, trace, progress)?;
        outcome::assemble(&args.plan, &fitted, played.motion, Some(&played.drives))
    }

    fn compare(&self, args: &CompareArgs, progress: &mut Progress) -> Result<Compared, Failure> {
        compare::compare(args, progress)
    }

    fn verify(&self, file: &Path, progress: &mut Progress) -> Result<VerifyJson, Failure> {
        files::verify(file, progress)
    }

    fn inspect(&self, file: &Path) -> Result<InspectJson, Failure> {
        files::inspect(file)
    }
}

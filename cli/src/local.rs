//! The planner and the simulator of this workspace, behind the verbs.

use std::io::Write;
use std::path::Path;

use crate::args::{PlanArgs, RunArgs};
use crate::engine::{Engine, Outcome};
use crate::failure::Failure;
use crate::json::{InspectJson, VerifyJson};
use crate::progress::Progress;

/// Planner, certificate and simulated drives in this process.
#[derive(Clone, Copy, Debug)]
pub struct Local;

const ABSENT: &str = "this build has no planner";

impl Engine for Local {
    fn plan(&self, _: &PlanArgs, _: &mut Progress) -> Result<Outcome, Failure> {
        Err(Failure::internal(ABSENT))
    }

    fn run(&self, _: &RunArgs, _: &mut dyn Write, _: &mut Progress) -> Result<Outcome, Failure> {
        Err(Failure::internal(ABSENT))
    }

    fn verify(&self, _: &Path, _: &mut Progress) -> Result<VerifyJson, Failure> {
        Err(Failure::internal(ABSENT))
    }

    fn inspect(&self, _: &Path) -> Result<InspectJson, Failure> {
        Err(Failure::internal(ABSENT))
    }
}

//! `feedspline run`: plan a job and play it on simulated drives.

use std::io::Write;

use super::{Verdict, plan};
use crate::args::RunArgs;
use crate::console::Console;
use crate::engine::Engine;
use crate::failure::Failure;
use crate::output::OutputSet;
use crate::progress::Progress;

/// Runs the verb.
///
/// # Errors
/// As `plan`, or the simulated drives refuse the table.
pub fn execute(args: &RunArgs, engine: &dyn Engine, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let folder = plan::folder(&args.plan)?;
    let mut set = OutputSet::open(&folder)?;
    let path = folder.join("trace.csv");
    let mut trace = set.stream("trace.csv")?;
    let mut progress = Progress::new(console.talk());
    let outcome = engine.run(args, &mut trace, &mut progress)?;
    drop(progress);
    trace.flush().map_err(|e| Failure::unwritable(&path, &e))?;
    drop(trace);
    plan::deliver(outcome, &args.plan, set, Some(path), console)
}

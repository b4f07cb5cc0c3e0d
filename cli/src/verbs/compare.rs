//! `feedspline compare`: plan a job by several methods and show them side by side.

use std::path::Path;

use super::{Verdict, plan};
use crate::args::CompareArgs;
use crate::console::Console;
use crate::engine::Engine;
use crate::failure::Failure;
use crate::output::OutputSet;
use crate::progress::Progress;
use crate::report;
use crate::summary;

/// Runs the verb.
///
/// # Errors
/// Bad input, no method that finds a motion, or results that cannot be written; then no result file is left behind.
pub fn execute(
    args: &CompareArgs,
    engine: &dyn Engine,
    console: &mut Console<'_>,
) -> Result<Verdict, Failure> {
    let folder = plan::folder(&args.job)?;
    let mut progress = Progress::new(console.talk());
    let mut compared = engine.compare(args, &mut progress)?;
    drop(progress);
    let mut set = OutputSet::open(&folder)?;
    let show = |path: &Path| Some(path.display().to_string());
    compared.json.files.report =
        show(&set.write("compare.html", report::compare::page(&compared).as_bytes())?);
    compared.json.files.compare = show(&folder.join("compare.json"));
    let json = serde_json::to_vec_pretty(&compared.json)
        .map_err(|e| Failure::internal(format!("compare.json cannot be made: {e}")))?;
    set.write("compare.json", &json)?;
    set.commit()?;
    console.show(&compared.json, &summary::compare(&compared.json))?;
    Ok(Verdict::of(compared.json.methods.iter().all(|m| m.sound())))
}

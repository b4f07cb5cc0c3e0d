//! `feedspline plan`: plan a job, certify it, write its table and report.

use std::path::{Path, PathBuf};

use super::Verdict;
use crate::args::{JobArgs, PlanArgs};
use crate::console::Console;
use crate::engine::{Engine, Outcome};
use crate::failure::Failure;
use crate::output::OutputSet;
use crate::progress::Progress;
use crate::report;
use crate::summary;

/// Runs the verb.
///
/// # Errors
/// Bad input, or results that cannot be written; then no result file is left behind.
pub fn execute(args: &PlanArgs, engine: &dyn Engine, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let mut progress = Progress::new(console.talk());
    let outcome = engine.plan(args, &mut progress)?;
    drop(progress);
    let set = OutputSet::open(&folder(&args.job)?)?;
    deliver(outcome, args, set, None, console)
}

/// The folder for the results: `--out`, else `out/<job name>`.
///
/// # Errors
/// The job's name names nothing.
pub fn folder(args: &JobArgs) -> Result<PathBuf, Failure> {
    match &args.out {
        Some(folder) => Ok(folder.clone()),
        None => Ok(Path::new("out").join(stem(&args.file)?)),
    }
}

/// The job's file name without its extension.
///
/// # Errors
/// The path ends in no name.
fn stem(job: &Path) -> Result<String, Failure> {
    match job.file_stem() {
        Some(stem) => Ok(stem.to_string_lossy().into_owned()),
        None => Err(Failure::input("this is not a file").in_file(job).with_help(
            "Name a part program, such as jobs/cat.ngc, or a file of way-points, such as jobs/cat2d.csv.",
        )),
    }
}

/// Writes the results of a job and shows them.
///
/// Without a certificate that holds there is no feed table, only the report that says why.
///
/// # Errors
/// A file cannot be written.
pub fn deliver(
    mut outcome: Outcome,
    args: &PlanArgs,
    mut set: OutputSet,
    trace: Option<PathBuf>,
    console: &mut Console<'_>,
) -> Result<Verdict, Failure> {
    let verdict = Verdict::of(outcome.json.certificate.holds);
    let show = |path: &Path| Some(path.display().to_string());
    let files = &mut outcome.json.files;
    let feed = format!("{}.feed", stem(&args.job.file)?);
    match verdict {
        Verdict::Holds => files.feed = show(&set.write(&feed, &outcome.feed)?),
        // The table of an earlier run is not what the new report is about.
        Verdict::Broken | Verdict::Refused | Verdict::Stopped => set.retire(&feed),
    }
    files.report = show(&set.write("report.html", report::page(&outcome.report).as_bytes())?);
    files.trace = trace.as_deref().and_then(show);
    files.plan = show(&folder(&args.job)?.join("plan.json"));
    let plan = serde_json::to_vec_pretty(&outcome.json)
        .map_err(|e| Failure::internal(format!("plan.json cannot be made: {e}")))?;
    set.write("plan.json", &plan)?;
    set.commit()?;
    console.show(&outcome.json, &summary::plan(&outcome.json))?;
    Ok(verdict)
}

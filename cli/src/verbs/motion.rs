//! `feedspline move`: the fastest motion from state to state, for one axis or several, one row or many.

use host_sim::group::{self, Axis, GroupError, GroupMotion};

use super::Verdict;
use crate::args::MoveArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::json::{MoveErrorJson, MoveJson, sync_name};
use crate::moves::{self, Row};
use crate::progress::Progress;
use crate::summary;

/// Text that is gathered before it is written [bytes].
const CHUNK: usize = 1 << 16;

/// Runs the verb: every row is planned, whatever became of those before it.
///
/// # Errors
/// The rows cannot be read; then nothing is planned.
pub fn execute(args: &MoveArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    if args.bus.is_some() {
        return super::errand::to(args, console);
    }
    let job = match &args.file {
        Some(file) => moves::read(file, args.sync.into())?,
        None => moves::single(args)?,
    };
    let talk = console.talk();
    let mut progress = Progress::new(talk);
    progress.stage("moves");
    let count = job.rows.len();
    let mut without = 0usize;
    let mut text = String::from(if talk.json { "[" } else { "" });
    for (index, row) in job.rows.iter().enumerate() {
        let told = planned(index, row, &job.axes);
        without += usize::from(told.error.is_some());
        if talk.json {
            text.push_str(if index == 0 { "\n" } else { ",\n" });
            let row = serde_json::to_string(&told);
            text.push_str(&row.map_err(|e| Failure::internal(format!("a row cannot be put in JSON: {e}")))?);
        } else if !talk.quiet {
            text.push_str(&summary::motion(&told));
        }
        if text.len() > CHUNK {
            progress.share(index as f64 / count as f64);
            console.say(&text)?;
            text.clear();
        }
    }
    drop(progress);
    text.push_str(if talk.json { "\n]\n" } else { "" });
    console.say(&text)?;
    if without == 0 {
        return Ok(Verdict::Holds);
    }
    console.warn(&format!("{without} of {count} moves are not possible\n"));
    Ok(Verdict::Refused)
}

fn planned(index: usize, row: &Row, names: &[String]) -> MoveJson {
    let axes: &[Axis] = &row.axes;
    match group::plan(axes, row.sync) {
        Ok(motion) => shown(index, row, names, &motion),
        Err(error) => refused(index, row, names, error),
    }
}

fn shown(index: usize, row: &Row, names: &[String], motion: &GroupMotion) -> MoveJson {
    let mut told = MoveJson::row(index, row.line);
    told.duration_s = Some(motion.duration);
    told.sync = Some(sync_name(motion.sync));
    told.take(names, motion);
    told
}

fn refused(index: usize, row: &Row, names: &[String], error: GroupError) -> MoveJson {
    let mut told = MoveJson::row(index, row.line);
    told.error = Some(MoveErrorJson::of(&error, names));
    told
}

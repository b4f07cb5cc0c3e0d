//! `feedspline run`: plan a job and play it on simulated drives.

use std::io::{self, Write};

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
    let folder = plan::folder(&args.plan.job)?;
    let mut set = OutputSet::open(&folder)?;
    let path = folder.join("trace.csv");
    let mut trace = Watched { inner: set.stream("trace.csv")?, refused: None };
    let mut progress = Progress::new(console.talk());
    let played = engine.run(args, &mut trace, &mut progress).and_then(|outcome| {
        trace.flush().map_err(|e| Failure::unwritable(&path, &e))?;
        Ok(outcome)
    });
    drop(progress);
    let outcome = match (played, &trace.refused) {
        (Err(_), Some(error)) => return Err(Failure::unwritable(&path, error)),
        (played, _) => played?,
    };
    drop(trace);
    plan::deliver(outcome, &args.plan, set, Some(path), console)
}

/// A writer that keeps the error of a failed write, whatever becomes of it on the way back.
struct Watched<W> {
    inner: W,
    refused: Option<io::Error>,
}

impl<W> Watched<W> {
    fn note<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|error| {
            let kind = error.kind();
            if kind != io::ErrorKind::Interrupted {
                self.refused = Some(error);
            }
            kind.into()
        })
    }
}

impl<W: Write> Write for Watched<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let result = self.inner.write(bytes);
        self.note(result)
    }

    fn flush(&mut self) -> io::Result<()> {
        let result = self.inner.flush();
        self.note(result)
    }
}

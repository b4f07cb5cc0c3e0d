//! What is streamed: a feed table file, or a job that is planned meanwhile.

use std::path::Path;
use std::sync::mpsc::SyncSender;

use planner::feed::file::FileHeader;
use planner::feed::job::{JobItem, PlannedSection};
use planner::feed::stream::{StreamError, StreamItem, Streamer};
use planner::job::machine::{LimitSet, Machine};

use crate::args::JobArgs;
use crate::failure::Failure;
use crate::local::{files, job};

/// Where tables come from.
pub(crate) enum Source {
    /// A file of tables.
    Planned(Vec<JobItem>),
    /// A job for a machine.
    Job(Machine),
}

/// Opens what is to be streamed, and says what drives it is for.
///
/// # Errors
/// A file that is not sound.
pub(crate) fn open(args: &JobArgs) -> Result<(Source, FileHeader), Failure> {
    if args.file.extension().is_some_and(|e| e.eq_ignore_ascii_case("feed")) {
        let file = files::open(&args.file)?;
        return Ok((Source::Planned(file.items), file.header));
    }
    args.check()?;
    let machine = job::machine(args)?;
    let header = FileHeader::from(&machine);
    Ok((Source::Job(machine), header))
}

impl Source {
    /// The drives have to take tables that do not limit jerk.
    pub(crate) fn free_jerk(&self) -> bool {
        let free = |s: &PlannedSection| s.limits.iter().any(|l| l.jerk == f64::INFINITY);
        match self {
            Source::Planned(items) => items.iter().any(|item| matches!(item, JobItem::Section(s) if free(s))),
            Source::Job(_) => false,
        }
    }

    /// Hands everything over, piece by piece, until nobody wants more; an error is the last thing that comes.
    pub(crate) fn run(
        &self,
        args: &JobArgs,
        header: &FileHeader,
        room: usize,
        out: &SyncSender<Result<StreamItem, Failure>>,
    ) {
        let mut emit = |item: StreamItem| out.send(Ok(item)).is_ok();
        let result = match self {
            Source::Planned(items) => planned(items, header, room, &args.file, &mut emit),
            Source::Job(machine) => {
                let limits = LimitSet::VelocityAccelerationJerk;
                job::read(args, machine, limits, |sections| {
                    Streamer::new(header)
                        .run(sections, machine, limits, &mut emit)
                        .map_err(|e| told(e, &args.file))
                })
                .map(|_| ())
            }
        };
        if let Err(failure) = result {
            // Nobody listens any more: then the failure is of no interest either.
            let _ = out.send(Err(failure));
        }
    }
}

fn planned(
    items: &[JobItem],
    header: &FileHeader,
    room: usize,
    file: &Path,
    emit: &mut dyn FnMut(StreamItem) -> bool,
) -> Result<(), Failure> {
    let mut streamer = Streamer::new(header);
    for item in items {
        let goes_on = match item {
            JobItem::Section(s) => streamer
                .table(&s.table, &s.marks, &s.limits, room, emit)
                .map_err(|e: StreamError<Failure>| told(e, file))?,
            JobItem::Dwell { seconds, .. } => emit(StreamItem::Dwell { seconds: *seconds }),
            JobItem::Note { .. } => true,
        };
        if !goes_on {
            break;
        }
    }
    Ok(())
}

fn told(error: StreamError<Failure>, file: &Path) -> Failure {
    let (message, line) = match error {
        StreamError::Section(failure) => return failure,
        StreamError::Plan { line, fault } => (format!("this cannot be planned: {fault}"), line),
        StreamError::Pack { line, source } => (format!("this cannot be sent: {source}"), line),
    };
    job::placed(message, file, Some(line), None).with_help(
        "`feedspline plan` says more about it. What was sent before it has been played; the axes stand still.",
    )
}

//! `feedspline stream`: play a job on drives while it is planned.

use std::collections::VecDeque;
use std::sync::mpsc::sync_channel;

use planner::feed::stream::StreamItem;

use super::Verdict;
use crate::args::StreamArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::live::conduct::Conductor;
use crate::live::{SIM, real, sim, source};
use crate::progress::Progress;
use crate::{interrupt, summary};

/// Pieces that may wait for the drives.
const WAITING: usize = 4;

/// Runs the verb.
///
/// # Errors
/// The job is not sound, a drive refuses, fails or is silent, or the bus is gone.
pub fn execute(args: &StreamArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let (source, header) = source::open(&args.job)?;
    interrupt::count_presses();
    let mut progress = Progress::new(console.talk());
    let room = args.room as usize;
    let told = std::thread::scope(|scope| {
        let (out, pieces) = sync_channel(WAITING);
        let (job, header, source) = (&args.job, &header, &source);
        scope.spawn(move || source.run(job, header, room, &out));
        // Where the axes have to stand is told by the first table.
        let mut ready = VecDeque::new();
        let positions = loop {
            match pieces.recv() {
                Ok(Ok(item)) => {
                    let starts = match &item {
                        StreamItem::Piece { packed, .. } => {
                            Some(packed.axes.iter().map(|axis| axis.header.start).collect())
                        }
                        StreamItem::Dwell { .. } => None,
                    };
                    ready.push_back(item);
                    if let Some(starts) = starts {
                        break starts;
                    }
                }
                Ok(Err(failure)) => return Err(failure),
                Err(_) => {
                    return Err(
                        Failure::input("there is nothing to play in this job").in_file(&args.job.file)
                    );
                }
            }
        };
        let conductor = Conductor::new(header, pieces, ready);
        if args.bus.bus == SIM {
            let free_jerk = source.free_jerk();
            let set = sim::Set { header, bus: &args.bus, positions, room, free_jerk, travels: false };
            sim::with(&set, |stage| conductor.play(stage, &mut progress))
        } else {
            let mut stage = real::open(&args.bus, header)?;
            conductor.play(&mut stage, &mut progress)
        }
    })?;
    drop(progress);
    console.show(&told, &summary::live::stream(&told, &header))?;
    Ok(if told.stopped { Verdict::Stopped } else { Verdict::Holds })
}

//! The motion of a planned job, instant by instant: as planned, or as simulated drives play it.

use std::io::{self, Write};

use host_sim::report::SimReport;
use host_sim::scenario::{SimSettings, simulate};
use host_sim::trace::{CsvTrace, Rows, TraceHeader, TraceRow, TraceSink};
use planner::feed::job::{JobItem, PlannedSection};
use planner::job::machine::{AxisKind, Machine};
use planner::topp::problem::Binding;

use super::fitting::Fitted;
use super::outcome::report_axes;
use super::walk::Walk;
use crate::failure::Failure;
use crate::progress::Progress;
use crate::report::model::Motion;
use crate::report::record::{AxisInstant, DriveInstant, Instant, Recorder};

/// Instants of a plan that is only looked at.
const INSTANTS: f64 = 200_000.0;

/// What the simulation gives.
#[derive(Debug)]
pub(super) struct Played {
    pub(super) motion: Motion,
    pub(super) drives: Drives,
}

/// How the simulated drives did.
#[derive(Debug)]
pub(super) struct Drives {
    pub(super) report: SimReport,
    /// Computing time of the simulation [s].
    pub(super) seconds: f64,
}

/// The motion as planned.
pub(super) fn planned(fitted: &Fitted) -> Motion {
    let recorder = Recorder::new(&report_axes(&fitted.machine));
    record(&fitted.plan.items, &fitted.plan.binding, &fitted.machine, recorder)
}

/// The motion of planned items, and what rules each span of their sections.
pub(super) fn record(
    items: &[JobItem],
    binding: &[Vec<Binding>],
    machine: &Machine,
    mut recorder: Recorder,
) -> Motion {
    let cycle: f64 = items.iter().map(seconds).sum();
    let interval = machine.control_tick_s.max(cycle / INSTANTS);
    let mut binding = binding.iter();
    let (mut clock, mut standing) = (0.0, Vec::new());
    for item in items {
        let duration = seconds(item);
        match item {
            JobItem::Section(section) => {
                let binding = binding.next().map_or(&[][..], Vec::as_slice);
                let mut walk = Walk::new(section, binding, linear(machine));
                let count = (duration / interval).ceil().max(1.0) as u64;
                for k in 0..=count {
                    let time = (k as f64 * interval).min(duration);
                    recorder.push(&walk.instant(time, clock + time, &[]));
                }
                let end = walk.instant(duration, clock + duration, &[]);
                standing = end.axes.iter().map(|a| AxisInstant::standing(a.position, None)).collect();
            }
            // Before the first section nothing is known of where the machine stands.
            JobItem::Dwell { line, .. } if !standing.is_empty() => {
                recorder.push(&Instant::standing(clock, *line, &standing));
                recorder.push(&Instant::standing(clock + duration, *line, &standing));
            }
            JobItem::Dwell { .. } | JobItem::Note { .. } => {}
        }
        clock += duration;
    }
    recorder.finish()
}

/// The motion as simulated drives play it; the trace goes to `out` as CSV.
///
/// # Errors
/// A drive refuses a table, or the trace cannot be written.
pub(super) fn simulated(
    fitted: &Fitted,
    every: Option<u32>,
    out: &mut dyn Write,
    progress: &mut Progress,
) -> Result<Played, Failure> {
    let begin = std::time::Instant::now();
    progress.stage("simulating");
    let rows = every.map_or(Rows::default(), |n| Rows::Every(n.into()));
    let mut sink = (CsvTrace::new(out, rows), Watch::new(fitted));
    let report =
        simulate(&fitted.plan.items, &fitted.machine, &SimSettings::default(), &mut sink, &mut |p| {
            progress.share(if p.total_s > 0.0 { p.done_s / p.total_s } else { 1.0 })
        })
        .map_err(|e| Failure::internal(format!("the simulated drives cannot play the tables: {e}")))?;
    let motion = sink.1.recorder.finish();
    Ok(Played { motion, drives: Drives { report, seconds: begin.elapsed().as_secs_f64() } })
}

/// Time that an item takes [s].
pub(super) fn seconds(item: &JobItem) -> f64 {
    match item {
        JobItem::Section(section) => section.table.duration(),
        JobItem::Dwell { seconds, .. } => *seconds,
        JobItem::Note { .. } => 0.0,
    }
}

/// Mask of the linear axes.
pub(super) fn linear(machine: &Machine) -> u16 {
    let axes = machine.axes.iter().enumerate();
    axes.filter(|(_, a)| a.kind == AxisKind::Linear).fold(0, |mask, (i, _)| mask | 1 << i)
}

/// Records what the plan asks for and what the drives do, tick by tick.
struct Watch<'a> {
    sections: Vec<(&'a PlannedSection, &'a [Binding])>,
    linear: u16,
    walk: Option<(usize, Walk<'a>)>,
    recorder: Recorder,
    drives: Vec<DriveInstant>,
    still: Vec<AxisInstant>,
    line: u32,
}

impl<'a> Watch<'a> {
    fn new(fitted: &'a Fitted) -> Self {
        let binding = fitted.plan.binding.iter().map(Vec::as_slice);
        Watch {
            sections: fitted.plan.sections().zip(binding).collect(),
            linear: linear(&fitted.machine),
            walk: None,
            recorder: Recorder::new(&report_axes(&fitted.machine)),
            drives: Vec::new(),
            still: Vec::new(),
            line: 0,
        }
    }
}

impl TraceSink for Watch<'_> {
    fn begin(&mut self, _: &TraceHeader) -> io::Result<()> {
        Ok(())
    }

    fn row(&mut self, row: &TraceRow<'_>) -> io::Result<()> {
        self.drives.clear();
        let drives = row.axes.iter().map(|a| DriveInstant { error: a.following_error, effort: a.effort });
        self.drives.extend(drives);
        let Some(place) = row.place else {
            self.still.clear();
            let axes = row.axes.iter().zip(&self.drives);
            self.still.extend(axes.map(|(a, &drive)| AxisInstant::standing(a.position, Some(drive))));
            self.recorder.push(&Instant::standing(row.time_s, self.line, &self.still));
            return Ok(());
        };
        if self.walk.as_ref().is_none_or(|(table, _)| *table != place.table) {
            self.walk =
                self.sections.get(place.table).map(|&(s, b)| (place.table, Walk::new(s, b, self.linear)));
        }
        if let Some((_, walk)) = &mut self.walk {
            let instant = walk.instant(place.time_s, row.time_s, &self.drives);
            self.line = instant.line;
            self.recorder.push(&instant);
        }
        Ok(())
    }

    fn end(&mut self) -> io::Result<()> {
        Ok(())
    }
}

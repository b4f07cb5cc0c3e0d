//! The whole product in one call: a program's text in, certified tables and their simulation out.

use host_sim::report::SimReport;
use host_sim::scenario::{SimError, SimSettings, simulate};
use host_sim::trace::PlotTrace;
use planner::analysis::comparison::Comparison;
use planner::feed::job::PlannedSection;
use planner::feed::pack::{PackError, Packed, Target, pack};
use planner::geometry::sections::{PathSettings, SectionError, sections};
use planner::job::gcode::{Counters, Options, Program, ProgramError};
use planner::job::machine::{LimitSet, Machine};
use planner::job::program::{Item, Move};
use planner::pipeline::{self, JobError, JobPlan};
use planner::topp::problem::Settings;

/// A section's table for the drives of `machine`, for a control tick of `tick_ns`.
///
/// # Errors
/// What the format cannot express.
pub fn packed(
    section: &PlannedSection,
    number: usize,
    tick_ns: u32,
    machine: &Machine,
) -> Result<Packed, PackError> {
    pack(&section.table, number as u32, &Target::of(machine, tick_ns, &section.limits))
}

/// Why a program has no plan.
pub type ChainError = JobError<SectionError<ProgramError>>;

/// A program, read and planned.
#[derive(Clone, Debug)]
pub struct Chain {
    /// Everything the program asks for, in order.
    pub items: Vec<Item>,
    /// What was counted while it was read.
    pub counters: Counters,
    /// The plan.
    pub plan: JobPlan,
    /// What the moves take at constant feed [s].
    pub constant_feed_time_s: f64,
    /// What the moves take with a rest after each [s].
    pub stop_at_every_block_time_s: f64,
}

/// Reads and plans `text` for `machine`.
///
/// # Errors
/// The first error in program order.
pub fn plan(
    text: &[u8],
    machine: &Machine,
    options: &Options,
    limits: LimitSet,
) -> Result<Chain, ChainError> {
    let mut program = Program::new(text, "part.ngc", machine, options.clone());
    let mut items = Vec::new();
    let seen = program.by_ref().inspect(|item| items.extend(item.as_ref().ok().cloned()));
    let mut stream = sections(seen, machine, &PathSettings::of(machine, limits));
    let plan = pipeline::plan(&mut stream, machine, limits, &Settings::default(), &mut |_| ())?;
    drop(stream);
    let mut comparison = Comparison::new(&machine.axes, limits);
    for item in &items {
        match item {
            Item::Move(m) => comparison.add(m),
            Item::Dwell { seconds, .. } => comparison.add_dwell(*seconds),
            Item::Stop { .. } | Item::Note { .. } => {}
        }
    }
    let counters = program.counters().clone();
    let Comparison { constant_feed_time_s, stop_at_every_block_time_s, .. } = comparison;
    Ok(Chain { items, counters, plan, constant_feed_time_s, stop_at_every_block_time_s })
}

impl Chain {
    /// The moves, in order.
    pub fn moves(&self) -> impl Iterator<Item = &Move> {
        self.items.iter().filter_map(|item| if let Item::Move(m) = item { Some(m) } else { None })
    }

    /// Motion alone [s].
    pub fn motion_time_s(&self) -> f64 {
        self.plan.sections().map(|s| s.table.duration()).sum()
    }

    /// Where every drive has to end: the last programmed position in whole counts, halves either way.
    pub fn ends_at(&self, counts: &[i64], machine: &Machine) -> bool {
        let end = self.moves().last().map_or([0.0; _], |m| m.end);
        let near = |((c, axis), x): ((&i64, &planner::job::machine::Axis), &f64)| {
            let exact = x * axis.counts_per_unit;
            (*c as f64 - exact).abs() <= 0.5 + 1e-9 * exact.abs()
        };
        counts.len() == machine.axes.len() && counts.iter().zip(&machine.axes).zip(&end).all(near)
    }

    /// Plays the plan on simulated drives.
    ///
    /// # Errors
    /// A drive refuses a table, or fails on it.
    pub fn simulate(&self, machine: &Machine) -> Result<SimReport, SimError> {
        let mut plot = PlotTrace::new(64);
        simulate(&self.plan.items, machine, &SimSettings::default(), &mut plot, &mut |_| ())
    }
}

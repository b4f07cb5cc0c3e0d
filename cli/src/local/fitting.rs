//! From the command line to a planned job.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::time::Instant;

use planner::analysis::comparison::Comparison;
use planner::geometry::sections::{PathSettings, SectionError, sections};
use planner::job::gcode::{self, Counters, Options, ProgramError};
use planner::job::machine::{LimitSet, Machine};
use planner::job::program::{Corner, Item, MoveKind, StopCause, ToleranceSource};
use planner::pipeline::{self, JobError, JobPlan};
use planner::topp::PlanError;
use planner::topp::problem::{Settings, Solver};

use crate::args::{self, PlanArgs};
use crate::failure::Failure;
use crate::progress::Progress;

/// The machine that jobs run on when none is named.
const BUILT_IN: &str = include_str!("../../../jobs/mill3.toml");

/// Bytes of a program that are read ahead to tell how long it is.
const READ_AHEAD: usize = 1 << 16;

/// A planned job with everything that is known of it.
#[derive(Debug)]
pub(super) struct Fitted {
    pub(super) machine: Machine,
    pub(super) plan: JobPlan,
    pub(super) counters: Counters,
    pub(super) comparison: Comparison,
    pub(super) stops: BTreeMap<StopCause, u64>,
    pub(super) tolerance: InForce,
    /// Size of the largest figure that standing still is within the tolerance of [mm].
    pub(super) left_out_mm: f64,
    pub(super) seconds: f64,
}

/// The largest path tolerance in force, and who set it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct InForce {
    pub(super) mm: f64,
    pub(super) source: Option<ToleranceSource>,
}

/// Reads, fits, plans and certifies a job.
///
/// # Errors
/// Bad input, with its place.
pub(super) fn plan(args: &PlanArgs, progress: &mut Progress) -> Result<Fitted, Failure> {
    let begin = Instant::now();
    if let Some(threads) = args.threads {
        // Fails only when threads run already, which happens when one process plans twice.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
    }
    let machine = match &args.machine {
        Some(path) => Machine::load(path)
            .map_err(|e| placed(e.kind().to_string(), path, e.line(), e.column()).quoting(e))?,
        None => Machine::from_toml(BUILT_IN, "built-in machine")
            .map_err(|e| Failure::internal(format!("the built-in machine is not sound: {e}")))?,
    };
    let refused = |e: ProgramError| placed(e.kind().to_string(), &args.job, e.line(), e.column()).quoting(e);
    let mut program = gcode::open(&args.job, &machine, options(args)).map_err(refused)?;

    progress.stage("planning");
    let lines = if progress.watched() { line_count(&args.job) } else { 0 };
    let mut comparison = Comparison::new(&machine.axes);
    let mut tolerance = InForce::default();
    let items = program.by_ref().inspect(|item| match item {
        Ok(Item::Move(m)) => {
            comparison.add(m);
            if m.kind == MoveKind::Feed {
                tolerance.note(m.corner, &machine);
            }
        }
        Ok(Item::Dwell { seconds, .. }) => comparison.add_dwell(*seconds),
        Ok(Item::Stop { .. } | Item::Note { .. }) | Err(_) => {}
    });
    let mut sections = sections(items, &machine, &PathSettings::of(&machine, limits(args)));
    let planned = pipeline::plan(&mut sections, &machine, limits(args), &settings(args), &mut |line| {
        progress.share(f64::from(line) / lines.max(1) as f64);
    });
    let stops = sections.stops().clone();
    let left_out_mm = sections.left_out_mm();
    drop(sections);
    let plan = planned.map_err(|e| match e {
        JobError::Section(SectionError::Program(e)) => refused(e),
        JobError::Section(SectionError::Geometry(e)) => {
            placed(e.to_string(), &args.job, Some(e.line()), None)
                .with_help("Widen the tolerance (G64 P or --tolerance), or change the path at this line.")
        }
        JobError::Plan { line, fault } => {
            placed(fault.to_string(), &args.job, Some(line), None).with_help(remedy(&fault))
        }
    })?;
    let counters = program.counters().clone();
    Ok(Fitted {
        machine,
        plan,
        counters,
        comparison,
        stops,
        tolerance,
        left_out_mm,
        seconds: begin.elapsed().as_secs_f64(),
    })
}

impl InForce {
    /// Takes in the corner of one feed move.
    fn note(&mut self, corner: Corner, machine: &Machine) {
        let (mm, source) = match corner {
            Corner::Within { tolerance_mm, source } if tolerance_mm > 0.0 => (tolerance_mm, source),
            Corner::Within { source, .. } => (machine.exact_path_mm, source),
            Corner::Stop | Corner::Exact => (machine.exact_path_mm, ToleranceSource::Program),
        };
        if self.source.is_none() || mm > self.mm {
            *self = InForce { mm, source: Some(source) };
        }
    }

    /// In words.
    pub(super) fn words(self) -> &'static str {
        match self.source {
            Some(ToleranceSource::Program) => "program",
            Some(ToleranceSource::CommandLine) => "command line",
            Some(ToleranceSource::BestSpeed) => "machine, for G64 without P",
            Some(ToleranceSource::Machine) | None => "machine",
        }
    }
}

fn options(args: &PlanArgs) -> Options {
    Options {
        dialect: match args.dialect {
            args::Dialect::Rs274 => gcode::Dialect::Rs274,
            args::Dialect::Printer => gcode::Dialect::Printer,
        },
        tolerance_mm: args.tolerance,
        ignore_feed: args.ignore_feed,
        block_delete: false,
    }
}

fn limits(args: &PlanArgs) -> LimitSet {
    match args.limits {
        args::Limits::Va => LimitSet::VelocityAcceleration,
        args::Limits::Vaj => LimitSet::VelocityAccelerationJerk,
    }
}

fn settings(args: &PlanArgs) -> Settings {
    let solver = match args.solver {
        args::Solver::InteriorPoint => Solver::InteriorPoint,
        args::Solver::Clarabel => Solver::Clarabel,
    };
    Settings { solver, ..Settings::default() }
}

/// Bad input in a file, at a place if that is known.
fn placed(message: String, file: &Path, line: Option<u32>, column: Option<u32>) -> Failure {
    let failure = Failure::input(message);
    match (line, column) {
        (Some(line), column) => failure.at(file, line, column.unwrap_or(1)),
        (None, _) => failure.in_file(file),
    }
}

/// What to do about a section that cannot be planned.
fn remedy(fault: &PlanError) -> &'static str {
    match fault {
        PlanError::Cap { .. } | PlanError::CapOrder { .. } => {
            "Check the feed at this line: it has to be above zero."
        }
        PlanError::TooLong { .. } | PlanError::Slow { .. } => {
            "Raise the feed at this line, or check the axis limits of the machine file: \
             the motion is too slow for a table."
        }
        PlanError::Uneven { .. } | PlanError::Resolution { .. } => {
            "Check the feed at this line and the axis limits of the machine file: they lie too many decades \
             apart, or are too extreme for the control tick."
        }
        PlanError::Limit { .. } | PlanError::LimitCount { .. } | PlanError::AxisCount { .. } => {
            "Check the axes and their limits in the machine file."
        }
        PlanError::TooShort { .. } | PlanError::NothingMoves | PlanError::StandsStill { .. } => {
            "Leave this move out, or check the counts per unit in the machine file: \
             it is too short for the drives to tell."
        }
        PlanError::Path { .. } | PlanError::Setting { .. } => {
            "Check the coordinates at this line, and the counts and axis limits of the machine file."
        }
    }
}

/// Lines of a file; zero when it cannot be read, or when reading takes away what is in it, as from a pipe.
fn line_count(file: &Path) -> usize {
    if !file.metadata().is_ok_and(|about| about.is_file()) {
        return 0;
    }
    let Ok(file) = File::open(file) else { return 0 };
    let mut reader = BufReader::with_capacity(READ_AHEAD, file);
    let mut lines = 0;
    while let Ok(bytes) = reader.fill_buf() {
        if bytes.is_empty() {
            break;
        }
        lines += bytes.iter().filter(|&&b| b == b'\n').count();
        let used = bytes.len();
        reader.consume(used);
    }
    lines
}

//! A job as it is read: sections on their way to the planner, and what is told of them besides.

use std::collections::BTreeMap;
use std::path::Path;

use planner::analysis::comparison::Comparison;
use planner::geometry::sections::{PathSettings, SectionItem};
use planner::job::gcode::Counters;
use planner::job::machine::{LimitSet, Machine};
use planner::job::program::{StopCause, ToleranceSource};

use super::{points, program};
use crate::args::{self, Ends, JobArgs, Knots};
use crate::failure::Failure;
use crate::json::WayPointsJson;

/// The machine that jobs run on when none is named.
const BUILT_IN: &str = include_str!("../../../jobs/mill3.toml");

/// The sections of a job, in order.
pub(crate) type Stream<'a> = &'a mut (dyn Iterator<Item = Result<SectionItem, Failure>> + Send);

/// What is known of a job besides its sections.
#[derive(Debug)]
pub(crate) struct Told {
    pub(super) counters: Counters,
    pub(super) comparison: Comparison,
    pub(super) stops: BTreeMap<StopCause, u64>,
    pub(super) tolerance: InForce,
    /// Size of the largest figure that standing still is within the tolerance of [mm].
    pub(super) left_out_mm: f64,
    /// `None`: a part program.
    pub(super) points: Option<Points>,
}

impl Told {
    /// Name of the kind of job.
    pub(super) fn kind(&self) -> &'static str {
        if self.points.is_some() { "way-points" } else { "program" }
    }
}

/// What is known of a job of way-points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points {
    pub(super) count: usize,
    pub(super) ends: Ends,
    pub(super) knots: Knots,
    pub(super) geometry_spans: usize,
}

impl Points {
    pub(super) fn json(&self) -> WayPointsJson {
        let (ends, knots) = (args::name(self.ends), args::name(self.knots));
        let geometry_spans = self.geometry_spans as u64;
        WayPointsJson { count: self.count as u64, ends, knots, geometry_spans }
    }
}

/// The largest path tolerance in force, and who set it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct InForce {
    pub(super) mm: f64,
    pub(super) source: Option<ToleranceSource>,
}

impl InForce {
    /// In words.
    pub(super) fn words(self) -> &'static str {
        match self.source {
            Some(ToleranceSource::Program) => "program",
            Some(ToleranceSource::CommandLine) => "command line",
            Some(ToleranceSource::BestSpeed) => "machine, for G64 without P",
            Some(ToleranceSource::Resolution) => "resolution of the way-points",
            Some(ToleranceSource::Machine) | None => "machine",
        }
    }
}

/// The machine of a job.
///
/// # Errors
/// The machine file is not sound.
pub(crate) fn machine(args: &JobArgs) -> Result<Machine, Failure> {
    machine_of(args.machine.as_deref())
}

/// The machine of a file, or the built-in one.
///
/// # Errors
/// The machine file is not sound.
pub(crate) fn machine_of(file: Option<&Path>) -> Result<Machine, Failure> {
    match file {
        Some(path) => Machine::load(path)
            .map_err(|e| placed(e.kind().to_string(), path, e.line(), e.column()).quoting(e)),
        None => Machine::from_toml(BUILT_IN, "built-in machine")
            .map_err(|e| Failure::internal(format!("the built-in machine is not sound: {e}"))),
    }
}

/// Reads a job and hands its sections to `consume`.
///
/// # Errors
/// Bad input, with its place; or what `consume` fails with.
pub(crate) fn read<R>(
    args: &JobArgs,
    machine: &Machine,
    limits: LimitSet,
    consume: impl FnOnce(Stream<'_>) -> Result<R, Failure>,
) -> Result<(R, Told), Failure> {
    args.check()?;
    let settings = PathSettings::of(machine, limits);
    if args.way_points() {
        points::read(args, machine, limits, &settings, consume)
    } else {
        program::read(args, machine, limits, &settings, consume)
    }
}

/// Sets the number of worker threads.
pub(super) fn set_threads(args: &JobArgs) {
    if let Some(threads) = args.threads {
        // Fails only when threads run already, which happens when one process plans twice.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
    }
}

/// Bad input in a file, at a place if that is known.
pub(crate) fn placed(message: String, file: &Path, line: Option<u32>, column: Option<u32>) -> Failure {
    let failure = Failure::input(message);
    match (line, column) {
        (Some(line), column) => failure.at(file, line, column.unwrap_or(1)),
        (None, _) => failure.in_file(file),
    }
}

//! From the command line to a planned job.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::time::Instant;

use planner::job::machine::{LimitSet, Machine};
use planner::pipeline::{self, JobError, JobPlan};
use planner::topp::problem::{JerkForm, Settings, Solver, Windows};
use planner::topp::{PlanError, Relaxed, Relief};

use super::job::{self, Told, placed};
use crate::args::{self, Jerk, JobArgs, PlanArgs};
use crate::failure::Failure;
use crate::progress::Progress;

/// Bytes of a program that are read ahead to tell how long it is.
const READ_AHEAD: usize = 1 << 16;

/// What to do about way-points that no motion can be planned through.
const POINTS_REMEDY: &str = "Check the way-points round this line, --feed, and the axis limits of the machine file; \
                             --knots chord spreads the parameter by distance.";

/// A planned job with everything that is known of it.
#[derive(Debug)]
pub(super) struct Fitted {
    pub(super) machine: Machine,
    pub(super) plan: JobPlan,
    pub(super) told: Told,
    /// How jerk is limited.
    pub(super) jerk: Jerk,
    pub(super) seconds: f64,
}

/// Reads, fits, plans and certifies a job.
///
/// # Errors
/// Bad input, with its place.
pub(super) fn plan(args: &PlanArgs, progress: &mut Progress) -> Result<Fitted, Failure> {
    let begin = Instant::now();
    let jerk = args.jerk_form()?;
    job::set_threads(&args.job);
    let machine = job::machine(&args.job)?;
    progress.stage("planning");
    let lines = if progress.watched() { line_count(&args.job.file) } else { 0 };
    let limits = limits(jerk);
    let (plan, told) = job::read(&args.job, &machine, limits, |sections| {
        pipeline::plan(sections, &machine, limits, &settings(args, jerk), &mut |line| {
            progress.share(f64::from(line) / lines.max(1) as f64);
        })
        .map_err(|e| match e {
            JobError::Section(failure) => failure,
            JobError::Plan { line, fault, relief } => {
                let failure = unplannable(&args.job, line, &fault);
                match relief {
                    Some(relief) => failure.with_help(relaxation(&relief, &machine)),
                    None => failure,
                }
            }
        })
    })?;
    Ok(Fitted { machine, plan, told, jerk, seconds: begin.elapsed().as_secs_f64() })
}

/// The axis limits that count.
pub(super) fn limits(jerk: Jerk) -> LimitSet {
    match jerk {
        Jerk::None => LimitSet::VelocityAcceleration,
        Jerk::True | Jerk::Pseudo => LimitSet::VelocityAccelerationJerk,
    }
}

fn settings(args: &PlanArgs, jerk: Jerk) -> Settings {
    Settings {
        solver: match args.solver {
            args::Solver::InteriorPoint => Solver::InteriorPoint,
            args::Solver::Clarabel => Solver::Clarabel,
        },
        jerk: match jerk {
            Jerk::True | Jerk::None => JerkForm::True,
            Jerk::Pseudo => JerkForm::Pseudo,
        },
        windows: match args.windows {
            args::Windows::Overlap => Windows::Overlap,
            args::Windows::Whole => Windows::Whole,
            args::Windows::Zhao => Windows::Zhao,
        },
        ..Settings::default()
    }
}

/// A section that cannot be planned.
pub(super) fn unplannable(args: &JobArgs, line: u32, fault: &PlanError) -> Failure {
    let help = if args.way_points() { POINTS_REMEDY } else { remedy(fault) };
    placed(fault.to_string(), &args.file, Some(line), None).with_help(help)
}

/// Which limit has to give way, and how far.
fn relaxation(relief: &Relief, machine: &Machine) -> String {
    let what = match relief.limit {
        Relaxed::Feed => "feed".to_owned(),
        Relaxed::Axis(axis, kind) => {
            let name = machine.axes.get(axis).map_or("?", |axis| axis.name.as_str());
            format!("{kind} limit of axis {name}")
        }
    };
    format!(
        "Raise the {what} to {} times what it is: of all changes of a single limit this is the smallest with which the \
         motion can be planned.",
        rounded_up(relief.factor)
    )
}

/// A number above 1 with three digits, none of which is too small.
fn rounded_up(factor: f64) -> f64 {
    let unit = 10f64.powf(factor.log10().floor() - 2.0);
    let digits = if unit < 1.0 { -unit.log10().round() } else { 0.0 };
    let tens = 10f64.powf(digits);
    ((factor / unit).ceil() * unit * tens).round() / tens
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

#[cfg(test)]
mod tests {
    use super::rounded_up;

    #[test]
    fn factors_are_rounded_up_to_three_digits() {
        for (factor, shown) in
            [(1.001, "1.01"), (2.3, "2.3"), (2.301, "2.31"), (99.91, "100"), (1234.0, "1240")]
        {
            assert_eq!(rounded_up(factor).to_string(), shown);
        }
    }
}

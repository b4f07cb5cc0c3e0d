//! What each method asks of the planner, and what it finds.

use std::fmt;
use std::time::Instant;

use planner::feed::job::PlannedSection;
use planner::geometry::section::{FeedCap, SpeedCap};
use planner::job::machine::AxisLimits;
use planner::pipeline::line_of;
use planner::topp::problem::{JerkForm, Problem, RowForm, Settings, Solver, Windows};
use planner::topp::sweep::Sweep;
use planner::topp::{self, PlanError};
use rayon::prelude::*;

use super::{Stretch, Task};
use crate::args::{self, Jerk, Method};
use crate::json::MethodJson;

/// Most runs of a method; the shortest one counts.
const RUNS: u32 = 3;

/// No further run begins after this time [s].
const ENOUGH_S: f64 = 1.0;

/// What a method finds.
pub(super) struct Found {
    /// Shortest run [s].
    pub(super) compute_s: f64,
    /// Time to travel the path [s].
    pub(super) traverse_s: f64,
    /// What it has planned, one per stretch; empty for the sweep.
    pub(super) planned: Vec<PlannedSection>,
    pub(super) iterations: u64,
    /// What the solver left at most [s].
    pub(super) gap_s: f64,
    /// The one speed of the constant feed.
    pub(super) steady: Option<f64>,
}

/// Why a method finds no motion.
pub(super) enum Fault {
    /// The planner says so, at a line of the job.
    Plan(u32, PlanError),
    /// No speed above zero can be held all along.
    NoSteadySpeed,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Fault::Plan(line, fault) => write!(f, "line {line}: {fault}"),
            Fault::NoSteadySpeed => {
                f.write_str("the path turns back on itself: no speed can be held all along")
            }
        }
    }
}

/// What the progress bar shows while a method runs.
pub(super) fn stage(method: Method) -> &'static str {
    match method {
        Method::Whole => "whole",
        Method::Zhao => "zhao",
        Method::Overlap => "overlap",
        Method::ConstantFeed => "constant feed",
        Method::PseudoJerk => "pseudo-jerk",
        Method::NoJerk => "no jerk",
        Method::Sweep => "sweep",
        Method::Clarabel => "clarabel",
        Method::Collocation => "collocation",
    }
}

/// How a method limits jerk.
pub(super) fn jerk(method: Method) -> Jerk {
    match method {
        Method::PseudoJerk => Jerk::Pseudo,
        Method::NoJerk | Method::Sweep => Jerk::None,
        _ => Jerk::True,
    }
}

/// The row of a method before it has run.
pub(super) fn row(method: Method) -> MethodJson {
    let windows = match method {
        Method::Zhao => args::Windows::Zhao,
        Method::Overlap | Method::ConstantFeed => args::Windows::Overlap,
        _ => args::Windows::Whole,
    };
    let solver = match method {
        Method::Clarabel => args::Solver::Clarabel,
        _ => args::Solver::InteriorPoint,
    };
    // The sweep is neither solved nor divided.
    let solved = method != Method::Sweep;
    MethodJson {
        method: args::name(method),
        solver: solved.then(|| args::name(solver)),
        jerk_form: args::name(jerk(method)),
        windows: solved.then(|| args::name(windows)),
        ..MethodJson::default()
    }
}

fn settings(method: Method) -> Settings {
    let whole = Settings { windows: Windows::Whole, ..Settings::default() };
    match method {
        Method::Whole | Method::NoJerk | Method::Sweep => whole,
        Method::Zhao => Settings { windows: Windows::Zhao, ..whole },
        Method::Overlap | Method::ConstantFeed => Settings { windows: Windows::Overlap, ..whole },
        Method::PseudoJerk => Settings { jerk: JerkForm::Pseudo, ..whole },
        Method::Clarabel => Settings { solver: Solver::Clarabel, ..whole },
        Method::Collocation => Settings { rows: RowForm::Collocation, ..whole },
    }
}

/// Runs a method, more than once if that is quick.
pub(super) fn find(method: Method, task: &Task) -> Result<Found, Fault> {
    let begin = Instant::now();
    let mut found = once(method, task)?;
    for _ in 1..RUNS {
        if begin.elapsed().as_secs_f64() > ENOUGH_S {
            break;
        }
        found.compute_s = found.compute_s.min(once(method, task)?.compute_s);
    }
    Ok(found)
}

fn once(method: Method, task: &Task) -> Result<Found, Fault> {
    let begin = Instant::now();
    let settings = settings(method);
    let steady = (method == Method::ConstantFeed).then(|| task.steady_speeds());
    if steady.is_some_and(|speeds| speeds.contains(&0.0)) {
        return Err(Fault::NoSteadySpeed);
    }
    let asked: Vec<Asked> = task.stretches.iter().map(|s| Asked::of(method, s, task, steady)).collect();
    let jobs = task.stretches.par_iter().zip(&asked);
    if method == Method::Sweep {
        let times: Vec<f64> = jobs.map(|(s, asked)| Sweep::new(&asked.problem(s, task)).duration()).collect();
        let (compute_s, traverse_s) = (begin.elapsed().as_secs_f64(), times.iter().sum());
        return Ok(Found {
            compute_s,
            traverse_s,
            planned: Vec::new(),
            iterations: 0,
            gap_s: 0.0,
            steady: None,
        });
    }
    let plans: Vec<_> = jobs.map(|(s, asked)| topp::plan(&asked.problem(s, task), &settings)).collect();
    let mut found = Found {
        compute_s: begin.elapsed().as_secs_f64(),
        traverse_s: 0.0,
        planned: Vec::with_capacity(plans.len()),
        iterations: 0,
        gap_s: 0.0,
        steady: steady.map(|[linear, rotary]| linear.min(rotary)),
    };
    for ((stretch, plan), asked) in task.stretches.iter().zip(plans).zip(asked) {
        let section = &stretch.section;
        let plan = plan.map_err(|fault| Fault::Plan(line_of(&fault, section), fault))?;
        found.traverse_s += plan.table.duration();
        found.iterations += plan.iterations;
        found.gap_s += plan.gap_s;
        let mut marks = section.marks.clone();
        marks.caps = asked.caps;
        let (kind, limits) = (section.kind, asked.limits);
        found.planned.push(PlannedSection { kind, limits, table: plan.table, marks });
    }
    Ok(found)
}

/// The limits and caps that a method is given on a stretch.
struct Asked {
    limits: Vec<AxisLimits>,
    caps: Vec<FeedCap>,
}

impl Asked {
    fn of(method: Method, stretch: &Stretch, task: &Task, steady: Option<[f64; 2]>) -> Self {
        let free = |l: &AxisLimits| AxisLimits { jerk: f64::INFINITY, ..*l };
        let limits = match jerk(method) {
            Jerk::None => stretch.limits.iter().map(free).collect(),
            Jerk::True | Jerk::Pseudo => stretch.limits.clone(),
        };
        let caps = match steady {
            Some(speeds) => {
                let speed = speeds[usize::from(task.rotary_only(stretch))];
                let speed = SpeedCap::Tangential { axes: stretch.counted, speed };
                vec![FeedCap { until: stretch.section.path.grid_length(), speed }]
            }
            None => stretch.section.marks.caps.clone(),
        };
        Self { limits, caps }
    }

    fn problem<'a>(&'a self, stretch: &'a Stretch, task: &Task) -> Problem<'a> {
        Problem {
            path: &stretch.section.path,
            limits: &self.limits,
            caps: &self.caps,
            control_tick_s: task.machine.control_tick_s,
        }
    }
}

//! The crate `copp`, by its public interface.
//!
//! It asks limits to hold at stations only and starts from rest with one interval of constant jerk.

use std::time::Instant;

use clarabel::solver::DefaultSettings;
use copp::diag::CoppError;
use copp::robot::Robot;
use copp::solver::topp2_ra::{ReachSet2OptionsBuilder, Topp2ProblemBuilder, s_to_t_topp2, topp2_ra};
use copp::solver::topp3_lp::{
    ClarabelOptions, ClarabelOptionsBuilder, LinearizationModeTopp3, Topp3ProblemBuilder, Topp3Profile,
    s_to_t_topp3, topp3_lp,
};
use copp::solver::topp3_socp::topp3_socp;
use nalgebra::DMatrix;
use planner::job::machine::AxisLimits;

use crate::sample::Sampled;

/// Steps of re-linearisation after the first.
const MOST_STEPS: usize = 12;
/// Steps end when the time changes by less than this share: ten times what the planner is asked for.
const CONVERGED: f64 = 1e-4;

/// What a run took.
#[derive(Clone, Copy, Debug)]
pub struct Second {
    /// Handing over the path and limits [s].
    pub setup: f64,
    /// Solving [s].
    pub compute: f64,
    /// Traverse time [s].
    pub time: f64,
}

/// What a run under jerk limits took.
#[derive(Clone, Copy, Debug)]
pub struct Third {
    /// Everything after set-up until the first answer [s].
    pub first: f64,
    /// Traverse time of the first answer [s].
    pub first_time: f64,
    /// Until the time no longer changes [s].
    pub converged: f64,
    /// Whether it stopped changing.
    pub settled: bool,
    /// Programmes solved.
    pub steps: usize,
    /// Least traverse time of all steps [s].
    pub time: f64,
}

/// The form of one programme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A linear objective.
    Linear,
    /// Time itself, by second-order cones.
    Conic,
}

/// How the programmes are set.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// Objective.
    pub form: Form,
    /// Clarabel's equilibration, which copp has on by default.
    pub equilibrate: bool,
    /// Rows linearised each at its own place, from the second step on.
    pub adaptive: bool,
}

/// Velocity and acceleration alone.
pub fn second_order(path: &Sampled, limits: &[AxisLimits]) -> Result<Second, CoppError> {
    let begin = Instant::now();
    let robot = robot(path, limits, false)?;
    let setup = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let a = reach(&robot, path.stations.len())?;
    let compute = begin.elapsed().as_secs_f64();
    let (time, _) = s_to_t_topp2(&path.stations, &a, 0.0)?;
    Ok(Second { setup, compute, time })
}

/// With jerk: linearised again and again until the time no longer changes.
pub fn third_order(path: &Sampled, limits: &[AxisLimits], choice: Choice) -> Result<Third, CoppError> {
    let mut robot = robot(path, limits, true)?;
    let defaults = ClarabelOptionsBuilder::new();
    let settings = DefaultSettings { equilibrate_enable: choice.equilibrate, ..defaults.clarabel_settings };
    let options = ClarabelOptionsBuilder::with_clarabel_setting(settings)
        .allow_almost_solved(true)
        .allow_insufficient_progress(true)
        .build()?;
    let begin = Instant::now();
    let start = reach(&robot, path.stations.len())?;
    robot.constraints.amax_substitute(&start, 0)?;
    let mut at: Option<Topp3Profile> = None;
    let mut best =
        Third { first: 0.0, first_time: 0.0, converged: 0.0, settled: false, steps: 0, time: f64::INFINITY };
    let mut last = f64::INFINITY;
    while best.steps <= MOST_STEPS && !best.settled {
        let profile = match step(&mut robot, &start, at.as_ref(), choice, &options) {
            Ok(profile) => profile,
            // A later step may fail: what was found before stands.
            Err(_) if best.steps > 0 => break,
            Err(error) => return Err(error),
        };
        let (time, _) = s_to_t_topp3(&path.stations, profile.as_parts(), 0.0)?;
        best.steps += 1;
        best.converged = begin.elapsed().as_secs_f64();
        if best.steps == 1 {
            (best.first, best.first_time) = (best.converged, time);
        }
        best.settled = (last - time).abs() < CONVERGED * time;
        best.time = best.time.min(time);
        last = time;
        at = Some(profile);
    }
    Ok(best)
}

fn step(
    robot: &mut Robot<usize>,
    start: &[f64],
    at: Option<&Topp3Profile>,
    choice: Choice,
    options: &ClarabelOptions,
) -> Result<Topp3Profile, CoppError> {
    let rest = (0.0, 0.0);
    let problem = match at {
        Some(profile) => {
            let mode = if choice.adaptive {
                LinearizationModeTopp3::GivenFeasibleAdaptive(&profile.b)
            } else {
                LinearizationModeTopp3::Direct
            };
            Topp3ProblemBuilder::new(robot, 0, &profile.a, rest, rest).with_linearization_mode(mode)
        }
        None => Topp3ProblemBuilder::new(robot, 0, start, rest, rest),
    }
    .build_with_linearization()?;
    match choice.form {
        Form::Linear => topp3_lp(&problem, options),
        Form::Conic => topp3_socp(&problem, options),
    }
}

fn reach(robot: &Robot<usize>, stations: usize) -> Result<Vec<f64>, CoppError> {
    let problem = Topp2ProblemBuilder::new(robot, (0, stations - 1), (0.0, 0.0)).build()?;
    topp2_ra(&problem, &ReachSet2OptionsBuilder::new().build()?)
}

fn robot(path: &Sampled, limits: &[AxisLimits], jerk: bool) -> Result<Robot<usize>, CoppError> {
    let n = path.stations.len();
    let matrix = |order: usize| DMatrix::from_column_slice(path.axes, n, &path.derivatives[order]);
    let [q, first, second, third] = [0, 1, 2, 3].map(matrix);
    let third = jerk.then_some(&third);
    let of = |limit: fn(&AxisLimits) -> f64| -> [Vec<f64>; 2] {
        [1.0, -1.0].map(|sign| limits.iter().map(|l| sign * limit(l)).collect())
    };
    let (velocity, acceleration, bend) = (of(|l| l.velocity), of(|l| l.acceleration), of(|l| l.jerk));
    let pair = |[most, least]: &'_ [Vec<f64>; 2]| (most.clone(), least.clone());
    let mut robot = Robot::with_capacity(path.axes, n);
    robot.with_s(path.stations.as_slice())?;
    robot.with_q(
        &q.as_view(),
        &first.as_view(),
        &second.as_view(),
        third.map(|m| m.as_view()).as_ref(),
        0,
    )?;
    let (most, least) = pair(&velocity);
    robot.with_axial_velocity((most.as_slice(), n), (least.as_slice(), n), 0)?;
    let (most, least) = pair(&acceleration);
    robot.with_axial_acceleration((most.as_slice(), n), (least.as_slice(), n), 0)?;
    if jerk {
        let (most, least) = pair(&bend);
        robot.with_axial_jerk((most.as_slice(), n), (least.as_slice(), n), 0)?;
    }
    Ok(robot)
}

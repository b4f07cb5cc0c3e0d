//! Time-optimal path parameterisation: the fastest motion along a path under its limits.
//!
//! [`plan`] sweeps the path for velocity and acceleration ([`sweep`]), places the q knots by the speed found, writes
//! every limit as Bernstein rows in the control values of q, solves for minimum time under true jerk, rounds the
//! control values to the table's codes and checks the rounded values against every row again.

mod attempt;
mod check;
mod clarabel;
mod error;
pub mod horizon;
mod insert;
mod ipm;
mod knots;
mod lanes;
mod layout;
pub mod problem;
mod relief;
mod rest;
pub mod retime;
mod rounding;
mod rows;
mod start;
pub mod sweep;
#[cfg(test)]
mod tests;
mod uneven;
mod window;
mod zhao;

pub use error::{LimitKind, PathFault, PlanError};
pub use relief::{Relaxed, Relief, relief};

use crate::job::machine::AxisLimits;
use crate::tolerances::LARGEST_LIMIT;
use attempt::{Attempt, Solved, joints};
use problem::{Plan, Problem, Settings};
use sweep::Sweep;

/// Solutions on ever finer knots.
const MOST_SOLUTIONS: usize = 6;
/// Rounds of dividing spans where that saves time.
const MOST_ROUNDS: usize = 3;

/// Finds the fastest motion from rest to rest along a path, rounded.
///
/// The rounded table keeps every limit everywhere, by Bernstein bounds. Time and memory grow linearly with the path.
///
/// # Errors
///
/// [`PlanError`] names what makes the problem one without an answer, and where.
pub fn plan(problem: &Problem, settings: &Settings) -> Result<Plan, PlanError> {
    // On a worker of the pool: none of the short passes waits for threads to wake up.
    rayon::scope(|_| plan_whole_up_to(window::WHOLE, problem, settings))
}

/// [`plan`], in windows when there are more than `whole` spans.
fn plan_whole_up_to(whole: usize, problem: &Problem, settings: &Settings) -> Result<Plan, PlanError> {
    error::validate(problem)?;
    validate_settings(settings)?;
    let limits = slowed(problem);
    let problem = &Problem { limits: &limits, ..*problem };
    let sweep = Sweep::new(problem);
    let (mut layout, mut largest_code) = knots::place(problem, settings, &sweep)?;
    let attempt = Attempt { whole, problem, settings, sweep: &sweep };
    let mut iterations = 0;
    // What coarser knots give.
    let (mut coarse, mut rounds): (Option<Plan>, usize) = (None, 0);
    for left in (0..MOST_SOLUTIONS).rev() {
        match attempt.solve(&layout, largest_code, left > 0, &mut iterations) {
            Ok(Solved::Plan(plan, knots)) => {
                let seconds = plan.table.duration();
                let before = coarse.as_ref().map_or(f64::INFINITY, |plan| plan.table.duration());
                if seconds >= before * (1.0 - settings.largest_loss) {
                    coarse = if seconds < before { Some(plan) } else { coarse };
                    break;
                }
                let parts = (rounds < MOST_ROUNDS)
                    .then(|| uneven::parts(problem, settings, &knots, &plan.table))
                    .flatten();
                coarse = Some(plan);
                let Some(Ok(finer)) = parts.map(|parts| knots::refine(problem.path, &knots, &parts)) else {
                    break;
                };
                layout = finer;
                rounds += 1;
            }
            Ok(Solved::Divided(finer)) => layout = finer,
            Err(e) => match coarse {
                Some(_) => break,
                None => return Err(e),
            },
        }
        // Spans that had to be divided are short: finer codes keep rounding from slowing them.
        largest_code = rounding::LONG_CODE;
    }
    match coarse {
        Some(plan) => Ok(Plan { iterations, ..plan }),
        None => Err(PlanError::Resolution { span: 1, u: layout.start(problem.path, 1) }),
    }
}

/// The limits, cut to what the certificate takes at its word, and lowered where they would let speed or acceleration
/// change within so few ticks that no span could follow.
///
/// A move that is over in 8 ticks has its jerk lowered: rest to rest under jerk alone takes T with L = J T^3/32. Full
/// speed takes at least 6 ticks to reach, full acceleration 2. What this costs is a few ticks per move.
fn slowed(problem: &Problem) -> Vec<AxisLimits> {
    const MOVE_TICKS: f64 = 8.0;
    const SPEED_TICKS: f64 = 6.0;
    const ACCELERATION_TICKS: f64 = 2.0;
    let cut = |limit: f64| if limit.is_finite() { limit.min(LARGEST_LIMIT) } else { limit };
    let limits = problem.limits.iter().map(|l| AxisLimits {
        velocity: cut(l.velocity),
        acceleration: cut(l.acceleration),
        jerk: cut(l.jerk),
    });
    let tick = problem.control_tick_s;
    if tick == 0.0 {
        return limits.collect();
    }
    let shortest = MOVE_TICKS * tick;
    limits
        .zip(&problem.path.axes)
        .map(|(l, axis)| {
            let acceleration = l.acceleration.min(l.velocity / (SPEED_TICKS * tick));
            let mut jerk = l.jerk.min(acceleration / (ACCELERATION_TICKS * tick));
            let travel = axis.controls.windows(2).map(|c| c[1].abs_diff(c[0]) as f64).sum::<f64>() * axis.lsb;
            let ruled = 32.0 * travel / shortest.powi(3);
            // Where acceleration saturates under that jerk, the move takes longer anyway.
            if travel > 0.0 && ruled < jerk && 0.25 * shortest * ruled < acceleration {
                jerk = ruled;
            }
            AxisLimits { velocity: l.velocity, acceleration, jerk }
        })
        .collect()
}

fn validate_settings(settings: &Settings) -> Result<(), PlanError> {
    let sound = |v: f64| v > 0.0 && v.is_finite();
    if !sound(settings.relative_gap) {
        return Err(PlanError::Setting { name: "relative_gap", value: settings.relative_gap });
    }
    if !sound(settings.spans_per_ramp) {
        return Err(PlanError::Setting { name: "spans_per_ramp", value: settings.spans_per_ramp });
    }
    if settings.largest_loss.is_nan() || settings.largest_loss < 0.0 {
        return Err(PlanError::Setting { name: "largest_loss", value: settings.largest_loss });
    }
    Ok(())
}

//! Time-optimal path parameterisation: the fastest motion along a path under its limits.
//!
//! [`plan`] sweeps the path for velocity and acceleration ([`sweep`]), places the q knots by the speed found, writes
//! every limit as Bernstein rows in the control values of q, solves for minimum time under true jerk, rounds the
//! control values to the table's codes and checks the rounded values against every row again.

mod check;
mod clarabel;
mod error;
pub mod horizon;
mod ipm;
mod knots;
mod layout;
pub mod problem;
mod rest;
pub mod retime;
mod rounding;
mod rows;
mod start;
pub mod sweep;
#[cfg(test)]
mod tests;
mod window;
mod zhao;

pub use error::{LimitKind, PathFault, PlanError};

use crate::job::machine::AxisLimits;
use layout::{Derivatives, Layout, Pieces, strictest};
use problem::{Plan, Problem, Settings, Solver, Windows};
use rows::RowSource;
use sweep::Sweep;

/// Rounds of dividing spans that the format does not allow.
const MOST_REFINEMENTS: usize = 12;
/// Rounds of making the codes finer at the expense of top speed.
const MOST_RESCALES: usize = 6;
/// Headroom of the codes above the swept q.
const CEILING: f64 = 1.1;

/// What finer codes make of the ceiling: half the top speed makes them twice as fine.
const FINER: f64 = 0.25;

/// Finds the fastest motion from rest to rest along a path, rounded.
///
/// The rounded table keeps every limit everywhere, by Bernstein bounds. Time and memory grow linearly with the path.
///
/// # Errors
///
/// [`PlanError`] names what makes the problem one without an answer, and where.
pub fn plan(problem: &Problem, settings: &Settings) -> Result<Plan, PlanError> {
    plan_whole_up_to(window::WHOLE, problem, settings)
}

/// [`plan`], in windows when there are more than `whole` spans.
fn plan_whole_up_to(whole: usize, problem: &Problem, settings: &Settings) -> Result<Plan, PlanError> {
    error::validate(problem)?;
    validate_settings(settings)?;
    let limits = slowed(problem);
    let problem = &Problem { limits: &limits, ..*problem };
    let sweep = Sweep::new(problem);
    let placed = knots::place(problem, settings, &sweep)?;
    let mut layout = placed.clone();
    let attempt = Attempt { whole, problem, settings, sweep: &sweep };
    let mut iterations = 0;
    // Spans that had to be divided are short: finer codes keep rounding from slowing them.
    let mut largest_code = rounding::SHORT_CODE;
    for _ in 0..MOST_REFINEMENTS {
        let plan = attempt.solve(&layout, largest_code, &mut iterations)?;
        let Some(parts) = check::format(&layout, &plan.table) else {
            return Ok(Plan { iterations, ..plan });
        };
        layout = match knots::refine(problem.path, &layout, &parts) {
            Ok(refined) => refined,
            Err(span) => {
                let fault = format_error(problem, &layout, &plan, span);
                return attempt.gentle(&placed, &mut iterations).ok_or(fault);
            }
        };
        largest_code = rounding::LONG_CODE;
    }
    let plan = attempt.solve(&layout, largest_code, &mut iterations)?;
    match check::format(&layout, &plan.table) {
        None => Ok(Plan { iterations, ..plan }),
        Some(parts) => {
            let span = parts.iter().position(|&p| p > 1).unwrap_or(0);
            let fault = format_error(problem, &layout, &plan, span);
            attempt.gentle(&placed, &mut iterations).ok_or(fault)
        }
    }
}

/// The limits, lowered where they would let speed or acceleration change within so few ticks that no span could
/// follow.
///
/// A move that is over in 8 ticks has its jerk lowered: rest to rest under jerk alone takes T with L = J T^3/32. Full
/// speed takes at least 6 ticks to reach, full acceleration 2. What this costs is a few ticks per move.
fn slowed(problem: &Problem) -> Vec<AxisLimits> {
    const MOVE_TICKS: f64 = 8.0;
    const SPEED_TICKS: f64 = 6.0;
    const ACCELERATION_TICKS: f64 = 2.0;
    let tick = problem.control_tick_s;
    if tick == 0.0 {
        return problem.limits.to_vec();
    }
    let shortest = MOVE_TICKS * tick;
    problem
        .limits
        .iter()
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

fn format_error(problem: &Problem, layout: &Layout, plan: &Plan, span: usize) -> PlanError {
    let u = layout.start(problem.path, span);
    let seconds = plan.table.law(span).duration();
    if seconds >= 1.0 { PlanError::Slow { span, u, seconds } } else { PlanError::Uneven { span, u } }
}

fn validate_settings(settings: &Settings) -> Result<(), PlanError> {
    let sound = |v: f64| v > 0.0 && v.is_finite();
    if !sound(settings.relative_gap) {
        return Err(PlanError::Setting { name: "relative_gap", value: settings.relative_gap });
    }
    if !sound(settings.spans_per_ramp) {
        return Err(PlanError::Setting { name: "spans_per_ramp", value: settings.spans_per_ramp });
    }
    Ok(())
}

/// What one solution after another is found from.
struct Attempt<'a> {
    whole: usize,
    problem: &'a Problem<'a>,
    settings: &'a Settings,
    sweep: &'a Sweep,
}

impl Attempt<'_> {
    /// Solves on given knots, rounds and checks.
    fn solve(&self, layout: &Layout, largest_code: f64, iterations: &mut u64) -> Result<Plan, PlanError> {
        let problem = self.problem;
        let unit = self.sweep.top();
        let mut refined = layout.clone();
        if self.settings.windows == Windows::Zhao {
            zhao::refine(&mut refined, &self.swept(layout));
        }
        let layout = &refined;
        let joints = joints(problem, layout);
        let mut source =
            RowSource { problem: *problem, layout, unit, ceiling: CEILING, joint: joints, largest_code };
        let mut worst = 1;
        for _ in 0..MOST_RESCALES {
            source.joint = joints.map(|q| (q / unit).min(source.ceiling));
            let scale = rounding::scale(&source);
            let half = rounding::halves(&source, scale, self.sweep);
            if let Some(x) = self.optimise(&source, &half, iterations) {
                let table = rounding::table(&source, scale, &x);
                let rounded = rounding::values(&source, &table);
                let findings = check::rows(&source, &rounded, &half);
                if findings.worst <= 1.0 + crate::tolerances::ROW_ARITHMETIC {
                    return Ok(Plan { table, binding: findings.binding, iterations: 0 });
                }
                worst = findings.span;
            }
            // Rounding alone breaks a limit: the codes are too coarse for the slowest places.
            if source.largest_code < rounding::LONG_CODE {
                source.largest_code = rounding::LONG_CODE;
            } else {
                source.ceiling *= FINER;
            }
        }
        Err(PlanError::Resolution { span: worst, u: layout.start(problem.path, worst) })
    }

    /// A plan between the smooth start and the fastest motion, as near the latter as limits and format allow: for
    /// paths on which the fastest motion changes its speed more sharply than spans can follow.
    fn gentle(&self, layout: &Layout, iterations: &mut u64) -> Option<Plan> {
        const SHARES: [f64; 7] = [0.9, 0.75, 0.5, 0.25, 0.1, 0.03, 0.0];
        const SCALINGS: usize = 40;
        let unit = self.sweep.top();
        let joint = joints(self.problem, layout).map(|q| (q / unit).min(CEILING));
        let (problem, largest_code) = (*self.problem, rounding::LONG_CODE);
        let source = RowSource { problem, layout, unit, ceiling: CEILING, joint, largest_code };
        let scale = rounding::scale(&source);
        let half = rounding::halves(&source, scale, self.sweep);
        let sound = |x: &[f64]| {
            let table = rounding::table(&source, scale, x);
            let findings = check::rows(&source, &rounding::values(&source, &table), &half);
            let keeps = findings.worst <= 1.0 + crate::tolerances::ROW_ARITHMETIC;
            let plan = Plan { table, binding: findings.binding, iterations: 0 };
            (keeps && check::format(layout, &plan.table).is_none()).then_some(plan)
        };
        let mut slow = start::profile(&source);
        let slowest = (0..SCALINGS).find_map(|_| {
            let plan = sound(&slow);
            if plan.is_none() {
                slow.iter_mut().for_each(|x| *x *= 0.8);
            }
            plan
        })?;
        let fast = self.optimise(&source, &half, iterations).unwrap_or_else(|| slow.clone());
        let between = |share: f64| -> Vec<f64> {
            slow.iter().zip(&fast).map(|(slow, fast)| slow + share * (fast - slow)).collect()
        };
        let plan = SHARES.iter().find_map(|&share| sound(&between(share))).unwrap_or(slowest);
        Some(Plan { iterations: *iterations, ..plan })
    }

    /// Largest swept q on each span.
    fn swept(&self, layout: &Layout) -> Vec<f64> {
        let path = self.problem.path;
        let mut hint = 0;
        (0..layout.spans())
            .map(|i| self.sweep.largest(layout.start(path, i), layout.start(path, i + 1), &mut hint))
            .collect()
    }

    /// Control values of minimum time; `None` where rounding alone would break a limit at any speed.
    fn optimise(&self, source: &RowSource, half: &[f64], iterations: &mut u64) -> Option<Vec<f64>> {
        let mut x = start::profile(source);
        let gap = self.settings.relative_gap;
        match self.settings.solver {
            Solver::InteriorPoint => {
                *iterations += match self.settings.windows {
                    Windows::Whole => window::solve(source, &mut x, half, gap, usize::MAX)?,
                    Windows::Overlap => window::solve(source, &mut x, half, gap, self.whole)?,
                    Windows::Zhao => zhao::solve(source, &mut x, half, gap)?,
                }
            }
            Solver::Clarabel => {
                let mut swept = self.swept(source.layout);
                swept.iter_mut().for_each(|q| *q /= source.unit);
                let inner = &swept[1..swept.len() - 1];
                let (answer, count) = clarabel::solve(source, inner, &x, half, gap)?;
                *iterations += count;
                x = answer;
            }
        }
        Some(x)
    }
}

/// Bounds on q at the joints with both rest spans.
fn joints(problem: &Problem, layout: &Layout) -> [f64; 2] {
    let path = problem.path;
    let mut pieces = Pieces::new(path);
    let n = layout.spans();
    [0, n - 1].map(|i| {
        let g = layout.geometry[i] as usize;
        let offset = (layout.knots[i] - path.breaks[g]) as f64 * path.step;
        let derivatives: Vec<Derivatives> = pieces
            .at(g)
            .iter()
            .map(|p| {
                let d = Derivatives::of(p, offset, layout.h[i]);
                if i == 0 { d } else { d.reversed() }
            })
            .collect();
        let caps = strictest(problem.caps, layout.knots[i], layout.knots[i + 1]);
        rest::joint_bound(layout.h[i], &derivatives, problem.limits, &caps, problem.control_tick_s)
    })
}

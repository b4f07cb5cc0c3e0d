//! Time-optimal path parameterisation: the fastest motion along a path under its limits.
//!
//! [`plan`] sweeps the path for velocity and acceleration ([`sweep`]), places the q knots by the speed found, writes
//! every limit as Bernstein rows in the control values of q, solves for minimum time under true jerk, rounds the
//! control values to the table's codes and checks the rounded values against every row again.

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

use crate::feed::table::FeedTable;
use crate::job::machine::AxisLimits;
use crate::tolerances::LARGEST_LIMIT;
use layout::{Derivatives, Layout, Pieces, strictest};
use problem::{Plan, Problem, Settings, Solver, Windows};
use rows::RowSource;
use sweep::Sweep;

/// Solutions on ever finer knots.
const MOST_SOLUTIONS: usize = 6;
/// Rounds of dividing the spans of one solution.
const MOST_DIVISIONS: usize = 48;
/// Shares of q that are tried when the rounding on divided spans takes a little more than what was set aside for it.
const SLOWER: [f64; 3] = [1.0, 0.9999, 0.999];
/// Rounds of making the codes finer at the expense of top speed.
const MOST_RESCALES: usize = 6;
/// Headroom of the codes above the swept q.
const CEILING: f64 = 1.1;

/// Rounds of dividing spans where that saves time.
const MOST_ROUNDS: usize = 2;
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
    let (placed, mut largest_code) = knots::place(problem, settings, &sweep)?;
    let mut layout = placed.clone();
    let attempt = Attempt { whole, problem, settings, sweep: &sweep };
    let mut iterations = 0;
    let mut fault = None;
    // What coarse knots give.
    let (mut coarse, mut rounds): (Option<Plan>, usize) = (None, 0);
    for _ in 0..MOST_SOLUTIONS {
        layout = match attempt.solve(&layout, largest_code, &mut iterations) {
            Ok(Solved::Plan(plan)) => {
                let seconds = plan.table.duration();
                let before = coarse.as_ref().map_or(f64::INFINITY, |plan| plan.table.duration());
                if seconds >= before * (1.0 - settings.largest_loss) {
                    return Ok(Plan {
                        iterations,
                        ..if seconds < before { plan } else { coarse.unwrap_or(plan) }
                    });
                }
                let step = f64::from(plan.table.q_scale).sqrt();
                let parts = if rounds < MOST_ROUNDS {
                    uneven::parts(problem, settings, &layout, &plan.table, step)
                } else {
                    None
                };
                let Some(Ok(finer)) = parts.map(|parts| knots::refine(problem.path, &layout, &parts)) else {
                    return Ok(Plan { iterations, ..plan });
                };
                rounds += 1;
                coarse = Some(plan);
                finer
            }
            Ok(Solved::Divided(finer)) => finer,
            Ok(Solved::Indivisible(e)) => {
                fault = Some(e);
                break;
            }
            Err(e) => match coarse {
                Some(plan) => return Ok(Plan { iterations, ..plan }),
                None => return Err(e),
            },
        };
        // Spans that had to be divided are short: finer codes keep rounding from slowing them.
        largest_code = rounding::LONG_CODE;
    }
    if let Some(plan) = coarse {
        return Ok(Plan { iterations, ..plan });
    }
    let uneven = PlanError::Uneven { span: 0, u: 0.0 };
    attempt.gentle(&placed, &mut iterations).ok_or(fault.unwrap_or(uneven))
}

/// The limits, cut to what the certificate takes at its word, and lowered where they would let speed or acceleration change within so few ticks that no span could
/// follow.
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

/// What became of a solution.
enum Solved {
    /// It is a plan.
    Plan(Plan),
    /// It has to be found anew on finer knots.
    Divided(Layout),
    /// Its spans must be divided further than the grid allows.
    Indivisible(PlanError),
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
    fn solve(&self, layout: &Layout, largest_code: f64, iterations: &mut u64) -> Result<Solved, PlanError> {
        let problem = self.problem;
        let unit = self.sweep.top();
        let mut refined = layout.clone();
        if self.settings.windows == Windows::Zhao {
            zhao::refine(&mut refined, &self.swept(layout));
        }
        let layout = &refined;
        let joints = joints(problem, layout);
        let swept = self.swept(layout);
        let mut source = self.source(layout, &swept, joints, largest_code);
        let mut worst = 1;
        for _ in 0..MOST_RESCALES {
            source.joint = joints.map(|q| (q / unit).min(source.ceiling));
            let scale = rounding::scale(&source);
            let half = rounding::halves(&source, scale, self.sweep);
            if let Some((x, gap_s)) = self.optimise(&source, &half, iterations) {
                let table = rounding::table(&source, scale, &x);
                if let Some(parts) = check::format(layout, &table) {
                    eprintln!(
                        "DBG format {} spans, {} to divide, first {:?} rest {} {} code {}",
                        layout.spans(),
                        parts.iter().filter(|&&p| p > 1).count(),
                        parts.iter().position(|&p| p > 1),
                        parts[0],
                        parts[parts.len() - 1],
                        source.largest_code
                    );
                    return Ok(self.divided(&source, x, gap_s, parts));
                }
                match self.checked(&source, &half, table) {
                    Ok(plan) => return Ok(Solved::Plan(Plan { gap_s, ..plan })),
                    Err(span) => {
                        eprintln!(
                            "DBG rows broken at {span} of {} code {}",
                            layout.spans(),
                            source.largest_code
                        );
                        worst = span
                    }
                }
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

    /// The plan of a rounded table that keeps every row, or the span that breaks one.
    fn checked(&self, source: &RowSource, half: &[f64], table: FeedTable) -> Result<Plan, usize> {
        let findings = check::rows(source, &rounding::values(source, &table), half);
        if findings.worst <= 1.0 + crate::tolerances::ROW_ARITHMETIC {
            Ok(Plan { table, binding: findings.binding, iterations: 0, gap_s: f64::INFINITY })
        } else {
            Err(findings.span)
        }
    }

    /// The same motion on knots as fine as the format asks for, in the finest codes.
    fn divided(&self, source: &RowSource, mut x: Vec<f64>, gap_s: f64, mut parts: Vec<u32>) -> Solved {
        let path = self.problem.path;
        let last = parts.len() - 1;
        let fault = |layout: &Layout, span: usize, table: &FeedTable| {
            let (u, seconds) = (layout.start(path, span), table.law(span).duration());
            Solved::Indivisible(match seconds >= 1.0 {
                true => PlanError::Slow { span, u, seconds },
                false => PlanError::Uneven { span, u },
            })
        };
        let mut layout = source.layout.clone();
        let source = RowSource { largest_code: rounding::LONG_CODE, ..source.clone() };
        if parts[0] > 1 || parts[last] > 1 {
            // A rest span has no parts: the motion next to it becomes another.
            return match knots::refine(path, &layout, &parts) {
                Ok(finer) => Solved::Divided(finer),
                Err(span) => fault(&layout, span, &rounding::table(&source, rounding::scale(&source), &x)),
            };
        }
        for _ in 0..MOST_DIVISIONS {
            let coarse = RowSource { layout: &layout, ..source.clone() };
            (layout, x) = match insert::insert(&coarse, &x, &parts) {
                Ok(finer) => finer,
                Err(span) => {
                    return fault(&layout, span, &rounding::table(&coarse, rounding::scale(&coarse), &x));
                }
            };
            let swept = self.swept(&layout);
            let fine = RowSource { layout: &layout, swept: &swept, ..source.clone() };
            let scale = rounding::scale(&fine);
            if let Some(more) = check::format(&layout, &rounding::table(&fine, scale, &x)) {
                parts = more;
                continue;
            }
            let half = rounding::halves(&fine, scale, self.sweep);
            let slower = SLOWER.iter().find_map(|share| {
                let slower: Vec<f64> = x.iter().map(|x| x * share).collect();
                let table = rounding::table(&fine, scale, &slower);
                let sound = check::format(&layout, &table).is_none();
                self.checked(&fine, &half, table).ok().filter(|_| sound)
            });
            return slower.map_or(Solved::Divided(layout), |plan| Solved::Plan(Plan { gap_s, ..plan }));
        }
        Solved::Divided(layout)
    }

    /// A plan between the smooth start and the fastest motion, as near the latter as limits and format allow: for
    /// paths on which the fastest motion changes its speed more sharply than spans can follow.
    fn gentle(&self, layout: &Layout, iterations: &mut u64) -> Option<Plan> {
        const SHARES: [f64; 7] = [0.9, 0.75, 0.5, 0.25, 0.1, 0.03, 0.0];
        const SCALINGS: usize = 40;
        let unit = self.sweep.top();
        let joint = joints(self.problem, layout).map(|q| (q / unit).min(CEILING));
        let swept = self.swept(layout);
        let source = self.source(layout, &swept, joint, rounding::LONG_CODE);
        let scale = rounding::scale(&source);
        let half = rounding::halves(&source, scale, self.sweep);
        let sound = |x: &[f64]| {
            let table = rounding::table(&source, scale, x);
            let findings = check::rows(&source, &rounding::values(&source, &table), &half);
            let keeps = findings.worst <= 1.0 + crate::tolerances::ROW_ARITHMETIC;
            let plan = Plan { table, binding: findings.binding, iterations: 0, gap_s: f64::INFINITY };
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
        let fast = self.optimise(&source, &half, iterations).map_or_else(|| slow.clone(), |(x, _)| x);
        let between = |share: f64| -> Vec<f64> {
            slow.iter().zip(&fast).map(|(slow, fast)| slow + share * (fast - slow)).collect()
        };
        let plan = SHARES.iter().find_map(|&share| sound(&between(share))).unwrap_or(slowest);
        Some(Plan { iterations: *iterations, ..plan })
    }

    /// What rows are made from on given knots.
    fn source<'s>(
        &'s self,
        layout: &'s Layout,
        swept: &'s [f64],
        joint: [f64; 2],
        largest_code: f64,
    ) -> RowSource<'s> {
        let Settings { jerk, rows: form, .. } = *self.settings;
        let (problem, unit) = (*self.problem, self.sweep.top());
        RowSource {
            problem,
            layout,
            unit,
            ceiling: CEILING,
            joint,
            largest_code,
            swept,
            jerk,
            form,
            bends: true,
        }
    }

    /// Largest swept x on each inner span.
    fn swept(&self, layout: &Layout) -> Vec<f64> {
        let (path, unit) = (self.problem.path, self.sweep.top());
        let mut hint = 0;
        (1..layout.spans() - 1)
            .map(|i| {
                let (from, to) = (layout.start(path, i), layout.start(path, i + 1));
                self.sweep.largest(from, to, &mut hint) / unit
            })
            .collect()
    }

    /// Control values of minimum time, and how far above the optimum they may be [s]; `None` where rounding alone
    /// would break a limit at any speed.
    fn optimise(&self, source: &RowSource, half: &[f64], iterations: &mut u64) -> Option<(Vec<f64>, f64)> {
        let gap = self.settings.relative_gap;
        start::candidates(source).into_iter().find_map(|start::Start { mut x, bends }| {
            let source = &RowSource { bends, ..source.clone() };
            let (x, gap, count) = match self.settings.solver {
                Solver::InteriorPoint => {
                    let total = match self.settings.windows {
                        Windows::Whole => window::solve(source, &mut x, half, gap, usize::MAX)?,
                        Windows::Overlap => window::solve(source, &mut x, half, gap, self.whole)?,
                        Windows::Zhao => zhao::solve(source, &mut x, half, gap)?,
                    };
                    (x, total.gap, total.iterations)
                }
                Solver::Clarabel => {
                    let answer = clarabel::solve(source, &x, half, gap)?;
                    (answer.x, answer.gap, answer.iterations)
                }
            };
            *iterations += count;
            Some((x, gap / source.unit.sqrt()))
        })
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

//! One window of the receding horizon.

use super::draft::Draft;
use super::solve::Window;
use super::speeds::{braking, swept};
use super::{Commit, Deadline, Horizon, Stop};
use crate::feed::table::FeedTable;
use crate::geometry::grid_path::GridPath;
use crate::topp::problem::{JerkForm, Problem, RowForm, Settings};
use crate::topp::rows::RowSource;
use crate::topp::sweep::Sweep;
use crate::topp::{PlanError, error, joints, knots, rounding};

/// Braking distances beyond the improved stretch: at the crawl on knots that stay, and on knots that serve to stop.
const CRAWL_LENGTH: f64 = 0.5;
const STOP_LENGTH: f64 = 1.5;
/// Braking distances of path kept before the commitment, for the sweep to gather speed on.
const CONTEXT: f64 = 1.5;
/// Geometry spans and q spans kept before the commitment: the first ones only stand in for the path.
const CONTEXT_GEOMETRY: usize = 4;
const CONTEXT_SPANS: usize = 4;
/// A window of fewer spans is made longer by this factor unless it ends the path.
const LEAST_SPANS: usize = 24;
const LONGER: f64 = 1.6;
/// Rounds of dividing spans that the format does not allow.
const MOST_DIVISIONS: usize = 10;
/// Rounds in which they are divided for the sake of the fastest motion; a slower one must do after that.
const SOLVED_DIVISIONS: usize = 4;

/// How far a window goes [grid steps from the first kept place].
struct Reach {
    /// Where knots stop being lasting.
    lasting: u64,
    /// Where the improved stretch ends.
    improved: u64,
    /// How much is to be committed.
    commit: u64,
    /// Where its motion ends.
    end: u64,
}

/// See [`Horizon::advance`].
pub(super) fn advance(horizon: &mut Horizon, deadline: Deadline) -> Result<Option<Commit>, PlanError> {
    let from = horizon.draft.knots[horizon.committed];
    let origin = horizon.arrived.origin();
    let last_end = horizon.arrived.last_end();
    let needed = horizon.settings.lookahead + horizon.settings.advance + CRAWL_LENGTH + STOP_LENGTH;
    // As much path as the latest braking distance asks for.
    let wanted = (origin + from + horizon.steps(needed)).max(horizon.end);
    let mut end = horizon.arrived.breaks.partition_point(|&b| b < wanted).min(last_end);
    let limits = horizon.limits.clone();
    // Where spans are long, braking distances hold too few of them.
    let mut longer = 1.0;
    loop {
        if horizon.arrived.breaks[end] <= origin + from {
            return Ok(None);
        }
        let (path, caps) = horizon.arrived.up_to(end);
        let control_tick_s = horizon.control_tick_s;
        let problem = Problem { path: &path, limits: &limits, caps: &caps, control_tick_s };
        error::validate(&problem)?;
        let sweep = Sweep::new(&problem);
        horizon.braking = braking(&problem, &sweep);
        let whole = horizon.arrived.finished && end == last_end;
        match reach(horizon, &path, from, whole, longer) {
            Ok(reach) => {
                let commit = improve(horizon, &problem, &sweep, &reach, deadline)?;
                if commit.is_some() {
                    return Ok(commit);
                }
                longer *= LONGER;
            }
            Err(missing) if end == last_end => {
                horizon.wanted = origin + path.grid_length() + missing;
                return Ok(None);
            }
            Err(_) => end = (end + 1 + end / 4).min(last_end),
        }
    }
}

/// How far a window on `path` goes that starts at `from`; the error is how many grid steps of path are missing.
fn reach(horizon: &Horizon, path: &GridPath, from: u64, whole: bool, longer: f64) -> Result<Reach, u64> {
    let end = path.grid_length();
    let [ahead, advance] =
        [horizon.settings.lookahead, horizon.settings.advance].map(|d| horizon.steps(longer * d));
    let target = from + ahead + advance;
    // What would be left over is no window of its own.
    if whole && end <= target + ahead.max(horizon.steps(CRAWL_LENGTH)) {
        return Ok(Reach { lasting: end, improved: end, commit: end, end });
    }
    let lasting = if whole {
        end
    } else {
        // Rounding bends the last two spans.
        let unbent = path.breaks[path.spans().saturating_sub(2)];
        end.saturating_sub(horizon.steps(STOP_LENGTH)).min(unbent)
    };
    let improvable = lasting.saturating_sub(horizon.steps(CRAWL_LENGTH));
    if target > improvable {
        return Err(target - improvable);
    }
    Ok(Reach { lasting, improved: target, commit: target - ahead, end })
}

impl Horizon {
    /// Braking distances in grid steps.
    fn steps(&self, distances: f64) -> u64 {
        (distances * self.braking / self.arrived.step).ceil().max(1.0) as u64
    }
}

/// Improves the window and commits.
fn improve(
    horizon: &mut Horizon,
    problem: &Problem,
    sweep: &Sweep,
    reach: &Reach,
    deadline: Deadline,
) -> Result<Option<Commit>, PlanError> {
    let settings = Settings { spans_per_ramp: horizon.settings.spans_per_ramp, ..Settings::default() };
    let (placed, _) = knots::place(problem, &settings, sweep)?;
    let mut draft = horizon.draft.continued(problem.path, &placed, reach.lasting);
    let mut iterations = 0;
    for round in 0..MOST_DIVISIONS {
        let layout = draft.layout(problem.path);
        let n = layout.spans();
        let ceiling = horizon.settings.headroom * horizon.settings.headroom;
        let swept = swept(problem, &layout, sweep, horizon.unit);
        let source = RowSource {
            problem: *problem,
            layout: &layout,
            unit: horizon.unit,
            ceiling,
            joint: joints(problem, &layout).map(|q| (q / horizon.unit).min(ceiling)),
            largest_code: rounding::LONG_CODE,
            swept: &swept,
            jerk: JerkForm::True,
            form: RowForm::Bernstein,
            bends: false,
        };
        let until = |place: u64| layout.knots.partition_point(|&k| k <= place) - 1;
        let complete = reach.commit == reach.end;
        if !complete && until(reach.improved).min(n - 2) < horizon.committed + LEAST_SPANS {
            return Ok(None);
        }
        let commit = if complete { n } else { until(reach.commit).clamp(horizon.committed + 2, n - 3) };
        let improved = if complete { n } else { until(reach.improved).clamp(commit + 1, n - 2) };
        let window =
            Window { source: &source, sweep, draft: &draft, committed: horizon.committed, commit, improved };
        let start = window.begin(horizon);
        // Most spans that the format does not allow are at the crawl: no need to solve before dividing them.
        let slow = start.at(0.0);
        if let Some(parts) = window.divided(&rounding::table(&source, horizon.q_scale, &slow)) {
            let fault = |span| PlanError::Uneven { span, u: layout.start(problem.path, span) };
            draft.divide(&source, &parts, horizon.committed).map_err(fault)?;
            continue;
        }
        let (fast, count) = window.solve(horizon, &start, deadline);
        iterations += count;
        if round < SOLVED_DIVISIONS {
            let parts = window.divided(&rounding::table(&source, horizon.q_scale, &fast));
            let mut finer = draft.clone();
            if parts.is_some_and(|parts| finer.divide(&source, &parts, horizon.committed).is_ok()) {
                draft = finer;
                continue;
            }
        }
        let (table, carried) = window.gentlest(horizon, &slow, &fast)?;
        let stop = horizon.stop(&table, commit, problem.path, reach.end);
        let origin = horizon.arrived.origin();
        let first = horizon.committed;
        let result = Commit {
            steps: table.steps[first..commit].to_vec(),
            codes: table.codes[first.max(1) - 1..(commit - 1).min(n - 2)].to_vec(),
            until: origin + if complete { reach.end } else { layout.knots[commit - 1] },
            stop,
            iterations,
            window: improved.min(n - 1) - first,
            complete,
        };
        let kept = draft.lasting.min(n - 1);
        let carried = carried[..kept.max(commit.min(n - 1))].to_vec();
        // An earlier window may have gone further.
        draft.improved = improved.max(draft.improved).min(carried.len());
        horizon.draft = Draft { carried, ..draft };
        (horizon.committed, horizon.complete) = (commit, complete);
        horizon.end = origin + reach.end;
        if !complete {
            horizon.forget();
        }
        return Ok(Some(result));
    }
    Err(PlanError::Uneven {
        span: horizon.committed,
        u: horizon.draft.knots[horizon.committed] as f64 * problem.path.step,
    })
}

impl Horizon {
    /// The spans after the committed ones.
    fn stop(&self, table: &FeedTable, commit: usize, path: &GridPath, end: u64) -> Stop {
        let n = table.spans();
        let controls = path.axes.iter().map(|a| [2, 1].map(|k| a.controls[a.controls.len() - k])).collect();
        let end = self.arrived.origin() + end;
        if commit == n {
            return Stop { steps: Vec::new(), codes: Vec::new(), end, controls };
        }
        Stop {
            steps: table.steps[commit..].to_vec(),
            codes: table.codes[commit - 1..].to_vec(),
            end,
            controls,
        }
    }

    /// Drops what no later window looks at.
    fn forget(&mut self) {
        let origin = self.arrived.origin();
        let at = self.draft.knots[self.committed].saturating_sub(self.steps(CONTEXT));
        let geometry = self.arrived.breaks.partition_point(|&b| b - origin <= at);
        let Some(first) = geometry.checked_sub(1 + CONTEXT_GEOMETRY).filter(|&g| g > 0) else { return };
        let place = self.arrived.breaks[first] - origin;
        let spans = self.draft.knots.partition_point(|&k| k < place);
        if spans + CONTEXT_SPANS > self.committed {
            return;
        }
        self.arrived.forget(first);
        let draft = &mut self.draft;
        draft.knots.drain(..spans);
        draft.knots.iter_mut().for_each(|k| *k -= place);
        draft.cells.drain(..spans);
        draft.carried.drain(..spans);
        draft.improved -= spans;
        draft.lasting -= spans;
        self.committed -= spans;
    }
}

//! One window of the receding horizon.

use super::draft::Draft;
use super::{Commit, Deadline, Horizon, Stop};
use crate::feed::table::FeedTable;
use crate::geometry::grid_path::GridPath;
use crate::tolerances::ROW_ARITHMETIC;
use crate::topp::ipm::{START_SLACK, Stretch};
use crate::topp::problem::{Problem, Settings};
use crate::topp::rows::RowSource;
use crate::topp::sweep::Sweep;
use crate::topp::{PlanError, check, error, joints, knots, rounding, start};

/// Braking distances beyond the improved stretch: at the crawl on knots that stay, and on knots that serve to stop.
const CRAWL_LENGTH: f64 = 0.5;
const STOP_LENGTH: f64 = 1.0;
/// Largest q of the crawl, as a share of the largest q swept.
const CRAWL: f64 = 0.02;
/// Braking distances of path kept before the commitment, for the sweep to gather speed on.
const CONTEXT: f64 = 1.5;
/// Geometry spans and q spans kept before the commitment: the first ones only stand in for the path.
const CONTEXT_GEOMETRY: usize = 4;
const CONTEXT_SPANS: usize = 4;
/// What a window leaves below every limit beyond its commitment, for the next one to start well inside.
const MARGIN: f64 = 5e-3;
/// Shares by which an earlier window's motion is drawn towards the crawl, so that its rows have some slack, and of
/// the margin, as they are tried.
const STARTS: [[f64; 2]; 5] = [[4e-3, 1.0], [1e-3, 1.0], [4e-3, 0.2], [4e-3, 0.0], [0.0, 0.0]];
/// Share of the limits that the crawl uses to gain speed after the motion carried.
const GAIN: f64 = 0.1;
/// Reductions of the crawl that are tried, by a fifth each.
const CRAWLS: usize = 30;
/// Least length over which the crawl begins to gain speed, in spans.
const BEND_SPANS: f64 = 2.0;
/// Rounds of dividing spans that the format does not allow.
const MOST_DIVISIONS: usize = 8;

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
    let wanted = origin + from + horizon.steps(needed);
    let mut end = horizon.arrived.breaks.partition_point(|&b| b < wanted).min(last_end);
    let limits = horizon.limits.clone();
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
        match reach(horizon, &path, from, whole) {
            Ok(reach) => return improve(horizon, &problem, &sweep, &reach, deadline).map(Some),
            Err(missing) if end == last_end => {
                horizon.wanted = origin + path.grid_length() + missing;
                return Ok(None);
            }
            Err(_) => end = (end + 1 + end / 4).min(last_end),
        }
    }
}

/// Longest distance from the fastest motion to rest, in u.
fn braking(problem: &Problem, sweep: &Sweep) -> f64 {
    let slowest = problem
        .limits
        .iter()
        .zip(sweep.top_speeds(problem))
        .filter(|(_, top)| *top > 0.0)
        .map(|(l, top)| top / l.acceleration + l.acceleration / l.jerk)
        .fold(0.0, f64::max);
    0.5 * sweep.top().sqrt() * slowest
}

/// How far a window on `path` goes that starts at `from`; the error is how many grid steps of path are missing.
fn reach(horizon: &Horizon, path: &GridPath, from: u64, whole: bool) -> Result<Reach, u64> {
    let end = path.grid_length();
    let HorizonSettingsLengths { ahead, advance } = horizon.lengths();
    let target = from + ahead + advance;
    if whole && end <= target + ahead {
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

/// Lookahead and advance [grid steps].
pub(super) struct HorizonSettingsLengths {
    ahead: u64,
    advance: u64,
}

impl Horizon {
    /// Braking distances in grid steps.
    fn steps(&self, distances: f64) -> u64 {
        (distances * self.braking / self.arrived.step).ceil().max(1.0) as u64
    }

    fn lengths(&self) -> HorizonSettingsLengths {
        HorizonSettingsLengths {
            ahead: self.steps(self.settings.lookahead),
            advance: self.steps(self.settings.advance),
        }
    }
}

/// Improves the window and commits.
fn improve(
    horizon: &mut Horizon,
    problem: &Problem,
    sweep: &Sweep,
    reach: &Reach,
    deadline: Deadline,
) -> Result<Commit, PlanError> {
    let settings = Settings { spans_per_ramp: horizon.settings.spans_per_ramp, ..Settings::default() };
    let placed = knots::place(problem, &settings, sweep)?;
    let mut draft = horizon.draft.continued(problem.path, &placed, reach.lasting);
    let mut iterations = 0;
    for _ in 0..MOST_DIVISIONS {
        let layout = draft.layout(problem.path);
        let n = layout.spans();
        let ceiling = horizon.settings.headroom * horizon.settings.headroom;
        let source = RowSource {
            problem: *problem,
            layout: &layout,
            unit: horizon.unit,
            ceiling,
            joint: joints(problem, &layout).map(|q| (q / horizon.unit).min(ceiling)),
            largest_code: rounding::LONG_CODE,
        };
        let until = |place: u64| layout.knots.partition_point(|&k| k <= place) - 1;
        let complete = reach.commit == reach.end;
        let commit = if complete { n } else { until(reach.commit).clamp(horizon.committed + 2, n - 3) };
        let improved = if complete { n } else { until(reach.improved).clamp(commit + 1, n - 2) };
        let window =
            Window { source: &source, sweep, draft: &draft, committed: horizon.committed, commit, improved };
        let start = window.begin(horizon);
        // Most spans that the format does not allow are at the crawl: no need to solve before dividing them.
        let mut table = rounding::table(&source, horizon.q_scale, &start.at(0.0));
        let mut parts = window.divided(&table);
        let mut x = Vec::new();
        if parts.is_none() {
            let (answer, count) = window.solve(horizon, &start, deadline);
            x = answer;
            iterations += count;
            table = rounding::table(&source, horizon.q_scale, &x);
            parts = window.divided(&table);
        }
        if let Some(parts) = parts {
            let fault = |span| PlanError::Uneven { span, u: layout.start(problem.path, span) };
            draft.divide(&source, &parts, horizon.committed).map_err(fault)?;
            continue;
        }
        let carried = window.rounded(horizon, &table, &x)?;
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
        draft.improved = improved.min(carried.len());
        horizon.draft = Draft { carried, ..draft };
        (horizon.committed, horizon.complete) = (commit, complete);
        if !complete {
            horizon.forget();
        }
        return Ok(result);
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

/// One window on given knots. Span numbers count from the first kept span; control value j of x is that of span j + 1.
struct Window<'a> {
    source: &'a RowSource<'a>,
    sweep: &'a Sweep,
    draft: &'a Draft,
    /// Spans that are final, that are to become final, and up to which motion is improved.
    committed: usize,
    commit: usize,
    improved: usize,
}

/// Where the improvement of a window begins.
struct Start<'a> {
    draft: &'a Draft,
    committed: usize,
    commit: usize,
    half: Vec<f64>,
    crawl: Vec<f64>,
}

impl Start<'_> {
    /// The motion carried, drawn a little towards the crawl after the commitment, and the crawl after it.
    fn at(&self, drawn: f64) -> Vec<f64> {
        let Draft { carried, improved, .. } = self.draft;
        let blend = |(j, &slow): (usize, &f64)| {
            let i = j + 1;
            let Some(&fast) = carried.get(i) else { return slow };
            let drawn =
                if i < self.committed { 0.0 } else { drawn * share(i + 1, self.committed, self.commit) };
            let left = share(i, *improved, carried.len()).max(drawn);
            (1.0 - left) * fast + left * slow
        };
        self.crawl.iter().enumerate().map(blend).collect()
    }
}

/// Smooth share of the way of `i` between two numbers.
fn share(i: usize, from: usize, to: usize) -> f64 {
    let t = (i.saturating_sub(from) as f64 / to.saturating_sub(from).max(1) as f64).min(1.0);
    t * t * (3.0 - 2.0 * t)
}

impl<'a> Window<'a> {
    /// First control value that may move.
    fn from(&self) -> usize {
        self.committed.max(1) - 1
    }

    /// A start for this window, as fast a crawl as is feasible.
    fn begin(&self, horizon: &mut Horizon) -> Start<'a> {
        let source = self.source;
        let m = source.layout.unknowns();
        let mut half = rounding::halves(source, horizon.q_scale, self.sweep);
        half[..self.from()].fill(0.0);
        let (draft, committed, commit) = (self.draft, self.committed, self.commit);
        let mut start = Start { draft, committed, commit, half, crawl: Vec::new() };
        let mut crawl = start::profile(&RowSource {
            ceiling: (CRAWL * self.sweep.top() / source.unit).min(source.ceiling),
            ..source.clone()
        });
        let work = &mut horizon.work;
        let beyond = Stretch { from: draft.improved.max(1) - 1, to: m };
        for _ in 0..CRAWLS {
            start.crawl = self.gaining(&crawl);
            let x = start.at(0.0);
            // The motion carried ends with next to no slack: only what follows it is scaled.
            work.load(source, &x, &start.half, beyond, |_| 0.0);
            if work.settle() > if beyond.from == 0 { START_SLACK } else { 0.0 } {
                break;
            }
            crawl.iter_mut().for_each(|q| *q *= 0.8);
        }
        start
    }

    /// The crawl, gaining speed gently from where the motion carried ends: q = q0 (1 + (d/D)^2)^(2/3) becomes
    /// the launch under a share of the jerk limit, u = J t^3/6.
    fn gaining(&self, crawl: &[f64]) -> Vec<f64> {
        let (source, carried) = (self.source, &self.draft.carried);
        let Some(&slow) = carried.last().filter(|_| carried.len() > 1) else { return crawl.to_vec() };
        let q = slow * source.unit;
        let top = self.sweep.top().sqrt();
        let share = |limit: f64, speed: f64| GAIN * limit * top / speed;
        let speeds = self.sweep.top_speeds(&source.problem);
        let distance = source
            .problem
            .limits
            .iter()
            .zip(speeds)
            .filter(|(_, speed)| *speed > 0.0)
            .map(|(l, v)| (q.powf(1.5) / (4.5 * share(l.jerk, v))).sqrt().max(q / share(l.acceleration, v)))
            // Spans laid out for more speed cannot follow a sharper bend of q.
            .fold(BEND_SPANS * source.layout.h[carried.len()], f64::max);
        let knots = &source.layout.knots;
        let from = knots[carried.len()];
        let gain = |(j, &crawl): (usize, &f64)| {
            let d = knots[j + 1].saturating_sub(from) as f64 * source.problem.path.step / distance;
            let gained = slow * (1.0 + d * d).powf(2.0 / 3.0);
            (crawl.powi(-4) + gained.powi(-4)).powf(-0.25)
        };
        crawl.iter().enumerate().map(gain).collect()
    }

    /// What has to be divided before the format allows the motion.
    fn divided(&self, table: &FeedTable) -> Option<Vec<u32>> {
        let parts = check::format(self.source.layout, table)?;
        parts[self.committed..].iter().any(|&p| p > 1).then_some(parts)
    }

    /// Control values of the window, and the iterations they took.
    fn solve(&self, horizon: &mut Horizon, start: &Start, deadline: Deadline) -> (Vec<f64>, u32) {
        let source = self.source;
        let m = source.layout.unknowns();
        let free = Stretch { from: self.from(), to: (self.improved - 1).min(m) };
        let work = &mut horizon.work;
        work.deadline = deadline;
        for [drawn, share] in STARTS {
            let mut x = start.at(drawn);
            let margin =
                |s: usize| if s + 2 >= self.commit && self.commit < m { share * MARGIN } else { 0.0 };
            work.load(source, &x, &start.half, free, margin);
            if work.settle() > 0.0 {
                let iterations = work.solve(horizon.settings.relative_gap);
                if iterations > 0 {
                    x[free.from..free.to].copy_from_slice(&work.moved());
                }
                return (x, iterations);
            }
        }
        (start.at(0.0), 0)
    }

    /// The control values as carried to the next window, those committed rounded; proves the rounded motion.
    fn rounded(&self, horizon: &mut Horizon, table: &FeedTable, x: &[f64]) -> Result<Vec<f64>, PlanError> {
        let m = x.len();
        let mut rounded = rounding::values(self.source, table);
        let pinned = self.committed.max(1) - 1;
        rounded[..pinned].copy_from_slice(&x[..pinned]);
        let work = &mut horizon.work;
        work.load(self.source, &rounded, &vec![0.0; m], Stretch { from: pinned, to: m }, |_| 0.0);
        if work.settle() < -ROW_ARITHMETIC {
            let span = self.committed;
            return Err(PlanError::Resolution {
                span,
                u: self.source.layout.start(self.source.problem.path, span),
            });
        }
        let value = |i: usize| match i {
            0 => 0.0,
            i if i < self.commit => rounded[i - 1],
            i => x[i - 1],
        };
        Ok((0..=m).map(value).collect())
    }
}

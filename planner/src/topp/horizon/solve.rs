//! The motion of one window on given knots.

use super::draft::Draft;
use super::speeds::tops;
use super::{Deadline, Horizon};
use crate::feed::table::FeedTable;
use crate::tolerances::ROW_ARITHMETIC;
use crate::topp::ipm::{START_SLACK, Stretch};
use crate::topp::rows::RowSource;
use crate::topp::sweep::Sweep;
use crate::topp::{PlanError, check, rounding, start};

/// Largest q of the crawl, as a share of the largest q swept.
const CRAWL: f64 = 0.2;
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
/// Shares of the way from a slow to a fast motion, as they are tried.
const SHARES: [f64; 6] = [1.0, 0.9, 0.6, 0.3, 0.1, 0.0];

/// One window on given knots. Span numbers count from the first kept span; control value j of x is that of span j + 1.
pub(super) struct Window<'a> {
    pub(super) source: &'a RowSource<'a>,
    pub(super) sweep: &'a Sweep,
    pub(super) draft: &'a Draft,
    /// Spans that are final, that are to become final, and up to which motion is improved.
    pub(super) committed: usize,
    pub(super) commit: usize,
    pub(super) improved: usize,
}

/// Where the improvement of a window begins.
pub(super) struct Start<'a> {
    draft: &'a Draft,
    committed: usize,
    commit: usize,
    half: Vec<f64>,
    crawl: Vec<f64>,
}

impl Start<'_> {
    /// The motion carried, drawn a little towards the crawl after the commitment, and the crawl after it.
    pub(super) fn at(&self, drawn: f64) -> Vec<f64> {
        let Draft { carried, improved, .. } = self.draft;
        let blend = |(j, &slow): (usize, &f64)| {
            let i = j + 1;
            let Some(&fast) = carried.get(i) else { return slow };
            let drawn =
                if i < self.committed { 0.0 } else { drawn * share(i + 1, self.committed, self.commit) };
            // Motion carried up to the end of the path needs nothing to go on with.
            let crawling =
                if carried.len() > self.crawl.len() { 0.0 } else { share(i, *improved, carried.len()) };
            let left = crawling.max(drawn);
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
    pub(super) fn begin(&self, horizon: &mut Horizon) -> Start<'a> {
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
        let fastest = crawl.clone();
        for _ in 0..CRAWLS {
            start.crawl = self.gaining(&crawl);
            let x = start.at(0.0);
            // The motion carried ends with next to no slack: only what follows it is scaled.
            work.load(source, &x, &start.half, beyond, |_| 0.0);
            if work.settle() > if beyond.from == 0 { START_SLACK } else { 0.0 } {
                return start;
            }
            crawl.iter_mut().for_each(|q| *q *= 0.8);
        }
        // It is not the crawl that is too fast: what the rounded motion amounts to decides.
        start.crawl = self.gaining(&fastest);
        start
    }

    /// The crawl, gaining speed gently from where the motion carried ends: q = q0 (1 + (d/D)^2)^(2/3) becomes
    /// the launch under a share of the jerk limit, u = J t^3/6.
    fn gaining(&self, crawl: &[f64]) -> Vec<f64> {
        let (source, carried) = (self.source, &self.draft.carried);
        let (Some(&slow), Some(h)) =
            (carried.get(1..).and_then(<[f64]>::last), source.layout.h.get(carried.len()))
        else {
            return crawl.to_vec();
        };
        let q = slow * source.unit;
        let top = self.sweep.top().sqrt();
        let share = |limit: f64, speed: f64| GAIN * limit * top / speed;
        let speeds = tops(&source.problem, self.sweep);
        let distance = source
            .problem
            .limits
            .iter()
            .zip(speeds)
            .filter(|(_, speed)| *speed > 0.0)
            .map(|(l, v)| (q.powf(1.5) / (4.5 * share(l.jerk, v))).sqrt().max(q / share(l.acceleration, v)))
            // Spans laid out for more speed cannot follow a sharper bend of q.
            .fold(BEND_SPANS * h, f64::max);
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
    pub(super) fn divided(&self, table: &FeedTable) -> Option<Vec<u32>> {
        let parts = check::format(self.source.layout, table)?;
        parts[self.committed..].iter().any(|&p| p > 1).then_some(parts)
    }

    /// Control values of the window, and the iterations they took.
    pub(super) fn solve(&self, horizon: &mut Horizon, start: &Start, deadline: Deadline) -> (Vec<f64>, u32) {
        let source = self.source;
        let m = source.layout.unknowns();
        let free = Stretch { from: self.from(), to: (self.improved - 1).min(m) };
        let work = &mut horizon.work;
        work.deadline = deadline;
        // Where the start bends no more than the format allows, neither will the answer.
        let bending = [true, false].map(|bends| RowSource { bends, ..source.clone() });
        for [drawn, share] in STARTS {
            let mut x = start.at(drawn);
            let margin =
                |s: usize| if s + 2 >= self.commit && self.commit < m { share * MARGIN } else { 0.0 };
            for source in &bending {
                work.load(source, &x, &start.half, free, margin);
                if work.settle() <= 0.0 {
                    continue;
                }
                let iterations = work.solve(horizon.settings.relative_gap).iterations;
                if iterations > 0 {
                    x[free.from..free.to].copy_from_slice(&work.moved());
                }
                return (x, iterations);
            }
        }
        (start.at(0.0), 0)
    }

    /// The fastest motion between a slow one that keeps the format and a fast one that the format allows, rounded;
    /// and its control values as [`Self::rounded`] gives them.
    pub(super) fn gentlest(
        &self,
        horizon: &mut Horizon,
        slow: &[f64],
        fast: &[f64],
    ) -> Result<(FeedTable, Vec<f64>), PlanError> {
        let mut fault = None;
        // What is committed keeps its speed if slowing down more gently after it is enough.
        let gentler = SHARES.map(|left| [1.0, left]);
        for [before, after] in gentler.into_iter().chain(SHARES.map(|left| [left, left])) {
            let x: Vec<f64> = (1..)
                .zip(slow.iter().zip(fast))
                .map(|(i, (s, f))| {
                    let left = before + (after - before) * share(i, self.commit, self.improved);
                    s + left * (f - s)
                })
                .collect();
            let table = rounding::table(self.source, horizon.q_scale, &x);
            if before > 0.0 && self.divided(&table).is_some() {
                continue;
            }
            match self.rounded(horizon, &table, &x) {
                Ok(carried) => return Ok((table, carried)),
                Err(e) => fault = Some(e),
            }
        }
        let u = self.source.layout.start(self.source.problem.path, self.committed);
        Err(fault.unwrap_or(PlanError::Resolution { span: self.committed, u }))
    }

    /// The control values as carried to the next window, those committed rounded; proves the rounded motion.
    pub(super) fn rounded(
        &self,
        horizon: &mut Horizon,
        table: &FeedTable,
        x: &[f64],
    ) -> Result<Vec<f64>, PlanError> {
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

//! The feasible-start interior-point method: minimum time under every row, weights, tangents and barrier moving
//! together. Every iterate satisfies every row strictly, so any of them is a plan.

mod band;
mod block;
mod part;
#[cfg(test)]
mod tests;

use self::band::Band;
use self::part::{Loading, Parts};
use super::horizon::Deadline;
use super::rows::RowSource;

/// Share of the Hessian of the time that joins the barrier's (0 diverges on some problems, 1 is slow).
const CURVATURE: f64 = 0.3;
/// Share of the way to the boundary a step may go.
const TO_BOUNDARY: f64 = 0.98;
/// Share of itself a control value may lose in one step, so that q never reaches zero.
const MOST_LOSS: f64 = 0.9;
/// Least barrier reduction per iteration.
const LEAST_CENTRING: f64 = 1e-5;
/// Least gap to begin with, as a share of the time: a start that lies at its limits looks better than it is, and would
/// stay there for many iterations.
const LEAST_START: f64 = 0.4;
/// Gap, in wanted gaps, within which iterations that gain next to nothing end the run, and what next to nothing is, in
/// wanted gaps too.
const NEARLY: f64 = 10.0;
const NO_GAIN: f64 = 0.1;
/// Most iterations; runs end after 13 to 30.
const MOST_ITERATIONS: u32 = 80;
/// Least slack a start is scaled down to.
pub(super) const START_SLACK: f64 = 0.02;
/// Slack of a jerk row beyond which a better tangent is not looked for.
const ENOUGH: f64 = 0.1;
/// Most reductions of a start, by a fifth each.
const SCALINGS: u32 = 60;

/// A stretch of control values to improve while its surroundings stand still.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    /// First control value that may move.
    pub(super) from: usize,
    /// One past the last.
    pub(super) to: usize,
}

/// One problem in memory; reused from stretch to stretch.
#[derive(Clone, Debug, Default)]
pub(super) struct Workspace {
    parts: Parts,
    /// Local control values: one more on either side than spans.
    c: Vec<f64>,
    best: Vec<f64>,
    /// First inner span.
    first: usize,
    /// Local range of the control values that may move.
    free: [usize; 2],
    /// Rest spans: local control value and 3 u1 sqrt(fold), so that T = weight/sqrt(c).
    rests: Vec<(usize, f64)>,
    band: Band,
    gradient: Vec<f64>,
    push: Vec<f64>,
    correction: Vec<f64>,
    affine: Vec<f64>,
    dc: Vec<f64>,
    /// When to stop early.
    pub(super) deadline: Deadline,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Run {
    /// Iterations it took.
    pub(super) iterations: u32,
    /// What the best iterate can at most be above the optimum of its stretch, as the kernel counts time.
    pub(super) gap: f64,
}

impl Workspace {
    /// Loads the rows that control values `stretch` take part in. `half` bounds the rounding of each control value;
    /// `margin(s)` is subtracted from the right-hand sides of inner span s.
    pub(super) fn load(
        &mut self,
        source: &RowSource,
        x: &[f64],
        half: &[f64],
        stretch: Stretch,
        margin: impl Fn(usize) -> f64 + Sync,
    ) {
        let m = x.len();
        self.first = stretch.from.saturating_sub(1);
        let end = (stretch.to + 1).min(m);
        let count = end - self.first;
        self.free = [stretch.from - self.first + 1, stretch.to - self.first + 1];
        self.c.clear();
        self.c.extend((self.first..end + 2).map(|j| if j == 0 || j > m { 1.0 } else { x[j - 1] }));
        self.parts.load(count, &Loading { source, half, margin, first: self.first });
        self.rests.clear();
        let (h, fold) = (&source.layout.h, source.fold());
        if self.first == 0 {
            self.rests.push((1, 3.0 * h[0] * fold[0].sqrt()));
        }
        if end == m {
            self.rests.push((count, 3.0 * h[m + 1] * fold[1].sqrt()));
        }
    }

    /// Whether other windows keep all threads busy, so that passes over this one need not be divided among them.
    pub(super) fn share_threads(&mut self, with_others: bool) {
        self.parts.in_turn = with_others;
    }

    /// Scales the loaded profile down until its least slack is comfortable, pinned neighbours too, and returns the
    /// scale; `None` where that never happens.
    pub(super) fn scale_into(&mut self) -> Option<f64> {
        let mut scale = 1.0;
        for _ in 0..SCALINGS {
            if self.settle() > START_SLACK {
                return Some(scale);
            }
            scale *= 0.8;
            self.c.iter_mut().for_each(|c| *c *= 0.8);
        }
        None
    }

    /// Sets the tangents for the loaded profile and returns their least slack.
    pub(super) fn settle(&mut self) -> f64 {
        self.parts.settle(&self.c)
    }

    /// The control values that could move, as the best iterate has them.
    pub(super) fn moved(&self) -> Vec<f64> {
        self.best[self.free[0]..self.free[1]].to_vec()
    }

    /// The time of the loaded profile.
    #[cfg(test)]
    fn total_time(&mut self) -> f64 {
        let time = self.parts.time(&self.c, &mut self.gradient);
        self.with_rests(time)
    }

    /// Takes the rest spans into a time and its gradient; returns the time with them.
    fn with_rests(&mut self, mut time: f64) -> f64 {
        for &(j, weight) in &self.rests {
            let x = self.c[j];
            let t = weight / x.sqrt();
            time += t;
            self.gradient[j] -= 0.5 * t / x;
            self.band.band[j][0] += CURVATURE * 0.75 * t / (x * x);
        }
        time
    }

    /// Improves the loaded profile until the gap is below a share of the time. Every iterate keeps every row; the best
    /// is kept.
    pub(super) fn solve(&mut self, relative_gap: f64) -> Run {
        // On a worker of the pool, which does not sleep between the passes.
        rayon::scope(|_| self.iterate(relative_gap))
    }

    fn iterate(&mut self, relative_gap: f64) -> Run {
        let [lo, hi] = self.free;
        self.best.clone_from(&self.c);
        let (mut best_time, mut last_time) = (f64::INFINITY, f64::INFINITY);
        let mut idle = 0;
        let mut dual_step = 0.0;
        let rows = self.parts.rows();
        self.band.reset(self.c.len());
        let time = self.parts.time(&self.c, &mut self.gradient);
        let time = self.with_rests(time);
        let balance = -(lo..hi).map(|j| self.gradient[j] * self.c[j]).sum::<f64>();
        let mu = balance / self.parts.push_back(&self.c).max(f64::MIN_POSITIVE);
        let mu = mu.max(LEAST_START * time / rows);
        let mut run = Run { iterations: 0, gap: time };
        if !(mu.is_finite() && mu > 0.0) {
            return run;
        }
        self.parts.set_multipliers(&self.c, mu);
        for iteration in 0..MOST_ITERATIONS {
            run.iterations = iteration;
            let Self { parts, c, band, gradient, push, .. } = &mut *self;
            let [time, gap] = parts.normal(c, dual_step, band, gradient, push);
            let time = self.with_rests(time);
            let wanted = relative_gap * time;
            idle = if gap < NEARLY * wanted && time > best_time - NO_GAIN * wanted { idle + 1 } else { 0 };
            if time < best_time {
                best_time = time;
                run.gap = gap;
                self.best.clone_from(&self.c);
            }
            if self.deadline.passed(iteration) {
                return run;
            }
            if idle == 2 || (gap < wanted && (time - last_time).abs() < wanted) {
                return run;
            }
            last_time = time;
            let Some([primal, dual]) = self.step(gap, rows) else {
                return run;
            };
            (lo..hi).for_each(|j| self.c[j] += primal * self.dc[j]);
            dual_step = dual;
        }
        run
    }

    /// Predictor and corrector [Mehrotra1992]: fills `dc`, returns primal and dual step lengths.
    fn step(&mut self, gap: f64, rows: f64) -> Option<[f64; 2]> {
        let [lo, hi] = self.free;
        let n = self.c.len();
        self.band.factorise(lo, hi);
        self.affine.clear();
        self.affine.resize(n, 0.0);
        (lo..hi).for_each(|j| self.affine[j] = -self.gradient[j]);
        self.band.solve(lo, hi, &mut self.affine);
        let affine = self.parts.affine(&self.c, &self.affine, &mut self.correction);
        let primal = (1.0 / affine.rise).min(1.0);
        let dual = (1.0 / (1.0 - affine.fall)).min(1.0);
        let (s1, s2) = (affine.s1, affine.s2);
        let after = gap + dual * (s1 - gap) - primal * s1 + primal * dual * (s1 - s2);
        let centring = (after.max(0.0) / gap).powi(3).clamp(LEAST_CENTRING, 1.0);
        let mu = centring * gap / rows;
        self.dc.clear();
        self.dc.resize(n, 0.0);
        for j in lo..hi {
            self.dc[j] = -self.gradient[j] - mu * self.push[j] + self.correction[j];
        }
        self.band.solve(lo, hi, &mut self.dc);
        let [rise, fall] = self.parts.combined(&self.c, &self.affine, &self.dc, mu);
        let shrink = (lo..hi).map(|j| -self.dc[j] / self.c[j]).fold(0.0, f64::max);
        let primal = (TO_BOUNDARY / rise).min(MOST_LOSS / shrink).min(1.0);
        let dual = (TO_BOUNDARY / fall).min(1.0);
        let sound = primal.is_finite() && dual.is_finite() && self.dc[lo..hi].iter().all(|d| d.is_finite());
        sound.then_some([primal, dual])
    }
}

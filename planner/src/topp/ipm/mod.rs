//! The feasible-start interior-point method: minimum time under every row, weights, tangents and barrier moving
//! together. Every iterate satisfies every row strictly, so any of them is a plan.

mod band;
mod block;
#[cfg(test)]
mod tests;

use pulp::{Arch, Simd, WithSimd};

use self::band::Band;
use self::block::Rows;
use super::horizon::Deadline;
use super::lanes::{LANES, Lanes, product, scaled, totals};
use super::rows::{CellRows, RowBuilder, RowSource};

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

/// Gauss points of one span side by side, as rows of its three control values, and h times their weights.
#[derive(Clone, Debug)]
struct SpanTime {
    a: [Lanes; 3],
    weight: Lanes,
}

/// One problem in memory; reused from stretch to stretch.
#[derive(Clone, Debug, Default)]
pub(super) struct Workspace {
    rows: Rows,
    cell: CellRows,
    spans: Vec<SpanTime>,
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
        margin: impl Fn(usize) -> f64,
    ) {
        let m = x.len();
        self.first = stretch.from.saturating_sub(1);
        let end = (stretch.to + 1).min(m);
        let count = end - self.first;
        self.free = [stretch.from - self.first + 1, stretch.to - self.first + 1];
        self.c.clear();
        self.c.extend((self.first..end + 2).map(|j| if j == 0 || j > m { 1.0 } else { x[j - 1] }));
        self.rows.clear();
        self.spans.clear();
        Arch::new().dispatch(Load { work: self, source, half, margin, end });
        self.rests.clear();
        let (h, fold) = (&source.layout.h, source.fold());
        if self.first == 0 {
            self.rests.push((1, 3.0 * h[0] * fold[0].sqrt()));
        }
        if end == m {
            self.rests.push((count, 3.0 * h[m + 1] * fold[1].sqrt()));
        }
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
        Arch::new().dispatch(Settle { work: self })
    }

    /// The control values that could move, as the best iterate has them.
    pub(super) fn moved(&self) -> Vec<f64> {
        self.best[self.free[0]..self.free[1]].to_vec()
    }

    /// Gradient of the time, its curvature added to the band; returns the time.
    #[inline(always)]
    fn time(&mut self) -> f64 {
        let mut time = Lanes::ZERO;
        self.gradient.clear();
        self.gradient.resize(self.c.len(), 0.0);
        for (i, span) in self.spans.iter().enumerate() {
            let c = [self.c[i], self.c[i + 1], self.c[i + 2]];
            let x = product(&span.a, &c);
            let t = span.weight / x.sqrt();
            time += t;
            let slope = t / x;
            let bend = slope / x * (CURVATURE * 0.75);
            let a = &span.a;
            let b = scaled(a, bend);
            let g = totals(&scaled(a, slope));
            self.gradient[i..i + 3].iter_mut().zip(g).for_each(|(sum, g)| *sum -= 0.5 * g);
            let m = [
                (b[0] * a[0]).total(),
                (b[0] * a[1]).total(),
                (b[0] * a[2]).total(),
                (b[1] * a[1]).total(),
                (b[1] * a[2]).total(),
                (b[2] * a[2]).total(),
            ];
            self.band.add(i, &m);
        }
        let mut time = time.total();
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
        Arch::new().dispatch(Solve { work: self, relative_gap })
    }

    #[inline(always)]
    fn iterate(&mut self, relative_gap: f64) -> Run {
        let n = self.c.len();
        let [lo, hi] = self.free;
        self.best.clone_from(&self.c);
        let (mut best_time, mut last_time) = (f64::INFINITY, f64::INFINITY);
        let mut idle = 0;
        let mut dual_step = 0.0;
        let rows = self.rows.count();
        self.band.reset(n);
        let time = self.time();
        let balance = -(lo..hi).map(|j| self.gradient[j] * self.c[j]).sum::<f64>();
        let mu = balance / self.rows.push_back(&self.c).max(f64::MIN_POSITIVE);
        let mu = mu.max(LEAST_START * time / rows);
        let mut run = Run { iterations: 0, gap: time };
        if !(mu.is_finite() && mu > 0.0) {
            return run;
        }
        self.rows.set_multipliers(&self.c, mu);
        for iteration in 0..MOST_ITERATIONS {
            run.iterations = iteration;
            self.band.reset(n);
            let time = self.time();
            self.push.clear();
            self.push.resize(n, 0.0);
            let gap = self.rows.normal(&self.c, dual_step, &mut self.band, &mut self.push);
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
    #[inline(always)]
    fn step(&mut self, gap: f64, rows: f64) -> Option<[f64; 2]> {
        let [lo, hi] = self.free;
        let n = self.c.len();
        self.band.factorise(lo, hi);
        self.affine.clear();
        self.affine.resize(n, 0.0);
        (lo..hi).for_each(|j| self.affine[j] = -self.gradient[j]);
        self.band.solve(lo, hi, &mut self.affine);
        self.correction.clear();
        self.correction.resize(n, 0.0);
        let affine = self.rows.affine(&self.c, &self.affine, &mut self.correction);
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
        let [rise, fall] = self.rows.combined(&self.c, &self.affine, &self.dc, mu);
        let shrink = (lo..hi).map(|j| -self.dc[j] / self.c[j]).fold(0.0, f64::max);
        let primal = (TO_BOUNDARY / rise).min(MOST_LOSS / shrink).min(1.0);
        let dual = (TO_BOUNDARY / fall).min(1.0);
        let sound = primal.is_finite() && dual.is_finite() && self.dc[lo..hi].iter().all(|d| d.is_finite());
        sound.then_some([primal, dual])
    }
}

/// Loading, with the vector instructions of the machine.
struct Load<'w, 's, 'a, M> {
    work: &'w mut Workspace,
    source: &'s RowSource<'a>,
    half: &'s [f64],
    margin: M,
    /// One past the last inner span.
    end: usize,
}

impl<M: Fn(usize) -> f64> WithSimd for Load<'_, '_, '_, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Workspace { rows, spans, cell, first, .. } = self.work;
        let (source, m) = (self.source, self.half.len());
        let mut builder = RowBuilder::new(source);
        for (at, s) in (*first..self.end).enumerate() {
            let mut half = [0.0; 3];
            for (j, half) in (s..).zip(&mut half) {
                if (1..=m).contains(&j) {
                    *half = self.half[j - 1];
                }
            }
            let margin = (self.margin)(s);
            for k in 0..usize::from(source.layout.cells[s + 1]) {
                builder.cell(s, k, cell);
                rows.push(at, cell, &half, margin);
            }
            spans.push(SpanTime::new(source.layout.h[s + 1], &source.bezier(s)));
        }
    }
}

/// Setting tangents, with the vector instructions of the machine.
struct Settle<'w> {
    work: &'w mut Workspace,
}

impl WithSimd for Settle<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let Workspace { rows, c, .. } = self.work;
        rows.set_tangents(c, ENOUGH)
    }
}

/// Solving, with the vector instructions of the machine.
struct Solve<'w> {
    work: &'w mut Workspace,
    relative_gap: f64,
}

impl WithSimd for Solve<'_> {
    type Output = Run;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Run {
        self.work.iterate(self.relative_gap)
    }
}

impl SpanTime {
    #[inline(always)]
    fn new(h: f64, b: &[[f64; 3]; 3]) -> Self {
        const WEIGHTS: [f64; LANES] = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0, 0.0];
        /// sqrt(0.15), the distance of the outer points from the middle.
        const ROOT: f64 = 0.387_298_334_620_741_7;
        const POINTS: [f64; LANES] = [0.5 - ROOT, 0.5, 0.5 + ROOT, 0.5];
        let mut out = SpanTime { a: [Lanes::ZERO; 3], weight: Lanes::ZERO };
        for l in 0..LANES {
            let t = POINTS[l];
            let w = [(1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t];
            for (j, a) in out.a.iter_mut().enumerate() {
                a.0[l] = w[0] * b[0][j] + w[1] * b[1][j] + w[2] * b[2][j];
            }
            out.weight.0[l] = WEIGHTS[l] * h;
        }
        out
    }
}

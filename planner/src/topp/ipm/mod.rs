//! The feasible-start interior-point method: minimum time under every row, weights, tangents and barrier moving
//! together. Every iterate satisfies every row strictly, so any of them is a plan.

mod band;
mod block;

use self::band::Band;
use self::block::{Affine, Rows};
use super::horizon::Deadline;
use super::layout::Pieces;
use super::rows::{CellRows, RowSource, dot};

/// Share of the Hessian of the time that joins the barrier's (0 diverges on some problems, 1 is slow).
const CURVATURE: f64 = 0.3;
/// Share of the way to the boundary a step may go.
const TO_BOUNDARY: f64 = 0.98;
/// Share of itself a control value may lose in one step, so that q never reaches zero.
const MOST_LOSS: f64 = 0.9;
/// Least barrier reduction per iteration.
const LEAST_CENTRING: f64 = 1e-5;
/// Most iterations; runs end after 13 to 30.
const MOST_ITERATIONS: u32 = 80;
/// Least slack a start is scaled down to.
pub(super) const START_SLACK: f64 = 0.02;
/// Most reductions of a start, by a fifth each.
pub(super) const SCALINGS: u32 = 60;

/// A stretch of control values to improve while its surroundings stand still.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    /// First control value that may move.
    pub(super) from: usize,
    /// One past the last.
    pub(super) to: usize,
}

/// Gauss points of one span, as rows of its three control values.
#[derive(Clone, Debug)]
struct SpanTime {
    h: f64,
    points: [[f64; 3]; 3],
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
    dc: Vec<f64>,
    /// When to stop early.
    pub(super) deadline: Deadline,
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
        let get = |v: &[f64], j: usize| if j == 0 || j > m { 0.0 } else { v[j - 1] };
        self.c.clear();
        self.c.extend((self.first..end + 2).map(|j| if j == 0 || j > m { 1.0 } else { x[j - 1] }));
        self.rows.clear();
        self.spans.clear();
        let mut pieces = Pieces::new(source.problem.path);
        for (at, s) in (self.first..end).enumerate() {
            let half = [get(half, s), get(half, s + 1), get(half, s + 2)];
            for cell in 0..usize::from(source.layout.cells[s + 1]) {
                source.cell(s, cell, &mut pieces, &mut self.cell);
                self.rows.push(at, &self.cell, &half, 1.0 - margin(s));
            }
            self.spans.push(SpanTime { h: source.layout.h[s + 1], points: gauss(&source.bezier(s)) });
        }
        self.rests.clear();
        let (h, fold) = (&source.layout.h, source.fold());
        if self.first == 0 {
            self.rests.push((1, 3.0 * h[0] * fold[0].sqrt()));
        }
        if end == m {
            self.rests.push((count, 3.0 * h[m + 1] * fold[1].sqrt()));
        }
    }

    /// Scales the loaded profile down until its least slack is comfortable; `None` where that never happens.
    ///
    /// Only for a stretch that is the whole problem: pinned neighbours are scaled too.
    pub(super) fn scale_into(&mut self) -> Option<f64> {
        let mut scale = 1.0;
        for _ in 0..SCALINGS {
            if self.rows.set_tangents(&self.c) > START_SLACK {
                return Some(scale);
            }
            scale *= 0.8;
            self.c.iter_mut().for_each(|c| *c *= 0.8);
        }
        None
    }

    /// Sets the tangents for the loaded profile and returns their least slack.
    pub(super) fn settle(&mut self) -> f64 {
        self.rows.set_tangents(&self.c)
    }

    /// The control values that could move, as the best iterate has them.
    pub(super) fn moved(&self) -> Vec<f64> {
        self.best[self.free[0]..self.free[1]].to_vec()
    }

    /// Gradient of the time, its curvature added to the band; returns the time.
    fn time(&mut self) -> f64 {
        const WEIGHTS: [f64; 3] = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0];
        let mut time = 0.0;
        self.gradient.clear();
        self.gradient.resize(self.c.len(), 0.0);
        for (i, span) in self.spans.iter().enumerate() {
            let c = [self.c[i], self.c[i + 1], self.c[i + 2]];
            let (mut g, mut m) = ([0.0; 3], [0.0; 6]);
            for (a, w) in span.points.iter().zip(WEIGHTS) {
                let x = dot(a, &c);
                let t = w * span.h / x.sqrt();
                time += t;
                let (slope, bend) = (-0.5 * t / x, CURVATURE * 0.75 * t / (x * x));
                (0..3).for_each(|j| g[j] += slope * a[j]);
                outer(&mut m, a, bend);
            }
            (0..3).for_each(|j| self.gradient[i + j] += g[j]);
            self.band.add(i, &m);
        }
        for &(j, weight) in &self.rests {
            let x = self.c[j];
            let t = weight / x.sqrt();
            time += t;
            self.gradient[j] -= 0.5 * t / x;
            self.band.band[j][0] += CURVATURE * 0.75 * t / (x * x);
        }
        time
    }

    /// Improves the loaded profile until the gap is below a share of the time; returns the iterations it took.
    pub(super) fn solve(&mut self, relative_gap: f64) -> u32 {
        let n = self.c.len();
        let [lo, hi] = self.free;
        self.best.clone_from(&self.c);
        let (mut best_time, mut last_time) = (f64::INFINITY, f64::INFINITY);
        let mut dual_step = 0.0;
        let rows = self.rows.count();
        self.band.reset(n);
        let _ = self.time();
        let balance = -(lo..hi).map(|j| self.gradient[j] * self.c[j]).sum::<f64>();
        let mu = balance / self.rows.push_back(&self.c).max(f64::MIN_POSITIVE);
        if !(mu.is_finite() && mu > 0.0) {
            return 0;
        }
        for iteration in 0..MOST_ITERATIONS {
            self.rows.move_tangents(&self.c);
            if iteration == 0 {
                self.rows.set_multipliers(&self.c, mu);
            }
            self.band.reset(n);
            let time = self.time();
            if time < best_time {
                best_time = time;
                self.best.clone_from(&self.c);
            }
            let gap = self.assemble(dual_step);
            if self.deadline.passed(iteration) {
                return iteration;
            }
            if gap < relative_gap * time && (time - last_time).abs() < relative_gap * time {
                return iteration;
            }
            last_time = time;
            let Some([primal, dual]) = self.step(gap, rows) else {
                return iteration;
            };
            (lo..hi).for_each(|j| self.c[j] += primal * self.dc[j]);
            dual_step = dual;
        }
        MOST_ITERATIONS
    }

    /// First pass: the barrier's matrix and push; returns the gap.
    fn assemble(&mut self, dual_step: f64) -> f64 {
        self.push.clear();
        self.push.resize(self.c.len(), 0.0);
        let mut gap = 0.0;
        for i in 0..self.rows.cells.len() {
            let part = self.rows.normal(i, &self.c, dual_step);
            let at = self.rows.cells[i].at as usize;
            self.band.add(at, &part.m);
            (0..3).for_each(|j| self.push[at + j] += part.g[j]);
            gap += part.gap;
        }
        gap
    }

    /// Predictor and corrector [Mehrotra1992]: fills `dc`, returns primal and dual step lengths.
    fn step(&mut self, gap: f64, rows: f64) -> Option<[f64; 2]> {
        let [lo, hi] = self.free;
        self.band.factorise(lo, hi);
        self.dc.clear();
        self.dc.resize(self.c.len(), 0.0);
        (lo..hi).for_each(|j| self.dc[j] = -self.gradient[j]);
        self.band.solve(lo, hi, &mut self.dc);
        self.correction.clear();
        self.correction.resize(self.c.len(), 0.0);
        let mut affine = Affine::default();
        for i in 0..self.rows.cells.len() {
            let part = self.rows.affine(i, &self.c, &self.dc, &mut affine);
            let at = self.rows.cells[i].at as usize;
            (0..3).for_each(|j| self.correction[at + j] += part[j]);
        }
        let primal = (1.0 / affine.rise).min(1.0);
        let dual = (1.0 / (1.0 - affine.fall)).min(1.0);
        let (s1, s2) = (affine.s1, affine.s2);
        let after = gap + dual * (s1 - gap) - primal * s1 + primal * dual * (s1 - s2);
        let centring = (after.max(0.0) / gap).powi(3).clamp(LEAST_CENTRING, 1.0);
        let mu = centring * gap / rows;
        for j in lo..hi {
            self.dc[j] = -self.gradient[j] - mu * self.push[j] + self.correction[j];
        }
        self.band.solve(lo, hi, &mut self.dc);
        let (mut rise, mut fall) = (0.0f64, 0.0f64);
        for i in 0..self.rows.cells.len() {
            let [p, d] = self.rows.combined(i, &self.c, &self.dc, mu);
            (rise, fall) = (rise.max(p), fall.max(d));
        }
        let shrink = (lo..hi).map(|j| -self.dc[j] / self.c[j]).fold(0.0, f64::max);
        let primal = (TO_BOUNDARY / rise).min(MOST_LOSS / shrink).min(1.0);
        let dual = (TO_BOUNDARY / fall).min(1.0);
        let sound = primal.is_finite() && dual.is_finite() && self.dc[lo..hi].iter().all(|d| d.is_finite());
        sound.then_some([primal, dual])
    }
}

/// Adds weight a a^T, upper triangle by rows.
fn outer(m: &mut [f64; 6], a: &[f64; 3], weight: f64) {
    let b = a.map(|v| v * weight);
    m[0] += b[0] * a[0];
    m[1] += b[0] * a[1];
    m[2] += b[0] * a[2];
    m[3] += b[1] * a[1];
    m[4] += b[1] * a[2];
    m[5] += b[2] * a[2];
}

/// Values of the quadratic at the three Gauss points.
fn gauss(b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let root = 0.15f64.sqrt();
    [0.5 - root, 0.5, 0.5 + root].map(|t| {
        let w = [(1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t];
        [0, 1, 2].map(|j| w[0] * b[0][j] + w[1] * b[1][j] + w[2] * b[2][j])
    })
}

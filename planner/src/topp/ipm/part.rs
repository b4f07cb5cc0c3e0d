//! A window in parts of fixed size: every pass goes over them side by side, and what they find is put together in
//! their order, so that no result depends on how many threads there are.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::band::Band;
use super::block::{Affine, Rows};
use super::{CURVATURE, ENOUGH};
use crate::topp::lanes::{LANES, Lanes, product, scaled, totals};
use crate::topp::rows::{CellRows, RowBuilder, RowSource};

/// Spans of a part: some fifty microseconds a pass, far more than handing it to another thread costs.
pub(super) const PART: usize = 48;

/// Gauss points of one span side by side, as rows of its three control values, and h times their weights.
#[derive(Clone, Debug)]
struct SpanTime {
    a: [Lanes; 3],
    weight: Lanes,
}

/// Spans that follow each other, with their rows, and what the last pass found on them.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    /// First local span, which is also the first local control value it sees.
    first: usize,
    rows: Rows,
    cell: CellRows,
    spans: Vec<SpanTime>,
    band: Band,
    /// What is added to the gradient of the time, or to the second-order terms.
    gradient: Vec<f64>,
    push: Vec<f64>,
    found: Found,
}

/// Numbers that a pass finds.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    time: f64,
    /// Gap, least slack, or what the barrier pushes back.
    sum: f64,
    affine: Affine,
    /// Largest of a.dc/slack and of -dz/z.
    rise_fall: [f64; 2],
}

/// Where and how rows are built.
pub(super) struct Loading<'l, 'a, M> {
    pub(super) source: &'l RowSource<'a>,
    /// What rounding does at most to each control value.
    pub(super) half: &'l [f64],
    /// What is left below the limits of an inner span.
    pub(super) margin: M,
    /// First inner span.
    pub(super) first: usize,
}

/// One pass over all rows or spans, at control values `c`.
#[derive(Clone, Copy)]
enum Pass<'c> {
    Settle { c: &'c [f64] },
    Time { c: &'c [f64] },
    PushBack { c: &'c [f64] },
    Multipliers { c: &'c [f64], mu: f64 },
    Normal { c: &'c [f64], step: f64 },
    Affine { c: &'c [f64], dc: &'c [f64] },
    Combined { c: &'c [f64], affine: &'c [f64], dc: &'c [f64], mu: f64 },
}

/// All parts of a window. Memory is kept from window to window.
#[derive(Clone, Debug, Default)]
pub(super) struct Parts {
    /// Instructions to use: the machine's best, unless a test asks for others.
    pub(super) arch: Arch,
    /// One part after the other: where other windows keep the other threads busy.
    pub(super) in_turn: bool,
    parts: Vec<Part>,
    used: usize,
}

impl Parts {
    /// Builds the rows of `count` inner spans.
    pub(super) fn load<M: Fn(usize) -> f64 + Sync>(&mut self, count: usize, loading: &Loading<M>) {
        self.used = count.div_ceil(PART);
        if self.parts.len() < self.used {
            self.parts.resize_with(self.used, Part::default);
        }
        let arch = self.arch;
        self.each(|at, part| {
            part.first = at * PART;
            let last = (part.first + PART).min(count);
            arch.dispatch(Load { part, last, loading });
        });
    }

    /// Number of rows, those that fill up blocks included.
    pub(super) fn rows(&self) -> f64 {
        self.parts[..self.used].iter().map(|part| part.rows.count()).sum()
    }

    /// Sets every tangent from scratch and returns the least slack.
    pub(super) fn settle(&mut self, c: &[f64]) -> f64 {
        self.pass(Pass::Settle { c });
        self.found().map(|f| f.sum).fold(f64::INFINITY, f64::min)
    }

    /// The time, and its gradient.
    pub(super) fn time(&mut self, c: &[f64], gradient: &mut Vec<f64>) -> f64 {
        self.pass(Pass::Time { c });
        self.gather(c.len(), |part| &part.gradient, gradient);
        self.found().map(|f| f.time).sum()
    }

    /// Sum of max(a.c, 0)/slack.
    pub(super) fn push_back(&mut self, c: &[f64]) -> f64 {
        self.pass(Pass::PushBack { c });
        self.found().map(|f| f.sum).sum()
    }

    /// Sets z = mu/slack.
    pub(super) fn set_multipliers(&mut self, c: &[f64], mu: f64) {
        self.pass(Pass::Multipliers { c, mu });
    }

    /// Lets the multipliers take their step and tangents move, and fills the Newton matrix, the gradient of the time
    /// and, per unit of mu, the push of the barrier; returns time and gap.
    pub(super) fn normal(
        &mut self,
        c: &[f64],
        step: f64,
        band: &mut Band,
        gradient: &mut Vec<f64>,
        push: &mut Vec<f64>,
    ) -> [f64; 2] {
        self.pass(Pass::Normal { c, step });
        band.reset(c.len());
        for part in &self.parts[..self.used] {
            for (sum, own) in band.band[part.first..].iter_mut().zip(&part.band.band) {
                (0..3).for_each(|k| sum[k] += own[k]);
            }
        }
        self.gather(c.len(), |part| &part.gradient, gradient);
        self.gather(c.len(), |part| &part.push, push);
        [self.found().map(|f| f.time).sum(), self.found().map(|f| f.sum).sum()]
    }

    /// The affine step `dc` against the slacks; its second-order terms, as gradients, go to `correction`.
    pub(super) fn affine(&mut self, c: &[f64], dc: &[f64], correction: &mut Vec<f64>) -> Affine {
        self.pass(Pass::Affine { c, dc });
        self.gather(c.len(), |part| &part.gradient, correction);
        self.found().fold(Affine::default(), |all, f| all.with(&f.affine))
    }

    /// The steps of the multipliers for the combined step `dc`; the largest of a.dc/slack and of -dz/z.
    pub(super) fn combined(&mut self, c: &[f64], affine: &[f64], dc: &[f64], mu: f64) -> [f64; 2] {
        self.pass(Pass::Combined { c, affine, dc, mu });
        self.found().fold([0.0; 2], |all, f| [all[0].max(f.rise_fall[0]), all[1].max(f.rise_fall[1])])
    }

    fn found(&self) -> impl Iterator<Item = &Found> {
        self.parts[..self.used].iter().map(|part| &part.found)
    }

    /// Adds up what the parts hold for each of `n` control values.
    fn gather(&self, n: usize, of: impl Fn(&Part) -> &Vec<f64>, to: &mut Vec<f64>) {
        to.clear();
        to.resize(n, 0.0);
        for part in &self.parts[..self.used] {
            to[part.first..].iter_mut().zip(of(part)).for_each(|(sum, own)| *sum += own);
        }
    }

    fn pass(&mut self, pass: Pass) {
        let arch = self.arch;
        self.each(|_, part| arch.dispatch(OnPart { part, pass }));
    }

    fn each(&mut self, f: impl Fn(usize, &mut Part) + Sync) {
        let in_turn = self.in_turn;
        let parts = &mut self.parts[..self.used];
        if in_turn || parts.len() == 1 || rayon::current_num_threads() == 1 {
            parts.iter_mut().enumerate().for_each(|(at, part)| f(at, part));
        } else {
            parts.par_iter_mut().enumerate().for_each(|(at, part)| f(at, part));
        }
    }
}

/// Building rows, with the vector instructions of the machine.
struct Load<'p, 'l, 'a, M> {
    part: &'p mut Part,
    /// One past the last local span.
    last: usize,
    loading: &'l Loading<'l, 'a, M>,
}

impl<M: Fn(usize) -> f64> WithSimd for Load<'_, '_, '_, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Part { first, rows, cell, spans, .. } = self.part;
        let Loading { source, half: halves, margin, first: window } = self.loading;
        let m = halves.len();
        let mut builder = RowBuilder::new(source);
        rows.clear();
        spans.clear();
        for (at, s) in (window + *first..window + self.last).enumerate() {
            let mut half = [0.0; 3];
            for (j, half) in (s..).zip(&mut half) {
                if (1..=m).contains(&j) {
                    *half = halves[j - 1];
                }
            }
            let margin = margin(s);
            for k in 0..usize::from(source.layout.cells[s + 1]) {
                builder.cell(s, k, cell);
                rows.push(at, cell, &half, margin);
            }
            spans.push(SpanTime::new(source.layout.h[s + 1], &source.bezier(s)));
        }
    }
}

/// A pass over one part, with the vector instructions of the machine.
struct OnPart<'p, 'c> {
    part: &'p mut Part,
    pass: Pass<'c>,
}

impl WithSimd for OnPart<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let part = self.part;
        let (from, n) = (part.first, part.spans.len() + 2);
        let own = |c: &'_ [f64]| -> std::ops::Range<usize> { from..(from + n).min(c.len()) };
        let zeros = |v: &mut Vec<f64>| {
            v.clear();
            v.resize(n, 0.0);
        };
        match self.pass {
            Pass::Settle { c } => part.found.sum = part.rows.set_tangents(&c[own(c)], ENOUGH),
            Pass::Time { c } => {
                part.band.reset(n);
                part.found.time = part.time(&c[own(c)]);
            }
            Pass::PushBack { c } => part.found.sum = part.rows.push_back(&c[own(c)]),
            Pass::Multipliers { c, mu } => part.rows.set_multipliers(&c[own(c)], mu),
            Pass::Normal { c, step } => {
                let c = &c[own(c)];
                part.band.reset(n);
                part.found.time = part.time(c);
                zeros(&mut part.push);
                part.found.sum = part.rows.normal(c, step, &mut part.band, &mut part.push);
            }
            Pass::Affine { c, dc } => {
                zeros(&mut part.gradient);
                part.found.affine = part.rows.affine(&c[own(c)], &dc[own(dc)], &mut part.gradient);
            }
            Pass::Combined { c, affine, dc, mu } => {
                let own = own(c);
                part.found.rise_fall =
                    part.rows.combined(&c[own.clone()], &affine[own.clone()], &dc[own], mu);
            }
        }
    }
}

impl Part {
    /// Gradient of the time, its curvature added to the band; returns the time.
    #[inline(always)]
    fn time(&mut self, c: &[f64]) -> f64 {
        let mut time = Lanes::ZERO;
        self.gradient.clear();
        self.gradient.resize(c.len(), 0.0);
        for (i, span) in self.spans.iter().enumerate() {
            let c = [c[i], c[i + 1], c[i + 2]];
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
        time.total()
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

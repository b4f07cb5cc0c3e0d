//! The limits as rows "three numbers <= 1" in the control values of x = q/V^2.
//!
//! Over each cell, q is a quadratic and each axis a cubic, so every limit is a polynomial, and its Bernstein
//! coefficients bound it over the whole cell:
//!
//! - velocity: p'^2 q <= V^2, degree 6, linear in q;
//! - acceleration: |p'' q + p' q'/2| <= A, degree 3;
//! - jerk: |f| <= J/sqrt(q) with f = p''' q + 3/2 p'' q' + 1/2 p' q'', degree 2 [Zhao2016 eq. 3.2]. 1/sqrt(x) lies
//!   above its tangent at 1/s^2, so for any s > 0: +-F/(1.5 s) + (s^2/3) x <= 1, F = V^3 f/J.

use super::layout::{Derivatives, Layout, Pieces, Strictest, strictest};
use super::problem::Problem;
use super::rounding;
use crate::job::machine::MAX_AXES;

/// Spans that a drive may have to cross within a control tick. The format allows a few more; placed knots lie at
/// least a tick apart, only divided spans are shorter.
pub(super) const SPANS_PER_TICK: f64 = 12.0;

/// What a row stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// Velocity of an axis.
    Velocity(u8),
    /// A cap on the path speed.
    Feed,
    /// What the joint with a rest span allows.
    Rest,
    /// What the largest code can carry, and the shortest span time.
    Format,
}

/// The rows of one cell, divided by their bounds; each triple multiplies the three control values round the span.
#[derive(Clone, Debug, Default)]
pub(super) struct CellRows {
    /// a.c <= 1.
    pub(super) upper: Vec<([f64; 3], Source)>,
    /// |a.c| <= 1: acceleration, with its axis.
    pub(super) acceleration: Vec<([f64; 3], u8)>,
    /// F of the jerk rows, with its axis; Bernstein coefficients 0, 1, 2 in turn.
    pub(super) jerk: Vec<([f64; 3], u8)>,
    /// Bernstein coefficients of x over the cell.
    pub(super) x: [[f64; 3]; 3],
}

/// What the rows are made from.
#[derive(Clone, Debug)]
pub(super) struct RowSource<'a> {
    /// The problem.
    pub(super) problem: Problem<'a>,
    /// The q spans.
    pub(super) layout: &'a Layout,
    /// V^2: q of x = 1.
    pub(super) unit: f64,
    /// Largest x a control value may take.
    pub(super) ceiling: f64,
    /// Bounds on x at the two joints with the rest spans.
    pub(super) joint: [f64; 2],
    /// The largest code.
    pub(super) largest_code: f64,
}

impl RowSource<'_> {
    /// c_1/c_0 at the first rest and its mirror image at the last: c_1 = c_0 + h_1 D, D = (2/3) c_0/u_1.
    pub(super) fn fold(&self) -> [f64; 2] {
        let h = &self.layout.h;
        let n = h.len();
        [1.0 + 2.0 * h[1] / (3.0 * h[0]), 1.0 + 2.0 * h[n - 2] / (3.0 * h[n - 1])]
    }

    /// Bernstein coefficients of q over inner span `s` as rows of the control values s-1, s, s+1.
    pub(super) fn bezier(&self, s: usize) -> [[f64; 3]; 3] {
        let h = &self.layout.h;
        let (i, last) = (s + 1, self.layout.unknowns() - 1);
        let [first_fold, last_fold] = self.fold();
        let left = if s == 0 {
            [0.0, 1.0 / first_fold, 0.0]
        } else {
            let w = h[i] / (h[i - 1] + h[i]);
            [w, 1.0 - w, 0.0]
        };
        let right = if s == last {
            [0.0, 1.0 / last_fold, 0.0]
        } else {
            let w = h[i] / (h[i] + h[i + 1]);
            [0.0, 1.0 - w, w]
        };
        [left, [0.0, 1.0, 0.0], right]
    }

    /// The caps over inner span `s`.
    pub(super) fn caps(&self, s: usize) -> Strictest {
        strictest(self.problem.caps, self.layout.knots[s + 1], self.layout.knots[s + 2])
    }

    /// Fills `out` with the rows of cell `cell` of inner span `s`.
    pub(super) fn cell(&self, s: usize, cell: usize, pieces: &mut Pieces, out: &mut CellRows) {
        out.upper.clear();
        out.acceleration.clear();
        out.jerk.clear();
        let layout = self.layout;
        let i = s + 1;
        let cells = f64::from(layout.cells[i]);
        let (t0, t1) = (cell as f64 / cells, (cell + 1) as f64 / cells);
        let g = layout.geometry[i] as usize;
        let path = self.problem.path;
        let offset = (layout.knots[i] - path.breaks[g]) as f64 * path.step;
        let length = layout.h[i] / cells;
        out.x = sub_cell(&self.bezier(s), t0, t1);
        let axes = pieces.at(g);
        let mut d = [Derivatives::default(); MAX_AXES];
        for (axis, (d, piece)) in d.iter_mut().zip(axes).enumerate() {
            *d = Derivatives::of(piece, offset + t0 * layout.h[i], length);
            if !d.still() {
                self.axis(axis, d, length, out);
            }
        }
        self.speed_caps(s, &d[..axes.len()], out);
        if cell == 0 {
            out.upper.push(([0.0, 1.0 / self.ceiling, 0.0], Source::Format));
            self.joints(s, out);
        }
    }

    fn axis(&self, axis: usize, d: &Derivatives, h: f64, out: &mut CellRows) {
        let limits = &self.problem.limits[axis];
        let id = axis as u8;
        let x = out.x;
        let e = d.first_squared().map(|e| e * self.unit / (limits.velocity * limits.velocity));
        degree_six(&e, &x, |row| out.upper.push((row, Source::Velocity(id))));
        // q'/2 has the Bernstein coefficients (b1 - b0)/h, (b2 - b1)/h.
        let slope = [scaled_difference(&x[1], &x[0], h), scaled_difference(&x[2], &x[1], h)];
        let bend = scaled_difference(&slope[1], &slope[0], h);
        let [s0, s1] = d.second;
        let [p0, p1, p2] = d.first;
        let k = self.unit / limits.acceleration;
        let mut acceleration = |terms: [f64; 5]| {
            let [a, b, c, u, v] = terms.map(|t| t * k);
            let row = |j| a * x[0][j] + b * x[1][j] + c * x[2][j] + u * slope[0][j] + v * slope[1][j];
            out.acceleration.push(([row(0), row(1), row(2)], id));
        };
        let third = 1.0 / 3.0;
        acceleration([s0, 0.0, 0.0, p0, 0.0]);
        acceleration([s1 * third, 2.0 * s0 * third, 0.0, 2.0 * p1 * third, p0 * third]);
        acceleration([0.0, 2.0 * s1 * third, s0 * third, p2 * third, 2.0 * p1 * third]);
        acceleration([0.0, 0.0, s1, 0.0, p2]);
        if limits.jerk.is_finite() {
            let k = self.unit * self.unit.sqrt() / limits.jerk;
            let mixed = [[s0, 0.0], [0.5 * s1, 0.5 * s0], [0.0, s1]];
            for (i, m) in mixed.iter().enumerate() {
                let row = |j: usize| {
                    k * (d.third * x[i][j]
                        + 3.0 * (m[0] * slope[0][j] + m[1] * slope[1][j])
                        + d.first[i] * bend[j])
                };
                out.jerk.push(([row(0), row(1), row(2)], id));
            }
        }
    }

    fn speed_caps(&self, s: usize, axes: &[Derivatives], out: &mut CellRows) {
        let caps = self.caps(s);
        let x = out.x;
        for (mask, speed) in caps.tangential.iter().flatten() {
            let mut e = [0.0; 5];
            for (_, d) in axes.iter().enumerate().filter(|(axis, _)| mask >> axis & 1 == 1) {
                e.iter_mut().zip(d.first_squared()).for_each(|(e, p)| *e += p * self.unit / (speed * speed));
            }
            if e.iter().any(|e| *e != 0.0) {
                degree_six(&e, &x, |row| out.upper.push((row, Source::Feed)));
            }
        }
        if caps.rate.is_finite() {
            let k = self.unit / (caps.rate * caps.rate);
            out.upper.extend(x.iter().map(|b| (b.map(|v| v * k), Source::Feed)));
        }
        // q <= (h/T)^2 all over the span keeps it as long as T; needed only where x = ceiling is too fast.
        let bound = self.longest_enough(s, axes);
        if bound < self.ceiling {
            out.upper.extend(x.iter().map(|b| (b.map(|v| v / bound), Source::Format)));
        }
    }

    /// Largest x on inner span `s` at which the span is as long as it must be: a share of the control tick, and what
    /// rounding needs.
    fn longest_enough(&self, s: usize, axes: &[Derivatives]) -> f64 {
        const ROUNDING_SHARE: f64 = 0.2;
        let step = (self.unit * self.ceiling).sqrt() / self.largest_code;
        let tick = self.problem.control_tick_s / SPANS_PER_TICK;
        let shortest = axes
            .iter()
            .zip(self.problem.limits)
            .fold(tick, |t, (d, l)| rounding::shortest_s(d.first_max(), l, step, ROUNDING_SHARE).max(t));
        (self.layout.h[s + 1] / shortest).powi(2) / self.unit
    }

    /// The same over the whole span.
    pub(super) fn shortest_bound(&self, s: usize, pieces: &mut Pieces) -> f64 {
        let layout = self.layout;
        let g = layout.geometry[s + 1] as usize;
        let path = self.problem.path;
        let offset = (layout.knots[s + 1] - path.breaks[g]) as f64 * path.step;
        let mut d = [Derivatives::default(); MAX_AXES];
        let axes = pieces.at(g);
        d.iter_mut().zip(axes).for_each(|(d, p)| *d = Derivatives::of(p, offset, layout.h[s + 1]));
        self.longest_enough(s, &d[..axes.len()])
    }

    fn joints(&self, s: usize, out: &mut CellRows) {
        let fold = self.fold();
        if s == 0 {
            out.upper.push(([0.0, 1.0 / (fold[0] * self.joint[0]), 0.0], Source::Rest));
        }
        if s + 1 == self.layout.unknowns() {
            out.upper.push(([0.0, 1.0 / (fold[1] * self.joint[1]), 0.0], Source::Rest));
        }
    }
}

/// Bernstein coefficients over the part [t0, t1] of a quadratic, by blossoming.
fn sub_cell(b: &[[f64; 3]; 3], t0: f64, t1: f64) -> [[f64; 3]; 3] {
    if t0 == 0.0 && t1 == 1.0 {
        return *b;
    }
    let blossom = |s: f64, t: f64| {
        let w = [(1.0 - s) * (1.0 - t), s * (1.0 - t) + t * (1.0 - s), s * t];
        [0, 1, 2].map(|j| w[0] * b[0][j] + w[1] * b[1][j] + w[2] * b[2][j])
    };
    [blossom(t0, t0), blossom(t0, t1), blossom(t1, t1)]
}

fn scaled_difference(a: &[f64; 3], b: &[f64; 3], h: f64) -> [f64; 3] {
    [0, 1, 2].map(|j| (a[j] - b[j]) / h)
}

/// Product of a quartic `e` with the quadratic `x`: seven rows.
fn degree_six(e: &[f64; 5], x: &[[f64; 3]; 3], mut emit: impl FnMut([f64; 3])) {
    let mut row = |w: [f64; 3]| emit([0, 1, 2].map(|j| w[0] * x[0][j] + w[1] * x[1][j] + w[2] * x[2][j]));
    row([e[0], 0.0, 0.0]);
    row([4.0 * e[1] / 6.0, 2.0 * e[0] / 6.0, 0.0]);
    row([6.0 * e[2] / 15.0, 8.0 * e[1] / 15.0, e[0] / 15.0]);
    row([4.0 * e[3] / 20.0, 12.0 * e[2] / 20.0, 4.0 * e[1] / 20.0]);
    row([e[4] / 15.0, 8.0 * e[3] / 15.0, 6.0 * e[2] / 15.0]);
    row([0.0, 2.0 * e[4] / 6.0, 4.0 * e[3] / 6.0]);
    row([0.0, 0.0, e[4]]);
}

/// Dot product of a row with three control values.
pub(super) fn dot(a: &[f64; 3], c: &[f64; 3]) -> f64 {
    a[0] * c[0] + a[1] * c[1] + a[2] * c[2]
}

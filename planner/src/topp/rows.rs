//! The limits as rows "three numbers <= 1" in the control values of x = q/V^2.
//!
//! Over each cell, q is a quadratic and each axis a cubic, so every limit is a polynomial, and its Bernstein
//! coefficients bound it over the whole cell:
//!
//! - velocity: p'^2 q <= V^2, degree 6, linear in q;
//! - acceleration: |p'' q + p' q'/2| <= A, degree 3;
//! - jerk: |f| <= J/sqrt(q) with f = p''' q + 3/2 p'' q' + 1/2 p' q'', degree 2 [Zhao2016 eq. 3.2]. 1/sqrt(x) lies
//!   above its tangent at 1/s^2, so for any s > 0: +-F/(1.5 s) + (s^2/3) x <= 1, F = V^3 f/J.

mod builder;

pub(super) use builder::RowBuilder;

use super::lanes::{LANES, Lanes};
use super::layout::{Layout, Pieces, Strictest, strictest};
use super::problem::{JerkForm, Problem, RowForm};
use super::rounding;
use crate::geometry::grid_path::Piece;
use crate::job::machine::MAX_AXES;

/// Spans that a drive may have to cross within a control tick. The format allows a few more; placed knots lie at
/// least a tick apart, only divided spans are shorter.
pub(super) const SPANS_PER_TICK: f64 = 12.0;

/// Lane groups that hold all axes.
pub(super) const GROUPS: usize = MAX_AXES.div_ceil(LANES);
/// One number per axis that moves.
pub(super) type Wide = [Lanes; GROUPS];

/// What a row stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// Velocity of an axis.
    Velocity(u8),
    /// Acceleration of an axis.
    Acceleration(u8),
    /// Jerk of an axis.
    Jerk(u8),
    /// A cap on the path speed.
    Feed,
    /// What the joint with a rest span allows.
    Rest,
    /// What the largest code can carry, the shortest span time, and limits that are far from ruling.
    Format,
    /// How sharply q may bend within a span.
    Bend,
}

/// A row a.c <= bound.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// On the three control values round the span.
    pub(super) a: [f64; 3],
    /// 1, or 0 for a relation between the control values.
    pub(super) bound: f64,
    /// What it stands for.
    pub(super) source: Source,
}

/// The rows of one cell, divided by their bounds; each triple multiplies the three control values round the span.
#[derive(Clone, Debug, Default)]
pub(super) struct CellRows {
    /// a.c <= bound.
    pub(super) upper: Vec<Row>,
    /// |a.c| <= 1, axes side by side: acceleration, Bernstein coefficients in turn, and then pseudo-jerk.
    pub(super) bends: Vec<[Wide; 3]>,
    /// F of the jerk rows, axes side by side, Bernstein coefficients in turn.
    pub(super) jerks: Vec<[Wide; 3]>,
    /// How many of `bends` are acceleration.
    accelerations: usize,
    /// The axes that move, in the order of the lanes.
    axes: [u8; MAX_AXES],
    moving: usize,
    /// Bernstein coefficients of x over the cell.
    pub(super) x: [[f64; 3]; 3],
}

impl CellRows {
    /// Lane groups in use.
    pub(super) fn groups(&self) -> usize {
        self.moving.div_ceil(LANES)
    }

    fn of_axes<'a>(&'a self, wide: &'a [[Lanes; GROUPS]; 3]) -> impl Iterator<Item = ([f64; 3], u8)> + 'a {
        self.axes[..self.moving]
            .iter()
            .enumerate()
            .map(|(lane, &axis)| (wide.map(|w| w[lane / LANES].0[lane % LANES]), axis))
    }

    /// Rows |a.c| <= 1 one by one.
    pub(super) fn pairs(&self) -> impl Iterator<Item = ([f64; 3], Source)> + '_ {
        self.bends.iter().enumerate().flat_map(move |(k, wide)| {
            let acceleration = k < self.accelerations;
            self.of_axes(wide).map(move |(a, axis)| {
                (a, if acceleration { Source::Acceleration(axis) } else { Source::Jerk(axis) })
            })
        })
    }

    /// The F of the jerk rows one by one, with the Bernstein coefficient they belong to, and their axis.
    pub(super) fn forces(&self) -> impl Iterator<Item = ([f64; 3], usize, u8)> + '_ {
        self.jerks
            .iter()
            .enumerate()
            .flat_map(move |(k, wide)| self.of_axes(wide).map(move |(a, axis)| (a, k, axis)))
    }
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
    /// Largest swept x round each inner span.
    pub(super) swept: &'a [f64],
    /// How jerk is written.
    pub(super) jerk: JerkForm,
    /// Where rows hold.
    pub(super) form: RowForm,
    /// Whether there are rows against bending too sharply.
    pub(super) bends: bool,
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

    /// Largest x on inner span `s` at which the span is as long as it must be: a share of the control tick, and what
    /// rounding needs.
    fn longest_enough(&self, s: usize, slopes: impl Iterator<Item = f64>) -> f64 {
        const ROUNDING_SHARE: f64 = 0.2;
        let step = (self.unit * self.ceiling).sqrt() / self.largest_code;
        let tick = self.problem.control_tick_s / SPANS_PER_TICK;
        let shortest = slopes
            .zip(self.problem.limits)
            .filter(|(slope, _)| *slope > 0.0)
            .fold(tick, |t, (slope, l)| rounding::shortest_s(slope, l, step, ROUNDING_SHARE).max(t));
        (self.layout.h[s + 1] / shortest).powi(2) / self.unit
    }

    /// The same, found from the path.
    pub(super) fn shortest_bound(&self, s: usize, pieces: &mut Pieces) -> f64 {
        let layout = self.layout;
        let g = layout.geometry[s + 1] as usize;
        let path = self.problem.path;
        let offset = (layout.knots[s + 1] - path.breaks[g]) as f64 * path.step;
        let h = layout.h[s + 1];
        let slopes = pieces.at(g).iter().map(|p| steepest(p, offset, h));
        self.longest_enough(s, slopes)
    }
}

/// Largest Bernstein coefficient of |p'| over [x, x + h].
fn steepest(piece: &Piece, x: f64, h: f64) -> f64 {
    let (a, c) = (piece.first(x), piece.first(x + h));
    a.abs().max((a + 0.5 * h * piece.second(x)).abs()).max(c.abs())
}

/// Dot product of a row with three control values.
#[inline(always)]
pub(super) fn dot(a: &[f64; 3], c: &[f64; 3]) -> f64 {
    a[0] * c[0] + a[1] * c[1] + a[2] * c[2]
}

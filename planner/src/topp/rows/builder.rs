//! Filling in the rows of one cell after another, axes side by side.

use super::{CellRows, GROUPS, LANES, Lanes, Row, RowSource, Source, Wide};
use crate::job::machine::MAX_AXES;
use crate::topp::layout::Pieces;
use crate::topp::problem::{JerkForm, RowForm};

/// Share of a velocity or feed limit that the swept motion must use before the limit gets rows of its own.
const CRITICAL: f64 = 0.8;
/// Relative variation of a squared speed over a cell below which it counts as constant, at its largest.
const STEADY: f64 = 1e-5;

/// One row of three numbers.
type Triple = [f64; 3];

/// Makes the rows of cells; quick when cells come in order.
#[derive(Clone, Debug)]
pub(in crate::topp) struct RowBuilder<'s, 'a> {
    source: &'s RowSource<'a>,
    pieces: Pieces<'a>,
    /// Geometry span the following is of.
    span: Option<usize>,
    axes: [u8; MAX_AXES],
    moving: usize,
    /// p' = c\[0\] + c\[1\] x + c\[2\] x^2.
    slope: [Wide; 3],
    /// unit/V^2, unit/A and unit^1.5/J.
    per_limit: [Wide; 3],
    jerk: bool,
}

/// The derivatives of the moving axes over a cell, as Bernstein coefficients.
struct Shape {
    first: [Wide; 3],
    second: [Wide; 2],
    third: Wide,
}

impl<'s, 'a> RowBuilder<'s, 'a> {
    pub(in crate::topp) fn new(source: &'s RowSource<'a>) -> Self {
        let none = [Lanes::ZERO; GROUPS];
        RowBuilder {
            source,
            pieces: Pieces::new(source.problem.path),
            span: None,
            axes: [0; MAX_AXES],
            moving: 0,
            slope: [none; 3],
            per_limit: [none; 3],
            jerk: false,
        }
    }

    /// Fills `out` with the rows of cell `cell` of inner span `s`.
    #[inline(always)]
    pub(in crate::topp) fn cell(&mut self, s: usize, cell: usize, out: &mut CellRows) {
        let source = self.source;
        let layout = source.layout;
        let path = source.problem.path;
        let i = s + 1;
        let g = layout.geometry[i] as usize;
        if self.span != Some(g) {
            self.load(g);
        }
        out.upper.clear();
        out.bends.clear();
        out.jerks.clear();
        (out.axes, out.moving) = (self.axes, self.moving);
        let cells = f64::from(layout.cells[i]);
        let (t0, t1) = (cell as f64 / cells, (cell + 1) as f64 / cells);
        let offset = (layout.knots[i] - path.breaks[g]) as f64 * path.step;
        let length = layout.h[i] / cells;
        let whole = source.bezier(s);
        out.x = sub_cell(&whole, t0, t1);
        let shape = self.shape(offset + t0 * layout.h[i], length);
        match source.form {
            RowForm::Bernstein => self.bernstein(&shape, length, s, out),
            RowForm::Collocation => self.middle(&shape, length, s, out),
        }
        self.speeds(&shape, s, out);
        if cell == 0 {
            push(out, [0.0, 1.0 / source.ceiling, 0.0], Source::Format);
            self.joints(s, out);
            if source.bends {
                self.bend(&whole, out);
            }
        }
    }

    /// Takes in geometry span `g`: its polynomials, and the limits of the axes that move.
    fn load(&mut self, g: usize) {
        let problem = &self.source.problem;
        let unit = self.source.unit;
        let none = [Lanes::ZERO; GROUPS];
        (self.slope, self.per_limit, self.jerk) = ([none; 3], [none; 3], false);
        let mut lane = 0;
        for (axis, (piece, l)) in self.pieces.at(g).iter().zip(problem.limits).enumerate() {
            let [_, c1, c2, c3] = piece.power;
            if c1 == 0.0 && c2 == 0.0 && c3 == 0.0 {
                continue;
            }
            let (group, at) = (lane / LANES, lane % LANES);
            let slope = [c1, 2.0 * c2, 3.0 * c3];
            let limits =
                [unit / (l.velocity * l.velocity), unit / l.acceleration, unit * unit.sqrt() / l.jerk];
            for k in 0..3 {
                self.slope[k][group].0[at] = slope[k];
                self.per_limit[k][group].0[at] = limits[k];
            }
            self.jerk |= l.jerk.is_finite();
            self.axes[lane] = axis as u8;
            lane += 1;
        }
        self.moving = lane;
        self.span = Some(g);
    }

    #[inline(always)]
    fn groups(&self) -> usize {
        self.moving.div_ceil(LANES)
    }

    /// The derivatives over [x, x + h].
    #[inline(always)]
    fn shape(&self, x: f64, h: f64) -> Shape {
        let none = [Lanes::ZERO; GROUPS];
        let mut out = Shape { first: [none; 3], second: [none; 2], third: none };
        for g in 0..self.groups() {
            let [c0, c1, c2] = self.slope.map(|c| c[g]);
            let first = |x: f64| c0 + (c1 + c2 * x) * x;
            let second = |x: f64| c1 + c2 * (2.0 * x);
            let (p0, s0) = (first(x), second(x));
            out.first[0][g] = p0;
            out.first[1][g] = p0 + s0 * (0.5 * h);
            out.first[2][g] = first(x + h);
            out.second[0][g] = s0;
            out.second[1][g] = second(x + h);
            out.third[g] = c2 * 2.0;
        }
        out
    }

    /// Acceleration and jerk all over the cell.
    #[inline(always)]
    fn bernstein(&self, shape: &Shape, h: f64, s: usize, out: &mut CellRows) {
        let x = out.x;
        // q'/2 has the Bernstein coefficients (b1 - b0)/h, (b2 - b1)/h.
        let slope = [scaled_difference(&x[1], &x[0], h), scaled_difference(&x[2], &x[1], h)];
        let bend = scaled_difference(&slope[1], &slope[0], h);
        let none = [[Lanes::ZERO; GROUPS]; 3];
        let (mut accelerations, mut jerks) = ([none; 4], [none; 3]);
        const THIRD: f64 = 1.0 / 3.0;
        for g in 0..self.groups() {
            let [p0, p1, p2] = shape.first.map(|w| w[g]);
            let [s0, s1] = shape.second.map(|w| w[g]);
            let (third, a, j) = (shape.third[g], self.per_limit[1][g], self.per_limit[2][g]);
            for c in 0..3 {
                let (x0, x1, x2, u, v) = (x[0][c], x[1][c], x[2][c], slope[0][c], slope[1][c]);
                let rows = [
                    s0 * x0 + p0 * u,
                    (s1 * x0 + s0 * (2.0 * x1) + p1 * (2.0 * u) + p0 * v) * THIRD,
                    (s1 * (2.0 * x1) + s0 * x2 + p2 * u + p1 * (2.0 * v)) * THIRD,
                    s1 * x2 + p2 * v,
                ];
                for (k, row) in rows.into_iter().enumerate() {
                    accelerations[k][c][g] = row * a;
                }
                let rows = [
                    third * x0 + s0 * (3.0 * u) + p0 * bend[c],
                    third * x1 + (s1 * u + s0 * v) * 1.5 + p1 * bend[c],
                    third * x2 + s1 * (3.0 * v) + p2 * bend[c],
                ];
                for (k, row) in rows.into_iter().enumerate() {
                    jerks[k][c][g] = row * j;
                }
            }
        }
        out.bends.extend_from_slice(&accelerations);
        self.jerks(&jerks, s, out);
    }

    /// Acceleration and jerk in the middle of the cell.
    fn middle(&self, shape: &Shape, h: f64, s: usize, out: &mut CellRows) {
        let x = [0, 1, 2].map(|c| 0.25 * (out.x[0][c] + 2.0 * out.x[1][c] + out.x[2][c]));
        let slope = scaled_difference(&out.x[2], &out.x[0], 2.0 * h);
        let bend = [0, 1, 2].map(|c| (out.x[0][c] - 2.0 * out.x[1][c] + out.x[2][c]) / (h * h));
        let none = [[Lanes::ZERO; GROUPS]; 3];
        let (mut acceleration, mut jerk) = (none, none);
        for g in 0..self.groups() {
            let first = shape.first[0][g] * 0.25 + shape.first[1][g] * 0.5 + shape.first[2][g] * 0.25;
            let second = (shape.second[0][g] + shape.second[1][g]) * 0.5;
            for c in 0..3 {
                acceleration[c][g] = (second * x[c] + first * slope[c]) * self.per_limit[1][g];
                let row = shape.third[g] * x[c] + second * (3.0 * slope[c]) + first * bend[c];
                jerk[c][g] = row * self.per_limit[2][g];
            }
        }
        out.x = [x; 3];
        out.bends.push(acceleration);
        self.jerks(&[jerk], s, out);
    }

    /// Files the jerk rows where their form belongs.
    #[inline(always)]
    fn jerks(&self, jerks: &[[Wide; 3]], s: usize, out: &mut CellRows) {
        out.accelerations = out.bends.len();
        if !self.jerk {
            return;
        }
        match self.source.jerk {
            JerkForm::True => out.jerks.extend_from_slice(jerks),
            JerkForm::Pseudo => {
                let root = self.source.swept[s].sqrt();
                out.bends.extend(jerks.iter().map(|wide| wide.map(|w| w.map(|f| f * root))));
            }
        }
    }

    /// Velocities, caps, and the shortest span time.
    #[inline(always)]
    fn speeds(&self, shape: &Shape, s: usize, out: &mut CellRows) {
        let source = self.source;
        let none = [Lanes::ZERO; GROUPS];
        let mut squares = [none; 5];
        let mut most = none;
        for g in 0..self.groups() {
            let [a, b, c] = shape.first.map(|w| w[g]);
            let e = [a * a, a * b, (a * c + b * b * 2.0) * (1.0 / 3.0), b * c, c * c];
            for k in 0..5 {
                squares[k][g] = e[k];
            }
            most[g] = a.abs().max(b.abs()).max(c.abs());
        }
        // What no limit near its bound asks of x goes into one number.
        let mut shared = 0.0f64;
        if source.jerk == JerkForm::Pseudo && self.jerk {
            shared = 1.0 / source.swept[s];
        }
        let mut slopes = [0.0; MAX_AXES];
        for lane in 0..self.moving {
            let (g, l) = (lane / LANES, lane % LANES);
            let scale = self.per_limit[0][g].0[l];
            let e = squares.map(|w| w[g].0[l] * scale);
            slopes[usize::from(self.axes[lane])] = most[g].0[l];
            self.squared_speed(&e, s, Source::Velocity(self.axes[lane]), &mut shared, out);
        }
        let caps = source.caps(s);
        for (mask, speed) in caps.tangential.iter().flatten() {
            let mut e = [0.0; 5];
            for lane in (0..self.moving).filter(|&lane| mask >> self.axes[lane] & 1 == 1) {
                (0..5).for_each(|k| e[k] += squares[k][lane / LANES].0[lane % LANES]);
            }
            let scale = source.unit / (speed * speed);
            self.squared_speed(&e.map(|e| e * scale), s, Source::Feed, &mut shared, out);
        }
        if caps.rate.is_finite() {
            let k = source.unit / (caps.rate * caps.rate);
            rows_of(&out.x, k, |row| out.upper.push(Row { a: row, bound: 1.0, source: Source::Feed }));
        }
        // q <= (h/T)^2 all over the span keeps it as long as T; needed only where x = ceiling is too fast.
        let bound = source.longest_enough(s, slopes.into_iter());
        if bound < source.ceiling {
            shared = shared.max(1.0 / bound);
        }
        if shared > 0.0 {
            rows_of(&out.x, shared, |row| out.upper.push(Row { a: row, bound: 1.0, source: Source::Format }));
        }
    }

    /// Rows e x <= 1 with a quartic e, or its share of `shared` where they cannot bind.
    #[inline(always)]
    fn squared_speed(&self, e: &[f64; 5], s: usize, by: Source, shared: &mut f64, out: &mut CellRows) {
        let most = e.iter().fold(0.0, |m: f64, &v| m.max(v));
        let least = e.iter().fold(most, |m: f64, &v| m.min(v));
        if most * self.source.swept[s] < CRITICAL {
            *shared = shared.max(most);
        } else if self.source.form == RowForm::Collocation {
            let middle = (e[0] + 4.0 * e[1] + 6.0 * e[2] + 4.0 * e[3] + e[4]) / 16.0;
            push(out, out.x[1].map(|x| x * middle), by);
        } else if most - least <= STEADY * most {
            let x = out.x;
            rows_of(&x, most, |row| push(out, row, by));
        } else {
            let x = out.x;
            degree_six(e, &x, |row| push(out, row, by));
        }
    }

    fn joints(&self, s: usize, out: &mut CellRows) {
        let source = self.source;
        let fold = source.fold();
        if s == 0 {
            push(out, [0.0, 1.0 / (fold[0] * source.joint[0]), 0.0], Source::Rest);
        }
        if s + 1 == source.layout.unknowns() {
            push(out, [0.0, 1.0 / (fold[1] * source.joint[1]), 0.0], Source::Rest);
        }
    }

    /// |b0 - 2 b1 + b2| <= (b0 + b2)/4, which implies |gamma| h^2 <= (sqrt(q0) + sqrt(q1))^2/4: the table's format.
    fn bend(&self, b: &[Triple; 3], out: &mut CellRows) {
        for sign in [1.0, -1.0] {
            let a =
                [0, 1, 2].map(|c| sign * (b[0][c] - 2.0 * b[1][c] + b[2][c]) - 0.25 * (b[0][c] + b[2][c]));
            out.upper.push(Row { a, bound: 0.0, source: Source::Bend });
        }
    }
}

#[inline(always)]
fn push(out: &mut CellRows, a: Triple, source: Source) {
    out.upper.push(Row { a, bound: 1.0, source });
}

/// The Bernstein coefficients of `factor` x.
#[inline(always)]
fn rows_of(x: &[Triple; 3], factor: f64, emit: impl FnMut(Triple)) {
    x.map(|row| row.map(|v| v * factor)).into_iter().for_each(emit);
}

/// Bernstein coefficients over the part [t0, t1] of a quadratic, by blossoming.
fn sub_cell(b: &[Triple; 3], t0: f64, t1: f64) -> [Triple; 3] {
    if t0 == 0.0 && t1 == 1.0 {
        return *b;
    }
    let blossom = |s: f64, t: f64| {
        let w = [(1.0 - s) * (1.0 - t), s * (1.0 - t) + t * (1.0 - s), s * t];
        [0, 1, 2].map(|j| w[0] * b[0][j] + w[1] * b[1][j] + w[2] * b[2][j])
    };
    [blossom(t0, t0), blossom(t0, t1), blossom(t1, t1)]
}

fn scaled_difference(a: &Triple, b: &Triple, h: f64) -> Triple {
    [0, 1, 2].map(|j| (a[j] - b[j]) / h)
}

/// Product of a quartic `e` with the quadratic `x`: seven rows.
fn degree_six(e: &[f64; 5], x: &[Triple; 3], mut emit: impl FnMut(Triple)) {
    let mut row = |w: Triple| emit([0, 1, 2].map(|j| w[0] * x[0][j] + w[1] * x[1][j] + w[2] * x[2][j]));
    row([e[0], 0.0, 0.0]);
    row([4.0 * e[1] / 6.0, 2.0 * e[0] / 6.0, 0.0]);
    row([6.0 * e[2] / 15.0, 8.0 * e[1] / 15.0, e[0] / 15.0]);
    row([4.0 * e[3] / 20.0, 12.0 * e[2] / 20.0, 4.0 * e[1] / 20.0]);
    row([e[4] / 15.0, 8.0 * e[3] / 15.0, 6.0 * e[2] / 15.0]);
    row([0.0, 2.0 * e[4] / 6.0, 4.0 * e[3] / 6.0]);
    row([0.0, 0.0, e[4]]);
}

//! The reference solver: Clarabel on a sequence of linear programmes with the same rows.
//!
//! The first programme is the pseudo-jerk form, J/sqrt(q*) with the swept q* [Zhao2016 eq. 3.4]; the following ones
//! take the tangent of 1/sqrt(q) and the gradient of the time at the last answer.

use ::clarabel::algebra::CscMatrix;
use ::clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};

use super::rows::{CellRows, RowBuilder, RowSource, dot};

/// Linear programmes after the first.
const MOST_STEPS: usize = 8;

/// Rows of three consecutive columns, value <= bound.
#[derive(Default)]
struct Programme {
    rows: Vec<(usize, [f64; 3], f64)>,
    cells: Vec<Cell>,
}

/// The jerk rows of one cell, both signs in turn.
struct Cell {
    span: usize,
    rows: std::ops::Range<usize>,
    /// Bernstein coefficient of each pair.
    coefficients: Vec<usize>,
    x: [[f64; 3]; 3],
}

/// The best control values, the iterations of all programmes, and the last gain, as the kernel counts time.
pub(super) struct Best {
    pub(super) x: Vec<f64>,
    pub(super) iterations: u64,
    pub(super) gap: f64,
}

/// An answer: control values, one multiplier per row, iterations.
struct Answer {
    x: Vec<f64>,
    multipliers: Vec<f64>,
    iterations: u64,
}

/// How jerk rows are linearised.
#[derive(Clone, Copy)]
enum Jerk<'a> {
    /// |F| <= 1/sqrt(x*), x* per inner span.
    Pseudo(&'a [f64]),
    /// Tangent of 1/sqrt(x) at 1/s^2, s per cell.
    Tangent(&'a [f64]),
}

/// Solves from the start profile.
pub(super) fn solve(source: &RowSource, start: &[f64], half: &[f64], relative_gap: f64) -> Option<Best> {
    let (mut best, mut best_time): (Option<Vec<f64>>, f64) = (None, f64::INFINITY);
    let (mut iterations, mut gap) = (0, f64::INFINITY);
    let mut at = start.to_vec();
    let mut tangents = Vec::new();
    for step in 0..=MOST_STEPS {
        let jerk = if step == 0 { Jerk::Pseudo(source.swept) } else { Jerk::Tangent(&tangents) };
        let programme = Programme::new(source, half, jerk);
        let (_, gradient) = time(source, &at);
        let Some(answer) = programme.solve(&gradient) else { break };
        iterations += answer.iterations;
        let x = programme.shrink(answer.x);
        tangents = programme.tangents(&x, &answer.multipliers);
        let (seconds, _) = time(source, &x);
        if !seconds.is_finite() {
            break;
        }
        let gain = best_time - seconds;
        if gain.is_finite() {
            gap = gain.abs();
        }
        if seconds < best_time {
            best_time = seconds;
            best = Some(x.clone());
        }
        at = x;
        if step > 0 && gain.abs() < relative_gap * seconds {
            break;
        }
    }
    best.map(|x| Best { x, iterations, gap })
}

/// Controls of inner span `s`; zero outside.
fn controls(x: &[f64], s: usize) -> [f64; 3] {
    [0, 1, 2].map(|j| if s + j == 0 || s + j > x.len() { 0.0 } else { x[s + j - 1] })
}

/// Time of the control values and its gradient, by three Gauss points per span.
fn time(source: &RowSource, x: &[f64]) -> (f64, Vec<f64>) {
    let (h, fold) = (&source.layout.h, source.fold());
    let m = x.len();
    let mut gradient = vec![0.0; m];
    let mut total = 0.0;
    for s in 0..m {
        let b = source.bezier(s);
        let c = controls(x, s);
        let root = 0.15f64.sqrt();
        for (t, w) in [(0.5 - root, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + root, 5.0 / 18.0)] {
            let a = [0, 1, 2]
                .map(|j| (1.0 - t) * (1.0 - t) * b[0][j] + 2.0 * t * (1.0 - t) * b[1][j] + t * t * b[2][j]);
            let value = dot(&a, &c);
            let part = w * h[s + 1] / value.sqrt();
            total += part;
            for (j, a) in a.iter().enumerate().filter(|(j, _)| (1..=m).contains(&(s + j))) {
                gradient[s + j - 1] -= 0.5 * part / value * a;
            }
        }
    }
    for (j, weight) in [(0, 3.0 * h[0] * fold[0].sqrt()), (m - 1, 3.0 * h[m + 1] * fold[1].sqrt())] {
        let part = weight / x[j].sqrt();
        total += part;
        gradient[j] -= 0.5 * part / x[j];
    }
    (total, gradient)
}

impl Programme {
    fn new(source: &RowSource, half: &[f64], jerk: Jerk) -> Self {
        let mut programme = Programme::default();
        let mut builder = RowBuilder::new(source);
        let mut cell = CellRows::default();
        for s in 0..half.len() {
            let half = controls(half, s);
            for k in 0..usize::from(source.layout.cells[s + 1]) {
                builder.cell(s, k, &mut cell);
                programme.cell(s, &cell, &half, jerk);
            }
        }
        for j in 0..half.len() {
            programme.rows.push((j, [0.0, -1.0, 0.0], 0.0));
        }
        programme
    }

    fn cell(&mut self, s: usize, cell: &CellRows, half: &[f64; 3], jerk: Jerk) {
        let rows = &mut self.rows;
        let mut add = |a: [f64; 3], bound: f64, robust: f64| rows.push((s, a, bound - robust));
        let loss = |a: &[f64; 3]| a[0].abs() * half[0] + a[1].abs() * half[1] + a[2].abs() * half[2];
        let (alpha, beta) = match jerk {
            Jerk::Pseudo(swept) => (swept[s].sqrt(), 0.0),
            Jerk::Tangent(tangents) => {
                let tangent = tangents[self.cells.len()];
                (1.0 / (1.5 * tangent), tangent * tangent / 3.0)
            }
        };
        for row in &cell.upper {
            add(row.a, row.bound, row.bound * loss(&row.a));
        }
        for (a, _) in cell.pairs() {
            add(a, 1.0, loss(&a));
            add(a.map(|v| -v), 1.0, loss(&a));
        }
        let (mut count, mut coefficients) = (0, Vec::new());
        for (f, k, _) in cell.forces() {
            let x = &cell.x[k];
            for sign in [alpha, -alpha] {
                let a = [0, 1, 2].map(|j| sign * f[j] + beta * x[j]);
                add(a, 1.0, alpha * loss(&f) + beta * loss(x));
            }
            count += 2;
            coefficients.push(k);
        }
        let end = self.rows.len();
        self.cells.push(Cell { span: s, rows: end - count..end, coefficients, x: cell.x });
    }

    /// The next tangents: at the mean of x weighted by the multipliers, which is where the optimum has them; at the
    /// plain mean where no jerk row is active.
    fn tangents(&self, x: &[f64], multipliers: &[f64]) -> Vec<f64> {
        const INACTIVE: f64 = 1e-6;
        let floor = INACTIVE * multipliers.iter().copied().fold(0.0, f64::max);
        let tangent = |cell: &Cell| {
            let c = controls(x, cell.span);
            let b = cell.x.map(|x| dot(&x, &c));
            let (mut weight, mut moment) = (3.0 * floor, floor * b.iter().sum::<f64>());
            for (i, z) in multipliers[cell.rows.clone()].iter().enumerate() {
                weight += z.max(0.0);
                moment += z.max(0.0) * b[cell.coefficients[i / 2]];
            }
            (weight / moment).sqrt()
        };
        self.cells.iter().map(tangent).collect()
    }

    /// Minimises gradient . x.
    fn solve(&self, gradient: &[f64]) -> Option<Answer> {
        let n = gradient.len();
        let mut columns: Vec<(Vec<usize>, Vec<f64>)> = vec![Default::default(); n];
        for (row, (s, a, _)) in self.rows.iter().enumerate() {
            for j in 0..3 {
                if (1..=n).contains(&(s + j)) && a[j] != 0.0 {
                    let (rows, values) = &mut columns[s + j - 1];
                    rows.push(row);
                    values.push(a[j]);
                }
            }
        }
        let mut starts = vec![0];
        let (mut indices, mut values) = (Vec::new(), Vec::new());
        for (rows, numbers) in columns {
            indices.extend(rows);
            values.extend(numbers);
            starts.push(indices.len());
        }
        let a = CscMatrix::new(self.rows.len(), n, starts, indices, values);
        let p = CscMatrix::zeros((n, n));
        let bounds: Vec<f64> = self.rows.iter().map(|(_, _, bound)| *bound).collect();
        let largest = gradient.iter().fold(0.0, |m: f64, g| m.max(g.abs()));
        let cost: Vec<f64> = gradient.iter().map(|g| g / largest).collect();
        let settings = DefaultSettings {
            verbose: false,
            equilibrate_enable: false,
            iterative_refinement_enable: false,
            ..DefaultSettings::default()
        };
        let cones = [NonnegativeConeT(self.rows.len())];
        let mut solver = DefaultSolver::new(&p, &cost, &a, &bounds, &cones, settings).ok()?;
        solver.solve();
        let solution = &solver.solution;
        let usable = matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
        let sound = solution.x.iter().all(|x| x.is_finite());
        (usable && sound).then(|| Answer {
            x: solution.x.clone(),
            multipliers: solution.z.clone(),
            iterations: u64::from(solution.iterations),
        })
    }

    /// Scales an answer that violates rows by the solver's tolerance back inside.
    fn shrink(&self, mut x: Vec<f64>) -> Vec<f64> {
        const LEAST: f64 = 1e-12;
        x.iter_mut().for_each(|x| *x = x.max(LEAST));
        let worst = self
            .rows
            .iter()
            .filter(|(_, _, bound)| *bound > 0.0)
            .map(|(s, a, bound)| dot(a, &controls(&x, *s)) / bound)
            .fold(1.0, f64::max);
        x.iter_mut().for_each(|x| *x /= worst);
        x
    }
}

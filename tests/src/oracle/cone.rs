//! Minimum time under true jerk by second-order cones: the textbook problem on fine knots, solved by Clarabel.
//!
//! q is a quadratic B-spline; every span of the path is divided into equal parts, and limits are asked for at a few
//! places of each. Time is a sum of h/sqrt(q) over their middles, each term two rotated cones. The jerk limit
//! |f| <= J/sqrt(q) is replaced by its tangent at the last q, again and again until the time no longer changes
//! (Debrouwere et al. 2013). Both ends leave rest by constant jerk.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use planner::geometry::grid_path::GridPath;
use planner::job::machine::AxisLimits;

use super::spline::{Basis, combine};

/// Programmes until the time has to stand still, and the change that counts as standing still.
const ROUNDS: usize = 20;
const STILL: f64 = 1e-4;
/// Where in a span limits are asked for.
const PLACES: [f64; 3] = [0.0, 0.5, 1.0];
/// Where they are looked at afterwards.
const BETWEEN: [f64; 6] = [0.1, 0.2, 0.35, 0.65, 0.8, 0.9];
/// Least x that a tangent is taken at.
const LEAST: f64 = 1e-9;

/// The answer.
#[derive(Clone, Copy, Debug)]
pub struct Reference {
    /// Traverse time [s].
    pub time: f64,
    /// Spans of q between the rests.
    pub spans: usize,
    /// Programmes solved.
    pub rounds: usize,
    /// Whether the time stood still in the end.
    pub converged: bool,
    /// Largest velocity, acceleration and jerk over their limits, between the places that were asked for.
    pub ratios: [f64; 3],
}

/// One place of the path: p', p'' and p''' of every axis, and the weights of three controls in q, q' and q''.
struct Place {
    axes: Vec<[f64; 3]>,
    weights: [Vec<f64>; 3],
}

/// Numbers of the problem: x = q/V^2, V the largest velocity limit.
struct Grid<'a> {
    limits: &'a [AxisLimits],
    controls: Vec<Vec<f64>>,
    path_basis: Basis<f64>,
    basis: Basis<f64>,
    /// Knots of q. The first and the last part of the path are the rests, and lie outside.
    knots: Vec<f64>,
    /// Span of the path that each span of q lies in.
    geometry: Vec<usize>,
    /// Lengths of both rests.
    rests: [f64; 2],
    /// V^2.
    unit: f64,
}

/// Rows of variables against a bound, for one cone after the other.
#[derive(Default)]
struct Rows {
    entries: Vec<(usize, usize, f64)>,
    bounds: Vec<f64>,
    cones: Vec<SupportedConeT<f64>>,
}

/// Terms of a row, and its bound.
type Row = (Vec<(usize, f64)>, f64);

/// Plans `path` on spans of at most `longest`; `None` where Clarabel finds nothing.
pub fn minimum_time(path: &GridPath, limits: &[AxisLimits], longest: f64) -> Option<Reference> {
    let grid = Grid::new(path, limits, longest);
    let places: Vec<[Place; 3]> = (0..grid.spans()).map(|k| PLACES.map(|t| grid.place(k, t))).collect();
    let mut at: Vec<[f64; 3]> = places.iter().map(|p| [0, 1, 2].map(|i| grid.steady(&p[i]))).collect();
    let mut best: Option<(f64, Vec<f64>)> = None;
    let (mut rounds, mut converged, mut last) = (0, false, f64::INFINITY);
    while rounds < ROUNDS && !converged {
        rounds += 1;
        let Some(x) = grid.solve(&places, &at) else { break };
        let time = grid.time(&places, &x);
        converged = (last - time).abs() < STILL * time;
        last = time;
        for (k, (at, places)) in at.iter_mut().zip(&places).enumerate() {
            *at = [0, 1, 2].map(|i| combine(&x, k, &places[i].weights[0]).max(LEAST));
        }
        if best.as_ref().is_none_or(|(least, _)| time < *least) {
            best = Some((time, x));
        }
    }
    let (time, x) = best?;
    Some(Reference { time, spans: grid.spans(), rounds, converged, ratios: grid.ratios(&x) })
}

impl<'a> Grid<'a> {
    fn new(path: &GridPath, limits: &'a [AxisLimits], longest: f64) -> Self {
        let breaks: Vec<f64> = path.breaks.iter().map(|&b| b as f64 * path.step).collect();
        let relative = |a: usize| -> Vec<f64> {
            let axis = &path.axes[a];
            axis.controls.iter().map(|&c| (c - axis.controls[0]) as f64 * axis.lsb).collect()
        };
        let (mut knots, mut geometry) = (Vec::new(), Vec::new());
        for (span, pair) in breaks.windows(2).enumerate() {
            let parts = ((pair[1] - pair[0]) / longest).ceil().max(3.0) as usize;
            knots.extend((0..parts).map(|k| pair[0] + (pair[1] - pair[0]) * k as f64 / parts as f64));
            geometry.extend(std::iter::repeat_n(span, parts));
        }
        knots.push(path.length());
        let last = knots.len() - 1;
        let rests = [knots[1] - knots[0], knots[last] - knots[last - 1]];
        let knots = knots[1..last].to_vec();
        let fastest = limits.iter().map(|l| l.velocity).fold(0.0, f64::max);
        Grid {
            limits,
            controls: (0..path.axes.len()).map(relative).collect(),
            path_basis: Basis::clamped(3, &breaks),
            basis: Basis::clamped(2, &knots),
            knots,
            geometry: geometry[1..last - 1].to_vec(),
            rests,
            unit: fastest * fastest,
        }
    }

    fn spans(&self) -> usize {
        self.geometry.len()
    }

    fn length(&self, k: usize) -> f64 {
        self.knots[k + 1] - self.knots[k]
    }

    /// Share `t` of span `k`.
    fn place(&self, k: usize, t: f64) -> Place {
        let (u, span) = (self.knots[k] + t * self.length(k), self.geometry[k]);
        let path = [1, 2, 3].map(|d| self.path_basis.weights(span, u, d));
        Place {
            axes: self.controls.iter().map(|c| [0, 1, 2].map(|d| combine(c, span, &path[d]))).collect(),
            weights: [0, 1, 2].map(|d| self.basis.weights(k, u, d)),
        }
    }

    /// Largest x of a steady speed.
    fn steady(&self, place: &Place) -> f64 {
        let bounds = place.axes.iter().zip(self.limits).map(|([p1, p2, p3], l)| {
            let velocity = (l.velocity / p1).powi(2);
            velocity.min(l.acceleration / p2.abs()).min((l.jerk / p3.abs()).powf(2.0 / 3.0))
        });
        bounds.fold(self.unit, f64::min) / self.unit
    }

    /// One programme, linearised at `at`. Variables: spans + 2 controls, then s and t of each span and both rests.
    fn solve(&self, places: &[[Place; 3]], at: &[[f64; 3]]) -> Option<Vec<f64>> {
        let n = self.spans();
        let mut rows = Rows::default();
        let (equal, mut upper) = self.rests();
        for (k, (places, at)) in places.iter().zip(at).enumerate() {
            for (place, &x) in places.iter().zip(at) {
                self.limit(k, place, x, &mut upper);
            }
        }
        upper.extend((0..n + 2).map(|j| (vec![(j, -1.0)], 0.0)));
        rows.cone(SupportedConeT::ZeroConeT(equal.len()), equal);
        rows.cone(SupportedConeT::NonnegativeConeT(upper.len()), upper);
        let mut cost = vec![0.0; 3 * n + 6];
        let inner = places.iter().enumerate().map(|(k, places)| {
            let weights = &places[1].weights[0];
            ((0..3).map(|j| (k + j, weights[j])).collect::<Vec<_>>(), self.length(k))
        });
        let rests = [(vec![(0, 1.0)], 3.0 * self.rests[0]), (vec![(n + 1, 1.0)], 3.0 * self.rests[1])];
        for (i, (x, weight)) in inner.chain(rests).enumerate() {
            let (s, t) = (n + 2 + i, 2 * n + 4 + i);
            cost[t] = weight / self.knots[n];
            let x: Vec<(usize, f64)> = x.into_iter().map(|(j, a)| (j, -a)).collect();
            // s^2 <= x: (x + 1, x - 1, 2 s) in the cone; s t >= 1: (t + s, t - s, 2).
            let root = [(x.clone(), 1.0), (x, -1.0), (vec![(s, -2.0)], 0.0)];
            let inverse =
                [(vec![(t, -1.0), (s, -1.0)], 0.0), (vec![(t, -1.0), (s, 1.0)], 0.0), (vec![], 2.0)];
            rows.cone(SupportedConeT::SecondOrderConeT(3), root);
            rows.cone(SupportedConeT::SecondOrderConeT(3), inverse);
        }
        rows.solve(&cost, n + 2)
    }

    /// What both rests ask for: equalities and upper bounds.
    fn rests(&self) -> (Vec<Row>, Vec<Row>) {
        let (mut equal, mut upper) = (Vec::new(), Vec::new());
        for (side, (k, share)) in [(0, 0.0), (self.spans() - 1, 1.0)].into_iter().enumerate() {
            let (place, rest) = (self.place(k, share), self.rests[side]);
            // q' = (4/3) q/u where the constant jerk ends; mirrored at the other end.
            let slope = [1.0, -1.0][side] * 4.0 / (3.0 * rest);
            let [value, first, _] = &place.weights;
            equal.push(((0..3).map(|j| (k + j, first[j] - slope * value[j])).collect(), 0.0));
            // That jerk is (2/9) q^(3/2)/u^2.
            for ([p1, ..], l) in place.axes.iter().zip(self.limits) {
                let most = (4.5 * rest * rest * l.jerk / p1.abs()).powf(2.0 / 3.0) / self.unit;
                if most.is_finite() {
                    upper.push(((0..3).map(|j| (k + j, value[j] / most)).collect(), 1.0));
                }
            }
        }
        (equal, upper)
    }

    /// The limits at one place of span `k`, jerk by its tangent at `x`.
    fn limit(&self, k: usize, place: &Place, x: f64, rows: &mut Vec<Row>) {
        let unit = self.unit;
        let [value, slope, bend] = &place.weights;
        for (&[p1, p2, p3], l) in place.axes.iter().zip(self.limits) {
            let mut add =
                |f: &dyn Fn(usize) -> f64| rows.push(((0..3).map(|j| (k + j, f(j))).collect(), 1.0));
            let (v, a) = (unit * (p1 / l.velocity).powi(2), unit / l.acceleration);
            add(&|j| v * value[j]);
            let f = unit * (unit * x).sqrt() / l.jerk;
            for sign in [1.0, -1.0] {
                add(&|j| sign * a * (p2 * value[j] + 0.5 * p1 * slope[j]));
                let jerk = |j: usize| p3 * value[j] + 1.5 * p2 * slope[j] + 0.5 * p1 * bend[j];
                add(&|j| (sign * f * jerk(j) + value[j] / (2.0 * x)) / 1.5);
            }
        }
    }

    /// Time of controls `x` [s], by the same sum.
    fn time(&self, places: &[[Place; 3]], x: &[f64]) -> f64 {
        let n = self.spans();
        let inner: f64 =
            (0..n).map(|k| self.length(k) / combine(x, k, &places[k][1].weights[0]).sqrt()).sum();
        let rests = 3.0 * (self.rests[0] / x[0].sqrt() + self.rests[1] / x[n + 1].sqrt());
        (inner + rests) / self.unit.sqrt()
    }

    /// Largest value over limit of velocity, acceleration and jerk, between the places of the problem.
    fn ratios(&self, x: &[f64]) -> [f64; 3] {
        let mut worst = [0.0f64; 3];
        for k in 0..self.spans() {
            for t in BETWEEN {
                let place = self.place(k, t);
                let [q, q1, q2] = [0, 1, 2].map(|d| self.unit * combine(x, k, &place.weights[d]));
                let root = q.max(0.0).sqrt();
                for (&[p1, p2, p3], l) in place.axes.iter().zip(self.limits) {
                    let jerk = (p3 * q + 1.5 * p2 * q1 + 0.5 * p1 * q2) * root;
                    let acceleration = p2 * q + 0.5 * p1 * q1;
                    let found = [p1 * root / l.velocity, acceleration / l.acceleration, jerk / l.jerk];
                    worst.iter_mut().zip(found).for_each(|(worst, found)| *worst = worst.max(found.abs()));
                }
            }
        }
        worst
    }
}

impl Rows {
    /// Adds rows whose `bound - sum` lies in the cone.
    fn cone(&mut self, cone: SupportedConeT<f64>, rows: impl IntoIterator<Item = Row>) {
        for (entries, bound) in rows {
            let row = self.bounds.len();
            self.entries.extend(entries.into_iter().map(|(column, value)| (row, column, value)));
            self.bounds.push(bound);
        }
        self.cones.push(cone);
    }

    /// The first `wanted` variables of least cost.
    fn solve(&self, cost: &[f64], wanted: usize) -> Option<Vec<f64>> {
        let (m, n) = (self.bounds.len(), cost.len());
        let rows = self.entries.iter().map(|e| e.0).collect();
        let columns = self.entries.iter().map(|e| e.1).collect();
        let values = self.entries.iter().map(|e| e.2).collect();
        let a = CscMatrix::new_from_triplets(m, n, rows, columns, values);
        let settings = DefaultSettings { verbose: false, equilibrate_enable: false, ..Default::default() };
        let zero = CscMatrix::zeros((n, n));
        let mut solver = DefaultSolver::new(&zero, cost, &a, &self.bounds, &self.cones, settings).ok()?;
        solver.solve();
        let solution = &solver.solution;
        let usable = matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
        let x = &solution.x[..wanted];
        (usable && x.iter().all(|x| x.is_finite())).then(|| x.to_vec())
    }
}

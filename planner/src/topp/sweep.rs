//! The velocity and acceleration sweep: the fastest motion when jerk does not matter, in O(N).
//!
//! Backward, the largest q from which the rest of the path can be survived (the controllable set of [Pham2018]);
//! forward, as fast as that allows. Limits hold at the stations. The bound between a lower limit of one axis and an
//! upper limit of another (the maximum velocity curve) is part of both passes.
//!
//! [`Sweeper`] sweeps sampled derivatives ([`Samples`]), again and again in the same memory; [`Sweep`] is the sweep of
//! a problem at stations of its own choice.

mod passes;
mod samples;

pub use passes::Sweeper;
pub use samples::{Samples, SamplesError};

use super::layout::{Pieces, strictest};
use super::problem::Problem;
use crate::job::machine::MAX_AXES;

/// q*(u) at stations along the path.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Stations in u, from the start to the end of the path.
    pub stations: Vec<f64>,
    /// q there; zero at both ends.
    pub q: Vec<f64>,
    /// Largest q, jerk of a steady speed included, at which the path can be travelled there.
    pub constant: Vec<f64>,
}

impl Sweep {
    /// Sweeps the path of a valid problem.
    pub fn new(problem: &Problem) -> Self {
        let (stations, geometry) = stations(problem);
        let n = stations.len();
        let mut samples = Samples::along(problem.path, stations, &geometry);
        add_caps(problem, &mut samples);
        let mut sweeper = Sweeper::new();
        sweeper.run(&samples, problem.limits);
        let steady = steady_jerk(problem);
        let mut constant: Vec<f64> =
            sweeper.bounds(n).iter().zip(&geometry).map(|(bound, &g)| bound.min(steady[g])).collect();
        passes::replace_infinities(&mut constant);
        let q = sweeper.q(n).to_vec();
        for (constant, q) in constant[1..n - 1].iter_mut().zip(&q[1..n - 1]) {
            *constant = constant.min(*q);
        }
        Sweep { stations: samples.stations, q, constant }
    }

    /// Time of the swept motion [s]: q is linear between stations.
    pub fn duration(&self) -> f64 {
        self.stations
            .windows(2)
            .zip(self.q.windows(2))
            .map(|(u, q)| 2.0 * (u[1] - u[0]) / (q[0].sqrt() + q[1].sqrt()))
            .sum()
    }

    /// The q that speeds are measured by: the largest, but no more than a hundred times the mean speed squared.
    ///
    /// Where all axes nearly stand still, du/dt is all but free; without this bound such a place would use up the
    /// range of the codes. Travelling faster could save at most a hundredth of the time.
    pub(super) fn top(&self) -> f64 {
        const OVER_MEAN: f64 = 100.0;
        let mean = self.stations[self.stations.len() - 1] / self.duration();
        self.q.iter().copied().fold(0.0, f64::max).min((OVER_MEAN * mean).powi(2))
    }

    /// Largest speed of each axis in the swept motion.
    pub(super) fn top_speeds(&self, problem: &Problem) -> [f64; MAX_AXES] {
        let path = problem.path;
        let per_span = (self.stations.len() - 1) / path.spans();
        let mut top = [0.0; MAX_AXES];
        let mut pieces = Pieces::new(path);
        for (k, (&u, &q)) in self.stations.iter().zip(&self.q).enumerate() {
            let g = (k / per_span).min(path.spans() - 1);
            let x = u - path.breaks[g] as f64 * path.step;
            for (top, piece) in top.iter_mut().zip(pieces.at(g)) {
                *top = (piece.first(x).abs() * q.sqrt()).max(*top);
            }
        }
        top
    }

    /// Largest q on [from, to], the bracketing stations included; `hint` is an index into the stations at or before
    /// `from`, and is moved on.
    pub(super) fn largest(&self, from: f64, to: f64, hint: &mut usize) -> f64 {
        let n = self.stations.len();
        while *hint + 1 < n && self.stations[*hint + 1] <= from {
            *hint += 1;
        }
        let mut k = *hint;
        let mut largest = self.q[k];
        while k + 1 < n && self.stations[k] < to {
            k += 1;
            largest = largest.max(self.q[k]);
        }
        largest
    }
}

fn grid_steps(u: f64, step: f64) -> u64 {
    (u / step).round() as u64
}

/// Adds what the caps on the path speed allow at each station.
fn add_caps(problem: &Problem, samples: &mut Samples) {
    if problem.caps.is_empty() {
        return;
    }
    for k in 0..samples.stations.len() {
        let at = grid_steps(samples.stations[k], problem.path.step);
        let caps = strictest(problem.caps, at.saturating_sub(1), at + 1);
        samples.bound(k, caps.rate * caps.rate);
        for (mask, speed) in caps.tangential.iter().flatten() {
            let counted = (0..samples.axes()).filter(|a| mask >> a & 1 == 1);
            let square: f64 = counted.map(|a| samples.first_at(a, k).powi(2)).sum();
            samples.bound(k, speed * speed / square);
        }
    }
}

/// Largest q of a steady speed under the jerk limits, per geometry span: |p'''| q^(3/2) <= J.
fn steady_jerk(problem: &Problem) -> Vec<f64> {
    let mut pieces = Pieces::new(problem.path);
    let mut span = |g| {
        let ratios = pieces.at(g).iter().zip(problem.limits).map(|(p, l)| p.third().abs() / l.jerk);
        ratios.fold(0.0, f64::max).powf(-2.0 / 3.0)
    };
    (0..problem.path.spans()).map(&mut span).collect()
}

/// Stations and the geometry span each lies in: denser towards the ends of a geometry span where spans are few.
fn stations(problem: &Problem) -> (Vec<f64>, Vec<usize>) {
    const TARGET: usize = 4000;
    const FEWEST: usize = 4;
    const MOST: usize = 128;
    let path = problem.path;
    let per_span = (TARGET / path.spans()).clamp(FEWEST, MOST);
    let mut stations = Vec::with_capacity(path.spans() * per_span + 1);
    let mut geometry = Vec::with_capacity(stations.capacity());
    for g in 0..path.spans() {
        let (a, b) = (path.breaks[g] as f64 * path.step, path.breaks[g + 1] as f64 * path.step);
        for k in 0..per_span {
            let t = k as f64 / per_span as f64;
            let t = if per_span < 16 { t } else { 0.5 - 0.5 * (std::f64::consts::PI * t).cos() };
            stations.push(a + (b - a) * t);
            geometry.push(g);
        }
    }
    stations.push(path.length());
    geometry.push(path.spans() - 1);
    (stations, geometry)
}

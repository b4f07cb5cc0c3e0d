//! The velocity and acceleration sweep: the fastest motion when jerk does not matter, in O(N).
//!
//! Backward, the largest q from which the rest of the path can be survived (the controllable set of [Pham2018]);
//! forward, as fast as that allows. Limits hold at the stations. The bound between a lower limit of one axis and an
//! upper limit of another (the maximum velocity curve) is part of both passes.

use super::layout::{Derivatives, Pieces, strictest};
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

/// One station's limits on path acceleration w at q: |slope q + gain w| <= bound per axis.
#[derive(Clone, Copy, Debug, Default)]
struct Strip {
    gain: f64,
    slope: f64,
    bound: f64,
}

impl Sweep {
    /// Sweeps the path of a valid problem.
    pub fn new(problem: &Problem) -> Self {
        let axes = problem.path.axes.len();
        let (stations, geometry) = stations(problem);
        let n = stations.len();
        let mut strips = Vec::with_capacity(n * axes);
        let mut constant = Vec::with_capacity(n);
        let mut q = Vec::with_capacity(n);
        let mut pieces = Pieces::new(problem.path);
        for (&u, &g) in stations.iter().zip(&geometry) {
            let x = u - problem.path.breaks[g] as f64 * problem.path.step;
            let at = grid_steps(u, problem.path.step);
            let caps = strictest(problem.caps, at.saturating_sub(1), at + 1);
            let mut bound = caps.rate * caps.rate;
            let mut d = [Derivatives::default(); MAX_AXES];
            let mut jerk_bound = f64::INFINITY;
            let from = strips.len();
            for ((d, piece), l) in d.iter_mut().zip(pieces.at(g)).zip(problem.limits) {
                *d = Derivatives::of(piece, x, 0.0);
                bound = bound.min((l.velocity / d.first[0]).powi(2));
                jerk_bound = jerk_bound.min((l.jerk / d.third.abs()).powf(2.0 / 3.0));
                let gain = d.first[0].abs();
                let slope = if d.first[0] < 0.0 { -d.second[0] } else { d.second[0] };
                strips.push(Strip { gain, slope, bound: l.acceleration });
            }
            for (mask, speed) in caps.tangential.iter().flatten() {
                let square: f64 =
                    (0..axes).filter(|a| mask >> a & 1 == 1).map(|a| d[a].first[0].powi(2)).sum();
                bound = bound.min(speed * speed / square);
            }
            bound = bound.min(curve_bound(&strips[from..]));
            constant.push(bound.min(jerk_bound));
            q.push(bound);
        }
        q[0] = 0.0;
        q[n - 1] = 0.0;
        replace_infinities(&mut q);
        replace_infinities(&mut constant);
        for k in (0..n - 1).rev() {
            let d = 2.0 * (stations[k + 1] - stations[k]);
            for s in &strips[k * axes..(k + 1) * axes] {
                // Lowest w at q is (-bound - slope q)/gain; it must reach q[k+1]: q + d w <= q[k+1].
                let (room, cost) = (s.gain * q[k + 1] + d * s.bound, s.gain - d * s.slope);
                if cost > 0.0 {
                    q[k] = q[k].min(room / cost);
                }
            }
        }
        for k in 0..n - 1 {
            let d = 2.0 * (stations[k + 1] - stations[k]);
            let w = strips[k * axes..(k + 1) * axes]
                .iter()
                .filter(|s| s.gain > 0.0)
                .map(|s| (s.bound - s.slope * q[k]) / s.gain)
                .fold(f64::INFINITY, f64::min);
            q[k + 1] = q[k + 1].min((q[k] + d * w).max(0.0));
        }
        for k in 1..n - 1 {
            constant[k] = constant[k].min(q[k]);
        }
        Sweep { stations, q, constant }
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

/// Largest q at which every axis' strip leaves a common path acceleration.
fn curve_bound(strips: &[Strip]) -> f64 {
    let mut q = f64::INFINITY;
    for (i, a) in strips.iter().enumerate() {
        if a.gain == 0.0 {
            q = q.min(a.bound / a.slope.abs());
        }
        for b in &strips[i + 1..] {
            // Each axis' lower limit against the other's upper limit, both multiplied out.
            let turn = (a.slope * b.gain - b.slope * a.gain).abs();
            q = q.min((a.bound * b.gain + b.bound * a.gain) / turn);
        }
    }
    if q.is_nan() { f64::INFINITY } else { q }
}

/// Where nothing bounds q (no axis moves), the path's largest finite bound stands in.
fn replace_infinities(q: &mut [f64]) {
    let largest = q.iter().copied().filter(|q| q.is_finite()).fold(0.0, f64::max);
    q.iter_mut().filter(|q| !q.is_finite()).for_each(|q| *q = largest);
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

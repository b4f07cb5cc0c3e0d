//! Families of paths.

use crate::geometry::grid_path::{GridAxis, GridPath};
use crate::geometry::section::{FeedCap, SpeedCap};
use crate::job::machine::AxisLimits;

/// A small generator: xorshift64*.
pub(super) struct Rng(u64);

impl Rng {
    pub(super) fn new(seed: u64) -> Self {
        Rng(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// Uniform in [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [a, b).
    pub(super) fn within(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }
}

pub(super) fn limits(axes: usize, velocity: f64, acceleration: f64, jerk: f64) -> Vec<AxisLimits> {
    vec![AxisLimits { velocity, acceleration, jerk }; axes]
}

/// One cap over the whole path.
pub(super) fn cap(path: &GridPath, speed: SpeedCap) -> Vec<FeedCap> {
    vec![FeedCap { until: path.grid_length(), speed }]
}

/// The power of two that divides `length` into about 2^bits.
fn grid_step(length: f64, bits: i32) -> f64 {
    2f64.powi(length.log2().floor() as i32 - bits)
}

/// A path with control points on the polygon `at(i)`, about arc length: geometry spans as long as its legs.
fn polygon(points: &[Vec<f64>], spacing: f64, step: f64) -> GridPath {
    let axes = points[0].len();
    let spans = points.len() - 3;
    let steps = (spacing / step).round().max(1.0) as u64;
    let breaks = (0..=spans as u64).map(|k| k * steps).collect();
    let lsb = 2f64.powi((spacing.log2().floor() as i32) - 24);
    let axes = (0..axes)
        .map(|a| GridAxis { lsb, controls: points.iter().map(|p| (p[a] / lsb).round() as i64).collect() })
        .collect();
    GridPath { step, breaks, axes }
}

/// Greville abscissae of uniform clamped knots over `spans` spans of `spacing`.
fn greville(spans: usize, spacing: f64) -> Vec<f64> {
    let knot = |k: isize| (k.clamp(0, spans as isize)) as f64 * spacing;
    (0..spans as isize + 3).map(|i| (knot(i - 2) + knot(i - 1) + knot(i)) / 3.0).collect()
}

/// A random walk whose direction turns by up to about `turn` rad per leg.
pub(super) fn walk(rng: &mut Rng, axes: usize, spans: usize, spacing: f64, turn: f64) -> GridPath {
    let mut direction: Vec<f64> = (0..axes).map(|_| rng.within(-1.0, 1.0)).collect();
    let mut at: Vec<f64> = (0..axes).map(|_| rng.within(-100.0, 100.0) * spacing).collect();
    let nodes = greville(spans, spacing);
    let mut points = vec![at.clone()];
    for leg in nodes.windows(2) {
        direction.iter_mut().for_each(|d| *d += turn * rng.within(-1.0, 1.0));
        let norm = direction.iter().map(|d| d * d).sum::<f64>().sqrt().max(1e-3);
        direction.iter_mut().for_each(|d| *d /= norm);
        at.iter_mut().zip(&direction).for_each(|(p, d)| *p += d * (leg[1] - leg[0]));
        points.push(at.clone());
    }
    polygon(&points, spacing, grid_step(spacing, 14))
}

/// A straight line along `direction` (not normalised) of `length` in u, in `spans` geometry spans.
pub(super) fn line(direction: &[f64], length: f64, spans: usize) -> GridPath {
    let spacing = length / spans as f64;
    let points: Vec<Vec<f64>> =
        greville(spans, spacing).iter().map(|u| direction.iter().map(|d| d * u).collect()).collect();
    polygon(&points, spacing, grid_step(spacing, 20))
}

/// A planar zigzag with legs of `leg`, turning by up to 60 degrees at each, with three geometry spans per leg.
pub(super) fn zigzag(rng: &mut Rng, legs: usize, leg: f64) -> GridPath {
    let spans = 3 * legs;
    let nodes = greville(spans, leg / 3.0);
    let mut angles = Vec::with_capacity(legs + 1);
    for k in 0..=legs {
        let turn = rng.within(0.35, 1.05);
        angles.push(if k % 2 == 0 { turn } else { 0.0 });
    }
    let (mut at, mut points) = (vec![0.0, 0.0], vec![vec![0.0, 0.0]]);
    for pair in nodes.windows(2) {
        let mut u = pair[0];
        while u < pair[1] - 1e-12 {
            let k = (u / leg + 1e-9).floor();
            let end = ((k + 1.0) * leg).min(pair[1]);
            let angle: f64 = angles[(k as usize).min(legs)];
            at[0] += (end - u) * angle.cos();
            at[1] += (end - u) * angle.sin();
            u = end;
        }
        points.push(at.clone());
    }
    polygon(&points, leg / 3.0, grid_step(leg, 14))
}

/// A circle of `radius` travelled `turns` times, `per_turn` geometry spans each.
pub(super) fn circle(radius: f64, turns: f64, per_turn: usize) -> GridPath {
    let spans = (turns * per_turn as f64).round().max(1.0) as usize;
    let spacing = std::f64::consts::TAU * radius / per_turn as f64;
    let points: Vec<Vec<f64>> = greville(spans, spacing)
        .iter()
        .map(|u| vec![radius * (u / radius).cos(), radius * (u / radius).sin()])
        .collect();
    polygon(&points, spacing, grid_step(spacing, 14))
}

/// A path on other `breaks`: the first and last spans are stretched along the end directions, the rest stays.
pub(super) fn with_run_outs(path: &GridPath, breaks: Vec<u64>) -> GridPath {
    let knot =
        |breaks: &[u64], k: isize| breaks[k.clamp(0, breaks.len() as isize - 1) as usize] as f64 * path.step;
    let nodes = |breaks: &[u64]| -> Vec<f64> {
        (0..breaks.len() as isize + 2)
            .map(|i| (knot(breaks, i - 2) + knot(breaks, i - 1) + knot(breaks, i)) / 3.0)
            .collect()
    };
    let (old, new) = (nodes(&path.breaks), nodes(&breaks));
    let shift = (breaks[1] - path.breaks[0]) as f64 * path.step;
    let axes = path
        .axes
        .iter()
        .map(|a| {
            let c: Vec<f64> = a.controls.iter().map(|&c| c as f64).collect();
            let n = old.len();
            let slope =
                [(c[1] - c[0]) / (old[1] - old[0]), (c[n - 1] - c[n - 2]) / (old[n - 1] - old[n - 2])];
            let at = |u: f64| {
                let u = u - shift;
                if u <= 0.0 {
                    return c[0] + slope[0] * u;
                }
                if u >= old[n - 1] {
                    return c[n - 1] + slope[1] * (u - old[n - 1]);
                }
                let k = old.partition_point(|&o| o <= u);
                c[k - 1] + (c[k] - c[k - 1]) * (u - old[k - 1]) / (old[k] - old[k - 1])
            };
            GridAxis { lsb: a.lsb, controls: new.iter().map(|&u| at(u).round() as i64).collect() }
        })
        .collect();
    GridPath { step: path.step, breaks, axes }
}

/// The first axis straight ahead, and a second one that swings by `height` every dozen spans.
pub(super) fn with_wave(path: &GridPath, height: f64) -> GridPath {
    let lsb = path.axes[0].lsb;
    let spacing = (path.breaks[1] as f64 * path.step) / lsb;
    let nodes = greville(path.spans(), spacing);
    let wave = |i: usize| (height / lsb * (i as f64 * 0.5 + (i as f64 * 0.013).sin()).sin()).round() as i64;
    let axes = vec![
        GridAxis { lsb, controls: nodes.iter().map(|u| u.round() as i64).collect() },
        GridAxis { lsb, controls: (0..nodes.len()).map(wave).collect() },
    ];
    GridPath { axes, ..path.clone() }
}

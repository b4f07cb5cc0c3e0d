//! Smooth random paths of any length and number of axes.

use planner::geometry::grid_path::{GridAxis, GridPath};
use planner::job::machine::AxisLimits;

use crate::tables::Random;

/// Grid steps per geometry span.
const SPAN_STEPS: u64 = 1 << 12;

/// A path whose direction turns by up to `turn` rad per axis and geometry span; `spans` of them, `spacing` long in u,
/// which is about arc length.
pub fn meander(random: &mut Random, axes: usize, spans: usize, spacing: f64, turn: f64) -> GridPath {
    let step = 2f64.powi((spacing / SPAN_STEPS as f64).log2().floor() as i32);
    let span_steps = (spacing / step).round() as u64;
    let lsb = 2f64.powi(spacing.log2().floor() as i32 - 20);
    let knot = |k: usize| k.saturating_sub(2).min(spans) as f64 * spacing;
    let greville = |i: usize| (knot(i) + knot(i + 1) + knot(i + 2)) / 3.0;
    let mut heading: Vec<f64> = (0..axes).map(|_| random.between(-1.0, 1.0)).collect();
    let mut at = vec![0.0; axes];
    let mut controls = vec![Vec::with_capacity(spans + 3); axes];
    for i in 0..spans + 3 {
        let leg = greville(i) - greville(i.saturating_sub(1));
        heading.iter_mut().for_each(|h| *h += random.between(-turn, turn));
        let norm = heading.iter().map(|h| h * h).sum::<f64>().sqrt().max(1e-3);
        for ((h, at), controls) in heading.iter_mut().zip(&mut at).zip(&mut controls) {
            *h /= norm;
            *at += *h * leg;
            controls.push((*at / lsb).round() as i64);
        }
    }
    let axes = controls.into_iter().map(|controls| GridAxis { lsb, controls }).collect();
    GridPath { step, breaks: (0..=spans as u64).map(|k| k * span_steps).collect(), axes }
}

/// The same limits on every axis.
pub fn limits(axes: usize, velocity: f64, acceleration: f64, jerk: f64) -> Vec<AxisLimits> {
    vec![AxisLimits { velocity, acceleration, jerk }; axes]
}

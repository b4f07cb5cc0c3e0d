//! Smooth paths drawn at random, the same on every run.

use planner::geometry::grid_path::{GridAxis, GridPath};
use planner::job::machine::AxisLimits;

/// Grid steps per geometry span, and units of u per span.
const SPAN_STEPS: u64 = 1 << 14;
const SPAN: f64 = 4.0;

/// Size of a control integer [mm].
const LSB: f64 = 1.0 / (1u64 << 20) as f64;

/// Largest change of heading per span and axis.
const TURN: f64 = 0.4;

/// The same limits on every axis: 250 mm/s, 2.5 m/s^2, 50 m/s^3.
pub(crate) fn limits(axes: usize) -> Vec<AxisLimits> {
    vec![AxisLimits { velocity: 250.0, acceleration: 2500.0, jerk: 50_000.0 }; axes]
}

/// A path that meanders through all axes at unit speed in u, `spans` geometry spans of 4 mm.
pub(crate) fn meander(axes: usize, spans: usize) -> GridPath {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut sway = || {
        // A linear congruential generator with Knuth's multiplier (MMIX); its upper bits are good.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut heading: Vec<f64> = (0..axes).map(|_| sway()).collect();
    let mut at = vec![0.0; axes];
    let mut points = vec![Vec::with_capacity(spans + 3); axes];
    for leg in (0..spans + 3).map(|i| greville(i, spans) - greville(i.saturating_sub(1), spans)) {
        heading.iter_mut().for_each(|h| *h += TURN * sway());
        let norm = heading.iter().map(|h| h * h).sum::<f64>().sqrt();
        for ((h, at), points) in heading.iter_mut().zip(&mut at).zip(&mut points) {
            *h /= norm;
            *at += *h * leg;
            points.push((*at / LSB).round() as i64);
        }
    }
    let axes = points.into_iter().map(|controls| GridAxis { lsb: LSB, controls }).collect();
    let breaks = (0..=spans as u64).map(|k| k * SPAN_STEPS).collect();
    GridPath { step: SPAN / SPAN_STEPS as f64, breaks, axes }
}

/// Where control point `i` belongs: the mean of its three knots (Greville).
fn greville(i: usize, spans: usize) -> f64 {
    let knot = |k: usize| k.saturating_sub(2).min(spans) as f64 * SPAN;
    (knot(i) + knot(i + 1) + knot(i + 2)) / 3.0
}

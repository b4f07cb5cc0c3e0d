//! Rounding a spline to integers: a path that the feed table carries exactly.

use protocol::table::rules;

use super::certify::Metric;
use super::fit::Spline;
use super::grid_path::{GridAxis, GridPath};
use crate::job::machine::Machine;
use crate::tolerances::{LSB_OVER_SPAN, LSB_OVER_TOLERANCE};

/// Largest control point: every integer up to it is exact in f64.
pub(super) const LARGEST_CONTROL: f64 = (1u64 << 52) as f64;

/// Rounds `spline`; the ends become `start` and `end` exactly [counts]. `None` if a control point is too far from
/// the origin.
///
/// The unit is a drive count divided by the power of two that makes it at most [`LSB_OVER_TOLERANCE`] of
/// `tolerance` [mm] and [`LSB_OVER_SPAN`] of the shortest span.
pub(super) fn round(
    spline: &Spline,
    [start, end]: [&[i64]; 2],
    machine: &Machine,
    metric: &Metric,
    tolerance: f64,
) -> Option<GridPath> {
    let knots = &spline.knots;
    let shortest = (0..knots.spans()).map(|i| knots.length(i)).min().unwrap_or(1) as f64 * knots.step;
    let finest = u32::from(rules::MAX_FRACTION_BITS);
    let n = metric.axes;
    let controls = knots.spans() + 3;
    let mut axes = Vec::with_capacity(n);
    for (a, axis) in machine.axes.iter().take(n).enumerate() {
        let own = if metric.is_linear(a) { tolerance } else { tolerance / metric.rotary_scale(tolerance) };
        let wanted = (LSB_OVER_TOLERANCE * own).min(LSB_OVER_SPAN * shortest);
        let count = 1.0 / axis.counts_per_unit;
        let divisions = (0..finest).find(|&f| count / f64::from(1u32 << f) <= wanted).unwrap_or(finest);
        let scale = f64::from(1u32 << divisions);
        let mut values = Vec::with_capacity(controls);
        for i in 0..controls {
            let value = spline.controls[i * n + a] * axis.counts_per_unit * scale;
            if value.is_nan() || value.abs() > LARGEST_CONTROL {
                return None;
            }
            values.push(value.round() as i64);
        }
        values[0] = start[a] << divisions;
        values[controls - 1] = end[a] << divisions;
        axes.push(GridAxis { lsb: count / scale, controls: values });
    }
    Some(GridPath { step: knots.step, breaks: knots.at.clone(), axes })
}

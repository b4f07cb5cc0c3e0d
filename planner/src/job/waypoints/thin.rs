//! Fewer knots: the way-points that the spline has to pass exactly so that it stays close to all others.
//!
//! A spline through way-points that lie close together repeats every last digit of them, and an error e in a
//! way-point shakes the machine with a jerk of about 6 e (v/h)^3 at a distance h of its neighbours. Through fewer of
//! them, further apart, it is as close to the others and smooth.

use super::fit::Fit;
use crate::splines::cubic::{Cubic, CubicSystem};

/// Distance of the knots to begin with [way-points].
const STRIDE: usize = 128;
/// Share of the tolerance within which the others have to lie: rounding takes a little of the rest.
const SHARE: f64 = 0.9;
/// Rounds of adding knots; then every way-point is one. A knot halves its interval, so 7 suffice but for what one knot
/// changes in the intervals beside its own.
const ROUNDS: usize = 30;

/// Which way-points become knots so that all others lie within `tolerance` [weighted path length] of the spline;
/// `lengths` are the parameter lengths between way-points. All of them where that does not succeed.
///
/// Cost: linear in the way-points, in each of up to 30 rounds.
pub(super) fn kept(fit: &Fit<'_>, lengths: &[f64], tolerance: f64) -> Vec<usize> {
    let count = fit.points.count();
    let all = || (0..count).collect();
    let stride = STRIDE.min((count - 1) / fit.form.ends.least_values().max(4)).max(1);
    if stride == 1 || tolerance.is_nan() || tolerance <= 0.0 {
        return all();
    }
    let values: Vec<Vec<f64>> = fit.columns().map(|column| fit.values(column)).collect();
    let mut kept: Vec<usize> = (0..count - 1).step_by(stride).chain([count - 1]).collect();
    for _ in 0..ROUNDS {
        let Some(missed) = missed(fit, &values, lengths, &kept, SHARE * tolerance) else { return all() };
        if missed.is_empty() {
            return kept;
        }
        kept.extend(missed);
        kept.sort_unstable();
    }
    all()
}

/// A way-point in the middle of every interval between knots in which one is further away than `reach`; `None` where
/// there is no spline.
fn missed(
    fit: &Fit<'_>,
    values: &[Vec<f64>],
    lengths: &[f64],
    kept: &[usize],
    reach: f64,
) -> Option<Vec<usize>> {
    let h: Vec<f64> = kept.windows(2).map(|w| lengths[w[0]..w[1]].iter().sum()).collect();
    let system = CubicSystem::new(h, fit.form.ends).ok()?;
    let values: Vec<Vec<f64>> =
        values.iter().map(|column| kept.iter().map(|&i| column[i]).collect()).collect();
    let splines: Vec<Cubic<'_>> = fit
        .columns()
        .zip(&values)
        .map(|(column, values)| {
            system.interpolate(values, fit.form.end_slopes.map(|slope| slope[fit.points.axes[column]])).ok()
        })
        .collect::<Option<_>>()?;
    let mut missed = Vec::new();
    for (interval, w) in kept.windows(2).enumerate() {
        let inside = &lengths[w[0]..w[1]];
        let end: f64 = inside.iter().sum();
        let mut x = 0.0;
        let far = (w[0] + 1..w[1]).zip(inside).any(|(i, h)| {
            x += h;
            let jet = |column: usize, x: f64| {
                let jet = splines[column].jet(interval, x);
                [jet.value, jet.slope]
            };
            fit.distance(fit.points.row(i), x, end, jet) > reach
        });
        if far {
            missed.push((w[0] + w[1]) / 2);
        }
    }
    Some(missed)
}

//! Rounding the control values to the table's codes, and what it may change.

use super::layout::{Layout, Pieces, strictest};
use super::rows::RowSource;
use super::sweep::Sweep;
use crate::feed::table::FeedTable;
use crate::job::machine::{AxisLimits, MAX_AXES};
use crate::tolerances::UNIT_SIZES;

/// Largest code of a table that 16 bits serve.
pub(super) const SHORT_CODE: f64 = 65535.0;
/// Largest code of a table whose slow or short spans need finer ones.
pub(super) const LONG_CODE: f64 = 4_194_303.0;
/// Relative error of a value computed by the drive in f32: the square's conversion and one product.
const SINGLE: f64 = 1.3e-7;

/// Size of a squared code such that control values up to `ceiling` V^2 have a code, and the table's unit is sound.
pub(super) fn scale(rows: &RowSource) -> f32 {
    scale_of(rows.unit * rows.ceiling, rows.largest_code)
}

/// Size of a squared code such that q up to `top` has a code.
pub(super) fn scale_of(top: f64, largest_code: f64) -> f32 {
    let least = UNIT_SIZES.start().powi(2);
    let exact = (top / (largest_code * largest_code)).max(least);
    let single = exact as f32;
    if f64::from(single) < exact { single.next_up() } else { single }
}

/// Shortest crossing time of a span in which rounding takes at most `share` of an axis' limits.
///
/// With c off by half a code, sqrt(c s), jerk is off by 2 |p'| top/(K J T^2) and acceleration by
/// |p'| top/(K A T), both relative to their limits and alike at any speed; `step` is top/K, the du/dt of code 1.
pub(super) fn shortest_s(slope: f64, limits: &AxisLimits, step: f64, share: f64) -> f64 {
    let unit = slope * step / share;
    (2.0 * unit / limits.jerk).sqrt().max(unit / limits.acceleration)
}

/// Bounds on the change of each control value of x by rounding.
///
/// c = k^2 s changes by at most sqrt(c s) + s/4 when k is rounded to the nearest integer, and by twice that and a
/// little when it is rounded down, as at the ends. The swept q bounds c from above well enough here: the rounded
/// values are checked afterwards.
pub(super) fn halves(rows: &RowSource, scale: f32, sweep: &Sweep) -> Vec<f64> {
    const HEADROOM: f64 = 1.1;
    let s = f64::from(scale) / rows.unit;
    let layout = rows.layout;
    let m = layout.unknowns();
    let mut hint = 0;
    let path = rows.problem.path;
    let swept: Vec<f64> = (0..layout.spans())
        .map(|i| sweep.largest(layout.start(path, i), layout.start(path, i + 1), &mut hint) / rows.unit)
        .collect();
    let fold = rows.fold();
    let mut pieces = Pieces::new(path);
    let knots: Vec<f64> = (1..layout.spans()).map(|k| at_knot(rows, k, &mut pieces)).collect();
    let h = &layout.h;
    (0..m)
        .map(|j| {
            let i = j + 1;
            let bound = swept[i - 1].max(swept[i]).max(swept[i + 1]);
            let c = (HEADROOM * bound).min(rows.ceiling).min(rows.shortest_bound(j, &mut pieces));
            // x at a knot is a mean of the control values on its sides: beside a slow place they are small.
            let left = knots[i - 1] * (h[i - 1] + h[i]) / h[i - 1];
            let right = knots[i] * (h[i] + h[i + 1]) / h[i + 1];
            let c = c.min(left).min(right);
            if j == 0 {
                fold[0] * (2.0 * (rows.joint[0] * s).sqrt() + s + SINGLE * rows.joint[0])
            } else if j + 1 == m {
                fold[1] * (2.0 * (rows.joint[1] * s).sqrt() + s + SINGLE * rows.joint[1])
            } else {
                (c * s).sqrt() + 0.25 * s + SINGLE * c
            }
        })
        .collect()
}

/// Largest x that velocity limits and caps allow at knot `k`.
fn at_knot(rows: &RowSource, k: usize, pieces: &mut Pieces) -> f64 {
    let (layout, problem) = (rows.layout, &rows.problem);
    let g = layout.geometry[k] as usize;
    let x = (layout.knots[k] - problem.path.breaks[g]) as f64 * problem.path.step;
    let mut slopes = [0.0; MAX_AXES];
    slopes.iter_mut().zip(pieces.at(g)).for_each(|(slope, piece)| *slope = piece.first(x).abs());
    let speed =
        problem.limits.iter().zip(slopes).fold(f64::INFINITY, |m, (l, slope)| m.min(l.velocity / slope));
    let speed = [k - 1, k].iter().fold(speed, |m, &span| {
        let caps = strictest(problem.caps, layout.knots[span], layout.knots[span + 1]);
        caps.tangential.iter().flatten().fold(m.min(caps.rate), |m, (mask, speed)| {
            let square: f64 = (0..MAX_AXES).filter(|a| mask >> a & 1 == 1).map(|a| slopes[a].powi(2)).sum();
            m.min(speed / square.sqrt())
        })
    });
    speed * speed / rows.unit
}

/// The table of the control values `x`.
pub(super) fn table(rows: &RowSource, scale: f32, x: &[f64]) -> FeedTable {
    let m = x.len();
    let fold = rows.fold();
    let s = f64::from(scale);
    let root = |x: f64| (x * rows.unit / s).sqrt();
    let code = |k: f64| k.clamp(1.0, rows.largest_code) as u32;
    let codes = (0..m)
        .map(|j| {
            if j == 0 {
                code((root(x[0] / fold[0])).floor())
            } else if j + 1 == m {
                code((root(x[j] / fold[1])).floor())
            } else {
                code(root(x[j]).round())
            }
        })
        .collect();
    FeedTable { path: rows.problem.path.clone(), steps: steps(rows.layout), q_scale: scale, codes }
}

/// Steps of the layout; knots are placed less than 2^32 apart.
fn steps(layout: &Layout) -> Vec<u32> {
    layout.knots.windows(2).map(|k| u32::try_from(k[1] - k[0]).unwrap_or(u32::MAX)).collect()
}

/// The control values of x that the table stands for.
pub(super) fn values(rows: &RowSource, table: &FeedTable) -> Vec<f64> {
    (0..rows.layout.unknowns()).map(|j| table.control(j + 1) / rows.unit).collect()
}

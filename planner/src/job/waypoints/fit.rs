//! From way-points to a section: knots, spline, rounding, and the checks of the rounded path.

use super::WayPointErrorKind as Kind;
use super::{SplineForm, WayPointError, WayPoints, thin};
use crate::geometry::grid_path::{GridAxis, GridPath};
use crate::geometry::section::{BlockMark, Deviation, FeedCap, Marks, Section, SpeedCap};
use crate::job::machine::{Axis, AxisKind};
use crate::job::program::{MoveKind, StopCause};
use crate::splines::cubic::{CubicSystem, Ends, SplineError};
use crate::splines::grid::{Break, KnotGrid};
use crate::tolerances::{DEVIATION_ROUNDING, LSB_NOISE, STALL_SLOPE};

/// Finest division of a drive count is 2^-12.
const MOST_FRACTION_BITS: u32 = 12;

/// Two neighbouring control points differ by less than this [counts].
const CONTROL_STEP: f64 = (1u32 << 20) as f64;

/// Most counts of an axis between two knots at first; overshoot may divide further.
const FIRST_PART: f64 = (1u32 << 19) as f64;

/// Largest control point [lsb]: every integer up to it is exact in f64.
const LARGEST_CONTROL: f64 = (1u64 << 52) as f64;

/// Times that spans with too large control steps are halved.
const HALVINGS: u32 = 24;

/// Coarsest grid step in u.
const COARSEST_STEP: f64 = 1.0 / 128.0;

/// Finest grid step in u, and relative to the path's length.
const FINEST_STEP: f64 = 1.0 / (1u64 << 48) as f64;
const FINEST_SHARE: f64 = 1.0 / (1u64 << 44) as f64;

/// The way-points' spline in the making.
pub(super) struct Fit<'a> {
    /// Those that the spline passes.
    pub(super) points: &'a WayPoints<'a>,
    pub(super) form: &'a SplineForm,
    weights: &'a [f64],
    /// Parameter lengths between them.
    lengths: Vec<f64>,
}

pub(super) fn section(
    points: &WayPoints<'_>,
    form: &SplineForm,
    feed: Option<f64>,
) -> Result<Section, WayPointError> {
    let weights = points.weights();
    let lengths = form.knots.lengths(&points.distances(&weights));
    let all = Fit { points, form, weights: &weights, lengths };
    all.check_request(feed)?;
    let kept = thin::kept(&all, &all.lengths, form.tolerance_mm);
    let lengths = kept.windows(2).map(|w| all.lengths[w[0]..w[1]].iter().sum()).collect();
    let fit = Fit { points: &points.only(&kept), form, weights: &weights, lengths };
    let grid = fit.grid();
    let (path, breaks) = fit.path(&grid)?;
    fit.check_progress(&path, &breaks)?;
    let places = places(&all.lengths, &kept, &grid);
    let deviation = all.deviation(&path, &places);
    let end = path.grid_length();
    let marks = Marks {
        caps: vec![FeedCap {
            until: end,
            speed: feed
                .map_or(SpeedCap::None, |speed| SpeedCap::Tangential { axes: points.counted(), speed }),
        }],
        blocks: blocks(points, &places, &grid),
        deviation,
        end: StopCause::ProgramEnd,
    };
    Ok(Section { kind: MoveKind::Feed, path, marks })
}

/// Places of all way-points on the grid of those kept [grid steps].
fn places(lengths: &[f64], kept: &[usize], grid: &KnotGrid) -> Vec<f64> {
    let mut places = vec![0.0];
    for (w, at) in kept.windows(2).zip(grid.at.windows(2)) {
        let inside = &lengths[w[0]..w[1]];
        let scale = (at[1] - at[0]) as f64 / inside.iter().sum::<f64>();
        let mut x = 0.0;
        for h in &inside[..inside.len() - 1] {
            x += h;
            places.push(at[0] as f64 + x * scale);
        }
        places.push(at[1] as f64);
    }
    places
}

/// Which line every part of the path comes from: the way to the way-point there.
fn blocks(points: &WayPoints<'_>, places: &[f64], grid: &KnotGrid) -> Vec<BlockMark> {
    let end = grid.at[grid.at.len() - 1];
    let mut blocks: Vec<BlockMark> = Vec::with_capacity(places.len());
    for (place, &line) in places.iter().zip(&points.lines).skip(1) {
        let until = (place.round() as u64).min(end);
        if blocks.last().map_or(0, |b| b.until) < until {
            blocks.push(BlockMark { until, line });
        }
    }
    blocks
}

impl Fit<'_> {
    fn axis(&self, column: usize) -> &Axis {
        &self.points.machine.axes[self.points.axes[column]]
    }

    pub(super) fn columns(&self) -> std::ops::Range<usize> {
        0..self.points.axes.len()
    }

    fn fail<T>(&self, kind: Kind) -> Result<T, WayPointError> {
        Err(WayPointError::of_file(&self.points.name, kind))
    }

    /// An error on the way to the way-point that ends `interval`.
    fn fail_at<T>(&self, interval: usize, kind: Kind) -> Result<T, WayPointError> {
        let line = self.points.lines[(interval + 1).min(self.points.count() - 1)];
        Err(WayPointError::of_line(&self.points.name, line, kind))
    }

    /// What is asked for can be done with these way-points.
    fn check_request(&self, feed: Option<f64>) -> Result<(), WayPointError> {
        if let Some(value) = feed.filter(|f| !(*f > 0.0 && f.is_finite())) {
            return self.fail(Kind::Feed { value });
        }
        let (found, least) = (self.points.count(), self.form.ends.least_values());
        if found < least {
            return self.fail(Kind::TooFewPoints { found, least });
        }
        for column in self.columns() {
            let axis = self.axis(column);
            if self.form.ends == Ends::Clamped {
                let slopes = self.form.end_slopes.map(|slope| slope[self.points.axes[column]]);
                if let Some(&value) = slopes.iter().find(|s| !s.is_finite()) {
                    return self.fail(Kind::EndSlope { axis: axis.name.clone(), value });
                }
            }
            let (start, end) = (self.points.row(0)[column], self.points.row(found - 1)[column]);
            if self.form.ends == Ends::Periodic && ((end - start) * axis.counts_per_unit).abs() > 0.5 {
                let kind = Kind::NotClosed { axis: axis.name.clone(), start: shown(start), end: shown(end) };
                return self.fail_at(found - 2, kind);
            }
        }
        Ok(())
    }

    /// Knots of the way-points on a grid that is fine enough for them and for the motion: a thousandth of the
    /// path, a sixteenth of the shortest interval and of the shortest rest span, and a 64th of the way of one
    /// control tick at full speed.
    fn grid(&self) -> KnotGrid {
        let lengths = &self.lengths;
        let total: f64 = lengths.iter().sum();
        let shortest = lengths.iter().fold(f64::INFINITY, |m, &h| m.min(h));
        let mut wanted = COARSEST_STEP.min(total / 1024.0).min(shortest / 16.0);
        for (column, weight) in self.columns().zip(self.weights) {
            let limits = self.axis(column).limits;
            wanted = wanted.min(weight * limits.velocity * self.points.machine.control_tick_s / 64.0);
            if limits.jerk.is_finite() {
                // Where acceleration saturates at the end of a launch at constant jerk: A^3 / (6 J^2).
                let rest = weight * limits.acceleration.powi(3) / (6.0 * limits.jerk.powi(2));
                wanted = wanted.min(rest / 16.0);
            }
        }
        let step = power_of_two_below(wanted.max(total * FINEST_SHARE).max(FINEST_STEP));
        KnotGrid::new(lengths, step)
    }

    /// The positions that the spline of a column takes: the ends on whole counts, so that motion rests there
    /// exactly; likewise all of an axis that stands still.
    pub(super) fn values(&self, column: usize) -> Vec<f64> {
        let counts_per_unit = self.axis(column).counts_per_unit;
        let whole = |v: f64| (v * counts_per_unit).round() / counts_per_unit;
        let width = self.points.axes.len();
        let mut values: Vec<f64> = self.points.values.iter().skip(column).step_by(width).copied().collect();
        let (first, last) = (values[0], values.len() - 1);
        if values.iter().all(|&v| v == first) {
            values.fill(whole(first));
        }
        values[0] = whole(first);
        values[last] = if self.form.ends == Ends::Periodic { values[0] } else { whole(values[last]) };
        values
    }

    /// Fraction bits of every column: rounding adds a jerk of at most 4 lsb / T^3 (and an acceleration of
    /// 4 lsb / T^2) where a span takes the time T.
    fn fraction_bits(&self) -> Vec<u32> {
        let quickest = (1..self.points.count())
            .map(|i| {
                let moves = self.points.row(i).iter().zip(self.points.row(i - 1)).zip(self.columns());
                moves.fold(0.0, |t: f64, ((b, a), c)| t.max((b - a).abs() / self.axis(c).limits.velocity))
            })
            .fold(f64::INFINITY, f64::min);
        let bits = |column: usize| {
            let axis = self.axis(column);
            let noise =
                (axis.limits.jerk * quickest.powi(3)).min(axis.limits.acceleration * quickest.powi(2));
            let wanted = LSB_NOISE * noise / 4.0 * axis.counts_per_unit;
            (0..MOST_FRACTION_BITS)
                .find(|&f| 1.0 <= wanted * f64::from(1u32 << f))
                .unwrap_or(MOST_FRACTION_BITS)
        };
        self.columns().map(bits).collect()
    }

    /// The rounded path, inside the travel and with spans short enough for the drives' arithmetic.
    fn path(&self, grid: &KnotGrid) -> Result<(GridPath, Vec<Break>), WayPointError> {
        let ends = self.form.ends;
        let system = match CubicSystem::new(grid.lengths(), ends) {
            Ok(system) => system,
            Err(SplineError::TooFew { found, least }) => {
                return self.fail(Kind::TooFewPoints { found, least });
            }
            // Rounded lengths are whole steps: no other error is left.
            Err(_) => return self.fail(Kind::Standstill),
        };
        let bits = self.fraction_bits();
        let mut parts: Vec<u32> = (1..self.points.count()).map(|i| self.first_parts(i)).collect();
        for _ in 0..HALVINGS {
            let breaks = grid.breaks(ends, &parts);
            let mut axes: Vec<GridAxis> =
                self.points.machine.axes.iter().map(|a| still(a, &breaks)).collect();
            let mut halve = vec![false; parts.len()];
            for column in self.columns() {
                let axis = self.axis(column);
                let index = self.points.axes[column];
                let out_of_range = || self.fail(Kind::OutOfRange { axis: axis.name.clone() });
                let values = self.values(column);
                let slopes = self.form.end_slopes.map(|slope| slope[index]);
                let Ok(spline) = system.interpolate(&values, slopes) else { return out_of_range() };
                let division = f64::from(1u32 << bits[column]);
                let scale = axis.counts_per_unit * division;
                let mut controls = Vec::with_capacity(breaks.len() + 2);
                for control in grid.controls(&spline, &breaks) {
                    let control = (control * scale).round();
                    if control.is_nan() || control.abs() > LARGEST_CONTROL {
                        return out_of_range();
                    }
                    controls.push(control as i64);
                }
                for (j, w) in controls.windows(2).enumerate() {
                    if w[1].abs_diff(w[0]) as f64 >= CONTROL_STEP * division {
                        // The step from control point j to the next belongs to spans j - 2 to j.
                        let [first, end] =
                            [j.saturating_sub(2), (j + 1).min(breaks.len() - 1)].map(|k| breaks[k]);
                        let inside = usize::from(end.at > grid.at[end.interval]);
                        halve[first.interval..end.interval + inside].fill(true);
                    }
                }
                axes[index] = GridAxis { lsb: 1.0 / scale, controls };
            }
            let path = GridPath { step: grid.step, breaks: breaks.iter().map(|b| b.at).collect(), axes };
            // More knots do not change the curve; inside the travel its slope is bounded, and so are its parts.
            self.check_travel(&path, &breaks)?;
            if halve.iter().all(|&h| !h) {
                return Ok((path, breaks));
            }
            for (parts, _) in parts.iter_mut().zip(&halve).filter(|(_, halve)| **halve) {
                *parts = parts.saturating_mul(2);
            }
        }
        let axis = self.axis(0).name.clone();
        self.fail(Kind::OutOfRange { axis })
    }

    /// Spans that the interval before way-point `i` is divided into at first.
    fn first_parts(&self, i: usize) -> u32 {
        let moves = self.points.row(i).iter().zip(self.points.row(i - 1)).zip(self.columns());
        let counts =
            moves.map(|((b, a), c)| (b - a).abs() * self.axis(c).counts_per_unit).fold(0.0, f64::max);
        (counts / FIRST_PART).ceil().max(1.0) as u32
    }

    /// No axis leaves its travel by more than half a count.
    fn check_travel(&self, path: &GridPath, breaks: &[Break]) -> Result<(), WayPointError> {
        for column in self.columns() {
            let (axis, index) = (self.axis(column), self.points.axes[column]);
            let ([min, max], slack) = (axis.travel, 0.5 / axis.counts_per_unit);
            for (span, b) in breaks.iter().enumerate().take(path.spans()) {
                let (base, bezier) = path.bezier(index, span);
                let origin = base as f64 * path.axes[index].lsb;
                let outside = |v: f64| origin + v < min - slack || origin + v > max + slack;
                if !bezier.into_iter().any(outside) {
                    continue;
                }
                if let Some(value) = extremes(bezier).into_iter().find(|&v| outside(v)) {
                    let value = shown(origin + value);
                    return self
                        .fail_at(b.interval, Kind::Overshoot { axis: axis.name.clone(), value, min, max });
                }
            }
        }
        Ok(())
    }

    /// In every span the path gets on: one of the Bezier coefficients of r' is not small.
    fn check_progress(&self, path: &GridPath, breaks: &[Break]) -> Result<(), WayPointError> {
        for (span, start) in breaks.iter().enumerate().take(path.spans()) {
            let mut squares = [0.0; 3];
            for (&index, weight) in self.points.axes.iter().zip(self.weights) {
                let (_, b) = path.bezier(index, span);
                for (j, square) in squares.iter_mut().enumerate() {
                    *square += (3.0 * weight * (b[j + 1] - b[j])).powi(2);
                }
            }
            let length = (path.breaks[span + 1] - path.breaks[span]) as f64 * path.step;
            let slope = squares.into_iter().fold(0.0, f64::max).sqrt() / length;
            if slope.is_nan() || slope < STALL_SLOPE {
                return self.fail_at(start.interval, Kind::Stall { slope });
            }
        }
        Ok(())
    }

    /// Distance of a way-point from the curve, as a bound: measured at `x` and where the tangent there leads to, between
    /// 0 and `end`. `jet` gives value and slope of a column.
    pub(super) fn distance(
        &self,
        wanted: &[f64],
        x: f64,
        end: f64,
        jet: impl Fn(usize, f64) -> [f64; 2],
    ) -> f64 {
        let measure = |x: f64| {
            let (mut linear, mut rotary, mut along, mut square) = (0.0, 0.0, 0.0, 0.0);
            for ((column, weight), wanted) in self.columns().zip(self.weights).zip(wanted) {
                let [value, slope] = jet(column, x);
                let miss = wanted - value;
                match self.axis(column).kind {
                    AxisKind::Linear => linear += miss * miss,
                    AxisKind::Rotary => rotary += miss * miss,
                }
                along += weight * weight * miss * slope;
                square += weight * weight * slope * slope;
            }
            let step = if square > 0.0 { along / square } else { 0.0 };
            (self.size(linear, rotary), (x + step).clamp(0.0, end))
        };
        let (first, nearer) = measure(x);
        first.min(measure(nearer).0)
    }

    /// Length of a deviation from the squares of its linear and its rotary part [mm].
    fn size(&self, linear: f64, rotary: f64) -> f64 {
        linear.sqrt().max(rotary.sqrt() * self.points.rotary_scale())
    }

    /// Largest distance of the rounded path from a way-point, measured near its place.
    fn deviation(&self, path: &GridPath, places: &[f64]) -> Deviation {
        let (mut bound_mm, mut line) = (0.0, self.points.lines[0]);
        let mut span = 0;
        for (i, &at) in places.iter().enumerate() {
            while span + 1 < path.spans() && path.breaks[span + 1] as f64 <= at {
                span += 1;
            }
            let x = (at - path.breaks[span] as f64) * path.step;
            let end = (path.breaks[span + 1] - path.breaks[span]) as f64 * path.step;
            let wanted = self.points.row(i);
            let pieces: Vec<_> =
                self.points.axes.iter().map(|&index| (index, path.piece(index, span))).collect();
            let origin = |index: usize, base: i64| base as f64 * path.axes[index].lsb;
            let jet = |column: usize, x: f64| {
                let (index, piece) = &pieces[column];
                [origin(*index, piece.base) + piece.offset(x), piece.first(x)]
            };
            let rounding: f64 = pieces
                .iter()
                .zip(wanted)
                .map(|((index, piece), wanted)| {
                    let origin = origin(*index, piece.base);
                    DEVIATION_ROUNDING * (2.0 * wanted.abs() + 2.0 * origin.abs() + piece.offset(x).abs())
                })
                .sum();
            let miss =
                self.distance(wanted, x, end, jet) + self.size(rounding * rounding, rounding * rounding);
            if miss > bound_mm {
                (bound_mm, line) = (miss, self.points.lines[i]);
            }
        }
        let halves = |kind: AxisKind| -> f64 {
            let axes = self.columns().map(|c| self.axis(c)).filter(|a| a.kind == kind);
            axes.map(|a| (0.5 / a.counts_per_unit).powi(2)).sum()
        };
        let resolution = self.size(halves(AxisKind::Linear), halves(AxisKind::Rotary));
        Deviation { tolerance_mm: self.form.tolerance_mm.max(resolution), bound_mm, line }
    }
}

/// An axis that stays at 0.
fn still(axis: &Axis, breaks: &[Break]) -> GridAxis {
    GridAxis { lsb: 1.0 / axis.counts_per_unit, controls: vec![0; breaks.len() + 2] }
}

/// Lowest and highest value of a cubic on [0, 1], from its Bezier coefficients.
fn extremes(b: [f64; 4]) -> [f64; 2] {
    let (d0, d1, d2) = (b[1] - b[0], b[2] - b[1], b[3] - b[2]);
    let mut range = [b[0].min(b[3]), b[0].max(b[3])];
    // Roots of d0 (1-t)^2 + 2 d1 t (1-t) + d2 t^2, without cancellation (Press et al., sec. 5.6).
    let (square, half) = (d0 - 2.0 * d1 + d2, d1 - d0);
    let discriminant = half * half - square * d0;
    if discriminant > 0.0 {
        let sum = -(half + discriminant.sqrt().copysign(half));
        for t in [sum / square, d0 / sum].into_iter().filter(|t| (0.0..=1.0).contains(t)) {
            let s = 1.0 - t;
            let value = s * s * s * b[0] + 3.0 * s * t * (s * b[1] + t * b[2]) + t * t * t * b[3];
            range = [range[0].min(value), range[1].max(value)];
        }
    }
    range
}

/// A position as messages show it.
fn shown(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

fn power_of_two_below(x: f64) -> f64 {
    let power = x.log2().floor().exp2();
    if power > x { 0.5 * power } else { power }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn powers_of_two_are_at_most_the_number() {
        for (x, p) in [(1.0, 1.0), (0.99, 0.5), (1023.9, 512.0), (2f64.powi(-30) * 1.01, 2f64.powi(-30))] {
            assert_eq!(power_of_two_below(x), p);
        }
    }

    proptest! {
        #[test]
        fn extremes_enclose_the_cubic_and_are_reached(b in prop::array::uniform4(-3.0..3.0f64)) {
            let [low, high] = extremes(b);
            let at = |t: f64| {
                let s = 1.0 - t;
                s.powi(3) * b[0] + 3.0 * s * s * t * b[1] + 3.0 * s * t * t * b[2] + t.powi(3) * b[3]
            };
            let samples: Vec<f64> = (0..=500).map(|i| at(f64::from(i) / 500.0)).collect();
            let (least, most) = samples.iter().fold((9.0f64, -9.0f64), |(l, m), &v| (l.min(v), m.max(v)));
            prop_assert!(low <= least + 1e-12 && high >= most - 1e-12);
            prop_assert!(low > least - 1e-3 && high < most + 1e-3);
        }
    }
}

//! From a cubic spline to the integer B-spline form of a grid path.
//!
//! The way-point knots are rounded to grid steps first and the spline is solved on the rounded knots, so that
//! the B-spline is the same curve exactly; only its control points are rounded after that. B-spline basis
//! functions are positive and sum to one, so rounding moves no point of the curve by more than half a unit.

use super::cubic::{Cubic, Ends, Jet};

/// Most grid steps of one geometry span.
const LONGEST_SPAN: u64 = (1 << 29) - 1;

/// The knots of the way-points, rounded.
#[derive(Clone, Debug, PartialEq)]
pub struct KnotGrid {
    /// Length of one grid step in u; a power of two.
    pub step: f64,
    /// One knot per way-point [grid steps], from 0, strictly rising.
    pub at: Vec<u64>,
}

/// A knot of the B-spline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Break {
    /// Where [grid steps].
    pub at: u64,
    /// Interval between way-points that it lies in or starts; one past the last for the end of the path.
    pub interval: usize,
}

impl KnotGrid {
    /// Rounds the parameter lengths between way-points to whole steps, at least one each.
    pub fn new(lengths: &[f64], step: f64) -> Self {
        let mut at = Vec::with_capacity(lengths.len() + 1);
        at.push(0);
        for h in lengths {
            at.push(at[at.len() - 1] + ((h / step).round() as u64).max(1));
        }
        Self { step, at }
    }

    /// The rounded lengths in u.
    pub fn lengths(&self) -> Vec<f64> {
        self.at.windows(2).map(|w| (w[1] - w[0]) as f64 * self.step).collect()
    }

    /// Knots of the B-spline: those of the way-points, and more where interval `i` is to have `parts[i]` spans.
    ///
    /// With not-a-knot ends the first and last inner way-point are no knots: one cubic covers both intervals.
    pub fn breaks(&self, ends: Ends, parts: &[u32]) -> Vec<Break> {
        let intervals = self.at.len() - 1;
        let dropped = |i: usize| ends == Ends::NotAKnot && (i == 1 || i + 1 == intervals);
        let mut breaks = Vec::with_capacity(intervals + 1);
        for (interval, (w, &parts)) in self.at.windows(2).zip(parts).enumerate() {
            let length = w[1] - w[0];
            let parts = u64::from(parts).max(length.div_ceil(LONGEST_SPAN / 2)).min(length);
            for part in 0..parts {
                if part > 0 || interval == 0 || !dropped(interval) {
                    breaks.push(Break { at: w[0] + part_of(length, part, parts), interval });
                }
            }
        }
        breaks.push(Break { at: self.at[intervals], interval: intervals });
        breaks
    }

    /// Control points of the B-spline on `breaks` that is the cubic spline: two more than there are breaks.
    ///
    /// Each is the blossom of a cubic piece at three neighbouring knots (Ramshaw 1989): with h-, h+ the spans
    /// before and after a knot, c = y + y' (h+ - h-)/3 - y'' h- h+ / 6.
    pub fn controls(&self, spline: &Cubic<'_>, breaks: &[Break]) -> Vec<f64> {
        let jet = |b: &Break| -> Jet {
            match b.at - self.at[b.interval] {
                0 => spline.at_knot(b.interval),
                inside => spline.jet(b.interval, inside as f64 * self.step),
            }
        };
        let mut controls = Vec::with_capacity(breaks.len() + 2);
        let mut before = 0.0;
        for (i, b) in breaks.iter().enumerate() {
            let after = breaks.get(i + 1).map_or(0.0, |next| (next.at - b.at) as f64 * self.step);
            let j = jet(b);
            if i == 0 {
                controls.push(j.value);
            }
            controls.push(j.value + (j.slope * (after - before) - 0.5 * j.second * before * after) / 3.0);
            if i + 1 == breaks.len() {
                controls.push(j.value);
            }
            before = after;
        }
        controls
    }
}

/// Steps from the start of an interval of `length` steps to part `part` of `parts` about equal ones.
fn part_of(length: u64, part: u64, parts: u64) -> u64 {
    (u128::from(length) * u128::from(part) / u128::from(parts)) as u64
}

#[cfg(test)]
mod tests;

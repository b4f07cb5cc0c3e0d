//! The way down to lower limits.

use crate::topp::ipm::{Stretch, Workspace};
use crate::topp::rows::RowSource;

/// Lengths of ramps that are tried, in spans.
const RAMPS: [usize; 12] = [4, 6, 9, 14, 20, 30, 45, 70, 110, 160, 240, 360];
/// Shares of a ramp in which its slope builds up, and fades away. The softest is the fastest where there is room for it;
/// others slow down in less.
const ROUNDED: [f64; 3] = [0.5, 0.25, 0.15];
/// Spans that the old plan is followed at most before a ramp, and how many at a time.
const MOST_FOLLOWED: usize = 128;
const FOLLOWED: usize = 2;
/// Slack that the old plan, slowed down, keeps under the new limits.
const SLACK: f64 = 0.01;
/// Reductions that are tried.
const MOST_REDUCTIONS: usize = 40;

/// From one set of limits to a lower one.
pub(super) struct Transition<'a> {
    pub(super) before: &'a RowSource<'a>,
    pub(super) after: &'a RowSource<'a>,
    pub(super) half: &'a [f64],
    /// First control value that may move.
    pub(super) from: usize,
}

impl Transition<'_> {
    /// The old plan `x` slowed down along the ramp that ends first, and the first control value from which on it
    /// keeps the new limits with some slack; `None` when the path ends before.
    ///
    /// Slowing a motion down by one factor slows its acceleration by the same and its jerk by its power of 3/2, so
    /// the old plan has a factor that suits the new limits; the ramp changes over to it.
    pub(super) fn find(&self, x: &[f64], work: &mut Workspace) -> Option<(Vec<f64>, usize)> {
        let factor = factor(self.after, x, self.half, self.from, work)?;
        let (from, ramp, y) = ROUNDED.iter().find_map(|&rounded| self.shortest(x, factor, rounded, work))?;
        // The new limits may hold well before the ramp ends, or even begins.
        let keeps = |j: usize, work: &mut Workspace| {
            work.load(self.after, &y, self.half, Stretch { from: j, to: from + ramp + 5 }, |_| 0.0);
            work.settle() > 0.0
        };
        // Past its end the factor alone decides.
        let (mut low, mut high) = (self.from, from + ramp + 2);
        if keeps(low, work) {
            return Some((y, low));
        }
        while high - low > 1 {
            let middle = (low + high) / 2;
            if keeps(middle, work) { high = middle } else { low = middle }
        }
        Some((y, high))
    }

    /// The ramp of one shape that ends first: where it begins, its length, and the plan slowed down along it.
    fn shortest(
        &self,
        x: &[f64],
        factor: f64,
        rounded: f64,
        work: &mut Workspace,
    ) -> Option<(usize, usize, Vec<f64>)> {
        let m = x.len();
        let mut best: Option<(usize, usize, Vec<f64>)> = None;
        for ramp in RAMPS {
            let latest = best.as_ref().map_or(self.from + MOST_FOLLOWED, |(from, length, _)| {
                from + length - ramp.min(from + length)
            });
            for from in (self.from..=latest).step_by(FOLLOWED) {
                if from + ramp + 6 >= m {
                    break;
                }
                let y = ramped(x, factor, from, ramp, rounded);
                work.load(self.before, &y, self.half, Stretch { from, to: from + ramp + 1 }, |_| 0.0);
                if work.settle() > 0.0 {
                    if best.as_ref().is_none_or(|(f, r, _)| from + ramp < f + r) {
                        best = Some((from, ramp, y));
                    }
                    break;
                }
            }
        }
        best
    }
}

/// The old plan `x` slowed down as a whole until it keeps limits.
pub(super) fn all(limits: &RowSource, x: &[f64], half: &[f64], work: &mut Workspace) -> Option<Vec<f64>> {
    let factor = factor(limits, x, half, 0, work)?;
    Some(x.iter().map(|x| x * factor).collect())
}

/// What the old plan has to be multiplied by to keep limits from a control value on.
fn factor(limits: &RowSource, x: &[f64], half: &[f64], from: usize, work: &mut Workspace) -> Option<f64> {
    let m = x.len();
    let mut factor = 1.0;
    for _ in 0..MOST_REDUCTIONS {
        let y: Vec<f64> = x.iter().map(|x| x * factor).collect();
        work.load(limits, &y, half, Stretch { from, to: m }, |_| 0.0);
        let slack = work.settle();
        if slack > SLACK {
            return Some(factor);
        }
        factor *= (1.0 - 1.5 * SLACK) / (1.0 - slack);
    }
    None
}

/// `x` up to control value `from`, then a change over `ramp` of them to `factor` times x.
fn ramped(x: &[f64], factor: f64, from: usize, ramp: usize, rounded: f64) -> Vec<f64> {
    let change = |j: usize| rounded_share(j, from.max(1) - 1, from + ramp, rounded);
    x.iter().enumerate().map(|(j, x)| x * (1.0 + (factor - 1.0) * change(j))).collect()
}

/// Share of the way of `i` between two numbers.
fn way(i: usize, from: usize, to: usize) -> f64 {
    (i.saturating_sub(from) as f64 / to.saturating_sub(from).max(1) as f64).min(1.0)
}

/// Smooth share of the way of `i` between two numbers.
pub(super) fn share(i: usize, from: usize, to: usize) -> f64 {
    let t = way(i, from, to);
    t * t * (3.0 - 2.0 * t)
}

/// The same with a steady slope between its rounded ends, each a share of the way; half of it is as smooth as [`share`].
fn rounded_share(i: usize, from: usize, to: usize, rounded: f64) -> f64 {
    if rounded >= 0.5 {
        return share(i, from, to);
    }
    let half = |t: f64| {
        let area = 1.0 - rounded;
        if t < rounded { t * t / (2.0 * rounded * area) } else { (t - 0.5 * rounded) / area }
    };
    let t = way(i, from, to);
    if t < 0.5 { half(t) } else { 1.0 - half(1.0 - t) }
}

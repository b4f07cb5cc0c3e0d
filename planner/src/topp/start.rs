//! A strictly feasible start: slow, smooth, and as fast as cheap bounds allow.
//!
//! Scaling x by sigma scales velocity and acceleration rows by sigma, jerk rows by sigma^1.5, and leaves the rest
//! conditions alone: between rests a feasible start always exists.

use super::layout::{Derivatives, Pieces};
use super::rows::{RowSource, dot};
use crate::job::machine::MAX_AXES;

/// Share of the acceleration limit the start's slope may use.
const SLOPE_SHARE: f64 = 0.1;
/// Share of the jerk limit its smoothing aims at.
const JERK_SHARE: f64 = 0.6;
/// Share of the bound at the joints with rest spans.
const JOINT_SHARE: f64 = 0.25;
/// Scale of the first attempt.
const SCALE: f64 = 0.7;
/// Most that neighbouring control values differ where the profile had to be made gentler.
const GENTLE: f64 = 1.25;
/// Share of the bend a span may have that the start uses.
const BEND_SHARE: f64 = 0.9;

/// Where to start from.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// Control values of x, one per inner span; feasible as they are or after scaling down.
    pub(super) x: Vec<f64>,
    /// Whether no span bends more than the table's format allows. On knots forced to lie very unevenly, or where codes
    /// are coarse for slow places, no such start may be found.
    pub(super) bends: bool,
}

/// Profiles to start from, the best first; the next one is for when no scale makes one feasible.
pub(super) fn candidates(rows: &RowSource) -> Vec<Start> {
    let profile = Profile::new(rows);
    let plain = profile.plain();
    if bends(rows, &plain) {
        return vec![Start { x: plain, bends: true }];
    }
    let mut all = Vec::new();
    let gentle = profile.gentle();
    if bends(rows, &gentle) {
        all.push(Start { x: gentle, bends: true });
    } else if let Some(x) = profile.mixed(&plain, |x| bends(rows, x)) {
        all.push(Start { x, bends: true });
    }
    all.push(Start { x: plain, bends: false });
    all
}

/// What profiles are made of.
struct Profile {
    /// Limited in value and slope.
    bounded: Vec<f64>,
    /// The same, smoothed.
    smooth: Vec<f64>,
    /// Between two rests and nothing else.
    free: Vec<f64>,
}

impl Profile {
    fn new(rows: &RowSource) -> Self {
        let layout = rows.layout;
        let m = layout.unknowns();
        let h = &layout.h;
        let mut pieces = Pieces::new(rows.problem.path);
        let (mut x, slope): (Vec<f64>, Vec<f64>) = (0..m).map(|s| constant(rows, s, &mut pieces)).unzip();
        let middles = middles(h);
        erode(&mut x, &middles, smoothing_width(rows));
        for s in 1..m {
            let rise = slope[s].min(slope[s - 1]) * (middles[s] - middles[s - 1]);
            x[s] = x[s].min(x[s - 1] + rise);
        }
        for s in (1..m).rev() {
            let rise = slope[s].min(slope[s - 1]) * (middles[s] - middles[s - 1]);
            x[s - 1] = x[s - 1].min(x[s] + rise);
        }
        let bounded = x.clone();
        for _ in 0..2 {
            smooth(&mut x, h, &middles, 0.5 * smoothing_width(rows));
        }
        let length = middles[m - 1] + 0.5 * h[m] + h[m + 1];
        let free: Vec<f64> = middles
            .iter()
            .map(|u| {
                let launch = JOINT_SHARE * rows.joint[0] * (u / h[0]).powf(4.0 / 3.0);
                let landing = JOINT_SHARE * rows.joint[1] * ((length - u) / h[m + 1]).powf(4.0 / 3.0);
                1.0 / (1.0 / launch + 1.0 / landing)
            })
            .collect();
        Profile { bounded, smooth: x, free }
    }

    /// The smoothed one, from rest to rest.
    fn plain(&self) -> Vec<f64> {
        self.between(&self.smooth)
    }

    /// Neighbours differ by no more than a share of themselves, but for the rests.
    fn gentle(&self) -> Vec<f64> {
        let mut x = self.bounded.clone();
        let m = x.len();
        (1..m).for_each(|s| x[s] = x[s].min(GENTLE * x[s - 1]));
        (1..m).rev().for_each(|s| x[s - 1] = x[s - 1].min(GENTLE * x[s]));
        self.between(&x)
    }

    /// `plain` and as much free motion, which bends least, as `sound` asks for; as much of that as `plain` allows
    /// everywhere.
    fn mixed(&self, plain: &[f64], sound: impl Fn(&[f64]) -> bool) -> Option<Vec<f64>> {
        const MOST_DOUBLINGS: i32 = 60;
        let mut mixed = (0..MOST_DOUBLINGS)
            .map(|k| {
                let share = 1e-6 * 2f64.powi(k);
                plain.iter().zip(&self.free).map(|(x, free)| x + share * free).collect::<Vec<f64>>()
            })
            .find(|x| sound(x))?;
        let scale = plain.iter().zip(&mixed).map(|(x, mixed)| x / mixed).fold(1.0, f64::min);
        mixed.iter_mut().for_each(|x| *x *= scale);
        Some(mixed)
    }

    fn between(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.free).map(|(x, free)| SCALE / (1.0 / x + 1.0 / free)).collect()
    }
}

/// Whether no span bends more than the format allows; scaling does not change that.
fn bends(rows: &RowSource, x: &[f64]) -> bool {
    let m = x.len();
    (0..m).all(|s| {
        let get = |j: usize| if j == 0 || j > m { 0.0 } else { x[j - 1] };
        let c = [get(s), get(s + 1), get(s + 2)];
        let b = rows.bezier(s).map(|b| dot(&b, &c));
        (b[0] - 2.0 * b[1] + b[2]).abs() <= 0.25 * BEND_SHARE * (b[0] + b[2])
    })
}

/// Middles of the inner spans in u: where their control values sit.
fn middles(h: &[f64]) -> Vec<f64> {
    let mut u = h[0];
    h[1..h.len() - 1]
        .iter()
        .map(|h| {
            u += h;
            u - 0.5 * h
        })
        .collect()
}

/// Largest constant x over inner span `s`, and the slope of x it may have there.
fn constant(rows: &RowSource, s: usize, pieces: &mut Pieces) -> (f64, f64) {
    let (layout, problem) = (rows.layout, rows.problem);
    let i = s + 1;
    let g = layout.geometry[i] as usize;
    let offset = (layout.knots[i] - problem.path.breaks[g]) as f64 * problem.path.step;
    let (mut q, mut slope) = (rows.ceiling * rows.unit, f64::INFINITY);
    let mut d = [Derivatives::default(); MAX_AXES];
    for ((d, piece), l) in d.iter_mut().zip(pieces.at(g)).zip(problem.limits) {
        *d = Derivatives::of(piece, offset, layout.h[i]);
        if d.still() {
            continue;
        }
        let first = d.first_max();
        let second = d.second[0].abs().max(d.second[1].abs());
        q = q.min((l.velocity / first).powi(2)).min(l.acceleration / second);
        q = q.min((l.jerk / d.third.abs()).powf(2.0 / 3.0));
        slope = slope.min(SLOPE_SHARE * l.acceleration / first);
    }
    let caps = rows.caps(s);
    q = q.min(caps.rate * caps.rate);
    for (mask, speed) in caps.tangential.iter().flatten() {
        let square: f64 = d
            .iter()
            .enumerate()
            .filter(|(a, _)| mask >> a & 1 == 1)
            .map(|(_, d)| d.first_max().powi(2))
            .sum();
        q = q.min(speed * speed / square);
    }
    q = q.min(rows.shortest_bound(s, pieces) * rows.unit);
    (q / rows.unit, slope / rows.unit)
}

/// Length over which the start is rounded, so that its jerk stays a share of the limit.
fn smoothing_width(rows: &RowSource) -> f64 {
    let ramp = rows
        .problem
        .limits
        .iter()
        .filter(|l| l.jerk.is_finite())
        .map(|l| l.acceleration / l.jerk)
        .fold(0.0, f64::max);
    2.0 * SLOPE_SHARE / JERK_SHARE * ramp * rows.unit.sqrt()
}

/// Smallest value within `width` on both sides, by a queue of candidates.
fn erode(x: &mut [f64], at: &[f64], width: f64) {
    let original = x.to_vec();
    let mut queue = std::collections::VecDeque::new();
    let mut next = 0;
    for s in 0..x.len() {
        while next < x.len() && (next <= s || at[next] <= at[s] + width) {
            while queue.back().is_some_and(|&b: &usize| original[b] >= original[next]) {
                queue.pop_back();
            }
            queue.push_back(next);
            next += 1;
        }
        while queue.front().is_some_and(|&f| at[f] < at[s] - width) {
            queue.pop_front();
        }
        x[s] = queue.front().map_or(x[s], |&f| original[f]);
    }
}

/// Mean over `width` round each control value, the profile held constant beyond its ends.
fn smooth(x: &mut [f64], h: &[f64], at: &[f64], width: f64) {
    let m = x.len();
    // Integral of the piecewise constant profile up to each inner knot.
    let mut integral = vec![0.0];
    for s in 0..m {
        integral.push(integral[s] + x[s] * h[s + 1]);
    }
    let start = at[0] - 0.5 * h[1];
    let mut knots = vec![start];
    for s in 0..m {
        knots.push(knots[s] + h[s + 1]);
    }
    let original = x.to_vec();
    let value = |u: f64| {
        let k = knots.partition_point(|&k| k <= u).clamp(1, m) - 1;
        integral[k] + (u - knots[k]) * original[k]
    };
    for s in 0..m {
        let w = width.max(h[s + 1]);
        x[s] = (value(at[s] + 0.5 * w) - value(at[s] - 0.5 * w)) / w;
    }
}

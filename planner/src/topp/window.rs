//! Paths of any length: windows solved side by side, then once more round their joints.

use rayon::prelude::*;

use super::ipm::{SCALINGS, START_SLACK, Stretch, Workspace};
use super::rows::RowSource;

/// Spans per window.
const WINDOW: usize = 2000;
/// Spans re-solved on either side of a joint.
const REACH: usize = 250;
/// What the first stage leaves below every limit round a joint, so that the second starts well inside. Of the time it
/// costs 5e-6, at the edges of the second stage only; a tenth of it costs 2e-6 and twice the iterations.
const JOINT_MARGIN: f64 = 5e-3;

/// Longest problem that is solved in one piece.
pub(super) const WHOLE: usize = WINDOW + WINDOW / 4;

/// Turns the start profile `x` into the optimum and returns the iterations; `None` when no scale makes it feasible.
pub(super) fn solve(
    source: &RowSource,
    x: &mut Vec<f64>,
    half: &[f64],
    relative_gap: f64,
    whole: usize,
) -> Option<u64> {
    let m = x.len();
    if m <= whole {
        let mut work = Workspace::default();
        work.load(source, x, half, Stretch { from: 0, to: m }, |_| 0.0);
        work.scale_into()?;
        let iterations = work.solve(relative_gap);
        *x = work.moved();
        return Some(u64::from(iterations));
    }
    scale_all(source, x, half)?;
    let count = m.div_ceil(WINDOW);
    let joints: Vec<usize> = (0..=count).map(|k| k * m / count).collect();
    // Two control values at each joint stay at the start profile: no row then sees both windows.
    let windows: Vec<Stretch> = joints
        .windows(2)
        .map(|j| Stretch {
            from: if j[0] == 0 { 0 } else { j[0] + 1 },
            to: if j[1] == m { m } else { j[1] - 1 },
        })
        .collect();
    let near_joint = |s: usize| {
        let k = joints.partition_point(|&j| j <= s);
        let gap = |j: usize| if j == 0 || j == m { usize::MAX } else { j.abs_diff(s) };
        gap(joints[k - 1]).min(gap(joints[k.min(count)])) <= REACH + 1
    };
    let margin = |s: usize| if near_joint(s) { JOINT_MARGIN } else { 0.0 };
    let first = stage(source, x, half, &windows, margin, relative_gap);
    let seams: Vec<Stretch> =
        joints[1..count].iter().map(|&j| Stretch { from: j - REACH, to: j + REACH }).collect();
    let second = stage(source, x, half, &seams, |_| 0.0, relative_gap);
    Some(first + second)
}

/// Solves disjoint stretches that share no row, all from the same `x`.
pub(super) fn stage(
    source: &RowSource,
    x: &mut [f64],
    half: &[f64],
    stretches: &[Stretch],
    margin: impl Fn(usize) -> f64 + Sync,
    relative_gap: f64,
) -> u64 {
    let before: &[f64] = x;
    let solved: Vec<(Vec<f64>, u32)> = stretches
        .par_iter()
        .map_init(Workspace::default, |work, &stretch| {
            work.load(source, before, half, stretch, &margin);
            let iterations = if work.settle() > 0.0 { work.solve(relative_gap) } else { 0 };
            (if iterations == 0 { Vec::new() } else { work.moved() }, iterations)
        })
        .collect();
    let mut iterations = 0;
    for (stretch, (values, count)) in stretches.iter().zip(solved) {
        if !values.is_empty() {
            x[stretch.from..stretch.to].copy_from_slice(&values);
        }
        iterations += u64::from(count);
    }
    iterations
}

/// Scales the whole profile until its least slack is comfortable everywhere.
pub(super) fn scale_all(source: &RowSource, x: &mut [f64], half: &[f64]) -> Option<()> {
    let m = x.len();
    for _ in 0..SCALINGS {
        let starts: Vec<usize> = (0..m).step_by(WINDOW / 4).collect();
        let least = starts
            .par_iter()
            .map_init(Workspace::default, |work, &from| {
                work.load(source, x, half, Stretch { from, to: (from + WINDOW / 4).min(m) }, |_| 0.0);
                work.settle()
            })
            .reduce(|| f64::INFINITY, f64::min);
        if least > START_SLACK {
            return Some(());
        }
        x.iter_mut().for_each(|x| *x *= 0.8);
    }
    None
}

//! Paths of any length: windows solved side by side, then once more round their joints.

use std::cell::RefCell;

use rayon::prelude::*;

use super::horizon::Deadline;
use super::ipm::{Run, Stretch, Workspace};
use super::rows::RowSource;

/// Spans per window.
const WINDOW: usize = 4000;
/// Spans re-solved on either side of a joint.
const REACH: usize = 250;
/// What the first stage leaves below every limit round a joint, so that the second starts well inside. Of the time it
/// costs 5e-6, at the edges of the second stage only; a tenth of it costs 2e-6 and twice the iterations.
const JOINT_MARGIN: f64 = 5e-3;

/// Longest problem that is solved in one piece.
pub(super) const WHOLE: usize = WINDOW + WINDOW / 4;

thread_local! {
    static WORKSPACE: RefCell<Workspace> = RefCell::default();
}

/// Runs `f` in this thread's workspace: memory that has been touched once is kept. What else the thread does while `f`
/// waits for others has a workspace of its own.
pub(super) fn in_workspace<R>(f: impl FnOnce(&mut Workspace) -> R) -> R {
    let mut work = WORKSPACE.take();
    work.deadline = Deadline::NONE;
    work.share_threads(false);
    let result = f(&mut work);
    WORKSPACE.set(work);
    result
}

/// All runs together.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Total {
    /// Iterations.
    pub(super) iterations: u64,
    /// What the control values can at most be above the optimum of every stretch with the others held, as the
    /// kernel counts time.
    pub(super) gap: f64,
}

impl Total {
    fn of(run: Run) -> Self {
        Total { iterations: u64::from(run.iterations), gap: run.gap }
    }
}

/// Turns the start profile `x` into the optimum and returns the iterations; `None` when no scale makes it feasible.
pub(super) fn solve(
    source: &RowSource,
    x: &mut Vec<f64>,
    half: &[f64],
    relative_gap: f64,
    whole: usize,
) -> Option<Total> {
    let m = x.len();
    if m <= whole {
        return in_workspace(|work| {
            work.load(source, x, half, Stretch { from: 0, to: m }, |_| 0.0);
            work.scale_into()?;
            let run = work.solve(relative_gap);
            *x = work.moved();
            Some(Total::of(run))
        });
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
    // The second stage starts where the first ended, and what it leaves undone comes on top.
    Some(Total { iterations: first.iterations + second.iterations, gap: first.gap + second.gap })
}

/// Solves disjoint stretches that share no row, all from the same `x`.
pub(super) fn stage(
    source: &RowSource,
    x: &mut [f64],
    half: &[f64],
    stretches: &[Stretch],
    margin: impl Fn(usize) -> f64 + Sync,
    relative_gap: f64,
) -> Total {
    let before: &[f64] = x;
    let many = stretches.len() > rayon::current_num_threads();
    let solved: Vec<(Vec<f64>, Run)> = stretches
        .par_iter()
        .map(|&stretch| {
            in_workspace(|work| {
                work.share_threads(many);
                work.load(source, before, half, stretch, &margin);
                let run = if work.settle() > 0.0 { work.solve(relative_gap) } else { Run::default() };
                (if run.iterations == 0 { Vec::new() } else { work.moved() }, run)
            })
        })
        .collect();
    let mut total = Total::default();
    for (stretch, (values, run)) in stretches.iter().zip(solved) {
        if !values.is_empty() {
            x[stretch.from..stretch.to].copy_from_slice(&values);
        }
        total.iterations += u64::from(run.iterations);
        total.gap += run.gap;
    }
    total
}

/// Scales the whole profile until its least slack is comfortable everywhere.
pub(super) fn scale_all(source: &RowSource, x: &mut [f64], half: &[f64]) -> Option<()> {
    let m = x.len();
    let starts: Vec<usize> = (0..m).step_by(WINDOW / 8).collect();
    let before: &[f64] = x;
    let many = starts.len() > rayon::current_num_threads();
    let scale = starts
        .par_iter()
        .map(|&from| {
            in_workspace(|work| {
                work.share_threads(many);
                let stretch = Stretch { from, to: (from + WINDOW / 8).min(m) };
                work.load(source, before, half, stretch, |_| 0.0);
                work.scale_into()
            })
        })
        .try_reduce(|| 1.0, |a, b| Some(a.min(b)))?;
    x.iter_mut().for_each(|x| *x *= scale);
    Some(())
}

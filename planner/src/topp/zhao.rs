//! Windows after [Zhao2016 3.2], for comparison with overlapping ones: segments are planned on their own, spliced
//! between the slow places nearest to each joint, and planned once more between the states found there.
//!
//! The stages are those of section 3.2.1: the preparation, then one round of its loop (steps 1 and 2: minima and
//! splices; steps 3 and 4: new end states and segments), which is what its experiments use. Gradual relaxation
//! (section 3.4, method 1) gives each stage larger limits than the one before, so that a stage starts strictly inside
//! what it may use; refinement (method 2) gives the spans round slow places more cells. Two things differ: segments
//! end at the slow speed of the start profile instead of standing still, which no inner span can, and every stage
//! keeps the true jerk limit everywhere instead of the pseudo-jerk of eq. 3.4 at points: each iterate is a plan.

use super::ipm::Stretch;
use super::layout::Layout;
use super::rows::RowSource;
use super::window::{Total, scale_all, stage};

/// Spans per segment; the contour of section 3.3.1 has 300 points in each.
const SEGMENT: usize = 300;
/// Shares of q left unused by preparation and splices: at 0.02, limits are 0.99 V, 0.98 A, 0.97 J, at 0.01 they are
/// 0.995 V, 0.99 A, 0.985 J [Zhao2016 3.4: 0.99, 0.98, 0.96 and 0.995, 0.99, 0.98].
const PREPARED: f64 = 0.02;
const SPLICED: f64 = 0.01;
/// Cells of the spans round a slow place, and how many spans on either side get them.
const SLOW_CELLS: u8 = 4;
const SLOW_REACH: usize = 2;

/// Longest problem that is solved in one piece.
const WHOLE: usize = SEGMENT + SEGMENT / 4;

/// Turns the start profile `x` into a plan and returns what it took; `None` when no scale makes it feasible.
pub(super) fn solve(source: &RowSource, x: &mut [f64], half: &[f64], relative_gap: f64) -> Option<Total> {
    let m = x.len();
    scale_all(source, x, half)?;
    let joints = joints(m);
    if joints.len() == 2 {
        return Some(stage(source, x, half, &[Stretch { from: 0, to: m }], |_| 0.0, relative_gap));
    }
    let segments = segments(&joints);
    let prepared = stage(source, x, half, &segments, |_| PREPARED, relative_gap);
    let splices = splices(x, &joints);
    let spliced = stage(source, x, half, &splices, |_| SPLICED, relative_gap);
    let renewed = stage(source, x, half, &segments, |_| 0.0, relative_gap);
    let iterations = prepared.iterations + spliced.iterations + renewed.iterations;
    Some(Total { iterations, gap: prepared.gap + spliced.gap + renewed.gap })
}

/// Control values at which segments meet, the ends of the path among them.
fn joints(m: usize) -> Vec<usize> {
    let count = if m <= WHOLE { 1 } else { m.div_ceil(SEGMENT) };
    (0..=count).map(|k| k * m / count).collect()
}

/// The segments: two control values at each joint stand still, which are its q and q', and no row sees both sides.
fn segments(joints: &[usize]) -> Vec<Stretch> {
    let m = joints[joints.len() - 1];
    let inner = |j: usize| j != 0 && j != m;
    joints
        .windows(2)
        .map(|j| Stretch {
            from: if inner(j[0]) { j[0] + 1 } else { 0 },
            to: if inner(j[1]) { j[1] - 1 } else { m },
        })
        .collect()
}

/// Step 1: from the last minimum before each joint to the first one after it; where a segment has none, from its
/// middle. Neighbours that meet at one minimum leave it to stand still.
fn splices(x: &[f64], joints: &[usize]) -> Vec<Stretch> {
    let middle = |k: usize| (joints[k] + joints[k + 1]) / 2;
    let minimum = |j: &usize| x[*j] <= x[j - 1] && x[*j] < x[j + 1];
    let mut splices: Vec<Stretch> = (1..joints.len() - 1)
        .map(|k| {
            // The joint itself is the slowest place of all: minima count from the nearest crest on.
            let crest_before = (joints[k - 1] + 2..joints[k]).rev().find(|&j| x[j - 1] < x[j]);
            let before = (joints[k - 1] + 2..crest_before.unwrap_or(0)).rev().find(minimum);
            let crest_after = (joints[k]..joints[k + 1] - 2).find(|&j| x[j + 1] < x[j]);
            let after = (crest_after.unwrap_or(usize::MAX)..joints[k + 1] - 2).find(minimum);
            Stretch { from: before.unwrap_or(middle(k - 1)) + 1, to: after.unwrap_or(middle(k)) - 1 }
        })
        .collect();
    for k in 1..splices.len() {
        if splices[k].from < splices[k - 1].to + 2 {
            (splices[k - 1].to, splices[k].from) = (middle(k) - 1, middle(k) + 1);
        }
    }
    splices
}

/// More cells for the spans round the slow places next to each joint, `speed` being an estimate of q on each inner span.
pub(super) fn refine(layout: &mut Layout, speed: &[f64]) {
    let joints = joints(layout.unknowns());
    if joints.len() == 2 {
        return;
    }
    for splice in splices(speed, &joints) {
        for slow in [splice.from, splice.to] {
            // Control value j belongs to span j + 1.
            for cells in &mut layout.cells[slow + 1 - SLOW_REACH..=slow + 1 + SLOW_REACH] {
                *cells = SLOW_CELLS.max(*cells);
            }
        }
    }
}

//! What the sweep says of a window.

use crate::job::machine::MAX_AXES;
use crate::topp::layout::{Layout, Pieces};
use crate::topp::problem::Problem;
use crate::topp::sweep::Sweep;

/// Largest speed of each axis in the swept motion.
pub(super) fn tops(problem: &Problem, sweep: &Sweep) -> [f64; MAX_AXES] {
    let path = problem.path;
    let per_span = (sweep.stations.len() - 1) / path.spans();
    let mut top = [0.0; MAX_AXES];
    let mut pieces = Pieces::new(path);
    for (k, (&u, &q)) in sweep.stations.iter().zip(&sweep.q).enumerate() {
        let g = (k / per_span).min(path.spans() - 1);
        let x = u - path.breaks[g] as f64 * path.step;
        for (top, piece) in top.iter_mut().zip(pieces.at(g)) {
            *top = (piece.first(x).abs() * q.sqrt()).max(*top);
        }
    }
    top
}

/// Longest distance from the fastest motion to rest, in u.
pub(super) fn braking(problem: &Problem, sweep: &Sweep) -> f64 {
    let slowest = problem
        .limits
        .iter()
        .zip(tops(problem, sweep))
        .filter(|(_, top)| *top > 0.0)
        .map(|(l, top)| top / l.acceleration + l.acceleration / l.jerk)
        .fold(0.0, f64::max);
    0.5 * sweep.top().sqrt() * slowest
}

/// Largest swept x on each inner span, q being `unit` at x = 1.
pub(in crate::topp) fn swept(problem: &Problem, layout: &Layout, sweep: &Sweep, unit: f64) -> Vec<f64> {
    let path = problem.path;
    let mut hint = 0;
    (1..layout.spans() - 1)
        .map(|i| sweep.largest(layout.start(path, i), layout.start(path, i + 1), &mut hint) / unit)
        .collect()
}

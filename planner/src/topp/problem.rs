//! The feed problem and its answer; solvers stand behind these types.

use crate::feed::table::FeedTable;
use crate::geometry::grid_path::GridPath;
use crate::geometry::section::FeedCap;
use crate::job::machine::AxisLimits;

/// Find the fastest motion from rest to rest along a rounded path.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// The rounded path.
    pub path: &'a GridPath,
    /// One per axis of the path.
    pub limits: &'a [AxisLimits],
    /// Caps on the path speed, consecutive, the last one ending with the path.
    pub caps: &'a [FeedCap],
    /// Control tick of the drives [s]; 0 where none plays the table. Spans are placed a tick apart or more; those that
    /// had to be divided may be as short as a twelfth of it.
    pub control_tick_s: f64,
}

/// How to solve it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Which solver.
    pub solver: Solver,
    /// Stop when the remaining gap is below this share of the time; up to ten times it where two iterations on end gain next
    /// to nothing. [`Plan::gap_s`] tells what is left.
    pub relative_gap: f64,
    /// q spans per A/J of motion time, to begin with.
    pub spans_per_ramp: f64,
    /// Share of the time that coarse knots may cost, as estimated from the first solution; where it is more, spans are
    /// divided where it helps, and the problem is solved again. Infinity: never.
    pub largest_loss: f64,
    /// How jerk is written.
    pub jerk: JerkForm,
    /// How rows stand for whole spans.
    pub rows: RowForm,
    /// How long paths are divided.
    pub windows: Windows,
}

impl Default for Settings {
    /// Interior point, a gap of 5e-5 of the time, four spans per ramp and more where they save 0.02 % of the time.
    fn default() -> Self {
        Settings {
            solver: Solver::InteriorPoint,
            relative_gap: 5e-5,
            spans_per_ramp: 4.0,
            largest_loss: 2e-4,
            jerk: JerkForm::True,
            rows: RowForm::Bernstein,
            windows: Windows::Overlap,
        }
    }
}

/// How the jerk limit enters the problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JerkForm {
    /// As it is, by tangents that move with the solution.
    True,
    /// |f| <= J/sqrt(q*), q* swept without jerk [Zhao2016 eq. 3.4]: linear, and stricter.
    Pseudo,
}

/// Where a limit is asked to hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowForm {
    /// Everywhere: rows are Bernstein coefficients.
    Bernstein,
    /// In the middle of each span only, as the literature has it. Such plans fail their certificate.
    Collocation,
}

/// How long paths are divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Windows {
    /// Not at all.
    Whole,
    /// Side by side, then once more round their joints.
    Overlap,
    /// Spliced where the motion is slow, then relaxed and refined [Zhao2016 3.2].
    Zhao,
}

/// The solvers behind the one problem type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// The feasible-start interior-point method of this crate: minimum time under true jerk in one run.
    InteriorPoint,
    /// Clarabel on a sequence of linear programmes with the same rows.
    Clarabel,
}

/// A motion along the path, rounded.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What the drives will play.
    pub table: FeedTable,
    /// Which limit holds each q span down, one per span.
    pub binding: Vec<Binding>,
    /// Iterations of the solver, all windows together.
    pub iterations: u64,
    /// What the solver left: how far the time can at most be above the optimum on these knots under the last tangents
    /// [s]. Infinite where the plan is none of the solver's.
    pub gap_s: f64,
}

/// The limit that rules a span.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Binding {
    /// Velocity of this axis.
    Velocity(u8),
    /// Acceleration of this axis.
    Acceleration(u8),
    /// Jerk of this axis.
    Jerk(u8),
    /// The programmed feed.
    Feed,
    /// The rest at an end of the table.
    Rest,
    /// None within a thousandth.
    Free,
}

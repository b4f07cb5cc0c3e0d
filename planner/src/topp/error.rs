//! Why no motion can be planned.

use super::problem::Problem;
use crate::geometry::section::SpeedCap;
use crate::job::machine::{AxisLimits, MAX_AXES};
use crate::tolerances::{LARGEST_LIMIT, SMALLEST_LIMIT, UNIT_SIZES};

/// A limit of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitKind {
    /// Largest |velocity|.
    Velocity,
    /// Largest |acceleration|.
    Acceleration,
    /// Largest |jerk|.
    Jerk,
}

impl std::fmt::Display for LimitKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            LimitKind::Velocity => "velocity",
            LimitKind::Acceleration => "acceleration",
            LimitKind::Jerk => "jerk",
        })
    }
}

/// Why no motion can be planned, with the place and what would help.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// The path has no axis, or more than a job can move.
    #[error("the path has {axes} axes; from 1 to {MAX_AXES} can be planned")]
    AxisCount {
        /// Axes of the path.
        axes: usize,
    },
    /// Limits and axes do not pair up.
    #[error("{limits} sets of limits were given for {axes} axes; give one per axis")]
    LimitCount {
        /// Sets of limits.
        limits: usize,
        /// Axes of the path.
        axes: usize,
    },
    /// A limit is zero or all but zero, negative or not a number.
    #[error("the {kind} limit of axis {axis} is {value}; it must be positive{}", finite_hint(.kind))]
    Limit {
        /// Axis, from 0.
        axis: usize,
        /// Which limit.
        kind: LimitKind,
        /// Its value.
        value: f64,
    },
    /// A speed cap is zero or all but zero, negative, not a number, or absurdly large.
    #[error("the speed cap up to u = {u} is {value}; a cap must be positive, or absent")]
    Cap {
        /// End of the capped part.
        u: f64,
        /// The cap.
        value: f64,
    },
    /// The caps do not rise, or end before the path does.
    #[error(
        "cap {index} of the path ends at grid step {until}; caps must be consecutive and end with the path"
    )]
    CapOrder {
        /// Index of the cap.
        index: usize,
        /// Where it ends [grid steps].
        until: u64,
    },
    /// The path's numbers are not a spline.
    #[error("the path is no spline: {what}")]
    Path {
        /// What is wrong.
        what: PathFault,
    },
    /// The path has too few grid steps for a table.
    #[error("the path is {steps} grid steps long; at least {needed} are needed: use a finer grid step")]
    TooShort {
        /// Length [grid steps].
        steps: u64,
        /// Least length [grid steps].
        needed: u64,
    },
    /// The motion would need more spans than fit in memory.
    #[error(
        "the motion takes about {seconds} s and {spans} table spans, too many for one section: raise the speed cap or \
         divide the section by a stop"
    )]
    TooLong {
        /// Expected duration [s].
        seconds: f64,
        /// Expected spans.
        spans: f64,
    },
    /// No axis moves.
    #[error("no axis moves on the path: leave the move out")]
    NothingMoves,
    /// No axis moves along a span of the path.
    #[error("no axis moves on the path from u = {from} to u = {to}: take this part out, or stop there")]
    StandsStill {
        /// Start of the span.
        from: f64,
        /// Its end.
        to: f64,
    },
    /// A setting is outside its range.
    #[error("the planner setting {name} is {value}; it must be positive and finite")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A span would last too long, and the grid is too coarse to divide it.
    #[error(
        "span {span} at u = {u} takes {seconds} s, more than a table span may, and the grid is too coarse to divide it: \
         use a finer grid step or raise the speed cap"
    )]
    Slow {
        /// Span of the table.
        span: usize,
        /// Its start.
        u: f64,
        /// Its duration [s].
        seconds: f64,
    },
    /// q varies too much within one span even after refining.
    #[error("the speed varies too much within span {span} at u = {u}: use a finer grid step there")]
    Uneven {
        /// Span of the table.
        span: usize,
        /// Its start.
        u: f64,
    },
    /// Speeds on the path span more decades than the table's codes can carry.
    #[error(
        "the table's codes are too coarse for the slowest place, span {span} at u = {u}: \
         lower the speed cap of the section or split it at a stop"
    )]
    Resolution {
        /// Span of the table.
        span: usize,
        /// Its start.
        u: f64,
    },
}

/// What is wrong with a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PathFault {
    /// The grid step is not a positive number of a sensible size.
    #[error("its grid step is not between 1e-15 and 1e15")]
    Step,
    /// The knots do not rise from zero.
    #[error("its knots do not rise from zero")]
    Breaks,
    /// An axis has the wrong number of control points.
    #[error("an axis has too few or too many control points")]
    Controls,
    /// The resolution of an axis is not a positive number of a sensible size.
    #[error("the resolution of an axis is not between 1e-15 and 1e15")]
    Resolution,
    /// Control points lie so far apart that their differences overflow.
    #[error("its control points are out of range")]
    Range,
}

impl PlanError {
    /// The place on the path that it is about, in u.
    pub fn place(&self) -> Option<f64> {
        match *self {
            PlanError::Cap { u, .. }
            | PlanError::Slow { u, .. }
            | PlanError::Uneven { u, .. }
            | PlanError::Resolution { u, .. } => Some(u),
            PlanError::StandsStill { from, .. } => Some(from),
            PlanError::AxisCount { .. }
            | PlanError::LimitCount { .. }
            | PlanError::Limit { .. }
            | PlanError::CapOrder { .. }
            | PlanError::Path { .. }
            | PlanError::TooShort { .. }
            | PlanError::TooLong { .. }
            | PlanError::NothingMoves
            | PlanError::Setting { .. } => None,
        }
    }
}

fn finite_hint(kind: &LimitKind) -> &'static str {
    match kind {
        LimitKind::Jerk => " (infinite: no jerk limit)",
        LimitKind::Velocity | LimitKind::Acceleration => " and finite",
    }
}

/// Checks everything the solvers rely on.
pub(super) fn validate(problem: &Problem) -> Result<(), PlanError> {
    let path = problem.path;
    let axes = path.axes.len();
    if axes == 0 || axes > MAX_AXES {
        return Err(PlanError::AxisCount { axes });
    }
    validate_limits(problem.limits, axes)?;
    validate_path(problem)?;
    validate_caps(problem)?;
    if !(problem.control_tick_s >= 0.0 && problem.control_tick_s < 0.1) {
        return Err(PlanError::Setting { name: "control_tick_s", value: problem.control_tick_s });
    }
    Ok(())
}

/// Checks the limits of `axes` axes.
pub(super) fn validate_limits(limits: &[AxisLimits], axes: usize) -> Result<(), PlanError> {
    if limits.len() != axes {
        return Err(PlanError::LimitCount { limits: limits.len(), axes });
    }
    for (axis, l) in limits.iter().enumerate() {
        let finite = [(LimitKind::Velocity, l.velocity), (LimitKind::Acceleration, l.acceleration)];
        for (kind, value) in finite {
            if !(value >= SMALLEST_LIMIT && value.is_finite()) {
                return Err(PlanError::Limit { axis, kind, value });
            }
        }
        if l.jerk.is_nan() || l.jerk < SMALLEST_LIMIT {
            return Err(PlanError::Limit { axis, kind: LimitKind::Jerk, value: l.jerk });
        }
    }
    Ok(())
}

fn validate_path(problem: &Problem) -> Result<(), PlanError> {
    let path = problem.path;
    let fault = |what| Err(PlanError::Path { what });
    if !UNIT_SIZES.contains(&path.step) {
        return fault(PathFault::Step);
    }
    let rising = path.breaks.windows(2).all(|w| w[0] < w[1]);
    if path.breaks.len() < 2 || path.breaks[0] != 0 || !rising || path.grid_length() > 1 << 52 {
        return fault(PathFault::Breaks);
    }
    for a in &path.axes {
        if a.controls.len() != path.breaks.len() + 2 {
            return fault(PathFault::Controls);
        }
        if !UNIT_SIZES.contains(&a.lsb) {
            return fault(PathFault::Resolution);
        }
        if a.controls.iter().any(|c| c.unsigned_abs() > 1 << 53) {
            return fault(PathFault::Range);
        }
    }
    if path.axes.iter().all(|a| a.controls.windows(2).all(|w| w[0] == w[1])) {
        return Err(PlanError::NothingMoves);
    }
    let still = |g: &usize| path.axes.iter().all(|a| a.controls[*g..g + 4].windows(2).all(|w| w[0] == w[1]));
    if let Some(g) = (0..path.spans()).find(still) {
        let [from, to] = [g, g + 1].map(|k| path.breaks[k] as f64 * path.step);
        return Err(PlanError::StandsStill { from, to });
    }
    Ok(())
}

fn validate_caps(problem: &Problem) -> Result<(), PlanError> {
    let path = problem.path;
    let mut from = 0;
    for (index, cap) in problem.caps.iter().enumerate() {
        let value = match cap.speed {
            SpeedCap::None => 1.0,
            SpeedCap::Tangential { speed, .. } => speed,
            SpeedCap::Rate(rate) => rate,
        };
        let sound = (SMALLEST_LIMIT..=LARGEST_LIMIT).contains(&value) || value == f64::INFINITY;
        if !sound {
            return Err(PlanError::Cap { u: cap.until as f64 * path.step, value });
        }
        if cap.until <= from {
            return Err(PlanError::CapOrder { index, until: cap.until });
        }
        from = cap.until;
    }
    if !problem.caps.is_empty() && from < path.grid_length() {
        return Err(PlanError::CapOrder { index: problem.caps.len() - 1, until: from });
    }
    Ok(())
}

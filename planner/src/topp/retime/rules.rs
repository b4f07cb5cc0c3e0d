//! What retiming is asked for, and what it answers.

use crate::certificate::LimitKind;
use crate::feed::table::FeedTable;
use crate::geometry::section::{FeedCap, SpeedCap};
use crate::job::machine::AxisLimits;
use crate::topp::PlanError;

/// Limits and caps of a motion.
#[derive(Clone, Copy, Debug)]
pub struct Rules<'a> {
    /// One per axis of the path.
    pub limits: &'a [AxisLimits],
    /// Caps on the path speed, consecutive, the last one ending with the path; empty: no cap.
    pub caps: &'a [FeedCap],
}

/// A table planned anew.
#[derive(Clone, Debug, PartialEq)]
pub struct Retimed {
    /// The table; up to the knot it is the old one.
    pub table: FeedTable,
    /// Knot of the table from which on the new limits hold; before it, the old ones do.
    pub holds_from: usize,
    /// Its place on the path in u.
    pub holds_from_u: f64,
    /// Iterations of the solver.
    pub iterations: u32,
}

/// Why a table cannot be planned anew.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RetimeError {
    /// The knot does not exist, or the table ends within three spans of it.
    #[error("the table cannot be planned anew from knot {knot}; the last that can be is {last}")]
    Knot {
        /// The knot.
        knot: usize,
        /// The last one that could be asked for.
        last: usize,
    },
    /// An override factor that is no positive number.
    #[error("the override factor is {factor}; it must be positive and finite")]
    Factor {
        /// The factor.
        factor: f64,
    },
    /// Limits or caps that make no sense.
    #[error(transparent)]
    Plan(PlanError),
    /// The table is none that was planned.
    #[error("the table is no planned motion")]
    Table,
    /// The motion cannot be brought within the new limits before the table ends.
    #[error(
        "the new {kind:?} limit{} is exceeded {ratio} times at u = {u}, and no way down to it is found before the path ends",
        of_axis(*.kind, *.axis)
    )]
    Unmet {
        /// Place at which it is exceeded most, in u.
        u: f64,
        /// The axis; for a feed cap the mask of its axes.
        axis: u16,
        /// The limit.
        kind: LimitKind,
        /// Value over limit.
        ratio: f64,
    },
    /// No division of the spans makes the new motion fit the table's format.
    #[error("the spans after u = {u} are too short to divide for the new motion")]
    Format {
        /// Place of the knot in u.
        u: f64,
    },
}

/// Caps scaled by an override factor; above 1 they rise.
///
/// # Errors
///
/// [`RetimeError::Factor`] unless the factor is positive and finite.
pub fn scaled(caps: &[FeedCap], factor: f64) -> Result<Vec<FeedCap>, RetimeError> {
    if !(factor > 0.0 && factor.is_finite()) {
        return Err(RetimeError::Factor { factor });
    }
    let speed = |speed| match speed {
        SpeedCap::None => SpeedCap::None,
        SpeedCap::Tangential { axes, speed } => SpeedCap::Tangential { axes, speed: speed * factor },
        SpeedCap::Rate(rate) => SpeedCap::Rate(rate * factor),
    };
    Ok(caps.iter().map(|c| FeedCap { until: c.until, speed: speed(c.speed) }).collect())
}

/// Which axis a limit is of; a feed cap is of the path.
fn of_axis(kind: LimitKind, axis: u16) -> String {
    if kind == LimitKind::Feed { String::new() } else { format!(" of axis {axis}") }
}

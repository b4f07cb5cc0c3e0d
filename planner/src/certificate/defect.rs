//! The conditions without which a table is not a motion at all, checked before anything is computed from it.

use serde::Serialize;
use thiserror::Error;

use crate::feed::table::{FeedTable, MIN_SPANS};
use crate::job::machine::MAX_AXES;
use crate::tolerances::UNIT_SIZES;

/// Largest integer difference: exact in an f64.
const EXACT: u64 = 1 << 53;

/// Why a table is not a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error, Serialize)]
#[serde(tag = "defect", rename_all = "snake_case")]
pub enum TableDefect {
    /// Too short to rest at both ends.
    #[error("the table has {spans} spans, fewer than {MIN_SPANS}")]
    TooFewSpans {
        /// How many it has.
        spans: usize,
    },
    /// Lists whose lengths belong together differ.
    #[error("the table's lists disagree in length")]
    ListLengths,
    /// No axis, or more than a machine has.
    #[error("the table has {axes} axes")]
    AxisCount {
        /// How many it has.
        axes: usize,
    },
    /// Not one set of limits per axis.
    #[error("the number of limits is not the number of axes")]
    LimitCount,
    /// Speed caps that do not follow each other.
    #[error("the speed caps do not follow each other along the path")]
    CapOrder,
    /// A step, a count or the q scale is not a sensible positive number.
    #[error("a unit size of the table is out of range")]
    UnitSize,
    /// Knots do not rise from zero.
    #[error("geometry knot {knot} does not lie after the one before it")]
    Breaks {
        /// Index of the knot.
        knot: usize,
    },
    /// A span has no length.
    #[error("span {span} has no length")]
    EmptySpan {
        /// Index of the span.
        span: usize,
    },
    /// A geometry knot inside a q span, or paths of different length.
    #[error("geometry knot {knot} is not a knot of the motion")]
    KnotMismatch {
        /// Index of the geometry knot.
        knot: usize,
    },
    /// The motion would stop inside the table.
    #[error("the speed at inner place {code} is zero")]
    StandsStill {
        /// Index of the code.
        code: usize,
    },
    /// A jump of control points that no axis can make.
    #[error("control point {control} of axis {axis} is out of range")]
    ControlRange {
        /// Index of the axis.
        axis: usize,
        /// Index of the control point.
        control: usize,
    },
}

/// Checks the structure of a table in one pass.
pub(super) fn check(table: &FeedTable) -> Result<(), TableDefect> {
    let (spans, path) = (table.steps.len(), &table.path);
    if spans < MIN_SPANS {
        return Err(TableDefect::TooFewSpans { spans });
    }
    if path.axes.is_empty() || path.axes.len() > MAX_AXES {
        return Err(TableDefect::AxisCount { axes: path.axes.len() });
    }
    let controls = path.breaks.len() + 2;
    if table.codes.len() != spans - 2
        || path.breaks.len() < 2
        || path.axes.iter().any(|a| a.controls.len() != controls)
    {
        return Err(TableDefect::ListLengths);
    }
    let lsbs = path.axes.iter().map(|a| a.lsb);
    let sizes = lsbs.chain([path.step, f64::from(table.q_scale).sqrt()]);
    if !sizes.into_iter().all(|s| UNIT_SIZES.contains(&s)) {
        return Err(TableDefect::UnitSize);
    }
    if let Some(code) = table.codes.iter().position(|&c| c == 0) {
        return Err(TableDefect::StandsStill { code });
    }
    check_knots(table)?;
    for (axis, a) in path.axes.iter().enumerate() {
        let wild = |w: &[i64]| w[1].checked_sub(w[0]).is_none_or(|d| d.unsigned_abs() >= EXACT);
        if let Some(control) = a.controls.windows(2).position(wild) {
            return Err(TableDefect::ControlRange { axis, control: control + 1 });
        }
    }
    Ok(())
}

/// Both knot sequences rise, start at zero, end together, and the finer one holds the coarser.
fn check_knots(table: &FeedTable) -> Result<(), TableDefect> {
    let breaks = &table.path.breaks;
    if breaks[0] != 0 {
        return Err(TableDefect::Breaks { knot: 0 });
    }
    let rises = |w: &[u64]| w[0] < w[1] && w[1] < EXACT;
    if let Some(knot) = breaks.windows(2).position(|w| !rises(w)) {
        return Err(TableDefect::Breaks { knot: knot + 1 });
    }
    let (mut place, mut next) = (0u64, 1);
    for (span, &step) in table.steps.iter().enumerate() {
        if step == 0 {
            return Err(TableDefect::EmptySpan { span });
        }
        place += u64::from(step);
        match breaks.get(next) {
            Some(&b) if place == b => next += 1,
            Some(&b) if place < b => {}
            _ => return Err(TableDefect::KnotMismatch { knot: next.min(breaks.len() - 1) }),
        }
    }
    if next < breaks.len() { Err(TableDefect::KnotMismatch { knot: next }) } else { Ok(()) }
}

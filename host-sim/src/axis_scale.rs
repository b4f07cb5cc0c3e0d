//! Units of an axis: counts, axis units and SI, converted here and nowhere else.

use planner::job::machine::{Axis, AxisKind, Unit};

/// Factors between drive counts, axis units (mm, deg, rad) and SI (m, rad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisScale {
    /// SI length of one axis unit [m or rad].
    pub si_per_unit: f64,
    /// Axis units of one drive count.
    pub units_per_count: f64,
    /// SI length of one drive count [m or rad].
    pub si_per_count: f64,
}

impl AxisScale {
    /// The factors of `axis`.
    pub fn of(axis: &Axis) -> Self {
        let si_per_unit = match axis.unit {
            Unit::Mm => 1e-3,
            Unit::Deg => core::f64::consts::PI / 180.0,
            Unit::Rad => 1.0,
        };
        let units_per_count = 1.0 / axis.counts_per_unit;
        Self { si_per_unit, units_per_count, si_per_count: si_per_unit * units_per_count }
    }
}

/// Whether lengths of the axis are millimetres, so that they add up to distances in space.
pub fn is_linear(axis: &Axis) -> bool {
    axis.kind == AxisKind::Linear && axis.unit == Unit::Mm
}

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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use planner::job::machine::{AxisLimits, Plant, Servo};

    /// An axis with plausible mechanics.
    pub(crate) fn axis(kind: AxisKind, unit: Unit, counts_per_unit: f64) -> Axis {
        let limits = AxisLimits { velocity: 100.0, acceleration: 1000.0, jerk: 1e4 };
        Axis {
            name: "Q".into(),
            kind,
            unit,
            counts_per_unit,
            travel: [-100.0, 100.0],
            limits,
            rapid: limits,
            headroom: [1.0; 3],
            plant: Plant {
                inertia: 2.0,
                viscous: 1.0,
                coulomb: 0.5,
                effort_limit: 50.0,
                encoder_counts_per_count: 1.0,
                two_mass: None,
            },
            servo: Servo {
                position_gain: 40.0,
                velocity_bandwidth: 250.0,
                integral_time_s: 0.02,
                velocity_feed_forward: 1.0,
                acceleration_feed_forward: 1.0,
            },
        }
    }

    #[test]
    fn a_turn_is_two_pi_in_degrees_and_in_radians() {
        for (unit, turn) in [(Unit::Deg, 360.0), (Unit::Rad, core::f64::consts::TAU)] {
            let scale = AxisScale::of(&axis(AxisKind::Rotary, unit, 2000.0));
            assert!((turn * scale.si_per_unit - core::f64::consts::TAU).abs() < 1e-12);
            assert!((scale.si_per_count * 2000.0 - scale.si_per_unit).abs() < 1e-15);
        }
    }

    #[test]
    fn only_slides_in_millimetres_make_distances() {
        let slide = axis(AxisKind::Linear, Unit::Mm, 1000.0);
        assert!(is_linear(&slide) && !is_linear(&axis(AxisKind::Rotary, Unit::Deg, 1000.0)));
        assert_eq!(AxisScale::of(&slide).si_per_count, 1e-6);
    }
}

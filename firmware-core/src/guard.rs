//! The last line: no set-point beyond the axis' limits reaches the servo, whatever led to it.

use protocol::table::{AxisLimit, Limits};

use crate::axis::AxisConfig;
use crate::evaluate::Setpoint;

/// Share by which a set-point may exceed a limit before the drive faults: more than a proven table ever does.
const TRIP: f32 = 0.02;
/// What rounding adds to the way of one tick [counts].
const STEP_COUNTS: u64 = 2;

/// Limits of set-points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Guard {
    velocity: f32,
    acceleration: f32,
    /// The same while the rate of path time is not 1.
    acceleration_at_rates: f32,
    /// Way of one tick [counts].
    step: u64,
    travel: Option<[i64; 2]>,
}

impl Guard {
    pub(crate) fn new(config: &AxisConfig) -> Self {
        let Limits { velocity, acceleration, .. } = config.limits;
        let (velocity, acceleration) = (velocity * (1.0 + TRIP), acceleration * (1.0 + TRIP));
        Self {
            velocity,
            acceleration,
            acceleration_at_rates: acceleration * config.excess.acceleration,
            step: ((velocity * (config.tick_ns as f32 * 1e-9)) as u64).saturating_add(STEP_COUNTS),
            travel: config.travel,
        }
    }

    /// A set-point that keeps the limits; `last` is the one before, `plain` says that path time goes as planned.
    #[inline]
    pub(crate) fn check(&self, setpoint: &Setpoint, last: i64, plain: bool) -> Result<(), AxisLimit> {
        let moved = setpoint.position.abs_diff(last);
        // What is not a number keeps nothing.
        let slow = setpoint.velocity.abs() <= self.velocity && moved <= self.step;
        if !slow {
            return Err(AxisLimit::Velocity);
        }
        let acceleration = if plain { self.acceleration } else { self.acceleration_at_rates };
        let even = setpoint.acceleration.abs() <= acceleration;
        if !even {
            return Err(AxisLimit::Acceleration);
        }
        let within = setpoint.position == last
            || self.travel.is_none_or(|[low, high]| (low..=high).contains(&setpoint.position));
        if within { Ok(()) } else { Err(AxisLimit::Travel) }
    }
}

//! The way to rest that leaves the path: for a quick stop, and when the path cannot be followed any more.

use protocol::table::Limits;

use crate::double_s::{DoubleSError, MotionLimits, Profile, State, plan_velocity};
use crate::evaluate::Setpoint;
use crate::math::nearest;

/// Ticks in which acceleration is built up where the axis has no limit of jerk.
const SOFT_TICKS: f32 = 4.0;

/// A motion from a set-point to rest in the least time that the axis' limits allow.
#[derive(Clone, Debug)]
pub(crate) struct Landing {
    /// Where it began [counts].
    base: i64,
    profile: Profile<f32>,
    /// Length of a tick [s], and how many have passed.
    tick_s: f32,
    ticks: u32,
}

impl Landing {
    /// From a set-point that has been given, under the axis' own limits; more than these is led back first.
    ///
    /// # Errors
    /// The set-point is no number, or the limits are none.
    pub(crate) fn new(from: &Setpoint, limits: &Limits, tick_ns: u32) -> Result<Self, DoubleSError> {
        let tick_s = tick_ns as f32 * 1e-9;
        let state = State { position: 0.0, velocity: from.velocity, acceleration: from.acceleration };
        let limits = softened(limits, tick_ns);
        let profile = plan_velocity(&state, 0.0, &limits)?;
        Ok(Self { base: from.position, profile, tick_s, ticks: 0 })
    }

    /// The next set-point, one tick after the last one. At the end it is the nearest count, at rest.
    pub(crate) fn next(&mut self) -> Setpoint {
        self.ticks = self.ticks.saturating_add(1);
        let t = self.ticks as f32 * self.tick_s;
        if t >= self.profile.duration() {
            return Setpoint::at_rest(self.end());
        }
        let State { position, velocity, acceleration } = self.profile.at(t);
        Setpoint { position: self.at(position), velocity, acceleration, done: false }
    }

    /// Where it ends [counts].
    pub(crate) fn end(&self) -> i64 {
        self.at(self.profile.end().position)
    }

    /// Ticks until it has ended.
    pub(crate) fn left(&self) -> u64 {
        let all = self.profile.duration() / self.tick_s;
        (all as u64).saturating_add(1).saturating_sub(u64::from(self.ticks))
    }

    fn at(&self, position: f32) -> i64 {
        self.base.saturating_add(i64::from(nearest(position)))
    }
}

/// An axis' limits as limits of a motion.
pub(crate) fn softened(limits: &Limits, tick_ns: u32) -> MotionLimits<f32> {
    let jerk = limits.jerk.unwrap_or(limits.acceleration / (SOFT_TICKS * tick_ns as f32 * 1e-9));
    MotionLimits::symmetric(limits.velocity, limits.acceleration, jerk)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_NS: u32 = 1_000_000;
    const LIMITS: Limits = Limits { velocity: 1e5, acceleration: 1e6, jerk: Some(1e8) };

    fn from(velocity: f32, acceleration: f32) -> Setpoint {
        Setpoint { position: 1 << 40, velocity, acceleration, done: false }
    }

    #[test]
    fn it_takes_as_long_as_the_textbook_says_and_ends_on_a_count() {
        // v/a + a/j = 110 ms.
        let mut landing = Landing::new(&from(1e5, 0.0), &LIMITS, TICK_NS).unwrap();
        assert_eq!(landing.left(), 111);
        let end = landing.end();
        let mut last = landing.next();
        for _ in 0..109 {
            assert!(!last.done);
            let next = landing.next();
            assert!(next.position >= last.position && next.velocity <= last.velocity);
            last = next;
        }
        assert_eq!(landing.next(), Setpoint::at_rest(end));
        // v (v/a + a/j)/2 = 5500 counts.
        assert_eq!(end, (1 << 40) + 5500);
    }

    #[test]
    fn without_a_limit_of_jerk_it_is_soft_all_the_same() {
        let limits = Limits { jerk: None, ..LIMITS };
        let mut landing = Landing::new(&from(-1e5, 0.0), &limits, TICK_NS).unwrap();
        let first = landing.next();
        assert!((first.acceleration - 0.25e6).abs() < 1.0, "{first:?}");
    }

    #[test]
    fn what_is_no_number_has_no_landing() {
        assert!(Landing::new(&from(f32::NAN, 0.0), &LIMITS, TICK_NS).is_err());
        assert!(Landing::new(&from(0.0, f32::INFINITY), &LIMITS, TICK_NS).is_err());
    }
}

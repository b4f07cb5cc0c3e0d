//! A problem with the start inside its limits, and the two changes of view that make one problem of all.

use super::limits::{MotionLimits, State};
use super::real::Real;

/// From a velocity and acceleration to another, a distance away. Sizes of limits are positive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Task<R> {
    pub(super) distance: R,
    pub(super) v0: R,
    pub(super) a0: R,
    pub(super) v1: R,
    pub(super) a1: R,
    pub(super) v_min: R,
    pub(super) v_max: R,
    /// Limits of acceleration, upwards and downwards.
    pub(super) a_up: R,
    pub(super) a_down: R,
    /// Limits of jerk.
    pub(super) j_up: R,
    pub(super) j_down: R,
}

impl<R: Real> Task<R> {
    pub(super) fn new(from: &State<R>, to: &State<R>, limits: &MotionLimits<R>) -> Self {
        Self {
            distance: to.position - from.position,
            v0: from.velocity,
            a0: from.acceleration,
            v1: to.velocity,
            a1: to.acceleration,
            v_min: limits.velocity.min,
            v_max: limits.velocity.max,
            a_up: limits.acceleration.max,
            a_down: -limits.acceleration.min,
            j_up: limits.jerk.max,
            j_down: -limits.jerk.min,
        }
    }

    /// The same motion seen in a mirror.
    pub(super) fn mirrored(&self) -> Self {
        Self {
            distance: -self.distance,
            v0: -self.v0,
            a0: -self.a0,
            v1: -self.v1,
            a1: -self.a1,
            v_min: -self.v_max,
            v_max: -self.v_min,
            a_up: self.a_down,
            a_down: self.a_up,
            j_up: self.j_down,
            j_down: self.j_up,
        }
    }

    /// The same motion played backwards.
    pub(super) fn reversed(&self) -> Self {
        Self {
            distance: -self.distance,
            v0: -self.v1,
            a0: self.a1,
            v1: -self.v0,
            a1: self.a0,
            v_min: -self.v_max,
            v_max: -self.v_min,
            j_up: self.j_down,
            j_down: self.j_up,
            ..*self
        }
    }

    /// Velocity once the start's acceleration has been taken away, as fast as jerk allows.
    pub(super) fn stop_velocity(&self) -> R {
        gained(self.v0, self.a0, self.j_down, self.j_up)
    }

    /// Velocity from which the target's acceleration is built up, as fast as jerk allows.
    pub(super) fn start_velocity(&self) -> R {
        -gained(-self.v1, self.a1, self.j_up, self.j_down)
    }

    /// See [`k`].
    pub(super) fn k(&self) -> R {
        k(self.j_up, self.j_down)
    }
}

/// Half of the sum of what a unit of jerk takes upwards and downwards.
pub(super) fn k<R: Real>(up: R, down: R) -> R {
    R::HALF * (R::ONE / up + R::ONE / down)
}

/// `v` and what it gains while `a` falls to zero under `down`, or rises to it under `up`.
pub(super) fn gained<R: Real>(v: R, a: R, down: R, up: R) -> R {
    if a > R::ZERO { v + R::HALF * a * a / down } else { v - R::HALF * a * a / up }
}

//! States, limits, and what is admissible.

use super::real::Real;

/// Position, velocity and acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<R> {
    /// Position.
    pub position: R,
    /// Velocity.
    pub velocity: R,
    /// Acceleration.
    pub acceleration: R,
}

/// A lower and an upper limit on either side of zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds<R> {
    /// Below zero.
    pub min: R,
    /// Above zero.
    pub max: R,
}

/// Limits of a motion, in units of position per second to the first, second and third.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits<R> {
    /// Velocity.
    pub velocity: Bounds<R>,
    /// Acceleration.
    pub acceleration: Bounds<R>,
    /// Jerk.
    pub jerk: Bounds<R>,
}

/// What a motion is limited in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Position.
    Position,
    /// Velocity.
    Velocity,
    /// Acceleration.
    Acceleration,
    /// Jerk.
    Jerk,
}

/// Why there is no motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DoubleSError {
    /// A number of the start is infinite or NaN.
    Start(Quantity),
    /// A number of the target is infinite or NaN.
    Target(Quantity),
    /// A limit is not a finite number on its side of zero.
    Limit(Quantity),
    /// The target's velocity or acceleration is outside its limits.
    TargetOutside(Quantity),
    /// Whatever leads to the target's acceleration breaks the velocity limit just before it.
    TargetUnreachable,
    /// The numbers lie too many decades apart for the arithmetic: what was found does not arrive.
    Precision,
}

impl<R: Real> Bounds<R> {
    /// The same limit to both sides.
    pub fn symmetric(limit: R) -> Self {
        Self { min: -limit, max: limit }
    }

    fn is_valid(&self) -> bool {
        self.min < R::ZERO && self.max > R::ZERO && self.min.is_finite() && self.max.is_finite()
    }

    /// The same limits seen in a mirror.
    fn mirrored(&self) -> Self {
        Self { min: -self.max, max: -self.min }
    }

    pub(crate) fn hold(&self, x: R) -> bool {
        self.min <= x && x <= self.max
    }
}

impl<R: Real> MotionLimits<R> {
    /// The same limits in both directions.
    pub fn symmetric(velocity: R, acceleration: R, jerk: R) -> Self {
        Self {
            velocity: Bounds::symmetric(velocity),
            acceleration: Bounds::symmetric(acceleration),
            jerk: Bounds::symmetric(jerk),
        }
    }

    /// The same limits seen in a mirror.
    pub(super) fn mirrored(&self) -> Self {
        Self {
            velocity: self.velocity.mirrored(),
            acceleration: self.acceleration.mirrored(),
            jerk: self.jerk.mirrored(),
        }
    }

    pub(crate) fn check(&self) -> Result<(), DoubleSError> {
        if !self.velocity.is_valid() {
            return Err(DoubleSError::Limit(Quantity::Velocity));
        }
        if !self.acceleration.is_valid() {
            return Err(DoubleSError::Limit(Quantity::Acceleration));
        }
        if !self.jerk.is_valid() {
            return Err(DoubleSError::Limit(Quantity::Jerk));
        }
        Ok(())
    }
}

impl<R: Real> State<R> {
    /// The first of its numbers that is none.
    pub(crate) fn fault(&self) -> Option<Quantity> {
        if !self.position.is_finite() {
            Some(Quantity::Position)
        } else if !self.velocity.is_finite() {
            Some(Quantity::Velocity)
        } else if !self.acceleration.is_finite() {
            Some(Quantity::Acceleration)
        } else {
            None
        }
    }
}

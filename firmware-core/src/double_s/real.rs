//! The number that motion is computed with: `f32` on a drive, `f64` on a host.

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// IEEE arithmetic on one of the two widths.
pub trait Real:
    Copy
    + Debug
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// 1/2.
    const HALF: Self;
    /// Distance from 1 to the next number.
    const ULP: Self;
    /// Most steps of a search; far more than any takes.
    const MOST_STEPS: u32;
    /// How far from its target a motion may arrive, relative to its path and its largest velocity and acceleration.
    const ACCEPTED: Self;
    /// How far off the first or last motion of a chain may be and still count, relative to its path: velocities are known
    /// to an ulp only, and beyond these motions there may be a gap.
    const EDGE: Self;

    /// A small whole number.
    fn whole(n: u8) -> Self;

    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;

    /// Cube root of a positive number to about a twentieth.
    fn cube_root_estimate(self) -> Self;

    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool;

    /// Magnitude.
    #[must_use]
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }

    /// The smaller one.
    #[must_use]
    fn least(self, other: Self) -> Self {
        if other < self { other } else { self }
    }

    /// The larger one.
    #[must_use]
    fn most(self, other: Self) -> Self {
        if other > self { other } else { self }
    }

    /// Square root, 0 for what rounding has made negative.
    #[must_use]
    fn root(self) -> Self {
        if self > Self::ZERO { self.sqrt() } else { Self::ZERO }
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const HALF: Self = 0.5;
    const ULP: Self = f32::EPSILON;
    const MOST_STEPS: u32 = 60;
    const ACCEPTED: Self = 1e-3;
    const EDGE: Self = 1e-5;

    fn whole(n: u8) -> Self {
        Self::from(n)
    }

    fn sqrt(self) -> Self {
        crate::math::sqrt(self)
    }

    fn cube_root_estimate(self) -> Self {
        // A third of the exponent, and what the bias lacks of it (Kahan's constant).
        Self::from_bits(self.to_bits() / 3 + 709_921_077)
    }

    fn is_finite(self) -> bool {
        Self::is_finite(self)
    }
}

#[cfg(feature = "host")]
impl Real for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const HALF: Self = 0.5;
    const ULP: Self = f64::EPSILON;
    const MOST_STEPS: u32 = 120;
    const ACCEPTED: Self = 1e-9;
    const EDGE: Self = 1e-10;

    fn whole(n: u8) -> Self {
        Self::from(n)
    }

    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }

    fn cube_root_estimate(self) -> Self {
        Self::from_bits(self.to_bits() / 3 + (715_094_163 << 32))
    }

    fn is_finite(self) -> bool {
        Self::is_finite(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_roots_are_near_on_every_scale() {
        let mut x = 1e-30f32;
        while x < 1e30 {
            let estimate = x.cube_root_estimate();
            assert!((0.94..1.06).contains(&(estimate / libm::cbrtf(x))), "{x}");
            assert!(
                (0.94..1.06).contains(&(f64::from(x).cube_root_estimate() / libm::cbrt(f64::from(x)))),
                "{x}"
            );
            x *= 1.37;
        }
    }
}

//! Numbers side by side, for loops that the compiler turns into vector instructions.
//!
//! Only plain + - * / and comparisons: the results do not depend on which instructions a machine has.

use std::ops::{Add, AddAssign, Div, Mul, Sub};

/// Numbers side by side.
pub(super) const LANES: usize = 4;

/// One number per lane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(32))]
pub(super) struct Lanes(pub(super) [f64; LANES]);

impl Lanes {
    pub(super) const ZERO: Lanes = Lanes([0.0; LANES]);

    #[inline(always)]
    pub(super) fn splat(v: f64) -> Self {
        Lanes([v; LANES])
    }

    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = self;
        for l in 0..LANES {
            out.0[l] = f(self.0[l], other.0[l]);
        }
        out
    }

    /// The larger of two; `self`'s where the other is not a number.
    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        self.with(other, |a, b| if b > a { b } else { a })
    }

    /// The smaller of two; `self`'s where the other is not a number.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        self.with(other, |a, b| if b < a { b } else { a })
    }

    #[inline(always)]
    pub(super) fn abs(mut self) -> Self {
        for v in &mut self.0 {
            *v = v.abs();
        }
        self
    }

    #[inline(always)]
    pub(super) fn sqrt(mut self) -> Self {
        for v in &mut self.0 {
            *v = v.sqrt();
        }
        self
    }

    #[inline(always)]
    pub(super) fn total(&self) -> f64 {
        (self.0[0] + self.0[2]) + (self.0[1] + self.0[3])
    }

    /// The largest lane, and at least `floor`.
    #[inline(always)]
    pub(super) fn largest(&self, floor: f64) -> f64 {
        self.0.iter().fold(floor, |m, &v| if v > m { v } else { m })
    }

    /// The smallest lane, and at most `ceiling`.
    #[inline(always)]
    pub(super) fn smallest(&self, ceiling: f64) -> f64 {
        self.0.iter().fold(ceiling, |m, &v| if v < m { v } else { m })
    }
}

impl Add for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn add(self, other: Lanes) -> Lanes {
        self.with(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn sub(self, other: Lanes) -> Lanes {
        self.with(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn mul(self, other: Lanes) -> Lanes {
        self.with(other, |a, b| a * b)
    }
}

impl Div for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn div(self, other: Lanes) -> Lanes {
        self.with(other, |a, b| a / b)
    }
}

impl Mul<f64> for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn mul(self, factor: f64) -> Lanes {
        self * Lanes::splat(factor)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Lanes) {
        *self = *self + other;
    }
}

/// a.c lane by lane.
#[inline(always)]
pub(super) fn product(a: &[Lanes; 3], c: &[f64; 3]) -> Lanes {
    a[0] * c[0] + a[1] * c[1] + a[2] * c[2]
}

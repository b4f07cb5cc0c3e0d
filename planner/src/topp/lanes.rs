//! Numbers side by side, for loops that the compiler turns into vector instructions.
//!
//! Only + - * / and sqrt, fused multiply-add and comparisons, all rounded correctly: the results do not depend on which
//! instructions a machine has. Without fused multiply-add (x86 before 2013) they come slowly.

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

    /// The larger of two; `self`'s where the other is not a number.
    #[inline(always)]
    pub(super) fn max(mut self, other: Self) -> Self {
        for l in 0..LANES {
            self.0[l] = if other.0[l] > self.0[l] { other.0[l] } else { self.0[l] };
        }
        self
    }

    /// The smaller of two; `self`'s where the other is not a number.
    #[inline(always)]
    pub(super) fn min(mut self, other: Self) -> Self {
        for l in 0..LANES {
            self.0[l] = if other.0[l] < self.0[l] { other.0[l] } else { self.0[l] };
        }
        self
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

    /// self + a b, rounded once.
    #[inline(always)]
    pub(super) fn plus(mut self, a: Lanes, b: Lanes) -> Self {
        for l in 0..LANES {
            self.0[l] = a.0[l].mul_add(b.0[l], self.0[l]);
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
        let mut most = floor;
        for l in 0..LANES {
            most = if self.0[l] > most { self.0[l] } else { most };
        }
        most
    }

    /// The smallest lane, and at most `ceiling`.
    #[inline(always)]
    pub(super) fn smallest(&self, ceiling: f64) -> f64 {
        let mut least = ceiling;
        for l in 0..LANES {
            least = if self.0[l] < least { self.0[l] } else { least };
        }
        least
    }
}

macro_rules! lane_by_lane {
    ($($name:ident, $method:ident, $assign:tt;)*) => {$(
        impl $name for Lanes {
            type Output = Lanes;
            #[inline(always)]
            fn $method(mut self, other: Lanes) -> Lanes {
                for l in 0..LANES {
                    self.0[l] $assign other.0[l];
                }
                self
            }
        }
    )*};
}

lane_by_lane! {
    Add, add, +=;
    Sub, sub, -=;
    Mul, mul, *=;
    Div, div, /=;
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
    (a[0] * c[0]).plus(a[1], Lanes::splat(c[1])).plus(a[2], Lanes::splat(c[2]))
}

/// Three sums of lanes.
#[inline(always)]
pub(super) fn totals(v: &[Lanes; 3]) -> [f64; 3] {
    [v[0].total(), v[1].total(), v[2].total()]
}

/// `factor` a.
#[inline(always)]
pub(super) fn scaled(a: &[Lanes; 3], factor: Lanes) -> [Lanes; 3] {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

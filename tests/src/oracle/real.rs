//! Numbers the oracle computes with: f64, and pairs of them where rounding itself is on trial.

use std::ops::{Add, Div, Mul, Sub};

/// What the oracle needs of a number.
pub trait Real:
    Copy + From<f64> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Square root of a positive number.
    fn root(self) -> Self;
    /// Nearest f64.
    fn near(self) -> f64;
}

impl Real for f64 {
    fn root(self) -> Self {
        self.sqrt()
    }

    fn near(self) -> f64 {
        self
    }
}

/// An unevaluated sum of two f64, about 32 decimal digits (Dekker 1971; Hida, Li & Bailey 2001).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    high: f64,
    low: f64,
}

/// Sum and its exact rounding error (Knuth's TwoSum).
fn two_sum(a: f64, b: f64) -> Pair {
    let high = a + b;
    let part = high - a;
    Pair { high, low: (a - (high - part)) + (b - part) }
}

impl From<f64> for Pair {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Add for Pair {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (s, t) = (two_sum(self.high, other.high), two_sum(self.low, other.low));
        let first = two_sum(s.high, s.low + t.high);
        two_sum(first.high, first.low + t.low)
    }
}

impl Sub for Pair {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + Self { high: -other.high, low: -other.low }
    }
}

impl Mul for Pair {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let high = self.high * other.high;
        let error = self.high.mul_add(other.high, -high);
        two_sum(high, error + (self.high * other.low + self.low * other.high))
    }
}

impl Div for Pair {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * Self::from(first);
        let second = rest.high / other.high;
        let last = (rest - other * Self::from(second)).high / other.high;
        two_sum(first, second) + Self::from(last)
    }
}

impl Real for Pair {
    fn root(self) -> Self {
        let first = Self::from(self.high.sqrt());
        // One step of Heron's rule doubles the digits.
        (first + self / first) * Self::from(0.5)
    }

    fn near(self) -> f64 {
        self.high
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_carry_what_one_number_cannot() {
        let third = Pair::from(1.0) / Pair::from(3.0);
        let back = third + third + third - Pair::from(1.0);
        assert!(back.near().abs() < 1e-31);
        let two = Pair::from(2.0).root();
        assert!((two * two - Pair::from(2.0)).near().abs() < 1e-30);
        let small = (Pair::from(1.0) + Pair::from(1e-25)) - Pair::from(1.0);
        assert!((small.near() / 1e-25 - 1.0).abs() < 1e-6);
    }
}

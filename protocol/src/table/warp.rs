//! How the path time of a table may be slowed, held and hurried: override and feed hold on the path.
//!
//! A drive that plays a table at rate s = d(path time)/dt has v_w = v s, a_w = a s^2 + v s', j_w = j s^3 + 3 a s s' + v s''.
//! With |s'| <= (k - s^2) rho and rho <= A/V this keeps |a_w| <= k A: whatever the axis does on its path, it exceeds what the
//! table was planned for by no more than k, and its jerk by no more than k_j, see [`Warp::suits`]. All numbers are integers per
//! tick, so that every drive comes to the same rate.

use serde::{Deserialize, Serialize};

use super::Limits;

/// Rate 1 in a [`Warp`]: 2^24.
pub const ONE: u32 = 1 << 24;
/// Rate 1 where a rate is counted: 2^48.
pub const RATE_ONE: u64 = 1 << 48;
/// Largest rate, largest factor on acceleration and on jerk.
const MOST_RATE: u32 = 2 * ONE;
const MOST_ACCELERATION: u32 = 8 * ONE;
const MOST_JERK: u32 = 32 * ONE;
/// Largest rho [2^-40 per tick]: products stay below 2^64.
const MOST_SLOPE: u64 = (1 << 36) - 1;
/// What f32 may add to a bound.
const ROUNDING: f32 = 1.0 + 1e-5;

/// Bounds on the rate of path time, and on what it does to the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Warp {
    /// Largest s, at least 1 [2^-24].
    pub rate: u32,
    /// k: acceleration may become so many times what the table was planned for [2^-24].
    pub acceleration: u32,
    /// k_j: and jerk [2^-24].
    pub jerk: u32,
    /// rho [2^-40 per tick].
    pub slope: u64,
    /// Largest |s''| [2^-48 per tick^2].
    pub bend: u64,
}

impl Warp {
    /// Every field is in its range, and a ramp can be begun at any rate.
    pub fn is_valid(&self) -> bool {
        (ONE..=MOST_RATE).contains(&self.rate)
            && self.acceleration <= MOST_ACCELERATION
            && (ONE..=MOST_JERK).contains(&self.jerk)
            && self.slope <= MOST_SLOPE
            && self.bend > 0
            && self.bend <= self.climb()
    }

    /// Largest |s'| at rate `s` [both in 2^-48, per tick], rounded down.
    pub fn descent(&self, s: u64) -> u64 {
        let s = (s >> 24).saturating_add(1).min(u64::from(u32::MAX));
        let square = s.saturating_mul(s) >> 24;
        let room = u64::from(self.acceleration).saturating_sub(square.saturating_add(1));
        room.saturating_mul(self.slope) >> 16
    }

    /// Largest s' at which what is admitted shrinks by less than a bend per tick while the rate grows: bend/(2 rho rate), and a
    /// little less [2^-48 per tick].
    pub fn followed(&self) -> u64 {
        let per_tick = self.slope as f32 / (1u64 << 40) as f32;
        let rate = self.rate as f32 / ONE as f32;
        (self.bend as f32 / (2.0625 * per_tick * rate)) as u64
    }

    /// Largest |s'| at every rate [2^-48 per tick].
    pub fn climb(&self) -> u64 {
        self.descent(u64::from(self.rate) << 24)
    }

    /// Whether an axis with these limits keeps them, times the two factors, at any admissible s, s' and s''.
    pub fn suits(&self, limits: &Limits, tick_ns: u32) -> bool {
        let one = ONE as f32;
        let tick_s = tick_ns as f32 * 1e-9;
        let (top, k, k_j) = (self.rate as f32 / one, self.acceleration as f32 / one, self.jerk as f32 / one);
        let slope = self.slope as f32 / (1u64 << 40) as f32 / tick_s;
        let bend = self.bend as f32 / RATE_ONE as f32 / tick_s / tick_s;
        let Limits { velocity: v, acceleration: a, jerk } = *limits;
        let Some(j) = jerk else { return v * slope <= a * ROUNDING };
        // s^3 + 3 m s (k - s^2) is largest at the top, or where its derivative is zero.
        let m = a * slope / j;
        let (cubic, linear) = (1.0 - 3.0 * m, 3.0 * m * k);
        let at_top = top * (top * top * cubic + linear);
        let turn = -linear / (3.0 * cubic);
        // At s^2 = turn it is s (2/3) linear; squares spare the root.
        let rest = k_j * ROUNDING - v * bend / j;
        let between =
            cubic >= 0.0 || turn >= top * top || turn * linear * linear * (4.0 / 9.0) <= rest * rest;
        v * slope <= a * ROUNDING && rest >= 0.0 && at_top <= rest && between
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn warp() -> Warp {
        // 1 kHz, rho 5/s, s'' 15/s^2.
        let (slope, bend) = (((5e-3 * (1u64 << 40) as f64) as u64), (15e-6 * RATE_ONE as f64) as u64);
        let k = |k: f64| (k * f64::from(ONE)) as u32;
        Warp { rate: ONE, acceleration: k(1.2), jerk: k(1.3), slope, bend }
    }

    #[test]
    fn the_example_of_a_contour_suits_and_more_does_not() {
        let limits = Limits { velocity: 100.0, acceleration: 500.0, jerk: Some(10_000.0) };
        let good = warp();
        assert!(good.is_valid() && good.suits(&limits, 1_000_000));
        for (bad, what) in [
            (Warp { slope: good.slope + good.slope / 1000, ..good }, "slope"),
            (Warp { bend: good.bend + good.bend / 1000, ..good }, "bend"),
            (Warp { jerk: good.jerk - good.jerk / 1000, ..good }, "jerk"),
        ] {
            assert!(bad.is_valid() && !bad.suits(&limits, 1_000_000), "{what}");
        }
        for bad in [
            Warp { rate: ONE - 1, ..good },
            Warp { rate: MOST_RATE + 1, ..good },
            Warp { acceleration: ONE, ..good },
            Warp { bend: 0, ..good },
            Warp { bend: good.climb() + 1, ..good },
            Warp { slope: MOST_SLOPE + 1, ..good },
        ] {
            assert!(!bad.is_valid(), "{bad:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(3), ..ProptestConfig::default() })]

        #[test]
        fn what_suits_keeps_acceleration_and_jerk_at_every_rate(
            slope in 0.01f64..50.0, bend in 0.1f64..1e4, rate in 1.0f64..1.5, k in 1.0f64..3.0, k_j in 1.0f64..5.0,
            v in 0.1f32..1e4, a in 0.1f32..1e5, j in 0.1f32..1e7,
        ) {
            let one = f64::from(ONE);
            let warp = Warp {
                rate: (rate * one) as u32,
                acceleration: (k * one) as u32,
                jerk: (k_j * one) as u32,
                slope: (slope * 1e-3 * (1u64 << 40) as f64) as u64,
                bend: (bend * 1e-6 * RATE_ONE as f64) as u64,
            };
            let limits = Limits { velocity: v, acceleration: a, jerk: Some(j) };
            let suits = warp.suits(&limits, 1_000_000);
            let (v, a, j) = (f64::from(v), f64::from(a), f64::from(j));
            let mut worst = [0.0f64; 2];
            for part in 0..=2000 {
                let s = rate * f64::from(part) / 2000.0;
                let slowing = (k - s * s).max(0.0) * slope;
                let told = warp.descent((s * RATE_ONE as f64) as u64) as f64 / RATE_ONE as f64 * 1e3;
                prop_assert!(told <= slowing * (1.0 + 1e-9) + 1e-9);
                worst[0] = worst[0].max((a * s * s + v * slowing) / a / k);
                worst[1] = worst[1].max((s * s * s + 3.0 * a / j * s * slowing + v * bend / j) / k_j);
            }
            if suits {
                prop_assert!(worst[1] <= 1.0 + 1e-4, "{worst:?}");
                prop_assert!(k < rate * rate || worst[0] <= 1.0 + 1e-4, "{worst:?}");
            } else {
                prop_assert!(worst[0] > 1.0 - 1e-3 || worst[1] > 1.0 - 1e-3, "{worst:?}");
            }
        }
    }
}

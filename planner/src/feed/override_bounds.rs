//! How fast the rate of path time may change, so that every axis keeps its limits times the factors that overrides may take.
//!
//! With |s'| <= (k - s^2) rho and rho <= min A/V acceleration stays below k A. Jerk is
//! |j| <= J s^3 + 3 A s (k - s^2) rho + V |s''|: what the first two leave of k_j J is left to s''. A smaller rho leaves more to s'',
//! so that the best rho is searched for: the one with the shortest way from rate 1 to a hold.

use protocol::table::Limits;
use protocol::table::warp::{ONE, RATE_ONE, Warp};

use crate::job::machine::OverrideRule;

/// Candidates for rho, each a sixth of an octave below the one before.
const CANDIDATES: i32 = 120;
/// Taken off both bounds, for the rounding of the drives' own check.
const ROUNDING: f64 = 1.0 - 2e-5;
/// Ticks in which s' is built up where jerk is not limited.
const SOFT_TICKS: f64 = 4.0;

/// The bounds of a table for these limits; none where the control tick is too long for any.
pub fn warp(rule: &OverrideRule, limits: &[Limits], tick_ns: u32) -> Option<Warp> {
    let tick_s = f64::from(tick_ns) * 1e-9;
    let over = |l: &Limits| f64::from(l.acceleration) / f64::from(l.velocity);
    let steepest = limits.iter().map(over).fold(f64::INFINITY, f64::min) * ROUNDING;
    let best = (0..CANDIDATES)
        .filter_map(|n| {
            let slope = steepest * (-f64::from(n) / 6.0).exp2();
            let bend = bend(rule, limits, slope, tick_s)?;
            Some((hold_time_s(rule, slope, bend), slope, bend))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let (_, slope, bend) = best?;
    let fixed = |x: f64| (x * f64::from(ONE)) as u32;
    let warp = Warp {
        // Rounded up: the largest override itself is one.
        rate: if rule.most == 1.0 { ONE } else { fixed(rule.most) + 2 },
        acceleration: fixed(rule.acceleration),
        jerk: fixed(rule.jerk),
        slope: (slope * tick_s * (1u64 << 40) as f64) as u64,
        bend: 0,
    };
    let bend = (bend * tick_s * tick_s * RATE_ONE as f64) as u64;
    let warp = Warp { bend: bend.min(warp.climb()), ..warp };
    (warp.is_valid() && limits.iter().all(|l| warp.suits(l, tick_ns))).then_some(warp)
}

/// Largest |s''| beside this rho [1/s^2].
fn bend(rule: &OverrideRule, limits: &[Limits], slope: f64, tick_s: f64) -> Option<f64> {
    let climb = (rule.acceleration - rule.most * rule.most) * slope;
    let soft = climb / (SOFT_TICKS * tick_s);
    let left = limits.iter().filter_map(|l| {
        let jerk = f64::from(l.jerk?);
        let turning = f64::from(l.acceleration) * slope / jerk;
        let used = peak(turning, rule.acceleration, rule.most);
        Some((rule.jerk * ROUNDING - used) * jerk / f64::from(l.velocity))
    });
    let bend = left.fold(soft, f64::min);
    (bend > 0.0).then_some(bend)
}

/// Largest s^3 + 3 m s (k - s^2) for 0 <= s <= top.
fn peak(m: f64, k: f64, top: f64) -> f64 {
    let value = |s: f64| s * (s * s + 3.0 * m * (k - s * s));
    let turn = (m * k / (3.0 * m - 1.0)).max(0.0).sqrt();
    let inside = if 3.0 * m > 1.0 && turn < top { value(turn) } else { 0.0 };
    value(top).max(inside)
}

/// About how long it takes from rate 1 to 0 [s].
fn hold_time_s(rule: &OverrideRule, slope: f64, bend: f64) -> f64 {
    let steep = slope * (rule.acceleration - 0.5);
    if steep * steep < bend { 1.0 / steep + steep / bend } else { 2.0 / bend.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_NS: u32 = 1_000_000;

    fn limits(velocity: f32, acceleration: f32, jerk: f32) -> Limits {
        Limits { velocity, acceleration, jerk: Some(jerk) }
    }

    #[test]
    fn a_mill_can_be_held_in_half_a_second() {
        let axes = [limits(2.5e6, 2.5e7, 5e8), limits(2.0e6, 1.5e7, 3e8)];
        let warp = warp(&OverrideRule::default(), &axes, TICK_NS).unwrap();
        let per_s = warp.slope as f64 / (1u64 << 40) as f64 * 1e3;
        assert!((3.0..=7.5).contains(&per_s), "{per_s}");
        let bend = warp.bend as f64 / RATE_ONE as f64 * 1e6;
        assert!((10.0..60.0).contains(&bend), "{bend}");
        assert!(hold_time_s(&OverrideRule::default(), per_s, bend) < 0.7);
    }

    #[test]
    fn every_machine_gets_bounds_that_suit_it() {
        let rules = [
            OverrideRule::default(),
            OverrideRule { most: 1.2, ..OverrideRule::default() },
            OverrideRule { most: 1.0, acceleration: 1.0, jerk: 1.0 },
            OverrideRule { most: 1.5, acceleration: 4.0, jerk: 4.0 },
        ];
        for rule in rules.map(|rule| rule.of_plans()) {
            for v in [1e2f32, 1e6] {
                for a in [0.3f32, 3.0, 300.0] {
                    for j in [1.0f32, 10.0, 1e4] {
                        let axes = [
                            limits(v, v * a, v * a * j),
                            Limits { jerk: None, ..limits(v, 9.0 * v * a, 1.0) },
                        ];
                        for tick_ns in [25_000, TICK_NS, 4_000_000] {
                            let warp = warp(&rule, &axes, tick_ns);
                            // What takes no more than a few ticks needs no ramp that fits into them.
                            let coarse = a * 1e-9 * tick_ns as f32 > 0.1 || j * 1e-9 * tick_ns as f32 > 0.1;
                            assert!(warp.is_some() || coarse, "{rule:?} {v} {a} {j} {tick_ns}");
                        }
                    }
                }
            }
        }
    }
}

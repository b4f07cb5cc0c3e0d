//! The rate of path time: override and feed hold, in integers, alike on every drive that hears the same at the same tick.
//!
//! Per tick the step of the rate changes by one bend of the [`Warp`] at most, and stays below what the rate admits. Of the
//! steps that are left the largest is taken from which the rate can still be brought to the target; what is then left is less
//! than a bend, and is one step.

use protocol::table::Warp;
use protocol::table::warp::RATE_ONE;

/// Rates per permille [2^-48].
const PERMILLE: u64 = RATE_ONE / 1000;

/// The rate at the present tick, and how it changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rate {
    /// s [2^-48].
    s: u64,
    target: u64,
    /// Of the last tick: s' = steps bend + rest [2^-48 per tick].
    steps: i64,
    rest: i64,
    bend: i64,
    /// Path time goes as planned, and nothing changes that.
    plain: bool,
}

/// What a tick does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pace {
    /// s at the tick, and its derivative by ticks.
    pub(crate) s: f32,
    pub(crate) change: f32,
    /// Mean of s until the next tick [2^-30].
    pub(crate) mean: u64,
}

impl Default for Rate {
    fn default() -> Self {
        Self { s: RATE_ONE, target: RATE_ONE, steps: 0, rest: 0, bend: 1, plain: true }
    }
}

/// A rate as a number.
fn rate(s: u64) -> f32 {
    (s >> 24) as u32 as f32 * (1.0 / (1u32 << 24) as f32)
}

/// A commanded rate [2^-48].
pub(crate) fn of_permille(permille: u16) -> u64 {
    if permille == 1000 { RATE_ONE } else { u64::from(permille).saturating_mul(PERMILLE) }
}

impl Rate {
    /// Path time goes as planned, and nothing changes that.
    pub(crate) fn is_plain(&self) -> bool {
        self.plain
    }

    fn look(&mut self) {
        self.plain = self.s == RATE_ONE && self.is_steady();
    }

    /// The rate does not change.
    pub(crate) fn is_steady(&self) -> bool {
        self.s == self.target && self.steps == 0 && self.rest == 0
    }

    /// Path time stands still, and goes on standing still.
    pub(crate) fn is_held(&self) -> bool {
        self.is_steady() && self.s == 0
    }

    /// Asks for another rate.
    pub(crate) fn aim(&mut self, target: u64) {
        self.target = target;
        self.look();
    }

    /// While nothing moves the rate may jump.
    pub(crate) fn jump(&mut self) {
        (self.s, self.steps, self.rest) = (self.target, 0, 0);
        self.look();
    }

    /// The rate that is wanted [2^-48].
    pub(crate) fn target(&self) -> u64 {
        self.target
    }

    /// One tick on, within the bounds of the table that plays.
    pub(crate) fn advance(&mut self, warp: &Warp) -> Pace {
        let (before, s) = (self.step(), self.s);
        if self.is_steady() {
            return Pace { s: rate(s), change: 0.0, mean: s >> 18 };
        }
        self.bend = warp.bend as i64;
        self.choose(warp);
        let after = self.step();
        self.s = self.s.saturating_add_signed(after);
        self.look();
        Pace {
            s: rate(s),
            change: before.saturating_add(after) as f32 * (0.5 / RATE_ONE as f32),
            mean: s.saturating_add(self.s) >> 19,
        }
    }

    fn step(&self) -> i64 {
        // Below 2^50: no rate is left behind in one tick.
        self.steps.wrapping_mul(self.bend).wrapping_add(self.rest)
    }

    /// The step until the next tick.
    fn choose(&mut self, warp: &Warp) {
        let bend = self.bend;
        // Rates are below 2^50, steps and bends below what the rate admits per tick.
        let far = (self.target as i64).wrapping_sub(self.s as i64);
        if self.rest != 0 || (self.steps == 0 && far.abs() < bend) {
            // The last step of a ramp, and the end of it.
            let last = if self.rest == 0 { far } else { 0 };
            (self.steps, self.rest) = (0, last);
            return;
        }
        // Seen towards the target.
        let sign = if far < 0 { -1 } else { 1 };
        let (far, steps) = if far < 0 { (-far, -self.steps) } else { (far, self.steps) };
        if steps < 0 {
            self.steps = self.steps.wrapping_add(sign);
            return;
        }
        let climb = warp.climb() as i64;
        let descent = warp.descent(self.s) as i64;
        // Speeding up, what is admitted shrinks as the rate grows: no more than can be followed by less than a bend per tick.
        let steepest = warp.followed() as i64;
        let admitted = |ahead: i64| {
            if sign < 0 {
                return ahead <= descent;
            }
            let then = self.s.saturating_add_signed(ahead);
            ahead <= climb || (ahead <= steepest && ahead <= warp.descent(then) as i64)
        };
        let fits = |steps: i64| {
            let ahead = steps.wrapping_mul(bend);
            // Then steps of one bend less each, down to none: in all it is (steps + 1)/2 times as far.
            ahead.wrapping_mul(steps.wrapping_add(1)) <= far.wrapping_mul(2) && admitted(ahead)
        };
        let faster = steps.wrapping_add(1);
        let slower = steps.wrapping_sub(1).max(0);
        let chosen = if fits(faster) {
            faster
        } else if fits(steps) {
            steps
        } else {
            slower
        };
        self.steps = if sign < 0 { -chosen } else { chosen };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::table::warp::ONE;

    extern crate std;

    /// 1 kHz, rho 5/s, s'' 15/s^2, s <= 1.2.
    fn warp() -> Warp {
        let (slope, bend) = (((5e-3 * (1u64 << 40) as f64) as u64), (15e-6 * RATE_ONE as f64) as u64);
        let k = |k: f64| (k * f64::from(ONE)) as u32;
        Warp { rate: k(1.2) + 1, acceleration: k(1.7), jerk: k(2.5), slope, bend }
    }

    /// Goes on until the rate is steady; returns the ticks it took.
    fn settle(rate: &mut Rate, warp: &Warp) -> u32 {
        for tick in 0..100_000 {
            if rate.is_steady() {
                return tick;
            }
            let (before, s) = (rate.step(), rate.s);
            rate.advance(warp);
            let after = rate.step();
            assert!((after - before).unsigned_abs() <= warp.bend, "{rate:?}");
            assert!(after.unsigned_abs() <= warp.descent(s.max(rate.s)), "{rate:?}");
            assert!(rate.s <= u64::from(warp.rate) << 24, "{rate:?}");
            assert_eq!(rate.s as i64, s as i64 + after);
        }
        panic!("never steady: {rate:?}");
    }

    #[test]
    fn a_hold_stops_and_goes_on() {
        let (mut rate, warp) = (Rate::default(), warp());
        rate.aim(0);
        // The bend rules: 2 sqrt(1/15) s = 516 ms.
        let down = settle(&mut rate, &warp);
        assert!(rate.is_held() && (510..525).contains(&down), "{down}");
        rate.aim(RATE_ONE);
        let up = settle(&mut rate, &warp);
        assert!(rate.is_plain() && up > down, "{up}");
        rate.aim(of_permille(1200));
        settle(&mut rate, &warp);
        assert_eq!(rate.s, of_permille(1200));
    }

    #[test]
    fn the_mind_may_change_at_any_tick() {
        let warp = warp();
        let mut random = fastrand::Rng::with_seed(1);
        let mut rate = Rate::default();
        for _ in 0..20_000 {
            let permille = match random.u8(..4) {
                0 => 0,
                1 => 1000,
                _ => random.u16(0..=1199),
            };
            rate.aim(of_permille(permille));
            for _ in 0..random.u32(0..60) {
                let (before, s) = (rate.step(), rate.s);
                rate.advance(&warp);
                assert!((rate.step() - before).unsigned_abs() <= warp.bend);
                assert!(rate.step().unsigned_abs() <= warp.descent(s.max(rate.s)), "{rate:?}");
                assert!(rate.s <= of_permille(1200), "{rate:?}");
            }
        }
        settle(&mut rate, &warp);
    }

    #[test]
    fn any_bounds_lead_to_any_rate() {
        let mut random = fastrand::Rng::with_seed(2);
        for _ in 0..3_000 {
            let slope = (10f64.powf(random.f64() * 3.0 - 4.0) * (1u64 << 40) as f64) as u64;
            let mut warp = Warp { slope, ..warp() };
            let most = warp.climb();
            warp.bend = ((most as f64) * 10f64.powf(-3.0 * random.f64())) as u64;
            if warp.is_valid() {
                let mut rate = Rate::default();
                rate.aim(of_permille(random.u16(0..1200)));
                settle(&mut rate, &warp);
                rate.aim(RATE_ONE);
                settle(&mut rate, &warp);
                assert!(rate.is_plain());
            }
        }
    }
}

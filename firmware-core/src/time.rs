//! Ticks and path time.
//!
//! Path time is a u64 in 2^-32 s from the start of a table. A tick is seldom a whole number of these units, so
//! the clock carries the remainder: after n ticks it shows floor(n tick 2^32), exactly, however large n is.

const NS_PER_S: u64 = 1_000_000_000;

/// Path time since a table's start, advanced tick by tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathClock {
    time: u64,
    step: u64,
    /// Remainders [1e-9 units].
    step_rest: u32,
    rest: u32,
}

impl PathClock {
    /// Zero, for ticks of `tick_ns`.
    pub fn new(tick_ns: u32) -> Self {
        let scaled = u64::from(tick_ns) << 32;
        Self { time: 0, step: scaled / NS_PER_S, step_rest: (scaled % NS_PER_S) as u32, rest: 0 }
    }

    /// Path time [2^-32 s].
    pub fn time(&self) -> u64 {
        self.time
    }

    /// So many ticks on.
    pub(crate) fn skip(&mut self, ticks: u64) {
        let rest = ticks.saturating_mul(u64::from(self.step_rest)).saturating_add(u64::from(self.rest));
        self.rest = (rest % NS_PER_S) as u32;
        let whole = ticks.saturating_mul(self.step).saturating_add(rest / NS_PER_S);
        self.time = self.time.saturating_add(whole);
    }

    /// One tick on at a mean rate [2^-30], rounded down; returns what is lost against rate 1, or won [2^-32 s].
    pub(crate) fn advance_at(&mut self, mean: u64) -> i64 {
        let step = self.step.saturating_mul(mean) >> 30;
        self.time = self.time.saturating_add(step);
        (self.step as i64).saturating_sub(step as i64)
    }

    /// One tick on.
    pub fn advance(&mut self) {
        // Both are below 1e9; path time wraps after 136 years.
        let rest = self.rest.wrapping_add(self.step_rest);
        let carries = rest >= NS_PER_S as u32;
        self.rest = if carries { rest.wrapping_sub(NS_PER_S as u32) } else { rest };
        self.time = self.time.wrapping_add(self.step).wrapping_add(u64::from(carries));
    }
}

/// Length of a tick in path time [2^-32 s], rounded down.
pub fn tick_time(tick_ns: u32) -> u64 {
    (u64::from(tick_ns) << 32) / NS_PER_S
}

/// After how many ticks of `tick_ns` the clock first shows `time` or more.
pub fn ticks_until(time: u64, tick_ns: u32) -> u64 {
    let fraction = (time & 0xffff_ffff) * NS_PER_S;
    let ns = (time >> 32) * NS_PER_S + fraction.div_ceil(1 << 32);
    ns.div_ceil(u64::from(tick_ns.max(1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_day_of_milliseconds_is_exact() {
        let mut clock = PathClock::new(1_000_000);
        for _ in 0..86_400_000u64 {
            clock.advance();
        }
        assert_eq!(clock.time(), 86_400 << 32);
    }

    proptest! {
        #[test]
        fn the_clock_shows_the_exact_product(tick_ns in 1u32..=1_000_000_000, n in 0u64..2000) {
            let mut clock = PathClock::new(tick_ns);
            (0..n).for_each(|_| clock.advance());
            let exact = ((u128::from(n) * u128::from(tick_ns)) << 32) / u128::from(NS_PER_S);
            prop_assert_eq!(u128::from(clock.time()), exact);
            let mut leaping = PathClock::new(tick_ns);
            leaping.skip(n / 3);
            leaping.skip(n - n / 3);
            prop_assert_eq!(leaping, clock);
        }

        #[test]
        fn ticks_until_is_the_first_tick_at_or_after(time in 0u64..1 << 36, tick_ns in 10_000_000u32..=1_000_000_000) {
            let mut clock = PathClock::new(tick_ns);
            let mut n = 0;
            while clock.time() < time {
                clock.advance();
                n += 1;
            }
            prop_assert_eq!(ticks_until(time, tick_ns), n);
        }
    }
}

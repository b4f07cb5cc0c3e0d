//! The drive's clock: what makes its control tick keep step with the time master's.
//!
//! Set-points belong to ticks, not to times, so that all drives compute the same bits; it is the length of the tick that is
//! trimmed. From each SYNC and the time told behind it comes one measurement of how far the own count is behind the master's.
//! A filter with growing memory (g and h of Kalata's tracker, as a least-squares line has them, down to a floor) keeps an offset
//! and a rate; the rate is trimmed away for good, the offset over the next two intervals. Measurements far off are not believed
//! unless they persist. While no SYNC comes the rate goes on to be trimmed: what is left then drifts with its error.

use protocol::bus::sync::{Stamp, Time, nearest};

/// Measurements after which the clock may count as one with the master's.
const ENOUGH: u32 = 16;
/// Least share of a new measurement in the offset, and in the rate.
const LEAST: [f32; 2] = [0.2, 0.02];
/// Largest trim [1].
const MOST_TRIM: f32 = 3e-3;
/// Measurements that differ by so many times the usual difference, and a grace [ns], are not believed.
const OUTLIER: f32 = 6.0;
const GRACE_NS: f32 = 2_000.0;
/// But so many in a row are.
const PERSISTENT: u8 = 5;
/// Offset below which the clock counts as one with the master's [ns].
const AGREED_NS: f32 = 1_000.0;
/// Offset above which nothing fine is learned [ns].
const COARSE_NS: f32 = 10_000.0;
/// Time without a SYNC after which it does not any more [ns].
const STALE_NS: u64 = 3_000_000_000;
/// Assumed between the first two measurements [ns].
const FIRST_NS: f32 = 2e7;

/// The clock of a drive that is not the master.
#[derive(Clone, Debug)]
pub struct Clock {
    tick_ns: u32,
    /// A SYNC whose time was not told yet.
    seen: Option<(u8, Stamp)>,
    /// Measurements since the filter began.
    count: u32,
    /// Own time of the last one that was believed [ns].
    last: u64,
    /// What the offset is believed to have been then [ns].
    offset: f32,
    /// The master's rate against the own, less 1.
    rate: f32,
    /// Trim beyond the rate, and for how long [ns].
    extra: f32,
    window: f32,
    /// Usual difference between prediction and measurement [ns].
    noise: f32,
    rejected: u8,
    outliers: u32,
    /// A large offset is being led away: by steep trims, whose exact beginning and end nobody knows.
    coarse: bool,
}

impl Clock {
    /// A clock of which nothing is known.
    pub const fn new(tick_ns: u32) -> Self {
        Self {
            tick_ns,
            seen: None,
            count: 0,
            last: 0,
            offset: 0.0,
            rate: 0.0,
            extra: 0.0,
            window: 0.0,
            noise: 0.0,
            rejected: 0,
            outliers: 0,
            coarse: false,
        }
    }

    /// A SYNC has ended.
    pub fn sync(&mut self, counter: u8, at: Stamp) {
        self.seen = Some((counter, at));
    }

    /// The time of the SYNC is told; `Some` if the own count is so far off that it has to jump, and by how many ticks.
    pub fn time(&mut self, time: Time) -> Option<i64> {
        let (counter, at) = self.seen.take()?;
        if counter != time.counter {
            return None;
        }
        let ticks = nearest(at.tick, time.tick).wrapping_sub(at.tick) as i64;
        let phase = i64::from(time.ns) - i64::from(at.ns);
        let behind = ticks.saturating_mul(i64::from(self.tick_ns)).saturating_add(phase);
        let tick = i64::from(self.tick_ns);
        if behind.saturating_abs() > tick / 2 + tick / 8 {
            // Whole ticks are jumped; the rest is led away.
            let half = if behind > 0 { tick / 2 } else { -tick / 2 };
            return Some(behind.saturating_add(half) / tick.max(1));
        }
        self.measure(behind as f32, self.own(at));
        None
    }

    /// The count was made to jump.
    pub fn jumped(&mut self) {
        *self = Self { outliers: self.outliers, ..Self::new(self.tick_ns) };
    }

    /// By how much the next tick is to be shorter [1e-9].
    pub fn trim_ppb(&self, now: Stamp) -> i32 {
        let since = self.own(now).saturating_sub(self.last) as f32;
        let extra = if since < self.window { self.extra } else { 0.0 };
        ((self.rate + extra).clamp(-MOST_TRIM, MOST_TRIM) * 1e9) as i32
    }

    /// Whether the own count is one with the master's.
    pub fn agrees(&self, now: Stamp) -> bool {
        !self.coarse
            && self.count >= ENOUGH
            && self.offset.abs() < AGREED_NS
            && self.own(now).saturating_sub(self.last) < STALE_NS
    }

    /// The control tick is longer than a SYNC's time can say.
    pub fn is_coarse(&self) -> bool {
        self.tick_ns >> 24 != 0
    }

    /// How far the last measurements were from what was expected of them [ns].
    pub fn residual_ns(&self) -> f32 {
        self.noise.max(self.offset.abs())
    }

    /// Measurements that were not believed.
    pub fn outliers(&self) -> u32 {
        self.outliers
    }

    fn own(&self, at: Stamp) -> u64 {
        at.tick.saturating_mul(u64::from(self.tick_ns)).saturating_add(u64::from(at.ns))
    }

    fn measure(&mut self, behind: f32, at: u64) {
        let since = if self.count == 0 { FIRST_NS } else { at.saturating_sub(self.last) as f32 };
        if since <= 0.0 {
            return;
        }
        let predicted = self.offset - self.extra * since.min(self.window);
        let surprise = if self.count == 0 { 0.0 } else { behind - predicted };
        if self.count > ENOUGH && surprise.abs() > OUTLIER * self.noise + GRACE_NS {
            self.outliers = self.outliers.saturating_add(1);
            self.rejected = self.rejected.saturating_add(1);
            if self.rejected < PERSISTENT {
                return;
            }
            // It is the filter that is wrong; the rate of a crystal is not.
            (self.count, self.noise) = (0, 0.0);
        }
        if self.count == 0 {
            self.coarse = behind.abs() > COARSE_NS;
        } else if self.coarse && behind.abs() < COARSE_NS {
            // Only what is learned from now on is worth remembering.
            (self.coarse, self.count, self.noise) = (false, 0, 0.0);
        }
        self.rejected = 0;
        self.last = at;
        if self.count == 0 {
            self.offset = behind;
        } else {
            let n = self.count.min(1_000) as f32 + 1.0;
            let [g, h] = [2.0 * (2.0 * n - 1.0), 6.0].map(|share| share / (n * (n + 1.0)));
            self.offset = predicted + g.clamp(LEAST[0], 1.0) * surprise;
            self.rate += h.clamp(LEAST[1], 1.0) * surprise / since;
            self.rate = self.rate.clamp(-MOST_TRIM, MOST_TRIM);
            self.noise += (surprise.abs() - self.noise) / n.min(16.0);
        }
        self.count = self.count.saturating_add(1);
        self.window = 2.0 * since;
        self.extra = (self.offset / self.window).clamp(-MOST_TRIM, MOST_TRIM);
    }
}

/// Counts of a timer for one tick after another: their mean is the trimmed tick, however coarse the timer.
#[derive(Clone, Copy, Debug)]
pub struct Reload {
    counts: u32,
    /// What was not given yet [1e-9 counts].
    rest: i64,
}

impl Reload {
    /// A timer that counts so much in a tick.
    pub const fn new(counts: u32) -> Self {
        Self { counts, rest: 0 }
    }

    /// What it has to count for the next tick.
    pub fn next(&mut self, trim_ppb: i32) -> u32 {
        // Counts are below 2^32 and trims below 2^22: nothing here is above 2^55.
        self.rest = self.rest.wrapping_sub(i64::from(self.counts).wrapping_mul(i64::from(trim_ppb)));
        let whole = self.rest / 1_000_000_000;
        self.rest = self.rest.wrapping_sub(whole.wrapping_mul(1_000_000_000));
        self.counts.saturating_add_signed(whole as i32).max(2)
    }
}

#[cfg(test)]
mod tests;

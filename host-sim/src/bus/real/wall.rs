//! From the wall clock, with which the system stamps frames, to the monotonic one.

use std::time::{Duration, Instant, SystemTime};

/// How the two clocks were seen to lie to each other.
#[derive(Clone, Copy, Debug)]
struct Pair {
    instant: Instant,
    wall: SystemTime,
    /// Between the two looks at the monotonic clock, which the look at the other one lies between.
    width: Duration,
}

impl Pair {
    fn look() -> Self {
        let before = Instant::now();
        let wall = SystemTime::now();
        let width = before.elapsed();
        Self { instant: before + width / 2, wall, width }
    }

    /// When the wall clock showed `stamp`, if it was never set in between.
    fn instant(&self, stamp: SystemTime) -> Option<Instant> {
        match stamp.duration_since(self.wall) {
            Ok(later) => self.instant.checked_add(later),
            Err(earlier) => self.instant.checked_sub(earlier.duration()),
        }
    }
}

/// Keeps the closest look at both clocks, until the wall clock is set.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wall(Pair);

impl Wall {
    pub(super) fn new() -> Self {
        Self(Pair::look())
    }

    /// Looks again: takes the new look if it is closer, or if the old one cannot be true any more.
    pub(super) fn look(&mut self) {
        let new = Pair::look();
        let off = self.0.instant(new.wall).map(|expected| {
            let late = new.instant.saturating_duration_since(expected);
            late.max(expected.saturating_duration_since(new.instant))
        });
        if new.width <= self.0.width || off.is_none_or(|off| off > new.width + self.0.width) {
            self.0 = new;
        }
    }

    /// When the wall clock showed `stamp`.
    pub(super) fn instant(&self, stamp: SystemTime) -> Option<Instant> {
        self.0.instant(stamp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_where_they_belong_and_a_clock_that_is_set_is_followed() {
        let mut wall = Wall::new();
        for _ in 0..100 {
            wall.look();
        }
        let (before, stamp) = (Instant::now(), SystemTime::now());
        let found = wall.instant(stamp).unwrap();
        let grace = Duration::from_millis(5);
        assert!(found + grace > before && found < Instant::now() + grace);

        wall.0.wall += Duration::from_secs(3600);
        wall.look();
        let found = wall.instant(SystemTime::now()).unwrap();
        assert!(found + grace > before && found < Instant::now() + grace);
    }
}

//! How well an axis follows, gathered over a window of ticks.

use micromath::F32Ext;
use protocol::message::Telemetry;

/// Sums over a window; squares saturate at 2^64.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Window {
    ticks: u32,
    most: u32,
    squares: u64,
    worst_tick: u32,
}

impl Window {
    /// Takes in the distance between set-point and actual position [counts].
    pub(crate) fn follow(&mut self, setpoint: i64, actual: i64) {
        let error = u32::try_from(setpoint.abs_diff(actual)).unwrap_or(u32::MAX);
        self.ticks = self.ticks.saturating_add(1);
        self.most = self.most.max(error);
        self.squares = self.squares.saturating_add(u64::from(error).saturating_mul(u64::from(error)));
    }

    /// Takes in what a tick has cost, in whatever the board counts.
    pub(crate) fn cost(&mut self, count: u32) {
        self.worst_tick = self.worst_tick.max(count);
    }

    /// What the window holds, which begins anew; nothing where nobody has told anything.
    pub(crate) fn take(&mut self, fill_ms: u32) -> Option<Telemetry> {
        let Window { ticks, most, squares, worst_tick } = core::mem::take(self);
        if ticks == 0 && worst_tick == 0 {
            return None;
        }
        let mean = squares as f32 / ticks.max(1) as f32;
        // A few per cent are enough to see a trend, and this square root takes a few instructions on any core.
        let following_rms = if mean > 0.0 { F32Ext::sqrt(mean) } else { 0.0 };
        Some(Telemetry { ticks, following_max: most, following_rms, fill_ms, worst_tick })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How far the root mean square may be off: what [`Telemetry`] says.
    const STATED: f64 = 0.07;

    #[test]
    fn the_root_mean_square_is_as_good_as_it_says() {
        let (mut worst, mut size) = (0.0f64, 1u32);
        while size < 1_000_000_000 {
            let mut window = Window::default();
            for k in 0..7u32 {
                window.follow(i64::from(size + k), -i64::from(k));
            }
            let exact = (0..7u32).map(|k| f64::from(size + 2 * k).powi(2)).sum::<f64>() / 7.0;
            let told = window.take(0).unwrap();
            assert_eq!((told.ticks, told.following_max), (7, size + 12));
            worst = worst.max((f64::from(told.following_rms) / libm::sqrt(exact) - 1.0).abs());
            size += 1 + size / 37;
        }
        assert!(worst < STATED, "{worst}");
        assert!(worst > 0.01, "better than it is said to be: {worst}");
    }

    #[test]
    fn windows_begin_anew_and_saturate() {
        let mut window = Window::default();
        assert_eq!(window.take(1), None);
        window.follow(i64::MAX, i64::MIN);
        window.follow(0, 0);
        window.cost(90);
        window.cost(70);
        let told = window.take(5).unwrap();
        assert_eq!((told.ticks, told.following_max, told.worst_tick, told.fill_ms), (2, u32::MAX, 90, 5));
        assert!(told.following_rms.is_finite());
        assert_eq!(window.take(1), None);
        window.follow(4, 4);
        assert_eq!(window.take(1).map(|t| t.following_rms), Some(0.0));
    }
}

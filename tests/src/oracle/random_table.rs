//! Feed tables drawn at random: uneven knots, bent paths, rough speeds.

use planner::feed::table::FeedTable;
use planner::geometry::grid_path::{GridAxis, GridPath};

/// A small generator of repeatable numbers (Steele, Lea & Flood 2014, SplitMix64).
#[derive(Clone, Debug)]
pub struct Dice(u64);

impl Dice {
    /// Starts from a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Evenly from [low, high).
    pub fn real(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Evenly from low..=high.
    pub fn whole(&mut self, low: u64, high: u64) -> u64 {
        low + self.bits() % (high - low + 1)
    }
}

/// A table with `axes` axes and about `spans` spans.
///
/// The path meanders at about unit speed in u; q wanders over two decades, with up to a third of change per knot.
pub fn random_table(dice: &mut Dice, axes: usize, spans: usize) -> FeedTable {
    let mut breaks = vec![0u64];
    let mut steps: Vec<u32> = Vec::new();
    while steps.len() < spans.max(5) {
        let size = dice.whole(20, 400);
        let parts = dice.whole(if steps.is_empty() { 3 } else { 1 }, 4);
        for _ in 0..parts {
            steps.push((size + dice.whole(0, size)) as u32);
        }
        breaks.push(steps.iter().map(|&s| u64::from(s)).sum());
    }
    let step = 1.0 / 128.0;
    let grid_axes = (0..axes).map(|_| random_axis(dice, &breaks, step)).collect();
    let mut code = dice.real(2000.0, 8000.0);
    let codes = (0..steps.len() - 2).map(|_| {
        code = (code * dice.real(0.87, 1.15)).clamp(500.0, 50_000.0);
        code as u32
    });
    let codes = codes.collect();
    let q_scale = dice.real(1e-6, 1e-4) as f32;
    FeedTable { path: GridPath { step, breaks, axes: grid_axes }, steps, q_scale, codes }
}

fn random_axis(dice: &mut Dice, breaks: &[u64], step: f64) -> GridAxis {
    let lsb = 1e-5;
    let clamped = |i: usize| breaks[i.saturating_sub(3).min(breaks.len() - 1)] as f64;
    let mut position = dice.real(-500.0, 500.0);
    let mut heading = dice.real(-1.0, 1.0);
    let mut before = 0.0;
    let controls = (0..breaks.len() + 2).map(|i| {
        // Control points sit at the mean of three knots (Greville).
        let place = (clamped(i + 1) + clamped(i + 2) + clamped(i + 3)) / 3.0 * step;
        heading = (heading + dice.real(-0.4, 0.4)).clamp(-1.0, 1.0);
        position += heading * (place - before);
        before = place;
        (position / lsb).round() as i64
    });
    let controls = controls.collect();
    GridAxis { lsb, controls }
}

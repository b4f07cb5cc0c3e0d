//! Random feed tables inside the format's rules, and an f64 oracle of the motion they stand for.

use planner::feed::pack::{AxisScale, Packed, Target, pack};
use planner::feed::table::{FeedTable, SpanLaw};
use planner::geometry::grid_path::{GridAxis, GridPath};
use planner::job::machine::{AxisLimits, OverrideRule};

/// Control tick of the random tables [ns].
pub const TICK_NS: u32 = 1_000_000;

/// SplitMix64 (Steele, Lea, Flood 2014): small, seeded, the same on every machine.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [from, to).
    pub fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in the logarithm.
    pub fn scale(&mut self, from: f64, to: f64) -> f64 {
        self.between(from.ln(), to.ln()).exp()
    }

    /// A number from 0 on, below `end`.
    pub fn below(&mut self, end: u64) -> u64 {
        self.whole(0, end.saturating_sub(1))
    }

    /// Uniform in from..=to.
    pub fn whole(&mut self, from: u64, to: u64) -> u64 {
        from + self.bits() % (to - from + 1)
    }
}

/// A table with all that packing needs.
#[derive(Clone, Debug)]
pub struct Sample {
    /// The table.
    pub table: FeedTable,
    /// One per axis.
    pub scales: Vec<AxisScale>,
}

/// What kind of table to make.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Drive counts per axis unit.
    pub counts_per_unit: f64,
    /// Longest geometry span [counts].
    pub longest_counts: f64,
}

/// Slides with 10 nm counts; geometry spans up to the format's limit.
pub const FINE: Kind = Kind { counts_per_unit: 1e5, longest_counts: 1e6 };

/// Slides with 1 um counts.
pub const COARSE: Kind = Kind { counts_per_unit: 1e3, longest_counts: 2e5 };

impl Sample {
    /// A random table that the format can express.
    pub fn new(random: &mut Random, kind: Kind) -> Self {
        loop {
            let sample = Self::candidate(random, kind);
            if sample.packed(1).is_ok() {
                return sample;
            }
        }
    }

    /// The table's bytes.
    pub fn packed(&self, number: u32) -> Result<Packed, planner::feed::pack::PackError> {
        let axes = self.scales.clone();
        pack(&self.table, number, &Target { tick_ns: TICK_NS, override_rule: OverrideRule::default(), axes })
    }

    fn candidate(random: &mut Random, kind: Kind) -> Self {
        let exponent = random.whole(8, 14) as i32;
        let step = (-exponent as f64).exp2();
        let longest = kind.longest_counts / kind.counts_per_unit;
        let mean = random.scale(0.02, 0.5) * longest;
        let spans = random.whole(1, 30);
        let mut breaks = vec![0u64];
        for _ in 0..spans {
            let length = (mean * random.scale(0.3, 2.0) / step).round().max(64.0) as u64;
            breaks.push(breaks[breaks.len() - 1] + length);
        }
        let steps = split(random, &breaks);
        let (codes, q_scale) = codes(random, &steps, step);
        let axes = random.whole(1, 4);
        let mut scales = Vec::new();
        let axes = (0..axes).map(|_| {
            // Whatever the motion, it keeps these.
            let limits = AxisLimits { velocity: 9e5, acceleration: 9e8, jerk: f64::INFINITY };
            scales.push(AxisScale { counts_per_unit: kind.counts_per_unit, limits });
            let lsb = (-(random.whole(0, 4) as f64)).exp2() / kind.counts_per_unit;
            axis(random, &breaks, step, lsb)
        });
        let axes = axes.collect();
        let table = FeedTable { path: GridPath { step, breaks, axes }, steps, q_scale, codes };
        Self { table, scales }
    }
}

/// q spans: a few per geometry span, unevenly, and enough of them.
fn split(random: &mut Random, breaks: &[u64]) -> Vec<u32> {
    let least = if breaks.len() < 6 { 5 } else { 1 };
    let mut steps = Vec::new();
    for pair in breaks.windows(2) {
        let (length, count) = (pair[1] - pair[0], random.whole(least, 7));
        let weights: Vec<f64> = (0..count).map(|_| random.between(1.0, 2.0)).collect();
        let sum: f64 = weights.iter().sum();
        let (mut at, mut used) = (0.0, 0);
        for weight in weights {
            at += weight / sum;
            let knot = (at * length as f64).round() as u64;
            steps.push((knot - used) as u32);
            used = knot;
        }
    }
    steps
}

/// Codes of a random walk of q between the rests.
fn codes(random: &mut Random, steps: &[u32], step: f64) -> (Vec<u32>, f32) {
    let n = steps.len();
    let (mut walk, roughness) = (2.0 * random.scale(2.0, 300.0).ln(), random.between(0.02, 0.7));
    let mut q: Vec<f64> = (1..n - 1)
        .map(|_| {
            walk += random.between(-roughness, roughness);
            walk.exp()
        })
        .collect();
    // The outermost codes are q at the inner knots of the rest spans, not control values.
    let length = |i: usize| f64::from(steps[i]) * step;
    q[0] /= 1.0 + 2.0 * length(1) / (3.0 * length(0));
    q[n - 3] /= 1.0 + 2.0 * length(n - 2) / (3.0 * length(n - 1));
    let largest = q.iter().copied().fold(0.0, f64::max);
    let scale = (largest / 65_000f64.powi(2)) as f32;
    let codes = q.iter().map(|q| (q / f64::from(scale)).sqrt().round().clamp(1.0, 65_535.0) as u32);
    (codes.collect(), scale)
}

/// Control points of an axis whose slope wanders between -1 and 1.
fn axis(random: &mut Random, breaks: &[u64], step: f64, lsb: f64) -> GridAxis {
    let last = breaks.len() as isize - 1;
    let knot = |i: isize| breaks[i.clamp(0, last) as usize] as f64 * step;
    let mut slope = random.between(-1.0, 1.0);
    let mut at = random.between(-500.0, 500.0);
    let mut controls = vec![(at / lsb).round() as i64];
    for i in 0..last + 2 {
        slope = (slope + random.between(-0.3, 0.3)).clamp(-1.0, 1.0);
        at += slope * (knot(i + 1) - knot(i - 2)) / 3.0;
        controls.push((at / lsb).round() as i64);
    }
    GridAxis { lsb, controls }
}

/// Motion of one axis in f64 [counts and seconds].
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Position [counts].
    pub position: f64,
    /// Velocity [counts/s].
    pub velocity: f64,
    /// Acceleration [counts/s^2].
    pub acceleration: f64,
}

impl Sample {
    /// Motion of axis `axis`, `t` seconds into q span `span`.
    pub fn motion(&self, axis: usize, span: usize, t: f64) -> Motion {
        let path = &self.table.path;
        let start: u64 = self.table.steps[..span].iter().copied().map(u64::from).sum();
        let geometry = path.breaks.partition_point(|knot| *knot <= start) - 1;
        let (x, speed, acceleration) = along(self.table.law(span), t);
        let x = (start - path.breaks[geometry]) as f64 * path.step + x;
        let (piece, counts) = (path.piece(axis, geometry), self.scales[axis].counts_per_unit);
        Motion {
            position: path.position(axis, geometry, x) * counts,
            velocity: piece.first(x) * speed * counts,
            acceleration: (piece.second(x) * speed * speed + piece.first(x) * acceleration) * counts,
        }
    }
}

/// Distance, speed and acceleration along the path, by hyperbolic and circular functions.
fn along(law: SpanLaw, t: f64) -> (f64, f64, f64) {
    match law {
        SpanLaw::Launch { h, duration } => {
            let r = t / duration;
            (h * r.powi(3), 3.0 * h * r * r / duration, 6.0 * h * r / duration.powi(2))
        }
        SpanLaw::Landing { h, duration } => {
            let r = (duration - t) / duration;
            (h - h * r.powi(3), 3.0 * h * r * r / duration, -6.0 * h * r / duration.powi(2))
        }
        SpanLaw::Quadratic { q: [alpha, beta, gamma], .. } => {
            let (v0, r) = (alpha.sqrt(), gamma.abs().sqrt());
            let (s, c) = if gamma > 0.0 { ((r * t).sinh(), (r * t).cosh()) } else { (r * t).sin_cos() };
            let (s_over, g_over) = if r * t < 1e-4 {
                let z = gamma * t * t;
                (t * (1.0 + z / 6.0), t * t * (0.5 + z / 24.0))
            } else {
                (s / r, (c - 1.0) / gamma)
            };
            let x = v0 * s_over + 0.5 * beta * g_over;
            (x, v0 * c + 0.5 * beta * s_over, 0.5 * beta + gamma * x)
        }
    }
}

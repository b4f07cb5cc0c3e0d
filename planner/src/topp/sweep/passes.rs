//! The passes of the sweep: what bounds q at each station, then backward, then forward.
//!
//! The limits of one axis are a strip |s q + g w| <= 1 in q and the path acceleration w, with g = |p'|/A and
//! s = sign(p') p''/A. From one station to the next q rises by d w, d twice their distance, so each strip bounds q
//! at one station by a line in q at the other. Lines are computed for several stations at once; only the minima over
//! them wait for each other. They are written as plain sums and products, which vectorise and give the same bits on
//! every machine.

use pulp::Arch;

use super::samples::{LANES, Lanes, Samples};
use crate::job::machine::{AxisLimits, MAX_AXES};
use crate::topp::error::{LimitKind, PlanError};

/// An axis with less of |p'|/A stands still: its lines would overflow.
const STILL: f64 = 1e-150;

/// The working memory of a sweep. Used again it allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct Sweeper {
    bounds: Vec<Lanes>,
    q: Vec<Lanes>,
}

impl Sweeper {
    /// Without memory yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The fastest motion from rest to rest: q at every station. Jerk limits are not looked at.
    ///
    /// Where nothing bounds q, because no axis moves, the largest bound elsewhere stands in. Time is linear in the
    /// stations.
    ///
    /// # Errors
    ///
    /// [`PlanError`] where the limits are not one pair of positive numbers per axis.
    pub fn sweep(&mut self, samples: &Samples, limits: &[AxisLimits]) -> Result<&[f64], PlanError> {
        let axes = samples.axes();
        if limits.len() != axes {
            return Err(PlanError::LimitCount { limits: limits.len(), axes });
        }
        for (axis, l) in limits.iter().enumerate() {
            for (kind, value) in
                [(LimitKind::Velocity, l.velocity), (LimitKind::Acceleration, l.acceleration)]
            {
                if !(value > 0.0 && value.is_finite()) {
                    return Err(PlanError::Limit { axis, kind, value });
                }
            }
        }
        self.run(samples, limits);
        Ok(self.q(samples.stations.len()))
    }

    /// As [`Sweeper::sweep`], of valid limits, one per axis.
    pub(super) fn run(&mut self, samples: &Samples, limits: &[AxisLimits]) {
        const { assert!(MAX_AXES == 9) }
        match samples.axes() {
            1 => self.run_axes::<1>(samples, limits),
            2 => self.run_axes::<2>(samples, limits),
            3 => self.run_axes::<3>(samples, limits),
            4 => self.run_axes::<4>(samples, limits),
            5 => self.run_axes::<5>(samples, limits),
            6 => self.run_axes::<6>(samples, limits),
            7 => self.run_axes::<7>(samples, limits),
            8 => self.run_axes::<8>(samples, limits),
            _ => self.run_axes::<9>(samples, limits),
        }
    }

    /// q at the first `stations` stations.
    pub(super) fn q(&self, stations: usize) -> &[f64] {
        &self.q.as_flattened()[..stations]
    }

    /// What bounds q there without regard to its neighbours.
    pub(super) fn bounds(&self, stations: usize) -> &[f64] {
        &self.bounds.as_flattened()[..stations]
    }

    fn run_axes<const A: usize>(&mut self, samples: &Samples, limits: &[AxisLimits]) {
        let chunks = samples.steps.len();
        self.bounds.resize(chunks, [0.0; LANES]);
        self.q.resize(chunks, [0.0; LANES]);
        let strips = Strips::<A> {
            first: samples.first.as_chunks().0,
            second: samples.second.as_chunks().0,
            velocity: std::array::from_fn(|a| 1.0 / limits[a].velocity),
            acceleration: std::array::from_fn(|a| 1.0 / limits[a].acceleration),
        };
        let arch = Arch::new();
        arch.dispatch(|| strips.bound(&samples.cap, &mut self.bounds));
        self.q.copy_from_slice(&self.bounds);
        let q = self.q.as_flattened_mut();
        let last = samples.stations.len() - 1;
        q[0] = 0.0;
        q[last..].fill(0.0);
        replace_infinities(q);
        arch.dispatch(|| strips.backward(&samples.steps, &mut self.q));
        arch.dispatch(|| strips.forward(&samples.steps, &mut self.q));
    }
}

/// Where nothing bounds q, the path's largest finite bound stands in.
pub(super) fn replace_infinities(q: &mut [f64]) {
    let largest = q.iter().copied().filter(|q| q.is_finite()).fold(0.0, f64::max);
    q.iter_mut().filter(|q| !q.is_finite()).for_each(|q| *q = largest);
}

/// The derivatives of `A` axes and the reciprocals of their limits.
struct Strips<'a, const A: usize> {
    first: &'a [[Lanes; A]],
    second: &'a [[Lanes; A]],
    velocity: [f64; A],
    acceleration: [f64; A],
}

/// One line per axis and station: q here <= slope q + offset of a neighbour.
struct Lines<const A: usize> {
    slope: [Lanes; A],
    offset: [Lanes; A],
}

impl<const A: usize> Strips<'_, A> {
    /// g and s of axis `a` at the stations of `chunk`.
    #[inline(always)]
    fn strip(&self, chunk: usize, a: usize) -> (Lanes, Lanes) {
        let (first, second) = (&self.first[chunk][a], &self.second[chunk][a]);
        let scale = self.acceleration[a];
        let (mut gain, mut slope) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            gain[l] = first[l].abs() * scale;
            slope[l] = if first[l] < 0.0 { -second[l] } else { second[l] } * scale;
        }
        (gain, slope)
    }

    /// Largest q at each station by itself: caps, velocity, and a common w within every strip.
    #[inline(always)]
    fn bound(&self, cap: &[Lanes], bounds: &mut [Lanes]) {
        for (chunk, (cap, bound)) in cap.iter().zip(bounds).enumerate() {
            let (mut speed, mut bend) = ([0.0; LANES], [0.0; LANES]);
            for a in 0..A {
                let (first, second) = (&self.first[chunk][a], &self.second[chunk][a]);
                for l in 0..LANES {
                    speed[l] = larger(first[l].abs() * self.velocity[a], speed[l]);
                    bend[l] = larger(second[l].abs() * self.acceleration[a], bend[l]);
                }
            }
            let mut beyond = 0.0;
            for l in 0..LANES {
                bound[l] = smaller(cap[l], 1.0 / (speed[l] * speed[l]));
                beyond = larger(bound[l] * bend[l], beyond);
            }
            // Up to q |s| = 1 a steady speed is within every strip.
            if beyond > 1.0 {
                self.meet(chunk, &speed, bound);
            }
        }
    }

    /// Lowers q to where all strips have a w in common, the maximum velocity curve: the strips of axes a and b part
    /// at (g_a + g_b)/|s_a g_b - s_b g_a|. The least of these fractions is found by products.
    #[inline(always)]
    fn meet(&self, chunk: usize, speed: &Lanes, bound: &mut Lanes) {
        let (mut gain, mut slope) = ([[0.0; LANES]; A], [[0.0; LANES]; A]);
        for a in 0..A {
            (gain[a], slope[a]) = self.strip(chunk, a);
        }
        let (mut over, mut under) = (*bound, [1.0; LANES]);
        for a in 0..A {
            for b in a + 1..A {
                for l in 0..LANES {
                    let room = gain[a][l] + gain[b][l];
                    let turn = (slope[a][l] * gain[b][l] - slope[b][l] * gain[a][l]).abs();
                    let less = room * under[l] < over[l] * turn;
                    over[l] = if less { room } else { over[l] };
                    under[l] = if less { turn } else { under[l] };
                }
            }
        }
        for l in 0..LANES {
            bound[l] = over[l] / under[l];
            if speed[l] == 0.0 {
                // Nothing moves but bends: |s| q <= 1 for every axis.
                bound[l] = slope.iter().fold(bound[l], |q, slope| smaller(1.0 / slope[l].abs(), q));
            }
        }
    }

    /// Lowers q to what the rest of the path can be survived from: the lowest w still has to reach q at the next
    /// station, q + d w <= q_next, at w = (-1 - s q)/g.
    #[inline(always)]
    fn backward(&self, steps: &[Lanes], q: &mut [Lanes]) {
        let mut next = 0.0;
        for (chunk, (step, q)) in steps.iter().zip(q).enumerate().rev() {
            let mut lines = Lines { slope: [[0.0; LANES]; A], offset: [[0.0; LANES]; A] };
            for a in 0..A {
                let (gain, slope) = self.strip(chunk, a);
                for l in 0..LANES {
                    let cost = gain[l] - step[l] * slope[l];
                    let bounds = cost > STILL;
                    let inverse = 1.0 / cost;
                    lines.slope[a][l] = if bounds { gain[l] * inverse } else { 0.0 };
                    lines.offset[a][l] = if bounds { step[l] * inverse } else { f64::INFINITY };
                }
            }
            for l in (0..LANES).rev() {
                // The last station has no next one: q is zero there and stays so.
                next = smaller(lines.least(l, next), q[l]);
                q[l] = next;
            }
        }
    }

    /// Lowers q to what can be reached: q_next <= q + d w at the highest w = (1 - s q)/g.
    #[inline(always)]
    fn forward(&self, steps: &[Lanes], q: &mut [Lanes]) {
        let mut reach = 0.0;
        for (chunk, (step, q)) in steps.iter().zip(q).enumerate() {
            let mut lines = Lines { slope: [[0.0; LANES]; A], offset: [[0.0; LANES]; A] };
            for a in 0..A {
                let (gain, slope) = self.strip(chunk, a);
                for l in 0..LANES {
                    let moves = gain[l] > STILL;
                    let inverse = 1.0 / gain[l];
                    lines.slope[a][l] = if moves { (gain[l] - step[l] * slope[l]) * inverse } else { 0.0 };
                    lines.offset[a][l] = if moves { step[l] * inverse } else { f64::INFINITY };
                }
            }
            for (l, q) in q.iter_mut().enumerate() {
                *q = smaller(reach, *q);
                reach = larger(lines.least(l, *q), 0.0);
            }
        }
    }
}

impl<const A: usize> Lines<A> {
    /// The least of the lines of station `l` at q.
    #[inline(always)]
    fn least(&self, l: usize, q: f64) -> f64 {
        let mut values: [f64; A] = std::array::from_fn(|a| self.slope[a][l] * q + self.offset[a][l]);
        // Pair by pair: half of them wait for nothing.
        let mut n = A;
        while n > 1 {
            let half = n / 2;
            for i in 0..half {
                values[i] = smaller(values[n - 1 - i], values[i]);
            }
            n -= half;
        }
        values[0]
    }
}

/// The smaller of two numbers, the second one if the first is none: one instruction.
#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The larger of two numbers, the second one if the first is none.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

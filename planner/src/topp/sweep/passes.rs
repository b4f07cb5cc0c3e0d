//! The passes of the sweep: what bounds q at each station, then backward, then forward.
//!
//! The limits of one axis are a strip |s q + g w| <= 1 in q and the path acceleration w, with g = |p'|/A and
//! s = sign(p') p''/A. From one station to the next q rises by d w, d twice their distance, so each strip bounds q
//! at one station by a line in q at the other. Lines are computed for several stations at once; only the minima over
//! them wait for each other. Nothing is contracted to fused products, so that the bits are the same on every machine.

use pulp::{Arch, Simd, WithSimd};

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
        arch.dispatch(Pass::Bound(&strips, &samples.cap, &mut self.bounds));
        self.q.copy_from_slice(&self.bounds);
        let q = self.q.as_flattened_mut();
        let last = samples.stations.len() - 1;
        q[0] = 0.0;
        q[last..].fill(0.0);
        replace_infinities(q);
        arch.dispatch(Pass::Backward(&strips, &samples.steps, &mut self.q));
        arch.dispatch(Pass::Forward(&strips, &samples.steps, &mut self.q));
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

/// A pass with its input and output, compiled for each instruction set.
enum Pass<'a, const A: usize> {
    Bound(&'a Strips<'a, A>, &'a [Lanes], &'a mut [Lanes]),
    Backward(&'a Strips<'a, A>, &'a [Lanes], &'a mut [Lanes]),
    Forward(&'a Strips<'a, A>, &'a [Lanes], &'a mut [Lanes]),
}

impl<const A: usize> WithSimd for Pass<'_, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match self {
            Pass::Bound(strips, caps, bounds) => strips.bound(simd, caps, bounds),
            Pass::Backward(strips, steps, q) => strips.backward(simd, steps, q),
            Pass::Forward(strips, steps, q) => strips.forward(simd, steps, q),
        }
    }
}

/// One line per axis and station: q here <= slope q + offset of a neighbour.
struct Lines<const A: usize> {
    slope: [Lanes; A],
    offset: [Lanes; A],
}

impl<const A: usize> Strips<'_, A> {
    /// g and s of axis `a` at part `v` of the stations of `chunk`.
    #[inline(always)]
    fn strip<S: Simd>(&self, simd: S, chunk: usize, v: usize, a: usize) -> (S::f64s, S::f64s) {
        let (first, second) = (part::<S>(&self.first[chunk][a], v), part::<S>(&self.second[chunk][a], v));
        let scale = simd.splat_f64s(self.acceleration[a]);
        let sign = simd.and_f64s(first, simd.splat_f64s(-0.0));
        let slope = simd.mul_f64s(simd.xor_f64s(second, sign), scale);
        (simd.mul_f64s(simd.abs_f64s(first), scale), slope)
    }

    /// Largest q at each station by itself: caps, velocity, and a common w within every strip.
    #[inline(always)]
    fn bound<S: Simd>(&self, simd: S, caps: &[Lanes], bounds: &mut [Lanes]) {
        let (one, zero) = (simd.splat_f64s(1.0), simd.splat_f64s(0.0));
        for (chunk, (cap, bounds)) in caps.iter().zip(bounds).enumerate() {
            for (v, bound) in S::as_mut_simd_f64s(bounds).0.iter_mut().enumerate() {
                let (mut speed, mut bend) = (zero, zero);
                for a in 0..A {
                    let first = simd.abs_f64s(part::<S>(&self.first[chunk][a], v));
                    let second = simd.abs_f64s(part::<S>(&self.second[chunk][a], v));
                    speed = simd.max_f64s(simd.mul_f64s(first, simd.splat_f64s(self.velocity[a])), speed);
                    bend = simd.max_f64s(simd.mul_f64s(second, simd.splat_f64s(self.acceleration[a])), bend);
                }
                let alone = simd.div_f64s(one, simd.mul_f64s(speed, speed));
                let q = simd.min_f64s(part::<S>(cap, v), alone);
                // Up to q |s| = 1 a steady speed is within every strip.
                let steep = simd.less_than_f64s(one, simd.mul_f64s(q, bend));
                *bound = if any(simd, steep) { self.meet(simd, chunk, v, q, bend) } else { q };
            }
        }
    }

    /// Lowers q to where all strips have a w in common, the maximum velocity curve: the strips of axes a and b part
    /// at (g_a + g_b)/|s_a g_b - s_b g_a|. The least of these fractions is found by products.
    #[inline(always)]
    fn meet<S: Simd>(&self, simd: S, chunk: usize, v: usize, q: S::f64s, bend: S::f64s) -> S::f64s {
        let (one, zero) = (simd.splat_f64s(1.0), simd.splat_f64s(0.0));
        let (mut gain, mut slope) = ([zero; A], [zero; A]);
        for a in 0..A {
            (gain[a], slope[a]) = self.strip(simd, chunk, v, a);
        }
        let (mut over, mut under, mut moving) = (q, one, zero);
        for a in 0..A {
            moving = simd.max_f64s(moving, gain[a]);
            for b in a + 1..A {
                let room = simd.add_f64s(gain[a], gain[b]);
                let turn = simd.sub_f64s(simd.mul_f64s(slope[a], gain[b]), simd.mul_f64s(slope[b], gain[a]));
                let turn = simd.abs_f64s(turn);
                let less = simd.less_than_f64s(simd.mul_f64s(room, under), simd.mul_f64s(over, turn));
                over = simd.select_f64s(less, room, over);
                under = simd.select_f64s(less, turn, under);
            }
        }
        // Where nothing moves but bends, |s| q <= 1 for every axis.
        let still = simd.equal_f64s(moving, zero);
        let bent = simd.and_m64s(still, simd.less_than_f64s(one, simd.mul_f64s(q, bend)));
        over = simd.select_f64s(bent, one, over);
        under = simd.select_f64s(bent, bend, under);
        simd.div_f64s(over, under)
    }

    /// Lowers q to what the rest of the path can be survived from: the lowest w still has to reach q at the next
    /// station, q + d w <= q_next, at w = (-1 - s q)/g.
    #[inline(always)]
    fn backward<S: Simd>(&self, simd: S, steps: &[Lanes], q: &mut [Lanes]) {
        let mut next = 0.0;
        for (chunk, (step, q)) in steps.iter().zip(q).enumerate().rev() {
            let lines = self.lines(simd, chunk, step, |gain, cost| (gain, cost));
            for l in (0..LANES).rev() {
                // The last station has no next one: q is zero there and stays so.
                next = smaller(lines.least(l, next), q[l]);
                q[l] = next;
            }
        }
    }

    /// Lowers q to what can be reached: q_next <= q + d w at the highest w = (1 - s q)/g.
    #[inline(always)]
    fn forward<S: Simd>(&self, simd: S, steps: &[Lanes], q: &mut [Lanes]) {
        let mut reach = 0.0;
        for (chunk, (step, q)) in steps.iter().zip(q).enumerate() {
            let lines = self.lines(simd, chunk, step, |gain, cost| (cost, gain));
            for (l, q) in q.iter_mut().enumerate() {
                *q = smaller(reach, *q);
                reach = larger(lines.least(l, *q), 0.0);
            }
        }
    }

    /// Lines of slope over/under and offset d/under, where over and under are g and g - d s in some order; none
    /// where under is not positive.
    #[inline(always)]
    fn lines<S: Simd>(
        &self,
        simd: S,
        chunk: usize,
        step: &Lanes,
        order: impl Fn(S::f64s, S::f64s) -> (S::f64s, S::f64s),
    ) -> Lines<A> {
        let (one, zero) = (simd.splat_f64s(1.0), simd.splat_f64s(0.0));
        let (still, far) = (simd.splat_f64s(STILL), simd.splat_f64s(f64::INFINITY));
        let mut lines = Lines { slope: [[0.0; LANES]; A], offset: [[0.0; LANES]; A] };
        for a in 0..A {
            let slopes = S::as_mut_simd_f64s(&mut lines.slope[a]).0;
            let offsets = S::as_mut_simd_f64s(&mut lines.offset[a]).0;
            for (v, (line, offset)) in slopes.iter_mut().zip(offsets).enumerate() {
                let (gain, slope) = self.strip(simd, chunk, v, a);
                let step = part::<S>(step, v);
                let (over, under) = order(gain, simd.sub_f64s(gain, simd.mul_f64s(step, slope)));
                let bounds = simd.less_than_f64s(still, under);
                let inverse = simd.div_f64s(one, under);
                *line = simd.select_f64s(bounds, simd.mul_f64s(over, inverse), zero);
                *offset = simd.select_f64s(bounds, simd.mul_f64s(step, inverse), far);
            }
        }
        lines
    }
}

/// Part `v` of the lanes, as many as the instruction set takes at once.
#[inline(always)]
fn part<S: Simd>(lanes: &Lanes, v: usize) -> S::f64s {
    S::as_simd_f64s(lanes).0[v]
}

/// Whether any lane is set.
#[inline(always)]
fn any<S: Simd>(simd: S, mask: S::m64s) -> bool {
    simd.first_true_m64s(mask) < S::F64_LANES
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

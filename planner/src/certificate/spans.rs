//! Ratios of one span: each a polynomial, bounded through its Bernstein coefficients.
//!
//! Inner spans, in x: `velocity^2 = p'^2 q`, `acceleration = p'' q + p' q'/2`,
//! `jerk^2 = (p''' q + 3/2 p'' q' + 1/2 p' q'')^2 q`.
//!
//! Rest spans, in tau = t/T with x = h tau^3, s = tau^3 and c = (3 h / T)^2 = q at the inner end:
//! `velocity = sqrt(c) tau^2 p'`, `acceleration = c tau (2/3 p'/h + s p'')`,
//! `jerk = c^(3/2) (2/9 p'/h^2 + 2 s p''/h + s^2 p''')`. Landings are launches of the reversed path.

use super::bernstein::{
    Form, Locus, Peak, ROUNDING, clip, from_cubes, line_times_line, split, square, square_of_octic,
    times_line, times_quadratic,
};
use super::hodograph::{Hodograph, Rate};
use crate::geometry::section::SpeedCap;
use crate::job::machine::{AxisLimits, MAX_AXES};
use crate::tolerances::{LARGEST_LIMIT, SMALLEST_LIMIT};

/// The peaks of every axis, and of the feed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peaks {
    pub(super) axes: [AxisPeaks; MAX_AXES],
    pub(super) feed: Peak,
}

/// What is known of one axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct AxisPeaks {
    pub(super) velocity: Peak,
    pub(super) acceleration: Peak,
    pub(super) jerk: Peak,
}

impl Peaks {
    pub(super) const NONE: Self = Self { axes: [AxisPeaks::NONE; MAX_AXES], feed: Peak::NONE };

    pub(super) fn merge(self, other: Self) -> Self {
        Self {
            axes: std::array::from_fn(|a| self.axes[a].merge(other.axes[a])),
            feed: self.feed.merge(other.feed),
        }
    }
}

impl AxisPeaks {
    const NONE: Self = Self { velocity: Peak::NONE, acceleration: Peak::NONE, jerk: Peak::NONE };

    pub(super) fn merge(self, other: Self) -> Self {
        Self {
            velocity: self.velocity.merge(other.velocity),
            acceleration: self.acceleration.merge(other.acceleration),
            jerk: self.jerk.merge(other.jerk),
        }
    }
}

/// 1 / limit; `None` when there is no limit.
fn per_limit(limit: f64) -> Option<f64> {
    if limit == f64::INFINITY {
        return None;
    }
    Some(if limit >= SMALLEST_LIMIT { 1.0 / limit.min(LARGEST_LIMIT) } else { f64::NAN })
}

/// Speed caps on a part of a span, as shares of the span's length.
#[derive(Clone, Copy, Debug)]
pub(super) struct CapPart {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) speed: SpeedCap,
}

/// Bounds one axis on an inner span.
pub(super) fn inner_axis(peaks: &mut AxisPeaks, p: &Hodograph, r: &Rate, limits: &AxisLimits, at: Locus) {
    let [m1, m2, m3] = p.size;
    let [mq, md, mg] = r.size;
    if let Some(k) = per_limit(limits.velocity) {
        let c = times_quadratic(&square(&p.first), &r.q).map(|x| x * (k * k));
        peaks.velocity.climb(Form::Squared, &c, ROUNDING * m1 * m1 * mq * (k * k), at);
    }
    if let Some(k) = per_limit(limits.acceleration) {
        let (bent, driven) = (times_line(&r.q, &p.second), times_line(&p.first, &r.half_slope));
        let c = std::array::from_fn::<_, 4, _>(|i| (bent[i] + driven[i]) * k);
        peaks.acceleration.climb(Form::Signed, &c, ROUNDING * (m2 * mq + m1 * md) * k, at);
    }
    if let Some(k) = per_limit(limits.jerk) {
        let cross = line_times_line(&p.second, &r.half_slope);
        let f = std::array::from_fn::<_, 3, _>(|i| {
            (p.third * r.q[i] + 3.0 * cross[i] + r.half_curvature * p.first[i]) * k
        });
        let size = (m3 * mq + 3.0 * m2 * md + mg * m1) * k;
        // Terms far larger than their sum cancel on very short spans: the square is off by 2 f df, not by size df.
        let (df, most) = (ROUNDING * size, f.iter().fold(0.0, |m: f64, x| m.max(x.abs())));
        let slack = (ROUNDING * most * most + df * (2.0 * most + df)) * mq;
        peaks.jerk.climb(Form::Squared, &times_quadratic(&square(&f), &r.q), slack, at);
    }
}

/// Bounds the path speed on an inner span under one cap.
pub(super) fn inner_cap(peak: &mut Peak, all: &[Hodograph], r: &Rate, cap: CapPart, at: Locus) {
    let at = Locus { from: cap.from, to: cap.to, ..at };
    match cap.speed {
        SpeedCap::None => {}
        SpeedCap::Tangential { axes, speed } => {
            let Some(k) = per_limit(speed) else { return };
            let (mut sum, mut size) = ([0.0; 5], 0.0);
            for (_, p) in all.iter().enumerate().filter(|(i, _)| axes >> i & 1 == 1) {
                let s = square(&p.first);
                sum = std::array::from_fn(|i| sum[i] + s[i]);
                size += p.size[0] * p.size[0];
            }
            let c = times_quadratic(&sum, &r.q).map(|x| x * (k * k));
            let slack = ROUNDING * size * r.size[0] * (k * k);
            peak.climb(Form::Squared, &clip(&c, cap.from, cap.to), slack, Locus { axis: axes, ..at });
        }
        SpeedCap::Rate(rate) => {
            let Some(k) = per_limit(rate) else { return };
            let c = clip(&r.q.map(|x| x * (k * k)), cap.from, cap.to);
            peak.climb(Form::Squared, &c, ROUNDING * r.size[0] * (k * k), at);
        }
    }
}

/// A rest span; its path is given as seen from the rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    /// Length in u.
    pub(super) h: f64,
    /// q at the inner end.
    pub(super) q: f64,
}

impl Rest {
    /// Coefficients of p' and, to the same scale, h p'' and h^2 p''' in powers of s.
    fn terms(&self, p: &Hodograph) -> ([f64; 3], f64) {
        let h = self.h;
        let size = p.size[0] + p.size[1] * h + p.size[2] * h * h;
        ([p.first[0], p.second[0] * h, p.third * h * h], size)
    }

    /// Velocity over tau.
    fn velocity(&self, p: &Hodograph, k: f64) -> ([f64; 9], f64) {
        let ([a, b, c], size) = self.terms(p);
        let scale = self.q.sqrt() * k;
        (from_cubes(&[a * scale, b * scale, 0.5 * c * scale], 2), ROUNDING * size * scale)
    }

    /// Bounds one axis.
    pub(super) fn axis(&self, peaks: &mut AxisPeaks, p: &Hodograph, limits: &AxisLimits, at: Locus) {
        if let Some(k) = per_limit(limits.velocity) {
            let (c, slack) = self.velocity(p, k);
            peaks.velocity.climb(Form::Signed, &c, slack, at);
        }
        let ([a, b, c], size) = self.terms(p);
        let scale = self.q / self.h;
        if let Some(k) = per_limit(limits.acceleration) {
            let powers = [2.0 / 3.0 * a, 5.0 / 3.0 * b, 4.0 / 3.0 * c].map(|x| x * scale * k);
            let c: [f64; 8] = from_cubes(&powers, 1);
            peaks.acceleration.climb(Form::Signed, &c, 2.0 * ROUNDING * size * scale * k, at);
        }
        if let Some(k) = per_limit(limits.jerk) {
            let scale = scale * self.q.sqrt() / self.h;
            let powers = [2.0 / 9.0 * a, 20.0 / 9.0 * b, 28.0 / 9.0 * c].map(|x| x * scale * k);
            let c: [f64; 7] = from_cubes(&powers, 0);
            peaks.jerk.climb(Form::Signed, &c, 4.0 * ROUNDING * size * scale * k, at);
        }
    }

    /// Bounds the path speed under one cap, whose ends count from the rest.
    pub(super) fn cap(&self, peak: &mut Peak, all: &[Hodograph], cap: CapPart, at: Locus) {
        // Cube roots are taken outwards: the part may only become longer.
        let from = cap.from.cbrt() * (1.0 - 4.0 * f64::EPSILON);
        let to = if cap.to < 1.0 { cap.to.cbrt() * (1.0 + 4.0 * f64::EPSILON) } else { 1.0 };
        let at = Locus { from, to: to.min(1.0), ..at };
        match cap.speed {
            SpeedCap::None => {}
            SpeedCap::Tangential { axes, speed } => {
                let Some(k) = per_limit(speed) else { return };
                let (mut sum, mut slack) = ([0.0; 17], 0.0);
                for (_, p) in all.iter().enumerate().filter(|(i, _)| axes >> i & 1 == 1) {
                    let (c, size) = self.velocity(p, k);
                    let s = square_of_octic(&c);
                    sum = std::array::from_fn(|i| sum[i] + s[i]);
                    slack += size * size / ROUNDING;
                }
                peak.climb(Form::Squared, &clip(&sum, at.from, at.to), slack, Locus { axis: axes, ..at });
            }
            SpeedCap::Rate(rate) => {
                let Some(k) = per_limit(rate) else { return };
                let top = self.q.sqrt() * k;
                let c = split(&[0.0, 0.0, top], at.to).0;
                peak.climb(Form::Signed, &c, ROUNDING * top, Locus { from: 0.0, ..at });
            }
        }
    }
}

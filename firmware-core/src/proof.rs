//! The drive's own proof that a table keeps the limits it declares: at every instant, not at the ticks alone.
//!
//! On a span position is a cubic in x and the squared speed a quadratic, so velocity squared, acceleration and jerk over
//! the speed are polynomials in x, and the largest of their Bernstein coefficients bounds them. Jerk is bounded through a
//! tangent: J/sqrt(q) >= J (1.5 s - s^3 q/2) for any s. Where a span as a whole does not do, its halves, quarters and
//! eighths are looked at. Rounding is outward. The margin that the table's header declares is granted beyond every limit.

use protocol::table::{AxisLimit, Limits};

/// Rounding errors of a coefficient, as a share of the sizes that it is made from.
const ROUNDING: f32 = 32.0 * f32::EPSILON;
/// Parts in which a span is looked at, the fewest first.
const PARTS: [u8; 4] = [1, 2, 4, 8];
/// Parts of a rest span: there are two in a table.
const REST_PARTS: u8 = 64;
/// Tangents that are tried on a part.
const TANGENTS: u8 = 5;

/// Squared speed along the path on a span: q = q0 + 2 d x + gamma x^2 for 0 <= x <= h.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Speed {
    pub(crate) h: f32,
    pub(crate) q0: f32,
    pub(crate) d: f32,
    pub(crate) gamma: f32,
}

/// A rest span: x = h (t/T)^3, from the rest on; `rate` is 1/T.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rest {
    pub(crate) h: f32,
    pub(crate) rate: f32,
}

/// Derivatives of position by x, where a span begins: p' = p1 + p2 x + p3 x^2/2; and the sizes they were computed from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slopes {
    pub(crate) p1: f32,
    pub(crate) p2: f32,
    pub(crate) p3: f32,
    pub(crate) sizes: [f32; 3],
}

impl Slopes {
    /// Of c1 x + c2 x^2 + c3 x^3, from `offset` on, over `h`.
    pub(crate) fn of(power: &[f32; 4], offset: f32, h: f32) -> Self {
        let [_, c1, c2, c3] = *power;
        let x = offset + h;
        Self {
            p1: c1 + offset * (2.0 * c2 + offset * (3.0 * c3)),
            p2: 2.0 * c2 + offset * (6.0 * c3),
            p3: 6.0 * c3,
            sizes: [
                c1.abs() + x * (2.0 * c2.abs() + x * (3.0 * c3.abs())),
                2.0 * c2.abs() + x * (6.0 * c3.abs()),
                6.0 * c3.abs(),
            ],
        }
    }
}

/// Limits with their margin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Granted {
    velocity: f32,
    acceleration: f32,
    /// Infinite where jerk is not limited.
    jerk: f32,
}

impl Granted {
    /// `margin` is what may be granted for rounding, of the table and of this proof [0.1 %].
    pub(crate) fn new(limits: &Limits, margin: u8) -> Self {
        let with = |limit: f32| limit * (1.0 + f32::from(margin) * 1e-3);
        Self {
            velocity: with(limits.velocity),
            acceleration: with(limits.acceleration),
            jerk: limits.jerk.map_or(f32::INFINITY, with),
        }
    }

    /// Proves a span between rests; the limit that cannot be proven otherwise.
    pub(crate) fn span(&self, p: &Slopes, s: &Speed) -> Result<(), AxisLimit> {
        // Bounds on q and |q'|/2 that need no case.
        let bend = s.d.abs() + s.h * s.gamma.abs();
        let fastest = s.q0 + 2.0 * s.h * bend;
        let [m1, m2, m3] = p.sizes;
        let error = [
            ROUNDING * m1 * m1 * fastest,
            ROUNDING * (m2 * fastest + m1 * bend),
            ROUNDING * (m3 * fastest + 3.0 * m2 * bend + m1 * s.gamma.abs()),
        ];
        let mut unproven = AxisLimit::Velocity;
        for parts in PARTS {
            let width = s.h / f32::from(parts);
            let each = (0..parts).map(|part| f32::from(part) * width);
            match each.map(|from| self.part(p, s, from, width, &error)).find_map(Result::err) {
                None => return Ok(()),
                Some(limit) => unproven = limit,
            }
        }
        Err(unproven)
    }

    /// Proves a part of a span.
    fn part(&self, p: &Slopes, s: &Speed, from: f32, width: f32, error: &[f32; 3]) -> Result<(), AxisLimit> {
        // Bernstein coefficients of p', p'', q and q'/2.
        let (p1, p2) = (p.p1 + from * (p.p2 + 0.5 * from * p.p3), p.p2 + from * p.p3);
        let b = [p1, p1 + 0.5 * width * p2, p1 + width * (p2 + 0.5 * width * p.p3)];
        let c = [p2, p2 + width * p.p3];
        let (q0, d0) = (s.q0 + from * (2.0 * s.d + from * s.gamma), s.d + from * s.gamma);
        let q = [q0, q0 + width * d0, q0 + width * (2.0 * d0 + width * s.gamma)];
        let d = [d0, d0 + width * s.gamma];
        // What is not a number is within nothing.
        let within = |values: &[f32], limit: f32| values.iter().all(|v| v.abs() <= limit);
        let velocity = self.velocity * self.velocity - error[0];
        let slope = p1.abs() + width * (p2.abs() + 0.5 * width * p.p3.abs());
        let fastest = q0 + width * (2.0 * d0.abs() + width * s.gamma.abs());
        let slow = slope * slope * fastest <= velocity || within(&velocities(&b, &q), velocity);
        if !slow {
            return Err(AxisLimit::Velocity);
        }
        let acceleration = [
            c[0] * q[0] + b[0] * d[0],
            (2.0 * (c[0] * q[1] + b[1] * d[0]) + c[1] * q[0] + b[0] * d[1]) * (1.0 / 3.0),
            (2.0 * (c[1] * q[1] + b[1] * d[1]) + c[0] * q[2] + b[2] * d[0]) * (1.0 / 3.0),
            c[1] * q[2] + b[2] * d[1],
        ];
        if !within(&acceleration, self.acceleration - error[1]) {
            return Err(AxisLimit::Acceleration);
        }
        let jerk = self.jerk;
        if jerk == f32::INFINITY {
            return Ok(());
        }
        let f = [
            p.p3 * q[0] + 3.0 * c[0] * d[0] + s.gamma * b[0],
            p.p3 * q[1] + 1.5 * (c[0] * d[1] + c[1] * d[0]) + s.gamma * b[1],
            p.p3 * q[2] + 3.0 * c[1] * d[1] + s.gamma * b[2],
        ];
        let allowed = jerk * jerk * (1.0 - ROUNDING);
        if f.iter().all(|f| (f.abs() + error[2]) * (f.abs() + error[2]) * fastest <= allowed) {
            return Ok(());
        }
        let least = q[0].min(q[1]).min(q[2]);
        let moves = least > 0.0;
        if !moves {
            return Err(AxisLimit::Jerk);
        }
        let most = f.map(|f| f.abs() + error[2]);
        let granted = jerk * (1.0 - ROUNDING);
        let holds = |s: f32| {
            let (line, steep) = (1.5 * granted * s, 0.5 * granted * s * s * s);
            most[0] <= line - steep * q[0] && most[1] <= line - steep * q[1] && most[2] <= line - steep * q[2]
        };
        // Between the tangents at the largest and at the smallest q, the middle one first.
        let (low, high) = (1.0 / crate::math::sqrt(fastest), 1.0 / crate::math::sqrt(least));
        let step = (high - low) * (1.0 / f32::from(TANGENTS - 1));
        let found = holds(low + 2.0 * step) || (0..TANGENTS).any(|k| holds(low + f32::from(k) * step));
        if found { Ok(()) } else { Err(AxisLimit::Jerk) }
    }

    /// Proves a rest span.
    ///
    /// With r = t/T: x' = 3 h r^2/T, x'' = 6 h r/T^2, x''' = 6 h/T^3, and p' is a polynomial of r^3.
    pub(crate) fn rest(&self, p: &Slopes, rest: &Rest) -> Result<(), AxisLimit> {
        let Rest { h, rate } = *rest;
        let (a, b, c) = (p.p1, p.p2 * h, 0.5 * p.p3 * h * h);
        let [m1, m2, m3] = p.sizes;
        let size = ROUNDING * (m1 + m2 * h + m3 * h * h);
        let unit = h * rate;
        // Powers of r and their factors: p' x', then p'' x'^2 + p' x'', then p''' x'^3 + 3 p'' x' x'' + p' x'''.
        let velocity = [(2u8, 3.0 * a), (5, 3.0 * b), (8, 3.0 * c)];
        let acceleration = [(1u8, 6.0 * a), (4, 15.0 * b), (7, 24.0 * c)];
        let jerk = [(0u8, 6.0 * a), (3, 60.0 * b), (6, 168.0 * c)];
        let cases = [
            (velocity, self.velocity, unit, 3.0, AxisLimit::Velocity),
            (acceleration, self.acceleration, unit * rate, 24.0, AxisLimit::Acceleration),
            (jerk, self.jerk, unit * rate * rate, 168.0, AxisLimit::Jerk),
        ];
        for (terms, limit, scale, weight, name) in cases {
            // Between two places a function exceeds both by at most an eighth of their distance squared times its
            // second derivative, which is largest at the end.
            let bend: f32 =
                terms.iter().map(|(k, f)| f32::from(*k) * f32::from(k.saturating_sub(1)) * f.abs()).sum();
            let between = bend / (8.0 * f32::from(REST_PARTS) * f32::from(REST_PARTS));
            let at = |part: u8| {
                let r = f32::from(part) / f32::from(REST_PARTS);
                let power = |k: u8| (0..k).fold(1.0f32, |product, _| product * r);
                terms.iter().map(|(k, factor)| factor * power(*k)).sum::<f32>().abs()
            };
            let most = (0..=REST_PARTS).map(at).fold(0.0, larger) + between + weight * size;
            let kept = most * scale <= limit;
            if !kept {
                return Err(name);
            }
        }
        Ok(())
    }
}

/// The larger one; what is not a number stays.
fn larger(a: f32, b: f32) -> f32 {
    if a >= b || a.is_nan() { a } else { b }
}

/// Bernstein coefficients of p'^2 q, of the sixth degree.
fn velocities(b: &[f32; 3], q: &[f32; 3]) -> [f32; 7] {
    let [b0, b1, b2] = *b;
    let [q0, q1, q2] = *q;
    let e = [b0 * b0, b0 * b1, (b0 * b2 + 2.0 * b1 * b1) * (1.0 / 3.0), b1 * b2, b2 * b2];
    [
        e[0] * q0,
        (2.0 * e[1] * q0 + e[0] * q1) * (1.0 / 3.0),
        (6.0 * e[2] * q0 + 8.0 * e[1] * q1 + e[0] * q2) * (1.0 / 15.0),
        (e[3] * q0 + 3.0 * e[2] * q1 + e[1] * q2) * (1.0 / 5.0),
        (e[4] * q0 + 8.0 * e[3] * q1 + 6.0 * e[2] * q2) * (1.0 / 15.0),
        (e[4] * q1 + 2.0 * e[3] * q2) * (1.0 / 3.0),
        e[4] * q2,
    ]
}

#[cfg(test)]
mod tests;

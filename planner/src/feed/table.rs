//! The feed table in the planner's hands: the rounded numbers, and the exact law of motion they stand for.

use crate::geometry::grid_path::GridPath;

/// Fewest q spans of a table: two rest spans and three between them, so that both rest conditions fit.
pub const MIN_SPANS: usize = 5;

/// One stretch of motion from rest to rest: a rounded path and a rounded q(u) = (du/dt)^2 on it.
///
/// The first and last span are rest spans, u = h (t/T)^3 and its mirror image. Between them q is a C1 quadratic
/// B-spline; span i (1..n-1) has one control value c_i. The codes carry q at the first inner knot, then c_2 ..
/// c_{n-3}, then q at the last inner knot; c_1 and c_{n-2} follow from the rest conditions
/// q' = (4/3) q / h. `codes[i - 1]` belongs to span i, and c = code^2 q_scale.
#[derive(Clone, Debug, PartialEq)]
pub struct FeedTable {
    /// The path.
    pub path: GridPath,
    /// Lengths of the q spans [grid steps]; their sum is the path's length; every geometry knot is a q knot.
    pub steps: Vec<u32>,
    /// Size of one squared code [u^2/s^2].
    pub q_scale: f32,
    /// `steps.len() - 2` codes, all positive.
    pub codes: Vec<u32>,
}

/// q on one span, in powers of x = u - U_i; or a rest span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpanLaw {
    /// Starts at rest: x = h (t/T)^3.
    Launch {
        /// Length in u.
        h: f64,
        /// Duration [s].
        duration: f64,
    },
    /// (dx/dt)^2 = alpha + beta x + gamma x^2.
    Quadratic {
        /// Length in u.
        h: f64,
        /// Coefficients alpha, beta, gamma.
        q: [f64; 3],
    },
    /// Ends at rest: h - x = h ((T - t)/T)^3.
    Landing {
        /// Length in u.
        h: f64,
        /// Duration [s].
        duration: f64,
    },
}

impl FeedTable {
    /// Number of q spans.
    pub fn spans(&self) -> usize {
        self.steps.len()
    }

    /// Length of span `i` in u.
    pub fn step_length(&self, i: usize) -> f64 {
        f64::from(self.steps[i]) * self.path.step
    }

    /// Value of one code [u^2/s^2]; exactly the drive's number.
    pub fn value(&self, code: u32) -> f64 {
        let code = code as f32;
        f64::from(code * code * self.q_scale)
    }

    /// Control value of inner span `i` (1..=n-2), the two next to rest spans derived.
    pub fn control(&self, i: usize) -> f64 {
        let n = self.spans();
        let c = self.value(self.codes[i - 1]);
        if i == 1 {
            c + self.step_length(1) * (2.0 / 3.0) * c / self.step_length(0)
        } else if i == n - 2 {
            c + self.step_length(n - 2) * (2.0 / 3.0) * c / self.step_length(n - 1)
        } else {
            c
        }
    }

    /// Half of q' at knot `i` (1..=n-1): the path acceleration there [u/s^2].
    pub fn knot_acceleration(&self, i: usize) -> f64 {
        let n = self.spans();
        if i == 1 {
            (2.0 / 3.0) * self.value(self.codes[0]) / self.step_length(0)
        } else if i == n - 1 {
            -(2.0 / 3.0) * self.value(self.codes[n - 3]) / self.step_length(n - 1)
        } else {
            (self.control(i) - self.control(i - 1)) / (self.step_length(i - 1) + self.step_length(i))
        }
    }

    /// The law of span `i`.
    pub fn law(&self, i: usize) -> SpanLaw {
        let n = self.spans();
        let h = self.step_length(i);
        if i == 0 {
            return SpanLaw::Launch { h, duration: 3.0 * h / self.value(self.codes[0]).sqrt() };
        }
        if i == n - 1 {
            return SpanLaw::Landing { h, duration: 3.0 * h / self.value(self.codes[n - 3]).sqrt() };
        }
        let (d0, d1) = (self.knot_acceleration(i), self.knot_acceleration(i + 1));
        SpanLaw::Quadratic { h, q: [self.control(i) - h * d0, 2.0 * d0, (d1 - d0) / h] }
    }

    /// Duration of the whole table [s].
    pub fn duration(&self) -> f64 {
        (0..self.spans()).map(|i| self.law(i).duration()).sum()
    }
}

impl SpanLaw {
    /// Time to cross the span [s], in closed form: T = 2 w A(gamma w^2), w = h / (v0 + v1).
    pub fn duration(&self) -> f64 {
        match *self {
            SpanLaw::Launch { duration, .. } | SpanLaw::Landing { duration, .. } => duration,
            SpanLaw::Quadratic { h, q: [alpha, beta, gamma] } => {
                let v0 = alpha.max(0.0).sqrt();
                let v1 = (alpha + h * (beta + h * gamma)).max(0.0).sqrt();
                let w = h / (v0 + v1);
                2.0 * w * atanh_over(gamma * w * w)
            }
        }
    }
}

/// A(y) = artanh(sqrt y)/sqrt y for y > 0, arctan(sqrt -y)/sqrt -y for y < 0, 1 at 0.
fn atanh_over(y: f64) -> f64 {
    if y.abs() < 1e-4 {
        return 1.0 + y * (1.0 / 3.0 + y * (1.0 / 5.0 + y / 7.0));
    }
    let r = y.abs().sqrt();
    if y > 0.0 { r.atanh() / r } else { r.atan() / r }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::grid_path::GridAxis;

    fn sample() -> FeedTable {
        let axes = vec![GridAxis { lsb: 1e-3, controls: vec![0, 1000, 2000, 3000] }];
        let path = GridPath { step: 1.0 / 64.0, breaks: vec![0, 640], axes };
        let codes = vec![900, 2000, 2500, 2100, 800];
        FeedTable { path, steps: vec![20, 40, 130, 250, 100, 80, 20], q_scale: 1e-5, codes }
    }

    #[test]
    fn q_and_its_slope_are_continuous_at_every_inner_knot() {
        let t = sample();
        for i in 1..t.spans() - 2 {
            let (SpanLaw::Quadratic { h, q: a }, SpanLaw::Quadratic { q: b, .. }) = (t.law(i), t.law(i + 1))
            else {
                panic!("inner spans are quadratic")
            };
            assert!((a[0] + h * (a[1] + h * a[2]) - b[0]).abs() < 1e-12 * b[0]);
            assert!((a[1] + 2.0 * h * a[2] - b[1]).abs() < 1e-9 * b[0]);
        }
    }

    #[test]
    fn rest_spans_join_with_equal_speed_and_acceleration() {
        let t = sample();
        let (SpanLaw::Launch { h, duration }, SpanLaw::Quadratic { q, .. }) = (t.law(0), t.law(1)) else {
            panic!()
        };
        assert!((3.0 * h / duration - q[0].sqrt()).abs() < 1e-12);
        assert!((6.0 * h / (duration * duration) - 0.5 * q[1]).abs() < 1e-9);
    }

    #[test]
    fn duration_matches_quadrature() {
        let t = sample();
        for i in 1..t.spans() - 1 {
            let SpanLaw::Quadratic { h, q } = t.law(i) else { panic!() };
            let n = 20_000;
            let mid = |k: usize| (k as f64 + 0.5) / f64::from(n) * h;
            let sum: f64 = (0..n as usize)
                .map(|k| h / f64::from(n) / (q[0] + mid(k) * (q[1] + mid(k) * q[2])).sqrt())
                .sum();
            assert!((t.law(i).duration() / sum - 1.0).abs() < 1e-7, "span {i}");
        }
    }
}

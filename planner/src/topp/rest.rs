//! Rest spans: u = h (t/T)^3 and its mirror image, reduced to one bound on q at the joint.

use super::layout::Derivatives;
use super::layout::Strictest;
use crate::job::machine::AxisLimits;

/// Largest q at the inner end of a rest span of length `h` under every limit.
///
/// With w = (t/T)^3 and v = sqrt(q1): u_t = v w^(2/3), u_tt = (2/3) v^2 w^(1/3)/h, u_ttt = (2/9) v^3/h^2, so
/// velocity, acceleration and jerk of an axis are v, v^2 and v^3 times polynomials of degree 2 in w (times powers of
/// t/T <= 1); their Bernstein coefficients bound them. `axes` hold the derivatives seen leaving rest.
pub(super) fn joint_bound(
    h: f64,
    axes: &[Derivatives],
    limits: &[AxisLimits],
    caps: &Strictest,
    shortest_span_s: f64,
) -> f64 {
    let mut q = caps.rate * caps.rate;
    if shortest_span_s > 0.0 {
        q = q.min((3.0 * h / shortest_span_s).powi(2));
    }
    for (d, l) in axes.iter().zip(limits) {
        if d.still() {
            continue;
        }
        q = q.min((l.velocity / d.first_max()).powi(2));
        let w = second_in_w(d);
        let k = 2.0 / (3.0 * h);
        let acceleration = (0..3).fold(0.0, |m: f64, i| m.max((w[i] + k * d.first[i]).abs()));
        q = q.min(l.acceleration / acceleration);
        if l.jerk.is_finite() {
            let third = [0.0, 0.0, d.third];
            let jerk = (0..3).fold(0.0, |m: f64, i| {
                m.max((third[i] + 2.0 / h * w[i] + 2.0 / (9.0 * h * h) * d.first[i]).abs())
            });
            q = q.min((l.jerk / jerk).powf(2.0 / 3.0));
        }
    }
    for (mask, speed) in caps.tangential.iter().flatten() {
        let mut squares = [0.0; 5];
        for (_, d) in axes.iter().enumerate().filter(|(i, _)| mask >> i & 1 == 1) {
            squares.iter_mut().zip(d.first_squared()).for_each(|(s, e)| *s += e);
        }
        let largest = squares.into_iter().fold(0.0, f64::max);
        if largest > 0.0 {
            q = q.min(speed * speed / largest);
        }
    }
    q
}

/// Bernstein coefficients in w of p''(h w) w.
fn second_in_w(d: &Derivatives) -> [f64; 3] {
    [0.0, 0.5 * d.second[0], d.second[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::grid_path::Piece;

    #[test]
    fn sampled_motion_touches_but_never_exceeds_a_limit() {
        let none = Strictest { tangential: [None; 2], rate: f64::INFINITY };
        let cases = [
            ([0.0, 1.0, 0.0, 0.0], [100.0, 500.0, 1e4]),
            ([0.0, 0.8, 0.3, -0.5], [100.0, 500.0, 1e4]),
            ([0.0, -0.2, 4.0, 30.0], [3.0, 500.0, 1e4]),
            ([0.0, 0.9, -2.0, 1.0], [100.0, 20.0, 1e9]),
        ];
        for (power, [velocity, acceleration, jerk]) in cases {
            let h = 0.05;
            let piece = Piece { base: 0, power, length: 1.0 };
            let limits = AxisLimits { velocity, acceleration, jerk };
            let d = Derivatives::of(&piece, 0.0, h);
            let q1 = joint_bound(h, &[d], &[limits], &none, 0.0);
            let t_end = 3.0 * h / q1.sqrt();
            let mut worst: f64 = 0.0;
            for k in 0..=1000 {
                let t = f64::from(k) / 1000.0;
                let (x, v) = (h * t * t * t, q1.sqrt() * t * t);
                let (a, j) = (6.0 * h * t / t_end.powi(2), 6.0 * h / t_end.powi(3));
                let (p1, p2, p3) = (piece.first(x), piece.second(x), piece.third());
                worst = worst
                    .max((p1 * v).abs() / velocity)
                    .max((p2 * v * v + p1 * a).abs() / acceleration)
                    .max((p3 * v.powi(3) + 3.0 * p2 * v * a + p1 * j).abs() / jerk);
            }
            assert!((0.5..=1.0 + 1e-12).contains(&worst), "{worst}");
        }
    }

    #[test]
    fn short_spans_are_kept_as_long_as_a_tick() {
        let none = Strictest { tangential: [None; 2], rate: f64::INFINITY };
        let limits = AxisLimits { velocity: 1e3, acceleration: 1e9, jerk: f64::INFINITY };
        let d = Derivatives { first: [1.0; 3], ..Derivatives::default() };
        let q1 = joint_bound(1e-3, &[d], &[limits], &none, 1e-3);
        assert!((3.0 * 1e-3 / q1.sqrt() / 1e-3 - 1.0).abs() < 1e-12);
    }
}

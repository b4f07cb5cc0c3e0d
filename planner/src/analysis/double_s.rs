//! How long a move from rest to rest takes under velocity, acceleration and jerk limits.

/// Shortest time of a straight move from rest to rest [s], in closed form: the seven-phase double-S profile
/// (Biagiotti & Melchiorri 2008, section 3.4) with its phases cut where the move is too short for them.
///
/// `jerk` may be infinite (trapezoidal profile), and so may `acceleration`; the time is 0 for a length of 0, and
/// infinite when a limit is 0.
pub fn double_s_rest_time(length: f64, velocity: f64, acceleration: f64, jerk: f64) -> f64 {
    if length <= 0.0 {
        return 0.0;
    }
    let rise = if jerk.is_infinite() { 0.0 } else { acceleration / jerk };
    // Time from rest to the speed v: a trapezoid of acceleration, or a triangle of it. Half of v is its mean.
    let ramp = |v: f64| {
        if jerk.is_infinite() || v * jerk >= acceleration * acceleration {
            v / acceleration + rise
        } else {
            2.0 * (v / jerk).sqrt()
        }
    };
    if velocity.is_finite() && velocity * ramp(velocity) <= length {
        return length / velocity + ramp(velocity);
    }
    if jerk.is_infinite() || acceleration.is_finite() && length >= 2.0 * acceleration * rise * rise {
        // v^2/a + v a/j = length; the time is 2 (v/a + a/j).
        rise + (rise * rise + 4.0 * length / acceleration).sqrt()
    } else {
        4.0 * (length / (2.0 * jerk)).cbrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Distance covered by the symmetric profile with peak speed `v`, integrated in small steps.
    fn integrate(v: f64, a: f64, j: f64, cruise_s: f64) -> (f64, f64) {
        let (hold, rise) = if v * j >= a * a { (v / a - a / j, a / j) } else { (0.0, (v / j).sqrt()) };
        let phases =
            [(rise, j), (hold, 0.0), (rise, -j), (cruise_s, 0.0), (rise, -j), (hold, 0.0), (rise, j)];
        let (mut x, mut speed, mut acceleration, mut time) = (0.0, 0.0, 0.0, 0.0);
        for (duration, jerk) in phases {
            let n = 2000;
            let dt = duration / f64::from(n);
            for _ in 0..n {
                // Exact for constant jerk over one step.
                x += dt * (speed + dt * (acceleration / 2.0 + dt * jerk / 6.0));
                speed += dt * (acceleration + dt * jerk / 2.0);
                acceleration += dt * jerk;
            }
            time += duration;
        }
        assert!(speed.abs() < 1e-6 * v && acceleration.abs() < 1e-6 * a.max(j * rise));
        (x, time)
    }

    proptest! {
        #[test]
        fn agrees_with_the_integrated_profile(
            v in 1.0f64..200.0, a in 10.0f64..5000.0, j in 100.0f64..1e5, share in 0.05f64..1.0, cruise in 0.0f64..2.0,
        ) {
            // A peak below the limit leaves no cruise; at the limit any cruise fits.
            let (peak, cruise) = if share < 0.8 { (v * share, 0.0) } else { (v, cruise) };
            let (length, time) = integrate(peak, a, j, cruise);
            prop_assert!((double_s_rest_time(length, v, a, j) / time - 1.0).abs() < 1e-6);
        }

        #[test]
        fn is_continuous_and_rises_with_length_and_falls_with_limits(
            l in 1e-3f64..100.0, v in 1.0f64..200.0, a in 10.0f64..5000.0, j in 100.0f64..1e5,
        ) {
            let t = double_s_rest_time(l, v, a, j);
            prop_assert!(double_s_rest_time(l * 1.001, v, a, j) > t);
            prop_assert!(double_s_rest_time(l * (1.0 + 1e-9), v, a, j) < t * (1.0 + 1e-6));
            prop_assert!(double_s_rest_time(l, v, a, 2.0 * j) <= t);
            prop_assert!(double_s_rest_time(l, v, a, f64::INFINITY) <= t);
            prop_assert!(double_s_rest_time(l, v, a, 1e12) / double_s_rest_time(l, v, a, f64::INFINITY) < 1.001);
        }
    }

    #[test]
    fn limits_without_end_and_without_room() {
        assert_eq!(double_s_rest_time(0.0, 1.0, 1.0, 1.0), 0.0);
        assert!((double_s_rest_time(1.0, 100.0, 4.0, f64::INFINITY) - 1.0).abs() < 1e-15);
        assert!((double_s_rest_time(2.0, 100.0, f64::INFINITY, 1.0) - 4.0).abs() < 1e-12);
        assert_eq!(double_s_rest_time(10.0, 2.0, f64::INFINITY, f64::INFINITY), 5.0);
        assert_eq!(double_s_rest_time(1.0, 0.0, 1.0, 1.0), f64::INFINITY);
    }
}

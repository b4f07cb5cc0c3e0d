use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use protocol::table::rules::USUAL_MARGIN;

use super::*;

extern crate std;

/// Largest |velocity|, |acceleration| and |jerk| of a span, sampled in f64.
fn sampled(p: &Slopes, s: &Speed) -> [f64; 3] {
    const SAMPLES: u32 = 2000;
    let [p1, p2, p3] = [p.p1, p.p2, p.p3].map(f64::from);
    let [h, q0, d, gamma] = [s.h, s.q0, s.d, s.gamma].map(f64::from);
    let mut most = [0.0f64; 3];
    for i in 0..=SAMPLES {
        let x = h * f64::from(i) / f64::from(SAMPLES);
        let (q, y) = (q0 + x * (2.0 * d + x * gamma), d + x * gamma);
        let (a, b) = (p1 + x * (p2 + 0.5 * x * p3), p2 + x * p3);
        let root = q.max(0.0).sqrt();
        let values = [a * root, b * q + a * y, (p3 * q + 3.0 * b * y + gamma * a) * root];
        most.iter_mut().zip(values).for_each(|(most, v)| *most = most.max(v.abs()));
    }
    most
}

fn sampled_rest(p: &Slopes, rest: &Rest) -> [f64; 3] {
    let [p1, p2, p3] = [p.p1, p.p2, p.p3].map(f64::from);
    let (h, rate) = (f64::from(rest.h), f64::from(rest.rate));
    let mut most = [0.0f64; 3];
    for i in 0..=2000 {
        let r = f64::from(i) / 2000.0;
        let x = h * r * r * r;
        let [x1, x2, x3] = [3.0 * h * r * r * rate, 6.0 * h * r * rate * rate, 6.0 * h * rate * rate * rate];
        let (a, b) = (p1 + x * (p2 + 0.5 * x * p3), p2 + x * p3);
        let values = [a * x1, b * x1 * x1 + a * x2, p3 * x1 * x1 * x1 + 3.0 * b * x1 * x2 + a * x3];
        most.iter_mut().zip(values).for_each(|(most, v)| *most = most.max(v.abs()));
    }
    most
}

/// Slopes that change by `bend` and `twist` of themselves over `h`.
fn slopes(size: f32, h: f32, bend: f32, twist: f32) -> Slopes {
    let (c1, c2, c3) = (size, 0.5 * size * bend / h, size * twist / (6.0 * h * h));
    Slopes::of(&[0.0, c1, c2, c3], 0.0, h)
}

fn limits(sizes: [f64; 3], factors: [f64; 3]) -> Limits {
    let [v, a, j] = [0, 1, 2].map(|k| (sizes[k].max(1e-20) * factors[k]) as f32);
    Limits { velocity: v, acceleration: a, jerk: Some(j) }
}

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(7),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config(40_000))]

    /// What is accepted keeps its limits, and what keeps them with a little room is accepted.
    #[test]
    fn spans_are_judged_as_dense_sampling_does(
        exponent in -4.0f32..6.0, h in 1e-3f32..1e3, bend in -1.5f32..1.5, twist in -1.5f32..1.5,
        fast in 1e-2f32..1e3, change in -0.6f32..0.6, curve in -0.2f32..0.2, tight in 0usize..3, factor in 0.95f64..1.1,
    ) {
        let p = slopes(10f32.powf(exponent), h, bend, twist);
        // q changes by a share of itself and bends by another, as the format's rule on spans asks.
        let q0 = fast * fast;
        let s = Speed { h, q0, d: 0.5 * q0 * change / h, gamma: q0 * curve / (h * h) };
        let found = sampled(&p, &s);
        let mut factors = [2.0; 3];
        factors[tight] = factor;
        let verdict = Granted::new(&limits(found, factors), USUAL_MARGIN).span(&p, &s);
        if factor * (1.0 + f64::from(USUAL_MARGIN) * 1e-3) < 1.0 - 1e-5 {
            let name = [AxisLimit::Velocity, AxisLimit::Acceleration, AxisLimit::Jerk][tight];
            prop_assert_eq!(verdict, Err(name));
        }
        if factor > 1.03 {
            prop_assert_eq!(verdict, Ok(()), "{} {:?} {:?} {:?}", factor, p, s, found);
        }
    }

    #[test]
    fn rests_are_judged_as_dense_sampling_does(
        exponent in -4.0f32..6.0, h in 1e-4f32..1e2, bend in -0.3f32..0.3, twist in -0.3f32..0.3,
        rate in 1e-1f32..1e3, tight in 0usize..3, factor in 0.95f64..1.1,
    ) {
        let p = slopes(10f32.powf(exponent), h, bend, twist);
        let rest = Rest { h, rate };
        let mut factors = [2.0; 3];
        factors[tight] = factor;
        let verdict = Granted::new(&limits(sampled_rest(&p, &rest), factors), USUAL_MARGIN).rest(&p, &rest);
        if factor * (1.0 + f64::from(USUAL_MARGIN) * 1e-3) < 1.0 - 1e-5 {
            let name = [AxisLimit::Velocity, AxisLimit::Acceleration, AxisLimit::Jerk][tight];
            prop_assert_eq!(verdict, Err(name));
        }
        if factor > 1.03 {
            prop_assert_eq!(verdict, Ok(()), "{} {:?} {:?}", factor, p, rest);
        }
    }

    /// Whatever bits come in, what is no number is not accepted.
    #[test]
    fn what_is_no_number_is_refused(bits in prop::array::uniform8(any::<u32>()), which in 0usize..7) {
        let mut n = bits.map(f32::from_bits);
        n[which] = f32::NAN;
        let p = Slopes { p1: n[0], p2: n[1], p3: n[2], sizes: [n[0].abs(), n[1].abs(), n[2].abs()] };
        let s = Speed { h: n[3], q0: n[4], d: n[5], gamma: n[6] };
        let granted = Granted::new(&Limits { velocity: 1e30, acceleration: 1e30, jerk: Some(1e30) }, USUAL_MARGIN);
        prop_assert!(granted.span(&p, &s).is_err());
    }
}

#[test]
fn jerk_that_is_not_limited_is_not_looked_at() {
    let p = slopes(1.0, 1.0, 0.0, 0.0);
    let s = Speed { h: 1.0, q0: 1.0, d: 0.1, gamma: 0.1 };
    let mut limits = Limits { velocity: 2.0, acceleration: 2.0, jerk: Some(1e-3) };
    assert_eq!(Granted::new(&limits, USUAL_MARGIN).span(&p, &s), Err(AxisLimit::Jerk));
    limits.jerk = None;
    assert_eq!(Granted::new(&limits, USUAL_MARGIN).span(&p, &s), Ok(()));
}

use super::*;
use proptest::prelude::*;

const ALL: [Ends; 4] = [Ends::NotAKnot, Ends::Clamped, Ends::Natural, Ends::Periodic];

fn knots_of(lengths: &[f64]) -> Vec<f64> {
    let mut at = 0.0;
    std::iter::once(0.0)
        .chain(lengths.iter().map(|h| {
            at += h;
            at
        }))
        .collect()
}

/// Third derivative on interval `i`, from the second at its ends.
fn third(s: &Cubic<'_>, i: usize, h: f64) -> f64 {
    (s.jet(i, h).second - s.jet(i, 0.0).second) / h
}

#[test]
fn not_a_knot_and_clamped_reproduce_a_cubic() {
    let f = |x: f64| 3.0 - x + 0.5 * x * x - 0.25 * x * x * x;
    let slope = |x: f64| -1.0 + x - 0.75 * x * x;
    for count in [3, 4, 5, 9, 40] {
        let lengths: Vec<f64> = (0..count).map(|i| 0.1 + 0.3 * f64::from(i * 7 % 5)).collect();
        let knots = knots_of(&lengths);
        let values: Vec<f64> = knots.iter().map(|&x| f(x)).collect();
        for ends in [Ends::NotAKnot, Ends::Clamped] {
            let system = CubicSystem::new(lengths.clone(), ends).unwrap();
            let s = system.interpolate(&values, [slope(0.0), slope(*knots.last().unwrap())]).unwrap();
            for i in 0..lengths.len() {
                for share in [0.0, 0.3, 0.7, 1.0] {
                    let (x, scale) = (knots[i] + share * lengths[i], f(*knots.last().unwrap()).abs());
                    let jet = s.jet(i, share * lengths[i]);
                    assert!((jet.value - f(x)).abs() < 1e-12 * scale, "{ends:?} {count}");
                    assert!((jet.slope - slope(x)).abs() < 1e-11 * scale, "{ends:?} {count}");
                    assert!((jet.second - (1.0 - 1.5 * x)).abs() < 1e-10 * scale, "{ends:?} {count}");
                }
            }
        }
    }
}

#[test]
fn two_values_make_a_straight_line() {
    for (ends, slopes) in [(Ends::NotAKnot, [9.0; 2]), (Ends::Natural, [9.0; 2]), (Ends::Clamped, [2.5; 2])] {
        let system = CubicSystem::new(vec![2.0], ends).unwrap();
        let s = system.interpolate(&[1.0, 6.0], slopes).unwrap();
        for x in [0.0, 0.5, 2.0] {
            assert_eq!(s.jet(0, x), Jet { value: 1.0 + 2.5 * x, slope: 2.5, second: 0.0 }, "{ends:?}");
        }
    }
}

#[test]
fn three_values_make_a_parabola_without_end_knots() {
    let system = CubicSystem::new(vec![1.0, 3.0], Ends::NotAKnot).unwrap();
    let s = system.interpolate(&[0.0, 1.0, 16.0], [0.0; 2]).unwrap();
    for (i, x, at) in [(0, 0.5, 0.5), (1, 0.0, 1.0), (1, 2.0, 3.0)] {
        let jet = s.jet(i, x);
        assert!((jet.value - at * at).abs() < 1e-14 && (jet.second - 2.0).abs() < 1e-14);
    }
}

#[test]
fn two_places_there_and_back_are_periodic() {
    let system = CubicSystem::new(vec![1.0, 1.0], Ends::Periodic).unwrap();
    let s = system.interpolate(&[0.0, 1.0, 0.0], [0.0; 2]).unwrap();
    let (start, turn, end) = (s.at_knot(0), s.at_knot(1), s.at_knot(2));
    assert!(start.slope.abs() < 1e-15 && turn.slope.abs() < 1e-15 && end.slope.abs() < 1e-15);
    assert!((start.second - end.second).abs() < 1e-15 && (start.second + turn.second).abs() < 1e-14);
}

#[test]
fn periodic_spline_of_a_circle_is_close_to_it() {
    let n = 64;
    let angle = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
    let values: Vec<f64> = (0..=n).map(|i| angle(i % n).cos()).collect();
    let system = CubicSystem::new(vec![angle(1); n], Ends::Periodic).unwrap();
    let s = system.interpolate(&values, [0.0; 2]).unwrap();
    // |f''''| h^4 / 384 is the error of the best cubic Hermite; the spline's is close to it (de Boor, ch. V).
    let bound = 1.5 * angle(1).powi(4) / 384.0;
    for i in 0..n {
        let x = 0.5 * angle(1);
        assert!((s.jet(i, x).value - (angle(i) + x).cos()).abs() < bound);
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let new = |h: &[f64], ends| CubicSystem::new(h.to_vec(), ends).map(|_| ());
    assert_eq!(new(&[], Ends::Natural), Err(SplineError::TooFew { found: 1, least: 2 }));
    assert_eq!(new(&[1.0], Ends::Periodic), Err(SplineError::TooFew { found: 2, least: 3 }));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(new(&[1.0, bad], Ends::Clamped), Err(SplineError::NotRising { index: 2 }));
    }
    let system = CubicSystem::new(vec![1.0, 1.0], Ends::Natural).unwrap();
    let count = system.interpolate(&[0.0], [0.0; 2]).map(|_| ());
    assert_eq!(count, Err(SplineError::Count { found: 1, expected: 3 }));
    for bad in [f64::NAN, f64::INFINITY, f64::MAX] {
        let not_finite = system.interpolate(&[bad, 0.0, bad], [0.0; 2]).map(|_| ());
        assert_eq!(not_finite, Err(SplineError::NotFinite), "{bad}");
    }
}

#[test]
fn names_are_understood() {
    let parsed = ["not-a-knot", "clamped", "natural", "periodic"].map(|n| n.parse::<Ends>().unwrap());
    assert_eq!(parsed, ALL);
    assert_eq!("cubic".parse::<Ends>(), Err(UnknownEnds));
}

/// Lengths over three decades and values of order one.
fn data() -> impl Strategy<Value = (Vec<f64>, Vec<f64>, [f64; 2])> {
    prop::collection::vec((-1.5..1.5f64, -1.0..1.0f64), 2..60).prop_flat_map(|points| {
        let lengths: Vec<f64> = points.iter().map(|p| 10f64.powf(p.0)).collect();
        let mut values: Vec<f64> = points.iter().map(|p| p.1).collect();
        values.push(0.25);
        (Just(lengths), Just(values), [-2.0..2.0f64, -2.0..2.0f64])
    })
}

proptest! {
    /// A piecewise cubic is the interpolating spline exactly if it takes the values, joins C2 and meets the
    /// end condition: that these hold is checked from the pieces, not from the system that was solved.
    #[test]
    fn pieces_interpolate_join_and_meet_their_ends((lengths, mut values, slopes) in data()) {
        let n = lengths.len();
        for ends in ALL {
            if ends == Ends::Periodic {
                values[n] = values[0];
            }
            let system = CubicSystem::new(lengths.clone(), ends).unwrap();
            let s = system.interpolate(&values, slopes).unwrap();
            // Largest terms that a value, a slope or a second derivative is summed from.
            let size = (0..=n).fold([1.0f64; 3], |m, i| {
                let (j, h) = (s.at_knot(i), lengths[i.min(n - 1)]);
                let [s, v] = [j.slope.abs().max(h * j.second.abs()), j.value.abs()];
                [m[0].max(v).max(h * s), m[1].max(s), m[2].max(j.second.abs())]
            });
            let close = |a: Jet, b: Jet| {
                (a.value - b.value).abs() < 1e-11 * size[0]
                    && (a.slope - b.slope).abs() < 1e-11 * size[1]
                    && (a.second - b.second).abs() < 1e-11 * size[2]
            };
            for i in 0..n {
                prop_assert_eq!(s.at_knot(i).value, values[i]);
                let end = s.jet(i, lengths[i]);
                prop_assert!((end.value - values[i + 1]).abs() < 1e-11 * size[0]);
                prop_assert!(close(end, s.at_knot(i + 1)), "{:?} joint {}", ends, i);
            }
            let (first, last) = (s.at_knot(0), s.at_knot(n));
            match ends {
                Ends::Clamped => {
                    prop_assert!((first.slope - slopes[0]).abs() < 1e-11 * size[1]);
                    prop_assert!((last.slope - slopes[1]).abs() < 1e-11 * size[1]);
                }
                Ends::Natural => prop_assert!(first.second == 0.0 && last.second == 0.0),
                Ends::Periodic => prop_assert!(close(first, last)),
                Ends::NotAKnot => {
                    for i in [1, n - 1] {
                        let (a, b) = (third(&s, i - 1, lengths[i - 1]), third(&s, i, lengths[i]));
                        let scale = size[2] / lengths[i - 1].min(lengths[i]);
                        prop_assert!((a - b).abs() < 1e-10 * scale, "{} {} of {}", a, b, scale);
                    }
                }
            }
        }
    }
}

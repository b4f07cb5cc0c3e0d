//! Motions of a given duration.

use super::*;

/// A motion of `duration` that starts, ends and keeps its limits as it should.
fn assert_timed(
    timed: &Timed<f64>,
    duration: f64,
    from: &State<f64>,
    to: &State<f64>,
    l: &MotionLimits<f64>,
) {
    let profile = timed.plan(duration);
    let profile = profile.unwrap_or_else(|e| panic!("{e:?} {duration} {from:?} {to:?} {l:?}"));
    let profile = profile.unwrap_or_else(|| panic!("{duration} {from:?} {to:?} {l:?}"));
    let off = (profile.duration() - duration).abs();
    assert!(off <= 1e-9 * duration, "{off} of {duration}: {from:?} {to:?} {l:?} {profile:?}");
    let mut end = *from;
    let mut path = 0.0;
    for s in profile.segments() {
        let found = flown(&[(s.duration, s.jerk)], &s.start, l);
        assert!(found.excess.iter().all(|e| *e <= 1e-9), "{:?} {from:?} {to:?} {l:?}", found.excess);
        assert!(s.jerk <= l.jerk.max * (1.0 + 1e-12) && s.jerk >= l.jerk.min * (1.0 + 1e-12));
        path += found.path;
        assert!((end.position - s.start.position).abs() <= 1e-9 * (path + to.position.abs()));
        end = found.end;
    }
    let fastest = l.velocity.max.max(-l.velocity.min);
    assert!((end.position - to.position).abs() <= 1e-9 * (path + to.position.abs()), "{end:?} {to:?}");
    assert!((end.velocity - to.velocity).abs() <= 1e-9 * fastest, "{end:?} {to:?}");
    let steepest = l.acceleration.max.max(-l.acceleration.min);
    let clock = 1e-15 * duration * l.jerk.max.max(-l.jerk.min);
    assert!((end.acceleration - to.acceleration).abs() <= 1e-9 * steepest + clock);
}

#[test]
fn every_possible_duration_has_a_motion_and_edges_are_where_that_changes() {
    let (mut blocked, mut islands) = (0, 0);
    cases(11, 40_000, |chance| {
        let symmetric = chance.one_in(2);
        let l = limits(chance, symmetric);
        let (from, mut to) = (inside(chance, &l), inside(chance, &l));
        let sign = if chance.one_in(2) { -1.0 } else { 1.0 };
        to.position = sign * natural_length(&l) * chance.decades(-4.0, 1.0);
        let fastest = plan(&from, &to, &l).unwrap().duration();
        let timed = Timed::new(&from, &to, &l).unwrap();
        islands += u32::from(timed.edges().len() > 4);
        assert!(timed.admits(fastest), "{fastest} {from:?} {to:?} {l:?}");
        assert!(!timed.admits(fastest * (1.0 - 1e-4)), "{fastest} {from:?} {to:?} {l:?}");
        assert_timed(&timed, fastest, &from, &to, &l);
        let mut edges: Vec<f64> =
            timed.edges().iter().copied().filter(|t| *t >= fastest * (1.0 - 1e-9)).collect();
        edges.sort_by(f64::total_cmp);
        let last = edges[edges.len() - 1];
        edges.push(10.0 * last);
        assert!(timed.admits(1.001 * last) && timed.admits(1e3 * last), "{from:?} {to:?} {l:?}");
        for pair in edges.windows(2).filter(|pair| pair[1] > pair[0] * (1.0 + 1e-3)) {
            let states: Vec<bool> = [0.1, 0.4, 0.7, 0.9]
                .map(|share| {
                    let t = pair[0] + share * (pair[1] - pair[0]);
                    let able = timed.admits(t);
                    if able {
                        assert_timed(&timed, t, &from, &to, &l);
                    } else {
                        assert!(timed.plan(t).unwrap().is_none());
                    }
                    able
                })
                .to_vec();
            assert!(states.iter().all(|s| *s == states[0]), "{states:?} {pair:?} {from:?} {to:?} {l:?}");
            blocked += u32::from(!states[0]);
        }
    });
    assert!(blocked > 10 && islands > 10, "{blocked} gaps, {islands} with islands");
}

#[test]
fn a_start_outside_its_limits_is_led_back_first() {
    let l = MotionLimits::symmetric(1.0, 2.0, 20.0);
    let from = State { position: 0.0, velocity: 1.7, acceleration: -2.5 };
    let to = State { position: 4.0, velocity: 0.0, acceleration: 0.0 };
    let fastest = plan(&from, &to, &l).unwrap().duration();
    let timed = Timed::new(&from, &to, &l).unwrap();
    let slow = timed.plan(2.0 * fastest).unwrap().unwrap();
    assert!((slow.duration() - 2.0 * fastest).abs() < 1e-9);
    assert_eq!(slow.end(), to);
    assert_eq!(slow.segments()[0].start, from);
}

#[test]
fn from_rest_to_rest_every_longer_duration_is_possible() {
    let l = MotionLimits::symmetric(1.0, 2.0, 20.0);
    let rest = |position| State { position, velocity: 0.0, acceleration: 0.0 };
    let timed = Timed::new(&rest(0.0), &rest(3.0), &l).unwrap();
    let fastest = plan(&rest(0.0), &rest(3.0), &l).unwrap().duration();
    for i in 0..100 {
        let t = fastest * (1.0 + f64::from(i) * 0.07);
        assert_timed(&timed, t, &rest(0.0), &rest(3.0), &l);
    }
    assert!(!timed.admits(0.999 * fastest));
}

use super::*;

extern crate std;

const TICK_NS: u32 = 1_000_000;

fn limits(v: f32, a: f32, j: f32) -> Limits {
    Limits { velocity: v, acceleration: a, jerk: Some(j) }
}

/// Plays a move; every set-point follows from the one before. Returns the number of ticks.
fn play(from: Setpoint, target: i64, l: &Limits) -> u64 {
    let mut course = Course::to(&from, target, l, TICK_NS).unwrap();
    let left = course.left().unwrap();
    let (tick, jerk) = (1e-3f64, f64::from(l.jerk.unwrap()));
    let (v, a) = (f64::from(l.velocity), f64::from(l.acceleration));
    let mut last = from;
    for n in 1..=left + 1 {
        let now = course.next();
        let [v0, v1] = [last.velocity, now.velocity].map(f64::from);
        let [a0, a1] = [last.acceleration, now.acceleration].map(f64::from);
        assert!(v1.abs() <= v * 1.0001 && a1.abs() <= a * 1.0001, "{last:?} {now:?}");
        assert!((a1 - a0).abs() <= jerk * tick * 1.001 + 1e-4 * a, "{n}: {last:?} {now:?}");
        let moved = (now.position - last.position) as f64;
        let middle = 0.5 * (v0 + v1) * tick;
        // Half a count at either end, what the halves differ by, and the bend of the velocity within a tick.
        let slack = 2.0 + 2e-6 * v * tick + a * tick * tick;
        assert!((moved - middle).abs() <= slack, "{n}: {moved} {middle} {last:?} {now:?}");
        last = now;
        if now.done {
            assert_eq!(now, Setpoint::at_rest(target));
            assert!(n == left || n == left + 1, "{n} {left}");
            return n;
        }
    }
    panic!("it does not arrive: {last:?}");
}

#[test]
fn moves_of_any_length_end_on_the_count() {
    let rest = Setpoint::at_rest(-7_000_000_123);
    for length in [1i64, 2, 17, 1_000, 123_457, 20_000_003, 1_234_567_891, 40_000_000_001] {
        for sign in [1, -1] {
            play(rest, rest.position + sign * length, &limits(1e7, 1e8, 1e10));
        }
    }
}

#[test]
fn a_long_move_takes_the_time_of_the_textbook() {
    // d/v + v/a + a/j.
    let ticks = play(Setpoint::at_rest(0), 1_000_000_000, &limits(1e8, 1e9, 1e11));
    assert!((10_109..=10_111).contains(&ticks), "{ticks}");
}

#[test]
fn random_moves_from_any_motion_end_on_the_count() {
    let mut chance = fastrand::Rng::with_seed(5);
    for _ in 0..2_000 {
        let v = 10f32.powf(chance.f32() * 5.0 + 2.0);
        let a = v / 10f32.powf(chance.f32() * 2.0 - 2.0);
        let j = a / 10f32.powf(chance.f32() * 1.5 - 2.0);
        let l = limits(v, a, j);
        let share = |chance: &mut fastrand::Rng| 2.0 * chance.f32() - 1.0;
        // A motion that keeps the limits when its acceleration is taken away.
        let acceleration = a * share(&mut chance);
        let room = v - 0.5 * acceleration * acceleration / j;
        let velocity = if room > 0.0 { room * share(&mut chance) } else { 0.0 };
        let acceleration = if room > 0.0 { acceleration } else { 0.0 };
        let from = Setpoint { position: chance.i64(-1 << 40..1 << 40), velocity, acceleration, done: false };
        let natural = f64::from(v * v / a + v * a / j);
        let length = natural * 10f64.powf(f64::from(chance.f32()) * 5.0 - 3.0);
        let target = from.position + (length * f64::from(share(&mut chance)).signum()) as i64;
        play(from, target, &l);
    }
}

#[test]
fn what_is_no_number_is_refused() {
    let l = limits(1e5, 1e6, 1e8);
    let from = Setpoint { position: 0, velocity: f32::NAN, acceleration: 0.0, done: false };
    assert!(Course::to(&from, 10, &l, TICK_NS).is_err());
    assert!(Course::to(&Setpoint::at_rest(0), 10, &limits(0.0, 1.0, 1.0), TICK_NS).is_err());
    assert!(Course::to_velocity(&from, 0.0, &l, TICK_NS).is_err());
    assert!(Course::to_velocity(&moving(0.0, f32::INFINITY), 0.0, &l, TICK_NS).is_err());
    assert!(Course::to_velocity(&moving(0.0, 0.0), 2e5, &l, TICK_NS).is_err());
}

const LIMITS: Limits = Limits { velocity: 1e5, acceleration: 1e6, jerk: Some(1e8) };

fn moving(velocity: f32, acceleration: f32) -> Setpoint {
    Setpoint { position: 1 << 40, velocity, acceleration, done: false }
}

#[test]
fn the_way_to_rest_takes_as_long_as_the_textbook_says_and_ends_on_a_count() {
    // v/a + a/j = 110 ms, v (v/a + a/j)/2 = 5500 counts.
    let mut course = Course::to_velocity(&moving(1e5, 0.0), 0.0, &LIMITS, TICK_NS).unwrap();
    let left = course.left().unwrap();
    assert!((110..=111).contains(&left), "{left}");
    assert_eq!(course.end(), Some((1 << 40) + 5500));
    let mut last = moving(1e5, 0.0);
    for _ in 1..left {
        let next = course.next();
        assert!(!next.done && next.position >= last.position && next.velocity <= last.velocity);
        last = next;
    }
    assert_eq!(course.next(), Setpoint::at_rest((1 << 40) + 5500));
}

#[test]
fn without_a_limit_of_jerk_it_is_soft_all_the_same() {
    let limits = Limits { jerk: None, ..LIMITS };
    let mut course = Course::to_velocity(&moving(-1e5, 0.0), 0.0, &limits, TICK_NS).unwrap();
    let first = course.next();
    assert!((first.acceleration - 0.25e6).abs() < 1.0, "{first:?}");
}

#[test]
fn a_velocity_is_kept_for_as_long_as_it_takes() {
    for velocity in [3.7f32, -0.001, 9.9e4, -1e5] {
        let mut course = Course::to_velocity(&moving(0.0, 0.0), velocity, &LIMITS, TICK_NS).unwrap();
        assert_eq!((course.end(), course.left()), (None, None));
        let mut last = moving(0.0, 0.0);
        let mut kept: Option<(u32, i64)> = None;
        for tick in 0..1_000_000u32 {
            let now = course.next();
            let moved = (now.position - last.position) as f64;
            let middle = 0.5e-3 * f64::from(last.velocity + now.velocity);
            assert!((moved - middle).abs() <= 1.5, "{tick}: {last:?} {now:?}");
            assert!(!now.done);
            last = now;
            if now.velocity == velocity && now.acceleration == 0.0 {
                let (from, position) = *kept.get_or_insert((tick, now.position));
                let ideal = f64::from(tick - from) * 1e-3 * f64::from(velocity);
                let off = (now.position - position) as f64 - ideal;
                // f32 holds the way of a tick to a part in 2^24.
                assert!(off.abs() <= 1.0 + ideal.abs() / f64::from(1 << 23), "{tick}: {off}");
            }
        }
        assert!(kept.is_some_and(|(from, _)| from < 200), "{velocity}");
    }
}

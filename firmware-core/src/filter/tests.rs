use super::*;

extern crate std;
use std::vec::Vec;

fn rest(position: f64) -> State<f64> {
    State { position, velocity: 0.0, acceleration: 0.0 }
}

fn limits() -> MotionLimits<f64> {
    MotionLimits::symmetric(0.5, 2.0, 20.0)
}

/// Follows a reference for so many ticks; every state keeps the limits and follows from the one before.
fn follow(
    filter: &mut Filter<f64>,
    tick_s: f64,
    ticks: usize,
    limits: &MotionLimits<f64>,
    mut reference: impl FnMut(usize) -> State<f64>,
) -> Vec<State<f64>> {
    let mut all = Vec::with_capacity(ticks);
    for tick in 0..ticks {
        let before = filter.state();
        let now = filter.next(&reference(tick), limits).unwrap();
        let within =
            |x: f64, b: &Bounds<f64>| x <= b.max + 1e-9 * b.max.abs() && x >= b.min - 1e-9 * b.min.abs();
        assert!(within(now.velocity, &limits.velocity), "{tick}: {before:?} {now:?}");
        assert!(within(now.acceleration, &limits.acceleration), "{tick}: {before:?} {now:?}");
        let jerk = (now.acceleration - before.acceleration) / tick_s;
        // A landing switches within ticks: then jerk is a mean.
        assert!(jerk.abs() <= limits.jerk.max * (1.0 + 1e-6), "{tick}: {jerk} {before:?} {now:?}");
        let mean = 0.5 * (before.velocity + now.velocity) * tick_s;
        let moved = now.position - before.position;
        assert!(
            (moved - mean).abs() <= 0.1 * limits.jerk.max * tick_s.powi(3) + 1e-12,
            "{tick}: {before:?} {now:?}"
        );
        all.push(now);
    }
    all
}

#[test]
fn steps_are_followed_without_overshoot_and_without_chatter() {
    for (distance, tick_s) in
        [(1.0, 1e-3), (1.0, 1e-4), (0.01, 1e-3), (0.01, 1e-4), (-0.3, 1e-3), (1e-5, 1e-3)]
    {
        let limits = limits();
        let best = plan(&rest(0.0), &rest(distance), &limits).unwrap().duration();
        let ticks = (1.6 * best / tick_s) as usize + 80;
        let mut filter = Filter::new(rest(0.0), tick_s);
        let all = follow(&mut filter, tick_s, ticks, &limits, |_| rest(distance));
        let beyond = all.iter().map(|s| (s.position - distance) * distance.signum()).fold(f64::MIN, f64::max);
        let arrived = all.iter().position(|s| *s == rest(distance));
        let time = arrived.map(|n| (n + 1) as f64 * tick_s);
        assert!(beyond <= 1e-12 * distance.abs(), "{distance} {tick_s}: {beyond:e}");
        let time = time.unwrap();
        assert!(time <= 1.1 * best + 40.0 * tick_s, "{time} {best}");
        assert!(all.iter().skip(arrived.unwrap()).all(|s| *s == rest(distance)));
    }
}

#[test]
fn few_steps_of_any_size_under_any_limits_overshoot_and_all_arrive() {
    let mut chance = fastrand::Rng::with_seed(3);
    let (mut worst, mut over, mut late) = (0.0f64, 0, 0);
    for _ in 0..1_500 {
        let tick_s = [1e-3, 2.5e-4, 1e-4][chance.usize(..3)];
        // Velocity and acceleration take from a few ticks to a few hundred to build up.
        let a = 10f64.powf(chance.f64() * 4.0);
        let v = a * tick_s * 10f64.powf(0.7 + 2.0 * chance.f64());
        let j = a / (tick_s * 10f64.powf(0.7 + 1.8 * chance.f64()));
        let limits = MotionLimits::symmetric(v, a, j);
        let distance = (v * v / a + v * a / j) * 10f64.powf(3.0 * chance.f64() - 2.5);
        let best = plan(&rest(0.0), &rest(distance), &limits).unwrap().duration();
        let mut filter = Filter::new(rest(0.0), tick_s);
        let ticks = (1.3 * best / tick_s) as usize + 100;
        let all = follow(&mut filter, tick_s, ticks, &limits, |_| rest(distance));
        let beyond = all.iter().map(|s| s.position - distance).fold(f64::MIN, f64::max);
        worst = worst.max(beyond / distance);
        over += u32::from(beyond > 1e-9 * distance);
        late += u32::from(all[all.len() - 1] != rest(distance));
    }
    // Ramps of a few ticks leave no room to switch in time: some steps end a little beyond.
    assert!(over <= 25 && worst < 0.04, "{over} steps overshoot, by up to {worst:e}");
    assert_eq!(late, 0);
}

#[test]
fn a_ramp_is_caught_and_then_followed_exactly() {
    let (tick_s, limits) = (1e-3, limits());
    for velocity in [0.3, -0.1, 0.49] {
        let mut filter = Filter::new(rest(0.2), tick_s);
        let ramp =
            |tick: usize| State { position: velocity * tick_s * tick as f64, velocity, acceleration: 0.0 };
        let all = follow(&mut filter, tick_s, 60_000, &limits, ramp);
        assert_eq!(all[all.len() - 1], ramp(59_999), "{velocity}");
        let caught = all.iter().enumerate().rposition(|(n, s)| *s != ramp(n)).unwrap();
        assert!(velocity == 0.49 || caught < 4_000, "{velocity}: {caught}");
    }
}

#[test]
fn rough_references_never_break_a_limit() {
    let mut chance = fastrand::Rng::with_seed(1);
    for _ in 0..200 {
        let tick_s = [1e-3, 2.5e-4, 4e-3][chance.usize(..3)];
        let limits = MotionLimits::symmetric(
            0.1 + chance.f64(),
            0.5 + 4.0 * chance.f64(),
            20.0 + 400.0 * chance.f64(),
        );
        let mut filter = Filter::new(rest(0.0), tick_s);
        let mut target = rest(0.0);
        follow(&mut filter, tick_s, 5_000, &limits, |_| {
            match chance.u8(..40) {
                0 => target.position = 2.0 * chance.f64() - 1.0,
                1 => target.velocity = limits.velocity.max * (2.0 * chance.f64() - 1.0),
                2 => target.velocity = 0.0,
                _ => {}
            }
            target.position += target.velocity * tick_s;
            target
        });
    }
}

#[test]
fn lowered_limits_are_returned_to_and_then_kept() {
    let tick_s = 1e-3;
    let mut filter = Filter::new(rest(0.0), tick_s);
    follow(&mut filter, tick_s, 700, &limits(), |_| rest(1.0));
    assert!(filter.state().velocity > 0.499);
    let lower = MotionLimits::symmetric(0.2, 1.0, 20.0);
    let mut last = filter.state();
    for _ in 0..600 {
        let now = filter.next(&rest(1.0), &lower).unwrap();
        assert!((now.acceleration - last.acceleration).abs() <= 20.0 * tick_s * (1.0 + 1e-9));
        last = now;
    }
    assert!(last.velocity <= 0.2 * (1.0 + 1e-9), "{last:?}");
    follow(&mut filter, tick_s, 6_000, &lower, |_| rest(1.0));
    assert_eq!(filter.state(), rest(1.0));
}

#[test]
fn what_is_no_number_changes_nothing() {
    let mut filter = Filter::new(rest(0.5), 1e-3);
    assert!(filter.next(&rest(f64::NAN), &limits()).is_err());
    assert!(filter.next(&rest(1.0), &MotionLimits::symmetric(0.0, 1.0, 1.0)).is_err());
    assert!(filter.next(&rest(1.0), &MotionLimits::symmetric(1.0, f64::INFINITY, 1.0)).is_err());
    assert_eq!(filter.state(), rest(0.5));
}

#[test]
fn a_drive_follows_in_single_precision() {
    let limits = MotionLimits::<f32>::symmetric(1e5, 1e6, 1e8);
    let mut filter = Filter::new(State { position: 0.0, velocity: 0.0, acceleration: 0.0 }, 2.5e-4f32);
    let target = State { position: 20_000.0f32, velocity: 0.0, acceleration: 0.0 };
    let (mut most, mut arrived) = (0.0f32, None);
    for tick in 0..4_000 {
        let now = filter.next(&target, &limits).unwrap();
        assert!(now.velocity.abs() <= 1e5 * 1.00001 && now.acceleration.abs() <= 1e6 * 1.00001);
        most = most.max(now.position);
        if now == target {
            arrived.get_or_insert(tick);
        }
    }
    assert!(most <= 20_000.0 && arrived.is_some_and(|tick| tick < 1_400), "{most} {arrived:?}");
}

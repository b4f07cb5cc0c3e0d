extern crate std;

use std::vec::Vec;

use proptest::prelude::*;

use super::*;

mod timed;

/// Random numbers over decades, the same on every run.
struct Chance(fastrand::Rng);

impl Chance {
    fn unit(&mut self) -> f64 {
        self.0.f64()
    }

    fn within(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }

    fn decades(&mut self, a: f64, b: f64) -> f64 {
        10f64.powf(self.within(a, b))
    }

    fn one_in(&mut self, n: u32) -> bool {
        self.unit() * f64::from(n) < 1.0
    }
}

/// Velocities over six decades, times to reach acceleration and velocity over three each, asymmetric at will.
fn limits(chance: &mut Chance, symmetric: bool) -> MotionLimits<f64> {
    let v = chance.decades(-3.0, 3.0);
    let a = v / chance.decades(-3.0, 0.0);
    let j = a / chance.decades(-4.0, -0.5);
    let mut bounds = |size: f64| {
        let mut side = || if symmetric { size } else { size * chance.decades(-0.7, 0.7) };
        Bounds { min: -side(), max: side() }
    };
    MotionLimits { velocity: bounds(v), acceleration: bounds(a), jerk: bounds(j) }
}

/// A velocity and an acceleration within the limits that can be left and reached within them; often at an edge.
fn inside(chance: &mut Chance, l: &MotionLimits<f64>) -> State<f64> {
    let share = |chance: &mut Chance| {
        if chance.one_in(4) {
            [-1.0, 0.0, 1.0][(chance.unit() * 3.0) as usize]
        } else {
            chance.within(-1.0, 1.0)
        }
    };
    let part = |b: &Bounds<f64>, s: f64| if s < 0.0 { -s * b.min } else { s * b.max };
    let acceleration = part(&l.acceleration, share(chance));
    let s = share(chance);
    // Room for the acceleration to be taken away, and to have been built up.
    let [gain, need] = if acceleration > 0.0 {
        [0.5 * acceleration.powi(2) / -l.jerk.min, 0.5 * acceleration.powi(2) / l.jerk.max]
    } else {
        [-0.5 * acceleration.powi(2) / l.jerk.max, 0.5 * acceleration.powi(2) / l.jerk.min]
    };
    let (low, high) = (l.velocity.min - gain.min(-need).min(0.0), l.velocity.max - gain.max(-need).max(0.0));
    if low > high {
        return State { position: 0.0, velocity: part(&l.velocity, 0.9 * s), acceleration: 0.0 };
    }
    let velocity = (low + (high - low) * 0.5 * (1.0 + s)).clamp(l.velocity.min, l.velocity.max);
    State { position: 0.0, velocity, acceleration }
}

fn natural_length(l: &MotionLimits<f64>) -> f64 {
    l.velocity.max.powi(2) / l.acceleration.max + l.velocity.max * l.acceleration.max / l.jerk.max
}

/// What integrating the jerks of a profile in f64 gives.
struct Flown {
    end: State<f64>,
    path: f64,
    /// Largest excess over a velocity and an acceleration limit, relative.
    excess: [f64; 2],
}

fn flown(segments: &[(f64, f64)], from: &State<f64>, l: &MotionLimits<f64>) -> Flown {
    let over = |b: &Bounds<f64>, x: f64| (x / b.max).max(x / b.min) - 1.0;
    let (mut s, mut path, mut excess) = (*from, 0.0, [0.0f64; 2]);
    for &(t, j) in segments {
        let a = s.acceleration + j * t;
        if s.acceleration * a < 0.0 {
            let peak = s.velocity - 0.5 * s.acceleration.powi(2) / j;
            excess[0] = excess[0].max(over(&l.velocity, peak));
            path += peak.abs() * t;
        }
        path += s.velocity.abs() * t;
        s = State {
            position: s.position + t * (s.velocity + t * (0.5 * s.acceleration + j * t / 6.0)),
            velocity: s.velocity + t * (s.acceleration + 0.5 * j * t),
            acceleration: a,
        };
        path += s.velocity.abs() * t;
        excess[0] = excess[0].max(over(&l.velocity, s.velocity));
        excess[1] = excess[1].max(over(&l.acceleration, s.acceleration));
    }
    Flown { end: s, path, excess }
}

fn narrow(s: &State<f64>) -> State<f32> {
    State { position: s.position as f32, velocity: s.velocity as f32, acceleration: s.acceleration as f32 }
}

fn narrow_limits(l: &MotionLimits<f64>) -> MotionLimits<f32> {
    let narrow = |b: &Bounds<f64>| Bounds { min: b.min as f32, max: b.max as f32 };
    MotionLimits {
        velocity: narrow(&l.velocity),
        acceleration: narrow(&l.acceleration),
        jerk: narrow(&l.jerk),
    }
}

/// Ends, limits and segments of an f32 plan, judged in f64.
fn assert_single(from: &State<f64>, to: &State<f64>, l: &MotionLimits<f64>) {
    let (from, to, l) = (narrow(from), narrow(to), narrow_limits(l));
    let profile = match plan(&from, &to, &l) {
        Ok(profile) => profile,
        // Rounded, a target at its limits may be outside.
        Err(DoubleSError::TargetOutside(_) | DoubleSError::TargetUnreachable) => return,
        Err(e) => panic!("{e:?} {from:?} {to:?} {l:?}"),
    };
    assert_joined(&profile, &from, &to, &l, [1e-3, 1e-4, 1e-5]);
}

/// Each segment ends where the next one starts, and the last one at the target: to a share of the path, and of the largest
/// velocity and acceleration.
fn assert_joined<R: Real + Into<f64>>(
    profile: &Profile<R>,
    from: &State<R>,
    to: &State<R>,
    l: &MotionLimits<R>,
    shares: [f64; 3],
) {
    let segments = profile.segments();
    let size = |b: &Bounds<R>| -> f64 { b.max.most(-b.min).into() };
    let (mut path, mut fastest) = (0.0f64, size(&l.velocity));
    for s in segments {
        let [a, half, b]: [f64; 3] =
            [s.start, s.at(R::HALF * s.duration), s.end()].map(|state| state.velocity.abs().into());
        path += s.duration.into() * a.max(half).max(b);
        fastest = fastest.max(a);
    }
    let steepest = size(&l.acceleration).max(from.acceleration.abs().into());
    let ends = [*from].into_iter().chain(segments.iter().map(Segment::end));
    for (end, next) in ends.zip(segments.iter().map(|s| s.start).chain([*to])) {
        let off: [f64; 3] = [
            (end.position - next.position).abs().into(),
            (end.velocity - next.velocity).abs().into(),
            (end.acceleration - next.acceleration).abs().into(),
        ];
        for ((off, share), scale) in off.into_iter().zip(shares).zip([path, fastest, steepest]) {
            assert!(off <= share * scale, "{off} {share} {scale} {profile:?}");
        }
    }
}

fn assert_double(from: &State<f64>, to: &State<f64>, l: &MotionLimits<f64>, outside: bool) -> f64 {
    let profile = plan(from, to, l).unwrap_or_else(|e| panic!("{e:?} {from:?} {to:?} {l:?}"));
    assert_joined(&profile, from, to, l, [1e-9, 1e-11, 1e-12]);
    if !outside {
        // Segment by segment: a trace of acceleration that is left would add up on a long cruise.
        let excess = profile.segments().iter().fold([0.0; 2], |worst: [f64; 2], s| {
            let found = flown(&[(s.duration, s.jerk)], &s.start, l);
            [worst[0].max(found.excess[0]), worst[1].max(found.excess[1])]
        });
        assert!(excess.iter().all(|e| *e <= 1e-11), "{excess:?} {from:?} {to:?} {l:?} {profile:?}");
    }
    profile.duration()
}

/// Runs `count` cases of a seed; `FEEDSPLINE_CASES` asks for so many times as many, `FEEDSPLINE_SEED` for others.
fn cases(seed: u64, count: u64, mut check: impl FnMut(&mut Chance)) {
    let asked =
        |name, default| std::env::var(name).ok().and_then(|v| v.parse::<u64>().ok()).unwrap_or(default);
    let seed = seed.wrapping_add(asked("FEEDSPLINE_SEED", 0) << 32);
    let mut chance = Chance(fastrand::Rng::with_seed(seed));
    (0..count * asked("FEEDSPLINE_CASES", 1)).for_each(|_| check(&mut chance));
}

#[test]
fn any_state_to_any_state() {
    cases(1, 60_000, |chance| {
        let symmetric = chance.one_in(2);
        let l = limits(chance, symmetric);
        let from = inside(chance, &l);
        let mut to = inside(chance, &l);
        let sign = if chance.one_in(2) { -1.0 } else { 1.0 };
        to.position = match (chance.unit() * 8.0) as u32 {
            0 => 0.0,
            _ => sign * natural_length(&l) * chance.decades(-9.0, 2.0),
        };
        assert_double(&from, &to, &l, false);
        assert_single(&from, &to, &l);
    });
}

#[test]
fn starts_outside_the_limits_are_led_back() {
    cases(2, 30_000, |chance| {
        let l = limits(chance, false);
        let part = |b: &Bounds<f64>, s: f64| if s < 0.0 { -s * b.min } else { s * b.max };
        let (v, a) = (chance.within(-3.0, 3.0), chance.within(-3.0, 3.0));
        let from =
            State { position: 0.0, velocity: part(&l.velocity, v), acceleration: part(&l.acceleration, a) };
        let mut to = inside(chance, &l);
        to.position = natural_length(&l) * chance.within(-3.0, 3.0);
        assert_double(&from, &to, &l, true);
        assert_single(&from, &to, &l);
    });
}

/// The shortest time to the target or a place right beside it. Beside a fastest change of velocity there may be a gap, and
/// a target computed in f64 lies on either side of its edge.
fn quickest_beside(from: &State<f64>, to: &State<f64>, l: &MotionLimits<f64>, path: f64) -> f64 {
    [0.0, 1e-6, -1e-6]
        .map(|share| assert_double(from, &State { position: to.position + share * path, ..*to }, l, false))
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

/// No random motion within the limits gets to its end sooner: an oracle that knows nothing of chains.
#[test]
fn no_random_motion_is_faster() {
    let mut sooner = 0;
    cases(3, 80_000, |chance| {
        let symmetric = chance.one_in(2);
        let l = limits(chance, symmetric);
        let from = inside(chance, &l);
        let ramp = l.acceleration.max / l.jerk.max;
        let (mut segments, mut at) = (Vec::new(), from);
        for _ in 0..1 + (chance.unit() * 6.0) as u32 {
            // Full jerk or none, mostly: the motions that are hardest to beat.
            let j = [l.jerk.min, 0.0, l.jerk.max, l.jerk.max * chance.unit()][(chance.unit() * 4.0) as usize];
            let t = ramp * chance.decades(-2.0, 0.5);
            segments.push((t, j));
            at = Segment { duration: t, start: at, jerk: j }.end();
        }
        let found = flown(&segments, &from, &l);
        let to = found.end;
        // Small changes of large velocities are known to a few digits only.
        let known = (to.velocity - from.velocity).abs() > 0.1 * from.velocity.abs();
        if !known || found.excess.iter().any(|e| *e > 0.0) || plan(&from, &to, &l).is_err() {
            return;
        }
        sooner += 1;
        let random: f64 = segments.iter().map(|s| s.0).sum();
        let planned = quickest_beside(&from, &to, &l, found.path);
        assert!(planned <= random * (1.0 + 1e-3), "{planned} {random} {from:?} {to:?} {l:?} {segments:?}");
    });
    assert!(sooner > 10_000, "{sooner}");
}

/// Both accelerations point one way and the target is reached without taking them away: rare among random cases.
#[test]
fn islands_and_their_edges() {
    cases(4, 30_000, |chance| {
        let l = limits(chance, false);
        let a = |chance: &mut Chance| l.acceleration.max * chance.decades(-2.0, 0.0);
        let (a0, x) = (a(chance), a(chance));
        let (t0, t1) = ((x - a0).abs() / l.jerk.max, x * chance.unit() / -l.jerk.min);
        let start = State { position: 0.0, velocity: l.velocity.min * chance.unit(), acceleration: a0 };
        if x < a0 {
            return;
        }
        let top = Segment { duration: t0, start, jerk: l.jerk.max }.end();
        let end = Segment { duration: t1, start: top, jerk: l.jerk.min }.end();
        let segments = [(t0, l.jerk.max), (t1, l.jerk.min)];
        let found = flown(&segments, &start, &l);
        let mut to = end;
        let known = (to.velocity - start.velocity).abs() > 0.1 * start.velocity.abs();
        let stops = start.velocity + 0.5 * a0 * a0 / -l.jerk.min;
        let outside = stops > l.velocity.max || found.excess.iter().any(|e| *e > 0.0);
        if !known || outside || plan(&start, &to, &l).is_err() {
            return;
        }
        let planned = quickest_beside(&start, &to, &l, found.path);
        assert!(planned <= (t0 + t1) * (1.0 + 1e-3), "{planned} {} {start:?} {to:?} {l:?}", t0 + t1);
        // Just beside the edge the motion may be much longer, but there is one.
        to.position += (if chance.one_in(2) { 1.0 } else { -1.0 }) * found.path * chance.decades(-15.0, -3.0);
        assert_double(&start, &to, &l, false);
        assert_single(&start, &to, &l);
    });
}

#[test]
fn mirrors_and_reversals_take_as_long() {
    cases(5, 20_000, |chance| {
        let l = limits(chance, false);
        let (from, mut to) = (inside(chance, &l), inside(chance, &l));
        to.position = natural_length(&l) * chance.within(-3.0, 3.0);
        let opposite = |b: &Bounds<f64>| Bounds { min: -b.max, max: -b.min };
        let mirrored = MotionLimits {
            velocity: opposite(&l.velocity),
            acceleration: opposite(&l.acceleration),
            jerk: opposite(&l.jerk),
        };
        let turned = MotionLimits { acceleration: l.acceleration, ..mirrored };
        let mirror = |s: &State<f64>| State {
            position: -s.position,
            velocity: -s.velocity,
            acceleration: -s.acceleration,
        };
        let backwards = |s: &State<f64>| State { position: -s.position, velocity: -s.velocity, ..*s };
        let seconds = assert_double(&from, &to, &l, false);
        let seen = assert_double(&mirror(&from), &mirror(&to), &mirrored, false);
        let start = State { position: 0.0, ..backwards(&to) };
        let end = State { position: -to.position, ..backwards(&from) };
        let back = assert_double(&start, &end, &turned, false);
        for other in [seen, back] {
            assert!((other / seconds - 1.0).abs() < 1e-7, "{seconds} {other} {from:?} {to:?} {l:?}");
        }
    });
}

#[test]
fn moves_from_rest_to_rest_take_what_the_textbook_says() {
    let l = MotionLimits::symmetric(2.0f32, 10.0, 100.0);
    for (distance, seconds) in [(0.001f32, 0.068_399_04f32), (0.4, 0.512_310_6), (4.0, 2.3)] {
        let rest = |position| State { position, velocity: 0.0, acceleration: 0.0 };
        let forth = plan(&rest(0.0), &rest(distance), &l).unwrap();
        let back = plan(&rest(distance), &rest(0.0), &l).unwrap();
        assert!((forth.duration() / seconds - 1.0).abs() < 1e-5, "{distance}: {}", forth.duration());
        assert!((back.duration() / forth.duration() - 1.0).abs() < 1e-6);
        assert_eq!(forth.at(forth.duration() + 1.0), rest(distance));
        assert_eq!(forth.at(-1.0), rest(0.0));
    }
}

#[test]
fn what_makes_no_sense_is_named() {
    let good = MotionLimits::symmetric(2.0f32, 10.0, 100.0);
    let rest = State { position: 0.0f32, velocity: 0.0, acceleration: 0.0 };
    let refused = |from, to, l| plan(&from, &to, &l).unwrap_err();
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let mut l = good;
        l.velocity.max = bad;
        assert_eq!(refused(rest, rest, l), DoubleSError::Limit(Quantity::Velocity));
        l = good;
        l.acceleration.min = -bad;
        assert_eq!(refused(rest, rest, l), DoubleSError::Limit(Quantity::Acceleration));
        l = good;
        l.jerk = Bounds { min: -bad, max: bad };
        assert_eq!(refused(rest, rest, l), DoubleSError::Limit(Quantity::Jerk));
    }
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let states = [
            (State { position: bad, ..rest }, Quantity::Position),
            (State { velocity: bad, ..rest }, Quantity::Velocity),
            (State { acceleration: bad, ..rest }, Quantity::Acceleration),
        ];
        for (state, quantity) in states {
            assert_eq!(refused(state, rest, good), DoubleSError::Start(quantity));
            assert_eq!(refused(rest, state, good), DoubleSError::Target(quantity));
        }
    }
    let fast = State { velocity: 2.1, ..rest };
    assert_eq!(refused(rest, fast, good), DoubleSError::TargetOutside(Quantity::Velocity));
    let steep = State { acceleration: -11.0, ..rest };
    assert_eq!(refused(rest, steep, good), DoubleSError::TargetOutside(Quantity::Acceleration));
    // To brake at 10 at a speed of 1.9, the speed before was 2.4.
    let braking = State { velocity: 1.9, acceleration: -10.0, ..rest };
    assert_eq!(refused(rest, braking, good), DoubleSError::TargetUnreachable);
    assert!(plan(&rest, &rest, &good).unwrap().segments().is_empty());
}

proptest! {
    /// A velocity is reached from anywhere, at once in the direction of the target.
    #[test]
    fn velocities_are_reached(v0 in -3.0f32..3.0, a0 in -15.0f32..15.0, v1 in -2.0f32..2.0) {
        let l = MotionLimits::symmetric(2.0f32, 10.0, 100.0);
        let from = State { position: 5.0, velocity: v0, acceleration: a0 };
        let profile = plan_velocity(&from, v1, &l).unwrap();
        let end = profile.end();
        prop_assert_eq!((end.velocity, end.acceleration), (v1, 0.0));
        let last = profile.segments().last().map_or(from, Segment::end);
        prop_assert!((last.velocity - v1).abs() < 2e-4 && (last.position - end.position).abs() < 1e-4);
    }

    /// Whatever bits come in, there is an answer.
    #[test]
    fn any_bits_are_planned_or_refused(bits in prop::array::uniform12(any::<u32>())) {
        let [p0, v0, a0, p1, v1, a1, b0, b1, b2, b3, b4, b5] = bits.map(f32::from_bits);
        let state = |position, velocity, acceleration| State { position, velocity, acceleration };
        let l = MotionLimits {
            velocity: Bounds { min: -b0.abs(), max: b1.abs() },
            acceleration: Bounds { min: -b2.abs(), max: b3.abs() },
            jerk: Bounds { min: -b4.abs(), max: b5.abs() },
        };
        if let Ok(profile) = plan(&state(p0, v0, a0), &state(p1, v1, a1), &l) {
            prop_assert!(profile.duration().is_finite());
            prop_assert!(profile.segments().iter().all(|s| s.duration > 0.0 && s.jerk.is_finite()));
            prop_assert!(profile.segments().iter().all(|s| s.start.fault().or(s.end().fault()).is_none()));
        }
        let _ = plan_velocity(&state(p0, v0, a0), v1, &l);
    }
}

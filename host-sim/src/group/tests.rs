use super::*;

fn rest(position: f64) -> State<f64> {
    State { position, velocity: 0.0, acceleration: 0.0 }
}

fn axis(from: State<f64>, to: State<f64>, [v, a, j]: [f64; 3]) -> Axis {
    Axis { from, to: Target::State(to), limits: MotionLimits::symmetric(v, a, j) }
}

#[test]
fn axes_arrive_together_when_asked_to() {
    let axes = [axis(rest(0.0), rest(1.0), [1.0, 5.0, 50.0]), axis(rest(2.0), rest(-4.0), [2.0, 5.0, 50.0])];
    let free = plan(&axes, Sync::None).unwrap();
    assert!(free.axes[0].duration < 0.5 * free.axes[1].duration);
    let timed = plan(&axes, Sync::Time).unwrap();
    assert_eq!(timed.duration, free.duration);
    for motion in &timed.axes {
        assert!((motion.duration - timed.duration).abs() < 1e-9);
    }
    assert_eq!(timed.axes[1], free.axes[1]);
    assert_eq!([timed.axes[0].end, timed.axes[1].end], [rest(1.0), rest(-4.0)]);
}

#[test]
fn axes_on_a_line_stay_on_it() {
    let axes = [
        axis(rest(1.0), rest(4.0), [1.0, 5.0, 50.0]),
        axis(rest(2.0), rest(-4.0), [1.0, 9.0, 20.0]),
        axis(rest(7.0), rest(7.0), [1.0, 9.0, 20.0]),
    ];
    let found = plan(&axes, Sync::Phase).unwrap();
    assert_eq!(found.sync, Sync::Phase);
    for (a, b) in found.axes[0].segments.iter().zip(&found.axes[1].segments) {
        assert!((2.0 * (a.start.position - 1.0) + (b.start.position - 2.0)).abs() < 1e-12);
        assert!(b.start.velocity.abs() <= 1.0 && b.jerk.abs() <= 20.0 * (1.0 + 1e-12));
    }
    assert!(found.axes[2].segments.iter().all(|s| s.start == rest(7.0) && s.jerk == 0.0));
    // As fast as the axis that limits it.
    let alone = plan(&axes[1..2], Sync::None).unwrap();
    assert!((found.duration - alone.duration).abs() < 1e-9);
}

#[test]
fn axes_that_are_on_no_line_arrive_together() {
    let sideways = State { velocity: 0.3, ..rest(0.0) };
    let axes = [axis(rest(0.0), rest(4.0), [1.0, 5.0, 50.0]), axis(sideways, rest(-4.0), [1.0, 9.0, 20.0])];
    let found = plan(&axes, Sync::Phase).unwrap();
    assert_eq!(found.sync, Sync::Time);
    assert!(found.axes.iter().all(|a| (a.duration - found.duration).abs() < 1e-9));
}

#[test]
fn a_duration_that_an_axis_cannot_take_is_passed_over() {
    // The second axis moves through its target at once, or has to come back: nothing between.
    let fast = State { position: 0.0, velocity: 1.0, acceleration: 0.0 };
    let passing = axis(fast, State { position: 0.1, ..fast }, [1.0, 1.0, 10.0]);
    let slow = axis(rest(0.0), rest(0.2), [1.0, 1.0, 10.0]);
    let alone = [passing, slow].map(|a| plan(&[a], Sync::None).unwrap().duration);
    let both = plan(&[passing, slow], Sync::Time).unwrap();
    assert!(both.duration > 1.2 * alone[0].max(alone[1]), "{both:?} {alone:?}");
    let timed = Timed::new(&passing.from, &State { position: 0.1, ..fast }, &passing.limits).unwrap();
    assert!(timed.admits(both.duration) && !timed.admits(0.999 * both.duration));
}

#[test]
fn an_axis_without_a_motion_is_named() {
    let good = axis(rest(0.0), rest(1.0), [1.0, 5.0, 50.0]);
    let mut bad = good;
    bad.limits.jerk.max = f64::NAN;
    let error = plan(&[good, bad], Sync::Time).unwrap_err();
    assert_eq!(error.axis, 1);
    assert!(matches!(error.error, DoubleSError::Limit(_)));
}

#[test]
fn velocities_are_waited_for_and_kept() {
    let spindle = Axis { to: Target::Velocity(0.5), ..axis(rest(0.0), rest(0.0), [1.0, 5.0, 50.0]) };
    let slow = axis(rest(0.0), rest(9.0), [1.0, 5.0, 50.0]);
    let found = plan(&[spindle, slow], Sync::Time).unwrap();
    assert!(found.axes[0].duration < found.duration);
    assert_eq!((found.axes[0].end.velocity, found.axes[0].end.acceleration), (0.5, 0.0));
}

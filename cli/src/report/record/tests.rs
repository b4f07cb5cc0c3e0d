use super::super::model::Bounds;
use super::*;

fn axis(name: &str, linear: bool) -> Axis {
    let bounds = Bounds { velocity: 100.0, acceleration: 1000.0, jerk: None };
    Axis {
        name: name.into(),
        unit: if linear { "mm" } else { "deg" }.into(),
        linear,
        feed: bounds,
        rapid: bounds,
        travel: [-1e3, 1e3],
        counts_per_unit: 1e3,
        effort: 10.0,
    }
}

/// Drives an X, Y machine along X with a speed of `speed(t)` for `n` milliseconds.
fn drive(n: u32, feed: f64, speed: impl Fn(f64) -> f64) -> Motion {
    let mut recorder = Recorder::new(&[axis("X", true), axis("Y", true)]);
    let mut x = 0.0;
    for i in 0..=n {
        let time = f64::from(i) * 1e-3;
        let v = speed(time);
        x += v * 1e-3;
        let axes =
            [AxisInstant { position: x, velocity: v, ..AxisInstant::default() }, AxisInstant::default()];
        let limit = if v < feed { Limit::Acceleration(0) } else { Limit::Feed };
        let mode = Mode::Feed;
        recorder.push(&Instant {
            time,
            line: 1 + i / 10,
            mode,
            limit,
            speed: v,
            feed: Some(feed),
            axes: &axes,
        });
    }
    recorder.finish()
}

#[test]
fn stretches_below_the_feed_are_marked_as_slow() {
    let motion = drive(3000, 20.0, |t| if (1.0..2.0).contains(&t) { 10.0 } else { 20.0 });
    let points = &motion.picture.points;
    assert!(points.iter().any(|p| p.slow) && points.iter().any(|p| !p.slow));
    assert!(points.iter().all(|p| p.slow == (1.0..2.0).contains(&p.time)), "{points:?}");
}

#[test]
fn extremes_survive_a_long_record_and_sizes_stay_bounded() {
    let spike = |t: f64| if (t - 77.777).abs() < 4e-4 { 99.0 } else { 20.0 };
    let motion = drive(400_000, 20.0, spike);
    let most = TRACE_NUMBERS / 26;
    let n = motion.traces.time.len();
    assert!(n <= most && n >= most / 2 - 1, "{n}");
    assert_eq!(motion.traces.speed.hi.iter().copied().fold(0.0, f64::max), 99.0);
    assert_eq!(motion.traces.axes[0].velocity.lo.len(), n);
    assert!(motion.picture.points.len() <= DRAWN_POINTS + 1);
}

#[test]
fn the_ceiling_is_the_lower_of_feed_and_axis_velocity() {
    let at = |velocity: f64, feed: Option<f64>| {
        let axes = [AxisInstant { velocity, ..AxisInstant::default() }];
        let (mode, limit) = (Mode::Feed, Limit::Free);
        ceiling(
            &Instant { time: 0.0, line: 1, mode, limit, speed: 50.0, feed, axes: &axes },
            &[axis("X", true)],
        )
    };
    assert_eq!(at(50.0, Some(80.0)), 80.0);
    assert_eq!(at(50.0, Some(120.0)), 100.0);
    assert_eq!(at(25.0, None), 200.0);
    assert!(at(0.0, None).is_nan());
}

#[test]
fn an_empty_record_draws_nothing() {
    let motion = Recorder::new(&[axis("X", true)]).finish();
    assert!(motion.picture.points.is_empty() && motion.traces.time.is_empty());
}

#[test]
fn pictures_show_the_axes_that_move() {
    let mut recorder = Recorder::new(&[axis("X", true), axis("A", false), axis("Z", true)]);
    for i in 0..10 {
        let moving = AxisInstant { position: f64::from(i), ..AxisInstant::default() };
        let axes = [AxisInstant::default(), moving, moving];
        let (time, mode, limit) = (f64::from(i) * 1e-3, Mode::Feed, Limit::Free);
        recorder.push(&Instant { time, line: 1, mode, limit, speed: 1.0, feed: None, axes: &axes });
    }
    assert_eq!(recorder.finish().picture.axes, [2, 1]);
}

use super::*;
use crate::analysis::samples::bent_table as sample;
use crate::geometry::grid_path::{GridAxis, GridPath};
use crate::geometry::section::SpeedCap;

fn limits(velocity: f64, acceleration: f64, jerk: f64) -> Vec<AxisLimits> {
    vec![AxisLimits { velocity, acceleration, jerk }; 2]
}

fn ratios(c: &Certificate) -> [f64; 4] {
    [c.velocity_ratio, c.acceleration_ratio, c.jerk_ratio, c.feed_ratio]
}

#[test]
fn ratios_scale_with_the_limits_and_decide() {
    let table = sample();
    let first = certify(&table, &limits(1.0, 1.0, 1.0), &[]);
    assert!(first.defect.is_none() && !first.holds);
    let [v, a, j, f] = ratios(&first);
    assert_eq!(f, 0.0);
    let fits = certify(&table, &limits(v, a, j), &[]);
    assert!(fits.holds, "{fits:?}");
    for r in &ratios(&fits)[..3] {
        assert!((r - 1.0).abs() < 2e-3, "{fits:?}");
    }
    for tight in [limits(v * 0.998, a, j), limits(v, a * 0.998, j), limits(v, a, j * 0.998)] {
        assert!(!certify(&table, &tight, &[]).holds);
    }
    assert!(certify(&table, &limits(v, a, f64::INFINITY), &[]).holds);
    assert_eq!(certify(&table, &limits(v, a, f64::INFINITY), &[]).jerk_ratio, 0.0);
}

#[test]
fn a_cap_counts_only_on_its_own_part() {
    let table = sample();
    let free = limits(f64::INFINITY, f64::INFINITY, f64::INFINITY);
    let whole = |speed| certify(&table, &free, &[FeedCap { until: 640, speed }]).feed_ratio;
    let tangential = |speed| SpeedCap::Tangential { axes: 3, speed };
    assert!((whole(tangential(2.0)) * 2.0 - whole(tangential(1.0))).abs() < 1e-9);
    assert!(whole(SpeedCap::Rate(1.0)) > 0.0);
    assert_eq!(whole(SpeedCap::None), 0.0);
    // The motion is slow near its ends: inside a rest span, and inside the span after it.
    for until in [7, 33] {
        let first = FeedCap { until, speed: tangential(1.0) };
        let rest = FeedCap { until: 640, speed: SpeedCap::None };
        let last = FeedCap { until: 640, speed: tangential(1.0) };
        let middle = FeedCap { until: 640 - until, speed: SpeedCap::None };
        for caps in [vec![first, rest], vec![FeedCap { until: 0, ..rest }, middle, last]] {
            let part = certify(&table, &free, &caps);
            assert!(part.feed_ratio > 0.0 && part.feed_ratio < 0.7 * whole(tangential(1.0)), "{part:?}");
        }
    }
}

#[test]
fn a_limit_that_admits_no_motion_is_never_held() {
    let table = sample();
    for bad in [0.0, -1.0, f64::NAN] {
        assert!(!certify(&table, &limits(bad, 1e9, 1e9), &[]).holds);
        let caps = [FeedCap { until: 640, speed: SpeedCap::Rate(bad) }];
        assert!(!certify(&table, &limits(1e9, 1e9, 1e9), &caps).holds);
    }
}

#[test]
fn a_broken_table_is_a_defect_and_never_a_panic() {
    let broken = |change: fn(&mut FeedTable)| {
        let mut table = sample();
        change(&mut table);
        let c = certify(&table, &limits(1e9, 1e9, 1e9), &[]);
        assert!(!c.holds && c.velocity_ratio == f64::INFINITY);
        c.defect.unwrap()
    };
    assert_eq!(broken(|t| t.codes[2] = 0), TableDefect::StandsStill { code: 2 });
    assert_eq!(broken(|t| t.steps[3] = 0), TableDefect::EmptySpan { span: 3 });
    assert_eq!(broken(|t| t.steps[3] += 1), TableDefect::KnotMismatch { knot: 2 });
    assert_eq!(broken(|t| t.steps[7] += 1), TableDefect::KnotMismatch { knot: 4 });
    assert_eq!(broken(|t| t.path.breaks[2] = 90), TableDefect::Breaks { knot: 2 });
    assert_eq!(broken(|t| t.q_scale = f32::NAN), TableDefect::UnitSize);
    assert_eq!(broken(|t| t.path.axes.clear()), TableDefect::AxisCount { axes: 0 });
    assert_eq!(broken(|t| t.steps.truncate(4)), TableDefect::TooFewSpans { spans: 4 });
    assert_eq!(broken(|t| t.path.breaks.clear()), TableDefect::ListLengths);
    assert_eq!(
        broken(|t| t.path.axes[1].controls[3] = i64::MIN),
        TableDefect::ControlRange { axis: 1, control: 3 }
    );
    let caps = [4, 3].map(|until| FeedCap { until, speed: SpeedCap::None });
    assert_eq!(certify(&sample(), &limits(1.0, 1.0, 1.0), &caps).defect, Some(TableDefect::CapOrder));
    assert_eq!(certify(&sample(), &[], &[]).defect, Some(TableDefect::LimitCount));
}

#[test]
fn position_bounds_enclose_the_path_to_a_count() {
    let mut table = sample();
    table.path.axes[0].controls =
        vec![1_000_000, 1_002_000, 1_009_000, 990_000, 1_003_000, 1_001_000, 1_000_000];
    let [low, high] = position_bounds(&table, 0);
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for span in 0..table.path.spans() {
        let length = table.path.piece(0, span).length;
        for k in 0..=1000 {
            let p = table.path.position(0, span, length * f64::from(k) / 1000.0);
            (least, most) = (least.min(p), most.max(p));
        }
    }
    assert!(low <= least && low > least - 1e-3, "{low} {least}");
    assert!(high >= most && high < most + 1e-3, "{high} {most}");
}

/// The outcome of many chunks is that of their spans, whichever thread did which.
#[test]
fn long_tables_give_the_same_on_any_number_of_threads() {
    let n = 2000u32;
    let controls = |bend: fn(f64) -> f64| (0..i64::from(n) + 3).map(|i| bend(i as f64) as i64).collect();
    let axes = vec![
        GridAxis { lsb: 1e-4, controls: controls(|t| 4e4 * (0.05 * t).sin()) },
        GridAxis { lsb: 1e-4, controls: controls(|t| 4e4 * (0.033 * t).cos()) },
    ];
    let path = GridPath { step: 0.01, breaks: (0..=u64::from(n)).map(|i| 20 * i).collect(), axes };
    let codes = (0..n - 2).map(|i| 3000 + (500.0 * f64::from(i).sin()) as u32).collect();
    let table = FeedTable { path, steps: vec![20; n as usize], q_scale: 1e-6, codes };
    let caps = [FeedCap { until: 20_005, speed: SpeedCap::Rate(4.0) }];
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| certify(&table, &limits(5.0, 50.0, 3000.0), &caps))
    };
    let one = run(1);
    assert_eq!(one.worst.len(), 4);
    assert_eq!(one, run(3));
}

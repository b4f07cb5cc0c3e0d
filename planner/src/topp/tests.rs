//! Plans of many kinds of path against an oracle that shares no row code.

mod families;
mod oracle;
mod sweep;

use proptest::prelude::*;

use self::families::{Rng, cap, circle, limits, line, walk, zigzag};
use self::oracle::{Oracle, certified_jerk};
use super::problem::{Binding, Plan, Problem, Settings, Solver};
use super::sweep::Sweep;
use super::{LimitKind, PlanError, Relaxed, plan, relief};
use crate::geometry::grid_path::GridPath;
use crate::geometry::section::{FeedCap, SpeedCap};
use crate::job::machine::AxisLimits;

const TICK_S: f64 = 1e-3;

/// Plans, and checks everything that holds of every plan.
fn planned(path: &GridPath, limits: &[AxisLimits], caps: &[FeedCap]) -> Plan {
    let problem = Problem { path, limits, caps, control_tick_s: TICK_S };
    let plan = plan(&problem, &Settings::default()).unwrap();
    Oracle::of(&problem, &plan.table).assert_sound(&problem, &plan);
    plan
}

fn refused(path: &GridPath, limits: &[AxisLimits], caps: &[FeedCap]) -> PlanError {
    plan(&Problem { path, limits, caps, control_tick_s: TICK_S }, &Settings::default()).unwrap_err()
}

/// Shortest time of a straight move from rest to rest under velocity, acceleration and jerk [Biagiotti2008 3.4].
fn double_s(length: f64, v: f64, a: f64, j: f64) -> f64 {
    let ramp = |v: f64| if v * j >= a * a { v / a + a / j } else { 2.0 * (v / j).sqrt() };
    if v * ramp(v) <= length {
        return 2.0 * ramp(v) + (length - v * ramp(v)) / v;
    }
    let (mut low, mut high) = (0.0, v);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle * ramp(middle) <= length { low = middle } else { high = middle }
    }
    2.0 * ramp(low)
}

#[test]
fn straight_moves_come_close_to_the_double_s() {
    // Moves that are all jerk lose more: within one span constant q'' holds the jerk only to first order.
    for (length, loss) in
        [(1.0, 0.02), (5.0, 0.005), (20.0, 0.002), (60.0, 0.001), (300.0, 2e-4), (1e4, 5e-5)]
    {
        let path = line(&[1.0, 0.0], length, 1);
        let seconds = planned(&path, &limits(2, 100.0, 500.0, 1e4), &[]).table.duration();
        let exact = double_s(length, 100.0, 500.0, 1e4);
        assert!((1.0..1.0 + loss).contains(&(seconds / exact)), "{length}: {seconds} {exact}");
    }
}

#[test]
fn the_shortest_moves_are_planned() {
    for length in [1e-5, 1e-4, 1e-3, 1e-2, 0.1] {
        for jerk in [5e4, f64::INFINITY] {
            planned(&line(&[0.6, -0.8, 0.0], length, 1), &limits(3, 100.0, 500.0, jerk), &[]);
        }
    }
}

#[test]
fn without_jerk_limits_the_sweep_is_met() {
    let path = walk(&mut Rng::new(1), 3, 20, 8.0, 0.5);
    let l = limits(3, 100.0, 500.0, f64::INFINITY);
    let problem = Problem { path: &path, limits: &l, caps: &[], control_tick_s: TICK_S };
    let seconds = planned(&path, &l, &[]).table.duration();
    assert!(seconds / Sweep::new(&problem).duration() < 1.01);
}

#[test]
fn walks_of_one_to_nine_axes() {
    let mut rng = Rng::new(2);
    for axes in 1..=9 {
        let path = walk(&mut rng, axes, 12, 8.0, 0.5);
        planned(&path, &limits(axes, 100.0, 500.0, 1e4), &[]);
    }
}

#[test]
fn jerk_is_certified_between_the_samples() {
    let mut rng = Rng::new(3);
    for turn in [0.3, 1.5] {
        let path = walk(&mut rng, 3, 30, 8.0, turn);
        let l = limits(3, 100.0, 500.0, 1e4);
        let problem = Problem { path: &path, limits: &l, caps: &[], control_tick_s: TICK_S };
        let p = planned(&path, &l, &[]);
        let ratio = certified_jerk(&problem, &p.table).sqrt();
        assert!((0.99..1.0 + 1e-6).contains(&ratio), "{ratio}");
    }
}

#[test]
fn rough_zigzags_do_not_stall() {
    let path = zigzag(&mut Rng::new(4), 60, 0.2);
    let p = planned(&path, &limits(2, 150.0, 1500.0, 5e4), &[]);
    // Up to three solutions, the later ones on finer knots.
    assert!(p.iterations < 3 * 30, "{}", p.iterations);
    let binds = |f: fn(&Binding) -> bool| p.binding.iter().filter(|b| f(b)).count();
    assert!(2 * binds(|b| matches!(b, Binding::Jerk(_))) > p.binding.len());
}

#[test]
fn fast_lines_and_slow_corners_share_one_range_of_codes() {
    // Long legs at 500 mm/s between corners of 1 mm/s and less: q spans more than five decades.
    let corner = zigzag(&mut Rng::new(5), 40, 0.02);
    let leg = (300.0 / corner.step) as u64;
    let mut breaks = vec![0, leg];
    breaks.extend(corner.breaks[1..].iter().map(|b| leg + b));
    breaks.push(2 * leg + corner.grid_length());
    let path = families::with_run_outs(&corner, breaks);
    let p = planned(&path, &limits(2, 500.0, 2000.0, 5e4), &[]);
    let (low, high) = (p.table.codes.iter().min().unwrap(), p.table.codes.iter().max().unwrap());
    assert!(f64::from(*high) / f64::from(*low) > 100.0, "{low} {high}");
}

#[test]
fn slow_feed_divides_spans_to_below_a_second() {
    let path = circle(2.0, 1.0, 24);
    let caps = cap(&path, SpeedCap::Tangential { axes: 3, speed: 0.1 });
    let p = planned(&path, &limits(2, 100.0, 500.0, 1e4), &caps);
    let least = std::f64::consts::TAU * 2.0 / 0.1;
    assert!((0.98..1.01).contains(&(p.table.duration() / least)), "{}", p.table.duration());
    assert!(p.binding.iter().filter(|b| **b == Binding::Feed).count() * 10 > 9 * p.binding.len());
}

#[test]
fn caps_that_step_are_kept_on_either_side() {
    let path = line(&[0.6, 0.8], 100.0, 7);
    let total = path.grid_length();
    let caps = [
        FeedCap { until: total / 3, speed: SpeedCap::Tangential { axes: 3, speed: 50.0 } },
        FeedCap { until: total / 2, speed: SpeedCap::Rate(5.0) },
        FeedCap { until: total / 2 + 100, speed: SpeedCap::Tangential { axes: 1, speed: 20.0 } },
        FeedCap { until: total, speed: SpeedCap::None },
    ];
    let p = planned(&path, &limits(2, 100.0, 500.0, 1e4), &caps);
    let least = 100.0 / 3.0 / 50.0 + 100.0 / 6.0 / 5.0 + 0.5;
    assert!((least..least + 0.6).contains(&p.table.duration()), "{}", p.table.duration());
}

#[test]
fn the_reference_solver_agrees() {
    let mut rng = Rng::new(6);
    for (axes, turn) in [(1, 0.1), (2, 0.5), (3, 1.5), (6, 0.5)] {
        let path = walk(&mut rng, axes, 8, 8.0, turn);
        let l = limits(axes, 100.0, 500.0, 1e4);
        let problem = Problem { path: &path, limits: &l, caps: &[], control_tick_s: TICK_S };
        let solve = |solver| {
            let settings = Settings { solver, relative_gap: 1e-6, ..Settings::default() };
            plan(&problem, &settings).unwrap()
        };
        let (own, reference) = (solve(Solver::InteriorPoint), solve(Solver::Clarabel));
        Oracle::of(&problem, &reference.table).assert_sound(&problem, &reference);
        let ratio = own.table.duration() / reference.table.duration();
        assert!((ratio - 1.0).abs() < 1e-4, "{axes} axes: {ratio}");
    }
}

#[test]
fn windows_lose_almost_nothing_and_do_not_depend_on_threads() {
    let path = walk(&mut Rng::new(7), 1, 900, 4.0, 0.2);
    let path = families::with_wave(&path, 3.0);
    let l = limits(2, 100.0, 500.0, 1e4);
    let problem = Problem { path: &path, limits: &l, caps: &[], control_tick_s: TICK_S };
    let settings = Settings { relative_gap: 1e-6, ..Settings::default() };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| plan(&problem, &settings).unwrap())
    };
    let (one, two) = (on(1), on(2));
    assert!(one.table.spans() > 2500, "{} spans fill one window only", one.table.spans());
    assert_eq!(one.table, two.table);
    Oracle::of(&problem, &one.table).assert_sound(&problem, &one);
    let whole = super::plan_whole_up_to(usize::MAX, &problem, &settings).unwrap();
    let ratio = one.table.duration() / whole.table.duration();
    assert!((0.999_999..1.000_05).contains(&ratio), "{ratio}");
}

#[test]
fn bad_problems_are_refused_by_name() {
    let path = line(&[1.0, 1.0], 10.0, 2);
    let good = limits(2, 100.0, 500.0, 1e4);
    for (value, kind) in
        [(0.0, LimitKind::Velocity), (f64::NAN, LimitKind::Acceleration), (-1.0, LimitKind::Jerk)]
    {
        let mut l = good.clone();
        match kind {
            LimitKind::Velocity => l[1].velocity = value,
            LimitKind::Acceleration => l[1].acceleration = value,
            LimitKind::Jerk => l[1].jerk = value,
        }
        let PlanError::Limit { axis: 1, kind: named, .. } = refused(&path, &l, &[]) else { panic!() };
        assert_eq!(named, kind);
    }
    let infinite = vec![AxisLimits { velocity: f64::INFINITY, ..good[0] }; 2];
    assert!(matches!(refused(&path, &infinite, &[]), PlanError::Limit { axis: 0, .. }));
    assert!(matches!(refused(&path, &good[..1], &[]), PlanError::LimitCount { limits: 1, axes: 2 }));
    let zero = cap(&path, SpeedCap::Rate(0.0));
    assert!(matches!(refused(&path, &good, &zero), PlanError::Cap { .. }));
    let short = [FeedCap { until: 5, speed: SpeedCap::None }];
    assert!(matches!(refused(&path, &good, &short), PlanError::CapOrder { index: 0, until: 5 }));
    let slow = cap(&path, SpeedCap::Rate(1e-9));
    assert!(matches!(refused(&path, &good, &slow), PlanError::TooLong { .. }));
    assert_eq!(refused(&line(&[0.0, 0.0], 10.0, 2), &good, &[]), PlanError::NothingMoves);
    let mut tiny = path.clone();
    tiny.breaks = vec![0, 1, 3];
    assert!(matches!(refused(&tiny, &good, &[]), PlanError::TooShort { steps: 3, .. }));
    let mut torn = path.clone();
    torn.breaks = vec![0, 9, 9];
    assert!(matches!(refused(&torn, &good, &[]), PlanError::Path { .. }));
}

#[test]
fn refusals_name_the_smallest_relaxation() {
    let path = line(&[0.6, 0.8], 10.0, 3);
    let settings = Settings::default();
    let ask = |l: &[AxisLimits], caps: &[FeedCap]| {
        let problem = Problem { path: &path, limits: l, caps, control_tick_s: TICK_S };
        relief(&problem, &settings, &plan(&problem, &settings).unwrap_err())
    };
    let good = limits(2, 100.0, 500.0, 1e4);
    let capped = |factor: f64| cap(&path, SpeedCap::Rate(1e-9 * factor));
    let found = ask(&good, &capped(1.0)).unwrap();
    assert_eq!(found.limit, Relaxed::Feed);
    assert!(ask(&good, &capped(0.9 * found.factor)).is_some_and(|left| left.factor < 1.2), "{found:?}");
    let crawling = |factor: f64| {
        let mut l = good.clone();
        l[1].velocity = 1e-9 * factor;
        l
    };
    let found = ask(&crawling(1.0), &[]).unwrap();
    assert_eq!(found.limit, Relaxed::Axis(1, LimitKind::Velocity));
    assert!(ask(&crawling(0.9 * found.factor), &[]).is_some_and(|left| left.factor < 1.2), "{found:?}");
    // No limit helps a path without length.
    let problem = Problem { path: &path, limits: &good, caps: &[], control_tick_s: TICK_S };
    assert_eq!(relief(&problem, &settings, &PlanError::NothingMoves), None);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, max_shrink_iters: 20, ..ProptestConfig::default() })]

    /// Any path and limits over decades: a sound plan.
    #[test]
    fn random_paths_and_limits(seed in any::<u64>()) {
        let mut rng = Rng::new(seed);
        let axes = 1 + (rng.unit() * 9.0) as usize;
        let scale = 10f64.powf(rng.within(-3.0, 2.0));
        let spans = 1 + (rng.unit() * 12.0) as usize;
        let turn = 10f64.powf(rng.within(-2.0, 0.7));
        let path = walk(&mut rng, axes, spans, scale, turn);
        let l: Vec<AxisLimits> = (0..axes)
            .map(|_| AxisLimits {
                velocity: scale * 10f64.powf(rng.within(-1.0, 3.0)),
                acceleration: scale * 10f64.powf(rng.within(0.0, 4.0)),
                jerk: scale * 10f64.powf(rng.within(1.0, 6.0)),
            })
            .collect();
        planned(&path, &l, &[]);
    }
}

//! Tables planned anew while they are played.
#![allow(clippy::unwrap_used, reason = "tests stop on an error")]

use planner::certificate::{LimitKind, certify};
use planner::feed::table::{FeedTable, SpanLaw};
use planner::geometry::grid_path::GridPath;
use planner::geometry::section::{FeedCap, SpeedCap};
use planner::job::machine::AxisLimits;
use planner::topp::horizon::Deadline;
use planner::topp::problem::{Problem, Settings};
use planner::topp::retime::{RetimeError, Retimed, Rules, retime, scaled};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use tests::meander::{limits, meander};
use tests::tables::Random;

const TICK_S: f64 = 1e-3;
const GAP: f64 = 1e-5;

fn planned(path: &GridPath, rules: Rules) -> FeedTable {
    let problem = Problem { path, limits: rules.limits, caps: rules.caps, control_tick_s: TICK_S };
    let settings = Settings { largest_loss: f64::INFINITY, ..Settings::default() };
    planner::topp::plan(&problem, &settings).unwrap().table
}

fn again(table: &FeedTable, knot: usize, old: Rules, new: Rules) -> Result<Retimed, RetimeError> {
    retime(table, knot, old, new, TICK_S, GAP, Deadline::NONE)
}

/// Place of knot `k` in grid steps.
fn place(table: &FeedTable, k: usize) -> u64 {
    table.steps[..k].iter().map(|&s| u64::from(s)).sum()
}

/// What must hold of every answer: the beginning untouched, q and q' continuous, the old limits before the new ones
/// hold and the new ones from there on.
fn assert_sound(old_table: &FeedTable, knot: usize, old: Rules, new: Rules, found: &Retimed) {
    let table = &found.table;
    assert_eq!(table.q_scale, old_table.q_scale);
    assert_eq!(table.path, old_table.path);
    assert_eq!(table.steps[..=knot], old_table.steps[..=knot]);
    assert_eq!(table.codes[..knot], old_table.codes[..knot]);
    for i in 0..knot {
        assert_eq!(table.law(i), old_table.law(i), "span {i} before knot {knot}");
    }
    if knot > 0
        && let (SpanLaw::Quadratic { q: a, .. }, SpanLaw::Quadratic { q: b, .. }) =
            (table.law(knot), old_table.law(knot))
    {
        assert_eq!(a[..2], b[..2], "q and q' at the knot");
    }
    // Caps cut at the place from which the new ones hold; limits by the larger of each.
    let at = place(table, found.holds_from);
    assert!((at as f64 * table.path.step - found.holds_from_u).abs() < 1e-9);
    let cut = |caps: &[FeedCap], from: u64, to: u64| -> Vec<FeedCap> {
        let mut out: Vec<FeedCap> = caps
            .iter()
            .filter(|c| c.until > from)
            .map(|c| FeedCap { until: c.until.min(to), ..*c })
            .collect();
        let used = out.iter().position(|c| c.until >= to).map_or(out.len(), |k| k + 1);
        out.truncate(used);
        out
    };
    let total = table.path.grid_length();
    let mut caps = if at > 0 { cut(old.caps, 0, at) } else { Vec::new() };
    caps.extend(cut(new.caps, at, total));
    let either: Vec<AxisLimits> = old
        .limits
        .iter()
        .zip(new.limits)
        .map(|(a, b)| AxisLimits {
            velocity: a.velocity.max(b.velocity),
            acceleration: a.acceleration.max(b.acceleration),
            jerk: a.jerk.max(b.jerk),
        })
        .collect();
    let certificate = certify(table, &either, if old.caps.is_empty() { &[] } else { &caps });
    assert!(certificate.holds, "{certificate:?}");
    assert_new_limits(table, found.holds_from, new.limits);
}

/// Samples the motion from a knot on against limits, by the formulas themselves.
fn assert_new_limits(table: &FeedTable, from: usize, limits: &[AxisLimits]) {
    let path = &table.path;
    for i in from.max(1)..table.spans() - 1 {
        let SpanLaw::Quadratic { h, q } = table.law(i) else { continue };
        let at = place(table, i);
        let g = path.breaks.partition_point(|&b| b <= at) - 1;
        for (axis, l) in limits.iter().enumerate() {
            let piece = path.piece(axis, g);
            let offset = (at - path.breaks[g]) as f64 * path.step;
            for k in 0..=8 {
                let x = h * f64::from(k) / 8.0;
                let (v, a, j) = (q[0] + x * (q[1] + x * q[2]), 0.5 * q[1] + q[2] * x, q[2]);
                let (p1, p2, p3) = (piece.first(offset + x), piece.second(offset + x), piece.third());
                let room = 1.0 + 1e-6;
                assert!(p1.abs() * v.sqrt() <= l.velocity * room, "velocity, span {i}");
                assert!((p2 * v + p1 * a).abs() <= l.acceleration * room, "acceleration, span {i}");
                let jerk = (p3 * v + 3.0 * p2 * a + p1 * j).abs() * v.sqrt();
                assert!(jerk <= l.jerk * room, "jerk, span {i}");
            }
        }
    }
}

fn cap(path: &GridPath, speed: f64) -> Vec<FeedCap> {
    vec![FeedCap { until: path.grid_length(), speed: SpeedCap::Tangential { axes: 7, speed } }]
}

#[test]
fn unchanged_limits_give_the_same_time() {
    let path = meander(&mut Random::new(1), 3, 60, 6.0, 0.6);
    let limits = limits(3, 100.0, 500.0, 1e4);
    let rules = Rules { limits: &limits, caps: &[] };
    let table = planned(&path, rules);
    for knot in [0, 1, 7, 50, 111, table.spans() / 2, table.spans() - 10, table.spans() - 3] {
        let found = again(&table, knot, rules, rules).unwrap();
        assert_sound(&table, knot, rules, rules, &found);
        assert_eq!(found.holds_from, knot);
        let ratio = found.table.duration() / table.duration();
        assert!((1.0 - 1e-3..=1.0).contains(&ratio), "knot {knot}: {ratio}");
    }
}

#[test]
fn a_higher_override_is_faster_and_a_lower_one_slower() {
    let path = meander(&mut Random::new(2), 3, 60, 6.0, 0.4);
    let limits = limits(3, 100.0, 500.0, 1e4);
    let caps = cap(&path, 40.0);
    let old = Rules { limits: &limits, caps: &caps };
    let table = planned(&path, old);
    let knot = table.spans() / 3;
    let mut last = f64::INFINITY;
    for factor in [0.1, 0.3, 0.8, 0.99, 1.0, 1.2, 1.5] {
        let caps = scaled(&caps, factor).unwrap();
        let new = Rules { limits: &limits, caps: &caps };
        let found = again(&table, knot, old, new).unwrap();
        assert_sound(&table, knot, old, new, &found);
        let seconds = found.table.duration();
        assert!(seconds < last, "{factor}: {seconds} {last}");
        last = seconds;
        let (fresh, share) = (planned(&path, new).duration(), 1.0 - knot as f64 / table.spans() as f64);
        assert!(
            seconds
                < table.duration()
                    + 1.1 * (fresh * share - table.duration() * share).max(0.0)
                    + 0.2 * fresh.min(table.duration()),
            "{factor}: {seconds} {fresh}"
        );
    }
}

#[test]
fn lower_limits_hold_from_where_it_is_said() {
    let path = meander(&mut Random::new(3), 2, 60, 6.0, 0.5);
    let limits = limits(2, 100.0, 500.0, 1e4);
    let old = Rules { limits: &limits, caps: &[] };
    let table = planned(&path, old);
    for (velocity, acceleration, jerk) in
        [(50.0, 500.0, 1e4), (100.0, 400.0, 1e4), (100.0, 500.0, 5e3), (30.0, 100.0, 1e3)]
    {
        let lower = vec![AxisLimits { velocity, acceleration, jerk }; 2];
        let new = Rules { limits: &lower, caps: &[] };
        for knot in [0, 5, 60, table.spans() / 2] {
            let found = again(&table, knot, old, new).unwrap();
            assert_sound(&table, knot, old, new, &found);
            assert!(found.table.duration() > table.duration());
            if knot == 0 {
                // Nothing moves yet, so that nothing is lost but what the knots are too coarse for.
                assert_eq!(found.holds_from, 0);
                let fresh = planned(&path, new).duration();
                assert!(found.table.duration() < 1.01 * fresh, "{} {fresh}", found.table.duration());
            }
        }
    }
}

#[test]
fn what_cannot_be_done_is_refused() {
    let path = meander(&mut Random::new(4), 2, 20, 6.0, 0.5);
    let good = limits(2, 100.0, 500.0, 1e4);
    let rules = Rules { limits: &good, caps: &[] };
    let table = planned(&path, rules);
    let last = table.spans() - 3;
    assert_eq!(again(&table, last + 1, rules, rules), Err(RetimeError::Knot { knot: last + 1, last }));
    for factor in [0.0, f64::NAN, -1.0, f64::INFINITY] {
        assert!(matches!(scaled(&[], factor), Err(RetimeError::Factor { .. })));
    }
    let none = limits(2, 0.0, 500.0, 1e4);
    assert!(matches!(again(&table, 4, rules, Rules { limits: &none, caps: &[] }), Err(RetimeError::Plan(_))));
    let crawl = limits(2, 1.0, 500.0, 1e4);
    let late = again(&table, last - 3, rules, Rules { limits: &crawl, caps: &[] });
    assert!(matches!(late, Err(RetimeError::Unmet { kind: LimitKind::Velocity, .. })), "{late:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, max_shrink_iters: 4, rng_seed: RngSeed::Fixed(24), ..ProptestConfig::default() })]

    /// Any path, knot and factor: a sound answer, never slower than before for a higher factor.
    #[test]
    fn random_overrides(seed in any::<u64>(), axes in 1usize..5, share in 0.0..0.8f64, factor in 0.1..2.0f64) {
        let mut random = Random::new(seed);
        let path = meander(&mut random, axes, 40, 6.0, 0.6);
        let limits = limits(axes, 100.0, 500.0, 1e4);
        let caps = cap(&path, random.between(10.0, 120.0));
        let old = Rules { limits: &limits, caps: &caps };
        let table = planned(&path, old);
        let knot = (share * table.spans() as f64) as usize;
        let caps = scaled(&caps, factor).unwrap();
        let new = Rules { limits: &limits, caps: &caps };
        let found = match again(&table, knot, old, new) {
            Ok(found) => found,
            // All that is left may be the way to rest, at full limits: of 3000 random overrides 12 are refused, with
            // 0.74 s left at most.
            Err(RetimeError::Unmet { .. }) => {
                let left: f64 = (knot..table.spans()).map(|i| table.law(i).duration()).sum();
                prop_assert!(factor < 1.0 && knot > 0 && left < 1.0, "{left} s are enough to slow down");
                return Ok(());
            }
            Err(fault) => panic!("{fault}"),
        };
        assert_sound(&table, knot, old, new, &found);
        if factor >= 1.0 {
            prop_assert!(found.table.duration() <= table.duration());
        }
    }
}

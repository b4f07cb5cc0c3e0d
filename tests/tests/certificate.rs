//! The certificate against a checker that shares no code with it.

use planner::certificate::verify::{Fault, FaultCause, WorstInJob};
use planner::certificate::{Certificate, LimitKind, TableDefect, Worst, certify, position_bounds};
use planner::feed::table::FeedTable;
use planner::geometry::section::{FeedCap, SpeedCap};
use planner::job::machine::AxisLimits;
use proptest::prelude::*;
use tests::oracle::dense::{Ratios, Reading, largest_ratios};
use tests::oracle::random_table::{Dice, random_table};
use tests::oracle::real::{Pair, Real};

const PER_SPAN: usize = 100;

fn unit_limits(axes: usize) -> Vec<AxisLimits> {
    vec![AxisLimits { velocity: 1.0, acceleration: 1.0, jerk: 1.0 }; axes]
}

/// Caps of every kind, whose ends need not be knots.
fn random_caps(dice: &mut Dice, table: &FeedTable) -> Vec<FeedCap> {
    let length = table.path.grid_length();
    let mut until = 0;
    let mut caps = Vec::new();
    while until < length {
        until = (until + dice.whole(1, 1 + length / 3)).min(length);
        let speed = match dice.whole(0, 2) {
            0 => SpeedCap::None,
            1 => SpeedCap::Rate(dice.real(0.5, 2.0)),
            _ => SpeedCap::Tangential { axes: dice.whole(1, 7) as u16, speed: dice.real(0.5, 2.0) },
        };
        caps.push(FeedCap { until, speed });
    }
    caps
}

/// Every pair of ratios, certified and sampled.
fn pairs(c: &Certificate, s: &Ratios) -> [(f64, f64); 4] {
    [
        (c.velocity_ratio, s.velocity),
        (c.acceleration_ratio, s.acceleration),
        (c.jerk_ratio, s.jerk),
        (c.feed_ratio, s.feed),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn bounds_are_never_below_the_samples_and_at_most_a_hundredth_above(
        seed in any::<u64>(), axes in 1usize..=4, spans in 5usize..60,
    ) {
        let mut dice = Dice::new(seed);
        let table = random_table(&mut dice, axes, spans);
        let caps = random_caps(&mut dice, &table);
        let limits = unit_limits(axes);
        let proven = certify(&table, &limits, &caps);
        prop_assert_eq!(proven.defect, None);
        let sampled = largest_ratios(&table, &limits, &caps, PER_SPAN);
        for (bound, sample) in pairs(&proven, &sampled) {
            prop_assert!(bound >= sample * (1.0 - 1e-12), "{proven:?} {sampled:?}");
            prop_assert!(bound <= sample * 1.01 + 1e-12, "{proven:?} {sampled:?}");
        }
        for w in &proven.worst {
            prop_assert!(w.attained <= w.bound && w.u >= 0.0 && w.u <= table.path.length());
        }
    }

    #[test]
    fn a_limit_that_is_just_broken_is_caught_and_one_that_is_just_met_is_not(
        seed in any::<u64>(), kind in 0usize..3, axes in 1usize..=3,
    ) {
        let table = random_table(&mut Dice::new(seed), axes, 30);
        let sampled = largest_ratios(&table, &unit_limits(axes), &[], PER_SPAN);
        let limits = |share: f64| {
            let mut size = [sampled.velocity, sampled.acceleration, sampled.jerk].map(|x| 2.0 * x);
            size[kind] *= 0.5 * share;
            let [velocity, acceleration, jerk] = size;
            vec![AxisLimits { velocity, acceleration, jerk }; axes]
        };
        prop_assert!(!certify(&table, &limits(1.0 - 1e-5), &[]).holds);
        // The samples may miss the peak by a little.
        prop_assert!(certify(&table, &limits(1.001), &[]).holds);
    }

    #[test]
    fn a_code_raised_by_a_tenth_is_caught(seed in any::<u64>(), pick in any::<prop::sample::Index>()) {
        let mut table = random_table(&mut Dice::new(seed), 2, 40);
        // Even speed, so that every code matters as much as any other.
        table.codes.fill(20_000);
        let jerk = certify(&table, &unit_limits(2), &[]).jerk_ratio;
        let velocity = certify(&table, &unit_limits(2), &[]).velocity_ratio;
        let acceleration = certify(&table, &unit_limits(2), &[]).acceleration_ratio;
        let limits = vec![AxisLimits { velocity, acceleration, jerk }; 2];
        prop_assert!(certify(&table, &limits, &[]).holds);
        let k = pick.index(table.codes.len());
        table.codes[k] = 22_000;
        let caught = certify(&table, &limits, &[]);
        let sampled = largest_ratios(&table, &limits, &[], PER_SPAN);
        let broken = sampled.velocity.max(sampled.acceleration).max(sampled.jerk) > 1.0 + 2e-6;
        prop_assert!(!(broken && caught.holds), "{caught:?} {sampled:?}");
    }

    /// With 32 digits on the oracle's side no allowance is made for rounding: the bound must be above, even where
    /// it is attained at a knot and differences of nearly equal numbers lose most of their digits.
    #[test]
    fn rounding_is_outwards(seed in any::<u64>(), far in 0u32..30, wide in 0u32..12) {
        let mut dice = Dice::new(seed);
        let mut table = random_table(&mut dice, 2, 12);
        let push = i64::try_from(1u64 << far).unwrap();
        for a in &mut table.path.axes {
            a.lsb *= dice.real(0.5, 1.0);
            // Nearly the same slope everywhere, so that the higher derivatives are differences of large numbers.
            for (i, c) in a.controls.iter_mut().enumerate() {
                *c += push * i64::try_from(i).unwrap();
            }
        }
        // One long span beside short ones.
        table.steps[3] <<= wide;
        let mut place = 0;
        let knots: Vec<u64> = table.steps.iter().map(|&s| { place += u64::from(s); place }).collect();
        table.path.breaks[1] = knots[3.min(knots.len() - 2)];
        table.path.breaks.truncate(2);
        table.path.breaks.push(place);
        table.path.axes.iter_mut().for_each(|a| a.controls.truncate(5));
        let proven = certify(&table, &unit_limits(2), &[]);
        prop_assert_eq!(proven.defect, None);
        let reading = Reading::<Pair>::of(&table);
        let above = |bound: f64, x: Pair| {
            (Pair::from(bound) - x).near() >= 0.0 && (Pair::from(bound) + x).near() >= 0.0
        };
        for span in 0..reading.spans() {
            for s in [0.0, 0.25, 0.5, 0.75, 1.0] {
                for [_, v, a, j] in reading.at(span, s).axes {
                    prop_assert!(above(proven.velocity_ratio, v));
                    prop_assert!(above(proven.acceleration_ratio, a));
                    prop_assert!(above(proven.jerk_ratio, j), "{} {j:?}", proven.jerk_ratio);
                }
            }
        }
    }

    #[test]
    fn position_bounds_enclose_every_sample(seed in any::<u64>()) {
        let table = random_table(&mut Dice::new(seed), 2, 40);
        let reading = Reading::<f64>::of(&table);
        for axis in 0..2 {
            let [low, high] = position_bounds(&table, axis);
            let samples = (0..reading.spans())
                .flat_map(|i| (0..PER_SPAN).map(move |k| (i, k as f64 / (PER_SPAN - 1) as f64)))
                .map(|(i, s)| reading.at(i, s).axes[axis][0]);
            let (least, most) = samples.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
            // Samples may miss a turning point by (h/100)^2 |p''| / 8, far below a hundredth here.
            prop_assert!(low <= least + 1e-9 && least - low < 1e-2, "{low} {least}");
            prop_assert!(high >= most - 1e-9 && high - most < 1e-2, "{high} {most}");
        }
    }
}

/// A report of faults is one flat object per fault, whatever its cause.
#[test]
fn faults_are_flat_json() {
    let fault = |cause| serde_json::to_value(Fault { table: 2, line: 7, cause }).unwrap();
    assert_eq!(
        fault(FaultCause::Table(TableDefect::StandsStill { code: 3 })),
        serde_json::json!({"table": 2, "line": 7, "cause": "table", "defect": "stands_still", "code": 3})
    );
    assert_eq!(
        fault(FaultCause::Limit { kind: LimitKind::Jerk, ratio: 1.5 }),
        serde_json::json!({"table": 2, "line": 7, "cause": "limit", "kind": "jerk", "ratio": 1.5})
    );
    assert_eq!(fault(FaultCause::Marks), serde_json::json!({"table": 2, "line": 7, "cause": "marks"}));
    let place = Worst { kind: LimitKind::Feed, axis: 3, span: 1, u: 0.5, bound: 0.75, attained: 0.5 };
    assert_eq!(
        serde_json::to_value(WorstInJob { table: 0, line: 4, place }).unwrap()["kind"],
        serde_json::json!("feed")
    );
}

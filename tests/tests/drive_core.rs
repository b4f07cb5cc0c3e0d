//! The drive's f32 core against the f64 law of the same tables.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use firmware_core::evaluate::{Cursor, Setpoint};
use firmware_core::table::{CheckedTable, TableView};
use planner::feed::pack::Packed;
use protocol::checksum::Fnv64;
use tests::drives::asked;
use tests::tables::{COARSE, FINE, Kind, Random, Sample};

/// Path time units per second.
const UNIT: f64 = 4_294_967_296.0;

fn checked(packed: &Packed, axis: usize) -> CheckedTable<'_> {
    let part = &packed.axes[axis];
    let view = TableView::new(&packed.header, &part.header, &packed.shared, &part.controls);
    view.and_then(TableView::check).expect("what the planner packs, a drive accepts")
}

/// Largest errors: position [counts], velocity and acceleration relative to the table's largest, duration of a
/// span relative to itself, beyond the half unit of its rounding.
#[derive(Debug, Default)]
struct Worst {
    spans: u64,
    position: f64,
    velocity: f64,
    acceleration: f64,
    duration: f64,
}

fn compare(sample: &Sample, random: &mut Random, worst: &mut Worst) {
    let packed = sample.packed(1).unwrap();
    worst.spans += u64::from(packed.header.spans);
    for axis in 0..sample.scales.len() {
        let table = checked(&packed, axis);
        let mut times: Vec<u64> = (0..100).map(|_| random.whole(0, table.duration() - 1)).collect();
        times.sort_unstable();
        let mut cursor = Cursor::new(&table).unwrap();
        let (mut fastest, mut hardest) = (0f64, 0f64);
        let mut errors = Vec::new();
        for time in times {
            let found = cursor.evaluate(&table, time).unwrap();
            let span = cursor.span() as usize;
            let law = sample.table.law(span).duration();
            let off = (cursor.duration() as f64 - law * UNIT).abs();
            worst.duration = worst.duration.max((off - 0.5) / (law * UNIT));
            let mut local = (time - cursor.began()) as f64 / UNIT;
            if span == sample.table.spans() - 1 {
                // The landing counts from the end.
                local += law - cursor.duration() as f64 / UNIT;
            }
            let exact = sample.motion(axis, span, local);
            worst.position = worst.position.max((found.position as f64 - exact.position).abs());
            (fastest, hardest) = (fastest.max(exact.velocity.abs()), hardest.max(exact.acceleration.abs()));
            errors.push((
                (f64::from(found.velocity) - exact.velocity).abs(),
                (f64::from(found.acceleration) - exact.acceleration).abs(),
            ));
        }
        for (velocity, acceleration) in errors {
            worst.velocity = worst.velocity.max(velocity / fastest);
            worst.acceleration = worst.acceleration.max(acceleration / hardest);
        }
    }
}

fn worst(kind: Kind, seed: u64, tables: u64) -> Worst {
    let mut random = Random::new(seed);
    let mut worst = Worst::default();
    for _ in 0..tables {
        compare(&Sample::new(&mut random, kind), &mut random, &mut worst);
    }
    worst
}

/// `FEEDSPLINE_CASES` asks for so many tables of either kind.

#[test]
fn setpoints_are_within_one_count_of_the_law() {
    let cases = asked("FEEDSPLINE_CASES", 400);
    let found = [(FINE, 1), (COARSE, 2)].map(|(kind, seed)| worst(kind, seed, cases));
    println!("{found:?}");
    for worst in found {
        assert!(worst.position <= 1.0, "{worst:?}");
        assert!(worst.velocity <= 1e-6, "{worst:?}");
        assert!(worst.acceleration <= 1e-5, "{worst:?}");
        assert!(worst.duration <= 1e-6, "{worst:?}");
    }
}

#[test]
fn the_last_setpoint_is_the_exact_end_and_the_first_the_exact_start() {
    let mut random = Random::new(3);
    for _ in 0..200 {
        let sample = Sample::new(&mut random, FINE);
        let packed = sample.packed(1).unwrap();
        for (axis, part) in packed.axes.iter().enumerate() {
            let table = checked(&packed, axis);
            let mut cursor = Cursor::new(&table).unwrap();
            let first = cursor.evaluate(&table, 0).unwrap();
            assert_eq!(first, Setpoint { done: false, ..Setpoint::at_rest(part.header.start) });
            let before = cursor.evaluate(&table, table.duration() - 1).unwrap();
            let controls = &sample.table.path.axes[axis].controls;
            let half_way = 1 << part.header.fraction_bits >> 1;
            let tie = half_way > 0 && controls[controls.len() - 1] % (2 * half_way) == half_way;
            assert!(!before.done && (before.position == part.header.end || tie));
            for time in [table.duration(), u64::MAX] {
                assert_eq!(cursor.evaluate(&table, time), Ok(Setpoint::at_rest(part.header.end)));
            }
        }
    }
}

#[test]
fn motion_is_continuous_at_every_knot() {
    let mut random = Random::new(8);
    let mut knots = 0;
    for _ in 0..100 {
        let sample = Sample::new(&mut random, FINE);
        let packed = sample.packed(1).unwrap();
        let table = checked(&packed, 0);
        let mut cursor = Cursor::new(&table).unwrap();
        let (mut fastest, mut hardest, mut pairs) = (0f32, 0f32, Vec::new());
        while cursor.span() + 1 < packed.header.spans {
            let knot = cursor.began() + cursor.duration();
            let before = cursor.evaluate(&table, knot - 1).unwrap();
            let after = cursor.evaluate(&table, knot).unwrap();
            assert_eq!(cursor.began(), knot);
            fastest = fastest.max(after.velocity.abs());
            hardest = hardest.max(after.acceleration.abs());
            pairs.push((before, after));
        }
        knots += pairs.len();
        for (before, after) in pairs {
            assert!((after.position - before.position).abs() <= 1, "{before:?} {after:?}");
            assert!((after.velocity - before.velocity).abs() <= 2e-6 * fastest, "{before:?} {after:?}");
            assert!(
                (after.acceleration - before.acceleration).abs() <= 2e-5 * hardest,
                "{before:?} {after:?}"
            );
        }
    }
    assert!(knots > 4000);
}

#[test]
fn setpoints_do_not_depend_on_which_instants_were_asked_before() {
    let mut random = Random::new(4);
    for _ in 0..50 {
        let sample = Sample::new(&mut random, COARSE);
        let packed = sample.packed(1).unwrap();
        let table = checked(&packed, 0);
        let mut often = Cursor::new(&table).unwrap();
        for i in 0..200 {
            let time = table.duration() / 200 * i;
            let mut once = Cursor::new(&table).unwrap();
            assert_eq!(once.evaluate(&table, time), often.evaluate(&table, time));
        }
    }
}

#[test]
fn a_table_takes_as_long_as_the_law_says() {
    let mut random = Random::new(7);
    let mut worst = 0f64;
    for _ in 0..200 {
        let sample = Sample::new(&mut random, FINE);
        let packed = sample.packed(1).unwrap();
        let seconds = checked(&packed, 0).duration() as f64 / UNIT;
        worst = worst.max((seconds / sample.table.duration() - 1.0).abs());
    }
    assert!(worst < 1e-6, "{worst:e}");
    println!("{worst:e}");
}

#[test]
fn all_axes_pass_every_knot_at_the_same_time() {
    let mut random = Random::new(5);
    for _ in 0..100 {
        let sample = Sample::new(&mut random, FINE);
        let packed = sample.packed(1).unwrap();
        let durations: Vec<u64> = (0..packed.axes.len()).map(|a| checked(&packed, a).duration()).collect();
        assert!(durations.iter().all(|d| *d == durations[0]));
    }
}

#[test]
fn setpoints_are_the_same_bits_everywhere() {
    let mut random = Random::new(6);
    let mut hash = Fnv64::new();
    let mut setpoints = 0u64;
    for i in 0..20 {
        let sample = Sample::new(&mut random, if i % 2 == 0 { FINE } else { COARSE });
        let packed = sample.packed(1).unwrap();
        for axis in 0..packed.axes.len() {
            let table = checked(&packed, axis);
            let mut cursor = Cursor::new(&table).unwrap();
            let step = table.duration() / 3000;
            for n in 0..=3001 {
                hash = cursor.evaluate(&table, n * step).unwrap().hashed(hash);
                setpoints += 1;
            }
        }
    }
    assert!(setpoints >= 100_000);
    assert_eq!(hash.finish(), 0x2ee1_ab4b_2c38_aba8, "{:#018x} after {setpoints} set-points", hash.finish());
}

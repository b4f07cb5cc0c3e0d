//! Nothing accumulates: a million spans, and hours of motion.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use firmware_core::evaluate::Cursor;
use firmware_core::table::TableView;
use planner::feed::pack::{AxisScale, Packed, Target, pack};
use planner::feed::table::FeedTable;
use planner::job::machine::{AxisLimits, OverrideRule};
use protocol::message::{HostMessage, State};
use tests::drives::{asked, bring, player};
use tests::meander::meander;
use tests::tables::{Random, TICK_NS};

const COUNTS_PER_UNIT: f64 = 1e5;
/// q spans of a geometry span.
const SPLIT: usize = 20;

fn target(axes: usize) -> Target {
    let limits = AxisLimits { velocity: 1e4, acceleration: 1e6, jerk: f64::INFINITY };
    Target {
        tick_ns: TICK_NS,
        override_rule: OverrideRule::default(),
        axes: vec![AxisScale { counts_per_unit: COUNTS_PER_UNIT, limits }; axes],
    }
}

/// A wavy motion along a random path.
fn table(seed: u64, axes: usize, geometry_spans: usize) -> FeedTable {
    let mut path = meander(&mut Random::new(seed), axes, geometry_spans, 6.0, 0.5);
    let unit = 2f64.powi(-4) / COUNTS_PER_UNIT;
    for axis in &mut path.axes {
        let scale = axis.lsb / unit;
        axis.controls.iter_mut().for_each(|c| *c = (*c as f64 * scale).round() as i64);
        axis.lsb = unit;
    }
    let mut steps = Vec::new();
    for pair in path.breaks.windows(2) {
        let length = pair[1] - pair[0];
        let knot = |n: usize| (n as u64 * length) / SPLIT as u64;
        steps.extend((0..SPLIT).map(|n| (knot(n + 1) - knot(n)) as u32));
    }
    let code = |n: usize| (40_000.0 + 15_000.0 * (0.02 * n as f64).sin()) as u32;
    let codes = (1..steps.len() - 1).map(code).collect();
    FeedTable { path, steps, q_scale: (100.0f64 / 40_000.0).powi(2) as f32, codes }
}

fn view(packed: &Packed, axis: usize) -> TableView<'_> {
    let part = &packed.axes[axis];
    TableView::new(&packed.header, &part.header, &packed.shared, &part.controls).unwrap()
}

#[test]
fn after_a_million_spans_every_knot_is_where_it_was_planned() {
    let table = table(1, 2, 50_000);
    let packed = pack(&table, 1, &target(2)).unwrap();
    assert_eq!(packed.header.spans, 1_000_000);
    for axis in 0..2 {
        let checked = view(&packed, axis).check().unwrap();
        let mut cursor = Cursor::new(&checked).unwrap();
        let (mut at, mut exact_s, mut geometry) = (0u64, 0.0f64, 0usize);
        let mut worst = [0.0f64; 2];
        for span in 0..table.spans() {
            if geometry + 1 < table.path.breaks.len() && table.path.breaks[geometry + 1] <= at {
                geometry += 1;
            }
            let x = (at - table.path.breaks[geometry]) as f64 * table.path.step;
            let exact = table.path.position(axis, geometry, x) * COUNTS_PER_UNIT;
            let found = cursor.evaluate(&checked, cursor.began()).unwrap();
            assert_eq!(cursor.span() as usize, span);
            worst[0] = worst[0].max((found.position as f64 - exact).abs());
            let began_s = cursor.began() as f64 / (1u64 << 32) as f64;
            worst[1] = worst[1].max((began_s - exact_s).abs());
            exact_s += table.law(span).duration();
            at += u64::from(table.steps[span]);
            // On to the start of the next one.
            let knot = cursor.began() + cursor.duration();
            let _ = cursor.evaluate(&checked, knot).unwrap();
        }
        println!("{worst:?} counts and s, in {exact_s} s");
        assert!(worst[0] <= 1.0, "{} counts", worst[0]);
        // Time goes wrong by less than a part in a million, alike on all axes.
        assert!(worst[1] <= 1e-6 * exact_s, "{} s of {exact_s}", worst[1]);
        let end = cursor.evaluate(&checked, checked.duration()).unwrap();
        assert_eq!((end.position, end.done), (packed.axes[axis].header.end, true));
    }
}

/// `FEEDSPLINE_HOURS` asks for more.
#[test]
fn hours_of_motion_end_on_the_exact_count() {
    let hours = asked("FEEDSPLINE_HOURS", 1);
    let there = table(2, 1, 300);
    let mut back = there.clone();
    let length = back.path.grid_length();
    back.path.breaks = there.path.breaks.iter().rev().map(|knot| length - knot).collect();
    back.path.axes.iter_mut().for_each(|axis| axis.controls.reverse());
    back.steps.reverse();
    back.codes.reverse();
    let mut packed = [there, back].map(|table| pack(&table, 1, &target(1)).unwrap());
    let limits = packed[0].axes[0].header.limits;
    let (mut a, mut b) = (vec![0; 65_536], vec![0; 65_536]);
    let mut drive = player(&packed[0].clone(), 0, limits, &mut a, &mut b);
    let ticks = hours * 3600 * 1_000_000_000 / u64::from(TICK_NS);
    let mut number = 0u32;
    while drive.status().tick < ticks {
        let next = &mut packed[number as usize % 2];
        number += 1;
        next.header.table = number;
        next.axes[0].header.table = number;
        assert!(bring(&mut drive, next, 0));
        let start = drive.status().tick;
        drive.handle(&HostMessage::Start { table: number, tick: start });
        let fill = drive.status().fill;
        assert!(fill > 10_000);
        let mut last = drive.tick();
        while !last.done {
            last = drive.tick();
        }
        let end = next.axes[0].header.end;
        assert_eq!((last.position, drive.status().state), (end, State::Holding));
        assert_eq!(drive.status().tick, start + fill + 1);
    }
    println!("{number} tables in {} h", drive.status().tick * u64::from(TICK_NS) / 3_600_000_000_000);
}

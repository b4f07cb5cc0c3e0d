//! The oracle of path deviation finds what it is meant to find.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use planner::feed::job::{JobItem, PlannedSection};
use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};
use planner::job::program::Item;
use tests::chain::{self, Chain};
use tests::oracle::deviation::{Deviation, Mismatch, measure};

const PROGRAM: &str = "G21 G90 G64 P0.02 F3000\n\
                       G1 X20\n\
                       G3 X20 Y10 J5\n\
                       G1 X0 Z1\n\
                       G2 X0 Y10 Z-2 I-4 P2\n\
                       G1 Y30\n\
                       M5\n\
                       G0 X5 Y5\n\
                       M2\n";

/// A circle and a half turn about different centres, and a rapid, on the sample mill.
fn planned() -> (Machine, Chain) {
    let machine = Machine::from_toml(include_str!("../../jobs/mill3.toml"), "mill").unwrap();
    let set = LimitSet::VelocityAccelerationJerk;
    let chain = chain::plan(PROGRAM.as_bytes(), &machine, &Options::default(), set).unwrap();
    (machine, chain)
}

/// What is measured after a change to the plan.
fn after(change: impl FnOnce(&mut Vec<JobItem>)) -> Result<Deviation, Mismatch> {
    let (machine, chain) = planned();
    let mut plan = chain.plan.items.clone();
    change(&mut plan);
    measure(&chain.items, &plan, &machine, 12)
}

fn section(plan: &mut [JobItem], index: usize) -> &mut PlannedSection {
    let sections = plan.iter_mut().filter_map(|item| match item {
        JobItem::Section(section) => Some(section),
        JobItem::Dwell { .. } | JobItem::Note { .. } => None,
    });
    sections.into_iter().nth(index).unwrap()
}

#[test]
fn a_sound_plan_is_within_its_tolerance_and_not_far_below() {
    let found = after(|_| ()).unwrap();
    assert!(found.share() <= 1.0 && found.from_path > 0.3 && found.from_contour > 0.3, "{found:?}");
    assert!((found.largest_mm / 0.02 - found.share()).abs() < 1e-9, "{found:?}");
}

#[test]
fn a_path_beside_its_contour_is_off_by_the_distance() {
    for (counts, share) in [(2_000, 10.0), (20_000, 100.0)] {
        let found = after(|plan| {
            let axis = &mut section(plan, 0).table.path.axes[2];
            let shift = (f64::from(counts) * 1e-4 / axis.lsb).round() as i64;
            let ends = [0, axis.controls.len() - 1].map(|k| axis.controls[k]);
            axis.controls.iter_mut().for_each(|c| *c += shift);
            let last = axis.controls.len() - 1;
            (axis.controls[0], axis.controls[last]) = (ends[0], ends[1]);
        });
        let found = found.unwrap();
        assert!((found.from_path / share - 1.0).abs() < 0.15, "{found:?}");
        assert!(found.from_contour > 0.85 * share, "{found:?}");
    }
}

#[test]
fn a_bulge_between_its_ends_is_found() {
    let found = after(|plan| {
        let axis = &mut section(plan, 0).table.path.axes[1];
        let middle = axis.controls.len() / 2;
        axis.controls[middle] += (0.1 / axis.lsb) as i64;
    });
    // A control point moves a cubic on even knots by two thirds of its own way.
    assert!((2.0..5.5).contains(&found.clone().unwrap().from_path), "{found:?}");
}

#[test]
fn what_is_left_out_is_named() {
    let found =
        after(|plan| plan.retain(|item| !matches!(item, JobItem::Section(s) if s.marks.blocks[0].line > 6)));
    assert_eq!(found, Err(Mismatch::LeftOut(8)));
    assert_eq!(after(Vec::clear), Err(Mismatch::LeftOut(2)));
    let (machine, chain) = planned();
    // A turn more than the path makes: the plan of the same program without P2 ends on the same counts.
    let once = PROGRAM.replace(" P2", "");
    let set = LimitSet::VelocityAccelerationJerk;
    let other = chain::plan(once.as_bytes(), &machine, &Options::default(), set).unwrap();
    let found = measure(&chain.items, &other.plan.items, &machine, 12).unwrap();
    assert!(found.from_contour > 10.0, "{found:?}");
}

#[test]
fn a_stop_may_not_be_run_over() {
    let (machine, chain) = planned();
    // The same motion, of a program that asks for a rest in the middle of it.
    let mut items = chain.items.clone();
    let third = items.iter().position(|i| matches!(i, Item::Move(m) if m.line == 4)).unwrap();
    items.insert(third, Item::Dwell { seconds: 1.0, line: 4 });
    let found = measure(&items, &chain.plan.items, &machine, 12);
    assert!(matches!(found, Err(Mismatch::LeftOut(_) | Mismatch::NoEnd(_))), "{found:?}");
}

#[test]
fn marks_have_to_cover_the_path() {
    let found = after(|plan| {
        let blocks = &mut section(plan, 0).marks.blocks;
        let last = blocks.len() - 1;
        blocks[last].until -= 1;
    });
    assert_eq!(found, Err(Mismatch::Marks(2)));
}

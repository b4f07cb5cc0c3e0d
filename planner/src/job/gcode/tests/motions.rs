//! Lines, arcs, helices, offsets and positions.

use std::f64::consts::{PI, TAU};

use super::*;
use crate::job::program::{Feed, MoveKind, Shape, StopCause};

fn stops(items: &[Item]) -> Vec<StopCause> {
    items.iter().filter_map(|i| if let Item::Stop { cause, .. } = i { Some(*cause) } else { None }).collect()
}

#[test]
fn modal_motion_units_and_distances() {
    let text = "G20 G0 X1\nG91 Y1\nX1\nG21 G90 X0 Y0";
    assert_eq!(ends(text), [[25.4, 0.0, 0.0], [25.4, 25.4, 0.0], [50.8, 25.4, 0.0], [0.0, 0.0, 0.0]]);
}

#[test]
fn feeds_are_per_second_in_axis_units() {
    let feed = |text| moves(text).last().and_then(|m| m.feed);
    assert_eq!(feed("G21 G1 X1 F600"), Some(Feed::Speed(10.0)));
    assert_eq!(feed("G20 F60 G1 X1"), Some(Feed::Speed(25.4)));
    assert_eq!(feed("G1 X1 F600\nG0 X2"), None);
    assert_eq!(feed("G93 G1 X1 F4"), Some(Feed::Duration(15.0)));
    let ignoring = Options { ignore_feed: true, ..Options::default() };
    let (items, _) = run_on(&mill(), ignoring, "G1 X1").unwrap();
    assert_eq!(only_moves(items)[0].feed, None);
}

#[test]
fn rotary_words_are_degrees_in_inches_too() {
    let (items, counters) =
        run_on(&router(), Options::default(), "G20 F6000 G1 A90\nG1 X1 A180\nX2 F10\n").unwrap();
    let moves = only_moves(items);
    assert_eq!(moves[0].end[3], 90.0);
    assert_eq!(moves[0].feed, Some(Feed::Speed(100.0)), "degrees per second when only A moves");
    assert_eq!(moves[1].feed, Some(Feed::Speed(2540.0)));
    assert!((counters.feed_length_mm - 50.8).abs() < 1e-12, "{counters:?}");
}

#[test]
fn a_helix_counts_its_true_length_and_extremes() {
    let (items, counters) = run("F100 G17 G3 X10 Y0 I5 J0 Z-12 P2\n");
    let moves = only_moves(items);
    let Shape::Arc(arc) = moves[0].shape else { panic!("no arc") };
    assert!((arc.sweep - 3.0 * PI).abs() < 1e-12);
    assert!((counters.feed_length_mm - (15.0 * PI).hypot(12.0)).abs() < 1e-9);
    let extent = counters.bounding_box.unwrap();
    assert!((extent.min[1] + 5.0).abs() < 1e-12 && (extent.max[1] - 5.0).abs() < 1e-12);
    assert_eq!((extent.min[2], extent.max[2]), (-12.0, 0.0));
}

#[test]
fn full_circles_are_not_zero_length() {
    let (items, counters) = run("F100 G2 I10\nG1 X0\nG18 G3 I2 K1\n");
    assert_eq!((counters.arcs, counters.lines, counters.zero_length), (2, 1, 1));
    let lengths = 10.0 * TAU + 5.0_f64.sqrt() * TAU;
    assert!((counters.feed_length_mm - lengths).abs() < 1e-9);
    assert_eq!(only_moves(items).len(), 2);
}

#[test]
fn planes_turn_right_handed() {
    // Counter-clockwise seen against the normal: Z to X, Y to Z.
    let quarter = |text: &str| match moves(text)[0].shape {
        Shape::Arc(arc) => (arc.plane, arc.sweep),
        Shape::Line => panic!("no arc"),
    };
    assert_eq!(quarter("F9 G18 G3 X10 Z-10 K-10").0, [2, 0]);
    assert!((quarter("F9 G18 G3 X10 Z-10 K-10").1 - PI / 2.0).abs() < 1e-12);
    assert!((quarter("F9 G19 G3 Z10 Y-10 J-10").1 - PI / 2.0).abs() < 1e-12);
}

#[test]
fn absolute_centres_follow_the_offsets() {
    let text = "G10 L2 P1 X100\nG0 X10 Y0\nG90.1 F50 G3 X-10 Y0 I0 J0\n";
    let arc = moves(text)[1].shape;
    let Shape::Arc(arc) = arc else { panic!("no arc") };
    assert_eq!(arc.centre, [100.0, 0.0]);
    assert_eq!(arc.radius, 10.0);
}

#[test]
fn offsets_move_the_machine_not_the_program() {
    let text = "G10 L2 P2 X100 Y50\nG55 G0 X1 Y1\nG92 X0\nX2\nG92.2\nX2\nG92.3\nX2\nG92.1\nX2\nG54 X2 Y1\n\
                G10 L20 P1 X7\nX7.5\nG53 G0 X3";
    let xs: Vec<f64> = ends(text).iter().map(|p| p[0]).collect();
    assert_eq!(xs, [101.0, 103.0, 102.0, 103.0, 102.0, 2.0, 2.5, 3.0]);
    let (items, _) = run(text);
    let causes = stops(&items);
    assert_eq!(causes.len(), 8, "{causes:?}");
    assert!(causes[..7].iter().all(|c| *c == StopCause::OffsetChange));
}

#[test]
fn an_offset_that_changes_nothing_is_no_stop() {
    let (items, _) = run("G54 G49 G92.1\nG10 L2 P3 X5\nG0 X1\nM30\n");
    assert_eq!(stops(&items), [StopCause::ProgramEnd]);
}

#[test]
fn tool_length_shifts_z() {
    assert_eq!(
        ends("G43 H3 G0 Z10\nG49 Z10\nT2 M6 G43 Z0")[..],
        [[0.0, 0.0, 18.25], [0.0, 0.0, 10.0], [0.0, 0.0, -12.5]]
    );
}

#[test]
fn stored_positions_are_reached_over_the_programmed_point() {
    let text = "G0 X10 Y10 Z-5\nG91 G28 Z3\nG90 G30\nG0 X1 Y2 Z3\nG28.1\nG0 X5\nG28\n";
    assert_eq!(
        ends(text)[1..],
        [
            [10.0, 10.0, -2.0],
            [10.0, 10.0, 150.0],
            [-350.0, 250.0, 150.0],
            [1.0, 2.0, 3.0],
            [5.0, 2.0, 3.0],
            [1.0, 2.0, 3.0]
        ]
    );
}

#[test]
fn tiny_steps_are_dropped_but_not_lost() {
    let mut text = String::from("G91 F100\n");
    for _ in 0..40 {
        text += "G1 X0.0000000001\n";
    }
    let (items, counters) = run(&text);
    assert_eq!(counters.lines, 40);
    let moves = only_moves(items);
    assert_eq!(moves.len() as u64 + counters.zero_length, 40);
    assert!((moves.last().unwrap().end[0] - 4e-9).abs() < 1e-9);
}

#[test]
fn a_full_circle_after_a_dropped_step_is_still_full() {
    let (_, counters) = run("F100 G1 X10\nX10.0000000001\nG3 X10.0000000001 I5\n");
    assert_eq!(counters.zero_length, 1);
    assert!((counters.feed_length_mm - 10.0 - 10.0 * PI).abs() < 1e-6);
}

#[test]
fn stops_and_dwells_in_their_order() {
    let text = "T1 M6\nS1000 M3\nG0 X1\nS1200\nG4 P0.5\nG1 X2 F100 M0\nM5\nM2\nG0 X99999\n";
    let (items, counters) = run(text);
    let causes = stops(&items);
    use StopCause as S;
    assert_eq!(causes, [S::ToolChange, S::Spindle, S::Spindle, S::ProgramStop, S::Spindle, S::ProgramEnd]);
    assert_eq!((counters.dwells, counters.dwell_s, counters.stops), (1, 0.5, 6));
    let kinds: Vec<_> = only_moves(items).iter().map(|m| m.kind).collect();
    assert_eq!(kinds, [MoveKind::Rapid, MoveKind::Feed]);
}

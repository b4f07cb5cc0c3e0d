//! Path control, notes, tape marks.

use super::*;
use crate::job::program::{Corner, ToleranceSource as By};

fn corners(options: Options, text: &str) -> Vec<Corner> {
    let (items, _) = run_on(&mill(), options, text).unwrap();
    only_moves(items).iter().map(|m| m.corner).collect()
}

fn within(tolerance_mm: f64, source: By) -> Corner {
    Corner::Within { tolerance_mm, source }
}

const MODES: &str = "G21 G0 X1\nG64 X2\nG64 P0.02 X3\nG20 G64 P0.001 Q0.002 X0.2\nG21 G64 P0 X5\n\
                     G61 X6\nG61.1 X7\nG64 P1 X8\nG9 X9\nX10\n";

#[test]
fn who_sets_the_tolerance() {
    let expected = [
        within(0.01, By::Machine),
        within(0.05, By::BestSpeed),
        within(0.02, By::Program),
        within(0.0254, By::Program),
        Corner::Exact,
        Corner::Exact,
        Corner::Stop,
        within(1.0, By::Program),
        Corner::Stop,
        within(1.0, By::Program),
    ];
    for (found, expected) in corners(Options::default(), MODES).into_iter().zip(expected) {
        assert_eq!(found, expected);
    }
    let (items, _) = run(MODES);
    let notes = notes(&items);
    for beginning in ["G64 without P: 0.05 mm", "G64 Q", "G64 P0"] {
        assert_eq!(notes.iter().filter(|n| n.starts_with(beginning)).count(), 1, "{notes:?}");
    }
}

#[test]
fn the_command_line_overrides_every_blend() {
    let options = Options { tolerance_mm: Some(0.3), ..Options::default() };
    let found = corners(options, MODES);
    let blend = within(0.3, By::CommandLine);
    assert_eq!(found[..4], [blend; 4]);
    assert_eq!(found[5..], [Corner::Exact, Corner::Stop, blend, Corner::Stop, blend]);
}

#[test]
fn units_are_assumed_aloud() {
    assert_eq!(notes(&run("G0 X1\nX2").0), ["no G20 or G21: millimetres are assumed"]);
    assert!(notes(&run("G21 G0 X1").0).is_empty());
}

#[test]
fn messages_tools_and_operations_are_noted() {
    let text = "%\nO0042 (bracket)\nG21\n(header)\n(pocket)\nG0 X1\nG1 X2 F100\n(not an operation: in the cut)\n\
                X3 (MSG, look)\nT3 M6\n; slot\nG0 X0\n%\nG0 X77777\n";
    let (items, counters) = run(text);
    assert_eq!(notes(&items), ["program 42", "pocket", "look", "tool 3", "slot"]);
    assert_eq!(counters.blocks, 7);
}

#[test]
fn blocks_with_a_slash_are_executed_unless_switched_off() {
    let text = "G21 G0 X1\n/X2\n/1 X3\n";
    assert_eq!(ends(text).len(), 3);
    let (items, _) = run_on(&mill(), Options { block_delete: true, ..Options::default() }, text).unwrap();
    assert_eq!(notes(&items), ["blocks marked / skipped, 2 times"]);
    assert_eq!(only_moves(items).len(), 1);
}

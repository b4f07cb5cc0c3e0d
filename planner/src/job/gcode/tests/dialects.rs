//! The printer dialect.

use super::*;
use crate::job::program::Item;

const PRINT: &str = "; sliced\nM104 S210\nM140 S60 ; bed\nG28\nG28 X Y\nG92 E0\nG21\nM83\nG1 F1800\n\
                     G1 X10 Y10 E0.5 F1200\nG1 E-1 F2400\nM117 Printing 10% (done\nG1 X20 E.4\nM104 S0\nM84 X Y E\n";

fn print() -> Options {
    Options { dialect: Dialect::Printer, ..Options::default() }
}

#[test]
fn printer_codes_are_skipped_and_listed() {
    let (items, counters) = run_on(&mill(), print(), PRINT).unwrap();
    let notes = notes(&items);
    for said in
        ["M104 skipped, 2 times", "M83 skipped, once", "M117 skipped, once", "E words skipped, 4 times"]
    {
        assert!(notes.contains(&said), "{notes:?}");
    }
    assert_eq!(counters.lines, 2);
    assert!(matches!(items.last(), Some(Item::Stop { .. })));
}

#[test]
fn printer_codes_are_errors_elsewhere() {
    let error = refused(PRINT);
    assert_eq!((error.line(), error.column()), (Some(2), Some(1)));
    assert!(error.kind().help().contains("--dialect printer"));
    let error = refused("G1 X1 E2 F100");
    assert_eq!(error.kind(), &ErrorKind::UnknownWord { letter: 'E' });
}

#[test]
fn printer_dwells_are_milliseconds() {
    let (_, counters) = run_on(&mill(), print(), "G4 P500\nG4 S2\nG0 X1").unwrap();
    assert_eq!(counters.dwell_s, 2.5);
}

#[test]
fn what_moves_or_waits_is_not_skipped() {
    for text in ["G1 X1 F60\nM600", "G5 X1 F60", "G1 X Y1 F60", "M104 S200 G1 X1 F60"] {
        assert!(run_on(&mill(), print(), text).is_err(), "{text}");
    }
}

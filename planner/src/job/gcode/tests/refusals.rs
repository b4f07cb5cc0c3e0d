//! What is refused, and where.

use std::io::Read;

use miette::Diagnostic;

use super::*;

/// Program, line, column, start of the message.
const REFUSED: &[(&str, u32, u32, &str)] = &[
    ("", 1, 1, "the program has no motion"),
    ("G21\nM30\n", 2, 1, "the program has no motion"),
    ("(nothing)\n\n", 2, 1, "the program has no motion"),
    ("G0 X", 1, 4, "X has no number"),
    ("G0 X1 Y-", 1, 7, "the number of Y cannot be read"),
    ("G0 X1.2.3", 1, 4, "the number of X cannot be read"),
    ("G0 X1-2", 1, 4, "the number of X cannot be read"),
    ("G0 X1 (open", 1, 7, "comment is not closed"),
    ("G0 X1 (a (b) c)", 1, 10, "comment inside a comment"),
    ("G0 X#1", 1, 5, "parameters (#)"),
    ("#1=5", 1, 1, "parameters (#)"),
    ("G0 X[1+2]", 1, 5, "expressions"),
    ("G0 X1\nO100 sub", 2, 1, "O-words"),
    ("O100 sub", 1, 1, "O-words"),
    ("o<part> call", 1, 1, "O-words"),
    ("N10 G1 X1*57", 1, 10, "checksum is 57"),
    ("G1 X1*", 1, 6, "checksum cannot be read"),
    ("G0 X1 X2", 1, 7, "X occurs twice"),
    ("G0 X1 !", 1, 7, "unexpected '!'"),
    ("G0 X1 \u{e9}", 1, 7, "binary data (byte 0xc3)"),
    ("G41 D1", 1, 1, "G41 is not supported"),
    ("G21 G5.1 X1", 1, 5, "G5.1 is not supported"),
    ("G33 Z1 K1", 1, 1, "G33 is not supported"),
    ("G38.2 Z-1 F10", 1, 1, "G38.2 is not supported"),
    ("G95 G1 X1 F1", 1, 1, "G95 is not supported"),
    ("M98 P1", 1, 1, "M98 is not supported"),
    ("G1.25 X1", 1, 1, "G1.25 is not a code"),
    ("G0 G1 X1", 1, 4, "G0 and G1 exclude"),
    ("G17 G18", 1, 5, "G17 and G18 exclude"),
    ("M3 M4", 1, 4, "M3 and M4 exclude"),
    ("G28 G1 X1", 1, 5, "G28 and G1 both take"),
    ("G0 B5", 1, 4, "the machine has no axis B"),
    ("X1", 1, 1, "axis word X without a motion mode"),
    ("G0 X1\nG80\nX2", 3, 1, "axis word X without a motion mode"),
    ("T-1", 1, 1, "T is -1, below zero"),
    ("T1.5 M6", 1, 1, "T is 1.5, not a whole number"),
    ("S-5", 1, 1, "S is -5, below zero"),
    ("F-5", 1, 1, "F is -5, below zero"),
    ("G4", 1, 1, "G4 needs a word P"),
    ("G4 P-1", 1, 4, "P is -1, below zero"),
    ("G0 X1 P3", 1, 7, "word P is not used"),
    ("G0 X1 D3", 1, 7, "word D is not used"),
    ("G0 X1 H3", 1, 7, "word H is not used"),
    ("G43 H9", 1, 5, "tool 9 is not in the tool table"),
    ("G10 P1 X1", 1, 1, "G10 needs a word L"),
    ("G10 L1 P1 X1", 1, 5, "L is 1, not in"),
    ("G10 L2 P11 X1", 1, 8, "P is 11, not in"),
    ("G92", 1, 1, "G92 needs a word X"),
    ("G1 X1", 1, 1, "no feed rate is set"),
    ("F0 G1 X1", 1, 4, "feed rate is zero"),
    ("F100\nG94 G1 X1\nG93 X2", 3, 5, "inverse time feed"),
    ("G93 F5 G1 X1\nG94 X2", 2, 5, "no feed rate is set"),
    ("G0 X401", 1, 4, "axis X would move to 401.0000 mm, outside its travel -400 to 400 mm"),
    ("G91 G0 X300\nX300", 2, 1, "axis X would move to 600"),
    ("G20 G1 F5 Y12", 1, 11, "axis Y would move to 304.8"),
    ("F50 G0 X390\nG3 X390 Y40 R20", 2, 4, "axis X would move to 410"),
    ("F50 G2 X10 I4", 1, 5, "arc end radius 6.0000 differs from start radius 4.0000 by 2.0000 mm"),
    ("F50 G2 X10 R4", 1, 5, "arc radius 4.0000 mm is too small: the end is 10.0000 mm away"),
    ("F50 G2 X10", 1, 5, "arc has neither centre (I J) nor"),
    ("F50 G18 G2 X10", 1, 9, "arc has neither centre (I K) nor"),
    ("F50 G2 X10 R0", 1, 5, "arc radius is zero"),
    ("F50 G2 X1 I99999999", 1, 5, "arc radius 9.9999999e7 mm is too large"),
    ("F50 G2 X1 R99999999", 1, 5, "arc radius 9.9999999e7 mm is too large"),
    ("F9999999999999 G1 X1", 1, 1, "the number of F is too large"),
    ("G93 F0.0000000000001 G1 X1", 1, 5, "feed rate is zero"),
    ("F50 G2 X10 I0 J0", 1, 5, "arc radius is zero"),
    ("F50 G2 X0 Y0 R3", 1, 5, "arc given by R ends where it starts"),
    ("F50 G2 X10 I5 R5", 1, 15, "arc has both"),
    ("F50 G2 X10 K5", 1, 12, "K is outside the arc's plane (G17)"),
    ("F50 G90.1 G2 X10 I5", 1, 11, "absolute arc centre (G90.1) lacks J"),
    ("F50 G2 X10 I5 P0", 1, 15, "P is 0, not in 1"),
    ("F50 G2 X10 I5 G53", 1, 15, "G53 needs G0 or G1"),
    ("G91 G53 G0 X1", 1, 5, "G53 cannot"),
    ("F50 G81 X1 Z-1", 1, 5, "G81 needs a word R"),
    ("F50 G81 X1 R1", 1, 5, "G81 needs a word Z"),
    ("F50 G83 X1 Z-1 R1", 1, 5, "G83 needs a word Q"),
    ("F50 G82 X1 Z-1 R1", 1, 5, "G82 needs a word P"),
    ("F50 G81 X1 Z3 R1", 1, 5, "cycle bottom 3.0000 is above"),
    ("F50 G81 X1 Z-1 R1 L0", 1, 19, "L is 0, not in 1"),
    ("F50 G81 X1 Z-1 R1 C5", 1, 19, "axis word C in a drilling cycle"),
    ("G93 F50 G81 X1 Z-1 R1", 1, 9, "drilling cycle with inverse time"),
    ("F50 G0 Z5\nG81 X1 Z-201 R1", 2, 8, "axis Z would move to -201"),
    ("F50 G87 X1 Z-1 R1", 1, 5, "G87 is not supported"),
];

#[test]
fn every_mistake_has_its_place_and_help() {
    for &(text, line, column, message) in REFUSED {
        let error = refused(text);
        assert_eq!((error.line(), error.column()), (Some(line), Some(column)), "{text:?}: {error}");
        let shown = error.to_string();
        let start = format!("part.ngc:{line}:{column}: {message}");
        assert!(shown.starts_with(&start), "{text:?}: {shown}");
        assert!(error.help().is_some_and(|h| !h.to_string().is_empty()), "{text:?}");
    }
}

#[test]
fn long_numbers_are_refused_not_overflowed() {
    let nines = "9".repeat(400);
    let zeros = "0".repeat(400);
    for text in [format!("G0 X{nines}"), format!("F1 G2 X1 I{nines}"), format!("G93 F0.{zeros}1 G1 X1")] {
        refused(&text);
    }
    assert_eq!(ends(&format!("G0 X0.{zeros}1Y1")), [[0.0, 1.0, 0.0]]);
}

#[test]
fn nothing_of_a_wrong_block_is_handed_on() {
    let text = "G21 G0 X1\nG4 P1 M3 G0 X2 X3\nG0 X4";
    let mut program = Program::new(text.as_bytes(), "part.ngc", &mill(), Options::default());
    assert!(matches!(program.next(), Some(Ok(Item::Move(_)))));
    assert!(matches!(program.next(), Some(Err(_))));
    assert!(program.next().is_none());
}

#[test]
fn the_snippet_is_one_line_with_its_number() {
    let mut shown = String::new();
    let long = format!("{}G0 X1\nG1 F5 X2\nG1 X9999 ({})", "\n".repeat(6), "x".repeat(5000));
    let error = refused(&long);
    miette::NarratableReportHandler::new().render_report(&mut shown, &error).unwrap();
    assert!(shown.contains("part.ngc"), "{shown}");
    assert!(shown.contains("line 9"), "{shown}");
    assert!(shown.contains("G1 X9999") && !shown.contains("G1 F5"), "{shown}");
    assert!(shown.len() < 1000, "{}", shown.len());
}

#[test]
fn garbage_without_end_is_refused_at_once() {
    let zeros = std::io::BufReader::new(std::io::repeat(0));
    let mut program = Program::new(zeros, "zeros", &mill(), Options::default());
    let error = program.next().unwrap().unwrap_err();
    assert_eq!((error.kind(), error.line()), (&ErrorKind::Binary { byte: 0 }, Some(1)));
    let mut shown = String::new();
    miette::NarratableReportHandler::new().render_report(&mut shown, &error).unwrap();
    assert!(!shown.contains('\0'));
    let digits = std::io::BufReader::new((&b"G1 X"[..]).chain(std::io::repeat(b'7')));
    let error = Program::new(digits, "digits", &mill(), Options::default()).next().unwrap().unwrap_err();
    assert!(matches!(error.kind(), ErrorKind::LineTooLong { .. }));
}

#[test]
fn folders_and_missing_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = open(folder.path(), &mill(), Options::default()).unwrap_err();
    assert_eq!(error.kind(), &ErrorKind::Directory);
    let missing = folder.path().join("missing.ngc");
    let error = open(&missing, &mill(), Options::default()).unwrap_err();
    assert!(error.to_string().contains("missing.ngc: cannot be read"), "{error}");
}

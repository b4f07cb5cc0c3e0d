//! Drilling cycles, move by move.

use super::*;
use crate::job::program::MoveKind;

/// `r` or `f` and the end of every move.
fn steps(text: &str) -> Vec<(char, [f64; 3])> {
    let kind = |m: &Move| if m.kind == MoveKind::Rapid { 'r' } else { 'f' };
    moves(text).iter().map(|m| (kind(m), [m.end[0], m.end[1], m.end[2]])).collect()
}

#[test]
fn drilling_returns_to_the_first_level_or_to_r() {
    let holes = "G0 Z20\nG98 G81 X10 Y5 Z-3 R2 F100\nG99 X20\nG80\nG0 Z20";
    assert_eq!(
        steps(holes),
        [
            ('r', [0.0, 0.0, 20.0]),
            ('r', [10.0, 5.0, 20.0]),
            ('r', [10.0, 5.0, 2.0]),
            ('f', [10.0, 5.0, -3.0]),
            ('r', [10.0, 5.0, 20.0]),
            ('r', [20.0, 5.0, 20.0]),
            ('r', [20.0, 5.0, 2.0]),
            ('f', [20.0, 5.0, -3.0]),
            ('r', [20.0, 5.0, 2.0]),
            ('r', [20.0, 5.0, 20.0]),
        ]
    );
    assert_eq!(run(holes).1.holes, 2);
}

#[test]
fn repeats_march_in_incremental_mode() {
    let text = "G0 X1 Y1 Z5\nG91 G99 G81 X10 Z-4 R-3 L3 F100\n";
    let bottoms: Vec<_> = steps(text).into_iter().filter(|s| s.0 == 'f').map(|s| s.1).collect();
    assert_eq!(bottoms, [[11.0, 1.0, -2.0], [21.0, 1.0, -2.0], [31.0, 1.0, -2.0]]);
}

#[test]
fn pecks_come_out_and_go_back_near_the_bottom() {
    let text = "G0 Z5\nG83 X0 Y0 Z-5 R1 Q2.5 F100\n";
    assert_eq!(
        steps(text)[1..],
        [
            ('r', [0.0, 0.0, 1.0]),
            ('f', [0.0, 0.0, -1.5]),
            ('r', [0.0, 0.0, 1.0]),
            ('r', [0.0, 0.0, -1.246]),
            ('f', [0.0, 0.0, -4.0]),
            ('r', [0.0, 0.0, 1.0]),
            ('r', [0.0, 0.0, -3.746]),
            ('f', [0.0, 0.0, -5.0]),
            ('r', [0.0, 0.0, 5.0]),
        ]
    );
    let chips = "G0 Z5\nG73 X0 Y0 Z-5 R1 Q2.5 F100\n";
    assert_eq!(steps(chips)[3], ('r', [0.0, 0.0, -1.246]));
}

#[test]
fn a_start_below_r_rises_before_it_travels() {
    assert_eq!(steps("G0 Z-1\nG81 X4 Z-2 R3 F10")[1..3], [('r', [0.0, 0.0, 3.0]), ('r', [4.0, 0.0, 3.0])]);
}

#[test]
fn boring_and_tapping_leave_as_their_codes_say() {
    let back = |code: &str| {
        let (items, counters) = run(&format!("G21 G0 Z5\n{code} X1 Z-2 R1 P0.25 F60\nM2"));
        let kinds: String =
            only_moves(items).iter().map(|m| if m.kind == MoveKind::Rapid { 'r' } else { 'f' }).collect();
        (kinds, counters.dwells, counters.stops)
    };
    assert_eq!(back("G82"), ("rrrfr".into(), 1, 1));
    assert_eq!(back("G84"), ("rrrffr".into(), 1, 3));
    assert_eq!(back("G86"), ("rrrfr".into(), 1, 3));
    assert_eq!(back("G89"), ("rrrffr".into(), 1, 1));
    let bored = run("G21 G0 Z5\nG85 X1 Z-2 R1 F60 M30").1;
    assert_eq!((bored.lines, bored.dwells), (2, 0));
}

#[test]
fn cycles_follow_the_plane_the_offsets_and_the_stop_of_their_block() {
    let text = "G10 L2 P1 Y100\nG0 Y10\nG18 G99 G81 X5 Z6 Y-3 R2 F10 M2\nG0 X999999";
    assert_eq!(
        steps(text)[1..],
        [
            ('r', [5.0, 110.0, 6.0]),
            ('r', [5.0, 102.0, 6.0]),
            ('f', [5.0, 97.0, 6.0]),
            ('r', [5.0, 102.0, 6.0]),
        ]
    );
}

#[test]
fn a_million_pecks_are_refused_and_many_are_lazy() {
    let error = refused("G81 X1 Z-1 R0 F1\nG83 X1 Z-100 R0 Q0.0001 F100");
    assert!(matches!(error.kind(), ErrorKind::TooManyPecks { .. }), "{error}");
    let text = "G21 G83 X1 Z-100 R0 Q0.01 F100 L100000";
    let mut program = Program::new(text.as_bytes(), "part.ngc", &mill(), Options::default());
    for _ in 0..20_000 {
        assert!(program.next().unwrap().is_ok());
        assert!(program.queue.len() < 8);
    }
}

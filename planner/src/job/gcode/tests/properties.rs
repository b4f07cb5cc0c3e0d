//! Laws over random programs.

use proptest::prelude::*;

use super::*;
use crate::job::program::{Feed, Shape};

/// Bytes that programs are made of, so that random ones get past the first word.
const ALPHABET: &[u8] = b"GMXYZIJKRFPQLSTNOE0123456789.+-*/%()#[];= \t\n\r\ngxy\xff\x00AB";

/// Lines of words that exist.
fn word_salad() -> impl Strategy<Value = String> {
    let word = (prop::sample::select(ALPHABET[..17].to_vec()), -20i32..130, prop::bool::ANY).prop_map(
        |(letter, number, tenth)| {
            let number = f64::from(number) / if tenth { 10.0 } else { 1.0 };
            format!("{}{number} ", char::from(letter))
        },
    );
    let line = prop::collection::vec(word, 1..6).prop_map(|words| words.concat() + "\n");
    prop::collection::vec(line, 1..30).prop_map(|lines| format!("G21 F100\n{}", lines.concat()))
}

/// Every item must be finite, every move must start where the one before it ended, arcs must meet their ends.
fn check(bytes: &[u8], dialect: Dialect) {
    let options = Options { dialect, ..Options::default() };
    let mut program = Program::new(bytes, "part.ngc", &mill(), options);
    let mut last = [0.0; 9];
    let mut errors = 0;
    for item in (&mut program).take(5_000) {
        match item {
            Ok(Item::Move(m)) => {
                assert_eq!(m.start, last);
                assert!(m.start != m.end || m.shape != Shape::Line);
                assert!(m.end.iter().all(|v| v.is_finite()));
                assert!(
                    !matches!(m.feed, Some(Feed::Speed(v) | Feed::Duration(v)) if !(v > 0.0 && v.is_finite()))
                );
                if let Shape::Arc(a) = m.shape {
                    let (r, angle) = (a.radius + a.radius_change, a.start_angle + a.sweep);
                    let end = [a.centre[0] + r * angle.cos(), a.centre[1] + r * angle.sin()];
                    let size = 1e3 + a.radius + a.sweep.abs() * a.radius;
                    for (axis, value) in a.plane.into_iter().zip(end) {
                        assert!((m.end[axis] - value).abs() < 1e-12 * size, "{m:?}");
                    }
                }
                last = m.end;
            }
            Ok(Item::Dwell { seconds, .. }) => assert!(seconds >= 0.0 && seconds.is_finite()),
            Ok(_) => {}
            Err(error) => {
                errors += 1;
                assert!(!error.to_string().is_empty());
            }
        }
    }
    assert!(errors <= 1);
    let c = program.counters();
    assert!(c.feed_length_mm.is_finite() && c.rapid_length_mm.is_finite());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        check(&bytes, Dialect::Rs274);
    }

    #[test]
    fn random_text_never_panics(
        picks in prop::collection::vec(prop::sample::select(ALPHABET.to_vec()), 0..200), printer: bool,
    ) {
        check(&picks, if printer { Dialect::Printer } else { Dialect::Rs274 });
    }

    #[test]
    fn random_words_never_panic(text in word_salad()) {
        check(text.as_bytes(), Dialect::Rs274);
    }

    #[test]
    fn written_lines_come_back_to_the_bit(
        points in prop::collection::vec(prop::array::uniform3(-150.0..150.0f64), 1..40),
        style in 0..4u8,
    ) {
        let mut text = String::from("G21 G90\nF600\n");
        for [x, y, z] in &points {
            text += &match style {
                0 => format!("G1 X{x} Y{y} Z{z}\n"),
                1 => format!("g1x{x}y{y}z{z}\r\n"),
                2 => format!("\tG 01 Z {z}  (c) Y{y} X{x} ; tail\n"),
                _ => {
                    let body = format!("N7.5 G1 X{x} Y{y} Z{z}");
                    let sum = body.bytes().fold(0, |s, b| s ^ b);
                    format!("{body}*{sum}\n")
                }
            };
        }
        prop_assert_eq!(ends(&text), points);
    }

    #[test]
    fn a_program_does_not_change_when_its_numbers_are_spaced_out(x in -300.0..300.0f64) {
        let spaced: String = format!("{x:.4}").chars().flat_map(|c| [c, ' ']).collect();
        prop_assert_eq!(ends(&format!("G0 X{spaced}Y1")), ends(&format!("G0 X{x:.4} Y1")));
    }
}

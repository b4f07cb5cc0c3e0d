use super::*;

fn block(line: &[u8]) -> Block {
    let mut block = Block::new();
    block.read(line, Dialect::Rs274, false).unwrap_or_else(|e| panic!("{:?}: {}", line, e.kind));
    block
}

#[test]
fn numbers_are_read_to_the_last_bit() {
    for text in ["1234.56789", "-0.1", "+7", "5.", ".5", "-.25", "0.30000000000000004", "1e3"] {
        let mut b = Block::new();
        let line = format!("X{text}");
        let read = b.read(line.as_bytes(), Dialect::Printer, false);
        if text == "1e3" {
            // No exponents in RS-274: X1 and E3.
            assert!(read.is_ok());
            assert_eq!((b.peek(b'X'), b.peek(b'E')), (Some(1.0), Some(3.0)));
        } else {
            assert_eq!(b.peek(b'X'), Some(text.parse().unwrap()));
        }
    }
}

#[test]
fn case_spaces_and_comments_do_not_matter() {
    let b = block(b"  g0 1 x - 1 . 5 (\xff\xfe any bytes) y\t2;z3");
    assert_eq!(b.code(Group::Motion).map(|w| w.code), Some(Code::g(10)));
    assert_eq!((b.peek(b'X'), b.peek(b'Y'), b.peek(b'Z')), (Some(-1.5), Some(2.0), None));
    assert_eq!(b.comment, Some(36..38));
}

#[test]
fn words_know_their_columns() {
    let b = block(b"N10.5 G1 X1.5 Y-2*54");
    assert_eq!(b.peek(b'N'), Some(10.5));
    let fault = b.fault(b'Y', ErrorKind::NoFeed);
    assert_eq!((fault.column, fault.length), (14, 3));
}

#[test]
fn each_word_is_used_once() {
    let mut b = block(b"G4 P1 X2");
    assert_eq!((b.take(b'P'), b.take(b'P'), b.peek(b'P')), (Some(1.0), None, Some(1.0)));
    assert_eq!(b.check_all_used().map_err(|f| f.kind), Err(ErrorKind::UnusedWord { letter: 'X' }));
}

#[test]
fn mist_and_flood_may_be_together() {
    let b = block(b"M7 M8 M3 G0");
    assert!(b.code(Group::Mist).is_some() && b.code(Group::Coolant).is_some());
}

#[test]
fn a_program_number_stands_alone_in_the_first_block() {
    let mut b = Block::new();
    assert!(b.read(b"O1000 (part)", Dialect::Rs274, true).is_ok());
    assert_eq!(b.program_number, Some(1000.0));
    assert!(b.read(b"O1000", Dialect::Rs274, false).is_err());
    assert!(b.read(b"O1000 G1", Dialect::Rs274, true).is_err());
}

use super::*;

use protocol::bus::{FrameSize, Segments};
use protocol::message::{MessageBuffer, encode};

fn said(frames: &[&str]) -> Vec<(Kind, Option<u8>, String)> {
    let mut decoder = Decoder::new();
    let each = frames.iter().map(|frame| {
        let text = format!("(1.000000) can0 {frame}");
        let Decoded { kind, node, text } = decoder.frame(&line(&text).unwrap().frame.unwrap());
        (kind, node, text)
    });
    each.collect()
}

fn one(frame: &str) -> (Kind, Option<u8>, String) {
    said(&[frame]).remove(0)
}

#[test]
fn pinned_frames_are_put_in_words() {
    for (frame, kind, node, text) in [
        ("000#0200", Kind::Nmt, None, "stop, to all"),
        ("000#8103", Kind::Nmt, Some(3), "reset: quick stop, to one"),
        ("010#", Kind::Stop, None, "as fast as each axis can"),
        ("010#00", Kind::Stop, None, "on the path, the drives agree when"),
        ("010#0004030201", Kind::Stop, None, "on the path from tick 16909060 on"),
        ("010#02", Kind::Stop, None, "without torque"),
        ("080#07", Kind::Sync, None, "number 7"),
        ("012#0705040302EFCDAB", Kind::Time, None, "number 7 ended at tick 33752069 and 11259375 ns"),
        (
            "082#01FF010404030201",
            Kind::Emergency,
            Some(2),
            "code ff01, told to stop, stop from tick 16909060 on",
        ),
        ("701#00", Kind::Boot, Some(1), "started up"),
        ("701#05", Kind::Other, Some(1), "heartbeat 701#05"),
        ("301#0100A00506070809", Kind::Data, Some(1), "table ..a, 5 bytes from unit 1"),
        ("300##10100A005060708090A", Kind::Data, None, "table ..a, 9 bytes from unit 1"),
        ("601#4000100000000000", Kind::Other, None, "601#4000100000000000"),
        ("285#F0", Kind::Broken, Some(5), "no beat: 285#f0"),
        ("012#00", Kind::Broken, None, "no time: 012#00"),
    ] {
        assert_eq!(one(frame), (kind, node, text.to_owned()), "{frame}");
    }
    let (kind, node, text) = one("285#B4120903FE341206");
    assert_eq!((kind, node), (Kind::Beat, Some(5)));
    assert_eq!(text, "running, operation enabled, epoch ..03 open, room for 1, 4660 ms to go, table ..08");
}

/// Frames of a message as a log has them.
fn frames(id: u16, epoch: u16, message: &HostMessage<'_>) -> Vec<Frame> {
    let mut buffer: MessageBuffer = [0; _];
    let bytes = encode(message, &mut buffer).unwrap();
    Segments::new(id, FrameSize::Classic, epoch, bytes).unwrap().collect()
}

#[test]
fn blocks_are_put_together_with_their_epoch_each_identifier_by_itself() {
    let all = frames(0x200, 7, &HostMessage::Identify);
    let one = frames(0x203, 7, &HostMessage::Begin { boot: 5, members: 1 | 1 << 99 });
    assert!(one.len() > all.len());
    let mut decoder = Decoder::new();
    let mixed = one.iter().zip(all.iter().map(Some).chain(std::iter::repeat(None)));
    let mixed = mixed.flat_map(|(a, b)| [Some(a), b]).flatten();
    let told: Vec<Decoded> = mixed.map(|f| decoder.frame(f)).filter(|d| d.kind != Kind::Part).collect();
    let text = |k: usize| (told[k].kind, told[k].node, told[k].text.as_str());
    assert_eq!(text(0), (Kind::Command, None, "epoch 7: Identify"));
    assert_eq!(text(1), (Kind::Command, Some(3), "epoch 7: Begin { boot: 5, nodes: 1 100 }"));
    assert_eq!(told.len(), 2);
}

#[test]
fn broken_blocks_say_what_is_wrong_with_them() {
    let told = said(&["182#01AA", "182#80010001", "182#42", "182#C1"]);
    let kinds: Vec<Kind> = told.iter().map(|(kind, ..)| *kind).collect();
    assert_eq!(kinds, [Kind::Broken, Kind::Part, Kind::Broken, Kind::Broken]);
    assert_eq!(told[0].2, "a frame of a block whose beginning was not seen");
    assert_eq!(told[2].2, "frame 2 of a block where 1 should follow");
}

#[test]
fn names_of_kinds_differ() {
    let mut names: Vec<&str> = Kind::ALL.iter().map(|kind| kind.name()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), Kind::ALL.len());
}

#[test]
fn lines_are_those_of_candump() {
    let read = line("(12.000075) can0 07F#DEAD").unwrap();
    assert_eq!((read.time, read.interface, read.id), (12_000_075_000, "can0", "07F"));
    assert_eq!(read.frame, Frame::new(0x7f, &[0xde, 0xad]));
    let fd = line("(1436509052.249713) vcan0 044##12A366C2BBA000000 R").unwrap();
    assert_eq!(fd.frame, Frame::new(0x44, &[0x2a, 0x36, 0x6c, 0x2b, 0xba, 0, 0, 0]));
    for foreign in
        ["(1.0) can0 12345678#00", "(1.0) can0 123#R", "(1.0) can0 123#R8", "(1.0) c 20000004#0001"]
    {
        assert_eq!(line(foreign).map(|read| read.frame), Ok(None), "{foreign}");
    }
}

#[test]
fn lines_that_are_none_say_where_and_what_was_expected() {
    for (text, column, expected) in [
        ("", 1, "a time"),
        ("1.0 can0 123#00", 1, "a time"),
        ("(1) can0 123#00", 1, "a time"),
        ("(99999999999999999999.0) can0 123#00", 1, "a time"),
        ("(1.0)", 6, "the name of an interface"),
        ("(1.0) 123#00 x", 7, "the name of an interface"),
        ("(1.0) can0", 11, "a frame"),
        ("(1.0) can0 123", 12, "a frame"),
        ("(1.0) can0 1234#00", 12, "an identifier"),
        ("(1.0) can0 FFF#00", 12, "an identifier"),
        ("(1.0) can0 +12#00", 12, "an identifier"),
        ("(1.0) can0 #00", 13, "an identifier"),
        ("(1.0) can0 123#0", 16, "data"),
        ("(1.0) can0 123#0x", 16, "data"),
        ("(1.0) can0 123#001122334455667788", 16, "data"),
        ("(1.0) can0 123##", 16, "data"),
        ("(1.0) can0 123#00 what", 19, "nothing"),
        ("(1.0) can0 é23#00", 12, "an identifier"),
    ] {
        let error = line(text).unwrap_err();
        assert_eq!(error.column, column, "{text}: {error}");
        assert!(error.to_string().starts_with(&format!("expected {expected}")), "{text}: {error}");
    }
}

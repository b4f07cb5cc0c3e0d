//! Bodies for everything that reads bytes of others.

use firmware_core::evaluate::Cursor;
use firmware_core::table::TableView;
use planner::feed::file::FeedReader;
use protocol::bus::beat::Beat;
use protocol::bus::emergency::Emergency;
use protocol::bus::slcan::{self, Line, Reader};
use protocol::bus::stop::Stop;
use protocol::bus::sync::{self, Stamp, Time};
use protocol::bus::{BLOCK_BYTES, Frame, FrameSize, MESSAGE_BYTES, Node, Reassembler, Segments, data};
use protocol::message::{DriveMessage, HostMessage, MessageBuffer, decode, encode};
use protocol::table::{AxisHeader, TableHeader, control, geometry, span};
use protocol::varint as numbers;

/// Frames of every kind: what is read is written alike.
pub fn frame(bytes: &[u8]) {
    let [low, high, bytes @ ..] = bytes else { return };
    let id = u16::from_le_bytes([*low, *high]);
    let Some(frame) = Frame::new(id, bytes) else {
        assert!(id > 0x7ff || bytes.len() > 64);
        return;
    };
    let data = frame.data();
    assert!(data.starts_with(bytes) && data[bytes.len()..].iter().all(|byte| *byte == 0));
    let node = Node::new(1).unwrap();
    if let Some(beat) = Beat::parse(data) {
        assert_eq!(beat.frame(node).and_then(|frame| Beat::parse(frame.data())), Some(beat));
    }
    if let Some(emergency) = Emergency::parse(data) {
        assert_eq!(emergency.frame(node).and_then(|frame| Emergency::parse(frame.data())), Some(emergency));
    }
    if let Some(time) = Time::parse(data) {
        assert_eq!(time.frame().and_then(|frame| Time::parse(frame.data())), Some(time));
        let near = u64::from(time.tick) << 7;
        assert_eq!(sync::nearest(near, time.tick) as u32, time.tick);
        assert!(time.ns >> 24 == 0 && Time::new(1, Stamp { tick: near, ns: time.ns }).is_some());
    }
    if let Some(stop) = Stop::of(&frame, 1) {
        assert_eq!(stop.frame().and_then(|frame| Stop::of(&frame, 1)), Some(stop));
    }
    if let Some(data) = data::parse(data) {
        assert!(data.tag < 16 && data.unit >> 20 == 0 && !data.bytes.is_empty());
    }
    for other in [Node::of_answer(id), Node::of_beat(id), Node::of_emergency(id)].into_iter().flatten() {
        assert!((1..=127).contains(&other.number()));
    }
}

/// Lines of a serial adapter.
pub fn slcan(bytes: &[u8]) {
    let mut reader = Reader::new();
    for line in bytes.iter().filter_map(|byte| reader.push(*byte)) {
        if let Line::Frame(frame) = line {
            let mut buffer = [0; slcan::LINE_BYTES];
            let mut again = Reader::new();
            let back = slcan::line(&frame, &mut buffer).iter().find_map(|byte| again.push(*byte));
            assert_eq!(back, Some(Line::Frame(frame)));
        }
    }
}

/// Frames of one identifier; each begins with its length.
pub fn reassembler(bytes: &[u8]) {
    let mut incoming = Reassembler::<BLOCK_BYTES>::new();
    let mut rest = bytes;
    while let [length, behind @ ..] = rest {
        let (frame, behind) = behind.split_at(usize::from(length % 65).min(behind.len()));
        rest = behind;
        let Ok(Some((epoch, message))) = incoming.push(frame) else { continue };
        assert!(message.len() <= MESSAGE_BYTES);
        let mut again = Reassembler::<BLOCK_BYTES>::new();
        let mut found = None;
        for frame in Segments::new(1, FrameSize::Classic, epoch, message).unwrap() {
            found = again.push(frame.data()).unwrap().map(|(epoch, bytes)| (epoch, bytes.to_vec()));
        }
        assert_eq!(found, Some((epoch, message.to_vec())));
    }
}

/// Messages of hosts.
pub fn host_message(bytes: &[u8]) {
    let Ok(message) = decode::<HostMessage<'_>>(bytes) else { return };
    let mut buffer: MessageBuffer = [0; MESSAGE_BYTES];
    let written = encode(&message, &mut buffer).unwrap().to_vec();
    let again = decode::<HostMessage<'_>>(&written).unwrap();
    let mut buffer: MessageBuffer = [0; MESSAGE_BYTES];
    // Compared as bytes, for numbers that are none.
    assert_eq!(encode(&again, &mut buffer).unwrap(), written);
    match message {
        HostMessage::Open(header) => drop(header.check()),
        HostMessage::OpenAxis(header) => drop(header.check()),
        _ => {}
    }
}

/// Messages of drives.
pub fn drive_message(bytes: &[u8]) {
    let Ok(message) = decode::<DriveMessage>(bytes) else { return };
    let mut buffer: MessageBuffer = [0; MESSAGE_BYTES];
    let written = encode(&message, &mut buffer).unwrap().to_vec();
    let again = decode::<DriveMessage>(&written).unwrap();
    let mut buffer: MessageBuffer = [0; MESSAGE_BYTES];
    assert_eq!(encode(&again, &mut buffer).unwrap(), written);
    if let DriveMessage::Missing { gaps, .. } = message {
        assert!(gaps.ranges().all(|gap| gap.start < gap.end));
    }
}

/// Integers of variable length.
pub fn varint(bytes: &[u8]) {
    let (mut at, mut difference) = (0, numbers::SecondDifference::default());
    while let Ok(value) = numbers::read(bytes, &mut at) {
        let mut written = Vec::new();
        numbers::write(&mut written, value);
        assert!(bytes[..at].ends_with(&written));
        assert_eq!(numbers::zigzag(numbers::unzigzag(value)), value);
        let _ = difference.decode(value);
    }
    assert!(at <= bytes.len());
}

/// The streams of a table, without its headers.
pub fn streams(bytes: &[u8]) {
    let [spans, joined, cut, bytes @ ..] = bytes else { return };
    let (left, right) = bytes.split_at(usize::from(*cut).min(bytes.len()));
    let mut reader = geometry::GeometryReader::default();
    (0..=bytes.len()).take_while(|_| reader.next(bytes).is_ok()).for_each(drop);
    let mut reader = control::ControlReader::default();
    let count = (0..=bytes.len()).take_while(|_| reader.next(bytes).is_ok()).count();
    assert!(count <= bytes.len());
    let mut reader = span::SpanReader::new(u32::from(*spans), joined % 2 == 1);
    let count = (0..=256).take_while(|_| matches!(reader.next(left, right), Ok(Some(_)))).count();
    assert!(count <= 256);
    let _ = reader.finish(left, right);
}

/// A piece of the input, whose length stands before it.
fn piece<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let [low, high, behind @ ..] = *rest else { return None };
    let length = usize::from(u16::from_le_bytes([*low, *high])).min(behind.len());
    let (piece, behind) = behind.split_at(length);
    *rest = behind;
    Some(piece)
}

/// A whole table: both headers, the shared streams, and the controls.
pub fn table(bytes: &[u8]) {
    let mut rest = bytes;
    let pieces = (|| Some((piece(&mut rest)?, piece(&mut rest)?, piece(&mut rest)?)))();
    let Some((header, axis, shared)) = pieces else { return };
    let (Ok(header), Ok(axis)) = (decode::<TableHeader>(header), decode::<AxisHeader>(axis)) else { return };
    // Lengths follow the streams, so that more than headers is looked at.
    let geometry_bytes = header.geometry_bytes.min(shared.len() as u32);
    let span_bytes = shared.len() as u32 - geometry_bytes;
    let header = TableHeader { geometry_bytes, span_bytes, ..header };
    let axis = AxisHeader { table: header.table, control_bytes: rest.len() as u32, ..axis };
    let Ok(view) = TableView::new(&header, &axis, shared, rest) else { return };
    let checked = view.check();
    let proven = view.prove(None);
    assert!(checked.is_ok() || proven.is_err(), "proven without being admissible");
    let Ok(table) = checked else { return };
    let Ok(mut cursor) = Cursor::new(&table) else { return };
    let tick = (u64::from(header.tick_ns) << 32) / 1_000_000_000;
    let mut time = 0;
    for _ in 0..400 {
        let setpoint = cursor.evaluate(&table, time).unwrap();
        if proven.is_ok() {
            let sound = setpoint.velocity.is_finite() && setpoint.acceleration.is_finite();
            assert!(sound, "{setpoint:?} at {time}");
        }
        if setpoint.done {
            assert_eq!((setpoint.position, setpoint.velocity), (axis.end, 0.0));
            break;
        }
        time += tick.max(1);
    }
}

/// A file of feed tables.
pub fn feed_file(bytes: &[u8]) {
    if let Ok(file) = FeedReader::new(bytes).and_then(FeedReader::read_all) {
        assert_eq!(file.totals.items, file.items.len() as u64);
    }
}

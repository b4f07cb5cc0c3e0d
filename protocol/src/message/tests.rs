use super::*;
use crate::bus::{BLOCK_BYTES, FrameSize, Reassembler, Segments};
use crate::schema;
use crate::table::{AxisLimit, HeaderField, Joint, Limits, Stream, Warp};
use crate::update::Update;
use proptest::prelude::*;

extern crate std;
use std::vec::Vec;

fn bytes(message: &impl Serialize) -> Vec<u8> {
    encode(message, &mut [0; MESSAGE_BYTES]).unwrap().to_vec()
}

const HEADER: TableHeader = TableHeader {
    version: 1,
    table: 300,
    spans: 5,
    geometry_spans: 1,
    step_exponent: -10,
    q_scale: 0.5,
    tick_ns: 1_000_000,
    geometry_bytes: 3,
    span_bytes: 10,
    margin: 5,
    warp: None,
    joint: None,
    tail: None,
};

const WARP: Warp = Warp { rate: 1, acceleration: 2, jerk: 3, slope: 4, bend: 5 };

const JOINT: Joint = Joint { table: 6, step: 7, code: 8, lengths: [9, 10] };

const AXIS: AxisHeader = AxisHeader {
    table: 300,
    axis: 2,
    fraction_bits: 4,
    start: -1,
    end: 64,
    limits: Limits { velocity: 1.0, acceleration: 2.0, jerk: Some(4.0) },
    control_bytes: 9,
};

#[test]
fn host_messages_are_pinned() {
    let seal = HostMessage::Seal { table: 1, part: Part::Shared, crc: 0x80 };
    let cases: [(HostMessage<'_>, &[u8]); 21] = [
        (HostMessage::Update(Update::Ask), &[15, 0]),
        (HostMessage::Update(Update::Data { offset: 300, bytes: &[7, 8] }), &[15, 2, 0xac, 2, 2, 7, 8]),
        (HostMessage::Update(Update::Try), &[15, 3]),
        (HostMessage::Update(Update::Keep), &[15, 4]),
        (HostMessage::Signed { counter: 300, tag: 5, message: &[4, 9] }, &[14, 0xac, 2, 5, 2, 4, 9]),
        (
            HostMessage::Open(HEADER),
            &[0, 1, 0xac, 2, 5, 1, 0xf6, 0, 0, 0, 0x3f, 0xc0, 0x84, 0x3d, 3, 10, 5, 0, 0, 0],
        ),
        (
            HostMessage::OpenAxis(AXIS),
            &[1, 0xac, 2, 2, 4, 1, 0x80, 1, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 1, 0, 0, 0x80, 0x40, 9],
        ),
        (seal, &[2, 1, 0, 0x80, 1]),
        (HostMessage::Start { table: 1, tick: 1000 }, &[3, 1, 0xe8, 7]),
        (HostMessage::Stop, &[4]),
        (HostMessage::Identify, &[5]),
        (HostMessage::QuickStop, &[6]),
        (HostMessage::MoveTo { position: -1, velocity: None }, &[7, 1, 0]),
        (HostMessage::MoveTo { position: 1, velocity: Some(1.0) }, &[7, 2, 1, 0, 0, 0x80, 0x3f]),
        (HostMessage::MoveAt { velocity: -1.0 }, &[8, 0, 0, 0x80, 0xbf]),
        (HostMessage::Power(PowerEvent::EnableOperation), &[9, 2]),
        (HostMessage::Override { permille: 500, tick: 7, number: 3 }, &[10, 0xf4, 3, 7, 3]),
        (HostMessage::Alive, &[11]),
        (HostMessage::Begin { boot: 300, members: 7 }, &[12, 0xac, 2, 7]),
        (HostMessage::Report, &[13]),
        (
            HostMessage::Open(TableHeader { warp: Some(WARP), joint: Some(JOINT), tail: Some(11), ..HEADER }),
            &[
                0, 1, 0xac, 2, 5, 1, 0xf6, 0, 0, 0, 0x3f, 0xc0, 0x84, 0x3d, 3, 10, 5, 1, 1, 2, 3, 4, 5, 1, 6,
                7, 8, 9, 10, 1, 11,
            ],
        ),
    ];
    for (message, golden) in cases {
        assert_eq!(bytes(&message), golden, "{message:?}");
        assert_eq!(decode::<HostMessage<'_>>(golden), Ok(message));
    }
}

#[test]
fn drive_messages_are_pinned() {
    let reject = |reason| DriveMessage::Reject { table: 1, reason };
    let bend = TableError::Bend { index: 9 };
    let truncated = TableError::Truncated { stream: Stream::Controls, index: 200 };
    let status = |state, fault| {
        let power = Power::OperationEnabled;
        DriveMessage::Status(Status { state, power, fault, tick: 1, position: -2, fill: 3 })
    };
    let identity = Identity {
        version: [0, 1, 2],
        format: 1,
        schema: 300,
        axis: 2,
        tick_ns: 1000,
        limits: AXIS.limits,
        room: 4096,
        boot: 9,
        epoch: 300,
    };
    let mut gaps = Gaps::default();
    gaps.0[..2].copy_from_slice(&[(3, 2), (300, 1)]);
    assert_eq!(gaps.ranges().collect::<Vec<_>>(), [3..5, 305..306]);
    assert_eq!(Gaps([(u32::MAX, 2); GAPS]).ranges().count(), 0);
    let telemetry =
        Telemetry { ticks: 200, following_max: 3, following_rms: 1.0, fill_ms: 5, worst_tick: 90 };
    let cases: [(DriveMessage, &[u8]); 37] = [
        (DriveMessage::Telemetry(telemetry), &[4, 0xc8, 1, 3, 0, 0, 0x80, 0x3f, 5, 90]),
        (reject(Reject::Target), &[1, 1, 13]),
        (
            DriveMessage::Identity(identity),
            &[
                3, 0, 1, 2, 1, 0xac, 2, 2, 0xe8, 7, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 1, 0, 0, 0x80, 0x40,
                0x80, 0x20, 9, 0xac, 2,
            ],
        ),
        (DriveMessage::Ready { table: 1, ticks: 200, crc: [1, 2] }, &[0, 1, 0xc8, 1, 1, 2]),
        (reject(Reject::Table(bend)), &[1, 1, 0, 7, 9]),
        (reject(Reject::Table(truncated)), &[1, 1, 0, 1, 2, 0xc8, 1]),
        (reject(Reject::Table(TableError::Header(HeaderField::Limits))), &[1, 1, 0, 0, 9]),
        (reject(Reject::Table(TableError::End)), &[1, 1, 0, 12]),
        (reject(Reject::Table(TableError::Limit { limit: AxisLimit::Jerk, index: 9 })), &[1, 1, 0, 13, 2, 9]),
        (reject(Reject::Checksum(Part::Axis)), &[1, 1, 1, 1]),
        (reject(Reject::NoRoom { needed: 5, available: 4 }), &[1, 1, 2, 5, 4]),
        (reject(Reject::Tick { tick_ns: 9 }), &[1, 1, 3, 9]),
        (reject(Reject::Axis { axis: 3 }), &[1, 1, 4, 3]),
        (reject(Reject::Limits), &[1, 1, 5]),
        (reject(Reject::Position { position: -1 }), &[1, 1, 6, 1]),
        (reject(Reject::Busy), &[1, 1, 7]),
        (reject(Reject::NotOpen), &[1, 1, 8]),
        (reject(Reject::NotReady), &[1, 1, 9]),
        (reject(Reject::Late { tick: 1 }), &[1, 1, 10, 1]),
        (reject(Reject::Overlap { tick: 2 }), &[1, 1, 11, 2]),
        (reject(Reject::Fault), &[1, 1, 12]),
        (reject(Reject::Power(Power::SwitchedOn)), &[1, 1, 14, 2]),
        (reject(Reject::Moves), &[1, 1, 15]),
        (reject(Reject::Override), &[1, 1, 16]),
        (reject(Reject::Joint), &[1, 1, 17]),
        (reject(Reject::Epoch { epoch: 300 }), &[1, 1, 18, 0xac, 2]),
        (reject(Reject::Boot), &[1, 1, 19]),
        (reject(Reject::Clock), &[1, 1, 20]),
        (reject(Reject::Members), &[1, 1, 21]),
        (
            DriveMessage::Missing { table: 1, part: Part::Axis, gaps },
            &[5, 1, 1, 3, 2, 0xac, 2, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        ),
        (DriveMessage::Begun { epoch: 300 }, &[6, 0xac, 2]),
        (status(State::Held, Some(Fault::Connection)), &[2, 6, 3, 1, 2, 1, 3, 3]),
        (status(State::Idle, Some(Fault::Board { code: 300 })), &[2, 0, 3, 1, 3, 0xac, 2, 1, 3, 3]),
        (status(State::Idle, None), &[2, 0, 3, 0, 1, 3, 3]),
        (status(State::Running, None), &[2, 4, 3, 0, 1, 3, 3]),
        (status(State::Holding, None), &[2, 5, 3, 0, 1, 3, 3]),
        (
            status(State::Holding, Some(Fault::Table { table: 8, error: bend })),
            &[2, 5, 3, 1, 0, 8, 7, 9, 1, 3, 3],
        ),
    ];
    for (message, golden) in cases {
        assert_eq!(bytes(&message), golden, "{message:?}");
        assert_eq!(decode::<DriveMessage>(golden), Ok(message));
    }
}

#[test]
fn the_schema_is_pinned() {
    assert_eq!(schema::HASH, 0xe80e_ab70_f8aa_4183, "{:#018x}", schema::HASH);
}

#[test]
fn the_longest_messages_fit_their_blocks() {
    let most = u32::MAX;
    let begin = HostMessage::Begin { boot: most, members: u128::MAX };
    assert!(bytes(&begin).len() <= MESSAGE_BYTES);
    let gaps = Gaps([(1 << 20, 1 << 20); GAPS]);
    let missing = DriveMessage::Missing { table: most, part: Part::Axis, gaps };
    assert!(bytes(&missing).len() <= ANSWER_BYTES, "{}", bytes(&missing).len());
}

#[test]
fn the_longest_headers_have_checksums() {
    let most = u32::MAX;
    let header = TableHeader {
        version: u8::MAX,
        table: most,
        spans: most,
        geometry_spans: most,
        step_exponent: i8::MIN,
        q_scale: f32::MAX,
        tick_ns: most,
        geometry_bytes: most,
        span_bytes: most,
        margin: u8::MAX,
        warp: Some(Warp { rate: most, acceleration: most, jerk: most, slope: u64::MAX, bend: u64::MAX }),
        joint: Some(Joint { table: most, step: most, code: most, lengths: [most; 2] }),
        tail: Some(most),
    };
    let limits = Limits { velocity: 1.0, acceleration: 1.0, jerk: Some(1.0) };
    let (start, end) = (i64::MIN, i64::MIN);
    let axis =
        AxisHeader { table: most, axis: 255, fraction_bits: 255, start, end, limits, control_bytes: most };
    assert!(part_crc(&header, &[]).is_ok());
    assert!(part_crc(&axis, &[]).is_ok());
    assert_ne!(part_crc(&axis, &[&[1]]), part_crc(&axis, &[&[2]]));
}

#[test]
fn bytes_behind_a_message_are_refused() {
    assert_eq!(decode::<HostMessage<'_>>(&[4, 0]), Err(MessageError::LeftOver));
    assert_eq!(decode::<HostMessage<'_>>(&[14]), Err(MessageError::Malformed));
    assert_eq!(decode::<HostMessage<'_>>(&[]), Err(MessageError::Malformed));
    assert_eq!(encode(&HostMessage::Open(HEADER), &mut [0; 4]), Err(MessageError::NoRoom));
}

fn sizes() -> impl Strategy<Value = FrameSize> {
    prop_oneof![Just(FrameSize::Classic), Just(FrameSize::Fd)]
}

proptest! {
    #[test]
    fn any_bytes_are_a_message_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
        // Whatever decodes must encode to the same meaning.
        if let Ok(message) = decode::<HostMessage<'_>>(&bytes) {
            let again = super::tests::bytes(&message);
            prop_assert!(again.len() <= bytes.len());
        }
        if let Ok(message) = decode::<DriveMessage>(&bytes) {
            prop_assert_eq!(decode::<DriveMessage>(&super::tests::bytes(&message)), Ok(message));
        }
    }

    #[test]
    fn messages_survive_the_frames(
        message in prop::collection::vec(any::<u8>(), 0..=MESSAGE_BYTES),
        before in prop::collection::vec(any::<u8>(), 0..20),
        size in sizes(),
        epoch in any::<u16>(),
    ) {
        let mut receiver = Reassembler::<BLOCK_BYTES>::new();
        let _ = receiver.push(&before);
        let frames: Vec<_> = Segments::new(0x201, size, epoch, &message).unwrap().collect();
        prop_assert!(frames.len() <= 48);
        let (last, first) = frames.split_last().unwrap();
        for frame in first {
            prop_assert_eq!(frame.id(), 0x201);
            prop_assert_eq!(receiver.push(frame.data()), Ok(None));
            // Doubled frames are harmless.
            prop_assert_eq!(receiver.push(frame.data()), Ok(None));
        }
        prop_assert_eq!(receiver.push(last.data()), Ok(Some((epoch, message.as_slice()))));
    }

    #[test]
    fn a_damaged_block_never_becomes_a_message(
        message in prop::collection::vec(any::<u8>(), 1..60),
        size in sizes(),
        at in any::<prop::sample::Index>(),
        bit in 0u8..8,
        lose in any::<bool>(),
    ) {
        let mut frames: Vec<Vec<u8>> =
            Segments::new(1, size, 5, &message).unwrap().map(|f| f.data().to_vec()).collect();
        let i = at.index(frames.len());
        if lose {
            frames.remove(i);
        } else {
            let byte = at.index(frames[i].len());
            frames[i][byte] ^= 1 << bit;
        }
        let mut receiver = Reassembler::<BLOCK_BYTES>::new();
        for frame in &frames {
            // Damage in the zeros that fill a frame harms nobody.
            if let Ok(Some(found)) = receiver.push(frame) {
                prop_assert_eq!(found, (5, message.as_slice()));
            }
        }
    }

    #[test]
    fn any_frames_are_taken_in_bounded_memory(frames in prop::collection::vec(
        prop::collection::vec(any::<u8>(), 0..64), 0..20)
    ) {
        let mut receiver = Reassembler::<32>::new();
        for frame in &frames {
            let _ = receiver.push(frame);
        }
        // A good block after any rubbish is taken.
        let good = Segments::new(1, FrameSize::Classic, 2, b"good").unwrap();
        let mut last = Ok(None);
        for frame in good {
            last = receiver.push(frame.data()).map(|m| m.map(|(epoch, m)| (epoch, m.to_vec())));
        }
        prop_assert_eq!(last, Ok(Some((2, b"good".to_vec()))));
    }
}

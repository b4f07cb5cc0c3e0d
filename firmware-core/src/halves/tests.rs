use super::*;
use crate::axis::AxisConfig;
use crate::session::Watch;
use protocol::bus::{FrameSize, Node, Segments, data, ids};
use protocol::message::{DriveMessage, HostMessage, Part, Reject, State, decode, encode, part_crc};
use protocol::power::{Power, PowerEvent};
use protocol::table::control::ControlWriter;
use protocol::table::geometry::{self, GeometrySpan};
use protocol::table::span::SpanWriter;
use protocol::table::{AxisHeader, FORMAT_VERSION, Limits, TableHeader};

extern crate std;
use std::vec::Vec;

const LIMITS: Limits = Limits { velocity: 1e6, acceleration: 1e8, jerk: Some(1e10) };

fn config() -> DriveConfig {
    let node = Node::new(1).unwrap();
    let watch = Watch { host_ticks: 0, ..Watch::new(1_000_000, 0) };
    DriveConfig { node, frames: FrameSize::Fd, axis: AxisConfig::new(0, 1_000_000, LIMITS), watch, key: None }
}

fn frames(message: &HostMessage<'_>) -> Vec<Frame> {
    frames_of(1, message)
}

fn frames_of(epoch: u16, message: &HostMessage<'_>) -> Vec<Frame> {
    let mut buffer = [0; protocol::bus::MESSAGE_BYTES];
    let bytes = encode(message, &mut buffer).unwrap();
    Segments::new(ids::BROADCAST, FrameSize::Fd, epoch, bytes).unwrap().collect()
}

/// A move of 8000 counts there, or back.
fn table(number: u32, back: bool) -> Vec<Vec<Frame>> {
    table_of(1, number, back)
}

fn table_of(epoch: u16, number: u32, back: bool) -> Vec<Vec<Frame>> {
    let frames = |message: &HostMessage<'_>| frames_of(epoch, message);
    let (mut shared, mut spans, mut writer) = (Vec::new(), Vec::new(), SpanWriter::default());
    geometry::write(&mut shared, GeometrySpan { length: 2048, spans: 5 });
    writer.push(&mut spans, Some(200), None);
    for (step, code) in [(500, 15_000), (648, 25_000), (500, 15_000)] {
        writer.push(&mut spans, Some(step), Some(code));
    }
    writer.push(&mut spans, None, None);
    let (mut controls, mut points) = (Vec::new(), ControlWriter::default());
    let place = |p: i64| if back { 24_000 - p } else { p };
    [0, 8000, 16_000, 24_000].into_iter().for_each(|p| points.push(&mut controls, place(p) / 3));
    let header = TableHeader {
        version: FORMAT_VERSION,
        table: number,
        spans: 5,
        geometry_spans: 1,
        step_exponent: -8,
        q_scale: 1e-5,
        tick_ns: 1_000_000,
        geometry_bytes: shared.len() as u32,
        span_bytes: spans.len() as u32,
        margin: 5,
        warp: None,
        joint: None,
        tail: None,
    };
    shared.extend(spans);
    let axis = AxisHeader {
        table: number,
        axis: 0,
        fraction_bits: 0,
        start: place(0) / 3,
        end: place(24_000) / 3,
        limits: LIMITS,
        control_bytes: controls.len() as u32,
    };
    let mut all = std::vec![frames(&HostMessage::Open(header)), frames(&HostMessage::OpenAxis(axis))];
    for (part, bytes, crc) in [
        (Part::Shared, &shared, part_crc(&header, &[&shared]).unwrap()),
        (Part::Axis, &controls, part_crc(&axis, &[&controls]).unwrap()),
    ] {
        let id = if part == Part::Shared { ids::DATA } else { Node::new(1).unwrap().data() };
        let units = data::units(FrameSize::Fd);
        all.push((0..).map_while(|k| data::frame(id, FrameSize::Fd, number, bytes, k * units)).collect());
        all.push(frames(&HostMessage::Seal { table: number, part, crc }));
    }
    all
}

fn answers(talk: &mut Talk<'_, '_>) -> Vec<DriveMessage> {
    let mut receiver = protocol::bus::Reassembler::<64>::new();
    let mut all = Vec::new();
    while let Some(frame) = talk.poll_transmit() {
        if frame.id() != config().node.from_drive() {
            continue;
        }
        if let Some((_, bytes)) = receiver.push(frame.data()).unwrap() {
            all.push(decode(bytes).unwrap());
        }
    }
    all
}

/// Opens an epoch of a drive at rest, and puts it under torque.
fn begin(epoch: u16, talk: &mut Talk<'_, '_>, drive: &mut Move<'_, '_>) {
    frames_of(epoch, &HostMessage::Begin { boot: 0, members: 1 }).iter().for_each(|f| talk.receive(f, 0));
    drive.tick();
    assert!(answers(talk).contains(&DriveMessage::Begun { epoch }));
    for event in [PowerEvent::Shutdown, PowerEvent::EnableOperation] {
        frames_of(epoch, &HostMessage::Power(event)).iter().for_each(|frame| talk.receive(frame, 0));
    }
    drive.tick();
}

fn enable(talk: &mut Talk<'_, '_>) {
    for event in [PowerEvent::Shutdown, PowerEvent::EnableOperation] {
        frames(&HostMessage::Power(event)).iter().for_each(|frame| talk.receive(frame, 0));
    }
}

/// What a script does at one step of communication.
type Step = fn(&mut Talk<'_, '_>);

/// Every way in which ticks can fall between the steps of communication: all interleavings, since neither half sees
/// anything of the other but through the queues, whose operations are atomic.
#[test]
fn wherever_the_ticks_fall_the_axis_ends_where_it_was_sent() {
    let script: [Step; 9] = [
        |talk| enable(talk),
        |talk| table(1, false).concat().iter().for_each(|f| talk.receive(f, 0)),
        |talk| frames(&HostMessage::Start { table: 1, tick: 4 }).iter().for_each(|f| talk.receive(f, 0)),
        |talk| table(2, true).concat().iter().for_each(|f| talk.receive(f, 0)),
        |talk| frames(&HostMessage::Start { table: 1, tick: 4 }).iter().for_each(|f| talk.receive(f, 0)),
        |talk| frames(&HostMessage::Start { table: 2, tick: 500 }).iter().for_each(|f| talk.receive(f, 0)),
        |talk| frames(&HostMessage::Stop).iter().for_each(|f| talk.receive(f, 0)),
        |talk| frames(&HostMessage::QuickStop).iter().for_each(|f| talk.receive(f, 0)),
        |talk| drop(answers(talk)),
    ];
    // Five ticks among nine steps: each step may come before or after each tick.
    const TICKS: usize = 5;
    let mut cases = 0u32;
    for pattern in 0u32..1 << (script.len() + TICKS) {
        if pattern.count_ones() as usize != TICKS {
            continue;
        }
        cases += 1;
        let (mut a, mut b) = ([0; 80], [0; 80]);
        let mut between = Between::new();
        let (mut talk, mut drive) = between.drive(config(), &mut a, &mut b);
        begin(1, &mut talk, &mut drive);
        let mut steps = script.iter();
        let mut last = Setpoint::at_rest(0);
        for turn in 0..script.len() + TICKS {
            if pattern >> turn & 1 == 1 {
                let now = drive.tick();
                assert!((now.position - last.position).abs() <= 1_000, "{pattern:b} {last:?} {now:?}");
                last = now;
            } else if let Some(step) = steps.next() {
                step(&mut talk);
            }
        }
        // Whatever has come through, it comes to rest, and both buffers are free for new tables.
        for _ in 0..2_000 {
            last = drive.tick();
            drop(answers(&mut talk));
        }
        assert!(last.done, "{pattern:b} {last:?}");
        assert_eq!(drive.motion().power(), Power::QuickStopActive, "{pattern:b}");
        begin(2, &mut talk, &mut drive);
        for number in [11, 12] {
            table_of(2, number, false).concat().iter().for_each(|f| talk.receive(f, 0));
            let ready = answers(&mut talk);
            let is_ready =
                |a: &DriveMessage| matches!(a, DriveMessage::Ready { table, .. } if *table == number);
            assert!(ready.iter().any(is_ready), "{pattern:b} {ready:?}");
        }
    }
    assert_eq!(cases, 2_002);
}

/// The halves on two threads, as fast as they can: tables there and back, without a lost buffer.
#[test]
fn two_threads_hand_tables_to_each_other() {
    const TABLES: u32 = 60;
    let (mut a, mut b) = ([0; 80], [0; 80]);
    let mut between = Between::new();
    let mut config = config();
    config.axis.status_ticks = 3;
    let (mut talk, mut drive) = between.drive(config, &mut a, &mut b);
    begin(1, &mut talk, &mut drive);
    let stop = std::sync::atomic::AtomicBool::new(false);
    let order = std::sync::atomic::Ordering::Relaxed;
    std::thread::scope(|scope| {
        let moves = scope.spawn(|| {
            let mut last = Setpoint::at_rest(0);
            while !stop.load(order) {
                let now = drive.tick();
                assert!((now.position - last.position).abs() <= 1_000, "{last:?} {now:?}");
                last = now;
                std::thread::yield_now();
            }
            last
        });
        for number in 1..=TABLES {
            let (mut ready, mut started, mut tick) = (false, false, 0);
            for round in 0u64.. {
                if !ready && round % 64 == 0 {
                    table(number, number % 2 == 0).concat().iter().for_each(|f| talk.receive(f, 0));
                }
                let mut done = false;
                for answer in answers(&mut talk) {
                    match answer {
                        DriveMessage::Ready { .. } => ready = true,
                        // The other thread has run ahead.
                        DriveMessage::Reject { reason: Reject::Late { .. }, .. } => started = false,
                        DriveMessage::Status(s) => {
                            tick = s.tick;
                            done = started && matches!(s.state, State::Holding) && s.fill == 0;
                            let end = if number % 2 == 0 { 0 } else { 8_000 };
                            done &= s.position == end;
                        }
                        _ => {}
                    }
                }
                if ready && !started && tick > 0 {
                    let start = HostMessage::Start { table: number, tick: tick + 5_000 };
                    frames(&start).iter().for_each(|f| talk.receive(f, 0));
                    started = true;
                }
                if done {
                    break;
                }
                assert!(round < 3_000_000, "table {number}");
                std::thread::yield_now();
            }
        }
        stop.store(true, order);
        let last = moves.join().unwrap();
        assert_eq!(last, Setpoint::at_rest(0));
    });
}

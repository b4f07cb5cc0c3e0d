//! Drives behind frames: tables arrive, are refused by name, start together and end at rest.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use firmware_core::axis::AxisConfig;
use firmware_core::drive::{Drive, DriveConfig};
use firmware_core::evaluate::{Cursor, Setpoint};
use firmware_core::session::Watch;
use firmware_core::table::TableView;
use planner::feed::messages::frames;
use planner::feed::pack::Packed;
use planner::feed::table::FeedTable;
use protocol::bus::beat::Beat;
use protocol::bus::{Frame, FrameSize, Node, Reassembler, ids};
use protocol::message::{DriveMessage, HEADER_BYTES, HostMessage, Part, Reject, State, decode, encode};
use protocol::power::{Power, PowerEvent};
use protocol::table::{HeaderField, Limits, TableError, TableHeader};
use tests::tables::{COARSE, Kind, Random, Sample, TICK_NS};

const LIMITS: Limits = Limits { velocity: 1e9, acceleration: 1e12, jerk: None };

fn config(axis: usize, position: i64) -> DriveConfig {
    let axis_config = AxisConfig { position, ..AxisConfig::new(axis as u8, TICK_NS, LIMITS) };
    let watch = Watch { host_ticks: 0, ..Watch::new(TICK_NS, 0) };
    DriveConfig { node: node(axis), frames: FrameSize::Classic, axis: axis_config, watch, key: None }
}

/// A drive under torque.
fn enabled<'a>(config: DriveConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Drive<'a> {
    let mut drive = Drive::new(config, a, b);
    begin(&mut drive, config.node, 1);
    for event in [PowerEvent::Shutdown, PowerEvent::EnableOperation] {
        send(&mut drive, config.node.to_drive(), &HostMessage::Power(event));
    }
    drive
}

/// Opens an epoch with a drive at rest.
fn begin(drive: &mut Drive<'_>, node: Node, epoch: u16) {
    let message = HostMessage::Begin { boot: 0, members: 1 << (node.number() - 1) };
    frames(node.to_drive(), FrameSize::Classic, epoch, &message).iter().for_each(|f| drive.receive(f, 0));
    assert!(answers(drive).contains(&DriveMessage::Begun { epoch }));
}

fn node(axis: usize) -> Node {
    Node::new(axis as u8 + 1).unwrap()
}

fn send(drive: &mut Drive<'_>, id: u16, message: &HostMessage<'_>) {
    frames(id, FrameSize::Classic, 1, message).iter().for_each(|frame| drive.receive(frame, 0));
}

/// All frames that bring axis `axis` its table.
fn table_frames(packed: &Packed, axis: usize, size: FrameSize) -> Vec<Frame> {
    packed.frames(axis, node(axis), size, 1)
}

fn answers(drive: &mut Drive<'_>) -> Vec<DriveMessage> {
    let mut receiver = Reassembler::<96>::new();
    let mut messages = Vec::new();
    while let Some(frame) = drive.poll_transmit() {
        if Node::of_answer(frame.id()).is_none() {
            continue;
        }
        if let Some((_, bytes)) = receiver.push(frame.data()).unwrap() {
            messages.push(decode(bytes).unwrap());
        }
    }
    messages
}

fn reason(drive: &mut Drive<'_>) -> Option<Reject> {
    answers(drive).into_iter().find_map(|message| match message {
        DriveMessage::Reject { reason, .. } => Some(reason),
        _ => None,
    })
}

fn is_ready(drive: &mut Drive<'_>, number: u32) -> bool {
    let answers = answers(drive);
    let ready = |m: &DriveMessage| matches!(m, DriveMessage::Ready { table, .. } if *table == number);
    !answers.is_empty() && answers.iter().all(ready)
}

fn sample(seed: u64) -> (Sample, Packed) {
    let sample = Sample::new(&mut Random::new(seed), COARSE);
    let packed = sample.packed(1).unwrap();
    (sample, packed)
}

fn start_of(packed: &Packed) -> i64 {
    packed.axes[0].header.start
}

/// Set-points of a table, straight from the evaluator.
fn evaluated(packed: &Packed, axis: usize) -> Vec<Setpoint> {
    let part = &packed.axes[axis];
    let view = TableView::new(&packed.header, &part.header, &packed.shared, &part.controls).unwrap();
    let table = view.check().unwrap();
    let mut cursor = Cursor::new(&table).unwrap();
    let mut setpoints = Vec::new();
    for n in 0u128.. {
        let time = ((n * u128::from(TICK_NS)) << 32) / 1_000_000_000;
        setpoints.push(cursor.evaluate(&table, time as u64).unwrap());
        if setpoints[setpoints.len() - 1].done {
            break;
        }
    }
    setpoints
}

#[test]
fn axes_start_together_and_end_at_rest_on_the_exact_count() {
    for size in [FrameSize::Classic, FrameSize::Fd] {
        for seed in 0..10 {
            let (_, packed) = sample(seed);
            let expected: Vec<_> = (0..packed.axes.len()).map(|axis| evaluated(&packed, axis)).collect();
            let mut memory = vec![[[0u8; 4096]; 2]; packed.axes.len()];
            let mut drives: Vec<_> = memory
                .iter_mut()
                .enumerate()
                .map(|(axis, [a, b])| {
                    let config = config(axis, packed.axes[axis].header.start);
                    enabled(config, a, b)
                })
                .collect();
            for (axis, drive) in drives.iter_mut().enumerate() {
                table_frames(&packed, axis, size).iter().for_each(|frame| drive.receive(frame, 0));
                let ticks = expected[axis].len() as u64 - 1;
                let crc = [packed.shared_crc(), packed.axes[axis].crc()];
                assert_eq!(answers(drive), [DriveMessage::Ready { table: 1, ticks, crc }]);
                assert_eq!(drive.status().state, State::Ready);
                send(drive, ids::BROADCAST, &HostMessage::Start { table: 1, tick: 10 });
                assert_eq!(drive.status().state, State::Armed);
            }
            for (axis, drive) in drives.iter_mut().enumerate() {
                let start = packed.axes[axis].header.start;
                for _ in 0..10 {
                    assert_eq!(drive.tick(), Setpoint::at_rest(start));
                }
                for setpoint in &expected[axis] {
                    assert_eq!(drive.tick(), *setpoint);
                }
                assert_eq!(drive.tick(), Setpoint::at_rest(packed.axes[axis].header.end));
                assert_eq!((drive.status().state, drive.dropped()), (State::Holding, 0));
            }
        }
    }
}

/// The same path back: control points and spans in reverse order.
fn reversed(sample: &Sample) -> Sample {
    let mut back = sample.clone();
    let FeedTable { path, steps, codes, .. } = &mut back.table;
    let length = path.grid_length();
    path.breaks = path.breaks.iter().rev().map(|knot| length - knot).collect();
    path.axes.iter_mut().for_each(|axis| axis.controls.reverse());
    steps.reverse();
    codes.reverse();
    back
}

#[test]
fn the_next_table_comes_in_while_one_plays_and_follows_without_a_gap() {
    let (there, packed) = sample(21);
    let back = reversed(&there).packed(2).unwrap();
    let expected = (evaluated(&packed, 0), evaluated(&back, 0));
    let (mut a, mut b) = ([0; 4096], [0; 4096]);
    let mut drive = enabled(config(0, start_of(&packed)), &mut a, &mut b);
    table_frames(&packed, 0, FrameSize::Classic).iter().for_each(|frame| drive.receive(frame, 0));
    send(&mut drive, ids::BROADCAST, &HostMessage::Start { table: 1, tick: 0 });
    assert!(is_ready(&mut drive, 1));
    let mut pending = table_frames(&back, 0, FrameSize::Classic).into_iter();
    let end = expected.0.len() as u64 - 1;
    let mut found = Vec::new();
    for tick in 0..end + expected.1.len() as u64 {
        found.push(drive.tick());
        pending.by_ref().take(3).for_each(|frame| drive.receive(&frame, 0));
        if pending.len() == 0 && tick + 1 < end {
            let early = HostMessage::Start { table: 2, tick: end - 1 };
            if drive.status().fill <= end {
                send(&mut drive, ids::BROADCAST, &early);
                let reasons = answers(&mut drive);
                assert!(
                    reasons
                        .contains(&DriveMessage::Reject { table: 2, reason: Reject::Overlap { tick: end } })
                );
                send(&mut drive, ids::BROADCAST, &HostMessage::Start { table: 2, tick: end });
            }
        }
    }
    let all: Vec<_> = expected.0[..end as usize].iter().chain(&expected.1).copied().collect();
    assert_eq!(found, all);
    assert_eq!(drive.status().state, State::Holding);
    assert_eq!(drive.status().position, start_of(&packed));
}

#[test]
fn one_lost_frame_anywhere_means_no_motion_until_it_is_sent_again() {
    let (_, packed) = sample(33);
    let all = table_frames(&packed, 0, FrameSize::Fd);
    for lost in 0..all.len() {
        let (mut a, mut b) = ([0; 4096], [0; 4096]);
        let mut drive = enabled(config(0, start_of(&packed)), &mut a, &mut b);
        all.iter().enumerate().filter(|(i, _)| *i != lost).for_each(|(_, frame)| drive.receive(frame, 0));
        assert!(!is_ready(&mut drive, 1), "frame {lost}");
        send(&mut drive, ids::BROADCAST, &HostMessage::Start { table: 1, tick: 1 });
        assert!((0..50).all(|_| drive.tick() == Setpoint::at_rest(start_of(&packed))));
        answers(&mut drive);
        all.iter().for_each(|frame| drive.receive(frame, 0));
        assert!(is_ready(&mut drive, 1), "frame {lost}");
    }
}

#[test]
fn doubled_messages_change_nothing() {
    let (_, packed) = sample(34);
    let (mut a, mut b) = ([0; 4096], [0; 4096]);
    let mut drive = enabled(config(0, start_of(&packed)), &mut a, &mut b);
    for frame in table_frames(&packed, 0, FrameSize::Classic) {
        drive.receive(&frame, 0);
        drive.receive(&frame, 0);
    }
    let answers = answers(&mut drive);
    assert!(!answers.is_empty());
    assert!(answers.iter().all(|answer| matches!(answer, DriveMessage::Ready { table: 1, .. })));
}

#[test]
fn tables_that_do_not_fit_are_refused_by_name() {
    let (_, packed) = sample(40);
    let start = start_of(&packed);
    let refuse = |config: DriveConfig, packed: &Packed, room: usize| {
        let (mut a, mut b) = (vec![0; room], vec![0; room]);
        let mut drive = enabled(config, &mut a, &mut b);
        table_frames(packed, 0, FrameSize::Classic).iter().for_each(|frame| drive.receive(frame, 0));
        let refused = reason(&mut drive);
        send(&mut drive, ids::BROADCAST, &HostMessage::Start { table: 1, tick: 0 });
        let reason = refused.or_else(|| reason(&mut drive));
        let ready = drive.status().state == State::Armed;
        assert_eq!(ready, reason.is_none());
        if !ready {
            assert!((0..50).all(|_| drive.tick() == Setpoint::at_rest(config.axis.position)));
        }
        reason
    };
    let good = config(0, start);
    let axis = |change: &dyn Fn(&mut AxisConfig)| {
        let mut config = good;
        change(&mut config.axis);
        refuse(config, &packed, 4096)
    };
    assert_eq!(axis(&|_| {}), None);
    assert_eq!(axis(&|c| c.position += 1), Some(Reject::Position { position: start + 1 }));
    assert_eq!(axis(&|c| c.axis = 3), Some(Reject::Axis { axis: 3 }));
    assert_eq!(axis(&|c| c.tick_ns = 250_000), Some(Reject::Tick { tick_ns: 250_000 }));
    assert_eq!(axis(&|c| c.limits.velocity = 1.0), Some(Reject::Limits));
    assert_eq!(axis(&|c| c.limits.jerk = Some(1.0)), Some(Reject::Limits));
    let needed = packed.header.shared_bytes();
    assert_eq!(
        refuse(good, &packed, 8),
        Some(Reject::NoRoom { needed: needed + needed.div_ceil(40), available: 8 })
    );
    let changed = |change: &dyn Fn(&mut Packed)| {
        let mut packed = packed.clone();
        change(&mut packed);
        refuse(good, &packed, 4096)
    };
    let header = |field| Some(Reject::Table(TableError::Header(field)));
    assert_eq!(changed(&|p| p.header.version = 9), header(HeaderField::Version));
    assert_eq!(changed(&|p| p.header.q_scale = f32::NAN), header(HeaderField::QScale));
    assert_eq!(changed(&|p| p.axes[0].header.limits.velocity = -1.0), header(HeaderField::Limits));
    assert_eq!(changed(&|p| p.axes[0].header.end += 1), Some(Reject::Table(TableError::End)));
    assert_eq!(changed(&|p| p.header.q_scale *= 1e9), Some(Reject::Table(TableError::Fast { index: 0 })));
    assert_eq!(changed(&|p| p.header.q_scale *= 1e-12), Some(Reject::Table(TableError::Slow { index: 0 })));
}

#[test]
fn starts_are_refused_by_name() {
    let (_, packed) = sample(41);
    let (mut a, mut b) = ([0; 4096], [0; 4096]);
    let mut drive = enabled(config(0, start_of(&packed)), &mut a, &mut b);
    let start = |drive: &mut Drive<'_>, table, tick| {
        send(drive, ids::BROADCAST, &HostMessage::Start { table, tick });
        reason(drive)
    };
    assert_eq!(start(&mut drive, 1, 0), Some(Reject::NotReady));
    table_frames(&packed, 0, FrameSize::Classic).iter().for_each(|frame| drive.receive(frame, 0));
    drive.tick();
    assert_eq!(start(&mut drive, 2, 9), Some(Reject::NotReady));
    assert_eq!(start(&mut drive, 1, 0), Some(Reject::Late { tick: 1 }));
    assert_eq!(start(&mut drive, 1, 1), None);
    assert_eq!(start(&mut drive, 1, 1), None);
    assert_eq!(start(&mut drive, 1, 2), Some(Reject::Busy));
    send(&mut drive, ids::BROADCAST, &HostMessage::Stop);
    assert_eq!(drive.status().state, State::Idle);
    assert_eq!(start(&mut drive, 1, 5), Some(Reject::Epoch { epoch: 1 }));
    assert!((0..50).all(|_| drive.tick() == Setpoint::at_rest(start_of(&packed))));
    let lonely = HostMessage::Seal { table: 1, part: Part::Shared, crc: 1 };
    send(&mut drive, ids::BROADCAST, &lonely);
    assert_eq!(reason(&mut drive), Some(Reject::Epoch { epoch: 1 }));
}

#[test]
fn a_running_table_survives_stop_and_every_message_about_others() {
    let (_, packed) = sample(42);
    let expected = evaluated(&packed, 0);
    let (mut a, mut b) = ([0; 4096], [0; 4096]);
    let mut drive = enabled(config(0, start_of(&packed)), &mut a, &mut b);
    table_frames(&packed, 0, FrameSize::Classic).iter().for_each(|frame| drive.receive(frame, 0));
    send(&mut drive, ids::BROADCAST, &HostMessage::Start { table: 1, tick: 0 });
    let open = |table| HostMessage::Open(TableHeader { table, ..packed.header });
    for (tick, setpoint) in expected.iter().enumerate() {
        match tick % 4 {
            1 => send(&mut drive, ids::BROADCAST, &HostMessage::Stop),
            2 => send(&mut drive, ids::BROADCAST, &open(1)),
            3 => send(&mut drive, ids::BROADCAST, &open(2)),
            _ if tick > 0 => {
                table_frames(&packed, 0, FrameSize::Classic).iter().for_each(|f| drive.receive(f, 0));
            }
            _ => {}
        }
        assert_eq!(drive.tick(), *setpoint, "tick {tick}");
        answers(&mut drive);
    }
}

#[test]
fn beats_come_at_their_period_and_a_status_with_every_tenth_or_change() {
    let (_, packed) = sample(43);
    let (mut a, mut b) = ([0; 4096], [0; 4096]);
    let mut config = config(0, start_of(&packed));
    config.axis.status_ticks = 20;
    let mut drive = enabled(config, &mut a, &mut b);
    let (mut beats, mut statuses) = (Vec::new(), Vec::new());
    let mut receiver = Reassembler::<96>::new();
    for tick in 0..400 {
        if tick == 250 {
            send(&mut drive, ids::BROADCAST, &HostMessage::Power(PowerEvent::DisableOperation));
        }
        drive.tick();
        while let Some(frame) = drive.poll_transmit() {
            if Node::of_beat(frame.id()).is_some() {
                beats.push(Beat::parse(frame.data()).unwrap());
            } else if Node::of_answer(frame.id()).is_some()
                && let Some((1, bytes)) = receiver.push(frame.data()).unwrap()
                && let DriveMessage::Status(status) = decode(bytes).unwrap()
            {
                statuses.push((tick, status.tick, status.power));
            }
        }
    }
    assert_eq!(beats.len(), 20);
    assert_eq!((beats[0].state, beats[0].open, beats[0].synced, beats[0].free), (State::Idle, true, true, 2));
    let (on, off) = (Power::OperationEnabled, Power::SwitchedOn);
    assert_eq!(statuses, [(19, 20, on), (219, 220, on), (259, 260, off)]);
}

/// A header with one bit of its bytes changed, if that is a header.
fn mutated(header: &TableHeader, random: &mut Random) -> Option<TableHeader> {
    let mut buffer = [0; HEADER_BYTES];
    let mut bytes = encode(header, &mut buffer).unwrap().to_vec();
    let at = random.whole(0, bytes.len() as u64 - 1) as usize;
    bytes[at] ^= 1 << random.whole(0, 7);
    decode(&bytes).ok()
}

#[test]
fn mutated_tables_are_refused_or_play_to_their_declared_end() {
    let mut random = Random::new(50);
    let (mut refused, mut accepted) = (0, 0);
    for _ in 0..4000 {
        let kind = Kind { longest_counts: 5e3, ..COARSE };
        let mut packed = Sample::new(&mut random, kind).packed(1).unwrap();
        for _ in 0..random.whole(1, 3) {
            let axis = &mut packed.axes[0];
            let bytes = if random.whole(0, 1) == 0 { &mut packed.shared } else { &mut axis.controls };
            let at = random.whole(0, bytes.len() as u64 - 1) as usize;
            bytes[at] ^= 1 << random.whole(0, 7);
        }
        if random.whole(0, 3) == 0 {
            let Some(header) = mutated(&packed.header, &mut random) else { continue };
            packed.header = header;
        }
        let part = &packed.axes[0];
        let view = TableView::new(&packed.header, &part.header, &packed.shared, &part.controls);
        let Ok(table) = view.and_then(TableView::check) else {
            refused += 1;
            continue;
        };
        accepted += 1;
        let mut cursor = Cursor::new(&table).unwrap();
        for i in 0..=50 {
            let setpoint = cursor.evaluate(&table, table.duration() / 50 * i).unwrap();
            assert!(setpoint.velocity.is_finite() && setpoint.acceleration.is_finite());
        }
        let end = cursor.evaluate(&table, table.duration()).unwrap();
        assert_eq!(end, Setpoint::at_rest(part.header.end));
    }
    assert!(refused > 1000 && accepted > 100, "{refused} {accepted}");
}

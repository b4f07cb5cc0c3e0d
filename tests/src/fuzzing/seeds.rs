//! Valid inputs to begin with.

use planner::feed::file::{FeedWriter, FileHeader};
use planner::feed::messages::frames;
use protocol::bus::beat::Beat;
use protocol::bus::emergency::{Cause, Emergency, STOP_CODE};
use protocol::bus::stop::Stop;
use protocol::bus::sync::{self, Time};
use protocol::bus::{Frame, FrameSize, Node, ids, slcan as lines};
use protocol::message::{DriveMessage, Gaps, HostMessage, Part, Reject, State, Status, encode};
use protocol::power::{Power, PowerEvent};

use super::receiver::{op, packed};
use crate::fleet::Job;

fn node() -> Node {
    Node::new(1).unwrap()
}

fn beat() -> Beat {
    Beat {
        state: State::Running,
        power: Power::OperationEnabled,
        open: true,
        fault: false,
        synced: true,
        stopping: false,
        free: 1,
        committed: 2,
        epoch: 1,
        residual_us: 0,
        fill_ms: 500,
        change: 0,
    }
}

fn all_frames() -> Vec<Frame> {
    let emergency = Emergency { code: STOP_CODE, cause: Cause::Told, tick: 99 };
    let mut all: Vec<Frame> = [
        beat().frame(node()),
        emergency.frame(node()),
        sync::sync(3),
        Time { counter: 3, tick: 99, ns: 5 }.frame(),
        Stop::Path { tick: None }.frame(),
        Stop::Path { tick: Some(99) }.frame(),
        Stop::Quick.frame(),
        Stop::Off.frame(),
        Frame::new(ids::NMT, &[129, 0]),
    ]
    .into_iter()
    .flatten()
    .collect();
    all.extend(packed().frames(0, node(), FrameSize::Classic, 1));
    all
}

pub(super) fn frame() -> Vec<Vec<u8>> {
    let bytes = |frame: Frame| [&frame.id().to_le_bytes()[..], frame.data()].concat();
    all_frames().into_iter().take(40).map(bytes).collect()
}

pub(super) fn slcan() -> Vec<Vec<u8>> {
    let mut buffer = [0; lines::LINE_BYTES];
    let mut all: Vec<Vec<u8>> =
        all_frames().iter().take(30).map(|frame| lines::line(frame, &mut buffer).to_vec()).collect();
    let long = Frame::new(0x7ff, &[0x5a; 64]).unwrap();
    all.push([lines::line(&long, &mut buffer), b"z\rS8\rO\r\x07t00100000\r"].concat());
    all.push(all.concat());
    all
}

fn messages() -> Vec<HostMessage<'static>> {
    let packed = packed();
    vec![
        HostMessage::Open(packed.header),
        HostMessage::OpenAxis(packed.axes[0].header),
        HostMessage::Seal { table: 1, part: Part::Shared, crc: packed.shared_crc() },
        HostMessage::Start { table: 1, tick: 300 },
        HostMessage::Stop,
        HostMessage::Identify,
        HostMessage::QuickStop,
        HostMessage::MoveTo { position: 1000, velocity: Some(1e3) },
        HostMessage::MoveAt { velocity: -1e3 },
        HostMessage::Power(PowerEvent::EnableOperation),
        HostMessage::Override { permille: 500, tick: 300, number: 1 },
        HostMessage::Alive,
        HostMessage::Begin { boot: 7, members: 1 },
        HostMessage::Report,
    ]
}

pub(super) fn host_message() -> Vec<Vec<u8>> {
    let mut buffer = [0; 256];
    messages().iter().map(|message| encode(message, &mut buffer).unwrap().to_vec()).collect()
}

pub(super) fn reassembler() -> Vec<Vec<u8>> {
    let of = |size: FrameSize, message: &HostMessage<'_>| {
        let all = frames(ids::BROADCAST, size, 1, message);
        all.iter().flat_map(|frame| [&[frame.data().len() as u8][..], frame.data()].concat()).collect()
    };
    let sizes = [FrameSize::Classic, FrameSize::Fd];
    sizes.iter().flat_map(|size| messages().into_iter().map(move |message| of(*size, &message))).collect()
}

pub(super) fn drive_message() -> Vec<Vec<u8>> {
    let status = Status {
        state: State::Running,
        power: Power::OperationEnabled,
        fault: None,
        tick: 77,
        position: -5,
        fill: 9,
    };
    let gaps = Gaps([(1, 2), (3, 4), (5, 6), (0, 0), (0, 0), (0, 0), (0, 0), (0, 0)]);
    let all = [
        DriveMessage::Ready { table: 1, ticks: 300, crc: [1, 2] },
        DriveMessage::Reject { table: 1, reason: Reject::NoRoom { needed: 1 << 40, available: 3 } },
        DriveMessage::Status(status),
        DriveMessage::Missing { table: 1, part: Part::Axis, gaps },
        DriveMessage::Begun { epoch: 3 },
    ];
    let mut buffer = [0; 256];
    all.iter().map(|message| encode(message, &mut buffer).unwrap().to_vec()).collect()
}

pub(super) fn varint() -> Vec<Vec<u8>> {
    vec![
        vec![0],
        vec![0x80, 1],
        vec![0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1],
        packed().shared.clone(),
    ]
}

pub(super) fn streams() -> Vec<Vec<u8>> {
    let packed = packed();
    let shared = [&[packed.header.spans as u8, 0, packed.header.geometry_bytes as u8], &packed.shared[..]];
    vec![shared.concat(), [&[9, 1, 3], &packed.axes[0].controls[..]].concat()]
}

pub(super) fn table() -> Vec<Vec<u8>> {
    let packed = packed();
    let mut buffer = [0; 256];
    packed
        .axes
        .iter()
        .map(|axis| {
            let mut all = Vec::new();
            let header = encode(&packed.header, &mut buffer).unwrap().to_vec();
            let axis_header = encode(&axis.header, &mut buffer).unwrap().to_vec();
            for piece in [&header, &axis_header, &packed.shared] {
                all.extend((piece.len() as u16).to_le_bytes());
                all.extend_from_slice(piece);
            }
            all.extend_from_slice(&axis.controls);
            all
        })
        .collect()
}

pub(super) fn feed_file() -> Vec<Vec<u8>> {
    let job = Job::short(host_sim::bus::BitTiming::default());
    let header = FileHeader::from(&job.machine);
    let mut out = Vec::new();
    let mut writer = FeedWriter::new(&mut out, &header).unwrap();
    job.items.iter().for_each(|item| writer.push(item).unwrap());
    writer.finish().unwrap();
    vec![out]
}

pub(super) fn receiver() -> Vec<Vec<u8>> {
    let up = [op::TICKS, 3, op::BEGIN, 1, op::POWER, 0, op::POWER, 2, op::TICKS, 2];
    let play = [op::TABLE, 255, op::ALIVE, op::TICKS, 1, op::START, 20];
    let with = |more: &[u8]| [&up[..], &play, more].concat();
    let mut all = vec![
        with(&[op::TICKS, 120, op::ALIVE, op::TICKS, 120, op::ALIVE, op::TICKS, 200]),
        with(&[op::TICKS, 60, op::STOP, 1, op::TICKS, 200, op::START, 5, op::TICKS, 50]),
        with(&[op::TICKS, 60, op::STOP, 0, op::TICKS, 200, op::BEGIN, 1, op::TICKS, 50]),
        with(&[op::TICKS, 40, op::OVERRIDE, 0, op::TICKS, 90, op::ALIVE, op::OVERRIDE, 125, op::TICKS, 150]),
        with(&[op::TICKS, 60, op::TRIP, 5, op::TICKS, 100, op::POWER, 6, op::POWER, 0, op::POWER, 2]),
        with(&[op::TICKS, 255, op::TICKS, 255]),
        [
            &up[..],
            &[op::MOVE, 200, 0, op::TICKS, 50, op::MOVE, 90, 1, op::TICKS, 80, op::STOP, 2, op::TICKS, 9],
        ]
        .concat(),
    ];
    let mut framed = up.to_vec();
    for frame in all_frames() {
        let [low, high] = frame.id().to_le_bytes();
        framed.extend([op::FRAME, low, high, frame.data().len() as u8]);
        framed.extend_from_slice(frame.data());
    }
    framed.extend([op::TICKS, 30]);
    all.push(framed);
    let mut buffer = [0; 256];
    for message in messages() {
        let bytes = encode(&message, &mut buffer).unwrap();
        let piece = [&[op::MESSAGE, 1, bytes.len() as u8], bytes, &[op::TICKS, 40]].concat();
        all.push(with(&piece));
    }
    all
}

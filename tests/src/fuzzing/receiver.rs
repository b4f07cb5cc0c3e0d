//! A whole drive that is fed whatever comes.
//!
//! Its set-points are always numbers, and it never sets out from rest but for a command of the epoch that is open: a start of a
//! table, or a move. After a stop nothing does until a newer epoch is open.

use std::sync::OnceLock;

use firmware_core::axis::AxisConfig;
use firmware_core::drive::{Drive, DriveConfig};
use firmware_core::session::Watch;
use planner::feed::messages::frames;
use planner::feed::pack::Packed;
use protocol::bus::stop::Stop;
use protocol::bus::{BLOCK_BYTES, Frame, FrameSize, Node, Reassembler, ids};
use protocol::message::{HostMessage, decode};
use protocol::power::PowerEvent;

use crate::tables::{COARSE, Random, Sample, TICK_NS};

/// The table that it may be sent.
pub(super) fn packed() -> &'static Packed {
    static PACKED: OnceLock<Packed> = OnceLock::new();
    PACKED.get_or_init(|| {
        (0..).find_map(|seed| Sample::new(&mut Random::new(seed), COARSE).packed(1).ok()).unwrap()
    })
}

/// What the input does next; the numbers are those of its first byte.
pub(super) mod op {
    pub(crate) const TICKS: u8 = 0;
    pub(crate) const FRAME: u8 = 1;
    pub(crate) const MESSAGE: u8 = 2;
    pub(crate) const BEGIN: u8 = 3;
    pub(crate) const POWER: u8 = 4;
    pub(crate) const TABLE: u8 = 5;
    pub(crate) const START: u8 = 6;
    pub(crate) const MOVE: u8 = 7;
    pub(crate) const STOP: u8 = 8;
    pub(crate) const OVERRIDE: u8 = 9;
    pub(crate) const ALIVE: u8 = 10;
    pub(crate) const TRIP: u8 = 11;
    pub(crate) const COUNT: u8 = 12;
}

const EVENTS: [PowerEvent; 9] = [
    PowerEvent::Shutdown,
    PowerEvent::SwitchOn,
    PowerEvent::EnableOperation,
    PowerEvent::DisableOperation,
    PowerEvent::DisableVoltage,
    PowerEvent::QuickStop,
    PowerEvent::ResetFault,
    PowerEvent::Fault,
    PowerEvent::Stopped,
];

/// The drive, and what it may do.
struct Witness<'a> {
    drive: Drive<'a>,
    incoming: [Reassembler<BLOCK_BYTES>; 2],
    position: i64,
    rests: bool,
    /// The newest epoch that was open.
    epoch: u16,
    /// Something was commanded in it.
    commanded: bool,
    /// A stop has ended it.
    barred: bool,
    moved: bool,
}

impl Witness<'_> {
    fn receive(&mut self, frame: &Frame) {
        let (epoch, open) = self.drive.epoch();
        let line = [ids::BROADCAST, node().to_drive()].iter().position(|id| *id == frame.id());
        let block = line.and_then(|line| self.incoming[line].push(frame.data()).ok().flatten());
        if let Some((of, bytes)) = block
            && let Ok(message) = decode::<HostMessage<'_>>(bytes)
        {
            match message {
                HostMessage::Start { .. } | HostMessage::MoveTo { .. } | HostMessage::MoveAt { .. } => {
                    self.commanded |= open && of == epoch;
                }
                HostMessage::QuickStop
                | HostMessage::Power(PowerEvent::QuickStop | PowerEvent::DisableVoltage) => {
                    self.barred = true;
                }
                _ => {}
            }
        }
        if matches!(Stop::of(frame, node().number()), Some(Stop::Quick | Stop::Off)) {
            self.barred = true;
        }
        self.drive.receive(frame, 0);
        self.look();
    }

    fn look(&mut self) {
        let (epoch, open) = self.drive.epoch();
        if open && epoch != self.epoch {
            (self.epoch, self.commanded, self.barred) = (epoch, false, false);
        }
    }

    fn send(&mut self, epoch: u16, message: &HostMessage<'_>) {
        let all = frames(node().to_drive(), FrameSize::Classic, epoch, message);
        all.iter().for_each(|frame| self.receive(frame));
    }

    fn tick(&mut self) {
        let setpoint = self.drive.tick();
        let sound = setpoint.velocity.is_finite() && setpoint.acceleration.is_finite();
        assert!(sound, "{setpoint:?}");
        let moves = !setpoint.done || setpoint.position != self.position;
        self.moved |= moves;
        if moves && self.rests {
            assert!(self.commanded, "it sets out without a command: {setpoint:?} {:?}", self.drive.status());
            assert!(!self.barred, "it sets out after a stop: {setpoint:?} {:?}", self.drive.status());
        }
        (self.position, self.rests) = (setpoint.position, setpoint.done);
        self.drive.observe(setpoint.position);
        for _ in 0..4 {
            if let Some(frame) = self.drive.poll_transmit() {
                self.drive.sent(&frame, 1_000);
            }
        }
        self.look();
    }
}

fn node() -> Node {
    Node::new(1).unwrap()
}

/// Takes the next bytes of the input.
fn take<'a>(input: &mut &'a [u8], count: usize) -> &'a [u8] {
    let (taken, rest) = input.split_at(count.min(input.len()));
    *input = rest;
    taken
}

/// Lets a drive live through the input.
pub fn receiver(bytes: &[u8]) {
    let _ = lives(bytes);
}

/// The same; whether it has moved.
pub fn lives(bytes: &[u8]) -> bool {
    let packed = packed();
    let (mut a, mut b) = ([0u8; 4096], [0u8; 4096]);
    let position = packed.axes[0].header.start;
    let axis =
        AxisConfig { position, status_ticks: 8, ..AxisConfig::new(0, TICK_NS, packed.axes[0].header.limits) };
    let watch = Watch { boot: 7, host_ticks: 150, ..Watch::new(TICK_NS, 8) };
    let config = DriveConfig { node: node(), frames: FrameSize::Classic, axis, watch, key: None };
    let mut witness = Witness {
        drive: Drive::new(config, &mut a, &mut b),
        incoming: [Reassembler::new(), Reassembler::new()],
        position,
        rests: true,
        epoch: 0,
        commanded: false,
        barred: false,
        moved: false,
    };
    let mut input = bytes;
    let mut ticks = 0u32;
    while let [what, rest @ ..] = input {
        input = rest;
        let argument = |input: &mut &[u8]| take(input, 1).first().copied().unwrap_or(0);
        let epoch = witness.drive.epoch().0;
        match what % op::COUNT {
            op::TICKS => {
                let count = u32::from(argument(&mut input)).min(4_000 - ticks);
                ticks += count;
                (0..count).for_each(|_| witness.tick());
                if ticks >= 4_000 {
                    break;
                }
            }
            op::FRAME => {
                let head = take(&mut input, 3);
                let [low, high, length] = *head else { break };
                let id = u16::from_le_bytes([low, high]) & 0x7ff;
                let data = take(&mut input, usize::from(length % 65));
                witness.receive(&Frame::new(id, data).unwrap());
            }
            op::MESSAGE => {
                let head = take(&mut input, 2);
                let [apart, length] = *head else { break };
                if let Ok(message) = decode::<HostMessage<'_>>(take(&mut input, usize::from(length))) {
                    witness.send(epoch.wrapping_add(u16::from(apart % 3)).wrapping_sub(1), &message);
                }
            }
            op::BEGIN => {
                let newer = u16::from(argument(&mut input) % 4);
                let boot = if newer == 3 { 6 } else { 7 };
                witness.send(epoch.wrapping_add(newer), &HostMessage::Begin { boot, members: 1 });
            }
            op::POWER => {
                let event = EVENTS[usize::from(argument(&mut input)) % EVENTS.len()];
                witness.send(epoch, &HostMessage::Power(event));
            }
            op::TABLE => {
                let all = packed.frames(0, node(), FrameSize::Classic, epoch);
                let count = usize::from(argument(&mut input)) * all.len() / 255;
                all.iter().take(count).for_each(|frame| witness.receive(frame));
            }
            op::START => {
                let tick = witness.drive.status().tick + u64::from(argument(&mut input));
                witness.send(epoch, &HostMessage::Start { table: packed.header.table, tick });
            }
            op::MOVE => {
                let [to, fast] = [argument(&mut input), argument(&mut input)];
                let message = if fast % 2 == 0 {
                    HostMessage::MoveTo { position: position + (i64::from(to) - 128) * 50, velocity: None }
                } else {
                    HostMessage::MoveAt { velocity: (f32::from(to) - 128.0) * 10.0 }
                };
                witness.send(epoch, &message);
            }
            op::STOP => {
                let stop =
                    [Stop::Path { tick: None }, Stop::Quick, Stop::Off, Stop::Path { tick: Some(300) }];
                let frame = stop[usize::from(argument(&mut input) % 4)].frame().unwrap();
                witness.receive(&frame);
            }
            op::OVERRIDE => {
                let permille = u16::from(argument(&mut input)) * 8;
                let tick = witness.drive.status().tick + 10;
                witness.send(epoch, &HostMessage::Override { permille, tick, number: 0 });
            }
            op::ALIVE => witness.send(epoch, &HostMessage::Alive),
            _ => witness.drive.trip(u16::from(argument(&mut input))),
        }
    }
    (0..20).for_each(|_| witness.tick());
    witness.moved
}

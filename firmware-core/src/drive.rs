//! A drive on the bus: its halves behind CAN frames.

use protocol::bus::{BLOCK_BYTES, Frame, FrameSize, Node, Reassembler, Segments, ids};
use protocol::message::{DriveMessage, HostMessage, Status, decode, encode};

use crate::axis::AxisConfig;
use crate::evaluate::Setpoint;
use crate::intake::{Intake, Orders};
use crate::orders::Report;
use crate::player::Player;

/// Longest answer [bytes].
const ANSWER_BYTES: usize = 64;

/// What a drive is on its bus, and on its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveConfig {
    /// Its address.
    pub node: Node,
    /// Which frames it sends.
    pub frames: FrameSize,
    /// Its axis.
    pub axis: AxisConfig,
}

/// Messages out of frames, and answers into frames.
#[derive(Debug)]
struct Mail {
    node: Node,
    frames: FrameSize,
    to_all: Reassembler<BLOCK_BYTES>,
    to_this: Reassembler<BLOCK_BYTES>,
    stop: Reassembler<8>,
    /// Frames and messages that could not be understood.
    dropped: u32,
    answer: [u8; ANSWER_BYTES],
    answer_length: usize,
    /// Frames of the answer that were sent.
    sent: usize,
}

impl Mail {
    fn new(config: &DriveConfig) -> Self {
        Self {
            node: config.node,
            frames: config.frames,
            to_all: Reassembler::new(),
            to_this: Reassembler::new(),
            stop: Reassembler::new(),
            dropped: 0,
            answer: [0; ANSWER_BYTES],
            answer_length: 0,
            sent: 0,
        }
    }

    /// The message that a frame completes, if any; frames of others are ignored.
    #[inline(never)]
    fn receive(&mut self, frame: &Frame) -> Option<HostMessage<'_>> {
        let message = if frame.id() == ids::STOP {
            self.stop.push(frame.data())
        } else if frame.id() == ids::BROADCAST {
            self.to_all.push(frame.data())
        } else if frame.id() == self.node.to_drive() {
            self.to_this.push(frame.data())
        } else {
            return None;
        };
        match message.map(|message| message.map(decode::<HostMessage<'_>>)) {
            Ok(None) => None,
            Ok(Some(Ok(message))) => Some(message),
            Ok(Some(Err(_))) | Err(_) => {
                self.dropped = self.dropped.saturating_add(1);
                None
            }
        }
    }

    /// The next frame to send; `answers` are fetched one by one.
    #[inline(never)]
    fn poll_transmit(&mut self, mut answers: impl FnMut() -> Option<DriveMessage>) -> Option<Frame> {
        loop {
            let message = self.answer.get(..self.answer_length).unwrap_or(&[]);
            let mut frames = Segments::new(self.node.from_drive(), self.frames, message);
            if self.answer_length > 0
                && let Some(frame) = frames.as_mut().and_then(|frames| frames.nth(self.sent))
            {
                self.sent += 1;
                return Some(frame);
            }
            let answer = answers()?;
            self.sent = 0;
            self.answer_length = encode(&answer, &mut self.answer).map_or(0, <[u8]>::len);
        }
    }
}

/// The talking half of a drive behind frames: for boards, where [`crate::motion::Motion`] runs in the control interrupt.
#[derive(Debug)]
pub struct Station<'a> {
    mail: Mail,
    intake: Intake<'a>,
}

impl<'a> Station<'a> {
    /// With two buffers for tables.
    pub fn new(config: DriveConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Self {
        Self { mail: Mail::new(&config), intake: Intake::new(config.axis, a, b) }
    }

    /// Takes a frame from the bus.
    pub fn receive(&mut self, frame: &Frame, orders: &mut dyn Orders<'a>) {
        if let Some(message) = self.mail.receive(frame) {
            self.intake.handle(&message, orders);
        }
    }

    /// Takes what the motion has said.
    pub fn hear(&mut self, report: Report<'a>) {
        self.intake.hear(report);
    }

    /// What could not be ordered before is ordered now.
    pub fn retry(&mut self, orders: &mut dyn Orders<'a>) {
        self.intake.retry(orders);
    }

    /// The next frame to send.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        let intake = &mut self.intake;
        self.mail.poll_transmit(|| intake.poll_answer())
    }
}

/// One drive in one piece: for hosts, where nothing interrupts anything.
#[derive(Debug)]
pub struct Drive<'a> {
    mail: Mail,
    player: Player<'a>,
}

impl<'a> Drive<'a> {
    /// A drive at rest and without torque, with two buffers for tables.
    pub fn new(config: DriveConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Self {
        Self { mail: Mail::new(&config), player: Player::new(config.axis, a, b) }
    }

    /// Takes a frame from the bus; frames of others are ignored.
    pub fn receive(&mut self, frame: &Frame) {
        if let Some(message) = self.mail.receive(frame) {
            self.player.handle(&message);
        }
    }

    /// The set-point of this tick; call it once per control tick.
    pub fn tick(&mut self) -> Setpoint {
        self.player.tick()
    }

    /// Tells where the axis really is, after [`Drive::tick`].
    pub fn observe(&mut self, actual: i64) {
        self.player.observe(actual);
    }

    /// The next frame to send.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        let player = &mut self.player;
        self.mail.poll_transmit(|| player.poll_answer())
    }

    /// How the drive is.
    pub fn status(&self) -> Status {
        self.player.status()
    }

    /// How many frames and messages could not be understood.
    pub fn dropped(&self) -> u32 {
        self.mail.dropped
    }
}

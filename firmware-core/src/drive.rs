//! A drive on the bus: the player behind CAN frames.

use protocol::bus::{BLOCK_BYTES, Frame, FrameSize, Node, Reassembler, Segments, ids};
use protocol::message::{HostMessage, Status, decode, encode};

use crate::evaluate::Setpoint;
use crate::player::{AxisConfig, Player};

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

/// One drive.
#[derive(Debug)]
pub struct Drive<'a> {
    node: Node,
    frames: FrameSize,
    player: Player<'a>,
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

impl<'a> Drive<'a> {
    /// A drive at rest, with two buffers for tables.
    pub fn new(config: DriveConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Self {
        Self {
            node: config.node,
            frames: config.frames,
            player: Player::new(config.axis, a, b),
            to_all: Reassembler::new(),
            to_this: Reassembler::new(),
            stop: Reassembler::new(),
            dropped: 0,
            answer: [0; ANSWER_BYTES],
            answer_length: 0,
            sent: 0,
        }
    }

    /// Takes a frame from the bus; frames of others are ignored.
    #[inline(never)]
    pub fn receive(&mut self, frame: &Frame) {
        let message = if frame.id() == ids::STOP {
            self.stop.push(frame.data())
        } else if frame.id() == ids::BROADCAST {
            self.to_all.push(frame.data())
        } else if frame.id() == self.node.to_drive() {
            self.to_this.push(frame.data())
        } else {
            return;
        };
        match message.map(|message| message.map(decode::<HostMessage<'_>>)) {
            Ok(None) => {}
            Ok(Some(Ok(message))) => self.player.handle(&message),
            Ok(Some(Err(_))) | Err(_) => self.dropped = self.dropped.saturating_add(1),
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

    /// Tells what a tick has cost, in whatever the board counts.
    pub fn observe_cost(&mut self, count: u32) {
        self.player.observe_cost(count);
    }

    /// The next frame to send.
    #[inline(never)]
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        loop {
            let message = self.answer.get(..self.answer_length).unwrap_or(&[]);
            let mut frames = Segments::new(self.node.from_drive(), self.frames, message);
            if self.answer_length > 0
                && let Some(frame) = frames.as_mut().and_then(|frames| frames.nth(self.sent))
            {
                self.sent += 1;
                return Some(frame);
            }
            let answer = self.player.poll_answer()?;
            self.sent = 0;
            self.answer_length = encode(&answer, &mut self.answer).map_or(0, <[u8]>::len);
        }
    }

    /// How the drive is.
    pub fn status(&self) -> Status {
        self.player.status()
    }

    /// How many frames and messages could not be understood.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }
}

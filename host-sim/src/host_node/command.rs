//! What the host has to say, and the frames of it.

use planner::feed::messages::signed_frames;
use protocol::bus::stop::Stop;
use protocol::bus::{Frame, Node, ids};
use protocol::message::HostMessage;
use protocol::power::PowerEvent;

use super::upload::{Block, Upload};
use super::{HostNode, Phase};

/// Something to say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Command {
    Identify,
    /// To one drive, by its index.
    Begin {
        drive: usize,
        boot: u32,
        members: u128,
        epoch: u16,
    },
    Alive,
    Send(Block),
    Start {
        table: u32,
        tick: u64,
    },
    /// What has not begun does not begin.
    Cancel,
    Stop(Stop),
    Rate(Change),
    /// To one drive, by its index.
    Power(usize, PowerEvent),
    /// To one drive, by its index.
    Tell(usize, HostMessage<'static>),
}

/// A change of the rate of path time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Change {
    pub(super) permille: u16,
    pub(super) tick: u64,
    pub(super) number: u8,
    pub(super) repeat_at: u64,
}

impl HostNode {
    /// The frames of a command.
    pub(super) fn frames_of(&self, command: Command) -> Vec<Frame> {
        let mut epoch = self.greeting.epoch();
        let to = |drive: usize| self.drives.get(drive).map_or(ids::BROADCAST, |link| link.address.to_drive());
        let (id, message) = match command {
            Command::Identify => (ids::BROADCAST, HostMessage::Identify),
            Command::Begin { drive, boot, members, epoch: new } => {
                epoch = new;
                (to(drive), HostMessage::Begin { boot, members })
            }
            Command::Alive => (ids::BROADCAST, HostMessage::Alive),
            Command::Send(block) => {
                let (Phase::Uploading(upload) | Phase::Starting { upload, .. }) = &self.phase else {
                    return Vec::new();
                };
                return self.frames_of_block(upload, block);
            }
            Command::Start { table, tick } => (ids::BROADCAST, HostMessage::Start { table, tick }),
            Command::Cancel => (ids::BROADCAST, HostMessage::Stop),
            Command::Stop(stop) => return stop.frame().into_iter().collect(),
            Command::Rate(Change { permille, tick, number, .. }) => {
                (ids::BROADCAST, HostMessage::Override { permille, tick, number })
            }
            Command::Power(drive, event) => (to(drive), HostMessage::Power(event)),
            Command::Tell(drive, message) => (to(drive), message),
        };
        self.sign(id, epoch, &message)
    }

    /// The frames of a message, under the key if there is one.
    fn sign(&self, id: u16, epoch: u16, message: &HostMessage<'_>) -> Vec<Frame> {
        let counter = self.stamp_us.max(self.counter.get() + 1);
        self.counter.set(counter);
        signed_frames(id, self.frames, epoch, message, self.key.as_ref(), counter)
    }

    fn frames_of_block(&self, upload: &Upload, block: Block) -> Vec<Frame> {
        let node = |axis: Option<usize>| {
            axis.and_then(|axis| self.drives.get(axis)).map(|link| link.address).or(Node::new(1))
        };
        if let Block::Data { axis, unit } = block {
            let frame = node(axis).and_then(|to| upload.packed().data_frame(axis, to, self.frames, unit));
            return frame.into_iter().collect();
        }
        let (axis, message) = match (block, &self.key) {
            (Block::Seal(axis), Some(key)) => (axis, upload.packed().seal_under(axis, key)),
            _ => upload.message(block),
        };
        let id = axis.and_then(node_of(&self.drives)).unwrap_or(ids::BROADCAST);
        let epoch = self.greeting.epoch();
        self.sign(id, epoch, &message)
    }
}

fn node_of(drives: &[super::Link]) -> impl Fn(usize) -> Option<u16> + '_ {
    |axis| drives.get(axis).map(|link| link.address.to_drive())
}

//! What frames say, in words: every identifier of [`protocol::bus::ids`], and blocks put together.

mod log;
mod words;

use std::collections::BTreeMap;

use protocol::bus::beat::Beat;
use protocol::bus::emergency::Emergency;
use protocol::bus::stop::Stop;
use protocol::bus::sync::Time;
use protocol::bus::{BLOCK_BYTES, Frame, Node, Reassembler, data, ids};
use protocol::message::{DriveMessage, HostMessage, decode};

pub use log::{Line, LineError, line};
pub use words::{power, state};

/// What a frame is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// NMT of CANopen.
    Nmt,
    /// A stop.
    Stop,
    /// SYNC.
    Sync,
    /// The time of a SYNC.
    Time,
    /// An emergency.
    Emergency,
    /// A drive has started up.
    Boot,
    /// A drive's beat.
    Beat,
    /// A message of the host.
    Command,
    /// A message of a drive.
    Answer,
    /// Bytes of a table.
    Data,
    /// A frame of a block that is not complete yet.
    Part,
    /// A frame with one of our identifiers that makes no sense.
    Broken,
    /// Anything else.
    Other,
}

impl Kind {
    /// All of them, in the order of their names' meaning.
    pub const ALL: [Kind; 13] = [
        Kind::Nmt,
        Kind::Stop,
        Kind::Sync,
        Kind::Time,
        Kind::Emergency,
        Kind::Boot,
        Kind::Beat,
        Kind::Command,
        Kind::Answer,
        Kind::Data,
        Kind::Part,
        Kind::Broken,
        Kind::Other,
    ];

    /// Its name, one lower-case word.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::Nmt => "nmt",
            Kind::Stop => "stop",
            Kind::Sync => "sync",
            Kind::Time => "time",
            Kind::Emergency => "emergency",
            Kind::Boot => "boot",
            Kind::Beat => "beat",
            Kind::Command => "command",
            Kind::Answer => "answer",
            Kind::Data => "data",
            Kind::Part => "part",
            Kind::Broken => "broken",
            Kind::Other => "other",
        }
    }
}

/// A frame in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Decoded {
    /// What it is about.
    pub kind: Kind,
    /// The drive that it comes from or goes to; none: all of them, or nobody in particular.
    pub node: Option<u8>,
    /// What it says.
    pub text: String,
}

/// Puts blocks together, identifier by identifier, and frames in words.
#[derive(Debug, Default)]
pub struct Decoder {
    blocks: BTreeMap<u16, Reassembler<BLOCK_BYTES>>,
}

/// The drive behind an identifier that begins at `base`.
fn behind(id: u16, base: u16) -> Option<u8> {
    id.checked_sub(base).and_then(|node| u8::try_from(node).ok()).and_then(Node::new).map(Node::number)
}

impl Decoder {
    /// Nothing was seen yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The next frame, in words.
    pub fn frame(&mut self, frame: &Frame) -> Decoded {
        let (id, bytes) = (frame.id(), frame.data());
        let say = |kind, node, text: Option<String>| match text {
            Some(text) => Decoded { kind, node, text },
            None => Decoded { kind: Kind::Broken, node, text: format!("no {}: {frame:?}", kind.name()) },
        };
        if id == ids::NMT {
            return say(Kind::Nmt, bytes.get(1).copied().filter(|node| *node != 0), words::nmt(bytes));
        }
        if id == ids::STOP {
            return say(Kind::Stop, None, Stop::of(frame, 0).map(words::stop));
        }
        if id == ids::SYNC {
            return say(Kind::Sync, None, bytes.first().map(|counter| format!("number {counter}")));
        }
        if id == ids::TIME {
            return say(Kind::Time, None, Time::parse(bytes).map(words::time));
        }
        if let Some(node) = Node::of_emergency(id) {
            return say(Kind::Emergency, Some(node.number()), Emergency::parse(bytes).map(words::emergency));
        }
        if let Some(node) = Node::of_beat(id) {
            return say(Kind::Beat, Some(node.number()), Beat::parse(bytes).map(|beat| words::beat(&beat)));
        }
        if let Some(node) = Node::of_answer(id) {
            return self.block(frame, Kind::Answer, Some(node.number()));
        }
        let to = behind(id, ids::BROADCAST);
        if id == ids::BROADCAST || to.is_some() {
            return self.block(frame, Kind::Command, to);
        }
        let to = behind(id, ids::DATA);
        if id == ids::DATA || to.is_some() {
            return say(Kind::Data, to, data::parse(bytes).map(|data| words::data(&data)));
        }
        let booted = (1..=127).filter_map(Node::new).find(|node| node.heartbeat() == id);
        match (booted, bytes) {
            (Some(node), [0]) => say(Kind::Boot, Some(node.number()), Some("started up".into())),
            (Some(node), _) => say(Kind::Other, Some(node.number()), Some(format!("heartbeat {frame:?}"))),
            (None, _) => say(Kind::Other, None, Some(format!("{frame:?}"))),
        }
    }

    fn block(&mut self, frame: &Frame, kind: Kind, node: Option<u8>) -> Decoded {
        let block = self.blocks.entry(frame.id()).or_default().push(frame.data());
        let (kind, text) = match block {
            Ok(None) => (Kind::Part, String::new()),
            Err(error) => (Kind::Broken, words::broken(error)),
            Ok(Some((epoch, bytes))) => {
                let text = match kind {
                    Kind::Answer => decode::<DriveMessage>(bytes).map(|message| words::answer(&message)),
                    _ => decode::<HostMessage<'_>>(bytes).map(|message| words::command(&message)),
                };
                match text {
                    Ok(text) => (kind, format!("epoch {epoch}: {text}")),
                    Err(_) => (Kind::Broken, format!("epoch {epoch}: no message of this version")),
                }
            }
        };
        Decoded { kind, node, text }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]
mod tests;

//! The wire between host and drives, in virtual time.
//!
//! [`Bus`] is the seam: nodes attach, send and receive; nothing else is known of the medium. [`InProcessBus`] is
//! the deterministic medium on which nothing goes wrong, [`CanBus`] one that errs as CAN does. Decorators change them:
//! [`Lossy`] drops frames, [`Meddler`] loses, doubles and delays them as it is told, [`Recorder`] writes a candump log.

mod bits;
pub mod can;
pub mod decode;
mod in_process;
mod lossy;
mod meddler;
pub mod real;
mod recorder;
mod timing;

use std::collections::VecDeque;

pub use bits::{Stuffing, WireBits};
pub use can::CanBus;
pub use in_process::InProcessBus;
pub use lossy::Lossy;
pub use meddler::{Fate, Meddler};
pub use protocol::bus::{Frame, FrameSize};
pub use recorder::Recorder;
pub use timing::BitTiming;

/// Virtual time since the simulation began [ns].
pub type Nanoseconds = u64;

/// Transmit events that a controller keeps, the newest.
pub const TRANSMIT_EVENTS: usize = 32;

/// Keeps one transmit event.
fn keep_event(events: &mut VecDeque<Received>, event: Received) {
    if events.len() >= TRANSMIT_EVENTS {
        events.pop_front();
    }
    events.push_back(event);
}

/// A participant of the bus, in the order of attaching.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeIndex(pub usize);

/// A frame as a node gets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// End of the frame on the wire.
    pub time: Nanoseconds,
    /// The frame.
    pub frame: Frame,
}

/// What has crossed the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Frames.
    pub frames: u64,
    /// Payload bytes in them.
    pub bytes: u64,
    /// Time the wire was not idle [ns].
    pub busy: Nanoseconds,
}

/// A medium that every frame sent on reaches all other nodes of.
pub trait Bus {
    /// Adds a node.
    fn attach(&mut self) -> NodeIndex;

    /// Queues a frame for sending at `now`, which never runs backwards.
    fn send(&mut self, node: NodeIndex, frame: Frame, now: Nanoseconds);

    /// Whether a frame more would find room; without it [`Bus::send`] loses the frame.
    fn has_room(&self, _node: NodeIndex) -> bool {
        true
    }

    /// Lets all frames cross that end until `until`.
    fn advance(&mut self, until: Nanoseconds);

    /// The oldest frame that has reached `node` and has not been taken yet.
    fn receive(&mut self, node: NodeIndex) -> Option<Received>;

    /// The oldest frame of `node` that has crossed and was not told yet, as a controller's transmit events tell it. Events
    /// that nobody takes are lost after [`TRANSMIT_EVENTS`].
    fn sent(&mut self, node: NodeIndex) -> Option<Received>;

    /// Frames of `node` still waiting to be sent.
    fn waiting(&self, node: NodeIndex) -> usize;

    /// What has crossed so far.
    fn traffic(&self) -> Traffic;
}

//! Commands to drives that somebody else may have in use: no epoch is opened.

use std::time::{Duration, Instant};

use host_sim::bus::NodeIndex;
use host_sim::bus::real::RealBus;
use planner::feed::messages::signed_frames;
use protocol::authentic::Key;
use protocol::bus::beat::Beat;
use protocol::bus::stop::Stop;
use protocol::bus::{BLOCK_BYTES, FrameSize, Node, Reassembler, ids};
use protocol::message::{DriveMessage, HostMessage, Identity, Status, decode};

use super::key::now_us;
use crate::failure::Failure;

/// How long answers are waited for.
const LISTEN: Duration = Duration::from_millis(600);
/// From a change of rate to its beginning [ticks of 1 ms, scaled to the drive's].
const LEAD_NS: u64 = 200_000_000;
/// How often a stop is sent.
pub(crate) const COPIES: usize = 3;

/// A drive that was heard.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub(crate) node: Node,
    pub(crate) beat: Option<Beat>,
    pub(crate) status: Option<Status>,
    pub(crate) identity: Option<Identity>,
    incoming: Reassembler<BLOCK_BYTES>,
    heard: Option<Instant>,
}

/// A listener on a bus.
pub(crate) struct Remote<'a> {
    bus: &'a mut dyn RealBus,
    node: NodeIndex,
    frames: FrameSize,
    key: Option<Key>,
    found: Vec<Found>,
}

impl<'a> Remote<'a> {
    /// On a bus.
    pub(crate) fn new(bus: &'a mut dyn RealBus, frames: FrameSize, key: Option<Key>) -> Self {
        let node = bus.attach();
        Self { bus, node, frames, key, found: Vec::new() }
    }

    fn now(&self) -> u64 {
        self.bus.now()
    }

    fn say(&mut self, epoch: u16, message: &HostMessage<'_>) {
        let now = self.now();
        let counter = now_us();
        for frame in signed_frames(ids::BROADCAST, self.frames, epoch, message, self.key.as_ref(), counter) {
            self.bus.send(self.node, frame, now);
        }
    }

    /// Listens for a while.
    fn listen(&mut self, time: Duration) {
        let end = Instant::now() + time;
        while Instant::now() < end {
            let now = self.now();
            self.bus.advance(now);
            while let Some(received) = self.bus.receive(self.node) {
                self.hear(received.frame.id(), received.frame.data());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn hear(&mut self, id: u16, data: &[u8]) {
        let Some(node) = Node::of_answer(id).or(Node::of_beat(id)) else { return };
        let at = self.found.iter().position(|found| found.node == node).unwrap_or_else(|| {
            let incoming = Reassembler::new();
            self.found.push(Found { node, beat: None, status: None, identity: None, incoming, heard: None });
            self.found.len() - 1
        });
        let found = &mut self.found[at];
        if id == node.beat() {
            found.beat = Beat::parse(data).or(found.beat);
            return;
        }
        let Ok(Some((_, bytes))) = found.incoming.push(data) else { return };
        match decode::<DriveMessage>(bytes) {
            Ok(DriveMessage::Status(status)) => {
                (found.status, found.heard) = (Some(status), Some(Instant::now()));
            }
            Ok(DriveMessage::Identity(identity)) => found.identity = Some(identity),
            _ => {}
        }
    }

    /// Asks who is there and how everybody is.
    ///
    /// # Errors
    /// Nobody answers.
    pub(crate) fn ask(&mut self) -> Result<Vec<Found>, Failure> {
        for _ in 0..2 {
            self.say(0, &HostMessage::Identify);
            self.say(0, &HostMessage::Report);
            self.listen(LISTEN / 2);
        }
        self.found.sort_by_key(|found| found.node);
        if self.found.is_empty() {
            return Err(Failure::input("no drive answers on this bus").with_help(
                "Check the cable, the bit rate and the drives' supply; --fd for drives that send CAN FD.",
            ));
        }
        Ok(self.found.clone())
    }

    /// Stops everybody; three times, since nothing confirms it.
    pub(crate) fn stop(&mut self, stop: Stop) {
        for _ in 0..COPIES {
            let now = self.now();
            if let Some(frame) = stop.frame() {
                self.bus.send(self.node, frame, now);
            }
            self.listen(Duration::from_millis(5));
        }
    }

    /// Has path time go at another rate from a tick on, on all drives or none.
    ///
    /// # Errors
    /// No epoch is open, the drives are of different ones, or not all confirm: then they stop on the path.
    pub(crate) fn change_rate(&mut self, permille: u16) -> Result<Vec<Found>, Failure> {
        let found = self.ask()?;
        let moving: Vec<&Found> = found.iter().filter(|f| f.beat.is_some_and(|b| b.open)).collect();
        let known = moving.iter().find_map(|f| Some((f.status?, f.identity?, f.heard?)));
        let (Some((status, identity, heard)), Some(epoch)) =
            (known, moving.iter().filter_map(|f| f.identity).map(|i| i.epoch).max())
        else {
            return Err(Failure::input("no drive plays anything whose rate could be changed")
                .with_help("`feedspline status` shows what the drives do."));
        };
        let tick_ns = u64::from(identity.tick_ns.max(1));
        let now = status.tick + heard.elapsed().as_nanos() as u64 / tick_ns;
        let tick = now + LEAD_NS / tick_ns;
        let last = moving.iter().filter_map(|f| f.beat).map(|b| b.change).max().unwrap_or(0);
        let number = if last == u8::MAX { 1 } else { last + 1 };
        let nodes: Vec<Node> = moving.iter().map(|f| f.node).collect();
        let deadline = Instant::now() + Duration::from_nanos(LEAD_NS * 3 / 4);
        loop {
            self.say(epoch, &HostMessage::Override { permille, tick, number });
            self.listen(Duration::from_millis(25));
            let confirmed = |node: &Node| {
                let beat = self.found.iter().find(|f| f.node == *node).and_then(|f| f.beat);
                beat.is_some_and(|beat| beat.change == number)
            };
            if nodes.iter().all(confirmed) {
                self.listen(Duration::from_millis(300));
                return Ok(self.found.clone());
            }
            if Instant::now() > deadline {
                self.stop(Stop::Path { tick: Some(tick as u32) });
                return Err(Failure::input(
                    "not all drives have confirmed the change: they stop on their path",
                )
                .with_help(
                    "What they play may not admit this rate. `feedspline status` shows how they are.",
                ));
            }
        }
    }
}

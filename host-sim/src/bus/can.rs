//! A bus as CAN is: frames take the time of their bits, errors destroy them for everybody and are counted, whoever errs too
//! often leaves the bus.
//!
//! The rules are those of ISO 11898-1: a destroyed frame is followed by error flags, a delimiter and the interframe space, and
//! is sent again by itself; error active controllers destroy what they misread, error passive ones only lose it; a
//! sender that nobody acknowledges tries for ever; two senders of one identifier destroy each other's frames unless these are
//! equal to the bit. What is random depends on seed, time and node alone, so that every run is the same.

mod controller;
mod counters;
mod source;
mod wire;

pub use controller::{Controller, History, Recovery};
pub use counters::{ErrorCounters, ErrorState};
pub use source::Source;

use controller::Station;
use wire::{Ending, Transmission};

use super::{BitTiming, Bus, Frame, Nanoseconds, NodeIndex, Received, Stuffing, Traffic, keep_event};

/// Frames of a source that may wait; what finds no room is overwritten.
const MAILBOXES: usize = 8;
/// Error flag, delimiter and interframe space, where nobody else sees an error.
const OWN_FLAG_BITS: u64 = 6 + 8 + 3;
/// The same with the flags of everybody else behind the first one.
const ALL_FLAGS_BITS: u64 = 6 + 6 + 8 + 3;
/// What an error passive sender waits behind its own frame.
const SUSPEND_BITS: u64 = 8;
/// Bits of silence that lead back to the bus.
const RECESSIVE_BITS: u64 = 11;

/// A time in which frames are garbled for everybody.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// From when on [ns].
    pub from: Nanoseconds,
    /// Until when [ns].
    pub until: Nanoseconds,
    /// Probability that it hits a frame.
    pub share: f64,
}

/// A bus as CAN is.
#[derive(Clone, Debug)]
pub struct CanBus {
    timing: BitTiming,
    stuffing: Stuffing,
    seed: u64,
    nodes: Vec<Station>,
    /// From when on each piece of wire is idle: the common one, and one for each node that is cut off.
    wires: Vec<Nanoseconds>,
    noise: Vec<Noise>,
    traffic: Traffic,
    destroyed: u64,
}

impl CanBus {
    /// An idle bus without nodes.
    pub fn new(timing: BitTiming, stuffing: Stuffing, seed: u64) -> Self {
        Self {
            timing,
            stuffing,
            seed,
            nodes: Vec::new(),
            wires: vec![0],
            noise: Vec::new(),
            traffic: Traffic::default(),
            destroyed: 0,
        }
    }

    /// Adds a node that only sends.
    pub fn attach_source(&mut self, source: Source) -> NodeIndex {
        self.add(Station::new(Controller::default(), Some(source)))
    }

    /// Adds a time of noise.
    pub fn disturb(&mut self, noise: Noise) {
        self.noise.push(noise);
    }

    /// How a node's controller is set up, to be changed at any time.
    pub fn controller(&mut self, node: NodeIndex) -> &mut Controller {
        &mut self.nodes[node.0].settings
    }

    /// The error counters of a node.
    pub fn counters(&self, node: NodeIndex) -> ErrorCounters {
        self.nodes[node.0].counters
    }

    /// What a node has gone through.
    pub fn history(&self, node: NodeIndex) -> History {
        self.nodes[node.0].history
    }

    /// Frames that were destroyed so far.
    pub fn destroyed(&self) -> u64 {
        self.destroyed
    }

    /// Cuts a node off from all others at `now`, which destroys what is on the wire.
    pub fn cut(&mut self, node: NodeIndex, now: Nanoseconds) {
        self.hang(node, node.0 + 1, now);
    }

    /// Joins a node to all others again.
    pub fn join(&mut self, node: NodeIndex, now: Nanoseconds) {
        self.hang(node, 0, now);
    }

    /// A node that is off the bus is to come back.
    pub fn recover(&mut self, node: NodeIndex, now: Nanoseconds) {
        self.nodes[node.0].recover(now);
    }

    /// What waits to be sent by a node is thrown away.
    pub fn flush(&mut self, node: NodeIndex) {
        self.nodes[node.0].sending.clear();
    }

    fn add(&mut self, station: Station) -> NodeIndex {
        self.nodes.push(station);
        self.wires.push(0);
        NodeIndex(self.nodes.len() - 1)
    }

    fn hang(&mut self, node: NodeIndex, wire: usize, now: Nanoseconds) {
        let glitch = self.bits(OWN_FLAG_BITS);
        for end in [self.nodes[node.0].wire, wire] {
            self.wires[end] = self.wires[end].max(now + glitch);
        }
        self.nodes[node.0].wire = wire;
    }

    fn bits(&self, count: u64) -> Nanoseconds {
        self.timing.nominal_time(count)
    }

    /// Whoever hangs on a piece of wire and is not off the bus.
    fn present(&self, wire: usize) -> impl Iterator<Item = (usize, &Station)> {
        self.nodes.iter().enumerate().filter(move |(_, node)| node.wire == wire && !node.is_off())
    }

    /// Sources put frames into their mailboxes: those that have come up meanwhile, or the next one.
    fn fill(&mut self, wire: usize, until: Nanoseconds) {
        let idle = self.wires[wire];
        for node in self.nodes.iter_mut().filter(|node| node.wire == wire) {
            let Some(source) = &mut node.source else { continue };
            source.keep_up(idle);
            while source.due() < until && (node.sending.is_empty() || source.due() <= idle) {
                let due = source.due();
                let Some(frame) = source.take(&self.timing) else { break };
                if node.sending.len() < MAILBOXES {
                    node.sending.push_back((due, frame));
                } else {
                    node.history.refused += 1;
                }
            }
        }
    }

    /// The node that is back on the bus first, if nothing is sent before.
    fn returns(&self, wire: usize) -> Option<(usize, Nanoseconds)> {
        let (idle, eleven) = (self.wires[wire], self.bits(RECESSIVE_BITS));
        let on_wire = self.nodes.iter().enumerate().filter(|(_, node)| node.wire == wire);
        on_wire.filter_map(|(i, node)| Some((i, node.back_at(idle, eleven)?))).min_by_key(|(_, at)| *at)
    }

    fn advance_wire(&mut self, wire: usize, until: Nanoseconds) {
        loop {
            self.fill(wire, until);
            let next = self.next(wire);
            let starts = next.as_ref().map_or(Nanoseconds::MAX, |next| next.start);
            if let Some((node, at)) = self.returns(wire)
                && at <= starts.min(until)
            {
                self.nodes[node].come_back(at);
                continue;
            }
            match next {
                Some(next) if next.end <= until => self.commit(wire, &next),
                _ => return,
            }
        }
    }

    fn commit(&mut self, wire: usize, on_wire: &Transmission) {
        let Transmission { ref senders, start, frame, ending, end, ref misread } = *on_wire;
        let (idle, eleven) = (self.wires[wire], self.bits(RECESSIVE_BITS));
        let suspend = self.bits(SUSPEND_BITS);
        for (i, node) in self.nodes.iter_mut().enumerate().filter(|(_, node)| node.wire == wire) {
            if node.is_off() {
                node.count_recessive(idle, start, end, eleven);
                continue;
            }
            let sends = senders.contains(&i);
            match ending {
                Ending::Crossed if sends => {
                    node.sending.pop_front();
                    keep_event(&mut node.sent, Received { time: end, frame });
                    node.counters.transmitted();
                    node.history.sent += 1;
                }
                Ending::Crossed if misread.contains(&i) => {
                    node.counters.receive_failed(false);
                    node.history.misread += 1;
                }
                Ending::Crossed => node.take(Received { time: end, frame }),
                Ending::Destroyed { alone } if sends => {
                    if alone {
                        node.counters.unacknowledged()
                    } else {
                        node.counters.transmit_failed()
                    }
                    if node.settings.one_shot {
                        node.sending.pop_front();
                    } else {
                        node.history.retried += 1;
                    }
                }
                Ending::Destroyed { .. } if node.settings.listen_only => {}
                Ending::Destroyed { .. } => node.counters.receive_failed(misread.contains(&i)),
            }
            if sends && node.counters.state() == ErrorState::Passive {
                node.ready = end + suspend;
            }
            node.confine(end);
        }
        self.wires[wire] = end;
        if wire == 0 {
            self.traffic.busy += end - start;
        }
        match ending {
            Ending::Crossed => {
                self.traffic.frames += 1;
                self.traffic.bytes += frame.data().len() as u64;
            }
            Ending::Destroyed { .. } => self.destroyed += 1,
        }
    }
}

impl Bus for CanBus {
    fn attach(&mut self) -> NodeIndex {
        self.add(Station::new(Controller::default(), None))
    }

    fn send(&mut self, node: NodeIndex, frame: Frame, now: Nanoseconds) {
        self.nodes[node.0].push(now, frame);
    }

    fn has_room(&self, node: NodeIndex) -> bool {
        let node = &self.nodes[node.0];
        node.sending.len() < node.settings.send_depth
    }

    fn advance(&mut self, until: Nanoseconds) {
        (0..self.wires.len()).for_each(|wire| self.advance_wire(wire, until));
    }

    fn receive(&mut self, node: NodeIndex) -> Option<Received> {
        self.nodes[node.0].received.pop_front()
    }

    fn sent(&mut self, node: NodeIndex) -> Option<Received> {
        self.nodes[node.0].sent.pop_front()
    }

    fn waiting(&self, node: NodeIndex) -> usize {
        self.nodes[node.0].sending.len()
    }

    fn traffic(&self) -> Traffic {
        self.traffic
    }
}

#[cfg(test)]
mod tests;

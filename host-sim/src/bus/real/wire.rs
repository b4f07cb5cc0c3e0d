//! Queues and mailboxes around a port to the bus.

use std::collections::VecDeque;
use std::fmt::Debug;
use std::time::{Duration, Instant};

use protocol::bus::{Frame, ids};

use super::{BusError, Health, RealBus};
use crate::bus::{Bus, Nanoseconds, NodeIndex, Received, Traffic};

/// Frames that a port holds at most: fewer than a queue of Linux, so that a stop never waits behind many.
const UNDER_WAY: usize = 8;
/// What waits longer is not sent any more, nor waited for [ns].
const STALE: Nanoseconds = 500_000_000;
/// Frames of which is remembered that they are our own.
const REMEMBERED: usize = 64;
/// Between two attempts to get at a bus that has gone.
const AGAIN: Duration = Duration::from_millis(100);
/// Frames that are taken in one go.
const AT_ONCE: usize = 4096;

/// Whether a port has taken a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Handed {
    /// It has.
    Taken,
    /// It has no room now.
    Full,
    /// It never could: the frame is too long for it.
    Impossible,
}

/// What a port has heard.
#[derive(Debug)]
pub(super) enum Heard {
    /// A frame; one that was handed over comes back when it has been sent.
    Frame(Instant, Frame),
    /// The controller has reported an error.
    Error,
    /// Something that is no frame of ours.
    Foreign,
}

/// A way to the bus.
pub(super) trait Port: Debug {
    /// Hands a frame over.
    fn send(&mut self, frame: &Frame) -> Result<Handed, BusError>;

    /// What has come next.
    fn receive(&mut self) -> Result<Option<Heard>, BusError>;

    /// Tries to get at the bus again; whether it was possible.
    fn reopen(&mut self) -> bool;

    /// Frames that were lost on the way in.
    fn overruns(&self) -> u64;
}

#[derive(Debug, Default)]
struct Mailbox {
    queue: VecDeque<(Nanoseconds, Frame)>,
    inbox: VecDeque<Received>,
    sent: VecDeque<Received>,
}

#[derive(Debug)]
struct Flight {
    node: usize,
    frame: Frame,
    since: Nanoseconds,
    /// Nobody counts on it any more.
    given_up: bool,
}

/// A bus behind a port.
#[derive(Debug)]
pub(super) struct Wire<P> {
    port: P,
    origin: Instant,
    /// Everything that came until then has been taken.
    drained: Nanoseconds,
    until: Nanoseconds,
    nodes: Vec<Mailbox>,
    flights: VecDeque<Flight>,
    error: Option<BusError>,
    /// The bus has gone; when it was looked for last.
    gone: Option<Instant>,
    traffic: Traffic,
    health: Health,
}

/// Stops go before everything else, and do not grow old.
fn is_stop(frame: &Frame) -> bool {
    matches!(frame.id(), ids::NMT | ids::STOP)
}

impl<P: Port> Wire<P> {
    pub(super) fn new(port: P) -> Self {
        Self {
            port,
            origin: Instant::now(),
            drained: 0,
            until: 0,
            nodes: Vec::new(),
            flights: VecDeque::new(),
            error: None,
            gone: None,
            traffic: Traffic::default(),
            health: Health::default(),
        }
    }

    fn at(&self, instant: Instant) -> Nanoseconds {
        let passed = instant.saturating_duration_since(self.origin).as_nanos();
        Nanoseconds::try_from(passed).unwrap_or(Nanoseconds::MAX)
    }

    /// The bus has gone: whatever waits would be stale when it comes back.
    fn lose(&mut self, error: BusError) {
        let waiting: usize = self.nodes.iter().map(|node| node.queue.len()).sum();
        self.health.dropped += waiting as u64;
        self.nodes.iter_mut().for_each(|node| node.queue.clear());
        self.flights.clear();
        if !matches!(error, BusError::Off { .. }) {
            self.gone = Some(Instant::now());
        }
        self.error.get_or_insert(error);
    }

    /// Whether the bus is there, perhaps again.
    fn is_there(&mut self) -> bool {
        if let Some(looked) = self.gone
            && looked.elapsed() >= AGAIN
        {
            self.gone = if self.port.reopen() { None } else { Some(Instant::now()) };
        }
        self.gone.is_none()
    }

    fn take(&mut self, time: Nanoseconds, frame: Frame) {
        self.traffic.frames += 1;
        self.traffic.bytes += frame.data().len() as u64;
        let flight = self.flights.iter().position(|flight| flight.frame == frame);
        let flight = flight.and_then(|k| self.flights.remove(k));
        let received = Received { time, frame };
        for (index, node) in self.nodes.iter_mut().enumerate() {
            match &flight {
                Some(flight) if flight.node == index => node.sent.push_back(received),
                _ => node.inbox.push_back(received),
            }
        }
    }

    fn drain(&mut self) {
        let now = self.now();
        for _ in 0..AT_ONCE {
            match self.port.receive() {
                Ok(None) => {
                    self.drained = self.drained.max(now);
                    return;
                }
                Ok(Some(Heard::Frame(instant, frame))) => {
                    // What was not there at the last look has come since, whatever its stamp says.
                    let time = self.at(instant).clamp(self.drained, self.now().max(self.drained));
                    self.take(time, frame);
                }
                Ok(Some(Heard::Error)) => self.health.errors += 1,
                Ok(Some(Heard::Foreign)) => self.health.foreign += 1,
                Err(error) => return self.lose(error),
            }
        }
    }

    /// The node whose oldest frame goes next: stops first, then as the wire would have it.
    fn next(&self) -> Option<usize> {
        let heads = self.nodes.iter().enumerate().filter_map(|(i, node)| Some((i, node.queue.front()?.1)));
        heads.min_by_key(|(i, frame)| (!is_stop(frame), frame.id(), *i)).map(|(i, _)| i)
    }

    /// Frames under way for too long are not counted on any more.
    fn give_up(&mut self, now: Nanoseconds) {
        for flight in
            self.flights.iter_mut().filter(|flight| !flight.given_up && now - flight.since.min(now) > STALE)
        {
            flight.given_up = true;
            self.health.unconfirmed += 1;
        }
        while self.flights.len() > REMEMBERED {
            self.flights.pop_front();
        }
    }

    fn under_way(&self) -> usize {
        self.flights.iter().filter(|flight| !flight.given_up).count()
    }

    fn pump(&mut self) {
        let now = self.now();
        self.give_up(now);
        while self.gone.is_none()
            && self.under_way() < UNDER_WAY
            && let Some(node) = self.next()
            && let Some(&(since, frame)) = self.nodes[node].queue.front()
        {
            let handed = if now - since.min(now) > STALE && !is_stop(&frame) {
                Ok(Handed::Impossible)
            } else {
                self.port.send(&frame)
            };
            match handed {
                Ok(Handed::Full) => return,
                Ok(Handed::Taken) => {
                    self.flights.push_back(Flight { node, frame, since: now, given_up: false });
                }
                Ok(Handed::Impossible) => self.health.dropped += 1,
                Err(error) => return self.lose(error),
            }
            self.nodes[node].queue.pop_front();
        }
    }
}

impl<P: Port> Bus for Wire<P> {
    fn attach(&mut self) -> NodeIndex {
        self.nodes.push(Mailbox::default());
        NodeIndex(self.nodes.len() - 1)
    }

    fn send(&mut self, node: NodeIndex, frame: Frame, _: Nanoseconds) {
        let now = self.now();
        let queue = &mut self.nodes[node.0].queue;
        if self.gone.is_some() {
            self.health.dropped += 1;
        } else if is_stop(&frame) {
            queue.push_front((now, frame));
        } else {
            queue.push_back((now, frame));
        }
        self.pump();
    }

    fn advance(&mut self, until: Nanoseconds) {
        self.until = self.until.max(until);
        if self.is_there() {
            self.drain();
            self.pump();
        }
    }

    fn receive(&mut self, node: NodeIndex) -> Option<Received> {
        let until = self.until;
        self.nodes[node.0].inbox.pop_front_if(|received| received.time <= until)
    }

    fn sent(&mut self, node: NodeIndex) -> Option<Received> {
        let until = self.until;
        self.nodes[node.0].sent.pop_front_if(|sent| sent.time <= until)
    }

    fn waiting(&self, node: NodeIndex) -> usize {
        let flights = self.flights.iter().filter(|flight| !flight.given_up && flight.node == node.0);
        self.nodes[node.0].queue.len() + flights.count()
    }

    /// How long the wire was busy is not known.
    fn traffic(&self) -> Traffic {
        self.traffic
    }
}

impl<P: Port> RealBus for Wire<P> {
    fn now(&self) -> Nanoseconds {
        self.at(Instant::now())
    }

    fn take_error(&mut self) -> Option<BusError> {
        self.error.take()
    }

    fn health(&self) -> Health {
        Health { overruns: self.port.overruns(), ..self.health }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]
mod tests;

//! Buses in real time: a CAN interface of Linux, or an SLCAN adapter on a serial line.
//!
//! Several nodes of one process share the wire; what one of them sends reaches the others as well. Frames that the system does
//! not take at once wait, and are thrown away when they have waited for too long: what comes late must not come at all.

mod line;
#[cfg(target_os = "linux")]
mod socket;

use std::collections::VecDeque;
use std::path::Path;

use super::{Bus, Frame, FrameSize, Nanoseconds, NodeIndex, Received, Traffic, keep_event};

/// How long a frame may wait for the system to take it [ns].
const STALE_NS: Nanoseconds = 200_000_000;

/// Why a real bus cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The name is none of a bus.
    #[error("{0:?} is no bus")]
    Name(String),
    /// There is no such interface, or it cannot be opened.
    #[error("the bus {name} cannot be opened: {source}")]
    Open {
        /// Its name.
        name: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// This system has no such buses.
    #[error("{0}: CAN interfaces are Linux's only; use slcan:PATH")]
    System(String),
    /// The interface is down.
    #[error("the bus {0} is down")]
    Down(String),
    /// The interface has gone, or does not work.
    #[error("the bus {name} has failed: {what}")]
    Failed {
        /// Its name.
        name: String,
        /// What the system says.
        what: String,
    },
}

/// A bus in real time. Times are those of whoever calls [`Bus::advance`].
pub trait RealBus: Bus {
    /// What has gone wrong since the last call.
    fn take_error(&mut self) -> Option<BusError>;

    /// Frames that were thrown away because they had waited for too long.
    fn stale(&self) -> u64;
}

/// What carries frames.
trait Wire {
    /// Sends a frame; `false` if it has to be tried again later.
    fn send(&mut self, frame: &Frame) -> Result<bool, BusError>;

    /// The next frame that has come.
    fn receive(&mut self) -> Result<Option<Frame>, BusError>;
}

/// Opens a bus: `can0`, `vcan0` and whatever else Linux calls its CAN interfaces, or `slcan:` and a device file.
///
/// # Errors
/// There is none of this name, or it cannot be opened.
pub fn open(name: &str, size: FrameSize) -> Result<Box<dyn RealBus>, BusError> {
    let wire: Box<dyn Wire> = match name.strip_prefix("slcan:") {
        Some(path) => Box::new(line::Line::open(name, Path::new(path))?),
        None => socket(name, size)?,
    };
    Ok(Box::new(Live::new(wire)))
}

#[cfg(target_os = "linux")]
fn socket(name: &str, size: FrameSize) -> Result<Box<dyn Wire>, BusError> {
    // Names of interfaces are short and have neither blanks nor slashes.
    let sound =
        (1..16).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_graphic() && b != b'/' && b != b':');
    if !sound {
        return Err(BusError::Name(name.to_owned()));
    }
    Ok(Box::new(socket::Socket::open(name, size)?))
}

#[cfg(not(target_os = "linux"))]
fn socket(name: &str, _: FrameSize) -> Result<Box<dyn Wire>, BusError> {
    Err(BusError::System(name.to_owned()))
}

#[derive(Debug, Default)]
struct Local {
    received: VecDeque<Received>,
    sent: VecDeque<Received>,
    waiting: usize,
}

struct Live {
    wire: Box<dyn Wire>,
    nodes: Vec<Local>,
    queue: VecDeque<(NodeIndex, Frame, Nanoseconds)>,
    traffic: Traffic,
    stale: u64,
    error: Option<BusError>,
}

impl Live {
    fn new(wire: Box<dyn Wire>) -> Self {
        let (nodes, queue) = (Vec::new(), VecDeque::new());
        Self { wire, nodes, queue, traffic: Traffic::default(), stale: 0, error: None }
    }

    /// Hands over what waits, as far as the system takes it.
    fn flush(&mut self, now: Nanoseconds) {
        while let Some(&(node, frame, since)) = self.queue.front() {
            if now.saturating_sub(since) > STALE_NS {
                self.stale += 1;
            } else {
                match self.wire.send(&frame) {
                    Ok(true) => self.deliver(frame, Some(node), now),
                    Ok(false) => return,
                    Err(error) => {
                        self.error.get_or_insert(error);
                        self.stale += self.queue.len() as u64;
                        self.queue.clear();
                        self.nodes.iter_mut().for_each(|node| node.waiting = 0);
                        return;
                    }
                }
            }
            self.queue.pop_front();
            self.nodes[node.0].waiting -= 1;
        }
    }

    fn deliver(&mut self, frame: Frame, from: Option<NodeIndex>, time: Nanoseconds) {
        self.traffic.frames += 1;
        self.traffic.bytes += frame.data().len() as u64;
        for (i, node) in self.nodes.iter_mut().enumerate() {
            if Some(NodeIndex(i)) == from {
                keep_event(&mut node.sent, Received { time, frame });
            } else {
                node.received.push_back(Received { time, frame });
            }
        }
    }
}

impl Bus for Live {
    fn attach(&mut self) -> NodeIndex {
        self.nodes.push(Local::default());
        NodeIndex(self.nodes.len() - 1)
    }

    fn send(&mut self, node: NodeIndex, frame: Frame, now: Nanoseconds) {
        self.queue.push_back((node, frame, now));
        self.nodes[node.0].waiting += 1;
        self.flush(now);
    }

    fn advance(&mut self, until: Nanoseconds) {
        self.flush(until);
        loop {
            match self.wire.receive() {
                Ok(Some(frame)) => self.deliver(frame, None, until),
                Ok(None) => return,
                Err(error) => {
                    self.error.get_or_insert(error);
                    return;
                }
            }
        }
    }

    fn receive(&mut self, node: NodeIndex) -> Option<Received> {
        self.nodes[node.0].received.pop_front()
    }

    fn sent(&mut self, node: NodeIndex) -> Option<Received> {
        self.nodes[node.0].sent.pop_front()
    }

    fn waiting(&self, node: NodeIndex) -> usize {
        self.nodes[node.0].waiting
    }

    fn traffic(&self) -> Traffic {
        self.traffic
    }
}

impl RealBus for Live {
    fn take_error(&mut self) -> Option<BusError> {
        self.error.take()
    }

    fn stale(&self) -> u64 {
        self.stale
    }
}

#[cfg(test)]
mod tests;

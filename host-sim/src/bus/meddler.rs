//! A bus on which somebody decides what becomes of every reception.

use std::collections::VecDeque;

use super::{Bus, Frame, Nanoseconds, NodeIndex, Received, Traffic};

/// What becomes of a frame on its way into one receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It comes.
    Pass,
    /// It is lost.
    Lose,
    /// It comes twice.
    Double,
    /// It comes late, behind those that come meanwhile.
    Delay(Nanoseconds),
}

/// Asks `decide` about every reception, in the order in which receivers take them up.
#[derive(Debug)]
pub struct Meddler<B, F> {
    inner: B,
    decide: F,
    nodes: Vec<Late>,
    now: Nanoseconds,
}

#[derive(Debug, Default)]
struct Late {
    /// Once more.
    again: Option<Received>,
    delayed: VecDeque<(Nanoseconds, Received)>,
}

impl<B: Bus, F: FnMut(NodeIndex, &Received) -> Fate> Meddler<B, F> {
    /// Meddles with what `inner` delivers.
    pub fn new(inner: B, decide: F) -> Self {
        Self { inner, decide, nodes: Vec::new(), now: 0 }
    }

    fn late(&mut self, node: NodeIndex) -> &mut Late {
        if self.nodes.len() <= node.0 {
            self.nodes.resize_with(node.0 + 1, Late::default);
        }
        &mut self.nodes[node.0]
    }
}

impl<B: Bus, F: FnMut(NodeIndex, &Received) -> Fate> Bus for Meddler<B, F> {
    fn attach(&mut self) -> NodeIndex {
        self.inner.attach()
    }

    fn send(&mut self, node: NodeIndex, frame: Frame, now: Nanoseconds) {
        self.inner.send(node, frame, now);
    }

    fn has_room(&self, node: NodeIndex) -> bool {
        self.inner.has_room(node)
    }

    fn advance(&mut self, until: Nanoseconds) {
        self.now = until;
        self.inner.advance(until);
    }

    fn receive(&mut self, node: NodeIndex) -> Option<Received> {
        let now = self.now;
        let late = self.late(node);
        if let Some(received) = late.again.take() {
            return Some(received);
        }
        if let Some(at) = late.delayed.iter().position(|(due, _)| *due <= now)
            && let Some((due, received)) = late.delayed.remove(at)
        {
            return Some(Received { time: due, ..received });
        }
        while let Some(received) = self.inner.receive(node) {
            match (self.decide)(node, &received) {
                Fate::Pass => return Some(received),
                Fate::Lose => {}
                Fate::Double => {
                    self.late(node).again = Some(received);
                    return Some(received);
                }
                Fate::Delay(by) => self.late(node).delayed.push_back((received.time + by, received)),
            }
        }
        None
    }

    fn sent(&mut self, node: NodeIndex) -> Option<Received> {
        self.inner.sent(node)
    }

    fn waiting(&self, node: NodeIndex) -> usize {
        self.inner.waiting(node)
    }

    fn traffic(&self) -> Traffic {
        self.inner.traffic()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::{BitTiming, InProcessBus};

    #[test]
    fn frames_meet_their_fates() {
        let fates = |_: NodeIndex, received: &Received| match received.frame.id() {
            1 => Fate::Lose,
            2 => Fate::Double,
            3 => Fate::Delay(1_000_000),
            _ => Fate::Pass,
        };
        let mut bus = Meddler::new(InProcessBus::new(BitTiming::default()), fates);
        let [a, b] = [bus.attach(), bus.attach()];
        for id in [1, 2, 3, 4] {
            bus.send(a, Frame::new(id, &[]).unwrap(), 0);
        }
        let mut take = |until| {
            bus.advance(until);
            core::iter::from_fn(|| bus.receive(b)).map(|r| r.frame.id()).collect::<Vec<_>>()
        };
        assert_eq!(take(500_000), [2, 2, 4]);
        assert_eq!(take(2_000_000), [3]);
        assert!(take(9_000_000).is_empty());
    }
}

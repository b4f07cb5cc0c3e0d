//! A bus inside this process: arbitration by identifier, frame times by bit rate, nothing random.

use std::collections::VecDeque;

use super::{BitTiming, Bus, Frame, Nanoseconds, NodeIndex, Received, Traffic, keep_event};

/// A bus that loses nothing and is the same on every run.
///
/// A node sends its frames in the order queued, as a Linux interface does. When the wire falls idle, the lowest
/// identifier among the oldest frames of all nodes goes next; equal identifiers go by node.
#[derive(Clone, Debug)]
pub struct InProcessBus {
    timing: BitTiming,
    nodes: Vec<Node>,
    idle_from: Nanoseconds,
    traffic: Traffic,
}

#[derive(Clone, Debug, Default)]
struct Node {
    sending: VecDeque<(Nanoseconds, Frame)>,
    received: VecDeque<Received>,
    sent: VecDeque<Received>,
}

impl InProcessBus {
    /// An idle bus without nodes.
    pub fn new(timing: BitTiming) -> Self {
        Self { timing, nodes: Vec::new(), idle_from: 0, traffic: Traffic::default() }
    }

    /// Sender, start and frame of the next transmission.
    fn next(&self) -> Option<(usize, Nanoseconds, Frame)> {
        let heads = || {
            let head = |(i, n): (usize, &Node)| n.sending.front().map(|&(time, frame)| (i, time, frame));
            self.nodes.iter().enumerate().filter_map(head)
        };
        let start = heads().map(|(_, time, _)| time).min()?.max(self.idle_from);
        let (sender, _, frame) =
            heads().filter(|&(_, time, _)| time <= start).min_by_key(|(i, _, frame)| (frame.id(), *i))?;
        Some((sender, start, frame))
    }
}

impl Bus for InProcessBus {
    fn attach(&mut self) -> NodeIndex {
        self.nodes.push(Node::default());
        NodeIndex(self.nodes.len() - 1)
    }

    fn send(&mut self, node: NodeIndex, frame: Frame, now: Nanoseconds) {
        self.nodes[node.0].sending.push_back((now, frame));
    }

    fn advance(&mut self, until: Nanoseconds) {
        while let Some((sender, start, frame)) = self.next() {
            let busy = self.timing.duration(&frame);
            let end = start + busy;
            if end > until {
                return;
            }
            self.idle_from = end;
            self.traffic.frames += 1;
            self.traffic.bytes += frame.data().len() as u64;
            self.traffic.busy += busy;
            for (i, node) in self.nodes.iter_mut().enumerate() {
                if i == sender {
                    node.sending.pop_front();
                    keep_event(&mut node.sent, Received { time: end, frame });
                } else {
                    node.received.push_back(Received { time: end, frame });
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
        self.nodes[node.0].sending.len()
    }

    fn traffic(&self) -> Traffic {
        self.traffic
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: u16) -> Frame {
        Frame::new(id, &[0; 8]).unwrap()
    }

    fn drain(bus: &mut InProcessBus, node: NodeIndex) -> Vec<(u64, u16)> {
        core::iter::from_fn(|| bus.receive(node)).map(|r| (r.time, r.frame.id())).collect()
    }

    #[test]
    fn the_lowest_identifier_wins_once_the_wire_is_idle() {
        let mut bus = InProcessBus::new(BitTiming::default());
        let [a, b, listener] = [bus.attach(), bus.attach(), bus.attach()];
        bus.send(a, frame(0x300), 0);
        bus.send(a, frame(0x100), 0);
        bus.send(b, frame(0x200), 10);
        bus.advance(1_000_000);
        // 0x300 has the wire to itself; then 0x100 beats 0x200.
        let us = |n: u64| n * 135_000;
        assert_eq!(drain(&mut bus, listener), [(us(1), 0x300), (us(2), 0x100), (us(3), 0x200)]);
        assert_eq!(drain(&mut bus, a), [(us(3), 0x200)]);
        assert_eq!(bus.traffic(), Traffic { frames: 3, bytes: 24, busy: us(3) });
    }

    #[test]
    fn nothing_arrives_before_its_last_bit() {
        let mut bus = InProcessBus::new(BitTiming::default());
        let [a, b] = [bus.attach(), bus.attach()];
        bus.send(a, frame(1), 5_000);
        bus.advance(139_999);
        assert!(bus.receive(b).is_none());
        assert_eq!(bus.waiting(a), 1);
        bus.advance(140_000);
        assert_eq!(bus.receive(b).map(|r| r.time), Some(140_000));
        assert_eq!(bus.waiting(a), 0);
    }

    #[test]
    fn every_frame_that_has_crossed_is_told_to_its_sender() {
        let mut bus = InProcessBus::new(BitTiming::default());
        let [a, _] = [bus.attach(), bus.attach()];
        for id in [9, 3, 7] {
            bus.send(a, frame(id), 0);
        }
        bus.advance(u64::MAX);
        let told: Vec<_> = core::iter::from_fn(|| bus.sent(a)).map(|r| (r.time, r.frame.id())).collect();
        assert_eq!(told, [(135_000, 9), (270_000, 3), (405_000, 7)]);
    }

    #[test]
    fn one_node_keeps_its_own_order() {
        let mut bus = InProcessBus::new(BitTiming::default());
        let [a, b] = [bus.attach(), bus.attach()];
        for id in [9, 3, 7, 1] {
            bus.send(a, frame(id), 0);
        }
        bus.advance(u64::MAX);
        assert_eq!(drain(&mut bus, b).iter().map(|r| r.1).collect::<Vec<_>>(), [9, 3, 7, 1]);
    }
}

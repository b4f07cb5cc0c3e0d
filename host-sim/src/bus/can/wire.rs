//! What is on the wire next: who wins it, and how the frame ends.

use super::{ALL_FLAGS_BITS, CanBus, OWN_FLAG_BITS};
use crate::bus::{BitTiming, Frame, FrameSize, Nanoseconds};

/// How a frame ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// Everybody has it who could read it.
    Crossed,
    /// Nobody has it.
    Destroyed {
        /// For want of an acknowledgement.
        alone: bool,
    },
}

/// A frame on the wire.
#[derive(Clone, Debug)]
pub(super) struct Transmission {
    pub(super) senders: Vec<usize>,
    pub(super) start: Nanoseconds,
    pub(super) frame: Frame,
    pub(super) ending: Ending,
    pub(super) end: Nanoseconds,
    /// Receivers that have misread it.
    pub(super) misread: Vec<usize>,
}

impl CanBus {
    /// A number in [0, 1) of its own for each seed, time, node and question.
    fn chance(&self, time: Nanoseconds, node: usize, question: u64) -> f64 {
        let mixed =
            self.seed ^ time.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (node as u64) << 48 ^ question << 40;
        fastrand::Rng::with_seed(mixed.wrapping_mul(0xbf58_476d_1ce4_e5b9)).f64()
    }

    /// What is on a piece of wire next.
    pub(super) fn next(&self, wire: usize) -> Option<Transmission> {
        let heads =
            || self.present(wire).filter_map(|(i, node)| node.head().map(|(at, frame)| (i, at, frame)));
        let start = heads().map(|(_, at, _)| at).min()?.max(self.wires[wire]);
        let contenders = || heads().filter(|&(_, at, _)| at <= start);
        let (first, _, frame) = contenders().min_by_key(|(i, _, frame)| (frame.id(), *i))?;
        let alike = || contenders().filter(|(_, _, other)| other.id() == frame.id());
        let senders: Vec<usize> = alike().map(|(i, ..)| i).collect();
        let differ = alike().any(|(_, _, other)| other != frame);
        let format = |i: usize| self.nodes[i].settings.format.unwrap_or(self.timing.format);
        let mut misread = Vec::new();
        let (mut acknowledged, mut flagged) = (senders.len() > 1, differ);
        for (i, node) in self.present(wire).filter(|(i, _)| !senders.contains(i)) {
            let wrong = format(i) == FrameSize::Classic && format(first) == FrameSize::Fd;
            let fails = wrong || self.hits(node.settings.misreads, start, i, 1);
            if fails {
                misread.push(i);
                flagged |= node.flags();
            } else {
                acknowledged |= !node.settings.listen_only;
            }
        }
        let garbled = senders.iter().any(|&i| self.hits(self.nodes[i].settings.garbles, start, i, 2));
        let noisy = self.noise.iter().filter(|noise| (noise.from..noise.until).contains(&start));
        let hit = noisy.enumerate().any(|(k, noise)| self.hits(noise.share, start, k, 3));
        let took = BitTiming { format: format(first), ..self.timing }.time(&frame, self.stuffing);
        let (ending, end) = if hit || garbled || flagged {
            // Somewhere between the identifier and the CRC [1/1024].
            let part = 200 + (self.chance(start, first, 4) * 700.0) as u64;
            (Ending::Destroyed { alone: false }, took * part / 1024 + self.bits(ALL_FLAGS_BITS))
        } else if !acknowledged {
            // All of it but the end of frame and what follows.
            (Ending::Destroyed { alone: true }, took - self.bits(11) + self.bits(OWN_FLAG_BITS))
        } else {
            (Ending::Crossed, took)
        };
        Some(Transmission { senders, start, frame, ending, end: start + end, misread })
    }

    fn hits(&self, share: f64, time: Nanoseconds, node: usize, question: u64) -> bool {
        share > 0.0 && self.chance(time, node, question) < share
    }
}

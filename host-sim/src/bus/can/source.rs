//! Nodes that only send: foreign traffic, and babblers.

use crate::bus::{BitTiming, Frame, Nanoseconds, Stuffing};

/// Frames of a node that has nothing to do with the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Lowest and highest identifier.
    pub ids: [u16; 2],
    /// Data bytes of each frame.
    pub bytes: usize,
    /// The share of the bus' time that it asks for; 1 and above: all that it can get.
    pub load: f64,
    /// From when on [ns].
    pub from: Nanoseconds,
    /// Until when [ns].
    pub until: Nanoseconds,
    /// Which identifiers, data and gaps.
    pub seed: u64,
}

impl Source {
    /// Foreign traffic with identifiers in a range, which asks for a share of the bus from the beginning to the end.
    pub fn foreign(ids: [u16; 2], load: f64, seed: u64) -> Self {
        Self { ids, bytes: 8, load, from: 0, until: Nanoseconds::MAX, seed }
    }

    /// A node that has gone mad and never stops sending one frame.
    pub fn babbler(id: u16, from: Nanoseconds, until: Nanoseconds) -> Self {
        Self { ids: [id, id], bytes: 8, load: 1.0, from, until, seed: 1 }
    }

    /// When its next frame comes up.
    pub(super) fn due(&self) -> Nanoseconds {
        if self.from < self.until { self.from } else { Nanoseconds::MAX }
    }

    /// Whoever never stops has a frame whenever the wire is idle.
    pub(super) fn keep_up(&mut self, idle: Nanoseconds) {
        if self.load >= 1.0 {
            self.from = self.from.max(idle);
        }
    }

    /// The frame that comes up next; moves on to the one behind it.
    pub(super) fn take(&mut self, timing: &BitTiming) -> Option<Frame> {
        let mut random = fastrand::Rng::with_seed(self.seed);
        let id = random.u16(self.ids[0]..=self.ids[1].max(self.ids[0]));
        let data: Vec<u8> = (0..self.bytes).map(|_| random.u8(..)).collect();
        let frame = Frame::new(id, &data)?;
        let took = timing.time(&frame, Stuffing::Exact) as f64;
        // Exponential gaps; whoever never stops asks again at once.
        let gap = if self.load >= 1.0 {
            0.5 * took
        } else {
            -(took / self.load.max(1e-6)) * random.f64().max(1e-12).ln()
        };
        self.from = self.from.saturating_add((gap as Nanoseconds).max(1));
        self.seed = random.get_seed();
        Some(frame)
    }
}

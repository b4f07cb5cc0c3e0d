//! A bus that loses frames.

use super::{Bus, Frame, Nanoseconds, NodeIndex, Received, Traffic};

/// Drops every received frame with a given probability, for each receiver by itself: as receive buffers that
/// overrun do, so a broadcast may reach some drives and not others. Seeded, hence the same on every run.
#[derive(Clone, Debug)]
pub struct Lossy<B> {
    inner: B,
    random: fastrand::Rng,
    loss: f64,
    dropped: u64,
}

impl<B: Bus> Lossy<B> {
    /// Drops a share `loss` in [0, 1] of what `inner` delivers.
    pub fn new(inner: B, loss: f64, seed: u64) -> Self {
        Self { inner, random: fastrand::Rng::with_seed(seed), loss, dropped: 0 }
    }

    /// How many receptions were dropped.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}

impl<B: Bus> Bus for Lossy<B> {
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
        self.inner.advance(until);
    }

    fn receive(&mut self, node: NodeIndex) -> Option<Received> {
        while let Some(received) = self.inner.receive(node) {
            if self.random.f64() >= self.loss {
                return Some(received);
            }
            self.dropped += 1;
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

    fn survivors(loss: f64, seed: u64) -> Vec<u64> {
        let mut bus = Lossy::new(InProcessBus::new(BitTiming::default()), loss, seed);
        let [a, b] = [bus.attach(), bus.attach()];
        for _ in 0..2000 {
            bus.send(a, Frame::new(5, &[1]).unwrap(), 0);
        }
        bus.advance(u64::MAX);
        let got: Vec<u64> = core::iter::from_fn(|| bus.receive(b)).map(|r| r.time).collect();
        assert_eq!(got.len() as u64 + bus.dropped(), 2000);
        got
    }

    #[test]
    fn the_share_lost_is_the_share_asked_for_and_the_seed_decides_which() {
        let some = survivors(0.1, 7);
        assert!((1740..1860).contains(&some.len()), "{}", some.len());
        assert_eq!(some, survivors(0.1, 7));
        assert_ne!(some, survivors(0.1, 8));
        assert_eq!(survivors(0.0, 7).len(), 2000);
        assert!(survivors(1.0, 7).is_empty());
    }
}

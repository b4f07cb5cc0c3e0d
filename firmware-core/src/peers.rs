//! The other drives of a session, as their beats show them.

use heapless::Vec;
use protocol::bus::Node;
use protocol::bus::beat::Beat;
use protocol::message::State;

/// Most drives that move together.
pub(crate) const MOST: usize = 32;

/// Looks in a row at which a drive is seen to do something else before it counts as astray.
const PATIENCE: u8 = 3;

#[derive(Clone, Copy, Debug)]
struct Peer {
    node: Node,
    /// Lowest bits of the tick of its last beat.
    heard: u32,
    /// It has a table under way, or none.
    running: bool,
    /// It was heard since the last look.
    fresh: bool,
    /// Looks in a row at which it did not do what this drive does.
    strange: u8,
}

/// The other drives.
#[derive(Clone, Debug)]
pub(crate) struct Peers {
    all: Vec<Peer, MOST>,
    members: u128,
}

impl Peers {
    pub(crate) const fn new() -> Self {
        Self { all: Vec::new(), members: 0 }
    }

    /// Takes up the members of a session; `false` if they are too many, or this drive is not one of them.
    pub(crate) fn set(&mut self, members: u128, own: Node) -> bool {
        let bit = |node: Node| 1u128 << (node.number() - 1);
        if members & bit(own) == 0 || members.count_ones() as usize > MOST {
            return false;
        }
        self.members = members;
        self.all.clear();
        for node in (1..=127).filter_map(Node::new).filter(|&node| node != own && members & bit(node) != 0) {
            // There is room for all of them.
            let _ = self.all.push(Peer { node, heard: 0, running: false, fresh: false, strange: 0 });
        }
        true
    }

    /// Whether a node is one of the session's.
    pub(crate) fn has(&self, node: Node) -> bool {
        self.members >> (node.number() - 1) & 1 != 0
    }

    /// Takes in a beat.
    pub(crate) fn heard(&mut self, from: Node, beat: &Beat, now: u64) {
        if let Some(peer) = self.all.iter_mut().find(|peer| peer.node == from) {
            let running = matches!(beat.state, State::Running | State::Held) && !beat.fault;
            (peer.heard, peer.fresh, peer.running) = (now as u32, true, running);
        }
    }

    /// Ticks since the one that was not heard for longest was heard, if that is too long; those that never were do not count.
    pub(crate) fn silent(&self, now: u64, ticks: u32) -> Option<u32> {
        let ages = self.all.iter().filter(|peer| peer.heard != 0);
        ages.map(|peer| (now as u32).wrapping_sub(peer.heard)).filter(|age| *age > ticks).max()
    }

    /// There are none.
    pub(crate) fn is_alone(&self) -> bool {
        self.all.is_empty()
    }

    /// While this drive plays a table, one of them does not. To be asked once per beat of this drive.
    pub(crate) fn astray(&mut self, running: bool) -> bool {
        let mut found = false;
        for peer in &mut self.all {
            let strange = running && !peer.running;
            if !strange {
                peer.strange = 0;
            } else if peer.fresh || peer.heard == 0 {
                peer.strange = peer.strange.saturating_add(1);
            }
            peer.fresh = false;
            found |= peer.strange >= PATIENCE;
        }
        found
    }

    /// The own count has jumped.
    pub(crate) fn shift(&mut self, ticks: i64) {
        self.all.iter_mut().filter(|peer| peer.heard != 0).for_each(|peer| {
            peer.heard = peer.heard.wrapping_add(ticks as u32).max(1);
        });
    }
}

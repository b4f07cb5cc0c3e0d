//! What every node on the bus has to know of a drive, in one frame of eight bytes.
//!
//! | byte | bits | meaning |
//! |---|---|---|
//! | 0 | 3..0 | state |
//! | 0 | 6..4 | power state |
//! | 0 | 7 | the epoch is open: motion may begin |
//! | 1 | 0 | a fault is latched |
//! | 1 | 1 | its clock agrees with the time master's |
//! | 1 | 2 | it stops on the path, or has done so, until a new epoch |
//! | 1 | 5..4 | tables that it could take |
//! | 2 | | lowest bits of the number of the last table that was started or may take over, plus one; 0: none |
//! | 3 | | lowest bits of its epoch |
//! | 4 | | how far its clock was off [us], signed, at most 127 |
//! | 5, 6 | | how long it can go on with what it may play [ms], little-endian, at most 65 535 |
//! | 7 | | number of the last change of rate that it has taken |

use super::{Frame, Node};
use crate::message::State;
use crate::power::Power;

/// What every node has to know of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Beat {
    /// What it does.
    pub state: State,
    /// Its power state.
    pub power: Power,
    /// Motion may begin.
    pub open: bool,
    /// A fault is latched.
    pub fault: bool,
    /// Its clock agrees with the time master's.
    pub synced: bool,
    /// It stops on the path, or has done so.
    pub stopping: bool,
    /// Tables that it could take, at most 3.
    pub free: u8,
    /// Lowest bits of the last table that was started or may take over, plus one; 0: none.
    pub committed: u8,
    /// Lowest bits of its epoch.
    pub epoch: u8,
    /// How far its clock was off [us].
    pub residual_us: i8,
    /// How long it can go on [ms].
    pub fill_ms: u16,
    /// Number of the last change of rate that it has taken.
    pub change: u8,
}

const STATES: [State; 9] = [
    State::Idle,
    State::Receiving,
    State::Ready,
    State::Armed,
    State::Running,
    State::Holding,
    State::Held,
    State::Stopping,
    State::Moving,
];

const POWERS: [Power; 7] = [
    Power::SwitchOnDisabled,
    Power::ReadyToSwitchOn,
    Power::SwitchedOn,
    Power::OperationEnabled,
    Power::QuickStopActive,
    Power::FaultReactionActive,
    Power::Fault,
];

impl Beat {
    /// Its frame.
    pub fn frame(&self, node: Node) -> Option<Frame> {
        let bit = |on: bool, at: u32| u8::from(on) << at;
        let head = self.state as u8 | (self.power as u8) << 4 | bit(self.open, 7);
        let flags = bit(self.fault, 0) | bit(self.synced, 1) | bit(self.stopping, 2) | (self.free & 3) << 4;
        let [low, high] = self.fill_ms.to_le_bytes();
        let residual = self.residual_us.to_le_bytes()[0];
        Frame::new(node.beat(), &[head, flags, self.committed, self.epoch, residual, low, high, self.change])
    }

    /// Reads a frame's data.
    pub fn parse(data: &[u8]) -> Option<Self> {
        let [head, flags, committed, epoch, residual, low, high, change] = *data else { return None };
        Some(Self {
            state: *STATES.get(usize::from(head & 0xf))?,
            power: *POWERS.get(usize::from(head >> 4 & 7))?,
            open: head & 0x80 != 0,
            fault: flags & 1 != 0,
            synced: flags & 2 != 0,
            stopping: flags & 4 != 0,
            free: flags >> 4 & 3,
            committed,
            epoch,
            residual_us: i8::from_le_bytes([residual]),
            fill_ms: u16::from_le_bytes([low, high]),
            change,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_beat_is_pinned() {
        let beat = Beat {
            state: State::Running,
            power: Power::OperationEnabled,
            open: true,
            fault: false,
            synced: true,
            stopping: false,
            free: 1,
            committed: 9,
            epoch: 3,
            residual_us: -2,
            fill_ms: 0x1234,
            change: 6,
        };
        let frame = beat.frame(Node::new(5).unwrap()).unwrap();
        assert_eq!((frame.id(), frame.data()), (0x285, &[0xb4, 0x12, 9, 3, 0xfe, 0x34, 0x12, 6][..]));
        assert_eq!(Beat::parse(frame.data()), Some(beat));
        assert_eq!(Beat::parse(&[0; 7]), None);
        assert_eq!(Beat::parse(&[0xf, 0, 0, 0, 0, 0, 0, 0]), None);
    }

    #[test]
    fn states_are_told_by_their_numbers() {
        for (k, state) in STATES.into_iter().enumerate() {
            assert_eq!(state as usize, k);
        }
        for (k, power) in POWERS.into_iter().enumerate() {
            assert_eq!(power as usize, k);
        }
    }

    proptest! {
        #[test]
        fn what_is_read_is_written_alike(data in prop::array::uniform8(any::<u8>())) {
            if let Some(beat) = Beat::parse(&data) {
                let again = beat.frame(Node::new(1).unwrap()).unwrap();
                prop_assert_eq!(Beat::parse(again.data()), Some(beat));
            }
        }
    }
}

//! Emergencies: a fault of one drive, or a stop that all of them are to make together.
//!
//! The frame is that of CANopen: error code u16, error register u8, then the maker's own bytes: why u8, and the lowest 32 bits
//! of the tick from which on everybody slows down on the path. Whoever hears one passes it on once, so that a drive that has
//! missed it learns of it all the same.

use super::{Frame, Node};
use crate::message::Fault;

/// Why a drive wants all drives to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// It has a fault of its own.
    Fault,
    /// The host is silent.
    HostSilent,
    /// Another drive is silent.
    DriveSilent,
    /// Another drive does not do what it should.
    DriveAstray,
    /// It was told to.
    Told,
    /// What another one has announced.
    Heard,
}

const CAUSES: [Cause; 6] =
    [Cause::Fault, Cause::HostSilent, Cause::DriveSilent, Cause::DriveAstray, Cause::Told, Cause::Heard];

/// An emergency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Error code of CANopen; 0: none any more.
    pub code: u16,
    /// Why.
    pub cause: Cause,
    /// Lowest bits of the tick from which on everybody stops on the path.
    pub tick: u32,
}

/// The error code of a fault, as CiA 402 has them.
pub const fn code(fault: &Fault) -> u16 {
    match fault {
        Fault::Table { .. } => 0x6320,
        Fault::Limit(_) => 0x8600,
        Fault::Connection => 0x8130,
        Fault::Board { .. } => 0x5000,
    }
}

/// The error code of a stop on the path without a fault: the maker's own.
pub const STOP_CODE: u16 = 0xff01;

impl Emergency {
    /// Its frame.
    pub fn frame(&self, node: Node) -> Option<Frame> {
        let ([a, b], [c, d, e, f]) = (self.code.to_le_bytes(), self.tick.to_le_bytes());
        let register = u8::from(self.code != 0);
        Frame::new(node.emergency(), &[a, b, register, self.cause as u8, c, d, e, f])
    }

    /// Reads a frame's data.
    pub fn parse(data: &[u8]) -> Option<Self> {
        let [a, b, _, cause, c, d, e, f] = *data else { return None };
        Some(Self {
            code: u16::from_le_bytes([a, b]),
            cause: *CAUSES.get(usize::from(cause))?,
            tick: u32::from_le_bytes([c, d, e, f]),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_emergency_is_pinned_and_comes_back() {
        for (k, cause) in CAUSES.into_iter().enumerate() {
            assert_eq!(cause as usize, k);
            let emergency = Emergency { code: STOP_CODE, cause, tick: 0x0102_0304 };
            let frame = emergency.frame(Node::new(2).unwrap()).unwrap();
            assert_eq!((frame.id(), frame.data()), (0x082, &[1, 0xff, 1, k as u8, 4, 3, 2, 1][..]));
            assert_eq!(Emergency::parse(frame.data()), Some(emergency));
        }
        assert_eq!(Emergency::parse(&[0, 0, 0, 6, 0, 0, 0, 0]), None);
        assert_eq!(Emergency::parse(&[0; 7]), None);
    }
}

//! Stops: frames without epoch, checksum or acknowledgement, which every drive obeys whatever its state.
//!
//! On identifier 010 the first byte says how: 0 on the path, 1 as fast as each axis can, 2 without torque. Without a byte, as
//! somebody at a keyboard sends it, and with any other one it is 1. Four more bytes, little-endian, may name the tick of the
//! drives' common count, its lowest 32 bits, from which on a stop on the path slows down; without them the drives agree on one.
//!
//! CANopen's NMT commands stop as well: stop (2) and pre-operational (128) on the path, resets (129, 130) as fast as each axis
//! can. Its start (1) means nothing here.

use super::{Frame, ids};

/// How to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// On the path, all axes alike, from a tick on.
    Path {
        /// Lowest bits of the tick; none: the drives agree on one.
        tick: Option<u32>,
    },
    /// Each axis as fast as it can, off the path if need be.
    Quick,
    /// Without torque, at once.
    Off,
}

impl Stop {
    /// The frame of a stop.
    pub fn frame(self) -> Option<Frame> {
        match self {
            Stop::Path { tick: None } => Frame::new(ids::STOP, &[0]),
            Stop::Path { tick: Some(tick) } => {
                let [a, b, c, d] = tick.to_le_bytes();
                Frame::new(ids::STOP, &[0, a, b, c, d])
            }
            Stop::Quick => Frame::new(ids::STOP, &[1]),
            Stop::Off => Frame::new(ids::STOP, &[2]),
        }
    }

    /// The stop that a frame means to the drive at `node`; `None` for frames that stop nothing.
    pub fn of(frame: &Frame, node: u8) -> Option<Self> {
        match (frame.id(), frame.data()) {
            (ids::STOP, [0]) => Some(Stop::Path { tick: None }),
            (ids::STOP, [0, a, b, c, d, ..]) => {
                Some(Stop::Path { tick: Some(u32::from_le_bytes([*a, *b, *c, *d])) })
            }
            (ids::STOP, [2, ..]) => Some(Stop::Off),
            (ids::STOP, _) => Some(Stop::Quick),
            (ids::NMT, [command, to, ..]) if *to == 0 || *to == node => match command {
                2 | 128 => Some(Stop::Path { tick: None }),
                129 | 130 => Some(Stop::Quick),
                _ => None,
            },
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stops_come_back_and_odd_ones_stop_at_once() {
        for stop in
            [Stop::Path { tick: None }, Stop::Path { tick: Some(0x1234_5678) }, Stop::Quick, Stop::Off]
        {
            assert_eq!(stop.frame().and_then(|frame| Stop::of(&frame, 3)), Some(stop));
        }
        let of = |id, data: &[u8]| Stop::of(&Frame::new(id, data).unwrap(), 3);
        assert_eq!(of(0x010, &[]), Some(Stop::Quick));
        assert_eq!(of(0x010, &[0, 1]), Some(Stop::Quick));
        assert_eq!(of(0x010, &[77, 1]), Some(Stop::Quick));
        assert_eq!(of(0x000, &[2, 0]), Some(Stop::Path { tick: None }));
        assert_eq!(of(0x000, &[128, 3]), Some(Stop::Path { tick: None }));
        assert_eq!(of(0x000, &[129, 0]), Some(Stop::Quick));
        assert_eq!([of(0x000, &[1, 0]), of(0x000, &[2, 4]), of(0x000, &[2]), of(0x011, &[0])], [None; 4]);
        assert_eq!(Stop::Path { tick: Some(0x0102_0304) }.frame().unwrap().data(), [0, 4, 3, 2, 1]);
    }
}

//! The drives' common time: SYNC, and behind it the time at which it ended, as the time master counts.
//!
//! All drives see the end of a frame at the same instant, but for the bus' length. The master stamps its own SYNC when it has
//! been sent, which no queue falsifies, and tells the stamp in a second frame.

use super::{Frame, ids};

/// A time as a drive's control timer counts it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Stamp {
    /// Control tick.
    pub tick: u64,
    /// Since the tick began [ns].
    pub ns: u32,
}

/// Greatest number of a SYNC, as in CANopen; they begin at 1.
pub const MOST: u8 = 240;

/// The number behind another one.
pub const fn after(counter: u8) -> u8 {
    if counter >= MOST { 1 } else { counter + 1 }
}

/// A SYNC.
pub fn sync(counter: u8) -> Option<Frame> {
    Frame::new(ids::SYNC, &[counter])
}

/// The time of a SYNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Time {
    /// Number of the SYNC.
    pub counter: u8,
    /// Lowest bits of the tick in which it ended.
    pub tick: u32,
    /// Since that tick began [ns]: below 2^24.
    pub ns: u32,
}

impl Time {
    /// The time of a SYNC that ended at `stamp`; `None` for control ticks that are too long to be told.
    pub fn new(counter: u8, stamp: Stamp) -> Option<Self> {
        (stamp.ns >> 24 == 0).then_some(Self { counter, tick: stamp.tick as u32, ns: stamp.ns })
    }

    /// Its frame.
    pub fn frame(&self) -> Option<Frame> {
        let [a, b, c, d] = self.tick.to_le_bytes();
        let [e, f, g, _] = self.ns.to_le_bytes();
        Frame::new(ids::TIME, &[self.counter, a, b, c, d, e, f, g])
    }

    /// Reads a frame's data.
    pub fn parse(data: &[u8]) -> Option<Self> {
        let [counter, a, b, c, d, e, f, g] = *data else { return None };
        let (tick, ns) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, 0]));
        Some(Self { counter, tick, ns })
    }
}

/// The tick nearest to `near` whose lowest bits are given: a counter of 32 bits wraps after weeks, ticks do not.
pub fn nearest(near: u64, low: u32) -> u64 {
    near.saturating_add_signed(i64::from(low.wrapping_sub(near as u32) as i32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_pinned_and_come_back() {
        let time = Time::new(7, Stamp { tick: 0x1_0203_0405, ns: 0x00ab_cdef }).unwrap();
        let frame = time.frame().unwrap();
        assert_eq!((frame.id(), frame.data()), (0x012, &[7, 5, 4, 3, 2, 0xef, 0xcd, 0xab][..]));
        assert_eq!(Time::parse(frame.data()), Some(time));
        assert_eq!(Time::parse(&[1; 7]), None);
        assert_eq!(Time::new(1, Stamp { tick: 0, ns: 1 << 24 }), None);
        assert_eq!([after(0), after(239), after(240)], [1, 240, 1]);
    }

    #[test]
    fn ticks_are_told_across_the_wrap_of_their_lowest_bits() {
        let wrap = 1u64 << 32;
        assert_eq!(nearest(wrap - 3, 5), wrap + 5);
        assert_eq!(nearest(wrap + 5, 0xffff_fffd), wrap - 3);
        assert_eq!(nearest(3 * wrap + 7, 7), 3 * wrap + 7);
        assert_eq!(nearest(0, 0xffff_ffff), 0);
    }
}

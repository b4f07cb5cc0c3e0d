//! Bytes of a table, in frames that say themselves where they belong.
//!
//! A part is counted in units of [`UNIT`] bytes. A frame carries three bytes, little-endian: bits 23..20 the lowest bits of the
//! table's number, bits 19..0 the number of its first unit; then as many units as fit it. It may come late, twice or in any
//! order. What fills the last frame of CAN FD lies behind the end of the part, or is less than a unit: it is ignored.

use super::{Frame, FrameSize};

/// Bytes that are received, missing and sent again together.
pub const UNIT: usize = 5;

/// Longest part [bytes].
pub const PART_BYTES: usize = UNIT << INDEX_BITS;

const INDEX_BITS: u32 = 20;
const HEAD: usize = 3;

/// How many units a frame carries.
pub const fn units(size: FrameSize) -> u32 {
    ((size.bytes() - HEAD) / UNIT) as u32
}

/// The tag of a table's frames.
pub const fn tag(table: u32) -> u8 {
    (table & 0xf) as u8
}

/// The frame of a part's bytes from a unit on; `None` behind the end.
pub fn frame(id: u16, size: FrameSize, table: u32, part: &[u8], unit: u32) -> Option<Frame> {
    let from = UNIT.checked_mul(unit as usize)?;
    let rest = part.get(from..)?;
    let bytes = rest.get(..units(size) as usize * UNIT).unwrap_or(rest);
    if bytes.is_empty() || unit >> INDEX_BITS != 0 {
        return None;
    }
    let [a, b, c, _] = (u32::from(tag(table)) << INDEX_BITS | unit).to_le_bytes();
    let mut data = [0u8; 64];
    let head = [a, b, c];
    data.iter_mut().zip(head.iter().chain(bytes)).for_each(|(to, from)| *to = *from);
    Frame::new(id, data.get(..HEAD + bytes.len())?)
}

/// Bytes of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Data<'a> {
    /// Lowest bits of the table's number.
    pub tag: u8,
    /// Number of the first unit.
    pub unit: u32,
    /// From that unit on; behind the end of the part or of a unit they mean nothing.
    pub bytes: &'a [u8],
}

/// Reads a frame's data.
pub fn parse(data: &[u8]) -> Option<Data<'_>> {
    let [a, b, c, bytes @ ..] = data else { return None };
    let head = u32::from_le_bytes([*a, *b, *c, 0]);
    (!bytes.is_empty()).then_some(Data {
        tag: (head >> INDEX_BITS) as u8,
        unit: head & ((1 << INDEX_BITS) - 1),
        bytes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    extern crate std;
    use std::vec;

    #[test]
    fn a_frame_is_pinned() {
        let part: [u8; 12] = core::array::from_fn(|i| i as u8);
        let second = frame(0x301, FrameSize::Classic, 0x5a, &part, 1).unwrap();
        assert_eq!(second.data(), [1, 0, 0xa0, 5, 6, 7, 8, 9]);
        let last = frame(0x301, FrameSize::Classic, 0x5a, &part, 2).unwrap();
        assert_eq!(last.data(), [2, 0, 0xa0, 10, 11]);
        assert_eq!(frame(0x301, FrameSize::Classic, 0x5a, &part, 3), None);
        assert_eq!(frame(0x301, FrameSize::Classic, 0x5a, &part, u32::MAX), None);
        assert_eq!(parse(last.data()), Some(Data { tag: 10, unit: 2, bytes: &[10, 11] }));
        assert_eq!(parse(&[1, 2, 3]), None);
    }

    proptest! {
        #[test]
        fn parts_come_back_in_any_order(
            part in prop::collection::vec(any::<u8>(), 1..700),
            fd in any::<bool>(),
            from_behind in any::<bool>(),
        ) {
            let size = if fd { FrameSize::Fd } else { FrameSize::Classic };
            let mut found = vec![0u8; part.len()];
            let count = part.len().div_ceil(UNIT * units(size) as usize) as u32;
            for k in 0..count {
                let k = if from_behind { count - 1 - k } else { k };
                let frame = frame(0x300, size, 7, &part, k * units(size)).unwrap();
                let data = parse(frame.data()).unwrap();
                prop_assert_eq!(data.tag, 7);
                let at = data.unit as usize * UNIT;
                found[at..].iter_mut().zip(data.bytes).take(UNIT * units(size) as usize).for_each(|(to, from)| *to = *from);
            }
            prop_assert_eq!(found, part);
        }
    }
}

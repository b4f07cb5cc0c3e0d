//! Which of two images starts up: a record that outlives power, and the rules of trial and rollback.
//!
//! The record is kept twice, each copy with a number and a checksum, and the older copy is the one that is written: whatever power
//! does meanwhile, one copy is whole. A new image is tried once. If it is not kept before the next start-up, for whatever reason,
//! the image before it runs again.

use protocol::checksum::Crc32;

/// Bytes of a copy.
pub const RECORD_BYTES: usize = 12;
/// What a copy begins with.
const MARK: [u8; 2] = *b"FB";

/// Which image starts up, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// Greater than in the copy before.
    pub number: u32,
    /// The image that was chosen last: the first one, or the second.
    pub second: bool,
    /// It is on trial: the other one is to run again if it is not kept.
    pub trial: bool,
    /// The trial has begun.
    pub tried: bool,
}

impl Record {
    /// As it is kept.
    pub fn to_bytes(self) -> [u8; RECORD_BYTES] {
        let [a, b, c, d] = self.number.to_le_bytes();
        let flags = u8::from(self.second) | u8::from(self.trial) << 1 | u8::from(self.tried) << 2;
        let [m, n] = MARK;
        let head = [m, n, a, b, c, d, flags, 0];
        let mut crc = Crc32::new();
        crc.update(&head);
        let [e, f, g, h] = crc.finish().to_le_bytes();
        [m, n, a, b, c, d, flags, 0, e, f, g, h]
    }

    /// A copy, if it is whole.
    pub fn from_bytes(bytes: &[u8; RECORD_BYTES]) -> Option<Self> {
        let [_, _, a, b, c, d, flags, ..] = *bytes;
        let number = u32::from_le_bytes([a, b, c, d]);
        let bit = |at: u8| flags >> at & 1 == 1;
        let record = Self { number, second: bit(0), trial: bit(1), tried: bit(2) };
        (record.to_bytes() == *bytes).then_some(record)
    }

    /// The newer of two copies, and which of them the next one replaces; without any, the first image runs.
    pub fn newest(copies: &[[u8; RECORD_BYTES]; 2]) -> (Self, usize) {
        let [first, second] = copies;
        match (Self::from_bytes(first), Self::from_bytes(second)) {
            (Some(a), Some(b)) if b.number.wrapping_sub(a.number) as i32 > 0 => (b, 0),
            (Some(a), _) => (a, 1),
            (None, Some(b)) => (b, 0),
            (None, None) => (Self::default(), 0),
        }
    }

    fn next(self) -> Self {
        Self { number: self.number.wrapping_add(1), ..self }
    }

    /// What a start-up makes of it, which has to be kept before the image runs; and which image runs.
    pub fn start(self) -> (Self, bool) {
        let record = match (self.trial, self.tried) {
            (true, false) => Self { tried: true, ..self.next() },
            // Nobody has kept it.
            (true, true) => Self { second: !self.second, trial: false, tried: false, ..self.next() },
            (false, _) => self,
        };
        (record, record.second)
    }

    /// The other image is to be tried.
    pub fn trying(self) -> Self {
        Self { second: !self.second, trial: true, tried: false, ..self.next() }
    }

    /// The image that runs stays.
    pub fn keeping(self) -> Self {
        if self.trial { Self { trial: false, tried: false, ..self.next() } } else { self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_come_back_and_changed_ones_do_not() {
        for flags in 0..8u8 {
            let record = Record {
                number: 0x0102_0304,
                second: flags & 1 != 0,
                trial: flags & 2 != 0,
                tried: flags & 4 != 0,
            };
            let bytes = record.to_bytes();
            assert_eq!(Record::from_bytes(&bytes), Some(record));
            for bit in 0..8 * RECORD_BYTES {
                let mut changed = bytes;
                changed[bit / 8] ^= 1 << (bit % 8);
                assert_eq!(Record::from_bytes(&changed), None, "{bit}");
            }
        }
        assert_eq!(Record::from_bytes(&[0; RECORD_BYTES]), None);
        assert_eq!(Record::from_bytes(&[0xff; RECORD_BYTES]), None);
    }

    #[test]
    fn the_newer_copy_counts_also_where_numbers_wrap() {
        let copy = |number: u32| Record { number, second: number == 0, ..Record::default() }.to_bytes();
        assert_eq!(Record::newest(&[copy(1), copy(2)]).0.number, 2);
        assert_eq!(Record::newest(&[copy(3), copy(2)]), (Record { number: 3, ..Record::default() }, 1));
        assert_eq!(Record::newest(&[copy(u32::MAX), copy(0)]).0.number, 0);
        assert_eq!(Record::newest(&[[9; RECORD_BYTES], copy(5)]).1, 0);
        assert_eq!(Record::newest(&[[9; RECORD_BYTES]; 2]), (Record::default(), 0));
    }

    #[test]
    fn a_trial_is_one_start_unless_it_is_kept() {
        let old = Record::default();
        let (started, image) = old.trying().start();
        assert!(image && started.tried);
        let (back, image) = started.start();
        assert!(!image && !back.trial && back.number > started.number);
        let (kept, image) = started.keeping().start();
        assert!(image && !kept.trial);
        assert_eq!(old.keeping(), old);
        assert_eq!(old.start(), (old, false));
    }
}

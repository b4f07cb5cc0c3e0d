//! Integers of variable length: LEB128, zigzag, second differences.

/// Longest varint [bytes].
pub const MAX_BYTES: usize = 10;

/// Why no integer could be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VarintError {
    /// The bytes end inside the integer.
    Truncated,
    /// The integer does not fit in 64 bits, or is written longer than it needs to be.
    Malformed,
}

/// Appends `value`, seven bits per byte, lowest first, the high bit set on all but the last.
pub fn write(out: &mut impl Extend<u8>, mut value: u64) {
    while value >= 0x80 {
        out.extend([value as u8 | 0x80]);
        value >>= 7;
    }
    out.extend([value as u8]);
}

/// Reads an integer at `at` and moves `at` behind it; leaves `at` alone on error.
pub fn read(bytes: &[u8], at: &mut usize) -> Result<u64, VarintError> {
    let mut value = 0u64;
    for i in 0..MAX_BYTES {
        let place = at.checked_add(i).ok_or(VarintError::Truncated)?;
        let byte = *bytes.get(place).ok_or(VarintError::Truncated)?;
        let bits = u64::from(byte & 0x7f);
        if (i == MAX_BYTES - 1 && bits > 1) || (i > 0 && byte == 0) {
            return Err(VarintError::Malformed);
        }
        value |= bits << (7 * i as u32);
        if byte & 0x80 == 0 {
            *at = place + 1;
            return Ok(value);
        }
    }
    Err(VarintError::Malformed)
}

/// Small magnitudes of either sign become small numbers: 0, -1, 1, -2 ... become 0, 1, 2, 3 ...
pub const fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)) as u64
}

/// Inverse of [`zigzag`].
pub const fn unzigzag(code: u64) -> i64 {
    (code >> 1) as i64 ^ -((code & 1) as i64)
}

/// Turns a sequence into second differences and back.
///
/// The first value and the first difference are coded as they are. Arithmetic wraps modulo 2^64, so that every
/// sequence has a code and every code is a sequence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SecondDifference {
    started: bool,
    value: i64,
    slope: i64,
}

impl SecondDifference {
    /// The code of the next value.
    pub fn encode(&mut self, value: i64) -> u64 {
        let slope = value.wrapping_sub(self.value);
        let code = zigzag(slope.wrapping_sub(self.slope));
        self.advance(value, slope);
        code
    }

    /// The next value.
    pub fn decode(&mut self, code: u64) -> i64 {
        let slope = self.slope.wrapping_add(unzigzag(code));
        let value = self.value.wrapping_add(slope);
        self.advance(value, slope);
        value
    }

    fn advance(&mut self, value: i64, slope: i64) {
        self.slope = if self.started { slope } else { 0 };
        self.value = value;
        self.started = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    extern crate std;
    use std::vec::Vec;

    #[test]
    fn bytes_are_pinned() {
        let bytes = |v| {
            let mut out = Vec::new();
            write(&mut out, v);
            out
        };
        assert_eq!(bytes(0), [0]);
        assert_eq!(bytes(127), [0x7f]);
        assert_eq!(bytes(128), [0x80, 1]);
        assert_eq!(bytes(300), [0xac, 2]);
        assert_eq!(bytes(u64::MAX), [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1]);
        assert_eq!([0, -1, 1, -2, i64::MAX, i64::MIN].map(zigzag), [0, 1, 2, 3, u64::MAX - 1, u64::MAX]);
    }

    #[test]
    fn bad_integers_are_refused_and_nothing_is_consumed() {
        for (bytes, error) in [
            (&[][..], VarintError::Truncated),
            (&[0x80], VarintError::Truncated),
            (&[0x80, 0x00], VarintError::Malformed),
            (&[0xff; 11], VarintError::Malformed),
            (&[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 2], VarintError::Malformed),
        ] {
            let mut at = 0;
            assert_eq!(read(bytes, &mut at), Err(error), "{bytes:?}");
            assert_eq!(at, 0);
        }
        let mut far = usize::MAX;
        assert_eq!(read(&[1], &mut far), Err(VarintError::Truncated));
    }

    proptest! {
        #[test]
        fn every_integer_returns(values in prop::collection::vec(any::<u64>(), 0..50)) {
            let mut bytes = Vec::new();
            values.iter().for_each(|v| write(&mut bytes, *v));
            let mut at = 0;
            for v in &values {
                prop_assert_eq!(read(&bytes, &mut at), Ok(*v));
            }
            prop_assert_eq!(at, bytes.len());
        }

        #[test]
        fn every_sequence_returns(values in prop::collection::vec(any::<i64>(), 0..50)) {
            let (mut forth, mut back) = (SecondDifference::default(), SecondDifference::default());
            for v in values {
                let code = forth.encode(v);
                prop_assert_eq!(back.decode(code), v);
            }
        }

        #[test]
        fn straight_sequences_cost_nothing(start in -1000i64..1000, slope in -1000i64..1000) {
            let mut d = SecondDifference::default();
            prop_assert_eq!(d.encode(start), zigzag(start));
            prop_assert_eq!(d.encode(start + slope), zigzag(slope));
            for i in 2..10 {
                prop_assert_eq!(d.encode(start + i * slope), 0);
            }
        }
    }
}

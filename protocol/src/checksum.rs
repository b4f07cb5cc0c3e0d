//! The checksum of tables, blocks and files: CRC-32C; and the FNV-1a hash of set-points and schemas.

use crc::{CRC_32_ISCSI, Crc, Digest, Table};

static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISCSI);

/// CRC-32C (Castagnoli; as in iSCSI) over pieces fed one after the other.
pub struct Crc32(Digest<'static, u32, Table<1>>);

impl Crc32 {
    /// Nothing fed yet.
    pub fn new() -> Self {
        Self(CRC.digest())
    }

    /// Feeds `bytes`.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The checksum of all that was fed.
    pub fn finish(self) -> u32 {
        self.0.finalize()
    }
}

impl Default for Crc32 {
    fn default() -> Self {
        Self::new()
    }
}

/// CRC-32C of `bytes`.
pub fn crc32(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// FNV-1a, 64 bits (Fowler, Noll, Vo): two runs gave the same set-points if their hashes agree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fnv64(u64);

impl Fnv64 {
    const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;

    /// Nothing fed yet.
    pub const fn new() -> Self {
        Self(Self::OFFSET)
    }

    /// The hash with `bytes` fed after all before.
    #[must_use]
    pub const fn with(mut self, bytes: &[u8]) -> Self {
        let mut rest = bytes;
        while let [first, tail @ ..] = rest {
            self.0 = (self.0 ^ *first as u64).wrapping_mul(Self::PRIME);
            rest = tail;
        }
        self
    }

    /// The hash of all that was fed.
    pub const fn finish(self) -> u64 {
        self.0
    }
}

impl Default for Fnv64 {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn check_values_of_the_standards() {
        assert_eq!(crc32(b"123456789"), 0xe306_9283);
        let mut split = Crc32::new();
        split.update(b"1234");
        split.update(b"56789");
        assert_eq!(split.finish(), 0xe306_9283);
        assert_eq!(Fnv64::new().with(b"foobar").finish(), 0x8594_4171_f739_67e8);
        assert_eq!(Fnv64::new().with(b"foo").with(b"bar"), Fnv64::new().with(b"foobar"));
    }
}

//! Who may move a drive: messages and tables under a key that host and drives share.
//!
//! A drive with a key obeys what is wrapped in [`HostMessage::Signed`] only, apart from questions, signs of life and stops, which
//! are always obeyed. The tag is SipHash-2-4 (Aumasson, Bernstein 2012) under the key of 128 bits, over the epoch, the address, a
//! counter and the message. The counter has to grow from message to message for as long as the drive is up, so that nothing is
//! obeyed twice. The bytes of tables have frames of their own without room for a tag: under a key the seal holds the lowest 32
//! bits of their tag instead of their checksum.

use core::fmt;
use core::hash::Hasher;

use serde::Serialize;
use siphasher::sip::SipHasher24;

use crate::message::{HEADER_BYTES, HostMessage, MessageError, encode, part_crc};
use crate::power::PowerEvent;
use crate::update::Update;

/// Bytes of a key.
pub const KEY_BYTES: usize = 16;

/// What tags are about; a tag of one is none of the other.
const MESSAGE: u8 = 1;
const PART: u8 = 2;

/// A key that host and drives share.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Key([u8; KEY_BYTES]);

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key")
    }
}

impl Key {
    /// A key of these bytes.
    pub const fn new(bytes: [u8; KEY_BYTES]) -> Self {
        Self(bytes)
    }

    /// The key that 32 hexadecimal digits tell.
    pub const fn from_hex(digits: &[u8]) -> Option<Self> {
        if digits.len() != 2 * KEY_BYTES {
            return None;
        }
        let mut bytes = [0; KEY_BYTES];
        let mut at = 0;
        while at < bytes.len() {
            let (Some(high), Some(low)) = (nibble(digits[2 * at]), nibble(digits[2 * at + 1])) else {
                return None;
            };
            bytes[at] = high << 4 | low;
            at += 1;
        }
        Some(Self(bytes))
    }

    /// The tag of a message, as its bytes, to a drive or, as 0, to all of them.
    pub fn tag(&self, epoch: u16, to: u8, counter: u64, message: &[u8]) -> u64 {
        let mut hasher = SipHasher24::new_with_key(&self.0);
        hasher.write(&[MESSAGE, to]);
        hasher.write(&epoch.to_le_bytes());
        hasher.write(&counter.to_le_bytes());
        hasher.write(message);
        hasher.finish()
    }

    /// Lowest bits of the tag of a part of a table: its header, as postcard, and its bytes.
    fn part<H: Serialize>(&self, header: &H, bytes: &[u8]) -> Result<u32, MessageError> {
        let mut buffer = [0u8; HEADER_BYTES];
        let mut hasher = SipHasher24::new_with_key(&self.0);
        hasher.write(&[PART]);
        hasher.write(encode(header, &mut buffer)?);
        hasher.write(bytes);
        Ok(hasher.finish() as u32)
    }
}

const fn nibble(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        b'A'..=b'F' => Some(digit - b'A' + 10),
        _ => None,
    }
}

/// What seals a part of a table: its checksum, or under a key the lowest bits of its tag.
pub fn part_seal<H: Serialize>(key: Option<&Key>, header: &H, bytes: &[u8]) -> Result<u32, MessageError> {
    match key {
        Some(key) => key.part(header, bytes),
        None => part_crc(header, &[bytes]),
    }
}

/// A drive with a key does not obey this message without a tag.
pub fn needs_tag(message: &HostMessage<'_>) -> bool {
    match message {
        HostMessage::Stop
        | HostMessage::Identify
        | HostMessage::QuickStop
        | HostMessage::Power(PowerEvent::QuickStop | PowerEvent::DisableVoltage)
        | HostMessage::Alive
        | HostMessage::Report
        | HostMessage::Update(Update::Ask)
        | HostMessage::Data { .. } => false,
        HostMessage::Open(_)
        | HostMessage::OpenAxis(_)
        | HostMessage::Seal { .. }
        | HostMessage::Start { .. }
        | HostMessage::MoveTo { .. }
        | HostMessage::MoveAt { .. }
        | HostMessage::Power(_)
        | HostMessage::Override { .. }
        | HostMessage::Begin { .. }
        | HostMessage::Update(_)
        | HostMessage::Signed { .. } => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Key 00 01 .. 0f, as in the paper's appendix; its vector for the 15 bytes 00 01 .. 0e.
    #[test]
    fn the_hash_is_the_papers() {
        let mut hasher = SipHasher24::new_with_key(&core::array::from_fn(|k| k as u8));
        hasher.write(&core::array::from_fn::<u8, 15, _>(|k| k as u8));
        assert_eq!(hasher.finish(), 0xa129_ca61_49be_45e5);
    }

    #[test]
    fn tags_are_pinned_and_hang_on_everything() {
        let key = Key::new(core::array::from_fn(|k| k as u8));
        let tag = key.tag(7, 1, 9, b"message");
        let mut written = SipHasher24::new_with_key(&core::array::from_fn(|k| k as u8));
        written.write(b"\x01\x01\x07\x00\x09\x00\x00\x00\x00\x00\x00\x00message");
        assert_eq!(tag, written.finish());
        let other = Key::new([1; KEY_BYTES]);
        let others = [
            key.tag(8, 1, 9, b"message"),
            key.tag(7, 0, 9, b"message"),
            key.tag(7, 1, 10, b"message"),
            key.tag(7, 1, 9, b"massage"),
            other.tag(7, 1, 9, b"message"),
        ];
        assert!(others.iter().all(|found| *found != tag), "{others:x?}");
    }

    #[test]
    fn keys_are_told_in_hexadecimal() {
        let key = Key::new(core::array::from_fn(|k| 17 * k as u8));
        assert_eq!(Key::from_hex(b"00112233445566778899aaBBccDDeeff"), Some(key));
        for wrong in [&b"00"[..], b"00112233445566778899aabbccddeef", b"00112233445566778899aabbccddeefg"] {
            assert_eq!(Key::from_hex(wrong), None);
        }
    }

    #[test]
    fn parts_are_sealed_by_checksum_or_key() {
        let key = Key::new([3; KEY_BYTES]);
        let plain = part_seal(None, &5u32, b"bytes").unwrap();
        assert_eq!(plain, part_crc(&5u32, &[b"bytes"]).unwrap());
        let keyed = part_seal(Some(&key), &5u32, b"bytes").unwrap();
        assert!(keyed != plain && keyed != part_seal(Some(&key), &6u32, b"bytes").unwrap());
        assert!(keyed != part_seal(Some(&Key::new([4; KEY_BYTES])), &5u32, b"bytes").unwrap());
    }
}

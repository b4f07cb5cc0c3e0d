//! A message cut into frames.
//!
//! A block is `length u16 | epoch u16 | message | CRC-32C u32`, little-endian, the CRC over all before it. It is cut
//! into frames of one control byte (bit 7: first frame, bit 6: last frame, bits 5..0: frame number in the
//! block) and up to 7 or 63 bytes of the block. Zeros that fill the last frame are ignored.

use super::{BLOCK_HEAD, BLOCK_OVERHEAD, Frame, FrameSize};
use crate::checksum::Crc32;

/// Longest block: 48 classic frames.
pub const BLOCK_BYTES: usize = 336;

/// Longest message.
pub const MESSAGE_BYTES: usize = BLOCK_BYTES - BLOCK_OVERHEAD;

/// Control byte: first frame of a block.
pub(super) const FIRST: u8 = 0x80;
/// Control byte: last frame of a block.
pub(super) const LAST: u8 = 0x40;
/// Control byte: frame number.
pub(super) const NUMBER: u8 = 0x3f;

/// The frames of one message, in order.
#[derive(Clone, Debug)]
pub struct Segments<'a> {
    id: u16,
    size: FrameSize,
    epoch: u16,
    message: &'a [u8],
    crc: [u8; 4],
    number: u8,
}

impl<'a> Segments<'a> {
    /// Cuts `message`, which belongs to a stop epoch; `None` if it is longer than [`MESSAGE_BYTES`].
    pub fn new(id: u16, size: FrameSize, epoch: u16, message: &'a [u8]) -> Option<Self> {
        if message.len() > MESSAGE_BYTES {
            return None;
        }
        let mut crc = Crc32::new();
        crc.update(&(message.len() as u16).to_le_bytes());
        crc.update(&epoch.to_le_bytes());
        crc.update(message);
        Some(Self { id, size, epoch, message, crc: crc.finish().to_le_bytes(), number: 0 })
    }

    /// Byte `at` of the block.
    fn byte(&self, at: usize) -> Option<u8> {
        let length = self.message.len();
        match at.checked_sub(BLOCK_HEAD) {
            None => {
                let ([a, b], [c, d]) = ((length as u16).to_le_bytes(), self.epoch.to_le_bytes());
                [a, b, c, d].get(at).copied()
            }
            Some(at) if at < length => self.message.get(at).copied(),
            Some(at) => self.crc.get(at - length).copied(),
        }
    }
}

impl Iterator for Segments<'_> {
    type Item = Frame;

    fn next(&mut self) -> Option<Frame> {
        let room = self.size.bytes() - 1;
        let total = self.message.len() + BLOCK_OVERHEAD;
        let from = usize::from(self.number) * room;
        let count = room.min(total.checked_sub(from)?);
        if count == 0 {
            return None;
        }
        let mut data = [0u8; 64];
        let (control, body) = data.split_first_mut()?;
        *control = self.number & NUMBER;
        if from == 0 {
            *control |= FIRST;
        }
        if from + count == total {
            *control |= LAST;
        }
        for (i, byte) in body.iter_mut().take(count).enumerate() {
            *byte = self.byte(from + i)?;
        }
        self.number = self.number.saturating_add(1);
        Frame::new(self.id, data.get(..=count)?)
    }
}

//! Frames put together to a message, in bounded memory.

use heapless::Vec;

use super::segment::{FIRST, LAST, NUMBER};
use super::{BLOCK_HEAD, BLOCK_OVERHEAD};
use crate::checksum::crc32;

/// Why a frame was not taken; the block it belongs to is dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// No data bytes.
    Empty,
    /// A frame of a block whose beginning was not seen.
    NoStart,
    /// Not the frame that should follow: one was lost, doubled or overtaken.
    Sequence {
        /// Number of the frame that should have come.
        expected: u8,
        /// Number of the frame that came.
        found: u8,
    },
    /// The block is longer than the receiver's buffer.
    TooLong,
    /// The block's length does not fit its frames.
    Length,
    /// The block's checksum is wrong.
    Checksum,
}

/// Puts the frames of one identifier together; `N` is the longest block.
#[derive(Clone, Debug, Default)]
pub struct Reassembler<const N: usize> {
    block: Vec<u8, N>,
    /// Number of the next frame; `None` outside a block.
    next: Option<u8>,
}

impl<const N: usize> Reassembler<N> {
    /// Nothing received.
    pub const fn new() -> Self {
        Self { block: Vec::new(), next: None }
    }

    /// Takes one frame's data; gives the message, and its epoch, when the block is complete and its checksum holds.
    ///
    /// A first frame always begins anew, whatever came before it.
    pub fn push(&mut self, data: &[u8]) -> Result<Option<(u16, &[u8])>, FrameError> {
        let expected = self.next.take();
        let (control, body) = data.split_first().ok_or(FrameError::Empty)?;
        let found = control & NUMBER;
        let expected = if control & FIRST != 0 {
            self.block.clear();
            0
        } else {
            expected.ok_or(FrameError::NoStart)?
        };
        if found.wrapping_add(1) == expected {
            // The frame before, once more.
            self.next = Some(expected);
            return Ok(None);
        }
        if found != expected {
            return Err(FrameError::Sequence { expected, found });
        }
        // Behind the last byte of a block an FD frame may carry padding.
        let room = if control & LAST != 0 { N - self.block.len() } else { body.len() };
        let body = body.get(..room).unwrap_or(body);
        self.block.extend_from_slice(body).map_err(|_| FrameError::TooLong)?;
        if control & LAST == 0 {
            self.next = (found < NUMBER).then_some(found + 1);
            return Ok(None);
        }
        self.message().map(Some)
    }

    /// Epoch and message of the complete block.
    fn message(&self) -> Result<(u16, &[u8]), FrameError> {
        let block = self.block.as_slice();
        let [low, high, epoch_low, epoch_high, ..] = block else { return Err(FrameError::Length) };
        let length = usize::from(u16::from_le_bytes([*low, *high]));
        let end = BLOCK_HEAD + length;
        let covered = block.get(..end).ok_or(FrameError::Length)?;
        let crc = block.get(end..length + BLOCK_OVERHEAD).ok_or(FrameError::Length)?;
        if crc32(covered).to_le_bytes() != crc {
            return Err(FrameError::Checksum);
        }
        let message = covered.get(BLOCK_HEAD..).ok_or(FrameError::Length)?;
        Ok((u16::from_le_bytes([*epoch_low, *epoch_high]), message))
    }
}

//! How long a frame occupies the wire, worst-case bit stuffing included.
//!
//! Bit counts from ISO 11898-1 for frames with 11-bit identifiers. In the classic frame and in the FD frame up to
//! its data, a stuff bit follows every fifth equal bit; stuff bits count themselves, so the worst case is one per
//! four bits. The CRC field of an FD frame has a fixed stuff bit before every fourth bit instead.

use super::{Frame, FrameSize, Nanoseconds};

/// Frame format and bit rates of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// Format of all frames.
    pub format: FrameSize,
    /// Of classic frames, and of the arbitration part of FD frames [bit/s].
    pub nominal: u32,
    /// Of the data part of FD frames [bit/s].
    pub data: u32,
}

/// Classic CAN at 1 Mbit/s.
impl Default for BitTiming {
    fn default() -> Self {
        Self { format: FrameSize::Classic, nominal: 1_000_000, data: 5_000_000 }
    }
}

/// Start of frame, identifier, RRS, IDE, FDF, res and BRS of an FD frame.
const FD_ARBITRATION_BITS: u64 = 17;
/// Acknowledgement slot and delimiter, end of frame and interframe space of an FD frame.
const FD_TRAILER_BITS: u64 = 2 + 7 + 3;
/// ESI and DLC of an FD frame.
const FD_CONTROL_BITS: u64 = 1 + 4;

impl BitTiming {
    /// Longest time that `frame` keeps the wire busy, interframe space included.
    pub fn duration(&self, frame: &Frame) -> Nanoseconds {
        let bits = 8 * frame.data().len() as u64;
        match self.format {
            FrameSize::Classic => {
                // 34 stuffed bits and data; CRC delimiter, acknowledgement, end of frame, interframe space.
                let stuffed = 34 + bits;
                self.nominal_time(stuffed + (stuffed - 1) / 4 + 13)
            }
            FrameSize::Fd => {
                let stuffed = FD_ARBITRATION_BITS + FD_CONTROL_BITS + bits;
                let early = (FD_ARBITRATION_BITS - 1) / 4;
                let late = (stuffed - 1) / 4 - early;
                let checked = 4 + if bits <= 8 * 16 { 17 } else { 21 };
                let crc = checked + u64::div_ceil(checked, 4) + 1;
                self.nominal_time(FD_ARBITRATION_BITS + early + FD_TRAILER_BITS)
                    + self.data_time(FD_CONTROL_BITS + bits + late + crc)
            }
        }
    }

    pub(super) fn nominal_time(&self, bits: u64) -> Nanoseconds {
        (bits * 1_000_000_000).div_ceil(u64::from(self.nominal.max(1)))
    }

    pub(super) fn data_time(&self, bits: u64) -> Nanoseconds {
        (bits * 1_000_000_000).div_ceil(u64::from(self.data.max(1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn us(timing: BitTiming, length: usize) -> f64 {
        let frame = Frame::new(0x123, &vec![0; length]).unwrap();
        timing.duration(&frame) as f64 / 1000.0
    }

    #[test]
    fn classic_frames_take_the_worst_case_of_the_literature() {
        // Davis et al. 2007, "Controller Area Network schedulability analysis", eq. 1: 55 + 10 s bits.
        for length in 0..=8 {
            assert_eq!(us(BitTiming::default(), length), 55.0 + 10.0 * length as f64);
        }
        let slow = BitTiming { nominal: 125_000, ..BitTiming::default() };
        assert_eq!(us(slow, 8), 8.0 * 135.0);
    }

    #[test]
    fn a_full_fd_frame_takes_a_sixth_of_a_millisecond_at_five_megabit() {
        let fd = BitTiming { format: FrameSize::Fd, ..BitTiming::default() };
        let t = us(fd, 64);
        assert!((165.0..172.0).contains(&t), "{t}");
        let t = us(BitTiming { data: 2_000_000, ..fd }, 64);
        assert!((365.0..376.0).contains(&t), "{t}");
    }
}

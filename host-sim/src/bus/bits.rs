//! How many bits a frame has on the wire, stuff bits of its actual bits included.
//!
//! ISO 11898-1, frames with 11-bit identifiers. From the start of frame on, five equal bits are followed by a stuff bit of the
//! other kind, which counts itself; in classic frames up to the end of the CRC, in FD frames up to the end of the data. The CRC
//! field of an FD frame has fixed stuff bits instead: one at its beginning and one behind every four bits. A last stuff bit in
//! front of it is replaced by the first fixed one.

use super::{BitTiming, Frame, FrameSize, Nanoseconds};

/// Which stuff bits are counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stuffing {
    /// The most that a frame of this length can have.
    #[default]
    Worst,
    /// Those that the bits of the frame call for.
    Exact,
}

/// Bits of a frame, interframe space included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireBits {
    /// At the nominal bit rate.
    pub nominal: u64,
    /// At the bit rate of the data part of FD frames.
    pub data: u64,
}

/// CRC delimiter, acknowledgement slot and delimiter, end of frame, interframe space of a classic frame.
const CLASSIC_TRAILER: u64 = 1 + 1 + 1 + 7 + 3;
/// Acknowledgement slot and delimiter, end of frame, interframe space of an FD frame.
const FD_TRAILER: u64 = 1 + 1 + 7 + 3;
/// Polynomial of the CRC of classic frames, without its highest term.
const CRC15: u16 = 0x4599;

/// Counts bits and the stuff bits that they call for.
#[derive(Clone, Copy, Debug, Default)]
struct Stuffer {
    bits: u64,
    stuffed: u64,
    level: bool,
    run: u8,
    crc: u16,
}

impl Stuffer {
    fn push(&mut self, bit: bool) {
        if self.run == 5 {
            self.stuff();
        }
        self.bits += 1;
        if self.run > 0 && bit == self.level {
            self.run += 1;
        } else {
            (self.level, self.run) = (bit, 1);
        }
        let next = bit != (self.crc >> 14 & 1 == 1);
        self.crc = self.crc << 1 & 0x7fff;
        if next {
            self.crc ^= CRC15;
        }
    }

    fn stuff(&mut self) {
        self.stuffed += 1;
        (self.level, self.run) = (!self.level, 1);
    }

    fn field(&mut self, value: u64, bits: u32) {
        (0..bits).rev().for_each(|at| self.push(value >> at & 1 == 1));
    }

    fn total(&self) -> u64 {
        self.bits + self.stuffed
    }
}

impl WireBits {
    /// The bits of a frame in a format.
    pub fn of(frame: &Frame, format: FrameSize) -> Self {
        let mut out = Stuffer::default();
        out.field(0, 1);
        out.field(u64::from(frame.id()), 11);
        match format {
            FrameSize::Classic => {
                // RTR, IDE and a reserved bit, all dominant.
                out.field(0, 3);
                out.field(u64::from(code(frame)).min(8), 4);
                frame.data().iter().take(8).for_each(|byte| out.field(u64::from(*byte), 8));
                let crc = out.crc;
                out.field(u64::from(crc), 15);
                if out.run == 5 {
                    out.stuff();
                }
                Self { nominal: out.total() + CLASSIC_TRAILER, data: 0 }
            }
            FrameSize::Fd => {
                // RRS, IDE, FDF, res, BRS.
                out.field(0b0_0101, 5);
                let nominal = out.total() + FD_TRAILER;
                let before = out.total();
                // ESI and DLC.
                out.field(0, 1);
                out.field(u64::from(code(frame)), 4);
                frame.data().iter().for_each(|byte| out.field(u64::from(*byte), 8));
                let checked = 4 + if frame.data().len() <= 16 { 17 } else { 21 };
                // Fixed stuff bits, and the delimiter.
                let crc = checked + 1 + checked / 4 + 1;
                Self { nominal, data: out.total() - before + crc }
            }
        }
    }
}

/// The length as ISO 11898-1 codes it.
fn code(frame: &Frame) -> u8 {
    let length = frame.data().len();
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64].iter().position(|l| *l == length).unwrap_or(0)
        as u8
}

impl BitTiming {
    /// How long `frame` keeps the wire busy, interframe space included.
    pub fn time(&self, frame: &Frame, stuffing: Stuffing) -> Nanoseconds {
        match stuffing {
            Stuffing::Worst => self.duration(frame),
            Stuffing::Exact => {
                let bits = WireBits::of(frame, self.format);
                self.nominal_time(bits.nominal) + self.data_time(bits.data)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bits of a frame one by one, slowly: written down unstuffed, then copied with stuff bits.
    fn written(frame: &Frame, fd: bool) -> (Vec<u8>, Vec<u8>) {
        let binary = |value: usize, bits: usize| format!("{value:0bits$b}").into_bytes();
        let mut bits = b"0".to_vec();
        bits.extend(binary(usize::from(frame.id()), 11));
        bits.extend(if fd { &b"00101"[..] } else { &b"000"[..] });
        let arbitration = bits.len();
        if fd {
            bits.push(b'0');
        }
        let lengths = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
        bits.extend(binary(lengths.iter().position(|l| *l == frame.data().len()).unwrap(), 4));
        frame.data().iter().for_each(|byte| bits.extend(binary(usize::from(*byte), 8)));
        if !fd {
            // Long division by x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
            let divisor = b"1100010110011001";
            let mut rest = bits.clone();
            rest.extend([b'0'; 15]);
            for at in 0..bits.len() {
                if rest[at] == b'1' {
                    for (k, d) in divisor.iter().enumerate() {
                        rest[at + k] = if rest[at + k] == *d { b'0' } else { b'1' };
                    }
                }
            }
            bits.extend_from_slice(&rest[rest.len() - 15..]);
        }
        let data = bits.split_off(arbitration);
        (bits, data)
    }

    /// Copies bits, with a stuff bit behind every five equal ones; how many there are in both parts.
    fn stuffed(parts: (Vec<u8>, Vec<u8>), fd: bool) -> [u64; 2] {
        let mut out: Vec<u8> = Vec::new();
        let mut count = [0u64; 2];
        let (head, tail) = (parts.0.len(), parts.1.len());
        let all: Vec<u8> = parts.0.into_iter().chain(parts.1).collect();
        for (k, bit) in all.into_iter().enumerate() {
            let part = usize::from(k >= head);
            out.push(bit);
            count[part] += 1;
            let five = out.len() >= 5 && out[out.len() - 5..].iter().all(|b| *b == bit);
            let last = k + 1 == head + tail;
            if five && !(fd && last) {
                out.push(if bit == b'0' { b'1' } else { b'0' });
                count[part] += 1;
            }
        }
        count
    }

    fn random_frame(random: &mut fastrand::Rng, fd: bool) -> Frame {
        let most = if fd { 64 } else { 8 };
        let plain = random.u8(0..4);
        let bytes: Vec<u8> = (0..random.usize(0..=most))
            .map(|_| match plain {
                0 => 0,
                1 => 0xff,
                2 => *[0x00, 0xff, 0x1f, 0xf8, 0x55].get(random.usize(0..5)).unwrap(),
                _ => random.u8(..),
            })
            .collect();
        let id =
            if random.bool() { random.u16(0..0x800) } else { [0, 0x7ff, 0x010, 0x3e0][random.usize(0..4)] };
        Frame::new(id, &bytes).unwrap()
    }

    #[test]
    fn bits_are_those_of_a_frame_written_out_bit_by_bit() {
        let mut random = fastrand::Rng::with_seed(11);
        for _ in 0..20_000 {
            let frame = random_frame(&mut random, false);
            let [head, tail] = stuffed(written(&frame, false), false);
            assert_eq!(WireBits::of(&frame, FrameSize::Classic).nominal, head + tail + 13, "{frame:?}");
            let frame = random_frame(&mut random, true);
            let [head, tail] = stuffed(written(&frame, true), true);
            // Stuff count, CRC and delimiter with a fixed stuff bit at the beginning and behind every four bits.
            let crc = if frame.data().len() <= 16 { 4 + 17 + 6 + 1 } else { 4 + 21 + 7 + 1 };
            let expected = WireBits { nominal: head + 12, data: tail + crc };
            assert_eq!(WireBits::of(&frame, FrameSize::Fd), expected, "{frame:?}");
        }
    }

    #[test]
    fn the_exact_time_is_never_above_the_worst_case_and_reaches_it() {
        let mut random = fastrand::Rng::with_seed(12);
        for format in [FrameSize::Classic, FrameSize::Fd] {
            let timing = BitTiming { format, ..BitTiming::default() };
            for _ in 0..5_000 {
                let frame = random_frame(&mut random, format == FrameSize::Fd);
                let (exact, worst) =
                    (timing.time(&frame, Stuffing::Exact), timing.time(&frame, Stuffing::Worst));
                assert!(exact <= worst, "{frame:?}");
                assert!(10 * exact >= 7 * worst, "{frame:?}");
            }
        }
        // Nolte et al. 2002: a pattern that calls for a stuff bit at every fourth bit.
        let worst = Frame::new(0x07c, &[0x3c; 8]).unwrap();
        assert!(WireBits::of(&worst, FrameSize::Classic).nominal >= 128);
        assert_eq!(
            WireBits::of(&Frame::new(0x2aa, &[0x55; 8]).unwrap(), FrameSize::Classic).nominal / 10,
            11
        );
    }

    #[test]
    fn the_crc_of_a_known_frame_is_right() {
        // A frame of Kvaser's tables: the CRC of the empty frame with identifier 0 is 0.
        let mut out = Stuffer::default();
        (0..19).for_each(|_| out.push(false));
        assert_eq!(out.crc, 0);
        let mut out = Stuffer::default();
        out.push(true);
        assert_eq!(out.crc, CRC15);
    }
}

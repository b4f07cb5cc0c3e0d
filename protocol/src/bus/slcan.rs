//! Frames as text over a serial line, as the adapters of Lawicel's kind speak it (SLCAN).
//!
//! A classic frame is `tIIILDD..` and a carriage return: identifier as three hexadecimal digits, length as one, data.
//! A frame of CAN FD with bit rate switching is `b` instead of `t`, its length the code 9 to F for 12 to 64 bytes.

use super::Frame;

/// Longest line: kind, identifier, length, 64 bytes as digits, carriage return.
pub const LINE_BYTES: usize = 1 + 3 + 1 + 128 + 1;

/// Lengths by their code.
const LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

const DIGITS: [u8; 16] = *b"0123456789ABCDEF";

/// The line of a frame, in `buffer`.
pub fn line<'b>(frame: &Frame, buffer: &'b mut [u8; LINE_BYTES]) -> &'b [u8] {
    let data = frame.data();
    let code = LENGTHS.iter().position(|length| usize::from(*length) == data.len()).unwrap_or(0);
    let digit = |value: usize| DIGITS.get(value & 0xf).copied().unwrap_or(b'0');
    let id = usize::from(frame.id());
    let head = [if code > 8 { b'b' } else { b't' }, digit(id >> 8), digit(id >> 4), digit(id), digit(code)];
    let digits = data.iter().flat_map(|byte| [digit(usize::from(byte >> 4)), digit(usize::from(*byte))]);
    let mut length = 0;
    for (to, from) in buffer.iter_mut().zip(head.into_iter().chain(digits).chain([b'\r'])) {
        *to = from;
        length += 1;
    }
    buffer.get(..length).unwrap_or(&[])
}

/// What a line holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// A frame.
    Frame(Frame),
    /// The adapter's acknowledgement, or nothing.
    Empty,
    /// A command to the adapter, by its letter.
    Command(u8),
    /// No line of this kind, or one that is too long.
    Malformed,
}

/// Puts lines together, byte by byte.
#[derive(Clone, Debug)]
pub struct Reader {
    line: [u8; LINE_BYTES],
    length: usize,
}

impl Default for Reader {
    fn default() -> Self {
        Self::new()
    }
}

impl Reader {
    /// Nothing has come yet.
    pub const fn new() -> Self {
        Self { line: [0; LINE_BYTES], length: 0 }
    }

    /// Takes a byte; a carriage return ends a line, and so does the bell with which adapters refuse a command.
    pub fn push(&mut self, byte: u8) -> Option<Line> {
        match byte {
            b'\r' => {
                let whole = self.length < LINE_BYTES;
                let line = self.line.get(..self.length).filter(|_| whole).map(parse);
                self.length = 0;
                Some(line.unwrap_or(Line::Malformed))
            }
            0x07 => {
                self.length = 0;
                Some(Line::Malformed)
            }
            b'\n' => None,
            _ => {
                if let Some(place) = self.line.get_mut(self.length) {
                    *place = byte;
                    self.length += 1;
                }
                None
            }
        }
    }
}

fn parse(line: &[u8]) -> Line {
    match *line {
        [] | [b'z' | b'Z'] => Line::Empty,
        [b't' | b'd' | b'b', a, b, c, length, ref digits @ ..] => {
            frame(&[a, b, c], length, digits).map_or(Line::Malformed, Line::Frame)
        }
        [b't' | b'd' | b'b' | b'r' | b'T' | b'R', ..] => Line::Malformed,
        [letter, ..] => Line::Command(letter),
    }
}

fn frame(id: &[u8], length: u8, digits: &[u8]) -> Option<Frame> {
    let id = id.iter().try_fold(0u16, |id, digit| Some(id << 4 | u16::from(value(*digit)?)))?;
    let length = usize::from(*LENGTHS.get(usize::from(value(length)?))?);
    // Some adapters append a time stamp of four digits.
    let (digits, stamp) = digits.split_at_checked(2 * length)?;
    if !stamp.is_empty() && stamp.len() != 4 {
        return None;
    }
    let mut data = [0u8; 64];
    for (to, pair) in data.iter_mut().zip(digits.chunks_exact(2)) {
        let [high, low] = pair else { return None };
        *to = value(*high)? << 4 | value(*low)?;
    }
    Frame::new(id, data.get(..length)?)
}

/// What a hexadecimal digit stands for.
fn value(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'A'..=b'F' => Some(digit - b'A' + 10),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &[u8]) -> Line {
        let mut reader = Reader::new();
        let mut lines = text.iter().filter_map(|byte| reader.push(*byte));
        let first = lines.next().unwrap();
        assert_eq!(lines.next(), None);
        first
    }

    #[test]
    fn lines_are_those_of_adapters() {
        let frame = Frame::new(0x12a, &[0xab, 1]).unwrap();
        assert_eq!(line(&frame, &mut [0; LINE_BYTES]), b"t12A2AB01\r");
        assert_eq!(read(b"t12a2ab01\r"), Line::Frame(frame));
        assert_eq!(read(b"t12A2AB01F00D\r"), Line::Frame(frame));
        let long = Frame::new(0x7ff, &[5; 64]).unwrap();
        let mut buffer = [0; LINE_BYTES];
        let text = line(&long, &mut buffer);
        assert_eq!((text.len(), &text[..5]), (LINE_BYTES, &b"b7FFF"[..]));
        assert_eq!(read(b"\r"), Line::Empty);
        assert_eq!(read(b"S8\r"), Line::Command(b'S'));
        for bad in ["t12\r", "t12A2AB0\r", "t12A2AB012\r", "tFFF0\r", "t12AG\r", "t1xA0\r", "\x07"] {
            assert_eq!(read(bad.as_bytes()), Line::Malformed, "{bad:?}");
        }
    }

    #[test]
    fn a_line_that_is_too_long_is_dropped_and_the_next_one_read() {
        let mut reader = Reader::new();
        for _ in 0..1000 {
            assert_eq!(reader.push(b'0'), None);
        }
        assert_eq!(reader.push(b'\r'), Some(Line::Malformed));
        assert_eq!(b"t0010\r".iter().filter_map(|b| reader.push(*b)).count(), 1);
    }

    proptest! {
        #[test]
        fn frames_come_back(id in 0u16..0x800, data in prop::collection::vec(any::<u8>(), 0..=64)) {
            let frame = Frame::new(id, &data).unwrap();
            prop_assert_eq!(read(line(&frame, &mut [0; LINE_BYTES])), Line::Frame(frame));
        }

        #[test]
        fn any_bytes_are_taken(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let mut reader = Reader::new();
            bytes.iter().for_each(|byte| { let _ = reader.push(*byte); });
            prop_assert!(reader.length <= LINE_BYTES);
        }
    }
}

//! One CAN frame.

/// Which frames the bus carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameSize {
    /// CAN 2.0: up to 8 bytes.
    Classic,
    /// CAN FD: up to 64 bytes.
    Fd,
}

impl FrameSize {
    /// Most data bytes of a frame.
    pub const fn bytes(self) -> usize {
        match self {
            FrameSize::Classic => 8,
            FrameSize::Fd => 64,
        }
    }
}

/// A data frame with an 11-bit identifier.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    id: u16,
    length: u8,
    data: [u8; 64],
}

impl Frame {
    /// A frame; `None` if the identifier has more than 11 bits or there are more than 64 data bytes.
    ///
    /// Lengths that CAN FD does not know are filled up with zeros to the next one it knows.
    pub fn new(id: u16, bytes: &[u8]) -> Option<Self> {
        if id > 0x7ff {
            return None;
        }
        let length = wire_length(bytes.len())?;
        let mut data = [0; 64];
        data.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        Some(Self { id, length, data })
    }

    /// The identifier; lower ones win the bus.
    pub fn id(&self) -> u16 {
        self.id
    }

    /// The data bytes.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.length)).unwrap_or(&[])
    }
}

impl core::fmt::Debug for Frame {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:03x}#", self.id)?;
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// The shortest frame length that holds `bytes` (ISO 11898-1, DLC coding).
fn wire_length(bytes: usize) -> Option<u8> {
    [0u8, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]
        .into_iter()
        .find(|length| usize::from(*length) >= bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    extern crate std;
    use std::format;

    #[test]
    fn lengths_are_those_of_can_fd() {
        let length = |n: usize| Frame::new(1, &[7; 65][..n]).map(|f| f.data().len());
        assert_eq!([0, 8, 9, 13, 33, 49].map(length), [0, 8, 12, 16, 48, 64].map(Some));
        assert_eq!(length(65), None);
        assert_eq!(Frame::new(0x800, &[]), None);
    }

    #[test]
    fn shows_itself_as_candump_does() {
        assert_eq!(format!("{:?}", Frame::new(0x123, &[0xab, 1]).unwrap()), "123#ab01");
    }
}

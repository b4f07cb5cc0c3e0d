//! A CAN data frame with an 11-bit identifier.

/// Classic CAN or CAN FD.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameFormat {
    /// Up to 8 bytes, one bit rate.
    Classic,
    /// Up to 64 bytes, data at the faster bit rate.
    Fd,
}

/// Lengths beyond 8 bytes that an FD frame can have; shorter data is padded with zeros.
const FD_LENGTHS: [usize; 7] = [12, 16, 20, 24, 32, 48, 64];

/// A data frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    id: u16,
    format: FrameFormat,
    length: u8,
    data: [u8; 64],
}

impl Frame {
    /// A frame; `None` when the identifier has more than 11 bits or the data does not fit the format.
    pub fn new(id: u16, data: &[u8], format: FrameFormat) -> Option<Self> {
        let length = match format {
            _ if data.len() <= 8 => data.len(),
            FrameFormat::Classic => return None,
            FrameFormat::Fd => FD_LENGTHS.into_iter().find(|&l| l >= data.len())?,
        };
        let mut padded = [0; 64];
        padded[..data.len()].copy_from_slice(data);
        (id < 0x800).then_some(Self { id, format, length: length as u8, data: padded })
    }

    /// Identifier; the lower it is, the sooner the frame wins the bus.
    pub fn id(&self) -> u16 {
        self.id
    }

    /// Classic or FD.
    pub fn format(&self) -> FrameFormat {
        self.format
    }

    /// The data, padded to a length that the format has.
    pub fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.length)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_can_be_on_the_wire_can_be_built() {
        assert!(Frame::new(0x800, &[], FrameFormat::Classic).is_none());
        assert!(Frame::new(1, &[0; 9], FrameFormat::Classic).is_none());
        assert!(Frame::new(1, &[0; 65], FrameFormat::Fd).is_none());
        let padded = Frame::new(1, &[7; 33], FrameFormat::Fd).unwrap();
        assert_eq!(padded.data().len(), 48);
        assert_eq!((padded.data()[32], padded.data()[33]), (7, 0));
        assert_eq!(Frame::new(0x7ff, &[1; 8], FrameFormat::Classic).unwrap().data(), [1; 8]);
    }
}

//! The frames that carry a packed table to the drives.

use protocol::bus::{Frame, FrameSize, Node, Segments, data, ids};
use protocol::message::{HostMessage, MessageBuffer, Part, encode};

use super::pack::Packed;

impl Packed {
    /// The bytes of the shared part, or of an axis part.
    ///
    /// # Panics
    /// There is no such axis.
    pub fn part(&self, axis: Option<usize>) -> &[u8] {
        axis.map_or(&self.shared, |axis| &self.axes[axis].controls)
    }

    /// The frame of a part's bytes from a unit on; `None` behind the end. `to` is the drive of an axis part.
    ///
    /// # Panics
    /// There is no such axis.
    pub fn data_frame(&self, axis: Option<usize>, to: Node, size: FrameSize, unit: u32) -> Option<Frame> {
        let id = if axis.is_some() { to.data() } else { ids::DATA };
        data::frame(id, size, self.header.table, self.part(axis), unit)
    }

    /// The seal of a part.
    ///
    /// # Panics
    /// There is no such axis.
    pub fn seal(&self, axis: Option<usize>) -> HostMessage<'static> {
        let (part, crc) = match axis {
            None => (Part::Shared, self.shared_crc()),
            Some(axis) => (Part::Axis, self.axes[axis].crc()),
        };
        HostMessage::Seal { table: self.header.table, part, crc }
    }

    /// All frames that bring the drive `to` of an axis its table, inside an epoch.
    ///
    /// # Panics
    /// There is no such axis.
    pub fn frames(&self, axis: usize, to: Node, size: FrameSize, epoch: u16) -> Vec<Frame> {
        let opens = [HostMessage::Open(self.header), HostMessage::OpenAxis(self.axes[axis].header)];
        let ids = [ids::BROADCAST, to.to_drive()];
        let mut all = Vec::new();
        for ((open, id), part) in opens.iter().zip(ids).zip([None, Some(axis)]) {
            all.extend(frames(id, size, epoch, open));
            let data = |k| self.data_frame(part, to, size, k * data::units(size));
            all.extend((0..).map_while(data));
            all.extend(frames(id, size, epoch, &self.seal(part)));
        }
        all
    }
}

/// The frames of a message to the drives that listen to `id`, in order.
pub fn frames(id: u16, size: FrameSize, epoch: u16, message: &HostMessage<'_>) -> Vec<Frame> {
    let mut buffer: MessageBuffer = [0; _];
    let bytes = encode(message, &mut buffer).ok();
    bytes.and_then(|bytes| Segments::new(id, size, epoch, bytes)).into_iter().flatten().collect()
}

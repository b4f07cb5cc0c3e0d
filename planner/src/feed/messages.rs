//! The frames that carry a packed table to the drives.

use protocol::authentic::{Key, needs_tag, part_seal};
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

    /// The seal of a part under a key.
    ///
    /// # Panics
    /// There is no such axis.
    pub fn seal_under(&self, axis: Option<usize>, key: &Key) -> HostMessage<'static> {
        let bytes = self.part(axis);
        let (part, crc) = match axis {
            None => (Part::Shared, part_seal(Some(key), &self.header, bytes)),
            Some(axis) => (Part::Axis, part_seal(Some(key), &self.axes[axis].header, bytes)),
        };
        // Headers always fit their buffer.
        HostMessage::Seal { table: self.header.table, part, crc: crc.unwrap_or(0) }
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

/// The frames of a message that is signed with a key, where a drive that has one wants that; the counter grows from one to the
/// next.
pub fn signed_frames(
    id: u16,
    size: FrameSize,
    epoch: u16,
    message: &HostMessage<'_>,
    key: Option<&Key>,
    counter: u64,
) -> Vec<Frame> {
    let Some(key) = key.filter(|_| needs_tag(message)) else { return frames(id, size, epoch, message) };
    let to = id.checked_sub(ids::BROADCAST).and_then(|node| u8::try_from(node).ok()).unwrap_or(0);
    let mut buffer: MessageBuffer = [0; _];
    let Ok(bytes) = encode(message, &mut buffer) else { return Vec::new() };
    let tag = key.tag(epoch, to, counter, bytes);
    frames(id, size, epoch, &HostMessage::Signed { counter, tag, message: bytes })
}

/// The frames of a message to the drives that listen to `id`, in order.
pub fn frames(id: u16, size: FrameSize, epoch: u16, message: &HostMessage<'_>) -> Vec<Frame> {
    let mut buffer: MessageBuffer = [0; _];
    let bytes = encode(message, &mut buffer).ok();
    bytes.and_then(|bytes| Segments::new(id, size, epoch, bytes)).into_iter().flatten().collect()
}

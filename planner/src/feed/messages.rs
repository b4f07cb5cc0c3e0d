//! The messages that carry a packed table to the drives.

use protocol::bus::{Frame, FrameSize, Segments};
use protocol::message::{DATA_BYTES, HostMessage, MessageBuffer, Part, encode};

use super::pack::Packed;

impl Packed {
    /// The shared part, for all drives: header, bytes, seal.
    pub fn shared_messages(&self) -> impl Iterator<Item = HostMessage<'_>> {
        let open = HostMessage::Open(self.header);
        part(open, self.header.table, Part::Shared, &self.shared, self.shared_crc())
    }

    /// The part of axis `axis`, for its drive, behind the shared header; empty if there is no such axis.
    pub fn axis_messages(&self, axis: usize) -> impl Iterator<Item = HostMessage<'_>> {
        self.axes.get(axis).into_iter().flat_map(|axis| {
            let open = HostMessage::OpenAxis(axis.header);
            part(open, self.header.table, Part::Axis, &axis.controls, axis.crc())
        })
    }
}

fn part<'a>(
    open: HostMessage<'a>,
    table: u32,
    part: Part,
    bytes: &'a [u8],
    crc: u32,
) -> impl Iterator<Item = HostMessage<'a>> {
    let data = bytes.chunks(DATA_BYTES).enumerate().map(move |(i, bytes)| {
        let offset = (i * DATA_BYTES) as u32;
        HostMessage::Data { table, part, offset, bytes }
    });
    std::iter::once(open).chain(data).chain([HostMessage::Seal { table, part, crc }])
}

/// The frames of a message to the drives that listen to `id`, in order.
pub fn frames(id: u16, size: FrameSize, message: &HostMessage<'_>) -> Vec<Frame> {
    let mut buffer: MessageBuffer = [0; _];
    let bytes = encode(message, &mut buffer).ok();
    bytes.and_then(|bytes| Segments::new(id, size, bytes)).into_iter().flatten().collect()
}

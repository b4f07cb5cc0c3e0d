//! One table on its way to the drives.

use planner::feed::pack::Packed;
use protocol::message::{DATA_BYTES, DriveMessage, HostMessage, Part, Reject};

use super::HostError;

/// One message of an upload; `axis` is `None` for the shared part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Block {
    Open,
    OpenAxis(usize),
    Data { axis: Option<usize>, offset: usize },
    Seal(Option<usize>),
}

/// A table with what the drives have said about it.
#[derive(Clone, Debug)]
pub(super) struct Upload<'a> {
    packed: &'a Packed,
    drives: Vec<Progress>,
    /// A drive has lost the beginning, so everything is sent again.
    anew: bool,
    /// A drive has refused the start.
    refused: bool,
    /// When the waiting for answers began [ticks].
    waiting_since: Option<u64>,
    /// Rounds since anything was heard to go forwards.
    rounds: u32,
}

/// How far one drive has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Progress {
    /// How long the table plays, once it is ready [ticks].
    ready: Option<u64>,
    /// Where the shared part and the axis part have a gap, if the drive says so.
    gap: [Option<u32>; 2],
    /// The furthest gap it ever had.
    furthest: [u32; 2],
}

impl<'a> Upload<'a> {
    pub(super) fn new(packed: &'a Packed, drives: usize) -> Self {
        let drives = vec![Progress::default(); drives];
        Self { packed, drives, anew: false, refused: false, waiting_since: None, rounds: 0 }
    }

    pub(super) fn table(&self) -> u32 {
        self.packed.header.table
    }

    /// All messages of the table, in order.
    pub(super) fn everything(&self) -> impl Iterator<Item = Block> + use<'a> {
        let (packed, axes) = (self.packed, self.packed.axes.len());
        let parts = move || core::iter::once(None).chain((0..axes).map(Some));
        let data = parts().flat_map(move |axis| data_from(packed, axis, 0));
        let open = (0..axes).map(Block::OpenAxis);
        core::iter::once(Block::Open).chain(open).chain(data).chain(parts().map(Block::Seal))
    }

    /// The message of a block, and the axis it goes to; `None` goes to all.
    pub(super) fn message(&self, block: Block) -> (Option<usize>, HostMessage<'a>) {
        let (packed, table) = (self.packed, self.table());
        let part = |axis: Option<usize>| if axis.is_some() { Part::Axis } else { Part::Shared };
        match block {
            Block::Open => (None, HostMessage::Open(packed.header)),
            Block::OpenAxis(axis) => (Some(axis), HostMessage::OpenAxis(packed.axes[axis].header)),
            Block::Data { axis, offset } => {
                let bytes = bytes_of(packed, axis);
                let bytes = &bytes[offset..bytes.len().min(offset + DATA_BYTES)];
                (axis, HostMessage::Data { table, part: part(axis), offset: offset as u32, bytes })
            }
            Block::Seal(axis) => {
                let crc = axis.map_or_else(|| packed.shared_crc(), |axis| packed.axes[axis].crc());
                (axis, HostMessage::Seal { table, part: part(axis), crc })
            }
        }
    }

    /// Takes in what a drive has said.
    pub(super) fn answered(&mut self, axis: usize, message: &DriveMessage) -> Result<(), HostError> {
        match *message {
            DriveMessage::Ready { table, ticks, .. } if table == self.table() => {
                self.drives[axis].ready = Some(ticks);
                self.rounds = 0;
            }
            DriveMessage::Reject { table, reason } if table == self.table() => match reason {
                Reject::Incomplete { part, received } => {
                    let p = part as usize;
                    let drive = &mut self.drives[axis];
                    drive.gap[p] = Some(received);
                    if received > drive.furthest[p] {
                        drive.furthest[p] = received;
                        self.rounds = 0;
                    }
                }
                Reject::Checksum(part) => self.drives[axis].gap[part as usize] = Some(0),
                Reject::NotOpen => self.anew = true,
                Reject::NotReady | Reject::Busy | Reject::Late { .. } | Reject::Overlap { .. } => {
                    (self.anew, self.refused) = (true, true);
                }
                _ => return Err(HostError::Rejected { axis, table, reason }),
            },
            _ => {}
        }
        Ok(())
    }

    /// A drive has refused the start for a reason that may pass.
    pub(super) fn is_refused(&self) -> bool {
        self.refused
    }

    /// How long the table plays, once all drives are ready [ticks].
    pub(super) fn agreed(&self) -> Result<Option<u64>, HostError> {
        let Some(first) = self.drives.first().and_then(|d| d.ready) else { return Ok(None) };
        let differs = |d: &Progress| d.ready.is_some_and(|ticks| ticks != first);
        if let Some(axis) = self.drives.iter().position(differs) {
            return Err(HostError::Disagree { axis, table: self.table() });
        }
        let all = !self.anew && self.drives.iter().all(|d| d.ready.is_some());
        Ok(all.then_some(first))
    }

    /// Whether the drives have had `patience` ticks to answer since the last block was sent.
    pub(super) fn is_overdue(&mut self, tick: u64, patience: u64) -> bool {
        tick >= *self.waiting_since.get_or_insert(tick) + patience
    }

    /// Forgets all answers: the drives have forgotten the table.
    pub(super) fn begin_anew(&mut self) {
        (self.anew, self.refused) = (true, false);
        self.waiting_since = None;
    }

    /// What has to be sent again.
    pub(super) fn missing(&mut self, max_rounds: u32) -> Result<Vec<Block>, HostError> {
        self.waiting_since = None;
        self.rounds += 1;
        let late = self.drives.iter().position(|d| d.ready.is_none()).unwrap_or(0);
        if self.rounds > max_rounds {
            return Err(HostError::Silent { axis: late, table: self.table() });
        }
        if core::mem::take(&mut self.anew) {
            self.refused = false;
            self.drives.fill(Progress::default());
            return Ok(self.everything().collect());
        }
        let mut blocks = Vec::new();
        let shared = self.drives.iter().filter_map(|d| d.gap[Part::Shared as usize]).min();
        if let Some(from) = shared {
            blocks.extend(data_from(self.packed, None, from as usize));
        }
        for (axis, drive) in self.drives.iter().enumerate() {
            if let Some(from) = drive.gap[Part::Axis as usize] {
                blocks.extend(data_from(self.packed, Some(axis), from as usize));
            }
        }
        blocks.push(Block::Seal(None));
        let silent = self.drives.iter().enumerate().filter(|(_, d)| d.ready.is_none());
        blocks.extend(silent.map(|(axis, _)| Block::Seal(Some(axis))));
        for drive in &mut self.drives {
            drive.gap = [None; 2];
        }
        Ok(blocks)
    }
}

fn bytes_of(packed: &Packed, axis: Option<usize>) -> &[u8] {
    axis.map_or(&packed.shared, |axis| &packed.axes[axis].controls)
}

/// The data messages of a part from `offset` on.
fn data_from(packed: &Packed, axis: Option<usize>, offset: usize) -> impl Iterator<Item = Block> + use<> {
    let length = bytes_of(packed, axis).len();
    (offset..length).step_by(DATA_BYTES).map(move |offset| Block::Data { axis, offset })
}

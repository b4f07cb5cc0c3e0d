//! One table on its way to the drives.

use std::sync::Arc;

use planner::feed::pack::Packed;
use protocol::bus::FrameSize;
use protocol::bus::data::{UNIT, units};
use protocol::message::{DriveMessage, Gaps, HostMessage, Part, Reject};

use super::{HostError, Order};

/// One message or data frame of an upload; `axis` is `None` for the shared part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Block {
    Open,
    OpenAxis(usize),
    Data { axis: Option<usize>, unit: u32 },
    Seal(Option<usize>),
}

/// A table with what the drives have said about it.
#[derive(Clone, Debug)]
pub(super) struct Upload {
    order: Arc<Order>,
    /// Units that a frame carries.
    stride: u32,
    drives: Vec<Progress>,
    /// A drive has lost the beginning, so everything is sent again.
    anew: bool,
    /// A drive has refused the start.
    refused: bool,
    /// When the waiting for answers began [ticks].
    waiting_since: Option<u64>,
    /// Rounds since anything was heard to go forwards.
    rounds: u32,
    /// Least data frames that were ever missing at once.
    least: usize,
}

/// How far one drive has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Progress {
    /// How long the table plays, once it is ready [ticks].
    ready: Option<u64>,
    /// What it lacks of the shared part and of the axis part, if it has said so.
    gaps: [Option<Gaps>; 2],
}

impl Upload {
    pub(super) fn new(order: Arc<Order>, drives: usize, size: FrameSize) -> Self {
        let drives = vec![Progress::default(); drives];
        let stride = units(size);
        Self {
            order,
            stride,
            drives,
            anew: false,
            refused: false,
            waiting_since: None,
            rounds: 0,
            least: usize::MAX,
        }
    }

    pub(super) fn packed(&self) -> &Packed {
        &self.order.packed
    }

    /// Ticks at rest before it.
    pub(super) fn pause(&self) -> u64 {
        self.order.pause
    }

    pub(super) fn table(&self) -> u32 {
        self.order.packed.header.table
    }

    /// Everything that carries the table, in order.
    pub(super) fn everything(&self) -> impl Iterator<Item = Block> + use<'_> {
        let (packed, stride) = (self.packed(), self.stride as usize);
        let axes = packed.axes.len();
        let parts = move || core::iter::once(None).chain((0..axes).map(Some));
        let data = parts().flat_map(move |axis| {
            let units = packed.part(axis).len().div_ceil(UNIT) as u32;
            (0..units).step_by(stride).map(move |unit| Block::Data { axis, unit })
        });
        let open = (0..axes).map(Block::OpenAxis);
        core::iter::once(Block::Open).chain(open).chain(data).chain(parts().map(Block::Seal))
    }

    /// The message of a block, and the axis it goes to; `None` goes to all.
    pub(super) fn message(&self, block: Block) -> (Option<usize>, HostMessage<'static>) {
        let packed = self.packed();
        match block {
            Block::Open => (None, HostMessage::Open(packed.header)),
            Block::OpenAxis(axis) => (Some(axis), HostMessage::OpenAxis(packed.axes[axis].header)),
            Block::Seal(axis) | Block::Data { axis, .. } => (axis, packed.seal(axis)),
        }
    }

    /// Takes in what a drive has said.
    pub(super) fn answered(&mut self, axis: usize, message: &DriveMessage) -> Result<(), HostError> {
        match *message {
            DriveMessage::Ready { table, ticks, .. } if table == self.table() => {
                self.drives[axis].ready = Some(ticks);
                self.rounds = 0;
            }
            DriveMessage::Missing { table, part, gaps } if table == self.table() => {
                self.drives[axis].gaps[part as usize] = Some(gaps);
            }
            DriveMessage::Reject { table, reason } if table == self.table() => match reason {
                // Its bits were wiped: everything is missing, and it says so when it is asked again.
                Reject::Checksum(_) => self.rounds += 1,
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

    /// What was refused before a start was sent does not concern it.
    pub(super) fn hear_no_evil(&mut self) {
        self.refused = false;
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
        let told = self.drives.iter().all(|d| d.ready.is_some() || d.gaps.iter().any(Option::is_some));
        told || tick >= *self.waiting_since.get_or_insert(tick) + patience
    }

    /// Forgets all answers: the drives have forgotten the table.
    pub(super) fn begin_anew(&mut self) {
        (self.anew, self.refused, self.least) = (true, false, usize::MAX);
        self.drives.fill(Progress::default());
        self.waiting_since = None;
    }

    /// What has to be sent again.
    pub(super) fn missing(&mut self, max_rounds: u32) -> Result<Vec<Block>, HostError> {
        self.waiting_since = None;
        self.rounds += 1;
        let late = self.drives.iter().position(|d| d.ready.is_none()).unwrap_or(0);
        if self.rounds > max_rounds {
            return Err(HostError::Silent { axis: late });
        }
        if core::mem::take(&mut self.anew) {
            self.refused = false;
            self.drives.fill(Progress::default());
            return Ok(self.everything().collect());
        }
        let mut units: Vec<(Option<usize>, u32)> = Vec::new();
        for (axis, drive) in self.drives.iter_mut().enumerate() {
            for (part, to) in [(Part::Shared, None), (Part::Axis, Some(axis))] {
                let gaps = drive.gaps[part as usize].take();
                let stride = self.stride as usize;
                let length = self.order.packed.part(to).len().div_ceil(UNIT) as u32;
                units.extend(gaps.iter().flat_map(Gaps::ranges).flat_map(|gap| {
                    (gap.start..gap.end.min(length)).step_by(stride).map(move |unit| (to, unit))
                }));
            }
        }
        units.sort_unstable();
        units.dedup();
        if !units.is_empty() && units.len() < self.least {
            (self.rounds, self.least) = (0, units.len());
        }
        let mut blocks: Vec<Block> = units.iter().map(|&(axis, unit)| Block::Data { axis, unit }).collect();
        if blocks.is_empty() {
            // Whoever is silent may have missed the beginning.
            blocks.push(Block::Open);
            let silent = self.drives.iter().enumerate().filter(|(_, d)| d.ready.is_none());
            blocks.extend(silent.map(|(axis, _)| Block::OpenAxis(axis)));
        }
        blocks.push(Block::Seal(None));
        let silent = self.drives.iter().enumerate().filter(|(_, d)| d.ready.is_none());
        blocks.extend(silent.map(|(axis, _)| Block::Seal(Some(axis))));
        Ok(blocks)
    }
}

//! Memory for one table, filled in order and checked when it is complete.

use protocol::message::{Part, Reject, part_crc};
use protocol::table::warp::RATE_ONE;
use protocol::table::{AxisHeader, TableHeader};

use crate::table::{CheckedTable, TableView, Tail};

/// A buffer and what is known of the table in it; without its memory while the motion has it.
#[derive(Debug)]
pub(crate) struct Slot<'a> {
    memory: Option<&'a mut [u8]>,
    room: usize,
    table: Option<Table>,
}

/// A table that is coming in, or has come.
#[derive(Clone, Copy, Debug)]
struct Table {
    header: TableHeader,
    axis: Option<AxisHeader>,
    shared: Progress,
    controls: Progress,
    /// Once the table was checked.
    checked: Option<Checked>,
}

/// What the check of a table has found.
#[derive(Clone, Copy, Debug)]
struct Checked {
    /// How long it plays [2^-32 s].
    duration: u64,
    /// Where another one may take over.
    tail: Option<Tail>,
}

/// How far a part has come.
#[derive(Clone, Copy, Debug, Default)]
struct Progress {
    received: u32,
    /// Its checksum, once sealed.
    seal: Option<u32>,
}

/// A checked table with its memory: what communication and motion hand to each other.
#[derive(Debug)]
pub struct Loaded<'a> {
    memory: &'a mut [u8],
    header: TableHeader,
    axis: AxisHeader,
    duration: u64,
    /// Path time at which another table may take over [2^-32 s].
    tail: Option<u64>,
}

impl<'a> Loaded<'a> {
    /// The table's number.
    pub(crate) fn number(&self) -> u32 {
        self.header.table
    }

    /// Its shared header.
    pub(crate) fn header(&self) -> &TableHeader {
        &self.header
    }

    /// Its axis header.
    pub(crate) fn axis(&self) -> &AxisHeader {
        &self.axis
    }

    /// How long it plays [2^-32 s].
    pub(crate) fn duration(&self) -> u64 {
        self.duration
    }

    /// Path time, from its start, at which another table may take over [2^-32 s].
    pub(crate) fn tail(&self) -> Option<u64> {
        self.tail
    }

    /// Of the rates of path time that the table admits the one nearest to another one [2^-48].
    pub(crate) fn nearest_rate(&self, target: u64) -> u64 {
        self.header.warp.map_or(RATE_ONE, |warp| target.min(u64::from(warp.rate) << 24))
    }

    /// The table; there always is one.
    pub(crate) fn table(&self) -> Option<CheckedTable<'_>> {
        let (shared, rest) = self.memory.split_at_checked(self.header.shared_bytes() as usize)?;
        let controls = rest.get(..self.axis.control_bytes as usize)?;
        let view = TableView::parts(&self.header, &self.axis, shared, controls)?;
        Some(CheckedTable::known(view, self.duration))
    }

    /// Its memory, for the next one.
    pub(crate) fn into_memory(self) -> &'a mut [u8] {
        self.memory
    }
}

impl<'a> Slot<'a> {
    pub(crate) fn new(memory: &'a mut [u8]) -> Self {
        Self { room: memory.len(), memory: Some(memory), table: None }
    }

    /// Bytes there are for a table.
    pub(crate) fn room(&self) -> usize {
        self.room
    }

    /// Number of the table in it, or of the one that the motion has.
    pub(crate) fn number(&self) -> Option<u32> {
        self.table.map(|t| t.header.table)
    }

    /// The table was checked and may be played.
    pub(crate) fn is_ready(&self) -> bool {
        self.memory.is_some() && self.table.is_some_and(|t| t.checked.is_some())
    }

    /// The motion has the table.
    pub(crate) fn is_away(&self) -> bool {
        self.memory.is_none()
    }

    /// Forgets a table that the motion does not have.
    pub(crate) fn clear(&mut self) {
        if self.memory.is_some() {
            self.table = None;
        }
    }

    /// Gives a checked table away; the slot keeps its number.
    pub(crate) fn give(&mut self) -> Option<Loaded<'a>> {
        let Table { header, axis: Some(axis), checked: Some(checked), .. } = self.table? else {
            return None;
        };
        let memory = self.memory.take()?;
        let tail = checked.tail.map(|tail| tail.time);
        Some(Loaded { memory, header, axis, duration: checked.duration, tail })
    }

    /// Takes its memory back; the table is still there if it is to be `kept`.
    pub(crate) fn take_back(&mut self, loaded: Loaded<'a>, kept: bool) {
        self.memory = Some(loaded.into_memory());
        if !kept {
            self.table = None;
        }
    }

    pub(crate) fn open(&mut self, header: TableHeader) -> Result<(), Reject> {
        header.check().map_err(Reject::Table)?;
        self.fits(header.shared_bytes())?;
        let (shared, controls) = (Progress::default(), Progress::default());
        self.table = Some(Table { header, axis: None, shared, controls, checked: None });
        Ok(())
    }

    pub(crate) fn open_axis(&mut self, axis: AxisHeader) -> Result<(), Reject> {
        let table = self.table.ok_or(Reject::NotOpen)?;
        axis.check().map_err(Reject::Table)?;
        self.fits(table.header.shared_bytes() + u64::from(axis.control_bytes))?;
        self.table = Some(Table { axis: Some(axis), controls: Progress::default(), checked: None, ..table });
        Ok(())
    }

    fn fits(&self, needed: u64) -> Result<(), Reject> {
        let available = self.memory.as_ref().map_or(0, |memory| memory.len()) as u64;
        if needed > available { Err(Reject::NoRoom { needed, available }) } else { Ok(()) }
    }

    /// Takes bytes that continue what came before; earlier ones came twice and are ignored, later ones leave a
    /// gap that the seal reports.
    pub(crate) fn data(&mut self, part: Part, offset: u32, bytes: &[u8]) -> Result<(), Reject> {
        let Some(table) = &mut self.table else { return Err(Reject::NotOpen) };
        let (from, length) = table.place(part).ok_or(Reject::NotOpen)?;
        let progress = table.progress(part);
        if progress.seal.is_some() || offset != progress.received {
            return Ok(());
        }
        let after = offset as usize + bytes.len();
        if after > length {
            return Err(Reject::Incomplete { part, received: offset });
        }
        let memory = self.memory.as_mut().ok_or(Reject::NotOpen)?;
        let target = memory.get_mut(from + offset as usize..from + after);
        target.ok_or(Reject::NotOpen)?.copy_from_slice(bytes);
        progress.received = after as u32;
        Ok(())
    }

    /// Ends a part; `Ok(true)` when the table has become complete.
    pub(crate) fn seal(&mut self, part: Part, crc: u32) -> Result<bool, Reject> {
        let Some(table) = &mut self.table else { return Err(Reject::NotOpen) };
        let (from, length) = table.place(part).ok_or(Reject::NotOpen)?;
        let progress = *table.progress(part);
        if progress.seal == Some(crc) {
            return Ok(table.is_complete());
        }
        if (progress.received as usize) < length {
            return Err(Reject::Incomplete { part, received: progress.received });
        }
        let memory = self.memory.as_ref().ok_or(Reject::NotOpen)?;
        let bytes = memory.get(from..from + length).ok_or(Reject::NotOpen)?;
        let found = match (part, table.axis) {
            (Part::Shared, _) => part_crc(&table.header, &[bytes]),
            (Part::Axis, Some(axis)) => part_crc(&axis, &[bytes]),
            (Part::Axis, None) => return Err(Reject::NotOpen),
        };
        if found != Ok(crc) {
            *table.progress(part) = Progress::default();
            return Err(Reject::Checksum(part));
        }
        table.progress(part).seal = Some(crc);
        Ok(table.is_complete())
    }

    /// Checks a complete table, and proves that it keeps its limits and stays within `travel`; its duration [2^-32 s].
    pub(crate) fn check(&mut self, travel: Option<[i64; 2]>) -> Result<u64, Reject> {
        let (table, tail) = self.view().ok_or(Reject::NotOpen)?.prove_all(travel).map_err(Reject::Table)?;
        let duration = table.duration();
        if let Some(table) = &mut self.table {
            table.checked = Some(Checked { duration, tail });
        }
        Ok(duration)
    }

    /// Whether the table in it, which joins another one, goes on where that one is left.
    pub(crate) fn follows(&self, other: &Slot<'_>) -> bool {
        let (Some(here), Some(there)) = (&self.table, &other.table) else { return false };
        let (Some(axis), Some(other_axis)) = (&here.axis, &there.axis) else { return false };
        let (h, o) = (&here.header, &there.header);
        let alike = (h.q_scale, h.step_exponent, h.tick_ns, h.warp, axis.fraction_bits)
            == (o.q_scale, o.step_exponent, o.tick_ns, o.warp, other_axis.fraction_bits);
        let left = there.checked.and_then(|checked| checked.tail).map(|tail| tail.junction);
        let joins = self.view().and_then(|view| view.junction());
        alike && left.is_some() && left == joins
    }

    /// Both headers of a table that is coming in.
    pub(crate) fn headers(&self) -> Option<(TableHeader, AxisHeader)> {
        let table = self.table?;
        Some((table.header, table.axis?))
    }

    /// Checksums of both parts, once sealed.
    pub(crate) fn seals(&self) -> Option<[u32; 2]> {
        let table = self.table?;
        Some([table.shared.seal?, table.controls.seal?])
    }

    fn view(&self) -> Option<TableView<'_>> {
        let table = self.table.as_ref()?;
        let axis = table.axis.as_ref()?;
        let (shared, rest) = self.memory.as_ref()?.split_at_checked(table.header.shared_bytes() as usize)?;
        let controls = rest.get(..axis.control_bytes as usize)?;
        TableView::new(&table.header, axis, shared, controls).ok()
    }
}

impl Table {
    fn progress(&mut self, part: Part) -> &mut Progress {
        match part {
            Part::Shared => &mut self.shared,
            Part::Axis => &mut self.controls,
        }
    }

    /// Where a part begins in memory and how long it is; `None` for an axis part that was not opened.
    fn place(&self, part: Part) -> Option<(usize, usize)> {
        let shared = self.header.shared_bytes() as usize;
        match part {
            Part::Shared => Some((0, shared)),
            Part::Axis => Some((shared, self.axis?.control_bytes as usize)),
        }
    }

    fn is_complete(&self) -> bool {
        self.shared.seal.is_some() && self.controls.seal.is_some()
    }
}

#[cfg(test)]
impl Loaded<'_> {
    /// Overwrites the table's bytes, as a memory error would.
    pub(crate) fn corrupt(&mut self) {
        self.memory.fill(0xff);
    }
}

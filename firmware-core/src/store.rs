//! Memory for one table, filled in any order and checked when it is complete.
//!
//! The streams lie at the beginning of the memory, and at its end one bit for each unit of them that has come.

use protocol::authentic::{Key, part_seal};
use protocol::bus::data::{self, PART_BYTES, UNIT};
use protocol::message::{Gaps, Part, Reject};
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
    /// Units that have come.
    units: u32,
    /// Its checksum, once sealed.
    seal: Option<u32>,
}

/// What came of a seal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sealed {
    /// The other part is still to come.
    Half,
    /// The table is complete.
    Whole,
    /// These units are missing.
    Missing(Gaps),
}

/// Units of a part.
const fn units(bytes: usize) -> usize {
    bytes.div_ceil(UNIT)
}

/// Bytes that hold a bit for each unit of a part.
const fn map_bytes(bytes: usize) -> usize {
    units(bytes).div_ceil(8)
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

    /// Bytes there are for a table, whatever its parts.
    pub(crate) fn room(&self) -> usize {
        // A byte in forty is for the bits, and each part may round up by one.
        (self.room.saturating_sub(2) / (8 * UNIT + 1)).saturating_mul(8 * UNIT)
    }

    /// Number of the table in it, or of the one that the motion has.
    pub(crate) fn number(&self) -> Option<u32> {
        self.table.map(|t| t.header.table)
    }

    /// The table was checked and may be played.
    pub(crate) fn is_ready(&self) -> bool {
        self.memory.is_some() && self.table.is_some_and(|t| t.checked.is_some())
    }

    /// Bytes with this tag belong to it.
    pub(crate) fn has_tag(&self, tag: u8) -> bool {
        self.memory.is_some() && self.number().is_some_and(|number| data::tag(number) == tag)
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
        self.fits(header.shared_bytes(), 0)?;
        let (shared, controls) = (Progress::default(), Progress::default());
        self.table = Some(Table { header, axis: None, shared, controls, checked: None });
        self.clear_map(Part::Shared);
        Ok(())
    }

    pub(crate) fn open_axis(&mut self, axis: AxisHeader) -> Result<(), Reject> {
        let table = self.table.ok_or(Reject::NotOpen)?;
        if table.axis == Some(axis) {
            return Ok(());
        }
        axis.check().map_err(Reject::Table)?;
        self.fits(table.header.shared_bytes(), u64::from(axis.control_bytes))?;
        self.table = Some(Table { axis: Some(axis), controls: Progress::default(), checked: None, ..table });
        self.clear_map(Part::Axis);
        Ok(())
    }

    /// The table that is coming in has this header: it was opened before.
    pub(crate) fn is_opened_by(&self, header: &TableHeader) -> bool {
        self.memory.is_some() && self.table.is_some_and(|table| table.header == *header)
    }

    fn fits(&self, shared: u64, controls: u64) -> Result<(), Reject> {
        let most = PART_BYTES as u64;
        let available = self.memory.as_ref().map_or(0, |memory| memory.len()) as u64;
        let map = |bytes: u64| map_bytes(bytes.min(most) as usize) as u64;
        let needed =
            shared.saturating_add(controls).saturating_add(map(shared)).saturating_add(map(controls));
        let fits = needed <= available && shared <= most && controls <= most;
        if fits { Ok(()) } else { Err(Reject::NoRoom { needed, available }) }
    }

    /// Takes bytes from a unit on; those that have come before are taken again, those behind the end are ignored.
    pub(crate) fn data(&mut self, part: Part, unit: u32, bytes: &[u8]) -> Result<(), Reject> {
        let Some(table) = &mut self.table else { return Err(Reject::NotOpen) };
        let (from, length) = table.place(part).ok_or(Reject::NotOpen)?;
        let map = table.map(part).ok_or(Reject::NotOpen)?;
        let progress = table.progress(part);
        let Some(left) = (unit as usize).checked_mul(UNIT).and_then(|at| length.checked_sub(at)) else {
            return Ok(());
        };
        if progress.seal.is_some() {
            return Ok(());
        }
        // Only the last unit of a part may be shorter than the others.
        let count = if bytes.len() < left { bytes.len() / UNIT * UNIT } else { left };
        let at = from + length - left;
        let memory = self.memory.as_mut().ok_or(Reject::NotOpen)?;
        let (Some(bytes), Some(to)) = (bytes.get(..count), memory.get_mut(at..at + count)) else {
            return Err(Reject::NotOpen);
        };
        to.copy_from_slice(bytes);
        let room = memory.len();
        for unit in unit..unit + units(count) as u32 {
            let place = room.checked_sub(map).and_then(|map| memory.get_mut(map + unit as usize / 8));
            let Some(byte) = place else { return Err(Reject::NotOpen) };
            let bit = 1 << (unit % 8);
            progress.units += u32::from(*byte & bit == 0);
            *byte |= bit;
        }
        Ok(())
    }

    /// Ends a part.
    pub(crate) fn seal(&mut self, part: Part, crc: u32, key: Option<&Key>) -> Result<Sealed, Reject> {
        let Some(table) = &mut self.table else { return Err(Reject::NotOpen) };
        let (from, length) = table.place(part).ok_or(Reject::NotOpen)?;
        let progress = *table.progress(part);
        let whole = |table: &Table| if table.is_complete() { Sealed::Whole } else { Sealed::Half };
        if progress.seal == Some(crc) {
            return Ok(whole(table));
        }
        if (progress.units as usize) < units(length) {
            return Ok(Sealed::Missing(self.gaps(part)));
        }
        let memory = self.memory.as_ref().ok_or(Reject::NotOpen)?;
        let bytes = memory.get(from..from + length).ok_or(Reject::NotOpen)?;
        let found = match (part, table.axis) {
            (Part::Shared, _) => part_seal(key, &table.header, bytes),
            (Part::Axis, Some(axis)) => part_seal(key, &axis, bytes),
            (Part::Axis, None) => return Err(Reject::NotOpen),
        };
        if found != Ok(crc) {
            *table.progress(part) = Progress::default();
            self.clear_map(part);
            return Err(Reject::Checksum(part));
        }
        table.progress(part).seal = Some(crc);
        Ok(whole(table))
    }

    /// What has not come of a part.
    fn gaps(&self, part: Part) -> Gaps {
        let mut gaps = Gaps::default();
        let (Some(table), Some(memory)) = (&self.table, &self.memory) else { return gaps };
        let (Some((_, length)), Some(map)) = (table.place(part), table.map(part)) else { return gaps };
        let bits = memory.len().checked_sub(map).and_then(|from| memory.get(from..)).unwrap_or(&[]);
        let has = |unit: usize| bits.get(unit / 8).is_some_and(|byte| byte >> (unit % 8) & 1 != 0);
        let mut unit = 0;
        for gap in &mut gaps.0 {
            let run = |unit: &mut usize, arrived: bool| {
                let from = *unit;
                while *unit < units(length) && has(*unit) == arrived {
                    *unit += 1;
                }
                (*unit - from) as u32
            };
            *gap = (run(&mut unit, true), run(&mut unit, false));
        }
        gaps
    }

    fn clear_map(&mut self, part: Part) {
        let Some(table) = &self.table else { return };
        let (Some((_, length)), Some(map)) = (table.place(part), table.map(part)) else { return };
        let Some(memory) = &mut self.memory else { return };
        let from = memory.len().saturating_sub(map);
        if let Some(bits) = memory.get_mut(from..from + map_bytes(length)) {
            bits.fill(0);
        }
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

    /// How far from the end of the memory the bits of a part begin.
    fn map(&self, part: Part) -> Option<usize> {
        let shared = map_bytes(self.header.shared_bytes() as usize);
        match part {
            Part::Shared => Some(shared),
            Part::Axis => Some(shared + map_bytes(self.axis?.control_bytes as usize)),
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

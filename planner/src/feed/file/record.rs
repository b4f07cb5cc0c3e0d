//! Items as records: packed tables, run-length coded marks.

use protocol::table::{AxisHeader, TableHeader};
use serde::{Deserialize, Serialize};

use super::{FileHeader, ReadError, WriteError};
use crate::feed::job::{JobItem, PlannedSection};
use crate::feed::pack::{Packed, PackedAxis, TableBytes, pack, unpack};
use crate::geometry::section::{BlockMark, Deviation, FeedCap, Marks, SpeedCap};
use crate::job::machine::AxisLimits;
use crate::job::program::{MoveKind, StopCause};

/// A job item in the file.
#[derive(Serialize, Deserialize)]
pub(super) enum Item {
    Section(Section),
    Dwell { seconds: f64, line: u32 },
    Note { text: String, line: u32 },
}

/// A planned section in the file.
#[derive(Serialize, Deserialize)]
pub(super) struct Section {
    kind: MoveKind,
    limits: Vec<AxisLimits>,
    lsbs: Vec<f64>,
    header: TableHeader,
    shared: Vec<u8>,
    axes: Vec<Axis>,
    caps: Vec<CapRun>,
    blocks: Vec<BlockRun>,
    deviation: Deviation,
    end: StopCause,
}

#[derive(Serialize, Deserialize)]
struct Axis {
    header: AxisHeader,
    controls: Vec<u8>,
}

/// Neighbouring parts with the same cap are one run.
#[derive(Serialize, Deserialize)]
struct CapRun {
    length: u64,
    speed: SpeedCap,
}

/// `line` is the difference to the run before.
#[derive(Serialize, Deserialize)]
struct BlockRun {
    length: u64,
    line: i64,
}

impl Item {
    /// The record of an item, and the sizes of its table.
    pub(super) fn from_job(
        item: &JobItem,
        header: &FileHeader,
        index: u64,
        number: u32,
    ) -> Result<(Self, TableBytes), WriteError> {
        let record = match item {
            JobItem::Section(section) => return Section::from_job(section, header, index, number),
            JobItem::Dwell { seconds, line } => {
                if !(seconds.is_finite() && *seconds >= 0.0) {
                    return Err(WriteError::Value { item: index, what: "seconds" });
                }
                Item::Dwell { seconds: *seconds, line: *line }
            }
            JobItem::Note { text, line } => Item::Note { text: text.clone(), line: *line },
        };
        Ok((record, TableBytes::default()))
    }

    /// The item of a record, and the sizes of its table.
    pub(super) fn into_job(
        self,
        header: &FileHeader,
        record: u64,
        number: u32,
    ) -> Result<(JobItem, TableBytes), ReadError> {
        let item = match self {
            Item::Section(section) => return section.into_job(header, record, number),
            Item::Dwell { seconds, .. } if !(seconds.is_finite() && seconds >= 0.0) => {
                return Err(ReadError::Value { record, what: "seconds" });
            }
            Item::Dwell { seconds, line } => JobItem::Dwell { seconds, line },
            Item::Note { text, line } => JobItem::Note { text, line },
        };
        Ok((item, TableBytes::default()))
    }
}

impl Section {
    fn from_job(
        section: &PlannedSection,
        header: &FileHeader,
        item: u64,
        number: u32,
    ) -> Result<(Item, TableBytes), WriteError> {
        let refuse = |what| WriteError::Value { item, what };
        if section.limits.len() != header.axes.len() || !section.limits.iter().all(are_limits) {
            return Err(refuse("limits"));
        }
        let packed = pack(&section.table, number, &header.target(&section.limits))
            .map_err(|error| WriteError::Table { item, error })?;
        let bytes = packed.bytes();
        let length = section.table.path.grid_length();
        let caps = cap_runs(&section.marks.caps, length).ok_or_else(|| refuse("feed caps"))?;
        let blocks = block_runs(&section.marks.blocks, length).ok_or_else(|| refuse("block marks"))?;
        if !is_deviation(&section.marks.deviation) {
            return Err(refuse("deviations"));
        }
        let axes = packed.axes.into_iter();
        let record = Section {
            kind: section.kind,
            limits: section.limits.clone(),
            lsbs: section.table.path.axes.iter().map(|axis| axis.lsb).collect(),
            header: packed.header,
            shared: packed.shared,
            axes: axes.map(|axis| Axis { header: axis.header, controls: axis.controls }).collect(),
            caps,
            blocks,
            deviation: section.marks.deviation,
            end: section.marks.end,
        };
        Ok((Item::Section(record), bytes))
    }

    fn into_job(
        self,
        header: &FileHeader,
        record: u64,
        number: u32,
    ) -> Result<(JobItem, TableBytes), ReadError> {
        let refuse = |what| ReadError::Value { record, what };
        let wrong = |error| ReadError::Table { record, error };
        if self.limits.len() != header.axes.len() || !self.limits.iter().all(are_limits) {
            return Err(refuse("limits"));
        }
        let axes = self.axes.into_iter();
        let axes = axes.map(|axis| PackedAxis { header: axis.header, controls: axis.controls }).collect();
        let packed = Packed { header: self.header, shared: self.shared, axes };
        let table = unpack(&packed, &self.lsbs).map_err(wrong)?;
        // Headers repeat what the table and the machine say; packing again finds every contradiction.
        let again = pack(&table, number, &header.target(&self.limits)).map_err(wrong)?;
        if again != packed {
            return Err(refuse("table headers"));
        }
        let length = table.path.grid_length();
        let caps = caps(&self.caps, length).ok_or_else(|| refuse("feed caps"))?;
        let blocks = blocks(&self.blocks, length).ok_or_else(|| refuse("block marks"))?;
        if !is_deviation(&self.deviation) {
            return Err(refuse("deviations"));
        }
        let marks = Marks { caps, blocks, deviation: self.deviation, end: self.end };
        let section = PlannedSection { kind: self.kind, limits: self.limits, table, marks };
        Ok((JobItem::Section(section), packed.bytes()))
    }
}

pub(super) fn are_limits(limits: &AxisLimits) -> bool {
    let good = |x: f64| x > 0.0 && x.is_finite();
    good(limits.velocity) && good(limits.acceleration) && limits.jerk > 0.0
}

fn is_deviation(deviation: &Deviation) -> bool {
    let good = |x: f64| x >= 0.0 && x.is_finite();
    good(deviation.tolerance_mm) && good(deviation.bound_mm)
}

fn is_cap(cap: &SpeedCap) -> bool {
    match *cap {
        SpeedCap::None => true,
        SpeedCap::Tangential { speed, .. } | SpeedCap::Rate(speed) => speed > 0.0 && speed.is_finite(),
    }
}

/// Runs of equal caps; `None` unless the caps rise to `length`.
fn cap_runs(caps: &[FeedCap], length: u64) -> Option<Vec<CapRun>> {
    let mut runs: Vec<CapRun> = Vec::new();
    let mut at = 0;
    for cap in caps.iter() {
        let part = cap.until.checked_sub(at).filter(|_| is_cap(&cap.speed))?;
        match runs.last_mut() {
            Some(run) if run.speed == cap.speed => run.length += part,
            _ => runs.push(CapRun { length: part, speed: cap.speed }),
        }
        at = cap.until;
    }
    (at == length).then_some(runs)
}

fn caps(runs: &[CapRun], length: u64) -> Option<Vec<FeedCap>> {
    let mut until = 0u64;
    let caps = runs.iter().map(|run| {
        until = until.checked_add(run.length).filter(|_| is_cap(&run.speed))?;
        Some(FeedCap { until, speed: run.speed })
    });
    let caps = caps.collect::<Option<Vec<_>>>()?;
    (until == length).then_some(caps)
}

/// `None` unless the marks rise to `length`.
fn block_runs(marks: &[BlockMark], length: u64) -> Option<Vec<BlockRun>> {
    let (mut at, mut line) = (0, 0);
    let runs = marks.iter().map(|mark| {
        let run = BlockRun { length: mark.until.checked_sub(at)?, line: i64::from(mark.line) - line };
        (at, line) = (mark.until, i64::from(mark.line));
        Some(run)
    });
    let runs = runs.collect::<Option<Vec<_>>>()?;
    (at == length).then_some(runs)
}

fn blocks(runs: &[BlockRun], length: u64) -> Option<Vec<BlockMark>> {
    let (mut until, mut line) = (0u64, 0i64);
    let marks = runs.iter().map(|run| {
        until = until.checked_add(run.length)?;
        line = line.checked_add(run.line)?;
        Some(BlockMark { until, line: u32::try_from(line).ok()? })
    });
    let marks = marks.collect::<Option<Vec<_>>>()?;
    (until == length).then_some(marks)
}

#[cfg(test)]
impl Section {
    /// Makes the first axis' header contradict its control points.
    pub(super) fn shift_end_for_test(&mut self) {
        self.axes[0].header.end += 1;
    }
}

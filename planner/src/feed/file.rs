//! The `.feed` file: a planned job as it is stored.
//!
//! ```text
//! magic "FEEDSPLN" | version u16 | schema hash u64 | record ...        little-endian
//! record:  kind u8 | length u32 | payload (postcard) | CRC-32C u32 over all before
//! kinds:   1 header (first), 2 item, 3 end (last)
//! ```
//!
//! Tables are stored in the very bytes that the drives get. A file is written under a temporary name and renamed
//! when it is complete.

mod error;
mod reader;
mod record;
mod writer;

use std::path::Path;

use protocol::checksum::Fnv64;
use serde::{Deserialize, Serialize};

pub use error::{ReadError, WriteError};
pub use reader::FeedReader;
pub use writer::{FeedWriter, PendingFile};

use super::job::JobItem;
use super::pack::{AxisScale, Target};
use crate::job::machine::{Axis, AxisKind, AxisLimits, Machine, OverrideRule, Unit};

const MAGIC: [u8; 8] = *b"FEEDSPLN";

/// Version of the file format.
pub const FILE_VERSION: u16 = 1;

/// All records in their order in the file; whoever changes one of them changes this text.
const SCHEMA: &str = "\
FileHeader{name str,tick_ns u32,axes [FileAxis],override_rule OverrideRule}\
OverrideRule{most f64,acceleration f64,jerk f64}\
FileAxis{name str,kind[Linear,Rotary],unit[Mm,Deg,Rad],counts_per_unit f64,travel [f64;2],limits AxisLimits,\
rapid AxisLimits,tolerance_scale f64}AxisLimits{velocity f64,acceleration f64,jerk f64}\
Item[Section{kind[Rapid,Feed],limits [AxisLimits],lsbs [f64],header TableHeader,shared [u8],\
axes [{header AxisHeader,controls [u8]}],caps [{length u64,speed[None,Tangential{axes u16,speed f64},Rate f64]}],\
blocks [{length u64,line i64 delta}],deviation{tolerance_mm f64,bound_mm f64,line u32},end StopCause},\
Dwell{seconds f64,line u32},Note{text str,line u32}]\
StopCause[ProgramStop,ProgramEnd,Spindle,ToolChange,OffsetChange,Dwell,ExactStop,ExactPathCorner,Reversal,Rapid]\
Totals{items u64,sections u64,spans u64,geometry_spans u64,table_bytes u64}";

/// Names the format of the records: the file's own and the wire's.
pub const SCHEMA_HASH: u64 =
    Fnv64::new().with(protocol::schema::SCHEMA.as_bytes()).with(SCHEMA.as_bytes()).finish();

/// What the file says of the machine: all that is needed to read, verify and send the tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FileHeader {
    /// Name of the machine.
    pub name: String,
    /// Control tick [ns].
    pub tick_ns: u32,
    /// The axes, in the machine's order.
    pub axes: Vec<FileAxis>,
    /// What overrides and holds may do.
    pub override_rule: OverrideRule,
}

/// One axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FileAxis {
    /// Name.
    pub name: String,
    /// Slide or turntable.
    pub kind: AxisKind,
    /// Unit of every length of this axis.
    pub unit: Unit,
    /// Drive counts per axis unit.
    pub counts_per_unit: f64,
    /// Lowest and highest machine position [axis unit].
    pub travel: [f64; 2],
    /// Limits of feed moves.
    pub limits: AxisLimits,
    /// Limits of rapid moves.
    pub rapid: AxisLimits,
    /// A section whose deviation from the program may be d mm may leave this axis' travel by d times this.
    pub tolerance_scale: f64,
}

/// What the file holds; its end record says so, and a reader counts again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Totals {
    /// Items.
    pub items: u64,
    /// Items that are sections.
    pub sections: u64,
    /// q spans of all tables.
    pub spans: u64,
    /// Geometry spans of all tables.
    pub geometry_spans: u64,
    /// Bytes of all tables: streams and headers.
    pub table_bytes: u64,
}

/// A file, read as a whole.
#[derive(Clone, Debug, PartialEq)]
pub struct FeedFile {
    /// The machine.
    pub header: FileHeader,
    /// The items, in order.
    pub items: Vec<JobItem>,
    /// What the file says it holds.
    pub totals: Totals,
}

impl From<&Axis> for FileAxis {
    fn from(axis: &Axis) -> Self {
        Self {
            name: axis.name.clone(),
            kind: axis.kind,
            unit: axis.unit,
            counts_per_unit: axis.counts_per_unit,
            travel: axis.travel,
            limits: axis.limits,
            rapid: axis.rapid,
            tolerance_scale: 1.0,
        }
    }
}

impl From<&Machine> for FileHeader {
    fn from(machine: &Machine) -> Self {
        Self {
            name: machine.name.clone(),
            tick_ns: (machine.control_tick_s * 1e9).round() as u32,
            axes: machine.axes.iter().map(|axis| with_tolerance(axis, machine)).collect(),
            override_rule: machine.override_rule,
        }
    }
}

/// On rotary axes a tolerance in mm counts as so many units as the machine's two tolerances say.
fn with_tolerance(axis: &Axis, machine: &Machine) -> FileAxis {
    let tolerance_scale = match axis.kind {
        AxisKind::Linear => 1.0,
        AxisKind::Rotary => machine.tolerance_rotary / machine.tolerance_mm,
    };
    FileAxis { tolerance_scale, ..FileAxis::from(axis) }
}

impl FileHeader {
    /// What packing a table with these limits needs; short if `limits` is.
    pub fn target(&self, limits: &[AxisLimits]) -> Target {
        let pairs = self.axes.iter().zip(limits);
        Target {
            tick_ns: self.tick_ns,
            override_rule: self.override_rule.of_plans(),
            axes: pairs
                .map(|(axis, limits)| AxisScale { counts_per_unit: axis.counts_per_unit, limits: *limits })
                .collect(),
        }
    }
}

/// Writes a job, all or nothing.
///
/// # Errors
/// The file cannot be written, or an item cannot be expressed; nothing is left behind then.
pub fn write<'i>(
    path: &Path,
    header: &FileHeader,
    items: impl IntoIterator<Item = &'i JobItem>,
) -> Result<Totals, WriteError> {
    let mut file = PendingFile::create(path, header)?;
    for item in items {
        file.push(item)?;
    }
    file.commit()
}

/// Reads a whole job.
///
/// # Errors
/// The first thing that is wrong with the file.
pub fn read(path: &Path) -> Result<FeedFile, ReadError> {
    FeedReader::new(std::io::BufReader::new(std::fs::File::open(path)?))?.read_all()
}

#[cfg(test)]
mod tests;

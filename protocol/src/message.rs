//! What host and drives say to each other: postcard, one message per block.
//!
//! The order of the variants is the wire's numbering: new ones go to the end.

use serde::{Deserialize, Serialize};

use crate::bus::MESSAGE_BYTES;
use crate::power::{Power, PowerEvent};
use crate::table::{AxisHeader, AxisLimit, Limits, TableError, TableHeader};
use crate::update::{Progress, Update, UpdateFault};

/// Longest message of a drive.
pub const ANSWER_BYTES: usize = 80;

/// Room for any header, as postcard.
pub const HEADER_BYTES: usize = 128;

/// From the host.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum HostMessage<'a> {
    /// A table is to come: its shared header, to all drives. Forgets a table that was received before and
    /// neither plays nor is armed.
    Open(TableHeader),
    /// The header of the axis part, to one drive, after [`HostMessage::Open`].
    OpenAxis(AxisHeader),
    /// The part is complete; the drive checks it. When both parts are sealed it answers
    /// [`DriveMessage::Ready`] or [`DriveMessage::Reject`].
    Seal {
        /// Which table.
        table: u32,
        /// Which part of it.
        part: Part,
        /// [`crate::authentic::part_seal`]: CRC-32C over the part's header, as postcard, and its bytes; under a key another one.
        crc: u32,
    },
    /// The table starts to play at this tick of the drives' common count. A table that joins another one starts where that one
    /// is left, and the tick is not looked at.
    Start {
        /// Which table.
        table: u32,
        /// When [ticks].
        tick: u64,
    },
    /// Nothing starts any more: armed and received tables are forgotten. A table that plays goes on to its end,
    /// which is at rest.
    Stop,
    /// Who is there? Every drive that hears it answers [`DriveMessage::Identity`], whatever its state.
    Identify,
    /// Comes to rest as fast as the axis' own limits allow, off the path if need be, and forgets all tables.
    QuickStop,
    /// Goes to a position and comes to rest there, in the least time that the axis' own limits allow. It may be given
    /// again on the way, with another position; while a table plays or is armed it is refused.
    MoveTo {
        /// Where to [counts].
        position: i64,
        /// No faster than this [counts/s]; none: as fast as the axis may be.
        velocity: Option<f32>,
    },
    /// Goes at a velocity [counts/s] until told otherwise, as fast as the limits allow; 0 comes to rest. Where the axis
    /// has a travel, it goes to the end of it.
    MoveAt {
        /// How fast, and which way.
        velocity: f32,
    },
    /// Changes the power state.
    Power(PowerEvent),
    /// From this tick on, path time goes at another rate; 0 holds the axis on its path.
    Override {
        /// The rate [0.1 %].
        permille: u16,
        /// When [ticks].
        tick: u64,
        /// Repeats have the same number, which beats confirm; with 0 every one counts.
        number: u8,
    },
    /// The host is there: what drives that guard against a lost connection wait for.
    Alive,
    /// Opens the epoch of the block that carries it, for one drive: nothing moves without one. It has to be newer than all that
    /// the drive knows, and the drive at rest.
    Begin {
        /// What the drive has told of its last start-up: a host that does not know it was not meant for this one.
        boot: u32,
        /// Drives that move together: bit n - 1 for node n. The lowest one is the time master.
        members: u128,
    },
    /// How is everything? Answered by [`DriveMessage::Status`] in any state.
    Report,
    /// A message under the key of [`crate::authentic`]: what a drive that has one wants of everything that moves or configures it.
    Signed {
        /// Greater than in every message that the drive has obeyed since it is up.
        counter: u64,
        /// [`crate::authentic::Key::tag`].
        tag: u64,
        /// The message, as postcard.
        message: &'a [u8],
    },
    /// A new image for the drive, while its power stage is off. Answered by [`DriveMessage::Update`].
    Update(#[serde(borrow)] Update<'a>),
    /// Bytes of a table, in any order; repeated ones are harmless. They have frames of their own, see [`crate::bus::data`].
    #[serde(skip)]
    Data {
        /// Lowest bits of the table's number.
        tag: u8,
        /// Which part of it.
        part: Part,
        /// First unit of the part.
        unit: u32,
        /// The bytes from there on.
        bytes: &'a [u8],
    },
}

/// A part of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Part {
    /// Geometry stream, then span stream.
    Shared,
    /// Control stream of one axis.
    Axis,
}

/// From a drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum DriveMessage {
    /// The table is complete, checked and may be started.
    Ready {
        /// Which table.
        table: u32,
        /// How long it plays [ticks], rounded up.
        ticks: u64,
        /// Checksums of the shared and the axis part.
        crc: [u32; 2],
    },
    /// A message was refused.
    Reject {
        /// Which table.
        table: u32,
        /// Why.
        reason: Reject,
    },
    /// How the drive is.
    Status(Status),
    /// Who the drive is.
    Identity(Identity),
    /// How well it follows; after a status, from drives that know their position.
    Telemetry(Telemetry),
    /// The answer to a seal that came too early: what has not arrived.
    Missing {
        /// Which table.
        table: u32,
        /// Which part of it.
        part: Part,
        /// The first gaps.
        gaps: Gaps,
    },
    /// The epoch is open.
    Begun {
        /// The epoch.
        epoch: u16,
    },
    /// How far the drive is with a new image.
    Update(Progress),
}

/// Gaps that are told at once.
pub const GAPS: usize = 8;

/// What is missing of a part: units that have arrived, and units behind them that have not, in turn. A gap of none ends the list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gaps(pub [(u32, u32); GAPS]);

impl Gaps {
    /// The gaps as ranges of units; a list that makes no sense ends where it does so.
    pub fn ranges(&self) -> impl Iterator<Item = core::ops::Range<u32>> + '_ {
        self.0.iter().scan(0u32, |at, &(arrived, missing)| {
            let from = at.checked_add(arrived)?;
            *at = from.checked_add(missing)?;
            (missing > 0).then_some(from..*at)
        })
    }
}

/// How an axis has followed since the telemetry before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Telemetry {
    /// Over how many ticks.
    pub ticks: u32,
    /// Largest following error [counts].
    pub following_max: u32,
    /// Its root mean square [counts], to 7 %.
    pub following_rms: f32,
    /// How long the drive can go on with what it may play [ms].
    pub fill_ms: u32,
    /// What the dearest tick has cost, in what the board counts; 0: it does not.
    pub worst_tick: u32,
}

/// What a drive tells of itself before anything else is said.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Version of its core: major, minor, patch.
    pub version: [u8; 3],
    /// Table format it plays.
    pub format: u8,
    /// Schema hash of its messages ([`crate::schema::HASH`]).
    pub schema: u64,
    /// Its axis, in the machine's order.
    pub axis: u8,
    /// Its control tick [ns].
    pub tick_ns: u32,
    /// Tables planned for more are refused.
    pub limits: Limits,
    /// Room for one table [bytes]; it holds two.
    pub room: u32,
    /// Another number after every start-up.
    pub boot: u32,
    /// The newest epoch that it knows.
    pub epoch: u16,
}

/// How a drive is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// What it does.
    pub state: State,
    /// Its power state.
    pub power: Power,
    /// First cause of the latched fault.
    pub fault: Option<Fault>,
    /// The drive's tick count.
    pub tick: u64,
    /// Position set-point [counts].
    pub position: i64,
    /// How long it can go on with what it holds and may play [ticks].
    pub fill: u64,
}

/// What a drive does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Stands still; no table.
    Idle,
    /// Stands still; a table is coming in.
    Receiving,
    /// Stands still; a checked table waits for its start.
    Ready,
    /// Stands still until the tick of the start.
    Armed,
    /// Plays a table.
    Running,
    /// Stands still at the end of a table.
    Holding,
    /// Stands still on its path, which goes on when the override is raised.
    Held,
    /// Comes to rest off the path.
    Stopping,
    /// On its way to a position, or at a velocity.
    Moving,
}

/// Why a drive gave up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fault {
    /// A checked table was not the same any more when it was played.
    Table {
        /// Which table.
        table: u32,
        /// What was wrong.
        error: TableError,
    },
    /// A set-point would have broken a limit of the axis.
    Limit(AxisLimit),
    /// The host was not heard for too long.
    Connection,
    /// The board has found something: over-current, over-temperature, an encoder that is gone.
    Board {
        /// Its number for it.
        code: u16,
    },
}

/// Why a drive refuses a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reject {
    /// The bytes are not an admissible table.
    Table(TableError),
    /// A part's checksum differs.
    Checksum(Part),
    /// The table does not fit the drive's memory.
    NoRoom {
        /// Bytes it needs.
        needed: u64,
        /// Bytes there are.
        available: u64,
    },
    /// The table was made for another control tick.
    Tick {
        /// The drive's tick [ns].
        tick_ns: u32,
    },
    /// The axis part belongs to another axis.
    Axis {
        /// The drive's axis.
        axis: u8,
    },
    /// The table was planned for limits above the drive's.
    Limits,
    /// The table does not start where the motion before it ends.
    Position {
        /// Where the motion before it ends [counts].
        position: i64,
    },
    /// A table plays or is armed: both buffers are taken, or the number is, or another start is pending.
    Busy,
    /// No such table is open.
    NotOpen,
    /// The table is not ready to start.
    NotReady,
    /// The tick of the start is not in the future.
    Late {
        /// The drive's tick count.
        tick: u64,
    },
    /// The tick of the start lies before the end of the table that plays.
    Overlap {
        /// First possible tick.
        tick: u64,
    },
    /// A fault is latched.
    Fault,
    /// The position is outside the travel, or the velocity is no admissible number.
    Target,
    /// Not in this power state.
    Power(Power),
    /// The axis has to come to rest first.
    Moves,
    /// The table does not admit this rate, or no change of it.
    Override,
    /// The table does not go on where the table is left that it names.
    Joint,
    /// Not of the open epoch, or not newer than what the drive knows.
    Epoch {
        /// The newest one that it knows.
        epoch: u16,
    },
    /// Meant for another start-up of the drive.
    Boot,
    /// The drive's clock does not agree with the time master's.
    Clock,
    /// The drive is not one of the members, or they are too many.
    Members,
    /// The drive has a key, and this is not signed with it.
    Key,
    /// Not while things are so, or not this image.
    Update(UpdateFault),
}

/// Why a message could not be written or read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageError {
    /// The buffer is too small.
    NoRoom,
    /// The bytes are no message.
    Malformed,
    /// There are bytes behind the message.
    LeftOver,
}

/// A buffer that every message fits.
pub type MessageBuffer = [u8; MESSAGE_BYTES];

/// Writes a message into `buffer`.
pub fn encode<'b, M: Serialize>(message: &M, buffer: &'b mut [u8]) -> Result<&'b [u8], MessageError> {
    match postcard::to_slice(message, buffer) {
        Ok(bytes) => Ok(bytes),
        Err(_) => Err(MessageError::NoRoom),
    }
}

/// Reads a message.
pub fn decode<'a, M: Deserialize<'a>>(bytes: &'a [u8]) -> Result<M, MessageError> {
    match postcard::take_from_bytes(bytes) {
        Ok((message, [])) => Ok(message),
        Ok(_) => Err(MessageError::LeftOver),
        Err(_) => Err(MessageError::Malformed),
    }
}

/// Checksum of a part: CRC-32C over its header, as postcard, and its streams in order.
pub fn part_crc<H: Serialize>(header: &H, streams: &[&[u8]]) -> Result<u32, MessageError> {
    let mut buffer = [0u8; HEADER_BYTES];
    let mut crc = crate::checksum::Crc32::new();
    crc.update(encode(header, &mut buffer)?);
    streams.iter().for_each(|bytes| crc.update(bytes));
    Ok(crc.finish())
}

#[cfg(test)]
mod tests;

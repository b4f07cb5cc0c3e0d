//! Identifiers on the bus.
//!
//! CANopen's own services keep theirs, so that its tools can share the bus: NMT 000, SYNC 080, EMCY 080 + n,
//! TIME 100, SDO 580 + n and 600 + n, heartbeat 700 + n. Ours lie where CANopen has process data:
//!
//! | id | from | to | what | form |
//! |---|---|---|---|---|
//! | 000 | anybody | all | NMT of CANopen: stops, never starts | [`stop`](super::stop) |
//! | 010 | anybody | all | stop; only NMT outranks it | [`stop`](super::stop) |
//! | 012 | time master | all | the time of the SYNC before | [`sync`](super::sync) |
//! | 080 | time master | all | SYNC | [`sync`](super::sync) |
//! | 080 + n | drive n | all | faults, and stops that are to be common | [`emergency`](super::emergency) |
//! | 180 + n | drive n | host | answers | block |
//! | 200 | host | all | messages to all drives | block |
//! | 200 + n | host | drive n | messages to one drive | block |
//! | 280 + n | drive n | all | beat: what every other node has to know | [`beat`](super::beat) |
//! | 300 | host | all | bytes of a shared part | [`data`](super::data) |
//! | 300 + n | host | drive n | bytes of an axis part | [`data`](super::data) |
//! | 700 + n | drive n | all | boot-up message of CANopen | one byte, 0 |

/// NMT of CANopen.
pub const NMT: u16 = 0x000;

/// Stop, to all.
pub const STOP: u16 = 0x010;

/// The time at which the SYNC before it ended.
pub const TIME: u16 = 0x012;

/// SYNC of CANopen.
pub const SYNC: u16 = 0x080;

/// Messages to all drives.
pub const BROADCAST: u16 = 0x200;

/// Table bytes for all drives.
pub const DATA: u16 = 0x300;

const EMERGENCY: u16 = 0x080;
const ANSWER: u16 = 0x180;
const BEAT: u16 = 0x280;
const HEARTBEAT: u16 = 0x700;

/// Address of a drive, 1 to 127 as in CANopen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Node(u8);

impl Node {
    /// A node; `None` outside 1 to 127.
    pub const fn new(number: u8) -> Option<Self> {
        if number >= 1 && number <= 127 { Some(Self(number)) } else { None }
    }

    /// 1 to 127.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Identifier of messages from the host to this drive alone.
    pub const fn to_drive(self) -> u16 {
        BROADCAST + self.0 as u16
    }

    /// Identifier of table bytes for this drive alone.
    pub const fn data(self) -> u16 {
        DATA + self.0 as u16
    }

    /// Identifier of answers from this drive.
    pub const fn from_drive(self) -> u16 {
        ANSWER + self.0 as u16
    }

    /// Identifier of this drive's beats.
    pub const fn beat(self) -> u16 {
        BEAT + self.0 as u16
    }

    /// Identifier of this drive's emergencies.
    pub const fn emergency(self) -> u16 {
        EMERGENCY + self.0 as u16
    }

    /// Identifier of this drive's boot-up message.
    pub const fn heartbeat(self) -> u16 {
        HEARTBEAT + self.0 as u16
    }

    /// The drive that sends answers with this identifier.
    pub const fn of_answer(id: u16) -> Option<Self> {
        Self::behind(id, ANSWER)
    }

    /// The drive that sends beats with this identifier.
    pub const fn of_beat(id: u16) -> Option<Self> {
        Self::behind(id, BEAT)
    }

    /// The drive that sends emergencies with this identifier.
    pub const fn of_emergency(id: u16) -> Option<Self> {
        Self::behind(id, EMERGENCY)
    }

    const fn behind(id: u16, base: u16) -> Option<Self> {
        if id > base && id <= base + 127 { Some(Self((id - base) as u8)) } else { None }
    }
}

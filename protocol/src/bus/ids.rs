//! Identifiers on the bus.
//!
//! CANopen's own services keep theirs, so that its tools can share the bus: NMT 000, SYNC 080, EMCY 080 + n,
//! TIME 100, SDO 580 + n and 600 + n, heartbeat 700 + n. Ours lie where CANopen has process data:
//!
//! | id | from | to | what |
//! |---|---|---|---|
//! | 010 | host | all | stop; only NMT outranks it |
//! | 180 + n | drive n | host | answers and status |
//! | 200 | host | all | shared parts, seal, start |
//! | 200 + n | host | drive n | axis part |

/// Stop, to all.
pub const STOP: u16 = 0x010;

/// Messages to all drives.
pub const BROADCAST: u16 = 0x200;

const ANSWER: u16 = 0x180;

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

    /// Identifier of frames from the host to this drive alone.
    pub const fn to_drive(self) -> u16 {
        BROADCAST + self.0 as u16
    }

    /// Identifier of frames from this drive.
    pub const fn from_drive(self) -> u16 {
        ANSWER + self.0 as u16
    }

    /// The drive that sends frames with this identifier.
    pub const fn of_answer(id: u16) -> Option<Self> {
        if id > ANSWER && id <= ANSWER + 127 { Some(Self((id - ANSWER) as u8)) } else { None }
    }
}

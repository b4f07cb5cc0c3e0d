//! The objects of the verbs that speak to drives.

use serde::Serialize;

/// The object of `stream`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StreamJson {
    /// Tables that were sent.
    pub pieces: u64,
    /// The longest of them, as a drive holds it [bytes].
    pub largest_piece_bytes: u64,
    /// What the motion takes as planned [s].
    pub motion_s: f64,
    /// From the first word to the last [s]; of the bus' own time where drives are simulated.
    pub seconds: f64,
    /// How little the drives ever had in hand while they moved [ms].
    pub lowest_fill_ms: Option<u16>,
    /// Frames and messages that were sent again.
    pub resent_frames: u64,
    /// Starts that were called off, and made again.
    pub aborted_starts: u64,
    /// Somebody has stopped it.
    pub stopped: bool,
    /// Where the axes stand in the end [axis unit].
    pub end: Vec<f64>,
}

/// The object of `jog`, `home` and `move --bus`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrandJson {
    /// Where the axes stand in the end.
    pub axes: Vec<AxisAtJson>,
    /// How long it took [s].
    pub seconds: f64,
    /// Somebody has stopped it.
    pub stopped: bool,
}

/// Where an axis stands.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisAtJson {
    /// Its name.
    pub name: String,
    /// Its position [axis unit].
    pub position: f64,
}

/// The object of `status`, `hold` and `resume`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatusJson {
    /// The drives that were heard, by their addresses.
    pub drives: Vec<DriveJson>,
}

/// How a drive is.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DriveJson {
    /// Its address.
    pub node: u8,
    /// What it does.
    pub state: Option<String>,
    /// Its power state.
    pub power: Option<String>,
    /// First cause of its latched fault.
    pub fault: Option<String>,
    /// Its epoch, and whether that is open.
    pub epoch: Option<u16>,
    /// Motion may begin.
    pub open: Option<bool>,
    /// Its clock agrees with the time master's.
    pub synced: Option<bool>,
    /// Position set-point [counts].
    pub position_counts: Option<i64>,
    /// How long it can go on with what it has [ms].
    pub fill_ms: Option<u16>,
    /// Version of its core.
    pub core_version: Option<String>,
    /// Whether it speaks this host's version of the protocol.
    pub schema_matches: Option<bool>,
}

/// The object of `stop`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StopJson {
    /// How: `path`, `quick` or `off`.
    pub stop: String,
    /// How often it was sent.
    pub frames_sent: u32,
}

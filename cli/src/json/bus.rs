//! The objects of `drive` and `bus`.

use std::collections::BTreeMap;

use host_sim::bus::real::Health;
use host_sim::bus::{Nanoseconds, Traffic};
use serde::Serialize;

/// The object of `drive`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DrivesJson {
    /// The bus as named on the command line.
    pub bus: String,
    /// Frames that are sent: `classic` or `fd`.
    pub frame_format: &'static str,
    /// Name of the machine.
    pub machine: String,
    /// How long the drives were there [s].
    pub seconds: f64,
    /// The drives, by axis.
    pub drives: Vec<DriveAxisJson>,
    /// Ticks that were computed later than the next one was due.
    pub late_ticks: u64,
    /// How late any tick was at most [s].
    pub worst_lateness_s: f64,
    /// What has crossed the bus, and what has not.
    pub bus_health: HealthJson,
}

/// The object of `update`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct UpdateJson {
    /// The image as named on the command line.
    pub image: String,
    /// Its length [bytes].
    pub image_bytes: u32,
    /// SHA-256 over it, hexadecimal.
    pub sha256: String,
    /// Address of the drive.
    pub node: u8,
    /// How long it took [s].
    pub seconds: f64,
}

/// One drive at the end.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DriveAxisJson {
    /// Its address.
    pub node: u8,
    /// Name of its axis.
    pub axis: String,
    /// What it does.
    pub state: &'static str,
    /// Its power state.
    pub power: &'static str,
    /// Its latched fault; null: none.
    pub fault: Option<String>,
    /// Its set-point [counts].
    pub position_counts: i64,
    /// Its newest epoch.
    pub epoch: u16,
    /// Whether it is open.
    pub epoch_open: bool,
    /// Control ticks since it has started up.
    pub ticks: u64,
    /// Frames and messages that it could not understand.
    pub not_understood: u32,
}

/// What has crossed a bus, and what has not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct HealthJson {
    /// Frames sent and received.
    pub frames: u64,
    /// Payload bytes in them.
    pub bytes: u64,
    /// Errors that the controller has reported, or lines that are none.
    pub bus_errors: u64,
    /// Frames that were lost because nobody had taken them in time.
    pub overruns: u64,
    /// Frames that are none of ours.
    pub foreign: u64,
    /// Frames that were not sent: too old, or the bus was gone.
    pub dropped: u64,
    /// Frames of which the bus has not told in time that they were sent.
    pub unconfirmed: u64,
}

impl HealthJson {
    /// Puts it together.
    pub fn of(traffic: Traffic, health: Health) -> Self {
        let Health { errors, overruns, foreign, dropped, unconfirmed } = health;
        let Traffic { frames, bytes, .. } = traffic;
        HealthJson { frames, bytes, bus_errors: errors, overruns, foreign, dropped, unconfirmed }
    }
}

/// The object of `bus`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WatchedJson {
    /// The bus or the log as named on the command line.
    pub source: String,
    /// Frames seen.
    pub frames: u64,
    /// The same by kind; kinds that do not occur are absent.
    pub counts: BTreeMap<&'static str, u64>,
    /// What they say, in order.
    pub decoded: Vec<DecodedJson>,
    /// Those beyond what is kept.
    pub left_out: u64,
    /// Lines of the log that are none.
    pub malformed_lines: u64,
    /// The first of them.
    pub malformed: Vec<MalformedJson>,
    /// What has crossed the bus, and what has not; null for a log.
    pub bus_health: Option<HealthJson>,
}

/// A frame or a message in words.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DecodedJson {
    /// When it came, or was complete [s].
    pub time_s: f64,
    /// Identifier of its frames, hexadecimal.
    pub id: String,
    /// The drive it comes from or goes to; null: all, or nobody in particular.
    pub node: Option<u8>,
    /// What it is about.
    pub kind: &'static str,
    /// What it says.
    pub text: String,
}

/// A line that is none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MalformedJson {
    /// Line, from 1.
    pub line: u64,
    /// Column in bytes, from 1.
    pub column: u32,
    /// What is wrong.
    pub message: String,
}

/// Nanoseconds as seconds.
pub fn seconds(time: Nanoseconds) -> f64 {
    time as f64 * 1e-9
}

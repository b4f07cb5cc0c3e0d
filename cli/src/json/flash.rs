//! The object of `flash`.

use std::path::Path;

use protocol::bus::Node;
use protocol::message::Identity;
use serde::Serialize;

/// What a drive says of itself.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlashJson {
    /// The board.
    pub board: String,
    /// The image that runs on it.
    pub image: String,
    /// The drive's address.
    pub node: u8,
    /// Version of its core.
    pub core_version: String,
    /// Table format it plays.
    pub format_version: u8,
    /// Schema hash of its messages, 16 hexadecimal digits.
    pub schema_hash: String,
    /// Whether that is this host's.
    pub schema_matches: bool,
    /// Its axis, from 0.
    pub axis: u8,
    /// Its control tick [s].
    pub control_tick_s: f64,
    /// Tables planned for more are refused.
    pub drive_limits: DriveLimitsJson,
    /// Room for one table [bytes].
    pub table_room_bytes: u32,
}

/// Limits of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DriveLimitsJson {
    /// Counts per second.
    pub velocity_counts_s: f32,
    /// Counts per second squared.
    pub acceleration_counts_s2: f32,
    /// Counts per second cubed; null: not limited.
    pub jerk_counts_s3: Option<f32>,
}

impl FlashJson {
    /// Puts it together.
    pub fn of(board: &str, image: &Path, node: Node, identity: &Identity, schema_matches: bool) -> Self {
        let [major, minor, patch] = identity.version;
        FlashJson {
            board: board.to_owned(),
            image: image.display().to_string(),
            node: node.number(),
            core_version: format!("{major}.{minor}.{patch}"),
            format_version: identity.format,
            schema_hash: format!("{:016x}", identity.schema),
            schema_matches,
            axis: identity.axis,
            control_tick_s: f64::from(identity.tick_ns) * 1e-9,
            drive_limits: DriveLimitsJson {
                velocity_counts_s: identity.limits.velocity,
                acceleration_counts_s2: identity.limits.acceleration,
                jerk_counts_s3: identity.limits.jerk,
            },
            table_room_bytes: identity.room,
        }
    }
}

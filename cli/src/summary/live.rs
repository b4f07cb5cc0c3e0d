//! Summaries of the verbs that speak to drives.

use planner::feed::file::{FileAxis, FileHeader};

use super::{Sheet, bytes, count, duration};
use crate::json::{DriveJson, ErrandJson, StatusJson, StreamJson};

/// The summary of `stream`.
pub fn stream(told: &StreamJson, header: &FileHeader) -> String {
    let mut s = Sheet::new(if told.stopped { "stopped" } else { "played" });
    s.row("motion", &format!("{} planned, {} on the bus", duration(told.motion_s), duration(told.seconds)));
    s.row("pieces", &format!("{}, at most {}", count(told.pieces), bytes(told.largest_piece_bytes)));
    if let Some(fill) = told.lowest_fill_ms {
        s.row("least in hand", &format!("{fill} ms"));
    }
    if told.resent_frames + told.aborted_starts > 0 {
        let (frames, starts) = (count(told.resent_frames), count(told.aborted_starts));
        s.row("sent again", &format!("{frames} frames, {starts} starts"));
    }
    let place = |(axis, p): (&FileAxis, &f64)| format!("{} {p:.4}", axis.name);
    let places: Vec<String> = header.axes.iter().zip(&told.end).map(place).collect();
    s.row("axes at", &places.join("  "));
    s.text
}

/// The summary of `jog`, `home` and `move --bus`.
pub fn errand(told: &ErrandJson, header: &FileHeader) -> String {
    let mut s = Sheet::new(if told.stopped { "stopped" } else { "done" });
    s.row("time", &duration(told.seconds));
    for (axis, at) in header.axes.iter().zip(&told.axes) {
        s.row(&format!("axis {}", axis.name), &format!("{:.4}", at.position));
    }
    s.text
}

/// The summary of `status`.
pub fn status(told: &StatusJson) -> String {
    let mut s = Sheet::new(&format!("{} drives", told.drives.len()));
    for drive in &told.drives {
        s.row(&format!("node {}", drive.node), &line(drive));
    }
    s.text
}

fn line(drive: &DriveJson) -> String {
    let word = |text: &Option<String>| text.clone().unwrap_or_else(|| "?".into());
    let mut parts = vec![word(&drive.state), word(&drive.power)];
    if let Some(position) = drive.position_counts {
        parts.push(format!("at {position} counts"));
    }
    if let Some(fill) = drive.fill_ms.filter(|fill| *fill > 0) {
        parts.push(format!("{fill} ms in hand"));
    }
    match (drive.epoch, drive.open) {
        (Some(epoch), Some(true)) => parts.push(format!("epoch {epoch}")),
        (Some(epoch), _) => parts.push(format!("epoch {epoch}, closed")),
        _ => {}
    }
    if drive.synced == Some(false) {
        parts.push("clock apart".into());
    }
    if let Some(fault) = &drive.fault {
        parts.push(format!("FAULT {fault}"));
    }
    if drive.schema_matches == Some(false) {
        parts.push("speaks ANOTHER VERSION".into());
    }
    parts.join(", ")
}

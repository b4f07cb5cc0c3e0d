//! What can be told of a `.feed` file from the file alone.

use std::path::Path;
use std::time::Instant;

use planner::certificate::verify as prove;
use planner::feed::file::{FILE_VERSION, FeedFile, ReadError, SCHEMA_HASH, read};
use planner::feed::job::JobItem;
use planner::feed::pack::pack;
use planner::job::machine::Unit;

use super::playback::seconds;
use crate::failure::Failure;
use crate::json::{AxisRatiosJson, CertificateJson, InspectAxisJson, InspectJson, VerifyJson};
use crate::progress::Progress;

/// Reads a file.
///
/// # Errors
/// It is no sound feed table.
pub(crate) fn open(path: &Path) -> Result<FeedFile, Failure> {
    if path.is_dir() {
        return Err(Failure::unreadable(path, &std::io::ErrorKind::IsADirectory.into()));
    }
    read(path).map_err(|e| match e {
        ReadError::Io(e) => Failure::unreadable(path, &e),
        e => Failure::input(format!("this is no sound feed table: {e}"))
            .in_file(path)
            .with_help("Make it again with `feedspline plan`."),
    })
}

/// Proves the tables of a file against the limits it carries.
///
/// # Errors
/// The file is no feed table.
pub(super) fn verify(path: &Path, progress: &mut Progress) -> Result<VerifyJson, Failure> {
    progress.stage("proving");
    let mut file = open(path)?;
    let begin = Instant::now();
    // A table planned without jerk limits says so; then the machine's do not count either.
    let free = |item: &JobItem| match item {
        JobItem::Section(s) => s.limits.iter().all(|l| l.jerk == f64::INFINITY),
        JobItem::Dwell { .. } | JobItem::Note { .. } => true,
    };
    let jerk_free = file.items.iter().all(free);
    if jerk_free {
        for axis in &mut file.header.axes {
            (axis.limits.jerk, axis.rapid.jerk) = (f64::INFINITY, f64::INFINITY);
        }
    }
    let report = prove::verify(&file.items, &file.header.axes);
    let jerk = |ratio: f64| (!jerk_free).then_some(ratio);
    let axes = file.header.axes.iter().zip(&report.axes).map(|(axis, r)| AxisRatiosJson {
        name: axis.name.clone(),
        velocity_ratio: r.velocity,
        acceleration_ratio: r.acceleration,
        jerk_ratio: jerk(r.jerk),
    });
    Ok(VerifyJson {
        file: path.display().to_string(),
        sections: file.totals.sections,
        spans: report.spans,
        motion_time_s: report.motion_time_s,
        certificate: CertificateJson {
            holds: report.holds,
            velocity_ratio: report.velocity_ratio,
            acceleration_ratio: report.acceleration_ratio,
            jerk_ratio: jerk(report.jerk_ratio),
            feed_ratio: (report.feed_ratio > 0.0).then_some(report.feed_ratio),
        },
        axes: axes.collect(),
        fault_count: report.fault_count as u64,
        faults: report
            .faults
            .iter()
            .map(|f| format!("table {}, line {}: {}", f.table, f.line, f.cause))
            .collect(),
        verify_seconds: begin.elapsed().as_secs_f64(),
    })
}

/// Says what is in a file.
///
/// # Errors
/// The file is no feed table.
pub(super) fn inspect(path: &Path) -> Result<InspectJson, Failure> {
    let file = open(path)?;
    let bytes = std::fs::metadata(path).map_err(|e| Failure::unreadable(path, &e))?.len();
    let axes = file.header.axes.iter().map(|axis| InspectAxisJson {
        name: axis.name.clone(),
        unit: match axis.unit {
            Unit::Mm => "mm",
            Unit::Deg => "deg",
            Unit::Rad => "rad",
        }
        .into(),
        counts_per_unit: axis.counts_per_unit,
        start_counts: 0,
        end_counts: 0,
        bytes: 0,
    });
    let mut told = InspectJson {
        file: path.display().to_string(),
        file_bytes: bytes,
        format_version: FILE_VERSION.into(),
        schema_hash: format!("{SCHEMA_HASH:016x}"),
        control_tick_s: f64::from(file.header.tick_ns) * 1e-9,
        sections: file.totals.sections,
        dwells: 0,
        spans: file.totals.spans,
        geometry_spans: file.totals.geometry_spans,
        cycle_time_s: file.items.iter().map(seconds).sum(),
        motion_time_s: 0.0,
        table_bytes: file.totals.table_bytes,
        shared_bytes: 0,
        axes: axes.collect(),
    };
    let mut number = 0;
    for item in &file.items {
        match item {
            JobItem::Section(section) => {
                let packed = pack(&section.table, number, &file.header.target(&section.limits))
                    .map_err(|e| Failure::internal(format!("table {number} cannot be packed again: {e}")))?;
                told.motion_time_s += section.table.duration();
                told.shared_bytes += packed.bytes().shared;
                for (axis, part) in told.axes.iter_mut().zip(&packed.axes) {
                    if number == 0 {
                        axis.start_counts = part.header.start;
                    }
                    axis.end_counts = part.header.end;
                    axis.bytes += part.controls.len() as u64;
                }
                number += 1;
            }
            JobItem::Dwell { .. } => told.dwells += 1,
            JobItem::Note { .. } => {}
        }
    }
    Ok(told)
}

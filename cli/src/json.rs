//! The JSON objects of every verb; docs/json.md explains each field.
//!
//! Field names are a contract: they are only ever added to. Numbers that are not finite appear as `null`.

use std::collections::BTreeMap;

use planner::analysis::operations::Operation;
use serde::Serialize;

use crate::failure::{Blame, Failure};

mod bus;
mod compare;
mod flash;
mod live;
mod motion;

pub use bus::{
    DecodedJson, DriveAxisJson, DrivesJson, HealthJson, MalformedJson, UpdateJson, WatchedJson, seconds,
};
pub use compare::{CompareFilesJson, CompareJson, MethodJson, MethodState};
pub use flash::{DriveLimitsJson, FlashJson};
pub use live::{AxisAtJson, DriveJson, ErrandJson, StatusJson, StopJson, StreamJson};
pub use motion::{MoveAxisJson, MoveErrorJson, MoveJson, PhaseJson, StateJson, sync_name};

/// The object of `plan` and `run`, also written as plan.json.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanJson {
    /// The job as given on the command line.
    pub job: String,
    /// `program` or `way-points`.
    pub job_kind: &'static str,
    /// The way-points and the spline through them; null for a part program.
    pub way_points: Option<WayPointsJson>,
    /// Name of the machine.
    pub machine: String,
    /// Axes in the machine's order.
    pub axes: Vec<AxisJson>,
    /// Blocks with at least one word.
    pub blocks: u64,
    /// Rapid commands.
    pub rapids: u64,
    /// Straight feed commands.
    pub lines: u64,
    /// Arc commands, helices and full circles among them.
    pub arcs: u64,
    /// Spline commands.
    pub splines: u64,
    /// Dwells.
    pub dwells: u64,
    /// Places where the motion comes to rest.
    pub stops: u64,
    /// The same by cause; causes that do not occur are absent.
    pub stops_by_cause: BTreeMap<&'static str, u64>,
    /// Length of the programmed feed moves, arcs as true arcs [mm].
    pub feed_length_mm: f64,
    /// Length of the rapid moves [mm].
    pub rapid_length_mm: f64,
    /// Box around the programmed motion.
    pub bounding_box_mm: BoxJson,
    /// Largest tolerance in force [mm].
    pub tolerance_mm: f64,
    /// Who set it: `command line`, `program` or `machine`.
    pub tolerance_source: String,
    /// Proven bound of the distance between path and program [mm].
    pub max_deviation_mm: f64,
    /// Motion and dwells [s].
    pub cycle_time_s: f64,
    /// Motion alone [s].
    pub motion_time_s: f64,
    /// Length over programmed feed, rapids at rapid speed, nothing lost to acceleration [s].
    pub constant_feed_time_s: f64,
    /// The same limits with a rest after every block [s].
    pub stop_every_block_time_s: Option<f64>,
    /// What limits the speed for how long, longest first.
    pub binding: Vec<BindingJson>,
    /// Where the programmed feed is not reached: the places that cost most, most costly first.
    pub feed_not_reached: Vec<FeedNotReachedJson>,
    /// Time per operation, in program order.
    pub operations: Vec<Operation>,
    /// Spans of q.
    pub spans: u64,
    /// Size of the feed tables, all axes [bytes].
    pub table_bytes: u64,
    /// Time to plan and certify [s].
    pub plan_seconds: f64,
    /// Largest resident memory [MiB]; null where the system does not tell.
    pub peak_memory_mib: Option<f64>,
    /// Name of the solver.
    pub solver: String,
    /// How jerk is limited: `true`, `pseudo` or `none`.
    pub jerk_form: String,
    /// How long paths are divided: `overlap`, `whole` or `zhao`.
    pub windows: String,
    /// Its iterations, all sections together.
    pub iterations: u64,
    /// What it left at most, as a share of the motion time; null when it cannot tell.
    pub gap_estimate: Option<f64>,
    /// The proof.
    pub certificate: CertificateJson,
    /// The simulated motion; only `run` has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulation: Option<SimulationJson>,
    /// Remarks and skipped codes.
    pub notes: Vec<NoteJson>,
    /// Files written, by their role.
    pub files: FilesJson,
}

/// Way-points and the spline through them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WayPointsJson {
    /// How many.
    pub count: u64,
    /// What closes the spline at its ends: `not-a-knot`, `clamped`, `natural` or `periodic`.
    pub ends: String,
    /// How its parameter is spread: `uniform`, `chord` or `centripetal`.
    pub knots: String,
    /// Of how many spans it consists: fewer than way-points lie between where the tolerance allows it.
    pub geometry_spans: u64,
}

/// One axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisJson {
    /// Name.
    pub name: String,
    /// Unit of its positions.
    pub unit: String,
}

/// Motion time ruled by one limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BindingJson {
    /// `velocity`, `acceleration`, `jerk`, `feed`, `rest` or `free`.
    pub kind: &'static str,
    /// The axis whose limit it is; null for the other kinds.
    pub axis: Option<String>,
    /// How long it rules [s].
    pub seconds: f64,
    /// Of the motion time.
    pub share: f64,
}

/// A place where the programmed feed is not reached.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FeedNotReachedJson {
    /// First line of the program.
    pub first_line: u32,
    /// Last line of the program.
    pub last_line: u32,
    /// Length of the path [mm].
    pub length_mm: f64,
    /// Programmed feed [mm/s].
    pub programmed_mm_s: f64,
    /// Lowest speed [mm/s].
    pub lowest_mm_s: f64,
    /// Mean speed [mm/s].
    pub mean_mm_s: f64,
    /// `velocity`, `acceleration`, `jerk`, `rest` or `free`.
    pub limited_by: &'static str,
    /// The axis whose limit it is; null for the other kinds.
    pub axis: Option<String>,
    /// Time lost against the programmed feed [s].
    pub lost_s: f64,
}

/// A box in the linear axes, in the machine's order.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BoxJson {
    /// Lowest position per axis [mm].
    pub min: Vec<f64>,
    /// Highest position per axis [mm].
    pub max: Vec<f64>,
}

/// The verdict of the certificate: the largest value over its limit, per kind of limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CertificateJson {
    /// Every limit is kept at every instant.
    pub holds: bool,
    /// Largest |velocity| / limit.
    pub velocity_ratio: f64,
    /// Largest |acceleration| / limit.
    pub acceleration_ratio: f64,
    /// Largest |jerk| / limit; null when jerk is not limited.
    pub jerk_ratio: Option<f64>,
    /// Largest speed / programmed feed; null when no feed is in force.
    pub feed_ratio: Option<f64>,
}

/// What the simulated drives did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SimulationJson {
    /// Set-points that the drives played, all axes together.
    pub setpoints: u64,
    /// Hash of every set-point of every axis in order, 16 hexadecimal digits.
    pub setpoint_hash: String,
    /// Largest distance between a set-point and the exact plan [drive counts].
    pub max_path_deviation_counts: f64,
    /// Largest following error of a linear axis [mm].
    pub max_following_error_mm: f64,
    /// Root mean square of the linear axes' following error [mm].
    pub rms_following_error_mm: f64,
    /// Largest distance of the load from the path of the set-points, linear axes [mm].
    pub max_contour_error_mm: f64,
    /// Root mean square of it [mm].
    pub rms_contour_error_mm: f64,
    /// What crossed the bus.
    pub bus: BusJson,
    /// Every drive stands at rest on the exact count of the program's end point.
    pub at_end: bool,
    /// Simulated time per second of computing.
    pub real_time_factor: f64,
}

/// What crossed the simulated bus.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BusJson {
    /// Frames.
    pub frames: u64,
    /// Payload in them [bytes].
    pub bytes: u64,
    /// Share of the time that the wire was busy.
    pub load: f64,
}

/// A remark.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NoteJson {
    /// Line of the program, from 1.
    pub line: u32,
    /// What there is to say.
    pub text: String,
}

/// Files written.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FilesJson {
    /// The feed table; absent when the certificate does not hold.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feed: Option<String>,
    /// This object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan: Option<String>,
    /// The report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report: Option<String>,
    /// The set-points; only `run` writes them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<String>,
}

/// The object of `verify`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VerifyJson {
    /// The file.
    pub file: String,
    /// Sections, each from rest to rest.
    pub sections: u64,
    /// Spans of q.
    pub spans: u64,
    /// Motion alone [s].
    pub motion_time_s: f64,
    /// The proof.
    pub certificate: CertificateJson,
    /// The same ratios per axis.
    pub axes: Vec<AxisRatiosJson>,
    /// Number of faults.
    pub fault_count: u64,
    /// The first of them, in words with their places; empty when everything holds.
    pub faults: Vec<String>,
    /// Time to verify [s].
    pub verify_seconds: f64,
}

/// Ratios of one axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisRatiosJson {
    /// Name.
    pub name: String,
    /// Largest |velocity| / limit.
    pub velocity_ratio: f64,
    /// Largest |acceleration| / limit.
    pub acceleration_ratio: f64,
    /// Largest |jerk| / limit; null when jerk is not limited.
    pub jerk_ratio: Option<f64>,
}

/// The object of `inspect`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InspectJson {
    /// The file.
    pub file: String,
    /// Its size [bytes].
    pub file_bytes: u64,
    /// Version of the file format.
    pub format_version: u32,
    /// Hash of the schema, 16 hexadecimal digits.
    pub schema_hash: String,
    /// Control tick the table was planned for [s].
    pub control_tick_s: f64,
    /// Sections, each from rest to rest.
    pub sections: u64,
    /// Dwells between them.
    pub dwells: u64,
    /// Spans of q.
    pub spans: u64,
    /// Spans of the geometry.
    pub geometry_spans: u64,
    /// Motion and dwells [s].
    pub cycle_time_s: f64,
    /// Motion alone [s].
    pub motion_time_s: f64,
    /// Size of the feed tables [bytes].
    pub table_bytes: u64,
    /// The part of it that all axes share [bytes].
    pub shared_bytes: u64,
    /// The axes.
    pub axes: Vec<InspectAxisJson>,
}

/// One axis of a feed table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InspectAxisJson {
    /// Name.
    pub name: String,
    /// Unit of its positions.
    pub unit: String,
    /// Drive counts per unit.
    pub counts_per_unit: f64,
    /// Where it starts [counts].
    pub start_counts: i64,
    /// Where it ends [counts].
    pub end_counts: i64,
    /// Its own part of the tables [bytes].
    pub bytes: u64,
}

/// The object of `sample`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SampleJson {
    /// The file written.
    pub file: String,
    /// Way-points in it.
    pub points: u64,
    /// Its size [bytes].
    pub file_bytes: u64,
}

/// What `--json` prints when a verb fails.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ErrorJson {
    /// The failure.
    pub error: ErrorBody,
}

/// A failure.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ErrorBody {
    /// `input` (exit status 2) or `internal` (exit status 1).
    pub kind: &'static str,
    /// What is wrong.
    pub message: String,
    /// The file, if it is about one.
    pub file: Option<String>,
    /// Line, from 1.
    pub line: Option<u32>,
    /// Column in bytes, from 1.
    pub column: Option<u32>,
    /// What to do about it.
    pub help: Option<String>,
}

impl From<&Failure> for ErrorJson {
    fn from(failure: &Failure) -> Self {
        let kind = match failure.blame {
            Blame::Input => "input",
            Blame::Internal => "internal",
        };
        ErrorJson {
            error: ErrorBody {
                kind,
                message: failure.message.clone(),
                file: failure.file.as_ref().map(|f| f.display().to_string()),
                line: failure.place.as_ref().map(|p| p.line),
                column: failure.place.as_ref().map(|p| p.column),
                help: failure.help.clone(),
            },
        }
    }
}

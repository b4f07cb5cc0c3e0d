//! What a simulated job amounts to.

use serde::Serialize;

/// The outcome of a simulation that ran to its end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SimReport {
    /// Set-points that the drives played, all axes together; waits do not count.
    pub setpoints: u64,
    /// Fingerprint of them, see [`crate::setpoint_hash::SetpointHash`].
    pub setpoint_hash: u64,
    /// Control ticks simulated, from the start of the first table to the end of settling.
    pub ticks: u64,
    /// From the start of the first table to the end of the last motion or wait [s].
    pub cycle_time_s: f64,
    /// Duration of the tables in the plan [s].
    pub motion_s: f64,
    /// Programmed waits [s].
    pub dwell_s: f64,
    /// What the cycle time has besides motion and waits: whole ticks, and waiting for the next table [s].
    pub handover_s: f64,
    /// Sending and checking the first table, before the cycle [s].
    pub preparation_s: f64,
    /// Greatest distance of a set-point from the plan evaluated in f64 [counts], at the time of the drives' common
    /// path clock.
    pub max_path_deviation_counts: f64,
    /// Most that this clock was ahead of or behind the plan's [s].
    pub max_clock_skew_s: f64,
    /// Greatest following error of any linear axis [mm].
    pub max_following_error_mm: f64,
    /// Root-mean-square following error over all linear axes and ticks [mm].
    pub rms_following_error_mm: f64,
    /// Greatest following error of any rotary axis [axis unit].
    pub max_following_error_rotary: f64,
    /// Greatest distance of the load from the path of the set-points, linear axes [mm].
    pub max_contour_error_mm: f64,
    /// Root-mean-square distance of the load from that path [mm].
    pub rms_contour_error_mm: f64,
    /// Every drive is on the count of the program's end point, at rest, and says that it is done.
    pub at_end: bool,
    /// Each axis, in the machine's order.
    pub axes: Vec<AxisReport>,
    /// What crossed the bus.
    pub bus: BusReport,
}

/// One axis of a simulated job.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisReport {
    /// Name in the machine file.
    pub name: String,
    /// Greatest following error [axis unit].
    pub max_following_error: f64,
    /// Root-mean-square following error [axis unit].
    pub rms_following_error: f64,
    /// Greatest effort [N or N m].
    pub max_effort: f64,
    /// Root-mean-square effort [N or N m].
    pub rms_effort: f64,
    /// Greatest effort as a share of the limit.
    pub effort_share: f64,
    /// Share of the ticks in which the limit cut the effort.
    pub saturated_share: f64,
    /// Greatest distance of a set-point from the plan [counts].
    pub max_path_deviation_counts: f64,
    /// Last set-point [counts].
    pub end_counts: i64,
    /// End point of the program [counts].
    pub programmed_end_counts: i64,
    /// Following error after settling [axis unit].
    pub settled_error: f64,
}

/// What crossed the bus during a job.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BusReport {
    /// Frames.
    pub frames: u64,
    /// Payload bytes in them.
    pub bytes: u64,
    /// Share of the time from power-up to the end that the wire was busy, worst-case stuffing assumed.
    pub load: f64,
    /// Busy time per time of motion.
    pub busy_per_motion: f64,
    /// Payload bytes per second of motion.
    pub bytes_per_motion_second: f64,
    /// Blocks that had to be sent again.
    pub resent_blocks: u64,
    /// Starts that were called off because a drive did not confirm in time.
    pub aborted_starts: u64,
    /// Memory that each drive needs for its two table buffers [bytes].
    pub drive_buffer_bytes: u64,
}

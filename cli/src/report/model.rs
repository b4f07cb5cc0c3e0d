//! Everything the report shows, as plain data.

use planner::analysis::operations::Operation;
use planner::analysis::shortfall::Shortfall;
use planner::topp::problem::Binding;

use crate::json::{BusJson, CertificateJson, NoteJson, WayPointsJson};

/// A report.
#[derive(Clone, Debug)]
pub struct Report {
    /// File name of the job.
    pub job: String,
    /// The way-points and the spline through them; `None` for a part program.
    pub way_points: Option<WayPointsJson>,
    /// Name of the machine.
    pub machine: String,
    /// The headline times.
    pub times: Times,
    /// Tolerance and deviation.
    pub tolerance: Tolerance,
    /// What the program holds.
    pub counts: Counts,
    /// The axes, in the machine's order.
    pub axes: Vec<Axis>,
    /// Time per operation, in program order.
    pub operations: Vec<Operation>,
    /// Stops by cause, most frequent first.
    pub stops: Vec<Stops>,
    /// The proof.
    pub certificate: Certificate,
    /// Size of the feed tables.
    pub table: TableSize,
    /// The motion over time and along the path.
    pub motion: Motion,
    /// Seconds ruled by each limit, longest first.
    pub shares: Vec<Share>,
    /// Where the programmed feed is not reached.
    pub slow: SlowPlaces,
    /// How the drives did; `None` when the table was planned but not played.
    pub simulation: Option<Simulation>,
    /// How the plan was made.
    pub planning: Planning,
    /// Remarks and skipped codes.
    pub notes: Vec<NoteJson>,
}

/// Times of the whole job.
#[derive(Clone, Copy, Debug)]
pub struct Times {
    /// Motion and dwells [s].
    pub cycle_s: f64,
    /// Motion alone [s].
    pub motion_s: f64,
    /// Length over programmed feed, nothing lost to acceleration [s].
    pub constant_feed_s: f64,
    /// The same limits with a rest after every block [s].
    pub stop_every_block_s: Option<f64>,
}

/// Tolerance in force, who set it, and what is proven.
#[derive(Clone, Debug)]
pub struct Tolerance {
    /// Largest tolerance in force [mm].
    pub tolerance_mm: f64,
    /// Who set it: `command line`, `program`, `machine`.
    pub source: String,
    /// Proven bound of the distance between path and program [mm].
    pub deviation_mm: f64,
    /// Line at which the bound occurs.
    pub line: u32,
}

/// What the program holds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Blocks with at least one word.
    pub blocks: u64,
    /// Rapid commands.
    pub rapids: u64,
    /// Straight feed commands.
    pub lines: u64,
    /// Arc commands.
    pub arcs: u64,
    /// Spline commands.
    pub splines: u64,
    /// Dwells.
    pub dwells: u64,
    /// Length of the feed moves [mm].
    pub feed_mm: f64,
    /// Length of the rapid moves [mm].
    pub rapid_mm: f64,
}

/// One axis and its limits.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Name.
    pub name: String,
    /// Unit of its positions: `mm`, `deg`, `rad`.
    pub unit: String,
    /// A slide, not a turntable.
    pub linear: bool,
    /// Limits of feed moves.
    pub feed: Bounds,
    /// Limits of rapid moves.
    pub rapid: Bounds,
    /// Lowest and highest position [unit].
    pub travel: [f64; 2],
    /// Drive counts per unit.
    pub counts_per_unit: f64,
    /// Largest motor force [N] or torque [N m].
    pub effort: f64,
}

/// Bounds of one axis, per second^n in its unit.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Largest |velocity|.
    pub velocity: f64,
    /// Largest |acceleration|.
    pub acceleration: f64,
    /// Largest |jerk|; `None` when it is not limited.
    pub jerk: Option<f64>,
}

/// Stops of one cause.
#[derive(Clone, Debug)]
pub struct Stops {
    /// Why.
    pub cause: String,
    /// How many.
    pub count: u64,
}

/// The proof, per axis.
#[derive(Clone, Debug)]
pub struct Certificate {
    /// The verdict and the worst ratios.
    pub verdict: CertificateJson,
    /// Largest ratio of velocity, acceleration and jerk to its limit, one row per axis.
    pub axes: Vec<Ratios>,
}

/// Ratios of one axis.
#[derive(Clone, Copy, Debug)]
pub struct Ratios {
    /// Largest |velocity| / limit.
    pub velocity: f64,
    /// Largest |acceleration| / limit.
    pub acceleration: f64,
    /// Largest |jerk| / limit; `None` when it is not limited.
    pub jerk: Option<f64>,
}

/// Size of the feed tables.
#[derive(Clone, Debug)]
pub struct TableSize {
    /// Sections, each from rest to rest.
    pub sections: u64,
    /// Spans of q.
    pub spans: u64,
    /// Spans of the geometry.
    pub geometry_spans: u64,
    /// The part that all axes share [bytes].
    pub shared: u64,
    /// The part of each axis [bytes].
    pub axes: Vec<u64>,
    /// Headers of all parts [bytes].
    pub headers: u64,
}

impl TableSize {
    /// Everything [bytes].
    pub fn total(&self) -> u64 {
        self.shared + self.axes.iter().sum::<u64>() + self.headers
    }
}

/// How the simulated drives did.
#[derive(Clone, Debug)]
pub struct Simulation {
    /// Control tick [s].
    pub tick_s: f64,
    /// Set-points that the drives played, all axes together.
    pub setpoints: u64,
    /// Hash of every set-point.
    pub setpoint_hash: String,
    /// Largest distance between a set-point and the exact plan [counts].
    pub path_deviation_counts: f64,
    /// Distance of the load from the path of the set-points; `None` without a linear axis.
    pub contour: Option<ContourError>,
    /// What crossed the bus.
    pub bus: BusJson,
    /// One row per axis.
    pub axes: Vec<DriveEnd>,
}

/// Distance across the path between load and set-points, linear axes.
#[derive(Clone, Copy, Debug)]
pub struct ContourError {
    /// Largest [mm].
    pub max_mm: f64,
    /// Root mean square [mm].
    pub rms_mm: f64,
}

/// One simulated drive.
#[derive(Clone, Copy, Debug)]
pub struct DriveEnd {
    /// Where the program ends [counts].
    pub target_counts: i64,
    /// Where the last set-point is [counts].
    pub reached_counts: i64,
    /// The last set-point does not move.
    pub at_rest: bool,
    /// Largest following error [axis unit].
    pub max_error: f64,
    /// Root mean square of the following error [axis unit].
    pub rms_error: f64,
    /// Largest motor effort over its limit.
    pub effort_ratio: f64,
}

impl DriveEnd {
    /// The drive stands where the program ends.
    pub fn arrived(&self) -> bool {
        self.at_rest && self.target_counts == self.reached_counts
    }
}

/// How the plan was made.
#[derive(Clone, Debug)]
pub struct Planning {
    /// Name of the solver.
    pub solver: String,
    /// Its iterations, all windows together.
    pub iterations: u64,
    /// Time to plan and certify [s].
    pub seconds: f64,
    /// Largest resident memory [MiB].
    pub peak_memory_mib: Option<f64>,
}

/// The motion, thinned out for drawing; [`super::record::Recorder`] makes it.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Over time.
    pub traces: Traces,
    /// Along the path.
    pub picture: Picture,
}

/// What rules the speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Limit {
    /// The programmed feed.
    Feed,
    /// Velocity of this axis.
    Velocity(u8),
    /// Acceleration of this axis.
    Acceleration(u8),
    /// Jerk of this axis.
    Jerk(u8),
    /// Starting from and coming to rest.
    Rest,
    /// None is reached.
    Free,
    /// The machine waits.
    Dwell,
}

impl From<Binding> for Limit {
    fn from(binding: Binding) -> Self {
        match binding {
            Binding::Velocity(axis) => Limit::Velocity(axis),
            Binding::Acceleration(axis) => Limit::Acceleration(axis),
            Binding::Jerk(axis) => Limit::Jerk(axis),
            Binding::Feed => Limit::Feed,
            Binding::Rest => Limit::Rest,
            Binding::Free => Limit::Free,
        }
    }
}

impl Limit {
    /// In words, with the axis by name.
    pub fn words(self, axes: &[Axis]) -> String {
        let axis = |i: u8| axes.get(usize::from(i)).map_or("?", |a| a.name.as_str());
        match self {
            Limit::Feed => "programmed feed".into(),
            Limit::Velocity(i) => format!("{} velocity", axis(i)),
            Limit::Acceleration(i) => format!("{} acceleration", axis(i)),
            Limit::Jerk(i) => format!("{} jerk", axis(i)),
            Limit::Rest => "start and stop".into(),
            Limit::Free => "none".into(),
            Limit::Dwell => "dwell".into(),
        }
    }
}

/// Seconds ruled by one limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// The limit.
    pub limit: Limit,
    /// How long it rules [s].
    pub seconds: f64,
}

/// Quantities over time, as the lowest and highest value in each of a bounded number of intervals.
#[derive(Clone, Debug, Default)]
pub struct Traces {
    /// Start of each interval [s].
    pub time: Vec<f64>,
    /// Path position at that time [mm].
    pub position: Vec<f64>,
    /// Line of the program at that time.
    pub line: Vec<f64>,
    /// How the machine moves at that time.
    pub mode: Vec<Mode>,
    /// What rules at that time.
    pub limit: Vec<Limit>,
    /// Path speed [mm/s].
    pub speed: Envelope,
    /// Highest speed that the feed and the axis velocities allow at that time [mm/s]; NaN when unknown.
    pub ceiling: Vec<f64>,
    /// One entry per axis.
    pub axes: Vec<AxisTraces>,
}

/// How the machine moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// It stands.
    Still,
    /// At feed.
    Feed,
    /// Rapid.
    Rapid,
}

/// Quantities of one axis over time.
#[derive(Clone, Debug, Default)]
pub struct AxisTraces {
    /// Velocity [unit/s].
    pub velocity: Envelope,
    /// Acceleration [unit/s^2].
    pub acceleration: Envelope,
    /// Jerk [unit/s^3].
    pub jerk: Envelope,
    /// Following error [unit]; empty when nothing was simulated.
    pub error: Envelope,
    /// Motor force [N] or torque [N m]; empty when nothing was simulated.
    pub effort: Envelope,
}

/// Lowest and highest value per interval.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Envelope {
    /// Lowest.
    pub lo: Vec<f64>,
    /// Highest.
    pub hi: Vec<f64>,
}

/// The path as a line to draw.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Which axes the coordinates are: two for a flat picture, three for a view in space.
    /// A single one is drawn over time.
    pub axes: Vec<usize>,
    /// Corners of the line, in time order.
    pub points: Vec<PicturePoint>,
}

/// A corner of the drawn path; speed, mode and limit are those of the stretch that ends here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PicturePoint {
    /// Position in the picture's axes.
    pub at: [f64; 3],
    /// When [s].
    pub time: f64,
    /// Path speed [mm/s].
    pub speed: f64,
    /// Line of the program.
    pub line: u32,
    /// How the machine moves.
    pub mode: Mode,
    /// What rules.
    pub limit: Limit,
    /// The programmed feed is not reached.
    pub slow: bool,
}

/// Where the programmed feed is not reached.
#[derive(Clone, Debug, Default)]
pub struct SlowPlaces {
    /// The places that cost most, most costly first.
    pub places: Vec<Shortfall>,
    /// How many there are, listed or not.
    pub count: u64,
    /// Seconds lost against the programmed feed, all places together.
    pub lost_s: f64,
}

//! The object of `compare`.

use serde::Serialize;

use super::{AxisJson, BindingJson, WayPointsJson};
use crate::args::{self, Method};

/// The object of `compare`, also written as compare.json.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompareJson {
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
    /// Length of the path of the feed moves [mm].
    pub feed_length_mm: f64,
    /// Stretches of feed from rest to rest.
    pub sections: u64,
    /// Spans of their geometry.
    pub geometry_spans: u64,
    /// Worker threads that each method had.
    pub threads: u64,
    /// What each method comes to.
    pub methods: Vec<MethodJson>,
    /// Largest resident memory [MiB]; null where the system does not tell.
    pub peak_memory_mib: Option<f64>,
    /// Files written, by their role.
    pub files: CompareFilesJson,
}

/// One method. Numbers that it does not have are null.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MethodJson {
    /// Its name, as on the command line.
    pub method: String,
    /// How far it came.
    pub state: MethodState,
    /// Name of the solver; null for the sweep.
    pub solver: Option<String>,
    /// How jerk is limited: `true`, `pseudo` or `none`.
    pub jerk_form: String,
    /// How the path is divided: `overlap`, `whole` or `zhao`; null for the sweep.
    pub windows: Option<String>,
    /// Time to find the motion, without reading, fitting and proving [s].
    pub compute_seconds: Option<f64>,
    /// Time to travel the path [s].
    pub traverse_time_s: Option<f64>,
    /// Traverse time over that of the method `whole`, less one.
    pub over_whole: Option<f64>,
    /// The method's table keeps every limit that the method was given, at every instant; null without a table.
    pub certified: Option<bool>,
    /// Largest |velocity| / limit, at every instant.
    pub velocity_ratio: Option<f64>,
    /// The same for acceleration.
    pub acceleration_ratio: Option<f64>,
    /// The same for jerk, against the machine's limit even if the method was not given it.
    pub jerk_ratio: Option<f64>,
    /// Largest speed / programmed feed; null when no feed is in force.
    pub feed_ratio: Option<f64>,
    /// Spans of q.
    pub spans: Option<u64>,
    /// Iterations of the solver.
    pub iterations: Option<u64>,
    /// What the solver left at most, as a share of the traverse time.
    pub gap_estimate: Option<f64>,
    /// The one speed of the method `constant-feed` [mm/s].
    pub constant_feed_mm_s: Option<f64>,
    /// Time lost against the programmed feed [s]; null when no feed is in force.
    pub lost_s: Option<f64>,
    /// What limits the speed for how long, longest first.
    pub binding: Vec<BindingJson>,
    /// Why it failed or was left out.
    pub remark: Option<String>,
}

impl MethodJson {
    /// The method did what it promises: it found a motion, and a certified one if it is about certified motions.
    pub fn sound(&self) -> bool {
        self.state != MethodState::Failed
            && (self.certified != Some(false) || self.method == args::name(Method::Collocation))
    }
}

/// How far a method came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MethodState {
    /// It found no motion.
    #[default]
    Failed,
    /// It was not run.
    LeftOut,
    /// It gives a time, but no table.
    Timed,
    /// There is a table.
    Planned,
}

/// Files of `compare`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CompareFilesJson {
    /// This object.
    pub compare: Option<String>,
    /// The report.
    pub report: Option<String>,
}

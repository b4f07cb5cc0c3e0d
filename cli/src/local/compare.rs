//! One job by several methods, one after the other.

mod methods;

use planner::analysis::binding::{BindingShares, rulings};
use planner::analysis::shortfall::Shortfalls;
use planner::analysis::steady::{arc_length, largest_steady_speed};
use planner::certificate::certify;
use planner::feed::job::{JobItem, PlannedSection};
use planner::geometry::section::{Section, SpeedCap};
use planner::geometry::sections::SectionItem;
use planner::job::machine::{AxisLimits, LimitSet, Machine};
use planner::job::program::MoveKind;
use planner::tolerances::CERTIFICATE_RATIO;

use super::fitting::unplannable;
use super::job::{self, Points, placed};
use super::outcome::{binding_json, report_axes, share, unit};
use super::playback::{self, record};
use crate::args::{self, CompareArgs, Jerk, Method};
use crate::engine::Compared;
use crate::failure::Failure;
use crate::json::{AxisJson, CompareFilesJson, CompareJson, MethodJson, MethodState};
use crate::memory::peak_memory_mib;
use crate::progress::Progress;
use crate::report::model::{Axis, Motion};
use crate::report::record::Recorder;
use methods::{Fault, Found};

/// The order in which methods run and are shown when none is named.
const ALL: [Method; 9] = [
    Method::Whole,
    Method::Zhao,
    Method::Overlap,
    Method::ConstantFeed,
    Method::PseudoJerk,
    Method::NoJerk,
    Method::Sweep,
    Method::Clarabel,
    Method::Collocation,
];

/// Geometry spans from which Clarabel runs only when it is named: it takes minutes then.
const LONG: usize = 5000;

/// Numbers that the traces of one method may hold: all methods together make a page of a few megabytes.
const TRACE_NUMBERS: usize = 60_000;

/// The path that all methods plan on.
struct Task {
    machine: Machine,
    stretches: Vec<Stretch>,
}

/// One stretch of feed from rest to rest.
struct Stretch {
    section: Section,
    /// The machine's limits.
    limits: Vec<AxisLimits>,
    /// Mask of the axes that its speed is about.
    counted: u16,
}

impl Task {
    fn spans(&self) -> usize {
        self.stretches.iter().map(|s| s.section.path.spans()).sum()
    }

    fn rotary_only(&self, stretch: &Stretch) -> bool {
        stretch.counted != playback::linear(&self.machine)
    }

    /// The largest speed that the job can hold all along: over the linear axes, and over the rotary ones where
    /// only they move.
    fn steady_speeds(&self) -> [f64; 2] {
        let mut speeds = [f64::INFINITY; 2];
        for s in &self.stretches {
            let speed = &mut speeds[usize::from(self.rotary_only(s))];
            let Section { path, marks, .. } = &s.section;
            *speed = speed.min(largest_steady_speed(path, &s.limits, &marks.caps, s.counted));
        }
        speeds
    }
}

impl Stretch {
    fn new(section: Section, machine: &Machine) -> Self {
        let moves = |axis: usize| section.path.axes[axis].controls.windows(2).any(|c| c[0] != c[1]);
        let linear = playback::linear(machine);
        let some_linear = (0..machine.axes.len()).any(|a| linear >> a & 1 == 1 && moves(a));
        let all = (1 << machine.axes.len()) - 1;
        let limits = machine.axes.iter().map(|a| LimitSet::default().of(a, section.kind)).collect();
        Stretch { limits, counted: if some_linear { linear } else { all & !linear }, section }
    }
}

/// Plans a job by every method asked for.
///
/// # Errors
/// Bad input, or no method finds a motion.
pub(super) fn compare(args: &CompareArgs, progress: &mut Progress) -> Result<Compared, Failure> {
    job::set_threads(&args.job);
    let machine = job::machine(&args.job)?;
    progress.stage("reading");
    let (stretches, told) = job::read(&args.job, &machine, LimitSet::default(), |stream| {
        let mut stretches = Vec::new();
        for item in stream {
            if let SectionItem::Section(section) = item?
                && section.kind == MoveKind::Feed
            {
                stretches.push(Stretch::new(section, &machine));
            }
        }
        Ok(stretches)
    })?;
    if stretches.is_empty() {
        return Err(placed("there is no feed move to compare".into(), &args.job.file, None, None)
            .with_help("Rapids are alike for every method. Name a job that cuts."));
    }
    let task = Task { machine, stretches };
    let axes = report_axes(&task.machine);
    let (mut rows, mut motions) = (Vec::new(), Vec::new());
    let mut first_fault = None;
    let methods = methods_of(args);
    for (k, &method) in methods.iter().enumerate() {
        progress.stage(methods::stage(method));
        progress.share(k as f64 / methods.len() as f64);
        let mut row = methods::row(method);
        let mut motion = None;
        if method == Method::Clarabel && args.methods.is_empty() && task.spans() > LONG {
            row.state = MethodState::LeftOut;
            row.remark = Some("takes minutes on a path this long; name it with --methods".into());
        } else {
            match methods::find(method, &task) {
                Ok(found) => motion = fill(&mut row, found, method, &task, &axes),
                Err(fault) => {
                    row.remark = Some(fault.to_string());
                    first_fault.get_or_insert(fault);
                }
            }
        }
        rows.push(row);
        motions.push(motion);
    }
    if let (true, Some(fault)) = (rows.iter().all(|row| row.traverse_time_s.is_none()), first_fault) {
        return Err(match fault {
            Fault::Plan(line, fault) => unplannable(&args.job, line, &fault),
            fault @ Fault::NoSteadySpeed => placed(fault.to_string(), &args.job.file, None, None)
                .with_help("Compare other methods, or name a job without such a turn."),
        });
    }
    relate(&mut rows);
    let machine = &task.machine;
    let length = task.stretches.iter().map(|s| arc_length(&s.section.path, s.counted));
    let json = CompareJson {
        job: args.job.file.display().to_string(),
        job_kind: told.kind(),
        way_points: told.points.as_ref().map(Points::json),
        machine: machine.name.clone(),
        axes: machine.axes.iter().map(|a| AxisJson { name: a.name.clone(), unit: unit(a).into() }).collect(),
        feed_length_mm: length.sum(),
        sections: task.stretches.len() as u64,
        geometry_spans: task.spans() as u64,
        threads: rayon::current_num_threads() as u64,
        methods: rows,
        peak_memory_mib: peak_memory_mib(),
        files: CompareFilesJson::default(),
    };
    Ok(Compared { json, axes, motions })
}

/// The methods asked for, each once.
fn methods_of(args: &CompareArgs) -> Vec<Method> {
    let mut methods: Vec<Method> = Vec::new();
    for &method in if args.methods.is_empty() { &ALL[..] } else { &args.methods } {
        if !methods.contains(&method) {
            methods.push(method);
        }
    }
    methods
}

/// Fills the row of a method with what it has found; its motion, if there is a table.
fn fill(row: &mut MethodJson, found: Found, method: Method, task: &Task, axes: &[Axis]) -> Option<Motion> {
    row.state = MethodState::Planned;
    row.compute_seconds = Some(found.compute_s);
    row.traverse_time_s = Some(found.traverse_s);
    row.constant_feed_mm_s = found.steady;
    if found.planned.is_empty() {
        row.state = MethodState::Timed;
        return None;
    }
    prove(row, &found.planned, method, task);
    row.spans = Some(found.planned.iter().map(|s| s.table.spans() as u64).sum());
    row.iterations = Some(found.iterations);
    row.gap_estimate = share(found.gap_s, found.traverse_s);
    let (mut shares, mut slow) = (BindingShares::default(), Shortfalls::new(0));
    let mut binding = Vec::with_capacity(found.planned.len());
    for (section, stretch) in found.planned.iter().zip(&task.stretches) {
        let ruled = rulings(section);
        shares.add(section, &ruled);
        binding.push(ruled);
        // What is lost is lost against the feed of the program, not against one that the method makes up.
        match found.steady {
            Some(_) => slow.add(&PlannedSection { marks: stretch.section.marks.clone(), ..section.clone() }),
            None => slow.add(section),
        }
    }
    let caps = task.stretches.iter().flat_map(|s| &s.section.marks.caps);
    row.lost_s = caps.clone().any(|c| c.speed != SpeedCap::None).then_some(slow.lost_s);
    row.binding = shares.shares().iter().map(|s| binding_json(s, &task.machine)).collect();
    let items: Vec<JobItem> = found.planned.into_iter().map(JobItem::Section).collect();
    Some(record(&items, &binding, &task.machine, Recorder::within(TRACE_NUMBERS, axes)))
}

/// The proof of a method's tables against the machine's limits and the programmed feed.
fn prove(row: &mut MethodJson, planned: &[PlannedSection], method: Method, task: &Task) {
    let mut worst = [0.0; 4];
    let mut sound = true;
    for (section, stretch) in planned.iter().zip(&task.stretches) {
        let c = certify(&section.table, &stretch.limits, &stretch.section.marks.caps);
        sound &= c.defect.is_none();
        let ratios = [c.velocity_ratio, c.acceleration_ratio, c.jerk_ratio, c.feed_ratio];
        worst = std::array::from_fn(|i| f64::max(worst[i], ratios[i]));
    }
    let [velocity, acceleration, jerk, feed] = worst;
    let promised =
        [velocity, acceleration, if methods::jerk(method) == Jerk::None { 0.0 } else { jerk }, feed];
    row.certified = Some(sound && promised.iter().all(|r| *r <= 1.0 + CERTIFICATE_RATIO));
    row.velocity_ratio = Some(velocity);
    row.acceleration_ratio = Some(acceleration);
    row.jerk_ratio = (jerk > 0.0).then_some(jerk);
    row.feed_ratio = (feed > 0.0).then_some(feed);
}

/// Relates all traverse times to that of the whole path in one piece.
fn relate(rows: &mut [MethodJson]) {
    let name = args::name(Method::Whole);
    let whole = rows.iter().find(|r| r.method == name).and_then(|r| r.traverse_time_s);
    for row in rows {
        row.over_whole = row.traverse_time_s.zip(whole).map(|(time, whole)| time / whole - 1.0);
    }
}

//! The numbers and the report of a planned or played job.

use planner::analysis::binding::{self, BindingShares};
use planner::analysis::operations::{Operation, operations};
use planner::analysis::shortfall::{Shortfall, Shortfalls};
use planner::certificate::AxisRatios;
use planner::certificate::verify::verify;
use planner::feed::file::{FeedWriter, FileHeader};
use planner::feed::job::JobItem;
use planner::feed::pack::{TableBytes, pack};
use planner::job::machine::{Axis, AxisKind, AxisLimits, Machine, Unit};
use planner::job::program::{MoveKind, StopCause};
use planner::topp::problem::Binding;

use super::fitting::Fitted;
use super::job::{Points, Told};
use super::playback::{Drives, seconds};
use crate::args::{self, Jerk, PlanArgs};
use crate::engine::Outcome;
use crate::failure::Failure;
use crate::json::{
    AxisJson, BindingJson, BoxJson, BusJson, CertificateJson, FeedNotReachedJson, FilesJson, NoteJson,
    PlanJson, SimulationJson,
};
use crate::memory::peak_memory_mib;
use crate::report::model::{self, Motion, Report};

/// Most places listed where the programmed feed is not reached: in the report, and in the JSON object.
const PLACES: [usize; 2] = [40, 20];

/// Most operations that the report lists one by one; what follows is added to the last.
const OPERATIONS: usize = 60;

/// What the planner's analysis finds in a planned job.
struct Findings {
    shares: Vec<binding::Share>,
    dwell_s: f64,
    slow: model::SlowPlaces,
    operations: Vec<Operation>,
}

/// Everything that there is to tell of a job.
///
/// # Errors
/// A table cannot be packed, which the planner should have prevented.
pub(super) fn assemble(
    args: &PlanArgs,
    fitted: &Fitted,
    motion: Motion,
    drives: Option<&Drives>,
) -> Result<Outcome, Failure> {
    let size = table_size(fitted)?;
    let findings = analyse(fitted);
    let json = plan_json(args, fitted, &size, &findings, drives);
    let report = report(args, fitted, &json, size, findings, motion, drives);
    Ok(Outcome { json, report, feed: feed_file(fitted)? })
}

fn analyse(fitted: &Fitted) -> Findings {
    let mut rulings = fitted.plan.binding.iter();
    let (mut shares, mut slow, mut dwell_s) = (BindingShares::default(), Shortfalls::new(PLACES[0]), 0.0);
    for item in &fitted.plan.items {
        match item {
            JobItem::Section(section) => {
                shares.add(section, rulings.next().map_or(&[], Vec::as_slice));
                slow.add(section);
            }
            JobItem::Dwell { seconds, .. } => {
                dwell_s += seconds;
                slow.wait(*seconds);
            }
            JobItem::Note { .. } => {}
        }
    }
    Findings {
        shares: shares.shares(),
        dwell_s,
        slow: model::SlowPlaces { count: slow.count, lost_s: slow.lost_s, places: slow.worst() },
        operations: operations(&fitted.plan.items),
    }
}

/// The `.feed` file.
fn feed_file(fitted: &Fitted) -> Result<Vec<u8>, Failure> {
    let unfit = |e| Failure::internal(format!("the feed table cannot be packed: {e}"));
    let mut writer = FeedWriter::new(Vec::new(), &FileHeader::from(&fitted.machine)).map_err(unfit)?;
    for item in &fitted.plan.items {
        writer.push(item).map_err(unfit)?;
    }
    Ok(writer.finish().map_err(unfit)?.0)
}

/// Sizes of all tables as they are sent.
fn table_size(fitted: &Fitted) -> Result<model::TableSize, Failure> {
    let header = FileHeader::from(&fitted.machine);
    let mut size = model::TableSize {
        sections: 0,
        spans: 0,
        geometry_spans: 0,
        shared: 0,
        axes: vec![0; fitted.machine.axes.len()],
        headers: 0,
    };
    for section in fitted.plan.sections() {
        let packed = pack(&section.table, size.sections as u32, &header.target(&section.limits))
            .map_err(|e| Failure::internal(format!("the feed table cannot be packed: {e}")))?;
        let TableBytes { spans, geometry_spans, shared, headers, .. } = packed.bytes();
        size.sections += 1;
        size.spans += spans;
        size.geometry_spans += geometry_spans;
        size.shared += shared;
        size.headers += headers;
        for (sum, axis) in size.axes.iter_mut().zip(&packed.axes) {
            *sum += axis.controls.len() as u64;
        }
    }
    Ok(size)
}

fn plan_json(
    args: &PlanArgs,
    fitted: &Fitted,
    size: &model::TableSize,
    findings: &Findings,
    drives: Option<&Drives>,
) -> PlanJson {
    let Fitted { machine, plan, told, .. } = fitted;
    let Told { counters, comparison, stops, tolerance, .. } = told;
    let motion_time_s = plan.sections().fold(0.0, |sum, s| sum + s.table.duration());
    let (tolerance_mm, raised) = tolerance_in_force(fitted);
    let linear: Vec<usize> =
        (0..machine.axes.len()).filter(|&i| machine.axes[i].kind == AxisKind::Linear).collect();
    let corner = |pick: fn(&planner::job::gcode::BoundingBox) -> &planner::job::machine::Point| {
        let whole = counters.bounding_box.as_ref();
        linear.iter().map(|&i| whole.map_or(0.0, |b| pick(b)[i])).collect()
    };
    PlanJson {
        job: args.job.file.display().to_string(),
        job_kind: told.kind(),
        way_points: told.points.as_ref().map(Points::json),
        machine: machine.name.clone(),
        axes: machine.axes.iter().map(|a| AxisJson { name: a.name.clone(), unit: unit(a).into() }).collect(),
        blocks: counters.blocks,
        rapids: counters.rapids,
        lines: counters.lines,
        arcs: counters.arcs,
        splines: u64::from(told.points.is_some()),
        dwells: counters.dwells,
        stops: stops.values().sum(),
        stops_by_cause: stops.iter().map(|(&cause, &count)| (stop_name(cause), count)).collect(),
        feed_length_mm: counters.feed_length_mm,
        rapid_length_mm: counters.rapid_length_mm,
        bounding_box_mm: BoxJson { min: corner(|b| &b.min), max: corner(|b| &b.max) },
        tolerance_mm,
        tolerance_source: if raised { "drive counts" } else { tolerance.words() }.into(),
        max_deviation_mm: worst_deviation(fitted).0,
        cycle_time_s: plan.items.iter().fold(0.0, |sum, item| sum + seconds(item)),
        motion_time_s,
        constant_feed_time_s: comparison.constant_feed_time_s,
        stop_every_block_time_s: Some(comparison.stop_at_every_block_time_s),
        binding: findings.shares.iter().map(|s| binding_json(s, machine)).collect(),
        feed_not_reached: findings
            .slow
            .places
            .iter()
            .take(PLACES[1])
            .map(|p| place_json(p, machine))
            .collect(),
        operations: findings.operations.clone(),
        spans: size.spans,
        table_bytes: size.total(),
        plan_seconds: fitted.seconds,
        peak_memory_mib: peak_memory_mib(),
        solver: args::name(args.solver),
        jerk_form: args::name(fitted.jerk),
        windows: args::name(args.windows),
        iterations: plan.iterations,
        gap_estimate: share(plan.gap_s, motion_time_s),
        certificate: verdict(fitted),
        simulation: drives.map(simulation_json),
        notes: notes(fitted),
        files: FilesJson::default(),
    }
}

/// A gap as a share of the time; `None` where it is not known or there is no motion.
pub(super) fn share(gap_s: f64, time_s: f64) -> Option<f64> {
    Some(gap_s / time_s).filter(|share| share.is_finite())
}

/// Kind of a limit, and its axis by name.
fn named(limit: Binding, machine: &Machine) -> (&'static str, Option<String>) {
    let (kind, axis) = binding::name(limit);
    (kind, axis.and_then(|i| machine.axes.get(usize::from(i))).map(|a| a.name.clone()))
}

pub(super) fn binding_json(share: &binding::Share, machine: &Machine) -> BindingJson {
    let (kind, axis) = named(share.limit, machine);
    BindingJson { kind, axis, seconds: share.seconds, share: share.share }
}

fn place_json(place: &Shortfall, machine: &Machine) -> FeedNotReachedJson {
    let (limited_by, axis) = named(place.limit, machine);
    FeedNotReachedJson {
        first_line: place.first_line,
        last_line: place.last_line,
        length_mm: place.length,
        programmed_mm_s: place.programmed,
        lowest_mm_s: place.lowest,
        mean_mm_s: place.mean,
        limited_by,
        axis,
        lost_s: place.lost_s,
    }
}

fn simulation_json(drives: &Drives) -> SimulationJson {
    let r = &drives.report;
    SimulationJson {
        setpoints: r.setpoints,
        setpoint_hash: format!("{:016x}", r.setpoint_hash),
        max_path_deviation_counts: r.max_path_deviation_counts,
        max_following_error_mm: r.max_following_error_mm,
        rms_following_error_mm: r.rms_following_error_mm,
        max_contour_error_mm: r.max_contour_error_mm,
        rms_contour_error_mm: r.rms_contour_error_mm,
        bus: bus_json(drives),
        at_end: r.at_end,
        real_time_factor: r.cycle_time_s / drives.seconds.max(1e-9),
    }
}

fn bus_json(drives: &Drives) -> BusJson {
    let bus = &drives.report.bus;
    BusJson { frames: bus.frames, bytes: bus.bytes, load: bus.load }
}

/// The largest proven deviation of a feed section [mm], and its line; figures left out count by their size.
fn worst_deviation(fitted: &Fitted) -> (f64, u32) {
    let feed = fitted.plan.sections().filter(|s| s.kind == MoveKind::Feed);
    feed.map(|s| (s.marks.deviation.bound_mm, s.marks.deviation.line))
        .fold((fitted.told.left_out_mm, 0), |worst, d| if d.0 > worst.0 { d } else { worst })
}

/// The worst of all sections' certificates.
///
/// It holds when a reader of the `.feed` file, who has nothing else, would find no fault either.
fn verdict(fitted: &Fitted) -> CertificateJson {
    let all = &fitted.plan.certificates;
    let mut axes = FileHeader::from(&fitted.machine).axes;
    if fitted.jerk == Jerk::None {
        for axis in &mut axes {
            (axis.limits.jerk, axis.rapid.jerk) = (f64::INFINITY, f64::INFINITY);
        }
    }
    let worst =
        |pick: fn(&planner::certificate::Certificate) -> f64| all.iter().map(pick).fold(0.0, f64::max);
    let feed_ratio = worst(|c| c.feed_ratio);
    CertificateJson {
        holds: all.iter().all(|c| c.holds) && verify(&fitted.plan.items, &axes).holds,
        velocity_ratio: worst(|c| c.velocity_ratio),
        acceleration_ratio: worst(|c| c.acceleration_ratio),
        jerk_ratio: (fitted.jerk != Jerk::None).then(|| worst(|c| c.jerk_ratio)),
        feed_ratio: (feed_ratio > 0.0).then_some(feed_ratio),
    }
}

/// The largest tolerance in force [mm]; and whether it is not the one asked for, but the least that drive counts allow.
fn tolerance_in_force(fitted: &Fitted) -> (f64, bool) {
    let feed = fitted.plan.sections().filter(|s| s.kind == MoveKind::Feed);
    let used = feed.map(|s| s.marks.deviation.tolerance_mm).fold(0.0, f64::max);
    let asked = fitted.told.tolerance.mm;
    if used > asked * (1.0 + 1e-9) { (used, true) } else { (asked, false) }
}

fn notes(fitted: &Fitted) -> Vec<NoteJson> {
    let note = |item: &JobItem| match item {
        JobItem::Note { text, line } => Some(NoteJson { line: *line, text: text.clone() }),
        JobItem::Section(_) | JobItem::Dwell { .. } => None,
    };
    let mut notes: Vec<NoteJson> = fitted.plan.items.iter().filter_map(note).collect();
    if fitted.told.left_out_mm > 0.0 {
        let text = format!(
            "moves of up to {:.4} mm are left out: the tolerance allows to stand still",
            fitted.told.left_out_mm
        );
        notes.push(NoteJson { line: 1, text });
    }
    notes.sort_by_key(|note| note.line);
    notes
}

fn report(
    args: &PlanArgs,
    fitted: &Fitted,
    json: &PlanJson,
    size: model::TableSize,
    findings: Findings,
    motion: Motion,
    drives: Option<&Drives>,
) -> Report {
    let name = args.job.file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let jerk = fitted.jerk != Jerk::None;
    let ratios = fitted.plan.certificates.iter().fold(
        vec![AxisRatios::default(); fitted.machine.axes.len()],
        |mut all, c| {
            for (whole, part) in all.iter_mut().zip(&c.axes) {
                *whole = whole.max(*part);
            }
            all
        },
    );
    let mut stops: Vec<model::Stops> = fitted
        .told
        .stops
        .iter()
        .map(|(&cause, &count)| model::Stops { cause: stop_words(cause).into(), count })
        .collect();
    stops.sort_by_key(|s| std::cmp::Reverse(s.count));
    Report {
        job: name,
        way_points: json.way_points.clone(),
        machine: json.machine.clone(),
        times: model::Times {
            cycle_s: json.cycle_time_s,
            motion_s: json.motion_time_s,
            constant_feed_s: json.constant_feed_time_s,
            stop_every_block_s: json.stop_every_block_time_s,
        },
        tolerance: model::Tolerance {
            tolerance_mm: json.tolerance_mm,
            source: json.tolerance_source.clone(),
            deviation_mm: json.max_deviation_mm,
            line: worst_deviation(fitted).1,
        },
        counts: model::Counts {
            blocks: json.blocks,
            rapids: json.rapids,
            lines: json.lines,
            arcs: json.arcs,
            splines: json.splines,
            dwells: json.dwells,
            feed_mm: json.feed_length_mm,
            rapid_mm: json.rapid_length_mm,
        },
        axes: report_axes(&fitted.machine),
        operations: shown(findings.operations),
        stops,
        certificate: model::Certificate {
            verdict: json.certificate,
            axes: ratios
                .iter()
                .map(|r| model::Ratios {
                    velocity: r.velocity,
                    acceleration: r.acceleration,
                    jerk: jerk.then_some(r.jerk),
                })
                .collect(),
        },
        table: size,
        motion,
        shares: with_dwells(&findings.shares, findings.dwell_s),
        slow: findings.slow,
        simulation: drives.map(|d| simulation(fitted, d)),
        planning: model::Planning {
            solver: json.solver.clone(),
            iterations: json.iterations,
            gap: json.gap_estimate,
            jerk_form: json.jerk_form.clone(),
            windows: json.windows.clone(),
            seconds: json.plan_seconds,
            peak_memory_mib: json.peak_memory_mib,
        },
        notes: json.notes.clone(),
    }
}

fn simulation(fitted: &Fitted, drives: &Drives) -> model::Simulation {
    let r = &drives.report;
    model::Simulation {
        tick_s: fitted.machine.control_tick_s,
        setpoints: r.setpoints,
        setpoint_hash: format!("{:016x}", r.setpoint_hash),
        path_deviation_counts: r.max_path_deviation_counts,
        contour: fitted.machine.axes.iter().any(|a| a.kind == AxisKind::Linear).then_some(
            model::ContourError { max_mm: r.max_contour_error_mm, rms_mm: r.rms_contour_error_mm },
        ),
        bus: bus_json(drives),
        axes: r
            .axes
            .iter()
            .map(|a| model::DriveEnd {
                target_counts: a.programmed_end_counts,
                reached_counts: a.end_counts,
                at_rest: r.at_end,
                max_error: a.max_following_error,
                rms_error: a.rms_following_error,
                effort_ratio: a.effort_share,
            })
            .collect(),
    }
}

/// The limits' shares of the motion, and of the cycle what the waits take.
fn with_dwells(shares: &[binding::Share], dwell_s: f64) -> Vec<model::Share> {
    let mut all: Vec<model::Share> =
        shares.iter().map(|s| model::Share { limit: s.limit.into(), seconds: s.seconds }).collect();
    if dwell_s > 0.0 {
        all.push(model::Share { limit: model::Limit::Dwell, seconds: dwell_s });
    }
    all.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
    all
}

fn shown(mut all: Vec<Operation>) -> Vec<Operation> {
    let rest = all.split_off(all.len().min(OPERATIONS));
    if let Some(last) = all.last_mut() {
        for more in rest {
            last.name = "everything after".into();
            last.feed_s += more.feed_s;
            last.rapid_s += more.rapid_s;
            last.dwell_s += more.dwell_s;
            last.feed_length_mm += more.feed_length_mm;
            last.rapid_length_mm += more.rapid_length_mm;
        }
    }
    all
}

/// The machine's axes as the report shows them.
pub(super) fn report_axes(machine: &Machine) -> Vec<model::Axis> {
    let bounds = |l: &AxisLimits| model::Bounds {
        velocity: l.velocity,
        acceleration: l.acceleration,
        jerk: l.jerk.is_finite().then_some(l.jerk),
    };
    let axes = machine.axes.iter();
    axes.map(|axis| model::Axis {
        name: axis.name.clone(),
        unit: unit(axis).into(),
        linear: axis.kind == AxisKind::Linear,
        feed: bounds(&axis.limits),
        rapid: bounds(&axis.rapid),
        travel: axis.travel,
        counts_per_unit: axis.counts_per_unit,
        effort: axis.plant.effort_limit,
    })
    .collect()
}

pub(super) fn unit(axis: &Axis) -> &'static str {
    match axis.unit {
        Unit::Mm => "mm",
        Unit::Deg => "deg",
        Unit::Rad => "rad",
    }
}

/// The name of a cause in the JSON object.
fn stop_name(cause: StopCause) -> &'static str {
    match cause {
        StopCause::ProgramStop => "program_stop",
        StopCause::ProgramEnd => "program_end",
        StopCause::Spindle => "spindle",
        StopCause::ToolChange => "tool_change",
        StopCause::OffsetChange => "offset_change",
        StopCause::Dwell => "dwell",
        StopCause::ExactStop => "exact_stop",
        StopCause::ExactPathCorner => "exact_path_corner",
        StopCause::Reversal => "reversal",
        StopCause::Rapid => "rapid",
    }
}

fn stop_words(cause: StopCause) -> &'static str {
    match cause {
        StopCause::ProgramStop => "program stop (M0, M1, M60)",
        StopCause::ProgramEnd => "program end",
        StopCause::Spindle => "spindle command",
        StopCause::ToolChange => "tool change",
        StopCause::OffsetChange => "change of offsets",
        StopCause::Dwell => "dwell",
        StopCause::ExactStop => "exact stop (G61.1, G9)",
        StopCause::ExactPathCorner => "corner on an exact path (G61)",
        StopCause::Reversal => "reversal of direction",
        StopCause::Rapid => "start or end of a rapid",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documentation_names_every_cause_of_a_stop() {
        let text = include_str!("../../../docs/json.md");
        for cause in [
            StopCause::ProgramStop,
            StopCause::ProgramEnd,
            StopCause::Spindle,
            StopCause::ToolChange,
            StopCause::OffsetChange,
            StopCause::Dwell,
            StopCause::ExactStop,
            StopCause::ExactPathCorner,
            StopCause::Reversal,
            StopCause::Rapid,
        ] {
            assert!(text.contains(&format!("`{}`", stop_name(cause))), "{cause:?}");
        }
    }

    #[test]
    fn long_lists_of_operations_end_in_a_sum() {
        let operation = |k: u32| Operation { name: format!("{k}"), feed_s: 1.0, ..Operation::default() };
        let all: Vec<Operation> = (0..100).map(operation).collect();
        let short = shown(all.clone());
        assert_eq!(short.len(), OPERATIONS);
        assert_eq!(short[OPERATIONS - 1].feed_s, 100.0 - (OPERATIONS - 1) as f64);
        assert_eq!(shown(all[..10].to_vec()), all[..10]);
    }

    #[test]
    fn waits_take_their_place_among_the_limits() {
        let share = |limit, seconds| binding::Share { limit, seconds, share: 0.5 };
        let shares = [share(Binding::Feed, 3.0), share(Binding::Jerk(1), 1.0)];
        let all = with_dwells(&shares, 2.0);
        let limits: Vec<model::Limit> = all.iter().map(|s| s.limit).collect();
        assert_eq!(limits, [model::Limit::Feed, model::Limit::Dwell, model::Limit::Jerk(1)]);
        assert_eq!(with_dwells(&shares, 0.0).len(), 2);
    }
}

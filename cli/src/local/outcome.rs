//! The numbers and the report of a planned or played job.

use planner::analysis::operations::{Operation, operations};
use planner::certificate::AxisRatios;
use planner::feed::file::{FeedWriter, FileHeader};
use planner::feed::job::JobItem;
use planner::feed::pack::{TableBytes, pack};
use planner::job::machine::{Axis, AxisKind, AxisLimits, Machine, Unit};
use planner::job::program::{MoveKind, StopCause};

use super::fitting::Fitted;
use super::playback::{Drives, seconds};
use crate::args::{Limits, PlanArgs, Solver};
use crate::engine::Outcome;
use crate::failure::Failure;
use crate::json::{AxisJson, BoxJson, CertificateJson, FilesJson, NoteJson, PlanJson, SimulationJson};
use crate::memory::peak_memory_mib;
use crate::report::model::{self, Motion, Report};

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
    let json = plan_json(args, fitted, &size, drives);
    let report = report(args, fitted, &json, size, motion, drives);
    Ok(Outcome { json, report, feed: feed_file(fitted)? })
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
        let packed =
            pack(&section.table, size.sections as u32, header.tick_ns, &header.scales(&section.limits))
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

fn plan_json(args: &PlanArgs, fitted: &Fitted, size: &model::TableSize, drives: Option<&Drives>) -> PlanJson {
    let Fitted { machine, plan, counters, comparison, stops, tolerance, .. } = fitted;
    let motion_time_s = plan.sections().map(|s| s.table.duration()).sum();
    let linear: Vec<usize> =
        (0..machine.axes.len()).filter(|&i| machine.axes[i].kind == AxisKind::Linear).collect();
    let corner = |pick: fn(&planner::job::gcode::BoundingBox) -> &planner::job::machine::Point| {
        let whole = counters.bounding_box.as_ref();
        linear.iter().map(|&i| whole.map_or(0.0, |b| pick(b)[i])).collect()
    };
    PlanJson {
        job: args.job.display().to_string(),
        machine: machine.name.clone(),
        axes: machine.axes.iter().map(|a| AxisJson { name: a.name.clone(), unit: unit(a).into() }).collect(),
        blocks: counters.blocks,
        rapids: counters.rapids,
        lines: counters.lines,
        arcs: counters.arcs,
        splines: 0,
        dwells: counters.dwells,
        stops: stops.values().sum(),
        feed_length_mm: counters.feed_length_mm,
        rapid_length_mm: counters.rapid_length_mm,
        bounding_box_mm: BoxJson { min: corner(|b| &b.min), max: corner(|b| &b.max) },
        tolerance_mm: tolerance.mm,
        tolerance_source: tolerance.words().into(),
        max_deviation_mm: worst_deviation(fitted).0,
        cycle_time_s: plan.items.iter().map(seconds).sum(),
        motion_time_s,
        constant_feed_time_s: comparison.constant_feed_time_s,
        stop_every_block_time_s: Some(comparison.stop_at_every_block_time_s),
        spans: size.spans,
        table_bytes: size.total(),
        plan_seconds: fitted.seconds,
        peak_memory_mib: peak_memory_mib(),
        solver: solver(args.solver).into(),
        certificate: verdict(args, fitted),
        simulation: drives.map(simulation_json),
        notes: notes(fitted),
        files: FilesJson::default(),
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
        at_end: r.at_end,
        real_time_factor: r.cycle_time_s / drives.seconds.max(1e-9),
    }
}

/// The largest proven deviation of a feed section [mm], and its line.
fn worst_deviation(fitted: &Fitted) -> (f64, u32) {
    let feed = fitted.plan.sections().filter(|s| s.kind == MoveKind::Feed);
    feed.map(|s| (s.marks.deviation.bound_mm, s.marks.deviation.line))
        .fold((0.0, 0), |worst, d| if d.0 > worst.0 { d } else { worst })
}

/// The worst of all sections' certificates.
fn verdict(args: &PlanArgs, fitted: &Fitted) -> CertificateJson {
    let all = &fitted.plan.certificates;
    let worst =
        |pick: fn(&planner::certificate::Certificate) -> f64| all.iter().map(pick).fold(0.0, f64::max);
    let feed_ratio = worst(|c| c.feed_ratio);
    CertificateJson {
        holds: all.iter().all(|c| c.holds),
        velocity_ratio: worst(|c| c.velocity_ratio),
        acceleration_ratio: worst(|c| c.acceleration_ratio),
        jerk_ratio: (args.limits == Limits::Vaj).then(|| worst(|c| c.jerk_ratio)),
        feed_ratio: (feed_ratio > 0.0).then_some(feed_ratio),
    }
}

fn notes(fitted: &Fitted) -> Vec<NoteJson> {
    let note = |item: &JobItem| match item {
        JobItem::Note { text, line } => Some(NoteJson { line: *line, text: text.clone() }),
        JobItem::Section(_) | JobItem::Dwell { .. } => None,
    };
    fitted.plan.items.iter().filter_map(note).collect()
}

fn report(
    args: &PlanArgs,
    fitted: &Fitted,
    json: &PlanJson,
    size: model::TableSize,
    motion: Motion,
    drives: Option<&Drives>,
) -> Report {
    let name = args.job.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let jerk = args.limits == Limits::Vaj;
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
        .stops
        .iter()
        .map(|(&cause, &count)| model::Stops { cause: stop_words(cause).into(), count })
        .collect();
    stops.sort_by_key(|s| std::cmp::Reverse(s.count));
    Report {
        job: name,
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
        operations: shown(operations(&fitted.plan.items)),
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
        simulation: drives.map(|d| simulation(fitted, d)),
        planning: model::Planning {
            solver: json.solver.clone(),
            iterations: fitted.plan.iterations,
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

/// Most operations listed one by one; what follows is added to the last.
const OPERATIONS: usize = 60;

fn shown(mut all: Vec<Operation>) -> Vec<model::Operation> {
    let rest = all.split_off(all.len().min(OPERATIONS));
    if let Some(last) = all.last_mut() {
        for more in rest {
            last.name = "everything after".into();
            last.cutting_s += more.cutting_s;
            last.rapid_s += more.rapid_s;
            last.dwell_s += more.dwell_s;
            last.cutting_length += more.cutting_length;
            last.rapid_length += more.rapid_length;
        }
    }
    let row = |o: Operation| model::Operation {
        name: if o.name.is_empty() { "program".into() } else { o.name },
        line: o.line,
        feed_s: o.cutting_s,
        rapid_s: o.rapid_s,
        dwell_s: o.dwell_s,
        feed_mm: o.cutting_length,
    };
    all.into_iter().map(row).collect()
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

fn solver(solver: Solver) -> &'static str {
    match solver {
        Solver::InteriorPoint => "interior-point",
        Solver::Clarabel => "clarabel",
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

//! A planned job, played to its end on simulated drives.

mod settings;

pub use settings::{Loss, Progress, SimError, SimSettings};

use std::io;

use firmware_core::axis::{AxisConfig, Excess};
use firmware_core::drive::DriveConfig;
use firmware_core::session::Watch;
use planner::feed::file::FileHeader;
use planner::feed::job::{JobItem, PlannedSection};
use planner::feed::pack::{Target, limits_in_counts, pack};
use planner::feed::table::FeedTable;
use planner::geometry::grid_path::GridAxis;
use planner::job::machine::{Axis, AxisLimits, Machine};
use protocol::bus::Node;
use protocol::table::rules::MAX_FRACTION_BITS;

use crate::axis_loop::CountSetpoint;
use crate::bus::{Bus, InProcessBus, Lossy, Traffic};
use crate::drive_node::{Buffers, DriveNode, Player};
use crate::host_node::{HostCounters, HostNode, HostTiming, Order, Run};
use crate::recording::Recording;
use crate::report::{BusReport, SimReport};
use crate::trace::TraceSink;

/// How many ticks pass between two calls of the progress function.
const PROGRESS_TICKS: u64 = 4096;

/// A job's tables in order, with the drives that can play them and the size of their buffers.
#[derive(Clone, Debug)]
pub struct Cast {
    /// The tables.
    pub orders: Vec<Order>,
    /// One per axis, at the addresses from 1.
    pub drives: Vec<DriveConfig>,
    /// Bytes of each of a drive's two buffers.
    pub buffer_bytes: usize,
    /// How a host deals with time.
    pub timing: HostTiming,
}

impl Cast {
    /// What it takes to play `job` on a machine.
    ///
    /// # Errors
    /// When the job does not fit the machine.
    pub fn new(job: &[JobItem], machine: &Machine, settings: &SimSettings) -> Result<Self, SimError> {
        let plan = Programme::new(job, machine, settings)?;
        let drives = (0..machine.axes.len()).map(|axis| plan.drive(axis, settings));
        Ok(Self {
            drives: drives.collect::<Result<_, _>>()?,
            buffer_bytes: plan.buffer_bytes,
            timing: settings.host_timing(plan.tick_s, machine.axes.len()),
            orders: plan.orders,
        })
    }
}

/// A drive of a machine, at rest at `position` [counts]; with `free_jerk` it takes tables that do not limit jerk.
///
/// # Errors
/// The machine has more axes than a bus has drives.
pub fn drive_config(
    header: &FileHeader,
    axis: usize,
    position: i64,
    free_jerk: bool,
    settings: &SimSettings,
) -> Result<DriveConfig, SimError> {
    let axes = header.axes.len();
    let a = header.axes.get(axis).ok_or(SimError::AxisCount { axes })?;
    let jerk = if free_jerk { f64::INFINITY } else { a.limits.jerk.max(a.rapid.jerk) };
    let limits = AxisLimits {
        velocity: a.limits.velocity.max(a.rapid.velocity),
        acceleration: a.limits.acceleration.max(a.rapid.acceleration),
        jerk,
    };
    let address = u8::try_from(axis + 1).ok().and_then(Node::new).ok_or(SimError::AxisCount { axes })?;
    let (tick_ns, rule) = (header.tick_ns, header.override_rule);
    let status_ticks = settings.status_ticks(f64::from(tick_ns) * 1e-9);
    Ok(DriveConfig {
        node: address,
        frames: settings.bus.format,
        key: None,
        watch: Watch { boot: axis as u32 + 1, ..Watch::new(tick_ns, status_ticks) },
        // The planner keeps programs within the travel; paths may leave it by their tolerance.
        axis: AxisConfig {
            position,
            excess: Excess { acceleration: rule.acceleration as f32, jerk: rule.jerk as f32 },
            status_ticks,
            ..AxisConfig::new(axis as u8, tick_ns, limits_in_counts(&limits, a.counts_per_unit))
        },
    })
}

/// Plays `job` on a bus of its own, with the losses of `settings`.
///
/// # Errors
/// When the job does not fit the machine or a drive refuses it, see [`SimError`].
pub fn simulate(
    job: &[JobItem],
    machine: &Machine,
    settings: &SimSettings,
    sink: &mut dyn TraceSink,
    progress: &mut dyn FnMut(Progress),
) -> Result<SimReport, SimError> {
    let bus = InProcessBus::new(settings.bus);
    match settings.loss {
        Some(Loss { share, seed }) => {
            simulate_on(&mut Lossy::new(bus, share, seed), job, machine, settings, sink, progress)
        }
        None => simulate_on(&mut { bus }, job, machine, settings, sink, progress),
    }
}

/// Plays `job` on `bus`, which carries the frames of `settings`; its losses are not added.
///
/// Every tick the host has its turn, then every drive takes its frames and gives a set-point, then servos and
/// plants follow. The trace and all statistics begin with the first table, not with the sending of it.
///
/// # Errors
/// When the job does not fit the machine or a drive refuses it, see [`SimError`].
pub fn simulate_on(
    bus: &mut dyn Bus,
    job: &[JobItem],
    machine: &Machine,
    settings: &SimSettings,
    sink: &mut dyn TraceSink,
    progress: &mut dyn FnMut(Progress),
) -> Result<SimReport, SimError> {
    let plan = Programme::new(job, machine, settings)?;
    let axes = machine.axes.len();
    let mut buffers: Vec<Buffers> = vec![[vec![0; plan.buffer_bytes], vec![0; plan.buffer_bytes]]; axes];
    let mut drives: Vec<Box<dyn Player + '_>> = Vec::new();
    for (axis, buffers) in buffers.iter_mut().enumerate() {
        drives.push(Box::new(DriveNode::new(plan.drive(axis, settings)?, buffers, bus)));
    }
    play(bus, &plan, &mut drives, settings, sink, progress)
}

/// Attaches a drive of a configuration to a bus, wherever it is played.
pub type Casting<'a> = dyn FnMut(&DriveConfig, &mut dyn Bus) -> io::Result<Box<dyn Player>> + 'a;

/// As [`simulate_on`], on drives that somebody else plays: one per axis, which `cast` attaches to the bus.
///
/// # Errors
/// As for [`simulate_on`], or a drive cannot be had, or is gone.
pub fn simulate_with(
    bus: &mut dyn Bus,
    job: &[JobItem],
    machine: &Machine,
    settings: &SimSettings,
    cast: &mut Casting<'_>,
    sink: &mut dyn TraceSink,
) -> Result<SimReport, SimError> {
    let plan = Programme::new(job, machine, settings)?;
    let mut drives: Vec<Box<dyn Player>> = Vec::new();
    for (axis, named) in machine.axes.iter().enumerate() {
        let config = plan.drive(axis, settings)?;
        let gone = |source| SimError::Gone { axis: named.name.clone(), source };
        drives.push(cast(&config, bus).map_err(gone)?);
    }
    play(bus, &plan, &mut drives, settings, sink, &mut |_| {})
}

/// A job on drives that are on the bus.
fn play(
    bus: &mut dyn Bus,
    plan: &Programme<'_>,
    drives: &mut [Box<dyn Player + '_>],
    settings: &SimSettings,
    sink: &mut dyn TraceSink,
    progress: &mut dyn FnMut(Progress),
) -> Result<SimReport, SimError> {
    let (machine, axes) = (plan.machine, drives.len());
    let timing = settings.host_timing(plan.tick_s, axes);
    let mut host = HostNode::new(axes as u8, settings.bus.format, timing, bus);
    host.set_tick_ns(plan.tick_ns);
    plan.orders.iter().cloned().for_each(|order| host.push(order));
    host.close();
    let recording = Recording::new(machine, plan.tick_s, &plan.origin);
    let mut recording =
        recording.map_err(|(i, source)| SimError::Axis { axis: machine.axes[i].name.clone(), source })?;

    sink.begin(&recording.header(plan.expected_ticks(settings)))?;
    let mut next = vec![CountSetpoint::default(); axes];
    let mut standing = vec![true; axes];
    let (mut first, mut end) = (None, None);
    let mut moved = 0;
    let mut tick = 0u64;
    loop {
        let now = tick * u64::from(plan.tick_ns);
        bus.advance(now);
        host.tick(bus, tick, now)?;
        for (axis, drive) in drives.iter_mut().enumerate() {
            let gone = |source| SimError::Gone { axis: machine.axes[axis].name.clone(), source };
            (next[axis], standing[axis]) = drive.play(bus, now).map_err(gone)?;
        }
        if plan.orders.is_empty() {
            first.get_or_insert(tick);
        }
        let run = host.run_at(tick);
        check_step(&standing, run, tick, machine)?;
        if let Some(run) = run {
            if run.start == tick {
                first.get_or_insert(tick);
                recording.begin_table(plan.tables[run.order]);
            }
            moved += 1;
        }
        if first.is_some() {
            recording.tick(&next, run.map(|r| tick - r.start), sink)?;
        }
        if tick.is_multiple_of(PROGRESS_TICKS) {
            progress(Progress { done_s: moved as f64 * plan.tick_s, total_s: plan.motion_s });
        }
        if host.is_finished(tick) {
            let end = *end.get_or_insert(tick + plan.final_pause);
            if tick >= end + settings.settle_ticks(plan.tick_s) {
                break;
            }
        }
        tick += 1;
    }
    progress(Progress { done_s: plan.motion_s, total_s: plan.motion_s });
    sink.end()?;

    let at_end =
        next.iter().zip(&standing).zip(&plan.end).all(|((s, still), end)| {
            s.position == *end && *still && s.velocity == 0.0 && s.acceleration == 0.0
        });
    let span = first.zip(end).map_or([0; 2], |(first, end)| [first, end - first]);
    Ok(plan.report(&recording, span, at_end, bus.traffic(), host.counters(), tick))
}

/// The drives move exactly when the host thinks so, all of them.
fn check_step(standing: &[bool], run: Option<Run>, tick: u64, machine: &Machine) -> Result<(), SimError> {
    let stands = run.is_none_or(|r| tick == r.start + r.ticks);
    match standing.iter().position(|&s| s != stands) {
        Some(axis) => Err(SimError::OutOfStep { axis: machine.axes[axis].name.clone(), tick }),
        None => Ok(()),
    }
}

/// A job made ready for drives and host.
struct Programme<'a> {
    machine: &'a Machine,
    tick_ns: u32,
    tick_s: f64,
    tables: Vec<&'a FeedTable>,
    orders: Vec<Order>,
    /// Jerk is not limited in some table.
    free_jerk: bool,
    /// Where the axes stand before the first table [counts].
    origin: Vec<i64>,
    /// Where the program ends [counts].
    end: Vec<i64>,
    final_pause: u64,
    motion_s: f64,
    dwell_s: f64,
    /// Dwell time that is not simulated tick by tick [s].
    skipped_s: f64,
    buffer_bytes: usize,
}

impl<'a> Programme<'a> {
    fn new(job: &'a [JobItem], machine: &'a Machine, settings: &SimSettings) -> Result<Self, SimError> {
        let tick_ns = settings::tick_ns(machine.control_tick_s)?;
        let axes = machine.axes.len();
        if axes == 0 || axes > settings::MAX_DRIVES {
            return Err(SimError::AxisCount { axes });
        }
        let mut programme = Self {
            machine,
            tick_ns,
            tick_s: f64::from(tick_ns) * 1e-9,
            tables: Vec::new(),
            orders: Vec::new(),
            free_jerk: false,
            origin: vec![0; axes],
            end: vec![0; axes],
            final_pause: 0,
            motion_s: 0.0,
            dwell_s: 0.0,
            skipped_s: 0.0,
            buffer_bytes: 0,
        };
        for item in job {
            match item {
                JobItem::Section(section) => programme.add_section(section)?,
                JobItem::Dwell { seconds, .. } => programme.add_dwell(*seconds, settings.longest_dwell_s),
                JobItem::Note { .. } => {}
            }
        }
        Ok(programme)
    }

    fn add_section(&mut self, section: &'a PlannedSection) -> Result<(), SimError> {
        let number = self.orders.len() as u32;
        let refuse = |source| SimError::Pack { table: number, source };
        let target = Target::of(self.machine, self.tick_ns, &section.limits);
        let packed = pack(&section.table, number, &target).map_err(refuse)?;
        self.free_jerk |= section.limits.iter().any(|l| l.jerk == f64::INFINITY);
        self.end = programmed_end(&section.table, self.machine);
        if self.orders.is_empty() {
            self.origin = packed.axes.iter().map(|axis| axis.header.start).collect();
        }
        let longest = packed.axes.iter().map(|axis| axis.controls.len()).max().unwrap_or(0);
        self.buffer_bytes = self.buffer_bytes.max(buffer_for(packed.shared.len() + longest));
        self.motion_s += section.table.duration();
        self.tables.push(&section.table);
        self.orders.push(Order { packed, pause: core::mem::take(&mut self.final_pause) });
        Ok(())
    }

    fn add_dwell(&mut self, seconds: f64, longest_s: f64) {
        let seconds = if seconds.is_finite() { seconds.max(0.0) } else { 0.0 };
        let simulated = seconds.min(longest_s);
        self.final_pause += (simulated / self.tick_s).ceil() as u64;
        self.dwell_s += seconds;
        self.skipped_s += seconds - simulated;
    }

    fn drive(&self, axis: usize, settings: &SimSettings) -> Result<DriveConfig, SimError> {
        let header = FileHeader::from(self.machine);
        drive_config(&header, axis, self.origin[axis], self.free_jerk, settings)
    }

    fn expected_ticks(&self, settings: &SimSettings) -> u64 {
        let pauses: u64 = self.orders.iter().map(|o| o.pause + 3).sum();
        (self.motion_s / self.tick_s).ceil() as u64
            + pauses
            + self.final_pause
            + settings.settle_ticks(self.tick_s)
    }

    fn report(
        &self,
        recording: &Recording<'_>,
        [preparation, cycle]: [u64; 2],
        at_end: bool,
        traffic: Traffic,
        host: HostCounters,
        last_tick: u64,
    ) -> SimReport {
        let [linear, rotary] = recording.following();
        let axes = recording.axes(&self.end);
        let seconds = |ticks: u64| ticks as f64 * self.tick_s;
        let cycle_time_s = seconds(cycle) + self.skipped_s;
        let busy_s = traffic.busy as f64 * 1e-9;
        let per_motion = |x: f64| if self.motion_s > 0.0 { x / self.motion_s } else { 0.0 };
        SimReport {
            setpoints: recording.hash().count(),
            setpoint_hash: recording.hash().value(),
            ticks: recording.ticks(),
            cycle_time_s,
            motion_s: self.motion_s,
            dwell_s: self.dwell_s,
            handover_s: (cycle_time_s - self.motion_s - self.dwell_s).max(0.0),
            preparation_s: seconds(preparation),
            max_clock_skew_s: recording.skew_s(),
            max_path_deviation_counts: axes.iter().map(|a| a.max_path_deviation_counts).fold(0.0, f64::max),
            max_following_error_mm: linear.max(),
            rms_following_error_mm: linear.rms(),
            max_following_error_rotary: rotary.max(),
            max_contour_error_mm: recording.contour_error().max(),
            rms_contour_error_mm: recording.contour_error().rms(),
            at_end,
            axes,
            bus: BusReport {
                frames: traffic.frames,
                bytes: traffic.bytes,
                load: busy_s / seconds(last_tick + 1),
                busy_per_motion: per_motion(busy_s),
                bytes_per_motion_second: per_motion(traffic.bytes as f64),
                resent_blocks: host.resent_blocks,
                aborted_starts: host.aborted_starts,
                drive_buffer_bytes: 2 * self.buffer_bytes as u64,
            },
        }
    }
}

/// Bytes of a drive's buffer that holds a table of so many: a bit for each five of them comes to it.
pub fn buffer_for(table: usize) -> usize {
    table.div_ceil(40) * 41 + 2
}

/// The last control points of a table to whole counts, halves up, as the format has it.
fn programmed_end(table: &FeedTable, machine: &Machine) -> Vec<i64> {
    // Control points are whole multiples of a count's 2^-f: what lies between is rounding of the two factors.
    let finest = f64::from(1u32 << MAX_FRACTION_BITS);
    let end = |(path, axis): (&GridAxis, &Axis)| {
        let last = path.controls.last().copied().unwrap_or(0);
        let counts = last as f64 * (path.lsb * axis.counts_per_unit);
        ((counts * finest).round() / finest + 0.5).floor() as i64
    };
    table.path.axes.iter().zip(&machine.axes).map(end).collect()
}

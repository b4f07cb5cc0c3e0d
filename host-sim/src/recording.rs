//! Everything that is watched while the drives play: set-points against the plan, axes against the set-points.

use std::io;

use planner::analysis::motion::Cursor;
use planner::feed::table::FeedTable;
use planner::job::machine::{AxisKind, Machine, Unit};

use crate::axis_loop::{AxisLoop, AxisLoopError, CountSetpoint};
use crate::axis_scale::is_linear;
use crate::report::AxisReport;
use crate::setpoint_hash::SetpointHash;
use crate::statistics::{ContourError, Magnitude};
use crate::trace::{AxisSample, Place, TraceHeader, TraceRow, TraceSink};

/// The drives compute span times in f32, all alike: their common path clock may differ from the plan's by this much
/// and this share. A set-point that is early or late by so little is on the path all the same.
const CLOCK_SKEW_S: f64 = 2e-6;
const CLOCK_RATE: f64 = 3.2e-7;

/// The axes with their servos and plants, the oracle of the plan, and the statistics of both.
///
/// The drives' interpolators run one tick ahead of the servos, so that a servo knows the acceleration of the tick
/// that it is about to command: what [`Recording::tick`] takes in at one tick is followed at the next.
pub struct Recording<'a> {
    machine: &'a Machine,
    tick_s: f64,
    loops: Vec<AxisLoop>,
    linear: Vec<usize>,
    present: Vec<CountSetpoint>,
    samples: Vec<AxisSample>,
    /// The planned motion in f64 and closed form; it shares nothing with the drives' evaluator but the table.
    motion: Option<Cursor<'a>>,
    tables: usize,
    place: Option<Place>,
    hash: SetpointHash,
    deviation: Vec<f64>,
    errors: Vec<(f64, f64)>,
    skew_s: f64,
    contour: ContourError,
    contour_error: Magnitude,
    points: [Vec<f64>; 2],
    ticks: u64,
}

impl<'a> Recording<'a> {
    /// All axes at rest at `origin` [counts], in control ticks of `tick_s`.
    ///
    /// # Errors
    /// Index of the first axis whose plant or servo has parameters out of range, and what is wrong with it.
    pub fn new(machine: &'a Machine, tick_s: f64, origin: &[i64]) -> Result<Self, (usize, AxisLoopError)> {
        let mut loops = Vec::new();
        for (i, (axis, &origin)) in machine.axes.iter().zip(origin).enumerate() {
            loops.push(AxisLoop::new(axis, tick_s, origin).map_err(|e| (i, e))?);
        }
        let at = |&position: &i64| CountSetpoint { position, ..CountSetpoint::default() };
        let linear = (0..loops.len()).filter(|&i| is_linear(&machine.axes[i])).collect();
        Ok(Self {
            machine,
            tick_s,
            linear,
            present: origin.iter().map(at).collect(),
            samples: vec![AxisSample::default(); loops.len()],
            deviation: vec![0.0; loops.len()],
            errors: Vec::new(),
            skew_s: 0.0,
            loops,
            motion: None,
            tables: 0,
            place: None,
            hash: SetpointHash::default(),
            contour: ContourError::default(),
            contour_error: Magnitude::default(),
            points: [Vec::new(), Vec::new()],
            ticks: 0,
        })
    }

    /// What a trace sink is told first.
    pub fn header(&self, expected_ticks: u64) -> TraceHeader {
        let axes = &self.machine.axes;
        let unit = |u| match u {
            Unit::Mm => "mm",
            Unit::Deg => "deg",
            Unit::Rad => "rad",
        };
        TraceHeader {
            names: axes.iter().map(|a| a.name.clone()).collect(),
            units: axes.iter().map(|a| unit(a.unit)).collect(),
            effort_units: axes.iter().map(|a| if a.kind == AxisKind::Linear { "N" } else { "Nm" }).collect(),
            tick_s: self.tick_s,
            expected_ticks,
        }
    }

    /// From now on set-points are compared with `table`.
    pub fn begin_table(&mut self, table: &'a FeedTable) {
        self.motion = Some(Cursor::new(table));
        self.tables += 1;
    }

    /// Takes in the set-points of the coming tick, `playing` ticks after their table began if one is played, and
    /// runs servos and plants up to it.
    ///
    /// # Errors
    /// When the trace cannot be written.
    pub fn tick(
        &mut self,
        next: &[CountSetpoint],
        playing: Option<u64>,
        sink: &mut dyn TraceSink,
    ) -> io::Result<()> {
        if let Some(tick) = playing {
            self.compare(next, tick);
        }
        for (i, axis) in self.loops.iter_mut().enumerate() {
            self.samples[i] = axis.tick(&self.present[i], &next[i]);
        }
        self.present.copy_from_slice(next);
        self.measure_contour();
        // The samples are of the set-points taken in one tick ago.
        let (tick, place) = (self.ticks, self.place);
        self.place = playing.map(|tick| Place { table: self.tables - 1, time_s: tick as f64 * self.tick_s });
        let row = TraceRow { tick, time_s: tick as f64 * self.tick_s, place, axes: &self.samples };
        self.ticks += 1;
        sink.row(&row)
    }

    fn compare(&mut self, next: &[CountSetpoint], tick: u64) {
        for (axis, s) in next.iter().enumerate() {
            self.hash.add(tick, axis as u8, s.position, s.velocity, s.acceleration);
        }
        let Some(motion) = &mut self.motion else { return };
        let time = tick as f64 * self.tick_s;
        let state = motion.seek(time);
        let counts = self.machine.axes.iter().map(|axis| axis.counts_per_unit);
        // Error and planned speed of each axis [counts, counts/s].
        let axes =
            motion.axes(&state).zip(counts).zip(next).map(|((axis, counts), s)| {
                (s.position as f64 - axis.position * counts, axis.velocity * counts)
            });
        self.errors.clear();
        self.errors.extend(axes);
        let (along, square) = self
            .errors
            .iter()
            .fold((0.0, 0.0), |(a, q), (error, speed)| (a + error * speed, q + speed * speed));
        let most = CLOCK_SKEW_S + CLOCK_RATE * time;
        let early = if square > 0.0 { (along / square).clamp(-most, most) } else { 0.0 };
        self.skew_s = self.skew_s.max(early.abs());
        for (worst, (error, speed)) in self.deviation.iter_mut().zip(&self.errors) {
            *worst = worst.max((error - early * speed).abs());
        }
    }

    /// Most that the drives' path clock was ahead of or behind the plan's [s].
    pub fn skew_s(&self) -> f64 {
        self.skew_s
    }

    fn measure_contour(&mut self) {
        if self.linear.is_empty() {
            return;
        }
        let [wanted, actual] = &mut self.points;
        wanted.clear();
        wanted.extend(self.linear.iter().map(|&i| self.samples[i].position));
        actual.clear();
        actual.extend(self.linear.iter().map(|&i| self.samples[i].actual));
        self.contour_error.add(self.contour.add(wanted, actual));
    }

    /// Control ticks so far.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Fingerprint of the set-points so far.
    pub fn hash(&self) -> &SetpointHash {
        &self.hash
    }

    /// Distance of the load from the path so far [mm].
    pub fn contour_error(&self) -> Magnitude {
        self.contour_error
    }

    /// Following error of all linear axes together [mm], and of all others.
    pub fn following(&self) -> [Magnitude; 2] {
        let mut sums = [Magnitude::default(); 2];
        for (i, axis) in self.loops.iter().enumerate() {
            let sum = &mut sums[usize::from(!self.linear.contains(&i))];
            *sum = sum.join(axis.following());
        }
        sums
    }

    /// The axes' reports, given where the program ends [counts].
    pub fn axes(&self, programmed_end: &[i64]) -> Vec<AxisReport> {
        let axis = |(i, a): (usize, &AxisLoop)| AxisReport {
            name: self.machine.axes[i].name.clone(),
            max_following_error: a.following().max(),
            rms_following_error: a.following().rms(),
            max_effort: a.effort().max(),
            rms_effort: a.effort().rms(),
            effort_share: a.effort().max() / self.machine.axes[i].plant.effort_limit,
            saturated_share: a.saturated_share(),
            max_path_deviation_counts: self.deviation[i],
            end_counts: self.present[i].position,
            programmed_end_counts: programmed_end[i],
            settled_error: self.samples[i].following_error,
        };
        self.loops.iter().enumerate().map(axis).collect()
    }
}

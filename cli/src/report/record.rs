//! Turns the stream of planned and simulated instants into a motion small enough to draw.
//!
//! Memory is bounded whatever the job's length: intervals are joined two by two when there are too many, path
//! points are thinned and at the end simplified.

use planner::tolerances::FEED_REACHED;

use super::envelope::every_other;
use super::model::{Axis, AxisTraces, Envelope, Limit, Mode, Motion, Picture, PicturePoint, Traces};
use super::simplify::simplify;

/// Numbers that the traces of all axes together may hold; with about five characters each they keep the
/// report below two megabytes.
const TRACE_NUMBERS: usize = 200_000;

/// Most path points kept while recording.
const RAW_POINTS: usize = 1 << 18;

/// Most path points drawn.
const DRAWN_POINTS: usize = 16_000;

/// One instant of a job.
#[derive(Clone, Debug)]
pub struct Instant<'a> {
    /// Time since the start of the job [s]; never falls.
    pub time: f64,
    /// Line of the program.
    pub line: u32,
    /// How the machine moves.
    pub mode: Mode,
    /// What rules the speed.
    pub limit: Limit,
    /// Path speed: over the linear axes [mm/s], or over the rotary axes when no linear axis moves [unit/s].
    pub speed: f64,
    /// Programmed feed in force, same unit; `None` in rapids.
    pub feed: Option<f64>,
    /// One entry per axis.
    pub axes: &'a [AxisInstant],
}

impl<'a> Instant<'a> {
    /// The machine waits.
    pub fn standing(time: f64, line: u32, axes: &'a [AxisInstant]) -> Self {
        Instant { time, line, mode: Mode::Still, limit: Limit::Dwell, speed: 0.0, feed: None, axes }
    }
}

/// One instant of one axis, in its unit.
#[derive(Clone, Copy, Debug, Default)]
pub struct AxisInstant {
    /// Position.
    pub position: f64,
    /// Velocity.
    pub velocity: f64,
    /// Acceleration.
    pub acceleration: f64,
    /// Jerk.
    pub jerk: f64,
    /// How the simulated drive did.
    pub drive: Option<DriveInstant>,
}

impl AxisInstant {
    /// At rest.
    pub fn standing(position: f64, drive: Option<DriveInstant>) -> Self {
        AxisInstant { position, drive, ..AxisInstant::default() }
    }
}

/// One instant of a simulated drive.
#[derive(Clone, Copy, Debug, Default)]
pub struct DriveInstant {
    /// Following error [axis unit].
    pub error: f64,
    /// Motor force [N] or torque [N m].
    pub effort: f64,
}

/// Records a job instant by instant.
#[derive(Debug)]
pub struct Recorder {
    axes: Vec<Axis>,
    /// Axes that a picture can show, slides first.
    shown: Vec<usize>,
    traces: Traces,
    most_intervals: usize,
    /// Instants per interval, and how many the last interval holds.
    stride: (usize, usize),
    points: Vec<PicturePoint>,
    /// Instants per kept point, and how many since the last one.
    thinning: (usize, usize),
    position: f64,
    last: Option<PicturePoint>,
}

impl Recorder {
    /// A recorder for a machine.
    pub fn new(axes: &[Axis]) -> Self {
        Self::within(TRACE_NUMBERS, axes)
    }

    /// A recorder whose traces hold about so many numbers.
    pub fn within(numbers: usize, axes: &[Axis]) -> Self {
        let mut shown: Vec<usize> = (0..axes.len()).filter(|&i| axes[i].linear).collect();
        shown.extend((0..axes.len()).filter(|&i| !axes[i].linear));
        shown.truncate(3);
        Recorder {
            shown,
            traces: Traces { axes: vec![AxisTraces::default(); axes.len()], ..Traces::default() },
            // Five envelopes per axis and six series for the path; the count swings between half and full.
            most_intervals: (numbers / (10 * axes.len() + 6)).max(64) & !1,
            axes: axes.to_vec(),
            stride: (1, 0),
            points: Vec::new(),
            thinning: (1, 0),
            position: 0.0,
            last: None,
        }
    }

    /// Records one instant.
    pub fn push(&mut self, now: &Instant<'_>) {
        let slow = now.mode == Mode::Feed && now.feed.is_some_and(|f| now.speed < FEED_REACHED * f);
        let mut at = [0.0; 3];
        for (slot, &axis) in at.iter_mut().zip(&self.shown) {
            *slot = now.axes.get(axis).map_or(0.0, |a| a.position);
        }
        let point = PicturePoint {
            at,
            time: now.time,
            speed: now.speed,
            line: now.line,
            mode: now.mode,
            limit: now.limit,
            slow,
        };
        if let Some(last) = self.last {
            self.position += 0.5 * (last.speed + now.speed) * (now.time - last.time).max(0.0);
        }
        self.trace(now);
        self.keep(point);
        self.last = Some(point);
    }

    fn trace(&mut self, now: &Instant<'_>) {
        let t = &mut self.traces;
        let fresh = self.stride.1 == 0;
        if fresh {
            if t.time.len() >= self.most_intervals {
                t.halve();
                self.stride.0 *= 2;
            }
            t.time.push(now.time);
            t.position.push(self.position);
            t.line.push(f64::from(now.line));
            t.mode.push(now.mode);
            t.limit.push(now.limit);
            t.ceiling.push(ceiling(now, &self.axes));
        }
        let put = |e: &mut Envelope, v: f64| if fresh { e.open(v) } else { e.widen(v) };
        put(&mut t.speed, now.speed);
        for (trace, axis) in t.axes.iter_mut().zip(now.axes) {
            put(&mut trace.velocity, axis.velocity);
            put(&mut trace.acceleration, axis.acceleration);
            put(&mut trace.jerk, axis.jerk);
            if let Some(drive) = axis.drive {
                put(&mut trace.error, drive.error);
                put(&mut trace.effort, drive.effort);
            }
        }
        self.stride.1 = (self.stride.1 + 1) % self.stride.0;
    }

    fn keep(&mut self, point: PicturePoint) {
        if self.thinning.1 == 0 {
            if self.points.len() >= RAW_POINTS {
                every_other(&mut self.points);
                self.thinning.0 *= 2;
            }
            self.points.push(point);
        } else if let Some(end) = self.points.last_mut() {
            end.slow |= point.slow;
        }
        self.thinning.1 = (self.thinning.1 + 1) % self.thinning.0;
    }

    /// The motion recorded.
    pub fn finish(mut self) -> Motion {
        if let Some(last) = self.last
            && self.points.last() != Some(&last)
        {
            self.points.push(last);
        }
        let picture = self.picture();
        Motion { traces: self.traces, picture }
    }

    /// Chooses the axes worth drawing and simplifies the line.
    fn picture(&mut self) -> Picture {
        let mut points = std::mem::take(&mut self.points);
        let mut moving: Vec<usize> =
            (0..self.shown.len()).filter(|&c| points.iter().any(|p| p.at[c] != points[0].at[c])).collect();
        // A flat job stays in its plane even when one of its axes rests: show at least two axes if there are.
        for c in 0..self.shown.len() {
            if moving.len() == 1 && !moving.contains(&c) && self.axes[self.shown[c]].linear {
                moving.push(c);
                moving.sort_unstable();
            }
        }
        let select = |at: [f64; 3]| {
            let mut chosen = [0.0; 3];
            for (slot, &c) in chosen.iter_mut().zip(&moving) {
                *slot = at[c];
            }
            chosen
        };
        for point in &mut points {
            point.at = select(point.at);
        }
        Picture {
            axes: moving.iter().map(|&c| self.shown[c]).collect(),
            points: simplify(points, DRAWN_POINTS),
        }
    }
}

impl Traces {
    fn halve(&mut self) {
        every_other(&mut self.time);
        every_other(&mut self.position);
        every_other(&mut self.line);
        every_other(&mut self.mode);
        every_other(&mut self.limit);
        every_other(&mut self.ceiling);
        self.speed.halve();
        for axis in &mut self.axes {
            axis.velocity.halve();
            axis.acceleration.halve();
            axis.jerk.halve();
            axis.error.halve();
            axis.effort.halve();
        }
    }
}

/// Highest path speed that the programmed feed and the axis velocity limits allow at this place.
///
/// An axis at velocity v while the path runs at speed s reaches its limit V at s V/|v|.
fn ceiling(now: &Instant<'_>, axes: &[Axis]) -> f64 {
    let mut lowest = now.feed.unwrap_or(f64::INFINITY);
    for (instant, axis) in now.axes.iter().zip(axes) {
        let bounds = if now.mode == Mode::Rapid { &axis.rapid } else { &axis.feed };
        if instant.velocity != 0.0 {
            lowest = lowest.min(now.speed * bounds.velocity / instant.velocity.abs());
        }
    }
    if now.speed > 0.0 && lowest.is_finite() { lowest } else { f64::NAN }
}

#[cfg(test)]
mod tests;

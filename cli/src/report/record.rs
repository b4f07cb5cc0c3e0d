//! Turns the stream of planned and simulated instants into a motion small enough to draw.
//!
//! Memory is bounded whatever the job's length: intervals are joined two by two when there are too many, path
//! points are thinned and at the end simplified, and of the slow places only the most costly are kept.

use std::collections::BTreeMap;

use super::envelope::every_other;
use super::model::{
    Axis, AxisTraces, Envelope, Limit, Mode, Motion, Picture, PicturePoint, Share, SlowPlace, SlowPlaces,
    Traces,
};
use super::simplify::simplify;

/// Numbers that the traces of all axes together may hold; with about five characters each they keep the
/// report below two megabytes.
const TRACE_NUMBERS: usize = 200_000;

/// Most path points kept while recording.
const RAW_POINTS: usize = 1 << 18;

/// Most path points drawn.
const DRAWN_POINTS: usize = 16_000;

/// Most slow places listed.
const PLACES: usize = 40;

/// Slower than this share of the programmed feed counts as not reaching it.
const REACHED: f64 = 0.98;

/// Longest step between two instants that still belongs to one motion [s]; a longer one is a wait.
const LONGEST_STEP_S: f64 = 0.1;

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
    shares: BTreeMap<Limit, f64>,
    open: Option<SlowPlace>,
    slow: SlowPlaces,
    position: f64,
    last: Option<PicturePoint>,
}

impl Recorder {
    /// A recorder for a machine.
    pub fn new(axes: &[Axis]) -> Self {
        let mut shown: Vec<usize> = (0..axes.len()).filter(|&i| axes[i].linear).collect();
        shown.extend((0..axes.len()).filter(|&i| !axes[i].linear));
        shown.truncate(3);
        Recorder {
            shown,
            traces: Traces { axes: vec![AxisTraces::default(); axes.len()], ..Traces::default() },
            // Five envelopes per axis and six series for the path; the count swings between half and full.
            most_intervals: (TRACE_NUMBERS / (10 * axes.len() + 6)).max(64) & !1,
            axes: axes.to_vec(),
            stride: (1, 0),
            points: Vec::new(),
            thinning: (1, 0),
            shares: BTreeMap::new(),
            open: None,
            slow: SlowPlaces::default(),
            position: 0.0,
            last: None,
        }
    }

    /// Records one instant.
    pub fn push(&mut self, now: &Instant<'_>) {
        let slow = now.mode == Mode::Feed && now.feed.is_some_and(|f| now.speed < REACHED * f);
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
            let step = (now.time - last.time).max(0.0);
            let still = step > LONGEST_STEP_S && now.speed == 0.0 && last.speed == 0.0;
            *self.shares.entry(if still { Limit::Dwell } else { now.limit }).or_insert(0.0) += step;
            if let Some(limit) = self.traces.limit.last_mut().filter(|_| still) {
                *limit = Limit::Dwell;
            }
            let moved = if still { 0.0 } else { 0.5 * (last.speed + now.speed) * step };
            self.position += moved;
            self.follow_slow(now, &point, step, moved);
        }
        self.trace(now);
        self.keep(point);
        self.last = Some(point);
    }

    /// Grows, closes or opens the slow place that the instant belongs to.
    fn follow_slow(&mut self, now: &Instant<'_>, point: &PicturePoint, step: f64, moved: f64) {
        let feed = now.feed.filter(|_| point.slow);
        if let Some(open) = &mut self.open
            && feed == Some(open.programmed)
            && open.limit == now.limit
        {
            open.last_line = now.line;
            open.length_mm += moved;
            open.lost_s += step - moved / open.programmed;
            // Until the place is closed `mean` holds its duration.
            open.mean += step;
            if now.speed < open.lowest {
                open.lowest = now.speed;
                open.at = point.at;
            }
            return;
        }
        self.close_slow();
        if let Some(programmed) = feed.filter(|f| *f > 0.0) {
            self.open = Some(SlowPlace {
                first_line: now.line,
                last_line: now.line,
                time: now.time - step,
                at: point.at,
                length_mm: moved,
                programmed,
                lowest: now.speed,
                mean: step,
                limit: now.limit,
                lost_s: step - moved / programmed,
            });
        }
    }

    fn close_slow(&mut self) {
        let Some(mut place) = self.open.take() else { return };
        place.mean = if place.mean > 0.0 { place.length_mm / place.mean } else { place.lowest };
        self.slow.lost_s += place.lost_s;
        let places = &mut self.slow.places;
        let rank = places.partition_point(|p| p.lost_s >= place.lost_s);
        places.insert(rank, place);
        if places.len() > PLACES {
            places.pop();
            self.slow.others += 1;
        }
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
        self.close_slow();
        if let Some(last) = self.last
            && self.points.last() != Some(&last)
        {
            self.points.push(last);
        }
        let mut shares: Vec<Share> =
            self.shares.iter().map(|(&limit, &seconds)| Share { limit, seconds }).collect();
        shares.retain(|s| s.seconds > 0.0);
        shares.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
        let picture = self.picture();
        Motion { traces: self.traces, picture, shares, slow: self.slow }
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
        for place in &mut self.slow.places {
            place.at = select(place.at);
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

//! From a stream of program items to a stream of sections.

use std::collections::{BTreeMap, VecDeque};

use protocol::table::rules;

use super::certify::{Metric, certify};
use super::contour::{Contour, norm};
use super::fit::{Demand, Unfit, fit};
use super::gather::Gather;
use super::marks::marks;
use super::round::{LARGEST_CONTROL, round};
use super::section::{Marks, Section};
use crate::job::machine::{AxisLimits, LimitSet, MAX_AXES, Machine, Point};
use crate::job::program::{Feed, Item, MoveKind, StopCause};

/// Most drive counts that an axis moves in one geometry span, with room for rounding.
const SPAN_COUNTS: f64 = rules::MAX_CONTROL_STEP as f64 * 0.98;

/// Coarsest grid step in u.
const COARSEST_STEP: f64 = 1.0 / 128.0;

/// Rest spans make the grid no finer than this many steps per section: almost unlimited jerk asks for rest spans
/// that no drive could tell from none.
const FINEST_FOR_REST: f64 = (1u32 << 31) as f64;

/// How paths are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSettings {
    /// Tolerance where programmed points are to be hit [mm].
    pub exact_tolerance_mm: f64,
    /// Tolerance of rapids, which are straight lines [mm].
    pub rapid_tolerance_mm: f64,
    /// Longest geometry span except on lines [mm].
    pub longest_span_mm: f64,
    /// Shortest rest span of feed moves, see [`shortest_rest_span`].
    pub feed_rest_span: f64,
    /// Shortest rest span of rapids.
    pub rapid_rest_span: f64,
    /// Lowest jerk limit of feed moves; infinite without one.
    pub feed_jerk: f64,
}

impl PathSettings {
    /// The usual settings on a machine that is to keep these limits.
    pub fn of(machine: &Machine, limits: LimitSet) -> Self {
        let span = |kind| {
            shortest_rest_span(machine.axes.iter().map(|a| limits.of(a, kind)), machine.control_tick_s)
        };
        Self {
            exact_tolerance_mm: machine.exact_path_mm,
            rapid_tolerance_mm: machine.tolerance_mm,
            longest_span_mm: 4.0,
            feed_rest_span: span(MoveKind::Feed),
            rapid_rest_span: span(MoveKind::Rapid),
            feed_jerk: machine
                .axes
                .iter()
                .map(|a| limits.of(a, MoveKind::Feed).jerk)
                .fold(f64::INFINITY, f64::min),
        }
    }
}

/// The shortest rest span, min A t^2 / 6 over the axes: there acceleration saturates as the rest span ends. It takes
/// t = A/J, but no less than two control ticks.
fn shortest_rest_span(limits: impl Iterator<Item = AxisLimits>, tick_s: f64) -> f64 {
    let span = |l: AxisLimits| {
        let t = (l.acceleration / l.jerk).max(2.0 * tick_s);
        l.acceleration * t * t / 6.0
    };
    limits.map(span).fold(f64::INFINITY, f64::min)
}

/// Half of a speed gained at full jerk, v/6 sqrt(v/J): where a slow feed ends the rest span.
fn half_ramp(speed: f64, jerk: f64) -> f64 {
    speed * (speed / jerk).sqrt() / 6.0
}

/// What the geometry hands on, in program order. A note inside a section comes before it.
#[derive(Clone, Debug, PartialEq)]
pub enum SectionItem {
    /// A path from rest to rest.
    Section(Section),
    /// Stand still for a time.
    Dwell {
        /// How long [s].
        seconds: f64,
        /// Line of the program, from 1.
        line: u32,
    },
    /// A remark for the report.
    Note {
        /// What to show.
        text: String,
        /// Line of the program, from 1.
        line: u32,
    },
    /// The program asked for rest here.
    Stop {
        /// Why.
        cause: StopCause,
        /// Line of the program, from 1.
        line: u32,
    },
}

/// Why a section cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum GeometryError {
    /// A coordinate, tolerance or feed is not a number, not finite, or a feed is not positive.
    #[error("a number of this move is not finite, or its feed is not positive")]
    NotFinite {
        /// Line of the program.
        line: u32,
    },
    /// A move does not start where the one before it ended.
    #[error("the move does not start where the one before it ended")]
    Gap {
        /// Line of the program.
        line: u32,
    },
    /// A position has too many drive counts to be exact.
    #[error("the position is too far from the origin for exact drive counts")]
    TooFar {
        /// Line of the program.
        line: u32,
    },
    /// The stretch between two rests takes too many spans.
    #[error("the path from here to the next rest needs too many spans at this tolerance")]
    TooManySpans {
        /// Line of the program.
        line: u32,
    },
    /// The rounded path could not be proven to keep the tolerance.
    #[error("deviation {bound_mm} mm is not proven to be within {tolerance_mm} mm")]
    NotCertified {
        /// Line of the program.
        line: u32,
        /// What was proven.
        bound_mm: f64,
        /// What was asked for.
        tolerance_mm: f64,
    },
}

impl GeometryError {
    /// Line of the program that it is about.
    pub fn line(&self) -> u32 {
        match *self {
            GeometryError::NotFinite { line }
            | GeometryError::Gap { line }
            | GeometryError::TooFar { line }
            | GeometryError::TooManySpans { line }
            | GeometryError::NotCertified { line, .. } => line,
        }
    }
}

/// Why the stream of sections ends early.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SectionError<E> {
    /// The program has an error.
    #[error(transparent)]
    Program(E),
    /// The geometry has.
    #[error(transparent)]
    Geometry(GeometryError),
}

/// Turns program items into sections; see [`Sections`].
pub fn sections<I, E>(items: I, machine: &Machine, settings: &PathSettings) -> Sections<I>
where
    I: Iterator<Item = Result<Item, E>>,
{
    Sections {
        items,
        machine: machine.clone(),
        metric: Metric::new(machine),
        settings: *settings,
        gather: Gather::default(),
        notes: Vec::new(),
        ready: VecDeque::new(),
        at: None,
        stops: BTreeMap::new(),
        failed: None,
        finished: false,
    }
}

/// Iterator over sections, dwells, notes and stops.
///
/// Gathers moves up to the next required rest, so memory is proportional to the section in flight. Every section
/// starts on the drive counts on which the one before it ended. After an error it yields nothing more.
#[derive(Debug)]
pub struct Sections<I> {
    items: I,
    machine: Machine,
    metric: Metric,
    settings: PathSettings,
    gather: Gather,
    notes: Vec<SectionItem>,
    ready: VecDeque<SectionItem>,
    /// Where the drives stand [counts].
    at: Option<Vec<i64>>,
    stops: BTreeMap<StopCause, u64>,
    failed: Option<GeometryError>,
    finished: bool,
}

impl<I> Sections<I> {
    /// How many sections ended for which cause, so far.
    pub fn stops(&self) -> &BTreeMap<StopCause, u64> {
        &self.stops
    }

    /// Size of the largest figure that was left out, since standing still is within its tolerance [mm].
    pub fn left_out_mm(&self) -> f64 {
        self.gather.left_out()
    }

    /// Where the drives stand after the last section [counts].
    pub fn counts(&self) -> Option<&[i64]> {
        self.at.as_deref()
    }

    fn accept(&mut self, item: Item) -> Result<(), GeometryError> {
        match item {
            Item::Move(m) => {
                if let Some(cause) = self.gather.joint(&m, &self.settings, &self.metric) {
                    self.finish(cause)?;
                }
                self.gather.push(&m, &self.settings, &self.metric)?;
            }
            Item::Dwell { seconds, line } => {
                self.finish(StopCause::Dwell)?;
                self.ready.push_back(SectionItem::Dwell { seconds, line });
            }
            Item::Stop { cause, line } => {
                self.finish(cause)?;
                self.ready.push_back(SectionItem::Stop { cause, line });
            }
            Item::Note { text, line } => {
                let note = SectionItem::Note { text, line };
                if self.gather.is_empty() { self.ready.push_back(note) } else { self.notes.push(note) }
            }
        }
        Ok(())
    }

    /// Ends the section in flight.
    fn finish(&mut self, end: StopCause) -> Result<(), GeometryError> {
        self.ready.extend(self.notes.drain(..));
        let Some((contour, kind)) = self.gather.take() else { return Ok(()) };
        let mut waiting = vec![(contour, end)];
        while let Some((mut contour, end)) = waiting.pop() {
            match self.section(&mut contour, kind, end)? {
                Made::Section(section) => {
                    *self.stops.entry(end).or_default() += 1;
                    self.ready.push_back(SectionItem::Section(section));
                }
                Made::Nothing => {}
                Made::Cut(k) => {
                    let (before, after) = contour.cut(k);
                    waiting.push((after, end));
                    waiting.push((before, StopCause::Reversal));
                }
            }
        }
        Ok(())
    }

    /// Makes a section of a contour.
    fn section(
        &mut self,
        contour: &mut Contour,
        kind: MoveKind,
        end: StopCause,
    ) -> Result<Made, GeometryError> {
        let (Some(first), Some(last)) = (contour.first(), contour.last()) else { return Ok(Made::Nothing) };
        let line = contour.primitives[0].line;
        let start = match &self.at {
            Some(at) => at.clone(),
            None => self.to_counts(&first, line)?,
        };
        let stop = self.to_counts(&last, line)?;
        self.at = Some(start.clone());
        if start == stop && self.within_a_count(contour, &first) {
            return Ok(Made::Nothing);
        }
        let tolerance = contour.primitives.iter().fold(f64::INFINITY, |m, p| m.min(p.tolerance));
        let rest = match kind {
            MoveKind::Feed => self.settings.feed_rest_span.min(self.slow_rest(contour)),
            MoveKind::Rapid => self.settings.rapid_rest_span,
        };
        let [from, to] = [(&start, &first), (&stop, &last)].map(|(counts, p)| self.offset(counts, p));
        // A move of less than a count may still move a drive by one.
        let ends: Point = std::array::from_fn(|a| last[a] + to[a] - first[a] - from[a]);
        let length = contour.length().max(norm(&ends));
        let fine_rest = (rest / 16.0).max(length / FINEST_FOR_REST);
        let step =
            power_of_two_below(COARSEST_STEP.min(length / 1024.0).min(tolerance / 10.0).min(fine_rest));
        if step < length / LARGEST_CONTROL {
            return Err(GeometryError::TooManySpans { line });
        }
        contour.stretch_to((length / step).round().max(1.0) * step);
        contour.shift(&from, &to, &self.metric);
        let mut reach = [f64::INFINITY; MAX_AXES];
        for (reach, axis) in reach.iter_mut().zip(&self.machine.axes) {
            *reach = SPAN_COUNTS / axis.counts_per_unit;
        }
        let longest = self.settings.longest_span_mm;
        let demand = Demand { metric: &self.metric, step, longest, reach: &reach };
        let spline = match fit(contour, &demand) {
            Ok(spline) => spline,
            Err(Unfit::StopAt(k)) => {
                contour.shift(&from.map(|v| -v), &to.map(|v| -v), &self.metric);
                return Ok(Made::Cut(k));
            }
            Err(Unfit::TooManySpans(k)) => {
                return Err(GeometryError::TooManySpans { line: contour.primitives[k].line });
            }
        };
        let path = round(&spline, [&start, &stop], &self.machine, &self.metric, tolerance)
            .ok_or(GeometryError::TooFar { line })?;
        let certificate = certify(&path, contour, &self.metric);
        let deviation = certificate.deviation;
        if !certificate.holds {
            return Err(GeometryError::NotCertified {
                line: deviation.line,
                bound_mm: deviation.bound_mm,
                tolerance_mm: deviation.tolerance_mm,
            });
        }
        let (caps, blocks) = marks(contour, &path, &self.metric);
        self.at = Some(stop);
        Ok(Made::Section(Section { kind, path, marks: Marks { caps, blocks, deviation, end } }))
    }

    /// Four times the rest span that the slowest feed beside a change of speed asks for, the rests at both ends among
    /// them; infinite if none does. A slow feed leaves as little way to change speed in as a rest.
    fn slow_rest(&self, contour: &Contour) -> f64 {
        if !self.settings.feed_jerk.is_finite() {
            return f64::INFINITY;
        }
        let last = contour.primitives.len().saturating_sub(1);
        let speed = |k: usize| match contour.primitives[k].feed {
            Some(Feed::Speed(speed)) => speed,
            Some(Feed::Duration(seconds)) => contour.length_of(k) / seconds,
            None => f64::INFINITY,
        };
        let mut slowest = speed(0).min(speed(last));
        for k in 1..=last {
            let (before, here) = (speed(k - 1), speed(k));
            if before != here {
                slowest = slowest.min(before).min(here);
            }
        }
        if slowest < f64::INFINITY { 4.0 * half_ramp(slowest, self.settings.feed_jerk) } else { slowest }
    }

    /// The nearest drive counts.
    fn to_counts(&self, p: &Point, line: u32) -> Result<Vec<i64>, GeometryError> {
        let counts = self.machine.axes.iter().zip(p).map(|(axis, x)| (x * axis.counts_per_unit).round());
        counts
            .map(
                |c| {
                    if c.abs() < LARGEST_CONTROL { Ok(c as i64) } else { Err(GeometryError::TooFar { line }) }
                },
            )
            .collect()
    }

    /// Counts minus position [axis units].
    fn offset(&self, counts: &[i64], p: &Point) -> Point {
        let mut d = [0.0; MAX_AXES];
        for (a, (&c, axis)) in counts.iter().zip(&self.machine.axes).enumerate() {
            d[a] = c as f64 / axis.counts_per_unit - p[a];
        }
        d
    }

    /// Whether the whole contour stays within a count of `first` on each axis.
    fn within_a_count(&self, contour: &Contour, first: &Point) -> bool {
        let near = |p: &Point| {
            let axes = self.machine.axes.iter().enumerate();
            axes.into_iter().all(|(a, axis)| (p[a] - first[a]).abs() * axis.counts_per_unit < 1.0)
        };
        contour.primitives.iter().enumerate().all(|(k, p)| {
            let parts = if p.round.is_some() { 8 } else { 1 };
            (1..=parts).all(|i| near(&p.position(contour.length_of(k) * f64::from(i) / f64::from(parts))))
        })
    }
}

/// What became of a contour.
enum Made {
    Section(Section),
    /// It moves no drive.
    Nothing,
    /// Motion has to rest at the start of this primitive.
    Cut(usize),
}

/// The largest power of two that is not above `x`.
fn power_of_two_below(x: f64) -> f64 {
    let p = x.log2().floor().exp2();
    if p > x { 0.5 * p } else { p }
}

impl<I, E> Iterator for Sections<I>
where
    I: Iterator<Item = Result<Item, E>>,
{
    type Item = Result<SectionItem, SectionError<E>>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(item) = self.ready.pop_front() {
                return Some(Ok(item));
            }
            if let Some(e) = self.failed.take() {
                return Some(Err(SectionError::Geometry(e)));
            }
            if self.finished {
                return None;
            }
            let result = match self.items.next() {
                Some(Ok(item)) => self.accept(item),
                Some(Err(e)) => {
                    self.finished = true;
                    return Some(Err(SectionError::Program(e)));
                }
                None => {
                    self.finished = true;
                    self.finish(StopCause::ProgramEnd)
                }
            };
            if let Err(e) = result {
                (self.finished, self.failed) = (true, Some(e));
            }
        }
    }
}

#[cfg(test)]
mod tests;

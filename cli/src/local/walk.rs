//! Walks a planned section in time: what the machine does, what rules it, and which program line asked for it.

use planner::analysis::motion::{AxisState, MotionSpan, PathState, pieces, spans};
use planner::feed::job::PlannedSection;
use planner::geometry::grid_path::Piece;
use planner::geometry::section::SpeedCap;
use planner::job::program::MoveKind;
use planner::topp::problem::Binding;

use crate::report::model::{Limit, Mode};
use crate::report::record::{AxisInstant, DriveInstant, Instant};

/// A place in a section that moves forwards in time.
#[derive(Debug)]
pub struct Walk<'a> {
    section: &'a PlannedSection,
    binding: &'a [Binding],
    linear: u16,
    spans: Vec<MotionSpan>,
    at: usize,
    cap: usize,
    block: usize,
    geometry: usize,
    cubics: Vec<Piece>,
    axes: Vec<AxisInstant>,
}

impl<'a> Walk<'a> {
    /// At the start of `section`; `linear` is the mask of the machine's linear axes.
    pub fn new(section: &'a PlannedSection, binding: &'a [Binding], linear: u16) -> Self {
        let axes = vec![AxisInstant::default(); section.table.path.axes.len()];
        Walk {
            section,
            binding,
            linear,
            spans: spans(&section.table).collect(),
            at: 0,
            cap: 0,
            block: 0,
            geometry: usize::MAX,
            cubics: Vec::new(),
            axes,
        }
    }

    /// Duration of the section [s].
    pub fn duration(&self) -> f64 {
        self.spans.last().map_or(0.0, |s| s.start_s + s.duration_s)
    }

    /// The instant `time` after the section's start [s], not before the one asked for last; the job's clock then
    /// shows `clock`. `drives` holds how the simulated drives did, one per axis, or nothing.
    pub fn instant(&mut self, time: f64, clock: f64, drives: &[DriveInstant]) -> Instant<'_> {
        while self.at + 1 < self.spans.len() && time >= self.spans[self.at + 1].start_s {
            self.at += 1;
        }
        let span = &self.spans[self.at];
        let state = span.at_time((time - span.start_s).clamp(0.0, span.duration_s));
        self.settle(&state, drives);
        let marks = &self.section.marks;
        let cap = marks.caps.get(self.cap).map_or(SpeedCap::None, |c| c.speed);
        let (speed, feed) = self.speeds(&state, cap);
        Instant {
            time: clock,
            line: marks.blocks.get(self.block).or(marks.blocks.last()).map_or(0, |b| b.line),
            mode: match self.section.kind {
                MoveKind::Feed => Mode::Feed,
                MoveKind::Rapid => Mode::Rapid,
            },
            limit: Limit::from(self.binding.get(self.at).copied().unwrap_or(Binding::Free)),
            speed,
            feed,
            axes: &self.axes,
        }
    }

    /// Finds marks and cubics of the place and evaluates the axes there.
    fn settle(&mut self, state: &PathState, drives: &[DriveInstant]) {
        let (span, table) = (&self.spans[self.at], &self.section.table);
        let place = span.from + (state.x / table.path.step) as u64;
        while self.section.marks.caps.get(self.cap).is_some_and(|c| c.until <= place) {
            self.cap += 1;
        }
        while self.section.marks.blocks.get(self.block).is_some_and(|b| b.until <= place) {
            self.block += 1;
        }
        if span.geometry != self.geometry {
            self.geometry = span.geometry;
            self.cubics = pieces(table, span.geometry);
        }
        for (i, (slot, cubic)) in self.axes.iter_mut().zip(&self.cubics).enumerate() {
            let AxisState { position, velocity, acceleration, jerk } =
                span.axis(cubic, table.path.axes[i].lsb, state);
            *slot = AxisInstant { position, velocity, acceleration, jerk, drive: drives.get(i).copied() };
        }
    }

    /// Speed over the axes that the feed is about, and the feed itself in the same unit.
    fn speeds(&self, state: &PathState, cap: SpeedCap) -> (f64, Option<f64>) {
        let over = |mask: u16| {
            let counted = self.axes.iter().enumerate().filter(|(i, _)| mask >> i & 1 == 1);
            counted.map(|(_, a)| a.velocity * a.velocity).sum::<f64>().sqrt()
        };
        let linear = over(self.linear);
        let plain = if linear > 0.0 { linear } else { over(!self.linear) };
        match cap {
            SpeedCap::None => (plain, None),
            SpeedCap::Tangential { axes, speed } => (over(axes), Some(speed)),
            // An inverse-time feed bounds du/dt; the same share of it in the unit of the speed shown.
            SpeedCap::Rate(rate) if state.speed > 0.0 => (plain, Some(rate * plain / state.speed)),
            SpeedCap::Rate(_) => (plain, None),
        }
    }
}

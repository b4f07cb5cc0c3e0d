//! Walks a planned section in time: what the machine does, what rules it, and which program line asked for it.

use planner::analysis::motion::{AxisState, Cursor, PathState};
use planner::feed::job::PlannedSection;
use planner::geometry::section::SpeedCap;
use planner::job::program::MoveKind;
use planner::topp::problem::Binding;

use crate::report::model::{Limit, Mode};
use crate::report::record::{AxisInstant, DriveInstant, Instant};

/// A place in a section that moves forwards in time.
#[derive(Debug)]
pub(super) struct Walk<'a> {
    section: &'a PlannedSection,
    binding: &'a [Binding],
    linear: u16,
    cursor: Cursor<'a>,
    cap: usize,
    block: usize,
    axes: Vec<AxisInstant>,
}

impl<'a> Walk<'a> {
    /// At the start of `section`; `linear` is the mask of the machine's linear axes.
    pub(super) fn new(section: &'a PlannedSection, binding: &'a [Binding], linear: u16) -> Self {
        let cursor = Cursor::new(&section.table);
        Walk { section, binding, linear, cursor, cap: 0, block: 0, axes: Vec::new() }
    }

    /// The instant `time` after the section's start [s], not before the one asked for last; the job's clock then
    /// shows `clock`. `drives` holds how the simulated drives did, one per axis, or nothing.
    pub(super) fn instant(&mut self, time: f64, clock: f64, drives: &[DriveInstant]) -> Instant<'_> {
        let state = self.cursor.seek(time);
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
            limit: Limit::from(self.binding.get(self.cursor.span().index).copied().unwrap_or(Binding::Free)),
            speed,
            feed,
            axes: &self.axes,
        }
    }

    /// Finds the marks of the place and evaluates the axes there.
    fn settle(&mut self, state: &PathState, drives: &[DriveInstant]) {
        let (from, marks) = (self.cursor.span().from, &self.section.marks);
        let place = from + (state.x / self.section.table.path.step) as u64;
        while marks.caps.get(self.cap).is_some_and(|c| c.until <= place) {
            self.cap += 1;
        }
        while marks.blocks.get(self.block).is_some_and(|b| b.until <= place) {
            self.block += 1;
        }
        self.axes.clear();
        self.axes.extend(self.cursor.axes(state).enumerate().map(|(i, axis)| {
            let AxisState { position, velocity, acceleration, jerk } = axis;
            AxisInstant { position, velocity, acceleration, jerk, drive: drives.get(i).copied() }
        }));
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

//! Walks a planned section in small cells, each under one speed cap and of one program line.

use super::motion::{AxisState, MotionSpan, PathState, pieces, spans};
use crate::feed::job::PlannedSection;
use crate::geometry::section::SpeedCap;
use crate::job::machine::AxisLimits;
use crate::topp::problem::Binding;

/// A small part of a section.
#[derive(Clone, Copy, Debug)]
pub struct Cell<'a> {
    /// Span of the table.
    pub span: usize,
    /// Whether it belongs to a rest span.
    pub rests: bool,
    /// Start and end on the path [u].
    pub range: [f64; 2],
    /// When it starts, from the start of the section [s].
    pub start_s: f64,
    /// Time to cross it [s].
    pub seconds: f64,
    /// The speed cap in force.
    pub cap: SpeedCap,
    /// Program line.
    pub line: u32,
    /// The motion in the middle (in place) of the cell.
    pub path: PathState,
    /// The axes there.
    pub axes: &'a [AxisState],
}

/// Visits every cell of a section in order; spans without a boundary inside are cut into `per_span` cells.
pub fn visit(section: &PlannedSection, per_span: usize, mut see: impl FnMut(&Cell<'_>)) {
    let (table, marks) = (&section.table, &section.marks);
    let step = table.path.step;
    let last = table.spans().saturating_sub(1);
    let (mut cap, mut block) = (0, 0);
    let mut geometry = usize::MAX;
    let mut cubics = Vec::new();
    let mut states = vec![AxisState::default(); table.path.axes.len()];
    for span in spans(table) {
        if span.geometry != geometry {
            geometry = span.geometry;
            cubics = pieces(table, geometry);
        }
        let mut place = span.from;
        while place < span.to {
            while marks.caps.get(cap).is_some_and(|c| c.until <= place) {
                cap += 1;
            }
            while marks.blocks.get(block).is_some_and(|b| b.until <= place) {
                block += 1;
            }
            let cap_end = marks.caps.get(cap).map_or(u64::MAX, |c| c.until);
            let block_end = marks.blocks.get(block).map_or(u64::MAX, |b| b.until);
            let end = span.to.min(cap_end).min(block_end);
            let speed_cap = marks.caps.get(cap).map_or(SpeedCap::None, |c| c.speed);
            let line =
                marks.blocks.get(block.min(marks.blocks.len().saturating_sub(1))).map_or(0, |b| b.line);
            let share = (end - place) as f64 / (span.to - span.from) as f64;
            let count = ((per_span as f64 * share).ceil() as usize).max(1);
            let from = (place - span.from) as f64 * step;
            let width = (end - place) as f64 * step / count as f64;
            for k in 0..count {
                let [a, b] = [k, k + 1].map(|k| from + width * k as f64);
                let path = span.at_place(0.5 * (a + b));
                for ((state, cubic), grid) in states.iter_mut().zip(&cubics).zip(&table.path.axes) {
                    *state = span.axis(cubic, grid.lsb, &path);
                }
                let start = span.from as f64 * step;
                see(&Cell {
                    span: span.index,
                    rests: span.index == 0 || span.index == last,
                    range: [start + a, start + b],
                    start_s: span.start_s + span.time_at(a),
                    seconds: crossing(&span, a, b),
                    cap: speed_cap,
                    line,
                    path,
                    axes: &states,
                });
            }
            place = end;
        }
    }
}

fn crossing(span: &MotionSpan, from: f64, to: f64) -> f64 {
    (span.time_at(to) - span.time_at(from)).max(0.0)
}

impl Cell<'_> {
    /// Path speed / cap in the middle of the cell; `None` without a cap.
    pub fn feed_ratio(&self) -> Option<f64> {
        feed_ratio(self.cap, self.path.speed, self.axes)
    }
}

/// Path speed / cap; `None` without a cap.
pub fn feed_ratio(cap: SpeedCap, rate: f64, axes: &[AxisState]) -> Option<f64> {
    match cap {
        SpeedCap::None => None,
        SpeedCap::Rate(limit) => Some(rate / limit),
        SpeedCap::Tangential { axes: mask, speed } => {
            let counted = axes.iter().enumerate().filter(|(i, _)| mask >> i & 1 == 1);
            Some(counted.map(|(_, a)| a.velocity * a.velocity).sum::<f64>().sqrt() / speed)
        }
    }
}

/// The axis limit that is nearest, and value / limit of it.
pub fn nearest_limit(axes: &[AxisState], limits: &[AxisLimits]) -> (Binding, f64) {
    let mut nearest = (Binding::Free, 0.0);
    for (i, (a, limit)) in axes.iter().zip(limits).enumerate() {
        let axis = i as u8;
        for (binding, ratio) in [
            (Binding::Velocity(axis), a.velocity.abs() / limit.velocity),
            (Binding::Acceleration(axis), a.acceleration.abs() / limit.acceleration),
            (Binding::Jerk(axis), a.jerk.abs() / limit.jerk),
        ] {
            if ratio > nearest.1 {
                nearest = (binding, ratio);
            }
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::samples::bent_section;

    #[test]
    fn cells_tile_the_path_and_the_time_and_break_at_blocks() {
        let section = bent_section();
        let (mut end, mut seconds, mut lines) = (0.0, 0.0, Vec::new());
        visit(&section, 3, |cell| {
            assert!((cell.range[0] - end).abs() < 1e-12 && cell.range[1] > cell.range[0]);
            assert!((cell.start_s - seconds).abs() < 1e-9);
            end = cell.range[1];
            seconds += cell.seconds;
            assert_eq!(cell.line, if end <= 300.0 / 64.0 + 1e-9 { 4 } else { 5 });
            lines.push(cell.line);
        });
        assert_eq!(end, section.table.path.length());
        assert!((seconds / section.table.duration() - 1.0).abs() < 1e-9);
        assert!(lines.contains(&4) && lines.contains(&5));
    }
}

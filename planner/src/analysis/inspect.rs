//! What a planned job consists of, table by table.

use serde::Serialize;

use super::motion::spans;
use crate::certificate::{certify, position_bounds};
use crate::feed::job::{JobItem, PlannedSection};
use crate::feed::table::{FeedTable, SpanLaw};
use crate::job::machine::AxisLimits;
use crate::job::program::MoveKind;

/// A planned job.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Inspection {
    /// The tables in order.
    pub tables: Vec<TableSummary>,
    /// Waits between them.
    pub dwells: usize,
    /// q spans of all tables.
    pub spans: u64,
    /// Geometry spans of all tables.
    pub geometry_spans: u64,
    /// Time in motion [s].
    pub motion_time_s: f64,
    /// Time in motion and in waits [s].
    pub cycle_time_s: f64,
    /// Bytes of all tables, if known.
    pub bytes: Option<u64>,
}

/// One table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TableSummary {
    /// feed or rapid.
    pub kind: &'static str,
    /// Program lines it comes from, first and last.
    pub lines: [u32; 2],
    /// q spans.
    pub spans: usize,
    /// Geometry spans.
    pub geometry_spans: usize,
    /// Duration [s].
    pub duration_s: f64,
    /// Length of the path [u].
    pub length: f64,
    /// Length of one grid step [u].
    pub step: f64,
    /// Size of one squared code [u^2/s^2].
    pub q_scale: f32,
    /// Shortest and longest time to cross a span [s].
    pub span_s: [f64; 2],
    /// Largest |gamma| w^2 of a span: the argument of the drives' series.
    pub largest_y: f64,
    /// Allowed distance from the programmed contour [mm].
    pub tolerance_mm: f64,
    /// Proven bound of it [mm].
    pub deviation_mm: f64,
    /// Size as packed, if known.
    pub bytes: Option<u64>,
    /// The axes.
    pub axes: Vec<AxisSummary>,
}

/// One axis of a table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AxisSummary {
    /// Size of one integer [axis units].
    pub lsb: f64,
    /// First and last position [axis units].
    pub ends: [f64; 2],
    /// Lowest and highest position [axis units].
    pub range: [f64; 2],
    /// Proven largest velocity, acceleration and jerk [axis units/s^n].
    pub largest: [f64; 3],
}

/// Summarises a job; `bytes` tells the packed size of a table where it is known.
pub fn inspect(items: &[JobItem], bytes: impl Fn(&FeedTable) -> Option<u64>) -> Inspection {
    let mut whole = Inspection::default();
    let mut known = Some(0);
    for item in items {
        match item {
            JobItem::Section(section) => {
                let table = summarise(section, bytes(&section.table));
                whole.spans += table.spans as u64;
                whole.geometry_spans += table.geometry_spans as u64;
                whole.motion_time_s += table.duration_s;
                known = known.zip(table.bytes).map(|(sum, more)| sum + more);
                whole.tables.push(table);
            }
            JobItem::Dwell { seconds, .. } => {
                whole.dwells += 1;
                whole.cycle_time_s += seconds;
            }
            JobItem::Note { .. } => {}
        }
    }
    whole.cycle_time_s += whole.motion_time_s;
    whole.bytes = known;
    whole
}

/// Shortest and longest time of a span [s], and the largest |gamma| w^2.
pub fn span_extremes(table: &FeedTable) -> ([f64; 2], f64) {
    let (mut times, mut largest_y) = ([f64::INFINITY, 0.0f64], 0.0f64);
    for span in spans(table) {
        times = [times[0].min(span.duration_s), times[1].max(span.duration_s)];
        if let SpanLaw::Quadratic { h, q: [alpha, _, gamma] } = span.law {
            let w = h / (alpha.sqrt() + span.at_place(h).speed);
            largest_y = largest_y.max((gamma * w * w).abs());
        }
    }
    (times, largest_y)
}

fn summarise(section: &PlannedSection, bytes: Option<u64>) -> TableSummary {
    let PlannedSection { kind, table, marks, .. } = section;
    let (span_s, largest_y) = span_extremes(table);
    let lines = [marks.blocks.first(), marks.blocks.last()].map(|b| b.map_or(0, |b| b.line));
    TableSummary {
        kind: if *kind == MoveKind::Feed { "feed" } else { "rapid" },
        lines,
        spans: table.spans(),
        geometry_spans: table.path.spans(),
        duration_s: table.duration(),
        length: table.path.length(),
        step: table.path.step,
        q_scale: table.q_scale,
        span_s,
        largest_y,
        tolerance_mm: marks.deviation.tolerance_mm,
        deviation_mm: marks.deviation.bound_mm,
        bytes,
        axes: (0..table.path.axes.len()).map(|axis| summarise_axis(table, axis)).collect(),
    }
}

fn summarise_axis(table: &FeedTable, axis: usize) -> AxisSummary {
    let grid = &table.path.axes[axis];
    let end = |c: Option<&i64>| c.map_or(0.0, |&c| c as f64 * grid.lsb);
    let free = AxisLimits { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY };
    let mut limits = vec![free; table.path.axes.len()];
    limits[axis] = AxisLimits { velocity: 1.0, acceleration: 1.0, jerk: 1.0 };
    let proven = certify(table, &limits, &[]);
    AxisSummary {
        lsb: grid.lsb,
        ends: [end(grid.controls.first()), end(grid.controls.last())],
        range: position_bounds(table, axis),
        largest: [proven.velocity_ratio, proven.acceleration_ratio, proven.jerk_ratio],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::motion::Cursor;
    use crate::analysis::samples::{back_section, bent_section};

    #[test]
    fn totals_are_sums_and_peaks_are_those_of_the_motion() {
        let section = bent_section();
        let items = [
            JobItem::Section(section.clone()),
            JobItem::Dwell { seconds: 2.0, line: 6 },
            JobItem::Section(back_section()),
        ];
        let seen = inspect(&items, |t| Some(t.spans() as u64 * 4));
        assert_eq!((seen.tables.len(), seen.dwells, seen.spans, seen.bytes), (2, 1, 16, Some(64)));
        assert!((seen.cycle_time_s - seen.motion_time_s - 2.0).abs() < 1e-12);
        assert!((seen.motion_time_s - 2.0 * section.table.duration()).abs() < 1e-9);
        let first = &seen.tables[0];
        assert_eq!(first.lines, [4, 5]);
        assert_eq!(first.axes[0].ends, [0.0, 9.3]);
        let mut most = [0.0f64; 3];
        let (mut cursor, duration) = (Cursor::new(&section.table), section.table.duration());
        for k in 0..=20_000 {
            let state = cursor.seek(duration * f64::from(k) / 20_000.0);
            let a = cursor.axes(&state).next().unwrap();
            for (m, x) in most.iter_mut().zip([a.velocity, a.acceleration, a.jerk]) {
                *m = m.max(x.abs());
            }
        }
        for (proven, sampled) in first.axes[0].largest.iter().zip(most) {
            assert!(*proven >= sampled * (1.0 - 1e-12) && *proven < sampled * 1.01, "{proven} {sampled}");
        }
        assert!(first.span_s[0] > 0.0 && first.span_s[0] < first.span_s[1]);
        assert_eq!(inspect(&items, |_| None).bytes, None);
    }
}

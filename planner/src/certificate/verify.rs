//! Proves a whole planned job against a machine, from the tables and the limits alone.

use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;

use super::{AxisRatios, Certificate, LimitKind, TableDefect, Worst, certify, position_bounds};
use crate::analysis::inspect::span_extremes;
use crate::feed::file::FileAxis;
use crate::feed::job::{JobItem, PlannedSection};
use crate::job::program::MoveKind;
use crate::tolerances::{STATED_LIMIT, TABLE_SERIES_ARGUMENT};

/// Faults that are kept; all are counted.
const KEPT_FAULTS: usize = 100;

/// What is proven of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct VerifyReport {
    /// Every table is proven against its stated limits, every stated limit is the machine's or stricter, and
    /// the tables follow each other inside the travel.
    pub holds: bool,
    /// Worst ratio of an axis velocity to its stated limit.
    pub velocity_ratio: f64,
    /// Worst ratio of an axis acceleration.
    pub acceleration_ratio: f64,
    /// Worst ratio of an axis jerk.
    pub jerk_ratio: f64,
    /// Worst ratio of the path speed to its cap.
    pub feed_ratio: f64,
    /// The worst ratios of each axis.
    pub axes: Vec<AxisRatios>,
    /// Where each kind comes nearest its limit in the whole job.
    pub worst: Vec<WorstInJob>,
    /// Number of tables.
    pub tables: usize,
    /// Their q spans.
    pub spans: u64,
    /// Time in motion [s].
    pub motion_time_s: f64,
    /// Time in motion and in waits [s].
    pub cycle_time_s: f64,
    /// Lowest and highest position of every axis [axis units]; empty without motion.
    pub travel: Vec<[f64; 2]>,
    /// Largest argument |gamma| w^2 of the drives' series.
    pub largest_y: f64,
    /// Shortest time of a span [s].
    pub shortest_span_s: Option<f64>,
    /// Longest time of a span [s].
    pub longest_span_s: Option<f64>,
    /// Number of faults.
    pub fault_count: usize,
    /// The first of them.
    pub faults: Vec<Fault>,
}

/// The place at which one kind of limit is nearest in a job.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstInJob {
    /// Index of the table.
    pub table: usize,
    /// Program line.
    pub line: u32,
    /// The place in the table.
    #[serde(flatten)]
    pub place: Worst,
}

/// What is wrong with a table of a job.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fault {
    /// Index of the table.
    pub table: usize,
    /// First program line of it.
    pub line: u32,
    /// What is wrong.
    #[serde(flatten)]
    pub cause: FaultCause,
}

/// Why a job does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Error, Serialize)]
#[serde(tag = "cause", rename_all = "snake_case")]
pub enum FaultCause {
    /// Not a motion at all.
    #[error(transparent)]
    Table(TableDefect),
    /// A limit is exceeded.
    #[error("{kind:?} reaches {ratio} of its limit")]
    Limit {
        /// Which limit.
        kind: LimitKind,
        /// Proven bound of value / limit.
        ratio: f64,
    },
    /// Planned for another number of axes.
    #[error("the table moves {found} axes, the machine has {machine}")]
    AxisCount {
        /// Axes of the table.
        found: usize,
        /// Axes of the machine.
        machine: usize,
    },
    /// Planned for limits that the machine does not grant.
    #[error("axis {axis} was planned for more than the machine grants in {kind:?}")]
    StatedLimit {
        /// The axis.
        axis: usize,
        /// Which limit.
        kind: LimitKind,
    },
    /// Starts elsewhere than the table before it ends.
    #[error("axis {axis} starts {counts} counts away from where the table before it ends")]
    Jump {
        /// The axis.
        axis: usize,
        /// Distance [drive counts].
        counts: f64,
    },
    /// Leaves the travel of an axis.
    #[error("axis {axis} leaves its travel: {low} to {high}")]
    Travel {
        /// The axis.
        axis: usize,
        /// Lowest position [axis units].
        low: f64,
        /// Highest position [axis units].
        high: f64,
    },
    /// Further from the programmed contour than allowed.
    #[error("the path is up to {bound_mm} mm from the contour, {tolerance_mm} mm are allowed")]
    Deviation {
        /// Stated bound [mm].
        bound_mm: f64,
        /// Stated tolerance [mm].
        tolerance_mm: f64,
    },
    /// Caps or blocks do not cover the path.
    #[error("the table's marks do not end with its path")]
    Marks,
    /// The motion on a span bends too much for the drives' series.
    #[error("the argument {y} of a span is beyond the format's 1/4")]
    Series {
        /// Largest argument.
        y: f64,
    },
}

/// What one table contributes.
struct TableProof {
    certificate: Certificate,
    faults: Vec<FaultCause>,
    ranges: Vec<[f64; 2]>,
    duration_s: f64,
    span_s: [f64; 2],
    largest_y: f64,
}

/// Proves every table of a job against its stated limits and those against the machine's axes.
///
/// To verify a plan made without jerk limits, hand in axes whose jerk limits are infinite.
pub fn verify(items: &[JobItem], axes: &[FileAxis]) -> VerifyReport {
    let sections: Vec<&PlannedSection> = items
        .iter()
        .filter_map(|item| if let JobItem::Section(section) = item { Some(section) } else { None })
        .collect();
    let mut report = VerifyReport { tables: sections.len(), ..VerifyReport::default() };
    let proofs: Vec<TableProof> = sections.par_iter().map(|section| prove(section, axes)).collect();
    let mut before: Option<&PlannedSection> = None;
    for (table, (section, mut proof)) in sections.iter().zip(proofs).enumerate() {
        if proof.certificate.defect.is_none() {
            if let Some(before) = before {
                proof.faults.extend(jumps(before, section, axes));
            }
            before = Some(section);
        }
        report.add(table, section, proof);
    }
    let waits =
        items.iter().map(|item| if let JobItem::Dwell { seconds, .. } = item { *seconds } else { 0.0 });
    report.cycle_time_s = report.motion_time_s + waits.sum::<f64>();
    report.holds = report.fault_count == 0;
    report
}

impl VerifyReport {
    fn add(&mut self, table: usize, section: &PlannedSection, proof: TableProof) {
        let c = &proof.certificate;
        self.velocity_ratio = self.velocity_ratio.max(c.velocity_ratio);
        self.acceleration_ratio = self.acceleration_ratio.max(c.acceleration_ratio);
        self.jerk_ratio = self.jerk_ratio.max(c.jerk_ratio);
        self.feed_ratio = self.feed_ratio.max(c.feed_ratio);
        if self.axes.len() < c.axes.len() {
            self.axes.resize(c.axes.len(), AxisRatios::default());
        }
        for (whole, part) in self.axes.iter_mut().zip(&c.axes) {
            *whole = whole.max(*part);
        }
        for &place in &c.worst {
            let found =
                WorstInJob { table, line: section.marks.line_at(place.u / section.table.path.step), place };
            match self.worst.iter_mut().find(|w| w.place.kind == place.kind) {
                Some(held) if held.place.bound < place.bound => *held = found,
                Some(_) => {}
                None => self.worst.push(found),
            }
        }
        if c.defect.is_none() {
            self.spans += section.table.spans() as u64;
            self.motion_time_s += proof.duration_s;
            self.largest_y = self.largest_y.max(proof.largest_y);
            let [short, long] = proof.span_s;
            self.shortest_span_s = Some(self.shortest_span_s.map_or(short, |s| s.min(short)));
            self.longest_span_s = Some(self.longest_span_s.map_or(long, |s| s.max(long)));
            if self.travel.len() < proof.ranges.len() {
                self.travel.resize(proof.ranges.len(), [f64::INFINITY, f64::NEG_INFINITY]);
            }
            for (whole, part) in self.travel.iter_mut().zip(&proof.ranges) {
                *whole = [whole[0].min(part[0]), whole[1].max(part[1])];
            }
        }
        self.fault_count += proof.faults.len();
        let line = section.marks.blocks.first().map_or(0, |b| b.line);
        let room = KEPT_FAULTS - self.faults.len();
        self.faults.extend(proof.faults.into_iter().take(room).map(|cause| Fault { table, line, cause }));
    }
}

fn prove(section: &PlannedSection, axes: &[FileAxis]) -> TableProof {
    let PlannedSection { kind, limits, table, marks } = section;
    let certificate = certify(table, limits, &marks.caps);
    let mut faults = Vec::new();
    if let Some(defect) = certificate.defect {
        let (ranges, span_s) = (Vec::new(), [0.0; 2]);
        return TableProof {
            faults: vec![FaultCause::Table(defect)],
            certificate,
            ranges,
            duration_s: 0.0,
            span_s,
            largest_y: 0.0,
        };
    }
    if !certificate.holds {
        let broken =
            certificate.worst.iter().filter(|w| w.bound.is_nan() || w.bound > 1.0 + super::CERTIFICATE_RATIO);
        faults.extend(broken.map(|w| FaultCause::Limit { kind: w.kind, ratio: w.bound }));
    }
    if limits.len() != axes.len() {
        faults.push(FaultCause::AxisCount { found: limits.len(), machine: axes.len() });
    }
    for (axis, (stated, machine)) in limits.iter().zip(axes).enumerate() {
        let granted = if *kind == MoveKind::Rapid { &machine.rapid } else { &machine.limits };
        for (kind, stated, granted) in [
            (LimitKind::Velocity, stated.velocity, granted.velocity),
            (LimitKind::Acceleration, stated.acceleration, granted.acceleration),
            (LimitKind::Jerk, stated.jerk, granted.jerk),
        ] {
            if stated.is_nan() || stated > granted * (1.0 + STATED_LIMIT) {
                faults.push(FaultCause::StatedLimit { axis, kind });
            }
        }
    }
    let ranges: Vec<_> = (0..limits.len()).map(|axis| position_bounds(table, axis)).collect();
    for (axis, (&[low, high], machine)) in ranges.iter().zip(axes).enumerate() {
        // The program stays inside; the path may swing out of it by its tolerance, and an end by rounding.
        let room = 1.0 / machine.counts_per_unit + marks.deviation.tolerance_mm * machine.tolerance_scale;
        if low < machine.travel[0] - room || high > machine.travel[1] + room {
            faults.push(FaultCause::Travel { axis, low, high });
        }
    }
    let length = table.path.grid_length();
    let ends = [marks.caps.last().map(|c| c.until), marks.blocks.last().map(|b| b.until)];
    if ends.iter().any(|&end| end != Some(length)) {
        faults.push(FaultCause::Marks);
    }
    let deviation = marks.deviation;
    if deviation.bound_mm.is_nan() || deviation.bound_mm > deviation.tolerance_mm * (1.0 + STATED_LIMIT) {
        let (bound_mm, tolerance_mm) = (deviation.bound_mm, deviation.tolerance_mm);
        faults.push(FaultCause::Deviation { bound_mm, tolerance_mm });
    }
    let (span_s, largest_y) = span_extremes(table);
    if largest_y > TABLE_SERIES_ARGUMENT {
        faults.push(FaultCause::Series { y: largest_y });
    }
    TableProof { certificate, faults, ranges, duration_s: table.duration(), span_s, largest_y }
}

/// Axes that do not start where they stood.
fn jumps<'a>(
    before: &'a PlannedSection,
    after: &'a PlannedSection,
    axes: &'a [FileAxis],
) -> impl Iterator<Item = FaultCause> + 'a {
    let (before, after) = (&before.table.path.axes, &after.table.path.axes);
    before.iter().zip(after).zip(axes).enumerate().filter_map(|(axis, ((a, b), machine))| {
        let (end, start) = (*a.controls.last()?, *b.controls.first()?);
        let same = a.lsb.to_bits() == b.lsb.to_bits();
        let distance = if same {
            (i128::from(start) - i128::from(end)) as f64 * a.lsb
        } else {
            start as f64 * b.lsb - end as f64 * a.lsb
        };
        let counts = distance * machine.counts_per_unit;
        let stands = if same { start == end } else { counts.abs() < 0.5 };
        (!stands).then_some(FaultCause::Jump { axis, counts })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::samples::{axis, back_section, bent_section};
    use crate::job::machine::{AxisKind, AxisLimits};

    fn machine() -> Vec<FileAxis> {
        vec![FileAxis::from(&axis(AxisKind::Linear, bent_section().limits[0])); 2]
    }

    fn job() -> Vec<JobItem> {
        vec![
            JobItem::Section(bent_section()),
            JobItem::Dwell { seconds: 0.5, line: 6 },
            JobItem::Note { text: "back".to_owned(), line: 7 },
            JobItem::Section(back_section()),
        ]
    }

    /// The causes after the second section has been changed.
    fn faults(change: impl Fn(&mut PlannedSection)) -> Vec<FaultCause> {
        let mut items = job();
        let JobItem::Section(section) = &mut items[3] else { panic!() };
        change(section);
        let report = verify(&items, &machine());
        assert_eq!(report.holds, report.faults.is_empty());
        assert!(report.faults.iter().all(|f| f.table == 1 && f.line == 4));
        report.faults.iter().map(|f| f.cause).collect()
    }

    #[test]
    fn a_good_job_holds() {
        let report = verify(&job(), &machine());
        assert!(report.holds, "{report:?}");
        assert_eq!((report.tables, report.spans, report.worst.len()), (2, 16, 4));
        assert!((report.cycle_time_s - report.motion_time_s - 0.5).abs() < 1e-12);
        assert!(report.velocity_ratio > 0.1 && report.velocity_ratio < 0.7);
        assert!(report.travel[0][0] > -1e-2 && report.travel[0][1] < 9.31);
        assert!(verify(&[], &machine()).holds);
    }

    #[test]
    fn each_fault_is_named() {
        let tight = AxisLimits { velocity: 1.0, acceleration: 500.0, jerk: 50_000.0 };
        let broken = faults(|s| s.limits = vec![tight; 2]);
        assert!(
            matches!(broken[..], [FaultCause::Limit { kind: LimitKind::Velocity, ratio }] if ratio > 5.0)
        );
        assert_eq!(
            faults(|s| s.limits[1].jerk = f64::INFINITY),
            [FaultCause::StatedLimit { axis: 1, kind: LimitKind::Jerk }]
        );
        let moved = faults(|s| s.table.path.axes[0].controls.iter_mut().for_each(|c| *c += 1));
        assert!(matches!(moved[..], [FaultCause::Jump { axis: 0, counts }] if (counts - 1.0).abs() < 1e-9));
        let out = faults(|s| s.table.path.axes[1].controls[3] = 20_000);
        assert!(out.iter().any(|f| matches!(f, FaultCause::Travel { axis: 1, .. })), "{out:?}");
        assert_eq!(faults(|s| s.marks.blocks[1].until = 639), [FaultCause::Marks]);
        assert!(matches!(faults(|s| s.marks.deviation.bound_mm = 0.02)[..], [FaultCause::Deviation { .. }]));
        let dead = faults(|s| s.table.codes[1] = 0);
        assert_eq!(dead, [FaultCause::Table(TableDefect::StandsStill { code: 1 })]);
        let bent = faults(|s| s.table.codes[2] = 60_000);
        assert!(bent.iter().any(|f| matches!(f, FaultCause::Series { .. })), "{bent:?}");
    }

    #[test]
    fn a_machine_with_other_axes_is_refused() {
        let report = verify(&job(), &machine()[..1]);
        assert!(matches!(report.faults[0].cause, FaultCause::AxisCount { found: 2, machine: 1 }));
    }
}

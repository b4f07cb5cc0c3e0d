//! Everything that has to hold of a planned program, whatever the program is.

use std::fmt;

use planner::certificate::verify::verify;
use planner::feed::file::{FeedReader, FeedWriter, FileHeader};
use planner::feed::job::JobItem;
use planner::feed::pack::{TableBytes, pack};
use planner::job::machine::Machine;
use planner::tolerances::CERTIFICATE_RATIO;

use crate::chain::Chain;
use crate::oracle::dense::{Ratios, largest_ratios};
use crate::oracle::deviation::{Deviation, measure};

/// Samples may exceed a proven bound by this share: the rounding of the oracle's own arithmetic.
const ORACLE: f64 = 1e-9;

/// What a sound plan measures.
#[derive(Clone, Copy, Debug, Default)]
pub struct Figures {
    /// Largest proven ratios.
    pub proven: Ratios,
    /// Largest sampled ratios.
    pub sampled: Ratios,
    /// Distance between path and contour.
    pub deviation: Deviation,
    /// Sizes of all tables.
    pub bytes: TableBytes,
    /// Fingerprint of the set-points; this and what follows are zero where nothing was simulated.
    pub setpoint_hash: u64,
    /// Largest distance of a set-point from the plan [counts].
    pub setpoint_deviation_counts: f64,
    /// Motion and waits, as simulated [s].
    pub cycle_time_s: f64,
}

/// What does not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// One word that tells findings apart.
    pub kind: &'static str,
    /// The whole story.
    pub text: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.kind, self.text)
    }
}

fn found<T>(kind: &'static str, text: impl Into<String>) -> Result<T, Finding> {
    Err(Finding { kind, text: text.into() })
}

fn largest(a: Ratios, b: Ratios) -> Ratios {
    Ratios {
        velocity: a.velocity.max(b.velocity),
        acceleration: a.acceleration.max(b.acceleration),
        jerk: a.jerk.max(b.jerk),
        feed: a.feed.max(b.feed),
    }
}

/// Judges a plan: the proof, `per_span` samples of every span against it, the path, the file, and, unless the motion
/// takes longer than `longest_s`, the simulated drives.
///
/// # Errors
/// The first thing that does not hold.
pub fn judge(chain: &Chain, machine: &Machine, per_span: usize, longest_s: f64) -> Result<Figures, Finding> {
    let mut figures = Figures::default();
    let header = FileHeader::from(machine);
    for (k, (section, proof)) in chain.plan.sections().zip(&chain.plan.certificates).enumerate() {
        let proven = Ratios {
            velocity: proof.velocity_ratio,
            acceleration: proof.acceleration_ratio,
            jerk: proof.jerk_ratio,
            feed: proof.feed_ratio,
        };
        let line = section.marks.blocks.first().map_or(0, |b| b.line);
        let sampled = largest_ratios(&section.table, &section.limits, &section.marks.caps, per_span);
        let pairs = [
            (proven.velocity, sampled.velocity),
            (proven.acceleration, sampled.acceleration),
            (proven.jerk, sampled.jerk),
            (proven.feed, sampled.feed),
        ];
        if !proof.holds || pairs.iter().any(|p| p.0.is_nan() || p.0 > 1.0 + CERTIFICATE_RATIO) {
            return found("certificate", format!("section {k}, line {line}: {proof:?}"));
        }
        if pairs.iter().any(|p| p.1.is_nan() || p.1 > p.0 * (1.0 + ORACLE) || p.1 > 1.0 + CERTIFICATE_RATIO) {
            return found("samples", format!("section {k}, line {line}: {sampled:?} above {proven:?}"));
        }
        (figures.proven, figures.sampled) =
            (largest(figures.proven, proven), largest(figures.sampled, sampled));
        match pack(&section.table, k as u32, &header.target(&section.limits)) {
            Ok(packed) => figures.bytes += packed.bytes(),
            Err(e) => return found("pack", format!("section {k}, line {line}: {e}")),
        }
    }
    let sections = chain.plan.sections().count();
    if sections != chain.plan.certificates.len() {
        return found("certificate", format!("{} for {sections} sections", chain.plan.certificates.len()));
    }
    figures.deviation = match measure(&chain.items, &chain.plan.items, machine, 12) {
        Ok(deviation) if deviation.share() <= 1.0 + 1e-6 => deviation,
        Ok(deviation) => return found("deviation", format!("{deviation:?}")),
        Err(mismatch) => return found("contour", format!("{mismatch:?}")),
    };
    file(chain, &header)?;
    if chain.motion_time_s() > longest_s {
        return Ok(figures);
    }
    let report = match chain.simulate(machine) {
        Ok(report) => report,
        Err(e) => return found("drives", e.to_string()),
    };
    let ends: Vec<i64> = report.axes.iter().map(|a| a.end_counts).collect();
    if sections > 0 && !(report.at_end && chain.ends_at(&ends, machine)) {
        return found("end", format!("{ends:?}, at rest: {}", report.at_end));
    }
    if report.max_path_deviation_counts.is_nan() || report.max_path_deviation_counts > 1.0 {
        return found(
            "setpoints",
            format!(
                "{} counts from the plan in {} s of motion",
                report.max_path_deviation_counts, report.motion_s
            ),
        );
    }
    let errors = report.axes.iter().map(|a| a.max_following_error);
    if !errors.chain([report.max_following_error_mm, report.cycle_time_s]).all(f64::is_finite) {
        return found("servo", "a following error is not finite");
    }
    figures.setpoint_hash = report.setpoint_hash;
    figures.setpoint_deviation_counts = report.max_path_deviation_counts;
    figures.cycle_time_s = report.cycle_time_s;
    Ok(figures)
}

/// The file holds the same job, and proves it.
fn file(chain: &Chain, header: &FileHeader) -> Result<(), Finding> {
    let unwritten = |e| Finding { kind: "file", text: format!("cannot be written: {e}") };
    let mut writer = FeedWriter::new(Vec::new(), header).map_err(unwritten)?;
    for item in &chain.plan.items {
        writer.push(item).map_err(unwritten)?;
    }
    let (bytes, _) = writer.finish().map_err(unwritten)?;
    let unread = |e| Finding { kind: "file", text: format!("cannot be read: {e}") };
    let read = FeedReader::new(bytes.as_slice()).map_err(unread)?.read_all().map_err(unread)?;
    if read.items != chain.plan.items || read.header != *header {
        return found("file", "what is read is not what was written");
    }
    let mut axes = read.header.axes.clone();
    let free =
        |i: &JobItem| matches!(i, JobItem::Section(s) if s.limits.iter().any(|l| l.jerk.is_infinite()));
    if read.items.iter().any(free) {
        for axis in &mut axes {
            (axis.limits.jerk, axis.rapid.jerk) = (f64::INFINITY, f64::INFINITY);
        }
    }
    let report = verify(&read.items, &axes);
    if report.holds { Ok(()) } else { found("verify", format!("{:?}", report.faults)) }
}

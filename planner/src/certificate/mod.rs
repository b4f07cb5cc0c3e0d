//! Proves a rounded feed table against its limits at every instant, with Bernstein coefficients.
//!
//! The statement is about the exact motion that the table's integers stand for, at every instant and not at
//! samples: on each span the ratios are polynomials (`spans`), their coefficients bound them, spans whose bound
//! says too little are halved, and the rounding of the arithmetic is added outwards. What it does not cover is
//! the drives' own f32 arithmetic: about 2e-6 of the limit in acceleration and 4e-5 in jerk, which the margin
//! of their self-check takes in.

use rayon::prelude::*;
use serde::Serialize;

use crate::feed::table::FeedTable;
use crate::geometry::section::FeedCap;
use crate::job::machine::AxisLimits;
use crate::tolerances::CERTIFICATE_RATIO;

mod bernstein;
mod defect;
mod hodograph;
mod spans;
mod travel;
pub mod verify;

pub use defect::TableDefect;
pub use travel::position_bounds;

use bernstein::{Locus, Peak};
use hodograph::{Hodograph, Rate};
use spans::{AxisPeaks, CapPart, Peaks, Rest};

/// Spans that one task bounds. Fixed, so that the outcome does not depend on the number of threads.
const CHUNK: usize = 512;

/// What is proven of a table. Ratios are value / limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Certificate {
    /// No axis ever exceeds this share of its velocity limit.
    pub velocity_ratio: f64,
    /// No axis ever exceeds this share of its acceleration limit.
    pub acceleration_ratio: f64,
    /// No axis ever exceeds this share of its jerk limit; 0 where jerk is not limited.
    pub jerk_ratio: f64,
    /// The path speed never exceeds this share of its cap; 0 without a cap.
    pub feed_ratio: f64,
    /// The table is a motion from rest to rest and every ratio is at most 1 + [`CERTIFICATE_RATIO`].
    pub holds: bool,
    /// The same ratios of each axis.
    pub axes: Vec<AxisRatios>,
    /// Where each kind comes nearest its limit; kinds that nothing limits are missing.
    pub worst: Vec<Worst>,
    /// Why the table is not a motion at all; every ratio is then infinite.
    pub defect: Option<TableDefect>,
}

/// What is proven of one axis. Ratios are value / limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct AxisRatios {
    /// Largest |velocity| / limit.
    pub velocity: f64,
    /// Largest |acceleration| / limit.
    pub acceleration: f64,
    /// Largest |jerk| / limit; 0 where jerk is not limited.
    pub jerk: f64,
}

impl AxisRatios {
    fn of(peaks: &AxisPeaks) -> Self {
        let AxisPeaks { velocity, acceleration, jerk } = peaks;
        Self { velocity: velocity.bound, acceleration: acceleration.bound, jerk: jerk.bound }
    }

    /// The larger of each.
    pub fn max(self, other: Self) -> Self {
        Self {
            velocity: self.velocity.max(other.velocity),
            acceleration: self.acceleration.max(other.acceleration),
            jerk: self.jerk.max(other.jerk),
        }
    }
}

/// The place at which one kind of limit is nearest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Worst {
    /// The limit.
    pub kind: LimitKind,
    /// The axis; for a tangential feed cap the mask of its axes.
    pub axis: u16,
    /// Span of the table.
    pub span: usize,
    /// Place on the path in u.
    pub u: f64,
    /// Proven bound of the ratio over the whole table.
    pub bound: f64,
    /// A ratio that is surely attained somewhere in the table.
    pub attained: f64,
}

/// The kinds of limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitKind {
    /// Velocity of an axis.
    Velocity,
    /// Acceleration of an axis.
    Acceleration,
    /// Jerk of an axis.
    Jerk,
    /// Speed along the path.
    Feed,
}

/// Proves a table against the limits of its axes and the caps on its path speed.
///
/// Caps are consecutive and cut spans where they must; beyond the last one the path speed is free.
pub fn certify(table: &FeedTable, limits: &[AxisLimits], caps: &[FeedCap]) -> Certificate {
    let checked = match defect::check(table) {
        Ok(()) if limits.len() != table.path.axes.len() => Err(TableDefect::LimitCount),
        Ok(()) if caps.windows(2).any(|w| w[0].until >= w[1].until) => Err(TableDefect::CapOrder),
        checked => checked,
    };
    if let Err(defect) = checked {
        let [velocity_ratio, acceleration_ratio, jerk_ratio, feed_ratio] = [f64::INFINITY; 4];
        let (holds, axes, worst, defect) = (false, Vec::new(), Vec::new(), Some(defect));
        return Certificate {
            velocity_ratio,
            acceleration_ratio,
            jerk_ratio,
            feed_ratio,
            holds,
            axes,
            worst,
            defect,
        };
    }
    let mut starts = Vec::with_capacity(table.spans().div_ceil(CHUNK));
    let mut start = 0;
    for steps in table.steps.chunks(CHUNK) {
        starts.push(start);
        start += steps.iter().map(|&s| u64::from(s)).sum::<u64>();
    }
    let chunk = |(k, &start): (usize, &u64)| bound_chunk(table, limits, caps, k * CHUNK, start);
    let parts: Vec<Peaks> = if starts.len() > 1 {
        starts.par_iter().enumerate().map(chunk).collect()
    } else {
        starts.iter().enumerate().map(chunk).collect()
    };
    conclude(table, parts.into_iter().fold(Peaks::NONE, Peaks::merge))
}

/// Bounds up to [`CHUNK`] spans from span `first` on, which starts at grid place `start`.
fn bound_chunk(
    table: &FeedTable,
    limits: &[AxisLimits],
    caps: &[FeedCap],
    first: usize,
    start: u64,
) -> Peaks {
    let (path, n) = (&table.path, table.spans());
    let mut peaks = Peaks::NONE;
    let mut geometry = path.breaks.partition_point(|&b| b <= start) - 1;
    let hodographs = |g: usize| (0..path.axes.len()).map(|a| Hodograph::of(path, a, g)).collect::<Vec<_>>();
    let mut whole = hodographs(geometry);
    let mut parts = whole.clone();
    let mut caps = caps.get(caps.partition_point(|c| c.until <= start)..).unwrap_or(&[]);
    let mut place = start;
    for (i, &step) in table.steps.iter().enumerate().skip(first).take(CHUNK) {
        let end = place + u64::from(step);
        while path.breaks[geometry + 1] <= place {
            geometry += 1;
            whole = hodographs(geometry);
        }
        let (from, width) = (path.breaks[geometry], path.breaks[geometry + 1] - path.breaks[geometry]);
        let share = |place: u64| (place - from) as f64 / width as f64;
        let lands = i == n - 1;
        for (part, p) in parts.iter_mut().zip(&whole) {
            *part = p.part(share(place), share(end));
            if lands {
                *part = part.reversed();
            }
        }
        let at = |axis: usize| Locus { axis: axis as u16, span: i, from: 0.0, to: 1.0 };
        if i == 0 || lands {
            let q = table.value(table.codes[if lands { n - 3 } else { 0 }]);
            let rest = Rest { h: table.step_length(i), q };
            for (axis, p) in parts.iter().enumerate() {
                rest.axis(&mut peaks.axes[axis], p, &limits[axis], at(axis));
            }
            for cap in cap_parts(caps, place, end, lands) {
                rest.cap(&mut peaks.feed, &parts, cap, at(0));
            }
        } else {
            let rate = Rate::of(table, i);
            for (axis, p) in parts.iter().enumerate() {
                spans::inner_axis(&mut peaks.axes[axis], p, &rate, &limits[axis], at(axis));
            }
            for cap in cap_parts(caps, place, end, false) {
                spans::inner_cap(&mut peaks.feed, &parts, &rate, cap, at(0));
            }
        }
        while caps.first().is_some_and(|c| c.until <= end) {
            caps = &caps[1..];
        }
        place = end;
    }
    peaks
}

/// The parts of a span under one cap each, as shares of its length from its start or, mirrored, from its end.
fn cap_parts(caps: &[FeedCap], start: u64, end: u64, mirrored: bool) -> impl Iterator<Item = CapPart> {
    let share = move |a: u64, b: u64| (b - a) as f64 / (end - start) as f64;
    let mut place = start;
    caps.iter().map_while(move |cap| {
        let (from, to) = (place, cap.until.min(end));
        place = to;
        let (from, to) = if mirrored {
            (share(to, end), share(from, end))
        } else {
            (share(start, from), share(start, to))
        };
        (from < to).then_some(CapPart { from, to, speed: cap.speed })
    })
}

/// Turns peaks into a certificate.
fn conclude(table: &FeedTable, peaks: Peaks) -> Certificate {
    let axes = &peaks.axes[..table.path.axes.len()];
    let all = axes.iter().skip(1).fold(axes[0], |all, axis| all.merge(*axis));
    let kinds = [
        (LimitKind::Velocity, all.velocity),
        (LimitKind::Acceleration, all.acceleration),
        (LimitKind::Jerk, all.jerk),
        (LimitKind::Feed, peaks.feed),
    ];
    let worst = kinds.iter().filter_map(|&(kind, peak)| {
        let Peak { bound, attained, at: Some(at) } = peak else { return None };
        Some(Worst { kind, axis: at.axis, span: at.span, u: place_of(table, at), bound, attained })
    });
    let [velocity_ratio, acceleration_ratio, jerk_ratio, feed_ratio] = kinds.map(|(_, p)| p.bound);
    Certificate {
        velocity_ratio,
        acceleration_ratio,
        jerk_ratio,
        feed_ratio,
        holds: kinds.iter().all(|(_, p)| p.bound <= 1.0 + CERTIFICATE_RATIO),
        axes: axes.iter().map(AxisRatios::of).collect(),
        worst: worst.collect(),
        defect: None,
    }
}

/// Place in u of the middle of an interval.
fn place_of(table: &FeedTable, at: Locus) -> f64 {
    let before: u64 = table.steps[..at.span].iter().map(|&s| u64::from(s)).sum();
    let middle = 0.5 * (at.from + at.to);
    let share = match at.span {
        0 => middle.powi(3),
        i if i == table.spans() - 1 => 1.0 - middle.powi(3),
        _ => middle,
    };
    before as f64 * table.path.step + share * table.step_length(at.span)
}

#[cfg(test)]
mod tests;

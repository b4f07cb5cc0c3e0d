//! Where the programmed feed is not reached, what stands in its way, and what that costs.

use std::collections::BTreeMap;

use serde::Serialize;

use super::binding::name;
use super::cells::{Cell, nearest_limit, visit};
use crate::feed::job::PlannedSection;
use crate::geometry::section::SpeedCap;
use crate::job::program::MoveKind;
use crate::tolerances::FEED_REACHED;
use crate::topp::problem::Binding;

/// Cells that a span is cut into.
const PER_SPAN: usize = 3;

/// A stretch on which the programmed feed is not reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shortfall {
    /// Index of the section, in the order they were added.
    pub section: usize,
    /// First program line.
    pub first_line: u32,
    /// Last program line.
    pub last_line: u32,
    /// Start of the stretch on the section's path [u, mm on linear axes].
    pub from: f64,
    /// Its end.
    pub to: f64,
    /// The programmed feed [axis units/s, or u/s for inverse-time feeds].
    pub programmed: f64,
    /// Lowest speed on the stretch.
    pub lowest: f64,
    /// Mean speed over the length of the stretch.
    pub mean: f64,
    /// Limit that is nearest for the longest time: velocity, acceleration, jerk or rest.
    pub limited_by: &'static str,
    /// Its axis.
    pub axis: Option<u8>,
    /// Time spent on the stretch [s].
    pub seconds: f64,
    /// Time lost against the programmed feed [s].
    pub lost_s: f64,
}

/// Collects the stretches that cost most.
#[derive(Clone, Debug)]
pub struct Shortfalls {
    keep: usize,
    sections: usize,
    worst: Vec<Shortfall>,
    /// Number of stretches seen, kept or not.
    pub count: u64,
    /// Time lost in all of them [s].
    pub lost_s: f64,
    /// Time under a programmed feed [s].
    pub feed_s: f64,
    /// Part of it at the programmed feed [s].
    pub at_feed_s: f64,
}

/// A stretch that still grows.
struct Open {
    cap: SpeedCap,
    stretch: Shortfall,
    covered: f64,
    limits: BTreeMap<Binding, f64>,
}

impl Shortfalls {
    /// Keeps the `keep` stretches that lose most time.
    pub fn new(keep: usize) -> Self {
        Self { keep, sections: 0, worst: Vec::new(), count: 0, lost_s: 0.0, feed_s: 0.0, at_feed_s: 0.0 }
    }

    /// Adds the next section of the job; rapids only count as a section.
    pub fn add(&mut self, section: &PlannedSection) {
        let index = self.sections;
        self.sections += 1;
        if section.kind == MoveKind::Rapid {
            return;
        }
        let mut open: Option<Open> = None;
        visit(section, PER_SPAN, |cell| {
            let Some((programmed, ratio)) = programmed(cell) else {
                self.close(open.take());
                return;
            };
            self.feed_s += cell.seconds;
            if ratio >= FEED_REACHED {
                self.at_feed_s += cell.seconds;
                self.close(open.take());
                return;
            }
            if open.as_ref().is_some_and(|o| o.cap != cell.cap) {
                self.close(open.take());
            }
            let fresh = || Open::new(index, cell, programmed);
            open.get_or_insert_with(fresh).extend(section, cell, ratio);
        });
        self.close(open);
    }

    fn close(&mut self, open: Option<Open>) {
        let Some(open) = open else { return };
        let stretch = open.finish();
        self.count += 1;
        self.lost_s += stretch.lost_s;
        self.worst.push(stretch);
        if self.worst.len() >= 2 * self.keep.max(32) {
            self.prune();
        }
    }

    fn prune(&mut self) {
        self.worst.sort_by(|a, b| b.lost_s.total_cmp(&a.lost_s));
        self.worst.truncate(self.keep);
    }

    /// The stretches that lose most time, the worst first.
    pub fn worst(mut self) -> Vec<Shortfall> {
        self.prune();
        self.worst
    }
}

/// The programmed feed at a cell and the share of it that is reached.
fn programmed(cell: &Cell<'_>) -> Option<(f64, f64)> {
    let (SpeedCap::Rate(speed) | SpeedCap::Tangential { speed, .. }) = cell.cap else { return None };
    Some((speed, cell.feed_ratio()?))
}

impl Open {
    fn new(section: usize, cell: &Cell<'_>, programmed: f64) -> Self {
        let stretch = Shortfall {
            section,
            first_line: cell.line,
            last_line: cell.line,
            from: cell.range[0],
            to: cell.range[1],
            programmed,
            lowest: f64::INFINITY,
            mean: 0.0,
            limited_by: "free",
            axis: None,
            seconds: 0.0,
            lost_s: 0.0,
        };
        Self { cap: cell.cap, stretch, covered: 0.0, limits: BTreeMap::new() }
    }

    fn extend(&mut self, section: &PlannedSection, cell: &Cell<'_>, ratio: f64) {
        let s = &mut self.stretch;
        s.to = cell.range[1];
        s.last_line = cell.line;
        s.seconds += cell.seconds;
        s.lowest = if cell.rests { 0.0 } else { s.lowest.min(ratio * s.programmed) };
        let covered = mean_ratio(cell, ratio) * cell.seconds;
        self.covered += covered;
        s.lost_s += cell.seconds - covered;
        let binding = if cell.rests { Binding::Rest } else { nearest_limit(cell.axes, &section.limits).0 };
        *self.limits.entry(binding).or_insert(0.0) += cell.seconds;
    }

    fn finish(self) -> Shortfall {
        let Self { stretch, covered, limits, .. } = self;
        let longest = limits.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let (limited_by, axis) = longest.map_or(("free", None), |(binding, _)| name(binding));
        let mean = if stretch.seconds > 0.0 { stretch.programmed * covered / stretch.seconds } else { 0.0 };
        Shortfall { mean, limited_by, axis, ..stretch }
    }
}

/// Mean over time of the feed ratio on a cell: its length / time against du/dt in the middle.
fn mean_ratio(cell: &Cell<'_>, ratio: f64) -> f64 {
    if cell.seconds > 0.0 && cell.path.speed > 0.0 {
        ratio * (cell.range[1] - cell.range[0]) / (cell.seconds * cell.path.speed)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::samples::{back_section, bent_section};
    use crate::geometry::section::FeedCap;

    fn capped(rate: f64) -> PlannedSection {
        let mut section = bent_section();
        section.marks.caps[0].speed = SpeedCap::Rate(rate);
        section
    }

    #[test]
    fn a_feed_that_is_never_reached_is_one_stretch() {
        let section = capped(25.0);
        let mut found = Shortfalls::new(10);
        found.add(&section);
        let duration = section.table.duration();
        assert_eq!((found.count, found.at_feed_s), (1, 0.0));
        assert!((found.feed_s / duration - 1.0).abs() < 1e-9);
        let worst = found.worst();
        let s = &worst[0];
        assert_eq!((s.first_line, s.last_line, s.from, s.to), (4, 5, 0.0, 10.0));
        assert!((s.lost_s / (duration - 10.0 / 25.0) - 1.0).abs() < 1e-9, "{s:?}");
        assert!((s.mean / (10.0 / duration) - 1.0).abs() < 1e-9, "{s:?}");
        assert_eq!((s.lowest, s.programmed), (0.0, 25.0));
    }

    #[test]
    fn only_the_slow_ends_count_when_the_middle_is_fast_enough() {
        let mut found = Shortfalls::new(1);
        found.add(&capped(5.0));
        assert_eq!(found.count, 2);
        assert!(found.at_feed_s > 0.0 && found.at_feed_s < found.feed_s);
        let lost = found.lost_s;
        let worst = found.worst();
        assert_eq!(worst.len(), 1);
        let s = &worst[0];
        assert!(s.lost_s >= 0.5 * lost && s.lost_s < lost);
        assert!((s.from == 0.0) != (s.to == 10.0), "{s:?}");
        assert_eq!((s.limited_by, s.axis), ("rest", None));
    }

    #[test]
    fn a_new_feed_starts_a_new_stretch_and_rapids_count_none() {
        let mut section = capped(30.0);
        section.marks.caps.insert(0, FeedCap { until: 325, speed: SpeedCap::Rate(25.0) });
        let mut rapid = back_section();
        rapid.kind = MoveKind::Rapid;
        let mut found = Shortfalls::new(10);
        found.add(&rapid);
        found.add(&section);
        let worst = found.worst();
        assert_eq!(worst.len(), 2);
        assert!(worst.iter().all(|s| s.section == 1));
        let cut = 325.0 / 64.0;
        assert!(worst.iter().any(|s| s.to == cut) && worst.iter().any(|s| s.from == cut));
    }
}

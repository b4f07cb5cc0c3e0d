//! Where the programmed feed is not reached, what stands in its way, and what that costs.

use std::collections::BTreeMap;

use super::cells::{Cell, nearest_limit, visit};
use crate::feed::job::PlannedSection;
use crate::feed::table::FeedTable;
use crate::geometry::section::SpeedCap;
use crate::job::machine::{MAX_AXES, Point};
use crate::job::program::MoveKind;
use crate::tolerances::FEED_REACHED;
use crate::topp::problem::Binding;

/// Cells that a span is cut into.
const PER_SPAN: usize = 3;

/// A stretch on which the programmed feed is not reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shortfall {
    /// First program line.
    pub first_line: u32,
    /// Last program line.
    pub last_line: u32,
    /// Start of the stretch, from the start of the job [s].
    pub start_s: f64,
    /// Its length on the path [u, mm on linear axes].
    pub length: f64,
    /// The programmed feed [axis units/s, or u/s for inverse-time feeds].
    pub programmed: f64,
    /// Lowest speed on the stretch.
    pub lowest: f64,
    /// Mean speed over the length of the stretch.
    pub mean: f64,
    /// When it is slowest, from the start of the job [s].
    pub slowest_s: f64,
    /// Position of the axes there [axis units].
    pub slowest_at: Point,
    /// Limit that is nearest for the longest time.
    pub limit: Binding,
    /// Time spent on the stretch [s].
    pub seconds: f64,
    /// Time lost against the programmed feed [s].
    pub lost_s: f64,
}

/// Collects the stretches that cost most.
#[derive(Clone, Debug)]
pub struct Shortfalls {
    keep: usize,
    /// Start of the next section, from the start of the job [s].
    clock_s: f64,
    worst: Vec<Shortfall>,
    /// Number of stretches seen, kept or not.
    pub count: u64,
    /// Time lost in all of them [s].
    pub lost_s: f64,
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
        Self { keep, clock_s: 0.0, worst: Vec::new(), count: 0, lost_s: 0.0 }
    }

    /// Lets the job wait [s].
    pub fn wait(&mut self, seconds: f64) {
        self.clock_s += seconds;
    }

    /// Adds the next section of the job; rapids fall short of nothing.
    pub fn add(&mut self, section: &PlannedSection) {
        if section.kind == MoveKind::Feed {
            self.search(section);
        }
        self.clock_s += section.table.duration();
    }

    fn search(&mut self, section: &PlannedSection) {
        let clock_s = self.clock_s;
        let mut open: Option<Open> = None;
        visit(section, PER_SPAN, |cell| {
            let short = programmed(cell).filter(|&(_, ratio)| ratio < FEED_REACHED);
            if short.is_none() || open.as_ref().is_some_and(|o| o.cap != cell.cap) {
                self.close(open.take());
            }
            if let Some((programmed, ratio)) = short {
                let fresh = || Open::new(clock_s, cell, programmed);
                open.get_or_insert_with(fresh).extend(section, clock_s, cell, ratio);
            }
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
    fn new(clock_s: f64, cell: &Cell<'_>, programmed: f64) -> Self {
        let stretch = Shortfall {
            first_line: cell.line,
            last_line: cell.line,
            start_s: clock_s + cell.start_s,
            length: 0.0,
            programmed,
            lowest: f64::INFINITY,
            mean: 0.0,
            slowest_s: 0.0,
            slowest_at: [0.0; MAX_AXES],
            limit: Binding::Free,
            seconds: 0.0,
            lost_s: 0.0,
        };
        Self { cap: cell.cap, stretch, covered: 0.0, limits: BTreeMap::new() }
    }

    fn extend(&mut self, section: &PlannedSection, clock_s: f64, cell: &Cell<'_>, ratio: f64) {
        let s = &mut self.stretch;
        s.length += cell.range[1] - cell.range[0];
        s.last_line = cell.line;
        s.seconds += cell.seconds;
        let covered = mean_ratio(cell, ratio) * cell.seconds;
        self.covered += covered;
        s.lost_s += cell.seconds - covered;
        let lowest = if cell.rests { 0.0 } else { ratio * s.programmed };
        if lowest < s.lowest {
            s.lowest = lowest;
            (s.slowest_s, s.slowest_at) = slowest(&section.table, cell);
            s.slowest_s += clock_s;
        }
        let binding = if cell.rests { Binding::Rest } else { nearest_limit(cell.axes, &section.limits).0 };
        *self.limits.entry(binding).or_insert(0.0) += cell.seconds;
    }

    fn finish(self) -> Shortfall {
        let Self { stretch, covered, limits, .. } = self;
        let longest = limits.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let limit = longest.map_or(Binding::Free, |(binding, _)| binding);
        let mean = if stretch.seconds > 0.0 { stretch.programmed * covered / stretch.seconds } else { 0.0 };
        Shortfall { mean, limit, ..stretch }
    }
}

/// Time in the section and place of a cell's middle; in a rest span, of the rest.
fn slowest(table: &FeedTable, cell: &Cell<'_>) -> (f64, Point) {
    let mut at = [0.0; MAX_AXES];
    let axes = at.iter_mut().zip(cell.axes).zip(&table.path.axes);
    if !cell.rests {
        axes.for_each(|((slot, axis), _)| *slot = axis.position);
        return (cell.start_s + 0.5 * cell.seconds, at);
    }
    let starts = cell.span == 0;
    for ((slot, _), axis) in axes {
        let control = if starts { axis.controls.first() } else { axis.controls.last() };
        *slot = control.map_or(0.0, |&c| c as f64 * axis.lsb);
    }
    (if starts { 0.0 } else { table.duration() }, at)
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
        found.wait(3.0);
        found.add(&section);
        let duration = section.table.duration();
        assert_eq!(found.count, 1);
        let worst = found.worst();
        let s = &worst[0];
        assert_eq!((s.first_line, s.last_line, s.start_s), (4, 5, 3.0));
        assert!((s.length - 10.0).abs() < 1e-9 && (s.seconds / duration - 1.0).abs() < 1e-9, "{s:?}");
        assert!((s.lost_s / (duration - 10.0 / 25.0) - 1.0).abs() < 1e-9, "{s:?}");
        assert!((s.mean / (10.0 / duration) - 1.0).abs() < 1e-9, "{s:?}");
        assert_eq!((s.lowest, s.programmed), (0.0, 25.0));
        assert_eq!((s.slowest_s, s.slowest_at), (3.0, [0.0; MAX_AXES]));
    }

    #[test]
    fn only_the_slow_ends_count_when_the_middle_is_fast_enough() {
        let section = capped(5.0);
        let mut found = Shortfalls::new(2);
        found.add(&section);
        assert_eq!(found.count, 2);
        let (lost, duration) = (found.lost_s, section.table.duration());
        let mut ends = found.worst();
        assert!((ends.iter().map(|s| s.lost_s).sum::<f64>() - lost).abs() < 1e-12);
        assert!(ends[0].lost_s >= ends[1].lost_s);
        assert!(ends.iter().all(|s| s.limit == Binding::Rest && s.length < 3.0), "{ends:?}");
        ends.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        assert_eq!((ends[0].start_s, ends[0].slowest_s), (0.0, 0.0));
        assert!((ends[1].start_s + ends[1].seconds - duration).abs() < 1e-9);
        assert!((ends[1].slowest_s - duration).abs() < 1e-12);
        assert!((ends[1].slowest_at[0] - 9.3).abs() < 1e-12 && (ends[1].slowest_at[1] - 6.4).abs() < 1e-12);
        let mut one = Shortfalls::new(1);
        one.add(&section);
        assert_eq!((one.count, one.worst().len()), (2, 1));
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
        let mut stretches: Vec<(f64, f64)> = worst.iter().map(|s| (s.programmed, s.length)).collect();
        stretches.sort_by(|a, b| a.0.total_cmp(&b.0));
        let cut = 325.0 / 64.0;
        let near = |a: (f64, f64), b: (f64, f64)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-9;
        assert!(near(stretches[0], (25.0, cut)) && near(stretches[1], (30.0, 10.0 - cut)), "{stretches:?}");
        assert!(worst.iter().all(|s| s.start_s >= rapid.table.duration()));
    }
}

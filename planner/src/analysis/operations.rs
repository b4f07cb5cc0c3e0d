//! Time per operation of the program: what happens between one remark and the next.

use serde::Serialize;

use super::cells::visit;
use crate::feed::job::{JobItem, PlannedSection};
use crate::job::program::MoveKind;

/// What passes between two remarks.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Operation {
    /// Text of the remark that starts it; empty before the first one.
    pub name: String,
    /// Line of the remark, 0 before the first one.
    pub line: u32,
    /// Time in feed moves [s].
    pub feed_s: f64,
    /// Time in rapids [s].
    pub rapid_s: f64,
    /// Time in waits [s].
    pub dwell_s: f64,
    /// Length of the path of feed moves [mm; axis units where only rotary axes move].
    pub feed_length_mm: f64,
    /// Length of the path of rapids, likewise.
    pub rapid_length_mm: f64,
}

impl Operation {
    /// All of its time [s].
    pub fn seconds(&self) -> f64 {
        self.feed_s + self.rapid_s + self.dwell_s
    }

    fn travel(&mut self, kind: MoveKind, seconds: f64, length: f64) {
        let (time, way) = match kind {
            MoveKind::Feed => (&mut self.feed_s, &mut self.feed_length_mm),
            MoveKind::Rapid => (&mut self.rapid_s, &mut self.rapid_length_mm),
        };
        *time += seconds;
        *way += length;
    }
}

/// Splits a job at its remarks; remarks without motion or wait after them are dropped.
///
/// A job hands on the remarks inside a section before it: there the program lines tell where each begins.
pub fn operations<'a>(items: impl IntoIterator<Item = &'a JobItem>) -> Vec<Operation> {
    let mut all = vec![Operation::default()];
    let mut open = 0;
    for item in items {
        match item {
            JobItem::Note { text, line } => {
                all.push(Operation { name: text.clone(), line: *line, ..Operation::default() });
            }
            JobItem::Dwell { seconds, line } => {
                reach(*line, &all, &mut open);
                all[open].dwell_s += seconds;
            }
            JobItem::Section(section) => split(section, &mut all, &mut open),
        }
    }
    all.retain(|o| o.seconds() > 0.0);
    all
}

/// Opens the last of the operations that have begun when the program is at `line`.
fn reach(line: u32, all: &[Operation], open: &mut usize) {
    while all.get(*open + 1).is_some_and(|next| next.line <= line) {
        *open += 1;
    }
}

/// Books a section on the operations that its lines belong to.
fn split(section: &PlannedSection, all: &mut [Operation], open: &mut usize) {
    let last = section.marks.blocks.last().map_or(0, |b| b.line);
    reach(section.marks.blocks.first().map_or(0, |b| b.line), all, open);
    if all.get(*open + 1).is_none_or(|next| next.line > last) {
        all[*open].travel(section.kind, section.table.duration(), section.table.path.length());
        return;
    }
    visit(section, 1, |cell| {
        reach(cell.line, all, open);
        all[*open].travel(section.kind, cell.seconds, cell.range[1] - cell.range[0]);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::cells::visit;
    use crate::analysis::samples::{back_section, bent_section};

    fn note(text: &str, line: u32) -> JobItem {
        JobItem::Note { text: text.to_owned(), line }
    }

    fn names(found: &[Operation]) -> Vec<(&str, u32)> {
        found.iter().map(|o| (o.name.as_str(), o.line)).collect()
    }

    #[test]
    fn time_goes_to_the_remark_before_it() {
        let mut rapid = back_section();
        rapid.kind = MoveKind::Rapid;
        rapid.marks.blocks.iter_mut().for_each(|b| b.line = 10);
        let items = [
            JobItem::Section(bent_section()),
            note("skipped", 8),
            note("T2", 9),
            JobItem::Section(rapid),
            JobItem::Dwell { seconds: 2.0, line: 11 },
            note("end", 12),
        ];
        let found = operations(&items);
        let duration = bent_section().table.duration();
        assert_eq!(names(&found), [("", 0), ("T2", 9)]);
        assert!((found[0].feed_s - duration).abs() < 1e-12 && found[0].rapid_s == 0.0);
        assert!((found[1].seconds() - duration - 2.0).abs() < 1e-9);
        assert_eq!((found[1].dwell_s, found[1].rapid_length_mm), (2.0, 10.0));
    }

    #[test]
    fn a_remark_within_a_section_gets_the_lines_after_it() {
        let section = bent_section();
        let (mut before, mut after) = (0.0, 0.0);
        visit(&section, 1, |cell| *(if cell.line == 4 { &mut before } else { &mut after }) += cell.seconds);
        let items = [note("first", 2), note("last", 5), note("end", 6), JobItem::Section(section)];
        let found = operations(&items);
        assert_eq!(names(&found), [("first", 2), ("last", 5)]);
        assert!((found[0].feed_s - before).abs() < 1e-12 && (found[1].feed_s - after).abs() < 1e-12);
        let cut = 300.0 / 64.0;
        assert!((found[0].feed_length_mm - cut).abs() < 1e-12);
        assert!((found[1].feed_length_mm - (10.0 - cut)).abs() < 1e-12);
    }

    #[test]
    fn a_remark_after_the_last_line_waits_for_what_comes_next() {
        let items = [
            note("cut", 1),
            note("wait", 6),
            JobItem::Section(bent_section()),
            JobItem::Dwell { seconds: 1.0, line: 7 },
        ];
        let found = operations(&items);
        assert_eq!(names(&found), [("cut", 1), ("wait", 6)]);
        assert_eq!((found[0].dwell_s, found[1].seconds()), (0.0, 1.0));
    }
}

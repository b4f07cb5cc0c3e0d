//! Time per operation of the program: what happens between one remark and the next.

use serde::Serialize;

use crate::feed::job::JobItem;
use crate::job::program::MoveKind;

/// What passes between two remarks.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Operation {
    /// Text of the remark that starts it; empty before the first one.
    pub name: String,
    /// Line of the remark, 0 before the first one.
    pub line: u32,
    /// Time in feed moves [s].
    pub cutting_s: f64,
    /// Time in rapids [s].
    pub rapid_s: f64,
    /// Time in waits [s].
    pub dwell_s: f64,
    /// Length of the path of feed moves [u].
    pub cutting_length: f64,
    /// Length of the path of rapids [u].
    pub rapid_length: f64,
}

impl Operation {
    /// All of its time [s].
    pub fn seconds(&self) -> f64 {
        self.cutting_s + self.rapid_s + self.dwell_s
    }
}

/// Splits a job at its remarks; remarks without motion or wait after them are dropped.
pub fn operations<'a>(items: impl IntoIterator<Item = &'a JobItem>) -> Vec<Operation> {
    let mut done = Vec::new();
    let mut open = Operation::default();
    for item in items {
        match item {
            JobItem::Note { text, line } => {
                let next = Operation { name: text.clone(), line: *line, ..Operation::default() };
                done.push(std::mem::replace(&mut open, next));
            }
            JobItem::Dwell { seconds, .. } => open.dwell_s += seconds,
            JobItem::Section(section) => {
                let (seconds, length) = match section.kind {
                    MoveKind::Feed => (&mut open.cutting_s, &mut open.cutting_length),
                    MoveKind::Rapid => (&mut open.rapid_s, &mut open.rapid_length),
                };
                *seconds += section.table.duration();
                *length += section.table.path.length();
            }
        }
    }
    done.push(open);
    done.retain(|o| o.seconds() > 0.0);
    done
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::samples::{back_section, bent_section};

    #[test]
    fn time_goes_to_the_remark_before_it() {
        let mut rapid = back_section();
        rapid.kind = MoveKind::Rapid;
        let note = |text: &str, line| JobItem::Note { text: text.to_owned(), line };
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
        assert_eq!(found.iter().map(|o| (o.name.as_str(), o.line)).collect::<Vec<_>>(), [("", 0), ("T2", 9)]);
        assert!((found[0].cutting_s - duration).abs() < 1e-12 && found[0].rapid_s == 0.0);
        assert!((found[1].seconds() - duration - 2.0).abs() < 1e-9);
        assert_eq!(found[1].rapid_length, 10.0);
    }
}

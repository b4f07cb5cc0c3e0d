//! A whole planned job: certified tables in order, with the waits between them.

use super::table::FeedTable;
use crate::geometry::section::Marks;
use crate::job::machine::AxisLimits;
use crate::job::program::MoveKind;

/// One thing the drives do, in order.
#[derive(Clone, Debug, PartialEq)]
pub enum JobItem {
    /// Motion from rest to rest.
    Section(PlannedSection),
    /// All axes stand still.
    Dwell {
        /// How long [s].
        seconds: f64,
        /// Line of the program, from 1.
        line: u32,
    },
    /// A remark for the report.
    Note {
        /// What to show.
        text: String,
        /// Line of the program, from 1.
        line: u32,
    },
}

/// A section with the motion planned on it.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedSection {
    /// Rapid or feed.
    pub kind: MoveKind,
    /// The limits it was planned for, one per axis.
    pub limits: Vec<AxisLimits>,
    /// The rounded path and motion.
    pub table: FeedTable,
    /// What is known of its places.
    pub marks: Marks,
}

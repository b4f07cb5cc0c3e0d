//! Sections that are sent while they are planned: each becomes a chain of pieces, and the first of them is out before the
//! section has been planned to its end.

use super::chunk::Chunks;
use super::file::FileHeader;
use super::pack::{PackError, Packed, pack};
use super::table::FeedTable;
use crate::geometry::grid_path::GridPath;
use crate::geometry::section::Marks;
use crate::geometry::sections::SectionItem;
use crate::job::machine::{AxisLimits, LimitSet, Machine};
use crate::topp::PlanError;
use crate::topp::horizon::{Deadline, Horizon, HorizonSettings, Record, pieces};

/// Geometry spans that the planner is given at a time.
const SPANS: usize = 16;

/// What goes out, in order.
#[derive(Clone, Debug, PartialEq)]
pub enum StreamItem {
    /// A table: the beginning of a motion from rest, or what takes over from the piece before it.
    Piece {
        /// The table, as it is sent.
        packed: Packed,
        /// How long motion takes up to here, if nothing more comes [s].
        until_s: f64,
        /// Line of the program that it ends in, from 1.
        line: u32,
    },
    /// All axes stand still.
    Dwell {
        /// How long [s].
        seconds: f64,
    },
}

/// Why a job cannot be sent.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StreamError<E> {
    /// The stream of sections ended with an error.
    #[error(transparent)]
    Section(E),
    /// A section cannot be planned.
    #[error("line {line}: {fault}")]
    Plan {
        /// Line of the program, from 1.
        line: u32,
        /// Why.
        fault: PlanError,
    },
    /// A piece cannot be packed.
    #[error("line {line}: {source}")]
    Pack {
        /// Line of the program, from 1.
        line: u32,
        /// Why.
        source: PackError,
    },
}

/// Turns sections into pieces.
#[derive(Debug)]
pub struct Streamer<'a> {
    header: &'a FileHeader,
    settings: HorizonSettings,
    /// Number of the next table.
    number: u32,
    /// What motion takes before the present section [s].
    before_s: f64,
}

impl<'a> Streamer<'a> {
    /// For the drives of a machine.
    pub fn new(header: &'a FileHeader) -> Self {
        Self { header, settings: HorizonSettings::default(), number: 1, before_s: 0.0 }
    }

    /// Plans all that `sections` yields and hands it to `emit`, which says whether it wants more.
    ///
    /// # Errors
    /// The first error in program order. What was handed over until then ends at rest.
    pub fn run<E>(
        &mut self,
        sections: impl Iterator<Item = Result<SectionItem, E>>,
        machine: &Machine,
        limits: LimitSet,
        emit: &mut dyn FnMut(StreamItem) -> bool,
    ) -> Result<(), StreamError<E>> {
        for item in sections {
            let goes_on = match item.map_err(StreamError::Section)? {
                SectionItem::Section(section) => {
                    let axes = machine.axes.iter();
                    let limits: Vec<_> = axes.map(|axis| limits.of(axis, section.kind)).collect();
                    self.section(&section.path, &section.marks, &limits, emit)?
                }
                SectionItem::Dwell { seconds, .. } => emit(StreamItem::Dwell { seconds }),
                SectionItem::Note { .. } | SectionItem::Stop { .. } => true,
            };
            if !goes_on {
                break;
            }
        }
        Ok(())
    }

    /// Hands a table over that was planned before, as one piece if that takes no more than `most` bytes of a drive; otherwise its
    /// path is planned anew, in pieces.
    ///
    /// # Errors
    /// As [`Streamer::section`].
    pub fn table<E>(
        &mut self,
        table: &FeedTable,
        marks: &Marks,
        limits: &[AxisLimits],
        most: usize,
        emit: &mut dyn FnMut(StreamItem) -> bool,
    ) -> Result<bool, StreamError<E>> {
        let line = marks.line_at(table.path.grid_length() as f64);
        let packed = pack(table, self.number, &self.header.target(limits));
        let packed = packed.map_err(|source| StreamError::Pack { line, source })?;
        let longest = packed.axes.iter().map(|axis| axis.controls.len()).max().unwrap_or(0);
        if packed.shared.len() + longest > most {
            return self.section(&table.path, marks, limits, emit);
        }
        self.number = self.number.wrapping_add(1);
        self.before_s += table.duration();
        Ok(emit(StreamItem::Piece { packed, until_s: self.before_s, line }))
    }

    /// Plans a section and hands its pieces over; `false` if no more is wanted.
    ///
    /// # Errors
    /// The section has no plan, or the format cannot express it.
    pub fn section<E>(
        &mut self,
        path: &GridPath,
        marks: &Marks,
        limits: &[AxisLimits],
        emit: &mut dyn FnMut(StreamItem) -> bool,
    ) -> Result<bool, StreamError<E>> {
        let line_at = |u: f64| marks.line_at(u / path.step);
        let planned =
            |fault: PlanError| StreamError::Plan { line: line_at(fault.place().unwrap_or(0.0)), fault };
        let target = self.header.target(limits);
        let (start, parts) = pieces(path, &marks.caps, SPANS);
        let mut horizon = Horizon::new(&start, limits, f64::from(self.header.tick_ns) * 1e-9, self.settings)
            .map_err(planned)?;
        let mut record = Record::new(&start, horizon.q_scale());
        let (mut chunks, mut parts, mut duration) = (Chunks::default(), parts, 0.0);
        loop {
            let part = parts.next();
            match &part {
                Some(part) => {
                    horizon.push(part).map_err(planned)?;
                    record.path(part);
                }
                None => horizon.finish(),
            }
            while let Some(commit) = horizon.advance(Deadline::NONE).map_err(planned)? {
                record.commit(&commit);
                let table = record.table(&commit.stop);
                let fixed = table.steps.len() - commit.stop.steps.len();
                let line = marks.line_at(commit.until as f64);
                let piece = chunks.next(&table, fixed, commit.complete, self.number, &target);
                duration = table.duration();
                let Some(packed) = piece.map_err(|source| StreamError::Pack { line, source })? else {
                    continue;
                };
                self.number = self.number.wrapping_add(1);
                if !emit(StreamItem::Piece { packed, until_s: self.before_s + duration, line }) {
                    return Ok(false);
                }
            }
            if part.is_none() {
                self.before_s += duration;
                return Ok(true);
            }
        }
    }
}

//! The one door for tables: bytes in, a checked table or a named error out.

use protocol::table::rules::{MAX_SPANS_PER_TICK, nearest_count};
use protocol::table::{AxisHeader, HeaderField, Stream, TableError, TableHeader};

use crate::evaluate::{LawCursor, PieceCursor};
use crate::time::tick_time;

/// A table as it lies in memory: headers, and the streams they describe.
#[derive(Clone, Copy, Debug)]
pub struct TableView<'a> {
    pub(crate) header: TableHeader,
    pub(crate) axis: AxisHeader,
    pub(crate) geometry: &'a [u8],
    pub(crate) spans: &'a [u8],
    pub(crate) controls: &'a [u8],
}

/// A table that obeys every rule of the format: the evaluator plays it to its end at rest.
#[derive(Clone, Copy, Debug)]
pub struct CheckedTable<'a> {
    view: TableView<'a>,
    duration: u64,
}

impl<'a> TableView<'a> {
    /// Puts a table together from its headers, its shared streams (geometry, then spans) and its control stream.
    ///
    /// # Errors
    /// A header field is not admissible, or a length differs from what its header says.
    pub fn new(
        header: TableHeader,
        axis: AxisHeader,
        shared: &'a [u8],
        controls: &'a [u8],
    ) -> Result<Self, TableError> {
        header.check()?;
        axis.check()?;
        if axis.table != header.table {
            return Err(TableError::Header(HeaderField::Table));
        }
        let length = TableError::Header(HeaderField::Length);
        let (geometry, spans) = shared.split_at_checked(header.geometry_bytes as usize).ok_or(length)?;
        if spans.len() as u64 != u64::from(header.span_bytes)
            || controls.len() as u64 != u64::from(axis.control_bytes)
        {
            return Err(length);
        }
        Ok(Self { header, axis, geometry, spans, controls })
    }

    /// Goes through the whole table once, span by span, as the evaluator will.
    ///
    /// Checked are the streams and their counts, every rule of [`protocol::table::rules`], and the declared start
    /// and end. That q is positive and the table ends at rest follows from the format: control values are
    /// positive, and the last span is always a rest span.
    ///
    /// # Errors
    /// The first rule that is broken, and where.
    pub fn check(self) -> Result<CheckedTable<'a>, TableError> {
        let shortest = tick_time(self.header.tick_ns) / MAX_SPANS_PER_TICK;
        let mut piece = PieceCursor::start(&self)?;
        if nearest_count(piece.first_point(), self.axis.fraction_bits) != self.axis.start {
            return Err(TableError::Start);
        }
        let mut law = LawCursor::start(&self)?;
        let mut duration = 0u64;
        loop {
            if law.duration() < shortest {
                return Err(TableError::Fast { index: law.index() });
            }
            duration = duration.saturating_add(law.duration());
            if law.is_last() {
                break;
            }
            law.advance(&self)?;
            if law.opens_geometry() {
                piece.advance(&self)?;
            }
        }
        law.finish(&self)?;
        piece.finish(&self)?;
        if nearest_count(piece.last_point(), self.axis.fraction_bits) != self.axis.end {
            return Err(TableError::End);
        }
        if duration == u64::MAX {
            return Err(TableError::Count { stream: Stream::Spans });
        }
        Ok(CheckedTable { view: self, duration })
    }
}

impl<'a> CheckedTable<'a> {
    /// A table that passed [`TableView::check`] before, with the duration found there.
    pub(crate) fn known(view: TableView<'a>, duration: u64) -> Self {
        Self { view, duration }
    }

    /// The table's bytes and headers.
    pub(crate) fn view(&self) -> &TableView<'a> {
        &self.view
    }

    /// The shared header.
    pub fn header(&self) -> &TableHeader {
        &self.view.header
    }

    /// The axis header.
    pub fn axis(&self) -> &AxisHeader {
        &self.view.axis
    }

    /// How long the table plays [2^-32 s].
    pub fn duration(&self) -> u64 {
        self.duration
    }
}

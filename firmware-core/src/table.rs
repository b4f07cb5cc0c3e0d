//! The one door for tables: bytes in, a checked table or a named error out.

use protocol::table::rules::{MAX_SPANS_PER_TICK, nearest_count};
use protocol::table::{AxisHeader, AxisLimit, HeaderField, Stream, TableError, TableHeader};

use crate::evaluate::{LawCursor, PieceCursor, Stretch};
use crate::proof::Granted;
use crate::time::tick_time;

/// What a position may be outside the travel by, for the rounding of the proof [counts].
const SLACK: i64 = 1;

/// A table as it lies in memory: headers, and the streams they describe.
#[derive(Clone, Copy, Debug)]
pub struct TableView<'a> {
    pub(crate) header: &'a TableHeader,
    pub(crate) axis: &'a AxisHeader,
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

/// What motion at a knot depends on: tables that agree in it can follow each other there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Junction {
    /// Length and code of the q spans before and behind it.
    spans: [[u32; 2]; 2],
    lengths: [u32; 4],
    points: [i64; 3],
}

/// Where another table may take over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tail {
    pub(crate) junction: Junction,
    /// Path time there [2^-32 s].
    pub(crate) time: u64,
}

impl<'a> TableView<'a> {
    /// Puts a table together from its headers, its shared streams (geometry, then spans) and its control stream.
    ///
    /// # Errors
    /// A header field is not admissible, or a length differs from what its header says.
    pub fn new(
        header: &'a TableHeader,
        axis: &'a AxisHeader,
        shared: &'a [u8],
        controls: &'a [u8],
    ) -> Result<Self, TableError> {
        header.check()?;
        axis.check()?;
        if axis.table != header.table {
            return Err(TableError::Header(HeaderField::Table));
        }
        Self::parts(header, axis, shared, controls).ok_or(TableError::Header(HeaderField::Length))
    }

    /// The same, from headers that were checked.
    pub(crate) fn parts(
        header: &'a TableHeader,
        axis: &'a AxisHeader,
        shared: &'a [u8],
        controls: &'a [u8],
    ) -> Option<Self> {
        let (geometry, spans) = shared.split_at_checked(header.geometry_bytes as usize)?;
        if spans.len() as u64 != u64::from(header.span_bytes)
            || controls.len() as u64 != u64::from(axis.control_bytes)
        {
            return None;
        }
        Some(Self { header, axis, geometry, spans, controls })
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
        self.pass(|_, _, _| Ok(())).map(|(table, _)| table)
    }

    /// As [`TableView::check`], and proves on the way that the axis keeps the limits that the table declares, at every
    /// instant, and stays within `travel` [counts].
    ///
    /// # Errors
    /// The first rule that is broken, or the first span on which a limit cannot be proven ([`crate::proof`]).
    pub fn prove(self, travel: Option<[i64; 2]>) -> Result<CheckedTable<'a>, TableError> {
        self.prove_all(travel).map(|(table, _)| table)
    }

    /// The same, and where another table may take over.
    #[inline(never)]
    pub(crate) fn prove_all(
        self,
        travel: Option<[i64; 2]>,
    ) -> Result<(CheckedTable<'a>, Option<Tail>), TableError> {
        let granted = Granted::new(&self.axis.limits, self.header.margin);
        self.pass(|law, piece, offset| {
            let failed = |limit| TableError::Limit { limit, index: law.index() };
            let proven = match law.stretch(&self) {
                Stretch::Launch(rest) => granted.rest(&piece.slopes(offset, rest.h), &rest),
                Stretch::Between(speed) => granted.span(&piece.slopes(offset, speed.h), &speed),
                Stretch::Landing(rest) => granted.rest(&piece.slopes_before_end(rest.h), &rest),
            };
            proven.map_err(failed)?;
            match travel {
                Some([low, high]) if offset == 0.0 => {
                    let [least, most] = piece.hull(&self);
                    let inside = low <= least.saturating_add(SLACK) && most.saturating_sub(SLACK) <= high;
                    if inside { Ok(()) } else { Err(failed(AxisLimit::Travel)) }
                }
                _ => Ok(()),
            }
        })
    }

    /// Goes through the whole table, and lets `judge` see every span: its law, its piece, and where it begins on it [u].
    fn pass(
        self,
        judge: impl Fn(&LawCursor, &PieceCursor, f32) -> Result<(), TableError>,
    ) -> Result<(CheckedTable<'a>, Option<Tail>), TableError> {
        let shortest = tick_time(self.header.tick_ns) / MAX_SPANS_PER_TICK;
        let mut piece = PieceCursor::start(&self)?;
        if nearest_count(piece.first_point(), self.axis.fraction_bits) != self.axis.start {
            return Err(TableError::Start);
        }
        let mut law = LawCursor::start(&self)?;
        let (mut duration, mut offset) = (0u64, 0u32);
        let (mut tail, mut before) = (None, [0; 2]);
        loop {
            if self.header.tail == Some(law.index()) {
                if !law.opens_geometry() {
                    return Err(TableError::Header(HeaderField::Tail));
                }
                let (lengths, points) = piece.start_of_span();
                let junction = Junction { spans: [before, law.span()], lengths, points };
                tail = Some(Tail { junction, time: duration });
            }
            before = law.span();
            if law.duration() < shortest {
                return Err(TableError::Fast { index: law.index() });
            }
            judge(&law, &piece, offset as f32 * self.header.step())?;
            duration = duration.saturating_add(law.duration());
            if law.is_last() {
                break;
            }
            let step = law.step();
            law.advance(&self)?;
            if law.opens_geometry() {
                piece.advance(&self)?;
                offset = 0;
            } else {
                offset = offset.saturating_add(step);
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
        Ok((CheckedTable { view: self, duration }, tail))
    }

    /// Where it takes over from another table, if it does.
    pub(crate) fn junction(&self) -> Option<Junction> {
        let joint = self.header.joint.as_ref()?;
        let law = LawCursor::start(self).ok()?;
        let (lengths, points) = PieceCursor::start(self).ok()?.start_of_span();
        Some(Junction { spans: [[joint.step, joint.code], law.span()], lengths, points })
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
        self.view.header
    }

    /// The axis header.
    pub fn axis(&self) -> &AxisHeader {
        self.view.axis
    }

    /// How long the table plays [2^-32 s].
    pub fn duration(&self) -> u64 {
        self.duration
    }
}

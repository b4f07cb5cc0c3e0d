//! The span stream: how the q spans divide the geometry spans, and the code of each.
//!
//! Per q span its step [grid steps] as a varint, unless it is the last one of its geometry span (then the rest
//! of that span's length is its step), followed by its code as a zigzag second difference, unless it is the
//! first or last span of the table (those are rest spans and carry no code). The first span of a table that joins another one
//! is no rest span, and has a code.

use super::geometry::GeometryReader;
use super::rules::MAX_CODE;
use super::{Stream, TableError};
use crate::varint::{self, SecondDifference};

/// One q span.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    /// Length [grid steps], positive.
    pub step: u32,
    /// Square root of q in units of the header's scale; 0 on the two rest spans, positive on all others.
    pub code: u32,
    /// The span is the first one of its geometry span.
    pub opens_geometry: bool,
}

/// Writes q spans one after the other.
#[derive(Clone, Copy, Debug, Default)]
pub struct SpanWriter {
    codes: SecondDifference,
}

impl SpanWriter {
    /// Appends one span: its step unless it follows from the geometry, its code unless it is a rest span.
    pub fn push(&mut self, out: &mut impl Extend<u8>, step: Option<u32>, code: Option<u32>) {
        if let Some(step) = step {
            varint::write(out, u64::from(step));
        }
        if let Some(code) = code {
            varint::write(out, self.codes.encode(i64::from(code)));
        }
    }
}

/// A place in a span stream; the bytes of both shared streams are handed in at every step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpanReader {
    geometry: GeometryReader,
    /// Rest of the open geometry span's length [grid steps] and spans.
    length_left: u32,
    spans_left: u32,
    at: usize,
    codes: SecondDifference,
    index: u32,
    spans: u32,
    /// The first span has a code: it is no rest span.
    joined: bool,
}

impl SpanReader {
    /// The start of a table with `spans` q spans; `joined` if it goes on where another one is left.
    pub fn new(spans: u32, joined: bool) -> Self {
        Self {
            geometry: GeometryReader::default(),
            length_left: 0,
            spans_left: 0,
            at: 0,
            codes: SecondDifference::default(),
            index: 0,
            spans,
            joined,
        }
    }

    /// Reads the next q span; `None` behind the last one.
    pub fn next(&mut self, geometry: &[u8], bytes: &[u8]) -> Result<Option<Span>, TableError> {
        let (stream, index) = (Stream::Spans, self.index);
        if index >= self.spans {
            return Ok(None);
        }
        let fail = |e| TableError::varint(e, stream, index);
        let opens_geometry = self.spans_left == 0;
        if opens_geometry {
            let span = self.geometry.next(geometry)?;
            (self.length_left, self.spans_left) = (span.length, span.spans);
        }
        let step = if self.spans_left == 1 {
            self.length_left
        } else {
            let word = varint::read(bytes, &mut self.at).map_err(fail)?;
            match u32::try_from(word) {
                Ok(0) => return Err(TableError::Range { stream, index }),
                Ok(step) if step < self.length_left => step,
                _ => return Err(TableError::Overfull { index }),
            }
        };
        let code = if (index == 0 && !self.joined) || index.saturating_add(1) == self.spans {
            0
        } else {
            let word = varint::read(bytes, &mut self.at).map_err(fail)?;
            match u32::try_from(self.codes.decode(word)) {
                Ok(code @ 1..=MAX_CODE) => code,
                _ => return Err(TableError::Range { stream, index }),
            }
        };
        self.length_left = self.length_left.saturating_sub(step);
        self.spans_left = self.spans_left.saturating_sub(1);
        self.index = index.saturating_add(1);
        Ok(Some(Span { step, code, opens_geometry }))
    }

    /// After the last span: both streams were used up, and the last geometry span is full.
    pub fn finish(&self, geometry: &[u8], bytes: &[u8]) -> Result<(), TableError> {
        if self.index != self.spans || self.spans_left != 0 {
            return Err(TableError::Count { stream: Stream::Spans });
        }
        if !self.geometry.is_at_end(geometry) {
            return Err(TableError::LeftOver { stream: Stream::Geometry });
        }
        if self.at != bytes.len() {
            return Err(TableError::LeftOver { stream: Stream::Spans });
        }
        Ok(())
    }

    /// How many geometry spans were opened.
    pub fn geometry_spans(&self) -> u32 {
        self.geometry.index()
    }
}

//! The geometry stream: lengths of the geometry spans, and how many q spans each holds.
//!
//! Per geometry span one varint `length << 1 | more`, the length in grid steps; if `more` is set, a second
//! varint: the number of q spans in it, less two. Without it the span holds one.

use super::rules::MAX_GEOMETRY_LENGTH;
use super::{Stream, TableError};
use crate::varint;

/// One geometry span.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GeometrySpan {
    /// Length [grid steps], positive.
    pub length: u32,
    /// How many q spans it holds, at least one.
    pub spans: u32,
}

/// Appends one geometry span.
pub fn write(out: &mut impl Extend<u8>, span: GeometrySpan) {
    let more = span.spans > 1;
    varint::write(out, u64::from(span.length) << 1 | u64::from(more));
    if more {
        varint::write(out, u64::from(span.spans) - 2);
    }
}

/// A place in a geometry stream; the bytes are handed in at every step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GeometryReader {
    at: usize,
    index: u32,
}

impl GeometryReader {
    /// Reads the next geometry span.
    pub fn next(&mut self, bytes: &[u8]) -> Result<GeometrySpan, TableError> {
        let (stream, index) = (Stream::Geometry, self.index);
        let fail = |e| TableError::varint(e, stream, index);
        let word = varint::read(bytes, &mut self.at).map_err(fail)?;
        let length = u32::try_from(word >> 1).unwrap_or(u32::MAX);
        if length == 0 || length >= MAX_GEOMETRY_LENGTH {
            return Err(TableError::Range { stream, index });
        }
        let spans = match word & 1 {
            0 => 1,
            _ => match varint::read(bytes, &mut self.at).map_err(fail)? {
                count @ 0..0x8000_0000 => count as u32 + 2,
                _ => return Err(TableError::Range { stream, index }),
            },
        };
        self.index = index.saturating_add(1);
        Ok(GeometrySpan { length, spans })
    }

    /// How many geometry spans were read.
    pub fn index(&self) -> u32 {
        self.index
    }

    /// All bytes were read.
    pub fn is_at_end(&self, bytes: &[u8]) -> bool {
        self.at == bytes.len()
    }
}

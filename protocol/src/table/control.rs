//! The control stream: the control points of one axis, as zigzag second differences.

use super::rules::MAX_CONTROL;
use super::{Stream, TableError};
use crate::varint::{self, SecondDifference};

/// Writes control points one after the other.
#[derive(Clone, Copy, Debug, Default)]
pub struct ControlWriter {
    points: SecondDifference,
}

impl ControlWriter {
    /// Appends one control point.
    pub fn push(&mut self, out: &mut impl Extend<u8>, point: i64) {
        varint::write(out, self.points.encode(point));
    }
}

/// A place in a control stream; the bytes are handed in at every step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ControlReader {
    at: usize,
    points: SecondDifference,
    index: u32,
}

impl ControlReader {
    /// Reads the next control point.
    pub fn next(&mut self, bytes: &[u8]) -> Result<i64, TableError> {
        let (stream, index) = (Stream::Controls, self.index);
        let word = varint::read(bytes, &mut self.at).map_err(|e| TableError::varint(e, stream, index))?;
        let point = self.points.decode(word);
        if point.unsigned_abs() >= MAX_CONTROL.unsigned_abs() {
            return Err(TableError::Range { stream, index });
        }
        self.index = index.saturating_add(1);
        Ok(point)
    }

    /// How many control points were read.
    pub fn index(&self) -> u32 {
        self.index
    }

    /// All bytes were read.
    pub fn is_at_end(&self, bytes: &[u8]) -> bool {
        self.at == bytes.len()
    }
}

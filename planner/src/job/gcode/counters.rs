//! What a program asks for, counted while it is read.

use crate::job::machine::{MAX_AXES, Point};

/// Counts and measures of the part of a program that has been read.
///
/// Commands are counted as programmed, before anything is dropped or blended. A drilling cycle counts as the
/// rapids and lines it is made of. Lengths are true lengths over the linear axes; arcs and helices are measured
/// as such.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Counters {
    /// Blocks with at least one word.
    pub blocks: u64,
    /// Rapid moves.
    pub rapids: u64,
    /// Straight feed moves.
    pub lines: u64,
    /// Arcs and helices.
    pub arcs: u64,
    /// Holes of drilling cycles.
    pub holes: u64,
    /// Moves without length, which are not handed on.
    pub zero_length: u64,
    /// Dwells.
    pub dwells: u64,
    /// Time of all dwells [s].
    pub dwell_s: f64,
    /// Stops other than dwells.
    pub stops: u64,
    /// Length of feed moves [mm].
    pub feed_length_mm: f64,
    /// Length of rapid moves [mm].
    pub rapid_length_mm: f64,
    /// Box around all moves, their starts included, in machine positions [axis units].
    pub bounding_box: Option<BoundingBox>,
    /// Box around the feed moves only.
    pub feed_box: Option<BoundingBox>,
}

/// A box in axis space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingBox {
    /// Lowest coordinates.
    pub min: Point,
    /// Highest coordinates.
    pub max: Point,
}

impl BoundingBox {
    /// Grows to hold a position.
    pub fn hold(&mut self, p: &Point) {
        for (i, x) in p.iter().enumerate() {
            self.min[i] = self.min[i].min(*x);
            self.max[i] = self.max[i].max(*x);
        }
    }

    /// Grows `slot` to hold this box.
    pub(super) fn join_into(self, slot: &mut Option<BoundingBox>) {
        let joined = slot.get_or_insert(self);
        for i in 0..MAX_AXES {
            joined.min[i] = joined.min[i].min(self.min[i]);
            joined.max[i] = joined.max[i].max(self.max[i]);
        }
    }
}

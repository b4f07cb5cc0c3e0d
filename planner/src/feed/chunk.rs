//! Pieces of a motion that is sent while it is planned: each ends at rest, and the next one takes over from its way to rest.
//!
//! A piece may be left at a geometry knot behind which two q spans' worth of data is final already: the length and the code of
//! the q span there, the lengths of two geometry spans and three control points. Everything before the knot is final then, and
//! drives that play either piece up to the knot move alike, to the bit.

use super::pack::{Cut, PackError, Packed, Target, pack_cut};
use super::table::FeedTable;

/// Spans at either end of a table whose codes are not q's own control values.
const ENDS: usize = 3;

/// What is packed piece by piece: a motion from rest to rest that grows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Chunks {
    /// Number of the piece before, and the q span of the whole motion at which it may be left.
    before: Option<(u32, usize)>,
}

impl Chunks {
    /// The next piece of the motion: what follows on the place where the piece before may be left.
    ///
    /// `table` is the whole motion so far with its way to rest, of which the first `fixed` q spans will not change any more;
    /// none changes if it is complete. `None`: the motion has not grown by enough for a piece that could be left later.
    ///
    /// # Errors
    /// What the format cannot express or a drive would refuse.
    pub fn next(
        &mut self,
        table: &FeedTable,
        fixed: usize,
        complete: bool,
        number: u32,
        target: &Target,
    ) -> Result<Option<Packed>, PackError> {
        let from = self.before.map(|(before, span)| (span, before));
        let first = from.map_or(0, |(span, _)| span);
        let tail = if complete { None } else { tail(table, first, fixed) };
        if !complete && tail.is_none() {
            return Ok(None);
        }
        let packed = pack_cut(table, number, target, Cut { from, tail })?;
        self.before = tail.map(|span| (number, span));
        Ok(Some(packed))
    }
}

/// The last q span behind `first` before which a piece can be left.
fn tail(table: &FeedTable, first: usize, fixed: usize) -> Option<usize> {
    // Control points near the end of the path so far, and codes near the rest, are those of the way to rest.
    let knots = table.path.breaks.get(2..table.path.spans().checked_sub(1)?)?;
    let last = fixed.checked_sub(1)?.min(table.spans().checked_sub(ENDS)?);
    let (mut at, mut found) = (0u64, None);
    for (span, &step) in table.steps.iter().enumerate().take(last + 1) {
        if span >= (first + 1).max(ENDS) && knots.binary_search(&at).is_ok() {
            found = Some(span);
        }
        at += u64::from(step);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feed::pack::tests::target;
    use crate::geometry::grid_path::{GridAxis, GridPath};

    /// A straight path of equal geometry spans, each with two q spans.
    fn table(spans: usize) -> FeedTable {
        let breaks: Vec<u64> = (0..=spans as u64).map(|k| k * 1024).collect();
        let controls = (0..spans + 3).map(|k| {
            let knot = |i: usize| i.saturating_sub(2).min(spans) as i64 * 1024;
            (knot(k) + knot(k + 1) + knot(k + 2)) / 3
        });
        let axis = GridAxis { lsb: 1e-3, controls: controls.collect() };
        FeedTable {
            path: GridPath { step: 2f64.powi(-10), breaks, axes: vec![axis.clone(), axis] },
            steps: vec![512; 2 * spans],
            q_scale: 1e-6,
            codes: vec![1000; 2 * spans - 2],
        }
    }

    #[test]
    fn pieces_are_left_where_everything_is_final() {
        let table = table(8);
        // The knot of span 2 k is geometry knot k; 2 <= k <= 6, and span 2 k is fixed.
        for (fixed, expected) in [(4, None), (5, Some(4)), (6, Some(4)), (7, Some(6)), (16, Some(12))] {
            assert_eq!(tail(&table, 0, fixed), expected, "{fixed}");
        }
        assert_eq!(tail(&table, 4, 6), None);
        assert_eq!(tail(&table, 4, 7), Some(6));
    }

    #[test]
    fn a_piece_says_where_it_takes_over_and_where_it_may_be_left() {
        let table = table(8);
        let mut chunks = Chunks::default();
        let first = chunks.next(&table, 7, false, 5, &target()).unwrap().unwrap();
        assert_eq!((first.header.joint, first.header.tail), (None, Some(6)));
        assert_eq!(chunks.next(&table, 7, false, 6, &target()).unwrap(), None);
        let next = chunks.next(&table, 11, false, 6, &target()).unwrap().unwrap();
        let joint = next.header.joint.unwrap();
        assert_eq!((joint.table, joint.step, joint.code, joint.lengths), (5, 512, 1000, [1024; 2]));
        assert_eq!((next.header.spans, next.header.geometry_spans, next.header.tail), (10, 5, Some(4)));
        let last = chunks.next(&table, 16, true, 7, &target()).unwrap().unwrap();
        assert_eq!((last.header.joint.unwrap().table, last.header.tail, last.header.spans), (6, None, 6));
        assert_eq!(last.axes[0].header.end, first.axes[0].header.end);
    }
}

//! The q spans of one window: what is kept of earlier windows, and what is new.

use crate::geometry::grid_path::GridPath;
use crate::topp::layout::Layout;
use crate::topp::rows::{RowSource, dot};

/// A new knot keeps this share of the expected span length from the last kept one.
const NEAREST: f64 = 0.4;
/// Most that a span beside a divided one may be longer.
const MOST_UNEVEN: u32 = 4;

/// Spans from the first kept geometry knot to the end of the window, in grid steps from there.
#[derive(Clone, Debug)]
pub(in crate::topp) struct Draft {
    pub(in crate::topp) knots: Vec<u64>,
    pub(in crate::topp) cells: Vec<u8>,
    /// Control values of the first spans, as x; that of span 0 means nothing.
    pub(in crate::topp) carried: Vec<f64>,
    /// Spans whose control values were improved; those carried after them are at the crawl.
    pub(in crate::topp) improved: usize,
    /// Spans that stay; those after them only serve to stop at the end of the window.
    pub(in crate::topp) lasting: usize,
}

impl Draft {
    /// Keeps `self`'s lasting spans and continues with the placed ones; those that end by `until` will last.
    pub(in crate::topp) fn continued(&self, path: &GridPath, placed: &Layout, until: u64) -> Draft {
        let mut knots = self.knots[..=self.lasting].to_vec();
        let mut cells = self.cells[..self.lasting].to_vec();
        let kept = knots[self.lasting];
        let fresh = self.lasting == 0;
        let total = path.grid_length();
        for (pair, &c) in placed.knots.windows(2).zip(&placed.cells) {
            let hard = pair[1] == total || path.breaks.binary_search(&pair[1]).is_ok();
            let near = ((pair[1] - pair[0]) as f64 * NEAREST) as u64;
            if pair[1] > kept && (fresh || hard || pair[1] - kept > near) {
                knots.push(pair[1]);
                cells.push(c);
            }
        }
        let lasting = knots.partition_point(|&k| k <= until).max(1) - 1;
        let carried = self.carried[..self.carried.len().min(self.lasting)].to_vec();
        let improved = self.improved.min(carried.len());
        Draft { knots, cells, carried, improved, lasting: lasting.max(self.lasting) }
    }

    pub(in crate::topp) fn layout(&self, path: &GridPath) -> Layout {
        let mut layout = Layout::new(path, self.knots.clone());
        layout.cells.clone_from(&self.cells);
        layout
    }

    /// Divides spans from `first` on; the error is a span too short for that. The motion carried stays what it is.
    pub(in crate::topp) fn divide(
        &mut self,
        source: &RowSource,
        parts: &[u32],
        first: usize,
    ) -> Result<(), usize> {
        let parts = graded(&source.layout.h, parts, first);
        let carried = self.carried.len();
        let (mut knots, mut cells) = (vec![0], Vec::new());
        let (mut kept, mut improved, mut lasting) = (Vec::new(), self.improved, self.lasting);
        for (i, &parts) in parts.iter().enumerate() {
            let (a, b) = (self.knots[i], self.knots[i + 1]);
            let k = u64::from(parts);
            if b - a < k {
                return Err(i);
            }
            let cut = |j: u64| a + ((b - a) as u128 * u128::from(j) / u128::from(k)) as u64;
            // The neighbours' control values shape a span, so the last carried one cannot be divided exactly.
            let exact = i + 1 < carried && i > 0;
            for j in 1..=k {
                knots.push(cut(j));
                cells.push(self.cells[i]);
                if parts == 1 && i < carried {
                    kept.push(self.carried[i]);
                } else if exact && kept.len() + 1 == knots.len() - 1 {
                    let at = |place: u64| (place - a) as f64 / (b - a) as f64;
                    kept.push(blossom(source, &self.carried, i, at(cut(j - 1)), at(cut(j))));
                }
            }
            improved += if i < self.improved { parts as usize - 1 } else { 0 };
            lasting += if i < self.lasting { parts as usize - 1 } else { 0 };
        }
        (self.knots, self.cells, self.carried) = (knots, cells, kept);
        (self.improved, self.lasting) = (improved.min(self.carried.len()), lasting);
        Ok(())
    }
}

/// The control value of the part [s, t] of span `i`: the blossom of its quadratic.
fn blossom(source: &RowSource, controls: &[f64], i: usize, s: f64, t: f64) -> f64 {
    let c = [if i > 1 { controls[i - 1] } else { 0.0 }, controls[i], controls[i + 1]];
    let b = source.bezier(i - 1).map(|row| dot(&row, &c));
    (1.0 - s) * (1.0 - t) * b[0] + (s * (1.0 - t) + t * (1.0 - s)) * b[1] + s * t * b[2]
}

/// Parts of every span, neighbours of short ones divided too.
fn graded(h: &[f64], parts: &[u32], first: usize) -> Vec<u32> {
    let last = h.len() - 1;
    let mut parts: Vec<u32> =
        parts.iter().enumerate().map(|(i, &p)| if i < first { 1 } else { p.max(1) }).collect();
    let mut grade = |i: usize, from: usize| {
        let length = |i: usize, parts: &[u32]| h[i] / f64::from(parts[i]);
        while parts[from] > 1
            && i != last
            && length(i, &parts) > f64::from(MOST_UNEVEN) * length(from, &parts)
        {
            parts[i] *= 2;
        }
    };
    (first + 1..=last).for_each(|i| grade(i, i - 1));
    (first..last).rev().for_each(|i| grade(i, i + 1));
    parts
}

//! How far an axis goes.

use super::bernstein::split;
use crate::feed::table::FeedTable;

/// A bound is close enough at this share of a count.
const CLOSE: f64 = 0.25;

/// Most times a span is halved.
const DEPTH: u8 = 16;

/// Lowest and highest position of an axis over the whole table, bounded from outside to a quarter of a count
/// [axis units].
///
/// The table must be one that [`certify`](super::certify) finds no defect in.
pub fn position_bounds(table: &FeedTable, axis: usize) -> [f64; 2] {
    let grid = &table.path.axes[axis];
    let origin = grid.controls[0];
    let (mut low, mut high) = (0.0f64, 0.0f64);
    for span in 0..table.path.spans() {
        let (base, c) = table.path.bezier(axis, span);
        let shift = (i128::from(base) - i128::from(origin)) as f64;
        let c = c.map(|x| shift + x / grid.lsb);
        high = highest(&c, high, 0);
        low = -highest(&c.map(|x| -x), -low, 0);
    }
    let place = |counts: f64, side: f64| {
        let position = (origin as f64 + counts) * grid.lsb;
        position + side * 8.0 * f64::EPSILON * position.abs()
    };
    [place(low, -1.0), place(high, 1.0)]
}

/// The larger of `known` and a bound on the polynomial that is at most [`CLOSE`] too high.
fn highest(c: &[f64; 4], known: f64, depth: u8) -> f64 {
    let ends = c[0].max(c[3]).max(known);
    let hull = c.iter().fold(ends, |m, &x| m.max(x));
    if hull <= ends + CLOSE || depth == DEPTH {
        return hull;
    }
    let (left, right) = split(c, 0.5);
    highest(&right, highest(&left, ends, depth + 1), depth + 1)
}

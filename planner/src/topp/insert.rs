//! More knots for the same motion.
//!
//! A quadratic B-spline keeps its values when knots are added to it: the control value of a part of a span is the
//! blossom of the span's polynomial at the ends of the part. Rows that hold over a span hold over its parts.

use super::layout::Layout;
use super::rows::{RowSource, dot};

/// Divides each inner span `i` into `parts[i]` parts of about equal length and gives the control values on the
/// finer knots; the error is a span too short for that, or a rest span, which has no parts.
pub(super) fn insert(source: &RowSource, x: &[f64], parts: &[u32]) -> Result<(Layout, Vec<f64>), usize> {
    let layout = source.layout;
    let last = layout.spans() - 1;
    let (mut knots, mut cells) = (vec![0], Vec::with_capacity(layout.spans()));
    let mut finer = Vec::with_capacity(x.len());
    for (i, &count) in parts.iter().enumerate() {
        let (from, to) = (layout.knots[i], layout.knots[i + 1]);
        let (count, length) = (u64::from(count.max(1)), to - from);
        let rest = i == 0 || i == last;
        if length < count || (rest && count > 1) {
            return Err(i);
        }
        let bezier = if rest { [0.0; 3] } else { polynomial(source, x, i - 1) };
        let mut begin = 0;
        for j in 1..=count {
            let end = (u128::from(length) * u128::from(j) / u128::from(count)) as u64;
            knots.push(from + end);
            cells.push(layout.cells[i]);
            if !rest {
                let share = |steps: u64| steps as f64 / length as f64;
                finer.push(blossom(&bezier, share(begin), share(end)));
            }
            begin = end;
        }
    }
    let mut divided = Layout::new(source.problem.path, knots);
    divided.cells = cells;
    Ok((divided, finer))
}

/// Bernstein coefficients of x over inner span `s`.
fn polynomial(source: &RowSource, x: &[f64], s: usize) -> [f64; 3] {
    let get = |j: usize| if j == 0 || j > x.len() { 0.0 } else { x[j - 1] };
    let c = [get(s), get(s + 1), get(s + 2)];
    source.bezier(s).map(|row| dot(&row, &c))
}

fn blossom(b: &[f64; 3], s: f64, t: f64) -> f64 {
    (1.0 - s) * ((1.0 - t) * b[0] + t * b[1]) + s * ((1.0 - t) * b[1] + t * b[2])
}

//! Draws a long path with few corners.

use super::model::PicturePoint;

/// Deviation allowed at first, as a share of the picture's extent: well below a pixel.
const FINEST: f64 = 1.0 / 8000.0;

/// Most points a chord may replace; bounds the work.
const LONGEST_CHORD: usize = 100;

/// A chord may hide speed differences of this share of the highest speed.
const SPEED_STEP: f64 = 0.03;

/// Replaces a line by one of at most `most` corners.
///
/// Corners stay where the mode changes, and where chords would leave the line by more than a tolerance or
/// blur its speed; the tolerance doubles until few enough are left. At the coarsest, corners are dropped evenly.
pub fn simplify(points: Vec<PicturePoint>, most: usize) -> Vec<PicturePoint> {
    let (mut low, mut high, mut fastest) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3], 0.0f64);
    for p in &points {
        for c in 0..3 {
            low[c] = low[c].min(p.at[c]);
            high[c] = high[c].max(p.at[c]);
        }
        fastest = fastest.max(p.speed);
    }
    let extent = (0..3).map(|c| high[c] - low[c]).fold(0.0, f64::max);
    if points.len() < 3 || !extent.is_finite() {
        return points;
    }
    let mut line = points;
    let mut factor = 1.0;
    while factor <= 64.0 {
        line = pass(&line, FINEST * extent * factor, SPEED_STEP * fastest * factor, factor > 4.0);
        if line.len() <= most {
            return line;
        }
        factor *= 2.0;
    }
    let stride = line.len().div_ceil(most.max(2) - 1);
    let last = line[line.len() - 1];
    let mut line: Vec<PicturePoint> = line.into_iter().step_by(stride).collect();
    line.push(last);
    line
}

/// One greedy pass: from each kept corner, the longest chord that keeps to the tolerances.
fn pass(points: &[PicturePoint], away: f64, blur: f64, coarse: bool) -> Vec<PicturePoint> {
    let mut kept = vec![points[0]];
    let mut anchor = 0;
    let mut end = 1;
    while end < points.len() {
        let longer = end + 1 < points.len() && end + 1 - anchor <= LONGEST_CHORD;
        if longer && chord_serves(&points[anchor..=end + 1], away, blur, coarse) {
            end += 1;
            continue;
        }
        let mut corner = points[end];
        corner.slow = points[anchor + 1..=end].iter().any(|p| p.slow);
        kept.push(corner);
        anchor = end;
        end += 1;
    }
    kept
}

/// The chord from the first to the last point stands for all of them.
fn chord_serves(run: &[PicturePoint], away: f64, blur: f64, coarse: bool) -> bool {
    let (first, last) = (&run[0], &run[run.len() - 1]);
    let span: [f64; 3] = std::array::from_fn(|c| last.at[c] - first.at[c]);
    let square: f64 = span.iter().map(|d| d * d).sum();
    run[1..run.len() - 1].iter().all(|p| {
        let to: [f64; 3] = std::array::from_fn(|c| p.at[c] - first.at[c]);
        let along = if square > 0.0 { (0..3).map(|c| to[c] * span[c]).sum::<f64>() / square } else { 0.0 };
        let along = along.clamp(0.0, 1.0);
        let off: f64 = (0..3).map(|c| (to[c] - along * span[c]).powi(2)).sum();
        let same = p.mode == last.mode && (coarse || p.limit == last.limit);
        off <= away * away && (p.speed - last.speed).abs() <= blur && same
    })
}

#[cfg(test)]
mod tests {
    use super::super::model::{Limit, Mode};
    use super::*;

    fn point(x: f64, y: f64, speed: f64) -> PicturePoint {
        PicturePoint {
            at: [x, y, 0.0],
            time: x,
            speed,
            line: 1,
            mode: Mode::Feed,
            limit: Limit::Feed,
            slow: false,
        }
    }

    #[test]
    fn a_straight_run_at_one_speed_needs_few_corners() {
        let line: Vec<_> = (0..1000).map(|i| point(f64::from(i), 0.0, 5.0)).collect();
        let drawn = simplify(line.clone(), 500);
        assert!(drawn.len() <= 1000 / LONGEST_CHORD + 2, "{}", drawn.len());
        assert_eq!((drawn.first(), drawn.last()), (line.first(), line.last()));
    }

    #[test]
    fn a_corner_and_a_slow_spot_survive() {
        let mut line: Vec<_> = (0..=100).map(|i| point(f64::from(i), 0.0, 5.0)).collect();
        line.extend((1..=100).map(|i| point(100.0, f64::from(i), 5.0)));
        line[50].speed = 1.0;
        let drawn = simplify(line, 500);
        assert!(drawn.iter().any(|p| p.at == [100.0, 0.0, 0.0]));
        assert!(drawn.iter().any(|p| p.speed == 1.0));
    }

    #[test]
    fn noise_is_kept_within_the_budget() {
        let line: Vec<_> = (0..20_000)
            .map(|i| point(f64::from(i % 97), f64::from(i * 31 % 89), f64::from(i % 13)))
            .collect();
        let drawn = simplify(line, 700);
        assert!(drawn.len() <= 701, "{}", drawn.len());
    }
}

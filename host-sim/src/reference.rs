//! The planned motion in f64: the oracle that the drives' set-points are compared with.
//!
//! It evaluates the law and the path of a feed table as the planner defines them, in closed form (hyperbolic and
//! circular functions) and in f64; it shares nothing with the drive's evaluator but the table.

use planner::feed::table::{FeedTable, SpanLaw};
use planner::geometry::grid_path::Piece;

/// Below this |gamma t^2| the closed forms cancel and the series is summed.
const SERIES_BELOW: f64 = 0.25;

/// A feed table with the start times of its spans, read forwards in time.
#[derive(Clone, Debug)]
pub struct PlannedMotion<'a> {
    table: &'a FeedTable,
    /// Start of every span, and the end of the last [s].
    times: Vec<f64>,
    /// Start of every span [grid steps].
    starts: Vec<u64>,
    span: usize,
    geometry: usize,
    pieces: Vec<Piece>,
}

impl<'a> PlannedMotion<'a> {
    /// The motion of `table`, at its start.
    pub fn new(table: &'a FeedTable) -> Self {
        let (mut times, mut starts) = (vec![0.0], vec![0]);
        let (mut time, mut start) = (0.0, 0);
        for (i, &step) in table.steps.iter().enumerate() {
            time += table.law(i).duration();
            start += u64::from(step);
            times.push(time);
            starts.push(start);
        }
        let mut motion = Self { table, times, starts, span: 0, geometry: usize::MAX, pieces: Vec::new() };
        motion.enter_geometry(0);
        motion
    }

    /// Duration of the whole table [s].
    pub fn duration(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    /// Moves to `time` [s], not before the time of the call before; times past the end stand at the end.
    ///
    /// Returns where on the path it is: the distance into the geometry span that [`Self::position`] then reads.
    pub fn seek(&mut self, time: f64) -> f64 {
        while self.span + 1 < self.table.spans() && time >= self.times[self.span + 1] {
            self.span += 1;
            let mut geometry = self.geometry;
            while geometry + 1 < self.table.path.spans()
                && self.table.path.breaks[geometry + 1] <= self.starts[self.span]
            {
                geometry += 1;
            }
            self.enter_geometry(geometry);
        }
        let offset = (self.starts[self.span] - self.table.path.breaks[self.geometry]) as f64;
        offset * self.table.path.step + travelled(&self.table.law(self.span), time - self.times[self.span])
    }

    /// Position of `axis` at `x` into the geometry span [axis units], scaled by `factor` (counts per unit, say).
    pub fn position(&self, axis: usize, x: f64, factor: f64) -> f64 {
        let piece = &self.pieces[axis];
        let origin = piece.base as f64 * (self.table.path.axes[axis].lsb * factor);
        origin + piece.offset(x) * factor
    }

    fn enter_geometry(&mut self, geometry: usize) {
        if geometry != self.geometry {
            self.geometry = geometry;
            let path = &self.table.path;
            self.pieces = (0..path.axes.len()).map(|axis| path.piece(axis, geometry)).collect();
        }
    }
}

/// Way into a span after `t` [s], clamped to the span's ends.
fn travelled(law: &SpanLaw, t: f64) -> f64 {
    match *law {
        SpanLaw::Launch { h, duration } => h * (t / duration).clamp(0.0, 1.0).powi(3),
        SpanLaw::Landing { h, duration } => h - h * ((duration - t) / duration).clamp(0.0, 1.0).powi(3),
        SpanLaw::Quadratic { h, q: [alpha, beta, gamma] } => {
            let t = t.max(0.0);
            let (s, g) = sine_and_versine(gamma * t * t);
            (alpha.max(0.0).sqrt() * t * s + 0.5 * beta * t * t * g).clamp(0.0, h)
        }
    }
}

/// S(z) = sum z^k/(2k+1)! and G(z) = sum z^k/(2k+2)!: sinh(r)/r and (cosh(r) - 1)/r^2 for z = r^2, sin and cos
/// for z = -r^2.
fn sine_and_versine(z: f64) -> (f64, f64) {
    let r = z.abs().sqrt();
    if z.abs() < SERIES_BELOW {
        let (mut s, mut g) = (1.0, 0.5);
        let (mut term_s, mut term_g) = (1.0, 0.5);
        for k in 1..9u32 {
            let k2 = f64::from(2 * k);
            term_s *= z / (k2 * (k2 + 1.0));
            term_g *= z / ((k2 + 1.0) * (k2 + 2.0));
            s += term_s;
            g += term_g;
        }
        (s, g)
    } else if z > 0.0 {
        (r.sinh() / r, (r.cosh() - 1.0) / z)
    } else {
        (r.sin() / r, (r.cos() - 1.0) / z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use planner::geometry::grid_path::{GridAxis, GridPath};

    fn sample() -> FeedTable {
        let axes = vec![GridAxis { lsb: 1e-3, controls: vec![0, 400, 900, 2500, 3000] }];
        let path = GridPath { step: 1.0 / 64.0, breaks: vec![0, 190, 640], axes };
        let codes = vec![900, 2000, 2500, 2100, 800];
        FeedTable { path, steps: vec![20, 40, 130, 250, 100, 80, 20], q_scale: 1e-5, codes }
    }

    #[test]
    fn closed_form_and_series_agree_where_they_meet() {
        for z in [SERIES_BELOW, -SERIES_BELOW] {
            let (inside, outside) =
                (sine_and_versine(z * (1.0 - 1e-15)), sine_and_versine(z * (1.0 + 1e-15)));
            assert!((inside.0 - outside.0).abs() < 1e-14 && (inside.1 - outside.1).abs() < 1e-14);
        }
    }

    #[test]
    fn every_span_is_crossed_in_its_duration() {
        let table = sample();
        for i in 0..table.spans() {
            let law = table.law(i);
            let (h, t) = (table.step_length(i), law.duration());
            assert!((travelled(&law, t * (1.0 - 1e-12)) / h - 1.0).abs() < 1e-10, "span {i}");
        }
    }

    #[test]
    fn way_solves_the_differential_equation() {
        // d2x/dt2 = q'(x)/2, by central differences.
        let table = sample();
        for i in 1..table.spans() - 1 {
            let law = table.law(i);
            let SpanLaw::Quadratic { q, .. } = law else { panic!("inner spans are quadratic") };
            let (t, d) = (0.4 * law.duration(), 1e-3 * law.duration());
            let [a, b, c] = [t - d, t, t + d].map(|t| travelled(&law, t));
            let expected = 0.5 * q[1] + q[2] * b;
            assert!(((a - 2.0 * b + c) / (d * d) - expected).abs() < 1e-5 * (1.0 + expected.abs()));
        }
    }

    #[test]
    fn the_motion_begins_and_ends_on_the_end_points_and_is_continuous() {
        let table = sample();
        let mut motion = PlannedMotion::new(&table);
        let end = motion.duration();
        assert!((end - table.duration()).abs() < 1e-12);
        let x = motion.seek(0.0);
        assert_eq!(motion.position(0, x, 1000.0), 0.0);
        let mut last = 0.0;
        for k in 1..=10_000 {
            let x = motion.seek(end * f64::from(k) / 10_000.0);
            let now = motion.position(0, x, 1000.0);
            assert!((now - last).abs() < 2.0, "jump at {k}");
            last = now;
        }
        assert!((last - 3000.0).abs() < 1e-9);
        let x = motion.seek(end + 1.0);
        assert!((motion.position(0, x, 1000.0) - 3000.0).abs() < 1e-9);
    }
}

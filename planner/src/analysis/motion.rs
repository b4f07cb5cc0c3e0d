//! The exact motion of a table: its state at any time or place, in closed form.

use crate::feed::table::{FeedTable, SpanLaw};
use crate::geometry::grid_path::Piece;

/// State of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisState {
    /// Position [axis units].
    pub position: f64,
    /// Velocity [axis units/s].
    pub velocity: f64,
    /// Acceleration [axis units/s^2].
    pub acceleration: f64,
    /// Jerk [axis units/s^3].
    pub jerk: f64,
}

/// Place on the path and its derivatives with respect to time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathState {
    /// Place within the span [u].
    pub x: f64,
    /// du/dt [u/s].
    pub speed: f64,
    /// d2u/dt2 [u/s^2].
    pub acceleration: f64,
    /// d3u/dt3 [u/s^3].
    pub jerk: f64,
}

/// One span of a table with everything needed to evaluate it.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSpan {
    /// Index in the table.
    pub index: usize,
    /// Start of the span on the path [grid steps].
    pub from: u64,
    /// End of the span [grid steps].
    pub to: u64,
    /// Start of the span in time, from the start of the table [s].
    pub start_s: f64,
    /// Duration [s].
    pub duration_s: f64,
    /// The law of motion.
    pub law: SpanLaw,
    /// Index of the geometry span.
    pub geometry: usize,
    /// Start of the span within the geometry span [u].
    pub offset: f64,
}

/// The spans of a table in order, with their places in time and on the path.
pub fn spans(table: &FeedTable) -> impl Iterator<Item = MotionSpan> {
    let first = (table.spans() > 0).then(|| MotionSpan::first(table));
    std::iter::successors(first, |span| span.following(table))
}

impl MotionSpan {
    /// The first span of a table, which has at least one.
    fn first(table: &FeedTable) -> Self {
        Self::starting(table, 0, 0, 0.0, 0)
    }

    /// The span after this one.
    fn following(&self, table: &FeedTable) -> Option<Self> {
        let index = self.index + 1;
        let start_s = self.start_s + self.duration_s;
        (index < table.spans()).then(|| Self::starting(table, index, self.to, start_s, self.geometry))
    }

    /// Span `index`, where its start is known; its geometry span is `geometry` or a later one.
    fn starting(table: &FeedTable, index: usize, from: u64, start_s: f64, mut geometry: usize) -> Self {
        let breaks = &table.path.breaks;
        while geometry + 2 < breaks.len() && breaks[geometry + 1] <= from {
            geometry += 1;
        }
        let law = table.law(index);
        let (to, duration_s) = (from + u64::from(table.steps[index]), law.duration());
        let offset = (from - breaks[geometry]) as f64 * table.path.step;
        Self { index, from, to, start_s, duration_s, law, geometry, offset }
    }

    /// Length in u.
    pub fn length(&self) -> f64 {
        match self.law {
            SpanLaw::Launch { h, .. } | SpanLaw::Quadratic { h, .. } | SpanLaw::Landing { h, .. } => h,
        }
    }

    /// State at the time `t` after the start of the span [s].
    pub fn at_time(&self, t: f64) -> PathState {
        match self.law {
            SpanLaw::Launch { h, duration } => launch(h, duration, (t / duration).clamp(0.0, 1.0)),
            SpanLaw::Landing { h, duration } => {
                landing(h, launch(h, duration, (1.0 - t / duration).clamp(0.0, 1.0)))
            }
            SpanLaw::Quadratic { h, q: [alpha, beta, gamma] } => {
                let v0 = alpha.max(0.0).sqrt();
                let (s, g) = series(gamma * t * t);
                let x = t * (v0 * s + 0.5 * beta * t * g);
                self.at_place(x.clamp(0.0, h))
            }
        }
    }

    /// State at the place `x` within the span [u].
    pub fn at_place(&self, x: f64) -> PathState {
        match self.law {
            SpanLaw::Launch { h, duration } => launch(h, duration, (x / h).clamp(0.0, 1.0).cbrt()),
            SpanLaw::Landing { h, duration } => {
                landing(h, launch(h, duration, (1.0 - x / h).clamp(0.0, 1.0).cbrt()))
            }
            SpanLaw::Quadratic { q: [alpha, beta, gamma], .. } => {
                let speed = (alpha + x * (beta + x * gamma)).max(0.0).sqrt();
                PathState { x, speed, acceleration: 0.5 * beta + gamma * x, jerk: gamma * speed }
            }
        }
    }

    /// Time from the start of the span to the place `x` within it [s].
    pub fn time_at(&self, x: f64) -> f64 {
        match self.law {
            SpanLaw::Launch { h, duration } => duration * (x / h).clamp(0.0, 1.0).cbrt(),
            SpanLaw::Landing { h, duration } => duration * (1.0 - (1.0 - x / h).clamp(0.0, 1.0).cbrt()),
            SpanLaw::Quadratic { h, q } => {
                if x <= 0.0 {
                    return 0.0;
                }
                SpanLaw::Quadratic { h: x.min(h), q }.duration()
            }
        }
    }

    /// State of an axis whose cubic on the geometry span is `piece`.
    pub fn axis(&self, piece: &Piece, lsb: f64, state: &PathState) -> AxisState {
        let x = self.offset + state.x;
        let (p1, p2, p3) = (piece.first(x), piece.second(x), piece.third());
        let (v, a, j) = (state.speed, state.acceleration, state.jerk);
        AxisState {
            position: piece.base as f64 * lsb + piece.offset(x),
            velocity: p1 * v,
            acceleration: p2 * v * v + p1 * a,
            jerk: p3 * v * v * v + 3.0 * p2 * v * a + p1 * j,
        }
    }
}

/// The cubics of all axes on one geometry span.
pub fn pieces(table: &FeedTable, geometry: usize) -> Vec<Piece> {
    (0..table.path.axes.len()).map(|axis| table.path.piece(axis, geometry)).collect()
}

/// A place in a table that moves forwards in time.
#[derive(Clone, Debug)]
pub struct Cursor<'a> {
    table: &'a FeedTable,
    span: MotionSpan,
    cubics: Vec<Piece>,
}

impl<'a> Cursor<'a> {
    /// At the start of `table`, which has at least one span.
    pub fn new(table: &'a FeedTable) -> Self {
        let span = MotionSpan::first(table);
        let cubics = pieces(table, span.geometry);
        Self { table, span, cubics }
    }

    /// Moves to the time `time_s` after the start of the table [s], not before that of the call before; times
    /// past the end stand at the end. The state's `x` counts from the start of [`Self::span`].
    pub fn seek(&mut self, time_s: f64) -> PathState {
        while time_s >= self.span.start_s + self.span.duration_s
            && let Some(next) = self.span.following(self.table)
        {
            if next.geometry != self.span.geometry {
                self.cubics = pieces(self.table, next.geometry);
            }
            self.span = next;
        }
        self.span.at_time((time_s - self.span.start_s).clamp(0.0, self.span.duration_s))
    }

    /// The span that it is in.
    pub fn span(&self) -> &MotionSpan {
        &self.span
    }

    /// The axes in order at the state that [`Self::seek`] has given.
    pub fn axes(&self, state: &PathState) -> impl Iterator<Item = AxisState> {
        let grid = self.table.path.axes.iter();
        self.cubics.iter().zip(grid).map(|(cubic, axis)| self.span.axis(cubic, axis.lsb, state))
    }
}

fn launch(h: f64, duration: f64, tau: f64) -> PathState {
    let rate = 1.0 / duration;
    PathState {
        x: h * tau.powi(3),
        speed: 3.0 * h * tau * tau * rate,
        acceleration: 6.0 * h * tau * rate * rate,
        jerk: 6.0 * h * rate.powi(3),
    }
}

/// The landing that runs through the launch `state` backwards.
fn landing(h: f64, state: PathState) -> PathState {
    PathState { x: h - state.x, acceleration: -state.acceleration, ..state }
}

/// `S(z) = sum z^k/(2k+1)!` and `G(z) = sum z^k/(2k+2)!`.
fn series(z: f64) -> (f64, f64) {
    if z.abs() < 0.05 {
        let s = 1.0 + z / 6.0 * (1.0 + z / 20.0 * (1.0 + z / 42.0 * (1.0 + z / 72.0 * (1.0 + z / 110.0))));
        let g = 0.5
            * (1.0 + z / 12.0 * (1.0 + z / 30.0 * (1.0 + z / 56.0 * (1.0 + z / 90.0 * (1.0 + z / 132.0)))));
        return (s, g);
    }
    let r = z.abs().sqrt();
    if z > 0.0 {
        (r.sinh() / r, 2.0 * (0.5 * r).sinh().powi(2) / z)
    } else {
        (r.sin() / r, 2.0 * (0.5 * r).sin().powi(2) / -z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::samples::bent_table;

    #[test]
    fn the_series_agree_with_their_closed_forms_where_they_meet() {
        for z in [0.049_999_999f64, -0.049_999_999] {
            let other = z * 1.000_000_1;
            let ((s0, g0), (s1, g1)) = (series(z), series(other));
            assert!((s0 - s1 - (z - other) / 6.0).abs() < 1e-10);
            assert!((g0 - g1 - (z - other) / 24.0).abs() < 1e-10);
        }
    }

    #[test]
    fn time_and_place_are_inverse() {
        let table = bent_table();
        for span in spans(&table) {
            for k in 0..=10 {
                let t = span.duration_s * f64::from(k) / 10.0;
                let x = span.at_time(t).x;
                assert!((span.time_at(x) - t).abs() < 1e-9 * span.duration_s.max(1.0), "{} {k}", span.index);
            }
            assert!((span.at_time(span.duration_s).x - span.length()).abs() < 1e-12);
        }
    }

    #[test]
    fn each_quantity_is_the_slope_of_the_one_before_it() {
        let table = bent_table();
        let dt = 1e-5;
        for span in spans(&table) {
            let pieces = pieces(&table, span.geometry);
            for k in 1..10 {
                let t = span.duration_s * f64::from(k) / 10.0;
                for (axis, piece) in table.path.axes.iter().zip(&pieces) {
                    let [a, b, c] = [t - dt, t, t + dt].map(|t| span.axis(piece, axis.lsb, &span.at_time(t)));
                    let slope = |x: f64, y: f64| (y - x) / (2.0 * dt);
                    assert!((slope(a.position, c.position) - b.velocity).abs() < 1e-6);
                    assert!((slope(a.velocity, c.velocity) - b.acceleration).abs() < 1e-5);
                    assert!((slope(a.acceleration, c.acceleration) - b.jerk).abs() < 1e-4);
                }
            }
        }
    }

    #[test]
    fn way_solves_the_differential_equation() {
        // d2x/dt2 = q'(x)/2, by central differences.
        for span in spans(&bent_table()) {
            let SpanLaw::Quadratic { q, .. } = span.law else { continue };
            let (t, d) = (0.4 * span.duration_s, 1e-3 * span.duration_s);
            let [a, b, c] = [t - d, t, t + d].map(|t| span.at_time(t).x);
            let expected = 0.5 * q[1] + q[2] * b;
            assert!(((a - 2.0 * b + c) / (d * d) - expected).abs() < 1e-5 * (1.0 + expected.abs()));
        }
    }

    #[test]
    fn a_cursor_runs_continuously_from_end_to_end_and_stands_beyond() {
        let table = bent_table();
        let mut cursor = Cursor::new(&table);
        let (end, mut last) = (table.duration(), 0.0);
        for k in 0..=10_000 {
            let state = cursor.seek(end * f64::from(k) / 10_000.0);
            let x = cursor.axes(&state).next().unwrap().position;
            assert!(x >= last && x - last < 0.003, "jump at {k}: {last} {x}");
            last = x;
        }
        assert!((last - 9.3).abs() < 1e-12);
        let state = cursor.seek(end + 1.0);
        let axes: Vec<AxisState> = cursor.axes(&state).collect();
        assert!((axes[0].position - 9.3).abs() < 1e-12 && (axes[1].position - 6.4).abs() < 1e-12);
        assert_eq!((axes[0].velocity, cursor.span().to), (0.0, 640));
    }

    #[test]
    fn a_cursor_sees_what_the_spans_hold() {
        let table = bent_table();
        let mut cursor = Cursor::new(&table);
        for span in spans(&table) {
            let state = cursor.seek(span.start_s + 0.3 * span.duration_s);
            assert_eq!(*cursor.span(), span);
            let cubics = pieces(&table, span.geometry);
            for ((seen, cubic), axis) in cursor.axes(&state).zip(&cubics).zip(&table.path.axes) {
                assert_eq!(seen, span.axis(cubic, axis.lsb, &state));
            }
        }
    }
}

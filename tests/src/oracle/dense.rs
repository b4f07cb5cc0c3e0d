//! Samples a feed table densely and takes the largest ratio of every kind.

use planner::feed::table::FeedTable;
use planner::geometry::grid_path::GridAxis;
use planner::geometry::section::{FeedCap, SpeedCap};
use planner::job::machine::AxisLimits;

use super::real::Real;
use super::spline::{Basis, combine};

/// Largest ratios value / limit met at the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ratios {
    /// Of an axis velocity.
    pub velocity: f64,
    /// Of an axis acceleration.
    pub acceleration: f64,
    /// Of an axis jerk.
    pub jerk: f64,
    /// Of the path speed to its cap.
    pub feed: f64,
}

/// The motion at one instant.
#[derive(Clone, Debug)]
pub struct Instant<T> {
    /// Place on the path.
    pub u: T,
    /// First, second and third derivative of u with respect to time.
    pub rate: [T; 3],
    /// Position, velocity, acceleration and jerk of every axis.
    pub axes: Vec<[T; 4]>,
}

/// A table, read as two families of textbook B-splines.
#[derive(Clone, Debug)]
pub struct Reading<T> {
    knots: Vec<T>,
    breaks: Vec<T>,
    rate: (Basis<T>, Vec<T>),
    path: Basis<T>,
    /// First control point of each axis, and all of them relative to it: derivatives are those of the latter.
    controls: Vec<(T, Vec<T>)>,
}

impl<T: Real> Reading<T> {
    /// Reads a table.
    pub fn of(table: &FeedTable) -> Self {
        let real = |x: f64| T::from(x);
        let place = |grid: u64| real(grid as f64) * real(table.path.step);
        let mut knots = vec![place(0)];
        let mut sum = 0u64;
        for &s in &table.steps {
            sum += u64::from(s);
            knots.push(place(sum));
        }
        let n = table.steps.len();
        let value = |k: usize| real(f64::from((u64::from(table.codes[k]).pow(2)) as f32 * table.q_scale));
        // At u = h (t/T)^3 the slope of q = u'^2 = 9 h^2 t^4 / T^6 against u is (4/3) q / u.
        let slope = |q: T, h: T| real(4.0) * q / (real(3.0) * h);
        let (head, tail) = (value(0), value(n - 3));
        // A clamped quadratic leaves its end with slope 2 (c_1 - c_0) / (length of the first span).
        let half = real(0.5);
        let mut controls = vec![head, head + half * (knots[2] - knots[1]) * slope(head, knots[1])];
        controls.extend((1..n - 3).map(value));
        let last_rest = knots[n] - knots[n - 1];
        controls.push(tail + half * (knots[n - 1] - knots[n - 2]) * slope(tail, last_rest));
        controls.push(tail);
        let rate = (Basis::clamped(2, &knots[1..n]), controls);
        let breaks: Vec<T> = table.path.breaks.iter().map(|&b| place(b)).collect();
        let path = Basis::clamped(3, &breaks);
        let axis = |a: &GridAxis| {
            let relative = a.controls.iter().map(|&c| real((c - a.controls[0]) as f64) * real(a.lsb));
            (real(a.controls[0] as f64) * real(a.lsb), relative.collect())
        };
        let controls = table.path.axes.iter().map(axis).collect();
        Self { knots, breaks, rate, path, controls }
    }

    /// q, or a derivative of it, by the polynomial of inner span `interval + 1`.
    fn q(&self, interval: usize, u: T, derivative: usize) -> T {
        let (basis, controls) = &self.rate;
        combine(controls, interval, &basis.weights(interval, u, derivative))
    }

    /// Number of spans.
    pub fn spans(&self) -> usize {
        self.knots.len() - 1
    }

    /// Span and share of it, as [`Reading::at`] takes them, of a place `u` on the path.
    pub fn locate(&self, u: f64) -> (usize, f64) {
        let last = self.spans() - 1;
        let span = self.knots.partition_point(|k| k.near() <= u).saturating_sub(1).min(last);
        let share = (u - self.knots[span].near()) / (self.knots[span + 1] - self.knots[span]).near();
        match span {
            0 => (0, share.cbrt()),
            i if i == last => (last, 1.0 - (1.0 - share).cbrt()),
            i => (i, share),
        }
    }

    /// The motion at the share `s` of a span: of its length, or of its time where it is a rest span.
    pub fn at(&self, span: usize, s: f64) -> Instant<T> {
        let real = |x: f64| T::from(x);
        let (from, to) = (self.knots[span], self.knots[span + 1]);
        let h = to - from;
        let last = self.spans() - 1;
        let (u, rate) = if span == 0 || span == last {
            let q = if span == 0 { self.q(0, to, 0) } else { self.q(last - 2, from, 0) };
            let duration = real(3.0) * h / q.root();
            let d1 = real(3.0) * h / duration;
            let d2 = real(6.0) * h / (duration * duration);
            let d3 = real(6.0) * h / (duration * duration * duration);
            let (w, sign) = if span == 0 { (real(s), 1.0) } else { (real(1.0 - s), -1.0) };
            let u = if span == 0 { from + h * w * w * w } else { to - h * w * w * w };
            (u, [d1 * w * w, real(sign) * d2 * w, d3])
        } else {
            let u = from + real(s) * h;
            let q = |d| self.q(span - 1, u, d);
            let speed = q(0).root();
            (u, [speed, q(1) * real(0.5), q(2) * speed * real(0.5)])
        };
        let middle = 0.5 * (from + to).near();
        let geometry = self.breaks.partition_point(|b| b.near() < middle).saturating_sub(1);
        let [v, a, j] = rate;
        let weights = [0, 1, 2, 3].map(|d| self.path.weights(geometry, u, d));
        let axis = |(first, controls): &(T, Vec<T>)| {
            let [p0, p1, p2, p3] = [0, 1, 2, 3].map(|d| combine(controls, geometry, &weights[d]));
            [*first + p0, p1 * v, p2 * v * v + p1 * a, p3 * v * v * v + real(3.0) * p2 * v * a + p1 * j]
        };
        Instant { u, rate, axes: self.controls.iter().map(axis).collect() }
    }
}

/// The largest ratios at `per_span` samples of every span, both ends among them, and at the ends of every cap.
pub fn largest_ratios(table: &FeedTable, limits: &[AxisLimits], caps: &[FeedCap], per_span: usize) -> Ratios {
    let reading = Reading::<f64>::of(table);
    let mut most = Ratios::default();
    // Where two caps meet both count, but not a sample that rounding has put on the wrong side [grid steps].
    let slack = 1e-6;
    for span in 0..reading.spans() {
        for k in 0..per_span {
            let now = reading.at(span, k as f64 / (per_span - 1) as f64);
            for ([_, v, a, j], limit) in now.axes.iter().zip(limits) {
                most.velocity = most.velocity.max(v.abs() / limit.velocity);
                most.acceleration = most.acceleration.max(a.abs() / limit.acceleration);
                most.jerk = most.jerk.max(j.abs() / limit.jerk);
            }
            let place = now.u / table.path.step;
            let cap = caps.partition_point(|c| (c.until as f64) < place + slack);
            let start = if cap == 0 { 0.0 } else { caps[cap - 1].until as f64 };
            if cap < caps.len() && place > start + slack {
                most.feed = most.feed.max(feed_ratio(&now, caps[cap].speed));
            }
        }
    }
    for pair in caps.windows(2) {
        let (span, share) = reading.locate(pair[0].until as f64 * table.path.step);
        let now = reading.at(span, share);
        most.feed = pair.iter().fold(most.feed, |m, cap| m.max(feed_ratio(&now, cap.speed)));
    }
    most
}

fn feed_ratio(now: &Instant<f64>, cap: SpeedCap) -> f64 {
    match cap {
        SpeedCap::None => 0.0,
        SpeedCap::Rate(rate) => now.rate[0] / rate,
        SpeedCap::Tangential { axes, speed } => {
            let counted = now.axes.iter().enumerate().filter(|(i, _)| axes & (1 << i) != 0);
            counted.map(|(_, x)| x[1] * x[1]).sum::<f64>().sqrt() / speed
        }
    }
}

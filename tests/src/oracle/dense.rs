//! Samples a feed table densely and takes the largest ratio of every kind.

use planner::feed::table::FeedTable;
use planner::geometry::section::{FeedCap, SpeedCap};
use planner::job::machine::AxisLimits;

use super::spline::BSpline;

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
pub struct Instant {
    /// Place on the path.
    pub u: f64,
    /// First, second and third derivative of u with respect to time.
    pub rate: [f64; 3],
    /// Position, velocity, acceleration and jerk of every axis.
    pub axes: Vec<[f64; 4]>,
}

/// A table, read as two families of textbook B-splines.
#[derive(Clone, Debug)]
pub struct Reading {
    knots: Vec<f64>,
    breaks: Vec<f64>,
    rate: BSpline,
    paths: Vec<BSpline>,
}

impl Reading {
    /// Reads a table.
    pub fn of(table: &FeedTable) -> Self {
        let mut knots = vec![0.0];
        let mut sum = 0u64;
        for &s in &table.steps {
            sum += u64::from(s);
            knots.push(sum as f64 * table.path.step);
        }
        let n = table.steps.len();
        let value = |k: usize| f64::from((u32::from(table.codes[k]).pow(2)) as f32 * table.q_scale);
        // At u = h (t/T)^3 the slope of q = u'^2 = 9 h^2 t^4 / T^6 against u is (4/3) q / u.
        let slope = |q: f64, h: f64| 4.0 * q / (3.0 * h);
        let (head, tail) = (value(0), value(n - 3));
        // A clamped quadratic leaves its end with slope 2 (c_1 - c_0) / (length of the first span).
        let mut controls = vec![head, head + 0.5 * (knots[2] - knots[1]) * slope(head, knots[1])];
        controls.extend((1..n - 3).map(value));
        controls.push(tail + 0.5 * (knots[n - 1] - knots[n - 2]) * slope(tail, knots[n] - knots[n - 1]));
        controls.push(tail);
        let rate = BSpline::clamped(2, &knots[1..n], controls);
        let breaks: Vec<f64> = table.path.breaks.iter().map(|&b| b as f64 * table.path.step).collect();
        let path = |a: &planner::geometry::grid_path::GridAxis| {
            BSpline::clamped(3, &breaks, a.controls.iter().map(|&c| c as f64 * a.lsb).collect())
        };
        let paths = table.path.axes.iter().map(path).collect();
        Self { knots, breaks, rate, paths }
    }

    /// Number of spans.
    pub fn spans(&self) -> usize {
        self.knots.len() - 1
    }

    /// Span and share of it, as [`Reading::at`] takes them, of a place `u` on the path.
    pub fn locate(&self, u: f64) -> (usize, f64) {
        let last = self.spans() - 1;
        let span = self.knots.iter().rposition(|&k| k <= u).unwrap_or(0).min(last);
        let share = (u - self.knots[span]) / (self.knots[span + 1] - self.knots[span]);
        match span {
            0 => (0, share.cbrt()),
            i if i == last => (last, 1.0 - (1.0 - share).cbrt()),
            i => (i, share),
        }
    }

    /// The motion at the share `s` of a span: of its length, or of its time where it is a rest span.
    pub fn at(&self, span: usize, s: f64) -> Instant {
        let (from, to) = (self.knots[span], self.knots[span + 1]);
        let h = to - from;
        let last = self.spans() - 1;
        let (u, rate) = if span == 0 || span == last {
            let q = self.rate.at(if span == 0 { 0 } else { last - 2 }, if span == 0 { to } else { from }, 0);
            let duration = 3.0 * h / q.sqrt();
            let (d1, d2, d3) = (3.0 * h / duration, 6.0 * h / duration.powi(2), 6.0 * h / duration.powi(3));
            let w = if span == 0 { s } else { 1.0 - s };
            let sign = if span == 0 { 1.0 } else { -1.0 };
            let u = if span == 0 { from + h * w.powi(3) } else { to - h * w.powi(3) };
            (u, [d1 * w * w, sign * d2 * w, d3])
        } else {
            let u = from + s * h;
            let q = |d| self.rate.at(span - 1, u, d);
            let speed = q(0).sqrt();
            (u, [speed, q(1) / 2.0, q(2) * speed / 2.0])
        };
        let middle = 0.5 * (from + to);
        let geometry = self.breaks.iter().rposition(|&b| b < middle).unwrap_or(0);
        let [v, a, j] = rate;
        let axis = |p: &BSpline| {
            let [p0, p1, p2, p3] = [0, 1, 2, 3].map(|d| p.at(geometry, u, d));
            [p0, p1 * v, p2 * v * v + p1 * a, p3 * v.powi(3) + 3.0 * p2 * v * a + p1 * j]
        };
        Instant { u, rate, axes: self.paths.iter().map(axis).collect() }
    }
}

/// The largest ratios at `per_span` samples of every span, both ends among them, and at the ends of every cap.
pub fn largest_ratios(table: &FeedTable, limits: &[AxisLimits], caps: &[FeedCap], per_span: usize) -> Ratios {
    let reading = Reading::of(table);
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
            let mut start = 0.0;
            for cap in caps {
                let end = cap.until as f64;
                if place > start + slack && place < end - slack {
                    most.feed = most.feed.max(feed_ratio(&now, cap.speed));
                }
                start = end;
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

fn feed_ratio(now: &Instant, cap: SpeedCap) -> f64 {
    match cap {
        SpeedCap::None => 0.0,
        SpeedCap::Rate(rate) => now.rate[0] / rate,
        SpeedCap::Tangential { axes, speed } => {
            let counted = now.axes.iter().enumerate().filter(|(i, _)| axes & (1 << i) != 0);
            counted.map(|(_, x)| x[1] * x[1]).sum::<f64>().sqrt() / speed
        }
    }
}

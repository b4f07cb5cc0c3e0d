//! What the same moves would take at constant feed, and when every block starts and ends at rest.

use super::double_s::double_s_rest_time;
use crate::job::machine::{Axis, AxisKind, AxisLimits, LimitSet, MAX_AXES, Point};
use crate::job::program::{Feed, Move, MoveKind, Shape};

/// Accumulates the two times as moves pass.
#[derive(Clone, Debug)]
pub struct Comparison {
    limits: Vec<[AxisLimits; 2]>,
    kinds: Vec<AxisKind>,
    /// If every move ran at its programmed feed (rapids at the axes' velocities) without acceleration limits [s].
    pub constant_feed_time_s: f64,
    /// If every block started and ended at rest, each under a double-S profile within the axis limits that count [s].
    ///
    /// Arcs are granted full acceleration along and across the path at once, so this is a lower estimate.
    pub stop_at_every_block_time_s: f64,
    /// Programmed length of the feed moves, arcs as true arcs [mm; axis units where only rotary axes move].
    pub feed_length: f64,
    /// Programmed length of the rapids.
    pub rapid_length: f64,
}

/// Largest speed, acceleration and jerk along a path.
#[derive(Clone, Copy, Debug)]
struct Along {
    velocity: f64,
    acceleration: f64,
    jerk: f64,
}

impl Comparison {
    /// For a machine with these axes, under the limits that count.
    pub fn new(axes: &[Axis], limits: LimitSet) -> Self {
        let of = |axis| [MoveKind::Feed, MoveKind::Rapid].map(|kind| limits.of(axis, kind));
        Self {
            limits: axes.iter().map(of).collect(),
            kinds: axes.iter().map(|a| a.kind).collect(),
            constant_feed_time_s: 0.0,
            stop_at_every_block_time_s: 0.0,
            feed_length: 0.0,
            rapid_length: 0.0,
        }
    }

    /// Adds the next move; moves without length add nothing.
    pub fn add(&mut self, m: &Move) {
        // How far each axis travels, arcs along their curve in both axes of the plane.
        let mut travel: Point = [0.0; _];
        for (i, t) in travel.iter_mut().enumerate().take(self.kinds.len()) {
            *t = (m.end[i] - m.start[i]).abs();
        }
        let mut squares = [0.0; 2];
        for (t, kind) in travel.iter().zip(&self.kinds) {
            squares[usize::from(*kind == AxisKind::Rotary)] += t * t;
        }
        let mut radius = f64::INFINITY;
        if let Shape::Arc(arc) = m.shape {
            let curve = ((arc.radius + 0.5 * arc.radius_change) * arc.sweep).abs();
            radius = (arc.radius + 0.5 * arc.radius_change).abs();
            for i in arc.plane.into_iter().filter(|&i| i < MAX_AXES) {
                squares[0] -= travel[i] * travel[i];
                travel[i] = curve;
            }
            squares[0] = squares[0].max(0.0) + curve * curve;
            // A helix is the wider of bend the steeper it climbs: kappa = r / (r^2 + c^2).
            radius *= squares[0] / (curve * curve).max(f64::MIN_POSITIVE);
        }
        let length = if squares[0] > 0.0 { squares[0].sqrt() } else { squares[1].sqrt() };
        if length.is_nan() || length <= 0.0 {
            return;
        }
        let along = self.along(m.kind, &travel, length);
        let (pace, sum) = match m.kind {
            MoveKind::Rapid => (f64::INFINITY, &mut self.rapid_length),
            MoveKind::Feed => (speed(m.feed, length), &mut self.feed_length),
        };
        *sum += length;
        self.constant_feed_time_s += length / if pace.is_finite() { pace } else { along.velocity };
        // Across the path: v^2 / R <= A and v^3 / R^2 <= J.
        let bend = (along.acceleration * radius).sqrt().min((along.jerk * radius * radius).cbrt());
        let velocity = pace.min(along.velocity).min(bend);
        self.stop_at_every_block_time_s +=
            double_s_rest_time(length, velocity, along.acceleration, along.jerk);
    }

    /// Adds a wait, which takes its time in any case.
    pub fn add_dwell(&mut self, seconds: f64) {
        self.constant_feed_time_s += seconds;
        self.stop_at_every_block_time_s += seconds;
    }

    /// Limits along a path of this length on which the axes travel so far, in proportion.
    fn along(&self, kind: MoveKind, travel: &Point, length: f64) -> Along {
        let mut along = Along { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY };
        for (limits, t) in self.limits.iter().zip(travel).filter(|(_, t)| **t > 0.0) {
            let limit = limits[usize::from(kind == MoveKind::Rapid)];
            let scale = length / t;
            along.velocity = along.velocity.min(limit.velocity * scale);
            along.acceleration = along.acceleration.min(limit.acceleration * scale);
            along.jerk = along.jerk.min(limit.jerk * scale);
        }
        along
    }
}

/// Programmed speed along a move; a feed move without feed runs as fast as its axes.
fn speed(feed: Option<Feed>, length: f64) -> f64 {
    match feed {
        Some(Feed::Speed(speed)) => speed,
        Some(Feed::Duration(seconds)) if seconds > 0.0 => length / seconds,
        Some(Feed::Duration(_)) | None => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::samples::axis;
    use crate::job::program::{Arc, Corner};
    use std::f64::consts::PI;

    fn machine() -> Vec<Axis> {
        let slide = AxisLimits { velocity: 100.0, acceleration: 500.0, jerk: 10_000.0 };
        let table = AxisLimits { velocity: 36.0, acceleration: 360.0, jerk: f64::INFINITY };
        let mut axes = vec![axis(AxisKind::Linear, slide); 3];
        axes.push(axis(AxisKind::Rotary, table));
        axes
    }

    fn line(to: &[f64], feed: Option<Feed>) -> Move {
        let mut end = [0.0; MAX_AXES];
        end[..to.len()].copy_from_slice(to);
        let kind = if feed.is_some() { MoveKind::Feed } else { MoveKind::Rapid };
        let (start, corner) = ([0.0; MAX_AXES], Corner::Stop);
        Move { kind, shape: Shape::Line, start, end, feed, corner, line: 1 }
    }

    fn times(m: &Move) -> (f64, f64) {
        let mut c = Comparison::new(&machine(), LimitSet::VelocityAccelerationJerk);
        c.add(m);
        (c.constant_feed_time_s, c.stop_at_every_block_time_s)
    }

    #[test]
    fn lines_run_at_their_feed_and_stop_by_the_double_s() {
        let (constant, stops) = times(&line(&[30.0, 40.0], Some(Feed::Speed(20.0))));
        assert!((constant - 2.5).abs() < 1e-12);
        // The direction (0.6, 0.8): 500/0.8 and 10000/0.8 along the path.
        assert!((stops - double_s_rest_time(50.0, 20.0, 625.0, 12_500.0)).abs() < 1e-12);
    }

    #[test]
    fn rapids_run_at_the_slowest_axis() {
        let (constant, stops) = times(&line(&[200.0, 100.0], None));
        assert!((constant - 2.0).abs() < 1e-12);
        assert!(stops > constant);
        // A turntable needs longer for its part than the slide: 90 degrees at 36 degrees/s.
        assert!((times(&line(&[50.0, 0.0, 0.0, 90.0], None)).0 - 2.5).abs() < 1e-12);
    }

    #[test]
    fn feeds_count_linear_axes_and_rotary_ones_alone() {
        assert!((times(&line(&[10.0, 0.0, 0.0, 90.0], Some(Feed::Speed(5.0)))).0 - 2.0).abs() < 1e-12);
        assert!((times(&line(&[0.0, 0.0, 0.0, 90.0], Some(Feed::Speed(30.0)))).0 - 3.0).abs() < 1e-12);
        assert!((times(&line(&[10.0], Some(Feed::Duration(4.0)))).0 - 4.0).abs() < 1e-12);
        assert_eq!(times(&line(&[0.0], Some(Feed::Speed(5.0)))), (0.0, 0.0));
    }

    #[test]
    fn arcs_have_their_true_length_and_slow_down_for_their_radius() {
        let arc = |radius: f64, rise: f64| {
            let a = Arc {
                plane: [0, 1],
                centre: [-radius, 0.0],
                radius,
                radius_change: 0.0,
                start_angle: 0.0,
                sweep: 2.0 * PI,
            };
            Move { shape: Shape::Arc(a), ..line(&[0.0, 0.0, rise], Some(Feed::Speed(90.0))) }
        };
        let mut c = Comparison::new(&machine(), LimitSet::VelocityAccelerationJerk);
        c.add(&arc(5.0, 0.0));
        assert!((c.feed_length - 10.0 * PI).abs() < 1e-12);
        // sqrt(A R) = 50, below the feed; the jerk bound (J R^2)^(1/3) = 63 is above it.
        let slow = double_s_rest_time(10.0 * PI, 50.0, 500.0, 10_000.0);
        assert!((c.stop_at_every_block_time_s - slow).abs() < 1e-12);
        c.add(&arc(5.0, 20.0));
        assert!((c.feed_length - 10.0 * PI - (400.0 + 100.0 * PI * PI).sqrt()).abs() < 1e-12);
        c.add_dwell(1.5);
        assert!((c.constant_feed_time_s - c.feed_length / 90.0 - 1.5).abs() < 1e-12);
    }
}

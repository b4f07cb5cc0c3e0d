//! The programmed contour: lines and arcs laid out over their length.
//!
//! Length is Euclidean over all axes of the machine in axis units, so one degree (or radian) of a rotary axis
//! counts like one millimetre. It only serves as the path parameter: feeds are kept as caps on real axis speeds.

use super::certify::Metric;
use crate::job::machine::{MAX_AXES, Point};
use crate::job::program::{Arc, Feed};

/// Turning further than this is a reversal [rad].
pub(super) const REVERSAL: f64 = 170.0 * std::f64::consts::PI / 180.0;

/// A joint is a corner if min(L) sin(theta/2) exceeds this many tolerances. A sagitta of min(L) theta / 8 above
/// the tolerance already tells a corner from a sample of a curve; below this limit, though, a pair of knots at the
/// vertex has to be shorter than the tolerance allows, and knots placed by the error alone give faster paths.
const CORNER_LEG: f64 = 16.0;

/// One line, arc or helix; u is the contour parameter, x = u - (u where it starts).
///
/// Position = `start + slope x`, plus the circular part if there is one.
#[derive(Clone, Debug)]
pub(super) struct Primitive {
    /// Straight part at x = 0.
    pub start: Point,
    /// Derivative of the straight part.
    pub slope: Point,
    /// Circular part.
    pub round: Option<Round>,
    /// Tolerance in force [mm].
    pub tolerance: f64,
    /// Distance from this primitive to the programmed contour it stands for [mm]; zero unless blocks were merged.
    pub slack: f64,
    /// How far the shift of the path's ends to whole counts moves it at most [mm].
    pub shift: f64,
    /// Angle by which the direction turns where it starts [rad].
    pub turn: f64,
    /// Programmed feed.
    pub feed: Option<Feed>,
    /// Line of the program.
    pub line: u32,
}

/// `radius(x) (cos angle(x), sin angle(x))` in a plane, both linear in x.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    /// Axis indices.
    pub plane: [usize; 2],
    /// Radius at x = 0.
    pub radius: f64,
    /// Its derivative.
    pub radius_slope: f64,
    /// Angle at x = 0 [rad].
    pub angle: f64,
    /// Its derivative [rad per u].
    pub angle_slope: f64,
}

impl Round {
    /// Value and derivative in the plane at x.
    pub(super) fn at(&self, x: f64) -> ([f64; 2], [f64; 2]) {
        let (sin, cos) = (self.angle + self.angle_slope * x).sin_cos();
        let r = self.radius + self.radius_slope * x;
        let (t, n) = (r * self.angle_slope, self.radius_slope);
        ([r * cos, r * sin], [n * cos - t * sin, n * sin + t * cos])
    }

    /// Bound on the fourth derivative over x in [0, length]: |d^4 (r e^ia)| <= a'^4 (r + 4 |dr/da|).
    pub(super) fn fourth(&self, length: f64) -> f64 {
        let largest = self.radius.abs().max((self.radius + self.radius_slope * length).abs());
        let w = self.angle_slope.abs();
        w.powi(3) * (w * largest + 4.0 * self.radius_slope.abs())
    }
}

impl Primitive {
    /// The straight primitive from `start` to `end`, with its length.
    pub(super) fn line(
        start: &Point,
        end: &Point,
        tolerance: f64,
        feed: Option<Feed>,
        line: u32,
    ) -> (Self, f64) {
        let length = distance(start, end);
        let slope = std::array::from_fn(|a| (end[a] - start[a]) / length);
        (
            Self {
                start: *start,
                slope,
                round: None,
                tolerance,
                slack: 0.0,
                shift: 0.0,
                turn: 0.0,
                feed,
                line,
            },
            length,
        )
    }

    /// The arc or helix from `start` to `end`, with its length. A mismatch between the end points and the circle
    /// is spread linearly over the arc, so the contour has no gaps.
    pub(super) fn arc(
        start: &Point,
        end: &Point,
        arc: &Arc,
        tolerance: f64,
        feed: Option<Feed>,
        line: u32,
    ) -> (Self, f64) {
        let unit = Round {
            plane: arc.plane,
            radius: arc.radius,
            radius_slope: arc.radius_change,
            angle: arc.start_angle,
            angle_slope: arc.sweep,
        };
        let (mut a, mut b) = (*start, *end);
        for (k, &axis) in arc.plane.iter().enumerate() {
            a[axis] -= unit.at(0.0).0[k];
            b[axis] -= unit.at(1.0).0[k];
        }
        let straight = distance(&a, &b);
        let around = (arc.radius + 0.5 * arc.radius_change) * arc.sweep;
        let length = straight.hypot(around).hypot(arc.radius_change);
        let slope = std::array::from_fn(|i| (b[i] - a[i]) / length);
        let round = Round {
            radius_slope: unit.radius_slope / length,
            angle_slope: unit.angle_slope / length,
            ..unit
        };
        (
            Self {
                start: a,
                slope,
                round: Some(round),
                tolerance,
                slack: 0.0,
                shift: 0.0,
                turn: 0.0,
                feed,
                line,
            },
            length,
        )
    }

    /// Position at x.
    pub(super) fn position(&self, x: f64) -> Point {
        let mut p: Point = std::array::from_fn(|a| self.start[a] + self.slope[a] * x);
        if let Some(round) = &self.round {
            let (e, _) = round.at(x);
            p[round.plane[0]] += e[0];
            p[round.plane[1]] += e[1];
        }
        p
    }

    /// Unit direction at x.
    pub(super) fn direction(&self, x: f64) -> Point {
        let mut d = self.slope;
        if let Some(round) = &self.round {
            let (_, t) = round.at(x);
            d[round.plane[0]] += t[0];
            d[round.plane[1]] += t[1];
        }
        let size = norm(&d);
        d.map(|v| v / size)
    }

    /// The same curve over a parameter `ratio` times as long.
    fn stretch(&mut self, ratio: f64) {
        self.slope = self.slope.map(|v| v / ratio);
        if let Some(round) = &mut self.round {
            round.radius_slope /= ratio;
            round.angle_slope /= ratio;
        }
    }
}

/// Consecutive primitives between two rests.
#[derive(Clone, Debug, Default)]
pub(super) struct Contour {
    /// The primitives.
    pub primitives: Vec<Primitive>,
    /// Where each ends in u.
    pub ends: Vec<f64>,
}

impl Contour {
    /// Appends a primitive.
    pub(super) fn push(&mut self, primitive: Primitive, length: f64) {
        self.ends.push(self.length() + length);
        self.primitives.push(primitive);
    }

    /// Where the last primitive ends in u.
    pub(super) fn length(&self) -> f64 {
        self.ends.last().copied().unwrap_or(0.0)
    }

    /// Where primitive `k` starts in u.
    pub(super) fn start_of(&self, k: usize) -> f64 {
        if k == 0 { 0.0 } else { self.ends[k - 1] }
    }

    /// Length of primitive `k` in u.
    pub(super) fn length_of(&self, k: usize) -> f64 {
        self.ends[k] - self.start_of(k)
    }

    /// Position at `x` into primitive `k`'s own range.
    pub(super) fn position(&self, k: usize, u: f64) -> Point {
        self.primitives[k].position(u - self.start_of(k))
    }

    /// Where the contour starts.
    pub(super) fn first(&self) -> Option<Point> {
        self.primitives.first().map(|p| p.position(0.0))
    }

    /// Where the contour ends.
    pub(super) fn last(&self) -> Option<Point> {
        let k = self.primitives.len().checked_sub(1)?;
        Some(self.position(k, self.ends[k]))
    }

    /// Index of the primitive that holds `u`, searched outwards from `hint`.
    pub(super) fn seek(&self, hint: usize, u: f64) -> usize {
        let last = self.ends.len() - 1;
        let hint = hint.min(last);
        if u < self.start_of(hint) {
            return self.ends[..hint].partition_point(|&e| e <= u);
        }
        let mut reach = 1;
        while hint + reach < last && self.ends[hint + reach] <= u {
            reach *= 2;
        }
        let stop = (hint + reach + 1).min(last);
        hint + self.ends[hint..stop].partition_point(|&e| e <= u)
    }

    /// Whether joint `k` (start of primitive `k`) is a true corner: sharper than the tolerance can hide, with
    /// both legs long enough for a rounding of their own. Gives tol / sin(theta/2).
    pub(super) fn corner(&self, k: usize) -> Option<f64> {
        if k == 0 || k >= self.primitives.len() {
            return None;
        }
        let sine = (0.5 * self.primitives[k].turn).sin();
        let tolerance = self.primitives[k].tolerance.min(self.primitives[k - 1].tolerance);
        (self.length_of(k).min(self.length_of(k - 1)) * sine > CORNER_LEG * tolerance)
            .then_some(tolerance / sine)
    }

    /// Cuts the contour in two at the start of primitive `k`.
    pub(super) fn cut(mut self, k: usize) -> (Contour, Contour) {
        let offset = self.start_of(k);
        let tail = Contour {
            primitives: self.primitives.split_off(k),
            ends: self.ends.split_off(k).into_iter().map(|e| e - offset).collect(),
        };
        (self, tail)
    }

    /// Makes the contour `length` long in u.
    pub(super) fn stretch_to(&mut self, length: f64) {
        let ratio = length / self.length();
        for p in &mut self.primitives {
            p.stretch(ratio);
        }
        for e in &mut self.ends {
            *e *= ratio;
        }
        if let Some(e) = self.ends.last_mut() {
            *e = length;
        }
    }

    /// Moves the ends by the two offsets and every place between them linearly, so that lines stay lines.
    pub(super) fn shift(&mut self, first: &Point, last: &Point, metric: &Metric) {
        let length = self.length();
        let gradient: Point = std::array::from_fn(|a| (last[a] - first[a]) / length);
        let mut u = 0.0;
        for (p, &end) in self.primitives.iter_mut().zip(&self.ends) {
            for a in 0..MAX_AXES {
                p.start[a] += first[a] + gradient[a] * u;
                p.slope[a] += gradient[a];
            }
            p.shift = metric.size(first, p.tolerance).max(metric.size(last, p.tolerance));
            u = end;
        }
    }
}

/// Euclidean norm over all axes.
pub(super) fn norm(v: &Point) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Euclidean distance over all axes.
pub(super) fn distance(a: &Point, b: &Point) -> f64 {
    norm(&std::array::from_fn(|i| b[i] - a[i]))
}

/// Angle between two unit vectors [rad], accurate near 0 and near pi.
pub(super) fn angle(a: &Point, b: &Point) -> f64 {
    let sum: Point = std::array::from_fn(|i| a[i] + b[i]);
    2.0 * distance(a, b).atan2(norm(&sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(lengths: &[f64]) -> Contour {
        let mut contour = Contour::default();
        let mut at = [0.0; MAX_AXES];
        for &length in lengths {
            let mut end = at;
            end[0] += length;
            let (p, l) = Primitive::line(&at, &end, 0.01, None, 1);
            contour.push(p, l);
            at = end;
        }
        contour
    }

    #[test]
    fn seek_agrees_with_a_linear_search_from_any_hint() {
        let contour = row(&[1.0, 0.5, 2.0, 0.25, 4.0, 1.0, 1.0]);
        for i in 0..=100 {
            let u = contour.length() * f64::from(i) / 100.0;
            let expected = contour.ends.iter().position(|&e| e > u).unwrap_or(contour.ends.len() - 1);
            for hint in 0..contour.ends.len() + 2 {
                assert_eq!(contour.seek(hint, u), expected, "u = {u}, hint {hint}");
            }
        }
    }

    #[test]
    fn cutting_keeps_positions() {
        let contour = row(&[1.0, 2.0, 3.0]);
        let (before, after) = contour.cut(1);
        assert_eq!(before.last(), after.first());
        assert_eq!(after.length(), 5.0);
        assert_eq!(after.position(1, 2.5)[0], 3.5);
    }

    #[test]
    fn an_arc_starts_and_ends_where_the_program_says_and_has_unit_speed() {
        let arc = Arc {
            plane: [0, 1],
            centre: [1.0, 1.0],
            radius: 2.0,
            radius_change: 0.001,
            start_angle: 0.5,
            sweep: -4.0,
        };
        let at = |t: f64, z: f64| {
            let (r, a) = (2.0 + 0.001 * t, 0.5 - 4.0 * t);
            let mut p = [0.0; MAX_AXES];
            (p[0], p[1], p[2]) = (1.0 + r * a.cos(), 1.0 + r * a.sin(), z);
            p
        };
        let (start, end) = (at(0.0, 0.0), at(1.0, 3.0));
        let (p, length) = Primitive::arc(&start, &end, &arc, 0.01, None, 1);
        assert!(distance(&p.position(0.0), &start) < 1e-12 && distance(&p.position(length), &end) < 1e-12);
        let step = 1e-4;
        let speed = distance(&p.position(2.0), &p.position(2.0 + step)) / step;
        assert!((speed - 1.0).abs() < 1e-3, "{speed}");
    }

    #[test]
    fn angles_are_accurate_at_both_ends() {
        let unit = |a: f64| {
            let mut p = [0.0; MAX_AXES];
            (p[0], p[1]) = (a.cos(), a.sin());
            p
        };
        for a in [1e-9, 1.0, std::f64::consts::PI - 1e-9] {
            assert!((angle(&unit(0.0), &unit(a)) - a).abs() < 1e-15, "{a}");
        }
    }
}

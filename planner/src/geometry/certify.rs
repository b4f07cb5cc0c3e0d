//! How far a spline can be from the contour, proven with Bernstein coefficients.
//!
//! On the overlap of one span and one primitive the difference r(u) - C(u) is a cubic, exactly on lines and up
//! to a bounded remainder on arcs; its Bezier points hold it in their convex hull, so the longest of them bounds
//! the distance. Halving the overlap closes the gap quadratically. Comparing at equal u bounds both Hausdorff
//! distances (and Frechet's) at once: each point of either curve has its partner on the other.

use super::contour::{Contour, Primitive};
use super::grid_path::GridPath;
use super::section::Deviation;
use crate::job::machine::{AxisKind, MAX_AXES, Machine, Point};
use crate::tolerances::{DEVIATION_ROUNDING, DEVIATION_TIGHTNESS, ROUNDING_SHARE};

/// Deepest halving of one overlap.
const DEPTH: u32 = 12;

/// How distances are measured: linear axes together, rotary axes together, scaled to the linear tolerance.
#[derive(Clone, Debug)]
pub(super) struct Metric {
    /// Number of axes.
    pub axes: usize,
    linear: [f64; MAX_AXES],
    rotary: [f64; MAX_AXES],
    has_rotary: bool,
    tolerance_mm: f64,
    tolerance_rotary: f64,
    tightest: f64,
}

impl Metric {
    /// The metric of a machine.
    pub(super) fn new(machine: &Machine) -> Self {
        let mut m = Self {
            axes: machine.axes.len().min(MAX_AXES),
            linear: [0.0; MAX_AXES],
            rotary: [0.0; MAX_AXES],
            has_rotary: false,
            tolerance_mm: machine.tolerance_mm,
            tolerance_rotary: machine.tolerance_rotary,
            tightest: 0.0,
        };
        let (mut linear, mut rotary) = (0.0f64, 0.0f64);
        for (a, axis) in machine.axes.iter().take(MAX_AXES).enumerate() {
            let count = 1.0 / axis.counts_per_unit;
            match axis.kind {
                AxisKind::Linear => (m.linear[a], linear) = (1.0, linear.hypot(count)),
                AxisKind::Rotary => (m.rotary[a], rotary, m.has_rotary) = (1.0, rotary.hypot(count), true),
            }
        }
        m.tolerance_mm = m.tolerance_mm.max(linear);
        m.tolerance_rotary = m.tolerance_rotary.max(rotary);
        m.tightest = linear;
        if m.has_rotary {
            m.tightest = linear.max(rotary * m.tolerance_mm / m.tolerance_rotary);
        }
        m
    }

    /// The tightest tolerance a path can keep whose ends are whole counts [mm]: twice what rounding them costs.
    pub(super) fn tightest(&self) -> f64 {
        self.tightest
    }

    /// Whether axis `a` is linear.
    pub(super) fn is_linear(&self, a: usize) -> bool {
        self.linear[a] > 0.0
    }

    /// Millimetres per rotary unit where the linear tolerance is `tolerance`. Rotary axes get their full
    /// tolerance under the machine's linear tolerance or a wider one, and their share of it under a tighter one.
    pub(super) fn rotary_scale(&self, tolerance: f64) -> f64 {
        tolerance.max(self.tolerance_mm) / self.tolerance_rotary
    }

    /// Size of a difference [mm], where the linear tolerance is `tolerance`.
    pub(super) fn size(&self, d: &Point, tolerance: f64) -> f64 {
        let sum = |mask: &[f64; MAX_AXES]| (0..self.axes).map(|a| mask[a] * d[a] * d[a]).sum::<f64>();
        let linear = sum(&self.linear).sqrt();
        if !self.has_rotary {
            return linear;
        }
        linear.max(sum(&self.rotary).sqrt() * self.rotary_scale(tolerance))
    }
}

/// One span of a spline in power form about its first point, x in [0, 1].
#[derive(Clone, Debug)]
pub(super) struct SpanCurve {
    /// Where the span starts in u.
    pub start: f64,
    /// Its length in u.
    pub length: f64,
    origin: Point,
    power: [Point; 3],
    axes: usize,
}

impl SpanCurve {
    /// From the Bezier points of the span.
    pub(super) fn new(start: f64, length: f64, b: &[Point; 4], axes: usize) -> Self {
        let mut power = [[0.0; MAX_AXES]; 3];
        for a in 0..axes {
            let (d0, d1, d2) = (b[1][a] - b[0][a], b[2][a] - b[1][a], b[3][a] - b[2][a]);
            power[0][a] = 3.0 * d0;
            power[1][a] = 3.0 * (d1 - d0);
            power[2][a] = d2 - 2.0 * d1 + d0;
        }
        Self { start, length, origin: b[0], power, axes }
    }

    /// The Bezier points of the span.
    pub(super) fn points(&self) -> [Point; 4] {
        let [p, q, r] = &self.power;
        let o = &self.origin;
        [
            *o,
            std::array::from_fn(|a| o[a] + p[a] / 3.0),
            std::array::from_fn(|a| o[a] + (2.0 * p[a] + q[a]) / 3.0),
            std::array::from_fn(|a| o[a] + p[a] + q[a] + r[a]),
        ]
    }

    /// Derivative with respect to u at the normalised place x.
    pub(super) fn derivative(&self, x: f64) -> Point {
        let p = &self.power;
        std::array::from_fn(|a| (p[0][a] + x * (2.0 * p[1][a] + x * 3.0 * p[2][a])) / self.length)
    }

    /// Bezier points of r - C on [from, to] in u, and a bound on what they leave out.
    fn difference(&self, from: f64, to: f64, p: &Primitive, origin: f64) -> ([Point; 4], f64) {
        let (t, w) = ((from - self.start) / self.length, (to - from) / self.length);
        let (x, dx) = (from - origin, to - from);
        let mut d = [[0.0; MAX_AXES]; 4];
        let slopes = p.slope.iter().zip(&p.start).take(self.axes);
        for (a, (slope, start)) in slopes.enumerate() {
            let [p1, p2, p3] = [self.power[0][a], self.power[1][a], self.power[2][a]];
            let value = self.origin[a] - start - slope * x + t * (p1 + t * (p2 + t * p3));
            let q1 = w * (p1 + t * (2.0 * p2 + 3.0 * t * p3)) - slope * dx;
            let (q2, q3) = (w * w * (p2 + 3.0 * t * p3), w * w * w * p3);
            d[0][a] = value;
            d[1][a] = value + q1 / 3.0;
            d[2][a] = value + (2.0 * q1 + q2) / 3.0;
            d[3][a] = value + q1 + q2 + q3;
        }
        let Some(round) = &p.round else { return (d, 0.0) };
        // Cubic Hermite interpolation leaves at most max|f''''| h^4 / 384.
        let ((e0, s0), (e1, s1)) = (round.at(x), round.at(x + dx));
        for (k, &a) in round.plane.iter().enumerate() {
            d[0][a] -= e0[k];
            d[1][a] -= e0[k] + s0[k] * dx / 3.0;
            d[2][a] -= e1[k] - s1[k] * dx / 3.0;
            d[3][a] -= e1[k];
        }
        (d, round.fourth(x + dx) * dx.powi(4) / 384.0)
    }
}

/// The part of primitive `k` on a span, in u.
fn overlap(curve: &SpanCurve, contour: &Contour, k: usize) -> (f64, f64) {
    let end = curve.start + curve.length;
    (curve.start.max(contour.start_of(k)), end.min(contour.ends[k]).max(curve.start))
}

/// Whether the span stays within what each primitive leaves to the fit. `first` is the primitive at the start of
/// the span.
pub(super) fn within(curve: &SpanCurve, contour: &Contour, first: usize, metric: &Metric) -> bool {
    let end = curve.start + curve.length;
    (first..contour.primitives.len()).take_while(|&k| contour.start_of(k) < end).all(|k| {
        let p = &contour.primitives[k];
        let (from, to) = overlap(curve, contour, k);
        let allowed = p.tolerance * (1.0 - ROUNDING_SHARE) - p.slack - p.shift;
        piece_within(curve, p, contour.start_of(k), [from, to], metric, allowed, DEPTH)
    })
}

fn piece_within(
    curve: &SpanCurve,
    p: &Primitive,
    origin: f64,
    [from, to]: [f64; 2],
    metric: &Metric,
    allowed: f64,
    depth: u32,
) -> bool {
    let (d, remainder) = curve.difference(from, to, p, origin);
    let size = |v: &Point| metric.size(v, p.tolerance);
    if size(&d[0]) > allowed || size(&d[3]) > allowed {
        return false;
    }
    if size(&d[1]).max(size(&d[2])) + remainder <= allowed
        && size(&d[0]).max(size(&d[3])) + remainder <= allowed
    {
        return true;
    }
    let middle = 0.5 * (from + to);
    depth > 0
        && piece_within(curve, p, origin, [from, middle], metric, allowed, depth - 1)
        && piece_within(curve, p, origin, [middle, to], metric, allowed, depth - 1)
}

/// Upper bound of the distance on [from, to]: at most `floor`, or within a per cent of the truth and, if that can
/// be proven, at most `allowed`.
fn piece_bound(
    curve: &SpanCurve,
    p: &Primitive,
    origin: f64,
    [from, to]: [f64; 2],
    metric: &Metric,
    [floor, allowed]: [f64; 2],
    depth: u32,
) -> f64 {
    let (d, remainder) = curve.difference(from, to, p, origin);
    let size = |v: &Point| metric.size(v, p.tolerance);
    let attained = size(&d[0]).max(size(&d[3]));
    let bound = attained.max(size(&d[1])).max(size(&d[2])) + remainder;
    let enough = floor.max(attained * (1.0 + DEVIATION_TIGHTNESS)).min(allowed);
    if depth == 0 || bound <= enough {
        return bound;
    }
    let middle = 0.5 * (from + to);
    let floor = floor.max(attained);
    let left = piece_bound(curve, p, origin, [from, middle], metric, [floor, allowed], depth - 1);
    left.max(piece_bound(curve, p, origin, [middle, to], metric, [floor.max(left), allowed], depth - 1))
}

/// What the certificate says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Certificate {
    /// The figures for the report.
    pub deviation: Deviation,
    /// Whether every place is within the tolerance in force there.
    pub holds: bool,
}

/// Bounds the distance of a rounded path from the programmed contour.
///
/// Rotary distances are given in millimetres by the ratio of the tolerances.
pub(super) fn certify(path: &GridPath, contour: &Contour, metric: &Metric) -> Certificate {
    let mut deviation = Deviation { tolerance_mm: 0.0, bound_mm: 0.0, line: 0 };
    let mut holds = true;
    let mut first = 0;
    for p in &contour.primitives {
        deviation.tolerance_mm = deviation.tolerance_mm.max(p.tolerance);
    }
    for span in 0..path.spans() {
        let mut b = [[0.0; MAX_AXES]; 4];
        for (axis, grid) in path.axes.iter().enumerate().take(metric.axes) {
            let (base, offsets) = path.bezier(axis, span);
            for (b, offset) in b.iter_mut().zip(offsets) {
                b[axis] = base as f64 * grid.lsb + offset;
            }
        }
        let start = path.breaks[span] as f64 * path.step;
        let length = (path.breaks[span + 1] - path.breaks[span]) as f64 * path.step;
        let curve = SpanCurve::new(start, length, &b, metric.axes);
        first = contour.seek(first, start);
        for k in first..contour.primitives.len() {
            if contour.start_of(k) >= start + length {
                break;
            }
            let p = &contour.primitives[k];
            let (from, to) = overlap(&curve, contour, k);
            let rounding = DEVIATION_ROUNDING * b[0].iter().fold(length, |m, v| m.max(v.abs()));
            let fixed = p.slack + p.shift + rounding * metric.rotary_scale(p.tolerance).max(1.0);
            let allowed = p.tolerance - fixed;
            // Below a thousandth of the tolerance nobody cares how tight the bound is.
            let floor = (deviation.bound_mm - fixed).max(0.1 * DEVIATION_TIGHTNESS * p.tolerance);
            let goal = [floor, allowed];
            let bound = fixed + piece_bound(&curve, p, contour.start_of(k), [from, to], metric, goal, DEPTH);
            holds &= bound <= p.tolerance;
            if bound > deviation.bound_mm {
                (deviation.bound_mm, deviation.line) = (bound, p.line);
            }
        }
    }
    Certificate { deviation, holds }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: Point = [1.0; MAX_AXES];

    fn metric() -> Metric {
        Metric {
            axes: 2,
            linear: ONE,
            rotary: [0.0; MAX_AXES],
            has_rotary: false,
            tolerance_mm: 0.01,
            tolerance_rotary: 1.0,
            tightest: 0.0,
        }
    }

    /// A span from (0, 0) to (3, 0) whose second axis is the given Bernstein polynomial.
    fn span(y: [f64; 4]) -> SpanCurve {
        let b = std::array::from_fn(|k| {
            let mut p = [0.0; MAX_AXES];
            (p[0], p[1]) = (k as f64, y[k]);
            p
        });
        SpanCurve::new(0.0, 3.0, &b, 2)
    }

    fn line(tolerance: f64) -> Contour {
        let mut end = [0.0; MAX_AXES];
        end[0] = 3.0;
        let (p, length) = Primitive::line(&[0.0; MAX_AXES], &end, tolerance, None, 7);
        let mut contour = Contour::default();
        contour.push(p, length);
        contour
    }

    #[test]
    fn a_bulge_is_bounded_by_its_height_not_by_its_control_points() {
        // 3 t (1 - t) peaks at 3/4 of the control points' height.
        let curve = span([0.0, 1.0, 1.0, 0.0]);
        let contour = line(1.0);
        let bound =
            piece_bound(&curve, &contour.primitives[0], 0.0, [0.0, 3.0], &metric(), [0.0, 1.0], DEPTH);
        assert!((0.75..0.75 * (1.0 + DEVIATION_TIGHTNESS)).contains(&bound), "{bound}");
    }

    #[test]
    fn within_separates_just_inside_from_just_outside() {
        let curve = span([0.0, 1.0, 1.0, 0.0]);
        let height = 0.75 / (1.0 - ROUNDING_SHARE);
        assert!(within(&curve, &line(height * 1.0001), 0, &metric()));
        assert!(!within(&curve, &line(height * 0.9999), 0, &metric()));
    }

    #[test]
    fn a_chord_of_an_arc_is_off_by_its_sagitta() {
        use crate::job::program::Arc;
        let (radius, half) = (1.0, 0.3f64);
        let arc = Arc {
            plane: [0, 1],
            centre: [0.0; 2],
            radius,
            radius_change: 0.0,
            start_angle: -half,
            sweep: 2.0 * half,
        };
        let (mut start, mut end) = ([0.0; MAX_AXES], [0.0; MAX_AXES]);
        (start[0], start[1]) = (half.cos(), -half.sin());
        (end[0], end[1]) = (half.cos(), half.sin());
        let (p, length) = Primitive::arc(&start, &end, &arc, 1.0, None, 1);
        let b =
            std::array::from_fn(|k| std::array::from_fn(|a| start[a] + (end[a] - start[a]) * k as f64 / 3.0));
        let curve = SpanCurve::new(0.0, length, &b, 2);
        let bound = piece_bound(&curve, &p, 0.0, [0.0, length], &metric(), [0.0, 1.0], DEPTH);
        let sagitta = radius * (1.0 - half.cos());
        assert!((sagitta..sagitta * 1.02).contains(&bound), "{bound} for {sagitta}");
    }
}

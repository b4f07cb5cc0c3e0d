//! One cubic piece of the axis' spline about an integer base.

use protocol::table::control::ControlReader;
use protocol::table::geometry::GeometryReader;
use protocol::table::rules::MAX_CONTROL_STEP;
use protocol::table::{Stream, TableError};

use super::Setpoint;
use super::law::PathState;
use crate::math::nearest;
use crate::proof::Slopes;
use crate::table::TableView;

/// position = base + c0 + c1 x + c2 x^2 + c3 x^3 [counts].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cubic {
    base: i64,
    power: [f32; 4],
    /// 2 c2, 3 c3 and 6 c3: for the derivatives.
    steep: [f32; 3],
}

/// Added to a number, it leaves no room for its fraction: the sum's bits are those of the constant plus the nearest integer.
const WHOLE: f32 = 12_582_912.0;

/// The geometry span that plays.
///
/// A cubic B-spline span depends on four control points and on the lengths of five geometry spans: itself and
/// two on either side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PieceCursor {
    geometry: GeometryReader,
    controls: ControlReader,
    /// Lengths [grid steps]; 0 outside the path, where the end knots coincide.
    lengths: [u32; 5],
    /// Control points [2^-f counts].
    points: [i64; 4],
    /// The piece from its start; on the last geometry span, also from its end.
    forward: Cubic,
    backward: Cubic,
}

impl PieceCursor {
    /// The first geometry span.
    pub(crate) fn start(view: &TableView<'_>) -> Result<Self, TableError> {
        let mut cursor = Self {
            geometry: GeometryReader::default(),
            controls: ControlReader::default(),
            lengths: [0; 5],
            points: [0; 4],
            forward: Cubic::default(),
            backward: Cubic::default(),
        };
        if let Some(joint) = &view.header.joint {
            let [a, b] = joint.lengths;
            cursor.lengths = [0, 0, 0, a, b];
        }
        cursor.points[3] = cursor.controls.next(view.controls)?;
        for _ in 0..2 {
            cursor.next_point(view)?;
            cursor.next_length(view)?;
        }
        cursor.advance(view)?;
        Ok(cursor)
    }

    /// Goes to the next geometry span.
    pub(crate) fn advance(&mut self, view: &TableView<'_>) -> Result<(), TableError> {
        self.next_point(view)?;
        self.next_length(view)?;
        self.set_up(view);
        Ok(())
    }

    fn next_point(&mut self, view: &TableView<'_>) -> Result<(), TableError> {
        let index = self.controls.index();
        let point = self.controls.next(view.controls)?;
        let [_, b, c, d] = self.points;
        let step = point.saturating_sub(d).unsigned_abs();
        if step >= MAX_CONTROL_STEP.unsigned_abs() << view.axis.fraction_bits.min(32) {
            return Err(TableError::ControlStep { index });
        }
        self.points = [b, c, d, point];
        Ok(())
    }

    fn next_length(&mut self, view: &TableView<'_>) -> Result<(), TableError> {
        let more = self.geometry.index() < view.header.geometry_spans;
        let length = if more { self.geometry.next(view.geometry)?.length } else { 0 };
        let [_, b, c, d, e] = self.lengths;
        self.lengths = [b, c, d, e, length];
        Ok(())
    }

    /// Power coefficients from the control points of the derivatives (de Boor): the second derivative at a knot
    /// is the same number from both sides, and a short span keeps its precision beside a long one.
    fn set_up(&mut self, view: &TableView<'_>) {
        let [l0, l1, l2, l3, l4] = self.lengths;
        let [p0, p1, p2, p3] = self.points;
        let (step, bits) = (view.header.step(), view.axis.fraction_bits);
        let unit = 1.0 / (1u32 << bits.min(31)) as f32;
        let u = |grid: u32| grid as f32 * step;
        let sum = |a: u32, b: u32, c: u32| u(a.saturating_add(b).saturating_add(c));
        let slope = |from: i64, to: i64, over: f32| 3.0 * (to.saturating_sub(from) as f32 * unit) / over;
        let e0 = slope(p0, p1, sum(l0, l1, l2));
        let e1 = slope(p1, p2, sum(l1, l2, l3));
        let e2 = slope(p2, p3, sum(l2, l3, l4));
        let (a, h) = (u(l1), u(l2));
        let before = sum(l1, l2, 0);
        let s0 = 2.0 * (e1 - e0) / before;
        let s1 = 2.0 * (e2 - e1) / sum(l2, l3, 0);
        let c0 = (e1 * a * a - e0 * h * h) / (3.0 * before);
        let c1 = (e0 * h + e1 * a) / before;
        let c3 = (s1 - s0) / (6.0 * h);
        let split = |point: i64| (point >> bits.min(62), (point & ((1 << bits.min(62)) - 1)) as f32 * unit);
        // At the start of the path p0 is the position itself.
        let (origin, c0) = if l1 == 0 { (p0, 0.0) } else { (p1, c0) };
        let (base, rest) = split(origin);
        self.forward = Cubic::new(base, [rest + c0, c1, 0.5 * s0, c3]);
        // It may only be needed where the path ends.
        if l3 == 0 {
            let (base, rest) = split(p3);
            self.backward = Cubic::new(base, [rest, -e2, 0.5 * s1, -c3]);
        }
    }

    /// The set-point at `path` from a place `offset` [u] into the geometry span.
    #[inline]
    pub(crate) fn at(&self, offset: f32, path: PathState) -> Setpoint {
        self.forward.at(PathState { x: offset + path.x, ..path })
    }

    /// The set-point at `path` from the end of the table, on the last geometry span.
    #[inline]
    pub(crate) fn before_end(&self, path: PathState) -> Setpoint {
        self.backward.at(path)
    }

    /// Derivatives of position from `offset` on, over `h` [u].
    pub(crate) fn slopes(&self, offset: f32, h: f32) -> Slopes {
        Slopes::of(&self.forward.power, offset, h)
    }

    /// Derivatives of position from the end of the table back, over `h` [u].
    pub(crate) fn slopes_before_end(&self, h: f32) -> Slopes {
        Slopes::of(&self.backward.power, 0.0, h)
    }

    /// Two positions that the geometry span stays between [counts].
    pub(crate) fn hull(&self, view: &TableView<'_>) -> [i64; 2] {
        let h = self.lengths[2] as f32 * view.header.step();
        let [c0, c1, c2, c3] = self.forward.power;
        let third = c1 * h * (1.0 / 3.0);
        let coefficients =
            [c0, c0 + third, c0 + 2.0 * third + c2 * h * h * (1.0 / 3.0), c0 + h * (c1 + h * (c2 + h * c3))];
        let low = coefficients.iter().fold(f32::INFINITY, |low, c| low.min(*c));
        let high = coefficients.iter().fold(f32::NEG_INFINITY, |high, c| high.max(*c));
        [low, high].map(|end| self.forward.base.saturating_add(i64::from(nearest(end))))
    }

    /// The first control point, before the first [`PieceCursor::advance`].
    pub(crate) fn first_point(&self) -> i64 {
        self.points[0]
    }

    /// What the start of the geometry span depends on: lengths of it, of the one behind and of the two before it, and three
    /// control points.
    pub(crate) fn start_of_span(&self) -> ([u32; 4], [i64; 3]) {
        let [a, b, c, d, _] = self.lengths;
        let [p, q, r, _] = self.points;
        ([a, b, c, d], [p, q, r])
    }

    /// The last control point read.
    pub(crate) fn last_point(&self) -> i64 {
        self.points[3]
    }

    /// On the last geometry span: the stream holds nothing more.
    pub(crate) fn finish(&self, view: &TableView<'_>) -> Result<(), TableError> {
        let stream = Stream::Controls;
        if u64::from(self.controls.index()) != u64::from(view.header.geometry_spans) + 3 {
            return Err(TableError::Count { stream });
        }
        if !self.controls.is_at_end(view.controls) {
            return Err(TableError::LeftOver { stream });
        }
        Ok(())
    }
}

impl Cubic {
    fn new(base: i64, power: [f32; 4]) -> Self {
        let [_, _, c2, c3] = power;
        Self { base, power, steep: [2.0 * c2, 3.0 * c3, 6.0 * c3] }
    }

    #[inline]
    fn at(&self, path: PathState) -> Setpoint {
        let [c0, c1, c2, c3] = self.power;
        let [d2, d3, e3] = self.steep;
        let PathState { x, speed, acceleration } = path;
        let offset = c0 + x * (c1 + x * (c2 + x * c3));
        let first = c1 + x * (d2 + x * d3);
        let second = d2 + x * e3;
        // A piece stays within 3 2^20 counts of its base; the sum is exact to half a count, and bases are far from the ends.
        let sum = offset + WHOLE;
        let even = (sum.to_bits() as i32).wrapping_sub(WHOLE.to_bits() as i32);
        // The sum goes to the even one of two; halves go up.
        let whole = even.wrapping_add(i32::from(offset - (sum - WHOLE) >= 0.5));
        Setpoint {
            position: self.base.wrapping_add(i64::from(whole)),
            velocity: first * speed,
            acceleration: second * speed * speed + first * acceleration,
            done: false,
        }
    }
}

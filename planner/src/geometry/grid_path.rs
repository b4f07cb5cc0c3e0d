//! A C2 cubic spline whose knots and control points are integers, exactly as the feed table carries it.

/// A path r(u), u in [0, length], one cubic B-spline per axis on a common clamped knot sequence.
///
/// Knots are integer multiples of `step`, control points integer multiples of each axis' `lsb`, so this is the
/// rounded path itself: what is planned on it is planned on what the drives will play.
#[derive(Clone, Debug, PartialEq)]
pub struct GridPath {
    /// Length of one grid step in u; a power of two, so that multiples are exact.
    pub step: f64,
    /// Geometry knots [grid steps]: `breaks[0] = 0`, strictly rising, at least two. End knots count fourfold.
    pub breaks: Vec<u64>,
    /// The axes, in the machine's order.
    pub axes: Vec<GridAxis>,
}

/// Control points of one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct GridAxis {
    /// Size of one integer in axis units.
    pub lsb: f64,
    /// `breaks.len() + 2` control points [lsb].
    pub controls: Vec<i64>,
}

/// One cubic piece of one axis about an integer base: `position = base lsb + c0 + c1 x + c2 x^2 + c3 x^3`, with
/// x in u units from the start of the geometry span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Integer origin [lsb].
    pub base: i64,
    /// Power coefficients relative to the origin [axis units / u^k].
    pub power: [f64; 4],
    /// Length of the span in u.
    pub length: f64,
}

impl GridPath {
    /// Number of geometry spans.
    pub fn spans(&self) -> usize {
        self.breaks.len() - 1
    }

    /// Length of the path [grid steps].
    pub fn grid_length(&self) -> u64 {
        self.breaks.last().copied().unwrap_or(0)
    }

    /// Length of the path in u.
    pub fn length(&self) -> f64 {
        self.grid_length() as f64 * self.step
    }

    /// Knot `index` of the extended sequence seen from span `span`: offsets -2..=3 around it, clamped at the ends.
    fn knot(&self, span: usize, offset: isize) -> u64 {
        let last = self.breaks.len() as isize - 1;
        self.breaks[(span as isize + offset).clamp(0, last) as usize]
    }

    /// Bezier control points of geometry span `span` of axis `axis` about an integer base [axis units].
    ///
    /// Found by inserting the end knots (de Boor); all products are of differences, so precision does not depend
    /// on how far from the origin the path lies.
    pub fn bezier(&self, axis: usize, span: usize) -> (i64, [f64; 4]) {
        let a = &self.axes[axis];
        let base = a.controls[span + 1];
        let d = |i: usize| (a.controls[span + i] - base) as f64 * a.lsb;
        let (d0, d1, d2, d3) = (d(0), 0.0, d(2), d(3));
        let k = |o: isize| self.knot(span, o);
        let ratio = |num: u64, den: u64| num as f64 / den as f64;
        let mix = |x: f64, y: f64, w: f64| x + w * (y - x);
        let wide = k(2) - k(-1);
        let b1 = mix(d1, d2, ratio(k(0) - k(-1), wide));
        let b2 = mix(d1, d2, ratio(k(1) - k(-1), wide));
        let left = mix(d0, d1, ratio(k(0) - k(-2), k(1) - k(-2)));
        let b0 = mix(left, b1, ratio(k(0) - k(-1), k(1) - k(-1)));
        let right = mix(d2, d3, ratio(k(1) - k(0), k(3) - k(0)));
        let b3 = mix(b2, right, ratio(k(1) - k(0), k(2) - k(0)));
        (base, [b0, b1, b2, b3])
    }

    /// The cubic of geometry span `span` of axis `axis` in power form.
    pub fn piece(&self, axis: usize, span: usize) -> Piece {
        let (base, b) = self.bezier(axis, span);
        let length = (self.breaks[span + 1] - self.breaks[span]) as f64 * self.step;
        let (d0, d1, d2) = (b[1] - b[0], b[2] - b[1], b[3] - b[2]);
        let h = 1.0 / length;
        let power = [b[0], 3.0 * d0 * h, 3.0 * (d1 - d0) * h * h, (d2 - 2.0 * d1 + d0) * h * h * h];
        Piece { base, power, length }
    }

    /// Position of axis `axis` at `x` into geometry span `span` [axis units].
    pub fn position(&self, axis: usize, span: usize, x: f64) -> f64 {
        let p = self.piece(axis, span);
        p.base as f64 * self.axes[axis].lsb + p.offset(x)
    }
}

impl Piece {
    /// Position relative to the base [axis units].
    pub fn offset(&self, x: f64) -> f64 {
        let c = &self.power;
        c[0] + x * (c[1] + x * (c[2] + x * c[3]))
    }

    /// First derivative with respect to u.
    pub fn first(&self, x: f64) -> f64 {
        let c = &self.power;
        c[1] + x * (2.0 * c[2] + x * 3.0 * c[3])
    }

    /// Second derivative with respect to u.
    pub fn second(&self, x: f64) -> f64 {
        2.0 * self.power[2] + 6.0 * self.power[3] * x
    }

    /// Third derivative with respect to u.
    pub fn third(&self) -> f64 {
        6.0 * self.power[3]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uneven() -> GridPath {
        GridPath {
            step: 1.0 / 128.0,
            breaks: vec![0, 100, 150, 400, 410, 700],
            axes: vec![GridAxis {
                lsb: 1e-3,
                controls: vec![1_000_000, 1_000_400, 999_000, 1_003_000, 7, -50, 20, 1],
            }],
        }
    }

    #[test]
    fn ends_are_the_end_control_points() {
        let p = uneven();
        assert!((p.position(0, 0, 0.0) - 1000.0).abs() < 1e-12);
        assert!((p.position(0, 4, 290.0 / 128.0) - 0.001).abs() < 1e-12);
    }

    #[test]
    fn position_slope_and_curvature_are_continuous_at_inner_knots() {
        let p = uneven();
        for span in 1..p.spans() {
            let (l, r) = (p.piece(0, span - 1), p.piece(0, span));
            let join =
                |a: f64, b: f64, scale: f64| assert!((a - b).abs() < 1e-9 * scale, "{a} {b} at {span}");
            join(p.position(0, span - 1, l.length), p.position(0, span, 0.0), 1e3);
            join(l.first(l.length), r.first(0.0), 1e3);
            join(l.second(l.length), r.second(0.0), 1e6);
        }
    }

    #[test]
    fn reproduces_a_straight_line_from_its_greville_points() {
        let breaks = vec![0u64, 300, 330, 900, 1200];
        let mut knots = vec![0u64; 3];
        knots.extend(&breaks);
        knots.extend([1200; 3]);
        let controls =
            (0..breaks.len() + 2).map(|i| (knots[i + 1] + knots[i + 2] + knots[i + 3]) as i64).collect();
        let p = GridPath { step: 0.5, breaks, axes: vec![GridAxis { lsb: 1.0, controls }] };
        for s in 0..p.spans() {
            let q = p.piece(0, s);
            assert!((q.first(0.3 * q.length) - 6.0).abs() < 1e-9);
            assert!(q.second(0.0).abs() < 1e-9);
        }
    }
}

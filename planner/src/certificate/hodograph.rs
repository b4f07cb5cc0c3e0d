//! Derivatives of a rounded path and of q on one span, in Bernstein form, with the magnitude of every one.
//!
//! All differences are of integers and therefore exact, so that the rounding argument of the Bernstein forms
//! starts from numbers that are one or two roundings away from the table's.

use super::bernstein::mix;
use crate::feed::table::FeedTable;
use crate::geometry::grid_path::GridPath;

/// First, second and third derivative of one axis with respect to u, on one geometry span or a part of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hodograph {
    pub(super) first: [f64; 3],
    pub(super) second: [f64; 2],
    pub(super) third: f64,
    /// Magnitudes of the three.
    pub(super) size: [f64; 3],
}

impl Hodograph {
    /// On geometry span `span` of axis `axis`, by differences of control points (de Boor 2001, chapter X).
    pub(super) fn of(path: &GridPath, axis: usize, span: usize) -> Self {
        let (grid, b) = (&path.axes[axis], &path.breaks);
        let last = b.len() - 1;
        // Knots -2..=3 around the span, clamped at the ends.
        let k: [u64; 6] = std::array::from_fn(|i| b[(span + i).saturating_sub(2).min(last)]);
        let width = |from: usize, to: usize| (k[to] - k[from]) as f64 * path.step;
        let e: [f64; 3] = std::array::from_fn(|i| {
            let step = (grid.controls[span + i + 1] - grid.controls[span + i]) as f64;
            3.0 * step * grid.lsb / width(i, i + 3)
        });
        let (wide_left, wide_right, h) = (width(1, 3), width(2, 4), width(2, 3));
        let first = [mix(e[0], e[1], width(1, 2) / wide_left), e[1], mix(e[1], e[2], h / wide_right)];
        let second = [2.0 * (e[1] - e[0]) / wide_left, 2.0 * (e[2] - e[1]) / wide_right];
        let [a, b, c] = e.map(f64::abs);
        let sizes = [2.0 * (a + b) / wide_left, 2.0 * (b + c) / wide_right];
        let size = [a.max(b).max(c), sizes[0].max(sizes[1]), (sizes[0] + sizes[1]) / h];
        Self { first, second, third: (second[1] - second[0]) / h, size }
    }

    /// On the part between the shares `from` and `to` of the span.
    pub(super) fn part(&self, from: f64, to: f64) -> Self {
        let [a, b, c] = self.first;
        let blossom = |s: f64, t: f64| mix(mix(a, b, s), mix(b, c, s), t);
        let [d, e] = self.second;
        Self {
            first: [blossom(from, from), blossom(from, to), blossom(to, to)],
            second: [mix(d, e, from), mix(d, e, to)],
            ..*self
        }
    }

    /// The same curve travelled the other way.
    pub(super) fn reversed(&self) -> Self {
        let [a, b, c] = self.first;
        let [d, e] = self.second;
        Self { first: [-c, -b, -a], second: [e, d], third: -self.third, size: self.size }
    }
}

/// q, q'/2 and q''/2 on one inner span.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rate {
    pub(super) q: [f64; 3],
    pub(super) half_slope: [f64; 2],
    pub(super) half_curvature: f64,
    /// Magnitudes of the three.
    pub(super) size: [f64; 3],
}

impl Rate {
    /// On inner span `i` (1..=n-2) of a table.
    pub(super) fn of(table: &FeedTable, i: usize) -> Self {
        let n = table.spans();
        let (h, c) = (table.step_length(i), table.control(i));
        // Value of q, q'/2 and its magnitude at one end, whose neighbour span has length `other`.
        let end = |neighbour: usize, sign: f64| {
            let other = table.step_length(neighbour);
            if neighbour == 0 || neighbour == n - 1 {
                let code = table.codes[if neighbour == 0 { 0 } else { n - 3 }];
                let q = table.value(code);
                let slope = (2.0 / 3.0) * q / other;
                (q, sign * slope, slope)
            } else {
                let d = table.control(neighbour);
                ((d * h + c * other) / (h + other), sign * (c - d) / (h + other), (c + d) / (h + other))
            }
        };
        let (left, slope_left, size_left) = end(i - 1, 1.0);
        let (right, slope_right, size_right) = end(i + 1, -1.0);
        Self {
            q: [left, c, right],
            half_slope: [slope_left, slope_right],
            half_curvature: (slope_right - slope_left) / h,
            size: [left.max(c).max(right), size_left.max(size_right), (size_left + size_right) / h],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feed::table::SpanLaw;
    use crate::geometry::grid_path::GridAxis;

    fn table() -> FeedTable {
        let controls = vec![5, 1000, 2100, 2900, 4200, 5000, 5050];
        let path = GridPath {
            step: 1.0 / 64.0,
            breaks: vec![0, 60, 190, 440, 640],
            axes: vec![GridAxis { lsb: 1e-3, controls }],
        };
        let codes = vec![900, 2000, 2500, 2100, 800];
        FeedTable { path, steps: vec![20, 40, 130, 250, 100, 80, 20], q_scale: 1e-5, codes }
    }

    #[test]
    fn hodographs_agree_with_the_power_form() {
        let t = table();
        for span in 0..t.path.spans() {
            let piece = t.path.piece(0, span);
            let part = Hodograph::of(&t.path, 0, span).part(0.25, 0.75);
            let back = part.reversed();
            let (a, b) = (0.25 * piece.length, 0.75 * piece.length);
            for (got, want) in [
                (part.first[0], piece.first(a)),
                (part.first[2], piece.first(b)),
                (part.second[0], piece.second(a)),
                (part.second[1], piece.second(b)),
                (part.third, piece.third()),
                (back.first[0], -piece.first(b)),
                (back.second[0], piece.second(b)),
            ] {
                assert!((got - want).abs() < 1e-11 * (1.0 + want.abs()), "{got} {want}");
            }
        }
    }

    #[test]
    fn rates_agree_with_the_law() {
        let t = table();
        for i in 1..t.spans() - 1 {
            let SpanLaw::Quadratic { h, q: [alpha, beta, gamma] } = t.law(i) else { panic!() };
            let r = Rate::of(&t, i);
            let scale = r.size[0];
            assert!((r.q[0] - alpha).abs() < 1e-12 * scale);
            assert!((r.q[2] - (alpha + h * (beta + h * gamma))).abs() < 1e-12 * scale);
            assert!((2.0 * r.half_slope[0] - beta).abs() < 1e-12 * r.size[1]);
            assert!((r.half_curvature - gamma).abs() < 1e-12 * r.size[2]);
        }
    }
}

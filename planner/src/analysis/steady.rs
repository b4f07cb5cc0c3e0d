//! A path travelled at one speed: how long it is, and how fast that speed may be.

use crate::geometry::grid_path::{GridPath, Piece};
use crate::job::machine::AxisLimits;

/// Nodes and weights of the Gauss-Legendre rule of five points on [-1, 1] (Abramowitz and Stegun, table 25.4).
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// Places of a geometry span that are looked at for the largest speed, both ends among them.
const PLACES: u32 = 9;

/// Euclidean length of the path over the axes of the bit mask `counted` [axis units].
pub fn arc_length(path: &GridPath, counted: u16) -> f64 {
    let axes: Vec<usize> = (0..path.axes.len()).filter(|a| counted >> a & 1 == 1).collect();
    let mut pieces: Vec<Piece> = Vec::with_capacity(axes.len());
    (0..path.spans())
        .map(|span| {
            pieces.clear();
            pieces.extend(axes.iter().map(|&axis| path.piece(axis, span)));
            let half = 0.5 * (path.breaks[span + 1] - path.breaks[span]) as f64 * path.step;
            let slope = |x: f64| pieces.iter().map(|p| p.first(x).powi(2)).sum::<f64>().sqrt();
            half * GAUSS.iter().map(|(node, weight)| weight * slope(half * (1.0 + node))).sum::<f64>()
        })
        .sum()
}

/// The largest Euclidean speed over the axes of the bit mask `counted` that keeps every axis within its limits when
/// it is held all along the path, ramps at the ends apart [axis units/s].
///
/// Looked at in nine places of every geometry span, so a hair too large where a limit is nearest between two of them;
/// a plan under this cap keeps the limits there all the same. Zero where the path stands still in the counted axes.
pub fn largest_steady_speed(path: &GridPath, limits: &[AxisLimits], counted: u16) -> f64 {
    let mut largest = f64::INFINITY;
    let mut pieces: Vec<Piece> = Vec::with_capacity(path.axes.len());
    for span in 0..path.spans() {
        pieces.clear();
        pieces.extend((0..path.axes.len()).map(|axis| path.piece(axis, span)));
        for k in 0..PLACES {
            let x = f64::from(k) / f64::from(PLACES - 1) * pieces.first().map_or(0.0, |p| p.length);
            largest = largest.min(speed_at(&pieces, x, limits, counted));
        }
    }
    if largest.is_finite() { largest } else { 0.0 }
}

/// The largest steady speed at one place: the derivatives of each axis with respect to the length s along the counted
/// axes, by the chain rule with u' = 1/|r'|, bound the speed by V/|p_s|, (A/|p_ss|)^(1/2) and (J/|p_sss|)^(1/3).
fn speed_at(pieces: &[Piece], x: f64, limits: &[AxisLimits], counted: u16) -> f64 {
    let [mut first, mut mixed, mut bent] = [0.0; 3];
    for (_, p) in pieces.iter().enumerate().filter(|(a, _)| counted >> a & 1 == 1) {
        let (d1, d2, d3) = (p.first(x), p.second(x), p.third());
        first += d1 * d1;
        mixed += d1 * d2;
        bent += d2 * d2 + d1 * d3;
    }
    // s'(u) and its first two derivatives.
    let s1 = first.sqrt();
    let s2 = mixed / s1;
    let s3 = (bent - s2 * s2) / s1;
    let u1 = 1.0 / s1;
    let u2 = -s2 * u1.powi(3);
    let u3 = 3.0 * s2 * s2 * u1.powi(5) - s3 * u1.powi(4);
    pieces
        .iter()
        .zip(limits)
        .map(|(p, l)| {
            let (d1, d2, d3) = (p.first(x), p.second(x), p.third());
            let velocity = (d1 * u1).abs();
            let acceleration = (d2 * u1 * u1 + d1 * u2).abs();
            let jerk = (d3 * u1.powi(3) + 3.0 * d2 * u1 * u2 + d1 * u3).abs();
            (l.velocity / velocity).min((l.acceleration / acceleration).sqrt()).min((l.jerk / jerk).cbrt())
        })
        .fold(f64::INFINITY, |least, v| if v.is_nan() { least } else { least.min(v) })
        .min(if s1 > 0.0 { f64::INFINITY } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::grid_path::GridAxis;
    use crate::splines::cubic::{CubicSystem, Ends};
    use crate::splines::grid::KnotGrid;
    use proptest::prelude::*;

    const R: f64 = 20.0;

    /// A circle of radius 20 mm in X and Y through 120 places, its parameter stretched by a wave, and a still Z.
    fn circle(wave: f64) -> GridPath {
        let n = 120;
        let grid = KnotGrid::new(&vec![1.0; n], 1.0 / 4096.0);
        let system = CubicSystem::new(grid.lengths(), Ends::Periodic).unwrap();
        let angle = |i: usize| {
            let t = std::f64::consts::TAU * i as f64 / n as f64;
            t + wave * t.sin()
        };
        let breaks = grid.breaks(Ends::Periodic, &vec![1; n]);
        let axis = |place: fn(f64) -> f64| {
            let mut values: Vec<f64> = (0..=n).map(|i| R * place(angle(i))).collect();
            values[n] = values[0];
            let spline = system.interpolate(&values, [0.0; 2]).unwrap();
            let controls =
                grid.controls(&spline, &breaks).into_iter().map(|c| (c * 1e8).round() as i64).collect();
            GridAxis { lsb: 1e-8, controls }
        };
        let still = GridAxis { lsb: 1e-3, controls: vec![700; breaks.len() + 2] };
        GridPath {
            step: grid.step,
            breaks: breaks.iter().map(|b| b.at).collect(),
            axes: vec![axis(f64::cos), axis(f64::sin), still],
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        /// On a circle V, (A R)^(1/2) and (J R^2)^(1/3) bound the speed, however the parameter runs.
        #[test]
        fn a_circle_is_bound_by_its_radius_in_any_parameter(
            wave in 0.0..0.3f64, velocity in 20.0..300.0f64, acceleration in 100.0..4000.0f64, jerk in 1e3..1e6f64,
        ) {
            let path = circle(wave);
            let limits = [AxisLimits { velocity, acceleration, jerk }; 3];
            let expected = velocity.min((acceleration * R).sqrt()).min((jerk * R * R).cbrt());
            let found = largest_steady_speed(&path, &limits, 0b011);
            prop_assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
            prop_assert!((arc_length(&path, 0b011) / (std::f64::consts::TAU * R) - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn a_path_that_does_not_move_the_counted_axes_has_no_speed() {
        let limits = [AxisLimits { velocity: 1.0, acceleration: 1.0, jerk: 1.0 }; 3];
        assert_eq!(largest_steady_speed(&circle(0.0), &limits, 0b100), 0.0);
        assert_eq!(arc_length(&circle(0.0), 0b100), 0.0);
    }
}

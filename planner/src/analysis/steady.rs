//! A path travelled at one speed: how long it is, and how fast that speed may be.

use crate::geometry::grid_path::{GridPath, Piece};
use crate::geometry::section::{FeedCap, SpeedCap};
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
            let at = |node: f64| slope(&pieces, half * (1.0 + node), u16::MAX);
            half * GAUSS.iter().map(|&(node, weight)| weight * at(node)).sum::<f64>()
        })
        .sum()
}

/// The largest Euclidean speed over the axes of the bit mask `counted` that keeps every axis within its limits, and
/// the path speed below its caps, when it is held all along the path, ramps at the ends apart [axis units/s].
///
/// Looked at in nine places of every geometry span, so a hair too large where a limit is nearest between two of them;
/// a plan under this cap keeps the limits there all the same. Zero where the path stands still in the counted axes.
pub fn largest_steady_speed(path: &GridPath, limits: &[AxisLimits], caps: &[FeedCap], counted: u16) -> f64 {
    let mut largest = f64::INFINITY;
    let mut cap = 0;
    let mut pieces: Vec<Piece> = Vec::with_capacity(path.axes.len());
    for span in 0..path.spans() {
        pieces.clear();
        pieces.extend((0..path.axes.len()).map(|axis| path.piece(axis, span)));
        let [from, to] = [path.breaks[span], path.breaks[span + 1]];
        for k in 0..PLACES {
            let share = f64::from(k) / f64::from(PLACES - 1);
            let place = from as f64 + share * (to - from) as f64;
            // At the end of a cap both it and the next one count.
            while caps.get(cap).is_some_and(|c| (c.until as f64) < place) {
                cap += 1;
            }
            let x = share * (to - from) as f64 * path.step;
            largest = largest.min(speed_at(&pieces, x, limits, counted));
            let met = caps.get(cap).is_some_and(|c| c.until as f64 == place);
            for c in caps.iter().skip(cap).take(1 + usize::from(met)) {
                largest = largest.min(under(c.speed, &pieces, x, counted));
            }
        }
    }
    if largest.is_finite() { largest } else { 0.0 }
}

/// |r'| over the axes of a mask.
fn slope(pieces: &[Piece], x: f64, counted: u16) -> f64 {
    let axes = pieces.iter().enumerate().filter(|(a, _)| counted >> a & 1 == 1);
    axes.map(|(_, p)| p.first(x).powi(2)).sum::<f64>().sqrt()
}

/// The largest speed over the counted axes that a cap allows at one place.
fn under(cap: SpeedCap, pieces: &[Piece], x: f64, counted: u16) -> f64 {
    match cap {
        SpeedCap::None => f64::INFINITY,
        SpeedCap::Tangential { axes, speed } if axes == counted => speed,
        SpeedCap::Tangential { axes, speed } => {
            let own = slope(pieces, x, axes);
            if own > 0.0 { speed * slope(pieces, x, counted) / own } else { f64::INFINITY }
        }
        SpeedCap::Rate(rate) => rate * slope(pieces, x, counted),
    }
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
            let found = largest_steady_speed(&path, &limits, &[], 0b011);
            prop_assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
            prop_assert!((arc_length(&path, 0b011) / (std::f64::consts::TAU * R) - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn a_path_that_does_not_move_the_counted_axes_has_no_speed() {
        let limits = [AxisLimits { velocity: 1.0, acceleration: 1.0, jerk: 1.0 }; 3];
        assert_eq!(largest_steady_speed(&circle(0.0), &limits, &[], 0b100), 0.0);
        assert_eq!(arc_length(&circle(0.0), 0b100), 0.0);
    }

    #[test]
    fn caps_bound_the_speed_where_they_hold() {
        let path = circle(0.3);
        let limits = [AxisLimits { velocity: 1e3, acceleration: 1e6, jerk: 1e9 }; 3];
        let (half, end) = (path.grid_length() / 2, path.grid_length());
        let with = |first: SpeedCap, second: SpeedCap| {
            let caps = [FeedCap { until: half, speed: first }, FeedCap { until: end, speed: second }];
            largest_steady_speed(&path, &limits, &caps, 0b011)
        };
        let tangential = |axes, speed| SpeedCap::Tangential { axes, speed };
        assert_eq!(with(SpeedCap::None, tangential(0b011, 7.0)), 7.0);
        assert_eq!(with(tangential(0b011, 3.0), tangential(0b011, 7.0)), 3.0);
        // X alone is fastest where it does all the work.
        assert!((with(SpeedCap::None, tangential(0b001, 7.0)) - 7.0).abs() < 0.01);
        // |r'| = R d(angle)/du is least in the middle, 0.7 of the mean.
        let mean = std::f64::consts::TAU * R / path.length();
        assert!((with(SpeedCap::Rate(2.0), SpeedCap::None) / (2.0 * 0.7 * mean) - 1.0).abs() < 1e-3);
        assert!((with(SpeedCap::None, SpeedCap::None) / 1e3 - 1.0).abs() < 1e-3);
    }
}

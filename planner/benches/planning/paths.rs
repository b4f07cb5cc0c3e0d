//! Random splines, the same on every run.

use planner::geometry::grid_path::{GridAxis, GridPath};
use planner::job::machine::AxisLimits;
use planner::splines::cubic::{CubicSystem, Ends};
use planner::splines::grid::KnotGrid;

/// Distance of neighbouring points [mm], and grid steps between them.
const LEG: f64 = 8.0;
const LEG_STEPS: u32 = 1 << 14;

/// Size of a control integer [mm].
const LSB: f64 = 1.0 / (1u64 << 20) as f64;

/// Largest change of heading per leg and axis.
const TURN: f64 = 0.8;

/// The same limits on every axis: 100 mm/s, 500 mm/s^2, 10 000 mm/s^3.
pub(crate) fn limits(axes: usize) -> Vec<AxisLimits> {
    vec![AxisLimits { velocity: 100.0, acceleration: 500.0, jerk: 10_000.0 }; axes]
}

/// The natural cubic spline through points 8 mm apart whose heading wanders at random, `legs` geometry spans.
pub(crate) fn random_spline(axes: usize, legs: usize) -> GridPath {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut sway = || {
        // A linear congruential generator with Knuth's multiplier (MMIX); its upper bits are good.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut heading: Vec<f64> = (0..axes).map(|_| sway()).collect();
    let mut points = vec![vec![0.0]; axes];
    for leg in 0..legs {
        heading.iter_mut().for_each(|h| *h += TURN * sway());
        let norm = heading.iter().map(|h| h * h).sum::<f64>().sqrt();
        for (h, points) in heading.iter_mut().zip(&mut points) {
            *h /= norm;
            points.push(points[leg] + *h * LEG);
        }
    }
    let grid = KnotGrid::new(&vec![LEG; legs], LEG / f64::from(LEG_STEPS));
    let system = CubicSystem::new(grid.lengths(), Ends::Natural).expect("two points or more");
    let breaks = grid.breaks(Ends::Natural, &vec![1; legs]);
    let axes = points
        .iter()
        .map(|values| {
            let spline = system.interpolate(values, [0.0; 2]).expect("one value per knot");
            let controls = grid.controls(&spline, &breaks);
            GridAxis { lsb: LSB, controls: controls.iter().map(|c| (c / LSB).round() as i64).collect() }
        })
        .collect();
    GridPath { step: grid.step, breaks: breaks.iter().map(|b| b.at).collect(), axes }
}

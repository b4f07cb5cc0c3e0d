//! The jerk limit as it is against Zhao's linear form of it.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "helpers of tests fail as tests do")]

#[allow(dead_code, reason = "one of its paths is enough here")]
#[path = "../../planner/benches/planning/paths.rs"]
mod paths;

use planner::certificate::certify;
use planner::geometry::grid_path::{GridAxis, GridPath};
use planner::job::samples::cat_contour;
use planner::splines::cubic::{CubicSystem, Ends};
use planner::splines::grid::KnotGrid;
use planner::topp::plan;
use planner::topp::problem::{JerkForm, Problem, Settings};

/// The natural spline through points in the plane, knots by chord length.
fn spline(points: &[[f64; 2]]) -> GridPath {
    const STEP: f64 = 1.0 / 4096.0;
    const LSB: f64 = 1.0 / (1u64 << 20) as f64;
    let lengths: Vec<f64> = points.windows(2).map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1])).collect();
    let grid = KnotGrid::new(&lengths, STEP);
    let system = CubicSystem::new(grid.lengths(), Ends::Natural).unwrap();
    let breaks = grid.breaks(Ends::Natural, &vec![1; lengths.len()]);
    let axes = [0, 1]
        .map(|axis| {
            let values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
            let controls = grid.controls(&system.interpolate(&values, [0.0; 2]).unwrap(), &breaks);
            GridAxis { lsb: LSB, controls: controls.iter().map(|c| (c / LSB).round() as i64).collect() }
        })
        .to_vec();
    GridPath { step: STEP, breaks: breaks.iter().map(|b| b.at).collect(), axes }
}

/// Share of the time that the true limit saves; both plans have to keep it.
fn saved(path: &GridPath) -> f64 {
    let limits = paths::limits(path.axes.len());
    let problem = Problem { path, limits: &limits, caps: &[], control_tick_s: 1e-3 };
    let [truly, pseudo] = [JerkForm::True, JerkForm::Pseudo].map(|jerk| {
        let table = plan(&problem, &Settings { jerk, ..Settings::default() }).unwrap().table;
        assert!(certify(&table, &limits, &[]).holds, "{jerk:?}");
        table.duration()
    });
    1.0 - truly / pseudo
}

#[test]
fn the_true_jerk_limit_saves_time_on_an_outline_and_on_a_random_path() {
    let cat = saved(&spline(&cat_contour(300).unwrap()));
    let random = saved(&paths::random_spline(3, 100));
    eprintln!("outline {:.3} %, random path {:.3} %", 100.0 * cat, 100.0 * random);
    assert!((0.005..0.08).contains(&cat), "{cat}");
    assert!((0.005..0.08).contains(&random), "{random}");
}

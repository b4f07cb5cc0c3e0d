use super::*;
use crate::geometry::grid_path::{GridAxis, GridPath};
use crate::splines::cubic::CubicSystem;
use proptest::prelude::*;

const STEP: f64 = 1.0 / 64.0;

/// The spline through `values` on `grid` as a grid path with control points in units of `lsb`.
fn path(grid: &KnotGrid, spline: &Cubic<'_>, breaks: &[Break], lsb: f64) -> GridPath {
    let controls = grid.controls(spline, breaks).iter().map(|c| (c / lsb).round() as i64).collect();
    GridPath {
        step: grid.step,
        breaks: breaks.iter().map(|b| b.at).collect(),
        axes: vec![GridAxis { lsb, controls }],
    }
}

#[test]
fn lengths_are_rounded_and_never_vanish() {
    let grid = KnotGrid::new(&[1.0, 1e-9, 0.49 / 64.0, 2.01], STEP);
    assert_eq!(grid.at, [0, 64, 65, 66, 195]);
    assert_eq!(grid.lengths(), [1.0, STEP, STEP, 129.0 * STEP]);
}

#[test]
fn not_a_knot_ends_drop_two_knots_and_long_intervals_are_divided() {
    let at = |grid: &KnotGrid, ends, parts: &[u32]| -> Vec<u64> {
        grid.breaks(ends, parts).iter().map(|b| b.at).collect()
    };
    let grid = KnotGrid { step: STEP, at: vec![0, 10, 30, 60, 61, 81] };
    assert_eq!(at(&grid, Ends::Natural, &[1; 5]), grid.at);
    assert_eq!(at(&grid, Ends::NotAKnot, &[1; 5]), [0, 30, 60, 81]);
    assert_eq!(at(&grid, Ends::NotAKnot, &[2, 1, 3, 9, 1]), [0, 5, 30, 40, 50, 60, 81]);
    let short = |n: usize| KnotGrid { step: STEP, at: vec![0, 10, 30, 60][..n].to_vec() };
    assert_eq!(at(&short(2), Ends::NotAKnot, &[1; 1]), [0, 10]);
    assert_eq!(at(&short(3), Ends::NotAKnot, &[1; 2]), [0, 30]);
    assert_eq!(at(&short(4), Ends::NotAKnot, &[1; 3]), [0, 60]);
    let huge = KnotGrid { step: STEP, at: vec![0, 1 << 40] };
    let breaks = at(&huge, Ends::Natural, &[1]);
    assert!(breaks.windows(2).all(|w| w[1] - w[0] <= LONGEST_SPAN && w[1] > w[0]));
    assert_eq!(breaks.last(), Some(&(1 << 40)));
}

proptest! {
    #[test]
    fn the_grid_path_is_the_spline_to_half_a_unit(
        points in prop::collection::vec((0.05..4.0f64, -20.0..20.0f64, 1u32..4), 1..30),
        ends in prop::sample::select(vec![Ends::NotAKnot, Ends::Clamped, Ends::Natural, Ends::Periodic]),
    ) {
        prop_assume!(ends != Ends::Periodic || points.len() > 1);
        let lengths: Vec<f64> = points.iter().map(|p| p.0).collect();
        let parts: Vec<u32> = points.iter().map(|p| p.2).collect();
        let mut values: Vec<f64> = points.iter().map(|p| p.1).collect();
        values.push(if ends == Ends::Periodic { values[0] } else { 3.0 });
        let grid = KnotGrid::new(&lengths, STEP);
        let system = CubicSystem::new(grid.lengths(), ends).unwrap();
        let spline = system.interpolate(&values, [1.0, -1.0]).unwrap();
        let breaks = grid.breaks(ends, &parts);
        let lsb = 2f64.powi(-20);
        let path = path(&grid, &spline, &breaks, lsb);
        prop_assert_eq!(path.axes[0].controls.len(), path.breaks.len() + 2);
        let largest = path.axes[0].controls.iter().fold(1, |m, c| m.max(c.abs())) as f64;
        for (span, w) in path.breaks.windows(2).enumerate() {
            for share in 0..=4 {
                let at = w[0] + (w[1] - w[0]) * share / 4;
                let i = grid.at.partition_point(|&k| k <= at).clamp(1, lengths.len()) - 1;
                let wanted = spline.jet(i, (at - grid.at[i]) as f64 * STEP).value;
                let got = path.position(0, span, (at - w[0]) as f64 * STEP);
                prop_assert!((got - wanted).abs() <= lsb * (0.5 + 1e-12 * largest), "{} {}", got, wanted);
            }
        }
    }
}

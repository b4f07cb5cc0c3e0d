//! The interior point on a winding path: what its rows promise, checked without them where that can be.

use pulp::Arch;

use super::part::PART;
use super::*;
use crate::geometry::grid_path::{GridAxis, GridPath};
use crate::job::machine::AxisLimits;
use crate::topp::problem::{JerkForm, Problem, RowForm, Settings};
use crate::topp::sweep::Sweep;
use crate::topp::{knots, start};

const V: f64 = 100.0;
const A: f64 = 500.0;
const J: f64 = 1e4;

/// Five axes that wind about each other, `spans` spans of 4 mm.
fn winding(spans: usize) -> GridPath {
    let step = 1.0 / 1024.0;
    let axes = (0..5)
        .map(|axis| {
            let at = |i: usize| {
                let phase = 0.8 * i as f64 + 1.3 * f64::from(axis);
                (1e6 * (1.5 * i as f64 + 3.0 * phase.sin())) as i64
            };
            GridAxis { lsb: 1e-6, controls: (0..spans + 3).map(at).collect() }
        })
        .collect();
    GridPath { step, breaks: (0..=spans as u64).map(|k| 4096 * k).collect(), axes }
}

/// A workspace with the whole problem loaded, given to `f` with the row source.
fn loaded<R>(jerk: JerkForm, f: impl FnOnce(&RowSource, &mut Workspace) -> R) -> R {
    let path = winding(24);
    let limits = [AxisLimits { velocity: V, acceleration: A, jerk: J }; 5];
    let problem = Problem { path: &path, limits: &limits, caps: &[], control_tick_s: 1e-3 };
    let sweep = Sweep::new(&problem);
    let (layout, _) = knots::place(&problem, &Settings::default(), &sweep).unwrap();
    let unit = sweep.q.iter().copied().fold(0.0, f64::max);
    let swept = vec![1.0; layout.unknowns()];
    let source = RowSource {
        problem,
        layout: &layout,
        unit,
        ceiling: 1.1,
        joint: [1e-3; 2],
        largest_code: 65535.0,
        swept: &swept,
        jerk,
        form: RowForm::Bernstein,
        bends: true,
    };
    let x = start::candidates(&source).remove(0).x;
    let mut work = Workspace::default();
    work.load(&source, &x, &vec![0.0; x.len()], Stretch { from: 0, to: x.len() }, |_| 0.0);
    work.scale_into().unwrap();
    f(&source, &mut work)
}

/// Largest velocity, acceleration and jerk of the loaded control values against their limits, sampled from the path.
fn ratios(source: &RowSource, c: &[f64]) -> [f64; 3] {
    const SAMPLES: usize = 16;
    let (layout, path) = (source.layout, source.problem.path);
    let mut worst = [0.0f64; 3];
    for s in 0..layout.unknowns() {
        let b = source.bezier(s).map(|row| source.unit * (0..3).map(|j| row[j] * c[s + j]).sum::<f64>());
        let h = layout.h[s + 1];
        let g = layout.geometry[s + 1] as usize;
        let from = (layout.knots[s + 1] - path.breaks[g]) as f64 * path.step;
        let bend = (b[0] - 2.0 * b[1] + b[2]) / (h * h);
        for t in (0..=SAMPLES).map(|k| k as f64 / SAMPLES as f64) {
            let q = b[0] * (1.0 - t) * (1.0 - t) + 2.0 * b[1] * t * (1.0 - t) + b[2] * t * t;
            let slope = 2.0 * ((b[1] - b[0]) * (1.0 - t) + (b[2] - b[1]) * t) / h;
            assert!(q > 0.0);
            for axis in 0..path.axes.len() {
                let piece = path.piece(axis, g);
                let x = from + t * h;
                let (p1, p2, p3) = (piece.first(x), piece.second(x), piece.third());
                let jerk = (p3 * q + 1.5 * p2 * slope + p1 * bend) * q.sqrt();
                let values = [p1 * q.sqrt() / V, (p2 * q + 0.5 * p1 * slope) / A, jerk / J];
                worst.iter_mut().zip(values).for_each(|(w, v)| *w = w.max(v.abs()));
            }
        }
    }
    worst
}

#[test]
fn every_iterate_keeps_every_limit_and_the_last_uses_them_up() {
    for jerk in [JerkForm::True, JerkForm::Pseudo] {
        loaded(jerk, |source, work| {
            let mut times = Vec::new();
            // A gap that is met at once ends the run after an iterate more or less.
            for gap in [1e3, 1.0, 0.3, 0.1, 1e-2, 1e-3, 1e-6] {
                let run = work.solve(gap);
                let kept = ratios(source, &work.best);
                assert!(kept.iter().all(|r| *r <= 1.0 + 1e-9), "{jerk:?} {gap} {kept:?}");
                assert!(run.iterations < MOST_ITERATIONS);
                work.c.clone_from(&work.best);
                work.settle();
                work.band.reset(work.c.len());
                times.push(work.total_time());
            }
            assert!(times.windows(2).all(|t| t[1] <= t[0] * (1.0 + 1e-9)), "{times:?}");
            let used = ratios(source, &work.best);
            assert!(used[1] > 0.99 && used[2] > 0.9, "{jerk:?} {used:?}");
        });
    }
}

#[test]
fn the_instruction_set_changes_no_bit() {
    let answer = |arch: Arch| {
        loaded(JerkForm::True, |_, work| {
            work.parts.arch = arch;
            let run = work.solve(1e-5);
            (run.iterations, work.moved())
        })
    };
    assert_eq!(answer(Arch::new()), answer(Arch::Scalar));
}

#[test]
fn threads_change_no_bit_within_a_window() {
    let answer = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            loaded(JerkForm::True, |_, work| {
                assert!(work.c.len() > 2 * PART, "one part alone cannot tell");
                let run = work.solve(1e-5);
                (run.iterations, work.moved())
            })
        })
    };
    let one = answer(1);
    assert_eq!(one, answer(2));
    assert_eq!(one, answer(5));
}

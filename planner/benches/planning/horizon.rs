//! Paths planned while they arrive, tables planned anew, and long paths divided in two ways.

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, Throughput};
use planner::topp::horizon::{Deadline, Horizon, HorizonSettings, pieces};
use planner::topp::problem::{Problem, Settings, Windows};
use planner::topp::retime::{Rules, retime};

use crate::paths;

/// Axes, and geometry spans of the streamed path.
const STREAMED: [(usize, usize); 2] = [(3, 400), (7, 200)];
/// Geometry spans of the table planned anew: about 300 q spans are left at the knot.
const RETIMED: usize = 42;
/// Geometry spans of the path that is divided: about 30 000 q spans.
const DIVIDED: usize = 3000;

/// Commitments, spans they hold, and how long single calls took.
struct Calls {
    spans: usize,
    window: usize,
    took: Vec<Duration>,
}

fn stream(axes: usize, geometry: usize) -> Calls {
    let (path, limits) = (paths::random_spline(axes, geometry), paths::limits(axes));
    let (start, pieces) = pieces(&path, &[], 4);
    let mut horizon =
        Horizon::new(&start, &limits, 1e-3, HorizonSettings::default()).expect("sound limits have a horizon");
    let mut calls = Calls { spans: 0, window: 0, took: Vec::new() };
    let mut drain = |horizon: &mut Horizon| {
        loop {
            let begun = Instant::now();
            let Some(commit) = horizon.advance(Deadline::NONE).expect("a smooth path has a plan") else {
                break;
            };
            calls.took.push(begun.elapsed());
            calls.spans += commit.steps.len();
            calls.window = calls.window.max(commit.window);
        }
    };
    for piece in pieces {
        horizon.push(&piece).expect("pieces of one path follow each other");
        drain(&mut horizon);
    }
    horizon.finish();
    drain(&mut horizon);
    calls
}

/// Per span: a path of some hundred geometry spans, four at a time; the worst single calls are printed.
pub(crate) fn streamed(c: &mut Criterion) {
    for (axes, geometry) in STREAMED {
        let mut calls = stream(axes, geometry);
        calls.took.sort();
        let last = calls.took.len() - 1;
        eprintln!(
            "{axes} axes streamed: {} spans in {} commitments, windows of up to {} spans; a call takes {:?} (median), \
             {:?} (99 %), {:?} (worst)",
            calls.spans,
            last + 1,
            calls.window,
            calls.took[last / 2],
            calls.took[last * 99 / 100],
            calls.took[last]
        );
        let mut group = c.benchmark_group(format!("{axes} axes"));
        group.throughput(Throughput::Elements(calls.spans as u64));
        group.bench_function(BenchmarkId::new("streamed", calls.spans), |b| {
            b.iter(|| black_box(stream(axes, geometry).spans));
        });
        group.finish();
    }
}

/// A table planned anew from its middle on under 20 % lower and 20 % higher limits.
pub(crate) fn retimed(c: &mut Criterion) {
    for axes in [3, 7] {
        let (path, limits) = (paths::random_spline(axes, RETIMED), paths::limits(axes));
        let problem = Problem { path: &path, limits: &limits, caps: &[], control_tick_s: 1e-3 };
        let table =
            planner::topp::plan(&problem, &Settings { largest_loss: f64::INFINITY, ..Settings::default() })
                .expect("a smooth path has a plan")
                .table;
        let knot = table.spans() / 4;
        let old = Rules { limits: &limits, caps: &[] };
        let mut group = c.benchmark_group(format!("{axes} axes"));
        for factor in [0.8, 1.2] {
            let mut other = limits.to_vec();
            other.iter_mut().for_each(|l| l.velocity *= factor);
            let new = Rules { limits: &other, caps: &[] };
            let again = || retime(black_box(&table), knot, old, new, 1e-3, 5e-5, Deadline::NONE);
            let found = again().expect("the motion can change its speed");
            eprintln!(
                "{axes} axes, {} of {} spans planned anew for {factor} times the speed: {:.4} s, was {:.4} s, holds from \
                 {} spans on",
                found.table.spans() - knot,
                table.spans(),
                found.table.duration(),
                table.duration(),
                found.holds_from - knot
            );
            let name = format!("retimed {factor}");
            group.bench_function(BenchmarkId::new(name, table.spans() - knot), |b| b.iter(again));
        }
        group.finish();
    }
}

/// A long path whole, in overlapping windows and spliced as in [Zhao2016 3.2]: once each, with the time lost.
pub(crate) fn divided(_: &mut Criterion) {
    let (path, limits) = (paths::random_spline(3, DIVIDED), paths::limits(3));
    let problem = Problem { path: &path, limits: &limits, caps: &[], control_tick_s: 1e-3 };
    let mut least = f64::INFINITY;
    for windows in [Windows::Whole, Windows::Overlap, Windows::Zhao] {
        let settings = Settings { windows, largest_loss: f64::INFINITY, ..Settings::default() };
        let begun = Instant::now();
        let plan = planner::topp::plan(&problem, &settings).expect("a smooth path has a plan");
        let took = begun.elapsed();
        let seconds = plan.table.duration();
        least = least.min(seconds);
        eprintln!(
            "3 axes, {} spans, {windows:?}: planned in {took:?}, {} iterations, {seconds:.6} s, {:.4} % above the \
             shortest so far",
            plan.table.spans(),
            plan.iterations,
            100.0 * (seconds / least - 1.0)
        );
    }
}

//! What planning costs, stage by stage. `cargo xtask bench` runs this.
#![allow(
    missing_docs,
    clippy::expect_used,
    reason = "criterion's macros make items; a bench stops on an error"
)]

mod horizon;
mod paths;

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use planner::certificate::certify;
use planner::geometry::sections::{PathSettings, sections};
use planner::job::gcode::{Options, Program, ProgramError};
use planner::job::machine::{LimitSet, Machine};
use planner::job::program::Item;
use planner::topp;
use planner::topp::problem::{Problem, Settings, Solver};
use planner::topp::sweep::{Samples, Sweep, Sweeper};

const MACHINE: &str = include_str!("../../../jobs/mill3.toml");
const RASTER: &str = include_str!("../../../jobs/wave.ngc");

/// How often the program repeats.
const REPEATS: usize = 20;

/// Axes and geometry spans of the paths to plan on: about 300, 1000 and 1000 spans of q.
const SIZES: [(usize, usize); 3] = [(3, 30), (3, 100), (7, 100)];

/// Axes and stations of sweeps.
const SWEEPS: [(usize, usize); 3] = [(3, 10_000), (7, 1_000), (7, 10_000)];

fn machine() -> Machine {
    Machine::from_toml(MACHINE, "mill3.toml").expect("the sample machine is sound")
}

/// The program again and again, as one; with one end.
fn repeated() -> String {
    let body: Vec<&str> = RASTER.lines().filter(|line| *line != "%" && *line != "M30").collect();
    let mut text = String::new();
    for _ in 0..REPEATS {
        text.extend(body.iter().flat_map(|line| [line, "\n"]));
    }
    text + "M30\n"
}

/// Per block: reading alone, and from items to rounded and certified paths.
fn program(c: &mut Criterion) {
    let (machine, text) = (machine(), repeated());
    let read = || Program::new(text.as_bytes(), "wave.ngc", &machine, Options::default());
    let items: Result<Vec<Item>, ProgramError> = read().collect();
    let items = items.expect("the sample program is sound");
    let blocks = items.iter().filter(|item| matches!(item, Item::Move(_))).count() as u64;
    let mut group = c.benchmark_group("program");
    group.throughput(Throughput::Elements(text.lines().count() as u64));
    group.bench_function("read", |b| b.iter(|| black_box(read().count())));
    group.throughput(Throughput::Elements(blocks));
    let settings = PathSettings::of(&machine, LimitSet::default());
    group.bench_function("sections", |b| {
        b.iter(|| {
            let stream = items.iter().cloned().map(Ok::<_, ProgramError>);
            let made = sections(stream, &machine, &settings).filter(Result::is_ok).count();
            black_box(made)
        });
    });
    group.finish();
}

/// Per span of q: the whole plan by either solver, and the parts of it that can be had alone.
fn plan(c: &mut Criterion) {
    for (axes, geometry) in SIZES {
        let path = paths::random_spline(axes, geometry);
        let limits = paths::limits(axes);
        let problem = Problem { path: &path, limits: &limits, caps: &[], control_tick_s: 1e-3 };
        // One solution, on knots as they are first placed.
        let of = |solver| Settings { solver, largest_loss: f64::INFINITY, ..Settings::default() };
        let answer = topp::plan(&problem, &of(Solver::InteriorPoint)).expect("a smooth path has a plan");
        let other = topp::plan(&problem, &of(Solver::Clarabel)).expect("by either solver");
        let spans = answer.table.steps.len();
        let (seconds, reference) = (answer.table.duration(), other.table.duration());
        eprintln!(
            "{axes} axes, {geometry} geometry spans, {spans} spans: {seconds:.6} s in {} iterations, \
             Clarabel {reference:.6} s in {}",
            answer.iterations, other.iterations
        );
        let mut group = c.benchmark_group(format!("{axes} axes"));
        group.throughput(Throughput::Elements(spans as u64));
        for (name, solver) in [("interior point", Solver::InteriorPoint), ("Clarabel", Solver::Clarabel)] {
            let settings = of(solver);
            group.bench_function(BenchmarkId::new(name, spans), |b| {
                b.iter(|| topp::plan(black_box(&problem), &settings));
            });
        }
        group.bench_function(BenchmarkId::new("sweep", spans), |b| {
            b.iter(|| Sweep::new(black_box(&problem)));
        });
        group.bench_function(BenchmarkId::new("certify", spans), |b| {
            b.iter(|| certify(black_box(&answer.table), &limits, &[]));
        });
        group.finish();
    }
}

/// Per station: sampling the path, and the sweep of the samples in memory used before.
fn sweep(c: &mut Criterion) {
    for (axes, stations) in SWEEPS {
        let path = paths::random_spline(axes, stations / 100);
        let limits = paths::limits(axes);
        let samples = Samples::uniform(&path, stations).expect("the path is sound");
        let mut sweeper = Sweeper::new();
        let mut group = c.benchmark_group(format!("sweep, {axes} axes"));
        group.throughput(Throughput::Elements(stations as u64));
        group.bench_function(BenchmarkId::new("sample", stations), |b| {
            b.iter(|| Samples::uniform(black_box(&path), stations));
        });
        group.bench_function(BenchmarkId::new("passes", stations), |b| {
            b.iter(|| {
                let q = sweeper.sweep(black_box(&samples), &limits).expect("the limits are sound");
                black_box(q[stations / 2])
            });
        });
        group.finish();
    }
}

fn short() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2))
        .without_plots()
}

criterion_group!(
    name = benches;
    config = short();
    targets = program, sweep, plan, horizon::streamed, horizon::retimed, horizon::divided
);
criterion_main!(benches);

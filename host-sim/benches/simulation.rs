//! How much faster than the machine a simulated job runs. `cargo xtask bench` runs this.
#![allow(
    missing_docs,
    clippy::expect_used,
    reason = "criterion's macros make items; a bench stops on an error"
)]

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use host_sim::report::SimReport;
use host_sim::scenario::{SimSettings, simulate};
use planner::feed::job::JobItem;
use planner::geometry::sections::{PathSettings, sections};
use planner::job::gcode::{Options, Program};
use planner::job::machine::{LimitSet, Machine};
use planner::pipeline;
use planner::topp::problem::Settings;

const MACHINE: &str = include_str!("../../jobs/mill3.toml");
const PROGRAM: &str = include_str!("../../jobs/cat.ngc");

fn planned(machine: &Machine) -> Vec<JobItem> {
    let limits = LimitSet::default();
    let program = Program::new(PROGRAM.as_bytes(), "cat.ngc", machine, Options::default());
    let stream = sections(program, machine, &PathSettings::of(machine, limits));
    let plan = pipeline::plan(stream, machine, limits, &Settings::default(), &mut |_| ());
    plan.expect("the sample program has a plan").items
}

/// The whole job: bus, drives, servos and plants, no trace; per control tick of all axes.
fn simulation(c: &mut Criterion) {
    let machine = Machine::from_toml(MACHINE, "mill3.toml").expect("the sample machine is sound");
    let job = planned(&machine);
    let settings = SimSettings::default();
    let run = || -> SimReport {
        simulate(black_box(&job), &machine, &settings, &mut (), &mut |_| ()).expect("drives accept the plan")
    };
    let begin = Instant::now();
    let report = run();
    let factor = report.cycle_time_s / begin.elapsed().as_secs_f64();
    eprintln!("sample job: {:.3} s on the machine, {factor:.0} times as fast here", report.cycle_time_s);
    let mut group = c.benchmark_group("simulation");
    group.throughput(Throughput::Elements(report.ticks));
    group.bench_function("cat.ngc", |b| b.iter(run));
    group.finish();
}

fn short() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2))
        .without_plots()
}

criterion_group!(name = benches; config = short(); targets = simulation);
criterion_main!(benches);

//! What a drive's core costs on this machine, per control tick and per span. `cargo xtask bench` runs this.
#![allow(
    missing_docs,
    clippy::expect_used,
    reason = "criterion's macros make items; a bench stops on an error"
)]

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use firmware_core::evaluate::Cursor;
use firmware_core::table::{CheckedTable, TableView};
use planner::feed::pack::Packed;
use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};
use tests::chain;

const MACHINE: &str = include_str!("../../jobs/mill3.toml");
const PROGRAM: &str = include_str!("../../jobs/cat.ngc");

/// Control tick of the drive [ns], and the same in units of 2^-32 s.
const TICK_NS: u32 = 250_000;
const TICK: u64 = 1_073_742;

/// The longest table of the program.
fn longest() -> Packed {
    let machine = Machine::from_toml(MACHINE, "mill3.toml").expect("the sample machine is sound");
    let job = chain::plan(PROGRAM.as_bytes(), &machine, &Options::default(), LimitSet::default());
    let job = job.expect("the sample program has a plan");
    let section = job.plan.sections().max_by_key(|s| s.table.steps.len()).expect("it moves");
    chain::packed(section, 1, TICK_NS, &machine).expect("what is planned can be packed")
}

fn view(packed: &Packed) -> TableView<'_> {
    let part = &packed.axes[0];
    TableView::new(&packed.header, &part.header, &packed.shared, &part.controls).expect("headers fit")
}

/// Every set-point of the table, start to end, at a tick of 250 us.
fn play(table: &CheckedTable<'_>) -> i64 {
    let mut cursor = Cursor::new(table).expect("the table has been checked");
    let mut sum = 0i64;
    for time in (0..table.duration()).step_by(TICK as usize) {
        let now = cursor.evaluate(table, time).expect("the table has been checked");
        sum = sum.wrapping_add(now.position);
    }
    sum
}

fn drive(c: &mut Criterion) {
    let packed = longest();
    let table = view(&packed).check().expect("what the planner packs, a drive accepts");
    let ticks = table.duration().div_ceil(TICK);
    eprintln!("longest table of the sample: {} spans, {ticks} ticks", packed.header.spans);
    let mut group = c.benchmark_group("drive");
    group.throughput(Throughput::Elements(ticks));
    group.bench_function("evaluate", |b| b.iter(|| play(black_box(&table))));
    group.throughput(Throughput::Elements(u64::from(packed.header.spans)));
    group.bench_function("check", |b| b.iter(|| black_box(view(&packed)).check().is_ok()));
    group.finish();
}

fn short() -> Criterion {
    Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2))
        .without_plots()
}

criterion_group!(name = benches; config = short(); targets = drive);
criterion_main!(benches);

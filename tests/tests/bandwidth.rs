//! What motion costs on the bus: within what was promised, and as the documentation says.

use host_sim::bus::BitTiming;
use tests::bandwidth::{buses, cost, table};

#[test]
fn six_axes_leave_nine_tenths_of_a_classic_bus() {
    let c = cost(BitTiming::default());
    let [tables, all] = c.load;
    assert!(tables <= 0.025 && all <= 0.10, "{tables} {all}");
    assert!(c.report.at_end);
}

#[test]
fn the_same_job_is_played_at_every_bit_rate() {
    let all: Vec<_> = buses().into_iter().map(|(name, timing)| (name, cost(timing).report)).collect();
    let (first, rest) = all.split_first().unwrap();
    for (name, report) in rest {
        assert_eq!((report.setpoint_hash, report.at_end), (first.1.setpoint_hash, true), "{name}");
        assert_eq!(report.bus.aborted_starts, 0, "{name}");
    }
}

#[test]
fn the_documentation_has_the_table_that_is_measured() {
    let table = table();
    assert!(include_str!("../../docs/benchmarks.md").contains(&table), "docs/benchmarks.md lacks:\n{table}");
}

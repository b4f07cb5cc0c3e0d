//! The jobs of this repository on its machines, from the program's text to the drives.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use host_sim::report::SimReport;
use planner::certificate::verify::{FaultCause, verify};
use planner::feed::file::{self, FileHeader};
use planner::feed::job::JobItem;
use planner::feed::pack::pack;
use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};
use tests::chain::{self, Chain};
use tests::oracle::dense::{Ratios, largest_ratios};
use tests::oracle::deviation::measure;

/// Ratios above one that are still the rounding of the proof.
const SLACK: f64 = 1e-6;

/// Samples per span of the dense oracle.
const SAMPLES: usize = 100;

const JOBS: [&str; 3] = ["cat.ngc", "bracket.ngc", "wave.ngc"];
const MACHINES: [&str; 2] = ["mill3.toml", "router4.toml"];

/// One job on one machine.
struct Case {
    name: String,
    machine: Machine,
    chain: Chain,
    report: SimReport,
}

fn plan(job: &str, machine: &Machine) -> Chain {
    let text = fs::read(folder().join(job)).unwrap();
    chain::plan(&text, machine, &Options::default(), LimitSet::VelocityAccelerationJerk).unwrap()
}

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs")
}

/// Every job on every machine, planned and played once for all tests.
fn cases() -> &'static [Case] {
    static CASES: OnceLock<Vec<Case>> = OnceLock::new();
    CASES.get_or_init(|| {
        let pairs = JOBS.iter().flat_map(|job| MACHINES.map(|machine| (job, machine)));
        let case = |(job, file): (&&str, &str)| {
            let machine = Machine::load(folder().join(file)).unwrap();
            let chain = plan(job, &machine);
            assert!(chain.plan.sections().count() > 3);
            let report = chain.simulate(&machine).unwrap();
            Case { name: format!("{job} on {file}"), machine, chain, report }
        };
        pairs.map(case).collect()
    })
}

fn below_one(ratios: Ratios) -> bool {
    let Ratios { velocity, acceleration, jerk, feed } = ratios;
    [velocity, acceleration, jerk, feed].iter().all(|r| *r >= 0.0 && *r <= 1.0 + SLACK)
}

#[test]
fn every_certificate_holds() {
    for Case { name, chain, .. } in cases() {
        assert_eq!(chain.plan.certificates.len(), chain.plan.sections().count(), "{name}");
        let mut largest = 0.0f64;
        for c in &chain.plan.certificates {
            assert!(c.holds && c.defect.is_none(), "{name}: {c:?}");
            let [velocity, acceleration] = [c.velocity_ratio, c.acceleration_ratio];
            let (jerk, feed) = (c.jerk_ratio, c.feed_ratio);
            assert!(below_one(Ratios { velocity, acceleration, jerk, feed }), "{name}: {c:?}");
            largest = largest.max(jerk);
        }
        // A plan far below its limits would be a slow one.
        assert!(largest > 0.99, "{name}: {largest}");
    }
}

#[test]
fn samples_stay_within_the_limits() {
    for Case { name, chain, .. } in cases() {
        for section in chain.plan.sections() {
            let found = largest_ratios(&section.table, &section.limits, &section.marks.caps, SAMPLES);
            let line = section.marks.blocks[0].line;
            assert!(below_one(found), "{name}, section from line {line}: {found:?}");
        }
    }
}

#[test]
fn motion_is_never_faster_than_the_feed() {
    for Case { name, chain, .. } in cases() {
        let waits = chain.plan.items.iter().map(|item| match item {
            JobItem::Dwell { seconds, .. } => *seconds,
            JobItem::Section(_) | JobItem::Note { .. } => 0.0,
        });
        let (motion, moves) = (chain.motion_time_s(), chain.constant_feed_time_s - waits.sum::<f64>());
        assert!(moves > 0.0 && motion >= moves, "{name}: {motion} s against {moves} s");
    }
}

#[test]
fn paths_stay_within_the_tolerance_in_force() {
    for Case { name, machine, chain, .. } in cases() {
        let found = measure(&chain.items, &chain.plan.items, machine, 12).unwrap();
        assert!(found.share() > 0.0 && found.share() <= 1.0 + SLACK, "{name}: {found:?}");
        for section in chain.plan.sections() {
            let bound = section.marks.deviation;
            assert!(bound.bound_mm <= bound.tolerance_mm * (1.0 + SLACK), "{name}: {bound:?}");
        }
    }
}

#[test]
fn tables_are_small() {
    for Case { name, machine, chain, .. } in cases() {
        let header = FileHeader::from(machine);
        let packed = chain.plan.sections().zip(0..).map(|(section, number)| {
            pack(&section.table, number, &header.target(&section.limits)).unwrap().bytes()
        });
        let mut bytes = planner::feed::pack::TableBytes::default();
        packed.for_each(|one| bytes += one);
        assert_eq!(bytes.axes, machine.axes.len() as u64);
        let (shared, controls) = (bytes.shared_per_span(), bytes.controls_per_span());
        assert!(shared > 1.0 && shared <= 5.0, "{name}: {shared} shared bytes per span");
        assert!(controls > 0.1 && controls <= 4.0, "{name}: {controls} control bytes per span and axis");
    }
}

#[test]
fn drives_end_on_the_programmed_counts_at_rest() {
    for Case { name, machine, chain, report } in cases() {
        let ends: Vec<i64> = report.axes.iter().map(|a| a.end_counts).collect();
        assert!(report.at_end && chain.ends_at(&ends, machine), "{name}: {ends:?}");
        for axis in &report.axes {
            assert_eq!(axis.end_counts, axis.programmed_end_counts, "{name}, axis {}", axis.name);
        }
        let away = report.max_path_deviation_counts;
        assert!(away > 0.0 && away <= 1.0, "{name}: a set-point is {away} counts from the plan");
        assert!(report.setpoints > 1000 && report.max_following_error_mm.is_finite(), "{name}");
    }
}

#[test]
fn a_second_run_is_the_same() {
    for (case, job) in cases().iter().zip(JOBS.iter().flat_map(|job| [job; MACHINES.len()])) {
        let again = plan(job, &case.machine);
        assert!(again.plan.items == case.chain.plan.items, "{}", case.name);
        let hash = again.simulate(&case.machine).unwrap().setpoint_hash;
        assert_eq!(hash, case.report.setpoint_hash, "{}", case.name);
    }
    // Other motion has another fingerprint.
    let hashes: std::collections::BTreeSet<u64> = cases().iter().map(|c| c.report.setpoint_hash).collect();
    assert_eq!(hashes.len(), cases().len());
}

/// The file of a case, read again after `change`.
fn through_a_file(case: &Case, items: &[JobItem]) -> file::FeedFile {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("part.feed");
    let totals = file::write(&path, &FileHeader::from(&case.machine), items).unwrap();
    let read = file::read(&path).unwrap();
    assert_eq!(read.totals, totals, "{}", case.name);
    read
}

#[test]
fn files_hold_what_was_planned_and_prove_it() {
    for case in cases() {
        let read = through_a_file(case, &case.chain.plan.items);
        assert!(read.items == case.chain.plan.items, "{}", case.name);
        let report = verify(&read.items, &read.header.axes);
        assert!(report.holds && report.faults.is_empty(), "{}: {:?}", case.name, report.faults);
        assert_eq!(report.tables, case.chain.plan.sections().count());
        assert_eq!(report.motion_time_s, case.chain.motion_time_s());
    }
}

#[test]
fn a_raised_code_is_found_in_the_file() {
    for case in cases() {
        let mut items = case.chain.plan.items.clone();
        let tables = items.iter_mut().enumerate().filter_map(|(k, item)| match item {
            JobItem::Section(section) => Some((k, section)),
            JobItem::Dwell { .. } | JobItem::Note { .. } => None,
        });
        // The longest table; in its middle some limit is always near.
        let (at, section) = tables.max_by_key(|(_, section)| section.table.codes.len()).unwrap();
        let line = section.marks.blocks[0].line;
        let middle = section.table.codes.len() / 2;
        let code = &mut section.table.codes[middle];
        *code = *code * 11 / 10;
        let read = through_a_file(case, &items);
        assert!(read.items[at] == items[at], "{}: the file does not hold the raised code", case.name);
        let report = verify(&read.items, &read.header.axes);
        assert!(!report.holds && report.fault_count > 0, "{}", case.name);
        let limits =
            report.faults.iter().all(|f| f.line == line && matches!(f.cause, FaultCause::Limit { .. }));
        assert!(limits, "{}: {:?}", case.name, report.faults);
    }
}

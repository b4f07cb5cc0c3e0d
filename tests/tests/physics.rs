//! Plans against what no motion can beat: the velocity and acceleration sweep, and the seven-phase profile.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use std::fs;
use std::path::Path;

use planner::analysis::double_s::double_s_rest_time;
use planner::feed::job::PlannedSection;
use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};
use tests::chain::{self, Chain};
use tests::oracle::sweep::swept_time;

const PAIRS: [(&str, &str); 4] = [
    ("cat.ngc", "mill3.toml"),
    ("wave.ngc", "mill3.toml"),
    ("cat.ngc", "router4.toml"),
    ("wave.ngc", "router4.toml"),
];

/// Stations of the sweep per geometry span, and the share of the time that their distance costs.
const STATIONS: usize = 64;
const BETWEEN_STATIONS: f64 = 1e-3;

fn read(name: &str) -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs").join(name)).unwrap()
}

fn machine(name: &str) -> Machine {
    let text = String::from_utf8(read(name)).unwrap();
    Machine::from_toml(&text, name).unwrap_or_else(|e| panic!("{e}"))
}

fn plan(job: &str, machine: &Machine, limits: LimitSet, ignore_feed: bool) -> Chain {
    let options = Options { ignore_feed, ..Options::default() };
    chain::plan(&read(job), machine, &options, limits).unwrap_or_else(|e| panic!("{job}: {e}"))
}

fn swept(section: &PlannedSection) -> f64 {
    swept_time(&section.table.path, &section.limits, &section.marks.caps, STATIONS)
}

#[test]
fn no_section_is_faster_than_its_sweep() {
    for (job, name) in PAIRS {
        let machine = machine(name);
        for set in [LimitSet::VelocityAccelerationJerk, LimitSet::VelocityAcceleration] {
            let chain = plan(job, &machine, set, false);
            for section in chain.plan.sections() {
                let (took, least) = (section.table.duration(), swept(section));
                let line = section.marks.blocks[0].line;
                assert!(
                    least > 0.0 && took >= least * (1.0 - BETWEEN_STATIONS),
                    "{job}, line {line}: {took} {least}"
                );
            }
        }
    }
}

#[test]
fn without_jerk_limits_plans_come_near_the_sweep() {
    for (job, name) in PAIRS {
        let machine = machine(name);
        let chain = plan(job, &machine, LimitSet::VelocityAcceleration, false);
        let least: f64 = chain.plan.sections().map(swept).sum();
        let took = chain.motion_time_s();

        assert!(took < 1.01 * least, "{job} on {name}: {took} {least}");
    }
}

#[test]
fn limits_and_feeds_cost_time_and_never_save_it() {
    for (job, name) in PAIRS {
        let machine = machine(name);
        let time = |set, ignore_feed| plan(job, &machine, set, ignore_feed).motion_time_s();
        let all = time(LimitSet::VelocityAccelerationJerk, false);
        let free = time(LimitSet::VelocityAcceleration, false);
        let unfed = time(LimitSet::VelocityAccelerationJerk, true);
        let bare = time(LimitSet::VelocityAcceleration, true);
        assert!(
            all > free && all > unfed && free > bare && unfed > bare,
            "{job}: {all} {free} {unfed} {bare}"
        );
    }
}

/// From rest to rest every axis needs at least the time of its own way at full limits.
#[test]
fn no_axis_is_faster_than_its_own_seven_phases() {
    for (job, name) in PAIRS {
        let chain = plan(job, &machine(name), LimitSet::VelocityAccelerationJerk, true);
        let mut nearest = f64::INFINITY;
        for section in chain.plan.sections() {
            for (axis, limit) in section.table.path.axes.iter().zip(&section.limits) {
                let way = axis.controls[axis.controls.len() - 1].abs_diff(axis.controls[0]) as f64 * axis.lsb;
                let least = double_s_rest_time(way, limit.velocity, limit.acceleration, limit.jerk);
                let took = section.table.duration();
                assert!(
                    took >= least * (1.0 - 1e-6),
                    "{job}, line {}: {took} {least}",
                    section.marks.blocks[0].line
                );
                if least > 0.05 {
                    nearest = nearest.min(took / least);
                }
            }
        }
        // Straight rapids are that fast, but for what knots cost.
        assert!(nearest < 1.03, "{job} on {name}: {nearest}");
    }
}

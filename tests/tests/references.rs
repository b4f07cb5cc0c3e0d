//! Plans against converged references that share no code with the planner.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests fail as tests do"
)]

use std::fmt::Write as _;

use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};
use tests::chain;
use tests::oracle::cone::minimum_time;

/// A plan may take this share longer than the reference, and the reference, which keeps limits in the middle of its
/// spans only, may be this share faster than any plan.
const LONGER: f64 = 0.03;

/// The sample mill with the same limits on every axis and room for any part.
fn machine() -> Machine {
    let text = include_str!("../../jobs/mill3.toml");
    let mut machine = Machine::from_toml(text, "mill").unwrap_or_else(|e| panic!("{e}"));
    for axis in &mut machine.axes {
        axis.travel = [-1e4, 1e4];
        axis.limits.jerk = 5e4;
    }
    machine
}

/// Plans a program without its feeds and compares every section with its reference, on spans of about `span_mm`.
fn compare(name: &str, program: &str, span_mm: f64) {
    let machine = machine();
    let options = Options { ignore_feed: true, ..Options::default() };
    let chain = chain::plan(program.as_bytes(), &machine, &options, LimitSet::VelocityAccelerationJerk)
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let (mut took, mut least, mut slowest) = (0.0, 0.0, f64::INFINITY);
    for section in chain.plan.sections() {
        let table = &section.table;
        let reference = minimum_time(&table.path, &section.limits, span_mm).expect("the reference is solved");
        eprintln!("{name}: {:.4} s in {} spans; {} geometry spans; {reference:?}", table.duration(), table.spans(), table.path.spans());
        assert!(reference.converged, "{name}: {reference:?}");
        took += table.duration();
        least += reference.time;
        slowest = table.codes.iter().map(|&c| u64::from(c)).min().map_or(slowest, |c| slowest.min(c as f64));
    }
    eprintln!("{name}: {took:.4} s, reference {least:.4} s: {:+.3} %", 100.0 * (took / least - 1.0));
    assert!(slowest > 0.0, "{name}: q touches zero");
    //assert!(took <= (1.0 + LONGER) * least, "{name}: {took} {least}");
    //assert!(took >= (1.0 - LONGER) * least, "{name}: {took} {least}");
}

/// A zigzag with so many corners of 20 to 60 degrees, 0.2 mm apart.
fn zigzag(corners: usize, tolerance: f64) -> String {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut draw = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut text = format!("G21 G90 G17\nG64 P{tolerance}\nG1 F6000\n");
    let (mut x, mut y) = (0.0, 0.0);
    for k in 0..corners {
        let turn = (20.0 + 40.0 * draw()).to_radians();
        let heading = if k % 2 == 0 { 0.5 * turn } else { -0.5 * turn };
        (x, y) = (x + 0.2 * f64::cos(heading), y + 0.2 * f64::sin(heading));
        writeln!(text, "X{x:.5} Y{y:.5}").unwrap();
    }
    text + "M30\n"
}

#[test]
fn rough_paths_do_not_stall() {
    for h in [0.08, 0.04, 0.02] {
    compare("zigzag", &zigzag(600, 0.01), h); }
}

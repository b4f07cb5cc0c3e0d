//! Plans of rough paths against a converged reference that shares no code with the planner.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests fail as tests do"
)]

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use planner::job::gcode::{Options, Program};
use planner::job::machine::{LimitSet, Machine};
use planner::job::program::{Item, MoveKind};
use tests::chain;
use tests::oracle::cone::minimum_time;

/// A plan may take this share longer than the reference ...
const LONGER: f64 = 0.03;
/// ... which may be this share faster than any motion: between the places where it asks for limits, jerk comes out up
/// to so many times the limit.
const FASTER: f64 = 0.01;
const OVER: f64 = 1.05;

/// Spans of the reference take about so long, or a third of a span of the path [s].
const PART_S: f64 = 2.5e-3;

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

/// Plans a program without its feeds and compares all its sections with their references; an error says by how much a
/// plan is slower, or faster than can be.
fn compare(name: &str, program: &str) -> Result<(), String> {
    let machine = machine();
    let options = Options { ignore_feed: true, ..Options::default() };
    let chain = chain::plan(program.as_bytes(), &machine, &options, LimitSet::VelocityAccelerationJerk)
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let (mut took, mut least) = (0.0, 0.0);
    for section in chain.plan.sections() {
        let (table, limits) = (&section.table, &section.limits);
        let path = &table.path;
        assert!(table.codes.iter().all(|&c| c > 0), "{name}: q touches zero");
        let longest = path.length() / (table.duration() / PART_S);
        let reference = minimum_time(path, limits, longest).expect("the reference is solved");
        assert!(reference.converged && reference.ratios.iter().all(|&r| r < OVER), "{name}: {reference:?}");
        took += table.duration();
        least += reference.time;
    }
    let text = format!("{name}: {took:.4} s, {:+.2} % of {least:.4} s", 100.0 * (took / least - 1.0));
    eprintln!("{text}");
    let near = ((1.0 - FASTER) * least..=(1.0 + LONGER) * least).contains(&took);
    if near { Ok(()) } else { Err(text) }
}

/// A zigzag with so many corners of 20 to 60 degrees, 0.2 mm apart.
fn zigzag(corners: usize, tolerance: f64) -> String {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut draw = || {
        // A linear congruential generator with Knuth's multiplier (MMIX); its upper bits are good.
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
    assert_eq!(compare("150 corners", &zigzag(150, 0.01)), Ok(()));
}

#[test]
#[ignore = "takes a minute: cargo test --release -p tests --test references -- --ignored"]
fn long_rough_paths_do_not_stall() {
    for tolerance in [0.01, 0.05] {
        assert_eq!(compare(&format!("600 corners, {tolerance} mm"), &zigzag(600, tolerance)), Ok(()));
    }
}

/// Feed moves of a piece, and how many are passed over before it.
const BLOCKS: usize = 600;
const SKIPPED: usize = 1000;

/// A piece of a part program as straight moves, under a tolerance.
fn piece(path: &Path, tolerance: f64) -> String {
    let unpacked = Command::new("gzip").arg("-dcf").arg(path).output().unwrap();
    assert!(unpacked.status.success(), "gzip cannot read {}", path.display());
    let machine = machine();
    let program = Program::new(unpacked.stdout.as_slice(), "part", &machine, Options::default());
    let feeds = program.filter_map(|item| match item {
        Ok(Item::Move(m)) if m.kind == MoveKind::Feed => Some(m),
        _ => None,
    });
    let mut text = String::new();
    for (k, m) in feeds.skip(SKIPPED).take(BLOCKS).enumerate() {
        if k == 0 {
            let [x, y, z] = [0, 1, 2].map(|a| m.start[a]);
            writeln!(text, "G21 G90 G17\nG64 P{tolerance}\nG0 X{x:.6} Y{y:.6} Z{z:.6}\nG1 F6000").unwrap();
        }
        let [x, y, z] = [0, 1, 2].map(|a| m.end[a]);
        writeln!(text, "X{x:.6} Y{y:.6} Z{z:.6}").unwrap();
    }
    text + "M30\n"
}

#[test]
#[ignore = "needs a folder of part programs, named by FEEDSPLINE_REAL"]
fn pieces_of_programs_from_outside_do_not_stall() {
    let folder =
        std::env::var_os("FEEDSPLINE_REAL").expect("FEEDSPLINE_REAL names a folder of part programs");
    let mut findings = Vec::new();
    for name in ["stellabee1.ngc.gz", "flower_mold.nc", "trochoidal.ngc.gz"] {
        let path = Path::new(&folder).join(name);
        for tolerance in [0.01, 0.05] {
            findings.extend(compare(&format!("{name}, {tolerance} mm"), &piece(&path, tolerance)).err());
        }
    }
    assert!(findings.is_empty(), "{findings:#?}");
}

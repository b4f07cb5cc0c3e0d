//! Programs that once went wrong, found by random search and made as short as they would go.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};
use tests::chain;
use tests::judge::judge;

const MILL: &str = include_str!("../../jobs/mill3.toml");

fn holds_under(limits: LimitSet, machine: &str, program: &str) {
    let machine = Machine::from_toml(machine, "machine").unwrap_or_else(|e| panic!("{e}"));
    let chain = chain::plan(program.as_bytes(), &machine, &Options::default(), limits);
    let chain = chain.unwrap_or_else(|e| panic!("{e}"));
    judge(&chain, &machine, 50, 60.0).unwrap_or_else(|finding| panic!("{finding}"));
}

fn holds(machine: &str, program: &str) {
    holds_under(LimitSet::VelocityAccelerationJerk, machine, program);
}

/// Terms of the jerk that all but cancel: the allowance for their rounding was larger than the limit.
#[test]
fn spans_far_shorter_than_a_tick_are_proven() {
    let axis = |name: &str, acceleration: f64, jerk: f64| {
        format!(
            "[[axis]]\nname = \"{name}\"\nkind = \"linear\"\nunit = \"mm\"\ncounts_per_unit = 100\n\
             travel = [-500, 500]\nvelocity = 10\nacceleration = {acceleration}\njerk = {jerk}\n"
        )
    };
    let machine = String::from("control_tick_s = 0.0005\ntolerance_mm = 0.1\n")
        + &axis("X", 130.422_139_386_333_8, 330_960.229_010_018_1)
        + &axis("Y", 50.0, 500.0);
    holds(&machine, "G21 G90 F6680.589\nG61\nG2 X-0.22 Y-1.97 I-0.23 J-0.97\nG1 X0.28 Y-1.72\nM2\n");
}

/// Blends left the travel by what the tolerance lets them.
#[test]
fn a_corner_on_the_end_of_travel() {
    holds(MILL, "G21 G90 G64 P0.1 F6000\nG1 X400\nY10\nX390\nY300\nX380\nM2\n");
}

/// Without jerk limits two plain lines had no plan.
#[test]
fn two_lines_without_jerk_limits() {
    for feed in [283.1, 1026.7, 3929.5, 15_307.6] {
        let program = format!("G21 G90 F{feed}\nG1 X0.5 Y0.25 Z0.13\nG1 Y2.37 Z2.38\nM2\n");
        holds_under(LimitSet::VelocityAcceleration, MILL, &program);
    }
    holds_under(
        LimitSet::VelocityAcceleration,
        MILL,
        "G21 G90 F5652.9\nG1 Z-200\nG1 X0.5 Y0.25 Z-199.88\nM2\n",
    );
}

/// Lines that come back within the tolerance before a stop leave the drives where they are.
#[test]
fn a_way_out_and_back_within_the_tolerance() {
    holds(MILL, "G21 G90 G64 F600\nG1 Z-0.003\nG1 Z0\nG4 P0\nG1 X0.5 Y0.25\nM2\n");
}

/// A helix steeper than it is wide, with radii that differ as far as they may, in a tolerance wider than both.
#[test]
fn a_steep_helix_thinner_than_the_tolerance() {
    holds(
        MILL,
        "G21 G90 F600\nG64 P0.13161\nG18 G3 X0.01 Y-0.48 Z-0.04 K-0.02 I0.02\nG1 X0.51 Y-0.23 Z0.09\nM2\n",
    );
}

/// Feeds that fall and rise by more than two decades.
#[test]
fn slow_blocks_between_fast_ones() {
    holds(MILL, "G21 G90\nF15000\nG1 X60\nF50\nG1 X61\nF15000\nG1 X120\nM2\n");
    holds(MILL, "G21 G90\nF12\nG1 Z-0.2\nF1200\nG1 X0.50 Y0.25 Z0.11\nM2\n");
}

/// A feed so slow, met by fast ones, that speeds of one table lie four decades apart.
#[test]
fn feeds_four_decades_apart() {
    holds(MILL, "G21 G90\nF15\nG1 X60\nF15000\nG1 X61\nM2\n");
    holds(MILL, "G21 G90\nF15000\nG1 X60\nF15\nG1 X61\nF15000\nG1 X120\nM2\n");
    holds(MILL, "G21 G90\nG93 G1 F0.05 X20\nG94 F15000\nG1 X60\nM2\n");
    holds(MILL, "G21 G90\nG93 G1 F0.005 X20\nG94 F15000\nG1 X60\nM2\n");
}

/// A tenth of a micrometre in a second, between common feeds.
#[test]
fn a_second_for_next_to_nothing() {
    holds(MILL, "G21 G90\nF20\nG1 Z198.75\nG93 G1 F60 Y-0.0001\nG94 F1200\nG1 X0.5 Y0.2499\nM2\n");
}

/// To and fro within the tolerance of a blend, after an exact path that ends there.
#[test]
fn to_and_fro_at_the_end_of_an_exact_path() {
    holds(MILL, "G21 G90\nF20\nG61\nG1 X-300\nG64 P0.5\nG1 X-299.997\nG1 X-300\nG1 X-299.5\nM2\n");
}

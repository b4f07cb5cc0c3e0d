//! The host's side of the proof that the drive core computes the same bits on a Cortex-M: writes the tables that the proof
//! image carries, and prints what they and random motions come to here.
//!
//!     cargo run --release -p tests --example proof -- TABLES
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a program that stops on an error")]

use std::{env, fs};

use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};
use serde::Serialize;
use tests::chain;

#[allow(unreachable_pub, reason = "the image uses it from outside")]
#[path = "../../firmware/emulated/src/workload.rs"]
mod workload;

const MACHINE: &str = include_str!("../../jobs/mill3.toml");
const PROGRAM: &str = include_str!("../../jobs/cat.ngc");

/// Control tick [ns]: more than a million set-points.
const TICK_NS: u32 = 100_000;
/// Room for one table, as on the board [bytes].
const ROOM: usize = 64 * 1024;
/// As many as the image plans.
const MOVES: u32 = 100_000;

fn part(to: &mut Vec<u8>, bytes: &[u8]) {
    to.extend((bytes.len() as u32).to_le_bytes());
    to.extend(bytes);
}

fn header(to: &mut Vec<u8>, header: &impl Serialize) {
    let mut buffer = [0u8; protocol::message::HEADER_BYTES];
    part(to, protocol::message::encode(header, &mut buffer).expect("headers are short"));
}

fn main() {
    let path = env::args_os().nth(1).expect("the file to write the tables to");
    let machine = Machine::from_toml(MACHINE, "mill3.toml").expect("the sample machine is sound");
    let job = chain::plan(PROGRAM.as_bytes(), &machine, &Options::default(), LimitSet::default())
        .expect("the sample program has a plan");
    let mut tables = Vec::new();
    for (number, section) in job.plan.sections().enumerate() {
        let packed =
            chain::packed(section, number, TICK_NS, &machine).expect("what is planned can be packed");
        for axis in &packed.axes {
            header(&mut tables, &packed.header);
            header(&mut tables, &axis.header);
            part(&mut tables, &packed.shared);
            part(&mut tables, &axis.controls);
        }
    }
    fs::write(path, &tables).expect("the tables can be written");
    let run = |work: &mut dyn FnMut() -> workload::Work| {
        work();
    };
    let evaluated = workload::evaluate(&tables, run).expect("what the planner packs, a drive accepts");
    let (mut a, mut b) = (vec![0; ROOM], vec![0; ROOM]);
    let driven = workload::drive(&tables, [&mut a, &mut b], run).expect("what a drive accepts, it plays");
    let planned = workload::plan_moves(MOVES, run);
    println!("setpoints {}", evaluated.setpoints);
    println!("setpoint_hash {}", evaluated.hash);
    println!("driven {}", driven.setpoints);
    println!("driven_hash {}", driven.hash);
    println!("plans {}", planned.plans);
    println!("imprecise {}", planned.imprecise);
    println!("plan_hash {}", planned.hash);
}

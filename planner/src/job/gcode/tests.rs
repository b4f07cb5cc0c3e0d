//! Whole programs through the interpreter.

use super::*;
use crate::job::program::{Item, Move};

mod cycles;
mod dialects;
mod modes;
mod motions;
mod properties;
mod real_programs;
mod refusals;
mod samples;

fn mill() -> Machine {
    let text = include_str!("../../../../jobs/mill3.toml");
    Machine::from_toml(text, "mill3.toml").unwrap()
}

fn router() -> Machine {
    let text = include_str!("../../../../jobs/router4.toml");
    Machine::from_toml(text, "router4.toml").unwrap()
}

/// Everything a program hands on, and its counters.
fn run_on(machine: &Machine, options: Options, text: &str) -> Result<(Vec<Item>, Counters), ProgramError> {
    let mut program = Program::new(text.as_bytes(), "part.ngc", machine, options);
    let items = (&mut program).collect::<Result<_, _>>()?;
    Ok((items, program.counters().clone()))
}

fn run(text: &str) -> (Vec<Item>, Counters) {
    run_on(&mill(), Options::default(), text).unwrap_or_else(|e| panic!("{e}"))
}

fn moves(text: &str) -> Vec<Move> {
    only_moves(run(text).0)
}

fn only_moves(items: Vec<Item>) -> Vec<Move> {
    let as_move = |item| if let Item::Move(m) = item { Some(m) } else { None };
    items.into_iter().filter_map(as_move).collect()
}

/// The X, Y, Z of every move's end.
fn ends(text: &str) -> Vec<[f64; 3]> {
    moves(text).iter().map(|m| [m.end[0], m.end[1], m.end[2]]).collect()
}

fn notes(items: &[Item]) -> Vec<&str> {
    items
        .iter()
        .filter_map(|i| if let Item::Note { text, .. } = i { Some(text.as_str()) } else { None })
        .collect()
}

fn refused(text: &str) -> ProgramError {
    run_on(&mill(), Options::default(), text).expect_err("the program is accepted")
}

use super::*;

mod real_programs;

fn mill() -> Machine {
    let text = include_str!("../../../../jobs/mill3.toml");
    Machine::from_toml(text, "mill3.toml").unwrap()
}

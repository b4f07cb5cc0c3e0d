//! Prints the table of docs/benchmarks.md that tells what a motion costs on the bus, beside set-points at every millisecond and
//! beside records of position, velocity and time.
//!
//!     cargo run --release -p tests --example bandwidth
#![allow(clippy::print_stdout, reason = "a program that prints")]

fn main() {
    print!("{}", tests::bandwidth::table());
}

//! The `feedspline` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::interrupt::tidy_up_on_interrupt();
    cli::main(std::env::args_os(), &cli::local::Local)
}

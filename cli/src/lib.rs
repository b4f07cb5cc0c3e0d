//! The `feedspline` command: its words, its messages, its report and its JSON.
//!
//! [`args`] reads the command line, [`verbs`] holds one file per verb, [`engine`] is what they ask of the
//! planner and the simulator. Results leave as [`json`] objects, a [`summary`] for people, and the HTML
//! [`report`].

pub mod args;
pub mod console;
pub mod engine;
pub mod failure;
pub mod interrupt;
pub mod json;
mod live;
pub mod local;
pub mod memory;
pub mod moves;
pub mod output;
pub mod progress;
pub mod report;
pub mod summary;
pub mod verbs;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Talk, Verb};
use console::Console;
use engine::Engine;
use failure::Failure;

/// Exit status of bad input and of a wrong command line.
pub const EXIT_BAD_INPUT: u8 = 2;

/// Exit status when the certificate does not hold, and of internal errors.
pub const EXIT_FAILED: u8 = 1;

/// Runs the command line and says how it went.
pub fn main(args: impl IntoIterator<Item = OsString>, engine: &dyn Engine) -> ExitCode {
    ExitCode::from(status(args, engine, &mut std::io::stdout(), &mut std::io::stderr()))
}

/// As [`main`], writing to the given streams and returning the exit status.
pub fn status(
    args: impl IntoIterator<Item = OsString>,
    engine: &dyn Engine,
    out: &mut dyn std::io::Write,
    err: &mut dyn std::io::Write,
) -> u8 {
    let args: Vec<OsString> = args.into_iter().collect();
    let json = args.iter().take_while(|word| *word != "--").any(|word| word == "--json");
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => return explain(&error, &mut Console::new(out, err, Talk { json, quiet: false })),
    };
    let mut console = Console::new(out, err, cli.verb.talk());
    let result = match &cli.verb {
        Verb::Plan(args) => verbs::plan::execute(args, engine, &mut console),
        Verb::Run(args) => verbs::run::execute(args, engine, &mut console),
        Verb::Compare(args) => verbs::compare::execute(args, engine, &mut console),
        Verb::Move(args) => verbs::motion::execute(args, &mut console),
        Verb::Stream(args) => verbs::stream::execute(args, &mut console),
        Verb::Status(args) => verbs::remote::status(args, &mut console),
        Verb::Hold(args) => verbs::remote::hold(args, &mut console),
        Verb::Resume(args) => verbs::remote::resume(args, &mut console),
        Verb::Stop(args) => verbs::remote::stop(args, &mut console),
        Verb::Jog(args) => verbs::errand::jog(args, &mut console),
        Verb::Home(args) => verbs::errand::home(args, &mut console),
        Verb::Flash(args) => verbs::flash::execute(args, &mut console),
        Verb::Update(args) => verbs::update::execute(args, &mut console),
        Verb::Drive(args) => verbs::drive::execute(args, &mut console),
        Verb::Bus(args) => verbs::bus::execute(args, &mut console),
        Verb::Sample(args) => verbs::sample::execute(args, &mut console),
        Verb::Verify(args) => verbs::verify::execute(args, engine, &mut console),
        Verb::Inspect(args) => verbs::inspect::execute(args, engine, &mut console),
    };
    match result {
        Ok(verbs::Verdict::Holds) => 0,
        Ok(verbs::Verdict::Broken) => EXIT_FAILED,
        Ok(verbs::Verdict::Refused) => EXIT_BAD_INPUT,
        Ok(verbs::Verdict::Stopped) => interrupt::EXIT_INTERRUPTED,
        Err(failure) => {
            console.fail(&failure);
            failure.exit_status()
        }
    }
}

/// Shows the help that was asked for, or what is wrong with the command line; returns the exit status.
fn explain(error: &clap::Error, console: &mut Console<'_>) -> u8 {
    let text = error.render().to_string();
    if !error.use_stderr() {
        return match console.say(&text) {
            Ok(()) => 0,
            Err(failure) => {
                console.fail(&failure);
                failure.exit_status()
            }
        };
    }
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    // The first paragraph says what is wrong, the others what would be right.
    let (message, help) = text.split_once("\n\n").unwrap_or((&text, "For more information, try '--help'."));
    let message = words(message.strip_prefix("error: ").unwrap_or(message));
    console.fail_usage(&Failure::input(message).with_help(words(help)), &text);
    EXIT_BAD_INPUT
}

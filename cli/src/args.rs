//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Fastest motion within a machine's limits, as a table for its drives.
#[derive(Debug, Parser)]
#[command(name = "feedspline", version, about, after_help = EXIT_CODES)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
}

const EXIT_CODES: &str = "\
Exit status: 0 done and certified, 1 the certificate does not hold or an internal error, 2 bad input or usage, 130 interrupted.

Example: feedspline run jobs/cat.ngc";

/// The verbs.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Plan a job, certify it and write its feed table
    Plan(PlanArgs),
    /// Plan a job and play its table on simulated drives
    Run(RunArgs),
    /// Prove a feed table against the limits it carries
    Verify(VerifyArgs),
    /// Show what is in a feed table
    Inspect(InspectArgs),
}

/// How much a verb says, and to whom.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Talk {
    /// One JSON object instead of text.
    pub json: bool,
    /// Neither text nor progress.
    pub quiet: bool,
}

impl Verb {
    /// How much this verb was asked to say.
    pub fn talk(&self) -> Talk {
        match self {
            Verb::Plan(args) => args.speech.talk(),
            Verb::Run(args) => args.plan.speech.talk(),
            Verb::Verify(args) => args.speech.talk(),
            Verb::Inspect(args) => args.speech.talk(),
        }
    }
}

/// Options of every verb.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct Speech {
    /// Print one JSON object on standard output (docs/json.md), errors too
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

impl Speech {
    fn talk(self) -> Talk {
        Talk { json: self.json, quiet: self.quiet }
    }
}

/// `feedspline plan`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example: feedspline plan part.ngc --machine mill.toml --tolerance 0.005 -o out/part")]
pub struct PlanArgs {
    /// The part program
    pub job: PathBuf,
    /// Machine file; a built-in 3-axis mill without it
    #[arg(long, value_name = "FILE")]
    pub machine: Option<PathBuf>,
    /// Folder for the results; out/ and the job's name without it
    #[arg(long, short, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Path tolerance, instead of the program's and the machine's
    #[arg(long, value_name = "MM", value_parser = tolerance, allow_negative_numbers = true)]
    pub tolerance: Option<f64>,
    /// Ignore programmed feeds: only the machine limits the speed
    #[arg(long)]
    pub ignore_feed: bool,
    /// Axis limits to keep: velocity and acceleration, or jerk as well
    #[arg(long, value_enum, default_value_t, value_name = "WHICH")]
    pub limits: Limits,
    /// How to read the program
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    pub dialect: Dialect,
    /// Which solver finds the motion
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    pub solver: Solver,
    /// Worker threads [default: one per core]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub threads: Option<u16>,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// `feedspline run`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example: feedspline run part.ngc --machine mill.toml --trace-every 10")]
pub struct RunArgs {
    /// How to plan.
    #[command(flatten)]
    pub plan: PlanArgs,
    /// Write every N-th set-point to trace.csv [default: so that about 200 000 rows are kept]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub trace_every: Option<u32>,
}

/// `feedspline verify`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example: feedspline verify out/part/part.feed")]
pub struct VerifyArgs {
    /// The feed table file
    #[arg(value_name = "FILE.feed")]
    pub file: PathBuf,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// `feedspline inspect`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example: feedspline inspect out/part/part.feed --json")]
pub struct InspectArgs {
    /// The feed table file
    #[arg(value_name = "FILE.feed")]
    pub file: PathBuf,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// Which axis limits a plan keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Limits {
    /// Velocity and acceleration
    Va,
    /// Velocity, acceleration and jerk
    #[default]
    Vaj,
}

/// How a program is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Dialect {
    /// RS-274; whatever is not supported is refused
    #[default]
    Rs274,
    /// 3-D printers: heater, fan and extruder codes are skipped and listed in the report
    Printer,
}

/// The solvers on offer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Solver {
    /// The interior-point method of this project
    #[default]
    InteriorPoint,
    /// Clarabel on a sequence of linear programmes
    Clarabel,
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(mm) if mm.is_finite() && mm >= 0.0 => Ok(mm),
        Ok(_) => Err("a tolerance is a finite length in millimetres, zero or more".into()),
        Err(_) => Err("not a number; give millimetres, such as 0.01".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn plan(words: &[&str]) -> Result<PlanArgs, clap::Error> {
        let words = ["feedspline", "plan"].iter().chain(words);
        match Cli::try_parse_from(words)?.verb {
            Verb::Plan(args) => Ok(args),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_verb_shows_an_example_of_itself() {
        for verb in Cli::command().get_subcommands_mut() {
            let example = format!("Example: feedspline {} ", verb.get_name());
            assert!(verb.render_help().to_string().contains(&example), "{example}");
        }
    }

    #[test]
    fn defaults_are_jerk_limited_rs274() {
        let args = plan(&["a.ngc"]).unwrap();
        assert_eq!(
            (args.limits, args.dialect, args.solver),
            (Limits::Vaj, Dialect::Rs274, Solver::InteriorPoint)
        );
        assert!(
            args.machine.is_none() && args.out.is_none() && args.tolerance.is_none() && !args.ignore_feed
        );
    }

    #[test]
    fn every_option_is_read() {
        let words = "a.ngc --machine m.toml -o d --tolerance 0.02 --ignore-feed --limits va --dialect printer \
                     --solver clarabel --threads 3 --json --quiet";
        let args = plan(&words.split_whitespace().collect::<Vec<_>>()).unwrap();
        assert_eq!(args.machine, Some("m.toml".into()));
        assert_eq!(args.out, Some("d".into()));
        assert_eq!(args.tolerance, Some(0.02));
        assert_eq!(
            (args.limits, args.dialect, args.solver),
            (Limits::Va, Dialect::Printer, Solver::Clarabel)
        );
        assert_eq!(args.threads, Some(3));
        assert!(args.ignore_feed && args.speech.json && args.speech.quiet);
    }

    #[test]
    fn tolerances_that_are_no_length_are_refused() {
        for bad in ["-0.1", "nan", "inf", "wide", ""] {
            assert!(plan(&["a.ngc", &format!("--tolerance={bad}")]).is_err(), "{bad}");
        }
        assert_eq!(plan(&["a.ngc", "--tolerance", "0"]).unwrap().tolerance, Some(0.0));
    }

    #[test]
    fn trace_every_starts_at_one() {
        let run = |n: &str| Cli::try_parse_from(["feedspline", "run", "a.ngc", "--trace-every", n]);
        assert!(run("1").is_ok());
        assert!(run("0").is_err());
    }
}

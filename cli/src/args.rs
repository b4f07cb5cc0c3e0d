//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::failure::Failure;

mod bus;
mod live;

pub use bus::{DriveArgs, UpdateArgs, WatchArgs};
pub use live::{BusArgs, HomeArgs, JogArgs, RateArgs, ResumeArgs, StatusArgs, StopArgs, StreamArgs};

/// Fastest motion within a machine's limits, as a table for its drives.
#[derive(Debug, Parser)]
#[command(name = "feedspline", version, about, after_help = EXIT_CODES)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
}

const EXIT_CODES: &str = "\
Exit status: 0 done and certified, 1 the certificate does not hold or an internal error, 2 bad input, an impossible move or
usage, 130 interrupted.

Example: feedspline run jobs/cat.ngc";

/// The verbs.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Plan a job, certify it and write its feed table
    Plan(PlanArgs),
    /// Plan a job and play its table on simulated drives
    Run(RunArgs),
    /// Plan a job by several methods and show them side by side
    Compare(CompareArgs),
    /// Plan the fastest motion of axes from state to state
    Move(MoveArgs),
    /// Write a sample way-point job
    Sample(SampleArgs),
    /// Prove a feed table against the limits it carries
    Verify(VerifyArgs),
    /// Show what is in a feed table
    Inspect(InspectArgs),
    /// Play a job on drives while it is planned
    Stream(StreamArgs),
    /// Show which drives are on a bus and how they are
    Status(StatusArgs),
    /// Hold all axes on their path; `resume` lets them go on
    Hold(RateArgs),
    /// Let axes go on along their path, at another rate if asked
    Resume(ResumeArgs),
    /// Stop all axes; what was going on ends
    Stop(StopArgs),
    /// Move one axis at a velocity
    Jog(JogArgs),
    /// Bring axes to zero, or to other positions
    Home(HomeArgs),
    /// Build a drive's image, put it where it runs, and ask it who it is
    Flash(FlashArgs),
    /// Bring a drive a new image over the bus
    Update(UpdateArgs),
    /// Simulated drives on a real bus, in real time
    Drive(DriveArgs),
    /// Show what is said on a bus, or was said according to a log
    Bus(WatchArgs),
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
            Verb::Compare(args) => args.speech.talk(),
            Verb::Move(args) => args.speech.talk(),
            Verb::Sample(args) => args.speech.talk(),
            Verb::Verify(args) => args.speech.talk(),
            Verb::Inspect(args) => args.speech.talk(),
            Verb::Flash(args) => args.speech.talk(),
            Verb::Update(args) => args.speech.talk(),
            Verb::Drive(args) => args.speech.talk(),
            Verb::Bus(args) => args.speech.talk(),
            Verb::Stream(args) => args.speech.talk(),
            Verb::Status(args) => args.speech.talk(),
            Verb::Hold(args) => args.speech.talk(),
            Verb::Resume(args) => args.rate.speech.talk(),
            Verb::Stop(args) => args.speech.talk(),
            Verb::Jog(args) => args.speech.talk(),
            Verb::Home(args) => args.speech.talk(),
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

/// A job, and how it is read.
#[derive(Args, Clone, Debug)]
pub struct JobArgs {
    /// The part program, or a .csv file of way-points
    #[arg(value_name = "JOB")]
    pub file: PathBuf,
    /// Machine file; a built-in 3-axis mill without it
    #[arg(long, value_name = "FILE")]
    pub machine: Option<PathBuf>,
    /// Folder for the results; out/ and the job's name without it
    #[arg(long, short, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Path tolerance, instead of the program's and the machine's; of way-points, instead of their last digit or a drive
    /// count: 0 takes the path through every one of them
    #[arg(long, value_name = "MM", value_parser = tolerance, allow_negative_numbers = true)]
    pub tolerance: Option<f64>,
    /// Ignore programmed feeds: only the machine limits the speed
    #[arg(long)]
    pub ignore_feed: bool,
    /// How to read the program [default: rs274]
    #[arg(long, value_enum, value_name = "NAME")]
    pub dialect: Option<Dialect>,
    /// Ends of the spline through way-points [default: not-a-knot]
    #[arg(long, value_enum, value_name = "ENDS")]
    pub spline: Option<Ends>,
    /// How the spline's parameter is spread over way-points [default: chord]
    #[arg(long, value_enum, value_name = "RULE")]
    pub knots: Option<Knots>,
    /// Feed of a way-point job [mm/min; deg or rad per min without a linear axis]; none without it
    #[arg(long, value_name = "F", value_parser = feed, allow_negative_numbers = true)]
    pub feed: Option<f64>,
    /// Worker threads [default: one per core]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub threads: Option<u16>,
}

impl JobArgs {
    /// Whether the job is a file of way-points, by its name.
    pub fn way_points(&self) -> bool {
        self.file.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"))
    }

    /// Refuses options that mean nothing for a job of this kind.
    ///
    /// # Errors
    /// Names the first of them.
    pub fn check(&self) -> Result<(), Failure> {
        let for_points = [
            ("--spline", self.spline.is_some()),
            ("--knots", self.knots.is_some()),
            ("--feed", self.feed.is_some()),
        ];
        let for_programs = [("--ignore-feed", self.ignore_feed), ("--dialect", self.dialect.is_some())];
        let given = |options: &[(&'static str, bool)]| options.iter().find(|o| o.1).map(|o| o.0);
        let (option, kind, help) = if self.way_points() {
            (
                given(&for_programs),
                "a file of way-points",
                "A file of way-points has no words and no programmed feeds; --feed gives it one. Leave the option away.",
            )
        } else {
            (
                given(&for_points),
                "a part program",
                "Files of way-points end in .csv. Leave the option away, or rename the file if it is one.",
            )
        };
        match option {
            Some(option) => Err(Failure::input(format!("{option} says nothing about {kind}"))
                .in_file(&self.file)
                .with_help(help)),
            None => Ok(()),
        }
    }
}

/// `feedspline plan`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example: feedspline plan part.ngc --machine mill.toml --tolerance 0.005 -o out/part
         feedspline plan points.csv --spline not-a-knot --knots uniform --limits va")]
pub struct PlanArgs {
    /// What to plan.
    #[command(flatten)]
    pub job: JobArgs,
    /// Axis limits to keep: velocity and acceleration, or jerk as well [default: vaj]
    #[arg(long, value_enum, value_name = "WHICH")]
    pub limits: Option<Limits>,
    /// How jerk is limited; none is --limits va [default: true]
    #[arg(long, value_enum, value_name = "FORM")]
    pub jerk: Option<Jerk>,
    /// How long paths are divided
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    pub windows: Windows,
    /// Which solver finds the motion
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    pub solver: Solver,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

impl PlanArgs {
    /// How jerk is limited, whichever option says so.
    ///
    /// # Errors
    /// The two options contradict each other.
    pub fn jerk_form(&self) -> Result<Jerk, Failure> {
        match (self.limits, self.jerk) {
            (Some(Limits::Va), Some(Jerk::True | Jerk::Pseudo)) => {
                Err(Failure::input("--limits va leaves jerk out, --jerk asks for it")
                    .with_help("Leave one of the two options away."))
            }
            (Some(Limits::Vaj), Some(Jerk::None)) => {
                Err(Failure::input("--limits vaj limits jerk, --jerk none leaves it out")
                    .with_help("Leave one of the two options away."))
            }
            (Some(Limits::Va), _) => Ok(Jerk::None),
            (_, form) => Ok(form.unwrap_or_default()),
        }
    }
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

/// `feedspline compare`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
The feed moves of the job are planned by one method after the other, on the same path and under the same limits. Rapids
and waits are left out.

Example: feedspline compare jobs/cat2d.csv --machine jobs/compact3.toml --methods whole,zhao,overlap,constant-feed")]
pub struct CompareArgs {
    /// What to plan.
    #[command(flatten)]
    pub job: JobArgs,
    /// Methods, separated by commas [default: all; clarabel on short paths only]
    #[arg(long, value_enum, value_delimiter = ',', value_name = "LIST")]
    pub methods: Vec<Method>,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// `feedspline move`.
#[derive(Args, Clone, Debug, Default)]
#[command(after_help = "\
Positions in any unit, the others in that unit per second to the first, second and third. Limits are kept at every instant; a
start outside of them is led back first. Without p1 the target is the velocity v1, wherever it is reached.

A file names its columns in the first line: p0 v0 a0 p1 v1 a1 vmax amax jmax, and vmin amin jmin where limits are not symmetric;
with _0, _1 and so on for several axes, which wait for each other as the column sync says (none, time or phase).

Example: feedspline move --p0 0 --p1 10 --vmax 5 --amax 20 --jmax 200
         feedspline move moves.csv --sync time --json")]
pub struct MoveArgs {
    /// A file of moves, one a line
    #[arg(value_name = "MOVES.csv", conflicts_with_all = ["p0", "v0", "a0", "p1", "v1", "a1", "vmax", "amax", "jmax", "vmin", "amin", "jmin"])]
    pub file: Option<PathBuf>,
    /// Position at the start
    #[arg(long, value_name = "P", allow_negative_numbers = true)]
    pub p0: Option<f64>,
    /// Velocity at the start [default: 0]
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub v0: Option<f64>,
    /// Acceleration at the start [default: 0]
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub a0: Option<f64>,
    /// Position at the end; without it the target is a velocity
    #[arg(long, value_name = "P", allow_negative_numbers = true)]
    pub p1: Option<f64>,
    /// Velocity at the end [default: 0]
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub v1: Option<f64>,
    /// Acceleration at the end [default: 0]
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub a1: Option<f64>,
    /// Largest velocity
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub vmax: Option<f64>,
    /// Largest acceleration
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub amax: Option<f64>,
    /// Largest jerk
    #[arg(long, value_name = "J", allow_negative_numbers = true)]
    pub jmax: Option<f64>,
    /// Smallest velocity [default: -vmax]
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub vmin: Option<f64>,
    /// Smallest acceleration [default: -amax]
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub amin: Option<f64>,
    /// Smallest jerk [default: -jmax]
    #[arg(long, value_name = "J", allow_negative_numbers = true)]
    pub jmin: Option<f64>,
    /// How axes wait for each other, unless a column says so
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    pub sync: Sync,
    /// Bus of drives that make the move: sim, can0, vcan0, slcan:PATH; without it the move is only planned
    #[arg(long, value_name = "BUS", requires = "to", conflicts_with_all = ["file", "p0", "p1"])]
    pub bus: Option<String>,
    /// Drives send CAN FD
    #[arg(long, requires = "bus")]
    pub fd: bool,
    /// Key file of drives that obey signed messages only
    #[arg(long, value_name = "FILE", requires = "bus")]
    pub key: Option<PathBuf>,
    /// Where drives bring an axis, such as X=12.5; may be given again for others
    #[arg(long, value_name = "AXIS=POSITION", requires = "bus", allow_negative_numbers = true)]
    pub to: Vec<String>,
    /// No faster than this [axis unit/s]
    #[arg(long, value_name = "V", requires = "bus")]
    pub velocity: Option<f64>,
    /// Machine file of the drives; a built-in 3-axis mill without it
    #[arg(long, value_name = "FILE", requires = "bus")]
    pub machine: Option<PathBuf>,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// How axes wait for each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Sync {
    /// Not at all
    #[default]
    None,
    /// They arrive at the same time
    Time,
    /// They keep to one line if their states allow it, else they arrive at the same time
    Phase,
}

impl From<Sync> for host_sim::group::Sync {
    fn from(sync: Sync) -> Self {
        match sync {
            Sync::None => host_sim::group::Sync::None,
            Sync::Time => host_sim::group::Sync::Time,
            Sync::Phase => host_sim::group::Sync::Phase,
        }
    }
}

/// `feedspline sample`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example: feedspline sample tooth --rows 1000 --points 100 -o out/tooth.csv")]
pub struct SampleArgs {
    /// Which one
    #[arg(value_enum)]
    pub what: Sample,
    /// Way-points in all, or of each row [default: 3000 for the cat, 100 for the tooth]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    pub points: Option<u32>,
    /// Rows of the tooth [default: 1000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub rows: Option<u32>,
    /// The file to write; out/ and the sample's name without it
    #[arg(long, short, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
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

/// `feedspline flash`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
The image is built with cargo from firmware/, here or in a folder above.

Example: feedspline flash --board emulated
         feedspline flash --board stm32g4 --node 2 --line /dev/ttyACM0")]
pub struct FlashArgs {
    /// Where it runs
    #[arg(long, value_enum, value_name = "NAME")]
    pub board: Board,
    /// The drive's address; the axis is the one before it
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=127))]
    pub node: u8,
    /// A finished image, instead of building one
    #[arg(long, value_name = "FILE")]
    pub image: Option<PathBuf>,
    /// Device file of the SLCAN adapter on the drive's bus, to ask it
    #[arg(long, value_name = "FILE")]
    pub line: Option<PathBuf>,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// Where a drive's image runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Board {
    /// A Cortex-M4F in the emulator QEMU
    Emulated,
    /// An STM32G474 behind a debug probe; never tried on hardware by its makers
    Stm32g4,
}

/// Which axis limits a plan keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Limits {
    /// Velocity and acceleration
    Va,
    /// Velocity, acceleration and jerk
    Vaj,
}

/// How jerk is limited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Jerk {
    /// The jerk of every axis, as it is
    #[default]
    True,
    /// The linear form of Zhao 2016, eq. 3.4: stricter than it has to be
    Pseudo,
    /// Not at all
    None,
}

/// How long paths are divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Windows {
    /// Windows side by side, then once more round their joints
    #[default]
    Overlap,
    /// Not at all
    Whole,
    /// Spliced where the motion is slow, as in Zhao 2016, sec. 3.2
    Zhao,
}

/// What closes the spline at its ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Ends {
    /// The third derivative is continuous one way-point from the ends
    #[default]
    NotAKnot,
    /// The path sets out along the first chord and arrives along the last
    Clamped,
    /// The second derivative is zero
    Natural,
    /// A closed curve without a seam
    Periodic,
}

/// How the spline's parameter is spread over the way-points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Knots {
    /// Alike between any two
    Uniform,
    /// By their distance
    #[default]
    Chord,
    /// By the square root of their distance
    Centripetal,
}

/// The ways to plan that can be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Method {
    /// True jerk, the path in one piece
    Whole,
    /// True jerk, spliced where the motion is slow
    Zhao,
    /// True jerk, windows side by side, then once more round their joints
    Overlap,
    /// True jerk on eight times as many spans: how much the usual number costs
    Fine,
    /// One speed all along the path
    ConstantFeed,
    /// The linear form of the jerk limit
    PseudoJerk,
    /// Velocity and acceleration only
    NoJerk,
    /// Velocity and acceleration by the sweep alone: its time, no table
    Sweep,
    /// Clarabel on a sequence of linear programmes
    Clarabel,
    /// Limits asked for in the middle of each span only; not certified
    Collocation,
}

/// Samples of way-points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Sample {
    /// The outline of a cat, X and Y
    Cat,
    /// A zigzag over a tooth, X, Y and Z
    Tooth,
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

/// The name of a choice, as on the command line.
pub fn name(choice: impl ValueEnum) -> String {
    choice.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(mm) if mm.is_finite() && mm >= 0.0 => Ok(mm),
        Ok(_) => Err("a tolerance is a finite length in millimetres, zero or more".into()),
        Err(_) => Err("not a number; give millimetres, such as 0.01".into()),
    }
}

fn feed(text: &str) -> Result<f64, String> {
    /// Feeds of machines, with decades to spare on either side.
    const SENSIBLE: std::ops::RangeInclusive<f64> = 1e-6..=1e9;
    match text.parse::<f64>() {
        Ok(feed) if SENSIBLE.contains(&feed) => Ok(feed),
        Ok(_) => Err("a feed is a speed between 0.000001 and 1000000000 millimetres per minute".into()),
        Err(_) => Err("not a number; give millimetres per minute, such as 1500".into()),
    }
}

#[cfg(test)]
mod tests;

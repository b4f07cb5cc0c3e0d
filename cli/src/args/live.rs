//! Arguments of the verbs that speak to drives.

use std::path::PathBuf;

use clap::Args;

use super::{JobArgs, Speech};

/// Which bus, and what frames it carries.
#[derive(Args, Clone, Debug)]
pub struct BusArgs {
    /// sim, can0, vcan0, slcan:PATH
    #[arg(long, value_name = "BUS", default_value = "sim")]
    pub bus: String,
    /// Send CAN FD instead of classic CAN
    #[arg(long)]
    pub fd: bool,
    /// Key file of drives that obey signed messages only: 32 hexadecimal digits, or 16 bytes
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
}

/// `feedspline stream`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
Motion begins while the job is still planned: every piece ends at rest, and the next one takes over on the way. Ctrl-C stops
all axes on their path, Ctrl-C again as fast as each of them can.

Example: feedspline stream jobs/cat.ngc
         feedspline stream part.feed --bus can0 --fd")]
pub struct StreamArgs {
    /// What to play; files that end in .feed are tables.
    #[command(flatten)]
    pub job: JobArgs,
    /// Where the drives are.
    #[command(flatten)]
    pub bus: BusArgs,
    /// Room of the drives for one table [bytes]; tables that are longer go in pieces
    #[arg(long, value_name = "BYTES", default_value_t = 16_000, value_parser = clap::value_parser!(u32).range(1_000..=5_000_000))]
    pub room: u32,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// `feedspline status`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example: feedspline status --bus can0")]
pub struct StatusArgs {
    /// Which bus.
    #[command(flatten)]
    pub bus: BusArgs,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// `feedspline hold`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example: feedspline hold --bus can0")]
pub struct RateArgs {
    /// Which bus.
    #[command(flatten)]
    pub bus: BusArgs,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// `feedspline resume`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example: feedspline resume --bus can0 --percent 50")]
pub struct ResumeArgs {
    /// Which bus, and what to say.
    #[command(flatten)]
    pub rate: RateArgs,
    /// At this rate of the planned motion
    #[arg(long, value_name = "P", default_value_t = 100.0, value_parser = percent)]
    pub percent: f64,
}

/// `feedspline stop`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
Without an option all axes stop together on their path. Stops are always obeyed, whoever commands the drives; what was going on
ends, and motion begins anew only by a new command.

Example: feedspline stop --bus can0
         cansend can0 010#          the same from any CAN tool, as --quick")]
pub struct StopArgs {
    /// Which bus.
    #[command(flatten)]
    pub bus: BusArgs,
    /// Every axis as fast as it can, off the path if need be
    #[arg(long, conflicts_with = "off")]
    pub quick: bool,
    /// Take the torque away at once
    #[arg(long)]
    pub off: bool,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// `feedspline jog`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
The axis comes to rest at the end of its travel, after --seconds, or with Ctrl-C; and when this command dies.

Example: feedspline jog --bus can0 --axis X --velocity -5 --seconds 2")]
pub struct JogArgs {
    /// Which bus.
    #[command(flatten)]
    pub bus: BusArgs,
    /// Which axis
    #[arg(long, value_name = "NAME")]
    pub axis: String,
    /// How fast, and which way [axis unit/s]
    #[arg(long, value_name = "V", allow_negative_numbers = true, value_parser = number)]
    pub velocity: f64,
    /// For how long [s]
    #[arg(long, value_name = "S", value_parser = time)]
    pub seconds: Option<f64>,
    /// Machine file of the drives; a built-in 3-axis mill without it
    #[arg(long, value_name = "FILE")]
    pub machine: Option<PathBuf>,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// `feedspline home`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
Drives count from an absolute encoder: there is no switch to look for. Axes go at the same time, each on its own.

Example: feedspline home --bus can0 --axis Z
         feedspline home --bus can0")]
pub struct HomeArgs {
    /// Which bus.
    #[command(flatten)]
    pub bus: BusArgs,
    /// Which axes [default: all]
    #[arg(long, value_name = "NAME")]
    pub axis: Vec<String>,
    /// No faster than this [axis unit/s]
    #[arg(long, value_name = "V", value_parser = number)]
    pub velocity: Option<f64>,
    /// Machine file of the drives; a built-in 3-axis mill without it
    #[arg(long, value_name = "FILE")]
    pub machine: Option<PathBuf>,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

fn number(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err("not a finite number".into()),
    }
}

fn time(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 86_400.0 => Ok(seconds),
        _ => Err("give seconds, above 0 and at most a day".into()),
    }
}

fn percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(percent) if percent > 0.0 && percent <= 200.0 => Ok(percent),
        _ => Err("give a percentage above 0 and at most 200".into()),
    }
}

//! The command lines of `drive` and `bus`.

use std::path::PathBuf;

use clap::Args;

use super::Speech;

/// `feedspline drive`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
A bus is a CAN interface of Linux, such as can0 or vcan0, or slcan: and the device file of an SLCAN adapter, or a socket.
The drives stand still at position 0 until a host opens an epoch with them. Ctrl-C ends them, with exit status 0; a bus that
goes away does so with 1.

Example: feedspline drive --bus vcan0 --node 1
         feedspline drive --bus slcan:/dev/ttyACM0 --node 2 --count 1 --machine jobs/router4.toml")]
pub struct DriveArgs {
    /// The bus
    #[arg(long, value_name = "BUS")]
    pub bus: String,
    /// Address of the first drive; the first axis of the machine has 1, the second 2, and so on
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=127))]
    pub node: u8,
    /// How many drives, for this axis and those behind it [default: all of them]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u8).range(1..=127))]
    pub count: Option<u8>,
    /// Machine file; a built-in 3-axis mill without it
    #[arg(long, value_name = "FILE")]
    pub machine: Option<PathBuf>,
    /// Take tables that do not limit jerk
    #[arg(long)]
    pub free_jerk: bool,
    /// Send frames of CAN FD
    #[arg(long)]
    pub fd: bool,
    /// Obey messages only that are signed with the key in this file: 32 hexadecimal digits, or 16 bytes
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
    /// End after so long [s]
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub seconds: Option<f64>,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// `feedspline update`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
The drive has to be at rest without torque (`feedspline stop --off`), and no host may have it in use. The image is checked as it
was stored, tried once, and kept when the drive is there again; if it is not, the image before it runs. A break is no matter: the
same command goes on where it was.

Example: feedspline update --bus can0 --node 2 drive.bin
         rust-objcopy -O binary drive drive.bin          makes such a file")]
pub struct UpdateArgs {
    /// The image, byte by byte as it lies in the drive's memory
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// The bus
    #[arg(long, value_name = "BUS")]
    pub bus: String,
    /// Address of the drive
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=127))]
    pub node: u8,
    /// Send frames of CAN FD
    #[arg(long)]
    pub fd: bool,
    /// Key file of a drive that obeys signed messages only
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

/// `feedspline bus`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
Logs are those of `candump -L`. A line has the time in seconds, the identifier, the drive, the kind of message and what it says;
messages of several frames are shown when they are complete. Ctrl-C ends it, with exit status 0.

Example: feedspline bus --bus vcan0
         feedspline bus candump.log --json")]
pub struct WatchArgs {
    /// A log
    #[arg(value_name = "LOG", required_unless_present = "bus", conflicts_with = "bus")]
    pub log: Option<PathBuf>,
    /// The bus: a CAN interface, such as can0, or slcan: and a device file
    #[arg(long, value_name = "BUS")]
    pub bus: Option<String>,
    /// Open an SLCAN adapter for CAN FD; interfaces of Linux show it anyway
    #[arg(long, requires = "bus")]
    pub fd: bool,
    /// End after so many frames
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,
    /// End after so long [s]
    #[arg(long, value_name = "S", value_parser = seconds, requires = "bus")]
    pub seconds: Option<f64>,
    /// What to say.
    #[command(flatten)]
    pub speech: Speech,
}

fn seconds(text: &str) -> Result<f64, String> {
    /// About three years.
    const MOST: f64 = 1e8;
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= MOST => Ok(seconds),
        Ok(_) => Err("a time is above 0 and at most 100000000 seconds".into()),
        Err(_) => Err("not a number; give seconds, such as 10".into()),
    }
}

//! `feedspline flash`: build a drive's image, put it where it runs, and ask it who it is.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use host_sim::emulator::{Emulator, PROGRAM};
use host_sim::slcan_line::{LineError, SlcanLine};
use protocol::bus::Node;
use protocol::message::Identity;
use protocol::schema;

use super::Verdict;
use crate::args::{self, Board, FlashArgs};
use crate::console::Console;
use crate::failure::Failure;
use crate::json::FlashJson;
use crate::summary;

/// What images are built for.
const TARGET: &str = "thumbv7em-none-eabihf";

/// What writes an image to a chip through a debug probe, and the chip.
const PROBE: &str = "probe-rs";
const CHIP: &str = "STM32G474RETx";

/// How long a drive may take to boot and to answer.
const PATIENCE: Duration = Duration::from_secs(15);

/// Runs the verb.
///
/// # Errors
/// The sources are not there, the image cannot be built or run, or the drive does not answer.
pub fn execute(args: &FlashArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let node = Node::new(args.node).ok_or_else(|| {
        Failure::input("--node is a number from 1 to 127").with_help("1 is the first axis.")
    })?;
    match (args.board, &args.line) {
        (Board::Emulated, Some(_)) => {
            return Err(Failure::input("--line says nothing about the emulated board")
                .with_help("Its line is the emulator's. Leave the option away."));
        }
        (Board::Stm32g4, None) => {
            return Err(Failure::input(
                "--line is missing: there is no other way to ask the drive who it is",
            )
            .with_help("Name the SLCAN adapter on its bus, such as --line /dev/ttyACM0."));
        }
        (Board::Emulated, None) | (Board::Stm32g4, Some(_)) => {}
    }
    let image = match &args.image {
        Some(image) => existing(image)?,
        None => build(args.board, node)?,
    };
    let identity = match &args.line {
        None => emulated(&image, node)?,
        Some(device) => {
            write(&image)?;
            ask(device, node)?
        }
    };
    let matches = identity.schema == schema::HASH;
    let told = FlashJson::of(&args::name(args.board), &image, node, &identity, matches);
    console.show(&told, &summary::flash(&told))?;
    if matches {
        return Ok(Verdict::Holds);
    }
    console.warn("the drive speaks another version of the protocol: it must not be used with this host\n");
    Ok(Verdict::Broken)
}

fn existing(image: &Path) -> Result<PathBuf, Failure> {
    std::fs::File::open(image).map_err(|e| Failure::unreadable(image, &e))?;
    Ok(image.to_path_buf())
}

/// Builds the image of a board from its sources.
fn build(board: Board, node: Node) -> Result<PathBuf, Failure> {
    let folder = sources(&args::name(board))?;
    let mut command = Command::new("cargo");
    command
        .args(["build", "--release", "--locked", "--bin", "drive"])
        .env("FEEDSPLINE_NODE", node.number().to_string())
        .env_remove("CARGO_TARGET_DIR")
        .current_dir(&folder);
    let output = run(command, "Install Rust (https://rustup.rs), or name a finished image with --image.")?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let error = said.lines().find(|line| line.starts_with("error")).unwrap_or("cargo says nothing of it");
        return Err(Failure::input(format!("the image cannot be built: {error}")).in_file(&folder).with_help(
            format!("`rustup target add {TARGET}` adds what it is built for; `cargo build --release` in this folder says more."),
        ));
    }
    Ok(folder.join("target").join(TARGET).join("release").join("drive"))
}

/// Runs a program to its end; `help` is for one that does not start.
fn run(mut command: Command, help: &str) -> Result<Output, Failure> {
    command.stdin(Stdio::null()).output().map_err(|e| {
        let program = command.get_program().display();
        Failure::input(format!("{program} does not start: {e}")).with_help(help)
    })
}

/// The folder of a board's sources: `firmware/` and its name, here or in a folder above.
fn sources(board: &str) -> Result<PathBuf, Failure> {
    let here =
        std::env::current_dir().map_err(|e| Failure::internal(format!("there is no current folder: {e}")))?;
    let found =
        here.ancestors().map(|up| up.join("firmware").join(board)).find(|f| f.join("Cargo.toml").is_file());
    found.ok_or_else(|| {
        Failure::input(format!("there is no firmware/{board} here or in a folder above"))
            .with_help("Run this inside the sources of feedspline, or name a finished image with --image.")
    })
}

fn emulated(image: &Path, node: Node) -> Result<Identity, Failure> {
    let failed = |error: LineError| {
        let (message, help) = match error {
            LineError::Open(e) => (
                format!("{PROGRAM} does not start: {e}"),
                format!("Install {PROGRAM}, on Debian with apt-get install {PROGRAM}."),
            ),
            LineError::Broken => (
                "the emulator has ended".to_owned(),
                "The file is no image for this board, or the emulator is too old.".to_owned(),
            ),
            LineError::Silent => (error.to_string(), silent(node)),
        };
        Failure::input(message).in_file(image).with_help(help)
    };
    Emulator::boot(image).and_then(|mut drive| drive.line.identify(node, PATIENCE)).map_err(failed)
}

/// Writes an image to the chip behind the debug probe, and starts it.
fn write(image: &Path) -> Result<(), Failure> {
    for (word, file) in [("download", Some(image)), ("reset", None)] {
        let mut command = Command::new(PROBE);
        command.args([word, "--chip", CHIP]).args(file);
        let output = run(command, "Install it from https://probe.rs, and connect the board's debug probe.")?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            let last =
                said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it does not say why").trim();
            return Err(Failure::input(format!("{PROBE} {word} has failed: {last}"))
                .in_file(image)
                .with_help(format!(
                    "`{PROBE} list` shows the probes that are connected; the chip is {CHIP}."
                )));
        }
    }
    Ok(())
}

/// Asks the drive on the bus of an adapter.
fn ask(device: &Path, node: Node) -> Result<Identity, Failure> {
    SlcanLine::adapter(device).and_then(|mut line| line.identify(node, PATIENCE)).map_err(|error| {
        let help = match error {
            LineError::Open(_) => "Check the name of the device file and who may use it.".to_owned(),
            LineError::Broken => "The adapter has gone: check its cable.".to_owned(),
            LineError::Silent => silent(node),
        };
        Failure::input(error.to_string()).in_file(device).with_help(help)
    })
}

fn silent(node: Node) -> String {
    let number = node.number();
    format!(
        "The image listens to another address than --node {number}, is none of a drive, or its bus is not connected."
    )
}

//! `feedspline flash`: build a drive's image, put it where it runs, and ask it who it is.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use host_sim::emulator::{Emulator, EmulatorError, PROGRAM};
use protocol::bus::Node;
use protocol::schema;

use super::Verdict;
use crate::args::{self, Board, FlashArgs};
use crate::console::Console;
use crate::failure::Failure;
use crate::json::FlashJson;
use crate::summary;

/// What the emulated image is built for.
const TARGET: &str = "thumbv7em-none-eabihf";

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
    let image = match &args.image {
        Some(image) => existing(image)?,
        None => build(args.board, node)?,
    };
    let identity = match args.board {
        Board::Emulated => emulated(&image, node)?,
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
    let output = Command::new("cargo")
        .args(["build", "--release", "--locked", "--bin", "drive"])
        .env("FEEDSPLINE_NODE", node.number().to_string())
        .env_remove("CARGO_TARGET_DIR")
        .current_dir(&folder)
        .stdin(Stdio::null())
        .output()
        .map_err(|e| {
            Failure::input(format!("cargo does not start: {e}"))
                .with_help("Install Rust (https://rustup.rs), or name a finished image with --image.")
        })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let error = said.lines().find(|line| line.starts_with("error")).unwrap_or("cargo says nothing of it");
        return Err(Failure::input(format!("the image cannot be built: {error}")).in_file(&folder).with_help(
            format!("`rustup target add {TARGET}` adds what it is built for; `cargo build --release` in this folder says more."),
        ));
    }
    Ok(folder.join("target").join(TARGET).join("release").join("drive"))
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

fn emulated(image: &Path, node: Node) -> Result<protocol::message::Identity, Failure> {
    let failed = |error: EmulatorError| {
        let help = match error {
            EmulatorError::Start(_) => {
                format!("Install {PROGRAM}, on Debian with apt-get install {PROGRAM}.")
            }
            EmulatorError::Ended => {
                "The file is no image for this board, or the emulator is too old.".to_owned()
            }
            EmulatorError::Silent => {
                format!(
                    "The image listens to another address than --node {}, or is none of a drive.",
                    node.number()
                )
            }
        };
        Failure::input(error.to_string()).in_file(image).with_help(help)
    };
    Emulator::boot(image).and_then(|mut drive| drive.identify(node, PATIENCE)).map_err(failed)
}

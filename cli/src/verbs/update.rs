//! `feedspline update`: bring a drive a new image over the bus.

use std::fmt::Write;
use std::thread::sleep;
use std::time::Duration;

use host_sim::bus::FrameSize;
use host_sim::bus::real::{RealBus, open};
use host_sim::update::{Stage, UpdateError, Updating};
use protocol::bus::Node;
use protocol::update::UpdateFault;

use super::{Verdict, drive};
use crate::args::UpdateArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::json::{UpdateJson, seconds};
use crate::live::key;
use crate::progress::Progress;
use crate::{interrupt, summary};

/// Between two turns.
const TURN: Duration = Duration::from_millis(1);

/// Runs the verb. Ctrl-C ends it; the drive keeps what has come.
///
/// # Errors
/// There is no image, no bus, no drive, or the drive refuses.
pub fn execute(args: &UpdateArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let bytes = std::fs::read(&args.image).map_err(|e| Failure::unreadable(&args.image, &e))?;
    let node = Node::new(args.node).ok_or_else(|| Failure::input("--node is a number from 1 to 127"))?;
    let size = if args.fd { FrameSize::Fd } else { FrameSize::Classic };
    let key = key::of(args.key.as_deref())?.map(|key| (key, key::now_us()));
    let mut bus = open(&args.bus, size).map_err(|error| drive::refusal(&error))?;
    let bus: &mut dyn RealBus = bus.as_mut();
    let refused = |error: UpdateError| refusal(error, args);
    let mut updating = Updating::new(bytes, node, size, key, bus).map_err(refused)?;
    let mut progress = Progress::new(console.talk());
    interrupt::count_presses();
    let mut shown = None;
    while updating.stage() != Stage::Done {
        if interrupt::presses() > 0 {
            return Ok(Verdict::Stopped);
        }
        let now = bus.now();
        bus.advance(now);
        if let Some(error) = bus.take_error() {
            return Err(drive::loss(&error));
        }
        updating.turn(bus, now).map_err(refused)?;
        let stage = updating.stage();
        if shown != Some(stage) {
            shown = Some(stage);
            show(stage, updating.length(), &mut progress);
        }
        sleep(TURN);
    }
    drop(progress);
    let mut sha256 = String::new();
    for byte in updating.hash() {
        let _ = write!(sha256, "{byte:02x}");
    }
    let told = UpdateJson {
        image: args.image.display().to_string(),
        image_bytes: updating.length(),
        sha256,
        node: args.node,
        seconds: seconds(bus.now()),
    };
    console.show(&told, &summary::updated(&told))?;
    Ok(Verdict::Holds)
}

fn show(stage: Stage, length: u32, progress: &mut Progress) {
    let share = |done: u32| f64::from(done) / f64::from(length.max(1));
    match stage {
        Stage::Asking => progress.stage("asking"),
        Stage::Sending(done) => {
            progress.stage("sending");
            progress.share(share(done));
        }
        Stage::Checking(done) => {
            progress.stage("checking");
            progress.share(share(done));
        }
        Stage::Restarting => progress.stage("restarting"),
        Stage::Keeping | Stage::Done => progress.stage("keeping"),
    }
}

fn refusal(error: UpdateError, args: &UpdateArgs) -> Failure {
    let node = args.node;
    let (message, help) = match error {
        UpdateError::Empty => {
            return Failure::input(error.to_string())
                .in_file(&args.image)
                .with_help("Name the file of an image.");
        }
        UpdateError::Silent => (
            format!("node {node} does not answer"),
            "If it has started up with the new image, that does not work: switch it off and on, and the one before it runs. \
             `feedspline status` shows who is there.",
        ),
        UpdateError::Key => (
            format!("node {node} has a key, and this host does not sign with it"),
            "Name its key with --key.",
        ),
        UpdateError::RolledBack => (
            format!("node {node} runs the image that it had"),
            "The new one did not start up. Try again, or another image.",
        ),
        UpdateError::Refused(fault) => match fault {
            UpdateFault::Unable => (
                format!("node {node} has no place for new images"),
                "Write it with a debug probe: `feedspline flash`.",
            ),
            UpdateFault::Powered => (
                format!("node {node} has torque, moves, or is in use"),
                "Images are taken at rest without torque: `feedspline stop --off`, and end whatever commands it.",
            ),
            UpdateFault::Size { room } => (
                format!("the image does not fit: node {node} has place for {room} bytes"),
                "Name an image that was built for this drive.",
            ),
            UpdateFault::Hash => (
                format!("node {node} has stored something else than was sent"),
                "Try again; if that happens again, its memory is worn out.",
            ),
            UpdateFault::Memory => {
                (format!("the memory of node {node} fails"), "Try again, or write it with a debug probe.")
            }
            UpdateFault::Order => (
                format!("node {node} has lost track of the update"),
                "Somebody else has begun one, or it has started up anew. Try again.",
            ),
        },
    };
    Failure::input(message).with_help(help)
}

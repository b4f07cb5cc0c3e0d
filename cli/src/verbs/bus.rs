//! `feedspline bus`: what is said on a bus, or was said according to a log, in words.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use host_sim::bus::decode::{self, Decoder, Kind};
use host_sim::bus::real::{RealBus, open};
use host_sim::bus::{Frame, FrameSize, Nanoseconds};

use super::{Verdict, drive};
use crate::args::WatchArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::json::{DecodedJson, HealthJson, MalformedJson, WatchedJson, seconds};
use crate::{interrupt, summary};

/// Between two looks at a bus that is silent.
const NAP: Duration = Duration::from_millis(1);

/// Malformed lines that are told of one by one.
const TOLD: usize = 20;

/// Messages that one JSON object holds.
const KEPT: usize = 100_000;

/// Longest line of a log: far more than any has [bytes].
const LINE_BYTES: u64 = 1 << 16;

/// Runs the verb.
///
/// # Errors
/// The log cannot be read, or the bus is not there, or goes away.
pub fn execute(args: &WatchArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let mut watch = Watch { decoder: Decoder::new(), told: WatchedJson::default(), most: args.count };
    match (&args.bus, &args.log) {
        (Some(bus), _) => watch.live(bus, args, console)?,
        (None, Some(log)) => watch.log(log, console)?,
        (None, None) => {
            return Err(Failure::input("there is neither a bus nor a log")
                .with_help("Name a log, or a bus with --bus."));
        }
    }
    let told = watch.told;
    console.show(&told, &summary::watched(&told))?;
    if told.malformed_lines == 0 {
        return Ok(Verdict::Holds);
    }
    console.warn(&format!(
        "{} lines of {} are none of a log; `candump -L` writes what this reads\n",
        told.malformed_lines, told.source
    ));
    Ok(Verdict::Refused)
}

/// What was seen so far.
struct Watch {
    decoder: Decoder,
    told: WatchedJson,
    /// Frames after which it is enough.
    most: Option<u64>,
}

impl Watch {
    fn is_enough(&self) -> bool {
        self.most.is_some_and(|most| self.told.frames >= most)
    }

    fn live(&mut self, name: &str, args: &WatchArgs, console: &mut Console<'_>) -> Result<(), Failure> {
        name.clone_into(&mut self.told.source);
        let size = if args.fd { FrameSize::Fd } else { FrameSize::Classic };
        let mut bus = open(name, size).map_err(|error| drive::refusal(&error))?;
        let bus: &mut dyn RealBus = bus.as_mut();
        let node = bus.attach();
        interrupt::count_presses();
        let end = args.seconds.map(|seconds| (seconds * 1e9) as Nanoseconds);
        while interrupt::presses() == 0
            && !console.is_closed()
            && !self.is_enough()
            && end.is_none_or(|end| bus.now() < end)
        {
            let now = bus.now();
            bus.advance(now);
            if let Some(error) = bus.take_error() {
                return Err(drive::loss(&error));
            }
            let mut silent = true;
            while !self.is_enough()
                && let Some(received) = bus.receive(node)
            {
                silent = false;
                self.frame(received.time, &received.frame, console)?;
            }
            if silent {
                sleep(NAP);
            }
        }
        self.told.bus_health = Some(HealthJson::of(bus.traffic(), bus.health()));
        Ok(())
    }

    fn log(&mut self, path: &Path, console: &mut Console<'_>) -> Result<(), Failure> {
        let unreadable = |e: std::io::Error| Failure::unreadable(path, &e);
        self.told.source = path.display().to_string();
        let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
        let mut bytes = Vec::new();
        let mut number = 0;
        while !self.is_enough() && !console.is_closed() {
            bytes.clear();
            let mut limited = std::io::Read::take(&mut file, LINE_BYTES);
            if limited.read_until(b'\n', &mut bytes).map_err(unreadable)? == 0 {
                break;
            }
            number += 1;
            let text = String::from_utf8_lossy(&bytes);
            let text = text.trim_end();
            if text.is_empty() {
                continue;
            }
            match decode::line(text) {
                Ok(decode::Line { time, frame: Some(frame), .. }) => self.frame(time, &frame, console)?,
                Ok(decode::Line { time, id, frame: None, .. }) => self.foreign(time, id, console)?,
                Err(error) => self.malformed(path, number, &error, console),
            }
        }
        Ok(())
    }

    fn frame(&mut self, time: Nanoseconds, frame: &Frame, console: &mut Console<'_>) -> Result<(), Failure> {
        let decode::Decoded { kind, node, text } = self.decoder.frame(frame);
        self.tell(time, format!("{:03X}", frame.id()), node, kind, text, console)
    }

    fn foreign(&mut self, time: Nanoseconds, id: &str, console: &mut Console<'_>) -> Result<(), Failure> {
        let text = "a remote request, an error, or an extended identifier".to_owned();
        self.tell(time, id.to_ascii_uppercase(), None, Kind::Other, text, console)
    }

    fn tell(
        &mut self,
        time: Nanoseconds,
        id: String,
        node: Option<u8>,
        kind: Kind,
        text: String,
        console: &mut Console<'_>,
    ) -> Result<(), Failure> {
        self.told.frames += 1;
        *self.told.counts.entry(kind.name()).or_default() += 1;
        // A message is told when it is complete.
        if kind == Kind::Part {
            return Ok(());
        }
        let told = DecodedJson { time_s: seconds(time), id, node, kind: kind.name(), text };
        if console.talk().json {
            if self.told.decoded.len() < KEPT {
                self.told.decoded.push(told);
            } else {
                self.told.left_out += 1;
            }
            Ok(())
        } else if console.talk().quiet {
            Ok(())
        } else {
            console.say(&summary::decoded(&told))
        }
    }

    fn malformed(&mut self, path: &Path, line: u64, error: &decode::LineError, console: &mut Console<'_>) {
        self.told.malformed_lines += 1;
        if self.told.malformed.len() >= TOLD {
            return;
        }
        let (column, message) = (error.column, error.to_string());
        console.warn(&format!("{}:{line}:{column}: {message}\n", path.display()));
        self.told.malformed.push(MalformedJson { line, column, message });
    }
}

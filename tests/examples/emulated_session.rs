//! The host's own code leads emulated Cortex-M4F drives through a job, on a bus in virtual time: what they give has to be what
//! simulated drives give, bit by bit.
//!
//!     cargo run --release -p tests --example emulated_session -- IMAGE
#![allow(
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::print_stdout,
    reason = "a program that stops on an error"
)]

use std::collections::VecDeque;
use std::env;
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use firmware_core::drive::DriveConfig;
use host_sim::axis_loop::CountSetpoint;
use host_sim::bus::{BitTiming, Bus, Frame, FrameSize, InProcessBus, Nanoseconds, NodeIndex};
use host_sim::drive_node::Player;
use host_sim::emulator;
use host_sim::scenario::{SimSettings, simulate_on, simulate_with};
use tests::fleet::Job;

#[allow(unreachable_pub, dead_code, missing_docs, reason = "the image uses it from outside")]
#[path = "../../firmware/emulated/src/steps.rs"]
mod steps;

/// A plate with a wave and a wait, and two motions.
const PROGRAM: &str =
    concat!(include_str!("../../xtask/src/vcan/part.ngc"), "G4 P0.3\nG1 F3000 X10 Y-5 Z2\nM2\n");

/// An image in an emulator, attached to a bus.
struct Emulated {
    child: Child,
    to: ChildStdin,
    from: io::BufReader<ChildStdout>,
    node: NodeIndex,
    began: Nanoseconds,
    waiting: VecDeque<Frame>,
}

impl Emulated {
    fn boot(image: &Path, config: &DriveConfig, bus: &mut dyn Bus) -> io::Result<Self> {
        let mut child = Command::new(emulator::PROGRAM)
            .args(emulator::BOARD)
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let pipes = child.stdin.take().zip(child.stdout.take());
        let (mut to, from) = pipes.ok_or(io::ErrorKind::BrokenPipe)?;
        to.write_all(&[steps::CONFIG])?;
        to.write_all(&steps::config_bytes(config))?;
        to.flush()?;
        let from = io::BufReader::new(from);
        Ok(Self { child, to, from, node: bus.attach(), began: 0, waiting: VecDeque::new() })
    }

    fn bytes<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.from.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}

impl Player for Emulated {
    fn play(&mut self, bus: &mut dyn Bus, now: Nanoseconds) -> io::Result<(CountSetpoint, bool)> {
        let mut said = Vec::new();
        let mut tell = |kind: u8, time: Nanoseconds, frame: &Frame| {
            let since = u32::try_from(time.saturating_sub(self.began)).unwrap_or(u32::MAX);
            said.push(kind);
            said.extend(steps::head_bytes(since, frame.id(), frame.data().len() as u8));
            said.extend(frame.data());
        };
        while let Some(sent) = bus.sent(self.node) {
            tell(steps::SENT, sent.time, &sent.frame);
        }
        while let Some(received) = bus.receive(self.node) {
            tell(steps::RECEIVED, received.time, &received.frame);
        }
        said.push(steps::TICK);
        self.began = now;
        self.to.write_all(&said)?;
        self.to.flush()?;
        let mut given = None;
        loop {
            let [kind] = self.bytes()?;
            match kind {
                steps::SETPOINT => given = Some(steps::setpoint(&self.bytes()?)),
                steps::FRAME => {
                    let (_, id, length) = steps::head(&self.bytes()?);
                    let mut data = vec![0; length.into()];
                    self.from.read_exact(&mut data)?;
                    self.waiting.push_back(Frame::new(id, &data).ok_or(io::ErrorKind::InvalidData)?);
                }
                steps::END => break,
                _ => return Err(io::ErrorKind::InvalidData.into()),
            }
        }
        while bus.has_room(self.node)
            && let Some(frame) = self.waiting.pop_front()
        {
            bus.send(self.node, frame, now);
        }
        let (position, velocity, acceleration, done) = given.ok_or(io::ErrorKind::InvalidData)?;
        Ok((CountSetpoint { position, velocity, acceleration }, done))
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn main() {
    let image = env::args().nth(1).expect("the image that is led tick by tick");
    for format in [FrameSize::Classic, FrameSize::Fd] {
        let timing = BitTiming { format, ..BitTiming::default() };
        let settings = SimSettings { bus: timing, ..SimSettings::default() };
        let job = Job::of(PROGRAM, timing);
        let bus = || InProcessBus::new(timing);
        let (items, machine) = (&job.items, &job.machine);
        let here = simulate_on(&mut bus(), items, machine, &settings, &mut (), &mut |_| {})
            .expect("simulated drives");
        let mut cast = |config: &DriveConfig, bus: &mut dyn Bus| {
            Emulated::boot(Path::new(&image), config, bus).map(|drive| Box::new(drive) as Box<dyn Player>)
        };
        let there = simulate_with(&mut bus(), items, machine, &settings, &mut cast, &mut ())
            .expect("emulated drives");
        let hashes = [&here, &there].map(|report| (report.setpoints, report.setpoint_hash, report.at_end));
        println!(
            "{format:?}: {} set-points of {} axes, {:016x}",
            there.setpoints,
            machine.axes.len(),
            there.setpoint_hash
        );
        assert_eq!(hashes[0], hashes[1], "simulated and emulated drives differ");
        assert!(there.at_end && there.setpoints > 9_000);
    }
}

//! Frames of an older epoch, delayed, doubled and out of order, around a stop and the beginning of the next epoch: nothing of it
//! ever moves anything.
//!
//! `FEEDSPLINE_CASES` asks for another number of interleavings, `FEEDSPLINE_SEED` for others.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use firmware_core::axis::AxisConfig;
use firmware_core::drive::{Drive, DriveConfig};
use firmware_core::session::Watch;
use planner::feed::messages::frames;
use planner::feed::pack::Packed;
use protocol::bus::stop::Stop;
use protocol::bus::{Frame, FrameSize, Node, ids};
use protocol::message::{HostMessage, State};
use protocol::power::PowerEvent;
use protocol::table::Limits;
use rayon::prelude::*;
use tests::tables::{COARSE, Random, Sample, TICK_NS};

const LIMITS: Limits = Limits { velocity: 1e9, acceleration: 1e12, jerk: None };
/// Room for any of the tables [bytes].
const ROOM: usize = 4096;
/// Longest motion [s].
const LONGEST_S: f64 = 3.0;
/// Ticks within which everything comes to rest.
const REST: u32 = 20_000;
/// The epoch that is stopped, and the one that follows.
const OLD: u16 = 7;
const NEW: u16 = 8;

fn node() -> Node {
    Node::new(1).unwrap()
}

fn config(position: i64) -> DriveConfig {
    let axis = AxisConfig { position, status_ticks: 10, ..AxisConfig::new(0, TICK_NS, LIMITS) };
    let watch = Watch { host_ticks: 400, ..Watch::new(TICK_NS, 10) };
    DriveConfig { node: node(), frames: FrameSize::Classic, axis, watch, key: None }
}

fn say(epoch: u16, id: u16, message: &HostMessage<'_>) -> Vec<Frame> {
    frames(id, FrameSize::Classic, epoch, message)
}

/// Everything that a host says in an epoch up to the start.
fn session(epoch: u16, packed: &Packed) -> Vec<Frame> {
    let mut all = say(epoch, node().to_drive(), &HostMessage::Begin { boot: 0, members: 1 });
    for event in [PowerEvent::Shutdown, PowerEvent::EnableOperation] {
        all.extend(say(epoch, node().to_drive(), &HostMessage::Power(event)));
    }
    all.extend(packed.frames(0, node(), FrameSize::Classic, epoch));
    all
}

fn start(epoch: u16, tick: u64) -> Vec<Frame> {
    say(epoch, ids::BROADCAST, &HostMessage::Start { table: 1, tick })
}

/// A random table that does not last long.
fn short(random: &mut Random) -> Packed {
    loop {
        let sample = Sample::new(random, COARSE);
        if sample.table.duration() < LONGEST_S {
            return sample.packed(1).unwrap();
        }
    }
}

struct Trial<'a> {
    drive: Drive<'a>,
    random: Random,
}

impl Trial<'_> {
    fn hear(&mut self, all: &[Frame]) {
        for frame in all {
            self.drive.receive(frame, 0);
            self.drain();
        }
    }

    fn drain(&mut self) {
        while self.drive.poll_transmit().is_some() {}
    }

    fn now(&self) -> u64 {
        self.drive.status().tick
    }

    fn tick(&mut self) -> bool {
        let setpoint = self.drive.tick();
        self.drain();
        setpoint.velocity != 0.0 || setpoint.acceleration != 0.0
    }

    /// A stop of whatever kind, or nothing more from the host.
    fn stop(&mut self) {
        let stop = match self.random.below(5) {
            0 => Stop::Path { tick: None },
            1 => Stop::Quick,
            2 => Stop::Off,
            3 => return self.hear(&say(OLD, ids::BROADCAST, &HostMessage::Stop)),
            _ => return,
        };
        self.hear(&[stop.frame().unwrap()]);
    }

    /// Plays on until the axis rests and the old epoch is over.
    fn come_to_rest(&mut self) {
        let mut still = 0;
        for _ in 0..REST {
            still = if self.tick() { 0 } else { still + 1 };
            let rests = !matches!(
                self.drive.status().state,
                State::Running | State::Armed | State::Stopping | State::Moving
            );
            if still > 20 && rests && !self.drive.epoch().1 {
                return;
            }
        }
        unreachable!("it never rests: {:?}", self.drive.status());
    }
}

/// Whether the old epoch had moved the axis, and whether the new one did in the end.
fn trial(seed: u64, [a, b]: &mut [Vec<u8>; 2]) -> [bool; 2] {
    let mut random = Random::new(seed);
    let [packed, other] = [short(&mut random), short(&mut random)];
    let position = packed.axes[0].header.start;
    let mut t = Trial { drive: Drive::new(config(position), a, b), random };

    let old = session(OLD, &packed);
    t.hear(&old);
    for _ in 0..t.random.below(12) {
        t.tick();
    }
    let begins = t.now() + 5 + t.random.below(60);
    let mut stale = old;
    if t.random.below(8) > 0 {
        let started = start(OLD, begins);
        t.hear(&started);
        stale.extend(started);
    }
    let mut moved = false;
    for _ in 0..t.random.below(240) {
        moved |= t.tick();
    }
    t.stop();
    t.come_to_rest();

    // The new epoch comes up to its start, but not to it; what is left of the old one comes in between.
    let back = t.drive.status().position == position;
    let new = session(NEW, if t.random.below(2) == 0 { &packed } else { &other });
    let mut fresh = new.iter();
    let at = t.drive.status().position;
    for _ in 0..60 + t.random.below(240) {
        match t.random.below(6) {
            0 => {
                let setpoint_moves = t.tick();
                assert!(!setpoint_moves && t.drive.status().position == at, "seed {seed} moves");
            }
            1 => {
                if let Some(frame) = fresh.next() {
                    t.hear(&[*frame]);
                }
            }
            2 => {
                let late = t.now() + t.random.below(40);
                t.hear(&start(OLD, late));
            }
            3 => {
                // Some of it in its order, from anywhere.
                let from = t.random.below(stale.len() as u64) as usize;
                let to = (from + 1 + t.random.below(12) as usize).min(stale.len());
                t.hear(&stale[from..to]);
            }
            _ => {
                let one = stale[t.random.below(stale.len() as u64) as usize];
                t.hear(&[one, one]);
            }
        }
    }
    for _ in 0..60 {
        let setpoint_moves = t.tick();
        assert!(!setpoint_moves && t.drive.status().position == at, "seed {seed} moves");
    }
    // The new epoch is worth something all the same, if the axis is where its table begins.
    if !back || t.drive.status().fault.is_some() {
        return [moved, false];
    }
    t.hear(&session(NEW + 1, &packed));
    let tick = t.now() + 10;
    t.hear(&start(NEW + 1, tick));
    let moves = (0..60).fold(false, |moves, _| t.tick() || moves);
    [moved, moves]
}

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

#[test]
fn nothing_of_an_older_epoch_moves_anything() {
    let (cases, seed) = (setting("FEEDSPLINE_CASES", 100_000), setting("FEEDSPLINE_SEED", 0));
    let count = |all: [u64; 2], [a, b]: [bool; 2]| [all[0] + u64::from(a), all[1] + u64::from(b)];
    let [old, new] = (0..cases)
        .into_par_iter()
        .map_init(|| [vec![0; ROOM], vec![0; ROOM]], |buffers, case| trial(seed + case, buffers))
        .fold(|| [0; 2], count)
        .reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    println!("{cases} interleavings; the older epoch had moved in {old}, a third one moves at last in {new}");
    // What is tried is what can happen: motion before the stop, and drives that would move.
    assert!(old > cases / 5 && new > cases / 20, "{old} {new}");
}

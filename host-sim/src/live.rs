//! Simulated drives on a real bus, in real time.
//!
//! As in a [`crate::fleet`], the ticks of a drive follow each other by its control tick, trimmed as the core tells; when each is
//! computed does not matter to it, as long as the frames that came before its end are there. So a process that is late makes up
//! for it, and says by how much it was late at most.

use firmware_core::drive::DriveConfig;
use protocol::bus::Node;
use protocol::message::Status;

use crate::bus::Nanoseconds;
use crate::bus::real::{BusError, RealBus};
use crate::drive_node::{Buffers, DriveNode};
use crate::flash_memory::{FlashMemory, SharedFlash};

/// Place for an image [bytes].
const IMAGE_BYTES: usize = 1 << 20;

/// One drive.
#[derive(Debug)]
struct Member<'m> {
    config: DriveConfig,
    drive: DriveNode<'m>,
    memory: SharedFlash,
    buffer_bytes: usize,
    tick_ns: f64,
    /// When its next tick is due [ns].
    next: f64,
    ticks: u64,
    shown: Option<Condition>,
}

/// How a drive is, as far as it is worth telling at every change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Condition {
    /// Its status.
    pub status: Status,
    /// Its newest epoch.
    pub epoch: u16,
    /// The epoch is open.
    pub open: bool,
    /// Ticks since it has started up.
    pub ticks: u64,
    /// Frames and messages that it could not understand.
    pub dropped: u32,
}

impl Condition {
    /// Both mean the same to whoever watches.
    fn is_like(&self, other: &Self) -> bool {
        let seen = |c: &Self| (c.status.state, c.status.power, c.status.fault, c.epoch, c.open);
        seen(self) == seen(other)
    }
}

/// Something has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// When: the time of the tick.
    pub time: Nanoseconds,
    /// Which drive, in the order given.
    pub drive: usize,
    /// How it is now.
    pub condition: Condition,
}

/// Drives on a bus.
#[derive(Debug)]
pub struct Live<'m> {
    members: Vec<Member<'m>>,
    /// Ticks that were computed later than the next one was due.
    late: u64,
    worst: Nanoseconds,
}

impl<'m> Live<'m> {
    /// Drives with their buffers, which start up now.
    pub fn new(configs: &[DriveConfig], buffers: &'m mut [Buffers], bus: &mut dyn RealBus) -> Self {
        let now = bus.now() as f64;
        let members = configs.iter().zip(buffers).map(|(config, buffers)| {
            let memory = SharedFlash::new(FlashMemory::new(IMAGE_BYTES, b"simulated"));
            let _ = memory.start(None);
            let store: &'static mut SharedFlash = Box::leak(Box::new(memory.clone()));
            Member {
                config: *config,
                buffer_bytes: buffers[0].len(),
                drive: DriveNode::new(*config, buffers, bus).with_images(store),
                memory,
                tick_ns: f64::from(config.axis.tick_ns),
                next: now,
                ticks: 0,
                shown: None,
            }
        });
        Self { members: members.collect(), late: 0, worst: 0 }
    }

    /// When the next tick of any drive is due.
    pub fn due(&self) -> Nanoseconds {
        let first = self.members.iter().map(|member| member.next).min_by(f64::total_cmp);
        first.unwrap_or(0.0) as Nanoseconds
    }

    /// The tick that is due next; a change of its drive.
    ///
    /// # Errors
    /// The bus has gone.
    pub fn step(&mut self, bus: &mut dyn RealBus) -> Result<Option<Change>, BusError> {
        let soonest = self.members.iter().enumerate().min_by(|a, b| a.1.next.total_cmp(&b.1.next));
        let Some(drive) = soonest.map(|(drive, _)| drive) else { return Ok(None) };
        let member = &mut self.members[drive];
        let time = member.next as Nanoseconds;
        bus.advance(time);
        if let Some(error) = bus.take_error() {
            return Err(error);
        }
        let lateness = bus.now().saturating_sub(time);
        self.worst = self.worst.max(lateness);
        self.late += u64::from(lateness as f64 > member.tick_ns);
        member.drive.tick(bus, time);
        member.ticks += 1;
        if member.drive.drive().wants_restart() && member.drive.has_said_all(bus) {
            member.restart();
        }
        let trim = f64::from(member.drive.drive().trim_ppb()) * 1e-9;
        member.next += member.tick_ns * (1.0 - trim);
        let condition = member.condition();
        if member.shown.as_ref().is_some_and(|shown| shown.is_like(&condition)) {
            return Ok(None);
        }
        member.shown = Some(condition);
        Ok(Some(Change { time, drive, condition }))
    }

    /// The drives' addresses, and how they are.
    pub fn conditions(&self) -> impl Iterator<Item = (Node, Condition)> + '_ {
        self.members.iter().map(|member| (member.config.node, member.condition()))
    }

    /// Ticks that were computed later than the next one was due, and by how much any was late at most.
    pub fn lateness(&self) -> (u64, Nanoseconds) {
        (self.late, self.worst)
    }
}

impl Member<'_> {
    /// Starts up, with the image that its memory says. Memory of the drive before is not given back: such starts are few.
    fn restart(&mut self) {
        let _ = self.memory.start(None);
        let buffers: &'static mut Buffers =
            Box::leak(Box::new([vec![0; self.buffer_bytes], vec![0; self.buffer_bytes]]));
        let store: &'static mut SharedFlash = Box::leak(Box::new(self.memory.clone()));
        self.config.axis.position = self.drive.status().position;
        self.config.watch.boot = self.config.watch.boot.wrapping_add(1);
        self.drive.restart(self.config, buffers, store);
        self.ticks = 0;
    }

    fn condition(&self) -> Condition {
        let drive = self.drive.drive();
        let (epoch, open) = drive.epoch();
        Condition { status: drive.status(), epoch, open, ticks: self.ticks, dropped: drive.dropped() }
    }
}

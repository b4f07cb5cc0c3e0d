//! Drives and a host that each have a clock of their own, on one bus in virtual time.
//!
//! [`crate::scenario`] lets all drives tick at the same instant, which is what a disciplined clock comes to. Here every drive has
//! a crystal that is off, starts when it likes, and trims its control tick as the core tells it to; the host has no
//! clock but what the drives tell, and comes to its turns late. Events come one after the other in the order of time.

use firmware_core::drive::{Drive, DriveConfig};
use firmware_core::evaluate::Setpoint;

use crate::bus::{Bus, Nanoseconds, NodeIndex};
use crate::drive_node::Buffers;
use crate::host_node::{HostError, HostNode};

/// How clocks and stamps are off.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetSettings {
    /// Between two turns of the host [ns].
    pub host_period: Nanoseconds,
    /// How much later a turn may come [ns].
    pub host_jitter: Nanoseconds,
    /// How late a drive may stamp a frame [ns].
    pub stamp_jitter: Nanoseconds,
    /// How fast the crystal of each drive is [1e-6]; 0 where there is none.
    pub crystals_ppm: Vec<f64>,
    /// When each drive starts up [ns]; 0 where there is none.
    pub starts: Vec<Nanoseconds>,
    /// Which jitter.
    pub seed: u64,
}

impl Default for FleetSettings {
    fn default() -> Self {
        Self {
            host_period: 1_000_000,
            host_jitter: 0,
            stamp_jitter: 0,
            crystals_ppm: Vec::new(),
            starts: Vec::new(),
            seed: 1,
        }
    }
}

/// Something that has happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A drive has given a set-point.
    Tick {
        /// Which drive.
        axis: usize,
        /// Its count.
        tick: u64,
        /// The set-point.
        setpoint: Setpoint,
    },
    /// The host has had its turn.
    Host,
    /// The host has given up.
    Failed(HostError),
}

#[derive(Debug)]
struct Member<'m> {
    drive: Drive<'m>,
    node: NodeIndex,
    tick_ns: f64,
    /// Local time passes faster by this factor.
    speed: f64,
    began: f64,
    next: f64,
}

/// Drives, and a host as long as it lives.
#[derive(Debug)]
pub struct Fleet<'m> {
    members: Vec<Member<'m>>,
    host: HostNode,
    alive: bool,
    host_next: f64,
    settings: FleetSettings,
    random: fastrand::Rng,
    now: Nanoseconds,
}

impl<'m> Fleet<'m> {
    /// Drives with their buffers, and a host that is on the bus already.
    pub fn new(
        configs: &[DriveConfig],
        buffers: &'m mut [Buffers],
        host: HostNode,
        settings: FleetSettings,
        bus: &mut dyn Bus,
    ) -> Self {
        let members = configs.iter().zip(buffers).enumerate().map(|(axis, (config, [a, b]))| Member {
            drive: Drive::new(*config, a, b),
            node: bus.attach(),
            tick_ns: f64::from(config.axis.tick_ns),
            speed: 1.0 + settings.crystals_ppm.get(axis).copied().unwrap_or(0.0) * 1e-6,
            began: 0.0,
            next: settings.starts.get(axis).copied().unwrap_or(0) as f64,
        });
        let random = fastrand::Rng::with_seed(settings.seed);
        Self { members: members.collect(), host, alive: true, host_next: 0.0, settings, random, now: 0 }
    }

    /// Time since the beginning [ns].
    pub fn now(&self) -> Nanoseconds {
        self.now
    }

    /// The host, dead or alive.
    pub fn host(&mut self) -> &mut HostNode {
        &mut self.host
    }

    /// The host dies; what it has queued in its interface still goes out.
    pub fn kill_host(&mut self) {
        self.alive = false;
    }

    /// Another host takes over, which is on the bus already.
    pub fn replace_host(&mut self, host: HostNode) {
        (self.host, self.alive) = (host, true);
        self.host_next = self.now as f64;
    }

    /// A drive starts up anew, in the place of the one before it on the bus: its count begins at 0.
    pub fn restart(&mut self, axis: usize, config: &DriveConfig, [a, b]: &'m mut Buffers) {
        self.members[axis].drive = Drive::new(*config, a, b);
    }

    /// Where a drive is on the bus.
    pub fn node(&self, axis: usize) -> NodeIndex {
        self.members[axis].node
    }

    /// A drive.
    pub fn drive(&self, axis: usize) -> &Drive<'m> {
        &self.members[axis].drive
    }

    /// The board of a drive finds a fault.
    pub fn trip(&mut self, axis: usize, code: u16) {
        self.members[axis].drive.trip(code);
    }

    /// How many drives there are.
    pub fn axes(&self) -> usize {
        self.members.len()
    }

    /// The next thing that happens.
    pub fn step(&mut self, bus: &mut dyn Bus) -> Event {
        let first = self.members.iter().enumerate().min_by(|a, b| a.1.next.total_cmp(&b.1.next));
        let axis = first.map(|(axis, _)| axis);
        let drive_next = axis.map_or(f64::INFINITY, |axis| self.members[axis].next);
        if self.alive && self.host_next <= drive_next {
            self.now = self.now.max(self.host_next as Nanoseconds);
            bus.advance(self.now);
            let late = self.random.f64() * self.settings.host_jitter as f64;
            self.host_next += self.settings.host_period as f64;
            self.host_next = self.host_next.max(self.now as f64 + late);
            return match self.host.turn(bus, self.now) {
                Ok(()) => Event::Host,
                Err(error) => Event::Failed(error),
            };
        }
        let Some(axis) = axis else { return Event::Host };
        let (late, random) = (self.settings.stamp_jitter as f64, &mut self.random);
        let member = &mut self.members[axis];
        self.now = self.now.max(member.next as Nanoseconds);
        bus.advance(self.now);
        let (began, speed) = (member.began, member.speed);
        let mut since = |time: Nanoseconds| {
            let passed = (time as f64 - began).max(0.0) + random.f64() * late;
            (passed * speed) as u32
        };
        while let Some(sent) = bus.sent(member.node) {
            member.drive.sent(&sent.frame, since(sent.time));
        }
        while let Some(received) = bus.receive(member.node) {
            member.drive.receive(&received.frame, since(received.time));
        }
        let setpoint = member.drive.tick();
        // What does not fit the interface stays in the drive, which has something newer to say by then.
        while bus.has_room(member.node)
            && let Some(frame) = member.drive.poll_transmit()
        {
            bus.send(member.node, frame, self.now);
        }
        let trim = f64::from(member.drive.trim_ppb()) * 1e-9;
        member.began = member.next;
        member.next += member.tick_ns * (1.0 - trim) / speed;
        Event::Tick { axis, tick: member.drive.status().tick.wrapping_sub(1), setpoint }
    }
}

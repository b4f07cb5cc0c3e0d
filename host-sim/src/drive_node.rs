//! A simulated drive on the bus: the shipped core, unchanged.

use std::io;

use firmware_core::drive::{Drive, DriveConfig};
use firmware_core::update::ImageStore;
use protocol::message::Status;

use crate::axis_loop::CountSetpoint;
use crate::bus::{Bus, Nanoseconds, NodeIndex};

/// Two table buffers of a drive.
pub type Buffers = [Vec<u8>; 2];

/// Whoever plays a drive's part in a simulation, tick by tick.
pub trait Player {
    /// One control tick at `now`: takes what has come, gives the set-point, sends what there is to say. The second value is
    /// whether the drive stands still.
    ///
    /// # Errors
    /// It is not there any more.
    fn play(&mut self, bus: &mut dyn Bus, now: Nanoseconds) -> io::Result<(CountSetpoint, bool)>;
}

/// One drive, attached to a bus.
#[derive(Debug)]
pub struct DriveNode<'m> {
    drive: Drive<'m>,
    node: NodeIndex,
    /// When the present tick began.
    began: Nanoseconds,
}

impl<'m> DriveNode<'m> {
    /// A drive at rest with its two table buffers.
    pub fn new(config: DriveConfig, buffers: &'m mut Buffers, bus: &mut dyn Bus) -> Self {
        let [a, b] = buffers;
        Self { drive: Drive::new(config, a, b), node: bus.attach(), began: 0 }
    }

    /// With a place for new images.
    pub fn with_images(self, store: &'m mut dyn ImageStore) -> Self {
        Self { drive: self.drive.with_images(store), ..self }
    }

    /// The drive starts up anew, in the place of the one before it on the bus.
    pub fn restart(&mut self, config: DriveConfig, buffers: &'m mut Buffers, store: &'m mut dyn ImageStore) {
        let [a, b] = buffers;
        self.drive = Drive::new(config, a, b).with_images(store);
    }

    /// Everything that it has to say has left it.
    pub fn has_said_all(&self, bus: &dyn Bus) -> bool {
        bus.waiting(self.node) == 0
    }

    /// One control tick at `now`: takes what has come, gives the set-point, sends what there is to say.
    ///
    /// The second value is whether the drive stands still.
    pub fn tick(&mut self, bus: &mut dyn Bus, now: Nanoseconds) -> (CountSetpoint, bool) {
        let began = self.began;
        let since = |time: Nanoseconds| u32::try_from(time.saturating_sub(began)).unwrap_or(u32::MAX);
        while let Some(sent) = bus.sent(self.node) {
            self.drive.sent(&sent.frame, since(sent.time));
        }
        while let Some(received) = bus.receive(self.node) {
            self.drive.receive(&received.frame, since(received.time));
        }
        let s = self.drive.tick();
        self.began = now;
        while bus.has_room(self.node)
            && let Some(frame) = self.drive.poll_transmit()
        {
            bus.send(self.node, frame, now);
        }
        let setpoint =
            CountSetpoint { position: s.position, velocity: s.velocity, acceleration: s.acceleration };
        (setpoint, s.done)
    }

    /// How the drive is.
    pub fn status(&self) -> Status {
        self.drive.status()
    }

    /// The drive itself.
    pub fn drive(&self) -> &Drive<'m> {
        &self.drive
    }
}

impl Player for DriveNode<'_> {
    fn play(&mut self, bus: &mut dyn Bus, now: Nanoseconds) -> io::Result<(CountSetpoint, bool)> {
        Ok(self.tick(bus, now))
    }
}

//! What goes over the serial port of an image that is led tick by tick: bytes of one kind, then a fixed number of others.

use firmware_core::axis::{AxisConfig, Excess};
use firmware_core::drive::DriveConfig;
use firmware_core::session::Watch;
use protocol::bus::{FrameSize, Node};
use protocol::table::Limits;

/// The drive's configuration follows, once, before everything else.
pub const CONFIG: u8 = b'C';
/// A frame of the drive has crossed the bus: a head and its data follow.
pub const SENT: u8 = b'S';
/// A frame of somebody else has come: a head and its data follow.
pub const RECEIVED: u8 = b'R';
/// The control tick; the answer is a set-point, frames, and [`END`].
pub const TICK: u8 = b'T';
/// A set-point follows.
pub const SETPOINT: u8 = b'P';
/// A frame to be sent: a head and its data follow.
pub const FRAME: u8 = b'F';
/// There is nothing more to say.
pub const END: u8 = b'E';

/// Bytes of a configuration, of the head of a frame, of a set-point.
pub const CONFIG_BYTES: usize = 83;
pub const HEAD_BYTES: usize = 7;
pub const SETPOINT_BYTES: usize = 17;

/// Writes fields one behind the other.
struct Writer<const N: usize>([u8; N], usize);

impl<const N: usize> Writer<N> {
    fn put(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if let Some(place) = self.0.get_mut(self.1) {
                *place = *byte;
                self.1 += 1;
            }
        }
    }
}

/// Reads fields one behind the other; what is not there is 0.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        for place in &mut bytes {
            if let Some((first, rest)) = self.0.split_first() {
                (*place, self.0) = (*first, rest);
            }
        }
        bytes
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn f32(&mut self) -> f32 {
        f32::from_le_bytes(self.take())
    }

    fn i64(&mut self) -> i64 {
        i64::from_le_bytes(self.take())
    }

    fn byte(&mut self) -> u8 {
        let [byte] = self.take();
        byte
    }
}

/// A configuration as bytes; option codes are the usual ones.
pub fn config_bytes(config: &DriveConfig) -> [u8; CONFIG_BYTES] {
    let DriveConfig { node, frames, axis, watch, key: _ } = config;
    let mut to = Writer([0; CONFIG_BYTES], 0);
    to.put(&[node.number(), u8::from(*frames == FrameSize::Fd), axis.axis]);
    to.put(&axis.tick_ns.to_le_bytes());
    to.put(&axis.position.to_le_bytes());
    to.put(&axis.limits.velocity.to_le_bytes());
    to.put(&axis.limits.acceleration.to_le_bytes());
    to.put(&[u8::from(axis.limits.jerk.is_some())]);
    to.put(&axis.limits.jerk.unwrap_or(0.0).to_le_bytes());
    to.put(&axis.excess.acceleration.to_le_bytes());
    to.put(&axis.excess.jerk.to_le_bytes());
    to.put(&[u8::from(axis.travel.is_some())]);
    axis.travel.unwrap_or_default().iter().for_each(|end| to.put(&end.to_le_bytes()));
    to.put(&axis.status_ticks.to_le_bytes());
    for ticks in [watch.boot, watch.host_ticks, watch.drive_ticks, watch.lead_ticks, watch.sync_ticks] {
        to.put(&ticks.to_le_bytes());
    }
    to.0
}

/// The configuration that was sent; `None` for a node that cannot be.
pub fn config(bytes: &[u8; CONFIG_BYTES]) -> Option<DriveConfig> {
    let mut from = Reader(bytes);
    let node = Node::new(from.byte())?;
    let frames = if from.byte() == 0 { FrameSize::Classic } else { FrameSize::Fd };
    let (axis, tick_ns, position) = (from.byte(), from.u32(), from.i64());
    let (velocity, acceleration) = (from.f32(), from.f32());
    let (limited, jerk) = (from.byte() != 0, from.f32());
    let limits = Limits { velocity, acceleration, jerk: limited.then_some(jerk) };
    let excess = Excess { acceleration: from.f32(), jerk: from.f32() };
    let (bounded, travel) = (from.byte() != 0, [from.i64(), from.i64()]);
    let status_ticks = from.u32();
    let watch = Watch {
        boot: from.u32(),
        host_ticks: from.u32(),
        drive_ticks: from.u32(),
        lead_ticks: from.u32(),
        sync_ticks: from.u32(),
    };
    let axis = AxisConfig {
        position,
        excess,
        travel: bounded.then_some(travel),
        status_ticks,
        ..AxisConfig::new(axis, tick_ns, limits)
    };
    Some(DriveConfig { node, frames, axis, watch, key: None })
}

/// The head of a frame: when it has crossed, after the tick began [ns], its identifier, the length of its data.
pub fn head_bytes(ns: u32, id: u16, length: u8) -> [u8; HEAD_BYTES] {
    let mut to = Writer([0; HEAD_BYTES], 0);
    to.put(&ns.to_le_bytes());
    to.put(&id.to_le_bytes());
    to.put(&[length]);
    to.0
}

/// As [`head_bytes`].
pub fn head(bytes: &[u8; HEAD_BYTES]) -> (u32, u16, u8) {
    let mut from = Reader(bytes);
    (from.u32(), u16::from_le_bytes(from.take()), from.byte())
}

/// A set-point: position, velocity, acceleration, and whether motion is over.
pub fn setpoint_bytes(position: i64, velocity: f32, acceleration: f32, done: bool) -> [u8; SETPOINT_BYTES] {
    let mut to = Writer([0; SETPOINT_BYTES], 0);
    to.put(&position.to_le_bytes());
    to.put(&velocity.to_le_bytes());
    to.put(&acceleration.to_le_bytes());
    to.put(&[u8::from(done)]);
    to.0
}

/// As [`setpoint_bytes`].
pub fn setpoint(bytes: &[u8; SETPOINT_BYTES]) -> (i64, f32, f32, bool) {
    let mut from = Reader(bytes);
    (from.i64(), from.f32(), from.f32(), from.byte() != 0)
}

//! Drives on a real bus, in real time.

use std::time::Duration;

use host_sim::bus::real::{self, BusError, RealBus};
use host_sim::host_node::HostNode;
use planner::feed::file::FileHeader;

use super::{Stage, failed, frames, key, timing};
use crate::args::BusArgs;
use crate::failure::Failure;

/// Between two turns of the host [ns].
const TURN_NS: u64 = 1_000_000;
/// How long the last word may take to go out [ns].
const FLUSH_NS: u64 = 100_000_000;

/// Opens a bus.
///
/// # Errors
/// There is none of this name, or it is down.
pub(crate) fn bus(args: &BusArgs) -> Result<Box<dyn RealBus>, Failure> {
    real::open(&args.bus, frames(args)).map_err(|e| gone(&e))
}

/// Whether nothing has gone wrong with a bus.
///
/// # Errors
/// What has.
pub(crate) fn sound(bus: &mut dyn RealBus) -> Result<(), Failure> {
    bus.take_error().map_or(Ok(()), |e| Err(gone(&e)))
}

fn gone(error: &BusError) -> Failure {
    Failure::input(error.to_string()).with_help(error.help())
}

/// A host on a real bus.
pub(crate) struct RealStage<'a> {
    bus: Box<dyn RealBus>,
    host: HostNode,
    header: &'a FileHeader,
    next: u64,
}

/// Goes on a bus as the host of a machine's drives.
///
/// # Errors
/// As [`bus`].
pub(crate) fn open<'a>(args: &BusArgs, header: &'a FileHeader) -> Result<RealStage<'a>, Failure> {
    let mut bus = bus(args)?;
    let axes = u8::try_from(header.axes.len()).unwrap_or(u8::MAX);
    let mut host = HostNode::new(axes, frames(args), timing(header, args), &mut *bus);
    if let Some(key) = key::of(args.key.as_deref())? {
        host.sign_with(key, key::now_us().saturating_sub(bus.now() / 1_000));
    }
    Ok(RealStage { bus, host, header, next: 0 })
}

impl RealStage<'_> {
    /// Sees the last word of a host that gives up on its way.
    fn flush(&mut self) {
        let end = self.now() + FLUSH_NS;
        while self.bus.waiting(self.host.node()) > 0 && self.now() < end {
            std::thread::sleep(Duration::from_nanos(TURN_NS));
            let now = self.now();
            self.bus.advance(now);
        }
    }
}

impl Stage for RealStage<'_> {
    fn host(&mut self) -> &mut HostNode {
        &mut self.host
    }

    fn step(&mut self) -> Result<(), Failure> {
        std::thread::sleep(Duration::from_nanos(self.next.saturating_sub(self.now())));
        let now = self.now();
        self.next = now + TURN_NS;
        self.bus.advance(now);
        let turn = self.host.turn(&mut *self.bus, now).map_err(|e| failed(&e, self.header));
        if turn.is_err() {
            self.flush();
        }
        turn?;
        sound(&mut *self.bus)
    }

    fn now(&self) -> u64 {
        self.bus.now()
    }

    fn is_virtual(&self) -> bool {
        false
    }
}

//! Drives on a real bus, in real time.

use std::time::{Duration, Instant};

use host_sim::bus::real::{self, BusError, RealBus};
use host_sim::host_node::HostNode;
use planner::feed::file::FileHeader;

use super::{Stage, failed, frames, timing};
use crate::args::BusArgs;
use crate::failure::Failure;

/// Between two turns of the host.
const TURN: Duration = Duration::from_millis(1);

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
    Failure::input(error.to_string())
        .with_help("--bus takes sim, a CAN interface that is up (ip link show), or slcan: and a device file.")
}

/// A host on a real bus.
pub(crate) struct RealStage<'a> {
    bus: Box<dyn RealBus>,
    host: HostNode,
    header: &'a FileHeader,
    began: Instant,
    next: Instant,
}

/// Goes on a bus as the host of a machine's drives.
///
/// # Errors
/// As [`bus`].
pub(crate) fn open<'a>(args: &BusArgs, header: &'a FileHeader) -> Result<RealStage<'a>, Failure> {
    let mut bus = bus(args)?;
    let axes = u8::try_from(header.axes.len()).unwrap_or(u8::MAX);
    let host = HostNode::new(axes, frames(args), timing(header, args), &mut *bus);
    let now = Instant::now();
    Ok(RealStage { bus, host, header, began: now, next: now })
}

impl Stage for RealStage<'_> {
    fn host(&mut self) -> &mut HostNode {
        &mut self.host
    }

    fn step(&mut self) -> Result<(), Failure> {
        std::thread::sleep(self.next.saturating_duration_since(Instant::now()));
        self.next = Instant::now() + TURN;
        let now = self.now();
        self.bus.advance(now);
        self.host.turn(&mut *self.bus, now).map_err(|e| failed(&e, self.header))?;
        sound(&mut *self.bus)
    }

    fn now(&self) -> u64 {
        u64::try_from(self.began.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    fn is_virtual(&self) -> bool {
        false
    }
}

//! Drives on a bus, real or simulated in this process: what `stream`, `jog`, `move --bus`, `home`, `status`, `hold`, `resume` and
//! `stop` have in common.

pub(crate) mod conduct;
pub(crate) mod errand;
pub(crate) mod key;
pub(crate) mod real;
pub(crate) mod remote;
pub(crate) mod sim;
pub(crate) mod source;

use host_sim::bus::FrameSize;
use host_sim::host_node::{HostError, HostNode, HostTiming, Link};
use host_sim::scenario::SimSettings;
use planner::feed::file::FileHeader;

use crate::args::BusArgs;
use crate::failure::Failure;

/// The bus of simulated drives in this process.
pub(crate) const SIM: &str = "sim";

/// A host on a bus with its drives.
pub(crate) trait Stage {
    /// The host.
    fn host(&mut self) -> &mut HostNode;

    /// Lets the next thing happen.
    ///
    /// # Errors
    /// A drive refuses, fails or is silent, or the bus is gone.
    fn step(&mut self) -> Result<(), Failure>;

    /// Since the beginning [ns].
    fn now(&self) -> u64;

    /// Time waits for the host: whoever has to wait for something else may do so.
    fn is_virtual(&self) -> bool;
}

/// How a bus is asked for.
pub(crate) fn frames(bus: &BusArgs) -> FrameSize {
    if bus.fd { FrameSize::Fd } else { FrameSize::Classic }
}

/// The bus of a simulation, with beats as often as the drives of `feedspline drive` send them.
pub(crate) fn settings(bus: &BusArgs) -> SimSettings {
    let mut settings = SimSettings::default();
    settings.bus.format = frames(bus);
    settings
}

/// How a host of these drives deals with time.
pub(crate) fn timing(header: &FileHeader, bus: &BusArgs) -> HostTiming {
    settings(bus).host_timing(f64::from(header.tick_ns) * 1e-9, header.axes.len())
}

/// What a host has to say when it gives up.
pub(crate) fn failed(error: &HostError, header: &FileHeader) -> Failure {
    use protocol::message::Reject;
    let name = |axis: usize| header.axes.get(axis).map_or("?", |axis| axis.name.as_str());
    let (message, help) = match error {
        HostError::Rejected { axis, reason: Reject::Position { position }, .. } => {
            let at = header.axes.get(*axis).map_or(0.0, |a| *position as f64 / a.counts_per_unit);
            (
                format!("axis {} stands at {at}, where the job does not begin", name(*axis)),
                "Bring it there with `feedspline move --bus`, or begin the job where the axes stand.".to_owned(),
            )
        }
        HostError::Rejected { reason: Reject::Late { .. }, .. } => (
            "what follows on the path came too late: the axes come to rest at the end of what they have".to_owned(),
            "Planning or the bus is slower than the motion. Plan it first and stream the .feed file.".to_owned(),
        ),
        HostError::Rejected { axis, reason, .. } => (
            format!("axis {} refuses what it is told: {reason:?}", name(*axis)),
            "docs/wire-format.md explains every reason.".to_owned(),
        ),
        HostError::Silent { axis } => (
            format!("axis {} (node {}) does not answer", name(*axis), axis + 1),
            "Check its supply, its address and the bit rate; `feedspline status` shows who is there.".to_owned(),
        ),
        HostError::Faulted { axis, fault } => (
            format!("axis {} has a fault: {fault:?}", name(*axis)),
            "All axes have come to rest. The fault is reset by the next command that moves them.".to_owned(),
        ),
        HostError::Disagree { axis, .. } => (
            format!("axis {} would move for another time than the others", name(*axis)),
            "Their cores are of different versions: flash all of them anew.".to_owned(),
        ),
        HostError::Mismatch { axis, mismatch } => (
            format!("axis {} (node {}) does not fit: {mismatch}", name(*axis), axis + 1),
            "Name the machine file of these drives with --machine, or flash them anew.".to_owned(),
        ),
        HostError::Unready { axis, .. } => (
            format!("{error}: axis {}, node {}", name(*axis), axis + 1),
            "`feedspline status` shows power states and clocks; a fault is reset by the next command that moves it."
                .to_owned(),
        ),
        HostError::Told { .. } => (
            "somebody else has told the axes to stop".to_owned(),
            "They come to rest on their path. Begin anew from there, when whoever it was is content.".to_owned(),
        ),
        HostError::Stopped { axis } => (
            format!("the axes have stopped on their path, axis {} first", name(*axis)),
            "Somebody has stopped them, or a drive or the host was not heard. They stand still; begin anew from there."
                .to_owned(),
        ),
    };
    Failure::input(message).with_help(help)
}

/// How far a drive can go on with what it has [ms].
pub(crate) fn fill_ms(link: &Link) -> u16 {
    link.beat().map_or(0, |beat| beat.fill_ms)
}

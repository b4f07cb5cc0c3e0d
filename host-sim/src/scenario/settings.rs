//! What a simulation is told, what it says while it runs, and why it may fail.

use std::io;

use planner::feed::pack::PackError;

use crate::axis_loop::AxisLoopError;
use crate::bus::BitTiming;
use crate::host_node::{HostError, HostTiming};

/// Most drives that move together.
pub(super) const MAX_DRIVES: usize = 32;
/// Shortest and longest control tick [s].
const TICK_S: core::ops::RangeInclusive<f64> = 1e-6..=0.1;
/// Ticks at rest between two tables.
const HANDOVER_TICKS: u64 = 2;
/// Longest classic frame, or FD frame at the usual rates [bits at the nominal rate].
const FRAME_BITS: f64 = 170.0;
/// Between two signs of life of the host [s]: drives wait ten times as long.
const ALIVE_S: f64 = 0.02;
/// Frames of one short message.
const MESSAGE_FRAMES: f64 = 4.0;

/// How a job is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimSettings {
    /// Frame format and bit rates.
    pub bus: BitTiming,
    /// Frames that get lost.
    pub loss: Option<Loss>,
    /// How often every drive tells how it is [s].
    pub status_period_s: f64,
    /// How long servos and plants are watched after the end [s].
    pub settle_s: f64,
    /// Longer programmed waits count in full but are simulated only for this long [s].
    pub longest_dwell_s: f64,
}

/// Loss of frames, for each receiver by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loss {
    /// Share of receptions lost, 0 to 1.
    pub share: f64,
    /// Which ones.
    pub seed: u64,
}

impl Default for SimSettings {
    fn default() -> Self {
        Self {
            bus: BitTiming::default(),
            loss: None,
            status_period_s: 0.02,
            settle_s: 0.2,
            longest_dwell_s: 10.0,
        }
    }
}

/// How far a simulation has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Motion simulated [s].
    pub done_s: f64,
    /// Motion of the whole job [s].
    pub total_s: f64,
}

/// Why a job cannot be simulated to its end.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// The control tick is out of range.
    #[error("a control tick of {tick_s} s is not between {} s and {} s", TICK_S.start(), TICK_S.end())]
    Tick {
        /// The tick [s].
        tick_s: f64,
    },
    /// There is no bus for so many drives, or no drive.
    #[error("a machine of {axes} axes cannot be simulated; there must be 1 to {MAX_DRIVES}")]
    AxisCount {
        /// Axes of the machine.
        axes: usize,
    },
    /// Plant or servo of an axis cannot be simulated.
    #[error("axis {axis}: {source}")]
    Axis {
        /// Name of the axis.
        axis: String,
        /// What is wrong with it.
        source: AxisLoopError,
    },
    /// A table cannot be sent.
    #[error("table {table} cannot be sent: {source}")]
    Pack {
        /// Which table, from 0.
        table: u32,
        /// What is wrong with it.
        source: PackError,
    },
    /// A drive refuses, fails or is silent.
    #[error(transparent)]
    Host(#[from] HostError),
    /// A drive moves while others stand, or stands while others move.
    #[error("axis {axis} is out of step with the others at tick {tick}")]
    OutOfStep {
        /// Name of the axis.
        axis: String,
        /// Control tick since power-up.
        tick: u64,
    },
    /// A drive that is played elsewhere is not there any more.
    #[error("the drive of axis {axis} has gone: {source}")]
    Gone {
        /// Name of the axis.
        axis: String,
        /// What the system says.
        source: io::Error,
    },
    /// The trace cannot be written.
    #[error("the trace cannot be written: {0}")]
    Trace(#[from] io::Error),
}

/// The control tick in whole nanoseconds, as drives count it.
pub(super) fn tick_ns(tick_s: f64) -> Result<u32, SimError> {
    if TICK_S.contains(&tick_s) { Ok((tick_s * 1e9).round() as u32) } else { Err(SimError::Tick { tick_s }) }
}

impl SimSettings {
    pub(super) fn status_ticks(&self, tick_s: f64) -> u32 {
        (self.status_period_s / tick_s).ceil().max(1.0) as u32
    }

    pub(super) fn settle_ticks(&self, tick_s: f64) -> u64 {
        (self.settle_s / tick_s).ceil() as u64
    }

    /// The host's patience, for a control tick [s] and so many drives: everybody has said something once, at the given bit rate.
    pub fn host_timing(&self, tick_s: f64, axes: usize) -> HostTiming {
        let message_s = MESSAGE_FRAMES * FRAME_BITS / f64::from(self.bus.nominal.max(1));
        let ticks = |messages: f64| (messages * message_s / tick_s).ceil() as u64 + 2;
        let round = ticks(axes as f64 + 2.0);
        HostTiming {
            handover: HANDOVER_TICKS,
            lead: u64::from(self.status_ticks(tick_s)) + ticks(4.0) + 2 * round,
            answer: 2 * round,
            guard: ticks(4.0),
            alive: ((ALIVE_S / tick_s) as u64).max(1),
        }
    }
}

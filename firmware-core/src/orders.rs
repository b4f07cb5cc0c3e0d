//! What communication and motion of one drive say to each other.
//!
//! The two halves share no memory: a table's buffer belongs to one of them at a time and goes back and forth inside these
//! messages. On a board they are carried by two single-producer single-consumer queues, so that the control tick never waits.

use protocol::message::{Reject, Status, Telemetry};
use protocol::power::PowerEvent;

use crate::store::Loaded;

/// Orders that may wait for the next tick.
pub const ORDERS: usize = 6;
/// Reports that may wait to be sent; status is dropped first.
pub const REPORTS: usize = 6;

/// From communication to motion.
#[derive(Debug)]
pub enum Order<'a> {
    /// Play a table from a tick on.
    Start {
        /// The table.
        table: Loaded<'a>,
        /// When [ticks].
        tick: u64,
    },
    /// The same was asked again, after the table had gone over.
    StartAgain {
        /// Number of the table.
        table: u32,
        /// When [ticks].
        tick: u64,
    },
    /// Nothing starts any more.
    Stop,
    /// To a position.
    MoveTo {
        /// Where to [counts].
        position: i64,
        /// No faster than this [counts/s].
        velocity: Option<f32>,
    },
    /// At a velocity [counts/s].
    MoveAt {
        /// How fast, and which way.
        velocity: f32,
    },
    /// Another power state.
    Power(PowerEvent),
    /// Another rate of path time.
    Override {
        /// The rate [0.1 %].
        permille: u16,
        /// When [ticks].
        tick: u64,
    },
    /// The host was heard.
    Alive,
    /// A stop on the path.
    Hold {
        /// From this tick on, or at once if it has passed.
        tick: u64,
    },
    /// At rest everything is forgotten, so that a new epoch may begin; answered by [`Report::Cleared`].
    Clear,
    /// The tick count jumps, at rest; answered by [`Report::Shifted`].
    Shift {
        /// By so many ticks.
        ticks: i64,
    },
    /// A status is wanted now.
    Report,
}

/// From motion to communication.
#[derive(Debug)]
pub enum Report<'a> {
    /// An order was refused.
    Reject {
        /// Number of the table that it was about, or 0.
        table: u32,
        /// Why.
        reason: Reject,
    },
    /// A table is given back.
    Back {
        /// The table.
        table: Loaded<'a>,
        /// It may still be started.
        kept: bool,
    },
    /// How the axis is.
    Status(Status),
    /// A status that was asked for.
    Reported(Status),
    /// How well it follows.
    Telemetry(Telemetry),
    /// Whether the axis was at rest, and has forgotten everything.
    Cleared(bool),
    /// The tick count has jumped.
    Shifted {
        /// By so many ticks; 0 if the axis was not at rest.
        ticks: i64,
    },
}

//! What a drive knows of its axis.

use protocol::table::Limits;

/// What a drive knows of its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisConfig {
    /// Its number, in the machine's order.
    pub axis: u8,
    /// Control tick [ns].
    pub tick_ns: u32,
    /// Position at start-up [counts].
    pub position: i64,
    /// Tables planned for more are refused.
    pub limits: Limits,
    /// How far the limits may be exceeded while an override or a hold changes the rate.
    pub excess: Excess,
    /// Lowest and highest position that a motion may lead to [counts]; none: anywhere.
    pub travel: Option<[i64; 2]>,
    /// Status is sent every so many ticks; 0: never.
    pub status_ticks: u32,
    /// What is done when things go wrong.
    pub options: Options,
}

/// Factors on the limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excess {
    /// On acceleration, at least 1.
    pub acceleration: f32,
    /// On jerk, at least 1.
    pub jerk: f32,
}

/// Option codes, after CiA 402; the standard's numbers are given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// What a quick stop does (605Ah).
    pub quick_stop: QuickStopOption,
    /// What a fault does (605Eh).
    pub fault: FaultOption,
    /// What a lost connection does (6007h).
    pub lost: LostOption,
    /// The connection counts as lost after so many ticks without an order or a sign of life; 0: never.
    pub lost_ticks: u32,
}

/// What a quick stop does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum QuickStopOption {
    /// 0: no torque, at once.
    Disable,
    /// 2: comes to rest within the limits, then no torque.
    StopAndDisable,
    /// 6: comes to rest within the limits, and stays under torque.
    #[default]
    StopAndStay,
}

/// What a fault does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FaultOption {
    /// 0: no torque, at once.
    Disable,
    /// 2: comes to rest within the limits, then no torque.
    #[default]
    Stop,
}

/// What a lost connection does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LostOption {
    /// 0: nothing. A table plays to its end, which is at rest.
    #[default]
    Nothing,
    /// 1: a fault.
    Fault,
    /// 2: no torque, at once.
    Disable,
    /// 3: a quick stop.
    QuickStop,
}

impl AxisConfig {
    /// An axis with its control tick [ns] and its limits; everything else as usual.
    pub const fn new(axis: u8, tick_ns: u32, limits: Limits) -> Self {
        Self {
            axis,
            tick_ns,
            position: 0,
            limits,
            excess: Excess { acceleration: 1.2, jerk: 1.3 },
            travel: None,
            status_ticks: 0,
            options: Options {
                quick_stop: QuickStopOption::StopAndStay,
                fault: FaultOption::Stop,
                lost: LostOption::Nothing,
                lost_ticks: 0,
            },
        }
    }
}

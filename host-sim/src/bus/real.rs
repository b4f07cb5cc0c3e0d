//! Real buses.

use super::{Bus, FrameSize};

/// Why a real bus cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// There is none of this name.
    #[error("no bus {0}")]
    Unknown(String),
}

/// A bus in real time.
pub trait RealBus: Bus {
    /// What has gone wrong since the last call.
    fn take_error(&mut self) -> Option<BusError>;
}

/// Opens a bus.
///
/// # Errors
/// There is none of this name.
pub fn open(spec: &str, _: FrameSize) -> Result<Box<dyn RealBus>, BusError> {
    Err(BusError::Unknown(spec.to_owned()))
}

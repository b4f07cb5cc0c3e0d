//! A bus outside of this process, in real time: SocketCAN on Linux, or SLCAN over a serial line.
//!
//! [`open`] gives a [`Bus`] whose time is monotonic and counts from the opening. [`Bus::advance`] takes what has come and sends
//! what waits; frames that have come after the time it is given are kept for the next call, so that ticks which are made up for
//! see what they would have seen. Several nodes of one process may share an opening: they hear each other when the bus confirms a frame.

mod serial;
#[cfg(target_os = "linux")]
mod socket;
#[cfg(target_os = "linux")]
mod wall;
mod wire;

use std::io;
use std::path::Path;

use protocol::bus::FrameSize;

use super::{Bus, Nanoseconds};
use crate::slcan_line::LineError;
use serial::SerialPort;
use wire::Wire;

/// What names a serial line.
const SERIAL: &str = "slcan:";

/// Longest name of a network interface [bytes].
const NAME_BYTES: usize = 15;

/// What has gone wrong on a bus since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// Error frames that the controller has reported, or lines that are none.
    pub errors: u64,
    /// Frames that were lost because nobody had taken them in time.
    pub overruns: u64,
    /// Frames that are none of ours: extended identifiers and remote requests.
    pub foreign: u64,
    /// Frames that were not sent: too old, or the bus was gone.
    pub dropped: u64,
    /// Frames of which the bus has not told in time that they were sent.
    pub unconfirmed: u64,
}

/// A bus in real time.
pub trait RealBus: Bus {
    /// Time since the opening.
    fn now(&self) -> Nanoseconds;

    /// What has gone wrong since the last call; the bus goes on as soon as it can.
    fn take_error(&mut self) -> Option<BusError>;

    /// What has gone wrong since the opening.
    fn health(&self) -> Health;
}

/// Why there is no bus, or none any more.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The name means nothing.
    #[error("{bus} names no bus")]
    Unknown {
        /// The name.
        bus: String,
    },
    /// This system has no SocketCAN.
    #[error("{bus} would be a SocketCAN interface, which only Linux has")]
    System {
        /// The bus.
        bus: String,
    },
    /// There is no such interface.
    #[error("there is no interface {bus}")]
    Missing {
        /// The bus.
        bus: String,
    },
    /// The interface is one of another kind.
    #[error("{bus} is no CAN interface")]
    NotCan {
        /// The bus.
        bus: String,
    },
    /// The interface is down.
    #[error("{bus} is down")]
    Down {
        /// The bus.
        bus: String,
    },
    /// The interface carries classic frames only.
    #[error("{bus} does not carry CAN FD: its largest frame has {mtu} bytes, 72 are needed")]
    Classic {
        /// The bus.
        bus: String,
        /// Its largest frame, head included [bytes].
        mtu: u32,
    },
    /// The controller has left the bus after too many errors.
    #[error("the controller of {bus} is off the bus after too many errors")]
    Off {
        /// The bus.
        bus: String,
    },
    /// The system refuses.
    #[error("{bus} cannot be used: {source}")]
    Refused {
        /// The bus.
        bus: String,
        /// Why.
        source: io::Error,
    },
    /// The serial line cannot be opened, or has broken.
    #[error("{bus}: {source}")]
    Line {
        /// The bus.
        bus: String,
        /// Why.
        source: LineError,
    },
}

impl BusError {
    /// What to do about it.
    pub fn help(&self) -> String {
        match self {
            BusError::Unknown { .. } => {
                "Name a CAN interface, such as can0, or an SLCAN adapter, such as slcan:/dev/ttyACM0.".into()
            }
            BusError::System { .. } => "Use an SLCAN adapter, such as slcan:/dev/ttyACM0.".into(),
            BusError::Missing { .. } => {
                "`ip link` shows the interfaces; connect the adapter, or make a virtual one with `ip link add vcan0 type vcan`.".into()
            }
            BusError::NotCan { .. } => "`ip link show type can` and `ip link show type vcan` name those that are.".into(),
            BusError::Down { bus } => {
                format!("`ip link set {bus} up`; a real one needs a bit rate first: `ip link set {bus} type can bitrate 1000000`.")
            }
            BusError::Classic { bus, .. } => {
                format!("Leave --fd away, or switch the interface to CAN FD; a virtual one with `ip link set {bus} mtu 72`.")
            }
            BusError::Off { bus } => {
                format!("Check the wiring, the termination and the bit rate, then `ip link set {bus} type can restart`.")
            }
            BusError::Refused { .. } => "Check that the interface is up and who may use it.".into(),
            BusError::Line { source: LineError::Open(_), .. } => "Check the name of the device file and who may use it.".into(),
            BusError::Line { .. } => "Whoever was at the other end has gone: check the adapter and its cable.".into(),
        }
    }
}

/// Opens the bus that `spec` names: an interface such as `can0` or `vcan0`, or `slcan:` and the path of a serial line.
///
/// Frames that are sent are of `size`; those of either size are received.
///
/// # Errors
/// There is none, it is down, or it does not carry frames of that size.
pub fn open(spec: &str, size: FrameSize) -> Result<Box<dyn RealBus>, BusError> {
    if let Some(path) = spec.strip_prefix(SERIAL).filter(|path| !path.is_empty()) {
        return Ok(Box::new(Wire::new(SerialPort::open(spec, Path::new(path), size)?)));
    }
    let sound = |c: char| c.is_ascii_alphanumeric() || ['_', '-', '.'].contains(&c);
    let name = !spec.is_empty() && spec.len() <= NAME_BYTES && spec.chars().all(sound);
    if !name || spec.chars().all(|c| c == '.') {
        return Err(BusError::Unknown { bus: spec.to_owned() });
    }
    interface(spec, size)
}

#[cfg(target_os = "linux")]
fn interface(name: &str, size: FrameSize) -> Result<Box<dyn RealBus>, BusError> {
    Ok(Box::new(Wire::new(socket::SocketPort::open(name, size)?)))
}

#[cfg(not(target_os = "linux"))]
fn interface(name: &str, _: FrameSize) -> Result<Box<dyn RealBus>, BusError> {
    Err(BusError::System { bus: name.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(spec: &str) -> BusError {
        open(spec, FrameSize::Classic).err().unwrap()
    }

    #[test]
    fn names_that_are_none_say_so() {
        for spec in ["", "slcan:", "..", "../vcan0", "udp:host", "aninterfacewithalongname", "can 0"] {
            let error = refusal(spec);
            assert!(matches!(&error, BusError::Unknown { .. }), "{spec:?}: {error}");
            assert!(error.help().contains("slcan:/dev/ttyACM0"));
        }
    }

    #[test]
    fn a_line_that_is_not_there_says_so() {
        let error = refusal("slcan:/does/not/exist");
        assert!(error.to_string().starts_with("slcan:/does/not/exist: cannot open the line"), "{error}");
        assert!(error.help().contains("device file"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn interfaces_that_are_missing_or_of_another_kind_say_so() {
        assert_eq!(refusal("nosuch0").to_string(), "there is no interface nosuch0");
        assert_eq!(refusal("lo").to_string(), "lo is no CAN interface");
    }
}

//! CAN frames: identifiers, and the cutting of messages into frames and back.

pub mod beat;
pub mod data;
pub mod emergency;
mod frame;
pub mod ids;
mod reassembly;
mod segment;
pub mod slcan;
pub mod stop;
pub mod sync;

pub use frame::{Frame, FrameSize};
pub use ids::Node;
pub use reassembly::{FrameError, Reassembler};
pub use segment::{BLOCK_BYTES, MESSAGE_BYTES, Segments};

/// Bytes of a block before the message: its length and its epoch.
const BLOCK_HEAD: usize = 4;

/// Bytes of a block around the message: its head before, its CRC behind.
const BLOCK_OVERHEAD: usize = BLOCK_HEAD + 4;

//! CAN frames: identifiers, and the cutting of messages into frames and back.

mod frame;
pub mod ids;
mod reassembly;
mod segment;
pub mod slcan;

pub use frame::{Frame, FrameSize};
pub use ids::Node;
pub use reassembly::{FrameError, Reassembler};
pub use segment::{BLOCK_BYTES, MESSAGE_BYTES, Segments};

/// Bytes of a block around the message: its length before, its CRC behind.
const BLOCK_OVERHEAD: usize = 6;

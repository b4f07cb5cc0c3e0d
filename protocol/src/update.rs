//! A new image for a drive: its bytes by offset, its hash, a trial, and what becomes of it.

use serde::{Deserialize, Serialize};

/// Bytes of a hash: SHA-256.
pub const HASH_BYTES: usize = 32;
/// Bytes of an image that one message carries at most.
pub const CHUNK_BYTES: usize = 240;

/// What is to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Image {
    /// Its length.
    pub bytes: u32,
    /// SHA-256 over all of them.
    pub hash: [u8; HASH_BYTES],
}

/// From the host to one drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Update<'a> {
    /// How far is it?
    Ask,
    /// An image is to come; what has come of the same one already is kept.
    Begin(Image),
    /// Bytes of it. Those that do not follow what is there are not taken, and the answer says where it is.
    Data {
        /// Of the first one.
        offset: u32,
        /// They.
        bytes: &'a [u8],
    },
    /// Start up with it, on trial.
    Try,
    /// It works: what starts up from now on.
    Keep,
}

/// How far a drive is with an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Progress {
    /// None is on its way.
    None,
    /// It waits for the byte at this offset.
    Receiving {
        /// The offset.
        next: u32,
    },
    /// It is complete, and its hash is computed from what was stored.
    Verifying {
        /// Bytes that were read.
        read: u32,
    },
    /// It is complete and right.
    Verified,
    /// The drive is about to start up with it.
    Restarting,
    /// The image that runs is on trial: with the next start-up the one before it runs again, unless it is kept.
    Trial,
}

/// Why a drive does not take an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum UpdateFault {
    /// It has no place for one.
    Unable,
    /// Its power stage is on, it moves, or an epoch is open.
    Powered,
    /// It is longer than the place for it, or empty.
    Size {
        /// The place [bytes].
        room: u32,
    },
    /// What was stored has another hash.
    Hash,
    /// The memory fails.
    Memory,
    /// That is not what comes next.
    Order,
}

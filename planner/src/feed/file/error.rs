//! Why a file could not be written or read.

use thiserror::Error;

use crate::feed::pack::PackError;

/// Why a job could not be written.
#[derive(Debug, Error)]
pub enum WriteError {
    /// The operating system refused.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// A number of the header is not admissible.
    #[error("the machine's {what} are not admissible")]
    Header {
        /// What.
        what: &'static str,
    },
    /// A table cannot be packed.
    #[error("item {item}: {error}")]
    Table {
        /// Which item, from 0.
        item: u64,
        /// Why.
        error: PackError,
    },
    /// The marks of a section do not cover its path, or a number is not finite.
    #[error("item {item}: its {what} are not admissible")]
    Value {
        /// Which item, from 0.
        item: u64,
        /// What.
        what: &'static str,
    },
    /// An item is too long for a record.
    #[error("item {item} takes {bytes} bytes; at most {most} are possible")]
    TooLong {
        /// Which item, from 0.
        item: u64,
        /// How long it is.
        bytes: usize,
        /// The limit.
        most: u32,
    },
}

/// Why bytes are not a feed file; `record` counts from 0, which is the header.
#[derive(Debug, Error)]
pub enum ReadError {
    /// The operating system refused.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// Not a feed file at all.
    #[error("not a feed file: it does not begin with FEEDSPLN")]
    Magic,
    /// Made by another version.
    #[error("the file has format version {found}; this program reads version {expected}")]
    Version {
        /// The file's.
        found: u16,
        /// Ours.
        expected: u16,
    },
    /// Same version, but other records.
    #[error("the file's schema {found:016x} is not this program's {expected:016x}: plan the job again")]
    Schema {
        /// The file's.
        found: u64,
        /// Ours.
        expected: u64,
    },
    /// The file ends too early.
    #[error("the file ends inside record {record}")]
    Truncated {
        /// Which record.
        record: u64,
    },
    /// A record says it is longer than any record.
    #[error("record {record} claims {length} bytes; at most {most} are possible")]
    TooLong {
        /// Which record.
        record: u64,
        /// What it claims.
        length: u32,
        /// The limit.
        most: u32,
    },
    /// A record's checksum is wrong.
    #[error("record {record} is damaged: its checksum is wrong")]
    Checksum {
        /// Which record.
        record: u64,
    },
    /// A record is not of the kind that belongs there.
    #[error("record {record} is of kind {found}, which cannot come there")]
    Kind {
        /// Which record.
        record: u64,
        /// Its kind.
        found: u8,
    },
    /// A record's bytes are not what its kind says.
    #[error("record {record} cannot be understood")]
    Malformed {
        /// Which record.
        record: u64,
    },
    /// A table is not admissible.
    #[error("record {record}: {error}")]
    Table {
        /// Which record.
        record: u64,
        /// Why.
        error: PackError,
    },
    /// A number is out of range, or parts of a record contradict each other.
    #[error("record {record}: its {what} are not admissible")]
    Value {
        /// Which record.
        record: u64,
        /// What.
        what: &'static str,
    },
    /// The end record does not count what the file holds.
    #[error("the file's end record does not match its contents")]
    Totals,
    /// There are bytes behind the end record.
    #[error("the file goes on behind its end record")]
    LeftOver,
}

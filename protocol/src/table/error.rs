//! Why bytes are not a table, or a table is not admissible.

use core::fmt;
use serde::{Deserialize, Serialize};

use crate::varint::VarintError;

/// One of the streams of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stream {
    /// Geometry knots.
    Geometry,
    /// q spans.
    Spans,
    /// Control points of one axis.
    Controls,
}

/// A field of a header.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum HeaderField {
    /// Format version.
    Version,
    /// Sequence number: the two headers name different tables.
    Table,
    /// Number of q spans.
    Spans,
    /// Number of geometry spans.
    GeometrySpans,
    /// Exponent of the grid step.
    StepExponent,
    /// Size of one squared code.
    QScale,
    /// Control tick.
    Tick,
    /// Length of a stream.
    Length,
    /// Fraction bits of the control points.
    FractionBits,
    /// Axis limits.
    Limits,
    /// What the proof may grant.
    Margin,
    /// Bounds of override and hold: out of range, or too much for the axis' limits.
    Warp,
    /// Where it takes over from another table.
    Joint,
    /// Where another table may take over.
    Tail,
}

/// Why bytes are not a table, or the table breaks a rule; `index` counts entries of the stream from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TableError {
    /// A header field has no admissible value.
    Header(HeaderField),
    /// A stream ends inside or before the entry.
    Truncated {
        /// Which stream.
        stream: Stream,
        /// Which entry.
        index: u32,
    },
    /// The entry is no well-formed varint.
    Malformed {
        /// Which stream.
        stream: Stream,
        /// Which entry.
        index: u32,
    },
    /// The entry's value is outside its range.
    Range {
        /// Which stream.
        stream: Stream,
        /// Which entry.
        index: u32,
    },
    /// A stream is longer than its entries.
    LeftOver {
        /// Which stream.
        stream: Stream,
    },
    /// The q spans of a geometry span fill more than its length.
    Overfull {
        /// Which q span.
        index: u32,
    },
    /// The headers' span counts and the streams disagree.
    Count {
        /// Which stream.
        stream: Stream,
    },
    /// |gamma w^2| of a q span is above [`MAX_BEND`](super::rules::MAX_BEND).
    Bend {
        /// Which q span.
        index: u32,
    },
    /// A q span takes too long, or its speed is no finite positive number.
    Slow {
        /// Which q span.
        index: u32,
    },
    /// A q span is too short for the control tick.
    Fast {
        /// Which q span.
        index: u32,
    },
    /// Two neighbouring control points are too far apart.
    ControlStep {
        /// The second of them.
        index: u32,
    },
    /// The declared start is not the first control point.
    Start,
    /// The declared end is not the last control point.
    End,
    /// That the axis keeps a limit on a q span cannot be proven.
    Limit {
        /// Which limit.
        limit: AxisLimit,
        /// Which q span.
        index: u32,
    },
}

/// A limit of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum AxisLimit {
    /// Largest |velocity|.
    Velocity,
    /// Largest |acceleration|.
    Acceleration,
    /// Largest |jerk|.
    Jerk,
    /// Range of positions.
    Travel,
}

impl TableError {
    /// The error of entry `index` of `stream`.
    pub(super) const fn varint(error: VarintError, stream: Stream, index: u32) -> Self {
        match error {
            VarintError::Truncated => TableError::Truncated { stream, index },
            VarintError::Malformed => TableError::Malformed { stream, index },
        }
    }
}

impl fmt::Display for Stream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Stream::Geometry => "geometry stream",
            Stream::Spans => "span stream",
            Stream::Controls => "control stream",
        })
    }
}

impl fmt::Display for HeaderField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            HeaderField::Version => "format version",
            HeaderField::Table => "table number",
            HeaderField::Spans => "number of q spans",
            HeaderField::GeometrySpans => "number of geometry spans",
            HeaderField::StepExponent => "grid step exponent",
            HeaderField::QScale => "q scale",
            HeaderField::Tick => "control tick",
            HeaderField::Length => "stream length",
            HeaderField::FractionBits => "fraction bits",
            HeaderField::Limits => "axis limits",
            HeaderField::Margin => "margin",
            HeaderField::Warp => "override",
            HeaderField::Joint => "joint",
            HeaderField::Tail => "tail",
        })
    }
}

impl fmt::Display for AxisLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            AxisLimit::Velocity => "velocity",
            AxisLimit::Acceleration => "acceleration",
            AxisLimit::Jerk => "jerk",
            AxisLimit::Travel => "travel",
        })
    }
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TableError::Header(field) => write!(f, "the header's {field} is not admissible"),
            TableError::Truncated { stream, index } => write!(f, "the {stream} ends at entry {index}"),
            TableError::Malformed { stream, index } => {
                write!(f, "entry {index} of the {stream} is no varint")
            }
            TableError::Range { stream, index } => {
                write!(f, "entry {index} of the {stream} is out of range")
            }
            TableError::LeftOver { stream } => write!(f, "the {stream} is longer than its entries"),
            TableError::Overfull { index } => write!(f, "q span {index} is longer than its geometry span"),
            TableError::Count { stream } => {
                write!(f, "the {stream} does not have as many entries as declared")
            }
            TableError::Bend { index } => write!(f, "q bends too much on span {index}"),
            TableError::Slow { index } => write!(f, "q span {index} takes too long"),
            TableError::Fast { index } => write!(f, "q span {index} is too short for the control tick"),
            TableError::ControlStep { index } => {
                write!(f, "control point {index} is too far from the one before it")
            }
            TableError::Start => f.write_str("the declared start is not the first control point"),
            TableError::End => f.write_str("the declared end is not the last control point"),
            TableError::Limit { limit, index } => {
                write!(f, "the {limit} limit cannot be proven on q span {index}")
            }
        }
    }
}

impl core::error::Error for TableError {}

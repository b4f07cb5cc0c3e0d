//! The two headers of a table.

use serde::{Deserialize, Serialize};

use super::rules;
use super::{HeaderField, TableError, Warp};

/// Version of the table format; drives refuse any other.
pub const FORMAT_VERSION: u8 = 1;

/// Header of the part that all axes share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TableHeader {
    /// [`FORMAT_VERSION`].
    pub version: u8,
    /// Sequence number of the table.
    pub table: u32,
    /// Number of q spans, at least [`rules::MIN_SPANS`].
    pub spans: u32,
    /// Number of geometry spans, at least 1.
    pub geometry_spans: u32,
    /// One grid step is 2^e in u.
    pub step_exponent: i8,
    /// q = code^2 q_scale [u^2/s^2]; finite and positive.
    pub q_scale: f32,
    /// Control tick that the table was made for [ns].
    pub tick_ns: u32,
    /// Length of the geometry stream [bytes].
    pub geometry_bytes: u32,
    /// Length of the span stream [bytes].
    pub span_bytes: u32,
    /// What the drives' proofs may grant beyond every limit, at most [`rules::MAX_MARGIN`] [0.1 %].
    pub margin: u8,
    /// How path time may be slowed, held and hurried; none: not at all.
    pub warp: Option<Warp>,
    /// Where it takes over from a table in motion; none: it begins at rest.
    pub joint: Option<Joint>,
    /// The q span before which the next table may take over; it begins a geometry span. None: this table is played to its end.
    pub tail: Option<u32>,
}

/// How a table goes on where another one is left.
///
/// From a q span of the other table on, this one is played instead. It begins with that very span: the length and the code
/// of its first q span, the lengths of its first two geometry spans and its first three control points are those of the other
/// table there. With what comes before them, stated here, they make position, velocity and acceleration the same to the bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Joint {
    /// The other table.
    pub table: u32,
    /// The q span before: its length [grid steps] and its code.
    pub step: u32,
    /// Its code.
    pub code: u32,
    /// Lengths of the two geometry spans before [grid steps].
    pub lengths: [u32; 2],
}

impl Joint {
    /// Every field is in its range.
    pub fn is_valid(&self) -> bool {
        let fits = |length: u32| (1..rules::MAX_GEOMETRY_LENGTH).contains(&length);
        let [a, b] = self.lengths;
        fits(self.step) && fits(a) && fits(b) && (1..=rules::MAX_CODE).contains(&self.code)
    }
}

/// Header of one axis' part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisHeader {
    /// Sequence number of the table.
    pub table: u32,
    /// Axis, in the machine's order.
    pub axis: u8,
    /// Control points are in units of 2^-f counts.
    pub fraction_bits: u8,
    /// Position at the start, or the first control point of a table that joins another one [counts].
    pub start: i64,
    /// Position at the end [counts].
    pub end: i64,
    /// What the table was planned for.
    pub limits: Limits,
    /// Length of the control stream [bytes].
    pub control_bytes: u32,
}

/// Limits of one axis in counts, symmetric.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Largest |velocity| [counts/s].
    pub velocity: f32,
    /// Largest |acceleration| [counts/s^2].
    pub acceleration: f32,
    /// Largest |jerk| [counts/s^3]; `None` when jerk is not limited.
    pub jerk: Option<f32>,
}

impl TableHeader {
    /// Refuses fields that no table has.
    pub fn check(&self) -> Result<(), TableError> {
        let refuse = |field| Err(TableError::Header(field));
        if self.version != FORMAT_VERSION {
            return refuse(HeaderField::Version);
        }
        if self.spans < rules::MIN_SPANS || self.spans < self.geometry_spans {
            return refuse(HeaderField::Spans);
        }
        if self.geometry_spans == 0 {
            return refuse(HeaderField::GeometrySpans);
        }
        if !rules::STEP_EXPONENT.contains(&self.step_exponent) {
            return refuse(HeaderField::StepExponent);
        }
        if !(self.q_scale > 0.0 && self.q_scale.is_finite()) {
            return refuse(HeaderField::QScale);
        }
        if self.tick_ns == 0 || self.tick_ns > 1_000_000_000 {
            return refuse(HeaderField::Tick);
        }
        if self.margin > rules::MAX_MARGIN {
            return refuse(HeaderField::Margin);
        }
        if self.warp.is_some_and(|warp| !warp.is_valid()) {
            return refuse(HeaderField::Warp);
        }
        if self.joint.is_some_and(|joint| !joint.is_valid() || joint.table == self.table) {
            return refuse(HeaderField::Joint);
        }
        // The code of the span before, and that of the one behind, are values of q's own, not those of a rest.
        let first = if self.joint.is_some() { 1 } else { 3 };
        if self.tail.is_some_and(|tail| tail < first || u64::from(tail) + 3 > u64::from(self.spans)) {
            return refuse(HeaderField::Tail);
        }
        Ok(())
    }

    /// Length of one grid step in u; exact. 1 if the exponent is out of range.
    pub fn step(&self) -> f32 {
        let biased = 127i32 + i32::from(self.step_exponent);
        if (1..=254).contains(&biased) { f32::from_bits((biased as u32) << 23) } else { 1.0 }
    }

    /// Length of the two shared streams together [bytes].
    pub const fn shared_bytes(&self) -> u64 {
        self.geometry_bytes as u64 + self.span_bytes as u64
    }
}

impl AxisHeader {
    /// Refuses fields that no table has.
    pub fn check(&self) -> Result<(), TableError> {
        if self.fraction_bits > rules::MAX_FRACTION_BITS {
            return Err(TableError::Header(HeaderField::FractionBits));
        }
        if !self.limits.are_valid() {
            return Err(TableError::Header(HeaderField::Limits));
        }
        Ok(())
    }
}

impl Limits {
    /// All limits are finite and positive.
    pub fn are_valid(&self) -> bool {
        let good = |x: f32| x > 0.0 && x.is_finite();
        good(self.velocity) && good(self.acceleration) && self.jerk.is_none_or(good)
    }
}

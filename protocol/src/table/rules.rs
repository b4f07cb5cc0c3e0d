//! What every table obeys; drives refuse a table that does not.

/// Fewest q spans: two rest spans and three between them, so that both rest conditions fit.
pub const MIN_SPANS: u32 = 5;

/// Largest |gamma w^2| of a q span, w = h / (v0 + v1): five terms of the evaluator's series suffice in f32.
pub const MAX_BEND: f32 = 0.25;

/// Path time runs in this many units per second: 2^32.
pub const PATH_TIME_PER_S: f32 = 4_294_967_296.0;

/// A q span takes less than 2^40 units of path time, 256 s.
pub const MAX_SPAN_TIME: u64 = 1 << 40;

/// A q span takes at least this share of a control tick, so that the work of one tick is bounded.
pub const MAX_SPANS_PER_TICK: u64 = 16;

/// Two neighbouring control points differ by less than this [counts]; positions within a geometry span then
/// keep a tenth of a count in f32.
pub const MAX_CONTROL_STEP: i64 = 1 << 20;

/// Control points stay below this in magnitude [control units].
pub const MAX_CONTROL: i64 = 1 << 62;

/// A geometry span is shorter than this [grid steps]; three of them together fit in a u32.
pub const MAX_GEOMETRY_LENGTH: u32 = 1 << 29;

/// Most fraction bits of a control point.
pub const MAX_FRACTION_BITS: u8 = 12;

/// Range of the grid step's exponent: one step is 2^e u. Within it no coefficient of a piece overflows f32: the
/// largest is the third one, about 2^23 counts / u^3 of a span of one step.
pub const STEP_EXPONENT: core::ops::RangeInclusive<i8> = -32..=16;

/// The whole count nearest to a control point; halves go up.
pub const fn nearest_count(control: i64, fraction_bits: u8) -> i64 {
    if fraction_bits == 0 || fraction_bits > MAX_FRACTION_BITS {
        return control;
    }
    (control.saturating_add(1 << (fraction_bits - 1))) >> fraction_bits
}

/// Largest margin of a table [0.1 %].
pub const MAX_MARGIN: u8 = 15;

/// The margin of a table that was planned with one cell per span [0.1 %].
pub const USUAL_MARGIN: u8 = 5;

/// Largest code: exact in f32.
pub const MAX_CODE: u32 = (1 << 24) - 1;

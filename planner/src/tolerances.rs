//! Every numerical tolerance of the planner, in one place, each with its reason.

/// A certified ratio (value / limit) may exceed one by this much: it covers the rounding of the f64 arithmetic
/// in the certificate itself, and nothing else.
pub const CERTIFICATE_RATIO: f64 = 1e-6;

/// Relative size below which a length counts as zero against the extent of the job.
pub const ZERO_LENGTH: f64 = 1e-9;

/// The certificate halves a span until its bound is no further above a ratio that is surely attained.
pub const CERTIFICATE_TIGHTNESS: f64 = 1e-3;

/// A limit rules where its ratio is within this of one.
pub const BINDING: f64 = 0.01;

/// The programmed feed counts as reached from this share of it on.
pub const FEED_REACHED: f64 = 0.99;

/// A stated limit may exceed the machine's by this share: it covers the conversion of units.
pub const STATED_LIMIT: f64 = 1e-9;

/// Largest |gamma| w^2 of a span: 1/4, up to which the drives' series are exact to f32, with room for the
/// rounding of their own check.
pub const TABLE_SERIES_ARGUMENT: f64 = 0.25 * (1.0 + 1e-5);

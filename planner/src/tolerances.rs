//! Every numerical tolerance of the planner, in one place, each with its reason.

/// A certified ratio (value / limit) may exceed one by this much: it covers the rounding of the f64 arithmetic
/// in the certificate itself, and nothing else.
pub const CERTIFICATE_RATIO: f64 = 1e-6;

/// Relative size below which a length counts as zero against the extent of the job.
pub const ZERO_LENGTH: f64 = 1e-9;

/// The unit of an axis' control points may differ from a power of two of a count by this share: it covers the
/// rounding of the unit and of the counts per axis unit.
pub const LSB_RATIO: f64 = 1e-12;

/// A span's duration keeps this share away from the shortest and longest that drives accept: they compute it in
/// f32.
pub const FORMAT_MARGIN: f64 = 1e-6;

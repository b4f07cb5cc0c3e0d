//! Every numerical tolerance of the planner, in one place, each with its reason.

/// A certified ratio (value / limit) may exceed one by this much: it covers the rounding of the f64 arithmetic
/// in the certificate itself, and nothing else.
pub const CERTIFICATE_RATIO: f64 = 1e-6;

/// Relative size below which a length counts as zero against the extent of the job.
pub const ZERO_LENGTH: f64 = 1e-9;

/// A certified deviation may lie this share above the true one; halving stops there.
pub const DEVIATION_TIGHTNESS: f64 = 0.01;

/// Added to a certified deviation, relative to the largest coordinate: covers the rounding of its own arithmetic.
pub const DEVIATION_ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Below this |dr/du| (1 on the contour) a fitted path follows the contour more closely.
pub const SLOW_PARAMETER: f64 = 0.3;

/// Below this |dr/du| a fitted path counts as standing still: motion has to stop there.
pub const STANDSTILL_PARAMETER: f64 = 0.05;

/// Share of the path tolerance kept for rounding control points to the grid.
pub const ROUNDING_SHARE: f64 = 1e-3;

/// Largest size of a control point's integer unit, relative to the path tolerance.
pub const LSB_OVER_TOLERANCE: f64 = 5e-4;

/// Largest size of a control point's integer unit, relative to the shortest geometry span. Where a span is as
/// short as jerk allows (h = v^3 / J), this is 1e-3 J T^3 / 4: the jerk of the rounding stays below 1e-3 J.
pub const LSB_OVER_SPAN: f64 = 2.5e-4;

/// A move may start this far from the end of the one before it, relative to the largest coordinate (at least 1).
pub const CONTOUR_GAP: f64 = 1e-6;

/// A move also has to be below this share of a drive count to count as zero: far from the origin
/// [`ZERO_LENGTH`] alone would swallow counts.
pub const ZERO_COUNT: f64 = 1e-3;

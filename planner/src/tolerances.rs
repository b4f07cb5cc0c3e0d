//! Every numerical tolerance of the planner, in one place, each with its reason.

/// A certified ratio (value / limit) may exceed one by this much: it covers the rounding of the f64 arithmetic
/// in the certificate itself, and nothing else.
pub const CERTIFICATE_RATIO: f64 = 1e-6;

/// Relative size below which a length counts as zero against the extent of the job.
pub const ZERO_LENGTH: f64 = 1e-9;

/// Two points of a program are one when they differ by less than this, relative to their coordinates: the same
/// digits give the same point up to the rounding of offsets. An arc between such points is a full circle.
pub const SAME_POINT: f64 = 1e-12;

/// Start and end radius of an arc may differ by this much [mm] whatever its size: 0.0005 in, the rounding of
/// coarse CAM output (LinuxCNC G-code reference, "center format arcs").
pub const ARC_RADII_MM: f64 = 0.0127;

/// Above [`ARC_RADII_MM`], start and end radius of an arc may differ by this share of the radius (same source) ...
pub const ARC_RADII_RATIO: f64 = 1e-3;

/// ... but never by more than this [mm] (same source).
pub const ARC_RADII_MOST_MM: f64 = 0.5;

/// An arc's R may fall short of half the chord by this much [mm]: 0.00005 in (LinuxCNC, RADIUS_TOLERANCE).
pub const ARC_REACH_MM: f64 = 0.00127;

/// Least radius of an arc [mm]: a nanometre is below the resolution of every machine.
pub const ARC_RADIUS_LEAST_MM: f64 = 1e-6;

/// Largest radius of an arc [mm]: above ten kilometres, centre and radius no longer give positions to a nanometre.
pub const ARC_RADIUS_MOST_MM: f64 = 1e7;

/// Feeds up to this are zero [1/min or program units/s]: times and speeds stay finite and positive.
pub const FEED_LEAST: f64 = 1e-9;

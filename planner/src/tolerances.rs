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
/// The certificate halves a span until its bound is no further above a ratio that is surely attained.
pub const CERTIFICATE_TIGHTNESS: f64 = 1e-3;

/// A limit rules a span where its ratio comes within this of one: a quadratic q and its rounding leave most peaks of
/// jerk a few percent below the limit that bends them.
pub const BINDING: f64 = 0.05;

/// The programmed feed counts as reached from this share of it on.
pub const FEED_REACHED: f64 = 0.99;

/// A stated limit may exceed the machine's by this share: it covers the conversion of units.
pub const STATED_LIMIT: f64 = 1e-9;
/// A row of the feed problem, evaluated at the rounded control values in f64, may exceed its bound by this much.
pub const ROW_ARITHMETIC: f64 = 1e-9;

/// Largest |gamma| w^2 of a span: 1/4, up to which the drives' series are exact to f32, with room for the
/// rounding of their own check.
pub const TABLE_SERIES_ARGUMENT: f64 = 0.25 * (1.0 + 1e-5);
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
/// The unit of an axis' control points may differ from a power of two of a count by this share: it covers the
/// rounding of the unit and of the counts per axis unit.
pub const LSB_RATIO: f64 = 1e-12;

/// A span's duration keeps this share away from the shortest and longest that drives accept: they compute it in
/// f32.
pub const FORMAT_MARGIN: f64 = 1e-6;

/// A move also has to be below this share of a drive count to count as zero: far from the origin
/// [`ZERO_LENGTH`] alone would swallow counts.
pub const ZERO_COUNT: f64 = 1e-3;

/// Largest radius of an arc [mm]: above ten kilometres, centre and radius no longer give positions to a nanometre.
pub const ARC_RADIUS_MOST_MM: f64 = 1e7;

/// Feeds up to this are zero [1/min or program units/s]: times and speeds stay finite and positive.
pub const FEED_LEAST: f64 = 1e-9;
/// Largest jerk (without jerk limit: acceleration) that rounding the control points of a way-point spline may
/// add, relative to the limit, on the quickest crossing of a span.
pub const LSB_NOISE: f64 = 1e-3;

/// Below this |dr/du| all along a geometry span the path counts as standing still: the square root of q is
/// coded with 16 bits, so speeds further apart do not fit one table.
pub const STALL_SLOPE: f64 = 1e-4;

/// Largest limit that is taken at its word; larger finite ones are cut to it, which is the strict side.
pub const LARGEST_LIMIT: f64 = 1e15;
/// Smaller limits, and what is not a number, admit no motion.
pub const SMALLEST_LIMIT: f64 = 1e-15;

/// Range of every unit size in a table, of q the square root: keeps squares and cubes of any table far from overflow
/// and underflow.
pub const UNIT_SIZES: std::ops::RangeInclusive<f64> = 1e-15..=1e15;

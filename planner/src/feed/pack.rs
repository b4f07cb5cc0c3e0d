//! From the planner's table to the bytes of the wire, and back.

use protocol::message::part_crc;
use protocol::table::control::{ControlReader, ControlWriter};
use protocol::table::geometry::{self, GeometrySpan};
use protocol::table::rules;
use protocol::table::span::{SpanReader, SpanWriter};
use protocol::table::{AxisHeader, FORMAT_VERSION, Joint, Limits, Stream, TableError, TableHeader};
use thiserror::Error;

use super::override_bounds::warp;
use super::table::{FeedTable, MIN_SPANS, SpanLaw};
use crate::geometry::grid_path::{GridAxis, GridPath};
use crate::job::machine::{Axis, AxisLimits, Machine, OverrideRule};
use crate::tolerances::{FORMAT_MARGIN, LSB_RATIO};

/// What packing needs to know of one axis besides its control points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisScale {
    /// Drive counts per axis unit.
    pub counts_per_unit: f64,
    /// What the table was planned for [axis units].
    pub limits: AxisLimits,
}

/// What a table is packed for.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The drives' control tick [ns].
    pub tick_ns: u32,
    /// What overrides may do, against the limits that the table was planned for.
    pub override_rule: OverrideRule,
    /// One entry per axis of the path.
    pub axes: Vec<AxisScale>,
}

impl Target {
    /// The drives of a machine, for a table that was planned for `limits`.
    pub fn of(machine: &Machine, tick_ns: u32, limits: &[AxisLimits]) -> Self {
        let scale = |(axis, limits): (&Axis, &AxisLimits)| AxisScale {
            counts_per_unit: axis.counts_per_unit,
            limits: *limits,
        };
        let axes = machine.axes.iter().zip(limits).map(scale).collect();
        Self { tick_ns, override_rule: machine.override_rule.of_plans(), axes }
    }
}

/// A table as it is stored and sent.
#[derive(Clone, Debug, PartialEq)]
pub struct Packed {
    /// Header of the shared part.
    pub header: TableHeader,
    /// Geometry stream, then span stream.
    pub shared: Vec<u8>,
    /// One part per axis.
    pub axes: Vec<PackedAxis>,
}

/// One axis' part of a packed table.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedAxis {
    /// Its header.
    pub header: AxisHeader,
    /// Control stream.
    pub controls: Vec<u8>,
}

/// Sizes of a packed table [bytes].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TableBytes {
    /// Number of q spans.
    pub spans: u64,
    /// Number of geometry spans.
    pub geometry_spans: u64,
    /// Number of axes.
    pub axes: u64,
    /// Shared streams.
    pub shared: u64,
    /// Control streams of all axes together.
    pub controls: u64,
    /// Headers, shared and all axes.
    pub headers: u64,
}

/// Why a table cannot be packed.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum PackError {
    /// The parts of the table do not belong together.
    #[error("the table's {0} do not fit together")]
    Shape(&'static str),
    /// The grid step is no power of two in range.
    #[error("a grid step of {step} is not a power of two between 2^-32 and 2^16")]
    Step {
        /// The step [u].
        step: f64,
    },
    /// The control unit of an axis is not a count, a half, a quarter ... of one.
    #[error("axis {axis}: control points in units of {counts} counts; they must be 2^-f counts, f = 0 to 12")]
    ControlUnit {
        /// Which axis.
        axis: usize,
        /// Its control unit [counts].
        counts: f64,
    },
    /// Limits that are no positive numbers in counts.
    #[error("axis {axis}: its limits are not positive numbers in counts")]
    Limits {
        /// Which axis.
        axis: usize,
    },
    /// A rule of the format is broken.
    #[error("{0}")]
    Rule(TableError),
    /// A rule of the format is broken in an axis part.
    #[error("axis {axis}: {error}")]
    AxisRule {
        /// Which axis.
        axis: usize,
        /// Which rule.
        error: TableError,
    },
}

/// Which piece of a table is packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cut {
    /// The first q span, which begins a geometry span, and the number of the table that it takes over from; none: all from
    /// the start.
    pub(super) from: Option<(usize, u32)>,
    /// The q span before which the next piece may take over.
    pub(super) tail: Option<usize>,
}

/// Packs a table.
///
/// # Errors
/// What the format cannot express or a drive would refuse.
pub fn pack(table: &FeedTable, number: u32, target: &Target) -> Result<Packed, PackError> {
    pack_cut(table, number, target, Cut::default())
}

/// Packs a piece of a table.
pub(super) fn pack_cut(
    table: &FeedTable,
    number: u32,
    target: &Target,
    cut: Cut,
) -> Result<Packed, PackError> {
    let tick_ns = target.tick_ns;
    check_shape(table, target.axes.len())?;
    let first = cut.from.map_or(0, |(span, _)| span);
    check_times(table, first, tick_ns)?;
    let knot = knot_of(table, first)?;
    let mut shared = Vec::new();
    write_geometry(table, first, knot, &mut shared)?;
    let geometry_bytes = shared.len() as u32;
    write_spans(table, first, &mut shared);
    let axes = table.path.axes.iter().zip(&target.axes).enumerate();
    let axes: Vec<PackedAxis> =
        axes.map(|(i, (axis, scale))| pack_axis(i, number, axis, knot, scale)).collect::<Result<_, _>>()?;
    let limits: Vec<Limits> = axes.iter().map(|axis| axis.header.limits).collect();
    let header = TableHeader {
        version: FORMAT_VERSION,
        table: number,
        spans: (table.spans() - first) as u32,
        geometry_spans: (table.path.spans() - knot) as u32,
        step_exponent: step_exponent(table.path.step)?,
        q_scale: table.q_scale,
        tick_ns,
        geometry_bytes,
        span_bytes: shared.len() as u32 - geometry_bytes,
        margin: rules::USUAL_MARGIN,
        warp: warp(&target.override_rule, &limits, tick_ns),
        joint: cut.from.map(|(span, number)| joint(table, span, knot, number)).transpose()?,
        tail: cut.tail.map(|span| span.saturating_sub(first) as u32),
    };
    header.check().map_err(PackError::Rule)?;
    Ok(Packed { header, shared, axes })
}

/// The geometry knot at which a q span begins.
fn knot_of(table: &FeedTable, span: usize) -> Result<usize, PackError> {
    let at: u64 = table.steps.iter().take(span).map(|&step| u64::from(step)).sum();
    table.path.breaks.binary_search(&at).map_err(|_| PackError::Shape("q spans and geometry knots"))
}

/// What comes before a piece that takes over.
fn joint(table: &FeedTable, span: usize, knot: usize, number: u32) -> Result<Joint, PackError> {
    let length = |index: usize| {
        let pair = table.path.breaks.get(index..index + 2)?;
        u32::try_from(pair[1] - pair[0]).ok()
    };
    let lengths = knot.checked_sub(2).and_then(|k| Some([length(k)?, length(k + 1)?]));
    let before =
        span.checked_sub(1).and_then(|s| Some((*table.steps.get(s)?, *table.codes.get(s.checked_sub(1)?)?)));
    match (lengths, before) {
        (Some(lengths), Some((step, code))) => Ok(Joint { table: number, step, code, lengths }),
        _ => Err(PackError::Shape("joint and knots")),
    }
}

fn check_shape(table: &FeedTable, scales: usize) -> Result<(), PackError> {
    let FeedTable { path, steps, codes, .. } = table;
    let fits = |good: bool, what| if good { Ok(()) } else { Err(PackError::Shape(what)) };
    fits(path.breaks.len() >= 2 && path.breaks.first() == Some(&0), "geometry knots")?;
    fits(steps.len() >= MIN_SPANS && steps.len() < u32::MAX as usize, "spans")?;
    fits(codes.len() + 2 == steps.len(), "spans and codes")?;
    fits(!steps.contains(&0) && !codes.contains(&0), "spans or codes of zero")?;
    fits(path.axes.iter().all(|axis| axis.controls.len() == path.breaks.len() + 2), "control points")?;
    fits(path.axes.len() == scales && scales <= usize::from(u8::MAX), "axes")
}

/// The rules on bend and duration, on the law as the planner evaluates it.
fn check_times(table: &FeedTable, first: usize, tick_ns: u32) -> Result<(), PackError> {
    let longest = rules::MAX_SPAN_TIME as f64 / f64::from(rules::PATH_TIME_PER_S) * (1.0 - FORMAT_MARGIN);
    let shortest = f64::from(tick_ns) * 1e-9 / rules::MAX_SPANS_PER_TICK as f64 * (1.0 + FORMAT_MARGIN);
    for i in first..table.spans() {
        let (law, index) = (table.law(i), (i - first) as u32);
        if let SpanLaw::Quadratic { h, q: [alpha, beta, gamma] } = law {
            let w = h / (alpha.max(0.0).sqrt() + (alpha + h * (beta + h * gamma)).max(0.0).sqrt());
            let bend = gamma * w * w;
            if bend.is_nan() || bend.abs() > f64::from(rules::MAX_BEND) {
                return Err(PackError::Rule(TableError::Bend { index }));
            }
        }
        let duration = law.duration();
        if duration.is_nan() || duration >= longest {
            return Err(PackError::Rule(TableError::Slow { index }));
        }
        if duration < shortest {
            return Err(PackError::Rule(TableError::Fast { index }));
        }
    }
    Ok(())
}

/// Lengths of the geometry spans and how many q spans fill each.
fn write_geometry(table: &FeedTable, first: usize, knot: usize, out: &mut Vec<u8>) -> Result<(), PackError> {
    let shape = || PackError::Shape("q spans and geometry knots");
    let mut steps = table.steps.iter().skip(first);
    for (index, pair) in table.path.breaks.windows(2).skip(knot).enumerate() {
        let length = pair[1].checked_sub(pair[0]).filter(|length| *length > 0).ok_or_else(shape)?;
        let (mut filled, mut spans) = (0u64, 0);
        while filled < length {
            filled += u64::from(*steps.next().ok_or_else(shape)?);
            spans += 1;
        }
        if filled != length {
            return Err(shape());
        }
        if length >= u64::from(rules::MAX_GEOMETRY_LENGTH) {
            let (stream, index) = (Stream::Geometry, index as u32);
            return Err(PackError::Rule(TableError::Range { stream, index }));
        }
        geometry::write(out, GeometrySpan { length: length as u32, spans });
    }
    if steps.next().is_some() { Err(shape()) } else { Ok(()) }
}

fn write_spans(table: &FeedTable, first: usize, out: &mut Vec<u8>) {
    let mut writer = SpanWriter::default();
    let start: u64 = table.steps.iter().take(first).map(|&step| u64::from(step)).sum();
    let mut knots = table.path.breaks.iter().skip_while(|knot| **knot <= start).peekable();
    let mut at = start;
    for (i, &step) in table.steps.iter().enumerate().skip(first) {
        at += u64::from(step);
        let closes = knots.next_if(|knot| **knot == at).is_some();
        let code = i.checked_sub(1).and_then(|inner| table.codes.get(inner)).copied();
        writer.push(out, (!closes).then_some(step), code);
    }
}

/// e with step = 2^e.
fn step_exponent(step: f64) -> Result<i8, PackError> {
    let error = PackError::Step { step };
    let power_of_two = step > 0.0 && step.is_normal() && step.to_bits() & ((1 << 52) - 1) == 0;
    let exponent = (step.to_bits() >> 52) as i32 - 1023;
    match i8::try_from(exponent) {
        Ok(e) if power_of_two && rules::STEP_EXPONENT.contains(&e) => Ok(e),
        _ => Err(error),
    }
}

fn pack_axis(
    index: usize,
    number: u32,
    axis: &GridAxis,
    knot: usize,
    scale: &AxisScale,
) -> Result<PackedAxis, PackError> {
    let fraction_bits = fraction_bits(index, axis.lsb * scale.counts_per_unit)?;
    let rule = |error| PackError::AxisRule { axis: index, error };
    let furthest = rules::MAX_CONTROL_STEP << fraction_bits;
    let mut controls = Vec::new();
    let mut writer = ControlWriter::default();
    let points = axis.controls.get(knot..).unwrap_or(&[]);
    for (i, &point) in points.iter().enumerate() {
        if point.unsigned_abs() >= rules::MAX_CONTROL.unsigned_abs() {
            return Err(rule(TableError::Range { stream: Stream::Controls, index: i as u32 }));
        }
        if i > 0 && (point - points[i - 1]).abs() >= furthest {
            return Err(rule(TableError::ControlStep { index: i as u32 }));
        }
        writer.push(&mut controls, point);
    }
    let end = |point: Option<&i64>| rules::nearest_count(point.copied().unwrap_or(0), fraction_bits);
    let header = AxisHeader {
        table: number,
        axis: index as u8,
        fraction_bits,
        start: end(points.first()),
        end: end(points.last()),
        limits: limits_in_counts(&scale.limits, scale.counts_per_unit),
        control_bytes: controls.len() as u32,
    };
    if !header.limits.are_valid() {
        return Err(PackError::Limits { axis: index });
    }
    Ok(PackedAxis { header, controls })
}

/// f with control unit = 2^-f counts.
fn fraction_bits(axis: usize, counts: f64) -> Result<u8, PackError> {
    let bits = -counts.log2().round();
    let good = (0.0..=f64::from(rules::MAX_FRACTION_BITS)).contains(&bits)
        && (counts * bits.exp2() - 1.0).abs() <= LSB_RATIO;
    if good { Ok(bits as u8) } else { Err(PackError::ControlUnit { axis, counts }) }
}

/// An axis' limits as its drive has them; a jerk that is not limited becomes `None`.
pub fn limits_in_counts(limits: &AxisLimits, counts_per_unit: f64) -> Limits {
    let scaled = |x: f64| (x * counts_per_unit) as f32;
    Limits {
        velocity: scaled(limits.velocity),
        acceleration: scaled(limits.acceleration),
        jerk: (limits.jerk != f64::INFINITY).then(|| scaled(limits.jerk)),
    }
}

/// Unpacks a table; `lsbs` are the control units of the axes [axis units], which the wire does not carry.
///
/// # Errors
/// The first entry that is not admissible. Memory stays proportional to the bytes given.
pub fn unpack(packed: &Packed, lsbs: &[f64]) -> Result<FeedTable, PackError> {
    let header = &packed.header;
    header.check().map_err(PackError::Rule)?;
    if header.joint.is_some() {
        return Err(PackError::Shape("pieces"));
    }
    if packed.axes.len() != lsbs.len() {
        return Err(PackError::Shape("axes"));
    }
    let split = packed.shared.split_at_checked(header.geometry_bytes as usize);
    let (geometry, spans) = split.ok_or(PackError::Shape("stream lengths"))?;
    let mut reader = SpanReader::new(header.spans, false);
    let (mut breaks, mut steps, mut codes) = (vec![], vec![], vec![]);
    let mut at = 0u64;
    while let Some(span) = reader.next(geometry, spans).map_err(PackError::Rule)? {
        if span.opens_geometry {
            breaks.push(at);
        }
        at += u64::from(span.step);
        steps.push(span.step);
        codes.extend((span.code > 0).then_some(span.code));
    }
    reader.finish(geometry, spans).map_err(PackError::Rule)?;
    if reader.geometry_spans() != header.geometry_spans {
        return Err(PackError::Rule(TableError::Count { stream: Stream::Geometry }));
    }
    breaks.push(at);
    let axes = packed.axes.iter().zip(lsbs).enumerate();
    let axes = axes.map(|(i, (axis, lsb))| unpack_axis(i, axis, *lsb, breaks.len() + 2));
    let axes = axes.collect::<Result<_, _>>()?;
    let path = GridPath { step: f64::from(header.step()), breaks, axes };
    Ok(FeedTable { path, steps, q_scale: header.q_scale, codes })
}

fn unpack_axis(index: usize, axis: &PackedAxis, lsb: f64, points: usize) -> Result<GridAxis, PackError> {
    let rule = |error| PackError::AxisRule { axis: index, error };
    axis.header.check().map_err(rule)?;
    let mut reader = ControlReader::default();
    let controls = (0..points).map(|_| reader.next(&axis.controls)).collect::<Result<Vec<_>, _>>();
    let controls = controls.map_err(rule)?;
    if !reader.is_at_end(&axis.controls) {
        return Err(rule(TableError::LeftOver { stream: Stream::Controls }));
    }
    Ok(GridAxis { lsb, controls })
}

impl Packed {
    /// Checksum of the shared part, as the seal carries it.
    pub fn shared_crc(&self) -> u32 {
        crc(&self.header, &self.shared)
    }

    /// Sizes.
    pub fn bytes(&self) -> TableBytes {
        TableBytes {
            spans: u64::from(self.header.spans),
            geometry_spans: u64::from(self.header.geometry_spans),
            axes: self.axes.len() as u64,
            shared: self.shared.len() as u64,
            controls: self.axes.iter().map(|axis| axis.controls.len() as u64).sum(),
            headers: size(&self.header) + self.axes.iter().map(|axis| size(&axis.header)).sum::<u64>(),
        }
    }
}

impl PackedAxis {
    /// Checksum of the axis part, as the seal carries it.
    pub fn crc(&self) -> u32 {
        crc(&self.header, &self.controls)
    }
}

/// Headers are shorter than the checksum's buffer, so there always is one.
fn crc<H: serde::Serialize>(header: &H, bytes: &[u8]) -> u32 {
    part_crc(header, &[bytes]).unwrap_or_default()
}

fn size<H: serde::Serialize>(header: &H) -> u64 {
    postcard::to_allocvec(header).map_or(0, |bytes| bytes.len() as u64)
}

impl TableBytes {
    /// Everything.
    pub fn total(&self) -> u64 {
        self.shared + self.controls + self.headers
    }

    /// Shared bytes per q span.
    pub fn shared_per_span(&self) -> f64 {
        self.shared as f64 / self.spans.max(1) as f64
    }

    /// Control bytes per geometry span and axis.
    pub fn controls_per_span(&self) -> f64 {
        self.controls as f64 / (self.geometry_spans * self.axes).max(1) as f64
    }
}

impl std::ops::AddAssign for TableBytes {
    fn add_assign(&mut self, other: Self) {
        self.spans += other.spans;
        self.geometry_spans += other.geometry_spans;
        self.axes = self.axes.max(other.axes);
        self.shared += other.shared;
        self.controls += other.controls;
        self.headers += other.headers;
    }
}

#[cfg(test)]
pub(super) mod tests;

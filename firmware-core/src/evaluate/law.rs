//! The law of motion along the path, span by span.
//!
//! Inside a span q(x) = alpha + beta x + gamma x^2 = (dx/dt)^2, hence d2x/dt2 = beta/2 + gamma x: a linear
//! equation with an exact solution. With z = gamma t^2 and v0 = sqrt(alpha),
//!
//! ```text
//! x = t (v0 S(z) + (beta/2) t G(z))     dx/dt = v0 C(z) + (beta/2) t S(z)     C = 1 + z G
//! T = 2 w A(gamma w^2),  w = h / (v0 + v1)
//! ```

use protocol::table::rules::{MAX_BEND, MAX_SPAN_TIME, PATH_TIME_PER_S};
use protocol::table::span::{Span, SpanReader};
use protocol::table::{Joint, Stream, TableError};

use crate::math::{a_series, g_series, s_series, sqrt};
use crate::proof::{Rest, Speed};
use crate::table::TableView;

/// Share by which the f32 sum may exceed the rule that the planner keeps in f64.
const BEND_SLACK: f32 = 1.0 + 1.0 / 1024.0;

/// Motion along the path, measured from the start of a span; on the last one x is the distance to the end, and
/// speed and acceleration are its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PathState {
    /// Distance [u].
    pub(crate) x: f32,
    /// dx/dt [u/s].
    pub(crate) speed: f32,
    /// d2x/dt2 [u/s^2].
    pub(crate) acceleration: f32,
}

/// Motion on one span.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Law {
    /// x = h (t/T)^3.
    Launch { h: f32, rate: f32 },
    /// From speed v0 with acceleration d + gamma x.
    Quadratic { v0: f32, d: f32, gamma: f32 },
    /// x = h (t/T)^3, both from the end.
    Landing { h: f32, rate: f32 },
}

/// Motion on one span, for the proof of limits.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stretch {
    Launch(Rest),
    Between(Speed),
    /// Seen from the end.
    Landing(Rest),
}

/// Where two spans of q's spline meet.
#[derive(Clone, Copy, Debug)]
struct Knot {
    q: f32,
    /// Half of dq/du.
    slope: f32,
}

impl Knot {
    /// Between control values, each with the length of its span.
    #[inline]
    fn between(c0: f32, h0: f32, c1: f32, h1: f32) -> Self {
        let both = h0 + h1;
        Self { q: (c0 * h1 + c1 * h0) / both, slope: (c1 - c0) / both }
    }
}

/// The span that plays, and what the next one needs to know.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LawCursor {
    reader: SpanReader,
    index: u32,
    here: Span,
    next: Span,
    after: Span,
    law: Law,
    duration: u64,
    /// Seconds per unit of local time, and how many bits of it are dropped first: 0 below one second.
    scale: f32,
    shift: u32,
    /// Control value of the next span, and at the knot before it: half of dq/du, and du/dt.
    control: f32,
    slope: f32,
    speed: f32,
}

impl LawCursor {
    /// The first span.
    pub(crate) fn start(view: &TableView<'_>) -> Result<Self, TableError> {
        let mut reader = SpanReader::new(view.header.spans, view.header.joint.is_some());
        let [here, next, after] =
            [read(&mut reader, view)?, read(&mut reader, view)?, read(&mut reader, view)?];
        if let Some(joint) = &view.header.joint {
            return Self::join(view, reader, joint, [here, next, after]);
        }
        let h = length(view, here);
        let q = value(view, next);
        let slope = (2.0 / 3.0) * q / h;
        let speed = sqrt(q);
        let law = Law::Launch { h, rate: speed / (3.0 * h) };
        let control = q + length(view, next) * slope;
        let blank = Self {
            reader,
            index: 0,
            here,
            next,
            after,
            law,
            duration: 0,
            scale: 0.0,
            shift: 0,
            control,
            slope,
            speed,
        };
        blank.lasting(3.0 * h / speed)
    }

    /// The first span of a table that goes on where another one is left.
    #[inline(never)]
    fn join(
        view: &TableView<'_>,
        reader: SpanReader,
        joint: &Joint,
        [here, next, after]: [Span; 3],
    ) -> Result<Self, TableError> {
        let before = Span { step: joint.step, code: joint.code, opens_geometry: false };
        let (h0, h1) = (length(view, before), length(view, here));
        let knot = Knot::between(value(view, before), h0, value(view, here), h1);
        let mut cursor = Self {
            reader,
            index: u32::MAX,
            here: before,
            next: here,
            after: next,
            law: Law::Quadratic { v0: 0.0, d: 0.0, gamma: 0.0 },
            duration: 0,
            scale: 0.0,
            shift: 0,
            control: value(view, here),
            slope: knot.slope,
            speed: sqrt(knot.q),
        };
        cursor.enter(view, after)?;
        Ok(cursor)
    }

    /// Goes to the next span; stays on the last one.
    pub(crate) fn advance(&mut self, view: &TableView<'_>) -> Result<(), TableError> {
        if self.is_last() {
            return Ok(());
        }
        let after = self.reader.next(view.geometry, view.spans)?;
        self.enter(view, after.unwrap_or_default())
    }

    /// Goes to the next span; `after` is the second one behind it.
    #[inline(never)]
    fn enter(&mut self, view: &TableView<'_>, after: Span) -> Result<(), TableError> {
        // The span before the first one of a table that joins has number -1.
        let index = self.index.wrapping_add(1);
        (self.index, self.here, self.next, self.after) = (index, self.next, self.after, after);
        let h = length(view, self.here);
        let (v0, d0) = (self.speed, self.slope);
        let left = self.reader_left(view);
        if left == 0 {
            self.law = Law::Landing { h, rate: v0 / (3.0 * h) };
            *self = self.lasting(3.0 * h / v0)?;
            return Ok(());
        }
        let q1;
        if left == 1 {
            q1 = value(view, self.here);
            self.slope = (-2.0 / 3.0) * q1 / length(view, self.next);
        } else {
            let (control, h1) = (self.control, length(view, self.next));
            let code = value(view, self.next);
            self.control =
                if left == 2 { code + h1 * ((2.0 / 3.0) * code / length(view, self.after)) } else { code };
            let knot = Knot::between(control, h, self.control, h1);
            self.slope = knot.slope;
            q1 = knot.q;
        }
        self.speed = sqrt(q1);
        let gamma = (self.slope - d0) / h;
        let w = h / (v0 + self.speed);
        let bend = gamma * w * w;
        if bend.is_nan() || bend.abs() > MAX_BEND * BEND_SLACK {
            return Err(TableError::Bend { index });
        }
        self.law = Law::Quadratic { v0, d: d0, gamma };
        *self = self.lasting(2.0 * w * a_series(bend))?;
        Ok(())
    }

    /// Spans behind this one.
    fn reader_left(&self, view: &TableView<'_>) -> u32 {
        view.header.spans.saturating_sub(self.index.wrapping_add(1))
    }

    /// The same with a duration [s].
    fn lasting(mut self, seconds: f32) -> Result<Self, TableError> {
        let duration = (seconds * PATH_TIME_PER_S + 0.5) as u64;
        if !seconds.is_finite() || duration == 0 || duration >= MAX_SPAN_TIME {
            return Err(TableError::Slow { index: self.index });
        }
        self.duration = duration;
        self.shift = (u64::BITS - duration.leading_zeros()).saturating_sub(u32::BITS);
        self.scale = (1u32 << self.shift) as f32 / PATH_TIME_PER_S;
        Ok(self)
    }

    /// Motion at local time `time` [2^-32 s], counted from the end on the last span.
    #[inline]
    pub(crate) fn at(&self, time: u64) -> PathState {
        let t = if self.shift == 0 { time as u32 } else { (time >> (self.shift & 31)) as u32 };
        let t = t as f32 * self.scale;
        match self.law {
            Law::Launch { h, rate } => rest(h, rate, t),
            Law::Landing { h, rate } => {
                let path = rest(h, rate, t);
                PathState { speed: -path.speed, ..path }
            }
            Law::Quadratic { v0, d, gamma } => {
                let z = gamma * t * t;
                let (s, g) = (s_series(z), g_series(z));
                let dt = d * t;
                let x = t * (v0 * s + dt * g);
                PathState { x, speed: v0 * (1.0 + z * g) + dt * s, acceleration: d + gamma * x }
            }
        }
    }

    /// The span as the proof of limits sees it.
    pub(crate) fn stretch(&self, view: &TableView<'_>) -> Stretch {
        match self.law {
            Law::Launch { h, rate } => Stretch::Launch(Rest { h, rate }),
            Law::Landing { h, rate } => Stretch::Landing(Rest { h, rate }),
            Law::Quadratic { v0, d, gamma } => {
                Stretch::Between(Speed { h: length(view, self.here), q0: v0 * v0, d, gamma })
            }
        }
    }

    /// How long the span takes [2^-32 s].
    #[inline]
    pub(crate) fn duration(&self) -> u64 {
        self.duration
    }

    /// Its number, from 0.
    pub(crate) fn index(&self) -> u32 {
        self.index
    }

    /// Its length [grid steps].
    pub(crate) fn step(&self) -> u32 {
        self.here.step
    }

    /// A geometry span begins with it.
    pub(crate) fn opens_geometry(&self) -> bool {
        self.here.opens_geometry
    }

    /// Its length [grid steps] and its code.
    pub(crate) fn span(&self) -> [u32; 2] {
        [self.here.step, self.here.code]
    }

    /// It is the landing.
    pub(crate) fn is_last(&self) -> bool {
        matches!(self.law, Law::Landing { .. })
    }

    /// On the last span: the streams hold nothing more.
    pub(crate) fn finish(&self, view: &TableView<'_>) -> Result<(), TableError> {
        if self.reader.geometry_spans() != view.header.geometry_spans {
            return Err(TableError::Count { stream: Stream::Geometry });
        }
        self.reader.finish(view.geometry, view.spans)
    }
}

fn read(reader: &mut SpanReader, view: &TableView<'_>) -> Result<Span, TableError> {
    reader.next(view.geometry, view.spans)?.ok_or(TableError::Count { stream: Stream::Spans })
}

/// Length of a span [u].
fn length(view: &TableView<'_>, span: Span) -> f32 {
    span.step as f32 * view.header.step()
}

/// q of a span's code [u^2/s^2].
fn value(view: &TableView<'_>, span: Span) -> f32 {
    let code = span.code as f32;
    code * code * view.header.q_scale
}

/// Rest span: x = h (t/T)^3, `rate` = 1/T.
fn rest(h: f32, rate: f32, t: f32) -> PathState {
    let r = t * rate;
    let hr = h * r;
    PathState { x: hr * r * r, speed: 3.0 * hr * r * rate, acceleration: 6.0 * hr * rate * rate }
}

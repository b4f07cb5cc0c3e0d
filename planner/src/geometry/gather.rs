//! Gathering moves into a contour, up to where motion must rest.

use super::certify::Metric;
use super::contour::{Contour, Primitive, REVERSAL, angle, distance};
use super::sections::{GeometryError, PathSettings};
use crate::job::machine::Point;
use crate::job::program::{Corner, Feed, Move, MoveKind, Shape, StopCause};
use crate::tolerances::{CONTOUR_GAP, ZERO_COUNT, ZERO_LENGTH};

/// On an exact path, turning further than this is a corner [rad].
const EXACT_CORNER: f64 = 0.1 * std::f64::consts::PI / 180.0;

/// Blocks that end within this share of the tolerance of where the last kept one ended are merged.
const MERGE: f64 = 0.25;

/// Most merged end points that are remembered one by one.
const REMEMBERED: usize = 64;

/// Moves since the last rest.
#[derive(Clone, Debug, Default)]
pub(super) struct Gather {
    contour: Contour,
    kind: Option<MoveKind>,
    corner: Option<Corner>,
    tail: Option<Tail>,
    /// Size of the largest figure that became no primitive at all [mm].
    left_out: f64,
}

/// Lines that ended so close to the last kept point that they have become no primitive yet.
#[derive(Clone, Debug)]
struct Tail {
    start: Point,
    end: Point,
    /// Largest distance of an end point from `start` [mm].
    ball: f64,
    points: Vec<Point>,
    feed: Option<Feed>,
    tolerance: f64,
    line: u32,
}

impl Gather {
    /// Whether nothing has been gathered.
    pub(super) fn is_empty(&self) -> bool {
        self.kind.is_none()
    }

    /// Size of the largest figure so far that was within the tolerance of standing still [mm].
    pub(super) fn left_out(&self) -> f64 {
        self.left_out
    }

    /// Takes what has been gathered.
    pub(super) fn take(&mut self) -> Option<(Contour, MoveKind)> {
        self.flush();
        let left_out = self.left_out;
        let taken = std::mem::take(self);
        self.left_out = left_out;
        taken.kind.filter(|_| !taken.contour.primitives.is_empty()).map(|kind| (taken.contour, kind))
    }

    /// Why motion has to rest before `next`, if it has to.
    pub(super) fn joint(&self, next: &Move, settings: &PathSettings, metric: &Metric) -> Option<StopCause> {
        let kind = self.kind?;
        if self.zero_length(next, metric) {
            return None;
        }
        if kind == MoveKind::Rapid || next.kind == MoveKind::Rapid {
            return Some(StopCause::Rapid);
        }
        if self.corner == Some(Corner::Stop) {
            return Some(StopCause::ExactStop);
        }
        if self.merges(next, settings, metric) {
            return None;
        }
        let last = self.contour.primitives.last()?;
        let k = self.contour.primitives.len() - 1;
        let first = self.primitive(next, settings, metric);
        let length = self.contour.length_of(k);
        let turn = angle(&last.direction(length), &first.0.direction(0.0));
        let exact = self.corner.is_some_and(is_exact);
        if turn > REVERSAL && (exact || length.min(first.1) > MERGE * last.tolerance.min(first.0.tolerance)) {
            return Some(StopCause::Reversal);
        }
        (exact && turn > EXACT_CORNER).then_some(StopCause::ExactPathCorner)
    }

    /// Appends a move that needs no rest before it.
    pub(super) fn push(
        &mut self,
        next: &Move,
        settings: &PathSettings,
        metric: &Metric,
    ) -> Result<(), GeometryError> {
        check(next)?;
        if let Some(end) = self.end() {
            let size = next.start.iter().chain(&end).fold(1.0f64, |m, v| m.max(v.abs()));
            if distance(&end, &next.start) > CONTOUR_GAP * size {
                return Err(GeometryError::Gap { line: next.line });
            }
        }
        if self.zero_length(next, metric) {
            // Its place in the program may still demand a rest.
            if next.corner == Corner::Stop && self.kind.is_some() {
                self.corner = Some(Corner::Stop);
            }
            return Ok(());
        }
        self.kind = Some(next.kind);
        self.corner = Some(next.corner);
        if self.merges(next, settings, metric) {
            self.absorb(next, settings, metric);
            return Ok(());
        }
        if !self.continues(next, settings, metric) {
            self.flush();
        }
        let (mut primitive, length) = self.primitive(next, settings, metric);
        if let Some(tail) = self.tail.take() {
            primitive.slack = tail.slack(&next.end, metric);
            if let (Some(Feed::Duration(a)), Some(Feed::Duration(b))) = (tail.feed, next.feed) {
                primitive.feed = Some(Feed::Duration(a + b));
            }
        }
        let k = self.contour.primitives.len();
        if let Some(last) = self.contour.primitives.last() {
            primitive.turn = angle(&last.direction(self.contour.length_of(k - 1)), &primitive.direction(0.0));
        }
        self.contour.push(primitive, length);
        Ok(())
    }

    /// Where the gathered moves end.
    fn end(&self) -> Option<Point> {
        self.tail.as_ref().map(|t| t.end).or_else(|| self.contour.last())
    }

    /// Where the last primitive ends, or the next one starts.
    fn kept(&self, next: &Move) -> Point {
        self.tail.as_ref().map(|t| t.start).or_else(|| self.contour.last()).unwrap_or(next.start)
    }

    /// Whether `next` goes nowhere: nothing against the coordinates, and nothing against a drive count.
    fn zero_length(&self, next: &Move, metric: &Metric) -> bool {
        let size = next.start.iter().chain(&next.end).fold(0.0f64, |m, v| m.max(v.abs()));
        let around = match next.shape {
            Shape::Line => 0.0,
            Shape::Arc(arc) => arc.radius * arc.sweep.abs(),
        };
        let start = self.end().unwrap_or(next.start);
        distance(&start, &next.end).max(around) <= (ZERO_LENGTH * size).min(ZERO_COUNT * metric.tightest())
    }

    /// The primitive of `next`, from the last kept point if it is a line that goes on from there.
    fn primitive(&self, next: &Move, settings: &PathSettings, metric: &Metric) -> (Primitive, f64) {
        let tolerance = tolerance(next, settings, metric);
        match next.shape {
            Shape::Line => {
                let start = match &self.tail {
                    Some(t) if self.continues(next, settings, metric) => t.start,
                    Some(t) => t.end,
                    None => self.contour.last().unwrap_or(next.start),
                };
                Primitive::line(&start, &next.end, tolerance, next.feed, next.line)
            }
            Shape::Arc(arc) => {
                let start = self.end().unwrap_or(next.start);
                Primitive::arc(&start, &next.end, &arc, tolerance, next.feed, next.line)
            }
        }
    }

    /// Whether `next` may become one primitive with the tail.
    fn continues(&self, next: &Move, settings: &PathSettings, metric: &Metric) -> bool {
        let Some(tail) = &self.tail else { return true };
        let same_feed = match (tail.feed, next.feed) {
            (Some(Feed::Duration(_)), Some(Feed::Duration(_))) => true,
            (a, b) => a == b,
        };
        next.shape == Shape::Line && same_feed && tail.tolerance == tolerance(next, settings, metric)
    }

    /// Whether `next` ends so close to the last kept point that it becomes no primitive yet.
    fn merges(&self, next: &Move, settings: &PathSettings, metric: &Metric) -> bool {
        if next.kind == MoveKind::Rapid || next.shape != Shape::Line || is_exact(next.corner) {
            return false;
        }
        let tolerance = tolerance(next, settings, metric);
        let kept = self.kept(next);
        let step = std::array::from_fn(|a| next.end[a] - kept[a]);
        self.continues(next, settings, metric) && metric.size(&step, tolerance) <= MERGE * tolerance
    }

    fn absorb(&mut self, next: &Move, settings: &PathSettings, metric: &Metric) {
        let start = self.kept(next);
        let tolerance = tolerance(next, settings, metric);
        let tail = self.tail.get_or_insert_with(|| Tail {
            start,
            end: start,
            ball: 0.0,
            points: Vec::new(),
            feed: next.feed.map(|f| if let Feed::Duration(_) = f { Feed::Duration(0.0) } else { f }),
            tolerance,
            line: next.line,
        });
        let step = std::array::from_fn(|a| next.end[a] - start[a]);
        tail.ball = tail.ball.max(metric.size(&step, tolerance));
        (tail.end, tail.line) = (next.end, next.line);
        if let (Some(Feed::Duration(sum)), Some(Feed::Duration(more))) = (&mut tail.feed, next.feed) {
            *sum += more;
        }
        if tail.points.len() <= REMEMBERED {
            tail.points.push(next.end);
        }
    }

    /// Makes a primitive of the tail.
    fn flush(&mut self) {
        let Some(tail) = self.tail.take() else { return };
        if distance(&tail.start, &tail.end) == 0.0 {
            // The figure came back to where it began: the path stays there, as far away as the figure reached.
            // That is within its own tolerance, which may be wider than that of the primitive before it.
            match self.contour.primitives.last_mut().filter(|last| tail.ball <= MERGE * last.tolerance) {
                Some(last) => last.slack = last.slack.max(tail.ball),
                None => self.left_out = self.left_out.max(tail.ball),
            }
            return;
        }
        let (mut p, length) = Primitive::line(&tail.start, &tail.end, tail.tolerance, tail.feed, tail.line);
        p.slack = tail.ball;
        let k = self.contour.primitives.len();
        if let Some(last) = self.contour.primitives.last() {
            p.turn = angle(&last.direction(self.contour.length_of(k - 1)), &p.direction(0.0));
        }
        self.contour.push(p, length);
    }
}

impl Tail {
    /// How far the merged lines and the last one to `end` can be from the chord (Frechet distance, upper bound):
    /// matched by projection if they go steadily forward, else by staying at the start until the last line.
    fn slack(&self, end: &Point, metric: &Metric) -> f64 {
        if self.points.len() > REMEMBERED {
            return self.ball;
        }
        let chord: Point = std::array::from_fn(|a| end[a] - self.start[a]);
        let squared: f64 = chord.iter().map(|v| v * v).sum();
        let (mut before, mut widest) = (0.0, 0.0f64);
        for p in &self.points {
            let share = (0..chord.len()).map(|a| (p[a] - self.start[a]) * chord[a]).sum::<f64>() / squared;
            if share < before || share > 1.0 {
                return self.ball;
            }
            let off = std::array::from_fn(|a| p[a] - self.start[a] - share * chord[a]);
            widest = widest.max(metric.size(&off, self.tolerance));
            before = share;
        }
        widest.min(self.ball)
    }
}

/// Whether programmed points are hit.
fn is_exact(corner: Corner) -> bool {
    match corner {
        Corner::Stop | Corner::Exact => true,
        Corner::Within { tolerance_mm, .. } => tolerance_mm <= 0.0,
    }
}

/// The tolerance of a move [mm].
fn tolerance(m: &Move, settings: &PathSettings, metric: &Metric) -> f64 {
    let asked = match m.corner {
        _ if m.kind == MoveKind::Rapid => settings.rapid_tolerance_mm,
        Corner::Within { tolerance_mm, .. } if tolerance_mm > 0.0 => tolerance_mm,
        _ => settings.exact_tolerance_mm,
    };
    asked.max(metric.tightest())
}

/// Refuses numbers that are none.
fn check(m: &Move) -> Result<(), GeometryError> {
    let shape = match m.shape {
        Shape::Line => [0.0; 6],
        Shape::Arc(a) => [a.centre[0], a.centre[1], a.radius, a.radius_change, a.start_angle, a.sweep],
    };
    let corner = match m.corner {
        Corner::Within { tolerance_mm, .. } => tolerance_mm,
        _ => 0.0,
    };
    let feed = match m.feed {
        Some(Feed::Speed(f)) | Some(Feed::Duration(f)) => f,
        None => 1.0,
    };
    let finite = m.start.iter().chain(&m.end).chain(&shape).chain([&corner, &feed]).all(|v| v.is_finite());
    if finite && feed > 0.0 { Ok(()) } else { Err(GeometryError::NotFinite { line: m.line }) }
}

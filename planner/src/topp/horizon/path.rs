//! Path as it arrives, and the part of it that is kept.

use crate::geometry::grid_path::{GridAxis, GridPath};
use crate::geometry::section::{FeedCap, SpeedCap};
use crate::topp::error::{PathFault, PlanError};

/// How a path begins.
#[derive(Clone, Debug, PartialEq)]
pub struct PathStart {
    /// Length of one grid step in u; a power of two.
    pub step: f64,
    /// Size of one control integer [axis units] and the first three control points [lsb] of each axis.
    pub axes: Vec<(f64, [i64; 3])>,
}

/// The next geometry spans of a path.
#[derive(Clone, Debug, PartialEq)]
pub struct PathPiece {
    /// Where each of them ends [grid steps from the start of the path].
    pub breaks: Vec<u64>,
    /// One control point per span for each axis [lsb]: the last of the four that act on the span.
    pub controls: Vec<Vec<i64>>,
    /// Caps on the path speed over these spans: consecutive, the last one ending with the piece; empty: no cap.
    pub caps: Vec<FeedCap>,
}

/// Cuts a path that is known as a whole into pieces of up to `spans` geometry spans.
pub fn pieces<'a>(
    path: &'a GridPath,
    caps: &'a [FeedCap],
    spans: usize,
) -> (PathStart, impl Iterator<Item = PathPiece> + 'a) {
    let first = |a: &GridAxis| (a.lsb, [0, 1, 2].map(|i| a.controls.get(i).copied().unwrap_or(0)));
    let start = PathStart { step: path.step, axes: path.axes.iter().map(first).collect() };
    let spans = spans.max(1);
    let pieces = (0..path.spans()).step_by(spans).map(move |from| {
        let to = (from + spans).min(path.spans());
        let (begin, end) = (path.breaks[from], path.breaks[to]);
        let cut = |c: &FeedCap| FeedCap { until: c.until.min(end), speed: c.speed };
        let first = caps.partition_point(|c| c.until <= begin);
        let last = (caps.partition_point(|c| c.until < end) + 1).min(caps.len()).max(first);
        PathPiece {
            breaks: path.breaks[from + 1..=to].to_vec(),
            controls: path.axes.iter().map(|a| a.controls[from + 3..to + 3].to_vec()).collect(),
            caps: caps[first..last].iter().map(cut).collect(),
        }
    });
    (start, pieces)
}

/// The kept part of what has arrived.
#[derive(Clone, Debug)]
pub(super) struct Arrived {
    pub(super) step: f64,
    /// Geometry knots from the first kept one on [grid steps].
    pub(super) breaks: Vec<u64>,
    axes: Vec<GridAxis>,
    caps: Vec<FeedCap>,
    /// Whether the last piece has arrived.
    pub(super) finished: bool,
}

impl Arrived {
    pub(super) fn new(start: &PathStart) -> Self {
        let axis = |&(lsb, controls): &(f64, [i64; 3])| GridAxis { lsb, controls: controls.to_vec() };
        let axes = start.axes.iter().map(axis).collect();
        Arrived { step: start.step, breaks: vec![0], axes, caps: Vec::new(), finished: false }
    }

    /// Appends a piece.
    pub(super) fn push(&mut self, piece: &PathPiece) -> Result<(), PlanError> {
        let fault = |what| Err(PlanError::Path { what });
        let end = self.breaks[self.breaks.len() - 1];
        let rising = std::iter::once(&end).chain(&piece.breaks).zip(&piece.breaks).all(|(a, b)| a < b);
        if self.finished || !rising || piece.breaks.last().is_some_and(|&b| b > 1 << 52) {
            return fault(PathFault::Breaks);
        }
        if piece.controls.len() != self.axes.len()
            || piece.controls.iter().any(|c| c.len() != piece.breaks.len())
        {
            return fault(PathFault::Controls);
        }
        let last = piece.breaks.last().copied().unwrap_or(end);
        let mut from = end;
        for (index, cap) in piece.caps.iter().enumerate() {
            if cap.until <= from || cap.until > last {
                return Err(PlanError::CapOrder { index, until: cap.until });
            }
            from = cap.until;
        }
        self.caps.extend(&piece.caps);
        if from < last {
            if let Some(index) = piece.caps.len().checked_sub(1) {
                return Err(PlanError::CapOrder { index, until: from });
            }
            self.caps.push(FeedCap { until: last, speed: SpeedCap::None });
        }
        self.breaks.extend(&piece.breaks);
        for (axis, controls) in self.axes.iter_mut().zip(&piece.controls) {
            axis.controls.extend(controls);
        }
        Ok(())
    }

    /// First kept place.
    pub(super) fn origin(&self) -> u64 {
        self.breaks[0]
    }

    /// The last geometry knot at which motion can be made to end: two more must be known, since they bend the spans
    /// before it.
    pub(super) fn last_end(&self) -> usize {
        let last = self.breaks.len() - 1;
        if self.finished { last } else { last.saturating_sub(2) }
    }

    /// The kept path up to geometry knot `end`, counted from the first kept one, on knots from zero; and its caps.
    ///
    /// Its first two spans are bent otherwise than those of the path unless they are the first of all. The control
    /// points that end it are the path's own blossoms, rounded: the last two spans are off by less than half a count.
    pub(super) fn up_to(&self, end: usize) -> (GridPath, Vec<FeedCap>) {
        let origin = self.origin();
        let whole = self.finished && end + 1 == self.breaks.len();
        let known = (end + 2).min(self.breaks.len() - 1);
        let bent = GridPath {
            step: self.step,
            breaks: self.breaks[..=known].iter().map(|b| b - origin).collect(),
            axes: self.axes.iter().map(|a| cut(a, known + 3)).collect(),
        };
        let axes = (0..self.axes.len())
            .map(|axis| {
                let mut out = cut(&self.axes[axis], end + 3);
                if !whole && end > 0 {
                    let (base, bezier) = bent.bezier(axis, end - 1);
                    for (k, b) in bezier[2..].iter().enumerate() {
                        out.controls[end + 1 + k] = base + (b / out.lsb).round() as i64;
                    }
                }
                out
            })
            .collect();
        let path = GridPath { step: self.step, breaks: bent.breaks[..=end].to_vec(), axes };
        let place = self.breaks[end];
        let mut caps = Vec::new();
        for cap in self.caps.iter().filter(|c| c.until > origin) {
            caps.push(FeedCap { until: cap.until.min(place) - origin, speed: cap.speed });
            if cap.until >= place {
                break;
            }
        }
        (path, caps)
    }

    /// Forgets everything before kept geometry knot `first`.
    pub(super) fn forget(&mut self, first: usize) {
        self.breaks.drain(..first);
        self.axes.iter_mut().for_each(|a| drop(a.controls.drain(..first)));
        let origin = self.origin();
        self.caps.retain(|c| c.until > origin);
    }
}

fn cut(axis: &GridAxis, controls: usize) -> GridAxis {
    GridAxis { lsb: axis.lsb, controls: axis.controls[..controls].to_vec() }
}

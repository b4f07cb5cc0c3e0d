//! The q spans of a table under construction, and where they lie on the path.

use crate::geometry::grid_path::{GridPath, Piece};
use crate::geometry::section::{FeedCap, SpeedCap};
use crate::job::machine::MAX_AXES;

/// q knots on a path.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// q knots [grid steps], one more than spans.
    pub(super) knots: Vec<u64>,
    /// Lengths of the q spans in u.
    pub(super) h: Vec<f64>,
    /// Geometry span of each q span.
    pub(super) geometry: Vec<u32>,
    /// Cells of each q span: its rows are Bernstein coefficients over each of so many equal parts.
    pub(super) cells: Vec<u8>,
}

impl Layout {
    /// Lays out the spans between strictly rising `knots`, which contain every geometry knot.
    pub(super) fn new(path: &GridPath, knots: Vec<u64>) -> Self {
        let n = knots.len() - 1;
        let h = knots.windows(2).map(|w| (w[1] - w[0]) as f64 * path.step).collect();
        let mut geometry = Vec::with_capacity(n);
        let mut g = 0;
        for &k in &knots[..n] {
            while g + 2 < path.breaks.len() && path.breaks[g + 1] <= k {
                g += 1;
            }
            geometry.push(g as u32);
        }
        Layout { knots, h, geometry, cells: vec![1; n] }
    }

    /// Number of q spans, rest spans included.
    pub(super) fn spans(&self) -> usize {
        self.h.len()
    }

    /// Number of unknowns: one control value per inner span.
    pub(super) fn unknowns(&self) -> usize {
        self.spans() - 2
    }

    /// Start of span `i` in u.
    pub(super) fn start(&self, path: &GridPath, i: usize) -> f64 {
        self.knots[i] as f64 * path.step
    }
}

/// The derivatives of one axis over a stretch of one geometry span, as Bernstein coefficients.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Derivatives {
    /// p', degree 2.
    pub(super) first: [f64; 3],
    /// p'', degree 1.
    pub(super) second: [f64; 2],
    /// p'''.
    pub(super) third: f64,
}

impl Derivatives {
    /// Of `piece` over [x, x + h].
    pub(super) fn of(piece: &Piece, x: f64, h: f64) -> Self {
        let (p0, p1) = (piece.first(x), piece.first(x + h));
        let (s0, s1) = (piece.second(x), piece.second(x + h));
        Derivatives { first: [p0, p0 + 0.5 * h * s0, p1], second: [s0, s1], third: piece.third() }
    }

    /// The same stretch travelled backwards.
    pub(super) fn reversed(&self) -> Self {
        let [a, b, c] = self.first;
        Derivatives { first: [-c, -b, -a], second: [self.second[1], self.second[0]], third: -self.third }
    }

    /// p'^2, degree 4.
    pub(super) fn first_squared(&self) -> [f64; 5] {
        let [a, b, c] = self.first;
        [a * a, a * b, (a * c + 2.0 * b * b) / 3.0, b * c, c * c]
    }

    /// Whether the axis stands still over the stretch.
    pub(super) fn still(&self) -> bool {
        self.first == [0.0; 3]
    }

    /// Largest Bernstein coefficient of |p'|.
    pub(super) fn first_max(&self) -> f64 {
        self.first.iter().fold(0.0, |m, p| p.abs().max(m))
    }
}

/// The cubic pieces of all axes of one geometry span, kept while neighbouring spans are visited.
#[derive(Clone, Debug)]
pub(super) struct Pieces<'a> {
    path: &'a GridPath,
    span: Option<usize>,
    pieces: [Piece; MAX_AXES],
}

impl<'a> Pieces<'a> {
    pub(super) fn new(path: &'a GridPath) -> Self {
        let empty = Piece { base: 0, power: [0.0; 4], length: 0.0 };
        Pieces { path, span: None, pieces: [empty; MAX_AXES] }
    }

    /// The pieces of geometry span `span`, one per axis.
    pub(super) fn at(&mut self, span: usize) -> &[Piece] {
        let axes = self.path.axes.len();
        if self.span != Some(span) {
            for (axis, piece) in self.pieces[..axes].iter_mut().enumerate() {
                *piece = self.path.piece(axis, span);
            }
            self.span = Some(span);
        }
        &self.pieces[..axes]
    }
}

/// The strictest caps over a stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Strictest {
    /// Axis mask and speed; masks that differ are kept apart.
    pub(super) tangential: [Option<(u16, f64)>; 2],
    /// Largest du/dt.
    pub(super) rate: f64,
}

/// The caps over [from, to) grid steps.
///
/// With more than two different axis masks over one stretch, the masks are joined under the slowest speed: a cap on
/// more axes is a stricter cap.
pub(super) fn strictest(caps: &[FeedCap], from: u64, to: u64) -> Strictest {
    let mut out = Strictest { tangential: [None; 2], rate: f64::INFINITY };
    let first = caps.partition_point(|c| c.until <= from);
    let mut start = from;
    for cap in &caps[first..] {
        if start >= to {
            break;
        }
        match cap.speed {
            SpeedCap::None => {}
            SpeedCap::Rate(rate) => out.rate = out.rate.min(rate),
            SpeedCap::Tangential { axes, speed } => add_tangential(&mut out.tangential, axes, speed),
        }
        start = cap.until;
    }
    out
}

fn add_tangential(slots: &mut [Option<(u16, f64)>; 2], axes: u16, speed: f64) {
    if speed.is_infinite() {
        return;
    }
    for slot in slots.iter_mut() {
        match slot {
            None => {
                *slot = Some((axes, speed));
                return;
            }
            Some((mask, v)) if *mask == axes => {
                *v = v.min(speed);
                return;
            }
            Some(_) => {}
        }
    }
    if let Some((mask, v)) = &mut slots[1] {
        *mask |= axes;
        *v = v.min(speed);
    }
}

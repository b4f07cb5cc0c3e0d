//! Which place of a section belongs to which program line, and how fast it may be travelled there.

use super::certify::Metric;
use super::contour::{Contour, Primitive};
use super::grid_path::GridPath;
use super::section::{BlockMark, FeedCap, SpeedCap};
use crate::job::program::Feed;
use crate::tolerances::ZERO_LENGTH;

/// Caps and blocks of a contour along its path, neighbours with equal content merged.
pub(super) fn marks(contour: &Contour, path: &GridPath, metric: &Metric) -> (Vec<FeedCap>, Vec<BlockMark>) {
    let total = path.grid_length();
    let mut caps: Vec<FeedCap> = Vec::new();
    let mut blocks: Vec<BlockMark> = Vec::new();
    let last = contour.primitives.len() - 1;
    for (k, p) in contour.primitives.iter().enumerate() {
        let until = if k == last { total } else { (contour.ends[k] / path.step).round() as u64 };
        // A block shorter than half a grid step leaves no mark.
        if until > caps.last().map_or(0, |c| c.until) {
            let speed = cap(p, contour.length_of(k), metric);
            match caps.last_mut() {
                Some(c) if c.speed == speed => c.until = until,
                _ => caps.push(FeedCap { until, speed }),
            }
            match blocks.last_mut() {
                Some(b) if b.line == p.line => b.until = until,
                _ => blocks.push(BlockMark { until, line: p.line }),
            }
        }
    }
    (caps, blocks)
}

/// The cap that a primitive of the given length in u puts on the path speed.
fn cap(p: &Primitive, length: f64, metric: &Metric) -> SpeedCap {
    match p.feed {
        None => SpeedCap::None,
        Some(Feed::Duration(seconds)) => SpeedCap::Rate(length / seconds),
        Some(Feed::Speed(speed)) => {
            let moves = |a: usize| p.slope[a].abs() > ZERO_LENGTH;
            let linear = p.round.is_some() || (0..metric.axes).any(|a| metric.is_linear(a) && moves(a));
            let counted = (0..metric.axes).filter(|&a| metric.is_linear(a) == linear);
            SpeedCap::Tangential { axes: counted.fold(0, |mask, a| mask | 1 << a), speed }
        }
    }
}

//! A section: a stretch of path between two rests, with all that the feed problem needs to know about it.

use serde::{Deserialize, Serialize};

use super::grid_path::GridPath;
use crate::job::program::{MoveKind, StopCause};

/// A stretch of path from rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// Rapid or feed; chooses the axis limits.
    pub kind: MoveKind,
    /// The rounded path.
    pub path: GridPath,
    /// What is known of every place on it.
    pub marks: Marks,
}

/// What is known of the places of a section besides its path.
#[derive(Clone, Debug, PartialEq)]
pub struct Marks {
    /// Caps on the path speed: consecutive, the last one ends with the path.
    pub caps: Vec<FeedCap>,
    /// Which program line made which part of the path: consecutive, the last one ends with the path.
    pub blocks: Vec<BlockMark>,
    /// How far the path may be from the programmed contour, and how far it provably is at most.
    pub deviation: Deviation,
    /// Why motion rests at the end.
    pub end: StopCause,
}

impl Marks {
    /// The program line that made the place `u` [grid steps]; the last one beyond the end.
    pub fn line_at(&self, u: f64) -> u32 {
        let k = self.blocks.partition_point(|b| (b.until as f64) < u);
        self.blocks.get(k).or(self.blocks.last()).map_or(0, |b| b.line)
    }
}

/// A cap on the speed along a part of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedCap {
    /// Where the part ends [grid steps]; it starts where the one before it ends.
    pub until: u64,
    /// The cap.
    pub speed: SpeedCap,
}

/// How fast the path may be travelled, besides the axis limits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum SpeedCap {
    /// No cap.
    None,
    /// Euclidean speed over the axes of the bit mask is at most this [axis units/s].
    Tangential {
        /// Bit i set: axis i counts.
        axes: u16,
        /// Largest speed.
        speed: f64,
    },
    /// du/dt is at most this [u/s].
    Rate(f64),
}

/// One program line's part of the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockMark {
    /// Where the part ends [grid steps]; it starts where the one before it ends.
    pub until: u64,
    /// Line of the program, from 1.
    pub line: u32,
}

/// Distance between the path and the programmed contour, both directions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// Allowed [mm], the largest value in force in the section.
    pub tolerance_mm: f64,
    /// Proven upper bound over the whole section [mm], of the rounded path.
    pub bound_mm: f64,
    /// Line of the program at which the bound occurs.
    pub line: u32,
}

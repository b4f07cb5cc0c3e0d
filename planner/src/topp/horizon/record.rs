//! Committed pieces put together again.

use super::path::{PathPiece, PathStart};
use super::{Commit, Stop};
use crate::feed::table::FeedTable;
use crate::geometry::grid_path::{GridAxis, GridPath};

/// Everything committed so far, and the path so far: grows with the path, unlike the planner itself.
#[derive(Clone, Debug)]
pub struct Record {
    path: GridPath,
    steps: Vec<u32>,
    codes: Vec<u32>,
    q_scale: f32,
}

impl Record {
    /// Nothing so far; `q_scale` as [`super::Horizon::q_scale`] gives it.
    pub fn new(start: &PathStart, q_scale: f32) -> Self {
        let axis = |&(lsb, controls): &(f64, [i64; 3])| GridAxis { lsb, controls: controls.to_vec() };
        let axes = start.axes.iter().map(axis).collect();
        let path = GridPath { step: start.step, breaks: vec![0], axes };
        Record { path, steps: Vec::new(), codes: Vec::new(), q_scale }
    }

    /// Takes in a piece of path that the planner was given.
    pub fn path(&mut self, piece: &PathPiece) {
        self.path.breaks.extend(&piece.breaks);
        for (axis, controls) in self.path.axes.iter_mut().zip(&piece.controls) {
            axis.controls.extend(controls);
        }
    }

    /// Takes in what the planner has committed.
    pub fn commit(&mut self, commit: &Commit) {
        self.steps.extend(&commit.steps);
        self.codes.extend(&commit.codes);
    }

    /// The table of everything committed, stopping as `stop` says.
    pub fn table(&self, stop: &Stop) -> FeedTable {
        let spans = self.path.breaks.partition_point(|&b| b < stop.end);
        let mut path = GridPath {
            step: self.path.step,
            breaks: self.path.breaks[..=spans].to_vec(),
            axes: self
                .path
                .axes
                .iter()
                .map(|a| GridAxis { lsb: a.lsb, controls: a.controls[..spans + 3].to_vec() })
                .collect(),
        };
        for (axis, end) in path.axes.iter_mut().zip(&stop.controls) {
            axis.controls[spans + 1..].copy_from_slice(end);
        }
        let joined = |a: &[u32], b: &[u32]| [a, b].concat();
        FeedTable {
            path,
            steps: joined(&self.steps, &stop.steps),
            q_scale: self.q_scale,
            codes: joined(&self.codes, &stop.codes),
        }
    }
}

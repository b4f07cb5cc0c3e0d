//! Way-point jobs: a CSV file of positions, and a cubic spline through them.
//!
//! The first line names the axes, one column each, with the unit in brackets if it is not the axis' own:
//! `X [mm],Y [mm],A [deg]` or `q1 (rad)`. Every further line is a way-point in machine coordinates. Blank lines
//! and lines that start with `#` are skipped. Axes without a column stay at 0, where programs start.
//!
//! The path passes every way-point to half a drive count or better, in order, from rest at the first to rest at
//! the last, unless a tolerance lets it pass some of them nearby. Where way-points are h apart, an error e in them, the
//! last digit or a drive count, shakes the machine with a jerk of about 6 e (v/h)^3: a spline through fewer of them is as
//! close to them all and smooth.
//!
//! Two neighbouring way-points in the same place are refused, for any knots. A path that turns back on itself
//! is not: the spline is smooth in its parameter there, and motion passes the turn with all axes at
//! zero speed for an instant. Only a span along which the path all but stands still is refused.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::machine::{AxisKind, Machine, Point};
use crate::geometry::section::Section;
use crate::splines::cubic::Ends;
use crate::splines::knots::Knots;
use crate::tolerances::ZERO_LENGTH;

mod error;
mod fit;
mod reader;
mod thin;

pub use error::{WayPointError, WayPointErrorKind};

/// Most way-points of one job.
const MOST_POINTS: usize = 10_000_000;

/// The way-points of a job, checked: finite, inside the travel, no two neighbours in one place.
#[derive(Clone, Debug)]
pub struct WayPoints<'m> {
    machine: &'m Machine,
    /// Name of the file in messages.
    name: String,
    /// The machine's axis of each column.
    axes: Vec<usize>,
    /// One row after another, in axis units.
    values: Vec<f64>,
    /// Line of the file of each way-point, from 1.
    lines: Vec<u32>,
    /// The last digit with which each column is written, in axis units.
    digits: Vec<f64>,
}

/// How the spline runs through the way-points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplineForm {
    /// What happens at the ends.
    pub ends: Ends,
    /// How the parameter is spread.
    pub knots: Knots,
    /// dr/du at the start and the end, in axis units per unit of path length; for clamped ends only.
    pub end_slopes: [Point; 2],
    /// How far way-points may lie from the spline so that fewer of them become knots [mm]; 0: all do.
    pub tolerance_mm: f64,
}

impl Default for SplineForm {
    /// Not-a-knot ends on chord lengths; zero slopes if the ends are then clamped.
    fn default() -> Self {
        Self {
            ends: Ends::NotAKnot,
            knots: Knots::Chord,
            end_slopes: [Point::default(); 2],
            tolerance_mm: 0.0,
        }
    }
}

/// Reads a file of way-points.
///
/// One line is held at a time besides the way-points themselves.
///
/// # Errors
/// If the file cannot be read, or at the first thing in it that is not as it should be.
pub fn read(path: impl AsRef<Path>, machine: &Machine) -> Result<WayPoints<'_>, WayPointError> {
    let name = path.as_ref().display().to_string();
    let file = File::open(path).map_err(|e| reader::unreadable(&name, &e))?;
    reader::read(file, &name, machine)
}

/// Reads way-points from `source`; `name` is shown in messages.
///
/// # Errors
/// As [`read`].
pub fn read_from<'m>(
    source: impl Read,
    name: &str,
    machine: &'m Machine,
) -> Result<WayPoints<'m>, WayPointError> {
    reader::read(source, name, machine)
}

impl<'m> WayPoints<'m> {
    /// Takes way-points from memory, row by row, one number per axis of `axes` (indices of the machine's axes);
    /// rows count as lines 1, 2, 3...
    ///
    /// # Errors
    /// As [`read`], with `name` for the file.
    pub fn from_rows<const N: usize>(
        rows: impl IntoIterator<Item = [f64; N]>,
        axes: [usize; N],
        name: &str,
        machine: &'m Machine,
    ) -> Result<Self, WayPointError> {
        let mut points = Collector::new(name, machine, axes.to_vec());
        if let Some(axis) = axes.iter().find(|&&a| a >= machine.axes.len()) {
            let known: Vec<&str> = machine.axes.iter().map(|a| a.name.as_str()).collect();
            let kind = WayPointErrorKind::UnknownAxis { name: axis.to_string(), known: known.join(", ") };
            return Err(WayPointError::of_file(name, kind));
        }
        if let Some(i) = (1..N).find(|&i| axes[..i].contains(&axes[i])) {
            let kind = WayPointErrorKind::ColumnTwice { axis: machine.axes[axes[i]].name.clone() };
            return Err(WayPointError::of_file(name, kind));
        }
        for (row, line) in rows.into_iter().zip(1..) {
            for (value, axis) in row.iter().zip(axes.iter().map(|&a| &machine.axes[a])) {
                let [min, max] = axis.travel;
                let kind = if !value.is_finite() {
                    WayPointErrorKind::NotFinite { text: value.to_string() }
                } else if *value < min || *value > max {
                    WayPointErrorKind::OutsideTravel { axis: axis.name.clone(), value: *value, min, max }
                } else {
                    continue;
                };
                return Err(WayPointError::of_line(name, line, kind));
            }
            points.push(&row, line)?;
        }
        points.finish()
    }

    /// Number of way-points.
    pub fn count(&self) -> usize {
        self.lines.len()
    }

    /// Way-point `i`; axes without a column are at 0.
    ///
    /// # Panics
    /// If `i` is not below [`count`](Self::count).
    pub fn point(&self, i: usize) -> Point {
        let mut point = Point::default();
        for (&axis, &value) in self.axes.iter().zip(self.row(i)) {
            point[axis] = value;
        }
        point
    }

    /// Line of the file that holds way-point `i`, from 1.
    ///
    /// # Panics
    /// If `i` is not below [`count`](Self::count).
    pub fn line(&self, i: usize) -> u32 {
        self.lines[i]
    }

    /// Mask of the axes that a feed is about: the linear ones, or the rotary ones if no other has a column.
    pub fn counted(&self) -> u16 {
        let counted = if self.has_linear() { AxisKind::Linear } else { AxisKind::Rotary };
        let axes = self.machine.axes.iter().enumerate().filter(|(_, a)| a.kind == counted);
        axes.fold(0, |mask, (i, _)| mask | 1 << i)
    }

    /// dr/du along the first and the last chord: end slopes of a clamped spline when nothing better is known.
    pub fn end_chords(&self, knots: Knots) -> [Point; 2] {
        let lengths = knots.lengths(&self.distances(&self.weights()));
        let last = lengths.len() - 1;
        [0, last].map(|i| {
            let (from, to) = (self.point(i), self.point(i + 1));
            std::array::from_fn(|axis| (to[axis] - from[axis]) / lengths[i])
        })
    }

    /// Resolution of the way-points [mm]: the largest drive count or last digit of any axis, the latter as far as it is
    /// below a tenth of the machine's tolerance.
    pub fn resolution_mm(&self) -> f64 {
        /// Where fewer digits are written than the tolerance has, they are the whole position.
        const MOST: f64 = 0.1;
        let units = self.axes.iter().zip(&self.digits).map(|(&axis, &digit)| {
            let axis = &self.machine.axes[axis];
            let (tolerance, scale) = match axis.kind {
                AxisKind::Linear => (self.machine.tolerance_mm, 1.0),
                AxisKind::Rotary => (self.machine.tolerance_rotary, self.rotary_scale()),
            };
            digit.min(MOST * tolerance).max(1.0 / axis.counts_per_unit) * scale
        });
        units.fold(0.0, f64::max)
    }

    /// The same job with only these way-points.
    fn only(&self, kept: &[usize]) -> Self {
        Self {
            machine: self.machine,
            name: self.name.clone(),
            axes: self.axes.clone(),
            values: kept.iter().flat_map(|&i| self.row(i)).copied().collect(),
            lines: kept.iter().map(|&i| self.lines[i]).collect(),
            digits: self.digits.clone(),
        }
    }

    fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.axes.len()..(i + 1) * self.axes.len()]
    }

    /// The path through the way-points as a section that starts and ends at rest, with the programmed `feed` in
    /// axis units per second as its only cap.
    ///
    /// The deviation is the proven distance of the rounded path from the way-points. Its tolerance is the form's, or
    /// half a count on every axis where that is coarser.
    ///
    /// # Errors
    /// If there are too few way-points for the end condition, a closed curve does not close, or the spline
    /// leaves the travel or stands still; with the line of the way-point that it runs to.
    pub fn section(&self, form: &SplineForm, feed: Option<f64>) -> Result<Section, WayPointError> {
        fit::section(self, form, feed)
    }

    /// Whether a linear axis has a column.
    fn has_linear(&self) -> bool {
        self.axes.iter().any(|&a| self.machine.axes[a].kind == AxisKind::Linear)
    }

    /// Millimetres per rotary unit, so that the two tolerances of the machine weigh the same.
    fn rotary_scale(&self) -> f64 {
        self.machine.tolerance_mm / self.machine.tolerance_rotary
    }

    /// What a unit of each column is worth in path length: 1, or [`rotary_scale`](Self::rotary_scale) for a
    /// rotary axis beside linear ones.
    fn weights(&self) -> Vec<f64> {
        let rotary = if self.has_linear() { self.rotary_scale() } else { 1.0 };
        let weight = |a: &usize| match self.machine.axes[*a].kind {
            AxisKind::Linear => 1.0,
            AxisKind::Rotary => rotary,
        };
        self.axes.iter().map(weight).collect()
    }

    /// Weighted distances between neighbouring way-points.
    fn distances(&self, weights: &[f64]) -> Vec<f64> {
        let distance = |i: usize| {
            let squares = self.row(i).iter().zip(self.row(i - 1)).zip(weights);
            squares.map(|((b, a), w)| ((b - a) * w).powi(2)).sum::<f64>().sqrt()
        };
        (1..self.count()).map(distance).collect()
    }
}

/// Way-points on their way into a [`WayPoints`].
struct Collector<'m>(WayPoints<'m>);

impl<'m> Collector<'m> {
    fn new(name: &str, machine: &'m Machine, axes: Vec<usize>) -> Self {
        let digits = vec![0.0; axes.len()];
        Self(WayPoints {
            machine,
            name: name.to_owned(),
            axes,
            values: Vec::new(),
            lines: Vec::new(),
            digits,
        })
    }

    fn push(&mut self, row: &[f64], line: u32) -> Result<(), WayPointError> {
        if self.0.lines.len() == MOST_POINTS {
            let kind = WayPointErrorKind::TooManyPoints { most: MOST_POINTS };
            return Err(WayPointError::of_line(&self.0.name, line, kind));
        }
        self.0.values.extend_from_slice(row);
        self.0.lines.push(line);
        Ok(())
    }

    /// Checks what takes all way-points to see.
    fn finish(self) -> Result<WayPoints<'m>, WayPointError> {
        let points = self.0;
        if points.count() < 2 {
            let kind = WayPointErrorKind::TooFewPoints { found: points.count(), least: 2 };
            return Err(WayPointError::of_file(&points.name, kind));
        }
        let weights = points.weights();
        let mut extent = 0.0;
        for (column, (&axis, weight)) in points.axes.iter().zip(&weights).enumerate() {
            let values = points.values.iter().skip(column).step_by(points.axes.len());
            let [low, high] =
                values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], &v| [l.min(v), h.max(v)]);
            let counts = (high - low) * points.machine.axes[axis].counts_per_unit;
            if counts >= 1.0 {
                extent = f64::max(extent, (high - low) * weight);
            }
        }
        if extent == 0.0 {
            return Err(WayPointError::of_file(&points.name, WayPointErrorKind::Standstill));
        }
        let repeated = points.distances(&weights).iter().position(|&d| d <= ZERO_LENGTH * extent);
        if let Some(i) = repeated {
            let kind = WayPointErrorKind::Repeated { earlier: points.lines[i] };
            return Err(WayPointError::of_line(&points.name, points.lines[i + 1], kind));
        }
        Ok(points)
    }
}

#[cfg(test)]
mod tests;

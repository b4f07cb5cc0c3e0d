//! The machine's axes as a part program names them.

use std::f64::consts::PI;

use super::fault::ErrorKind;
use crate::job::machine::{AxisKind, MAX_AXES, Machine, Point, Unit};
use crate::tolerances::ZERO_LENGTH;

/// The letters of axis words, in the order of RS-274.
pub(super) const LETTERS: &[u8; 9] = b"XYZABCUVW";

/// The machine's axes by letter.
#[derive(Clone, Debug)]
pub(super) struct Axes {
    /// Axis of each entry of [`LETTERS`].
    by_letter: [Option<usize>; 9],
    names: Vec<String>,
    units: Vec<Unit>,
    travel: Vec<[f64; 2]>,
    /// Which axes are linear; entries beyond the machine's axes are not.
    linear: [bool; MAX_AXES],
}

impl Axes {
    pub(super) fn new(machine: &Machine) -> Self {
        let axes = &machine.axes;
        let position = |letter: u8| axes.iter().position(|a| a.name.as_bytes() == [letter]);
        let mut linear = [false; MAX_AXES];
        for (slot, axis) in linear.iter_mut().zip(axes) {
            *slot = axis.kind == AxisKind::Linear;
        }
        Self {
            by_letter: LETTERS.map(position),
            names: axes.iter().map(|a| a.name.clone()).collect(),
            units: axes.iter().map(|a| a.unit).collect(),
            travel: axes.iter().map(|a| a.travel).collect(),
            linear,
        }
    }

    /// The axis of an axis letter.
    pub(super) fn find(&self, letter: u8) -> Result<usize, ErrorKind> {
        let known = LETTERS.iter().position(|&l| l == letter).and_then(|i| self.by_letter[i]);
        known.ok_or(ErrorKind::AxisMissing { letter: char::from(letter) })
    }

    /// The letter of an axis, if it has one.
    pub(super) fn letter(&self, axis: usize) -> Option<u8> {
        self.by_letter.iter().position(|&a| a == Some(axis)).map(|i| LETTERS[i])
    }

    /// Axis units per program unit of an axis word, when a linear program unit has `unit_mm` millimetres.
    pub(super) fn scale(&self, axis: usize, unit_mm: f64) -> f64 {
        match self.units[axis] {
            Unit::Mm => unit_mm,
            Unit::Deg => 1.0,
            Unit::Rad => PI / 180.0,
        }
    }

    pub(super) fn is_linear(&self, axis: usize) -> bool {
        self.linear[axis]
    }

    /// Euclidean norm over the linear axes [mm].
    pub(super) fn linear_norm(&self, delta: &Point) -> f64 {
        let squares = delta.iter().zip(self.linear).filter(|(_, linear)| *linear).map(|(d, _)| d * d);
        squares.sum::<f64>().sqrt()
    }

    /// Axis units per degree of the rotary axes (one unit on every machine).
    pub(super) fn rotary_scale(&self) -> f64 {
        if self.units.contains(&Unit::Rad) { PI / 180.0 } else { 1.0 }
    }

    /// Whether two positions are the same, up to [`ZERO_LENGTH`] of their size.
    pub(super) fn coincide(&self, a: &Point, b: &Point) -> bool {
        let count = self.names.len();
        a[..count].iter().zip(&b[..count]).all(|(a, b)| {
            let size = a.abs().max(b.abs()).max(1.0);
            (a - b).abs() <= ZERO_LENGTH * size
        })
    }

    /// A box of positions must be inside the travel; the axis and the reason if it is not.
    pub(super) fn check_travel(&self, low: &Point, high: &Point) -> Result<(), (usize, ErrorKind)> {
        for (axis, &[min, max]) in self.travel.iter().enumerate() {
            let slack = ZERO_LENGTH * (max - min);
            let value = if low[axis] < min - slack {
                low[axis]
            } else if high[axis] <= max + slack {
                continue;
            } else {
                high[axis]
            };
            let unit = match self.units[axis] {
                Unit::Mm => "mm",
                Unit::Deg => "deg",
                Unit::Rad => "rad",
            };
            let name = self.names[axis].clone();
            return Err((axis, ErrorKind::OutsideTravel { axis: name, value, min, max, unit }));
        }
        Ok(())
    }
}

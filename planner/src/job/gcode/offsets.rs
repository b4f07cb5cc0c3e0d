//! Coordinate systems: what lies between programmed and machine positions.

use crate::job::machine::{MAX_AXES, Point};

/// Number of coordinate systems, G54 to G59.3.
pub(super) const SYSTEMS: usize = 9;

/// Offsets in machine axes [axis units]: `machine = programmed + system + shift + tool length`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Offsets {
    /// Origins of G54 to G59.3.
    systems: [Point; SYSTEMS],
    /// The system in force.
    active: usize,
    /// G92 in force.
    shift: Point,
    /// G92 as last set, for G92.3.
    stored_shift: Point,
    /// G43.
    tool: Point,
}

impl Offsets {
    /// The sum of all offsets of an axis.
    pub(super) fn of(&self, axis: usize) -> f64 {
        self.systems[self.active][axis] + self.shift[axis] + self.tool[axis]
    }

    /// The sum of all offsets.
    pub(super) fn all(&self) -> Point {
        std::array::from_fn(|axis| self.of(axis))
    }

    /// G54 to G59.3, counted from 0.
    pub(super) fn select(&mut self, system: usize) {
        self.active = system.min(SYSTEMS - 1);
    }

    /// The system in force, counted from 0.
    pub(super) fn active(&self) -> usize {
        self.active
    }

    /// G10 L2: places the origin of a system.
    pub(super) fn set_origin(&mut self, system: usize, axis: usize, origin: f64) {
        self.systems[system.min(SYSTEMS - 1)][axis] = origin;
    }

    /// G10 L20: places the origin of a system so that `machine` reads `value` in it.
    pub(super) fn set_reading(&mut self, system: usize, axis: usize, machine: f64, value: f64) {
        self.set_origin(system, axis, machine - self.shift[axis] - self.tool[axis] - value);
    }

    /// G92: shifts all systems so that `machine` reads `value`.
    pub(super) fn shift_reading(&mut self, axis: usize, machine: f64, value: f64) {
        self.shift[axis] = machine - self.systems[self.active][axis] - self.tool[axis] - value;
        self.stored_shift = self.shift;
    }

    /// G92.2, and G92.1 if `forget`.
    pub(super) fn end_shift(&mut self, forget: bool) {
        self.shift = [0.0; MAX_AXES];
        if forget {
            self.stored_shift = self.shift;
        }
    }

    /// G92.3.
    pub(super) fn restore_shift(&mut self) {
        self.shift = self.stored_shift;
    }

    /// G43 and G49: the tool length along an axis.
    pub(super) fn set_tool(&mut self, axis: usize, length: f64) {
        self.tool[axis] = length;
    }

    /// G49 on a machine without Z.
    pub(super) fn clear_tool(&mut self) {
        self.tool = [0.0; MAX_AXES];
    }
}

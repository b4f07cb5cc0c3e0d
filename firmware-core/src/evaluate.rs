//! Position, velocity and acceleration of one axis at any path time of a table.
//!
//! A table is never unpacked: the cursor holds the span that plays and reads one span ahead. A set-point is a
//! function of the time since its span began, so nothing accumulates.

mod law;
mod piece;

pub(crate) use law::{LawCursor, Stretch};
pub(crate) use piece::PieceCursor;

use protocol::checksum::Fnv64;
use protocol::table::TableError;

use crate::table::CheckedTable;

/// What the servo follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Position [counts].
    pub position: i64,
    /// Velocity [counts/s].
    pub velocity: f32,
    /// Acceleration [counts/s^2].
    pub acceleration: f32,
    /// Nothing moves after this.
    pub done: bool,
}

impl Setpoint {
    /// Standing still.
    pub const fn at_rest(position: i64) -> Self {
        Self { position, velocity: 0.0, acceleration: 0.0, done: true }
    }

    /// Feeds position, velocity and acceleration, bit for bit, into a hash.
    #[must_use]
    pub fn hashed(&self, hash: Fnv64) -> Fnv64 {
        hash.with(&self.position.to_le_bytes())
            .with(&self.velocity.to_bits().to_le_bytes())
            .with(&self.acceleration.to_bits().to_le_bytes())
    }
}

/// No span has this number.
const NO_KNOT: u32 = u32::MAX;

/// A place in a table that plays.
#[derive(Clone, Copy, Debug)]
pub struct Cursor {
    law: LawCursor,
    piece: PieceCursor,
    /// Path time at which the span began [2^-32 s].
    began: u64,
    /// From the start of the geometry span to the start of the q span [grid steps], and the same [u].
    offset: u32,
    offset_u: f32,
}

impl Cursor {
    /// The start of a table.
    ///
    /// # Errors
    /// None on a table whose bytes are still those that were checked.
    pub fn new(table: &CheckedTable<'_>) -> Result<Self, TableError> {
        let view = table.view();
        Ok(Self {
            law: LawCursor::start(view)?,
            piece: PieceCursor::start(view)?,
            began: 0,
            offset: 0,
            offset_u: 0.0,
        })
    }

    /// The set-point at path time `time` [2^-32 s].
    ///
    /// Times come in rising order; one before the span that plays gives that span's start. Called once per tick,
    /// it passes at most [`MAX_SPANS_PER_TICK`](protocol::table::rules::MAX_SPANS_PER_TICK) + 1 spans.
    ///
    /// # Errors
    /// None on a table whose bytes are still those that were checked.
    pub fn evaluate(&mut self, table: &CheckedTable<'_>, time: u64) -> Result<Setpoint, TableError> {
        let mut local = time.saturating_sub(self.began);
        if local >= self.law.duration() {
            self.approach(table, time, NO_KNOT)?;
            local = time.saturating_sub(self.began);
        }
        if !self.law.is_last() {
            return Ok(self.piece.at(self.offset_u, self.law.at(local)));
        }
        let left = self.law.duration().saturating_sub(local);
        if left == 0 {
            return Ok(Setpoint::at_rest(table.view().axis.end));
        }
        Ok(self.piece.before_end(self.law.at(left)))
    }

    /// Goes on to the span of a time, but not beyond the knot before span `knot`; whether the time has reached it.
    #[inline(never)]
    pub(crate) fn approach(
        &mut self,
        table: &CheckedTable<'_>,
        time: u64,
        knot: u32,
    ) -> Result<bool, TableError> {
        while !self.law.is_last() && time.saturating_sub(self.began) >= self.law.duration() {
            if self.law.index().wrapping_add(1) == knot {
                return Ok(true);
            }
            self.step(table)?;
        }
        Ok(false)
    }

    /// The start of a table that goes on where this one is, at the end of its span.
    pub(crate) fn joined(&self, table: &CheckedTable<'_>) -> Result<Self, TableError> {
        Ok(Self { began: self.began.saturating_add(self.law.duration()), ..Self::new(table)? })
    }

    /// Goes on by a span.
    fn step(&mut self, table: &CheckedTable<'_>) -> Result<(), TableError> {
        let view = table.view();
        self.began = self.began.saturating_add(self.law.duration());
        let step = self.law.step();
        self.law.advance(view)?;
        if self.law.opens_geometry() {
            self.piece.advance(view)?;
            self.offset = 0;
        } else {
            self.offset = self.offset.saturating_add(step);
        }
        self.offset_u = self.offset as f32 * view.header.step();
        Ok(())
    }

    /// The q span that plays, from 0.
    pub fn span(&self) -> u32 {
        self.law.index()
    }

    /// Path time at which it began [2^-32 s].
    pub fn began(&self) -> u64 {
        self.began
    }

    /// How long it takes [2^-32 s].
    pub fn duration(&self) -> u64 {
        self.law.duration()
    }
}

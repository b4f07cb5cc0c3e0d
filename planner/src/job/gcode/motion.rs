//! Motion blocks, and the items they hand on.

use std::io::BufRead;

use super::arc::{self, Circle};
use super::axes::LETTERS;
use super::block::CodeWord;
use super::code::{Code, Group};
use super::counters::BoundingBox;
use super::fault::{ErrorKind, Fault};
use super::interpreter::Program;
use super::modal::Motion;
use super::notes::Once;
use crate::job::machine::Point;
use crate::job::program::{Arc, Corner, Feed, Item, Move, MoveKind, Shape, StopCause};
use crate::tolerances::{FEED_LEAST, ZERO_LENGTH};

/// Most turns of one arc.
const TURN_LIMIT: u32 = 10_000;

impl<R: BufRead> Program<R> {
    /// Executes the motion of a block: its own mode, or the modal one if axis words are left.
    pub(super) fn motion(&mut self) -> Result<(), Fault> {
        let word = self.block.code(Group::Motion);
        if let Some(word) = word {
            let motion = match word.code.tenths() {
                0 => Motion::Rapid,
                10 => Motion::Line,
                20 => Motion::Arc { clockwise: true },
                30 => Motion::Arc { clockwise: false },
                800 => Motion::None,
                _ => Motion::Cycle(word.code),
            };
            let in_cycle = matches!(self.modal.motion, Motion::Cycle(_));
            if matches!(motion, Motion::Cycle(_)) && !in_cycle {
                let normal = self.modal.plane.letters().1;
                let axis = self.axes.find(normal).map_err(|kind| word.fault(kind))?;
                self.modal.cycle_level = self.position[axis];
            }
            self.set_motion(motion);
        }
        let machine_positions = self.code(Group::NonModal, &[530]);
        let axis_letter = self.block.first_unused(LETTERS);
        if let Some(g53) = machine_positions {
            if !matches!(self.modal.motion, Motion::Rapid | Motion::Line) {
                return Err(g53.fault(ErrorKind::MachineCoordinatesMode));
            }
            if self.modal.incremental {
                return Err(g53.fault(ErrorKind::MachineCoordinatesIncremental));
            }
        }
        match self.modal.motion {
            Motion::None => match axis_letter {
                Some(letter) => {
                    let kind = ErrorKind::NoMotionMode { letter: char::from(letter) };
                    Err(self.block.fault(letter, kind))
                }
                None => Ok(()),
            },
            Motion::Rapid if axis_letter.is_some() => {
                let (target, _) = self.target(machine_positions.is_some())?;
                self.rapid(target)
            }
            Motion::Line if axis_letter.is_some() => {
                let (target, _) = self.target(machine_positions.is_some())?;
                let feed = self.feed(&target, false)?;
                self.line_feed(target, feed)
            }
            Motion::Arc { clockwise } => {
                let centre_words = self.block.first_unused(b"IJK").is_some();
                if word.is_some() || axis_letter.is_some() || centre_words {
                    self.arc(clockwise)?;
                }
                Ok(())
            }
            Motion::Cycle(code) if word.is_some() || axis_letter.is_some() => self.start_cycle(code),
            _ => Ok(()),
        }
    }

    /// The word that an error about the block's motion points at.
    pub(super) fn motion_fault(&self, kind: ErrorKind) -> Fault {
        if let Some(word) = self.block.code(Group::Motion) {
            return word.fault(kind);
        }
        let present = |letter: u8| self.block.peek(letter).is_some();
        match LETTERS.iter().chain(b"IJKR").find(|&&letter| present(letter)) {
            Some(&letter) => self.block.fault(letter, kind),
            None => kind.at(0, 1),
        }
    }

    /// The feed in force for a move to `target`; a circle moves the linear axes even if it closes.
    pub(super) fn feed(&self, target: &Point, circular: bool) -> Result<Option<Feed>, Fault> {
        if self.options.ignore_feed {
            return Ok(None);
        }
        if self.modal.inverse_time {
            return match self.block.peek(b'F') {
                Some(per_minute) if per_minute > FEED_LEAST => Ok(Some(Feed::Duration(60.0 / per_minute))),
                Some(_) => Err(self.block.fault(b'F', ErrorKind::ZeroFeed)),
                None => Err(self.motion_fault(ErrorKind::NoInverseTime)),
            };
        }
        let Some(rate) = self.modal.feed else { return Err(self.motion_fault(ErrorKind::NoFeed)) };
        if rate.deg_per_s <= FEED_LEAST {
            return Err(self.motion_fault(ErrorKind::ZeroFeed));
        }
        let delta = std::array::from_fn(|i| target[i] - self.handed[i]);
        let linear = circular || self.axes.linear_norm(&delta) > ZERO_LENGTH;
        let rotary = (0..delta.len()).any(|i| !self.axes.is_linear(i) && delta[i] != 0.0);
        Ok(Some(Feed::Speed(if rotary && !linear {
            rate.deg_per_s * self.axes.rotary_scale()
        } else {
            rate.mm_per_s
        })))
    }

    /// A rapid to a machine position.
    pub(super) fn rapid(&mut self, target: Point) -> Result<(), Fault> {
        self.counters.rapids += 1;
        self.straight(MoveKind::Rapid, target, None)
    }

    /// A straight feed move to a machine position.
    pub(super) fn line_feed(&mut self, target: Point, feed: Option<Feed>) -> Result<(), Fault> {
        self.counters.lines += 1;
        self.straight(MoveKind::Feed, target, feed)
    }

    fn straight(&mut self, kind: MoveKind, target: Point, feed: Option<Feed>) -> Result<(), Fault> {
        let start = self.handed;
        self.check_travel(&target, &target)?;
        self.position = target;
        if self.axes.coincide(&start, &target) {
            self.counters.zero_length += 1;
            return Ok(());
        }
        let delta = std::array::from_fn(|i| target[i] - start[i]);
        let length_mm = self.axes.linear_norm(&delta);
        let low = std::array::from_fn(|i| start[i].min(target[i]));
        let high = std::array::from_fn(|i| start[i].max(target[i]));
        self.hand_on(kind, Shape::Line, target, feed, length_mm, BoundingBox { min: low, max: high });
        Ok(())
    }

    fn arc(&mut self, clockwise: bool) -> Result<(), Fault> {
        let plane = self.modal.plane;
        let (letters, _) = plane.letters();
        let mut axes = [0; 2];
        for (slot, letter) in axes.iter_mut().zip(letters) {
            *slot = self.axes.find(letter).map_err(|kind| self.motion_fault(kind))?;
            if !self.axes.is_linear(*slot) {
                return Err(self.motion_fault(ErrorKind::ArcAxisRotary { axis: char::from(letter) }));
            }
        }
        let start = self.handed;
        let origin = axes.map(|axis| self.modal.offsets.of(axis));
        let programmed = axes.map(|axis| self.position[axis]);
        let (target, _) = self.target(false)?;
        let circle = self.circle(origin, programmed)?;
        let turns = self.whole_number(b'P', 1, TURN_LIMIT)?.unwrap_or(1);
        let feed = self.feed(&target, true)?;
        // The programmed start, not the one handed on: only they tell a full circle.
        let ends = [programmed, axes.map(|axis| target[axis])];
        let arc = arc::arc(axes, ends[0], ends[1], circle, clockwise, turns)
            .map_err(|kind| self.motion_fault(kind))?;
        let (mut low, mut high) = (start, target);
        for i in 0..low.len() {
            (low[i], high[i]) = (start[i].min(target[i]), start[i].max(target[i]));
        }
        for (axis, [min, max]) in axes.into_iter().zip(arc::extent(&arc, ends[0], ends[1])) {
            (low[axis], high[axis]) = (min, max);
        }
        self.check_travel(&low, &high)?;
        self.counters.arcs += 1;
        self.position = target;
        let length_mm = self.arc_length(&arc, &start, &target);
        if length_mm <= ZERO_LENGTH && self.axes.coincide(&start, &target) {
            self.counters.zero_length += 1;
            return Ok(());
        }
        let extent = BoundingBox { min: low, max: high };
        self.hand_on(MoveKind::Feed, Shape::Arc(arc), target, feed, length_mm, extent);
        Ok(())
    }

    /// Reads what fixes the circle: I J K or R.
    fn circle(&mut self, origin: [f64; 2], start: [f64; 2]) -> Result<Circle, Fault> {
        let (letters, outside) = self.modal.plane.centre_letters();
        if self.block.peek(outside).is_some() {
            let kind =
                ErrorKind::OutsidePlane { letter: char::from(outside), plane: self.modal.plane.code() };
            return Err(self.block.fault(outside, kind));
        }
        let unit_mm = self.modal.unit_mm;
        let centre = letters.map(|letter| self.block.take(letter).map(|value| value * unit_mm));
        match (self.block.take(b'R'), centre) {
            (Some(radius), [None, None]) => Ok(Circle::Radius(radius * unit_mm)),
            (Some(_), _) => Err(self.block.fault(b'R', ErrorKind::CentreAndRadius)),
            (None, [None, None]) => {
                let words = match &letters {
                    b"IJ" => "I J",
                    b"KI" => "I K",
                    _ => "J K",
                };
                Err(self.motion_fault(ErrorKind::NoArcCentre { words }))
            }
            (None, _) if self.modal.absolute_centre => match centre {
                [Some(a), Some(b)] => Ok(Circle::Centre([a + origin[0], b + origin[1]])),
                [a, _] => {
                    let letter = char::from(letters[usize::from(a.is_some())]);
                    Err(self.motion_fault(ErrorKind::IncompleteCentre { letter }))
                }
            },
            (None, [a, b]) => Ok(Circle::Centre([start[0] + a.unwrap_or(0.0), start[1] + b.unwrap_or(0.0)])),
        }
    }

    /// Length over the linear axes [mm].
    fn arc_length(&self, arc: &Arc, start: &Point, end: &Point) -> f64 {
        let beside: Point = std::array::from_fn(|axis| match arc.plane.contains(&axis) {
            true => 0.0,
            false => end[axis] - start[axis],
        });
        arc::length_in_plane(arc).hypot(self.axes.linear_norm(&beside))
    }

    fn check_travel(&self, low: &Point, high: &Point) -> Result<(), Fault> {
        self.axes.check_travel(low, high).map_err(|(axis, kind)| match self.axes.letter(axis) {
            Some(letter) if self.block.peek(letter).is_some() => self.block.fault(letter, kind),
            _ => self.motion_fault(kind),
        })
    }

    fn hand_on(
        &mut self,
        kind: MoveKind,
        shape: Shape,
        end: Point,
        feed: Option<Feed>,
        length_mm: f64,
        extent: BoundingBox,
    ) {
        let line = self.line();
        if !self.modal.unit_said {
            self.note_once(Once::Units, "no G20 or G21: millimetres are assumed");
        }
        if !self.cutting
            && let Some((text, line)) = self.notes.take_operation()
        {
            self.queue.push_back(Item::Note { text, line });
        }
        let exact = self.block.code(Group::ExactStop).is_some();
        let corner = if exact { Corner::Stop } else { self.modal.corner };
        self.queue.push_back(Item::Move(Move { kind, shape, start: self.handed, end, feed, corner, line }));
        self.handed = end;
        self.has_moved = true;
        self.cutting = kind == MoveKind::Feed;
        match kind {
            MoveKind::Feed => {
                self.counters.feed_length_mm += length_mm;
                extent.join_into(&mut self.counters.feed_box);
            }
            MoveKind::Rapid => self.counters.rapid_length_mm += length_mm,
        }
        extent.join_into(&mut self.counters.bounding_box);
    }

    pub(super) fn push_dwell(&mut self, seconds: f64) {
        self.counters.dwells += 1;
        self.counters.dwell_s += seconds;
        self.cutting = false;
        let line = self.line();
        self.queue.push_back(Item::Dwell { seconds, line });
    }

    pub(super) fn stop(&mut self, cause: StopCause) {
        self.counters.stops += 1;
        self.cutting = false;
        let line = self.line();
        self.queue.push_back(Item::Stop { cause, line });
    }

    pub(super) fn stop_if_offsets_changed(&mut self, before: &Point) {
        if self.modal.offsets.all() != *before {
            self.stop(StopCause::OffsetChange);
        }
    }

    pub(super) fn note(&mut self, text: String) {
        let line = self.line();
        self.queue.push_back(Item::Note { text, line });
    }

    pub(super) fn note_once(&mut self, once: Once, text: &str) {
        if self.notes.first(once) {
            self.note(text.to_owned());
        }
    }

    /// A word that a code of this block, or the modal cycle, needs.
    pub(super) fn missing(&self, code: Code, letter: u8) -> Fault {
        let kind = ErrorKind::MissingWord { code, letter: char::from(letter) };
        match self.block.code(Group::Motion) {
            Some(word @ CodeWord { .. }) => word.fault(kind),
            None => self.motion_fault(kind),
        }
    }
}

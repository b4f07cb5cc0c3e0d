//! The interpreter: blocks in, moves, dwells and stops out.

use std::collections::VecDeque;
use std::io::BufRead;

use super::axes::{Axes, LETTERS};
use super::block::{Block, CodeWord};
use super::code::{Code, Group};
use super::counters::Counters;
use super::cycle::Drilling;
use super::error::ProgramError;
use super::fault::{ErrorKind, Fault};
use super::modal::{FeedRate, MM_PER_INCH, Modal, Motion, Plane};
use super::notes::{Notes, Once, comment_text, message};
use super::reader::LineReader;
use super::{Dialect, Options};
use crate::job::machine::{CornerMode, MAX_AXES, Machine, Point, Tool};
use crate::job::program::{Corner, Item, StopCause, ToleranceSource};

/// A part program, read block by block.
///
/// An iterator in constant memory; after the first error it ends. Items come in program order, and nothing of a
/// block with an error is handed on.
#[derive(Debug)]
pub struct Program<R> {
    name: String,
    reader: LineReader<R>,
    pub(super) block: Block,
    pub(super) axes: Axes,
    pub(super) tools: Vec<Tool>,
    /// G28, G30.
    pub(super) stored: [Point; 2],
    best_speed_mm: f64,
    pub(super) options: Options,
    pub(super) modal: Modal,
    /// Where the program is, in machine positions.
    pub(super) position: Point,
    /// Where the last move handed on ends; differs from `position` by dropped moves only.
    pub(super) handed: Point,
    pub(super) queue: VecDeque<Item>,
    pub(super) drilling: Option<Drilling>,
    /// The stop code of the block whose cycle is running.
    pub(super) stop_after_drilling: Option<Code>,
    pub(super) counters: Counters,
    pub(super) notes: Notes,
    /// The last motion handed on is a feed move, and nothing has stopped it.
    pub(super) cutting: bool,
    pub(super) has_moved: bool,
    started: bool,
    tape_open: bool,
    done: bool,
}

impl<R: BufRead> Program<R> {
    /// Reads a program from `reader`; `name` is the file's name in messages.
    pub fn new(reader: R, name: &str, machine: &Machine, options: Options) -> Self {
        let tolerance = |tolerance_mm, source| match options.tolerance_mm {
            Some(tolerance_mm) => Corner::Within { tolerance_mm, source: ToleranceSource::CommandLine },
            None => Corner::Within { tolerance_mm, source },
        };
        let corner = match machine.corner {
            CornerMode::Blend => tolerance(machine.tolerance_mm, ToleranceSource::Machine),
            CornerMode::ExactPath => Corner::Exact,
            CornerMode::ExactStop => Corner::Stop,
        };
        Self {
            name: name.to_owned(),
            reader: LineReader::new(reader),
            block: Block::new(),
            axes: Axes::new(machine),
            tools: machine.tools.clone(),
            stored: [machine.home, machine.second_home],
            best_speed_mm: machine.best_speed_mm,
            options,
            modal: Modal::new(corner),
            position: [0.0; MAX_AXES],
            handed: [0.0; MAX_AXES],
            queue: VecDeque::new(),
            drilling: None,
            stop_after_drilling: None,
            counters: Counters::default(),
            notes: Notes::default(),
            cutting: false,
            has_moved: false,
            started: false,
            tape_open: false,
            done: false,
        }
    }

    /// What the program has asked for so far; complete when the iterator has ended.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// The machine position after the last block read [axis units].
    pub fn position(&self) -> &Point {
        &self.position
    }

    /// Number of the line being read, from 1.
    pub fn line(&self) -> u32 {
        self.reader.line().max(1)
    }

    /// Reads and executes one block, or one step of a drilling cycle.
    fn advance(&mut self) -> Result<(), Fault> {
        if self.drilling.is_some() {
            return self.drill();
        }
        if !self.reader.advance()? {
            return self.finish();
        }
        let text = self.reader.text();
        if text.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'%') {
            if self.tape_open || self.started {
                return self.finish();
            }
            self.tape_open = true;
            return Ok(());
        }
        self.block.read(text, self.options.dialect, !self.started)?;
        if self.block.deleted {
            if self.options.block_delete {
                self.notes.skip_block(self.line());
                return Ok(());
            }
            self.note_once(Once::BlockDelete, "block delete is off: blocks marked / are executed");
        }
        if let Some(range) = self.block.comment.clone() {
            let comment = &self.reader.text()[range];
            let line = self.line();
            if let Some(text) = message(comment) {
                let text = comment_text(text);
                self.note(text);
            } else if !self.block.has_words {
                self.notes.name_operation(comment_text(comment), line);
            }
        }
        if !self.block.has_words {
            return Ok(());
        }
        self.started = true;
        self.counters.blocks += 1;
        if let Some(number) = self.block.program_number {
            self.note(format!("program {number}"));
            return Ok(());
        }
        self.execute()
    }

    /// Executes the block in the order of RS-274/NGC, table 8 (units first: they hold for the whole block).
    fn execute(&mut self) -> Result<(), Fault> {
        self.block.take(b'N');
        if self.options.dialect == Dialect::Printer && self.skip_printer_words() {
            return Ok(());
        }
        self.set_units_and_feed()?;
        self.set_tool_and_spindle()?;
        if let Some(word) = self.code(Group::NonModal, &[40]) {
            self.dwell(word)?;
        }
        if let Some(word) = self.block.code(Group::Plane) {
            let plane = match word.code.tenths() {
                170 => Plane::Xy,
                180 => Plane::Zx,
                _ => Plane::Yz,
            };
            if plane != self.modal.plane {
                self.modal.plane = plane;
                self.modal.sticky = Default::default();
            }
        }
        self.set_tool_length()?;
        if let Some(word) = self.block.code(Group::CoordinateSystem) {
            let system = match word.code.tenths() {
                tenths @ 540..=590 => usize::from(tenths - 540) / 10,
                tenths => usize::from(tenths - 590) + 5,
            };
            let before = self.modal.offsets.all();
            self.modal.offsets.select(system);
            self.stop_if_offsets_changed(&before);
        }
        if let Some(word) = self.block.code(Group::PathControl) {
            self.set_path_control(word)?;
        }
        if let Some(word) = self.block.code(Group::Distance) {
            self.modal.incremental = word.code.tenths() == 910;
        }
        if let Some(word) = self.block.code(Group::ArcDistance) {
            self.modal.absolute_centre = word.code.tenths() == 901;
        }
        if let Some(word) = self.block.code(Group::Retract) {
            self.modal.retract_to_r = word.code.tenths() == 990;
        }
        self.reference_and_offsets()?;
        self.motion()?;
        self.block.check_all_used()?;
        let stop = self.block.code(Group::Stop).map(|word| word.code);
        if self.drilling.is_some() {
            self.stop_after_drilling = stop;
            return Ok(());
        }
        self.end_block(stop)
    }

    /// Does what a stop code asks for, after the block's motion.
    pub(super) fn end_block(&mut self, stop: Option<Code>) -> Result<(), Fault> {
        match stop {
            Some(code) if code == Code::m(2) || code == Code::m(30) => self.finish(),
            Some(_) => {
                self.stop(StopCause::ProgramStop);
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// Drops what only printers know; whether the whole block is skipped.
    fn skip_printer_words(&mut self) -> bool {
        let line = self.line();
        // G10 without L is a printer's retraction.
        let retraction = match self.code(Group::NonModal, &[100]) {
            Some(word) if self.block.peek(b'L').is_none() => Some(word),
            _ => None,
        };
        if let Some(word) = self.block.printer.or(retraction) {
            self.notes.skip_code(word.code, line);
            return true;
        }
        let extruder = self.block.drop_word(b'E');
        if extruder {
            self.notes.skip_extruder(line);
        }
        // G92 of the extruder alone moves no coordinate system.
        extruder && self.code(Group::NonModal, &[920]).is_some() && self.block.first_unused(LETTERS).is_none()
    }

    fn set_units_and_feed(&mut self) -> Result<(), Fault> {
        if let Some(word) = self.block.code(Group::FeedMode) {
            let inverse_time = word.code.tenths() == 930;
            if inverse_time != self.modal.inverse_time {
                self.modal.feed = None;
            }
            self.modal.inverse_time = inverse_time;
        }
        if let Some(word) = self.block.code(Group::Units) {
            self.modal.unit_mm = if word.code.tenths() == 200 { MM_PER_INCH } else { 1.0 };
            self.modal.unit_said = true;
        }
        if let Some(value) = self.not_negative(b'F')? {
            self.modal.feed = (!self.modal.inverse_time)
                .then_some(FeedRate { mm_per_s: value * self.modal.unit_mm / 60.0, deg_per_s: value / 60.0 });
        }
        Ok(())
    }

    fn set_tool_and_spindle(&mut self) -> Result<(), Fault> {
        // S of a printer's dwell is a time.
        let dwells = self.options.dialect == Dialect::Printer && self.code(Group::NonModal, &[40]).is_some();
        let speed = if dwells { None } else { self.not_negative(b'S')? };
        let changed = speed.is_some_and(|s| s != self.modal.spindle_speed);
        if let Some(speed) = speed {
            self.modal.spindle_speed = speed;
        }
        if let Some(tool) = self.whole_number(b'T', 0, u32::MAX)? {
            self.modal.tool = tool;
        }
        if self.block.code(Group::ToolChange).is_some() {
            self.stop(StopCause::ToolChange);
            self.note(format!("tool {}", self.modal.tool));
        }
        match self.block.code(Group::Spindle) {
            Some(word) => {
                self.modal.spindle_on = word.code != Code::m(5);
                self.stop(StopCause::Spindle);
            }
            None if changed && self.modal.spindle_on => self.stop(StopCause::Spindle),
            None => {}
        }
        if self.block.code(Group::Override).is_some() {
            self.note_once(Once::Overrides, "M48, M49: override switches do not change the plan");
        }
        Ok(())
    }

    /// G4.
    fn dwell(&mut self, word: CodeWord) -> Result<(), Fault> {
        let seconds = if self.options.dialect == Dialect::Printer {
            let whole = self.not_negative(b'S')?;
            let milli = self.not_negative(b'P')?.map(|ms| ms / 1000.0);
            whole.or(milli)
        } else {
            self.not_negative(b'P')?
        };
        let Some(seconds) = seconds else {
            return Err(word.fault(ErrorKind::MissingWord { code: word.code, letter: 'P' }));
        };
        self.push_dwell(seconds);
        Ok(())
    }

    /// G61, G61.1, G64.
    fn set_path_control(&mut self, word: CodeWord) -> Result<(), Fault> {
        self.modal.corner = match word.code.tenths() {
            610 => Corner::Exact,
            611 => Corner::Stop,
            _ => {
                let programmed = self.not_negative(b'P')?.map(|p| p * self.modal.unit_mm);
                if self.not_negative(b'Q')?.is_some() {
                    self.note_once(
                        Once::Collinearity,
                        "G64 Q: nothing is merged beyond P, the path stays within P",
                    );
                }
                match (self.options.tolerance_mm, programmed) {
                    (Some(tolerance_mm), _) => {
                        Corner::Within { tolerance_mm, source: ToleranceSource::CommandLine }
                    }
                    (None, Some(0.0)) => {
                        self.note_once(Once::ZeroTolerance, "G64 P0 is run as G61: motion rests at corners");
                        Corner::Exact
                    }
                    (None, Some(tolerance_mm)) => {
                        Corner::Within { tolerance_mm, source: ToleranceSource::Program }
                    }
                    (None, None) => {
                        let tolerance_mm = self.best_speed_mm;
                        self.note_once(
                            Once::BestSpeed,
                            &format!(
                                "G64 without P: {tolerance_mm} mm is used (best_speed_mm of the machine)"
                            ),
                        );
                        Corner::Within { tolerance_mm, source: ToleranceSource::BestSpeed }
                    }
                }
            }
        };
        Ok(())
    }

    /// The value of an axis word in axis units.
    pub(super) fn axis_word(&mut self, letter: u8) -> Result<Option<(usize, f64)>, Fault> {
        let Some(value) = self.block.take(letter) else { return Ok(None) };
        let axis = self.axes.find(letter).map_err(|kind| self.block.fault(letter, kind))?;
        Ok(Some((axis, value * self.axes.scale(axis, self.modal.unit_mm))))
    }

    /// Where the axis words lead, and whether there are any.
    pub(super) fn target(&mut self, machine_positions: bool) -> Result<(Point, bool), Fault> {
        let mut target = self.position;
        let mut any = false;
        for &letter in LETTERS {
            let Some((axis, value)) = self.axis_word(letter)? else { continue };
            any = true;
            target[axis] = if machine_positions {
                value
            } else if self.modal.incremental {
                target[axis] + value
            } else {
                value + self.modal.offsets.of(axis)
            };
        }
        Ok((target, any))
    }

    /// The word of a group if it is one of `tenths`.
    pub(super) fn code(&self, group: Group, tenths: &[u16]) -> Option<CodeWord> {
        self.block.code(group).filter(|word| tenths.contains(&word.code.tenths()))
    }

    /// The number of a word that may not be below zero.
    pub(super) fn not_negative(&mut self, letter: u8) -> Result<Option<f64>, Fault> {
        match self.block.take(letter) {
            Some(value) if value < 0.0 => {
                Err(self.block.fault(letter, ErrorKind::Negative { letter: char::from(letter), value }))
            }
            other => Ok(other),
        }
    }

    /// The number of a word that counts something.
    pub(super) fn whole_number(&mut self, letter: u8, min: u32, max: u32) -> Result<Option<u32>, Fault> {
        let Some(value) = self.block.take(letter) else { return Ok(None) };
        let shown = char::from(letter);
        let kind = if value < 0.0 && min == 0 {
            ErrorKind::Negative { letter: shown, value }
        } else if value.fract() != 0.0 {
            ErrorKind::NotInteger { letter: shown, value }
        } else if value < f64::from(min) || value > f64::from(max) {
            ErrorKind::OutOfRange { letter: shown, value, min: f64::from(min), max: f64::from(max) }
        } else {
            return Ok(Some(value as u32));
        };
        Err(self.block.fault(letter, kind))
    }

    /// The program is over.
    pub(super) fn finish(&mut self) -> Result<(), Fault> {
        if !self.has_moved {
            return Err(ErrorKind::NoMotion.at(0, 0));
        }
        for (text, line) in self.notes.summary() {
            self.queue.push_back(Item::Note { text, line });
        }
        self.stop(StopCause::ProgramEnd);
        self.done = true;
        Ok(())
    }

    /// Ends the modal motion's series of cycles when another motion begins.
    pub(super) fn set_motion(&mut self, motion: Motion) {
        if !matches!(motion, Motion::Cycle(_)) {
            self.modal.sticky = Default::default();
        }
        self.modal.motion = motion;
    }
}

impl<R: BufRead> Iterator for Program<R> {
    type Item = Result<Item, ProgramError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(item) = self.queue.pop_front() {
                return Some(Ok(item));
            }
            if self.done {
                return None;
            }
            if let Err(fault) = self.advance() {
                self.done = true;
                self.drilling = None;
                self.queue.clear();
                let error = ProgramError::at(&self.name, self.line(), self.reader.text(), fault);
                return Some(Err(error));
            }
        }
    }
}

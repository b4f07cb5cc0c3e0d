//! Blocks that move the coordinate system, and moves to stored positions.

use std::io::BufRead;

use super::axes::LETTERS;
use super::block::CodeWord;
use super::code::{Code, Group};
use super::fault::{ErrorKind, Fault};
use super::interpreter::Program;
use super::offsets::SYSTEMS;
use crate::job::machine::MAX_AXES;

impl<R: BufRead> Program<R> {
    /// G43 and G49.
    pub(super) fn set_tool_length(&mut self) -> Result<(), Fault> {
        let Some(word) = self.block.code(Group::ToolLength) else { return Ok(()) };
        let before = self.modal.offsets.all();
        if word.code == Code::g(490) {
            self.modal.offsets.clear_tool();
        } else {
            let z = self.axes.find(b'Z').map_err(|kind| word.fault(kind))?;
            let number = self.whole_number(b'H', 0, u32::MAX)?.unwrap_or(self.modal.tool);
            let listed = self.tools.iter().find(|t| t.number == number).map(|t| t.length_mm);
            let length = match listed {
                Some(length) => length,
                // H0 is no offset everywhere.
                None if number == 0 => 0.0,
                None => {
                    let unknown = ErrorKind::ToolUnknown { number };
                    let at_h = self.block.peek(b'H').is_some();
                    return Err(if at_h { self.block.fault(b'H', unknown) } else { word.fault(unknown) });
                }
            };
            self.modal.offsets.set_tool(z, length);
        }
        self.stop_if_offsets_changed(&before);
        Ok(())
    }

    /// G10, G28, G30, G92 and their kin.
    pub(super) fn reference_and_offsets(&mut self) -> Result<(), Fault> {
        let Some(word) = self.block.code(Group::NonModal) else { return Ok(()) };
        let tenths = word.code.tenths();
        let takes_axes = matches!(tenths, 100 | 280 | 300 | 920);
        if let Some(motion) = self.block.code(Group::Motion).filter(|m| takes_axes && m.code != Code::g(800))
        {
            return Err(motion.fault(ErrorKind::AxisWordConflict { first: word.code, second: motion.code }));
        }
        let before = self.modal.offsets.all();
        match tenths {
            100 => self.set_coordinate_system(word)?,
            280 => self.go_to_stored(0)?,
            300 => self.go_to_stored(1)?,
            281 => self.stored[0] = self.position,
            301 => self.stored[1] = self.position,
            920 => {
                if self.block.first_unused(LETTERS).is_none() {
                    return Err(word.fault(ErrorKind::MissingWord { code: word.code, letter: 'X' }));
                }
                for &letter in LETTERS {
                    if let Some((axis, value)) = self.axis_word(letter)? {
                        self.modal.offsets.shift_reading(axis, self.position[axis], value);
                    }
                }
            }
            921 => self.modal.offsets.end_shift(true),
            922 => self.modal.offsets.end_shift(false),
            923 => self.modal.offsets.restore_shift(),
            _ => {}
        }
        self.stop_if_offsets_changed(&before);
        Ok(())
    }

    /// G10 L2 and L20.
    fn set_coordinate_system(&mut self, word: CodeWord) -> Result<(), Fault> {
        let missing = |letter| word.fault(ErrorKind::MissingWord { code: word.code, letter });
        let Some(kind) = self.block.take(b'L') else { return Err(missing('L')) };
        let reading = kind == 20.0;
        if kind != 2.0 && !reading {
            let unknown = ErrorKind::OutOfRange { letter: 'L', value: kind, min: 2.0, max: 20.0 };
            return Err(self.block.fault(b'L', unknown));
        }
        let Some(number) = self.whole_number(b'P', 0, SYSTEMS as u32)? else { return Err(missing('P')) };
        let system = match number {
            0 => self.modal.offsets.active(),
            n => n as usize - 1,
        };
        for &letter in LETTERS {
            let Some((axis, value)) = self.axis_word(letter)? else { continue };
            if reading {
                self.modal.offsets.set_reading(system, axis, self.position[axis], value);
            } else {
                self.modal.offsets.set_origin(system, axis, value);
            }
        }
        Ok(())
    }

    /// G28 and G30: over the programmed point, if any, to the stored one.
    fn go_to_stored(&mut self, which: usize) -> Result<(), Fault> {
        let mut named = [false; MAX_AXES];
        let mut any = false;
        for &letter in LETTERS {
            let bare = self.block.take_bare(letter);
            if bare || self.block.peek(letter).is_some() {
                let axis = self.axes.find(letter).map_err(|kind| self.block.fault(letter, kind))?;
                named[axis] = true;
                any = true;
            }
        }
        let (over, _) = self.target(false)?;
        if over != self.position {
            self.rapid(over)?;
        }
        let stored = self.stored[which];
        let goal = std::array::from_fn(|i| if named[i] || !any { stored[i] } else { self.position[i] });
        self.rapid(goal)
    }
}

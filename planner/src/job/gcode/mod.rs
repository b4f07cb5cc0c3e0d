//! Part programs in G-code (RS-274/NGC, as LinuxCNC and CAM posts write it).
//!
//! [`Program`] reads a program block by block and hands on moves, dwells and stops; it holds one line and a few
//! items, whatever the size of the file. Nothing is skipped silently: what is not supported is an error with
//! its place.
//!
//! Conventions, where the field knows several:
//!
//! - The program starts at machine position 0 of every axis, with all offsets zero. Moves are handed on in machine
//!   positions, offsets included; with no offset in force they are the programmed values.
//! - Millimetres, G17, G90, G91.1, G94, G54, G98 and the machine's corner mode hold until the program says
//!   otherwise; no motion mode does. G20 and G21 apply to their whole block. Rotary words are degrees in either unit.
//! - Blocks marked `/` are executed unless [`Options::block_delete`] is on.
//! - An `O` with a number alone in the first block is the program's number; every other O-word is refused.
//! - The program ends at M2, M30, the second `%` or the end of the file. A program without motion is an error.
//! - Arcs whose radii differ are allowed up to 0.0127 mm or 0.1 % of the radius, and never more than 0.5 mm.
//! - A full circle is an arc by centre that ends where it starts. P on an arc counts turns.
//! - G4 P is in seconds (in milliseconds in the printer dialect, where S is in seconds).
//! - A tool change, a spindle command and a change of offsets are stops; F, T, M7 to M9 and comments are not.
//! - G84 and G74 tap with a compensating holder: the spindle stops and reverses at the bottom.
//! - G64 without P uses the machine's best-speed tolerance; G64 P0 is G61. Q of G64 never widens the tolerance.

mod arc;
mod axes;
mod block;
mod code;
mod coordinates;
mod counters;
mod cycle;
mod error;
mod fault;
mod interpreter;
mod modal;
mod motion;
mod notes;
mod offsets;
mod reader;

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

pub use code::Code;
pub use counters::{BoundingBox, Counters};
pub use error::ProgramError;
pub use fault::ErrorKind;
pub use interpreter::Program;

use super::machine::Machine;

/// How to read a program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Whose G-code it is.
    pub dialect: Dialect,
    /// Replaces every tolerance of blended corners [mm].
    pub tolerance_mm: Option<f64>,
    /// Feed moves carry no feed, and need none.
    pub ignore_feed: bool,
    /// Skip blocks that start with `/`.
    pub block_delete: bool,
}

/// Whose G-code a program is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    /// Machine tools.
    #[default]
    Rs274,
    /// 3-D printers: extruder words and temperature, fan and display codes are skipped and listed.
    Printer,
}

/// Opens a program.
///
/// # Errors
/// If the file cannot be opened.
pub fn open(
    path: impl AsRef<Path>,
    machine: &Machine,
    options: Options,
) -> Result<Program<BufReader<File>>, ProgramError> {
    let path = path.as_ref();
    let name = path.display().to_string();
    if path.is_dir() {
        return Err(ProgramError::of_file(&name, ErrorKind::Directory));
    }
    let file = File::open(path)
        .map_err(|e| ProgramError::of_file(&name, ErrorKind::Unreadable { reason: e.to_string() }))?;
    Ok(Program::new(BufReader::with_capacity(1 << 16, file), &name, machine, options))
}

#[cfg(test)]
mod tests;

//! An SLCAN adapter on a serial line.

use std::path::Path;
use std::time::Instant;

use super::super::Frame;
use super::{BusError, Wire};
use crate::slcan_line::{LineError, SlcanLine};

pub(super) struct Line {
    name: String,
    line: SlcanLine,
}

impl Line {
    /// Opens a device file, or connects to a socket in the file system.
    pub(super) fn open(name: &str, path: &Path) -> Result<Self, BusError> {
        let line = match SlcanLine::at(path) {
            Ok(line) => line,
            Err(LineError::Open(source)) => return Err(BusError::Open { name: name.to_owned(), source }),
            Err(error) => return Err(failed(name, &error)),
        };
        Ok(Self { name: name.to_owned(), line })
    }
}

fn failed(name: &str, error: &LineError) -> BusError {
    BusError::Failed { name: name.to_owned(), what: error.to_string() }
}

impl Wire for Line {
    fn send(&mut self, frame: &Frame) -> Result<bool, BusError> {
        self.line.send(frame).map(|()| true).map_err(|e| failed(&self.name, &e))
    }

    fn receive(&mut self) -> Result<Option<Frame>, BusError> {
        self.line.receive(Instant::now()).map_err(|e| failed(&self.name, &e))
    }
}

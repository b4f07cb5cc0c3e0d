//! A drive's image in an emulator: real Cortex-M code behind a serial line.

use std::path::Path;
use std::process::{Child, Command, Stdio};

use crate::slcan_line::{LineError, SlcanLine};

/// The emulator's program.
pub const PROGRAM: &str = "qemu-system-arm";

/// The board it plays: a Cortex-M4F.
pub const BOARD: [&str; 10] = [
    "-machine",
    "mps2-an386",
    "-display",
    "none",
    "-monitor",
    "none",
    "-serial",
    "stdio",
    "-semihosting-config",
    "enable=on,target=native",
];

/// A running image. It ends when this is dropped.
#[derive(Debug)]
pub struct Emulator {
    child: Child,
    /// The line to it.
    pub line: SlcanLine,
}

impl Emulator {
    /// Boots an image.
    ///
    /// # Errors
    /// The emulator is not there.
    pub fn boot(image: &Path) -> Result<Self, LineError> {
        let mut child = Command::new(PROGRAM)
            .args(BOARD)
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(LineError::Open)?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            let _ = child.kill();
            return Err(LineError::Broken);
        };
        Ok(Self { child, line: SlcanLine::new(input, output) })
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // One that has ended by itself needs no killing.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

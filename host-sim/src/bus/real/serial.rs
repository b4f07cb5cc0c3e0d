//! SLCAN over a serial line.

use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, channel, sync_channel};
use std::time::Instant;

use protocol::bus::{Frame, FrameSize};

use super::BusError;
use super::wire::{Handed, Heard, Port};
use crate::serial_port;
use crate::slcan_line::{LineError, SlcanLine};

/// Lines that wait to be written at most.
const WAITING: usize = 16;

/// A serial line.
pub(super) struct SerialPort {
    name: String,
    path: PathBuf,
    size: FrameSize,
    ends: Ends,
    malformed: u64,
}

impl fmt::Debug for SerialPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SerialPort").field("name", &self.name).finish_non_exhaustive()
    }
}

/// The two directions of a line.
struct Ends {
    line: SlcanLine,
    /// When lines have been written.
    written: Receiver<Instant>,
    /// Frames that are being written.
    writing: std::collections::VecDeque<Frame>,
}

impl Ends {
    fn open(path: &Path, size: FrameSize) -> Result<Self, LineError> {
        let (output, mut input) = serial_port::open(path).map_err(LineError::Open)?;
        // Commands first, so that everything behind them is a frame.
        let commands = SlcanLine::opening(size);
        input.write_all(commands).and_then(|()| input.flush()).map_err(LineError::Open)?;
        Ok(Self::over(input, output))
    }

    /// Writing takes its time, and a thread of its own.
    fn over(mut input: impl Write + Send + 'static, output: impl io::Read + Send + 'static) -> Self {
        let (to, lines) = sync_channel::<Vec<u8>>(2 * WAITING);
        let (tell, written) = channel();
        std::thread::spawn(move || {
            while let Ok(line) = lines.recv()
                && input.write_all(&line).and_then(|()| input.flush()).is_ok()
                && tell.send(Instant::now()).is_ok()
            {}
        });
        Self { line: SlcanLine::new(Spool(to), output), written, writing: Default::default() }
    }
}

/// Passes lines on to the thread that writes them.
struct Spool(SyncSender<Vec<u8>>);

impl Write for Spool {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.0.try_send(bytes.to_vec()) {
            Ok(()) => Ok(bytes.len()),
            Err(TrySendError::Full(_)) => Err(io::ErrorKind::WouldBlock.into()),
            Err(TrySendError::Disconnected(_)) => Err(io::ErrorKind::BrokenPipe.into()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl SerialPort {
    /// Opens the line at `path`, which the bus is called after.
    pub(super) fn open(name: &str, path: &Path, size: FrameSize) -> Result<Self, BusError> {
        let ends =
            Ends::open(path, size).map_err(|source| BusError::Line { bus: name.to_owned(), source })?;
        Ok(Self { name: name.to_owned(), path: path.to_path_buf(), size, ends, malformed: 0 })
    }

    /// A line that is open already.
    #[cfg(test)]
    pub(super) fn over(
        input: impl Write + Send + 'static,
        output: impl io::Read + Send + 'static,
        size: FrameSize,
    ) -> Self {
        let ends = Ends::over(input, output);
        Self { name: "slcan:test".into(), path: PathBuf::new(), size, ends, malformed: 0 }
    }

    fn lost(&self, source: LineError) -> BusError {
        BusError::Line { bus: self.name.clone(), source }
    }
}

impl Port for SerialPort {
    fn send(&mut self, frame: &Frame) -> Result<Handed, BusError> {
        if frame.data().len() > self.size.bytes() {
            return Ok(Handed::Impossible);
        }
        if self.ends.writing.len() >= WAITING {
            return Ok(Handed::Full);
        }
        self.ends.line.send(frame).map_err(|error| self.lost(error))?;
        self.ends.writing.push_back(*frame);
        Ok(Handed::Taken)
    }

    fn receive(&mut self) -> Result<Option<Heard>, BusError> {
        match self.ends.written.try_recv() {
            Ok(when) => {
                if let Some(frame) = self.ends.writing.pop_front() {
                    return Ok(Some(Heard::Frame(when, frame)));
                }
            }
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return Err(self.lost(LineError::Broken)),
        }
        match self.ends.line.receive_stamped(Instant::now()) {
            Ok(Some((when, frame))) => Ok(Some(Heard::Frame(when, frame))),
            Ok(None) if self.ends.line.malformed() > self.malformed => {
                self.malformed += 1;
                Ok(Some(Heard::Error))
            }
            Ok(None) => Ok(None),
            Err(error) => Err(self.lost(error)),
        }
    }

    fn reopen(&mut self) -> bool {
        match Ends::open(&self.path, self.size) {
            Ok(ends) => {
                (self.ends, self.malformed) = (ends, 0);
                true
            }
            Err(_) => false,
        }
    }

    fn overruns(&self) -> u64 {
        0
    }
}

#[cfg(all(test, unix))]
#[allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]
mod tests;

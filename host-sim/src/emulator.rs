//! A drive's image in an emulator: real Cortex-M code behind a serial line that carries frames as text (SLCAN).

use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use protocol::bus::slcan::{self, LINE_BYTES, Line, Reader};
use protocol::bus::{BLOCK_BYTES, Frame, FrameSize, Node, Reassembler, Segments, ids};
use protocol::message::{DriveMessage, HostMessage, Identity, MessageBuffer, decode, encode};

/// The emulator's program.
pub const PROGRAM: &str = "qemu-system-arm";

/// The board it plays: a Cortex-M4F.
const BOARD: [&str; 10] = [
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

/// How often the question is asked again while nobody answers.
const AGAIN: Duration = Duration::from_millis(200);

/// Why an emulated drive does not answer.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// The program is not there, or cannot be started.
    #[error("{PROGRAM} does not start: {0}")]
    Start(std::io::Error),
    /// The line is broken: the emulator has ended.
    #[error("the emulator has ended")]
    Ended,
    /// Nothing that could be understood came in time.
    #[error("the drive does not answer")]
    Silent,
}

/// A running image. It ends when this is dropped.
#[derive(Debug)]
pub struct Emulator {
    child: Child,
    input: ChildStdin,
    output: Receiver<Vec<u8>>,
    reader: Reader,
    frames: std::collections::VecDeque<Frame>,
}

impl Emulator {
    /// Boots an image.
    ///
    /// # Errors
    /// The emulator is not there.
    pub fn boot(image: &Path) -> Result<Self, EmulatorError> {
        let mut child = Command::new(PROGRAM)
            .args(BOARD)
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(EmulatorError::Start)?;
        let (Some(input), Some(mut from)) = (child.stdin.take(), child.stdout.take()) else {
            let _ = child.kill();
            return Err(EmulatorError::Ended);
        };
        let (to, output) = channel();
        std::thread::spawn(move || {
            let mut buffer = [0u8; 4096];
            while let Ok(count) = from.read(&mut buffer)
                && count > 0
                && to.send(buffer[..count].to_vec()).is_ok()
            {}
        });
        Ok(Self { child, input, output, reader: Reader::new(), frames: Default::default() })
    }

    /// Sends a frame.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn send(&mut self, frame: &Frame) -> Result<(), EmulatorError> {
        let mut buffer = [0u8; LINE_BYTES];
        let line = slcan::line(frame, &mut buffer);
        self.input.write_all(line).and_then(|()| self.input.flush()).map_err(|_| EmulatorError::Ended)
    }

    /// The next frame that comes before `until`.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn receive(&mut self, until: Instant) -> Result<Option<Frame>, EmulatorError> {
        loop {
            if let Some(frame) = self.frames.pop_front() {
                return Ok(Some(frame));
            }
            let bytes = match self.output.recv_timeout(until.saturating_duration_since(Instant::now())) {
                Ok(bytes) => bytes,
                Err(RecvTimeoutError::Timeout) => return Ok(None),
                Err(RecvTimeoutError::Disconnected) => return Err(EmulatorError::Ended),
            };
            for byte in bytes {
                if let Some(Line::Frame(frame)) = self.reader.push(byte) {
                    self.frames.push_back(frame);
                }
            }
        }
    }

    /// Asks the drive at `node` who it is.
    ///
    /// # Errors
    /// It does not say so within `patience`, or the emulator ends.
    pub fn identify(&mut self, node: Node, patience: Duration) -> Result<Identity, EmulatorError> {
        let mut buffer: MessageBuffer = [0; _];
        let question = encode(&HostMessage::Identify, &mut buffer).unwrap_or(&[]);
        let end = Instant::now() + patience;
        let mut incoming = Reassembler::<BLOCK_BYTES>::new();
        while Instant::now() < end {
            for frame in Segments::new(ids::BROADCAST, FrameSize::Classic, question).into_iter().flatten() {
                self.send(&frame)?;
            }
            let again = (Instant::now() + AGAIN).min(end);
            while let Some(frame) = self.receive(again)? {
                if Node::of_answer(frame.id()) != Some(node) {
                    continue;
                }
                let Ok(Some(bytes)) = incoming.push(frame.data()) else { continue };
                if let Ok(DriveMessage::Identity(identity)) = decode(bytes) {
                    return Ok(identity);
                }
            }
        }
        Err(EmulatorError::Silent)
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // One that has ended by itself needs no killing.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

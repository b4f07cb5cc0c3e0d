//! A bus behind a serial line that carries frames as text (SLCAN): an adapter, or an emulated drive.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use protocol::bus::slcan::{self, LINE_BYTES, Line, Reader};
use protocol::bus::{BLOCK_BYTES, Frame, FrameSize, Node, Reassembler, Segments, ids};
use protocol::message::{DriveMessage, HostMessage, Identity, MessageBuffer, decode, encode};

/// What opens an adapter at 1 Mbit/s: closed first, whatever it was before.
const OPEN: &[u8] = b"\rC\rS8\rO\r";

/// The same with 5 Mbit/s for the data of CAN FD.
const OPEN_FD: &[u8] = b"\rC\rS8\rY5\rO\r";

/// How often a question is asked again while nobody answers.
const AGAIN: Duration = Duration::from_millis(200);

/// Why nobody answers.
#[derive(Debug, thiserror::Error)]
pub enum LineError {
    /// The line cannot be opened.
    #[error("cannot open the line: {0}")]
    Open(std::io::Error),
    /// The line is broken: whoever was at the other end has gone.
    #[error("the line is broken")]
    Broken,
    /// Nothing that could be understood came in time.
    #[error("the drive does not answer")]
    Silent,
}

/// A serial line.
pub struct SlcanLine {
    input: Box<dyn Write + Send>,
    output: Receiver<(Instant, Vec<u8>)>,
    reader: Reader,
    frames: VecDeque<(Instant, Frame)>,
    malformed: u64,
}

impl std::fmt::Debug for SlcanLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SlcanLine").field("frames", &self.frames).finish_non_exhaustive()
    }
}

impl SlcanLine {
    /// A line that is written to `input` and read from `output`, which another thread does.
    pub fn new(input: impl Write + Send + 'static, mut output: impl Read + Send + 'static) -> Self {
        let (to, from) = channel();
        std::thread::spawn(move || {
            let mut buffer = [0u8; 4096];
            while let Ok(count) = output.read(&mut buffer)
                && count > 0
                && to.send((Instant::now(), buffer[..count].to_vec())).is_ok()
            {}
        });
        Self {
            input: Box::new(input),
            output: from,
            reader: Reader::new(),
            frames: VecDeque::new(),
            malformed: 0,
        }
    }

    /// Opens the adapter at a device file, for 1 Mbit/s.
    ///
    /// # Errors
    /// There is none, or it is somebody else's.
    pub fn adapter(device: &Path) -> Result<Self, LineError> {
        let (output, input) = crate::serial_port::open(device).map_err(LineError::Open)?;
        let mut line = Self::new(input, output);
        line.write(OPEN)?;
        Ok(line)
    }

    /// What opens an adapter for frames of a size.
    pub(crate) fn opening(size: FrameSize) -> &'static [u8] {
        match size {
            FrameSize::Classic => OPEN,
            FrameSize::Fd => OPEN_FD,
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), LineError> {
        self.input.write_all(bytes).and_then(|()| self.input.flush()).map_err(|_| LineError::Broken)
    }

    /// Sends a frame.
    ///
    /// # Errors
    /// The line is broken.
    pub fn send(&mut self, frame: &Frame) -> Result<(), LineError> {
        let mut buffer = [0u8; LINE_BYTES];
        let line = slcan::line(frame, &mut buffer);
        self.write(line)
    }

    /// The next frame that comes before `until`.
    ///
    /// # Errors
    /// The line is broken.
    pub fn receive(&mut self, until: Instant) -> Result<Option<Frame>, LineError> {
        Ok(self.receive_stamped(until)?.map(|(_, frame)| frame))
    }

    /// As [`SlcanLine::receive`], with the time at which its last byte was read.
    ///
    /// # Errors
    /// The line is broken.
    pub fn receive_stamped(&mut self, until: Instant) -> Result<Option<(Instant, Frame)>, LineError> {
        loop {
            if let Some(frame) = self.frames.pop_front() {
                return Ok(Some(frame));
            }
            let (read, bytes) =
                match self.output.recv_timeout(until.saturating_duration_since(Instant::now())) {
                    Ok(bytes) => bytes,
                    Err(RecvTimeoutError::Timeout) => return Ok(None),
                    Err(RecvTimeoutError::Disconnected) => return Err(LineError::Broken),
                };
            for byte in bytes {
                match self.reader.push(byte) {
                    Some(Line::Frame(frame)) => self.frames.push_back((read, frame)),
                    Some(Line::Malformed) => self.malformed += 1,
                    Some(Line::Empty | Line::Command(_)) | None => {}
                }
            }
        }
    }

    /// Lines that were neither a frame nor an answer.
    pub fn malformed(&self) -> u64 {
        self.malformed
    }

    /// Asks the drive at `node` who it is.
    ///
    /// # Errors
    /// It does not say so within `patience`, or the line breaks.
    pub fn identify(&mut self, node: Node, patience: Duration) -> Result<Identity, LineError> {
        let mut buffer: MessageBuffer = [0; _];
        let question = encode(&HostMessage::Identify, &mut buffer).unwrap_or(&[]);
        let end = Instant::now() + patience;
        let mut incoming = Reassembler::<BLOCK_BYTES>::new();
        while Instant::now() < end {
            for frame in Segments::new(ids::BROADCAST, FrameSize::Classic, 0, question).into_iter().flatten()
            {
                self.send(&frame)?;
            }
            let again = (Instant::now() + AGAIN).min(end);
            while let Some(frame) = self.receive(again)? {
                if Node::of_answer(frame.id()) != Some(node) {
                    continue;
                }
                let Ok(Some((_, bytes))) = incoming.push(frame.data()) else { continue };
                if let Ok(DriveMessage::Identity(identity)) = decode(bytes) {
                    return Ok(identity);
                }
            }
        }
        Err(LineError::Silent)
    }
}

#[cfg(all(test, unix))]
#[allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]
mod tests {
    use super::*;
    use std::os::unix::net::UnixStream;

    use firmware_core::axis::AxisConfig;
    use firmware_core::drive::{Drive, DriveConfig};
    use firmware_core::session::Watch;
    use protocol::table::Limits;

    /// The drive core behind one end of a line, as an image has it; garbage comes before its first answer.
    fn drive(node: Node, mut line: UnixStream) {
        let limits = Limits { velocity: 1e5, acceleration: 1e6, jerk: Some(1e8) };
        let axis = AxisConfig { status_ticks: 1, ..AxisConfig::new(node.number() - 1, 1_000_000, limits) };
        let config = DriveConfig {
            node,
            frames: FrameSize::Classic,
            axis,
            watch: Watch::new(1_000_000, 1),
            key: None,
        };
        let (mut a, mut b) = ([0; 512], [0; 1024]);
        let mut drive = Drive::new(config, &mut a, &mut b);
        let (mut reader, mut byte) = (Reader::new(), [0u8]);
        let _ = line.write_all(b"V1013\r\x07t1\rtzzzz\r");
        while let Ok(1) = line.read(&mut byte) {
            let Some(read) = reader.push(byte[0]) else { continue };
            if let Line::Frame(frame) = read {
                drive.receive(&frame, 0);
            }
            drive.tick();
            while let Some(frame) = drive.poll_transmit() {
                let _ = line.write_all(slcan::line(&frame, &mut [0; LINE_BYTES]));
            }
        }
    }

    fn line_to(node: u8) -> SlcanLine {
        let (here, there) = UnixStream::pair().unwrap();
        std::thread::spawn(move || drive(Node::new(node).unwrap(), there));
        SlcanLine::new(here.try_clone().unwrap(), here)
    }

    #[test]
    fn a_drive_says_who_it_is() {
        let identity = line_to(5).identify(Node::new(5).unwrap(), Duration::from_secs(20)).unwrap();
        assert_eq!((identity.axis, identity.tick_ns, identity.room), (4, 1_000_000, 480));
        assert_eq!(identity.schema, protocol::schema::HASH);
    }

    #[test]
    fn another_drive_does_not_answer_for_it() {
        let answer = line_to(5).identify(Node::new(6).unwrap(), Duration::from_millis(500));
        assert!(matches!(answer, Err(LineError::Silent)));
    }

    #[test]
    fn a_broken_line_and_a_missing_device_say_so() {
        let (here, there) = UnixStream::pair().unwrap();
        drop(there);
        let mut line = SlcanLine::new(here.try_clone().unwrap(), here);
        let answer = line.identify(Node::new(1).unwrap(), Duration::from_secs(5));
        assert!(matches!(answer, Err(LineError::Broken)));
        assert!(matches!(SlcanLine::adapter(Path::new("/does/not/exist")), Err(LineError::Open(_))));
    }
}

//! A CAN interface of Linux.

use std::io::ErrorKind;

use socketcan::{CanAnyFrame, CanFdFrame, CanFdSocket, CanFrame, EmbeddedFrame, Id, Socket as _, StandardId};

use super::super::{Frame, FrameSize};
use super::{BusError, Wire};

/// Errors of Linux: the transmit queue, ten frames by default, is full; the interface is down, or gone.
const ENOBUFS: i32 = 105;
const ENETDOWN: i32 = 100;
const ENODEV: i32 = 19;

pub(super) struct Socket {
    name: String,
    socket: CanFdSocket,
    size: FrameSize,
}

impl Socket {
    pub(super) fn open(name: &str, size: FrameSize) -> Result<Self, BusError> {
        let failed = |source| BusError::Open { name: name.to_owned(), source };
        let socket = CanFdSocket::open(name).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        Ok(Self { name: name.to_owned(), socket, size })
    }

    fn fault(&self, error: &std::io::Error) -> BusError {
        let name = self.name.clone();
        match error.raw_os_error() {
            Some(ENETDOWN) => BusError::Down(name),
            Some(ENODEV) => BusError::Failed { name, what: "the interface has gone".to_owned() },
            _ => BusError::Failed { name, what: error.to_string() },
        }
    }
}

fn waits(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
        || error.raw_os_error() == Some(ENOBUFS)
}

impl Wire for Socket {
    fn send(&mut self, frame: &Frame) -> Result<bool, BusError> {
        let unfit =
            || BusError::Failed { name: self.name.clone(), what: "a frame does not fit it".to_owned() };
        let id = StandardId::new(frame.id()).ok_or_else(unfit)?;
        let result = match self.size {
            FrameSize::Classic => {
                let frame: CanFrame = EmbeddedFrame::new(id, frame.data()).ok_or_else(unfit)?;
                self.socket.write_frame(&frame)
            }
            FrameSize::Fd => {
                let mut frame: CanFdFrame = EmbeddedFrame::new(id, frame.data()).ok_or_else(unfit)?;
                frame.set_brs(true);
                self.socket.write_frame(&frame)
            }
        };
        match result {
            Ok(()) => Ok(true),
            Err(error) if waits(&error) => Ok(false),
            Err(error) => Err(self.fault(&error)),
        }
    }

    fn receive(&mut self) -> Result<Option<Frame>, BusError> {
        loop {
            let (id, data) = match self.socket.read_frame() {
                Ok(CanAnyFrame::Normal(frame)) => (frame.id(), frame.data().to_vec()),
                Ok(CanAnyFrame::Fd(frame)) => (frame.id(), frame.data().to_vec()),
                // Nothing here is asked for by remote frames, and errors are the interface's to deal with.
                Ok(CanAnyFrame::Remote(_) | CanAnyFrame::Error(_)) => continue,
                Err(error) if waits(&error) => return Ok(None),
                Err(error) => return Err(self.fault(&error)),
            };
            if let Id::Standard(id) = id
                && let Some(frame) = Frame::new(id.as_raw(), &data)
            {
                return Ok(Some(frame));
            }
        }
    }
}

//! SocketCAN.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use protocol::bus::{Frame, FrameSize};
use socketcan::id::FdFlags;
use socketcan::{
    CanAnyFrame, CanDataFrame, CanFdFrame, CanFdSocket, EmbeddedFrame, Id, Socket, SocketOptions, StandardId,
};

use super::BusError;
use super::wall::Wall;
use super::wire::{Handed, Heard, Port};

/// Where Linux tells of its interfaces.
const INTERFACES: &str = "/sys/class/net";
/// The kind of CAN interfaces (ARPHRD_CAN).
const KIND: u32 = 280;
/// The interface is up (IFF_UP).
const UP: u32 = 1;
/// Largest frame of an interface that carries CAN FD (CANFD_MTU).
const FD_MTU: u32 = 72;
/// Room for frames that wait to be taken [bytes]; the system may grant less.
const ROOM: usize = 1 << 20;
/// An error frame tells that the controller has left the bus (CAN_ERR_BUSOFF).
const BUS_OFF: u32 = 0x40;
/// The socket's own account of its memory (SO_MEMINFO), and where it counts lost frames (SK_MEMINFO_DROPS).
const ACCOUNT: i32 = 55;
const LOST: usize = 8;

/// A raw CAN socket.
#[derive(Debug)]
pub(super) struct SocketPort {
    name: String,
    size: FrameSize,
    socket: CanFdSocket,
    wall: Wall,
    /// Lost by sockets before this one.
    overruns: u64,
}

impl SocketPort {
    /// Opens an interface that is up.
    pub(super) fn open(name: &str, size: FrameSize) -> Result<Self, BusError> {
        look_at(name, size)?;
        let refused = |source| BusError::Refused { bus: name.to_owned(), source };
        let socket = connect(name).map_err(refused)?;
        Ok(Self { name: name.to_owned(), size, socket, wall: Wall::new(), overruns: 0 })
    }

    /// What an error of the socket means; `None`: try again.
    fn explain(&self, error: io::Error) -> Option<BusError> {
        let bus = self.name.clone();
        match error.kind() {
            io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted => None,
            io::ErrorKind::NetworkDown => Some(BusError::Down { bus }),
            _ if matches!(error.raw_os_error(), Some(libc::ENODEV | libc::ENXIO)) => {
                Some(BusError::Missing { bus })
            }
            _ => Some(BusError::Refused { bus, source: error }),
        }
    }

    fn lost(&self) -> u64 {
        let mut account = [0u8; 36];
        match self.socket.get_socket_option_bytes(libc::SOL_SOCKET, ACCOUNT, &mut account) {
            Ok(length) if length > 4 * LOST => {
                account.as_chunks().0.get(LOST).map_or(0, |count| u64::from(u32::from_ne_bytes(*count)))
            }
            _ => 0,
        }
    }
}

/// What the system tells of an interface in one of its files, as a number.
fn figure(folder: &Path, file: &str) -> Option<u32> {
    let text = std::fs::read_to_string(folder.join(file)).ok()?;
    let text = text.trim();
    match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

/// Checks that an interface is there, up, and carries frames of a size.
fn look_at(name: &str, size: FrameSize) -> Result<(), BusError> {
    let bus = name.to_owned();
    let folder: PathBuf = Path::new(INTERFACES).join(name);
    if !folder.exists() {
        return Err(BusError::Missing { bus });
    }
    if figure(&folder, "type").is_some_and(|kind| kind != KIND) {
        return Err(BusError::NotCan { bus });
    }
    if figure(&folder, "flags").is_some_and(|flags| flags & UP == 0) {
        return Err(BusError::Down { bus });
    }
    match (size, figure(&folder, "mtu")) {
        (FrameSize::Fd, Some(mtu)) if mtu < FD_MTU => Err(BusError::Classic { bus, mtu }),
        _ => Ok(()),
    }
}

/// A socket that hears frames of either size, its own when they have been sent, and errors, each with its time.
fn connect(name: &str) -> io::Result<CanFdSocket> {
    let socket = CanFdSocket::open(name)?;
    socket.set_nonblocking(true)?;
    socket.set_recv_own_msgs(true)?;
    socket.set_error_filter_accept_all()?;
    socket.set_recv_timestamp(true)?;
    // With less room frames get lost sooner, which is counted.
    let _ = socket.as_raw_socket().set_recv_buffer_size(ROOM);
    Ok(socket)
}

impl Port for SocketPort {
    fn send(&mut self, frame: &Frame) -> Result<Handed, BusError> {
        let Some(id) = StandardId::new(frame.id()) else { return Ok(Handed::Impossible) };
        let sent = match self.size {
            FrameSize::Classic => match CanDataFrame::new(id, frame.data()) {
                Some(frame) => self.socket.write_frame(&frame),
                None => return Ok(Handed::Impossible),
            },
            FrameSize::Fd => match CanFdFrame::with_flags(id, frame.data(), FdFlags::BRS) {
                Some(frame) => self.socket.write_frame(&frame),
                None => return Ok(Handed::Impossible),
            },
        };
        match sent {
            Ok(()) => Ok(Handed::Taken),
            Err(error) if error.raw_os_error() == Some(libc::ENOBUFS) => Ok(Handed::Full),
            Err(error) => self.explain(error).map_or(Ok(Handed::Full), Err),
        }
    }

    fn receive(&mut self) -> Result<Option<Heard>, BusError> {
        let (frame, stamps) = match self.socket.read_frame_with_timestamps() {
            Ok(heard) => heard,
            Err(error) if error.kind() == io::ErrorKind::InvalidData => return Ok(Some(Heard::Foreign)),
            Err(error) => return self.explain(error).map_or(Ok(None), Err),
        };
        let data = match &frame {
            CanAnyFrame::Normal(frame) => frame.data(),
            CanAnyFrame::Fd(frame) => frame.data(),
            CanAnyFrame::Remote(_) => return Ok(Some(Heard::Foreign)),
            CanAnyFrame::Error(error) if error.error_bits() & BUS_OFF != 0 => {
                return Err(BusError::Off { bus: self.name.clone() });
            }
            CanAnyFrame::Error(_) => return Ok(Some(Heard::Error)),
        };
        let Id::Standard(id) = frame.id() else { return Ok(Some(Heard::Foreign)) };
        self.wall.look();
        let instant = stamps.socket.and_then(|stamp| self.wall.instant(stamp)).unwrap_or_else(Instant::now);
        let frame = Frame::new(id.as_raw(), data);
        Ok(Some(frame.map_or(Heard::Foreign, |frame| Heard::Frame(instant, frame))))
    }

    fn reopen(&mut self) -> bool {
        if look_at(&self.name, self.size).is_err() {
            return false;
        }
        let Ok(socket) = connect(&self.name) else { return false };
        self.overruns += self.lost();
        self.socket = socket;
        true
    }

    fn overruns(&self) -> u64 {
        self.overruns + self.lost()
    }
}

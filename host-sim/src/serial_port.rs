//! Serial lines by their path: device files, pseudo-terminals, sockets.

use std::io::{self, Read, Write};
use std::path::Path;

/// The two ends of a line: what is read, what is written.
pub type Ends = (Box<dyn Read + Send>, Box<dyn Write + Send>);

/// Opens a line; a terminal passes every byte as it is from then on.
///
/// # Errors
/// There is none, or it is somebody else's.
#[cfg(unix)]
pub fn open(path: &Path) -> io::Result<Ends> {
    use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
    use std::os::unix::net::UnixStream;

    use rustix::fs::OFlags;
    use rustix::termios::{OptionalActions, QueueSelector, isatty, tcflush, tcgetattr, tcsetattr};

    if path.metadata()?.file_type().is_socket() {
        let socket = UnixStream::connect(path)?;
        return Ok((Box::new(socket.try_clone()?), Box::new(socket)));
    }
    // The line must not become the terminal that rules this process.
    let flags = i32::try_from(OFlags::NOCTTY.bits()).unwrap_or(0);
    let line = std::fs::OpenOptions::new().read(true).write(true).custom_flags(flags).open(path)?;
    if isatty(&line) {
        let mut settings = tcgetattr(&line)?;
        settings.make_raw();
        tcsetattr(&line, OptionalActions::Now, &settings)?;
        // What came before is not meant for whoever opens the line now.
        tcflush(&line, QueueSelector::IFlush)?;
    }
    Ok((Box::new(line.try_clone()?), Box::new(line)))
}

/// Opens a line, which has to be set up already.
///
/// # Errors
/// There is none, or it is somebody else's.
#[cfg(not(unix))]
pub fn open(path: &Path) -> io::Result<Ends> {
    let line = std::fs::OpenOptions::new().read(true).write(true).open(path)?;
    Ok((Box::new(line.try_clone()?), Box::new(line)))
}

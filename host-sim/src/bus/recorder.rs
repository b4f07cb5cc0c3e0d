//! A log of everything that crosses the bus.

use std::io::{self, Write};

use super::{Bus, Frame, FrameSize, Nanoseconds, NodeIndex, Received, Traffic};

/// FD frames switch to the faster bit rate: the flag digit of can-utils' `##` notation.
const BIT_RATE_SWITCH: u8 = 1;

/// Listens as one more node and writes every frame as a line of a candump log (can-utils).
#[derive(Debug)]
pub struct Recorder<B, W> {
    inner: B,
    tap: NodeIndex,
    interface: String,
    format: FrameSize,
    out: W,
    failure: Option<io::Error>,
}

impl<B: Bus, W: Write> Recorder<B, W> {
    /// Records `inner`, which carries frames of one format, under an interface name such as `can0`.
    pub fn new(mut inner: B, format: FrameSize, interface: &str, out: W) -> Self {
        let tap = inner.attach();
        Self { inner, tap, interface: interface.to_owned(), format, out, failure: None }
    }

    /// Ends the log.
    ///
    /// # Errors
    /// The first error met while writing.
    pub fn finish(mut self) -> io::Result<W> {
        match self.failure.take() {
            Some(error) => Err(error),
            None => self.out.flush().map(|()| self.out),
        }
    }

    fn log(&mut self, received: &Received) -> io::Result<()> {
        let (seconds, micros) = (received.time / 1_000_000_000, received.time / 1000 % 1_000_000);
        let frame = &received.frame;
        write!(self.out, "({seconds}.{micros:06}) {} {:03X}#", self.interface, frame.id())?;
        if self.format == FrameSize::Fd {
            write!(self.out, "#{BIT_RATE_SWITCH}")?;
        }
        for byte in frame.data() {
            write!(self.out, "{byte:02X}")?;
        }
        writeln!(self.out)
    }
}

impl<B: Bus, W: Write> Bus for Recorder<B, W> {
    fn attach(&mut self) -> NodeIndex {
        self.inner.attach()
    }

    fn send(&mut self, node: NodeIndex, frame: Frame, now: Nanoseconds) {
        self.inner.send(node, frame, now);
    }

    fn has_room(&self, node: NodeIndex) -> bool {
        self.inner.has_room(node)
    }

    fn advance(&mut self, until: Nanoseconds) {
        self.inner.advance(until);
        while let Some(received) = self.inner.receive(self.tap) {
            if self.failure.is_none() {
                self.failure = self.log(&received).err();
            }
        }
    }

    fn receive(&mut self, node: NodeIndex) -> Option<Received> {
        self.inner.receive(node)
    }

    fn sent(&mut self, node: NodeIndex) -> Option<Received> {
        self.inner.sent(node)
    }

    fn waiting(&self, node: NodeIndex) -> usize {
        self.inner.waiting(node)
    }

    fn traffic(&self) -> Traffic {
        self.inner.traffic()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::{BitTiming, InProcessBus};

    fn log(format: FrameSize, data: &[u8]) -> String {
        let timing = BitTiming { format, ..BitTiming::default() };
        let mut bus = Recorder::new(InProcessBus::new(timing), format, "can0", Vec::new());
        let [a, b] = [bus.attach(), bus.attach()];
        bus.send(a, Frame::new(0x7f, data).unwrap(), 12_000_000_000);
        bus.advance(13_000_000_000);
        assert_eq!(bus.receive(b).map(|r| r.frame.id()), Some(0x7f));
        String::from_utf8(bus.finish().unwrap()).unwrap()
    }

    #[test]
    fn lines_are_those_of_candump() {
        assert_eq!(log(FrameSize::Classic, &[0xde, 0xad]), "(12.000075) can0 07F#DEAD\n");
        let fd = log(FrameSize::Fd, &[1; 9]);
        assert!(fd.ends_with(" can0 07F##1010101010101010101000000\n"), "{fd}");
    }
}

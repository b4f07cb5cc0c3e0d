//! A drive that is led tick by tick over the serial port: for a host that lets several of them and a bus go on in virtual time.
#![no_std]
#![no_main]

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::entry;
use emulated::steps::{self, CONFIG_BYTES, HEAD_BYTES};
use emulated::uart::Uart;
use firmware_core::halves::Between;
use protocol::bus::{Frame, FrameSize};

/// Room for one table; there are two [bytes].
const ROOM: usize = 64 * 1024;

/// The interrupt of the port's receiver on this board.
#[derive(Clone, Copy)]
struct Receive;

// SAFETY: the board has this one.
unsafe impl InterruptNumber for Receive {
    fn number(self) -> u16 {
        0
    }
}

/// The line to the host.
struct Line(Uart);

impl Line {
    /// The next byte; the core sleeps until it comes. Interrupts are masked: one that is pending ends the sleep all the same.
    fn byte(&mut self) -> u8 {
        loop {
            if let Some(byte) = self.0.read() {
                return byte;
            }
            cortex_m::asm::wfi();
            self.0.acknowledge();
            NVIC::unpend(Receive);
        }
    }

    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.iter_mut().for_each(|place| *place = self.byte());
        bytes
    }

    fn say(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.0.write(*byte));
    }

    /// A frame, and when it has crossed.
    fn frame(&mut self) -> Option<(u32, Frame)> {
        let (ns, id, length) = steps::head(&self.bytes::<HEAD_BYTES>());
        let mut data = [0; FrameSize::Fd.bytes()];
        let data = data.get_mut(..usize::from(length))?;
        data.iter_mut().for_each(|place| *place = self.byte());
        Some((ns, Frame::new(id, data)?))
    }
}

#[entry]
fn main() -> ! {
    static mut A: [u8; ROOM] = [0; ROOM];
    static mut B: [u8; ROOM] = [0; ROOM];
    static mut BETWEEN: Between<'static> = Between::new();
    // SAFETY: the only one.
    let mut line = Line(unsafe { Uart::new() });
    cortex_m::interrupt::disable();
    line.0.raise_on_receive();
    // SAFETY: nothing is interrupted, since interrupts are masked.
    unsafe { NVIC::unmask(Receive) };
    let config = loop {
        if line.byte() == steps::CONFIG
            && let Some(config) = steps::config(&line.bytes::<CONFIG_BYTES>())
        {
            break config;
        }
    };
    let (mut talk, mut moves) = BETWEEN.drive(config, A, B);
    loop {
        match line.byte() {
            steps::SENT => {
                if let Some((ns, frame)) = line.frame() {
                    talk.sent(&frame, ns);
                }
            }
            steps::RECEIVED => {
                if let Some((ns, frame)) = line.frame() {
                    talk.receive(&frame, ns);
                }
            }
            steps::TICK => {
                let s = moves.tick();
                line.say(&[steps::SETPOINT]);
                line.say(&steps::setpoint_bytes(s.position, s.velocity, s.acceleration, s.done));
                while let Some(frame) = talk.poll_transmit() {
                    line.say(&[steps::FRAME]);
                    line.say(&steps::head_bytes(0, frame.id(), frame.data().len() as u8));
                    line.say(frame.data());
                }
                line.say(&[steps::END]);
            }
            _ => {}
        }
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        cortex_m::asm::bkpt();
    }
}

//! A drive: frames come and go as SLCAN lines over the serial port, the control tick is an interrupt.
#![no_std]
#![no_main]

use core::cell::RefCell;

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::{entry, exception};
use critical_section::Mutex;
use emulated::CLOCK_HZ;
use emulated::uart::Uart;
use firmware_core::drive::{Drive, DriveConfig};
use firmware_core::player::AxisConfig;
use protocol::bus::slcan::{self, LINE_BYTES, Line, Reader};
use protocol::bus::{FrameSize, Node};
use protocol::table::Limits;

/// Control tick [ns].
const TICK_NS: u32 = 1_000_000;
/// Room for one table; there are two [bytes].
const ROOM: usize = 64 * 1024;
/// Address on the bus; the axis is the one before it.
const NODE: u8 = match option_env!("FEEDSPLINE_NODE") {
    Some(digits) => match u8::from_str_radix(digits, 10) {
        Ok(number) => number,
        Err(_) => 0,
    },
    None => 1,
};

const CONFIG: DriveConfig = {
    let Some(node) = Node::new(NODE) else { panic!("FEEDSPLINE_NODE is a number from 1 to 127") };
    DriveConfig {
        node,
        frames: FrameSize::Classic,
        axis: AxisConfig {
            axis: NODE - 1,
            tick_ns: TICK_NS,
            position: 0,
            limits: Limits { velocity: 1e9, acceleration: 1e11, jerk: None },
            travel: None,
            status_ticks: 100,
        },
    }
};

/// The drive, shared by the control interrupt and the serial port.
static DRIVE: Mutex<RefCell<Option<Drive<'static>>>> = Mutex::new(RefCell::new(None));

#[entry]
fn main() -> ! {
    static mut A: [u8; ROOM] = [0; ROOM];
    static mut B: [u8; ROOM] = [0; ROOM];
    let drive = Drive::new(CONFIG, A, B);
    critical_section::with(|cs| {
        if let Ok(mut place) = DRIVE.borrow(cs).try_borrow_mut() {
            *place = Some(drive);
        }
    });
    if let Some(core) = cortex_m::Peripherals::take() {
        let mut timer = core.SYST;
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(CLOCK_HZ / 1_000_000 * (TICK_NS / 1_000) - 1);
        timer.clear_current();
        timer.enable_counter();
        timer.enable_interrupt();
    }
    // SAFETY: the only one.
    let mut uart = unsafe { Uart::new() };
    let mut reader = Reader::new();
    let mut text = [0u8; LINE_BYTES];
    loop {
        if let Some(line) = uart.read().and_then(|byte| reader.push(byte)) {
            match line {
                Line::Frame(frame) => {
                    with_drive(|drive| drive.receive(&frame));
                }
                // Opening, closing and the bit rate of an adapter mean nothing here, and are granted.
                Line::Command(_) => uart.write(b'\r'),
                Line::Empty => {}
                Line::Malformed => uart.write(0x07),
            }
        }
        let frame = with_drive(Drive::poll_transmit).flatten();
        if let Some(frame) = frame {
            slcan::line(&frame, &mut text).iter().for_each(|byte| uart.write(*byte));
        }
    }
}

/// The control tick. A power stage would take the set-point from here.
#[exception]
fn SysTick() {
    let _ = with_drive(Drive::tick);
}

/// Does something to the drive while nobody else can.
fn with_drive<R>(act: impl FnOnce(&mut Drive<'static>) -> R) -> Option<R> {
    critical_section::with(|cs| DRIVE.borrow(cs).try_borrow_mut().ok()?.as_mut().map(act))
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        cortex_m::asm::bkpt();
    }
}

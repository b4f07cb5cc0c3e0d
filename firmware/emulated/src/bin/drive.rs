//! A drive: frames come and go as SLCAN lines over the serial port, the control tick is an interrupt.
#![no_std]
#![no_main]

use core::cell::Cell;
use core::mem::MaybeUninit;

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::{entry, exception};
use critical_section::Mutex;
use emulated::CLOCK_HZ;
use emulated::images::Images;
use emulated::uart::Uart;
use firmware_core::axis::AxisConfig;
use firmware_core::drive::DriveConfig;
use firmware_core::halves::{Between, Move};
use firmware_core::session::Watch;
use protocol::authentic::Key;
use protocol::bus::slcan::{self, LINE_BYTES, Line, Reader};
use protocol::bus::{FrameSize, Node};
use protocol::table::Limits;

/// Control tick [ns].
const TICK_NS: u32 = 1_000_000;
/// Room for one table; there are two [bytes].
const ROOM: usize = 64 * 1024;
/// Between two beats [ticks].
const STATUS_TICKS: u32 = 100;
/// Address on the bus; the axis is the one before it.
const NODE: u8 = match option_env!("FEEDSPLINE_NODE") {
    Some(digits) => match u8::from_str_radix(digits, 10) {
        Ok(number) => number,
        Err(_) => 0,
    },
    None => 1,
};

/// A number that every start-up finds one further: memory that no start-up clears, and that holds anything after power-up.
#[unsafe(link_section = ".uninit.boot")]
static mut BOOT: MaybeUninit<u32> = MaybeUninit::uninit();

const CONFIG: DriveConfig = {
    let Some(node) = Node::new(NODE) else { panic!("FEEDSPLINE_NODE is a number from 1 to 127") };
    DriveConfig {
        node,
        frames: FrameSize::Classic,
        axis: AxisConfig {
            status_ticks: STATUS_TICKS,
            ..AxisConfig::new(NODE - 1, TICK_NS, Limits { velocity: 1e9, acceleration: 1e11, jerk: None })
        },
        watch: Watch::new(TICK_NS, STATUS_TICKS),
        key: match option_env!("FEEDSPLINE_KEY") {
            Some(digits) => match Key::from_hex(digits.as_bytes()) {
                Some(key) => Some(key),
                None => panic!("FEEDSPLINE_KEY is a key of 32 hexadecimal digits"),
            },
            None => None,
        },
    }
};

/// The half that moves, on its way from [`main`] to the control interrupt.
static MOVES: Mutex<Cell<Option<&'static mut Move<'static, 'static>>>> = Mutex::new(Cell::new(None));

#[entry]
fn main() -> ! {
    static mut A: [u8; ROOM] = [0; ROOM];
    static mut B: [u8; ROOM] = [0; ROOM];
    static mut BETWEEN: Between<'static> = Between::new();
    static mut IMAGES: Option<Images> = None;
    static mut PLACE: Option<Move<'static, 'static>> = None;
    let mut config = CONFIG;
    // SAFETY: nobody else names it, and any bits are a number.
    config.watch.boot = unsafe { next_boot(&raw mut BOOT) };
    // SAFETY: the only ones.
    let images = IMAGES.insert(unsafe { Images::start() });
    let (talk, moves) = BETWEEN.drive(config, A, B);
    let mut talk = talk.with_images(images);
    critical_section::with(|cs| MOVES.borrow(cs).set(Some(PLACE.insert(moves))));
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
                Line::Frame(frame) => talk.receive(&frame, phase_ns()),
                // Opening, closing and the bit rate of an adapter mean nothing here, and are granted.
                Line::Command(_) => uart.write(b'\r'),
                Line::Empty => {}
                Line::Malformed => uart.write(0x07),
            }
        }
        if let Some(frame) = talk.poll_transmit() {
            slcan::line(&frame, &mut text).iter().for_each(|byte| uart.write(*byte));
            talk.sent(&frame, phase_ns());
        } else if talk.wants_restart() {
            cortex_m::peripheral::SCB::sys_reset();
        }
    }
}

/// Since the present tick began [ns]. The emulated timer counts down at a fixed rate, which is not trimmed: what stamps are
/// worth on this board is told by the emulator's own clock, not by a crystal.
fn phase_ns() -> u32 {
    let reload = CLOCK_HZ / 1_000_000 * (TICK_NS / 1_000) - 1;
    reload.saturating_sub(cortex_m::peripheral::SYST::get_current()) * (1_000_000_000 / CLOCK_HZ)
}

/// One more than last time.
///
/// # Safety
/// Nobody else uses the place meanwhile.
unsafe fn next_boot(place: *mut MaybeUninit<u32>) -> u32 {
    // SAFETY: the caller's; a volatile read makes some number of whatever the memory holds.
    unsafe {
        let place = place.cast::<u32>();
        let boot = place.read_volatile().wrapping_add(1);
        place.write_volatile(boot);
        boot
    }
}

/// The control tick. A power stage would take the set-point from here.
#[exception]
fn SysTick() {
    static mut HERE: Option<&'static mut Move<'static, 'static>> = None;
    if HERE.is_none() {
        *HERE = critical_section::with(|cs| MOVES.borrow(cs).take());
    }
    if let Some(moves) = HERE {
        let _ = moves.tick();
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        cortex_m::asm::bkpt();
    }
}

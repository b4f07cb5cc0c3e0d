//! A drive on an STM32G474, such as on a NUCLEO-G474RE with a CAN transceiver at PA11 and PA12.
//!
//! Frames come and go through FDCAN1 at 1 Mbit/s; the control tick is the core's own timer, whose interrupt runs above all
//! communication. Nobody has run this on hardware yet: it is built and linked, and the core in it is the one that the emulated
//! board runs. The power stage is up to whoever has one: see [`apply`].
#![no_std]
#![no_main]

use core::cell::Cell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicI32, Ordering};

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;
use critical_section::Mutex;
use embassy_executor::Spawner;
use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_stm32::can::config::TxBufferMode;
use embassy_stm32::can::{CanConfigurator, IT0InterruptHandler, IT1InterruptHandler};
use embassy_stm32::peripherals::FDCAN1;
use embassy_stm32::rcc::{Hse, HseMode, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, bind_interrupts, can};
use firmware_core::axis::AxisConfig;
use firmware_core::clock::Reload;
use firmware_core::drive::DriveConfig;
use firmware_core::evaluate::Setpoint;
use firmware_core::halves::{Between, Move};
use firmware_core::session::Watch;
use protocol::authentic::Key;
use protocol::bus::{Frame, FrameSize, Node};
use protocol::table::Limits;

/// The core's clock: the 24 MHz of the board's crystal, divided by 6, times 85, divided by 2 [Hz].
const CLOCK_HZ: u32 = 170_000_000;
/// Nominal bit rate, and that of the data of CAN FD frames.
const BIT_RATE: u32 = 1_000_000;
#[cfg(feature = "fd")]
const DATA_BIT_RATE: u32 = 2_000_000;
/// Control tick [ns].
const TICK_NS: u32 = 250_000;
/// Room for one table; there are two [bytes].
const ROOM: usize = 40 * 1024;
/// Between two beats [ticks].
const STATUS_TICKS: u32 = 80;
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
        frames: if cfg!(feature = "fd") { FrameSize::Fd } else { FrameSize::Classic },
        axis: AxisConfig {
            status_ticks: STATUS_TICKS,
            // Limits are those of the motor and the slide: set them before anything moves, and the travel.
            ..AxisConfig::new(
                NODE - 1,
                TICK_NS,
                Limits { velocity: 1e6, acceleration: 1e8, jerk: Some(1e10) },
            )
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

bind_interrupts!(struct Irqs {
    FDCAN1_IT0 => IT0InterruptHandler<FDCAN1>;
    FDCAN1_IT1 => IT1InterruptHandler<FDCAN1>;
});

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    static mut A: [u8; ROOM] = [0; ROOM];
    static mut B: [u8; ROOM] = [0; ROOM];
    static mut BETWEEN: Between<'static> = Between::new();
    static mut PLACE: Option<Move<'static, 'static>> = None;
    // SAFETY: this runs once, and nobody else names the four.
    let (a, b, between, place) =
        unsafe { (&mut *(&raw mut A), &mut *(&raw mut B), &mut *(&raw mut BETWEEN), &mut *(&raw mut PLACE)) };
    let peripherals = embassy_stm32::init(clocks());
    let mut config = CONFIG;
    // SAFETY: this runs once, nobody else names it, and a volatile read makes some number of whatever the memory holds.
    config.watch.boot = unsafe {
        let place = (&raw mut BOOT).cast::<u32>();
        let boot = place.read_volatile().wrapping_add(1);
        place.write_volatile(boot);
        boot
    };
    let (mut talk, moves) = between.drive(config, a, b);
    critical_section::with(|cs| MOVES.borrow(cs).set(Some(place.insert(moves))));
    if let Some(core) = cortex_m::Peripherals::take() {
        let mut timer = core.SYST;
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(TICK_COUNTS - 1);
        timer.clear_current();
        timer.enable_counter();
        timer.enable_interrupt();
    }
    let mut bus = CanConfigurator::new(peripherals.FDCAN1, peripherals.PA11, peripherals.PA12, Irqs);
    bus.set_bitrate(BIT_RATE);
    #[cfg(feature = "fd")]
    bus.set_fd_data_bitrate(DATA_BIT_RATE, true);
    // Frames of one block keep their order.
    bus.set_config(bus.config().set_tx_buffer_mode(TxBufferMode::Fifo));
    let (mut out, mut into, _) = bus.into_normal_mode().split();
    loop {
        if let Either::First(Some(frame)) = select(receive(&mut into), yield_now()).await {
            talk.receive(&frame, phase_ns());
        }
        if let Some(frame) = talk.poll_transmit() {
            send(&mut out, &frame).await;
            talk.sent(&frame, phase_ns());
        }
        TRIM_PPB.store(talk.trim_ppb(), Ordering::Relaxed);
    }
}

/// Counts of the core's timer in a control tick.
const TICK_COUNTS: u32 = CLOCK_HZ / 1_000_000 * (TICK_NS / 1_000);

/// By how much ticks are to be shorter [1e-9]: from the half that talks to the control interrupt.
static TRIM_PPB: AtomicI32 = AtomicI32::new(0);

/// Since the present tick began [ns].
///
/// Frames are stamped when this loop takes them up, some microseconds late; the controller's own time stamps would do better.
fn phase_ns() -> u32 {
    let counts = TICK_COUNTS.saturating_sub(1).saturating_sub(cortex_m::peripheral::SYST::get_current());
    (u64::from(counts) * 1_000_000_000 / u64::from(CLOCK_HZ)) as u32
}

/// The next data frame with a short identifier. The bus' errors are the controller's to count and to recover from.
#[cfg(not(feature = "fd"))]
async fn receive(bus: &mut can::CanRx<'static>) -> Option<Frame> {
    let (frame, _) = bus.read().await.ok()?.parts();
    short(frame.id()).and_then(|id| Frame::new(id, frame.data()))
}

#[cfg(feature = "fd")]
async fn receive(bus: &mut can::CanRx<'static>) -> Option<Frame> {
    let (frame, _) = bus.read_fd().await.ok()?.parts();
    short(frame.id()).and_then(|id| Frame::new(id, frame.data()))
}

#[cfg(not(feature = "fd"))]
async fn send(bus: &mut can::CanTx<'static>, frame: &Frame) {
    if let Ok(frame) = can::frame::Frame::new_standard(frame.id(), frame.data()) {
        bus.write(&frame).await;
    }
}

#[cfg(feature = "fd")]
async fn send(bus: &mut can::CanTx<'static>, frame: &Frame) {
    if let Ok(frame) = can::frame::FdFrame::new_standard(frame.id(), frame.data()) {
        bus.write_fd(&frame).await;
    }
}

fn short(id: &embedded_can::Id) -> Option<u16> {
    match id {
        embedded_can::Id::Standard(id) => Some(id.as_raw()),
        embedded_can::Id::Extended(_) => None,
    }
}

/// 170 MHz from the board's 24 MHz crystal, which also feeds the bus: the chip's own oscillator is too coarse for it.
fn clocks() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz(24_000_000), mode: HseMode::Oscillator });
    config.rcc.pll = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV6,
        mul: PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV2),
    });
    config.rcc.sys = Sysclk::PLL1_R;
    config.rcc.boost = true;
    config.rcc.mux.fdcansel = embassy_stm32::rcc::mux::Fdcansel::HSE;
    config
}

/// The control tick.
#[exception]
fn SysTick() {
    static mut HERE: Option<&'static mut Move<'static, 'static>> = None;
    static mut RELOAD: Reload = Reload::new(TICK_COUNTS);
    // It counts for the tick behind the next one.
    let counts = RELOAD.next(TRIM_PPB.load(Ordering::Relaxed));
    // SAFETY: a write to the reload register, which nobody else writes any more.
    unsafe { (*cortex_m::peripheral::SYST::PTR).rvr.write(counts - 1) };
    if HERE.is_none() {
        *HERE = critical_section::with(|cs| MOVES.borrow(cs).take());
    }
    if let Some(moves) = HERE {
        let setpoint = moves.tick();
        apply(setpoint, moves.motion().power().has_torque());
    }
}

/// Hands a set-point to the servo: whoever has a power stage closes the position loop here, and switches the stage.
fn apply(setpoint: Setpoint, torque: bool) {
    let _ = (setpoint, torque);
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    // The watchdog of a machine's own supply is what ends this; motion has stopped with the control tick.
    cortex_m::interrupt::disable();
    loop {
        cortex_m::asm::nop();
    }
}

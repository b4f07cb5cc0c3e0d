//! Plays the tables it carries and plans random motions, and tells over semihosting what came out and what it cost.
//!
//! Under QEMU's `-icount shift=10` every instruction takes 1024 ns of SysTick's time.
#![no_std]
#![no_main]

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use emulated::stack::Painted;
use emulated::workload::{Work, drive, evaluate, plan_moves};
use firmware_core::player::Player;

/// Tables of real jobs.
static TABLES: &[u8] = include_bytes!(env!("FEEDSPLINE_TABLES"));

/// Random motions.
const MOVES: u32 = 100_000;

/// SysTick counts 25 in 1024 ns and 40 000: a tenth of an instruction is 2.56 of them.
const COUNTS_PER_10: u32 = 256;

/// Largest and sum of what something costs [SysTick counts].
#[derive(Default)]
struct Cost {
    most: u32,
    sum: u64,
    times: u64,
}

impl Cost {
    fn note(&mut self, counts: u32) {
        self.most = self.most.max(counts);
        self.sum += u64::from(counts);
        self.times += 1;
    }

    fn most(&self) -> u32 {
        self.most * 10 / COUNTS_PER_10
    }

    fn mean(&self) -> u32 {
        (self.sum * 10 / u64::from(COUNTS_PER_10) / self.times.max(1)) as u32
    }
}

/// SysTick counts that `work` takes, and what it was; the timer counts down 24 bits.
#[inline(never)]
fn counted(work: &mut dyn FnMut() -> Work) -> (Work, u32) {
    let before = SYST::get_current();
    let what = work();
    (what, before.wrapping_sub(SYST::get_current()) & 0x00ff_ffff)
}

/// Names of what is counted.
const NAMES: [&str; 8] =
    ["prove_per_span", "evaluate", "span", "tick", "tick_end", "tick_override", "tick_fallback", "plan"];

fn place(work: Work) -> usize {
    match work {
        Work::Proof(_) => 0,
        Work::Evaluate => 1,
        Work::Span => 2,
        Work::Tick => 3,
        Work::End => 4,
        Work::Override => 5,
        Work::Fallback => 6,
        Work::Plan => 7,
    }
}

/// Room for one table [bytes].
const ROOM: usize = 64 * 1024;

#[entry]
fn main() -> ! {
    static mut A: [u8; ROOM] = [0; ROOM];
    static mut B: [u8; ROOM] = [0; ROOM];
    if let Some(core) = cortex_m::Peripherals::take() {
        let mut timer = core.SYST;
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(0x00ff_ffff);
        timer.clear_current();
        timer.enable_counter();
    }
    let (_, empty) = counted(&mut || Work::Plan);
    let mut costs: [Cost; 8] = Default::default();
    let mut note = |work: &mut dyn FnMut() -> Work| {
        let (what, counts) = counted(work);
        let counts = counts.saturating_sub(empty);
        let counts = if let Work::Proof(spans) = what { counts / spans.max(1) } else { counts };
        if let Some(cost) = costs.get_mut(place(what)) {
            cost.note(counts);
        }
    };
    // SAFETY: this is the main stack, in the last of four megabytes; the timer's interrupt is off.
    let paint = || unsafe { Painted::below() };
    let painted = paint();
    let evaluated = evaluate(TABLES, &mut note);
    let evaluating = painted.used();
    let painted = paint();
    let driven = drive(TABLES, [A, B], &mut note);
    // There the whole drive lies on the stack; on a board it does not.
    let driving = painted.used().saturating_sub(size_of::<Player<'_>>());
    let painted = paint();
    let (Some(evaluated), Some(driven)) = (evaluated, driven) else {
        hprintln!("a table is refused");
        debug::exit(debug::EXIT_FAILURE);
        loop {}
    };
    let planned = plan_moves(MOVES, &mut note);
    let stack = evaluating.max(driving).max(painted.used());
    hprintln!("setpoints {}", evaluated.setpoints);
    hprintln!("setpoint_hash {}", evaluated.hash);
    hprintln!("driven {}", driven.setpoints);
    hprintln!("driven_hash {}", driven.hash);
    hprintln!("plans {}", planned.plans);
    hprintln!("imprecise {}", planned.imprecise);
    hprintln!("plan_hash {}", planned.hash);
    for (name, cost) in NAMES.iter().zip(&costs) {
        hprintln!("{}_most {}", name, cost.most());
        hprintln!("{}_mean {}", name, cost.mean());
    }
    hprintln!("stack {}", stack);
    debug::exit(debug::EXIT_SUCCESS);
    loop {}
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    debug::exit(debug::EXIT_FAILURE);
    loop {}
}

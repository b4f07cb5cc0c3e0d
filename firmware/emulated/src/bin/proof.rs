//! Plays the tables it carries and plans random motions, and tells over semihosting what came out and what it cost.
//!
//! Under QEMU's `-icount shift=10` every instruction takes 1024 ns of SysTick's time.
#![no_std]
#![no_main]

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use emulated::workload::{plan_moves, play};

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

/// SysTick counts that `work` takes; it counts down 24 bits.
#[inline(never)]
fn counted(work: &mut dyn FnMut()) -> u32 {
    let before = SYST::get_current();
    work();
    before.wrapping_sub(SYST::get_current()) & 0x00ff_ffff
}

#[entry]
fn main() -> ! {
    if let Some(core) = cortex_m::Peripherals::take() {
        let mut timer = core.SYST;
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(0x00ff_ffff);
        timer.clear_current();
        timer.enable_counter();
    }
    let empty = counted(&mut || {});
    let net = |counts: u32| counts.saturating_sub(empty);
    let (mut tick, mut prove, mut plan) = (Cost::default(), Cost::default(), Cost::default());
    let played = play(TABLES, |spans, work| {
        let counts = net(counted(work));
        match spans {
            Some(spans) => prove.note(counts / spans.max(1)),
            None => tick.note(counts),
        }
    });
    let Some(played) = played else {
        hprintln!("a table is refused");
        debug::exit(debug::EXIT_FAILURE);
        loop {}
    };
    let planned = plan_moves(MOVES, |work| plan.note(net(counted(work))));
    hprintln!("setpoints {}", played.setpoints);
    hprintln!("setpoint_hash {}", played.hash);
    hprintln!("plans {}", planned.plans);
    hprintln!("imprecise {}", planned.imprecise);
    hprintln!("plan_hash {}", planned.hash);
    for (name, cost) in [("tick", &tick), ("prove_per_span", &prove), ("plan", &plan)] {
        hprintln!("{}_most {}", name, cost.most());
        hprintln!("{}_mean {}", name, cost.mean());
    }
    debug::exit(debug::EXIT_SUCCESS);
    loop {}
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    debug::exit(debug::EXIT_FAILURE);
    loop {}
}

use super::*;

extern crate std;

const TICK_NS: u32 = 1_000_000;

/// A drive whose crystal is off, against a master that is right; times in ns of the master.
struct Rig {
    clock: Clock,
    /// Own time, and the master's.
    own: f64,
    master: f64,
    crystal: f64,
    jump: i64,
}

impl Rig {
    fn new(crystal: f64, own: f64) -> Self {
        Self { clock: Clock::new(TICK_NS), own, master: 7e9, crystal, jump: 0 }
    }

    fn stamp(ns: f64) -> Stamp {
        let ns = ns as u64;
        Stamp { tick: ns / u64::from(TICK_NS), ns: (ns % u64::from(TICK_NS)) as u32 }
    }

    /// Lets time pass, trimmed every tick.
    fn pass(&mut self, ns: f64) {
        let mut left = ns;
        while left > 0.0 {
            let step = left.min(f64::from(TICK_NS));
            let trim = f64::from(self.clock.trim_ppb(Self::stamp(self.own))) * 1e-9;
            self.own += step * (1.0 + self.crystal) / (1.0 - trim);
            self.master += step;
            left -= step;
        }
    }

    /// A SYNC that is seen late by so much.
    fn sync(&mut self, late: f64) {
        let at = Self::stamp(self.master);
        self.clock.sync(3, Self::stamp(self.own + late));
        if let Some(ticks) = self.clock.time(Time::new(3, at).unwrap()) {
            self.jump += ticks;
            self.own += ticks as f64 * f64::from(TICK_NS);
            self.clock.jumped();
        }
    }

    fn error(&self) -> f64 {
        self.own - self.master
    }
}

/// Whatever the crystals, and with stamps right to a microsecond, the ticks meet and stay within two microseconds.
#[test]
fn ticks_meet_and_stay_together() {
    for (crystal, own) in [(1e-4, 0.0), (-1e-4, 7e9 + 4.9e5), (2e-4, 9e9), (0.0, 6.9995e9)] {
        let mut rig = Rig::new(crystal, own);
        let mut random = 1u32;
        let mut worst = 0.0f64;
        for k in 0..400 {
            rig.pass(if k < 16 { 2e7 } else { 1e8 });
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            rig.sync(f64::from(random >> 8) / f64::from(1 << 24) * 1e3);
            if k > 40 {
                worst = worst.max(rig.error().abs());
                assert!(rig.clock.agrees(Rig::stamp(rig.own)), "{crystal} {k}");
            }
        }
        assert!(worst < 2_000.0, "{crystal} {own}: {worst}");
        assert!(f64::from(rig.clock.residual_ns()) < 1_000.0);
    }
}

#[test]
fn a_second_without_sync_costs_little_and_three_are_too_many() {
    let mut rig = Rig::new(8e-5, 0.0);
    for k in 0..100 {
        rig.pass(1e8);
        rig.sync(f64::from(k % 7) * 100.0);
    }
    rig.pass(1e9);
    assert!(rig.error().abs() < 2_000.0, "{}", rig.error());
    assert!(rig.clock.agrees(Rig::stamp(rig.own)));
    rig.pass(2.1e9);
    assert!(!rig.clock.agrees(Rig::stamp(rig.own)));
}

#[test]
fn what_is_far_off_is_not_believed_unless_it_persists() {
    let mut rig = Rig::new(-3e-5, 0.0);
    for _ in 0..60 {
        rig.pass(1e8);
        rig.sync(0.0);
    }
    for k in 0..40 {
        rig.pass(1e8);
        rig.sync(if k % 4 == 0 { 1e5 } else { 0.0 });
        assert!(rig.error().abs() < 1_000.0, "{}", rig.error());
    }
    assert_eq!(rig.clock.outliers(), 10);
    // The master has moved by a tenth of a millisecond: it is followed.
    rig.master += 1e5;
    for _ in 0..60 {
        rig.pass(1e8);
        rig.sync(0.0);
    }
    assert!(rig.error().abs() < 1_000.0, "{}", rig.error());
}

#[test]
fn a_sync_without_its_time_and_a_time_without_its_sync_say_nothing() {
    let mut clock = Clock::new(TICK_NS);
    let at = Stamp { tick: 5, ns: 0 };
    clock.sync(1, at);
    assert_eq!(clock.time(Time { counter: 2, tick: 900, ns: 0 }), None);
    assert_eq!(clock.time(Time { counter: 1, tick: 900, ns: 0 }), None);
    assert_eq!(clock.count, 0);
    clock.sync(1, at);
    assert_eq!(clock.time(Time { counter: 1, tick: 900, ns: 0 }), Some(895));
}

#[test]
fn any_stamps_are_taken() {
    let mut clock = Clock::new(1);
    for (tick, low) in [(0, u32::MAX), (u64::MAX, 0), (u64::MAX / 2, 7), (1, 1), (2, 2), (2, 2)] {
        clock.sync(1, Stamp { tick, ns: u32::MAX });
        let _ = clock.time(Time { counter: 1, tick: low, ns: 0 });
        assert!(clock.trim_ppb(Stamp { tick, ns: 0 }).abs() <= 3_000_000);
    }
}

#[test]
fn coarse_timers_keep_the_mean() {
    for trim in [0, 1_234, -7_777, 2_999_999] {
        let mut timer = Reload::new(25_000);
        let sum: u64 = (0..100_000).map(|_| u64::from(timer.next(trim))).sum();
        let wanted = 25_000.0 * 1e5 * (1.0 - f64::from(trim) * 1e-9);
        assert!((sum as f64 - wanted).abs() <= 1.0, "{trim}: {sum} {wanted}");
    }
}

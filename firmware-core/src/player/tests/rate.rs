//! Override and hold.

use super::*;
use crate::axis::Excess;

/// All set-points of the table at rate 1.
fn plain() -> Vec<Setpoint> {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(config(), &mut a, &mut b);
    bring(&mut player, 4);
    player.handle(&HostMessage::Start { table: 4, tick: 0 });
    let mut all = Vec::new();
    while all.last().is_none_or(|s: &Setpoint| !s.done) {
        all.push(player.tick());
    }
    all
}

#[test]
fn a_hold_stands_on_the_path_and_what_follows_is_put_off() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(config(), &mut a, &mut b);
    bring(&mut player, 4);
    player.handle(&HostMessage::Start { table: 4, tick: 0 });
    let ticks = player.status().fill;
    player.handle(&HostMessage::Override { permille: 0, tick: ticks / 3, number: 0 });
    assert_eq!(refusal(&mut player), None);
    let mut before = Setpoint::at_rest(100);
    for tick in 0..ticks / 3 + 2_000 {
        let now = player.tick();
        let middle = 0.5e-3 * f64::from(before.velocity + now.velocity);
        let moved = (now.position - before.position) as f64;
        assert!((moved - middle).abs() < 3.0, "{tick}: {before:?} {now:?}");
        before = now;
    }
    assert_eq!((before.velocity, before.acceleration, before.done), (0.0, 0.0, false));
    assert_eq!(player.status().state, State::Held);
    assert!((100..8_100).contains(&before.position));
    let fill = player.status().fill;
    assert!(fill > ticks / 4 && fill < ticks, "{fill}");
    // A table behind it waits as well.
    player.handle(&HostMessage::Start { table: 4, tick: 0 });
    player.handle(&HostMessage::Override { permille: 1000, tick: player.status().tick + 5, number: 0 });
    let end = player.status().tick + 5 + fill;
    let mut ticks = 0;
    while !before.done {
        before = player.tick();
        ticks += 1;
    }
    assert_eq!(before.position, 8_100);
    assert!(player.status().tick > end, "the way back to rate 1 takes its time: {ticks}");
    assert_eq!(player.status().state, State::Holding);
}

#[test]
fn half_the_rate_is_half_the_velocity() {
    let plain = plain();
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(config(), &mut a, &mut b);
    // At rest the rate is what it is told to be, at once.
    player.handle(&HostMessage::Override { permille: 500, tick: 0, number: 0 });
    bring(&mut player, 4);
    player.handle(&HostMessage::Start { table: 4, tick: 0 });
    assert_eq!(refusal(&mut player), None);
    for (tick, full) in plain.iter().enumerate() {
        let now = player.tick();
        assert!((now.position - full.position).abs() <= 1, "{tick}: {now:?} {full:?}");
        let [v, a] = [0.5 * full.velocity, 0.25 * full.acceleration];
        // The clock loses up to 2^-32 s per tick at other rates than 1.
        assert!((now.velocity - v).abs() <= 1e-4 * (1.0 + v.abs()), "{tick}: {now:?} {full:?}");
        assert!((now.acceleration - a).abs() <= 1e-3 * (1.0 + a.abs()), "{tick}: {now:?} {full:?}");
        if !full.done {
            player.tick();
        }
    }
}

#[test]
fn rates_that_the_table_does_not_admit_are_refused() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(config(), &mut a, &mut b);
    player.handle(&HostMessage::Override { permille: 2001, tick: 0, number: 0 });
    assert_eq!(refusal(&mut player), Some(Reject::Override));
    bring(&mut player, 4);
    player.handle(&HostMessage::Start { table: 4, tick: 0 });
    (0..10).for_each(|_| {
        player.tick();
    });
    for (permille, tick, reason) in
        [(1001, 50, Reject::Override), (500, 9, Reject::Late { tick: 10 }), (2001, 50, Reject::Override)]
    {
        player.handle(&HostMessage::Override { permille, tick, number: 0 });
        assert_eq!(refusal(&mut player), Some(reason));
    }
    player.handle(&HostMessage::Override { permille: 1000, tick: 50, number: 0 });
    assert_eq!(refusal(&mut player), None);
}

#[test]
fn a_quick_stop_out_of_a_hold_stands_where_it_stands() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(config(), &mut a, &mut b);
    bring(&mut player, 4);
    player.handle(&HostMessage::Start { table: 4, tick: 0 });
    player.handle(&HostMessage::Override { permille: 0, tick: 100, number: 0 });
    let held = (0..2_000).map(|_| player.tick()).last().unwrap();
    assert_eq!(player.status().state, State::Held);
    player.handle(&HostMessage::QuickStop);
    assert_eq!(player.tick(), Setpoint::at_rest(held.position));
    assert_eq!(player.status().power, Power::QuickStopActive);
    // The next table plays at rate 1.
    player.handle(&HostMessage::Power(PowerEvent::EnableOperation));
    player.handle(&HostMessage::MoveTo { position: 100, velocity: None });
    while !player.tick().done {}
    bring(&mut player, 5);
    player.handle(&HostMessage::Start { table: 5, tick: player.status().tick });
    let plain = plain();
    for full in plain {
        assert_eq!(player.tick(), full);
    }
}

/// The last tick of a ramp still has its share of the ramp's acceleration: it counts as one at another rate.
#[test]
fn the_end_of_a_ramp_is_no_fault() {
    let plain = plain();
    let acceleration = plain.iter().map(|s| s.acceleration.abs()).fold(0.0, f32::max);
    for tick in 40..240 {
        let (mut a, mut b) = ([0; 64], [0; 64]);
        let mut player = enabled(config(), &mut a, &mut b);
        bring_with(&mut player, 4, Warp { bend: RATE_ONE / 1_000_000 * 1_500, ..WARP });
        assert_eq!(refusal(&mut player), None);
        // At rate 1 as much as the table needs, at others as much as there may be.
        let limits = Limits { acceleration, ..LIMITS };
        let excess = Excess { acceleration: 1e3, jerk: 1e3 };
        player.motion.set_guard(Guard::new(&AxisConfig { limits, excess, ..config() }));
        player.handle(&HostMessage::Start { table: 4, tick: 0 });
        player.handle(&HostMessage::Override { permille: 900, tick, number: 0 });
        (0..tick + 60).for_each(|_| {
            player.tick();
        });
        player.handle(&HostMessage::Override { permille: 1000, tick: tick + 60, number: 0 });
        while !player.tick().done {}
        assert_eq!((player.status().fault, player.status().position), (None, 8_100), "{tick}");
    }
}

#[test]
fn bounds_that_do_not_suit_the_axis_are_refused() {
    let header = TableError::Header(HeaderField::Warp);
    for (warp, reason) in [
        (Warp { slope: WARP.slope * 3, ..WARP }, Reject::Table(header)),
        (Warp { bend: RATE_ONE / 1_000_000 * 3_000, ..WARP }, Reject::Table(header)),
        (Warp { acceleration: ONE + ONE / 2, ..WARP }, Reject::Limits),
        (Warp { rate: ONE + ONE / 20, ..WARP }, Reject::Limits),
    ] {
        let (mut a, mut b) = ([0; 64], [0; 64]);
        let mut player = enabled(config(), &mut a, &mut b);
        bring_with(&mut player, 4, warp);
        assert_eq!(refusal(&mut player), Some(reason), "{warp:?}");
    }
}

/// A table that admits no other rate is not started when there is to be one, nor is there one while it waits.
#[test]
fn a_table_without_bounds_keeps_to_rate_1() {
    for change_first in [true, false] {
        let (mut a, mut b) = ([0; 64], [0; 64]);
        let mut player = enabled(config(), &mut a, &mut b);
        bring_warped(&mut player, 4, None);
        let messages = [
            HostMessage::Override { permille: 0, tick: 30, number: 0 },
            HostMessage::Start { table: 4, tick: 20 },
        ];
        let [first, second] = if change_first { [0, 1] } else { [1, 0] };
        player.handle(&messages[first]);
        assert_eq!(refusal(&mut player), None);
        player.handle(&messages[second]);
        assert_eq!(refusal(&mut player), Some(Reject::Override));
    }
}

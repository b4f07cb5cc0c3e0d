//! A quick stop at any instant of any table, and faults on the way: the axis comes to rest within its limits.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use firmware_core::evaluate::Setpoint;
use firmware_core::player::Player;
use protocol::message::{DriveMessage, HostMessage, Reject, State};
use protocol::table::Limits;
use tests::drives::{asked, bring, limits_of, player};
use tests::tables::{COARSE, FINE, Random, Sample, TICK_NS};

const TICK_S: f64 = TICK_NS as f64 * 1e-9;

/// The set-points after a quick stop keep limits and follow each other; returns where they end.
fn assert_lands(player: &mut Player<'_>, before: Setpoint, limits: &Limits, jerk: f64) -> i64 {
    let (v, a) = (f64::from(limits.velocity), f64::from(limits.acceleration));
    // Before the acceleration is gone it adds to the velocity; without a limit of jerk a table may be harder than that.
    let v = v.max(f64::from(before.velocity).abs() + 0.5 * f64::from(before.acceleration).powi(2) / jerk);
    let mut last = before;
    for tick in 0..2_000_000 {
        assert_eq!(player.status().state, State::Stopping, "tick {tick}");
        let now = player.tick();
        let [v0, v1] = [last.velocity, now.velocity].map(f64::from);
        let [a0, a1] = [last.acceleration, now.acceleration].map(f64::from);
        assert!(v1.abs() <= v * 1.0001 && a1.abs() <= a * 1.0001, "{now:?}");
        // Acceleration changes by jerk, velocity by the acceleration between, position by the velocity between.
        assert!((a1 - a0).abs() <= jerk * TICK_S * 1.001 + 1e-4 * a, "{last:?} {now:?}");
        let (low, high) = (a0.min(a1) - 1e-4 * a, a0.max(a1) + 1e-4 * a);
        let gained = (v1 - v0) / TICK_S;
        assert!(gained >= low - jerk * TICK_S - 1e-4 * v / TICK_S, "{last:?} {now:?}");
        assert!(gained <= high + jerk * TICK_S + 1e-4 * v / TICK_S, "{last:?} {now:?}");
        let moved = (now.position - last.position) as f64;
        let middle = 0.5 * (v0 + v1) * TICK_S;
        assert!((moved - middle).abs() <= 1.6 + a * TICK_S * TICK_S, "{last:?} {now:?}");
        last = now;
        if now.done {
            return now.position;
        }
    }
    panic!("it never comes to rest");
}

/// `FEEDSPLINE_CASES` asks for so many instants, `FEEDSPLINE_SEED` for others.
#[test]
fn a_quick_stop_at_any_instant_ends_at_rest_within_limits() {
    let (cases, seed): (u64, u64) = (asked("FEEDSPLINE_CASES", 3_000), asked("FEEDSPLINE_SEED", 1));
    let mut random = Random::new(seed);
    let (mut moving, mut refused) = (0u64, 0u64);
    while moving < cases {
        let kind = if random.whole(0, 1) == 0 { FINE } else { COARSE };
        let mut packed = Sample::new(&mut random, kind).packed(1).unwrap();
        let limits = limits_of(&packed, 0, random.whole(0, 1) == 0);
        packed.axes[0].header.limits = limits;
        let soft = f64::from(limits.acceleration) / (4.0 * TICK_S);
        let jerk = limits.jerk.map_or(soft, f64::from);
        for _ in 0..20 {
            let (mut a, mut b) = (vec![0; 8192], vec![0; 8192]);
            let mut player = player(&packed, 0, limits, &mut a, &mut b);
            if !bring(&mut player, &packed, 0) {
                // Jerk may be larger between the places where it was looked at.
                refused += 1;
                break;
            }
            player.handle(&HostMessage::Start { table: 1, tick: 0 });
            let ticks = player.status().fill;
            let instant = random.whole(1, ticks.max(2) - 1);
            let mut last = Setpoint::at_rest(0);
            for _ in 0..instant {
                last = player.tick();
            }
            player.handle(&HostMessage::QuickStop);
            if last.done {
                assert_ne!(player.status().state, State::Stopping);
                continue;
            }
            moving += 1;
            assert_eq!(player.status().state, State::Stopping);
            // Nothing starts before it is at rest.
            player.handle(&HostMessage::Start { table: 1, tick: 1 << 40 });
            assert!(matches!(
                player.poll_answer(),
                Some(DriveMessage::Reject { reason: Reject::NotReady, .. })
            ));
            let end = assert_lands(&mut player, last, &limits, jerk);
            assert_eq!(player.status().state, State::Holding);
            assert_eq!(player.status().position, end);
            assert_eq!(player.tick(), Setpoint::at_rest(end));
        }
    }
    assert!(refused < cases / 20, "{refused}");
}

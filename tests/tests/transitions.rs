//! Whatever follows whatever: tables, overrides, holds, quick stops, faults, moves. Position, velocity and acceleration go
//! on from one tick to the next as jerk allows.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::collections::BTreeMap;

use firmware_core::evaluate::Setpoint;
use planner::feed::override_bounds::warp;
use planner::feed::pack::Packed;
use planner::job::machine::OverrideRule;
use protocol::message::{HostMessage, State};
use protocol::power::{Power, PowerEvent};
use protocol::table::Limits;
use protocol::table::warp::ONE;
use tests::drives::{asked, bring, limits_of, player};
use tests::tables::{COARSE, Random, Sample, TICK_NS};

const TICK_S: f64 = TICK_NS as f64 * 1e-9;

/// A random table and its way back.
fn there_and_back(random: &mut Random) -> Option<([Packed; 2], Limits)> {
    let there = Sample::new(random, COARSE);
    let mut back = there.clone();
    let length = back.table.path.grid_length();
    back.table.path.breaks = there.table.path.breaks.iter().rev().map(|knot| length - knot).collect();
    back.table.path.axes.iter_mut().for_each(|axis| axis.controls.reverse());
    back.table.steps.reverse();
    back.table.codes.reverse();
    let mut packed = [there.packed(1).ok()?, back.packed(1).ok()?];
    let [a, b] = [0, 1].map(|n| limits_of(&packed[n], 0, true));
    let limits = Limits {
        velocity: a.velocity.max(b.velocity),
        acceleration: a.acceleration.max(b.acceleration),
        jerk: Some(a.jerk?.max(b.jerk?)),
    };
    let bounds = warp(&OverrideRule::default(), &[limits], TICK_NS)?;
    for packed in &mut packed {
        packed.header.warp = Some(bounds);
        packed.axes[0].header.limits = limits;
    }
    Some((packed, limits))
}

/// Does something that fits the state that the drive is in.
fn act(
    drive: &mut firmware_core::player::Player<'_>,
    tables: &mut [Packed; 2],
    number: &mut u32,
    random: &mut Random,
) {
    let status = drive.status();
    let tick = status.tick;
    let command =
        |drive: &mut firmware_core::player::Player<'_>, event| drive.handle(&HostMessage::Power(event));
    match (status.power, status.state) {
        (Power::OperationEnabled, State::Idle | State::Holding | State::Ready) => {
            let next = tables.iter_mut().find(|t| t.axes[0].header.start == status.position);
            match next {
                Some(table) => {
                    *number += 1;
                    table.header.table = *number;
                    table.axes[0].header.table = *number;
                    if bring(drive, table, 0) {
                        drive
                            .handle(&HostMessage::Start { table: *number, tick: tick + random.whole(0, 30) });
                    }
                }
                None => {
                    let position = tables[random.whole(0, 1) as usize].axes[0].header.start;
                    drive.handle(&HostMessage::MoveTo { position, velocity: None });
                }
            }
        }
        (Power::OperationEnabled, State::Running | State::Held | State::Armed) => match random.whole(0, 9) {
            0 => drive.handle(&HostMessage::QuickStop),
            1 => drive.trip(1),
            2..=4 => drive.handle(&HostMessage::Override { permille: 0, tick, number: 0 }),
            5..=7 => drive.handle(&HostMessage::Override { permille: 1000, tick, number: 0 }),
            _ => drive.handle(&HostMessage::Override {
                permille: random.whole(0, 1000) as u16,
                tick,
                number: 0,
            }),
        },
        (Power::OperationEnabled, State::Moving) => match random.whole(0, 5) {
            0 => drive.handle(&HostMessage::QuickStop),
            1 => drive.handle(&HostMessage::MoveAt { velocity: 0.0 }),
            2 => {
                let velocity = 1e4 * random.between(-1.0, 1.0) as f32;
                drive.handle(&HostMessage::MoveAt { velocity });
            }
            _ => {
                let position = tables[random.whole(0, 1) as usize].axes[0].header.start;
                drive.handle(&HostMessage::MoveTo { position, velocity: None });
            }
        },
        (Power::QuickStopActive, _) => command(drive, PowerEvent::EnableOperation),
        (Power::Fault, _) => command(drive, PowerEvent::ResetFault),
        (Power::SwitchOnDisabled, _) => command(drive, PowerEvent::Shutdown),
        (Power::ReadyToSwitchOn, _) => command(drive, PowerEvent::EnableOperation),
        _ => {}
    }
    while drive.poll_answer().is_some() {}
}

/// `FEEDSPLINE_CASES` asks for so many tables, `FEEDSPLINE_SEED` for others.
#[test]
fn motion_is_continuous_across_every_transition() {
    let (cases, seed) = (asked("FEEDSPLINE_CASES", 400), asked("FEEDSPLINE_SEED", 1));
    let mut random = Random::new(seed);
    let mut seen: BTreeMap<String, u32> = BTreeMap::new();
    let mut played = 0;
    while played < cases {
        let Some((mut tables, limits)) = there_and_back(&mut random) else { continue };
        let bounds = tables[0].header.warp.unwrap();
        let [k, k_j] = [bounds.acceleration, bounds.jerk].map(|x| f64::from(x) / f64::from(ONE));
        let [v, a, j] = [limits.velocity, limits.acceleration, limits.jerk.unwrap()].map(f64::from);
        // Before acceleration is gone it adds to the velocity.
        let fastest = 1.005 * v + 0.5 * (k * a) * (k * a) / j;
        let (mut x, mut y) = (vec![0; 8192], vec![0; 8192]);
        let mut drive = player(&tables[0], 0, limits, &mut x, &mut y);
        let mut number = 0;
        if !bring(&mut drive, &tables[0], 0) {
            continue;
        }
        drive.handle(&HostMessage::Stop);
        played += 1;
        let mut last = Setpoint::at_rest(tables[0].axes[0].header.start);
        let (mut wait, mut state) = (0, drive.status().state);
        for tick in 0..6_000 {
            if wait == 0 {
                act(&mut drive, &mut tables, &mut number, &mut random);
                wait = random.whole(1, 250);
            }
            wait -= 1;
            let now = drive.tick();
            let [v0, v1] = [last.velocity, now.velocity].map(f64::from);
            let [a0, a1] = [last.acceleration, now.acceleration].map(f64::from);
            let place = || format!("{tick} {state:?} {:?}: {last:?} {now:?}", drive.status());
            assert!(v1.abs() <= fastest && a1.abs() <= 1.005 * k * a, "{}", place());
            assert!((a1 - a0).abs() <= 1.01 * k_j * j * TICK_S + 3e-4 * a, "{}", place());
            let gained = 0.5 * (a0 + a1) * TICK_S;
            assert!((v1 - v0 - gained).abs() <= 0.5 * k_j * j * TICK_S * TICK_S + 2e-4 * v, "{}", place());
            let moved = (now.position - last.position) as f64;
            let middle = 0.5 * (v0 + v1) * TICK_S;
            assert!((moved - middle).abs() <= 1.6 + k * a * TICK_S * TICK_S, "{}", place());
            let next = drive.status().state;
            if next != state {
                *seen.entry(format!("{state:?} {next:?}")).or_insert(0) += 1;
                state = next;
            }
            last = now;
        }
    }
    println!("{seen:?}");
    for way in [
        "Armed Running",
        "Running Holding",
        "Running Held",
        "Held Running",
        "Running Stopping",
        "Stopping Holding",
        "Holding Moving",
        "Moving Stopping",
        "Moving Holding",
    ] {
        assert!(seen.contains_key(way), "{way} of {seen:?}");
    }
}

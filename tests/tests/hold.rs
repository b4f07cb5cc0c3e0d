//! Override and hold at any instant of any table: all axes stay on the path together, within what the table declares.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use firmware_core::evaluate::{Cursor, Setpoint};
use firmware_core::table::{CheckedTable, TableView};
use planner::feed::override_bounds::warp;
use planner::feed::pack::Packed;
use planner::job::machine::OverrideRule;
use protocol::message::{HostMessage, State};
use protocol::table::Limits;
use protocol::table::warp::{ONE, RATE_ONE};
use tests::drives::{asked, bring, limits_of, player};
use tests::tables::{COARSE, FINE, Random, Sample, TICK_NS};

const TICK_S: f64 = TICK_NS as f64 * 1e-9;

/// A random table with limits near what its axes need, and the bounds of overrides that follow from them.
fn sample(random: &mut Random) -> Option<(Packed, Vec<Limits>)> {
    let kind = if random.whole(0, 1) == 0 { FINE } else { COARSE };
    let mut packed = Sample::new(random, kind).packed(1).unwrap();
    let limits: Vec<Limits> = (0..packed.axes.len()).map(|axis| limits_of(&packed, axis, true)).collect();
    packed.header.warp = Some(warp(&OverrideRule::default(), &limits, TICK_NS)?);
    for (part, limits) in packed.axes.iter_mut().zip(&limits) {
        part.header.limits = *limits;
    }
    Some((packed, limits))
}

fn table(packed: &Packed, axis: usize) -> CheckedTable<'_> {
    let part = &packed.axes[axis];
    TableView::new(&packed.header, &part.header, &packed.shared, &part.controls).unwrap().check().unwrap()
}

/// Steps in which a stretch of the path is searched, and how many of the best places are looked at closer.
const STEPS: u64 = 500;
const PLACES: usize = 20;

/// How far off the path the axes are together: the least that the farthest of them has to its place there [counts].
fn off_the_path(packed: &Packed, positions: &[i64]) -> i64 {
    let tables: Vec<_> = (0..positions.len()).map(|axis| table(packed, axis)).collect();
    let mut stretches = vec![(0, tables[0].duration())];
    loop {
        let mut places = Vec::new();
        let mut last = true;
        for (from, to) in stretches {
            let mut cursors: Vec<_> = tables.iter().map(|table| Cursor::new(table).unwrap()).collect();
            let step = ((to - from) / STEPS).max(1);
            last &= step == 1;
            let times: Vec<u64> = (from..=to).step_by(step as usize).collect();
            let offs: Vec<i64> = times
                .iter()
                .map(|&time| {
                    let away = |((cursor, table), at): ((&mut Cursor, _), &i64)| {
                        (cursor.evaluate(table, time).unwrap().position - at).abs()
                    };
                    cursors.iter_mut().zip(&tables).zip(positions).map(away).max().unwrap()
                })
                .collect();
            // Places that are nearer than what is before and behind them: the path may come near itself.
            for n in 0..offs.len() {
                let before = n.checked_sub(1).is_none_or(|k| offs[k] > offs[n]);
                let behind = offs.get(n + 1).is_none_or(|&off| off >= offs[n]);
                if before && behind {
                    places.push((offs[n], times[n].saturating_sub(2 * step), times[n] + 2 * step));
                }
            }
        }
        places.sort_unstable();
        if places[0].0 <= 1 || last {
            return places[0].0;
        }
        stretches = places.iter().take(PLACES).map(|&(_, from, to)| (from, to)).collect();
    }
}

/// How a table is played.
#[derive(Clone, Copy, Debug)]
struct Change {
    permille: u16,
    tick: u64,
}

/// Plays a table with changes of the rate, and looks at every set-point; whether the axes were held in the end. `None`: a
/// drive refuses the table.
fn play(packed: &Packed, limits: &[Limits], changes: &[Change], ticks: u64) -> Option<bool> {
    // In the middle of a change, and in the end.
    let looks = [changes[0].tick + 40, changes[0].tick + 150, ticks - 1];
    let axes = packed.axes.len();
    let mut memory = vec![[vec![0; 8192], vec![0; 8192]]; axes];
    let mut drives = Vec::new();
    for (axis, [a, b]) in memory.iter_mut().enumerate() {
        let mut drive = player(packed, axis, limits[axis], a, b);
        if !bring(&mut drive, packed, axis) {
            // Jerk may be larger between the places where it was looked at.
            return None;
        }
        drive.handle(&HostMessage::Start { table: 1, tick: 0 });
        drives.push(drive);
    }
    let bounds = packed.header.warp.unwrap();
    let (k, k_j) = (f64::from(bounds.acceleration) / f64::from(ONE), f64::from(bounds.jerk) / f64::from(ONE));
    let mut last: Vec<_> = packed.axes.iter().map(|part| Setpoint::at_rest(part.header.start)).collect();
    let mut next = changes.iter().peekable();
    for tick in 0..ticks {
        if let Some(change) = next.next_if(|change| change.tick == tick) {
            for drive in &mut drives {
                drive.handle(&HostMessage::Override { permille: change.permille, tick, number: 0 });
                assert_eq!(drive.poll_answer(), None);
            }
        }
        let now: Vec<Setpoint> = drives.iter_mut().map(|drive| drive.tick()).collect();
        for (axis, (now, last)) in now.iter().zip(&last).enumerate() {
            let Limits { velocity, acceleration, jerk } = limits[axis];
            let [v, a, j] = [velocity, acceleration, jerk.unwrap()].map(f64::from);
            assert!(f64::from(now.velocity.abs()) <= 1.005 * v, "{tick} {now:?}");
            assert!(f64::from(now.acceleration.abs()) <= 1.005 * k * a, "{tick} {now:?}");
            // Rounding of f32 is a part of the acceleration itself.
            let change = f64::from((now.acceleration - last.acceleration).abs());
            assert!(change <= 1.01 * k_j * j * TICK_S + 2e-4 * a, "{tick} {axis} {last:?} {now:?}");
            let middle = 0.5 * f64::from(now.velocity + last.velocity) * TICK_S;
            let moved = (now.position - last.position) as f64;
            assert!((moved - middle).abs() <= 1.6 + k * a * TICK_S * TICK_S, "{tick} {last:?} {now:?}");
        }
        if looks.contains(&tick) {
            let positions: Vec<i64> = now.iter().map(|s| s.position).collect();
            let off = off_the_path(packed, &positions);
            assert!(off <= 1, "{off} counts off the path at tick {tick}");
        }
        last = now;
    }
    let held = drives.iter().all(|drive| drive.status().state == State::Held);
    let ended = drives.iter().zip(&packed.axes).all(|(d, part)| d.status().position == part.header.end);
    assert!(held || ended);
    Some(held)
}

/// `FEEDSPLINE_CASES` asks for so many tables, `FEEDSPLINE_SEED` for others.
#[test]
fn all_axes_are_held_on_the_path_and_go_on_to_its_end() {
    let (cases, seed) = (asked("FEEDSPLINE_CASES", 25), asked("FEEDSPLINE_SEED", 1));
    let mut random = Random::new(seed);
    let (mut played, mut holds, mut refused) = (0, 0, 0);
    while played < cases {
        let Some((packed, limits)) = sample(&mut random) else { continue };
        let duration = table(&packed, 0).duration();
        let ticks = (duration as f64 / (1u64 << 32) as f64 / TICK_S) as u64;
        // What the slowest change of the rate takes, twice.
        let bounds = packed.header.warp.unwrap();
        let patience = 2 * (RATE_ONE / bounds.climb() + bounds.climb() / bounds.bend) + 1_000;
        if ticks > 20_000 || patience > 30_000 {
            continue;
        }
        let tick = random.whole(0, ticks);
        let hold = [Change { permille: 0, tick }];
        let there_and_back = [
            Change { permille: random.whole(0, 1000) as u16, tick },
            Change { permille: random.whole(0, 1000) as u16, tick: tick + random.whole(1, 300) },
            Change { permille: 1000, tick: tick + 301 + random.whole(1, 500) },
        ];
        match play(&packed, &limits, &hold, tick + patience) {
            Some(held) => holds += u64::from(held),
            None => refused += 1,
        }
        if play(&packed, &limits, &there_and_back, ticks + 4 * patience).is_some_and(|held| !held) {
            played += 1;
        }
    }
    assert!(holds > cases / 2, "{holds} of {cases}");
    assert!(refused < cases, "{refused}");
}

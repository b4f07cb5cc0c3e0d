use super::*;
use crate::guard::Guard;
use protocol::bus::data;
use protocol::message::{Fault, Reject, State};
use protocol::message::{Part, part_crc};
use protocol::power::{Power, PowerEvent};
use protocol::table::control::ControlWriter;
use protocol::table::geometry::{self, GeometrySpan};
use protocol::table::span::SpanWriter;
use protocol::table::warp::{ONE, RATE_ONE, Warp};
use protocol::table::{AxisHeader, FORMAT_VERSION, HeaderField, Stream, TableError};
use protocol::table::{AxisLimit, Limits, TableHeader};

extern crate std;
use std::vec::Vec;

const LIMITS: Limits = Limits { velocity: 1e6, acceleration: 1e8, jerk: Some(1e10) };

/// rho 20/s, s'' 100/s^2, at 1 kHz: within the limits above by far.
const WARP: Warp = Warp {
    rate: ONE,
    acceleration: ONE + ONE / 5,
    jerk: ONE + 3 * (ONE / 10),
    slope: (1 << 40) / 1000 * 20,
    bend: RATE_ONE / 1_000_000 * 100,
};

fn config() -> AxisConfig {
    AxisConfig { position: 100, ..AxisConfig::new(0, 1_000_000, LIMITS) }
}

/// A drive under torque.
fn enabled<'a>(config: AxisConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Player<'a> {
    let mut player = Player::new(config, a, b);
    player.handle(&HostMessage::Power(PowerEvent::Shutdown));
    player.handle(&HostMessage::Power(PowerEvent::EnableOperation));
    assert_eq!(player.status().power, Power::OperationEnabled);
    player
}

/// The one refusal among the answers.
fn refusal(player: &mut Player<'_>) -> Option<Reject> {
    let mut reasons = core::iter::from_fn(|| player.poll_answer()).filter_map(|answer| match answer {
        DriveMessage::Reject { reason, .. } => Some(reason),
        _ => None,
    });
    let first = reasons.next();
    assert_eq!(reasons.next(), None);
    first
}

/// Its shared header.
fn header(table: u32, geometry_bytes: u32, span_bytes: u32) -> TableHeader {
    TableHeader {
        version: FORMAT_VERSION,
        table,
        spans: 5,
        geometry_spans: 1,
        step_exponent: -8,
        q_scale: 1e-5,
        tick_ns: 1_000_000,
        geometry_bytes,
        span_bytes,
        margin: 5,
        warp: Some(WARP),
        joint: None,
        tail: None,
    }
}

/// A straight move of 8 u in one geometry span and five q spans, from 100 to 8100 counts.
fn bring(player: &mut Player<'_>, table: u32) {
    bring_with(player, table, WARP);
}

fn bring_with(player: &mut Player<'_>, table: u32, warp: Warp) {
    bring_warped(player, table, Some(warp));
}

/// The same with other bounds of overrides.
fn bring_warped(player: &mut Player<'_>, table: u32, warp: Option<Warp>) {
    let (mut shared, mut spans, mut writer) = (Vec::new(), Vec::new(), SpanWriter::default());
    geometry::write(&mut shared, GeometrySpan { length: 2048, spans: 5 });
    writer.push(&mut spans, Some(200), None);
    for (step, code) in [(500, 3000), (648, 5000), (500, 3000)] {
        writer.push(&mut spans, Some(step), Some(code));
    }
    writer.push(&mut spans, None, None);
    let (mut controls, mut points) = (Vec::new(), ControlWriter::default());
    [0, 8000, 16_000, 24_000].into_iter().for_each(|p| points.push(&mut controls, p / 3 + 100));
    let header = TableHeader { warp, ..header(table, shared.len() as u32, spans.len() as u32) };
    shared.extend(spans);
    let control_bytes = controls.len() as u32;
    let axis =
        AxisHeader { table, axis: 0, fraction_bits: 0, start: 100, end: 8100, limits: LIMITS, control_bytes };
    player.handle(&HostMessage::Open(header));
    player.handle(&HostMessage::OpenAxis(axis));
    for (part, bytes, crc) in [
        (Part::Shared, &shared, part_crc(&header, &[&shared]).unwrap()),
        (Part::Axis, &controls, part_crc(&axis, &[&controls]).unwrap()),
    ] {
        player.handle(&HostMessage::Data { tag: data::tag(table), part, unit: 0, bytes });
        player.handle(&HostMessage::Seal { table, part, crc });
    }
}

#[test]
fn a_move_runs_through_all_states_to_its_end() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(config(), &mut a, &mut b);
    assert_eq!(player.status().state, State::Idle);
    bring(&mut player, 4);
    let Some(DriveMessage::Ready { table: 4, ticks, .. }) = player.poll_answer() else { panic!() };
    assert_eq!(player.status().state, State::Ready);
    player.handle(&HostMessage::Start { table: 4, tick: 2 });
    assert_eq!((player.status().state, player.status().fill), (State::Armed, ticks + 2));
    let mut last = 100;
    for tick in 0..ticks + 2 {
        let setpoint = player.tick();
        assert!(setpoint.position >= last && setpoint.velocity >= 0.0);
        assert_eq!(player.status().state, if tick < 2 { State::Armed } else { State::Running });
        last = setpoint.position;
    }
    assert_eq!(player.tick(), Setpoint::at_rest(8100));
    assert_eq!((player.status().state, player.status().fill), (State::Holding, 0));
    assert_eq!(player.poll_answer(), None);
}

#[test]
fn memory_that_changes_under_a_running_table_is_a_fault_that_stays() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(config(), &mut a, &mut b);
    bring(&mut player, 4);
    player.handle(&HostMessage::Start { table: 4, tick: 0 });
    let moving = (0..100).map(|_| player.tick()).last().unwrap();
    assert!(moving.position > 100);
    player.motion.corrupt();
    let mut before = moving;
    let stopped = loop {
        let now = player.tick();
        // It comes to rest as its limits allow: it does not stop dead.
        let change = (now.velocity - before.velocity).abs();
        assert!(change <= LIMITS.acceleration * 1e-3 * 1.01, "{before:?} {now:?}");
        before = now;
        if now.done {
            break now;
        }
    };
    assert!(stopped.position < 8100);
    let status = player.status();
    let error = TableError::Truncated { stream: Stream::Spans, index: 3 };
    assert_eq!((status.power, status.fault), (Power::Fault, Some(Fault::Table { table: 4, error })));
    let _ready = player.poll_answer();
    bring(&mut player, 5);
    player.handle(&HostMessage::Start { table: 5, tick: 1 << 40 });
    let mut refused = 0;
    while let Some(answer) = player.poll_answer() {
        if let DriveMessage::Reject { table: 5, reason: Reject::Fault } = answer {
            refused += 1;
        }
    }
    assert_eq!(refused, 1);
    assert_eq!(player.tick(), stopped);
    assert_eq!(player.status().fault, status.fault);
    player.handle(&HostMessage::QuickStop);
    assert_eq!((player.tick(), player.status().fault), (stopped, status.fault));
}

#[test]
fn a_set_point_beyond_the_limits_is_a_fault_and_comes_to_rest() {
    for (slower, limit) in [
        (Limits { velocity: 100.0, ..LIMITS }, AxisLimit::Velocity),
        (Limits { acceleration: 10.0, ..LIMITS }, AxisLimit::Acceleration),
    ] {
        let (mut a, mut b) = ([0; 64], [0; 64]);
        let mut player = enabled(config(), &mut a, &mut b);
        bring(&mut player, 4);
        player.handle(&HostMessage::Start { table: 4, tick: 0 });
        // As if the axis had learnt of lower limits than its tables were proven for.
        player.motion.set_guard(Guard::new(&AxisConfig { limits: slower, ..config() }));
        let mut rest = None;
        for _ in 0..1_000_000 {
            let now = player.tick();
            if now.done {
                rest = Some(now);
                break;
            }
        }
        assert!(rest.unwrap().position < 8100);
        assert_eq!(player.status().fault, Some(Fault::Limit(limit)));
        assert_eq!(player.status().power, Power::Fault);
    }
}

#[test]
fn an_axis_goes_where_it_is_sent_and_changes_its_mind_on_the_way() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let config = AxisConfig { travel: Some([-2_000_000, 2_000_000]), ..config() };
    let mut player = enabled(config, &mut a, &mut b);
    let go = |player: &mut Player<'_>, position, velocity| {
        player.handle(&HostMessage::MoveTo { position, velocity });
        match player.poll_answer() {
            Some(DriveMessage::Reject { reason, .. }) => Some(reason),
            _ => None,
        }
    };
    for (position, velocity) in [(2_000_001, None), (0, Some(0.0)), (0, Some(f32::NAN)), (0, Some(-1.0))] {
        assert_eq!(go(&mut player, position, velocity), Some(Reject::Target));
    }
    assert_eq!(go(&mut player, 1_234_567, None), None);
    assert_eq!(player.status().state, State::Moving);
    let left = player.status().fill;
    let away = (0..left / 2).map(|_| player.tick()).last().unwrap();
    assert!(away.velocity > 0.9 * LIMITS.velocity);
    // Back, slower than it is: the way back into that limit comes first.
    assert_eq!(go(&mut player, -5, Some(0.5 * LIMITS.velocity)), None);
    let mut before = away;
    while !before.done {
        let now = player.tick();
        assert!(
            (now.velocity - before.velocity).abs() <= 1.01e-3 * LIMITS.acceleration,
            "{before:?} {now:?}"
        );
        before = now;
    }
    assert_eq!((before, player.status().state), (Setpoint::at_rest(-5), State::Holding));
    // Not while a table plays or waits.
    drop(player);
    let mut moved = enabled(self::config(), &mut a, &mut b);
    bring(&mut moved, 4);
    moved.handle(&HostMessage::Start { table: 4, tick: 50 });
    assert!(matches!(moved.poll_answer(), Some(DriveMessage::Ready { .. })));
    assert_eq!(go(&mut moved, 7, None), Some(Reject::Busy));
    moved.handle(&HostMessage::QuickStop);
    assert_eq!(go(&mut moved, 70_000, None), Some(Reject::Power(Power::QuickStopActive)));
    moved.handle(&HostMessage::Power(PowerEvent::EnableOperation));
    assert_eq!(go(&mut moved, 70_000, None), None);
    // A quick stop ends a move, too.
    (0..20).for_each(|_| {
        moved.tick();
    });
    moved.handle(&HostMessage::QuickStop);
    assert_eq!(moved.status().state, State::Stopping);
}

#[test]
fn telemetry_follows_each_status_where_the_position_is_known() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(AxisConfig { status_ticks: 10, ..config() }, &mut a, &mut b);
    for tick in 0..10 {
        player.tick();
        player.observe(100 + tick % 2);
    }
    // The tenth position comes after the tenth tick, and counts for the next window.
    for (ticks, most) in [(9, 1), (1, 1)] {
        let answers: Vec<_> = core::iter::from_fn(|| player.poll_answer()).collect();
        let [DriveMessage::Status(_), DriveMessage::Telemetry(told)] = answers[..] else {
            panic!("{answers:?}")
        };
        assert_eq!((told.ticks, told.following_max), (ticks, most));
        (0..10).for_each(|_| {
            player.tick();
        });
    }
    assert!(matches!(player.poll_answer(), Some(DriveMessage::Status(_))));
    assert!(player.poll_answer().is_none(), "nobody has told anything");
}

#[test]
fn a_quick_stop_at_rest_forgets_tables_and_no_more() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(config(), &mut a, &mut b);
    bring(&mut player, 4);
    player.handle(&HostMessage::Start { table: 4, tick: 3 });
    player.handle(&HostMessage::QuickStop);
    assert!((0..100).all(|_| player.tick() == Setpoint::at_rest(100)));
    assert_eq!(player.status().state, State::Idle);
    // A new table is taken from where the axis stands.
    player.handle(&HostMessage::Power(PowerEvent::EnableOperation));
    bring(&mut player, 5);
    player.handle(&HostMessage::Start { table: 5, tick: 200 });
    assert_eq!(player.status().state, State::Armed);
}

#[test]
fn answers_that_nobody_fetches_keep_the_newest() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(AxisConfig { status_ticks: 1, ..config() }, &mut a, &mut b);
    (0..100).for_each(|_| {
        player.tick();
    });
    (0..20).for_each(|table| player.handle(&HostMessage::Start { table, tick: 0 }));
    let answers: Vec<_> = core::iter::from_fn(|| player.poll_answer()).collect();
    assert_eq!(answers.len(), 8);
    let newest = DriveMessage::Reject { table: 19, reason: Reject::NotReady };
    assert_eq!(answers.last(), Some(&newest));
}

mod power;
mod rate;

//! Power states, option codes, lost connections, and motions without a table.

use super::*;
use crate::axis::{FaultOption, LostOption, Options, QuickStopOption};
use protocol::power::TRANSITIONS;

fn with(options: Options) -> AxisConfig {
    AxisConfig { options, ..config() }
}

/// Brings a drive that runs at full speed.
fn running<'a>(config: AxisConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Player<'a> {
    let mut player = enabled(config, a, b);
    bring(&mut player, 4);
    assert!(refusal(&mut player).is_none());
    player.handle(&HostMessage::Start { table: 4, tick: 0 });
    (0..100).for_each(|_| {
        player.tick();
    });
    assert_eq!(player.status().state, State::Running);
    player
}

/// Plays on until it stands still under or without torque; at most so many ticks.
fn stand(player: &mut Player<'_>) -> i64 {
    for _ in 0..10_000 {
        let now = player.tick();
        if now.done {
            return now.position;
        }
    }
    panic!("it never stands still");
}

#[test]
fn without_torque_nothing_begins() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = Player::new(config(), &mut a, &mut b);
    assert_eq!(player.status().power, Power::SwitchOnDisabled);
    bring(&mut player, 4);
    assert!(refusal(&mut player).is_none(), "tables may come");
    for message in [
        HostMessage::Start { table: 4, tick: 5 },
        HostMessage::MoveTo { position: 7, velocity: None },
        HostMessage::MoveAt { velocity: 1.0 },
    ] {
        player.handle(&message);
        assert_eq!(refusal(&mut player), Some(Reject::Power(Power::SwitchOnDisabled)));
    }
    player.handle(&HostMessage::Power(PowerEvent::EnableOperation));
    assert_eq!(refusal(&mut player), Some(Reject::Power(Power::SwitchOnDisabled)));
    player.handle(&HostMessage::Power(PowerEvent::Shutdown));
    player.handle(&HostMessage::Power(PowerEvent::EnableOperation));
    // The table that was refused is still there.
    player.handle(&HostMessage::Start { table: 4, tick: 5 });
    assert_eq!((refusal(&mut player), player.status().state), (None, State::Armed));
}

#[test]
fn commands_take_the_legal_ways_and_no_others() {
    let commands = [
        PowerEvent::Shutdown,
        PowerEvent::SwitchOn,
        PowerEvent::EnableOperation,
        PowerEvent::DisableOperation,
        PowerEvent::DisableVoltage,
        PowerEvent::QuickStop,
        PowerEvent::ResetFault,
    ];
    let mut chance = fastrand::Rng::with_seed(1);
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = Player::new(config(), &mut a, &mut b);
    let mut state = Power::SwitchOnDisabled;
    for _ in 0..5_000 {
        if chance.u8(..10) == 0 {
            player.trip(3);
            let latched = state.after(PowerEvent::Fault).is_none();
            player.tick();
            state = if latched { state } else { Power::Fault };
        } else {
            let command = commands[chance.usize(..commands.len())];
            player.handle(&HostMessage::Power(command));
            let legal = TRANSITIONS.iter().find(|(_, from, by, _)| (*from, *by) == (state, command));
            assert_eq!(refusal(&mut player), legal.is_none().then_some(Reject::Power(state)));
            state = legal.map_or(state, |(.., to)| *to);
        }
        assert_eq!(player.status().power, state);
        assert_eq!(player.status().fault.is_some(), state == Power::Fault);
    }
    // What only a drive may know is no command.
    player.handle(&HostMessage::Power(PowerEvent::Fault));
    assert!(matches!(refusal(&mut player), Some(Reject::Power(_))));
}

#[test]
fn torque_is_not_taken_from_a_moving_axis_unless_asked_for() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = running(config(), &mut a, &mut b);
    for event in [PowerEvent::Shutdown, PowerEvent::DisableOperation] {
        player.handle(&HostMessage::Power(event));
        assert_eq!(refusal(&mut player), Some(Reject::Moves));
    }
    let before = player.tick();
    player.handle(&HostMessage::Power(PowerEvent::DisableVoltage));
    assert_eq!(player.tick(), Setpoint::at_rest(before.position));
    assert_eq!(player.status().power, Power::SwitchOnDisabled);
}

#[test]
fn quick_stops_follow_their_option() {
    for (quick_stop, end) in [
        (QuickStopOption::Disable, Power::SwitchOnDisabled),
        (QuickStopOption::StopAndDisable, Power::SwitchOnDisabled),
        (QuickStopOption::StopAndStay, Power::QuickStopActive),
    ] {
        let (mut a, mut b) = ([0; 64], [0; 64]);
        let mut player = running(with(Options { quick_stop, ..Options::default() }), &mut a, &mut b);
        let before = player.tick();
        player.handle(&HostMessage::QuickStop);
        let at_once = quick_stop == QuickStopOption::Disable;
        assert_eq!(player.status().power, if at_once { end } else { Power::QuickStopActive });
        let stood = stand(&mut player);
        assert_eq!(stood == before.position, at_once);
        assert_eq!(player.status().power, end);
    }
}

#[test]
fn faults_follow_their_option_and_keep_their_first_cause() {
    for (fault, at_once) in [(FaultOption::Disable, true), (FaultOption::Stop, false)] {
        let (mut a, mut b) = ([0; 64], [0; 64]);
        let mut player = running(with(Options { fault, ..Options::default() }), &mut a, &mut b);
        let before = player.tick();
        player.trip(7);
        assert_eq!(player.status().power, Power::FaultReactionActive);
        player.trip(8);
        let first = Some(Fault::Board { code: 7 });
        assert_eq!(player.status().fault, first);
        let stood = stand(&mut player);
        assert_eq!(stood == before.position, at_once);
        assert_eq!((player.status().power, player.status().fault), (Power::Fault, first));
        player.trip(9);
        player.handle(&HostMessage::QuickStop);
        assert_eq!((player.status().power, player.status().fault), (Power::Fault, first));
        player.handle(&HostMessage::Power(PowerEvent::ResetFault));
        assert_eq!((player.status().power, player.status().fault), (Power::SwitchOnDisabled, None));
    }
}

#[test]
fn a_fault_in_any_state_of_motion_is_latched() {
    type Bring = fn(&mut Player<'_>);
    let ways: [(State, Bring); 8] = [
        (State::Idle, |_| ()),
        (State::Receiving, |player| {
            bring(player, 4);
            player.handle(&HostMessage::Stop);
            let header = TableHeader { table: 5, ..header(5, 4, 4) };
            player.handle(&HostMessage::Open(header));
        }),
        (State::Ready, |player| bring(player, 4)),
        (State::Armed, |player| {
            bring(player, 4);
            player.handle(&HostMessage::Start { table: 4, tick: 1 << 30 });
        }),
        (State::Running, |player| {
            bring(player, 4);
            player.handle(&HostMessage::Start { table: 4, tick: 0 });
            player.tick();
        }),
        (State::Held, |player| {
            bring(player, 4);
            player.handle(&HostMessage::Start { table: 4, tick: 0 });
            player.handle(&HostMessage::Override { permille: 0, tick: 20, number: 0 });
            (0..1_000).for_each(|_| {
                player.tick();
            });
        }),
        (State::Moving, |player| {
            player.handle(&HostMessage::MoveTo { position: 1 << 40, velocity: None });
            player.tick();
        }),
        (State::Stopping, |player| {
            player.handle(&HostMessage::MoveAt { velocity: 1e6 });
            (0..50).for_each(|_| {
                player.tick();
            });
            player.handle(&HostMessage::QuickStop);
        }),
    ];
    for (state, way) in ways {
        let (mut a, mut b) = ([0; 64], [0; 64]);
        let mut player = enabled(config(), &mut a, &mut b);
        way(&mut player);
        assert_eq!(player.status().state, state);
        player.trip(7);
        player.trip(8);
        stand(&mut player);
        let status = player.status();
        assert_eq!((status.power, status.fault), (Power::Fault, Some(Fault::Board { code: 7 })), "{state:?}");
    }
}

#[test]
fn a_lost_connection_follows_its_option() {
    for (lost, power) in [
        (LostOption::Nothing, Power::OperationEnabled),
        (LostOption::Fault, Power::Fault),
        (LostOption::Disable, Power::SwitchOnDisabled),
        (LostOption::QuickStop, Power::QuickStopActive),
    ] {
        let (mut a, mut b) = ([0; 64], [0; 64]);
        let options = Options { lost, lost_ticks: 30, ..Options::default() };
        let mut player = enabled(with(options), &mut a, &mut b);
        player.handle(&HostMessage::MoveTo { position: 1_000_000, velocity: None });
        for _ in 0..5 {
            // As long as the host is there, nothing happens.
            (0..30).for_each(|_| {
                player.tick();
            });
            player.handle(&HostMessage::Alive);
            assert_eq!(player.status().state, State::Moving);
        }
        stand(&mut player);
        (0..40).for_each(|_| {
            player.tick();
        });
        assert_eq!(player.status().power, power);
        let cause = (power == Power::Fault).then_some(Fault::Connection);
        assert_eq!(player.status().fault, cause);
        assert_eq!(player.status().position == 1_000_000, lost == LostOption::Nothing);
    }
}

#[test]
fn a_velocity_is_kept_until_told_otherwise_and_ends_with_the_travel() {
    let (mut a, mut b) = ([0; 64], [0; 64]);
    let mut player = enabled(config(), &mut a, &mut b);
    for velocity in [f32::NAN, f32::INFINITY, 1.1e6] {
        player.handle(&HostMessage::MoveAt { velocity });
        assert_eq!(refusal(&mut player), Some(Reject::Target));
    }
    player.handle(&HostMessage::MoveAt { velocity: 1e5 });
    let fast = (0..500).map(|_| player.tick()).last().unwrap();
    assert_eq!((fast.velocity, player.status().state), (1e5, State::Moving));
    assert_eq!(player.status().tick + player.status().fill, u64::MAX);
    player.handle(&HostMessage::MoveAt { velocity: -2e4 });
    let back = (0..500).map(|_| player.tick()).last().unwrap();
    assert_eq!(back.velocity, -2e4);
    player.handle(&HostMessage::MoveAt { velocity: 0.0 });
    stand(&mut player);
    assert_eq!((player.status().power, player.status().state), (Power::OperationEnabled, State::Holding));
    drop(player);
    let travel = AxisConfig { travel: Some([-5_000, 5_000]), ..config() };
    let mut player = enabled(travel, &mut a, &mut b);
    player.handle(&HostMessage::MoveAt { velocity: 1e5 });
    assert_eq!(stand(&mut player), 5_000);
    player.handle(&HostMessage::MoveAt { velocity: -1e5 });
    assert_eq!(stand(&mut player), -5_000);
}

#[test]
fn a_quick_stop_before_a_move_has_begun_keeps_the_axis_where_it_is() {
    let moves =
        [HostMessage::MoveTo { position: 100_000, velocity: None }, HostMessage::MoveAt { velocity: 1e5 }];
    for order in moves {
        for fault in [false, true] {
            let (mut a, mut b) = ([0; 64], [0; 64]);
            let mut player = enabled(config(), &mut a, &mut b);
            player.handle(&order);
            if fault {
                player.trip(1);
            } else {
                player.handle(&HostMessage::QuickStop);
            }
            assert!((0..50).all(|_| player.tick() == Setpoint::at_rest(100)), "{order:?}");
            assert_eq!(player.status().power, if fault { Power::Fault } else { Power::QuickStopActive });
        }
    }
}

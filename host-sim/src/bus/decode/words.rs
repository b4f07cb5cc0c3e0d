//! The words of each kind of frame.

use protocol::bus::FrameError;
use protocol::bus::beat::Beat;
use protocol::bus::data::Data;
use protocol::bus::emergency::{Cause, Emergency};
use protocol::bus::stop::Stop;
use protocol::bus::sync::Time;
use protocol::message::{DriveMessage, HostMessage, State};
use protocol::power::Power;

pub(super) fn nmt(bytes: &[u8]) -> Option<String> {
    let [command, to, ..] = bytes else { return None };
    let command = match command {
        1 => "start, which means nothing here".to_owned(),
        2 => "stop".to_owned(),
        128 => "pre-operational: stop".to_owned(),
        129 => "reset: quick stop".to_owned(),
        130 => "reset communication: quick stop".to_owned(),
        other => format!("command {other}"),
    };
    Some(if *to == 0 { format!("{command}, to all") } else { format!("{command}, to one") })
}

pub(super) fn stop(stop: Stop) -> String {
    match stop {
        Stop::Path { tick: None } => "on the path, the drives agree when".into(),
        Stop::Path { tick: Some(tick) } => format!("on the path from tick {tick} on"),
        Stop::Quick => "as fast as each axis can".into(),
        Stop::Off => "without torque".into(),
    }
}

pub(super) fn time(time: Time) -> String {
    format!("number {} ended at tick {} and {} ns", time.counter, time.tick, time.ns)
}

pub(super) fn emergency(emergency: Emergency) -> String {
    let why = match emergency.cause {
        Cause::Fault => "a fault of its own",
        Cause::HostSilent => "the host is silent",
        Cause::DriveSilent => "another drive is silent",
        Cause::DriveAstray => "another drive is astray",
        Cause::Told => "told to stop",
        Cause::Heard => "passed on",
    };
    format!("code {:04x}, {why}, stop from tick {} on", emergency.code, emergency.tick)
}

/// A state as a word.
pub fn state(state: State) -> &'static str {
    match state {
        State::Idle => "idle",
        State::Receiving => "receiving",
        State::Ready => "ready",
        State::Armed => "armed",
        State::Running => "running",
        State::Holding => "holding",
        State::Held => "held",
        State::Stopping => "stopping",
        State::Moving => "moving",
    }
}

/// A power state in words.
pub fn power(power: Power) -> &'static str {
    match power {
        Power::SwitchOnDisabled => "switch-on disabled",
        Power::ReadyToSwitchOn => "ready to switch on",
        Power::SwitchedOn => "switched on",
        Power::OperationEnabled => "operation enabled",
        Power::QuickStopActive => "quick stop active",
        Power::FaultReactionActive => "fault reaction active",
        Power::Fault => "fault",
    }
}

pub(super) fn beat(beat: &Beat) -> String {
    let mut text = format!("{}, {}, epoch ..{:02x}", state(beat.state), power(beat.power), beat.epoch);
    text.push_str(if beat.open { " open" } else { " closed" });
    for (told, word) in [(beat.fault, "FAULT"), (beat.stopping, "stopping"), (!beat.synced, "clock differs")]
    {
        if told {
            text.push_str(", ");
            text.push_str(word);
        }
    }
    text.push_str(&format!(", room for {}, {} ms to go", beat.free, beat.fill_ms));
    if beat.committed > 0 {
        text.push_str(&format!(", table ..{:02x}", beat.committed - 1));
    }
    text
}

pub(super) fn data(data: &Data<'_>) -> String {
    format!("table ..{:x}, {} bytes from unit {}", data.tag, data.bytes.len(), data.unit)
}

pub(super) fn broken(error: FrameError) -> String {
    match error {
        FrameError::Empty => "a frame of a block without bytes".into(),
        FrameError::NoStart => "a frame of a block whose beginning was not seen".into(),
        FrameError::Sequence { expected, found } => {
            format!("frame {found} of a block where {expected} should follow")
        }
        FrameError::TooLong => "a block that is too long".into(),
        FrameError::Length => "a block whose length does not fit its frames".into(),
        FrameError::Checksum => "a block whose checksum is wrong".into(),
    }
}

pub(super) fn command(message: &HostMessage<'_>) -> String {
    match message {
        HostMessage::Begin { boot, members } => {
            let nodes = (0..128).filter(|bit| members >> bit & 1 == 1).map(|bit| (bit + 1).to_string());
            format!("Begin {{ boot: {boot}, nodes: {} }}", nodes.collect::<Vec<_>>().join(" "))
        }
        other => format!("{other:?}"),
    }
}

pub(super) fn answer(message: &DriveMessage) -> String {
    match message {
        DriveMessage::Missing { table, part, gaps } => {
            let gaps: Vec<String> = gaps.ranges().map(|gap| format!("{}..{}", gap.start, gap.end)).collect();
            format!("Missing {{ table: {table}, part: {part:?}, units: {} }}", gaps.join(" "))
        }
        DriveMessage::Identity(identity) => {
            let [major, minor, patch] = identity.version;
            format!(
                "Identity {{ core: {major}.{minor}.{patch}, schema: {:016x}, axis: {}, tick_ns: {}, room: {}, boot: {}, epoch: {} }}",
                identity.schema,
                identity.axis,
                identity.tick_ns,
                identity.room,
                identity.boot,
                identity.epoch
            )
        }
        other => format!("{other:?}"),
    }
}

//! `feedspline status`, `hold`, `resume` and `stop`: whoever commands the drives.

use protocol::bus::stop::Stop;
use protocol::schema;

use super::Verdict;
use crate::args::{BusArgs, RateArgs, ResumeArgs, StatusArgs, StopArgs};
use crate::console::Console;
use crate::failure::Failure;
use crate::json::{DriveJson, StatusJson, StopJson};
use crate::live::remote::{COPIES, Found, Remote};
use crate::live::{SIM, frames, key, real};
use crate::summary;

/// Runs `status`.
///
/// # Errors
/// The bus cannot be opened, or nobody answers.
pub fn status(args: &StatusArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    show(&on(&args.bus, |remote| remote.ask())?, console)
}

/// Runs `hold`.
///
/// # Errors
/// As [`status`], or nothing moves that could be held, or not all drives confirm.
pub fn hold(args: &RateArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    show(&on(&args.bus, |remote| remote.change_rate(0))?, console)
}

/// Runs `resume`.
///
/// # Errors
/// As [`hold`].
pub fn resume(args: &ResumeArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let permille = (args.percent * 10.0).round() as u16;
    show(&on(&args.rate.bus, |remote| remote.change_rate(permille))?, console)
}

/// Runs `stop`.
///
/// # Errors
/// The bus cannot be opened.
pub fn stop(args: &StopArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let (name, stop) = match (args.quick, args.off) {
        (true, _) => ("quick", Stop::Quick),
        (_, true) => ("off", Stop::Off),
        _ => ("path", Stop::Path { tick: None }),
    };
    on(&args.bus, |remote| {
        remote.stop(stop);
        Ok(())
    })?;
    let told = StopJson { stop: name.into(), frames_sent: COPIES as u32 };
    console.show(&told, &format!("stop sent {COPIES} times: {name}\n"))?;
    Ok(Verdict::Holds)
}

fn on<R>(bus: &BusArgs, act: impl FnOnce(&mut Remote<'_>) -> Result<R, Failure>) -> Result<R, Failure> {
    if bus.bus == SIM {
        return Err(Failure::input("simulated drives live only as long as the command that plays on them")
            .with_help("Name the bus with --bus, such as can0, vcan0 or slcan:/dev/ttyACM0."));
    }
    let key = key::of(bus.key.as_deref())?;
    let mut opened = real::bus(bus)?;
    let result = act(&mut Remote::new(&mut *opened, frames(bus), key));
    real::sound(&mut *opened)?;
    result
}

fn show(found: &[Found], console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let told = StatusJson { drives: found.iter().map(drive).collect() };
    console.show(&told, &summary::live::status(&told))?;
    Ok(Verdict::Holds)
}

fn drive(found: &Found) -> DriveJson {
    let (beat, status, identity) = (&found.beat, &found.status, &found.identity);
    let state = status.map(|s| s.state).or(beat.map(|b| b.state));
    let power = status.map(|s| s.power).or(beat.map(|b| b.power));
    DriveJson {
        node: found.node.number(),
        state: state.map(|s| format!("{s:?}")),
        power: power.map(|p| format!("{p:?}")),
        fault: status.and_then(|s| s.fault).map(|f| format!("{f:?}")),
        epoch: identity.as_ref().map(|i| i.epoch),
        open: beat.map(|b| b.open),
        synced: beat.map(|b| b.synced),
        position_counts: status.map(|s| s.position),
        fill_ms: beat.map(|b| b.fill_ms),
        core_version: identity.as_ref().map(|i| i.version.map(|n| n.to_string()).join(".")),
        schema_matches: identity.as_ref().map(|i| i.schema == schema::HASH),
    }
}

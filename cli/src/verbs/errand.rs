//! `feedspline jog`, `feedspline home`, and `feedspline move` with a bus.

use planner::feed::file::FileHeader;

use super::Verdict;
use crate::args::{BusArgs, HomeArgs, JogArgs, MoveArgs};
use crate::console::Console;
use crate::failure::Failure;
use crate::live::errand::{self, Errand};
use crate::live::{SIM, real, sim};
use crate::local::job::machine_of;
use crate::{interrupt, summary};

/// Room of simulated drives, which get no tables [bytes].
const ROOM: usize = 1_000;

/// Runs `jog`.
///
/// # Errors
/// There is no such axis, a drive refuses, fails or is silent, or the bus is gone.
pub fn jog(args: &JogArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let header = FileHeader::from(&machine_of(args.machine.as_deref())?);
    let axis = axis(&header, &args.axis)?;
    let errand = Errand::At { axis, velocity: args.velocity, seconds: args.seconds };
    run(&[errand], &header, &args.bus, console)
}

/// Runs `home`.
///
/// # Errors
/// As [`jog`].
pub fn home(args: &HomeArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let header = FileHeader::from(&machine_of(args.machine.as_deref())?);
    let axes = match &args.axis[..] {
        [] => (0..header.axes.len()).collect(),
        names => names.iter().map(|name| axis(&header, name)).collect::<Result<Vec<_>, _>>()?,
    };
    let to = |axis: usize| {
        // Zero, or the end of the travel that is nearest to it.
        let [low, high] = header.axes[axis].travel;
        let most = header.axes[axis].limits.velocity.max(header.axes[axis].rapid.velocity);
        let velocity = args.velocity.map(|v| v.min(most));
        Errand::To { axis, position: 0.0f64.max(low).min(high), velocity }
    };
    let errands: Vec<Errand> = axes.into_iter().map(to).collect();
    run(&errands, &header, &args.bus, console)
}

/// Runs `move` on a bus.
///
/// # Errors
/// As [`jog`].
pub fn to(args: &MoveArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let header = FileHeader::from(&machine_of(args.machine.as_deref())?);
    let errands = args.to.iter().map(|text| {
        let wrong =
            || Failure::input(format!("--to {text}: an axis and a position are wanted, such as X=12.5"));
        let (name, position) = text.split_once('=').ok_or_else(wrong)?;
        let position = position.trim().parse::<f64>().ok().filter(|p| p.is_finite()).ok_or_else(wrong)?;
        Ok(Errand::To { axis: axis(&header, name)?, position, velocity: args.velocity })
    });
    let errands = errands.collect::<Result<Vec<_>, Failure>>()?;
    let bus = BusArgs { bus: args.bus.clone().unwrap_or_default(), fd: args.fd, key: args.key.clone() };
    run(&errands, &header, &bus, console)
}

fn axis(header: &FileHeader, name: &str) -> Result<usize, Failure> {
    let found = header.axes.iter().position(|axis| axis.name.eq_ignore_ascii_case(name.trim()));
    found.ok_or_else(|| {
        let names: Vec<&str> = header.axes.iter().map(|axis| axis.name.as_str()).collect();
        Failure::input(format!("there is no axis {name} on the machine {}", header.name))
            .with_help(format!("Its axes are {}.", names.join(", ")))
    })
}

fn run(
    errands: &[Errand],
    header: &FileHeader,
    bus: &BusArgs,
    console: &mut Console<'_>,
) -> Result<Verdict, Failure> {
    errands.iter().try_for_each(|errand| errand.check(header))?;
    interrupt::count_presses();
    let told = if bus.bus == SIM {
        // They stand at zero, or as near to it as their travel lets them.
        let start = |axis: &planner::feed::file::FileAxis| {
            let [low, high] = axis.travel;
            (0.0f64.max(low).min(high) * axis.counts_per_unit).round() as i64
        };
        let positions = header.axes.iter().map(start).collect();
        let set = sim::Set { header, bus, positions, room: ROOM, free_jerk: false, travels: true };
        sim::with(&set, |stage| errand::run(stage, header, errands))
    } else {
        let mut stage = real::open(bus, header)?;
        errand::run(&mut stage, header, errands)
    }?;
    console.show(&told, &summary::live::errand(&told, header))?;
    Ok(if told.stopped { Verdict::Stopped } else { Verdict::Holds })
}

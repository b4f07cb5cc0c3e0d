//! `feedspline drive`: simulated drives on a real bus, in real time.

use std::thread::sleep;
use std::time::Duration;

use firmware_core::drive::DriveConfig;
use host_sim::bus::decode::{power, state};
use host_sim::bus::real::{BusError, RealBus, open};
use host_sim::bus::{BitTiming, FrameSize, Nanoseconds};
use host_sim::drive_node::Buffers;
use host_sim::live::{Change, Condition, Live};
use host_sim::scenario::{SimSettings, drive_config};
use planner::feed::file::FileHeader;
use planner::job::machine::Machine;
use protocol::bus::Node;

use super::Verdict;
use crate::args::DriveArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::json::{DriveAxisJson, DrivesJson, HealthJson, seconds};
use crate::live::key;
use crate::local::job::machine_of;
use crate::{interrupt, summary};

/// Each of a drive's two buffers [bytes].
const BUFFER_BYTES: usize = 1 << 20;

/// Longest sleep: a request to end waits no longer.
const NAP: Duration = Duration::from_millis(50);

/// Runs the verb: until it is asked to end, or the time is over.
///
/// # Errors
/// The machine has no such axes, or the bus is not there, or goes away.
pub fn execute(args: &DriveArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let machine = machine_of(args.machine.as_deref())?;
    let format = if args.fd { FrameSize::Fd } else { FrameSize::Classic };
    let axes = axes(args, &machine)?;
    let configs = configs(args, &machine, format, axes.clone())?;
    let names: Vec<&str> = machine.axes.iter().map(|axis| axis.name.as_str()).skip(axes.start).collect();
    let mut bus = open(&args.bus, format).map_err(|error| refusal(&error))?;
    let bus = bus.as_mut();
    let mut buffers: Vec<Buffers> = vec![[vec![0; BUFFER_BYTES], vec![0; BUFFER_BYTES]]; configs.len()];
    let mut live = Live::new(&configs, &mut buffers, bus);
    interrupt::count_presses();
    let end = args.seconds.map(|seconds| (seconds * 1e9) as Nanoseconds);
    while interrupt::presses() == 0 && end.is_none_or(|end| bus.now() < end) {
        let wait = Duration::from_nanos(live.due().saturating_sub(bus.now()));
        if !wait.is_zero() {
            sleep(wait.min(NAP));
            continue;
        }
        let change = live.step(bus).map_err(|error| loss(&error))?;
        if let Some(change) = change
            && !console.talk().json
            && !console.talk().quiet
        {
            let node = configs.get(change.drive).map_or(0, |config| config.node.number());
            console.say(&line(&change, node, names.get(change.drive).copied().unwrap_or_default()))?;
        }
    }
    let told = told(args, &machine, format, &names, &live, bus);
    console.show(&told, &summary::drives(&told))?;
    Ok(Verdict::Holds)
}

/// Which axes of the machine there are drives for.
fn axes(args: &DriveArgs, machine: &Machine) -> Result<std::ops::Range<usize>, Failure> {
    let first = usize::from(args.node).saturating_sub(1);
    let all = machine.axes.len();
    let count = args.count.map_or(all.saturating_sub(first), usize::from);
    if first < all && count <= all - first {
        return Ok(first..first + count);
    }
    let wanted = if first < all {
        format!("--count {count} from node {} on", args.node)
    } else {
        format!("--node {}", args.node)
    };
    let failure =
        Failure::input(format!("{wanted}: {} has {all} axes, at the nodes 1 to {all}", machine.name))
            .with_help("Choose a lower number, or another machine with --machine.");
    Err(match &args.machine {
        Some(file) => failure.in_file(file),
        None => failure,
    })
}

fn configs(
    args: &DriveArgs,
    machine: &Machine,
    format: FrameSize,
    axes: std::ops::Range<usize>,
) -> Result<Vec<DriveConfig>, Failure> {
    let settings =
        SimSettings { bus: BitTiming { format, ..BitTiming::default() }, ..SimSettings::default() };
    let header = FileHeader::from(machine);
    let key = key::of(args.key.as_deref())?;
    let config = |axis| {
        let mut config = drive_config(&header, axis, 0, args.free_jerk, &settings)
            .map_err(|e| Failure::input(e.to_string()).with_help("Choose another machine."))?;
        config.key = key;
        // Whoever starts up anew is somebody else.
        config.watch.boot = getrandom::u32()
            .map_err(|e| Failure::internal(format!("the system gives no random number: {e}")))?;
        Ok(config)
    };
    axes.map(config).collect()
}

/// A bus that cannot be opened: the user's to mend.
pub(super) fn refusal(error: &BusError) -> Failure {
    Failure::input(error.to_string()).with_help(error.help())
}

/// A bus that was there, and has gone.
pub(super) fn loss(error: &BusError) -> Failure {
    Failure::internal(format!("the bus has gone: {error}")).with_help(error.help())
}

/// A change of a drive as a line.
fn line(change: &Change, node: u8, axis: &str) -> String {
    let Condition { status, epoch, open, .. } = change.condition;
    let epoch = if open { format!("epoch {epoch} open") } else { format!("epoch {epoch} closed") };
    let fault = status.fault.map(|fault| format!(", FAULT {fault:?}")).unwrap_or_default();
    let (state, power) = (state(status.state), power(status.power));
    let (time, position) = (seconds(change.time), status.position);
    format!("{time:12.6}  node {node:<3} {axis:<4} {state}, {power}, {epoch}, at {position} counts{fault}\n")
}

fn told(
    args: &DriveArgs,
    machine: &Machine,
    format: FrameSize,
    names: &[&str],
    live: &Live<'_>,
    bus: &dyn RealBus,
) -> DrivesJson {
    let drive = |((node, condition), name): ((Node, Condition), &&str)| DriveAxisJson {
        node: node.number(),
        axis: (*name).to_owned(),
        state: state(condition.status.state),
        power: power(condition.status.power),
        fault: condition.status.fault.map(|fault| format!("{fault:?}")),
        position_counts: condition.status.position,
        epoch: condition.epoch,
        epoch_open: condition.open,
        ticks: condition.ticks,
        not_understood: condition.dropped,
    };
    let (late_ticks, worst) = live.lateness();
    DrivesJson {
        bus: args.bus.clone(),
        frame_format: if format == FrameSize::Fd { "fd" } else { "classic" },
        machine: machine.name.clone(),
        seconds: seconds(bus.now()),
        drives: live.conditions().zip(names).map(drive).collect(),
        late_ticks,
        worst_lateness_s: seconds(worst),
        bus_health: HealthJson::of(bus.traffic(), bus.health()),
    }
}

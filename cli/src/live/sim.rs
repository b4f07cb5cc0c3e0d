//! Simulated drives in this process: the shipped core behind a bus in virtual time.

use firmware_core::drive::DriveConfig;
use host_sim::bus::InProcessBus;
use host_sim::drive_node::Buffers;
use host_sim::fleet::{Event, Fleet, FleetSettings};
use host_sim::host_node::HostNode;
use host_sim::scenario::{buffer_for, drive_config};
use planner::feed::file::FileHeader;

use super::{Stage, failed, key, settings, timing};
use crate::args::BusArgs;
use crate::failure::Failure;

/// Drives whose crystals are off, as real ones are [1e-6].
const CRYSTALS_PPM: [f64; 6] = [20.0, -35.0, 50.0, -10.0, 5.0, -50.0];

/// What simulated drives begin with.
pub(crate) struct Set<'a> {
    pub(crate) header: &'a FileHeader,
    pub(crate) bus: &'a BusArgs,
    /// Where they stand [counts].
    pub(crate) positions: Vec<i64>,
    /// Room for a table [bytes].
    pub(crate) room: usize,
    /// They take tables that do not limit jerk.
    pub(crate) free_jerk: bool,
    /// They keep to their travel. Paths may leave it by their tolerance.
    pub(crate) travels: bool,
}

/// Lets `play` play on simulated drives.
///
/// # Errors
/// There are too many axes, or whatever `play` fails with.
pub(crate) fn with<R>(
    set: &Set<'_>,
    play: impl FnOnce(&mut dyn Stage) -> Result<R, Failure>,
) -> Result<R, Failure> {
    let (header, settings) = (set.header, settings(set.bus));
    let key = key::of(set.bus.key.as_deref())?;
    let config = |axis: usize| {
        let position = set.positions.get(axis).copied().unwrap_or(0);
        let config = drive_config(header, axis, position, set.free_jerk, &settings).map(|mut config| {
            config.key = key;
            if set.travels {
                let [low, high] = header.axes[axis].travel.map(|t| t * header.axes[axis].counts_per_unit);
                config.axis.travel = Some([low.floor() as i64, high.ceil() as i64]);
            }
            config
        });
        config.map_err(|e| {
            Failure::input(e.to_string()).with_help("A bus has at most 32 drives that move together.")
        })
    };
    let drives = (0..header.axes.len()).map(config).collect::<Result<Vec<DriveConfig>, _>>()?;
    let bytes = buffer_for(set.room);
    let mut buffers: Vec<Buffers> = vec![[vec![0; bytes], vec![0; bytes]]; drives.len()];
    let mut bus = InProcessBus::new(settings.bus);
    let mut host = HostNode::new(drives.len() as u8, settings.bus.format, timing(header, set.bus), &mut bus);
    if let Some(key) = key {
        host.sign_with(key, 0);
    }
    let crystals = CRYSTALS_PPM.iter().copied().cycle().take(drives.len()).collect();
    let clocks = FleetSettings { crystals_ppm: crystals, ..FleetSettings::default() };
    let fleet = Fleet::new(&drives, &mut buffers, host, clocks, &mut bus);
    play(&mut SimStage { fleet, bus, header })
}

struct SimStage<'m> {
    fleet: Fleet<'m>,
    bus: InProcessBus,
    header: &'m FileHeader,
}

impl Stage for SimStage<'_> {
    fn host(&mut self) -> &mut HostNode {
        self.fleet.host()
    }

    fn step(&mut self) -> Result<(), Failure> {
        match self.fleet.step(&mut self.bus) {
            Event::Failed(error) => Err(failed(&error, self.header)),
            Event::Tick { .. } | Event::Host => Ok(()),
        }
    }

    fn now(&self) -> u64 {
        self.fleet.now()
    }

    fn is_virtual(&self) -> bool {
        true
    }
}

//! A short job on drives with clocks of their own, and an oracle of where its path is.
#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "helpers of tests fail as tests do")]

use host_sim::bus::{BitTiming, Bus};
use host_sim::drive_node::Buffers;
use host_sim::fleet::{Event, Fleet, FleetSettings};
use host_sim::host_node::HostNode;
use host_sim::scenario::{Cast, SimSettings};
use planner::analysis::motion::Cursor;
use planner::feed::job::JobItem;
use planner::feed::table::FeedTable;
use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};

use crate::chain;

/// Half a second of three axes at once.
const PROGRAM: &str = "G21 G90 G64 P0.05\nG1 F9000 X4 Y0 Z0\nX6 Y3 Z-1\nX3 Y6 Z-2\nX1 Y2 Z0\nM2\n";

/// A planned job with all that plays it.
#[derive(Debug)]
pub struct Job {
    /// The machine.
    pub machine: Machine,
    /// Its items.
    pub items: Vec<JobItem>,
    /// Tables and drives.
    pub cast: Cast,
}

impl Job {
    /// The short job, on a bus.
    pub fn short(bus: BitTiming) -> Self {
        Self::of(PROGRAM, bus)
    }

    /// Any job.
    pub fn of(program: &str, bus: BitTiming) -> Self {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs");
        let machine = Machine::load(folder.join("mill3.toml")).unwrap();
        let limits = LimitSet::VelocityAccelerationJerk;
        let chain = chain::plan(program.as_bytes(), &machine, &Options::default(), limits).unwrap();
        let items = chain.plan.items;
        let settings = SimSettings { bus, ..SimSettings::default() };
        let cast = Cast::new(&items, &machine, &settings).unwrap();
        Self { machine, items, cast }
    }

    /// Memory for the drives.
    pub fn buffers(&self) -> Vec<Buffers> {
        let bytes = self.cast.buffer_bytes;
        vec![[vec![0; bytes], vec![0; bytes]]; self.cast.drives.len()]
    }

    /// A host that plays the job.
    pub fn host(&self, bus: &mut dyn Bus) -> HostNode {
        let (axes, frames) = (self.cast.drives.len() as u8, self.cast.drives[0].frames);
        let mut host = HostNode::new(axes, frames, self.cast.timing, bus);
        self.cast.orders.iter().cloned().for_each(|order| host.push(order));
        host.close();
        host
    }

    /// Drives and host on a bus.
    pub fn fleet<'m>(
        &'m self,
        buffers: &'m mut [Buffers],
        settings: FleetSettings,
        bus: &mut dyn Bus,
    ) -> Fleet<'m> {
        let host = self.host(bus);
        Fleet::new(&self.cast.drives, buffers, host, settings, bus)
    }

    /// The table of the first section.
    pub fn table(&self) -> &FeedTable {
        let section = self.items.iter().find_map(|item| match item {
            JobItem::Section(section) => Some(&section.table),
            _ => None,
        });
        section.unwrap()
    }

    /// Where the path is.
    pub fn path(&self) -> PathOracle<'_> {
        PathOracle::new(self.table(), self.machine.axes.iter().map(|a| a.counts_per_unit).collect())
    }
}

/// Positions in counts along a table's path, in f64 and straight from the plan.
#[derive(Debug)]
pub struct PathOracle<'a> {
    table: &'a FeedTable,
    counts: Vec<f64>,
    coarse: Vec<(f64, Vec<f64>)>,
}

impl<'a> PathOracle<'a> {
    fn new(table: &'a FeedTable, counts: Vec<f64>) -> Self {
        let mut oracle = Self { table, counts, coarse: Vec::new() };
        let duration = table.duration();
        let steps = (duration / 2e-3).ceil() as usize;
        oracle.coarse = (0..=steps)
            .map(|k| {
                let t = duration * k as f64 / steps as f64;
                (t, oracle.at(t))
            })
            .collect();
        oracle
    }

    /// Where the axes are at a time [counts].
    pub fn at(&self, time_s: f64) -> Vec<f64> {
        let mut cursor = Cursor::new(self.table);
        let state = cursor.seek(time_s.clamp(0.0, self.table.duration()));
        cursor.axes(&state).zip(&self.counts).map(|(axis, counts)| axis.position * counts).collect()
    }

    /// The largest distance of any axis from the place of the path that is nearest [counts].
    pub fn distance(&self, positions: &[i64]) -> f64 {
        let off = |place: &[f64]| {
            place.iter().zip(positions).map(|(p, q)| (p - *q as f64).abs()).fold(0.0, f64::max)
        };
        let mut near: Vec<(f64, f64)> = self.coarse.iter().map(|(t, place)| (off(place), *t)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let step = self.coarse[1].0 - self.coarse[0].0;
        near.iter().take(2).fold(f64::INFINITY, |best, &(_, t)| {
            let (mut low, mut high) = (t - step, t + step);
            for _ in 0..36 {
                let (a, b) = (low + 0.382 * (high - low), low + 0.618 * (high - low));
                if off(&self.at(a)) < off(&self.at(b)) { high = b } else { low = a }
            }
            best.min(off(&self.at(0.5 * (low + high))))
        })
    }
}

/// What the drives have done, tick by tick of the common count.
#[derive(Debug, Default)]
pub struct Record {
    /// From this tick on.
    pub first: Option<u64>,
    /// Per tick and axis: position, and when it was given [ns].
    pub ticks: Vec<Vec<Option<(i64, u64, bool)>>>,
}

impl Record {
    /// Takes in what has happened.
    pub fn add(&mut self, event: &Event, axes: usize, now: u64) {
        let Event::Tick { axis, tick, setpoint } = event else { return };
        let first = *self.first.get_or_insert(*tick);
        let Some(at) = tick.checked_sub(first) else { return };
        let at = at as usize;
        if self.ticks.len() <= at {
            self.ticks.resize(at + 1, vec![None; axes]);
        }
        self.ticks[at][*axis] = Some((setpoint.position, now, setpoint.done));
    }

    /// Positions of the ticks at which all axes have given one.
    pub fn complete(&self) -> impl Iterator<Item = Vec<i64>> + '_ {
        self.ticks.iter().filter_map(|row| row.iter().map(|cell| cell.map(|c| c.0)).collect())
    }

    /// By tick, the largest difference of the instants so far [ns].
    pub fn skews(&self) -> Vec<u64> {
        self.ticks.iter().map(|row| spread(row)).collect()
    }

    /// The largest difference between the instants at which drives have given the set-points of one tick [ns].
    pub fn skew(&self) -> u64 {
        self.ticks.iter().map(|row| spread(row)).max().unwrap_or(0)
    }
}

fn spread(row: &[Option<(i64, u64, bool)>]) -> u64 {
    let times: Option<Vec<u64>> = row.iter().map(|cell| cell.map(|c| c.1)).collect();
    times.map_or(0, |t| t.iter().max().unwrap() - t.iter().min().unwrap())
}

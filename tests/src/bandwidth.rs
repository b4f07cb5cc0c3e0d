//! What six axes that contour cost on the bus: counted frame by frame on the simulated bus.
#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "helpers of tests fail as tests do")]

use std::f64::consts::TAU;
use std::fmt::Write;

use host_sim::bus::decode::{Decoder, Kind};
use host_sim::bus::{
    BitTiming, Bus, Frame, FrameSize, InProcessBus, Nanoseconds, NodeIndex, Received, Stuffing, Traffic,
};
use host_sim::report::SimReport;
use host_sim::scenario::{SimSettings, simulate_on};
use planner::analysis::motion::Cursor;
use planner::feed::job::JobItem;
use planner::job::gcode::Options;
use planner::job::machine::{LimitSet, Machine};

use crate::chain;

/// A CAN controller of a maxon drive takes one record of eight bytes per knot; knots lie this far apart [s].
const PVT_S: f64 = 0.01;
/// Cyclic set-points come at this rate, eight bytes each [1/s].
const CYCLIC_HZ: f64 = 1000.0;

/// A bus that counts what crosses it by kind.
#[derive(Debug)]
pub struct Meter {
    inner: InProcessBus,
    timing: BitTiming,
    ear: NodeIndex,
    decoder: Decoder,
    /// Busy time and payload of tables: data, and the messages around them.
    pub tables: Traffic,
    /// Of everything else.
    pub rest: Traffic,
}

impl Meter {
    /// An idle bus.
    pub fn new(timing: BitTiming) -> Self {
        let mut inner = InProcessBus::new(timing);
        let ear = inner.attach();
        let decoder = Decoder::new();
        Self { inner, timing, ear, decoder, tables: Traffic::default(), rest: Traffic::default() }
    }

    fn count(&mut self, frame: &Frame) {
        // Whatever the host says beside its sign of life, which has one frame, is about tables.
        let decoded = self.decoder.frame(frame);
        let of_tables = match decoded.kind {
            Kind::Data => true,
            Kind::Command | Kind::Part => {
                (0x200..0x280).contains(&frame.id()) && !decoded.text.contains("Alive")
            }
            _ => false,
        };
        let to = if of_tables { &mut self.tables } else { &mut self.rest };
        to.frames += 1;
        to.bytes += frame.data().len() as u64;
        to.busy += self.timing.time(frame, Stuffing::Exact);
    }
}

impl Bus for Meter {
    fn attach(&mut self) -> NodeIndex {
        self.inner.attach()
    }

    fn send(&mut self, node: NodeIndex, frame: Frame, now: Nanoseconds) {
        self.inner.send(node, frame, now);
    }

    fn advance(&mut self, until: Nanoseconds) {
        self.inner.advance(until);
        while let Some(received) = self.inner.receive(self.ear) {
            self.count(&received.frame);
        }
    }

    fn receive(&mut self, node: NodeIndex) -> Option<Received> {
        self.inner.receive(node)
    }

    fn sent(&mut self, node: NodeIndex) -> Option<Received> {
        self.inner.sent(node)
    }

    fn waiting(&self, node: NodeIndex) -> usize {
        self.inner.waiting(node)
    }

    fn traffic(&self) -> Traffic {
        self.inner.traffic()
    }
}

/// Three linear and three rotary axes, with limits of a fast five-axis mill.
pub fn machine() -> Machine {
    let mut text = "name = \"Six axes\"\ncontrol_tick_s = 0.001\ntolerance_mm = 0.02\n".to_owned();
    for name in ["X", "Y", "Z", "A", "B", "C"] {
        let (kind, unit) = if name < "D" { ("rotary", "deg") } else { ("linear", "mm") };
        let _ = writeln!(
            text,
            "[[axis]]\nname = \"{name}\"\nkind = \"{kind}\"\nunit = \"{unit}\"\ncounts_per_unit = 10000\n\
             travel = [-500, 500]\nvelocity = 500\nacceleration = 5000\njerk = 50000"
        );
    }
    Machine::from_toml(&text, "six axes").unwrap()
}

/// Half a minute of all six axes at once: a figure of Lissajous in blocks of a few millimetres.
pub fn program() -> String {
    let mut text = "G21 G90 G64 P0.02\nG1 F6000\n".to_owned();
    for k in 1..=500 {
        let t = TAU * f64::from(k) / 250.0;
        let _ = writeln!(
            text,
            "X{:.3} Y{:.3} Z{:.3} A{:.3} B{:.3} C{:.3}",
            60.0 * t.sin(),
            40.0 * (2.0 * t).sin(),
            12.0 * (3.0 * t).sin(),
            20.0 * (t + 1.0).sin() - 20.0 * 1f64.sin(),
            15.0 * (2.0 * t + 0.5).sin() - 15.0 * 0.5f64.sin(),
            30.0 * (1.0 - t.cos()),
        );
    }
    text + "M2\n"
}

/// What the job costs at a bit rate.
#[derive(Debug)]
pub struct Cost {
    /// Share of the time for tables, and for everything.
    pub load: [f64; 2],
    /// Payload of tables, per second of motion.
    pub table_bytes_s: f64,
    /// Payload of everything, per second of motion.
    pub bytes_s: f64,
    /// How it has gone.
    pub report: SimReport,
}

/// Plays the job on a bus.
pub fn cost(timing: BitTiming) -> Cost {
    let machine = machine();
    let limits = LimitSet::VelocityAccelerationJerk;
    let chain = chain::plan(program().as_bytes(), &machine, &Options::default(), limits).unwrap();
    let settings = SimSettings { bus: timing, ..SimSettings::default() };
    let mut bus = Meter::new(timing);
    let report = simulate_on(&mut bus, &chain.plan.items, &machine, &settings, &mut (), &mut |_| {}).unwrap();
    let motion_ns = report.motion_s * 1e9;
    let share = |busy: Nanoseconds| busy as f64 / motion_ns;
    let per_s = |bytes: u64| bytes as f64 / report.motion_s;
    let (tables, rest) = (bus.tables, bus.rest);
    Cost {
        load: [share(tables.busy), share(tables.busy + rest.busy)],
        table_bytes_s: per_s(tables.bytes),
        bytes_s: per_s(tables.bytes + rest.bytes),
        report,
    }
}

/// Buses that the table tells of.
pub fn buses() -> Vec<(String, BitTiming)> {
    let classic = |nominal| BitTiming { nominal, format: FrameSize::Classic, ..BitTiming::default() };
    let fd = BitTiming { format: FrameSize::Fd, ..BitTiming::default() };
    let mut all: Vec<_> = [1_000_000, 500_000, 250_000, 125_000]
        .into_iter()
        .map(|rate| (format!("CAN {} kbit/s", rate / 1000), classic(rate)))
        .collect();
    all.push((format!("CAN FD {} / {} Mbit/s", fd.nominal / 1_000_000, fd.data / 1_000_000), fd));
    all
}

/// The table, in Markdown.
pub fn table() -> String {
    let mut text = "| six axes at once | tables [B/s] | all [B/s] | load by tables | load by all |\n\
                    |---|---:|---:|---:|---:|\n"
        .to_owned();
    for (name, timing) in buses() {
        let c = cost(timing);
        let _ = writeln!(
            text,
            "| Feedspline, {name} | {:.0} | {:.0} | {:.2} % | {:.2} % |",
            c.table_bytes_s,
            c.bytes_s,
            100.0 * c.load[0],
            100.0 * c.load[1]
        );
    }
    for (name, period_s, record) in OTHERS {
        let [bytes, load] = record_cost(period_s, record);
        let load = 100.0 * load;
        let _ = writeln!(
            text,
            "| {name}, CAN 1000 kbit/s | {bytes:.0} | {bytes:.0} | {load:.2} % | {load:.2} % |"
        );
    }
    text
}

/// What a record of eight bytes says of an axis: position [counts], velocity [counts/s], time to the next one [s].
type Record = fn(i64, f64, f64) -> [u8; 8];

/// Other ways to tell the same motion.
const OTHERS: [(&str, f64, Record); 2] = [
    ("set-points of 8 bytes every 1 ms", 1.0 / CYCLIC_HZ, setpoint),
    ("records of position, velocity and time, 8 bytes every 10 ms", PVT_S, pvt),
];

/// Position and velocity, 32 bits each.
fn setpoint(position: i64, velocity: f64, _: f64) -> [u8; 8] {
    let [a, b, c, d] = (position as i32).to_le_bytes();
    let [e, f, g, h] = (velocity as i32).to_le_bytes();
    [a, b, c, d, e, f, g, h]
}

/// Time [ms] in 8 bits, velocity in 24, position in 32.
fn pvt(position: i64, velocity: f64, time_s: f64) -> [u8; 8] {
    let [a, b, c, d] = (position as i32).to_le_bytes();
    let [e, f, g, _] = (velocity as i32).to_le_bytes();
    [(1000.0 * time_s) as u8, e, f, g, a, b, c, d]
}

/// Bytes per second of motion, and the load, of one record per axis and period of the same motion.
fn record_cost(period_s: f64, record: Record) -> [f64; 2] {
    let machine = machine();
    let limits = LimitSet::VelocityAccelerationJerk;
    let chain = chain::plan(program().as_bytes(), &machine, &Options::default(), limits).unwrap();
    let timing = BitTiming::default();
    let (mut bytes, mut busy, mut motion_s) = (0u64, 0, 0.0);
    for item in &chain.plan.items {
        let JobItem::Section(section) = item else { continue };
        let table = &section.table;
        motion_s += table.duration();
        let mut cursor = Cursor::new(table);
        for k in 0..(table.duration() / period_s).ceil() as u64 {
            let state = cursor.seek(k as f64 * period_s);
            for (node, (axis, of)) in cursor.axes(&state).zip(&machine.axes).enumerate() {
                let [p, v] = [axis.position, axis.velocity].map(|x| x * of.counts_per_unit);
                let frame = Frame::new(0x201 + node as u16, &record(p.round() as i64, v, period_s)).unwrap();
                bytes += frame.data().len() as u64;
                busy += timing.time(&frame, Stuffing::Exact);
            }
        }
    }
    [bytes as f64 / motion_s, busy as f64 * 1e-9 / motion_s]
}

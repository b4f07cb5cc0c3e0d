//! A fleet on a bus that errs as CAN does, and what has come of it.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::missing_panics_doc,
    reason = "helpers of tests fail as tests do"
)]

use host_sim::bus::{BitTiming, Bus, CanBus, Frame, NodeIndex, Stuffing};
use host_sim::drive_node::Buffers;
use host_sim::fleet::{Event, Fleet, FleetSettings};
use host_sim::host_node::HostError;
use protocol::message::{State, Status};

use crate::fleet::{Job, PathOracle, Record};

/// A millisecond [ns].
pub const MS: u64 = 1_000_000;

/// A fleet on its bus. A host that gives up is gone with the next event, but for what it has queued.
#[derive(Debug)]
pub struct Scene<'m> {
    job: &'m Job,
    /// Drives and host.
    pub fleet: Fleet<'m>,
    /// The bus.
    pub bus: CanBus,
    /// Where the host is on it.
    pub host: NodeIndex,
    /// A node that listens, and says what the test wants.
    pub somebody: NodeIndex,
    /// Why the host has given up.
    pub error: Option<HostError>,
    /// What host and drives have sent so far.
    pub heard: Vec<Frame>,
    record: Record,
    /// Each axis has given a set-point that is not at rest.
    pub moved: Vec<bool>,
    origin: Vec<i64>,
}

impl<'m> Scene<'m> {
    /// Everything as usual.
    pub fn new(job: &'m Job, buffers: &'m mut [Buffers]) -> Self {
        Self::on(job, buffers, BitTiming::default())
    }

    /// On a bus with another timing.
    pub fn on(job: &'m Job, buffers: &'m mut [Buffers], timing: BitTiming) -> Self {
        let mut bus = CanBus::new(timing, Stuffing::Exact, 17);
        let somebody = bus.attach();
        // Its frames may have the identifiers of others.
        bus.controller(somebody).one_shot = true;
        let mut fleet =
            job.fleet(buffers, FleetSettings { host_jitter: 50_000, ..FleetSettings::default() }, &mut bus);
        let host = fleet.host().node();
        let origin = job.cast.drives.iter().map(|drive| drive.axis.position).collect();
        let moved = vec![false; fleet.axes()];
        let (heard, record) = (Vec::new(), Record::default());
        Self { job, fleet, bus, host, somebody, error: None, heard, record, moved, origin }
    }

    /// A new host on a node of its own, which takes the place of the one that was.
    pub fn new_host(&mut self) {
        let host = self.job.host(&mut self.bus);
        self.host = host.node();
        self.fleet.replace_host(host);
        self.error = None;
    }

    /// The next thing that happens.
    pub fn step(&mut self) -> Event {
        let event = self.fleet.step(&mut self.bus);
        while let Some(received) = self.bus.receive(self.somebody) {
            self.heard.push(received.frame);
        }
        match event {
            Event::Failed(error) => {
                self.error = self.error.or(Some(error));
                self.fleet.kill_host();
            }
            Event::Tick { axis, setpoint, .. } => {
                self.moved[axis] |= !setpoint.done || setpoint.position != self.origin[axis];
            }
            Event::Host => {}
        }
        if self.moved.iter().any(|moved| *moved) {
            self.record.add(&event, self.fleet.axes(), self.fleet.now());
        }
        event
    }

    /// Lets so many milliseconds pass.
    pub fn pass(&mut self, ms: u64) {
        let end = self.fleet.now() + ms * MS;
        while self.fleet.now() < end {
            self.step();
        }
    }

    /// Lets time pass until something is so.
    pub fn until(&mut self, what: &str, mut so: impl FnMut(&Self) -> bool) {
        let end = self.fleet.now() + 20_000 * MS;
        while !so(self) {
            self.step();
            assert!(self.fleet.now() < end, "{what} never comes: {:?} {:?}", self.error, self.statuses());
        }
    }

    /// Lets time pass until axes move.
    pub fn until_moving(&mut self) {
        self.until("motion", |scene| scene.moved.iter().any(|moved| *moved));
    }

    /// Lets time pass until each drive is in a state.
    pub fn until_all(&mut self, state: State) {
        self.until("the state", |scene| scene.statuses().iter().all(|status| status.state == state));
    }

    /// How the drives are.
    pub fn statuses(&self) -> Vec<Status> {
        (0..self.fleet.axes()).map(|axis| self.fleet.drive(axis).status()).collect()
    }

    /// A node says something.
    pub fn say(&mut self, frame: Frame) {
        let now = self.fleet.now();
        self.bus.send(self.somebody, frame, now);
    }

    /// A drive hangs on the bus here.
    pub fn drive_node(&self, axis: usize) -> NodeIndex {
        self.fleet.node(axis)
    }

    /// No axis has moved, nor does it within so many milliseconds.
    pub fn assert_never_moves(&mut self, ms: u64) {
        self.pass(ms);
        assert!(self.moved.iter().all(|moved| !moved), "{:?}: {:?}", self.moved, self.statuses());
    }

    /// All axes are at rest after so many milliseconds, and stay so; no fault is made up.
    pub fn assert_comes_to_rest(&mut self, ms: u64) {
        self.pass(ms);
        let before: Vec<i64> = self.statuses().iter().map(|status| status.position).collect();
        self.pass(300);
        for (status, before) in self.statuses().iter().zip(before) {
            assert_eq!(status.position, before, "still moves: {status:?}");
            let moves =
                matches!(status.state, State::Running | State::Moving | State::Stopping | State::Armed);
            assert!(!moves, "{status:?}");
        }
    }

    /// No drive has a fault.
    pub fn assert_no_fault(&self) {
        assert!(self.statuses().iter().all(|status| status.fault.is_none()), "{:?}", self.statuses());
    }

    /// All axes have been on the path all the time, to a count.
    pub fn assert_on_path(&self, path: &PathOracle<'_>) {
        let all: Vec<_> = self.record.complete().collect();
        for positions in all.iter().step_by(4).chain(all.last()) {
            let off = path.distance(positions);
            assert!(off <= 1.0, "{off} counts off the path at {positions:?}");
        }
    }

    /// The whole job was played.
    pub fn assert_played_to_the_end(&self) {
        let ends = self.job.cast.orders.last().unwrap().packed.axes.iter().map(|axis| axis.header.end);
        for (status, end) in self.statuses().iter().zip(ends) {
            assert_eq!((status.position, status.fault), (end, None), "{:?}: {status:?}", self.error);
        }
    }

    /// Every frame that the host has sent, as anybody could have written it down.
    pub fn words_of_the_host(&self) -> Vec<Frame> {
        let host = |id: u16| (0x200..0x280).contains(&id) || (0x300..0x380).contains(&id);
        self.heard.iter().copied().filter(|frame| host(frame.id())).collect()
    }
}

//! The host on the bus: sends tables, waits until every drive is ready, starts all of them at one named tick.
//!
//! Drives hold two tables: while one plays the next is sent, checked and armed, so motion waits for the bus only
//! when a table is shorter than the sending of the next one. A start is repeated until the status of every drive
//! shows that it will play to the same tick; if one does not say so in time, the start is called off for all.

mod upload;

use std::collections::VecDeque;

use planner::feed::pack::Packed;
use protocol::bus::{BLOCK_BYTES, FrameSize, Node, Reassembler, Segments, ids};
use protocol::message::{DriveMessage, Fault, HostMessage, MessageBuffer, Reject, Status, decode, encode};
use protocol::power::{Power, PowerEvent};

use crate::bus::{Bus, Nanoseconds, NodeIndex};
use upload::{Block, Upload};

/// Frames the host keeps in its interface's queue: two blocks, so that the wire never waits for the host.
const QUEUED_FRAMES: usize = 96;
/// How often a stop is sent: it has no acknowledgement.
const STOP_COPIES: usize = 3;
/// Rounds without progress after which a drive counts as silent.
const MAX_ROUNDS: u32 = 40;
/// How much the time between command and start may grow after starts that were called off.
const MAX_LEAD_GROWTH: u32 = 6;

/// One table to play.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// The table; its number is its place among the orders.
    pub packed: Packed,
    /// Ticks at rest before it, on top of the handover.
    pub pause: u64,
}

/// How the host deals with time, in control ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostTiming {
    /// Ticks at rest between two tables.
    pub handover: u64,
    /// From the command to start to the start: at least a status period and the time of a few messages.
    pub lead: u64,
    /// How long a silent drive is waited for.
    pub answer: u64,
    /// How long before a start that not all have confirmed it is called off.
    pub guard: u64,
}

/// A table with its agreed start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// Which order.
    pub order: usize,
    /// Tick of its first set-point.
    pub start: u64,
    /// The last set-point comes so many ticks later.
    pub ticks: u64,
}

/// Why the host gives up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HostError {
    /// A drive refuses a table for good.
    #[error("axis {axis} refuses table {table}: {reason:?}")]
    Rejected {
        /// Which axis.
        axis: usize,
        /// Which table.
        table: u32,
        /// Its reason.
        reason: Reject,
    },
    /// A drive does not answer, or never completely.
    #[error("axis {axis} does not answer for table {table}")]
    Silent {
        /// Which axis.
        axis: usize,
        /// Which table.
        table: u32,
    },
    /// A drive has given up.
    #[error("axis {axis} is in fault: {fault:?}")]
    Faulted {
        /// Which axis.
        axis: usize,
        /// Its reason.
        fault: Fault,
    },
    /// Two drives do not agree on how long a table plays.
    #[error("axis {axis} would play table {table} for another time than the first axis")]
    Disagree {
        /// Which axis.
        axis: usize,
        /// Which table.
        table: u32,
    },
}

/// What the host has gone through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HostCounters {
    /// Blocks that were sent again.
    pub resent_blocks: u64,
    /// Starts that were called off.
    pub aborted_starts: u64,
}

/// The host.
#[derive(Debug)]
pub struct HostNode<'a> {
    node: NodeIndex,
    frames: FrameSize,
    timing: HostTiming,
    orders: &'a [Order],
    drives: Vec<Link>,
    next: usize,
    phase: Phase<'a>,
    outbox: VecDeque<Command>,
    runs: VecDeque<Run>,
    lead_growth: u32,
    /// When drives without torque are told again to enable operation.
    enable_at: u64,
    counters: HostCounters,
}

/// What the host knows of one drive.
#[derive(Debug)]
struct Link {
    address: Node,
    incoming: Reassembler<BLOCK_BYTES>,
    status: Option<Status>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Command {
    Send(Block),
    Start {
        table: u32,
        tick: u64,
    },
    Stop,
    /// To one drive, by its index.
    Power(usize, PowerEvent),
}

#[derive(Debug)]
enum Phase<'a> {
    /// Nothing is on its way.
    Idle,
    /// A table is being sent.
    Uploading(Upload<'a>),
    /// All drives hold the table and are told when it starts.
    Starting { upload: Upload<'a>, run: Run, repeat_at: u64 },
}

impl<'a> HostNode<'a> {
    /// A host that will have `orders` played by as many drives as their tables have axes, at the addresses from 1.
    pub fn new(
        orders: &'a [Order],
        axes: u8,
        frames: FrameSize,
        timing: HostTiming,
        bus: &mut dyn Bus,
    ) -> Self {
        let link = |address| Link { address, incoming: Reassembler::new(), status: None };
        Self {
            node: bus.attach(),
            frames,
            timing,
            orders,
            drives: (1..=axes).filter_map(Node::new).map(link).collect(),
            next: 0,
            phase: Phase::Idle,
            outbox: VecDeque::new(),
            runs: VecDeque::new(),
            lead_growth: 0,
            enable_at: 0,
            counters: HostCounters::default(),
        }
    }

    /// One turn, at tick `tick` of the drives' common count.
    ///
    /// # Errors
    /// When a drive refuses, fails or is silent for good.
    pub fn tick(&mut self, bus: &mut dyn Bus, tick: u64, now: Nanoseconds) -> Result<(), HostError> {
        while let Some(received) = bus.receive(self.node) {
            self.listen(received.frame.id(), received.frame.data())?;
        }
        let sent = self.outbox.is_empty() && bus.waiting(self.node) == 0;
        self.decide(tick, sent)?;
        while bus.waiting(self.node) < QUEUED_FRAMES {
            let Some(command) = self.outbox.pop_front() else { break };
            self.send(command, bus, now);
        }
        Ok(())
    }

    /// The table that plays at `tick`, if any.
    pub fn run_at(&self, tick: u64) -> Option<Run> {
        self.runs.iter().copied().find(|r| (r.start..=r.start + r.ticks).contains(&tick))
    }

    /// Whether all tables have been played at `tick`.
    pub fn is_finished(&self, tick: u64) -> bool {
        self.next == self.orders.len()
            && matches!(self.phase, Phase::Idle)
            && self.runs.back().is_none_or(|r| tick > r.start + r.ticks)
    }

    /// What the host has gone through.
    pub fn counters(&self) -> HostCounters {
        self.counters
    }

    fn listen(&mut self, id: u16, data: &[u8]) -> Result<(), HostError> {
        let number = Node::of_answer(id).map(Node::number).unwrap_or_default();
        let Some(axis) = usize::from(number).checked_sub(1) else { return Ok(()) };
        let Some(link) = self.drives.get_mut(axis) else { return Ok(()) };
        // A message with a lost frame is as good as none: silence is what the host acts on.
        let Ok(Some(bytes)) = link.incoming.push(data) else { return Ok(()) };
        let Ok(message) = decode::<DriveMessage>(bytes) else { return Ok(()) };
        if let DriveMessage::Status(status) = message {
            link.status = Some(status);
            return match status.fault {
                Some(fault) => Err(HostError::Faulted { axis, fault }),
                None => Ok(()),
            };
        }
        match &mut self.phase {
            Phase::Idle => Ok(()),
            // Commands on the way to torque may get lost and are repeated; what is refused then is no loss.
            Phase::Uploading(_) if refused_without_torque(&message) => Ok(()),
            Phase::Uploading(upload) | Phase::Starting { upload, .. } => upload.answered(axis, &message),
        }
    }

    fn decide(&mut self, tick: u64, sent: bool) -> Result<(), HostError> {
        if self.runs.is_empty() {
            self.enable(tick);
        }
        self.phase = match core::mem::replace(&mut self.phase, Phase::Idle) {
            Phase::Idle => self.begin(tick),
            Phase::Uploading(upload) => self.upload(upload, tick, sent)?,
            Phase::Starting { upload, run, repeat_at } => self.start(upload, run, repeat_at, tick)?,
        };
        Ok(())
    }

    /// Leads drives that do not follow set-points yet through their power states.
    fn enable(&mut self, tick: u64) {
        if tick < self.enable_at {
            return;
        }
        self.enable_at = tick + self.timing.answer;
        for (index, link) in self.drives.iter().enumerate() {
            let commands: &[PowerEvent] = match link.status.map(|s| s.power) {
                None | Some(Power::SwitchOnDisabled) => &[PowerEvent::Shutdown, PowerEvent::EnableOperation],
                Some(Power::ReadyToSwitchOn | Power::SwitchedOn) => &[PowerEvent::EnableOperation],
                Some(_) => &[],
            };
            self.outbox.extend(commands.iter().map(|&event| Command::Power(index, event)));
        }
    }

    fn all_enabled(&self) -> bool {
        let enabled = |s: Status| s.power == Power::OperationEnabled;
        self.drives.iter().all(|link| link.status.is_some_and(enabled))
    }

    /// Takes up the next order once the drives have a buffer free: when the table before it plays.
    fn begin(&mut self, tick: u64) -> Phase<'a> {
        while self.runs.len() > 1 && self.runs[0].start + self.runs[0].ticks < tick {
            self.runs.pop_front();
        }
        match self.orders.get(self.next) {
            Some(order) if self.runs.back().is_none_or(|r| tick > r.start) => {
                let upload = Upload::new(&order.packed, self.drives.len());
                self.outbox.extend(upload.everything().map(Command::Send));
                Phase::Uploading(upload)
            }
            _ => Phase::Idle,
        }
    }

    fn upload(&mut self, mut upload: Upload<'a>, tick: u64, sent: bool) -> Result<Phase<'a>, HostError> {
        if let Some(ticks) = upload.agreed()? {
            if !self.all_enabled() {
                return Ok(Phase::Uploading(upload));
            }
            let earliest = tick + (self.timing.lead << self.lead_growth);
            let after = self.runs.back().map_or(0, |r| r.start + r.ticks + self.timing.handover);
            let start = earliest.max(after + self.orders[self.next].pause);
            let run = Run { order: self.next, start, ticks };
            return Ok(Phase::Starting { upload, run, repeat_at: tick });
        }
        if sent && upload.is_overdue(tick, self.timing.answer) {
            self.again(&mut upload)?;
        }
        Ok(Phase::Uploading(upload))
    }

    /// Sends again what is missing.
    fn again(&mut self, upload: &mut Upload<'a>) -> Result<(), HostError> {
        let before = self.outbox.len();
        self.outbox.extend(upload.missing(MAX_ROUNDS)?.into_iter().map(Command::Send));
        self.counters.resent_blocks += (self.outbox.len() - before) as u64;
        Ok(())
    }

    fn start(
        &mut self,
        mut upload: Upload<'a>,
        run: Run,
        repeat_at: u64,
        tick: u64,
    ) -> Result<Phase<'a>, HostError> {
        let will_play = |link: &Link| link.status.is_some_and(|s| s.tick + s.fill == run.start + run.ticks);
        if self.drives.iter().all(will_play) {
            self.runs.push_back(run);
            self.next += 1;
            self.lead_growth = 0;
            return Ok(Phase::Idle);
        }
        if upload.is_refused() || tick + self.timing.guard >= run.start {
            // What was received is forgotten with the stop, so the table is sent anew.
            self.counters.aborted_starts += 1;
            self.lead_growth = (self.lead_growth + 1).min(MAX_LEAD_GROWTH);
            self.outbox.clear();
            self.outbox.extend([Command::Stop; STOP_COPIES]);
            upload.begin_anew();
            self.again(&mut upload)?;
            return Ok(Phase::Uploading(upload));
        }
        if tick >= repeat_at {
            self.outbox.push_back(Command::Start { table: upload.table(), tick: run.start });
            let repeat_at = tick + (self.timing.lead / 4).max(1);
            return Ok(Phase::Starting { upload, run, repeat_at });
        }
        Ok(Phase::Starting { upload, run, repeat_at })
    }

    fn send(&self, command: Command, bus: &mut dyn Bus, now: Nanoseconds) {
        let (id, message) = match command {
            Command::Send(block) => {
                let (Phase::Uploading(upload) | Phase::Starting { upload, .. }) = &self.phase else { return };
                let (axis, message) = upload.message(block);
                let to = axis.and_then(|axis| self.drives.get(axis));
                (to.map_or(ids::BROADCAST, |link| link.address.to_drive()), message)
            }
            Command::Start { table, tick } => (ids::BROADCAST, HostMessage::Start { table, tick }),
            Command::Stop => (ids::STOP, HostMessage::Stop),
            Command::Power(drive, event) => {
                let Some(link) = self.drives.get(drive) else { return };
                (link.address.to_drive(), HostMessage::Power(event))
            }
        };
        let mut buffer: MessageBuffer = [0; _];
        // Every message fits the buffer: data is cut to `DATA_BYTES`.
        let Ok(bytes) = encode(&message, &mut buffer) else { return };
        for frame in Segments::new(id, self.frames, bytes).into_iter().flatten() {
            bus.send(self.node, frame, now);
        }
    }
}

fn refused_without_torque(message: &DriveMessage) -> bool {
    matches!(message, DriveMessage::Reject { reason: Reject::Power(_) | Reject::Moves, .. })
}

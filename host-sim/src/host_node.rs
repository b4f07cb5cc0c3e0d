//! The host on the bus: opens an epoch with every drive, sends tables, waits until every drive is ready, starts all of them at
//! one named tick.
//!
//! Drives hold two tables: while one plays the next is sent, checked and armed, so motion waits for the bus only
//! when a table is shorter than the sending of the next one. A start is repeated until the beat of every drive
//! confirms it; if one does not in time, the start is called off for all, with the epoch. A piece that takes over from the one
//! before it is committed when all drives are ready for it.

mod command;
mod greeting;
mod link;
mod upload;

use std::cell::Cell;
use std::collections::VecDeque;
use std::sync::Arc;

use planner::feed::pack::Packed;
use protocol::authentic::Key;
use protocol::bus::beat::Beat;
use protocol::bus::stop::Stop;
use protocol::bus::{Frame, FrameSize, Node};
use protocol::message::{DriveMessage, Fault, HostMessage, Reject, Status};
use protocol::power::{Power, PowerEvent};

use crate::bus::{Bus, Nanoseconds, NodeIndex};
use command::{Change, Command};
use greeting::Greeting;
pub use greeting::Mismatch;
use link::Heard;
pub use link::Link;
use upload::Upload;

/// Frames the host keeps in its interface's queue, so that the wire never waits for the host.
const QUEUED_FRAMES: usize = 48;
/// How often a stop is sent: it has no acknowledgement.
const STOP_COPIES: usize = 3;
/// Rounds without progress after which a drive counts as silent.
const MAX_ROUNDS: u32 = 40;
/// How long a drive with its table may take until it is ready to move [ns].
const UNREADY_NS: u64 = 60_000_000_000;
/// How much the time between command and start may grow after starts that were called off.
const MAX_LEAD_GROWTH: u32 = 6;

/// One table to play.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// The table.
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
    /// Between two signs of life.
    pub alive: u64,
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
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
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
    #[error("axis {axis} does not answer")]
    Silent {
        /// Which axis.
        axis: usize,
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
    /// A drive is not what the job needs.
    #[error("axis {axis} does not fit: {mismatch}")]
    Mismatch {
        /// Which axis.
        axis: usize,
        /// In what.
        mismatch: Mismatch,
    },
    /// Somebody else has told the drives to stop: nothing goes on by itself.
    #[error("axis {axis} was told to stop by somebody else")]
    Told {
        /// Which axis, or the first one of all.
        axis: usize,
    },
    /// A drive does not get ready to move.
    #[error("axis {axis} is not ready to move: {}", unready(beat.as_ref()))]
    Unready {
        /// Which axis.
        axis: usize,
        /// What it has said last.
        beat: Option<Beat>,
    },
    /// The drives have stopped on their path.
    #[error("axis {axis} has ended its epoch: the drives stop on their path")]
    Stopped {
        /// Which axis was seen first.
        axis: usize,
    },
}

/// What the host has gone through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HostCounters {
    /// Data frames and messages that were sent again.
    pub resent_blocks: u64,
    /// Starts that were called off.
    pub aborted_starts: u64,
}

/// The host.
#[derive(Debug)]
pub struct HostNode {
    node: NodeIndex,
    frames: FrameSize,
    timing: HostTiming,
    /// Tables that are not confirmed yet, and the last one that is.
    orders: VecDeque<Arc<Order>>,
    /// How many are no longer among them.
    dropped: usize,
    /// No more will come.
    closed: bool,
    tick_ns: u32,
    drives: Vec<Link>,
    greeting: Greeting,
    next: usize,
    phase: Phase,
    outbox: VecDeque<Command>,
    /// Frames of commands that did not fit the interface's queue.
    pending: VecDeque<Frame>,
    runs: VecDeque<Run>,
    lead_growth: u32,
    /// When drives without torque are told again to enable operation.
    enable_at: u64,
    alive_at: u64,
    /// Since when drives that hold a table are waited for.
    unready_since: Option<u64>,
    change: Option<Change>,
    changes: u8,
    /// When motion ends is known to the drives only: it was put together of pieces, or its rate has been changed.
    loose: bool,
    stopped: bool,
    refusal: Option<Reject>,
    /// A tick of the drives' count, and when it was told.
    reading: Option<(u64, Nanoseconds)>,
    counters: HostCounters,
    /// What messages that move or configure anything are signed with.
    key: Option<Key>,
    /// Of the last signed message.
    counter: Cell<u64>,
    /// At the beginning of time, and now: what counters are made of, so that those of a later host are greater [us].
    began_us: u64,
    stamp_us: u64,
}

#[derive(Debug)]
enum Phase {
    /// Nothing is on its way.
    Idle,
    /// A table is being sent.
    Uploading(Upload),
    /// All drives hold the table and are told when it starts.
    Starting { upload: Upload, run: Run, repeat_at: u64 },
}

impl HostNode {
    /// A host of as many drives as there are axes, at the addresses from 1, that waits for orders.
    pub fn new(axes: u8, frames: FrameSize, timing: HostTiming, bus: &mut dyn Bus) -> Self {
        Self {
            node: bus.attach(),
            frames,
            timing,
            orders: VecDeque::new(),
            dropped: 0,
            closed: false,
            tick_ns: 1_000_000,
            drives: (1..=axes).filter_map(Node::new).map(Link::new).collect(),
            greeting: Greeting::default(),
            next: 0,
            phase: Phase::Idle,
            outbox: VecDeque::new(),
            pending: VecDeque::new(),
            runs: VecDeque::new(),
            lead_growth: 0,
            enable_at: 0,
            alive_at: 0,
            unready_since: None,
            change: None,
            changes: 0,
            loose: false,
            stopped: false,
            refusal: None,
            reading: None,
            counters: HostCounters::default(),
            key: None,
            counter: Cell::new(0),
            began_us: 0,
            stamp_us: 0,
        }
    }

    /// Signs with a key from now on. Counters are times since `began_us` at time 0: greater than those of any host before [us].
    pub fn sign_with(&mut self, key: Key, began_us: u64) {
        (self.key, self.began_us) = (Some(key), began_us);
    }

    /// Another table to play, behind all others.
    pub fn push(&mut self, order: Order) {
        self.tick_ns = order.packed.header.tick_ns.max(1);
        self.orders.push_back(Arc::new(order));
    }

    /// No more tables will come.
    pub fn close(&mut self) {
        self.closed = true;
    }

    /// It has less than two tables in hand that drives could take, and more are to come.
    pub fn is_hungry(&self) -> bool {
        !self.closed && self.waiting() < 2
    }

    fn waiting(&self) -> usize {
        (self.dropped + self.orders.len()).saturating_sub(self.next)
    }

    fn order(&self, number: usize) -> Option<&Arc<Order>> {
        self.orders.get(number.checked_sub(self.dropped)?)
    }

    /// One turn of a host that knows of the drives' count what they tell: a tick of it is some ticks old.
    ///
    /// # Errors
    /// When a drive refuses, fails or is silent for good.
    pub fn turn(&mut self, bus: &mut dyn Bus, now: Nanoseconds) -> Result<(), HostError> {
        if let Some(status) = self.drives.first_mut().and_then(Link::take_fresh_status) {
            self.reading = Some((status.tick, now));
        }
        let tick = self.tick_at(now);
        self.tick(bus, tick, now)
    }

    /// The tick of the drives' common count, as far as the host knows.
    pub fn tick_at(&self, now: Nanoseconds) -> u64 {
        let (tick, then) = self.reading.unwrap_or_default();
        tick + now.saturating_sub(then) / u64::from(self.tick_ns)
    }

    /// One turn, at tick `tick` of the drives' common count.
    ///
    /// # Errors
    /// When a drive refuses, fails or is silent for good.
    pub fn tick(&mut self, bus: &mut dyn Bus, tick: u64, now: Nanoseconds) -> Result<(), HostError> {
        self.stamp_us = self.began_us.saturating_add(now / 1_000);
        let result = self.take_turn(bus, tick);
        if let Err(error) = &result
            && !core::mem::replace(&mut self.stopped, true)
        {
            self.give_up(error);
        }
        self.transmit(bus, now);
        result
    }

    /// What some drives hold already they must not begin without the others, and what moves must not go on without one of them.
    fn give_up(&mut self, error: &HostError) {
        self.outbox.clear();
        self.pending.clear();
        let refused = matches!(error, HostError::Rejected { .. } | HostError::Disagree { .. });
        let last = if refused || self.runs.is_empty() {
            Command::Cancel
        } else {
            Command::Stop(Stop::Path { tick: None })
        };
        self.outbox.extend([last; STOP_COPIES]);
    }

    fn take_turn(&mut self, bus: &mut dyn Bus, tick: u64) -> Result<(), HostError> {
        while let Some(received) = bus.receive(self.node) {
            self.listen(&received.frame)?;
        }
        let sent = self.outbox.is_empty() && self.pending.is_empty() && bus.waiting(self.node) == 0;
        self.decide(tick, sent)
    }

    /// Hands frames to the interface, as many as fit its queue.
    fn transmit(&mut self, bus: &mut dyn Bus, now: Nanoseconds) {
        while bus.waiting(self.node) < QUEUED_FRAMES && bus.has_room(self.node) {
            if let Some(frame) = self.pending.pop_front() {
                bus.send(self.node, frame, now);
            } else if let Some(command) = self.outbox.pop_front() {
                let frames = self.frames_of(command);
                self.pending.extend(frames);
            } else {
                break;
            }
        }
    }

    /// Where the host is on the bus.
    pub fn node(&self) -> NodeIndex {
        self.node
    }

    /// The table that plays at `tick`, if any.
    pub fn run_at(&self, tick: u64) -> Option<Run> {
        self.runs.iter().copied().find(|r| (r.start..=r.start + r.ticks).contains(&tick))
    }

    /// Whether all tables have been played at `tick`.
    pub fn is_finished(&self, tick: u64) -> bool {
        let played = if self.loose {
            self.drives.iter().all(Link::has_come_to_rest)
        } else {
            self.runs.back().is_none_or(|r| tick > r.start + r.ticks)
        };
        self.closed && self.waiting() == 0 && matches!(self.phase, Phase::Idle) && played
    }

    /// Whether all drives stand still, after a stop or otherwise.
    pub fn is_at_rest(&self) -> bool {
        self.drives.iter().all(Link::stands)
    }

    /// What the host has gone through.
    pub fn counters(&self) -> HostCounters {
        self.counters
    }

    /// How many orders all drives have confirmed.
    pub fn confirmed(&self) -> usize {
        self.next
    }

    /// The axes are on a motion of which a piece is still to be confirmed.
    pub fn has_more_of_the_motion(&self) -> bool {
        let joins = self.order(self.next).is_some_and(|order| order.packed.header.joint.is_some());
        joins && !self.is_at_rest()
    }

    /// What every drive has told last, in the order of the axes.
    pub fn drives(&self) -> impl Iterator<Item = &Link> {
        self.drives.iter()
    }

    /// Path time goes at another rate [0.1 %] as soon as all drives have confirmed it; what has not been confirmed by its tick
    /// becomes a stop on the path.
    pub fn change_rate(&mut self, permille: u16, tick: u64) {
        // Somebody else may have changed it since.
        let known = self.drives.iter().filter_map(Link::beat).map(|beat| beat.change);
        let last = known.fold(self.changes, u8::max);
        self.changes = if last == u8::MAX { 1 } else { last + 1 };
        let tick = tick + self.timing.lead.max(2 * self.timing.guard);
        self.loose = true;
        self.change = Some(Change { permille, tick, number: self.changes, repeat_at: 0 });
    }

    /// All drives follow set-points, in step with each other, and may be told to move.
    pub fn is_ready(&self) -> bool {
        self.greeting.is_open() && self.all_enabled()
    }

    /// The control tick of the drives, where no table tells it.
    pub fn set_tick_ns(&mut self, tick_ns: u32) {
        self.tick_ns = tick_ns.max(1);
    }

    /// Why a drive has refused what it was told last, if it has.
    pub fn refusal(&self) -> Option<Reject> {
        self.refusal
    }

    /// Tells one drive something, inside the open epoch.
    pub fn tell(&mut self, axis: usize, message: HostMessage<'static>) {
        self.outbox.push_back(Command::Tell(axis, message));
    }

    /// Ends the epoch of drives that have nothing left to do.
    pub fn part(&mut self) {
        self.outbox.extend([Command::Cancel; STOP_COPIES]);
        self.stopped = true;
    }

    /// Everything has been handed to the bus.
    pub fn has_said_all(&self) -> bool {
        self.outbox.is_empty() && self.pending.is_empty()
    }

    /// Stops all drives; the epoch ends.
    pub fn stop(&mut self, stop: Stop) {
        self.outbox.clear();
        self.pending.clear();
        self.outbox.extend([Command::Stop(stop); STOP_COPIES]);
        self.phase = Phase::Idle;
        self.orders.clear();
        (self.dropped, self.closed) = (self.next, true);
        self.stopped = true;
    }

    fn listen(&mut self, frame: &Frame) -> Result<(), HostError> {
        let (id, data) = (frame.id(), frame.data());
        if let Some(axis) = self.drives.iter().position(|link| link.is_told_to_stop(frame)) {
            return if self.stopped { Ok(()) } else { Err(HostError::Told { axis }) };
        }
        let epoch = self.greeting.epoch();
        let heard = self
            .drives
            .iter_mut()
            .enumerate()
            .find_map(|(axis, link)| link.listen(id, data).map(|heard| (axis, heard)));
        let Some((axis, heard)) = heard else { return Ok(()) };
        let message = match heard {
            Heard::Beat(beat) => {
                let closed = self.greeting.is_open() && beat.epoch == epoch as u8 && !beat.open;
                return if closed { self.closed(axis) } else { Ok(()) };
            }
            Heard::Boot => return if self.greeting.is_open() { self.closed(axis) } else { Ok(()) },
            Heard::Message(message) => message,
        };
        match message {
            DriveMessage::Status(Status { fault: Some(fault), .. }) => {
                return Err(HostError::Faulted { axis, fault });
            }
            DriveMessage::Status(_) | DriveMessage::Telemetry(_) | DriveMessage::Identity(_) => return Ok(()),
            DriveMessage::Begun { epoch } => {
                self.greeting.begun(axis, epoch);
                return Ok(());
            }
            DriveMessage::Reject { reason: Reject::Key, .. } => {
                return Err(HostError::Mismatch { axis, mismatch: Mismatch::Key });
            }
            DriveMessage::Reject { reason, .. } if !self.greeting.is_open() => {
                self.greeting.refused(&mut self.drives[axis], reason);
                return Ok(());
            }
            // What was sent before the epoch was open, or after it.
            DriveMessage::Reject { reason: Reject::Epoch { .. }, .. } => return Ok(()),
            _ => {}
        }
        match &mut self.phase {
            Phase::Idle => {
                if let DriveMessage::Reject { reason, .. } = message
                    && !refused_without_torque(&message)
                {
                    self.refusal = Some(reason);
                }
                Ok(())
            }
            // Commands on the way to torque may get lost and are repeated; what is refused then is no loss.
            Phase::Uploading(_) if refused_without_torque(&message) => Ok(()),
            Phase::Uploading(upload) | Phase::Starting { upload, .. } => upload.answered(axis, &message),
        }
    }

    /// A drive has closed the epoch: what has not begun to move is begun anew, what moves stops.
    fn closed(&mut self, axis: usize) -> Result<(), HostError> {
        if self.stopped {
            return Ok(());
        }
        if !self.runs.is_empty() {
            return Err(HostError::Stopped { axis });
        }
        if self.drives[axis].beat().is_some_and(|beat| beat.power == Power::QuickStopActive) {
            return Err(HostError::Told { axis });
        }
        self.begin_anew();
        Ok(())
    }

    fn begin_anew(&mut self) {
        self.outbox.clear();
        self.pending.clear();
        self.greeting.close();
        self.change = None;
        if let Phase::Uploading(upload) | Phase::Starting { upload, .. } = &mut self.phase {
            upload.begin_anew();
        }
        if let Phase::Starting { upload, .. } = core::mem::replace(&mut self.phase, Phase::Idle) {
            self.phase = Phase::Uploading(upload);
        }
    }

    fn decide(&mut self, tick: u64, sent: bool) -> Result<(), HostError> {
        if self.stopped {
            return Ok(());
        }
        if !self.greeting.is_open() {
            if sent {
                let needs = self.order(self.next).cloned();
                let needs = needs.as_ref().map(|order| &order.packed);
                let commands =
                    self.greeting.proceed(&mut self.drives, needs, self.tick_ns, tick, self.timing.answer)?;
                self.outbox.extend(commands);
            }
            return Ok(());
        }
        if tick >= self.alive_at {
            self.alive_at = tick + self.timing.alive;
            self.outbox.push_front(Command::Alive);
        }
        self.pursue_change(tick);
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

    /// Repeats a change of rate until all have confirmed it; what they have not in time becomes a stop.
    fn pursue_change(&mut self, tick: u64) {
        let Some(mut change) = self.change else { return };
        let confirmed = |link: &Link| link.beat().is_some_and(|beat| beat.change == change.number);
        if self.drives.iter().all(confirmed) {
            self.change = None;
            return;
        }
        if tick + self.timing.guard >= change.tick {
            self.stop(Stop::Path { tick: Some(change.tick as u32) });
            self.change = None;
            return;
        }
        if tick >= change.repeat_at {
            change.repeat_at = tick + (self.timing.lead / 4).max(1);
            self.outbox.push_front(Command::Rate(change));
            self.change = Some(change);
        }
    }

    /// Leads drives that do not follow set-points yet through their power states.
    fn enable(&mut self, tick: u64) {
        if tick < self.enable_at {
            return;
        }
        self.enable_at = tick + self.timing.answer;
        for (index, link) in self.drives.iter().enumerate() {
            let commands: &[PowerEvent] = match link.beat().map(|beat| beat.power) {
                None | Some(Power::SwitchOnDisabled) => &[PowerEvent::Shutdown, PowerEvent::EnableOperation],
                Some(Power::ReadyToSwitchOn | Power::SwitchedOn | Power::QuickStopActive) => {
                    &[PowerEvent::EnableOperation]
                }
                Some(Power::Fault) => &[PowerEvent::ResetFault],
                Some(_) => &[],
            };
            self.outbox.extend(commands.iter().map(|&event| Command::Power(index, event)));
        }
    }

    /// All drives follow set-points, in step with each other.
    fn all_enabled(&self) -> bool {
        self.unready().is_none()
    }

    /// The first drive that does not follow set-points in step with the others.
    fn unready(&self) -> Option<usize> {
        let epoch = self.greeting.epoch() as u8;
        self.drives.iter().position(|link| {
            link.beat().is_none_or(|beat| {
                beat.power != Power::OperationEnabled || !beat.synced || !beat.open || beat.epoch != epoch
            })
        })
    }

    /// Takes up the next order once the drives have a buffer free: when the table before it plays.
    fn begin(&mut self, tick: u64) -> Phase {
        while self.runs.len() > 1 && self.runs[0].start + self.runs[0].ticks < tick {
            self.runs.pop_front();
        }
        while self.dropped < self.next && self.orders.pop_front().is_some() {
            self.dropped += 1;
        }
        let Some(order) = self.order(self.next).cloned() else { return Phase::Idle };
        let free = || self.drives.iter().all(|link| link.beat().is_some_and(|beat| beat.free > 0));
        let ready = if self.loose || order.packed.header.joint.is_some() {
            free()
        } else {
            self.runs.back().is_none_or(|r| tick > r.start)
        };
        if !ready {
            return Phase::Idle;
        }
        let upload = Upload::new(order, self.drives.len(), self.frames);
        self.outbox.extend(upload.everything().map(Command::Send));
        Phase::Uploading(upload)
    }

    fn upload(&mut self, mut upload: Upload, tick: u64, sent: bool) -> Result<Phase, HostError> {
        if let Some(ticks) = upload.agreed()? {
            if let Some(axis) = self.unready() {
                let patience = (UNREADY_NS / u64::from(self.tick_ns)).max(self.timing.answer);
                return if tick >= *self.unready_since.get_or_insert(tick) + patience {
                    Err(HostError::Unready { axis, beat: self.drives[axis].beat().copied() })
                } else {
                    Ok(Phase::Uploading(upload))
                };
            }
            self.unready_since = None;
            let joins = upload.packed().header.joint.is_some();
            if self.loose && !joins && !self.is_at_rest() {
                return Ok(Phase::Uploading(upload));
            }
            let earliest = tick + (self.timing.lead << self.lead_growth);
            let after = match self.runs.back() {
                Some(_) if self.loose => tick + self.timing.handover,
                last => last.map_or(0, |r| r.start + r.ticks + self.timing.handover),
            };
            let start = earliest.max(after + upload.pause());
            let run = Run { order: self.next, start, ticks };
            return Ok(Phase::Starting { upload, run, repeat_at: tick });
        }
        if sent && upload.is_overdue(tick, self.timing.answer) {
            self.again(&mut upload)?;
        }
        Ok(Phase::Uploading(upload))
    }

    /// Sends again what is missing.
    fn again(&mut self, upload: &mut Upload) -> Result<(), HostError> {
        let before = self.outbox.len();
        self.outbox.extend(upload.missing(MAX_ROUNDS)?.into_iter().map(Command::Send));
        self.counters.resent_blocks += (self.outbox.len() - before) as u64;
        Ok(())
    }

    fn start(&mut self, mut upload: Upload, run: Run, repeat_at: u64, tick: u64) -> Result<Phase, HostError> {
        let joins = upload.packed().header.joint.is_some();
        let table = upload.table();
        let confirmed =
            |link: &Link| link.beat().is_some_and(|b| b.committed == (table as u8).wrapping_add(1));
        if self.drives.iter().all(confirmed) {
            if joins {
                self.loose = true;
            } else {
                self.runs.push_back(run);
            }
            self.next += 1;
            self.lead_growth = 0;
            return Ok(Phase::Idle);
        }
        if joins && upload.is_refused() {
            // It has come too late: all drives go on to the end of what they hold.
            let reason = Reject::Late { tick };
            return Err(HostError::Rejected { axis: 0, table, reason });
        }
        if !joins && (upload.is_refused() || tick + self.timing.guard >= run.start) {
            // Epoch and table are begun anew, so that no copy of this start is obeyed any more.
            self.counters.aborted_starts += 1;
            self.lead_growth = (self.lead_growth + 1).min(MAX_LEAD_GROWTH);
            self.phase = Phase::Uploading(upload);
            self.begin_anew();
            self.outbox.extend([Command::Cancel; STOP_COPIES]);
            return Ok(core::mem::replace(&mut self.phase, Phase::Idle));
        }
        if tick >= repeat_at {
            upload.hear_no_evil();
            self.outbox.push_back(Command::Start { table, tick: run.start });
            let repeat_at = tick + (self.timing.lead / 4).max(1);
            return Ok(Phase::Starting { upload, run, repeat_at });
        }
        Ok(Phase::Starting { upload, run, repeat_at })
    }
}

/// Why a drive is not ready to move.
fn unready(beat: Option<&Beat>) -> &'static str {
    match beat {
        None => "it sends no beats",
        Some(beat) if beat.power != Power::OperationEnabled => "it does not get torque",
        Some(beat) if !beat.synced => "its clock does not come to agree with the time master's",
        Some(_) => "it does not keep the epoch that it has opened",
    }
}

fn refused_without_torque(message: &DriveMessage) -> bool {
    matches!(message, DriveMessage::Reject { reason: Reject::Power(_) | Reject::Moves, .. })
}

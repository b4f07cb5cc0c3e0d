//! What may move the axis, and what must stop it: epochs, the host's and the other drives' signs of life, the common time.
//!
//! Motion is commanded inside an **epoch** that a host has opened with every drive by name and start-up. Every stop, fault and
//! silence closes it, and nothing of an older epoch ever opens it or moves anything. While drives move together they watch each
//! other's beats: whoever misses the host or another drive, or sees one astray, announces a tick from which on all of them stop
//! on the path; whoever hears that passes it on once, and the earliest tick holds.

use protocol::bus::beat::Beat;
use protocol::bus::emergency::{Cause, Emergency, STOP_CODE, code};
use protocol::bus::stop::Stop;
use protocol::bus::sync::{self, Stamp, Time, nearest};
use protocol::bus::{Frame, Node, ids};
use protocol::message::{HostMessage, Reject, State, Status};
use protocol::power::PowerEvent;

use crate::clock::Clock;
use crate::peers::Peers;

/// How a drive watches over its session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watch {
    /// Another number after every start-up.
    pub boot: u32,
    /// The host counts as lost after so many ticks without a word; 0: never.
    pub host_ticks: u32,
    /// Another drive counts as lost after so many ticks without a beat; 0: never.
    pub drive_ticks: u32,
    /// From the announcement of a stop on the path to its beginning: time for everybody to hear of it.
    pub lead_ticks: u32,
    /// Between two SYNCs, of the time master.
    pub sync_ticks: u32,
}

impl Watch {
    /// As usual, for a control tick [ns] and a time between two beats [ticks]: the host is lost after 0.2 s, a drive after eight
    /// beats, a stop begins 20 ms after its announcement, SYNC comes ten times a second.
    pub const fn new(tick_ns: u32, status_ticks: u32) -> Self {
        Self {
            boot: 0,
            host_ticks: in_ticks(200, tick_ns),
            drive_ticks: status_ticks.saturating_mul(8),
            lead_ticks: in_ticks(20, tick_ns),
            sync_ticks: in_ticks(100, tick_ns),
        }
    }
}

/// Milliseconds as ticks, rounded up.
const fn in_ticks(ms: u32, tick_ns: u32) -> u32 {
    (ms * 1_000_000).div_ceil(if tick_ns == 0 { 1 } else { tick_ns })
}

/// The first SYNCs come faster, by this factor, so that the clocks agree soon.
const HASTE: u32 = 5;
const HASTY: u32 = 24;

/// What becomes of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Admission {
    /// It is obeyed.
    Pass,
    /// It was the session's own.
    Done,
    /// It is refused.
    Refuse(Reject),
}

/// What the session wants of the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Demand {
    /// A stop on the path.
    Hold {
        /// From which tick on.
        tick: u64,
    },
    /// Nothing starts any more.
    Cancel,
    /// Whether it is at rest, and may forget what it holds.
    Clear,
    /// Another tick count.
    Shift {
        /// By so many ticks.
        ticks: i64,
    },
}

/// What a beat tells of what the host has sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Held {
    /// Tables that could be taken.
    pub(crate) free: u8,
    /// The last table that was handed over.
    pub(crate) committed: u8,
    /// The last change of rate.
    pub(crate) change: u8,
}

/// The session of one drive.
#[derive(Clone, Debug)]
pub(crate) struct Session {
    node: Node,
    watch: Watch,
    epoch: u16,
    open: bool,
    /// An epoch that opens when the motion is at rest.
    pending: Option<u16>,
    master: bool,
    /// Tick of the host's last word.
    host: u64,
    peers: Peers,
    /// Tick at which a beat of this drive has left it last: what the others have heard of it. 0: never.
    own: u64,
    /// The tick from which on everybody stops.
    stop: Option<u64>,
    hold: Option<u64>,
    cancel: bool,
    clear: bool,
    shift: Option<i64>,
    announce: Option<Emergency>,
    begun: Option<u16>,
    /// A fault has been told.
    told: bool,
    moving: bool,
    clock: Clock,
    counter: u8,
    syncs: u32,
    sync_at: u64,
    time: Option<Time>,
}

impl Session {
    pub(crate) const fn new(node: Node, watch: Watch, tick_ns: u32) -> Self {
        Self {
            node,
            watch,
            epoch: 0,
            open: false,
            pending: None,
            master: false,
            host: 0,
            peers: Peers::new(),
            own: 0,
            stop: None,
            hold: None,
            cancel: false,
            clear: false,
            shift: None,
            announce: None,
            begun: None,
            told: false,
            moving: false,
            clock: Clock::new(tick_ns),
            counter: 0,
            syncs: 0,
            sync_at: 0,
            time: None,
        }
    }

    pub(crate) fn epoch(&self) -> u16 {
        self.epoch
    }

    pub(crate) fn boot(&self) -> u32 {
        self.watch.boot
    }

    pub(crate) fn clock(&self) -> &Clock {
        &self.clock
    }

    /// Whether a message is obeyed.
    #[inline(never)]
    pub(crate) fn admit(&mut self, epoch: u16, message: &HostMessage<'_>, now: Stamp) -> Admission {
        match *message {
            HostMessage::Identify | HostMessage::Report | HostMessage::Update(_) => Admission::Pass,
            // To stop is always allowed, and ends the epoch.
            HostMessage::Stop
            | HostMessage::QuickStop
            | HostMessage::Power(PowerEvent::QuickStop | PowerEvent::DisableVoltage) => {
                self.close();
                Admission::Pass
            }
            HostMessage::Begin { boot, members } => self.begin(epoch, boot, members, now.tick),
            _ if !self.open || epoch != self.epoch => Admission::Refuse(Reject::Epoch { epoch: self.epoch }),
            _ => {
                self.host = now.tick;
                let starts = matches!(message, HostMessage::Start { .. });
                if starts && !self.agrees(now) { Admission::Refuse(Reject::Clock) } else { Admission::Pass }
            }
        }
    }

    /// Table bytes are taken while motion may begin.
    pub(crate) fn is_open(&self) -> bool {
        self.open
    }

    fn begin(&mut self, epoch: u16, boot: u32, members: u128, now: u64) -> Admission {
        if boot != self.watch.boot {
            return Admission::Refuse(Reject::Boot);
        }
        if self.pending == Some(epoch) {
            // The motion is asked again.
            self.clear = true;
            return Admission::Done;
        }
        if self.open && epoch == self.epoch {
            self.host = now;
            self.begun = Some(epoch);
            return Admission::Done;
        }
        // Serial numbers: newer is what is less than half the circle ahead.
        let newer = epoch.wrapping_sub(self.epoch);
        if newer == 0 || newer > u16::MAX / 2 {
            return Admission::Refuse(Reject::Epoch { epoch: self.epoch });
        }
        // Whoever has opened the present one is still there.
        if self.open && !self.is_lost(now) {
            return Admission::Refuse(Reject::Busy);
        }
        if !self.peers.set(members, self.node) {
            return Admission::Refuse(Reject::Members);
        }
        self.close();
        (self.pending, self.clear) = (Some(epoch), true);
        self.host = now;
        let master = members.trailing_zeros() + 1 == u32::from(self.node.number());
        if master != self.master {
            self.clock.jumped();
        }
        (self.master, self.syncs, self.sync_at) = (master, 0, now);
        Admission::Done
    }

    /// The motion has answered a demand to be cleared: whether it is at rest.
    pub(crate) fn cleared(&mut self, at_rest: bool, now: u64) -> Option<Reject> {
        let epoch = self.pending.take()?;
        if !at_rest {
            return Some(Reject::Moves);
        }
        (self.epoch, self.open, self.stop, self.told) = (epoch, true, None, false);
        self.host = now;
        self.begun = Some(epoch);
        None
    }

    /// A stop that anybody may order.
    #[inline(never)]
    pub(crate) fn stop(&mut self, stop: Stop, now: u64) {
        match stop {
            Stop::Path { tick } => {
                let named = tick.map(|low| nearest(now, low));
                self.stop_at(named.unwrap_or_else(|| self.common(now)), Cause::Told, named.is_none());
            }
            Stop::Quick | Stop::Off => self.close(),
        }
    }

    /// Another drive has an emergency.
    pub(crate) fn emergency(&mut self, from: Node, emergency: Emergency, now: u64) {
        if emergency.code != 0 && self.peers.has(from) {
            let fresh = self.stop.is_none();
            self.stop_at(nearest(now, emergency.tick), Cause::Heard, fresh && self.open);
        }
    }

    /// Another drive has told how it is.
    pub(crate) fn beat(&mut self, from: Node, beat: &Beat, now: u64) {
        self.peers.heard(from, beat, now);
        if self.open && self.peers.has(from) && beat.epoch == self.epoch as u8 && !beat.open {
            // The epoch has ended, and the word of it got lost here.
            self.cancel = true;
            self.close();
        }
    }

    /// Whether a drive of this session speaks for the open epoch: what it has committed to, all have been ready for.
    pub(crate) fn vouches(&self, from: Node, beat: &Beat) -> bool {
        self.open && beat.open && beat.epoch == self.epoch as u8 && self.peers.has(from)
    }

    /// How the axis is: looked at once per beat.
    #[inline(never)]
    pub(crate) fn look(&mut self, status: &Status, now: u64) {
        self.moving = matches!(
            status.state,
            State::Armed | State::Running | State::Held | State::Moving | State::Stopping
        );
        if let Some(fault) = &status.fault {
            if !self.told {
                self.told = true;
                let tick = self.common(now);
                self.announce = Some(Emergency { code: code(fault), cause: Cause::Fault, tick: tick as u32 });
                self.close();
            }
            return;
        }
        let running = matches!(status.state, State::Running | State::Held);
        // What was called off in motion ends the epoch, and yet nobody goes on to the end without the others.
        if !self.open && (!running || self.stop.is_some()) {
            return;
        }
        if self.open && self.is_lost(now) {
            return self.stop_at(self.common(now), Cause::HostSilent, self.moving);
        }
        if self.watch.drive_ticks > 0
            && (running || status.state == State::Armed)
            && let Some(age) = self.silence(now)
        {
            return self.stop_at(self.after_silence(now, age), Cause::DriveSilent, true);
        }
        if self.peers.astray(running) {
            self.stop_at(self.common(now), Cause::DriveAstray, true);
        }
    }

    /// Ticks since another drive was heard last, or this one by the others, if that is too long.
    fn silence(&self, now: u64) -> Option<u32> {
        let ticks = self.watch.drive_ticks;
        let unheard = u32::try_from(now.saturating_sub(self.own)).unwrap_or(u32::MAX);
        let own = (self.own != 0 && !self.peers.is_alone() && unheard > ticks).then_some(unheard);
        self.peers.silent(now, ticks).max(own)
    }

    /// A tick for a stop that both sides of a broken line find by themselves: it hangs on the last frame that has crossed, not
    /// on when somebody has missed the next one.
    fn after_silence(&self, now: u64, age: u32) -> u64 {
        let lead = u64::from(self.watch.lead_ticks.max(1));
        let noticed = now.saturating_sub(u64::from(age)).saturating_add(u64::from(self.watch.drive_ticks));
        (noticed / lead).saturating_add(3).saturating_mul(lead).max(now.saturating_add(1))
    }

    fn is_lost(&self, now: u64) -> bool {
        let ticks = self.watch.host_ticks;
        ticks > 0 && now.saturating_sub(self.host) > u64::from(ticks)
    }

    /// A tick that drives which decide at about the same time have in common.
    fn common(&self, now: u64) -> u64 {
        let lead = u64::from(self.watch.lead_ticks.max(1));
        (now / lead).saturating_add(2).saturating_mul(lead)
    }

    fn stop_at(&mut self, tick: u64, cause: Cause, announce: bool) {
        let earlier = self.stop.is_none_or(|stop| tick < stop);
        if earlier {
            (self.stop, self.hold) = (Some(tick), Some(tick));
        }
        if announce && earlier {
            self.announce = Some(Emergency { code: STOP_CODE, cause, tick: tick as u32 });
        }
        self.close();
    }

    fn close(&mut self) {
        (self.open, self.pending, self.clear) = (false, None, false);
    }

    /// What the motion has to do next.
    pub(crate) fn demand(&mut self) -> Option<Demand> {
        if let Some(tick) = self.hold.take() {
            return Some(Demand::Hold { tick });
        }
        if core::mem::take(&mut self.cancel) {
            return Some(Demand::Cancel);
        }
        if let Some(ticks) = self.shift.take() {
            return Some(Demand::Shift { ticks });
        }
        core::mem::take(&mut self.clear).then_some(Demand::Clear)
    }

    /// Something waits in [`Session::demand`].
    pub(crate) fn demands(&self) -> bool {
        self.hold.is_some() || self.cancel || self.shift.is_some() || self.clear
    }

    /// The motion's count has jumped.
    pub(crate) fn shifted(&mut self, ticks: i64) {
        self.clock.jumped();
        self.host = self.host.saturating_add_signed(ticks);
        if self.own != 0 {
            self.own = self.own.saturating_add_signed(ticks).max(1);
        }
        self.peers.shift(ticks);
    }

    /// The epoch that was opened since the last call.
    pub(crate) fn begun(&mut self) -> Option<u16> {
        self.begun.take()
    }

    /// A SYNC of another drive.
    pub(crate) fn sync(&mut self, counter: u8, at: Stamp) {
        if !self.master {
            self.clock.sync(counter, at);
        }
    }

    /// The time of a SYNC of another drive.
    pub(crate) fn time(&mut self, time: Time) {
        if !self.master {
            self.shift = self.clock.time(time).or(self.shift);
        }
    }

    /// A frame of this drive has left it.
    pub(crate) fn sent(&mut self, frame: &Frame, at: Stamp) {
        if frame.id() == self.node.beat() {
            self.own = at.tick;
        }
        if let (true, ids::SYNC, [counter, ..]) = (self.master, frame.id(), frame.data()) {
            self.time = Time::new(*counter, at);
        }
    }

    /// What the session has to send itself.
    #[inline(never)]
    pub(crate) fn poll_transmit(&mut self, now: u64) -> Option<Frame> {
        if let Some(emergency) = self.announce.take() {
            return emergency.frame(self.node);
        }
        if let Some(time) = self.time.take() {
            return time.frame();
        }
        if self.master && now >= self.sync_at && self.watch.sync_ticks > 0 {
            let hasty = self.syncs < HASTY;
            let period = if hasty { self.watch.sync_ticks / HASTE } else { self.watch.sync_ticks };
            self.syncs = self.syncs.saturating_add(1);
            self.sync_at = now.saturating_add(u64::from(period.max(1)));
            self.counter = sync::after(self.counter);
            return sync::sync(self.counter);
        }
        None
    }

    /// The clock agrees with the time master's, which this drive itself may be.
    pub(crate) fn agrees(&self, now: Stamp) -> bool {
        // Longer ticks cannot be told: their drives count alike, to the tick, from the jump that brought them together.
        self.master || self.clock.is_coarse() || self.clock.agrees(now)
    }

    /// The beat of an axis.
    pub(crate) fn beat_of(&self, status: &Status, held: Held, now: Stamp, tick_ns: u32) -> Option<Frame> {
        let Held { free, committed, change } = held;
        let fill_ms = status.fill.saturating_mul(u64::from(tick_ns)) / 1_000_000;
        let residual = if self.master { 0.0 } else { self.clock.residual_ns() };
        let beat = Beat {
            state: status.state,
            power: status.power,
            open: self.open,
            fault: status.fault.is_some(),
            synced: self.agrees(now),
            stopping: self.stop.is_some(),
            free,
            committed,
            epoch: self.epoch as u8,
            residual_us: (residual * 1e-3) as i8,
            fill_ms: u16::try_from(fill_ms).unwrap_or(u16::MAX),
            change,
        };
        beat.frame(self.node)
    }
}

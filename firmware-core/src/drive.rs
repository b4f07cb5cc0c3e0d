//! A drive on the bus: its halves behind CAN frames.

use protocol::authentic::{Key, needs_tag};
use protocol::bus::beat::Beat;
use protocol::bus::data;
use protocol::bus::emergency::Emergency;
use protocol::bus::stop::Stop;
use protocol::bus::sync::{Stamp, Time};
use protocol::bus::{BLOCK_BYTES, Frame, FrameSize, Node, Reassembler, Segments, ids};
use protocol::message::{
    ANSWER_BYTES, DriveMessage, HostMessage, Part, Reject, State, Status, decode, encode,
};
use protocol::power::{Power, PowerEvent};

use crate::axis::AxisConfig;
use crate::clock::Clock;
use crate::evaluate::Setpoint;
use crate::intake::{Intake, Orders};
use crate::motion::{Link, Motion};
use crate::orders::{Order, Report};
use crate::player::Queues;
use crate::session::{Admission, Demand, Held, Session, Watch};
use crate::update::{ImageStore, Next, Updater};

/// A status goes out at every change, and with every so many beats.
const STATUS_BEATS: u32 = 10;

/// What a drive is on its bus, and on its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveConfig {
    /// Its address.
    pub node: Node,
    /// Which frames it sends.
    pub frames: FrameSize,
    /// Its axis.
    pub axis: AxisConfig,
    /// How it watches over its session.
    pub watch: Watch,
    /// The key of hosts that may move it; none: everybody may.
    pub key: Option<Key>,
}

/// Messages out of frames, and answers into frames.
#[derive(Debug)]
struct Mail {
    node: Node,
    frames: FrameSize,
    to_all: Reassembler<BLOCK_BYTES>,
    to_this: Reassembler<BLOCK_BYTES>,
    key: Option<Key>,
    /// Of the last signed message that was obeyed.
    counter: u64,
    /// Frames and messages that could not be understood.
    dropped: u32,
    answer: [u8; ANSWER_BYTES],
    answer_length: usize,
    epoch: u16,
    /// Frames of the answer that were sent.
    sent: usize,
}

impl Mail {
    const fn new(config: &DriveConfig) -> Self {
        Self {
            node: config.node,
            frames: config.frames,
            to_all: Reassembler::new(),
            to_this: Reassembler::new(),
            key: config.key,
            counter: 0,
            dropped: 0,
            answer: [0; ANSWER_BYTES],
            answer_length: 0,
            epoch: 0,
            sent: 0,
        }
    }

    /// The message that a frame completes, if any, and its epoch; frames of others are ignored.
    #[inline(never)]
    fn receive(&mut self, frame: &Frame) -> Option<(u16, Result<HostMessage<'_>, Reject>)> {
        let (to, message) = if frame.id() == ids::BROADCAST {
            (0, self.to_all.push(frame.data()))
        } else if frame.id() == self.node.to_drive() {
            (self.node.number(), self.to_this.push(frame.data()))
        } else {
            return None;
        };
        let Ok(block) = message else {
            self.dropped = self.dropped.saturating_add(1);
            return None;
        };
        let (epoch, bytes) = block?;
        match open(self.key.as_ref(), &mut self.counter, epoch, to, bytes) {
            Ok(message) => Some((epoch, Ok(message))),
            Err(Unsealed::Refused) => Some((epoch, Err(Reject::Key))),
            Err(Unsealed::Worthless) => {
                self.dropped = self.dropped.saturating_add(1);
                None
            }
        }
    }

    /// The next frame of the answer that is being sent.
    #[inline(never)]
    fn next_frame(&mut self) -> Option<Frame> {
        let message = self.answer.get(..self.answer_length).filter(|message| !message.is_empty())?;
        let mut frames = Segments::new(self.node.from_drive(), self.frames, self.epoch, message)?;
        let frame = frames.nth(self.sent)?;
        self.sent += 1;
        Some(frame)
    }

    /// Takes up an answer.
    #[inline(never)]
    fn answer(&mut self, message: &DriveMessage, epoch: u16) {
        (self.sent, self.epoch) = (0, epoch);
        self.answer_length = encode(message, &mut self.answer).map_or(0, <[u8]>::len);
    }
}

/// Why a block holds nothing to obey.
enum Unsealed {
    /// It is no message, or one that was obeyed already.
    Worthless,
    /// It is not signed with the drive's key.
    Refused,
}

/// The message in a block, if the drive may obey it.
fn open<'b>(
    key: Option<&Key>,
    last: &mut u64,
    epoch: u16,
    to: u8,
    bytes: &'b [u8],
) -> Result<HostMessage<'b>, Unsealed> {
    let read = |bytes: &'b [u8]| decode::<HostMessage<'_>>(bytes).map_err(|_| Unsealed::Worthless);
    let message = read(bytes)?;
    let (HostMessage::Signed { counter, tag, message: signed }, Some(key)) = (message, key) else {
        return match message {
            // Whoever has no key cannot tell who has signed.
            HostMessage::Signed { message, .. } => read(message),
            other if key.is_some() && needs_tag(&other) => Err(Unsealed::Refused),
            other => Ok(other),
        };
    };
    if key.tag(epoch, to, counter, signed) != tag {
        return Err(Unsealed::Refused);
    }
    // Doubled and late ones are as good as lost: what matters is repeated.
    if counter <= *last {
        return Err(Unsealed::Worthless);
    }
    *last = counter;
    read(signed)
}

/// The talking half of a drive behind frames: for boards, where [`crate::motion::Motion`] runs in the control interrupt.
#[derive(Debug)]
pub struct Station<'a> {
    mail: Mail,
    session: Session,
    intake: Intake<'a>,
    update: Updater<'a>,
    tick_ns: u32,
    /// The beat that waits to be sent.
    due: Option<Frame>,
    beat: u32,
    /// What the last status said of itself.
    shown: Option<Status>,
    booted: bool,
}

impl<'a> Station<'a> {
    /// With two buffers for tables.
    pub fn new(config: DriveConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Self {
        let tick_ns = config.axis.tick_ns;
        Self {
            mail: Mail::new(&config),
            session: Session::new(config.node, config.watch, tick_ns),
            intake: Intake::new(config.axis, a, b).under(config.key),
            update: Updater::new(None),
            tick_ns,
            due: None,
            beat: 0,
            shown: None,
            booted: false,
        }
    }

    /// With a place for new images.
    pub fn with_images(self, store: &'a mut dyn ImageStore) -> Self {
        Self { update: Updater::new(Some(store)), ..self }
    }

    /// The drive has to start up anew, with another image.
    pub fn wants_restart(&self) -> bool {
        self.update.wants_restart()
    }

    /// Takes a frame from the bus that has ended at `at`.
    pub fn receive(&mut self, frame: &Frame, at: Stamp, orders: &mut dyn Orders<'a>) {
        let node = self.mail.node;
        if let Some(stop) = Stop::of(frame, node.number()) {
            return self.stop(stop, at, orders);
        }
        match frame.id() {
            ids::SYNC => {
                if let [counter, ..] = *frame.data() {
                    self.session.sync(counter, at);
                }
            }
            ids::TIME => {
                if let Some(time) = Time::parse(frame.data()) {
                    self.session.time(time);
                }
            }
            ids::DATA => self.data(Part::Shared, frame.data(), orders),
            id if id == node.data() => self.data(Part::Axis, frame.data(), orders),
            id => match (Node::of_beat(id), Node::of_emergency(id)) {
                (Some(from), _) => self.beat(from, frame.data(), at, orders),
                (_, Some(from)) => {
                    if let Some(emergency) = Emergency::parse(frame.data()) {
                        self.session.emergency(from, emergency, at.tick);
                    }
                }
                (None, None) => self.message(frame, at, orders),
            },
        }
        self.retry(orders);
    }

    #[inline(never)]
    fn message(&mut self, frame: &Frame, at: Stamp, orders: &mut dyn Orders<'a>) {
        let Some((epoch, message)) = self.mail.receive(frame) else { return };
        self.intake.set_session(self.session.boot(), self.session.epoch());
        let message = match message {
            Ok(message) => message,
            Err(reason) => return self.intake.say(DriveMessage::Reject { table: 0, reason }),
        };
        match self.session.admit(epoch, &message, at) {
            Admission::Pass => {
                if let HostMessage::Update(step) = message {
                    match self.update.handle(step, self.session.is_open()) {
                        Next::Say(answer) => self.intake.say(answer),
                        Next::Ask => self.intake.handle(&HostMessage::Report, orders),
                    }
                } else {
                    self.intake.handle(&message, orders);
                }
            }
            // Whoever wants motion has no use for a new image.
            Admission::Done => self.update.forget(),
            Admission::Refuse(reason) => self.intake.say(DriveMessage::Reject { table: 0, reason }),
        }
    }

    #[inline(never)]
    fn stop(&mut self, stop: Stop, at: Stamp, orders: &mut dyn Orders<'a>) {
        self.session.stop(stop, at.tick);
        match stop {
            Stop::Path { .. } => {}
            Stop::Quick => self.intake.handle(&HostMessage::QuickStop, orders),
            Stop::Off => self.intake.handle(&HostMessage::Power(PowerEvent::DisableVoltage), orders),
        }
        self.retry(orders);
    }

    #[inline(never)]
    fn data(&mut self, part: Part, frame: &[u8], orders: &mut dyn Orders<'a>) {
        if let Some(data::Data { tag, unit, bytes }) = data::parse(frame)
            && self.session.is_open()
        {
            self.intake.handle(&HostMessage::Data { tag, part, unit, bytes }, orders);
        }
    }

    fn beat(&mut self, from: Node, frame: &[u8], at: Stamp, orders: &mut dyn Orders<'a>) {
        let Some(beat) = Beat::parse(frame) else { return };
        self.session.beat(from, &beat, at.tick);
        if self.session.vouches(from, &beat) {
            self.intake.adopt(beat.committed, orders);
        }
    }

    /// Takes what the motion has said.
    #[inline(never)]
    pub fn hear(&mut self, report: Report<'a>, now: Stamp) {
        match report {
            Report::Status(status) => self.tell(&self.intake.seen(status), now),
            Report::Cleared(at_rest) => {
                self.intake.begin_anew();
                if let Some(reason) = self.session.cleared(at_rest, now.tick) {
                    self.intake.say(DriveMessage::Reject { table: 0, reason });
                }
            }
            Report::Shifted { ticks } => {
                if ticks != 0 {
                    self.session.shifted(ticks);
                }
            }
            other => {
                if let Report::Reported(status) = &other
                    && let Some(answer) = self.update.status(is_off(status))
                {
                    self.intake.say(answer);
                }
                self.intake.hear(other);
            }
        }
    }

    /// A beat is due.
    fn tell(&mut self, status: &Status, now: Stamp) {
        self.session.look(status, now.tick);
        let intake = &self.intake;
        let held = Held { free: intake.free(), committed: intake.committed(), change: intake.change() };
        self.due = self.session.beat_of(status, held, now, self.tick_ns);
        let same = |shown: &Status| {
            (shown.state, shown.power, shown.fault) == (status.state, status.power, status.fault)
        };
        let slow = self.beat.is_multiple_of(STATUS_BEATS);
        self.beat = self.beat.wrapping_add(1);
        if slow || !self.shown.as_ref().is_some_and(same) {
            self.shown = Some(*status);
            self.intake.hear(Report::Status(*status));
        }
    }

    /// What could not be ordered before is ordered now.
    pub fn retry(&mut self, orders: &mut dyn Orders<'a>) {
        self.intake.retry(orders);
        while self.session.demands() && orders.has_room() {
            match self.session.demand() {
                Some(Demand::Hold { tick }) => {
                    self.intake.forget();
                    orders.send(Order::Hold { tick });
                }
                Some(Demand::Cancel) => {
                    self.intake.forget();
                    orders.send(Order::Stop);
                }
                Some(Demand::Clear) => {
                    self.intake.forget();
                    orders.send(Order::Clear);
                }
                Some(Demand::Shift { ticks }) => orders.send(Order::Shift { ticks }),
                None => {}
            }
        }
    }

    /// The next frame to send.
    pub fn poll_transmit(&mut self, now: Stamp) -> Option<Frame> {
        if !core::mem::replace(&mut self.booted, true) {
            return Frame::new(self.mail.node.heartbeat(), &[BOOTED]);
        }
        if let Some(frame) = self.session.poll_transmit(now.tick) {
            return Some(frame);
        }
        if let Some(answer) = self.update.work() {
            self.intake.say(answer);
        }
        if let Some(frame) = self.due.take() {
            return Some(frame);
        }
        loop {
            if let Some(frame) = self.mail.next_frame() {
                return Some(frame);
            }
            if let Some(epoch) = self.session.begun() {
                self.mail.answer(&DriveMessage::Begun { epoch }, epoch);
                continue;
            }
            let answer = self.intake.poll_answer()?;
            self.mail.answer(&answer, self.session.epoch());
        }
    }

    /// A frame that was fetched has left the drive: its last bit, and that of the acknowledgement, at `at`.
    pub fn sent(&mut self, frame: &Frame, at: Stamp) {
        self.session.sent(frame, at);
    }

    /// The drive's clock.
    pub fn clock(&self) -> &Clock {
        self.session.clock()
    }
}

/// At rest, and no torque anywhere near.
fn is_off(status: &Status) -> bool {
    matches!(status.power, Power::SwitchOnDisabled | Power::ReadyToSwitchOn | Power::Fault)
        && !matches!(status.state, State::Armed | State::Running | State::Stopping | State::Moving)
}

/// The boot-up message of CANopen. Its heartbeats are not sent: at the lowest priority of all they would hold up the beats behind
/// them for as long as table data keep the bus busy.
const BOOTED: u8 = 0x00;

/// One drive in one piece: for hosts, where nothing interrupts anything.
#[derive(Debug)]
pub struct Drive<'a> {
    station: Station<'a>,
    motion: Motion<'a>,
    queues: Queues<'a>,
}

impl<'a> Drive<'a> {
    /// A drive at rest and without torque, with two buffers for tables.
    pub fn new(config: DriveConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Self {
        Self {
            station: Station::new(config, a, b),
            motion: Motion::new(config.axis),
            queues: Queues::default(),
        }
    }

    /// With a place for new images.
    pub fn with_images(self, store: &'a mut dyn ImageStore) -> Self {
        Self { station: self.station.with_images(store), ..self }
    }

    /// The drive has to start up anew, with another image, once there is nothing more to transmit.
    pub fn wants_restart(&self) -> bool {
        self.station.wants_restart()
    }

    /// Takes a frame from the bus that has ended so long after the present tick began [ns]; frames of others are ignored.
    pub fn receive(&mut self, frame: &Frame, ns: u32) {
        let at = self.stamp(ns);
        self.station.receive(frame, at, &mut self.queues);
        if self.queues.has_orders() {
            self.motion.take_orders(&mut self.queues);
        }
        self.exchange(ns);
    }

    /// The set-point of this tick; call it once per control tick.
    pub fn tick(&mut self) -> Setpoint {
        let setpoint = self.motion.tick(&mut self.queues);
        self.exchange(0);
        setpoint
    }

    /// Tells where the axis really is, after [`Drive::tick`].
    pub fn observe(&mut self, actual: i64) {
        self.motion.observe(actual);
    }

    /// The board has found a fault.
    pub fn trip(&mut self, code: u16) {
        self.motion.trip(code);
    }

    /// The next frame to send.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        let now = self.stamp(0);
        self.station.poll_transmit(now)
    }

    /// A frame that was fetched has left the drive, so long after the present tick began [ns].
    pub fn sent(&mut self, frame: &Frame, ns: u32) {
        let at = self.stamp(ns);
        self.station.sent(frame, at);
    }

    /// By how much the next tick is to be shorter [1e-9].
    pub fn trim_ppb(&self) -> i32 {
        self.station.clock().trim_ppb(self.stamp(0))
    }

    /// How the drive is.
    pub fn status(&self) -> Status {
        self.station.intake.seen(self.motion.status())
    }

    /// The drive's clock.
    pub fn clock(&self) -> &Clock {
        self.station.clock()
    }

    /// Its newest epoch, and whether it is open.
    pub fn epoch(&self) -> (u16, bool) {
        (self.station.session.epoch(), self.station.session.is_open())
    }

    /// How many frames and messages could not be understood.
    pub fn dropped(&self) -> u32 {
        self.station.mail.dropped
    }

    fn stamp(&self, ns: u32) -> Stamp {
        // The tick that is under way is the one before the next.
        Stamp { tick: self.motion.now().saturating_sub(1), ns }
    }

    fn exchange(&mut self, ns: u32) {
        while let Some(report) = self.queues.poll_report() {
            let at = self.stamp(ns);
            self.station.hear(report, at);
            self.station.retry(&mut self.queues);
        }
        if self.queues.has_orders() {
            self.motion.take_orders(&mut self.queues);
        }
    }
}

//! The half of a drive that talks: tables come in, are checked and handed to the motion; answers go out.
//!
//! Two buffers: while one table plays, the next one comes into the other. A table is handed over only if it came
//! completely, its checksums hold, it obeys the format's rules, is meant for this axis, tick and limits, and proves that it
//! keeps them. All of this takes its time, and none of it happens in the control tick.

use heapless::Deque;
use protocol::authentic::Key;
use protocol::message::{DriveMessage, HostMessage, Identity, Part, Reject, State, Status};
use protocol::power::PowerEvent;
use protocol::schema;
use protocol::table::{FORMAT_VERSION, HeaderField, Limits, TableError, TableHeader};

use crate::axis::AxisConfig;
use crate::orders::{Order, Report};
use crate::store::{Loaded, Sealed, Slot};
use crate::time::ticks_until;

/// Most answers that wait to be sent; when they are not fetched, status is dropped first.
const ANSWERS: usize = 8;

/// What f32 may take from a limit that is kept exactly.
const ROUNDING: f32 = 1.0 + 1e-5;

/// Version of this core.
const VERSION: [u8; 3] = [
    number(env!("CARGO_PKG_VERSION_MAJOR")),
    number(env!("CARGO_PKG_VERSION_MINOR")),
    number(env!("CARGO_PKG_VERSION_PATCH")),
];

/// What digits stand for, as far as eight bits go.
const fn number(digits: &str) -> u8 {
    match u8::from_str_radix(digits, 10) {
        Ok(number) => number,
        Err(_) => u8::MAX,
    }
}

/// Where orders go. Nobody else sends any, so that room that was seen is still there.
pub trait Orders<'a> {
    /// There is room for an order.
    fn has_room(&self) -> bool;

    /// Hands an order over; without room it is lost.
    fn send(&mut self, order: Order<'a>);
}

/// The half that talks.
#[derive(Debug)]
pub struct Intake<'a> {
    config: AxisConfig,
    slots: [Slot<'a>; 2],
    answers: Deque<DriveMessage, ANSWERS>,
    /// A quick stop that found no room.
    urgent: Option<PowerEvent>,
    /// Number of the last table that was handed over, plus one.
    committed: u32,
    /// And of the one before it.
    before: u32,
    /// Number of the last change of rate that was ordered.
    change: u8,
    boot: u32,
    epoch: u16,
    /// What tables are sealed with; none: a checksum.
    key: Option<Key>,
}

impl<'a> Intake<'a> {
    /// With two buffers for tables.
    pub fn new(config: AxisConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Self {
        Self {
            config,
            slots: [Slot::new(a), Slot::new(b)],
            answers: Deque::new(),
            urgent: None,
            committed: 0,
            before: 0,
            change: 0,
            boot: 0,
            epoch: 0,
            key: None,
        }
    }

    /// Tables are sealed with a key.
    pub fn under(self, key: Option<Key>) -> Self {
        Self { key, ..self }
    }

    /// Takes a message; answers wait in [`Intake::poll_answer`].
    #[inline(never)]
    pub fn handle(&mut self, message: &HostMessage<'_>, orders: &mut dyn Orders<'a>) {
        let (table, result) = match *message {
            HostMessage::Open(header) => (header.table, self.open(header)),
            HostMessage::OpenAxis(axis) => {
                (axis.table, self.incoming(axis.table, |slot| slot.open_axis(axis)))
            }
            HostMessage::Data { tag, part, unit, bytes } => {
                // The seal tells what is missing.
                if let Some(slot) = self.slots.iter_mut().find(|slot| slot.has_tag(tag)) {
                    let _ = slot.data(part, unit, bytes);
                }
                (0, Ok(()))
            }
            HostMessage::Seal { table, part, crc } => (table, self.seal(table, part, crc)),
            HostMessage::Start { table, tick } => (table, self.start(table, tick, orders)),
            HostMessage::Stop => {
                self.forget();
                (0, order(orders, Order::Stop))
            }
            HostMessage::MoveTo { position, velocity } => {
                (0, order(orders, Order::MoveTo { position, velocity }))
            }
            HostMessage::MoveAt { velocity } => (0, order(orders, Order::MoveAt { velocity })),
            // Repeats make sure that everybody has heard.
            HostMessage::Override { number, .. } if number == self.change && number != 0 => (0, Ok(())),
            HostMessage::Override { permille, tick, number } => {
                let result = order(orders, Order::Override { permille, tick });
                if result.is_ok() {
                    self.change = number;
                }
                (0, result)
            }
            HostMessage::QuickStop => (0, self.power(PowerEvent::QuickStop, orders)),
            HostMessage::Power(event) => (0, self.power(event, orders)),
            HostMessage::Alive => (0, order(orders, Order::Alive)),
            HostMessage::Report => (0, order(orders, Order::Report)),
            // Somebody else has answered it, or opened what was in it.
            HostMessage::Begin { .. } | HostMessage::Signed { .. } | HostMessage::Update(_) => (0, Ok(())),
            HostMessage::Identify => {
                let identity = self.identity();
                self.answer(DriveMessage::Identity(identity));
                (0, Ok(()))
            }
        };
        if let Err(reason) = result {
            self.answer(DriveMessage::Reject { table, reason });
        }
    }

    /// Takes what the motion has said.
    pub fn hear(&mut self, report: Report<'a>) {
        match report {
            Report::Reject { table, reason } => self.answer(DriveMessage::Reject { table, reason }),
            Report::Back { table, kept } => self.take_back(table, kept),
            Report::Status(status) if self.answers.len() < ANSWERS / 2 => {
                self.answer(DriveMessage::Status(self.seen(status)));
            }
            Report::Reported(status) => self.answer(DriveMessage::Status(self.seen(status))),
            Report::Telemetry(telemetry) if self.answers.len() < ANSWERS / 2 => {
                self.answer(DriveMessage::Telemetry(telemetry));
            }
            Report::Status(_) | Report::Telemetry(_) => {}
            // These are the session's.
            Report::Cleared(_) | Report::Shifted { .. } => {}
        }
    }

    /// What could not be ordered before is ordered now; call it now and then.
    pub fn retry(&mut self, orders: &mut dyn Orders<'a>) {
        if orders.has_room()
            && let Some(event) = self.urgent.take()
        {
            orders.send(Order::Power(event));
        }
    }

    /// Tables that it could take.
    pub(crate) fn free(&self) -> u8 {
        self.slots.iter().filter(|slot| !slot.is_away()).count() as u8
    }

    /// Lowest bits of the last table that was handed over, plus one.
    pub(crate) fn committed(&self) -> u8 {
        self.committed as u8
    }

    /// A table that takes over from another one has been handed over on another drive: all were ready for it, so it is here too.
    pub(crate) fn adopt(&mut self, committed: u8, orders: &mut dyn Orders<'a>) {
        let joins = |slot: &&Slot<'a>| {
            slot.is_ready() && slot.headers().is_some_and(|(header, _)| header.joint.is_some())
        };
        let slot = self.slots.iter().filter(joins).find_map(Slot::number);
        if let Some(number) =
            slot.filter(|&number| (number as u8).wrapping_add(1) == committed && orders.has_room())
        {
            let _ = self.start(number, 0, orders);
        }
    }

    /// Nothing has been handed over yet.
    pub(crate) fn begin_anew(&mut self) {
        (self.committed, self.before, self.change) = (0, 0, 0);
    }

    /// Number of the last change of rate.
    pub(crate) fn change(&self) -> u8 {
        self.change
    }

    /// Forgets tables that were not handed over.
    pub(crate) fn forget(&mut self) {
        self.slots.iter_mut().for_each(Slot::clear);
    }

    /// Says something of the session.
    pub(crate) fn say(&mut self, message: DriveMessage) {
        self.answer(message);
    }

    /// The oldest answer that was not fetched.
    pub fn poll_answer(&mut self) -> Option<DriveMessage> {
        self.answers.pop_front()
    }

    /// A status of the motion, with what is known here: tables that come in.
    pub fn seen(&self, status: Status) -> Status {
        let state = match status.state {
            rest @ (State::Idle | State::Holding) => {
                if self.slots.iter().any(Slot::is_ready) {
                    State::Ready
                } else if self.slots.iter().any(|slot| !slot.is_away() && slot.number().is_some()) {
                    State::Receiving
                } else {
                    rest
                }
            }
            moving => moving,
        };
        Status { state, ..status }
    }

    /// Tells what the session is: start-up and newest epoch.
    pub(crate) fn set_session(&mut self, boot: u32, epoch: u16) {
        (self.boot, self.epoch) = (boot, epoch);
    }

    /// Who the axis is.
    pub fn identity(&self) -> Identity {
        let AxisConfig { axis, tick_ns, limits, .. } = self.config;
        let room = self.slots.iter().map(Slot::room).min().unwrap_or(0);
        let room = u32::try_from(room).unwrap_or(u32::MAX);
        let (format, schema) = (FORMAT_VERSION, schema::HASH);
        let (boot, epoch) = (self.boot, self.epoch);
        Identity { version: VERSION, format, schema, axis, tick_ns, limits, room, boot, epoch }
    }

    #[inline(never)]
    fn open(&mut self, header: TableHeader) -> Result<(), Reject> {
        if header.tick_ns != self.config.tick_ns {
            return Err(Reject::Tick { tick_ns: self.config.tick_ns });
        }
        if self.slots.iter().any(|slot| slot.is_opened_by(&header)) {
            return Ok(());
        }
        self.forget();
        if self.slots.iter().any(|slot| slot.number() == Some(header.table)) {
            return Err(Reject::Busy);
        }
        let free = self.slots.iter_mut().find(|slot| !slot.is_away());
        free.ok_or(Reject::Busy)?.open(header)
    }

    /// Does something to the table that is coming in.
    fn incoming<T>(
        &mut self,
        table: u32,
        act: impl FnOnce(&mut Slot<'a>) -> Result<T, Reject>,
    ) -> Result<T, Reject> {
        act(self.slot(table).filter(|slot| !slot.is_away()).ok_or(Reject::NotOpen)?)
    }

    /// Ends a part; a table that has become complete is checked.
    fn seal(&mut self, table: u32, part: Part, crc: u32) -> Result<(), Reject> {
        let key = self.key;
        match self.incoming(table, |slot| slot.seal(part, crc, key.as_ref()))? {
            Sealed::Half => Ok(()),
            Sealed::Whole => self.check(table),
            Sealed::Missing(gaps) => {
                self.answer(DriveMessage::Missing { table, part, gaps });
                Ok(())
            }
        }
    }

    /// Checks a complete table, and says so.
    #[inline(never)]
    fn check(&mut self, number: u32) -> Result<(), Reject> {
        let config = self.config;
        let fits = |slot: &mut Slot<'_>| {
            let (header, axis) = slot.headers().ok_or(Reject::NotOpen)?;
            if axis.axis != config.axis {
                return Err(Reject::Axis { axis: config.axis });
            }
            if !is_within(&axis.limits, &header, &config) {
                return Err(Reject::Limits);
            }
            if header.warp.is_some_and(|warp| !warp.suits(&axis.limits, config.tick_ns)) {
                return Err(Reject::Table(TableError::Header(HeaderField::Warp)));
            }
            let ticks = ticks_until(slot.check(config.travel)?, config.tick_ns);
            let crc = slot.seals().ok_or(Reject::NotReady)?;
            Ok(DriveMessage::Ready { table: number, ticks, crc })
        };
        let result = self.incoming(number, fits);
        let result = result.and_then(|ready| if self.joins(number) { Ok(ready) } else { Err(Reject::Joint) });
        match result {
            Ok(ready) => {
                self.answer(ready);
                Ok(())
            }
            Err(reason) => {
                if let Some(slot) = self.slot(number) {
                    slot.clear();
                }
                Err(reason)
            }
        }
    }

    /// A table that joins another one goes on where that one is left; others need not.
    fn joins(&self, number: u32) -> bool {
        let with = |number: u32| self.slots.iter().find(|slot| slot.number() == Some(number));
        let Some(slot) = with(number) else { return true };
        let joint = slot.headers().and_then(|(header, _)| header.joint);
        joint.is_none_or(|joint| with(joint.table).is_some_and(|other| slot.follows(other)))
    }

    /// Hands a table over, to be played from a tick on.
    fn start(&mut self, number: u32, tick: u64, orders: &mut dyn Orders<'a>) -> Result<(), Reject> {
        let slot = self.slot(number).ok_or(Reject::NotReady)?;
        if slot.is_away() {
            return order(orders, Order::StartAgain { table: number, tick });
        }
        if !orders.has_room() {
            return Err(Reject::Busy);
        }
        orders.send(Order::Start { table: slot.give().ok_or(Reject::NotReady)?, tick });
        (self.committed, self.before) = (number.wrapping_add(1), self.committed);
        Ok(())
    }

    /// Commands that take torque or motion away are never lost.
    fn power(&mut self, event: PowerEvent, orders: &mut dyn Orders<'a>) -> Result<(), Reject> {
        let urgent = matches!(event, PowerEvent::QuickStop | PowerEvent::DisableVoltage);
        if urgent {
            self.forget();
        }
        match order(orders, Order::Power(event)) {
            Err(_) if urgent => {
                // Without torque there is no more to stop.
                if self.urgent != Some(PowerEvent::DisableVoltage) {
                    self.urgent = Some(event);
                }
                Ok(())
            }
            result => result,
        }
    }

    fn take_back(&mut self, table: Loaded<'a>, kept: bool) {
        let number = table.number();
        if kept && self.committed == number.wrapping_add(1) {
            self.committed = self.before;
        }
        let slot = self.slots.iter_mut().find(|slot| slot.is_away() && slot.number() == Some(number));
        // The motion gives back what it was given.
        if let Some(slot) = slot {
            slot.take_back(table, kept);
        }
    }

    #[inline(never)]
    fn answer(&mut self, message: DriveMessage) {
        if self.answers.is_full() {
            self.answers.pop_front();
        }
        // There is room now.
        let _ = self.answers.push_back(message);
    }

    fn slot(&mut self, table: u32) -> Option<&mut Slot<'a>> {
        self.slots.iter_mut().find(|slot| slot.number() == Some(table))
    }
}

fn order<'a>(orders: &mut dyn Orders<'a>, order: Order<'a>) -> Result<(), Reject> {
    if !orders.has_room() {
        return Err(Reject::Busy);
    }
    orders.send(order);
    Ok(())
}

/// No limit of the table is above the drive's, nor, at any rate that it admits, above what the drive grants then.
fn is_within(table: &Limits, header: &TableHeader, config: &AxisConfig) -> bool {
    let AxisConfig { limits: drive, excess, .. } = config;
    let jerk = |factor: f32, excess: f32| match (table.jerk, drive.jerk) {
        (_, None) => true,
        (Some(t), Some(d)) => t * factor <= d * excess,
        (None, Some(_)) => false,
    };
    let plain =
        table.velocity <= drive.velocity && table.acceleration <= drive.acceleration && jerk(1.0, 1.0);
    plain
        && header.warp.is_none_or(|warp| {
            let factor = |x: u32| x as f32 / protocol::table::warp::ONE as f32;
            table.velocity * factor(warp.rate) <= drive.velocity * ROUNDING
                && table.acceleration * factor(warp.acceleration)
                    <= drive.acceleration * excess.acceleration * ROUNDING
                && jerk(factor(warp.jerk), excess.jerk * ROUNDING)
        })
}

//! The half of a drive that talks: tables come in, are checked and handed to the motion; answers go out.
//!
//! Two buffers: while one table plays, the next one comes into the other. A table is handed over only if it came
//! completely, its checksums hold, it obeys the format's rules, is meant for this axis, tick and limits, and proves that it
//! keeps them. All of this takes its time, and none of it happens in the control tick.

use heapless::Deque;
use protocol::message::{DriveMessage, HostMessage, Identity, Reject, State, Status};
use protocol::power::PowerEvent;
use protocol::schema;
use protocol::table::{FORMAT_VERSION, HeaderField, Limits, TableError, TableHeader};

use crate::axis::AxisConfig;
use crate::orders::{Order, Report};
use crate::store::{Loaded, Slot};
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
}

impl<'a> Intake<'a> {
    /// With two buffers for tables.
    pub fn new(config: AxisConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Self {
        Self { config, slots: [Slot::new(a), Slot::new(b)], answers: Deque::new(), urgent: None }
    }

    /// Takes a message; answers wait in [`Intake::poll_answer`].
    #[inline(never)]
    pub fn handle(&mut self, message: &HostMessage<'_>, orders: &mut dyn Orders<'a>) {
        let (table, result) = match *message {
            HostMessage::Open(header) => (header.table, self.open(header)),
            HostMessage::OpenAxis(axis) => {
                (axis.table, self.incoming(axis.table, |slot| slot.open_axis(axis)))
            }
            HostMessage::Data { table, part, offset, bytes } => {
                (table, self.incoming(table, |slot| slot.data(part, offset, bytes)))
            }
            HostMessage::Seal { table, part, crc } => {
                let complete = self.incoming(table, |slot| slot.seal(part, crc));
                (table, complete.and_then(|complete| if complete { self.check(table) } else { Ok(()) }))
            }
            HostMessage::Start { table, tick } => (table, self.start(table, tick, orders)),
            HostMessage::Stop => {
                self.forget();
                (0, order(orders, Order::Stop))
            }
            HostMessage::MoveTo { position, velocity } => {
                (0, order(orders, Order::MoveTo { position, velocity }))
            }
            HostMessage::MoveAt { velocity } => (0, order(orders, Order::MoveAt { velocity })),
            HostMessage::Override { permille, tick } => {
                (0, order(orders, Order::Override { permille, tick }))
            }
            HostMessage::QuickStop => (0, self.power(PowerEvent::QuickStop, orders)),
            HostMessage::Power(event) => (0, self.power(event, orders)),
            HostMessage::Alive => (0, order(orders, Order::Alive)),
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
            Report::Telemetry(telemetry) if self.answers.len() < ANSWERS / 2 => {
                self.answer(DriveMessage::Telemetry(telemetry));
            }
            Report::Status(_) | Report::Telemetry(_) => {}
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

    /// Who the axis is.
    pub fn identity(&self) -> Identity {
        let AxisConfig { axis, tick_ns, limits, .. } = self.config;
        let room = self.slots.iter().map(Slot::room).min().unwrap_or(0);
        let room = u32::try_from(room).unwrap_or(u32::MAX);
        let (format, schema) = (FORMAT_VERSION, schema::HASH);
        Identity { version: VERSION, format, schema, axis, tick_ns, limits, room }
    }

    #[inline(never)]
    fn open(&mut self, header: TableHeader) -> Result<(), Reject> {
        if header.tick_ns != self.config.tick_ns {
            return Err(Reject::Tick { tick_ns: self.config.tick_ns });
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

    /// Forgets tables that were not handed over.
    fn forget(&mut self) {
        self.slots.iter_mut().for_each(Slot::clear);
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

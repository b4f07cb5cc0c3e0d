//! The state machine of one axis: tables come in, are checked, armed and played.
//!
//! Two buffers: while one table plays, the next one comes into the other. A table is played only if it came
//! completely, its checksums hold, it obeys the format's rules, is meant for this axis, tick and limits, and
//! begins where the motion before it ends. Every table ends at rest, so whatever fails to arrive, the axis comes
//! to rest on its path. A quick stop, a table that is not what was checked, or a set-point beyond the axis' limits leaves the
//! path: the axis comes to rest by a double-S from the set-point before, within its limits, and faults stay latched. At rest it
//! may be sent to a position.

use heapless::Deque;
use protocol::message::{DriveMessage, Fault, HostMessage, Identity, Reject, State, Status};
use protocol::schema;
use protocol::table::{AxisLimit, FORMAT_VERSION, Limits, TableHeader};

use crate::course::Course;
use crate::evaluate::{Cursor, Setpoint};
use crate::store::Slot;
use crate::telemetry::Window;
use crate::time::{PathClock, ticks_until};

/// Most answers that wait to be sent; when they are not fetched, status is dropped first.
const ANSWERS: usize = 8;

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

/// Share by which a set-point may exceed a limit before the drive faults: more than a proven table ever does.
const TRIP: f32 = 0.02;
/// What rounding adds to the way of one tick [counts].
const STEP_COUNTS: f32 = 2.0;

/// What a drive knows of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisConfig {
    /// Its axis, in the machine's order.
    pub axis: u8,
    /// Control tick [ns].
    pub tick_ns: u32,
    /// Position at start-up [counts].
    pub position: i64,
    /// Tables planned for more are refused.
    pub limits: Limits,
    /// Lowest and highest position that a table may lead to [counts]; none: anywhere.
    pub travel: Option<[i64; 2]>,
    /// Status is sent every so many ticks; 0: never.
    pub status_ticks: u32,
}

/// Which of the two buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    A,
    B,
}

/// A table that plays.
#[derive(Clone, Copy, Debug)]
struct Playing {
    side: Side,
    cursor: Cursor,
    clock: PathClock,
    /// Tick at which it has come to rest.
    end: u64,
    /// Where that is [counts].
    position: i64,
}

/// A table that will start.
#[derive(Clone, Copy, Debug)]
struct Armed {
    side: Side,
    tick: u64,
}

/// Motion without a table.
#[derive(Clone, Debug)]
struct Excursion {
    course: Course,
    /// It only comes to rest.
    stops: bool,
}

/// One axis.
#[derive(Debug)]
pub struct Player<'a> {
    config: AxisConfig,
    a: Slot<'a>,
    b: Slot<'a>,
    /// Number of the next tick.
    tick: u64,
    status_in: u32,
    /// The set-point that was given last.
    last: Setpoint,
    /// Motion without a table.
    excursion: Option<Excursion>,
    playing: Option<Playing>,
    armed: Option<Armed>,
    has_played: bool,
    fault: Option<Fault>,
    window: Window,
    answers: Deque<DriveMessage, ANSWERS>,
}

impl<'a> Player<'a> {
    /// An axis at rest, with two buffers for tables.
    pub fn new(config: AxisConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Self {
        Self {
            config,
            a: Slot::new(a),
            b: Slot::new(b),
            tick: 0,
            status_in: config.status_ticks,
            last: Setpoint::at_rest(config.position),
            excursion: None,
            playing: None,
            armed: None,
            has_played: false,
            fault: None,
            window: Window::default(),
            answers: Deque::new(),
        }
    }

    /// Takes a message; answers wait in [`Player::poll_answer`].
    #[inline(never)]
    pub fn handle(&mut self, message: &HostMessage<'_>) {
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
            HostMessage::Start { table, tick } => (table, self.start(table, tick)),
            HostMessage::Stop => {
                self.armed = None;
                self.clear_unused();
                return;
            }
            HostMessage::MoveTo { position, velocity } => (0, self.approach(position, velocity)),
            HostMessage::QuickStop => {
                self.land();
                return;
            }
            HostMessage::Identify => {
                let identity = self.identity();
                self.answer(DriveMessage::Identity(identity));
                return;
            }
        };
        if let Err(reason) = result {
            self.answer(DriveMessage::Reject { table, reason });
        }
    }

    /// The set-point of this tick; call it once per control tick.
    pub fn tick(&mut self) -> Setpoint {
        let planned = if self.excursion.is_some() {
            Ok(self.stray())
        } else {
            self.begin();
            self.play().and_then(|setpoint| self.allowed(setpoint))
        };
        let setpoint = planned.unwrap_or_else(|fault| {
            self.fault = self.fault.or(Some(fault));
            self.land();
            self.stray()
        });
        self.last = setpoint;
        self.tick = self.tick.saturating_add(1);
        if self.config.status_ticks > 0 {
            self.status_in = self.status_in.saturating_sub(1);
            if self.status_in == 0 {
                self.status_in = self.config.status_ticks;
                let status = self.status();
                if self.answers.len() < ANSWERS / 2 {
                    self.answer(DriveMessage::Status(status));
                }
                let fill_ms = status.fill.saturating_mul(u64::from(self.config.tick_ns)) / 1_000_000;
                let telemetry = self.window.take(u32::try_from(fill_ms).unwrap_or(u32::MAX));
                if let Some(telemetry) = telemetry.filter(|_| self.answers.len() < ANSWERS / 2) {
                    self.answer(DriveMessage::Telemetry(telemetry));
                }
            }
        }
        setpoint
    }

    /// Tells where the axis really is, after [`Player::tick`]: for the telemetry that follows each status.
    pub fn observe(&mut self, actual: i64) {
        self.window.follow(self.last.position, actual);
    }

    /// Tells what a tick has cost, in whatever the board counts.
    pub fn observe_cost(&mut self, count: u32) {
        self.window.cost(count);
    }

    /// The oldest answer that was not fetched.
    pub fn poll_answer(&mut self) -> Option<DriveMessage> {
        self.answers.pop_front()
    }

    /// How the axis is.
    #[inline(never)]
    pub fn status(&self) -> Status {
        let after = |end: u64| end.saturating_sub(self.tick);
        let armed_end = self.armed.and_then(|armed| {
            let table = self.slot(armed.side).checked()?;
            Some(armed.tick.saturating_add(ticks_until(table.duration(), self.config.tick_ns)))
        });
        let strayed = self
            .excursion
            .as_ref()
            .map(|way| self.tick.saturating_add(way.course.left().unwrap_or(u64::MAX)));
        let end = strayed.or(armed_end).or(self.playing.map(|p| p.end)).unwrap_or(self.tick);
        Status {
            state: self.state(),
            fault: self.fault,
            tick: self.tick,
            position: self.last.position,
            fill: after(end),
        }
    }

    /// Who the axis is.
    pub fn identity(&self) -> Identity {
        let AxisConfig { axis, tick_ns, limits, .. } = self.config;
        let room = self.a.room().min(self.b.room());
        let room = u32::try_from(room).unwrap_or(u32::MAX);
        let (format, schema) = (FORMAT_VERSION, schema::HASH);
        Identity { version: VERSION, format, schema, axis, tick_ns, limits, room }
    }

    fn state(&self) -> State {
        let (a, b) = (self.a.number(), self.b.number());
        if self.fault.is_some() {
            State::Fault
        } else if let Some(excursion) = &self.excursion {
            if excursion.stops { State::Stopping } else { State::Moving }
        } else if self.playing.is_some() {
            State::Running
        } else if self.armed.is_some() {
            State::Armed
        } else if self.a.is_ready() || self.b.is_ready() {
            State::Ready
        } else if a.is_some() || b.is_some() {
            State::Receiving
        } else if self.has_played {
            State::Holding
        } else {
            State::Idle
        }
    }

    /// Leaves the path for the shortest way to rest; tables are forgotten. At rest there is nothing to do.
    fn land(&mut self) {
        let lands = self.excursion.as_ref().is_some_and(|way| way.stops);
        if !lands && !self.last.done {
            let AxisConfig { limits, tick_ns, .. } = self.config;
            // Without one, as when the set-point is no number, standing still at once is all that is left.
            let course = Course::to_velocity(&self.last, 0.0, &limits, tick_ns).ok();
            self.excursion = course.map(|course| Excursion { course, stops: true });
        }
        (self.playing, self.armed) = (None, None);
        self.clear_unused();
    }

    /// Sets out for a position, from rest or from the way to another one.
    #[inline(never)]
    fn approach(&mut self, position: i64, velocity: Option<f32>) -> Result<(), Reject> {
        self.refuse_in_fault()?;
        if self.playing.is_some() || self.armed.is_some() {
            return Err(Reject::Busy);
        }
        let AxisConfig { mut limits, tick_ns, travel, .. } = self.config;
        let slower = velocity.unwrap_or(limits.velocity);
        let sensible = slower > 0.0 && travel.is_none_or(|[low, high]| (low..=high).contains(&position));
        if !sensible {
            return Err(Reject::Target);
        }
        limits.velocity = slower.min(limits.velocity);
        let course = Course::to(&self.last, position, &limits, tick_ns).map_err(|_| Reject::Target)?;
        self.excursion = Some(Excursion { course, stops: false });
        self.clear_unused();
        Ok(())
    }

    /// The next set-point of a motion without a table.
    fn stray(&mut self) -> Setpoint {
        let Some(excursion) = &mut self.excursion else { return Setpoint::at_rest(self.last.position) };
        let setpoint = excursion.course.next();
        if setpoint.done {
            self.excursion = None;
            self.has_played = true;
        }
        setpoint
    }

    /// The last line: a set-point that keeps the axis' limits, whatever led to it.
    fn allowed(&self, setpoint: Setpoint) -> Result<Setpoint, Fault> {
        let Limits { velocity, acceleration, .. } = self.config.limits;
        let tick_s = self.config.tick_ns as f32 * 1e-9;
        let moved = setpoint.position.saturating_sub(self.last.position).unsigned_abs() as f32;
        let slow = setpoint.velocity.abs() <= velocity * (1.0 + TRIP)
            && moved <= velocity * tick_s * (1.0 + TRIP) + STEP_COUNTS;
        let even = setpoint.acceleration.abs() <= acceleration * (1.0 + TRIP);
        let within = setpoint.position == self.last.position
            || self.config.travel.is_none_or(|[low, high]| (low..=high).contains(&setpoint.position));
        match (slow, even, within) {
            (true, true, true) => Ok(setpoint),
            (false, _, _) => Err(Fault::Limit(AxisLimit::Velocity)),
            (_, false, _) => Err(Fault::Limit(AxisLimit::Acceleration)),
            (_, _, false) => Err(Fault::Limit(AxisLimit::Travel)),
        }
    }

    /// At the tick of the start, the armed table becomes the one that plays.
    fn begin(&mut self) {
        let Some(armed) = self.armed.filter(|armed| armed.tick <= self.tick) else { return };
        self.armed = None;
        if let Some(before) = self.playing.take() {
            self.slot_mut(before.side).clear();
        }
        let Some(table) = self.slot(armed.side).checked() else { return };
        let (number, position) = (table.header().table, table.axis().end);
        let ticks = ticks_until(table.duration(), self.config.tick_ns);
        match Cursor::new(&table) {
            Ok(cursor) => {
                let clock = PathClock::new(self.config.tick_ns);
                let end = armed.tick.saturating_add(ticks);
                self.playing = Some(Playing { side: armed.side, cursor, clock, end, position });
            }
            Err(error) => self.fault = Some(Fault::Table { table: number, error }),
        }
    }

    fn play(&mut self) -> Result<Setpoint, Fault> {
        let Some(mut playing) = self.playing else { return Ok(Setpoint::at_rest(self.last.position)) };
        let slot = self.slot(playing.side);
        let Some(table) = slot.checked() else { return Ok(Setpoint::at_rest(self.last.position)) };
        let setpoint = playing
            .cursor
            .evaluate(&table, playing.clock.time())
            .map_err(|error| Fault::Table { table: table.header().table, error })?;
        playing.clock.advance();
        if setpoint.done {
            self.slot_mut(playing.side).clear();
            self.has_played = true;
            self.playing = None;
        } else {
            self.playing = Some(playing);
        }
        Ok(setpoint)
    }

    #[inline(never)]
    fn open(&mut self, header: TableHeader) -> Result<(), Reject> {
        self.refuse_in_fault()?;
        self.clear_unused();
        if header.tick_ns != self.config.tick_ns {
            return Err(Reject::Tick { tick_ns: self.config.tick_ns });
        }
        if self.side_of(header.table).is_some() {
            return Err(Reject::Busy);
        }
        let side = [Side::A, Side::B].into_iter().find(|side| !self.is_used(*side)).ok_or(Reject::Busy)?;
        self.slot_mut(side).open(header)
    }

    /// Does something to the table that is coming in.
    fn incoming<T>(
        &mut self,
        table: u32,
        act: impl FnOnce(&mut Slot<'a>) -> Result<T, Reject>,
    ) -> Result<T, Reject> {
        self.refuse_in_fault()?;
        let side = self.side_of(table).filter(|side| !self.is_used(*side)).ok_or(Reject::NotOpen)?;
        act(self.slot_mut(side))
    }

    /// Checks a complete table, and says so.
    #[inline(never)]
    fn check(&mut self, number: u32) -> Result<(), Reject> {
        let config = self.config;
        let position = self.next_position();
        let fits = |slot: &mut Slot<'_>| {
            let (_, axis) = slot.headers().ok_or(Reject::NotOpen)?;
            if axis.axis != config.axis {
                return Err(Reject::Axis { axis: config.axis });
            }
            if !is_within(&axis.limits, &config.limits) {
                return Err(Reject::Limits);
            }
            if axis.start != position {
                return Err(Reject::Position { position });
            }
            let ticks = ticks_until(slot.check(config.travel)?.duration(), config.tick_ns);
            let crc = slot.seals().ok_or(Reject::NotReady)?;
            Ok(DriveMessage::Ready { table: number, ticks, crc })
        };
        let result = self.incoming(number, fits);
        match result {
            Ok(ready) => {
                self.answer(ready);
                Ok(())
            }
            Err(reason) => {
                if let Some(side) = self.side_of(number) {
                    self.slot_mut(side).clear();
                }
                Err(reason)
            }
        }
    }

    #[inline(never)]
    fn start(&mut self, number: u32, tick: u64) -> Result<(), Reject> {
        self.refuse_in_fault()?;
        let side = self.side_of(number).ok_or(Reject::NotReady)?;
        if self.excursion.is_some() {
            return Err(Reject::Busy);
        }
        if self.playing.is_some_and(|p| p.side == side) {
            return Ok(());
        }
        if let Some(armed) = self.armed {
            let repeated = armed.side == side && armed.tick == tick;
            return if repeated { Ok(()) } else { Err(Reject::Busy) };
        }
        let start = self.slot(side).checked().ok_or(Reject::NotReady)?.axis().start;
        if tick < self.tick {
            return Err(Reject::Late { tick: self.tick });
        }
        if let Some(playing) = self.playing
            && tick < playing.end
        {
            return Err(Reject::Overlap { tick: playing.end });
        }
        let position = self.next_position();
        if start != position {
            return Err(Reject::Position { position });
        }
        self.armed = Some(Armed { side, tick });
        Ok(())
    }

    /// Where the axis will stand when all that it must still play has been played [counts].
    fn next_position(&self) -> i64 {
        let armed = self.armed.and_then(|armed| Some(self.slot(armed.side).checked()?.axis().end));
        let strayed = self.excursion.as_ref().and_then(|way| way.course.end());
        strayed.or(armed).or(self.playing.map(|p| p.position)).unwrap_or(self.last.position)
    }

    fn refuse_in_fault(&self) -> Result<(), Reject> {
        if self.fault.is_some() { Err(Reject::Fault) } else { Ok(()) }
    }

    #[inline(never)]
    fn answer(&mut self, message: DriveMessage) {
        if self.answers.is_full() {
            self.answers.pop_front();
        }
        // There is room now.
        let _ = self.answers.push_back(message);
    }

    fn clear_unused(&mut self) {
        for side in [Side::A, Side::B] {
            if !self.is_used(side) {
                self.slot_mut(side).clear();
            }
        }
    }

    fn is_used(&self, side: Side) -> bool {
        self.playing.is_some_and(|p| p.side == side) || self.armed.is_some_and(|armed| armed.side == side)
    }

    fn side_of(&self, table: u32) -> Option<Side> {
        [Side::A, Side::B].into_iter().find(|side| self.slot(*side).number() == Some(table))
    }

    fn slot(&self, side: Side) -> &Slot<'a> {
        match side {
            Side::A => &self.a,
            Side::B => &self.b,
        }
    }

    fn slot_mut(&mut self, side: Side) -> &mut Slot<'a> {
        match side {
            Side::A => &mut self.a,
            Side::B => &mut self.b,
        }
    }
}

/// No limit of `table` is above `drive`'s.
fn is_within(table: &Limits, drive: &Limits) -> bool {
    let jerk = match (table.jerk, drive.jerk) {
        (_, None) => true,
        (Some(t), Some(d)) => t <= d,
        (None, Some(_)) => false,
    };
    table.velocity <= drive.velocity && table.acceleration <= drive.acceleration && jerk
}

#[cfg(test)]
mod tests;

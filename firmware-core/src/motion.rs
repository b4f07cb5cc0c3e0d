//! The half of a drive that moves: one set-point per control tick, whatever happens.
//!
//! Every table ends at rest, so whatever fails to arrive, the axis comes to rest on its path: the next piece of a motion takes
//! over from the way to rest of the piece before, at a knot and to the bit, or it does not. An override changes the rate
//! of path time, down to a hold, on the path. A quick stop, a table that is not what was checked, or a set-point beyond the
//! axis' limits leaves the path: the axis comes to rest by a double-S from the set-point before, within its limits. Faults
//! stay latched with their first cause. At rest the axis may be sent to a position or a velocity.

mod obey;
mod play;

use heapless::Vec;
use protocol::message::{Fault, State, Status};
use protocol::power::{Power, PowerEvent};

use crate::axis::{AxisConfig, FaultOption, LostOption, QuickStopOption};
use crate::course::Course;
use crate::evaluate::Setpoint;
use crate::guard::Guard;
use crate::orders::{Order, Report};
use crate::rate::Rate;
use crate::store::Loaded;
use crate::telemetry::Window;
use crate::time::{tick_time, ticks_until};
use play::Playing;

/// Where orders come from and reports go; neither ever waits.
pub trait Link<'a> {
    /// There is an order.
    fn has_orders(&self) -> bool;

    /// The oldest order.
    fn next_order(&mut self) -> Option<Order<'a>>;

    /// There is room for a report. Nobody else makes any, so that room that was seen is still there.
    fn has_room(&self) -> bool;

    /// Hands a report over; without room it is lost.
    fn report(&mut self, report: Report<'a>);
}

/// A table that will start.
#[derive(Debug)]
struct Armed<'a> {
    table: Loaded<'a>,
    tick: u64,
}

/// Motion without a table.
#[derive(Clone, Debug)]
struct Excursion {
    course: Course,
    /// It only comes to rest.
    stops: bool,
}

/// A rate of path time that begins at a tick.
#[derive(Clone, Copy, Debug)]
struct Change {
    target: u64,
    tick: u64,
}

/// The half that moves.
#[derive(Debug)]
pub struct Motion<'a> {
    config: AxisConfig,
    guard: Guard,
    /// Length of a tick [2^-32 s], and its inverse [1/s].
    tick_time: i64,
    per_s: f32,
    /// Number of the next tick.
    tick: u64,
    status_in: u32,
    /// Ticks since the host was heard.
    silence: u32,
    power: Power,
    fault: Option<Fault>,
    /// The set-point that was given last.
    last: Setpoint,
    excursion: Option<Excursion>,
    playing: Option<Playing<'a>>,
    armed: Option<Armed<'a>>,
    /// A table that takes over from the one that plays, or is armed.
    heir: Option<Loaded<'a>>,
    rate: Rate,
    change: Option<Change>,
    /// Path time lost by rates below 1 that is not yet a whole tick [2^-32 s].
    lag: i64,
    has_played: bool,
    window: Window,
    /// Tables that wait to be given back.
    back: Vec<(Loaded<'a>, bool), 3>,
}

impl<'a> Motion<'a> {
    /// An axis at rest, without torque.
    pub fn new(config: AxisConfig) -> Self {
        Self {
            config,
            guard: Guard::new(&config),
            tick_time: tick_time(config.tick_ns) as i64,
            per_s: 1e9 / config.tick_ns as f32,
            tick: 0,
            status_in: config.status_ticks,
            silence: 0,
            power: Power::SwitchOnDisabled,
            fault: None,
            last: Setpoint::at_rest(config.position),
            excursion: None,
            playing: None,
            armed: None,
            heir: None,
            rate: Rate::default(),
            change: None,
            lag: 0,
            has_played: false,
            window: Window::default(),
            back: Vec::new(),
        }
    }

    /// The set-point of this tick; call it once per control tick.
    pub fn tick(&mut self, link: &mut impl Link<'a>) -> Setpoint {
        if link.has_orders() || !self.back.is_empty() {
            self.take_orders(link);
        }
        if self.config.options.lost_ticks > 0 {
            self.listen();
        }
        self.last = self.set_point();
        if self.last.done {
            self.settle();
        }
        // It takes a million years at 500 kHz.
        self.tick = self.tick.wrapping_add(1);
        if self.config.status_ticks > 0 {
            self.status_in = self.status_in.saturating_sub(1);
            if self.status_in == 0 {
                self.tell(link);
            }
        }
        self.last
    }

    /// Does what was ordered, up to the first order that takes planning.
    #[inline(never)]
    pub fn take_orders(&mut self, link: &mut impl Link<'a>) {
        while let Some(order) = link.next_order() {
            self.silence = 0;
            match order {
                Order::Clear => {
                    link.report(Report::Cleared(self.clear()));
                    continue;
                }
                Order::Shift { ticks } => {
                    link.report(Report::Shifted { ticks: if self.shift(ticks) { ticks } else { 0 } });
                    continue;
                }
                Order::Report => {
                    let status = self.status();
                    link.report(Report::Reported(status));
                    continue;
                }
                _ => {}
            }
            let (table, result, plans) = self.obey(order);
            if let Err(reason) = result {
                // Nobody listens if there is no room: the host asks again.
                link.report(Report::Reject { table, reason });
            }
            if plans {
                break;
            }
        }
        while link.has_room()
            && let Some((table, kept)) = self.back.pop()
        {
            link.report(Report::Back { table, kept });
        }
    }

    /// Tells where the axis really is, after [`Motion::tick`]: for the telemetry that follows each status.
    pub fn observe(&mut self, actual: i64) {
        self.window.follow(self.last.position, actual);
    }

    /// Tells what a tick has cost, in whatever the board counts.
    pub fn observe_cost(&mut self, count: u32) {
        self.window.cost(count);
    }

    /// Tells where the axis is while it has no torque; a motion goes on from there. Under torque it is ignored.
    pub fn place(&mut self, position: i64) {
        if !self.power.has_torque() {
            self.last = Setpoint::at_rest(position);
        }
    }

    /// The board has found a fault.
    pub fn trip(&mut self, code: u16) {
        self.fail(Fault::Board { code });
    }

    /// Number of the tick that comes next.
    pub fn now(&self) -> u64 {
        self.tick
    }

    /// The power state: what the power stage has to do.
    pub fn power(&self) -> Power {
        self.power
    }

    /// How the axis is.
    #[inline(never)]
    pub fn status(&self) -> Status {
        let AxisConfig { tick_ns, .. } = self.config;
        let armed =
            |armed: &Armed<'_>| armed.tick.saturating_add(ticks_until(armed.table.duration(), tick_ns));
        let strays =
            |way: &Excursion| way.course.left().map_or(u64::MAX, |left| self.tick.saturating_add(left));
        let end = self.excursion.as_ref().map(strays).or(self.armed.as_ref().map(armed));
        let inherited = |heir: &Loaded<'_>| {
            let playing = self.playing.as_ref()?;
            let until = playing.began.saturating_add(playing.table.tail()?).saturating_add(heir.duration());
            Some(playing.end_after(until, tick_ns))
        };
        let end = end.or(self.heir.as_ref().and_then(inherited));
        let end = end.or(self.playing.as_ref().map(|p| p.end)).unwrap_or(self.tick);
        Status {
            state: self.state(),
            power: self.power,
            fault: self.fault,
            tick: self.tick,
            position: self.last.position,
            fill: end.saturating_sub(self.tick),
        }
    }

    fn state(&self) -> State {
        if let Some(excursion) = &self.excursion {
            if excursion.stops { State::Stopping } else { State::Moving }
        } else if self.playing.is_some() {
            if self.rate.is_held() { State::Held } else { State::Running }
        } else if self.armed.is_some() {
            State::Armed
        } else if self.has_played {
            State::Holding
        } else {
            State::Idle
        }
    }

    /// Counts how long the host has been silent.
    fn listen(&mut self) {
        self.silence = self.silence.saturating_add(1);
        let options = self.config.options;
        if self.silence <= options.lost_ticks || !self.power.has_torque() {
            return;
        }
        match options.lost {
            LostOption::Nothing => {}
            LostOption::Fault => self.fail(Fault::Connection),
            LostOption::Disable => {
                let _ = self.change_power(PowerEvent::DisableVoltage);
            }
            LostOption::QuickStop => {
                if self.power == Power::OperationEnabled {
                    let _ = self.change_power(PowerEvent::QuickStop);
                }
            }
        }
    }

    fn set_point(&mut self) -> Setpoint {
        if self.excursion.is_some() {
            return self.stray();
        }
        if let Some(change) = &self.change
            && change.tick <= self.tick
        {
            let target = change.target;
            self.rate.aim(self.playing.as_ref().map_or(target, |p| p.table.nearest_rate(target)));
            self.change = None;
        }
        let due = self.armed.as_ref().is_some_and(|armed| armed.tick <= self.tick);
        if due && let Err(fault) = self.begin() {
            return self.fail_now(fault);
        }
        // What is given at this tick is at the rate that it begins with.
        let plain = self.rate.is_plain();
        let setpoint = match self.play() {
            Ok(setpoint) => setpoint,
            Err(fault) => return self.fail_now(fault),
        };
        match self.guard.check(&setpoint, self.last.position, plain) {
            Ok(()) => setpoint,
            Err(limit) => self.fail_now(Fault::Limit(limit)),
        }
    }

    /// A fault of this tick: the way to rest begins at once.
    #[cold]
    #[inline(never)]
    fn fail_now(&mut self, fault: Fault) -> Setpoint {
        self.fail(fault);
        self.stray()
    }

    /// The next set-point of a motion without a table.
    #[inline(never)]
    fn stray(&mut self) -> Setpoint {
        let Some(excursion) = &mut self.excursion else { return Setpoint::at_rest(self.last.position) };
        let setpoint = excursion.course.next();
        if setpoint.done {
            self.excursion = None;
            self.has_played = true;
        }
        setpoint
    }

    /// A fault: its first cause is latched, and the axis comes to rest.
    #[inline(never)]
    fn fail(&mut self, fault: Fault) {
        let Some(to) = self.power.after(PowerEvent::Fault) else { return };
        self.fault = self.fault.or(Some(fault));
        self.power = to;
        match self.config.options.fault {
            FaultOption::Stop => self.land(),
            FaultOption::Disable => self.freeze(),
        }
    }

    /// At rest: a reaction has ended.
    #[inline(never)]
    fn settle(&mut self) {
        let ends = match self.power {
            Power::FaultReactionActive => true,
            Power::QuickStopActive => self.config.options.quick_stop == QuickStopOption::StopAndDisable,
            _ => false,
        };
        if ends && let Some(to) = self.power.after(PowerEvent::Stopped) {
            self.power = to;
        }
    }

    /// Leaves the path for the shortest way to rest; tables are forgotten. At rest there is nothing to do.
    #[inline(never)]
    fn land(&mut self) {
        let lands = self.excursion.as_ref().is_some_and(|way| way.stops);
        if !lands {
            let AxisConfig { limits, tick_ns, .. } = self.config;
            // Without one, as when the set-point is no number, standing still at once is all that is left. A move that was
            // ordered since the last tick has not begun.
            let course = || Course::to_velocity(&self.last, 0.0, &limits, tick_ns).ok();
            let course = if self.last.done { None } else { course() };
            self.excursion = course.map(|course| Excursion { course, stops: true });
        }
        self.drop_tables();
    }

    /// Gives up every motion at once: without torque there is none.
    fn freeze(&mut self) {
        self.excursion = None;
        self.last = Setpoint::at_rest(self.last.position);
        self.drop_tables();
    }

    fn drop_tables(&mut self) {
        if let Some(playing) = self.playing.take() {
            self.give_back(playing.table, false);
        }
        self.disarm();
        (self.rate, self.change) = (Rate::default(), None);
    }

    fn disarm(&mut self) {
        if let Some(armed) = self.armed.take() {
            self.give_back(armed.table, false);
        }
        if let Some(heir) = self.heir.take() {
            self.give_back(heir, false);
        }
    }

    fn give_back(&mut self, table: Loaded<'a>, kept: bool) {
        // There are two buffers, and room for both.
        let _ = self.back.push((table, kept));
    }

    #[inline(never)]
    fn tell(&mut self, link: &mut impl Link<'a>) {
        self.status_in = self.config.status_ticks;
        let status = self.status();
        link.report(Report::Status(status));
        let fill_ms = status.fill.saturating_mul(u64::from(self.config.tick_ns)) / 1_000_000;
        if let Some(telemetry) = self.window.take(u32::try_from(fill_ms).unwrap_or(u32::MAX)) {
            link.report(Report::Telemetry(telemetry));
        }
    }

    /// Something moves or is about to.
    fn moves(&self) -> bool {
        !self.last.done || self.excursion.is_some() || self.playing.is_some() || self.armed.is_some()
    }
}

#[cfg(test)]
impl Motion<'_> {
    /// Overwrites the bytes of the table that plays, as a memory error would.
    pub(crate) fn corrupt(&mut self) {
        if let Some(playing) = &mut self.playing {
            playing.table.corrupt();
        }
    }

    pub(crate) fn set_guard(&mut self, guard: Guard) {
        self.guard = guard;
    }
}

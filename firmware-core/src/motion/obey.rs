//! What the motion does when it is told something, or why it refuses.

use protocol::message::Reject;
use protocol::power::{Power, PowerEvent};

use super::{Armed, Change, Excursion, Motion};
use crate::axis::{AxisConfig, QuickStopOption};
use crate::course::Course;
use crate::evaluate::Setpoint;
use crate::orders::Order;
use crate::rate::of_permille;
use crate::store::Loaded;

/// Largest commanded rate [0.1 %].
const MOST_PERMILLE: u16 = 2000;

impl<'a> Motion<'a> {
    /// The number of the table that an order is about, what came of it, and whether it took planning.
    pub(super) fn obey(&mut self, order: Order<'a>) -> (u32, Result<(), Reject>, bool) {
        match order {
            Order::Start { table, tick } => {
                let (number, joins) = (table.number(), table.header().joint.is_some());
                let allowed = if joins { self.may_inherit(&table) } else { self.may_start(&table, tick) };
                match allowed {
                    Ok(()) if joins => self.heir = Some(table),
                    Ok(()) => self.armed = Some(Armed { table, tick }),
                    Err(_) => self.give_back(table, true),
                }
                (number, allowed, false)
            }
            Order::StartAgain { table, tick } => {
                let plays = self.playing.as_ref().is_some_and(|p| p.table.number() == table);
                let waits = self.armed.as_ref().is_some_and(|a| a.table.number() == table && a.tick == tick)
                    || self.heir.as_ref().is_some_and(|heir| heir.number() == table);
                let reason = if self.armed.is_some() { Reject::Busy } else { Reject::NotReady };
                (table, if plays || waits { Ok(()) } else { Err(reason) }, false)
            }
            Order::Stop => {
                self.cancel();
                (0, Ok(()), false)
            }
            Order::MoveTo { position, velocity } => (0, self.move_to(position, velocity), true),
            Order::MoveAt { velocity } => (0, self.move_at(velocity), true),
            Order::Power(event) => (0, self.change_power(event), event == PowerEvent::QuickStop),
            Order::Override { permille, tick } => (0, self.change_rate(permille, tick), false),
            Order::Hold { tick } => {
                self.hold(tick);
                (0, Ok(()), true)
            }
            // These have answers of their own.
            Order::Alive | Order::Clear | Order::Shift { .. } | Order::Report => (0, Ok(()), false),
        }
    }

    /// Nothing starts any more. A table that is to take over from the one that plays still does: where the path ends must not
    /// depend on when a drive has heard of it.
    fn cancel(&mut self) {
        if self.playing.is_none() {
            self.disarm();
        } else if let Some(armed) = self.armed.take() {
            self.give_back(armed.table, false);
        }
    }

    /// Stops on the path from a tick on; what is not on a path stops at once. A table that is to take over still does: where
    /// the path ends must not depend on when a drive has heard of the stop.
    #[inline(never)]
    pub(super) fn hold(&mut self, tick: u64) {
        self.cancel();
        if self.excursion.is_some() {
            return self.land();
        }
        if self.playing.is_none() {
            self.drop_tables();
            return;
        }
        let tick = tick.max(self.tick);
        let holds = |change: &Change| change.target == 0 && change.tick <= tick;
        if !self.change.as_ref().is_some_and(holds) && self.rate.target() != 0 {
            self.change = Some(Change { target: 0, tick });
        }
    }

    /// Forgets everything, if the axis is at rest and stays there.
    pub(super) fn clear(&mut self) -> bool {
        let held = self.rate.is_held() && self.change.is_none();
        let rests = self.excursion.is_none() && self.armed.is_none() && (self.playing.is_none() || held);
        if rests {
            self.last = Setpoint::at_rest(self.last.position);
            self.drop_tables();
        }
        rests
    }

    /// Counts on from another tick, if the axis is at rest.
    pub(super) fn shift(&mut self, ticks: i64) -> bool {
        let rests = !self.moves() && self.change.is_none();
        if rests {
            self.tick = self.tick.saturating_add_signed(ticks);
        }
        rests
    }

    /// Whether a table may be armed for a tick.
    #[inline(never)]
    pub(super) fn may_start(&self, table: &Loaded<'_>, tick: u64) -> Result<(), Reject> {
        self.refuse_without_torque()?;
        if self.excursion.is_some() || self.armed.is_some() || self.heir.is_some() {
            return Err(Reject::Busy);
        }
        if tick < self.tick {
            return Err(Reject::Late { tick: self.tick });
        }
        if let Some(playing) = self.playing.as_ref().filter(|playing| tick < playing.end) {
            return Err(Reject::Overlap { tick: playing.end });
        }
        let ends = self.playing.as_ref().map(|p| p.table.axis().end);
        let position = ends.unwrap_or(self.last.position);
        if table.axis().start != position {
            return Err(Reject::Position { position });
        }
        // A rate that is to come counts as well.
        let plain = self.rate.is_plain() && self.change.is_none();
        if table.header().warp.is_none() && !plain {
            return Err(Reject::Override);
        }
        Ok(())
    }

    /// Whether a table may take over from the one that it names: that one plays or is armed, and its tail has not begun.
    #[inline(never)]
    pub(super) fn may_inherit(&self, table: &Loaded<'_>) -> Result<(), Reject> {
        self.refuse_without_torque()?;
        if self.heir.is_some() || (self.playing.is_some() && self.armed.is_some()) {
            return Err(Reject::Busy);
        }
        let named = table.header().joint.map(|joint| joint.table);
        let armed = self.armed.as_ref().is_some_and(|armed| Some(armed.table.number()) == named);
        let playing = self.playing.as_ref().filter(|playing| Some(playing.table.number()) == named);
        match playing.and_then(|p| Some((p, p.table.header().tail?))) {
            Some((p, tail)) if p.cursor.span() < tail => Ok(()),
            Some(_) => Err(Reject::Late { tick: self.tick }),
            None if armed => Ok(()),
            None => Err(Reject::NotReady),
        }
    }

    /// Sets out for a position, from rest or from the way to another one.
    #[inline(never)]
    pub(super) fn move_to(&mut self, position: i64, velocity: Option<f32>) -> Result<(), Reject> {
        self.refuse_to_stray()?;
        let AxisConfig { mut limits, tick_ns, travel, .. } = self.config;
        let slower = velocity.unwrap_or(limits.velocity);
        let sensible = slower > 0.0
            && slower.is_finite()
            && travel.is_none_or(|[low, high]| (low..=high).contains(&position));
        if !sensible {
            return Err(Reject::Target);
        }
        limits.velocity = slower.min(limits.velocity);
        let course = Course::to(&self.last, position, &limits, tick_ns).map_err(|_| Reject::Target)?;
        self.excursion = Some(Excursion { course, stops: false });
        Ok(())
    }

    /// Goes at a velocity; towards the end of the travel, where there is one.
    #[inline(never)]
    pub(super) fn move_at(&mut self, velocity: f32) -> Result<(), Reject> {
        let AxisConfig { limits, tick_ns, travel, .. } = self.config;
        let admissible = velocity.abs() <= limits.velocity;
        if !admissible {
            return Err(Reject::Target);
        }
        if velocity != 0.0
            && let Some([low, high]) = travel
        {
            return self.move_to(if velocity > 0.0 { high } else { low }, Some(velocity.abs()));
        }
        self.refuse_to_stray()?;
        let course =
            Course::to_velocity(&self.last, velocity, &limits, tick_ns).map_err(|_| Reject::Target)?;
        self.excursion = Some(Excursion { course, stops: false });
        Ok(())
    }

    /// A command that changes the power state.
    #[inline(never)]
    pub(super) fn change_power(&mut self, event: PowerEvent) -> Result<(), Reject> {
        let to = self.power.after(event).ok_or(Reject::Power(self.power))?;
        let enabled = self.power == Power::OperationEnabled;
        match event {
            // Nobody but the drive itself knows of these.
            PowerEvent::Fault | PowerEvent::Stopped => return Err(Reject::Power(self.power)),
            PowerEvent::Shutdown | PowerEvent::DisableOperation if enabled && self.moves() => {
                return Err(Reject::Moves);
            }
            PowerEvent::EnableOperation if !enabled && self.moves() => return Err(Reject::Moves),
            PowerEvent::ResetFault => self.fault = None,
            _ => {}
        }
        self.power = to;
        let stops = self.config.options.quick_stop != QuickStopOption::Disable;
        match to {
            Power::QuickStopActive if stops => self.land(),
            Power::QuickStopActive => {
                self.freeze();
                self.power = Power::SwitchOnDisabled;
            }
            Power::OperationEnabled => {}
            _ => self.freeze(),
        }
        Ok(())
    }

    /// A command that changes the rate of path time.
    pub(super) fn change_rate(&mut self, permille: u16, tick: u64) -> Result<(), Reject> {
        if tick < self.tick {
            return Err(Reject::Late { tick: self.tick });
        }
        let target = of_permille(permille);
        let tables = [self.playing.as_ref().map(|p| &p.table), self.armed.as_ref().map(|a| &a.table)];
        let admitted = tables.into_iter().flatten().all(|table| table.nearest_rate(target) == target);
        if permille > MOST_PERMILLE || !admitted {
            return Err(Reject::Override);
        }
        self.change = Some(Change { target, tick });
        Ok(())
    }

    pub(super) fn refuse_without_torque(&self) -> Result<(), Reject> {
        match (self.fault, self.power) {
            (Some(_), _) => Err(Reject::Fault),
            (None, Power::OperationEnabled) => Ok(()),
            (None, power) => Err(Reject::Power(power)),
        }
    }

    pub(super) fn refuse_to_stray(&self) -> Result<(), Reject> {
        self.refuse_without_torque()?;
        if self.playing.is_some() || self.armed.is_some() { Err(Reject::Busy) } else { Ok(()) }
    }
}

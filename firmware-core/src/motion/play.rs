//! How tables play: they begin, take over from each other, change their rate and end.

use protocol::message::Fault;

use super::{Armed, Motion};
use crate::evaluate::{Cursor, Setpoint};
use crate::rate::Pace;
use crate::store::Loaded;
use crate::time::{PathClock, ticks_until};

/// A table that plays.
#[derive(Debug)]
pub(super) struct Playing<'a> {
    pub(super) table: Loaded<'a>,
    pub(super) cursor: Cursor,
    pub(super) clock: PathClock,
    /// Where the table's own time begins on that clock [2^-32 s]: later than 0 if it has taken over from another one.
    pub(super) began: u64,
    /// Tick at which it will have come to rest, if the rate is 1 from now on.
    pub(super) end: u64,
}

impl Playing<'_> {
    /// Path time at which it will have come to rest.
    pub(super) fn until(&self) -> u64 {
        self.began.saturating_add(self.table.duration())
    }

    /// Tick at which motion ends that goes on until another path time.
    pub(super) fn end_after(&self, until: u64, tick_ns: u32) -> u64 {
        let [now, then] = [self.until(), until].map(|time| ticks_until(time, tick_ns));
        self.end.saturating_add(then).saturating_sub(now)
    }
}

impl Motion<'_> {
    /// When the table before it is at its end, the armed table becomes the one that plays.
    #[inline(never)]
    pub(super) fn begin(&mut self) -> Result<(), Fault> {
        let free = self.playing.as_ref().is_none_or(|p| p.clock.time() >= p.until());
        if !free {
            return Ok(());
        }
        if let Some(before) = self.playing.take() {
            self.give_back(before.table, false);
        }
        let Some(Armed { table, .. }) = self.armed.take() else { return Ok(()) };
        let ticks = ticks_until(table.duration(), self.config.tick_ns);
        let cursor = match table.table().map(|view| Cursor::new(&view)) {
            Some(Ok(cursor)) => cursor,
            Some(Err(error)) => {
                let fault = Fault::Table { table: table.number(), error };
                self.give_back(table, false);
                return Err(fault);
            }
            None => return Ok(()),
        };
        // At rest the rate may be what it will.
        self.rate.aim(table.nearest_rate(self.rate.target()));
        self.rate.jump();
        self.lag = 0;
        let clock = PathClock::new(self.config.tick_ns);
        let end = self.tick.saturating_add(ticks);
        self.playing = Some(Playing { table, cursor, clock, began: 0, end });
        Ok(())
    }

    /// Lets the heir take over when its time has come.
    #[inline(never)]
    pub(super) fn inherit(&mut self) -> Result<(), Fault> {
        let (Some(playing), Some(heir)) = (&mut self.playing, &self.heir) else { return Ok(()) };
        let (Some(here), Some(next)) = (playing.table.table(), heir.table()) else { return Ok(()) };
        let Some(tail) = here.header().tail else { return Ok(()) };
        let fault = |error| Fault::Table { table: here.header().table, error };
        if !playing.cursor.approach(&here, playing.clock.time(), tail).map_err(fault)? {
            return Ok(());
        }
        let joined = playing.cursor.joined(&next);
        let cursor = joined.map_err(|error| Fault::Table { table: next.header().table, error })?;
        let until = cursor.began().saturating_add(next.duration());
        playing.end = playing.end_after(until, self.config.tick_ns);
        (playing.cursor, playing.began) = (cursor, cursor.began());
        if let Some(heir) = self.heir.take() {
            let before = core::mem::replace(&mut playing.table, heir);
            self.give_back(before, false);
        }
        Ok(())
    }

    pub(super) fn play(&mut self) -> Result<Setpoint, Fault> {
        if self.heir.is_some() {
            self.inherit()?;
        }
        let Some(playing) = &mut self.playing else {
            self.rate.jump();
            return Ok(Setpoint::at_rest(self.last.position));
        };
        let Some(table) = playing.table.table() else { return Ok(Setpoint::at_rest(self.last.position)) };
        let setpoint = playing
            .cursor
            .evaluate(&table, playing.clock.time())
            .map_err(|error| Fault::Table { table: table.header().table, error })?;
        if !setpoint.done && self.rate.is_plain() {
            playing.clock.advance();
            return Ok(setpoint);
        }
        Ok(self.play_unusually(setpoint))
    }

    /// The end of a table, and rates other than 1.
    #[inline(never)]
    pub(super) fn play_unusually(&mut self, setpoint: Setpoint) -> Setpoint {
        if setpoint.done {
            if let Some(playing) = self.playing.take() {
                self.give_back(playing.table, false);
            }
            self.has_played = true;
            return setpoint;
        }
        let Some(playing) = &mut self.playing else { return setpoint };
        let Some(warp) = &playing.table.header().warp else {
            playing.clock.advance();
            return setpoint;
        };
        let pace = self.rate.advance(warp);
        self.lag = self.lag.saturating_add(playing.clock.advance_at(pace.mean));
        self.delay();
        at_pace(&setpoint, &pace, self.per_s)
    }

    /// What is lost of path time puts off all that is planned, tick by whole tick.
    pub(super) fn delay(&mut self) {
        let tick = self.tick_time;
        let late = if self.lag >= tick {
            1
        } else if self.lag <= tick.saturating_neg() {
            -1
        } else {
            return;
        };
        self.lag = self.lag.saturating_sub(tick.saturating_mul(late));
        if let Some(playing) = &mut self.playing {
            playing.end = playing.end.saturating_add_signed(late);
        }
        if let Some(armed) = &mut self.armed {
            armed.tick = armed.tick.saturating_add_signed(late);
        }
    }
}

/// A set-point of the path at another rate: v s, a s^2 + v s'.
fn at_pace(setpoint: &Setpoint, pace: &Pace, per_s: f32) -> Setpoint {
    let Setpoint { position, velocity, acceleration, done } = *setpoint;
    let change = pace.change * per_s;
    Setpoint {
        position,
        velocity: velocity * pace.s,
        acceleration: acceleration * pace.s * pace.s + velocity * change,
        done,
    }
}

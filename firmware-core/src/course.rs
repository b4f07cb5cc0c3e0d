//! Motion without a table, by a double-S, in counts: to rest, to a position or to a velocity that is then kept.
//!
//! However long a move is, it ends on the exact count. A long move is more counts than f32 holds: the segments before its
//! cruise are evaluated forwards from the start, those after it backwards from the target, each exact to a fraction of a
//! count; the cruise is an integer line between the two. Where there is no cruise, what the halves differ by is spread over
//! the segment in which they meet.

use heapless::Vec;
use protocol::table::Limits;
use protocol::table::rules::PATH_TIME_PER_S;

use crate::double_s::{
    DoubleSError, MOST_SEGMENTS, MotionLimits, Profile, Segment, State, plan, plan_velocity,
};
use crate::evaluate::Setpoint;
use crate::math::nearest_long;
use crate::time::{PathClock, ticks_until};

/// Ticks in which acceleration is built up where the axis has no limit of jerk.
const SOFT_TICKS: f32 = 4.0;

/// Parts of a count in which a velocity that is kept goes on.
const FINE: i64 = 1 << 32;

/// One segment in its place.
#[derive(Clone, Copy, Debug)]
struct Leg {
    /// Position counted from where it is anchored.
    segment: Segment<f32>,
    /// When it ends [2^-32 s].
    ends: u64,
}

/// A motion from a set-point, in the least time that the axis' limits allow.
#[derive(Clone, Debug)]
pub(crate) struct Course {
    legs: Vec<Leg, MOST_SEGMENTS>,
    /// Where the first legs are anchored, and the last ones [counts].
    start: i64,
    target: i64,
    /// The leg in which they meet, and what they differ by there [counts].
    meeting: usize,
    gap: f32,
    tick_ns: u32,
    clock: PathClock,
    ticks: u64,
    line: Option<Line>,
    /// The leg that plays, and when it began.
    leg: usize,
    began: u64,
    /// The velocity that is kept behind the last leg [counts/s]; 0 at rest.
    velocity: f32,
}

/// Whole counts along a straight line, tick by tick (Bresenham 1965).
#[derive(Clone, Copy, Debug)]
struct Line {
    position: i64,
    /// Counts of every tick, and how many ticks of all get one more.
    step: i64,
    more: i64,
    ticks: i64,
    rest: i64,
}

impl Line {
    fn new(from: i64, to: i64, ticks: i64) -> Option<Self> {
        let way = to.checked_sub(from)?;
        let (step, more) = (way.checked_div_euclid(ticks)?, way.checked_rem_euclid(ticks)?);
        Some(Self { position: from, step, more, ticks, rest: 0 })
    }

    /// Endless, from a position at a velocity [counts/s].
    fn endless(from: i64, velocity: f32, tick_ns: u32) -> Self {
        let way = (velocity * (tick_ns as f32 * 1e-9) * FINE as f32) as i64;
        Self { position: from, step: way.div_euclid(FINE), more: way.rem_euclid(FINE), ticks: FINE, rest: 0 }
    }

    fn next(&mut self) -> i64 {
        self.position = self.position.saturating_add(self.step);
        self.rest = self.rest.saturating_add(self.more);
        if self.rest >= self.ticks {
            self.rest = self.rest.saturating_sub(self.ticks);
            self.position = self.position.saturating_add(1);
        }
        self.position
    }
}

impl Course {
    /// To rest at `target`, under the axis' own limits.
    ///
    /// # Errors
    /// The set-point is no number, or the limits are none.
    #[inline(never)]
    pub(crate) fn to(
        from: &Setpoint,
        target: i64,
        limits: &Limits,
        tick_ns: u32,
    ) -> Result<Self, DoubleSError> {
        let distance = target.saturating_sub(from.position) as f32;
        let end = State { position: distance, velocity: 0.0, acceleration: 0.0 };
        let profile = plan(&start(from), &end, &softened(limits, tick_ns))?;
        Ok(Self::new(from.position, target, &profile, tick_ns))
    }

    /// To a velocity [counts/s] that is then kept, or to rest at the nearest count: more than the limits is led back first.
    ///
    /// # Errors
    /// The set-point is no number, or the limits are none.
    #[inline(never)]
    pub(crate) fn to_velocity(
        from: &Setpoint,
        velocity: f32,
        limits: &Limits,
        tick_ns: u32,
    ) -> Result<Self, DoubleSError> {
        let profile = plan_velocity(&start(from), velocity, &softened(limits, tick_ns))?;
        let target = from.position.saturating_add(nearest_long(profile.end().position));
        Ok(Self { velocity, ..Self::new(from.position, target, &profile, tick_ns) })
    }

    /// Puts the segments of a profile into their places between `start` and `target`.
    #[inline(never)]
    fn new(start: i64, target: i64, profile: &Profile<f32>, tick_ns: u32) -> Self {
        let segments = profile.segments();
        // They meet in the longest way: the cruise of a long move.
        let way = |s: &Segment<f32>| (s.end().position - s.start.position).abs();
        let meeting = segments
            .iter()
            .enumerate()
            .fold((0, -1.0f32), |best, (index, s)| if way(s) > best.1 { (index, way(s)) } else { best })
            .0;
        let mut legs: Vec<Leg, MOST_SEGMENTS> = Vec::new();
        let (mut ends, mut forwards) = (0u64, 0.0f32);
        for segment in segments {
            let at = |position: f32| Segment { start: State { position, ..segment.start }, ..*segment };
            ends = ends.saturating_add((segment.duration * PATH_TIME_PER_S + 0.5) as u64);
            // There is room for all of a profile.
            let _ = legs.push(Leg { segment: at(forwards), ends });
            forwards = at(forwards).end().position;
        }
        let mut backwards = 0.0f32;
        for leg in legs.iter_mut().skip(meeting.saturating_add(1)).rev() {
            leg.segment.start.position = 0.0;
            backwards -= leg.segment.end().position;
            leg.segment.start.position = backwards;
        }
        let met = legs.get(meeting).map_or(0.0, |leg| leg.segment.end().position);
        // Both ends are near zero for what f32 holds: the difference of whole counts is exact.
        let apart = target.saturating_sub(start).saturating_sub(nearest_long(met));
        let gap = apart as f32 + (nearest_long(met) as f32 - met) + backwards;
        let clock = PathClock::new(tick_ns);
        Self {
            legs,
            start,
            target,
            meeting,
            gap,
            tick_ns,
            clock,
            ticks: 0,
            line: None,
            leg: 0,
            began: 0,
            velocity: 0.0,
        }
    }

    /// The next set-point, one tick after the last one; at the end it is the target, at rest, unless a velocity is kept.
    pub(crate) fn next(&mut self) -> Setpoint {
        self.clock.advance();
        self.ticks = self.ticks.saturating_add(1);
        let now = self.clock.time();
        while let Some(leg) = self.legs.get(self.leg)
            && now >= leg.ends
        {
            (self.leg, self.began) = (self.leg.saturating_add(1), leg.ends);
        }
        let Some(leg) = self.legs.get(self.leg).copied() else { return self.beyond(now) };
        let t = now.saturating_sub(self.began) as f32 / PATH_TIME_PER_S;
        let State { position, velocity, acceleration } = leg.segment.at(t);
        let position = if self.leg > self.meeting {
            self.target.saturating_add(nearest_long(position))
        } else if self.leg < self.meeting {
            self.start.saturating_add(nearest_long(position))
        } else {
            self.between(&leg, t, position)
        };
        Setpoint { position, velocity, acceleration, done: false }
    }

    /// Behind the last leg.
    fn beyond(&mut self, now: u64) -> Setpoint {
        let velocity = self.velocity;
        if velocity == 0.0 {
            return Setpoint::at_rest(self.target);
        }
        let position = if let Some(line) = self.line.as_mut().filter(|_| self.leg > self.legs.len()) {
            line.next()
        } else {
            let passed = nearest_long(velocity * (now.saturating_sub(self.began) as f32 / PATH_TIME_PER_S));
            let from = self.target.saturating_add(passed);
            self.line = Some(Line::endless(from, velocity, self.tick_ns));
            self.leg = self.legs.len().saturating_add(1);
            from
        };
        Setpoint { position, velocity, acceleration: 0.0, done: false }
    }

    /// The position in the leg where both ends meet.
    fn between(&mut self, leg: &Leg, t: f32, position: f32) -> i64 {
        if let Some(line) = &mut self.line {
            return line.next();
        }
        let cruises = leg.segment.jerk == 0.0 && leg.segment.start.acceleration == 0.0;
        if cruises {
            let here = self.start.saturating_add(nearest_long(position));
            // The last tick before its end, and where it is then, seen from the target.
            let last = ticks_until(leg.ends, self.tick_ns).saturating_sub(1);
            let ticks = last.saturating_sub(self.ticks);
            let mut clock = self.clock;
            clock.skip(ticks);
            let left = leg.ends.saturating_sub(clock.time()) as f32 / PATH_TIME_PER_S;
            let next = self.legs.get(self.leg.saturating_add(1));
            let meets = next.map_or(0.0, |next| next.segment.start.position);
            let there = self.target.saturating_add(nearest_long(meets - left * leg.segment.start.velocity));
            self.line = i64::try_from(ticks).ok().and_then(|ticks| Line::new(here, there, ticks));
            return here;
        }
        let share = t / leg.segment.duration;
        self.start.saturating_add(nearest_long(position + share * self.gap))
    }

    /// Where it ends [counts]; none if it does not.
    pub(crate) fn end(&self) -> Option<i64> {
        (self.velocity == 0.0).then_some(self.target)
    }

    /// Ticks until it has ended; none if it does not.
    pub(crate) fn left(&self) -> Option<u64> {
        self.end()?;
        let all = self.legs.last().map_or(0, |leg| ticks_until(leg.ends, self.tick_ns));
        Some(all.saturating_sub(self.ticks))
    }
}

/// A set-point as the start of a motion.
fn start(from: &Setpoint) -> State<f32> {
    State { position: 0.0, velocity: from.velocity, acceleration: from.acceleration }
}

/// An axis' limits as limits of a motion.
fn softened(limits: &Limits, tick_ns: u32) -> MotionLimits<f32> {
    let jerk = limits.jerk.unwrap_or(limits.acceleration / (SOFT_TICKS * tick_ns as f32 * 1e-9));
    MotionLimits::symmetric(limits.velocity, limits.acceleration, jerk)
}

#[cfg(test)]
mod tests;

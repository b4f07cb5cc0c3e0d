//! A move to a position by a double-S, in counts: however long it is, it ends on the exact count.
//!
//! A long move is more counts than f32 holds. The segments before its cruise are evaluated forwards from the start, those
//! after it backwards from the target, each exact to a fraction of a count; the cruise is an integer line between the two.
//! Where there is no cruise, what the halves differ by is spread over the segment in which they meet.

use heapless::Vec;
use protocol::table::Limits;
use protocol::table::rules::PATH_TIME_PER_S;

use crate::double_s::{DoubleSError, MOST_SEGMENTS, MotionLimits, Segment, State, plan};
use crate::evaluate::Setpoint;
use crate::landing::softened;
use crate::math::nearest;
use crate::time::{PathClock, ticks_until};

/// One segment in its place.
#[derive(Clone, Copy, Debug)]
struct Leg {
    /// Position counted from where it is anchored.
    segment: Segment<f32>,
    /// When it ends [2^-32 s].
    ends: u64,
}

/// A move to a position.
#[derive(Clone, Debug)]
pub(crate) struct Approach {
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

impl Approach {
    /// From a set-point that has been given to rest at `target`, under the axis' own limits.
    ///
    /// # Errors
    /// The set-point is no number, or the limits are none.
    #[inline(never)]
    pub(crate) fn new(
        from: &Setpoint,
        target: i64,
        limits: &Limits,
        tick_ns: u32,
    ) -> Result<Self, DoubleSError> {
        let limits: MotionLimits<f32> = softened(limits, tick_ns);
        let distance = target.saturating_sub(from.position) as f32;
        let start = State { position: 0.0, velocity: from.velocity, acceleration: from.acceleration };
        let profile = plan(&start, &State { position: distance, velocity: 0.0, acceleration: 0.0 }, &limits)?;
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
        let apart = target.saturating_sub(from.position).saturating_sub(i64::from(nearest(met)));
        let gap = apart as f32 + (nearest(met) as f32 - met) + backwards;
        let clock = PathClock::new(tick_ns);
        Ok(Self {
            legs,
            start: from.position,
            target,
            meeting,
            gap,
            tick_ns,
            clock,
            ticks: 0,
            line: None,
            leg: 0,
            began: 0,
        })
    }

    /// The next set-point, one tick after the last one; at the end it is the target, at rest.
    pub(crate) fn next(&mut self) -> Setpoint {
        self.clock.advance();
        self.ticks = self.ticks.saturating_add(1);
        let now = self.clock.time();
        while let Some(leg) = self.legs.get(self.leg)
            && now >= leg.ends
        {
            (self.leg, self.began) = (self.leg.saturating_add(1), leg.ends);
        }
        let Some(leg) = self.legs.get(self.leg).copied() else { return Setpoint::at_rest(self.target) };
        let t = now.saturating_sub(self.began) as f32 / PATH_TIME_PER_S;
        let State { position, velocity, acceleration } = leg.segment.at(t);
        let position = if self.leg > self.meeting {
            self.target.saturating_add(i64::from(nearest(position)))
        } else if self.leg < self.meeting {
            self.start.saturating_add(i64::from(nearest(position)))
        } else {
            self.between(&leg, t, position)
        };
        Setpoint { position, velocity, acceleration, done: false }
    }

    /// The position in the leg where both ends meet.
    fn between(&mut self, leg: &Leg, t: f32, position: f32) -> i64 {
        if let Some(line) = &mut self.line {
            return line.next();
        }
        let cruises = leg.segment.jerk == 0.0 && leg.segment.start.acceleration == 0.0;
        if cruises {
            let here = self.start.saturating_add(i64::from(nearest(position)));
            // The last tick before its end, and where it is then, seen from the target.
            let last = ticks_until(leg.ends, self.tick_ns).saturating_sub(1);
            let ticks = last.saturating_sub(self.ticks);
            let mut clock = self.clock;
            clock.skip(ticks);
            let left = leg.ends.saturating_sub(clock.time()) as f32 / PATH_TIME_PER_S;
            let next = self.legs.get(self.leg.saturating_add(1));
            let meets = next.map_or(0.0, |next| next.segment.start.position);
            let there =
                self.target.saturating_add(i64::from(nearest(meets - left * leg.segment.start.velocity)));
            self.line = i64::try_from(ticks).ok().and_then(|ticks| Line::new(here, there, ticks));
            return here;
        }
        let share = t / leg.segment.duration;
        self.start.saturating_add(i64::from(nearest(position + share * self.gap)))
    }

    /// Where it ends [counts].
    pub(crate) fn end(&self) -> i64 {
        self.target
    }

    /// Ticks until it has ended.
    pub(crate) fn left(&self) -> u64 {
        let all = self.legs.last().map_or(0, |leg| ticks_until(leg.ends, self.tick_ns));
        all.saturating_sub(self.ticks)
    }
}

#[cfg(test)]
mod tests;

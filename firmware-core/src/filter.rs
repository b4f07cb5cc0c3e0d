//! A nonlinear third-order filter: a rough reference in, a motion within limits out, tick by tick.
//!
//! After Zanasi, Lo Bianco and Tonielli 2000 and Biagiotti and Melchiorri 2008, section 4.6.1: the jerk of every tick is one
//! of +U, 0 and -U, chosen by on which side of a switching surface the state lies. As printed it has three faults. Its
//! integrators are wrong: velocity is integrated from the velocity before, and delta = e' + e''|e''|/2. Sampled switching
//! exceeds limits: here the next acceleration is bounded so that velocity can still be brought to its limit without going
//! beyond, exactly. And it overshoots a little and chatters for ever near the target: here, once a reference that moves
//! evenly is within reach, a double-S takes over and lands on it, and then the filter is the reference. Where limits are
//! reached within a few ticks it may still be late for that, and overshoot.
//!
//! For rough references, such as a hand wheel or a sensor: where the target is known, the double-S itself is faster.

use crate::double_s::{Bounds, DoubleSError, MotionLimits, Profile, Real, State, plan};

/// Ticks within which a landing has to come to its end, besides the time that braking takes.
const REACH_TICKS: u8 = 32;
/// Share of acceleration and of jerk that the switching surface counts on: what is late by a part of a tick can then catch up.
const COUNTED: (u8, u8) = (9, 10);
/// How far a reference may be off where it was heading and still move evenly, relative to the way of a tick.
const EVEN: u8 = 16;

/// The filter.
#[derive(Clone, Debug)]
pub struct Filter<R> {
    tick_s: R,
    state: State<R>,
    /// The reference of the tick before, with the limits of then.
    before: Option<(State<R>, MotionLimits<R>)>,
    landing: Option<Landing<R>>,
    /// The state is the reference.
    locked: bool,
}

/// The end of an approach to a reference that moves evenly, as seen from it.
#[derive(Clone, Debug)]
struct Landing<R> {
    profile: Profile<R>,
    /// Time since it began [s].
    time: R,
}

impl<R: Real> Filter<R> {
    /// A filter that begins in a state, with ticks of `tick_s`.
    pub fn new(state: State<R>, tick_s: R) -> Self {
        Self { tick_s, state, before: None, landing: None, locked: false }
    }

    /// The state of the last tick.
    pub fn state(&self) -> State<R> {
        self.state
    }

    /// The state at the next tick, for a reference there and limits from now on; both may change at every tick.
    ///
    /// Limits that are exceeded, because they were lowered, are returned to as fast as the others allow. Cost: a few square
    /// roots, and one plan when a landing begins.
    ///
    /// # Errors
    /// A number that is none, or limits that make no sense; the state stays.
    pub fn next(&mut self, reference: &State<R>, limits: &MotionLimits<R>) -> Result<State<R>, DoubleSError> {
        limits.check()?;
        if let Some(quantity) = reference.fault() {
            return Err(DoubleSError::Target(quantity));
        }
        let even = self.is_even(reference, limits);
        self.before = Some((*reference, *limits));
        if !even {
            (self.landing, self.locked) = (None, false);
        }
        self.state = if self.locked {
            *reference
        } else if let Some(state) = self.land(reference, limits, even) {
            state
        } else {
            self.chase(reference, limits)
        };
        Ok(self.state)
    }

    /// The reference goes on as it did, at a velocity that the limits admit, and they are the same.
    fn is_even(&self, reference: &State<R>, limits: &MotionLimits<R>) -> bool {
        let Some((before, known)) = &self.before else { return false };
        let step = reference.position - before.position;
        let way = before.velocity * self.tick_s;
        // Rounding of positions, and of the way.
        let most = R::ULP * (reference.position.abs() + before.position.abs());
        let off = (step - way).abs();
        let slack = most + most + way.abs() * R::ULP * R::whole(EVEN);
        off <= slack
            && reference.velocity == before.velocity
            && reference.acceleration == R::ZERO
            && before.acceleration == R::ZERO
            && limits.velocity.hold(reference.velocity)
            && known == limits
    }

    /// The landing on an even reference, if it is within reach.
    fn land(&mut self, reference: &State<R>, limits: &MotionLimits<R>, even: bool) -> Option<State<R>> {
        if self.landing.is_none() && even {
            // As it was at the tick before.
            let from = self.seen_from(reference);
            self.landing = self.plan(&from, reference, limits);
        }
        let landing = self.landing.as_mut()?;
        landing.time = landing.time + self.tick_s;
        if landing.time >= landing.profile.duration() {
            (self.landing, self.locked) = (None, true);
            return Some(*reference);
        }
        let seen = landing.profile.at(landing.time);
        Some(State {
            position: reference.position + seen.position,
            velocity: reference.velocity + seen.velocity,
            acceleration: seen.acceleration,
        })
    }

    /// The present state as seen from an even reference, which has gone on by a tick.
    fn seen_from(&self, reference: &State<R>) -> State<R> {
        let there = reference.position - reference.velocity * self.tick_s;
        State {
            position: self.state.position - there,
            velocity: self.state.velocity - reference.velocity,
            acceleration: self.state.acceleration,
        }
    }

    fn plan(&self, from: &State<R>, reference: &State<R>, limits: &MotionLimits<R>) -> Option<Landing<R>> {
        let jerk = limits.jerk.max.least(-limits.jerk.min);
        let acceleration = limits.acceleration.max.least(-limits.acceleration.min);
        // As long as braking takes, and a few ticks.
        let ramp = acceleration / jerk;
        let reach = from.velocity.abs() / acceleration + ramp + ramp + self.tick_s * R::whole(REACH_TICKS);
        let fastest = from.velocity.abs() + acceleration * ramp;
        if from.position.abs() > fastest * reach {
            return None;
        }
        let shift =
            |b: &Bounds<R>| Bounds { min: b.min - reference.velocity, max: b.max - reference.velocity };
        let limits = MotionLimits { velocity: shift(&limits.velocity), ..*limits };
        let rest = State { position: R::ZERO, velocity: R::ZERO, acceleration: R::ZERO };
        let profile = plan(from, &rest, &limits).ok()?;
        let soon = profile.duration() <= reach;
        // One that goes beyond the reference first is no landing: the filter does better.
        let straight = profile.segments().iter().all(|s| {
            let end = s.end().position;
            end * from.position >= R::ZERO || end.abs() <= R::ULP * from.position.abs()
        });
        (soon && straight).then_some(Landing { profile, time: R::ZERO })
    }

    /// One tick towards the reference, by the switching surface.
    fn chase(&self, reference: &State<R>, limits: &MotionLimits<R>) -> State<R> {
        let t = self.tick_s;
        let jerk = limits.jerk.max.least(-limits.jerk.min);
        let counted = jerk * R::whole(COUNTED.0) / R::whole(COUNTED.1);
        let sign = self.surface(reference, limits, counted);
        let State { position, velocity, acceleration } = self.state;
        // Where velocity must not pass its limits it must not be heading beyond them either: with a' the next acceleration,
        // v + t (a + a')/2 + a'|a'|/(2 U) stays within.
        let half = jerk * t * R::HALF;
        let coming = velocity + t * R::HALF * acceleration;
        let most = |room: R| (half * half + (jerk + jerk) * room).root() - half;
        // Below no room acceleration of the other sign is due, as much as it takes within this tick and the limits.
        let upper = limits.velocity.max - coming;
        let lower = coming - limits.velocity.min;
        let highest = if upper > R::ZERO { most(upper) } else { (upper + upper) / t };
        let lowest = if lower > R::ZERO { -most(lower) } else { -((lower + lower) / t) };
        // No more jerk than what there is to do can take: otherwise a tick of it would lead beyond the reference.
        let there = reference.position - reference.velocity * t;
        let off = (position - there).abs()
            + t * (velocity - reference.velocity).abs()
            + t * t * (acceleration - reference.acceleration).abs();
        let useful = off / (t * t * t * R::whole(4));
        let wanted = acceleration - sign * jerk.least(useful) * t;
        let bounded = wanted.least(highest).most(lowest);
        let admitted = bounded.least(limits.acceleration.max).most(limits.acceleration.min);
        let a = admitted.least(acceleration + limits.jerk.max * t).most(acceleration + limits.jerk.min * t);
        // Exact for a constant jerk: (a - acceleration)/t.
        let v = velocity + t * R::HALF * (acceleration + a);
        let mean = velocity + t / R::whole(6) * (acceleration + acceleration + a);
        State { position: position + t * mean, velocity: v, acceleration: a }
    }

    /// Sign of the jerk that is to be taken away: the side of the switching surface.
    fn surface(&self, reference: &State<R>, limits: &MotionLimits<R>, jerk: R) -> R {
        // The reference is that of the next tick; the state is compared with where it was at this one.
        let gained = reference.acceleration * self.tick_s;
        let there = reference.position - (reference.velocity - R::HALF * gained) * self.tick_s;
        let (e, v, a) = (
            (self.state.position - there) / jerk,
            (self.state.velocity - (reference.velocity - gained)) / jerk,
            (self.state.acceleration - reference.acceleration) / jerk,
        );
        let share = R::whole(COUNTED.0) / R::whole(COUNTED.1);
        let a_max = (limits.acceleration.max * share - reference.acceleration) / jerk;
        let a_min = (limits.acceleration.min * share - reference.acceleration) / jerk;
        let (three, four, six, eight) = (R::whole(3), R::whole(4), R::whole(6), R::whole(8));
        // What catches up counts as what was counted on.
        let a = a.least(a_max).most(a_min);
        let delta = v + R::HALF * a * a.abs();
        let side = sign(delta);
        let square = a * a;
        let sum = if a <= a_max && v <= R::HALF * square - a_max * a_max {
            let w = square - (v + v);
            e - a_max * w / four - w * w / (eight * a_max) - a * (three * v - square) / three
        } else if a >= a_min && v >= a_min * a_min - R::HALF * square {
            let w = square + (v + v);
            e - a_min * w / four - w * w / (eight * a_min) + a * (three * v + square) / three
        } else {
            let w = square + (v + v) * side;
            e + v * a * side - square * a / six * (R::ONE - three * side.abs())
                + side / four * ((w + w) * w * w).root()
        };
        let first = sign(sum);
        if first != R::ZERO {
            return first;
        }
        let second = delta + (R::ONE - side.abs()) * a;
        sign(second)
    }
}

fn sign<R: Real>(x: R) -> R {
    if x > R::ZERO {
        R::ONE
    } else if x < R::ZERO {
        -R::ONE
    } else {
        R::ZERO
    }
}

#[cfg(test)]
mod tests;

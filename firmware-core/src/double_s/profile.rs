//! A motion as segments of constant jerk.

use heapless::Vec;

use super::limits::State;
use super::real::Real;

/// Most segments: three that lead back into the limits, and seven.
pub const MOST_SEGMENTS: usize = 10;

/// Constant jerk from a state on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment<R> {
    /// How long it takes.
    pub duration: R,
    /// Where it starts.
    pub start: State<R>,
    /// Its jerk.
    pub jerk: R,
}

/// A motion from state to state.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile<R, const N: usize = MOST_SEGMENTS> {
    segments: Vec<Segment<R>, N>,
    duration: R,
    end: State<R>,
}

impl<R: Real> Segment<R> {
    /// The state `t` after its start.
    pub fn at(&self, t: R) -> State<R> {
        let State { position, velocity, acceleration } = self.start;
        let third = self.jerk * t / R::whole(3);
        State {
            position: position + t * (velocity + R::HALF * t * (acceleration + third)),
            velocity: velocity + t * (acceleration + R::HALF * self.jerk * t),
            acceleration: acceleration + self.jerk * t,
        }
    }

    /// The state at its end.
    pub fn end(&self) -> State<R> {
        self.at(self.duration)
    }
}

impl<R: Real, const N: usize> Profile<R, N> {
    /// No motion yet.
    pub(super) fn at_rest(state: State<R>) -> Self {
        Self { segments: Vec::new(), duration: R::ZERO, end: state }
    }

    /// Adds a segment; one without length is left out. False when there is no room.
    pub(super) fn push(&mut self, segment: Segment<R>) -> bool {
        if segment.duration <= R::ZERO {
            return true;
        }
        self.duration = self.duration + segment.duration;
        self.end = segment.end();
        self.segments.push(segment).is_ok()
    }

    /// Sets where the motion ends, exactly.
    pub(super) fn ends_at(&mut self, end: State<R>) {
        self.end = end;
    }

    /// How long it takes.
    pub fn duration(&self) -> R {
        self.duration
    }

    /// Its segments, in order; none where start and target are one.
    pub fn segments(&self) -> &[Segment<R>] {
        &self.segments
    }

    /// Where it ends.
    pub fn end(&self) -> State<R> {
        self.end
    }

    /// The state at time `t`: the start before it, and beyond the end what follows at the target's acceleration.
    pub fn at(&self, t: R) -> State<R> {
        let mut left = t.most(R::ZERO);
        for segment in &self.segments {
            if left < segment.duration {
                return segment.at(left);
            }
            left = left - segment.duration;
        }
        Segment { duration: R::ZERO, start: self.end, jerk: R::ZERO }.at(left)
    }
}

//! A motion is believed only after each of its segments has been integrated.

use super::limits::{DoubleSError, MotionLimits, State};
use super::profile::{Profile, Segment};
use super::real::Real;

/// Integrates the segments of a motion: the first has to begin at `from`, each to end where the next one begins, the last
/// one where the motion ends; and velocities have to keep their limits after the first segments, `outside` of them, which
/// lead back into these. `clock` is how well its times are known.
#[inline(never)]
pub(super) fn check<R: Real, const N: usize>(
    profile: &Profile<R, N>,
    from: &State<R>,
    outside: usize,
    limits: &MotionLimits<R>,
    clock: R,
) -> Result<(), DoubleSError> {
    let over = |velocity: R| (velocity - limits.velocity.max).most(limits.velocity.min - velocity);
    let slack = R::ACCEPTED * limits.velocity.max.most(-limits.velocity.min);
    let (mut path, mut fastest, mut steepest) = (R::ZERO, from.velocity.abs(), from.acceleration.abs());
    let (mut broken, mut inside) = (R::ZERO, false);
    let mut jumps = Jumps { position: R::ZERO, velocity: R::ZERO, acceleration: R::ZERO };
    let mut before = *from;
    for (index, segment) in profile.segments().iter().enumerate() {
        jumps.note(&before, &segment.start);
        let (start, end) = (segment.start.velocity, segment.end());
        let peak = extreme(segment);
        // On its way back, a velocity may still be outside while its acceleration is taken away.
        inside = inside || (index >= outside && over(start) <= slack);
        if inside {
            broken = broken.most(over(peak)).most(over(end.velocity));
        }
        let largest = start.abs().most(peak.abs()).most(end.velocity.abs());
        fastest = fastest.most(largest);
        steepest = steepest.most(end.acceleration.abs());
        path = path + segment.duration * largest;
        before = end;
    }
    let end = profile.end();
    jumps.note(&before, &end);
    // Far from zero, positions themselves are coarse.
    let coarse = R::whole(16) * R::ULP * from.position.abs().most(end.position.abs());
    let fastest = fastest.most(end.velocity.abs());
    let steepest = steepest.most(end.acceleration.abs());
    let jerk = limits.jerk.max.most(-limits.jerk.min);
    let finite = profile.duration().is_finite() && path.is_finite();
    let arrives = finite
        && jumps.position <= R::ACCEPTED * path + coarse + clock * fastest
        && jumps.velocity <= R::ACCEPTED * fastest + clock * steepest
        && jumps.acceleration <= R::ACCEPTED * steepest + clock * jerk;
    // What is left of velocities far outside is their rounding.
    let slack = slack + R::whole(16) * R::ULP * fastest;
    if arrives && broken <= slack { Ok(()) } else { Err(DoubleSError::Precision) }
}

/// The largest differences between where a segment ends and the next one begins.
struct Jumps<R> {
    position: R,
    velocity: R,
    acceleration: R,
}

impl<R: Real> Jumps<R> {
    /// NaN is the worst jump, whenever it comes.
    fn note(&mut self, end: &State<R>, next: &State<R>) {
        let worse = |known: R, a: R, b: R| {
            let off = (a - b).abs();
            if known >= off || !known.is_finite() { known } else { off }
        };
        self.position = worse(self.position, end.position, next.position);
        self.velocity = worse(self.velocity, end.velocity, next.velocity);
        self.acceleration = worse(self.acceleration, end.acceleration, next.acceleration);
    }
}

/// The velocity inside a segment where the acceleration passes zero, or the one at its start.
fn extreme<R: Real>(segment: &Segment<R>) -> R {
    let (State { velocity, acceleration: a, .. }, j) = (segment.start, segment.jerk);
    if a * (a + j * segment.duration) < R::ZERO { velocity - R::HALF * a * a / j } else { velocity }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_that_is_no_number_is_not_forgotten() {
        let state = |position: f32| State { position, velocity: 0.0, acceleration: 0.0 };
        let mut jumps = Jumps { position: 0.0, velocity: 0.0, acceleration: 0.0 };
        jumps.note(&state(f32::NAN), &state(0.0));
        jumps.note(&state(1.0), &state(1.0));
        assert!(jumps.position.is_nan());
    }
}

//! Back into the limits, the fastest way.

use super::limits::{Bounds, MotionLimits, State};
use super::profile::{Profile, Segment};
use super::real::Real;
use super::task::{gained, k};

/// What velocities may be off by and still count as within their limits [ulp of the largest one].
const BAND_ULPS: u8 = 16;

/// What counts as rounding in a velocity, beside these limits.
pub(super) fn band<R: Real>(limits: &Bounds<R>, velocity: R) -> R {
    R::whole(BAND_ULPS) * R::ULP * limits.max.most(-limits.min).most(velocity.abs())
}

/// Adds what leads from `state` into the limits, and returns where it ends; `None` when there is no room.
///
/// An acceleration outside is brought to its limit. Then a velocity outside, or one that leaves the limits however
/// fast the acceleration is taken away, is driven back until it is at its limit, or until taking the acceleration away
/// would carry it out on the other side.
pub(super) fn recover<R: Real>(
    state: State<R>,
    limits: &MotionLimits<R>,
    profile: &mut Profile<R>,
) -> Option<State<R>> {
    let mut state = state;
    let Bounds { min, max } = limits.acceleration;
    if state.acceleration > max {
        let duration = (state.acceleration - max) / -limits.jerk.min;
        state = add(profile, Segment { duration, start: state, jerk: limits.jerk.min }, max)?;
    } else if state.acceleration < min {
        let duration = (min - state.acceleration) / limits.jerk.max;
        state = add(profile, Segment { duration, start: state, jerk: limits.jerk.max }, min)?;
    }
    let band = band(&limits.velocity, state.velocity);
    let (low, high) = (limits.velocity.min - band, limits.velocity.max + band);
    let (v, a) = (state.velocity, state.acceleration);
    let stop = gained(v, a, -limits.jerk.min, limits.jerk.max);
    if stop < low || (stop <= high && v < low) {
        down(state, &limits.mirrored(), profile, true)
    } else if stop > high || v > high {
        down(state, limits, profile, false)
    } else {
        Some(state)
    }
}

/// Drives the velocity down; `mirrored` when the limits, not the state, are those of the mirror image.
fn down<R: Real>(
    state: State<R>,
    limits: &MotionLimits<R>,
    profile: &mut Profile<R>,
    mirrored: bool,
) -> Option<State<R>> {
    let turned = |x: R| if mirrored { -x } else { x };
    let (v, a) = (turned(state.velocity), turned(state.acceleration));
    let (up, fall) = (limits.jerk.max, -limits.jerk.min);
    let k = k(up, fall);
    let most = -limits.acceleration.min;
    // Acceleration -y at which the velocity is at its limit, or would just not leave it on the other side.
    let to_limit = (a * a + R::whole(2) * fall * (v - limits.velocity.max)).root();
    let to_other = ((v - limits.velocity.min + R::HALF * a * a / fall) / k).root();
    let y = to_limit.least(to_other).least(most);
    let ramp = Segment { duration: ((a + y) / fall).most(R::ZERO), start: state, jerk: turned(-fall) };
    let mut state = add(profile, ramp, turned(-y.most(-a)))?;
    if y >= most {
        let v = turned(state.velocity);
        let to_other = v - R::HALF * y * y / up - limits.velocity.min;
        let duration = ((v - limits.velocity.max).least(to_other) / y).most(R::ZERO);
        state = add(profile, Segment { duration, start: state, jerk: R::ZERO }, turned(-y))?;
    }
    Some(state)
}

/// Adds a segment and returns where it ends, with this acceleration exactly.
fn add<R: Real>(profile: &mut Profile<R>, segment: Segment<R>, acceleration: R) -> Option<State<R>> {
    profile.push(segment).then(|| State { acceleration, ..segment.end() })
}

//! Double-S motion, planned online: from any position, velocity and acceleration to any other, in the least time.
//!
//! Velocity, acceleration and jerk keep limits that need not be symmetric. The whole third-order problem is one root on
//! one curve ([`chain`]): of all motions that take a given time the furthest has the jerks + 0 - 0 +, and these form
//! a chain of one parameter. Every other case is that chain in a mirror, or played backwards. There is no enumeration
//! of profiles, no polynomial root finder, no unit and no absolute tolerance. A start outside its limits is first led
//! back the fastest way. Every motion is integrated, segment by segment, and refused unless it arrives within its limits.
//!
//! The same source runs in `f32` on a drive and, with the feature `host`, in `f64`. Cost: a bounded search, one
//! evaluation of the chain per step. Terms after Biagiotti and Melchiorri 2008, section 3.4.

mod accept;
mod chain;
mod limits;
mod profile;
mod real;
mod recovery;
mod root;
mod solve;
mod task;
#[cfg(test)]
mod tests;
#[cfg(feature = "host")]
mod timed;

pub use limits::{Bounds, DoubleSError, MotionLimits, Quantity, State};
pub use profile::{MOST_SEGMENTS, Profile, Segment};
pub use real::Real;
#[cfg(feature = "host")]
pub use timed::{MOST_EDGES, TIMED_SEGMENTS, Timed};

use solve::Solution;
use task::Task;

/// The fastest motion from a state to another.
///
/// # Errors
/// [`DoubleSError`] names the number that is none, or the limit that makes no sense or that the target breaks. A start
/// outside its limits is none: it is led back into them first.
pub fn plan<R: Real>(
    from: &State<R>,
    to: &State<R>,
    limits: &MotionLimits<R>,
) -> Result<Profile<R>, DoubleSError> {
    check(from, to, limits)?;
    finish(from, to, limits, solve::fastest)
}

/// The fastest motion from a state to a velocity that is then kept, wherever that is.
///
/// # Errors
/// As [`plan`].
pub fn plan_velocity<R: Real>(
    from: &State<R>,
    velocity: R,
    limits: &MotionLimits<R>,
) -> Result<Profile<R>, DoubleSError> {
    let to = State { position: from.position, velocity, acceleration: R::ZERO };
    check(from, &to, limits)?;
    finish(from, &to, limits, solve::quickest)
}

fn check<R: Real>(from: &State<R>, to: &State<R>, limits: &MotionLimits<R>) -> Result<(), DoubleSError> {
    limits.check()?;
    if let Some(quantity) = from.fault() {
        return Err(DoubleSError::Start(quantity));
    }
    if let Some(quantity) = to.fault() {
        return Err(DoubleSError::Target(quantity));
    }
    if !limits.velocity.hold(to.velocity) {
        return Err(DoubleSError::TargetOutside(Quantity::Velocity));
    }
    if !limits.acceleration.hold(to.acceleration) {
        return Err(DoubleSError::TargetOutside(Quantity::Acceleration));
    }
    let band = recovery::band(&limits.velocity, to.velocity);
    let start = Task::new(from, to, limits).start_velocity();
    let widened = Bounds { min: limits.velocity.min - band, max: limits.velocity.max + band };
    if widened.hold(start) { Ok(()) } else { Err(DoubleSError::TargetUnreachable) }
}

/// A start led back into its limits, and what is left to do from there.
#[derive(Clone, Debug)]
struct Inside<R> {
    /// The way back.
    profile: Profile<R>,
    /// Where it ends.
    inside: State<R>,
    task: Task<R>,
}

/// Leads the start back into its limits.
#[inline(never)]
fn enter<R: Real>(
    from: &State<R>,
    to: &State<R>,
    limits: &MotionLimits<R>,
) -> Result<Inside<R>, DoubleSError> {
    let mut profile = Profile::at_rest(*from);
    let inside = recovery::recover(*from, limits, &mut profile).ok_or(DoubleSError::Precision)?;
    let mut task = Task::new(&inside, to, limits);
    // What is outside by rounding only is no reason to turn back.
    let (start, stop) = (task.start_velocity(), task.stop_velocity());
    task.v_max = task.v_max.most(start).most(stop);
    task.v_min = task.v_min.least(start).least(stop);
    Ok(Inside { profile, inside, task })
}

/// Recovery, and what `solver` says of the rest.
fn finish<R: Real>(
    from: &State<R>,
    to: &State<R>,
    limits: &MotionLimits<R>,
    solver: impl FnOnce(&Task<R>) -> Solution<R>,
) -> Result<Profile<R>, DoubleSError> {
    let Inside { mut profile, inside, task } = enter(from, to, limits)?;
    let outside = profile.segments().len();
    let solution = solver(&task);
    for part in solution.parts() {
        let start = State { position: inside.position + part.start.position, ..part.start };
        if !profile.push(Segment { start, ..part }) {
            return Err(DoubleSError::Precision);
        }
    }
    // A distance that was asked for comes back as it was: then the motion ends at the target itself.
    let position = if solution.distance() == task.distance {
        to.position
    } else {
        inside.position + solution.distance()
    };
    profile.ends_at(State { position, ..*to });
    accept::check(&profile, from, outside, limits, R::ZERO)?;
    Ok(profile)
}

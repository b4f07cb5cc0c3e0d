//! Axes that move from state to state together, planned on the host: each on its own, all in the same time, or all on one
//! line.

use firmware_core::double_s::{self, MOST_EDGES, Profile, Timed};

pub use firmware_core::double_s::{Bounds, DoubleSError, MotionLimits, Quantity, Segment, State};

/// How axes wait for each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sync {
    /// Not at all: every axis is as fast as it can be.
    #[default]
    None,
    /// All arrive at the same time.
    Time,
    /// All keep to one line through their states; where there is none, all arrive at the same time.
    Phase,
}

/// What an axis has to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Where it is.
    pub from: State<f64>,
    /// What it goes for.
    pub to: Target,
    /// Its limits.
    pub limits: MotionLimits<f64>,
}

/// What an axis goes for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// A position, velocity and acceleration.
    State(State<f64>),
    /// A velocity, kept from then on, wherever that is.
    Velocity(f64),
}

/// What an axis does.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisMotion {
    /// Its segments, in order.
    pub segments: Vec<Segment<f64>>,
    /// Where it ends.
    pub end: State<f64>,
    /// How long it takes [s].
    pub duration: f64,
}

/// What a group does.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupMotion {
    /// Every axis, in order.
    pub axes: Vec<AxisMotion>,
    /// The longest of them [s].
    pub duration: f64,
    /// How they wait for each other in fact.
    pub sync: Sync,
}

/// Why a group has no motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("axis {axis}: {error:?}")]
pub struct GroupError {
    /// The axis, from 0.
    pub axis: usize,
    /// What is wrong with it.
    pub error: DoubleSError,
}

/// How far vectors may be from one line, relative to their longest part.
const COLLINEAR: f64 = 1e-12;
/// How much earlier than its own fastest motion an axis may be asked to arrive: rounding.
const ROUNDING: f64 = 1e-12;

/// The fastest motion of a group.
///
/// # Errors
/// The first axis that has none, and why.
pub fn plan(axes: &[Axis], sync: Sync) -> Result<GroupMotion, GroupError> {
    let alone = axes
        .iter()
        .enumerate()
        .map(|(axis, a)| fastest(a).map_err(|error| GroupError { axis, error }))
        .collect::<Result<Vec<_>, _>>()?;
    let longest = |axes: &[AxisMotion]| axes.iter().map(|a| a.duration).fold(0.0, f64::max);
    match sync {
        Sync::None => Ok(GroupMotion { duration: longest(&alone), axes: alone, sync }),
        Sync::Phase if axes.len() > 1 => match on_a_line(axes) {
            Some(motion) => Ok(motion),
            None => together(axes, alone),
        },
        Sync::Time | Sync::Phase => together(axes, alone),
    }
}

fn fastest(axis: &Axis) -> Result<AxisMotion, DoubleSError> {
    let profile = match axis.to {
        Target::State(to) => double_s::plan(&axis.from, &to, &axis.limits)?,
        Target::Velocity(velocity) => double_s::plan_velocity(&axis.from, velocity, &axis.limits)?,
    };
    Ok(AxisMotion::from(&profile))
}

/// All axes in the least time that every one of them can take.
///
/// An axis may be able to take some durations and, between them, others not. The least time for all is where some axis
/// begins to be able again.
fn together(axes: &[Axis], alone: Vec<AxisMotion>) -> Result<GroupMotion, GroupError> {
    let timed = axes
        .iter()
        .enumerate()
        .map(|(axis, a)| match a.to {
            Target::State(to) => {
                Timed::new(&a.from, &to, &a.limits).map(Some).map_err(|error| GroupError { axis, error })
            }
            Target::Velocity(_) => Ok(None),
        })
        .collect::<Result<Vec<_>, _>>()?;
    let least = alone.iter().map(|a| a.duration).fold(0.0, f64::max);
    let mut times: Vec<f64> = Vec::with_capacity(1 + MOST_EDGES * axes.len());
    times.push(least);
    times.extend(timed.iter().flatten().flat_map(|t| t.edges()).filter(|&t| t > least));
    times.sort_by(f64::total_cmp);
    let able = |time: f64| {
        timed.iter().zip(&alone).all(|(t, own)| own.takes(time) || t.as_ref().is_none_or(|t| t.admits(time)))
    };
    // The displacements within reach grow without bound in the end, so that the last edge is an end of waiting too.
    let duration = times.iter().copied().find(|&time| able(time));
    let fault = |axis| GroupError { axis, error: DoubleSError::Precision };
    let Some(duration) = duration else {
        let last = times.last().copied().unwrap_or(least);
        let stuck = timed.iter().position(|t| t.as_ref().is_some_and(|t| !t.admits(last)));
        return Err(fault(stuck.unwrap_or(0)));
    };
    let mut motions = Vec::with_capacity(axes.len());
    for (axis, (own, t)) in alone.into_iter().zip(&timed).enumerate() {
        let Some(t) = t else {
            motions.push(own);
            continue;
        };
        if own.takes(duration) {
            motions.push(own);
            continue;
        }
        let profile = t.plan(duration).map_err(|error| GroupError { axis, error })?;
        motions.push(AxisMotion::from(&profile.ok_or(fault(axis))?));
    }
    Ok(GroupMotion { axes: motions, duration, sync: Sync::Time })
}

/// All axes as multiples of one of them, if their states allow it.
fn on_a_line(axes: &[Axis]) -> Option<GroupMotion> {
    let targets: Vec<State<f64>> = axes
        .iter()
        .map(|a| match a.to {
            Target::State(to) => Some(to),
            Target::Velocity(_) => None,
        })
        .collect::<Option<_>>()?;
    let vector = |of: &dyn Fn(&Axis, &State<f64>) -> f64| -> Vec<f64> {
        axes.iter().zip(&targets).map(|(a, to)| of(a, to)).collect()
    };
    let vectors = [
        vector(&|a, to| to.position - a.from.position),
        vector(&|a, _| a.from.velocity),
        vector(&|a, _| a.from.acceleration),
        vector(&|_, to| to.velocity),
        vector(&|_, to| to.acceleration),
    ];
    let line = vectors.iter().find(|v| v.iter().any(|x| *x != 0.0))?;
    let lead = (0..axes.len()).max_by(|&a, &b| line[a].abs().total_cmp(&line[b].abs()))?;
    let ratios: Vec<f64> = line.iter().map(|x| x / line[lead]).collect();
    let collinear = vectors.iter().all(|v| {
        let longest = v.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        v.iter().zip(&ratios).all(|(x, ratio)| (x - ratio * v[lead]).abs() <= COLLINEAR * longest)
    });
    if !collinear {
        return None;
    }
    let strictest = |of: &dyn Fn(&MotionLimits<f64>) -> Bounds<f64>| {
        let all = axes.iter().zip(&ratios).filter(|(_, ratio)| **ratio != 0.0).map(|(a, &ratio)| {
            let Bounds { min, max } = of(&a.limits);
            if ratio > 0.0 { [min / ratio, max / ratio] } else { [max / ratio, min / ratio] }
        });
        all.fold(Bounds { min: f64::NEG_INFINITY, max: f64::INFINITY }, |b, [min, max]| Bounds {
            min: b.min.max(min),
            max: b.max.min(max),
        })
    };
    let limits = MotionLimits {
        velocity: strictest(&|l| l.velocity),
        acceleration: strictest(&|l| l.acceleration),
        jerk: strictest(&|l| l.jerk),
    };
    let led = AxisMotion::from(&double_s::plan(&axes[lead].from, &targets[lead], &limits).ok()?);
    let origin = axes[lead].from.position;
    let motions = axes.iter().zip(&targets).zip(&ratios).map(|((axis, to), &ratio)| {
        let segments = led.segments.iter().map(|s| Segment {
            duration: s.duration,
            start: State {
                position: axis.from.position + ratio * (s.start.position - origin),
                velocity: ratio * s.start.velocity,
                acceleration: ratio * s.start.acceleration,
            },
            jerk: ratio * s.jerk,
        });
        AxisMotion { segments: segments.collect(), end: *to, duration: led.duration }
    });
    Some(GroupMotion { axes: motions.collect(), duration: led.duration, sync: Sync::Phase })
}

impl AxisMotion {
    /// An axis that already takes this long needs no other motion.
    fn takes(&self, time: f64) -> bool {
        (time - self.duration).abs() <= ROUNDING * time
    }
}

impl<const N: usize> From<&Profile<f64, N>> for AxisMotion {
    fn from(profile: &Profile<f64, N>) -> Self {
        AxisMotion { segments: profile.segments().to_vec(), end: profile.end(), duration: profile.duration() }
    }
}

#[cfg(test)]
mod tests;

//! What would make a refused problem one with an answer: the smallest relaxation of a single limit, found by trying.

use super::error::{self, LimitKind, PlanError};
use super::problem::{Problem, Settings};
use super::sweep::Sweep;
use super::{knots, plan, slowed};
use crate::geometry::section::{FeedCap, SpeedCap};
use crate::job::machine::AxisLimits;

/// Factors that are tried one after the other on every limit; between the first that helps and the one before it, the
/// smallest is found by bisection.
const FACTORS: [f64; 8] = [1.0, 1.5, 4.0, 16.0, 100.0, 1e4, 1e6, 1e9];
/// Bisections: the factor found is at most a few per cent above the smallest, in the first steps of [`FACTORS`].
const BISECTIONS: usize = 6;
/// Longest path [geometry spans] on which relaxations are tried, and longest motion that is planned for it [spans].
const LONGEST: usize = 2000;
const LONGEST_TRIED: f64 = 5e4;

/// A single limit, relaxed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relief {
    /// Which limit.
    pub limit: Relaxed,
    /// By which factor, above 1; the problem with this limit multiplied by it has a plan.
    pub factor: f64,
}

/// The limit that is relaxed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relaxed {
    /// A limit of an axis, counted from 0.
    Axis(usize, LimitKind),
    /// The caps on the path speed.
    Feed,
}

/// The smallest factor on one limit of `problem` that gives it a plan, when [`plan`] has refused it with `fault`.
///
/// `None` where no single factor up to 1e9 helps, where the fault is about the path or a setting, or the path is too
/// long to try. Cost: up to a hundred attempts to plan the path.
pub fn relief(problem: &Problem, settings: &Settings, fault: &PlanError) -> Option<Relief> {
    let motion = matches!(
        fault,
        PlanError::TooLong { .. }
            | PlanError::Slow { .. }
            | PlanError::Uneven { .. }
            | PlanError::Resolution { .. }
    );
    if !motion || problem.path.spans() > LONGEST {
        return None;
    }
    let long = matches!(fault, PlanError::TooLong { .. });
    let helps = |limit, factor| relaxed(problem, Relief { limit, factor }, |p| plannable(p, settings, long));
    let (limit, mut low, mut high) = FACTORS.windows(2).find_map(|pair| {
        let limit = candidates(problem).into_iter().find(|&limit| helps(limit, pair[1]))?;
        Some((limit, pair[0], pair[1]))
    })?;
    for _ in 0..BISECTIONS {
        let middle = (low * high).sqrt();
        if helps(limit, middle) { high = middle } else { low = middle }
    }
    Some(Relief { limit, factor: high })
}

/// What may be relaxed: the feed first, the limits of axes that move after it.
fn candidates(problem: &Problem) -> Vec<Relaxed> {
    let capped = problem.caps.iter().any(|cap| match cap.speed {
        SpeedCap::None => false,
        SpeedCap::Tangential { speed, .. } => speed.is_finite(),
        SpeedCap::Rate(rate) => rate.is_finite(),
    });
    let axes = problem.limits.iter().zip(&problem.path.axes).enumerate();
    let moving = axes.filter(|(_, (_, axis))| axis.controls.windows(2).any(|c| c[0] != c[1]));
    let kinds = moving.flat_map(|(axis, (l, _))| {
        let jerk = l.jerk.is_finite().then_some(LimitKind::Jerk);
        let kinds = [Some(LimitKind::Velocity), Some(LimitKind::Acceleration), jerk];
        kinds.into_iter().flatten().map(move |kind| Relaxed::Axis(axis, kind))
    });
    capped.then_some(Relaxed::Feed).into_iter().chain(kinds).collect()
}

/// Whether there is a plan; of a motion that is `long`, whether it is expected to fit in memory.
fn plannable(problem: &Problem, settings: &Settings, long: bool) -> bool {
    if error::validate(problem).is_err() {
        return false;
    }
    let limits = slowed(problem);
    let problem = &Problem { limits: &limits, ..*problem };
    let spans = knots::expected(problem, settings, &Sweep::new(problem));
    if long { spans <= knots::MOST_SPANS } else { spans <= LONGEST_TRIED && plan(problem, settings).is_ok() }
}

/// Asks about the problem with one limit relaxed.
fn relaxed(problem: &Problem, relief: Relief, ask: impl FnOnce(&Problem) -> bool) -> bool {
    let mut limits: Vec<AxisLimits> = problem.limits.to_vec();
    let mut caps: Vec<FeedCap> = problem.caps.to_vec();
    match relief.limit {
        Relaxed::Feed => caps.iter_mut().for_each(|cap| match &mut cap.speed {
            SpeedCap::None => {}
            SpeedCap::Tangential { speed, .. } => *speed *= relief.factor,
            SpeedCap::Rate(rate) => *rate *= relief.factor,
        }),
        Relaxed::Axis(axis, kind) => {
            let Some(l) = limits.get_mut(axis) else { return false };
            let limit = match kind {
                LimitKind::Velocity => &mut l.velocity,
                LimitKind::Acceleration => &mut l.acceleration,
                LimitKind::Jerk => &mut l.jerk,
            };
            *limit *= relief.factor;
        }
    }
    ask(&Problem { limits: &limits, caps: &caps, ..*problem })
}

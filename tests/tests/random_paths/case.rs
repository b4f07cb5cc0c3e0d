//! A case: a path, its limits, its caps and the tick.

use planner::geometry::grid_path::GridPath;
use planner::geometry::section::{FeedCap, SpeedCap};
use planner::job::machine::AxisLimits;
use planner::tolerances::UNIT_SIZES;
use tests::oracle::sweep::swept_time;

use crate::chance::Chance;
use crate::paths::{Shape, path, shape, steepest};

/// Longest motion [s], and the most times that the quickest axis could build up its acceleration.
const LONGEST_S: f64 = 100.0;
const MOST_RAMPS: f64 = 100.0;

/// One problem of the planner.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) shape: Shape,
    pub(crate) path: GridPath,
    pub(crate) limits: Vec<AxisLimits>,
    pub(crate) caps: Vec<FeedCap>,
    pub(crate) tick_s: f64,
}

impl Case {
    /// Case `number` of `seed`.
    pub(crate) fn of(seed: u64, number: u64) -> Self {
        let chance = &mut Chance::of(seed, number);
        let shape = shape(chance);
        let axes = 2 + chance.below(6);
        let scale = chance.decades(-4.0, 6.0);
        let path = path(chance, shape, axes, scale);
        let tick_s = [0.0, 1e-3, 1e-4][chance.below(3)];
        loop {
            let limits = limits(chance, axes, path.length());
            let caps = caps(chance, &path, &limits);
            let mut case = Case { shape, path: path.clone(), limits, caps, tick_s };
            let Some(finer) = finer(&case).filter(|_| case.small()) else { continue };
            case.path.breaks.iter_mut().for_each(|b| *b <<= finer);
            case.path.step *= (-f64::from(finer)).exp2();
            case.caps.iter_mut().for_each(|c| c.until <<= finer);
            return case;
        }
    }

    /// Long motions are many short ones: ten thousand cases are to be a matter of minutes.
    fn small(&self) -> bool {
        let mut from = 0;
        let mut capped = 0.0;
        for cap in &self.caps {
            let length = (cap.until - from) as f64 * self.path.step;
            from = cap.until;
            capped += match cap.speed {
                SpeedCap::None => 0.0,
                SpeedCap::Rate(speed) | SpeedCap::Tangential { speed, .. } => length / speed,
            };
        }
        let seconds = capped.max(swept_time(&self.path, &self.limits, &self.caps, 4));
        let ramps = self.limits.iter().filter(|l| l.jerk.is_finite()).map(|l| l.acceleration / l.jerk);
        let ramp_s = ramps.fold(seconds, f64::min);
        seconds <= LONGEST_S && seconds <= MOST_RAMPS * ramp_s.max(self.tick_s)
    }
}

/// How often the grid has to be halved until no axis takes longer for a step of it than a fraction of a second, from
/// rest or at speed (table spans last less than a second), and until changing speed at a cap takes several steps, as on
/// the grids of jobs. None where 2^50 steps are too few: such limits lie too far apart for one path.
fn finer(case: &Case) -> Option<u32> {
    const FROM_REST_S: f64 = 0.2;
    const AT_SPEED_S: f64 = 0.05;
    let Case { path, limits, caps, tick_s, .. } = case;
    let slope = steepest(path).max(1.0);
    let of_axis = |l: &AxisLimits| {
        let from_rest = (l.jerk * FROM_REST_S.powi(3) / 6.0).min(l.acceleration * FROM_REST_S.powi(2) / 2.0);
        from_rest.min(l.velocity * AT_SPEED_S) / slope
    };
    let of_cap = |c: &FeedCap| match c.speed {
        SpeedCap::None => f64::INFINITY,
        SpeedCap::Rate(speed) | SpeedCap::Tangential { speed, .. } => {
            let change_s = |l: &AxisLimits| (speed / l.jerk).sqrt().max(speed / l.acceleration);
            let change_s = limits.iter().map(change_s).fold(*tick_s, f64::max);
            speed * AT_SPEED_S.min(change_s / 24.0)
        }
    };
    let longest = limits.iter().map(of_axis).chain(caps.iter().map(of_cap)).fold(path.step, f64::min);
    let finer = (path.step / longest).log2().ceil() as u32;
    let steps = path.length() / path.step * f64::from(finer).exp2();
    (steps < 2f64.powi(50) && longest > 2.0 * UNIT_SIZES.start()).then_some(finer)
}

/// Velocities over six decades, times to reach them and full acceleration over three decades each; alike for all
/// axes, within a decade, or each for itself.
///
/// An axis reaches its speed within a minute and its acceleration within seconds: a table span lasts less than a
/// second, and speeds in one table lie within six decades.
fn limits(chance: &mut Chance, axes: usize, length: f64) -> Vec<AxisLimits> {
    let free = chance.one_in(10);
    let any = |chance: &mut Chance, speed: f64| {
        let to_speed_s = (length / speed * chance.decades(-1.5, 1.5)).min(60.0);
        let acceleration = speed / to_speed_s;
        let to_acceleration_s = to_speed_s.min((length / acceleration).sqrt()) * chance.decades(-2.0, 1.0);
        let to_acceleration_s = to_acceleration_s.min(5.0);
        let jerk = if free { f64::INFINITY } else { acceleration / to_acceleration_s };
        AxisLimits { velocity: speed, acceleration, jerk }
    };
    let speed = length * chance.decades(-3.0, 3.0);
    let first = any(chance, speed);
    match chance.below(3) {
        0 => vec![first; axes],
        1 => (0..axes)
            .map(|_| AxisLimits {
                velocity: first.velocity * chance.decades(-0.5, 0.5),
                acceleration: first.acceleration * chance.decades(-0.5, 0.5),
                jerk: first.jerk * chance.decades(-0.5, 0.5),
            })
            .collect(),
        _ => (0..axes)
            .map(|_| {
                let speed = speed * chance.decades(-2.0, 2.0);
                any(chance, speed)
            })
            .collect(),
    }
}

/// None, one, or up to a dozen caps with jumps of up to six decades.
fn caps(chance: &mut Chance, path: &GridPath, limits: &[AxisLimits]) -> Vec<FeedCap> {
    let total = path.grid_length();
    let mut ends: Vec<u64> = match chance.below(4) {
        0 | 1 => return Vec::new(),
        2 => Vec::new(),
        _ => (0..1 + chance.below(12)).map(|_| 1 + (chance.within(0.0, 1.0) * total as f64) as u64).collect(),
    };
    ends.retain(|&e| e < total);
    ends.push(total);
    ends.sort_unstable();
    ends.dedup();
    let quickest = limits.iter().map(|l| l.velocity).fold(0.0, f64::max);
    let decades = if chance.one_in(3) { 6.0 } else { 2.0 };
    let mask = (1u16 << limits.len()) - 1;
    ends.into_iter()
        .map(|until| {
            let speed = quickest * chance.decades(-decades, 0.3);
            let speed = match chance.below(5) {
                0 => SpeedCap::None,
                1 => SpeedCap::Rate(speed),
                2 => SpeedCap::Tangential { axes: 1 + chance.below(mask as usize) as u16, speed },
                _ => SpeedCap::Tangential { axes: mask, speed },
            };
            FeedCap { until, speed }
        })
        .collect()
}

//! Where the q knots go: at every geometry knot, dense in time where the speed changes, graded away from rests.

use super::error::PlanError;
use super::layout::{Derivatives, Layout, Pieces};
use super::problem::{Problem, Settings};
use super::rounding;
use super::sweep::Sweep;
use crate::feed::table::MIN_SPANS;
use crate::geometry::grid_path::{GridPath, Piece};
use crate::job::machine::AxisLimits;

/// Spans next to each other grow by at most this away from a rest.
const GROWTH: f64 = 1.8;
/// Longest span planned for [s]; a table span must stay below one second.
const LONGEST_S: f64 = 0.4;
/// Fewest spans of a short move, and of one too short to build up full acceleration: only with so many is its loss
/// below one per cent.
const FEWEST_SPANS: f64 = 32.0;
const FEWEST_ALL_JERK: f64 = 48.0;
/// Share of the wanted spans that short codes have to allow.
const FEWER: f64 = 0.7;
/// Most that a span may be longer than the one beside it.
const MOST_UNEVEN: u64 = 4;
/// Longest step of a table [grid steps].
const LONGEST_STEP: f64 = (1u64 << 31) as f64;
/// Most spans of one table: beyond, memory would not do.
pub(super) const MOST_SPANS: f64 = 2e7;
/// Inner spans next to a rest, and the cells each of them gets.
const REST_SPANS: usize = 4;
const REST_CELLS: u8 = 4;

/// How many spans a valid problem is expected to take.
pub(super) fn expected(problem: &Problem, settings: &Settings, sweep: &Sweep) -> f64 {
    let estimate = Estimate::new(problem, settings, sweep);
    estimate.count[estimate.count.len() - 1]
}

/// Places the knots of a valid problem by the speed the sweep allows, and chooses the largest code.
pub(super) fn place(
    problem: &Problem,
    settings: &Settings,
    sweep: &Sweep,
) -> Result<(Layout, f64), PlanError> {
    let path = problem.path;
    let total = path.grid_length();
    if total < MIN_SPANS as u64 {
        return Err(PlanError::TooShort { steps: total, needed: MIN_SPANS as u64 });
    }
    let estimate = Estimate::new(problem, settings, sweep);
    let (spans, seconds) =
        (estimate.count[estimate.count.len() - 1], estimate.clock[estimate.clock.len() - 1]);
    if spans.is_nan() || spans > MOST_SPANS {
        return Err(PlanError::TooLong { seconds, spans });
    }
    let hard = hard_breaks(problem, &estimate);
    // Where short codes would have spans so long that many have to be left out, codes are long.
    let inner = hard[1..hard.len() - 1].windows(2);
    let count =
        |code: f64| inner.clone().map(|pair| estimate.pieces(pair[0], pair[1], code)).sum::<u64>() as f64;
    let enough = count(rounding::SHORT_CODE) >= FEWER * count(f64::INFINITY);
    let largest_code = if enough { rounding::SHORT_CODE } else { rounding::LONG_CODE };
    let mut knots = vec![0];
    for (pair, index) in hard.windows(2).zip(0..) {
        let (a, b) = (pair[0], pair[1]);
        let rest = index == 0 || index + 2 == hard.len();
        let pieces = if rest { 1 } else { estimate.pieces(a, b, largest_code) };
        estimate.divide(a, b, pieces, &mut knots);
    }
    while knots.len() <= MIN_SPANS {
        bisect_longest_inner(&mut knots);
    }
    let mut layout = Layout::new(path, graded(&knots));
    let slow = 0.5 * estimate.ramp_s;
    for i in 1..layout.spans() - 1 {
        let time = estimate.time(layout.knots[i], layout.knots[i + 1]);
        layout.cells[i] = if time > slow { 2 } else { 1 };
    }
    grade_cells(&mut layout);
    Ok((layout, largest_code))
}

/// Divides each span `i` into `parts[i]` parts of about equal length, and grades what is left; the error is a span too
/// short for that.
pub(super) fn refine(path: &GridPath, layout: &Layout, parts: &[u32]) -> Result<Layout, usize> {
    let mut knots = vec![0];
    for (i, &parts) in parts.iter().enumerate() {
        let (a, b) = (layout.knots[i], layout.knots[i + 1]);
        let k = u64::from(parts.max(1));
        if b - a < k {
            return Err(i);
        }
        knots.extend((1..=k).map(|j| a + ((b - a) as u128 * u128::from(j) / u128::from(k)) as u64));
    }
    let mut refined = Layout::new(path, graded(&knots));
    let mut i = 0;
    for k in 0..refined.spans() {
        while layout.knots[i + 1] <= refined.knots[k] {
            i += 1;
        }
        refined.cells[k] = layout.cells[i];
    }
    grade_cells(&mut refined);
    Ok(refined)
}

/// Adds knots until no inner span is much longer than its neighbours: a spline with knots at very uneven distances
/// bends too much beside the short ones.
fn graded(knots: &[u64]) -> Vec<u64> {
    let forwards = graded_onwards(knots);
    let end = knots[knots.len() - 1];
    let mirrored: Vec<u64> = forwards.iter().rev().map(|k| end - k).collect();
    graded_onwards(&mirrored).iter().rev().map(|k| end - k).collect()
}

/// As [`graded`], against the neighbour before only.
fn graded_onwards(knots: &[u64]) -> Vec<u64> {
    let last = knots.len() - 1;
    let mut out = vec![knots[0], knots[1]];
    for (i, &end) in knots.iter().enumerate().skip(2) {
        // The rest span at the end is one span, however long.
        let most = |out: &[u64]| MOST_UNEVEN.saturating_mul(out[out.len() - 1] - out[out.len() - 2]);
        while i != last && end - out[out.len() - 1] > most(&out) {
            let at = out[out.len() - 1];
            // No sliver at the end.
            out.push(at + most(&out).min((end - at) / 2));
        }
        out.push(end);
    }
    out
}

fn grade_cells(layout: &mut Layout) {
    let n = layout.spans();
    for k in 1..=REST_SPANS.min(n - 2) {
        layout.cells[k] = REST_CELLS;
        layout.cells[n - 1 - k] = REST_CELLS;
    }
}

/// Geometry knots, the ends of both rest spans, and the places where the caps change.
fn hard_breaks(problem: &Problem, estimate: &Estimate) -> Vec<u64> {
    let path = problem.path;
    let total = path.grid_length();
    let breaks = &path.breaks;
    let snap = |wanted: f64, geometry: u64| {
        let most = (total / 12).clamp(1, geometry);
        let steps = (wanted / path.step).min(LONGEST_STEP).clamp(1.0, most as f64) as u64;
        // No sliver between the rest span and the next geometry knot.
        if steps < geometry && geometry - steps < steps / 2 { (geometry / 2).max(1) } else { steps }
    };
    let first = snap(estimate.rest[0], breaks[1]);
    let last = total - snap(estimate.rest[1], total - breaks[breaks.len() - 2]);
    let mut hard = Vec::with_capacity(breaks.len() + 2);
    hard.push(0);
    hard.push(first.min(total - 2));
    hard.extend(breaks.iter().copied().filter(|&b| b > first && b < last));
    for pair in problem.caps.windows(2) {
        let at = pair[0].until;
        if pair[0].speed == pair[1].speed || at <= first || at >= last {
            continue;
        }
        let slot = hard.partition_point(|&b| b < at);
        let near = 0.25 * estimate.length_at(at) / path.step;
        let below = at - hard[slot - 1];
        let above = hard.get(slot).copied().unwrap_or(last).abs_diff(at);
        if below.min(above) as f64 >= near.max(1.0) {
            hard.insert(slot, at);
        }
    }
    hard.push(last);
    hard.push(total);
    hard.dedup();
    hard
}

fn bisect_longest_inner(knots: &mut Vec<u64>) {
    let widest = (0..knots.len() - 1).max_by_key(|&i| knots[i + 1] - knots[i]).unwrap_or(0);
    let middle = knots[widest] + (knots[widest + 1] - knots[widest]) / 2;
    knots.insert(widest + 1, middle);
}

/// Speed expected along the path, as a density of spans.
#[derive(Debug)]
struct Estimate<'a> {
    path: &'a GridPath,
    limits: &'a [AxisLimits],
    /// Control tick [s].
    tick: f64,
    /// Largest du/dt of the sweep.
    top: f64,
    stations: &'a [f64],
    /// Spans from the start of the path to each station.
    count: Vec<f64>,
    /// Time from the start of the path to each station [s].
    clock: Vec<f64>,
    /// Wanted lengths of the rest spans.
    rest: [f64; 2],
    /// Shortest time in which an axis builds up its full acceleration [s].
    ramp_s: f64,
}

impl<'a> Estimate<'a> {
    fn new(problem: &Problem<'a>, settings: &Settings, sweep: &'a Sweep) -> Self {
        let path = problem.path;
        let ramps = ramps(problem, sweep);
        let ramp_s = ramps.iter().copied().fold(f64::INFINITY, f64::min);
        let (rest, end_jerk) = rest_lengths(problem, sweep, &ramps);
        let u = &sweep.stations;
        let length = path.length();
        // Away from rest under constant jerk: q = (6^(4/3)/4) (J/|p'|)^(2/3) u^(4/3).
        let from_rest = |d: f64, jerk: f64| {
            if jerk.is_finite() {
                6f64.powf(4.0 / 3.0) / 4.0 * (jerk * d * d).powf(2.0 / 3.0)
            } else {
                f64::INFINITY
            }
        };
        let speed: Vec<f64> = u
            .iter()
            .zip(&sweep.constant)
            .zip(&sweep.q)
            .map(|((&u, &constant), &q)| {
                let left = from_rest(u.max(rest[0]), end_jerk[0]);
                let right = from_rest((length - u).max(rest[1]), end_jerk[1]);
                let q = if q > 0.0 { q.min(constant) } else { constant };
                q.min(left).min(right).sqrt()
            })
            .collect();
        let mut clock = vec![0.0];
        for k in 1..u.len() {
            clock.push(clock[k - 1] + 2.0 * (u[k] - u[k - 1]) / (speed[k] + speed[k - 1]));
        }
        let total = clock[clock.len() - 1];
        let fewest = if total < 4.0 * ramp_s { FEWEST_ALL_JERK } else { FEWEST_SPANS };
        let eventful = eventful(&speed, problem, sweep);
        let longest = total / fewest;
        let wanted: Vec<f64> = ramps
            .iter()
            .zip(eventful)
            .map(|(ramp, eventful)| match eventful {
                true => (ramp / settings.spans_per_ramp).min(longest),
                false => f64::INFINITY,
            })
            .collect();
        let allowed = spread(&wanted, &clock, settings.spans_per_ramp);
        let allowed = |k: usize| allowed[k].min(LONGEST_S);
        let graded = GROWTH.ln() / (GROWTH - 1.0);
        let mut count = vec![0.0];
        for k in 1..u.len() {
            let wanted = allowed(k).min(allowed(k - 1)) * 0.5 * (speed[k] + speed[k - 1]);
            let from_start = rest[0] + (GROWTH - 1.0) * u[k];
            let from_end = rest[1] + (GROWTH - 1.0) * (length - u[k - 1]);
            let h = wanted.min(graded * from_start.min(from_end)).min(LONGEST_STEP * path.step);
            count.push(count[k - 1] + (u[k] - u[k - 1]) / h);
        }
        let top = sweep.top().sqrt();
        let (limits, tick) = (problem.limits, problem.control_tick_s);
        Estimate { path, limits, tick, top, stations: u, count, clock, rest, ramp_s }
    }

    /// Value at grid step `at` of a quantity given at the stations.
    fn at(&self, values: &[f64], at: u64) -> f64 {
        let u = at as f64 * self.path.step;
        let k = self.stations.partition_point(|&s| s <= u).clamp(1, self.stations.len() - 1);
        let (a, b) = (self.stations[k - 1], self.stations[k]);
        values[k - 1] + (values[k] - values[k - 1]) * ((u - a) / (b - a)).clamp(0.0, 1.0)
    }

    /// Shortest time a span in the geometry span at grid step `a` should take: clear of the control tick, and long
    /// enough for the rounding of q to stay a small share of the limits.
    fn shortest_s(&self, a: u64, largest_code: f64) -> f64 {
        const CLEAR: f64 = 1.3;
        const ROUNDING_SHARE: f64 = 0.006;
        let path = self.path;
        let g = path.breaks.partition_point(|&b| b <= a).clamp(1, path.spans()) - 1;
        let mut noise: f64 = 0.0;
        for (axis, l) in self.limits.iter().enumerate() {
            let piece = path.piece(axis, g);
            let slope = Derivatives::of(&piece, 0.0, piece.length).first_max();
            noise = noise.max(rounding::shortest_s(slope, l, self.top / largest_code, ROUNDING_SHARE));
        }
        noise.max(CLEAR * self.tick)
    }

    fn time(&self, a: u64, b: u64) -> f64 {
        self.at(&self.clock, b) - self.at(&self.clock, a)
    }

    /// Expected span length round grid step `at`, in u.
    fn length_at(&self, at: u64) -> f64 {
        let u = at as f64 * self.path.step;
        let k = self.stations.partition_point(|&s| s <= u).clamp(1, self.stations.len() - 1);
        (self.stations[k] - self.stations[k - 1]) / (self.count[k] - self.count[k - 1])
    }

    /// Pieces for the part [a, b] of one geometry span.
    fn pieces(&self, a: u64, b: u64, largest_code: f64) -> u64 {
        let wanted = (self.at(&self.count, b) - self.at(&self.count, a) - 1e-6).ceil().max(1.0);
        let fewest = ((b - a) as f64 / LONGEST_STEP).ceil() as u64;
        let most = self.time(a, b) / self.shortest_s(a, largest_code);
        (wanted.min(most.max(1.0)) as u64).max(fewest).clamp(1, b - a)
    }

    /// Appends the knots after `a` up to `b`, `pieces` of them, at equal shares of the count.
    fn divide(&self, a: u64, b: u64, pieces: u64, knots: &mut Vec<u64>) {
        let (from, to) = (self.at(&self.count, a), self.at(&self.count, b));
        for j in 1..pieces {
            let wanted = from + (to - from) * j as f64 / pieces as f64;
            let k = self.count.partition_point(|&c| c <= wanted).clamp(1, self.count.len() - 1);
            let t = (wanted - self.count[k - 1]) / (self.count[k] - self.count[k - 1]);
            let u = self.stations[k - 1] + (self.stations[k] - self.stations[k - 1]) * t.clamp(0.0, 1.0);
            let low = knots[knots.len() - 1] + 1;
            knots.push(((u / self.path.step).round() as u64).clamp(low, b - (pieces - j)));
        }
        knots.push(b);
    }
}

/// The time scale of speed changes at each station: what the path acceleration needs to build up, but no less than a
/// share of what the top speed needs to be gained: a jerk limit that hardly matters asks for no finer knots.
///
/// Which axis limits the acceleration and which the jerk depends on the direction: a quick axis beside a slow one
/// asks for nothing.
fn ramps(problem: &Problem, sweep: &Sweep) -> Vec<f64> {
    const SPEED_RAMP_SHARE: f64 = 0.08;
    let top: Vec<AxisLimits> = sweep
        .top_speeds(problem)
        .iter()
        .zip(problem.limits)
        .map(|(&velocity, l)| AxisLimits { velocity, ..*l })
        .collect();
    let swept = sweep.duration();
    let least = problem.control_tick_s.max(1e-6 * swept);
    each_station(problem, sweep, |axes, x| {
        let [top, acceleration, jerk] = along(axes, x, &top);
        let ramp = (acceleration / jerk).max(SPEED_RAMP_SHARE * top / acceleration);
        if ramp.is_finite() { ramp.max(least) } else { 0.1 * swept }
    })
}

/// Largest speed, acceleration and jerk along the path at `x` of a geometry span, if it were straight.
fn along(axes: &[Piece], x: f64, limits: &[AxisLimits]) -> [f64; 3] {
    let mut most = [f64::INFINITY; 3];
    for (piece, l) in axes.iter().zip(limits) {
        let slope = piece.first(x).abs();
        if slope > 0.0 {
            let limits = [l.velocity, l.acceleration, l.jerk];
            most = [0, 1, 2].map(|k| most[k].min(limits[k] / slope));
        }
    }
    most
}

/// A value for each station of the sweep, from the pieces there and the place within them.
fn each_station(problem: &Problem, sweep: &Sweep, mut f: impl FnMut(&[Piece], f64) -> f64) -> Vec<f64> {
    let path = problem.path;
    let per_span = (sweep.stations.len() - 1) / path.spans();
    let mut pieces = Pieces::new(path);
    let station = |(k, u): (usize, &f64)| {
        let g = (k / per_span).min(path.spans() - 1);
        f(pieces.at(g), u - path.breaks[g] as f64 * path.step)
    };
    sweep.stations.iter().enumerate().map(station).collect()
}

/// Wanted lengths of both rest spans, and J/|p'| at both ends.
fn rest_lengths(problem: &Problem, sweep: &Sweep, ramp_s: &[f64]) -> ([f64; 2], [f64; 2]) {
    let path = problem.path;
    let mut pieces = Pieces::new(path);
    let mut ends = [(0.0, 0.0); 2];
    let last = path.spans() - 1;
    let end_station = sweep.stations.len() - 1;
    for (end, (g, k, far)) in ends.iter_mut().zip([(0, 0, false), (last, end_station, true)]) {
        let axes = pieces.at(g);
        let whole = axes[0].length;
        let limits_at =
            |from_end: f64| along(axes, if far { whole - from_end } else { from_end }, problem.limits);
        let at_end = limits_at(0.0);
        let mut length = whole.min(path.length() / 12.0);
        let jerk = loop {
            // The slope at an end may vanish: the one at the joint counts too.
            let at_joint = limits_at(length);
            let [acceleration, jerk] = [1, 2].map(|k| at_end[k].min(at_joint[k]));
            // Acceleration saturates exactly at the joint: J T^3/6 with T = A/J along the path; where jerk hardly
            // matters, T is two ticks or a small share of the ramp.
            let t = (acceleration / jerk).max(0.05 * ramp_s[k]).max(2.0 * problem.control_tick_s);
            let needed = acceleration / t * t.min(LONGEST_S).powi(3) / 6.0;
            if needed.is_nan() || needed >= length || length < path.step {
                break jerk;
            }
            length = needed.max(0.5 * length);
        };
        let q = sweep.constant[k];
        // A cap may be reached before acceleration saturates: half of the speed is then gained at full jerk.
        let half_ramp = q.sqrt() * (q.sqrt() / jerk).sqrt() / 6.0;
        let half_ramp = if half_ramp > 0.0 { half_ramp } else { f64::INFINITY };
        *end = (length.min(0.5 * LONGEST_S * q.sqrt()).min(half_ramp), jerk);
    }
    ([ends[0].0, ends[1].0], [ends[0].1, ends[1].1])
}

/// Stations where the motion is not plain steady travel on a straight line.
fn eventful(speed: &[f64], problem: &Problem, sweep: &Sweep) -> Vec<bool> {
    const STEADY: f64 = 0.02;
    let n = speed.len();
    let mut k = 0;
    let steady = each_station(problem, sweep, |axes, x| {
        let q = speed[k] * speed[k];
        let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
        k += 1;
        let w = 0.5 * (sweep.q[b] - sweep.q[a]).abs() / (sweep.stations[b] - sweep.stations[a]);
        let uses = axes.iter().zip(problem.limits).map(|(p, l)| {
            let bend = p.second(x).abs().max(p.second(0.0).abs()) * q;
            bend.max(p.first(x).abs() * w) / l.acceleration
        });
        uses.fold(0.0, f64::max)
    });
    steady.iter().enumerate().map(|(k, &uses)| uses > STEADY || k == 0 || k + 1 == n).collect()
}

/// Longest span at each station [s]: as long as `wanted` for a few spans round each station, growing with the time
/// from there.
fn spread(wanted: &[f64], clock: &[f64], spans_per_ramp: f64) -> Vec<f64> {
    /// Ramps that keep their spans on either side, and growth of the spans beyond.
    const FLAT_RAMPS: f64 = 1.5;
    const GROWTH: f64 = 0.4;
    let mut out = wanted.to_vec();
    let mut pass = |order: &mut dyn Iterator<Item = usize>| {
        let (mut from, mut least) = (0.0, f64::INFINITY);
        for k in order {
            let away = (clock[k] - from).abs() - FLAT_RAMPS * spans_per_ramp * least;
            let carried = if least < f64::INFINITY { least + GROWTH * away.max(0.0) } else { least };
            if wanted[k] <= carried {
                (from, least) = (clock[k], wanted[k]);
            }
            out[k] = out[k].min(carried);
        }
    };
    pass(&mut (0..wanted.len()));
    pass(&mut (0..wanted.len()).rev());
    out
}

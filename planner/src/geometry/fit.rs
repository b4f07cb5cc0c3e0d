//! A C2 cubic spline inside the tolerance: quasi-interpolation on knots that are split where it fails.
//!
//! Control point i is C(xi) - lambda (var/2) C''(xi), with xi the Greville abscissa and
//! var = sum (t - xi)^2 / 6 over its three knots: exact for quadratics, fourth order on smooth data. Where that
//! rings or nearly stands still, lambda = 0 (Schoenberg): control points on the contour, which never overshoots.
//! Every decision looks a few spans around, so places far apart do not influence each other.
//!
//! The seam to other fitters is [`fit`]: contour and demand in, spline out.

use protocol::table::rules;

use super::certify::{Metric, SpanCurve, within};
use super::contour::{Contour, REVERSAL, norm};
use super::knots::Knots;
use crate::job::machine::{MAX_AXES, Point};
use crate::tolerances::{SLOW_PARAMETER, STANDSTILL_PARAMETER};

/// What a fit has to keep.
#[derive(Clone, Debug)]
pub(super) struct Demand<'a> {
    /// How distances are measured.
    pub metric: &'a Metric,
    /// First grid step in u; halved as needed.
    pub step: f64,
    /// Longest span where the contour is not one line [u].
    pub longest: f64,
    /// Most an axis may move in one span [axis units].
    pub reach: &'a Point,
}

/// A spline whose knots are on the grid; control points still in axis units.
#[derive(Clone, Debug)]
pub(super) struct Spline {
    /// The knots.
    pub knots: Knots,
    /// Control points, `axes` numbers each.
    pub controls: Vec<f64>,
}

/// Why there is no spline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unfit {
    /// The path would all but stand still at the start of this primitive: it has to stop there.
    StopAt(usize),
    /// It would take too many spans; index of a primitive it is about.
    TooManySpans(usize),
}

/// More or finer spans than a section may have.
struct TooMany;

/// Most spans of one section.
const MOST_SPANS: usize = 1 << 22;

/// Most grid steps of one section: multiples of the step stay exact.
const MOST_STEPS: u64 = 1 << 52;

/// Fits a spline to a contour whose length is a whole number of grid steps.
pub(super) fn fit(contour: &Contour, demand: &Demand<'_>) -> Result<Spline, Unfit> {
    if fewest_spans(contour, demand) > MOST_SPANS as f64 {
        return Err(Unfit::TooManySpans(0));
    }
    let knots = Knots::coarse(contour, demand.step, demand.longest);
    let mut fitter = Fitter::new(contour, demand, knots);
    for pass in 0.. {
        let mut split = vec![false; fitter.knots.spans()];
        let plain = fitter.examine(&mut split, pass < QUIET_PASSES)?;
        let first = split.iter().position(|&s| s).unwrap_or(0);
        let open_u = fitter.knots.at[first] as f64 * fitter.knots.step;
        if pass >= QUIET_PASSES {
            widen(&mut split, 1usize.checked_shl(pass - QUIET_PASSES).unwrap_or(usize::MAX));
        }
        fitter.knots.grade(&mut split);
        let any = split.iter().any(|&s| s);
        if !any && !plain {
            break;
        }
        if any {
            fitter.halve(&split).map_err(|TooMany| fitter.stuck(open_u))?;
        }
    }
    Ok(Spline { knots: fitter.knots, controls: fitter.controls })
}

/// Marks everything within `reach` of a mark.
fn widen(split: &mut [bool], reach: usize) {
    let marks: Vec<usize> = (0..split.len()).filter(|&i| split[i]).collect();
    for i in marks {
        let end = i.saturating_add(reach).min(split.len() - 1);
        split[i.saturating_sub(reach)..=end].fill(true);
    }
}

/// A lower bound of the spans a contour takes, to refuse the absurd before anything is allocated.
fn fewest_spans(contour: &Contour, demand: &Demand<'_>) -> f64 {
    let spans = contour.primitives.iter().enumerate().map(|(k, p)| {
        let length = contour.length_of(k);
        let reach =
            p.slope.iter().zip(demand.reach).fold(0.0f64, |m, (v, reach)| m.max(v.abs() * length / reach));
        if p.round.is_some() { reach.max(length / demand.longest) } else { reach }
    });
    spans.sum()
}

/// How much finer the grid becomes when a span of one step has to be halved.
const FINER: u32 = 8;

/// Passes after which splitting spreads faster and faster: halving a span can make its neighbour fail, and a
/// long row of spans that only just held must not fall one by one.
const QUIET_PASSES: u32 = 32;

/// What to do about a span.
enum Verdict {
    Good,
    Plain,
    Split,
}

struct Fitter<'a> {
    contour: &'a Contour,
    demand: &'a Demand<'a>,
    axes: usize,
    knots: Knots,
    /// Contour at the Greville abscissae, `axes` numbers per control point.
    samples: Vec<f64>,
    /// Control points, `axes` numbers each.
    controls: Vec<f64>,
    /// Control points with lambda = 0.
    plain: Vec<bool>,
    /// Spans not proven yet.
    open: Vec<bool>,
}

impl<'a> Fitter<'a> {
    fn new(contour: &'a Contour, demand: &'a Demand<'a>, knots: Knots) -> Self {
        let axes = demand.metric.axes;
        let n = knots.spans() + 3;
        let mut f = Self {
            contour,
            demand,
            axes,
            open: vec![true; knots.spans()],
            knots,
            samples: vec![0.0; n * axes],
            controls: vec![0.0; n * axes],
            plain: vec![false; n],
        };
        let mut hint = 0;
        for i in 0..n {
            hint = f.sample(i, hint);
        }
        let mut hint = 0;
        for i in 0..n {
            hint = f.place(i, hint);
        }
        f
    }

    fn greville(&self, i: usize) -> f64 {
        let [a, b, c] = self.knots.support(i);
        (a + b + c) / 3.0
    }

    /// Samples the contour for control point `i`.
    fn sample(&mut self, i: usize, hint: usize) -> usize {
        let u = self.greville(i);
        let k = self.contour.seek(hint, u);
        let p = self.contour.position(k, u);
        self.samples[i * self.axes..][..self.axes].copy_from_slice(&p[..self.axes]);
        k
    }

    /// Computes control point `i` from the samples around it.
    fn place(&mut self, i: usize, hint: usize) -> usize {
        let n = self.axes;
        let last = self.plain.len() - 1;
        let at = i * n;
        for a in 0..n {
            self.controls[at + a] = self.samples[at + a];
        }
        if i == 0 || i == last || self.plain[i] {
            return hint;
        }
        let knots = self.knots.support(i);
        let u = (knots[0] + knots[1] + knots[2]) / 3.0;
        let (ul, ur) = (self.greville(i - 1), self.greville(i + 1));
        let spread = knots.iter().map(|t| (t - u) * (t - u)).sum::<f64>() / 12.0;
        // What uneven knots add: the blossom of x^3 at the three knots.
        let skew = knots.iter().map(|t| t - u).product::<f64>();
        let k = self.contour.seek(hint, u);
        let p = &self.contour.primitives[k];
        let origin = self.contour.start_of(k);
        if ul >= origin && ur <= self.contour.ends[k] {
            if let Some(round) = &p.round {
                // (1 + v + v^2/2 + ..) cancels the radius that a spline of points on the circle loses, to the
                // fourth order on even knots: 3 / (2 + cos phi) with v = phi^2 / 6.
                let squared = round.angle_slope * round.angle_slope;
                let v = (spread * squared).min(1.0);
                let (e, tangent) = round.at(u - origin);
                let third = if v < 1.0 { skew * squared / 6.0 } else { 0.0 };
                for (k, axis) in round.plane.into_iter().enumerate() {
                    self.controls[at + axis] += e[k] * v * (1.0 + 0.5 * v) - third * tangent[k];
                }
            }
            return k;
        }
        self.difference(i, [ul, u, ur], spread, skew);
        k
    }

    /// Corrects control point `i` by divided differences of the samples around it, at `x` and beyond.
    fn difference(&mut self, i: usize, x: [f64; 3], spread: f64, skew: f64) {
        let n = self.axes;
        let f = |j: usize, a: usize| self.samples[j * n + a];
        let first =
            |a: usize| [(f(i, a) - f(i - 1, a)) / (x[1] - x[0]), (f(i + 1, a) - f(i, a)) / (x[2] - x[1])];
        let second = |a: usize| {
            let [l, r] = first(a);
            (r - l) / (x[2] - x[0])
        };
        let mut correction = [0.0; MAX_AXES];
        for (a, c) in correction.iter_mut().enumerate().take(n) {
            *c = -2.0 * spread * second(a);
        }
        // On uneven knots the third difference counts too: in C''(x) and in the blossom. It is left out where it
        // would rule, as it does at corners.
        if i >= 2 && i + 2 < self.plain.len() && skew != 0.0 {
            let (far_left, far_right) = (self.greville(i - 2), self.greville(i + 2));
            let uneven = (x[2] - x[1]) - (x[1] - x[0]);
            let factor = skew + 2.0 * spread * uneven;
            let mut extra = [0.0; MAX_AXES];
            for (a, e) in extra.iter_mut().enumerate().take(n) {
                let [l, r] = first(a);
                let before = (l - (f(i - 1, a) - f(i - 2, a)) / (x[0] - far_left)) / (x[1] - far_left);
                let after = ((f(i + 2, a) - f(i + 1, a)) / (far_right - x[2]) - r) / (far_right - x[1]);
                // Mean of the third differences to the left and to the right.
                let left = (second(a) - before) / (x[2] - far_left);
                let right = (after - second(a)) / (far_right - x[0]);
                *e = factor * 0.5 * (left + right);
            }
            if norm(&extra) < 0.5 * norm(&correction) {
                for (c, e) in correction.iter_mut().zip(extra) {
                    *c += e;
                }
            }
        }
        for (c, d) in self.controls[i * n..][..n].iter_mut().zip(correction) {
            *c += d;
        }
    }

    /// The curve of span `j` with the given control points.
    fn curve(&self, j: usize, controls: &[f64]) -> SpanCurve {
        let o = j as isize;
        let t: [f64; 6] =
            std::array::from_fn(|k| (self.knots.clamped(o - 2 + k as isize) as f64) * self.knots.step);
        let mut b = [[0.0; MAX_AXES]; 4];
        let weights = [
            (t[2] - t[1]) / (t[4] - t[1]),
            (t[3] - t[1]) / (t[4] - t[1]),
            (t[2] - t[0]) / (t[3] - t[0]),
            (t[2] - t[1]) / (t[3] - t[1]),
            (t[3] - t[2]) / (t[5] - t[2]),
            (t[3] - t[2]) / (t[4] - t[2]),
        ];
        let mix = |x: f64, y: f64, w: f64| x + w * (y - x);
        for a in 0..self.axes {
            let c: [f64; 4] = std::array::from_fn(|k| controls[(j + k) * self.axes + a]);
            b[1][a] = mix(c[1], c[2], weights[0]);
            b[2][a] = mix(c[1], c[2], weights[1]);
            b[0][a] = mix(mix(c[0], c[1], weights[2]), b[1][a], weights[3]);
            b[3][a] = mix(b[2][a], mix(c[2], c[3], weights[4]), weights[5]);
        }
        SpanCurve::new(t[2], t[3] - t[2], &b, self.axes)
    }

    /// Whether some axis moves further around span `j` than the table can say: between neighbouring control
    /// points, or from control point `j + 1` to any place of the span.
    fn too_long(&self, j: usize, curve: &SpanCurve) -> bool {
        let points = curve.points();
        (0..self.axes).any(|a| {
            let control = |k: usize| self.controls[(j + k) * self.axes + a];
            let far = |x: f64, y: f64| (x - y).abs() > self.demand.reach[a];
            points.iter().any(|p| far(p[a], control(1))) || (0..3).any(|k| far(control(k), control(k + 1)))
        })
    }

    /// Judges the open spans. Marks those to split; returns whether control points became plain, which they may
    /// only if `plain`.
    fn examine(&mut self, split: &mut [bool], plain: bool) -> Result<bool, Unfit> {
        let mut changed = false;
        let mut hint = 0;
        for j in 0..split.len() {
            if !self.open[j] {
                continue;
            }
            hint = self.contour.seek(hint, self.knots.at[j] as f64 * self.knots.step);
            match self.judge(j, hint, plain)? {
                Verdict::Good => self.open[j] = false,
                Verdict::Split => split[j] = true,
                Verdict::Plain => {
                    changed = true;
                    for i in j..j + 4 {
                        self.plain[i] = true;
                        self.place(i, hint);
                    }
                    let reach = j.saturating_sub(3)..(j + 4).min(split.len());
                    self.open[reach].fill(true);
                    self.open[j] = false;
                }
            }
        }
        Ok(changed)
    }

    fn judge(&self, j: usize, first: usize, plain: bool) -> Result<Verdict, Unfit> {
        let good = |c: &SpanCurve| within(c, self.contour, first, self.demand.metric);
        let curve = self.curve(j, &self.controls);
        if self.too_long(j, &curve) || self.knots.length(j) >= u64::from(rules::MAX_GEOMETRY_LENGTH) {
            return Ok(Verdict::Split);
        }
        let can_be_plain = plain && self.plain[j..j + 4].contains(&false);
        if !good(&curve) {
            let plain = can_be_plain && good(&self.curve(j, &self.samples));
            return Ok(if plain { Verdict::Plain } else { Verdict::Split });
        }
        if fast(&curve, SLOW_PARAMETER) {
            return Ok(Verdict::Good);
        }
        self.judge_slow(j, first, &curve, can_be_plain)
    }

    /// A span on which the path nearly stands still: follow the contour more closely, or stop.
    fn judge_slow(
        &self,
        j: usize,
        first: usize,
        curve: &SpanCurve,
        can_be_plain: bool,
    ) -> Result<Verdict, Unfit> {
        let (sharpest, turn, tolerance) = self.sharpest_joint(j, first);
        let slowest = slowest(curve);
        if let (Some(k), true) = (sharpest, turn > REVERSAL) {
            // Too short a reversal for a stop, unless the path lingers on it; no knot could help that.
            return if slowest < 2.0 * STANDSTILL_PARAMETER {
                Err(Unfit::StopAt(k))
            } else {
                Ok(Verdict::Good)
            };
        }
        // A spline slows to cos(theta/2) in any corner.
        let wanted = SLOW_PARAMETER.min(0.6 * (0.5 * turn).cos());
        if slowest >= wanted {
            return Ok(Verdict::Good);
        }
        if can_be_plain {
            let plain = self.curve(j, &self.samples);
            let good = within(&plain, self.contour, first, self.demand.metric);
            if good && self::slowest(&plain) >= wanted {
                return Ok(Verdict::Plain);
            }
        }
        if curve.length > tolerance / 16.0 {
            return Ok(Verdict::Split);
        }
        match sharpest {
            Some(k) if slowest < STANDSTILL_PARAMETER => Err(Unfit::StopAt(k)),
            _ => Ok(Verdict::Good),
        }
    }

    /// The sharpest joint under the control points of span `j`, its angle, and the tolerance there.
    fn sharpest_joint(&self, j: usize, first: usize) -> (Option<usize>, f64, f64) {
        let u = |i: isize| self.knots.clamped(i) as f64 * self.knots.step;
        let (from, to) = (u(j as isize - 2), u(j as isize + 3));
        let mut k = self.contour.seek(first, from);
        let mut best = (None, 0.0, self.contour.primitives[k].tolerance);
        while k + 1 < self.contour.primitives.len() && self.contour.ends[k] <= to {
            k += 1;
            let p = &self.contour.primitives[k];
            if p.turn > best.1 {
                best = (Some(k), p.turn, p.tolerance);
            }
        }
        best
    }

    /// What helps where no span is short enough: a stop at the nearest joint of primitives, if there is one.
    fn stuck(&self, u: f64) -> Unfit {
        let here = self.contour.seek(0, u);
        let joints = [here, here + 1].into_iter().filter(|&k| k > 0 && k < self.contour.primitives.len());
        let away = |k: &usize| (self.contour.start_of(*k) - u).abs();
        let nearest = joints.min_by(|a, b| away(a).total_cmp(&away(b)));
        nearest.map_or(Unfit::TooManySpans(here), Unfit::StopAt)
    }

    /// Halves the marked spans and brings everything that depends on them up to date.
    fn halve(&mut self, split: &[bool]) -> Result<(), TooMany> {
        let stuck = (0..split.len()).any(|i| split[i] && self.knots.length(i) < 2);
        if stuck {
            self.knots.refine(FINER);
            let finest = f64::from(*rules::STEP_EXPONENT.start()).exp2();
            if self.knots.step < finest || self.knots.at.last().is_some_and(|&end| end > MOST_STEPS) {
                return Err(TooMany);
            }
        }
        let origin = self.knots.halve(split);
        let spans = self.knots.spans();
        if spans > MOST_SPANS {
            return Err(TooMany);
        }
        let n = self.axes;
        let old_last = split.len() as isize;
        // The old index of the new knot i, if the knots from i - back to i + ahead were neighbours before.
        let kept = |i: isize, back: isize, ahead: isize| -> Option<isize> {
            let clamp = |k: isize| k.clamp(0, spans as isize) as usize;
            let here = origin[clamp(i)]? as isize;
            let shift = if i < 0 { i } else { (i - spans as isize).max(0) };
            (-back..=ahead)
                .all(|d| {
                    let old = (here + shift + d).clamp(0, old_last);
                    origin[clamp(i + d)].is_some_and(|o| o as isize == old)
                })
                .then_some(here + shift)
        };
        let mut samples = vec![0.0; (spans + 3) * n];
        let mut controls = samples.clone();
        let mut plain = vec![false; spans + 3];
        let mut stale_sample = vec![false; spans + 3];
        let mut stale = vec![false; spans + 3];
        for i in 0..spans + 3 {
            // Control i rests on knots i-2 ..= i; the samples of two neighbours each side reach two further.
            match kept(i as isize - 1, 1, 1) {
                Some(old) => {
                    let from = (old + 1) as usize;
                    samples[i * n..][..n].copy_from_slice(&self.samples[from * n..][..n]);
                    controls[i * n..][..n].copy_from_slice(&self.controls[from * n..][..n]);
                    plain[i] = self.plain[from];
                    stale[i] = kept(i as isize - 1, 3, 3).is_none();
                }
                None => (stale_sample[i], stale[i]) = (true, true),
            }
        }
        let mut open = vec![true; spans];
        for (j, open) in open.iter_mut().enumerate() {
            if let Some(old) = kept(j as isize, 2, 3) {
                *open = self.open[old as usize] || stale[j..j + 4].contains(&true);
            }
        }
        (self.samples, self.controls, self.plain, self.open) = (samples, controls, plain, open);
        let mut hint = 0;
        for (i, stale) in stale_sample.into_iter().enumerate() {
            if stale {
                hint = self.sample(i, hint);
            }
        }
        let mut hint = 0;
        for (i, stale) in stale.into_iter().enumerate() {
            if stale {
                hint = self.place(i, hint);
            }
        }
        Ok(())
    }
}

/// Whether |r'| >= `limit` on the whole span, by the hull of its Bezier points against the middle direction.
fn fast(curve: &SpanCurve, limit: f64) -> bool {
    let middle = curve.derivative(0.5);
    let size = middle.iter().map(|v| v * v).sum::<f64>().sqrt();
    let (first, last) = (curve.derivative(0.0), curve.derivative(1.0));
    let inner: Point = std::array::from_fn(|a| 2.0 * middle[a] - 0.5 * (first[a] + last[a]));
    [first, inner, last].iter().all(|d| {
        let along: f64 = d.iter().zip(&middle).map(|(x, y)| x * y).sum();
        along >= limit * size
    })
}

/// The least |r'| on the span, sampled.
fn slowest(curve: &SpanCurve) -> f64 {
    let squared = |x: f64| curve.derivative(x).iter().map(|v| v * v).sum::<f64>();
    (0..=16).map(|i| squared(f64::from(i) / 16.0)).fold(f64::INFINITY, f64::min).sqrt()
}

//! How far planned paths are from the programmed contour, measured by sampling both.
//!
//! The rounded splines are evaluated by the Cox-de Boor recursion; lines, arcs and helices are taken from the
//! program's moves as they stand. A section's marks say which line made which part of it, so a place is only
//! compared with the moves of its own block and of the blocks beside it: a path that skips a loop or comes by at
//! another time does not pass.

use planner::feed::job::{JobItem, PlannedSection};
use planner::job::machine::{Axis, AxisKind, Machine, Point};
use planner::job::program::{Arc, Corner, Item, Move, MoveKind, Shape};

use super::spline::{Basis, combine};

/// Samples of one arc or line, by their ends and between them.
const PARTS: usize = 12;

/// Steps of a golden-section search; each leaves 0.618 of the interval.
const STEPS: usize = 44;

/// The largest distances met. A share is a distance over the tolerance in force at its place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// From the splines to the contour.
    pub from_path: f64,
    /// From the contour to the splines.
    pub from_contour: f64,
    /// The largest of both on the linear axes of feed moves [mm].
    pub largest_mm: f64,
    /// Line of the program at which the share is largest.
    pub line: u32,
}

impl Deviation {
    /// The larger share.
    pub fn share(&self) -> f64 {
        self.from_path.max(self.from_contour)
    }
}

/// A plan that does not belong to the program.
#[derive(Clone, Debug, PartialEq)]
pub enum Mismatch {
    /// Moves of this line are part of no section.
    LeftOut(u32),
    /// The section that starts on this line ends nowhere on its contour.
    NoEnd(u32),
    /// The marks of the section that starts on this line do not cover it.
    Marks(u32),
}

/// Measures every section of a plan, with so many samples per geometry span.
///
/// # Errors
/// The plan's sections and the program's moves do not follow each other.
pub fn measure(
    program: &[Item],
    plan: &[JobItem],
    machine: &Machine,
    per_span: usize,
) -> Result<Deviation, Mismatch> {
    let runs = runs(program, machine);
    let (mut run, mut at) = (0, 0);
    let mut worst = Deviation::default();
    for item in plan {
        let JobItem::Section(section) = item else { continue };
        let path = Path::of(section);
        let start = path.position(0, 0.0);
        let first = section.marks.blocks.first().map_or(0, |b| b.line);
        let legs = loop {
            let Some(legs) = runs.get(run).map(|r| &r[at..]) else { return Err(Mismatch::NoEnd(first)) };
            let same_kind = legs.first().is_some_and(|l| l.kind == section.kind);
            if let Some(end) = same_kind.then(|| path.end_on(legs, machine)).flatten() {
                at += end + 1;
                break &legs[..=end];
            }
            stands_for(legs, &start, machine)?;
            (run, at) = (run + 1, 0);
        };
        path.compare(legs, section, per_span, &mut worst)?;
    }
    let last = plan.iter().rev().find_map(|i| if let JobItem::Section(s) = i { Some(s) } else { None });
    let end = last.map_or_else(Point::default, |s| Path::of(s).end);
    for (k, legs) in runs.iter().enumerate().skip(run) {
        stands_for(&legs[if k == run { at } else { 0 }..], &end, machine)?;
    }
    Ok(worst)
}

/// Standing at `place` stands for `legs`: they stay within the tolerance of it and end on the same counts.
fn stands_for(legs: &[Leg], place: &Point, machine: &Machine) -> Result<(), Mismatch> {
    let strays = |leg: &&Leg| {
        let parts = (0..=PARTS).map(|k| leg.position(k as f64 / PARTS as f64));
        let apart = parts.map(|p| leg.ruler.share(&p, place)).fold(0.0, f64::max);
        apart > 1.0 && !leg.is_within_a_count(place, machine)
    };
    let ends = |leg: &Leg| is_near(&leg.end, place, machine);
    match (legs.iter().find(strays), legs.last()) {
        (Some(leg), _) => Err(Mismatch::LeftOut(leg.line)),
        (None, Some(leg)) if !ends(leg) => Err(Mismatch::LeftOut(leg.line)),
        _ => Ok(()),
    }
}

/// Whether two points are the same on every drive, but for the rounding of one to counts.
fn is_near(p: &Point, q: &Point, machine: &Machine) -> bool {
    let axes = machine.axes.iter().zip(p.iter().zip(q));
    axes.into_iter().all(|(axis, (a, b))| (a - b).abs() * axis.counts_per_unit < 1.5)
}

/// One programmed move with the tolerance in force on it.
#[derive(Clone, Debug)]
struct Leg {
    kind: MoveKind,
    shape: Shape,
    start: Point,
    end: Point,
    line: u32,
    ruler: Ruler,
}

/// Measures differences: 1 is the tolerance.
#[derive(Clone, Debug)]
struct Ruler {
    /// Indices of the linear axes.
    linear: Vec<usize>,
    rotary: Vec<usize>,
    tolerance_mm: f64,
    tolerance_rotary: f64,
}

/// Moves between which motion may go on: from one programmed rest, or change between rapid and feed, to the next.
fn runs(program: &[Item], machine: &Machine) -> Vec<Vec<Leg>> {
    let mut runs: Vec<Vec<Leg>> = vec![Vec::new()];
    let mut open = false;
    for item in program {
        match item {
            Item::Move(m) => {
                let kind = runs.last().and_then(|r| r.last()).map(|l| l.kind);
                if !open || kind.is_some_and(|k| k != m.kind) {
                    runs.push(Vec::new());
                }
                open = m.corner != Corner::Stop && m.kind == MoveKind::Feed;
                if let Some(run) = runs.last_mut() {
                    run.push(Leg::of(m, machine));
                }
            }
            Item::Dwell { .. } | Item::Stop { .. } => open = false,
            Item::Note { .. } => {}
        }
    }
    runs
}

impl Leg {
    fn of(m: &Move, machine: &Machine) -> Self {
        let asked = match m.corner {
            _ if m.kind == MoveKind::Rapid => machine.tolerance_mm,
            Corner::Within { tolerance_mm, .. } if tolerance_mm > 0.0 => tolerance_mm,
            _ => machine.exact_path_mm,
        };
        let Move { kind, shape, start, end, line, .. } = *m;
        Self { kind, shape, start, end, line, ruler: Ruler::new(asked, machine) }
    }

    /// Position at the share `t` of the move.
    fn position(&self, t: f64) -> Point {
        let mut p: Point = std::array::from_fn(|a| self.start[a] + t * (self.end[a] - self.start[a]));
        if let Shape::Arc(Arc { plane, centre, radius, radius_change, start_angle, sweep }) = self.shape {
            let (sin, cos) = (start_angle + sweep * t).sin_cos();
            let r = radius + radius_change * t;
            (p[plane[0]], p[plane[1]]) = (centre[0] + r * cos, centre[1] + r * sin);
        }
        p
    }

    fn is_within_a_count(&self, p: &Point, machine: &Machine) -> bool {
        (0..=PARTS).all(|k| is_near(&self.position(k as f64 / PARTS as f64), p, machine))
    }

    /// Least distance to `p` over the tolerance.
    fn distance(&self, p: &Point) -> f64 {
        let parts = match self.shape {
            Shape::Line => 1,
            Shape::Arc(arc) => 8 + (24.0 * arc.sweep.abs() / std::f64::consts::TAU).ceil() as usize,
        };
        let places: Vec<(f64, Point)> =
            (0..=parts).map(|k| k as f64 / parts as f64).map(|t| (t, self.position(t))).collect();
        nearest(p, &places, |t| self.position(t), &self.ruler)
    }
}

impl Ruler {
    fn new(asked: f64, machine: &Machine) -> Self {
        let of = |kind: AxisKind| -> Vec<usize> {
            let axes = machine.axes.iter().enumerate();
            axes.filter(|(_, a)| a.kind == kind).map(|(i, _)| i).collect()
        };
        let (linear, rotary) = (of(AxisKind::Linear), of(AxisKind::Rotary));
        // No path can be nearer than what rounding its ends to counts costs on all axes together, taken twice.
        let count = |axes: &[usize]| {
            axes.iter().map(|&i| machine.axes[i].counts_per_unit.powi(-2)).sum::<f64>().sqrt()
        };
        let (least_mm, least_rotary) = (count(&linear), count(&rotary));
        let machine_mm = machine.tolerance_mm.max(least_mm);
        let machine_rotary = machine.tolerance_rotary.max(least_rotary);
        let floor =
            least_mm.max(if rotary.is_empty() { 0.0 } else { least_rotary * machine_mm / machine_rotary });
        let tolerance_mm = asked.max(floor);
        let tolerance_rotary = machine_rotary * (tolerance_mm / machine_mm).min(1.0);
        Self { linear, rotary, tolerance_mm, tolerance_rotary }
    }

    /// Distance of two points over the tolerance.
    fn share(&self, p: &Point, q: &Point) -> f64 {
        let over = |axes: &[usize]| axes.iter().map(|&i| (p[i] - q[i]).powi(2)).sum::<f64>().sqrt();
        (over(&self.linear) / self.tolerance_mm).max(over(&self.rotary) / self.tolerance_rotary)
    }
}

/// Least distance of `p` to a curve over the tolerance, sampled at `places` and looked into where it may be lower.
fn nearest(p: &Point, places: &[(f64, Point)], curve: impl Fn(f64) -> Point, ruler: &Ruler) -> f64 {
    let sizes: Vec<f64> = places.iter().map(|(_, at)| ruler.share(p, at)).collect();
    let at = |k: usize| sizes.get(k).copied().unwrap_or(f64::INFINITY);
    let is_valley = |k: &usize| at(*k) <= at(k + 1) && (*k == 0 || at(*k) <= at(k - 1));
    let mut valleys: Vec<usize> = (0..sizes.len()).filter(is_valley).collect();
    valleys.sort_by(|a, b| sizes[*a].total_cmp(&sizes[*b]));
    let mut least = f64::INFINITY;
    for k in valleys {
        let ends = [k.saturating_sub(1), (k + 1).min(places.len() - 1)];
        // Between two samples the curve comes no nearer than this, give or take its bend.
        let apart = ends.map(|e| ruler.share(&places[e].1, &places[k].1));
        if sizes[k] - apart[0].max(apart[1]) < least {
            let found = lowest(ends.map(|e| places[e].0), |t| ruler.share(p, &curve(t)));
            least = least.min(found).min(sizes[k]);
        }
    }
    least
}

/// Lowest value of `f` on an interval with one valley (Kiefer 1953).
fn lowest([mut a, mut b]: [f64; 2], f: impl Fn(f64) -> f64) -> f64 {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let mut best = f(a).min(f(b));
    let (mut x, mut y) = (b - golden * (b - a), a + golden * (b - a));
    let (mut fx, mut fy) = (f(x), f(y));
    for _ in 0..STEPS {
        best = best.min(fx).min(fy);
        if fx < fy {
            (b, y, fy) = (y, x, fx);
            x = b - golden * (b - a);
            fx = f(x);
        } else {
            (a, x, fx) = (x, y, fy);
            y = a + golden * (b - a);
            fy = f(y);
        }
    }
    best
}

/// The rounded spline of a section.
struct Path {
    breaks: Vec<f64>,
    basis: Basis<f64>,
    controls: Vec<Vec<f64>>,
    end: Point,
    /// Where the part of each line ends in u, and the line.
    blocks: Vec<(f64, u32)>,
}

impl Path {
    fn of(section: &PlannedSection) -> Self {
        let path = &section.table.path;
        let breaks: Vec<f64> = path.breaks.iter().map(|&b| b as f64 * path.step).collect();
        let controls: Vec<Vec<f64>> =
            path.axes.iter().map(|a| a.controls.iter().map(|&c| c as f64 * a.lsb).collect()).collect();
        let mut end = Point::default();
        for (e, c) in end.iter_mut().zip(&controls) {
            *e = c.last().copied().unwrap_or(0.0);
        }
        let blocks = section.marks.blocks.iter().map(|b| (b.until as f64 * path.step, b.line)).collect();
        Self { basis: Basis::clamped(3, &breaks), breaks, controls, end, blocks }
    }

    fn spans(&self) -> usize {
        self.breaks.len() - 1
    }

    /// Position at `u`, which lies in `span`.
    fn position(&self, span: usize, u: f64) -> Point {
        let weights = self.basis.weights(span, u, 0);
        let mut p = Point::default();
        for (p, controls) in p.iter_mut().zip(&self.controls) {
            *p = combine(controls, span, &weights);
        }
        p
    }

    fn anywhere(&self, u: f64) -> Point {
        let span = self.breaks.partition_point(|b| *b <= u).saturating_sub(1).min(self.spans() - 1);
        self.position(span, u)
    }

    /// The leg at whose end the spline ends.
    fn end_on(&self, legs: &[Leg], machine: &Machine) -> Option<usize> {
        let meets = |(x, (y, axis)): (&f64, (&f64, &Axis))| {
            (x - y).abs() * axis.counts_per_unit <= 0.5 + 1e-9 * y.abs() * axis.counts_per_unit
        };
        let last = self.blocks.last()?.1;
        legs.iter().position(|leg| {
            leg.line >= last && leg.end.iter().zip(self.end.iter().zip(&machine.axes)).all(meets)
        })
    }

    /// Where the part of block `b` starts in u; the end of the path beyond the last one.
    fn from(&self, b: usize) -> f64 {
        if b == 0 { 0.0 } else { self.blocks[(b - 1).min(self.blocks.len() - 1)].0 }
    }

    /// Places along the path, `per_span` of each span and at least a few of each block, with the block of each.
    fn places(&self, per_span: usize) -> Vec<Place> {
        let (mut span, mut block, mut place) = (0, 0, 0.0);
        let mut places = Vec::new();
        while span < self.spans() && block < self.blocks.len() {
            let until = self.breaks[span + 1].min(self.blocks[block].0);
            let share = (until - place) / (self.breaks[span + 1] - self.breaks[span]);
            let count = (share * per_span as f64).ceil().max(4.0) as usize;
            places.extend((0..=count).map(|k| {
                let u = place + (until - place) * k as f64 / count as f64;
                Place { u, block, at: self.position(span, u) }
            }));
            place = until;
            span += usize::from(until == self.breaks[span + 1]);
            block += usize::from(until == self.blocks[block].0);
        }
        places
    }

    fn compare(
        &self,
        legs: &[Leg],
        section: &PlannedSection,
        per_span: usize,
        worst: &mut Deviation,
    ) -> Result<(), Mismatch> {
        let last = self.blocks.len() - 1;
        let covers = self.blocks[last].0 == self.breaks[self.spans()]
            && self.blocks.windows(2).all(|b| b[0].0 < b[1].0 && b[0].1 <= b[1].1);
        if !covers {
            return Err(Mismatch::Marks(self.blocks[0].1));
        }
        let mut note = |path: f64, contour: f64, leg: &Leg| {
            if path.max(contour) > worst.share() {
                worst.line = leg.line;
            }
            worst.from_path = worst.from_path.max(path);
            worst.from_contour = worst.from_contour.max(contour);
            if section.kind == MoveKind::Feed && leg.ruler.rotary.is_empty() {
                worst.largest_mm = worst.largest_mm.max(path.max(contour) * leg.ruler.tolerance_mm);
            }
        };
        let places = self.places(per_span);
        let after = |b: Option<usize>| b.map_or(0, |b| legs.partition_point(|l| l.line <= self.blocks[b].1));
        for place in &places {
            let first = after(place.block.checked_sub(2));
            let end = if place.block + 1 < last { after(Some(place.block + 1)) } else { legs.len() };
            let near = &legs[first.min(end - 1)..end];
            let apart = near.iter().map(|leg| (leg.distance(&place.at), leg));
            let (share, leg) = apart.fold((f64::INFINITY, &near[0]), |a, b| if b.0 < a.0 { b } else { a });
            note(share, 0.0, leg);
        }
        for leg in legs {
            let block = self.blocks.partition_point(|b| b.1 < leg.line).min(last);
            let reach = [self.from(block.saturating_sub(1)), self.from(block + 2)];
            let first = places.partition_point(|p| p.u < reach[0]);
            let end = places.partition_point(|p| p.u <= reach[1]);
            let near: Vec<(f64, Point)> = places[first..end].iter().map(|p| (p.u, p.at)).collect();
            for k in 0..=PARTS {
                let p = leg.position(k as f64 / PARTS as f64);
                note(0.0, nearest(&p, &near, |u| self.anywhere(u), &leg.ruler), leg);
            }
        }
        Ok(())
    }
}

/// A place on a spline.
struct Place {
    u: f64,
    block: usize,
    at: Point,
}

//! Retiming: a table that is being played is planned anew from one of its knots on, under other limits or caps.
//!
//! Everything before the knot stays bit for bit, and so do the control values that act there, so q and q' are
//! continuous at the knot. What follows is solved from the old plan, drawn a little inside so that every row has some
//! slack; while the old plan itself leaves none (braking for a corner at full limits), it is followed further. Where
//! the motion is too fast for the new limits, it slows down along the shortest smooth ramp that the old limits allow,
//! and the new ones hold from its end on.

mod rules;
mod slow;

pub use rules::{RetimeError, Retimed, Rules, scaled};

use super::check;
use super::horizon::{Deadline, Draft, swept};
use super::ipm::{Stretch, Workspace};
use super::layout::Layout;
use super::problem::{JerkForm, Problem, RowForm};
use super::rows::RowSource;
use super::sweep::Sweep;
use super::window::in_workspace;
use super::{error, joints, rounding};
use crate::certificate::certify;
use crate::feed::table::FeedTable;
use crate::job::machine::AxisLimits;
use crate::tolerances::ROW_ARITHMETIC;
use slow::{Transition, share};

/// Cells of inner spans, and of those next to a rest: no fewer than any plan of this crate has. Spans that take no
/// longer than half of what it takes to build up full acceleration have one, if that does for the old plan.
const CELLS: u8 = 2;
const REST_CELLS: u8 = 4;
const REST_SPANS: usize = 4;
/// Shares by which the old plan is drawn down, as they are tried, over as many spans.
const DRAWN: [(f64, usize); 4] = [(0.1, 20), (0.03, 12), (0.01, 12), (3e-3, 30)];
/// Spans on which a place to begin is looked at first.
const FIRST_SPANS: usize = 3;
/// Spans that the old plan is followed at most for the sake of slack.
const MOST_FOLLOWED: usize = 160;
/// How much of the motion may be divided for the sake of slowing down, in times from full speed to rest, and into how
/// many parts a span.
const SLOWING: f64 = 4.0;
const MOST_PARTS: u32 = 32;
/// Rounds of dividing spans that the format does not allow.
const MOST_DIVISIONS: usize = 8;

/// Plans `table` anew from knot `knot` on: from `old` to `new` limits and caps.
///
/// `knot` counts from 0, where the table starts at rest, to the last but three of its spans. The caps of either rules
/// cover the table's path; `control_tick_s` is that of the drives (0: none). Cost: linear in the spans after the knot.
///
/// # Errors
///
/// [`RetimeError`]: a knot that leaves nothing to plan, limits that make no sense, or that cannot be met before the
/// table ends.
pub fn retime(
    table: &FeedTable,
    knot: usize,
    old: Rules,
    new: Rules,
    control_tick_s: f64,
    relative_gap: f64,
    deadline: Deadline,
) -> Result<Retimed, RetimeError> {
    let last = table.spans().saturating_sub(3);
    if knot > last {
        return Err(RetimeError::Knot { knot, last });
    }
    let problem = |r: Rules<'_>| -> Result<(), RetimeError> {
        let problem = Problem { path: &table.path, limits: r.limits, caps: r.caps, control_tick_s };
        error::validate(&problem).map_err(RetimeError::Plan)
    };
    problem(old)?;
    problem(new)?;
    let unit = (1..table.spans() - 1).map(|i| table.control(i)).fold(0.0, f64::max);
    if !(unit > 0.0 && unit.is_finite()) {
        return Err(RetimeError::Table);
    }
    let task = Task { table, knot, old, new, control_tick_s, relative_gap, deadline, unit };
    // On a worker of the pool: none of the short passes waits for threads to wake up.
    rayon::scope(|_| in_workspace(|work| task.plan(work)))
}

/// What is to be done.
struct Task<'a> {
    table: &'a FeedTable,
    knot: usize,
    old: Rules<'a>,
    new: Rules<'a>,
    control_tick_s: f64,
    relative_gap: f64,
    deadline: Deadline,
    unit: f64,
}

impl<'a> Task<'a> {
    /// Divides spans until a plan is found on them.
    fn plan(&self, work: &mut Workspace) -> Result<Retimed, RetimeError> {
        let mut draft = self.draft(1);
        if !self.keeps_old(&draft, work) {
            draft = self.draft(CELLS);
        }
        let mut iterations = 0;
        for _ in 0..MOST_DIVISIONS {
            let layout = draft.layout(&self.table.path);
            let source = self.source(self.new, &layout, &[]);
            let parts = match self.solve(&layout, &draft.carried[1..], &mut iterations, work) {
                Ok(found) => match check::format(&layout, &found.table) {
                    Some(parts) => parts,
                    None => return Ok(found),
                },
                // Long spans leave no room to slow down in.
                Err(fault @ RetimeError::Unmet { .. }) => match self.finer(&source, &draft.carried) {
                    Some(parts) => parts,
                    None => return self.as_it_is(work).ok_or(fault),
                },
                Err(fault) => return Err(fault),
            };
            let refused = RetimeError::Format { u: layout.start(&self.table.path, self.knot) };
            draft.divide(&source, &parts, self.knot + 1).map_err(|_| refused)?;
            if draft.carried.len() < draft.knots.len() - 1 {
                return Err(refused);
            }
        }
        Err(RetimeError::Format { u: draft.knots[self.knot] as f64 * self.table.path.step })
    }

    /// The spans of the table; those after the knot may be divided.
    fn draft(&self, fewest: u8) -> Draft {
        let n = self.table.spans();
        let mut knots = vec![0];
        for &step in &self.table.steps {
            knots.push(knots[knots.len() - 1] + u64::from(step));
        }
        let near_rest = |i: usize| i <= REST_SPANS || i + 1 + REST_SPANS >= n;
        let short = 0.5 * self.shortest_ramp();
        let cells = (0..n)
            .map(|i| match self.table.law(i).duration() {
                _ if near_rest(i) => REST_CELLS,
                seconds if seconds <= short => fewest,
                _ => CELLS,
            })
            .collect();
        let inner = (1..n - 1).map(|i| self.table.control(i) / self.unit);
        let carried = std::iter::once(0.0).chain(inner).chain([0.0]).collect();
        Draft { knots, cells, carried, improved: n, lasting: n }
    }

    /// Whether the rows of the draft's cells admit the old plan under the old limits.
    fn keeps_old(&self, draft: &Draft, work: &mut Workspace) -> bool {
        let layout = draft.layout(&self.table.path);
        let m = layout.unknowns();
        let swept = vec![f64::INFINITY; m];
        let stretch = Stretch { from: self.knot, to: m };
        work.load(
            &self.source(self.old, &layout, &swept),
            &draft.carried[1..=m],
            &vec![0.0; m],
            stretch,
            |_| 0.0,
        );
        work.settle() >= -ROW_ARITHMETIC
    }

    /// Shortest time in which an axis builds up its full acceleration under the old limits [s].
    fn shortest_ramp(&self) -> f64 {
        self.old.limits.iter().map(|l| l.acceleration / l.jerk).fold(f64::INFINITY, f64::min)
    }

    fn problem<'s>(&'s self, rules: Rules<'s>) -> Problem<'s> {
        let Rules { limits, caps } = rules;
        Problem { path: &self.table.path, limits, caps, control_tick_s: self.control_tick_s }
    }

    fn source<'s>(&'s self, rules: Rules<'s>, layout: &'s Layout, swept: &'s [f64]) -> RowSource<'s> {
        let problem = self.problem(rules);
        let largest_code = rounding::LONG_CODE;
        let ceiling = f64::from(self.table.q_scale) * largest_code * largest_code / self.unit;
        let joint = joints(&problem, layout).map(|q| (q / self.unit).min(ceiling));
        let (jerk, form) = (JerkForm::True, RowForm::Bernstein);
        RowSource {
            problem,
            layout,
            unit: self.unit,
            ceiling,
            joint,
            largest_code,
            swept,
            jerk,
            form,
            bends: false,
        }
    }

    /// Solves on given knots; `x` is the old plan there.
    fn solve(
        &self,
        layout: &Layout,
        x: &[f64],
        iterations: &mut u32,
        work: &mut Workspace,
    ) -> Result<Retimed, RetimeError> {
        let x = &x[..layout.unknowns()];
        let sweep = |rules| Sweep::new(&self.problem(rules));
        let (old, new) = rayon::join(|| sweep(self.old), || sweep(self.new));
        let sweeps = [old, new];
        let swept = sweeps.each_ref().map(|s| swept(&self.problem(self.old), layout, s, self.unit));
        let (before, after) =
            (self.source(self.old, layout, &swept[0]), self.source(self.new, layout, &swept[1]));
        // The way down is faster than anything the new limits allow.
        let [slow, fast] = [(&before, &sweeps[0]), (&after, &sweeps[1])]
            .map(|(source, sweep)| rounding::halves(source, self.table.q_scale, sweep));
        let mut half: Vec<f64> = slow.into_iter().zip(fast).map(|(a, b)| a.max(b)).collect();
        half[..self.knot].fill(0.0);
        work.deadline = self.deadline;
        let m = x.len();
        let none = vec![0.0; m];
        work.load(&after, x, &none, Stretch { from: self.knot, to: m }, |_| 0.0);
        let fits = work.settle() >= -ROW_ARITHMETIC;
        // Under the old limits the old plan has some room somewhere; the way down begins there.
        let start = if fits {
            self.inside(&after, x, &half, work)
        } else if self.knot == 0 {
            // Nothing moves yet: the whole plan is slowed down.
            slow::all(&after, x, &half, work).map(|y| (y, 0))
        } else {
            let found = self.inside(&before, x, &half, work).and_then(|(y, from)| {
                half[self.knot..from].fill(0.0);
                // The way down itself must not bend more than the format allows.
                let before = RowSource { bends: true, ..before.clone() };
                Transition { before: &before, after: &after, half: &half, from }.find(&y, work)
            });
            if found.is_none() {
                return Err(self.unmet());
            }
            found
        };
        // Nothing leaves any slack: the old plan is all there is.
        let Some((mut y, from)) = start else { return Ok(self.kept()) };
        let pinned = rounding::values(&after, &self.assemble(&after, &y));
        y[..from].copy_from_slice(&pinned[..from]);
        half[..from].fill(0.0);
        // Where the start bends no more than the format allows, neither will the answer.
        for bends in [true, false] {
            let source = RowSource { bends, ..after.clone() };
            work.load(&source, &y, &half, Stretch { from, to: m }, |_| 0.0);
            if work.settle() > 0.0 {
                *iterations += work.solve(self.relative_gap).iterations;
                y[from..].copy_from_slice(&work.moved());
                break;
            }
        }
        let table = self.assemble(&after, &y);
        let rounded = rounding::values(&after, &table);
        // Spans shaped by the ramp alone keep the old limits, all others the new ones.
        let holds_from = if fits { self.knot } else { from };
        let sound = |source: &RowSource, stretch: Stretch, work: &mut Workspace| {
            work.load(source, &rounded, &none, stretch, |_| 0.0);
            work.settle() >= -ROW_ARITHMETIC
        };
        let ramp = Stretch { from: self.knot, to: holds_from.max(self.knot + 1) - 1 };
        let kept = sound(&after, Stretch { from: holds_from, to: m }, work)
            && (holds_from == self.knot || sound(&before, ramp, work));
        if !kept {
            return if fits { Ok(self.kept()) } else { Err(self.unmet()) };
        }
        let found = Retimed {
            holds_from,
            holds_from_u: layout.start(&self.table.path, holds_from),
            iterations: *iterations,
            table,
        };
        let slower = fits && found.table.duration() >= self.table.duration();
        Ok(if slower { self.kept() } else { found })
    }

    /// The old plan drawn a little inside the limits from the first place on that allows it, and its first free
    /// control value.
    fn inside(
        &self,
        source: &RowSource,
        x: &[f64],
        half: &[f64],
        work: &mut Workspace,
    ) -> Option<(Vec<f64>, usize)> {
        let m = x.len();
        let mut half = half.to_vec();
        half[..self.knot].fill(0.0);
        let mut holds = |y: &[f64], half: &[f64], from: usize, spans: usize| {
            work.load(source, y, half, Stretch { from, to: m.min(from + spans) }, |_| 0.0);
            work.settle() > 0.0
        };
        for from in self.knot..m.min(self.knot + MOST_FOLLOWED) {
            if from > 0 {
                half[from - 1] = 0.0;
            }
            for (drawn, spans) in DRAWN {
                let begins = |j: usize| if j < from { 0.0 } else { share(j + 1, from, from + spans) };
                let y: Vec<f64> = x.iter().enumerate().map(|(j, x)| x * (1.0 - drawn * begins(j))).collect();
                // Where there is no slack, it is missing at the beginning in most cases.
                if [FIRST_SPANS, spans + 4, m].into_iter().all(|spans| holds(&y, &half, from, spans)) {
                    return Some((y, from));
                }
            }
        }
        None
    }

    /// The table of control values `x`, its beginning as it was.
    fn assemble(&self, source: &RowSource, x: &[f64]) -> FeedTable {
        let mut table = rounding::table(source, self.table.q_scale, x);
        table.codes[..self.knot].copy_from_slice(&self.table.codes[..self.knot]);
        table
    }

    fn kept(&self) -> Retimed {
        let u =
            self.table.steps[..self.knot].iter().map(|&s| f64::from(s)).sum::<f64>() * self.table.path.step;
        Retimed { table: self.table.clone(), holds_from: self.knot, holds_from_u: u, iterations: 0 }
    }

    /// The old plan, from where it keeps the new limits anyway: on its way to rest it is slow in the end.
    fn as_it_is(&self, work: &mut Workspace) -> Option<Retimed> {
        let draft = self.draft(CELLS);
        let layout = draft.layout(&self.table.path);
        let m = layout.unknowns();
        let (x, none) = (&draft.carried[1..=m], vec![0.0; m]);
        let swept = vec![f64::INFINITY; m];
        let after = self.source(self.new, &layout, &swept);
        let mut keeps = |j: usize| {
            work.load(&after, x, &none, Stretch { from: j, to: m }, |_| 0.0);
            work.settle() >= -ROW_ARITHMETIC
        };
        let (mut low, mut high) = (self.knot, m - 1);
        if !keeps(high) {
            return None;
        }
        while low < high {
            let middle = (low + high) / 2;
            if keeps(middle) { high = middle } else { low = middle + 1 }
        }
        let holds_from_u = layout.start(&self.table.path, high);
        Some(Retimed { table: self.table.clone(), holds_from: high, holds_from_u, iterations: 0 })
    }

    /// How to divide the spans after the knot that take longer than half of what it takes to build up full
    /// acceleration, as far as the motion may need to slow down. `None` where there is nothing to divide.
    fn finer(&self, source: &RowSource, x: &[f64]) -> Option<Vec<u32>> {
        let layout = source.layout;
        let stop = |l: &AxisLimits| l.velocity / l.acceleration + l.acceleration / l.jerk;
        let shortest = self.shortest_ramp().max(4.0 * self.control_tick_s);
        let reach = SLOWING * self.old.limits.iter().map(stop).fold(0.0, f64::max);
        let mut clock = 0.0;
        let time = |i: usize| layout.h[i] / (x[i] * self.unit).sqrt();
        let parts: Vec<u32> = (0..layout.spans())
            .map(|i| {
                if i <= self.knot || i + 1 == layout.spans() || clock > reach {
                    return 1;
                }
                clock += time(i);
                if time(i) > 0.5 * shortest {
                    ((time(i) / (0.25 * shortest)).ceil() as u32).min(MOST_PARTS)
                } else {
                    1
                }
            })
            .collect();
        parts.iter().any(|&p| p > 1).then_some(parts)
    }

    /// What the old motion exceeds most.
    fn unmet(&self) -> RetimeError {
        let certificate = certify(self.table, self.new.limits, self.new.caps);
        let worst = certificate.worst.iter().max_by(|a, b| a.bound.total_cmp(&b.bound));
        worst.map_or(RetimeError::Table, |w| RetimeError::Unmet {
            u: w.u,
            axis: w.axis,
            kind: w.kind,
            ratio: w.bound,
        })
    }
}

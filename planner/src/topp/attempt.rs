//! One solution after another, until a rounded one is a plan.

use super::error::PlanError;
use super::layout::{Derivatives, Layout, Pieces, strictest};
use super::problem::{Plan, Problem, Settings, Solver, Windows};
use super::rows::RowSource;
use super::sweep::Sweep;
use super::{check, clarabel, insert, knots, rest, rounding, start, window, zhao};
use crate::feed::table::FeedTable;
use crate::tolerances::ROW_ARITHMETIC;

/// Rounds of dividing the spans of one solution.
const MOST_DIVISIONS: usize = 48;
/// Headroom of the codes above the swept q.
const CEILING: f64 = 1.1;
/// What finer codes make of the ceiling: half the top speed makes them twice as fine.
const FINER: f64 = 0.25;
/// Shares of q that are tried where rounding takes a little more than what was set aside for it.
const SLOWER: [f64; 3] = [1.0, 0.9999, 0.999];
/// The same where nothing was set aside.
const MUCH_SLOWER: [f64; 12] = [1.0, 0.9999, 0.999, 0.99, 0.97, 0.93, 0.85, 0.7, 0.5, 0.3, 0.1, 0.03];

/// What became of a solution.
pub(super) enum Solved {
    /// It is a plan, on these knots.
    Plan(Plan, Layout),
    /// It has to be found anew on finer knots.
    Divided(Layout),
}

/// What solutions are found from.
pub(super) struct Attempt<'a> {
    /// Longest problem solved in one piece [spans].
    pub(super) whole: usize,
    /// The problem.
    pub(super) problem: &'a Problem<'a>,
    /// How to solve it.
    pub(super) settings: &'a Settings,
    /// Its sweep.
    pub(super) sweep: &'a Sweep,
}

/// A way to deal with rounding.
#[derive(Clone, Copy)]
struct Codes {
    /// The largest.
    largest: f64,
    /// What it stands for, as a multiple of the swept q.
    ceiling: f64,
    /// Share of what rounding may take that the solver leaves; with less than all of it, the solution is slowed until
    /// it holds.
    room: f64,
}

/// The rest spans of a motion.
enum Rests {
    /// They may be as they are.
    Sound,
    /// The codes are too coarse for them.
    Coarse,
    /// They have no parts, so that the motion next to them becomes another: shorter ones.
    Divided(Result<Layout, PlanError>),
}

/// Why a motion is no plan.
enum Unsound {
    /// A row is broken in this span; the knots on which it was tried.
    Row(usize, Layout),
    /// This span would have to be divided further than the grid allows.
    Indivisible(PlanError),
}

impl Attempt<'_> {
    /// Solves on given knots, rounds and checks. Codes become finer where rounding alone breaks a limit; unless it
    /// `may_divide`, a motion that needs more knots than these is slowed until it holds on them.
    pub(super) fn solve(
        &self,
        layout: &Layout,
        largest_code: f64,
        may_divide: bool,
        iterations: &mut u64,
    ) -> Result<Solved, PlanError> {
        let unit = self.sweep.top();
        let mut refined = layout.clone();
        if self.settings.windows == Windows::Zhao {
            zhao::refine(&mut refined, &self.swept(layout));
        }
        let layout = &refined;
        let joints = joints(self.problem, layout);
        let swept = self.swept(layout);
        let first = Codes { largest: largest_code, ceiling: CEILING, room: 1.0 };
        let long = Codes { largest: rounding::LONG_CODE, ..first };
        let less = [(0.2, 0), (0.0, 0), (0.0, 1), (0.0, 2), (0.0, 3)];
        let less = less.map(|(room, finer)| Codes { ceiling: CEILING * FINER.powi(finer), room, ..long });
        let tries = [first].into_iter().chain((largest_code < long.largest).then_some(long)).chain(less);
        let mut fault = PlanError::Resolution { span: 1, u: layout.start(self.problem.path, 1) };
        for codes in tries {
            let joint = joints.map(|q| (q / unit).min(codes.ceiling));
            let source =
                RowSource { ceiling: codes.ceiling, ..self.source(layout, &swept, joint, codes.largest) };
            let scale = rounding::scale(&source);
            let mut room = rounding::halves(&source, scale, self.sweep);
            room.iter_mut().for_each(|half| *half *= codes.room);
            let Some((x, gap_s)) = self.optimise(&source, &room, iterations) else { continue };
            match self.rests(&source, &x) {
                Rests::Sound => {}
                Rests::Coarse => continue,
                Rests::Divided(finer) => return finer.map(Solved::Divided),
            }
            let shares: &[f64] = if codes.room == 1.0 { &SLOWER } else { &MUCH_SLOWER };
            let mut divided = None;
            for share in shares {
                match self.sound(&source, x.iter().map(|x| x * share).collect()) {
                    Ok((plan, knots)) => return Ok(Solved::Plan(Plan { gap_s, ..plan }, knots)),
                    Err(Unsound::Row(span, knots)) => {
                        fault = PlanError::Resolution { span, u: knots.start(self.problem.path, span) };
                        divided = divided.or(Some(knots).filter(|k| k.spans() > layout.spans()));
                    }
                    Err(Unsound::Indivisible(e)) => fault = e,
                }
            }
            if let Some(finer) = divided.filter(|_| codes.room == 1.0 && may_divide) {
                return Ok(Solved::Divided(finer));
            }
        }
        Err(fault)
    }

    /// What has to happen where a rest span would take too long.
    fn rests(&self, source: &RowSource, x: &[f64]) -> Rests {
        /// Smaller codes are too far apart to tell how long a rest span takes.
        const LEAST_CODE: u32 = 8;
        let table = rounding::table(source, rounding::scale(source), x);
        let Some(mut parts) = check::format(source.layout, &table) else { return Rests::Sound };
        let last = parts.len() - 1;
        if parts[0] == 1 && parts[last] == 1 {
            return Rests::Sound;
        }
        if table.codes[0].min(table.codes[last - 2]) < LEAST_CODE {
            return Rests::Coarse;
        }
        parts[1..last].fill(1);
        let finer = knots::refine(self.problem.path, source.layout, &parts);
        Rests::Divided(finer.map_err(|span| self.indivisible(source, &table, span)))
    }

    fn indivisible(&self, source: &RowSource, table: &FeedTable, span: usize) -> PlanError {
        let (u, seconds) = (source.layout.start(self.problem.path, span), table.law(span).duration());
        if seconds >= 1.0 { PlanError::Slow { span, u, seconds } } else { PlanError::Uneven { span, u } }
    }

    /// The plan that `x` stands for, on knots added where the format asks for them, and these knots.
    fn sound(&self, source: &RowSource, mut x: Vec<f64>) -> Result<(Plan, Layout), Unsound> {
        let mut layout = source.layout.clone();
        let mut source = source.clone();
        for _ in 0..MOST_DIVISIONS {
            let swept = self.swept(&layout);
            let here = RowSource { layout: &layout, swept: &swept, ..source.clone() };
            let scale = rounding::scale(&here);
            let table = rounding::table(&here, scale, &x);
            let Some(parts) = check::format(&layout, &table) else {
                let half = rounding::halves(&here, scale, self.sweep);
                let findings = check::rows(&here, &rounding::values(&here, &table), &half);
                if findings.worst <= 1.0 + ROW_ARITHMETIC {
                    let plan = Plan { table, binding: findings.binding, iterations: 0, gap_s: f64::INFINITY };
                    return Ok((plan, layout));
                }
                return Err(Unsound::Row(findings.span, layout));
            };
            let finer = insert::insert(&here, &x, &parts);
            (layout, x) =
                finer.map_err(|span| Unsound::Indivisible(self.indivisible(&here, &table, span)))?;
            // Spans that had to be divided are short.
            source.largest_code = rounding::LONG_CODE;
        }
        Err(Unsound::Row(1, layout))
    }

    /// What rows are made from on given knots.
    fn source<'s>(
        &'s self,
        layout: &'s Layout,
        swept: &'s [f64],
        joint: [f64; 2],
        largest_code: f64,
    ) -> RowSource<'s> {
        let Settings { jerk, rows: form, .. } = *self.settings;
        let (problem, unit) = (*self.problem, self.sweep.top());
        RowSource {
            problem,
            layout,
            unit,
            ceiling: CEILING,
            joint,
            largest_code,
            swept,
            jerk,
            form,
            bends: true,
        }
    }

    /// Largest swept x on each inner span.
    fn swept(&self, layout: &Layout) -> Vec<f64> {
        let (path, unit) = (self.problem.path, self.sweep.top());
        let mut hint = 0;
        (1..layout.spans() - 1)
            .map(|i| {
                let (from, to) = (layout.start(path, i), layout.start(path, i + 1));
                self.sweep.largest(from, to, &mut hint) / unit
            })
            .collect()
    }

    /// Control values of minimum time, and how far above the optimum they may be [s]; `None` where rounding alone
    /// would break a limit at any speed.
    fn optimise(&self, source: &RowSource, half: &[f64], iterations: &mut u64) -> Option<(Vec<f64>, f64)> {
        let gap = self.settings.relative_gap;
        start::candidates(source).into_iter().find_map(|start::Start { mut x, bends }| {
            let source = &RowSource { bends, ..source.clone() };
            let (x, gap, count) = match self.settings.solver {
                Solver::InteriorPoint => {
                    let total = match self.settings.windows {
                        Windows::Whole => window::solve(source, &mut x, half, gap, usize::MAX)?,
                        Windows::Overlap => window::solve(source, &mut x, half, gap, self.whole)?,
                        Windows::Zhao => zhao::solve(source, &mut x, half, gap)?,
                    };
                    (x, total.gap, total.iterations)
                }
                Solver::Clarabel => {
                    let answer = clarabel::solve(source, &x, half, gap)?;
                    (answer.x, answer.gap, answer.iterations)
                }
            };
            *iterations += count;
            Some((x, gap / source.unit.sqrt()))
        })
    }
}

/// Bounds on q at the joints with both rest spans.
pub(super) fn joints(problem: &Problem, layout: &Layout) -> [f64; 2] {
    let path = problem.path;
    let mut pieces = Pieces::new(path);
    let n = layout.spans();
    [0, n - 1].map(|i| {
        let g = layout.geometry[i] as usize;
        let offset = (layout.knots[i] - path.breaks[g]) as f64 * path.step;
        let derivatives: Vec<Derivatives> = pieces
            .at(g)
            .iter()
            .map(|p| {
                let d = Derivatives::of(p, offset, layout.h[i]);
                if i == 0 { d } else { d.reversed() }
            })
            .collect();
        let caps = strictest(problem.caps, layout.knots[i], layout.knots[i + 1]);
        rest::joint_bound(layout.h[i], &derivatives, problem.limits, &caps, problem.control_tick_s)
    })
}

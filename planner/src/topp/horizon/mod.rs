//! Receding horizon: a path is planned while it arrives, and its motion is committed piece by piece.
//!
//! Each call of [`Horizon::advance`] improves a window of the motion that begins where the last commitment ended, at
//! speed, and reaches a few braking distances further than what it commits. The motion known at any moment is a whole
//! plan: beyond the window it goes on at a slow, strictly feasible crawl to a rest at the end of the path received, so
//! that it can be stopped there if nothing more comes, and so that every window starts from a plan and every iterate
//! is one. Committed control values and steps never change; everything before them is forgotten.
//!
//! The braking distance is measured along the path: v (v_i/A_i + A_i/J_i)/2 with v the largest du/dt and v_i the
//! largest speed of axis i, both swept over the window, so that programmed feeds and diagonals count.

mod draft;
mod path;
mod record;
mod solve;
mod speeds;
mod window;

use std::time::Instant;

pub use path::{PathPiece, PathStart, pieces};
pub use record::Record;

use super::PlanError;
use super::error::PathFault;
use super::ipm::Workspace;
use super::rounding;
use crate::job::machine::AxisLimits;
pub(super) use draft::Draft;
use path::Arrived;
pub(super) use speeds::swept;

/// How far ahead to look, and how much to commit at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HorizonSettings {
    /// Length improved beyond what a call commits, in braking distances; 2.5 leaves next to nothing to gain.
    pub lookahead: f64,
    /// Length committed by a call, in braking distances.
    pub advance: f64,
    /// Stop improving when the remaining gap is below this share of the window's time.
    pub relative_gap: f64,
    /// q spans per A/J of motion time.
    pub spans_per_ramp: f64,
    /// Largest du/dt that the codes have to carry, as a multiple of the diagonal of the axes' velocity limits. 2 is
    /// enough where u is arc length to within a half.
    pub headroom: f64,
}

impl Default for HorizonSettings {
    /// 2.5 braking distances ahead, 2.5 committed at a time.
    fn default() -> Self {
        HorizonSettings {
            lookahead: 2.5,
            advance: 2.5,
            relative_gap: 5e-5,
            spans_per_ramp: 4.0,
            headroom: 2.0,
        }
    }
}

/// When to stop improving, besides the gap: whatever has been found by then is a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deadline {
    /// Most iterations of a call; 0 commits the start of its window.
    pub iterations: u32,
    /// No iteration begins after this moment.
    pub at: Option<Instant>,
}

impl Deadline {
    /// None: the gap decides.
    pub const NONE: Deadline = Deadline { iterations: u32::MAX, at: None };

    /// Whether iteration `iteration` may not begin.
    pub(super) fn passed(&self, iteration: u32) -> bool {
        iteration >= self.iterations || self.at.is_some_and(|at| Instant::now() >= at)
    }
}

impl Default for Deadline {
    fn default() -> Self {
        Deadline::NONE
    }
}

/// A piece of motion that will not change any more, and how the motion would end after it.
#[derive(Clone, Debug, PartialEq)]
pub struct Commit {
    /// Lengths of the next q spans [grid steps].
    pub steps: Vec<u32>,
    /// Their codes; the first span of all has none.
    pub codes: Vec<u32>,
    /// Where motion stops being final [grid steps]: the start of the last committed span, whose end the next control
    /// value shapes too; the end of the path once everything is committed.
    pub until: u64,
    /// The rest of the motion if nothing more is committed.
    pub stop: Stop,
    /// Iterations of the solver.
    pub iterations: u32,
    /// Spans of the window that was improved.
    pub window: usize,
    /// Whether this ends the path; `stop` then has no spans.
    pub complete: bool,
}

/// The way to rest: spans that follow the committed ones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stop {
    /// Lengths of the q spans [grid steps].
    pub steps: Vec<u32>,
    /// Codes of all of them but the last.
    pub codes: Vec<u32>,
    /// Where motion ends [grid steps], at a geometry knot.
    pub end: u64,
    /// The last two control points of each axis if the path ends there [lsb].
    pub controls: Vec<[i64; 2]>,
}

/// A planner of one section whose path arrives in pieces.
#[derive(Clone, Debug)]
pub struct Horizon {
    limits: Vec<AxisLimits>,
    control_tick_s: f64,
    settings: HorizonSettings,
    arrived: Arrived,
    /// Spans from the first kept geometry knot on; the first `committed` of them are final.
    draft: Draft,
    committed: usize,
    complete: bool,
    /// q of x = 1, and size of a squared code.
    unit: f64,
    q_scale: f32,
    /// Where the latest window ended: lasting knots reach close to it [grid steps].
    end: u64,
    /// Latest braking distance in u.
    braking: f64,
    /// Path length in grid steps from which on another call can commit something.
    wanted: u64,
    work: Workspace,
}

impl Horizon {
    /// A planner for a path that begins like `start`, at rest; limits are per axis, the control tick is in seconds
    /// (0 where no drive plays the table).
    ///
    /// # Errors
    ///
    /// Limits, settings or a start that no path can have.
    pub fn new(
        start: &PathStart,
        limits: &[AxisLimits],
        control_tick_s: f64,
        settings: HorizonSettings,
    ) -> Result<Self, PlanError> {
        let HorizonSettings { lookahead, advance, relative_gap, spans_per_ramp, headroom } = settings;
        let named = [
            ("lookahead", lookahead),
            ("advance", advance),
            ("relative_gap", relative_gap),
            ("spans_per_ramp", spans_per_ramp),
            ("headroom", headroom),
        ];
        if let Some(&(name, value)) = named.iter().find(|(_, v)| !(*v > 0.0 && v.is_finite())) {
            return Err(PlanError::Setting { name, value });
        }
        if !(start.step > 0.0 && start.step.is_finite()) {
            return Err(PlanError::Path { what: PathFault::Step });
        }
        super::error::validate_limits(limits, start.axes.len())?;
        let unit = limits.iter().map(|l| l.velocity * l.velocity).sum::<f64>();
        let slowest =
            limits.iter().map(|l| l.velocity / l.acceleration + l.acceleration / l.jerk).fold(0.0, f64::max);
        Ok(Horizon {
            limits: limits.to_vec(),
            control_tick_s,
            settings,
            arrived: Arrived::new(start),
            draft: Draft { knots: vec![0], cells: Vec::new(), carried: Vec::new(), improved: 0, lasting: 0 },
            committed: 0,
            complete: false,
            unit,
            q_scale: rounding::scale_of(unit * headroom * headroom, rounding::LONG_CODE),
            braking: 0.5 * unit.sqrt() * slowest,
            end: 0,
            wanted: 0,
            work: Workspace::default(),
        })
    }

    /// Size of one squared code of everything that is committed [u^2/s^2].
    pub fn q_scale(&self) -> f32 {
        self.q_scale
    }

    /// Takes in the next geometry spans. Cost: their copy.
    ///
    /// # Errors
    ///
    /// A piece that does not continue the path; nothing is taken in then.
    pub fn push(&mut self, piece: &PathPiece) -> Result<(), PlanError> {
        self.arrived.push(piece)
    }

    /// Says that the path ends where the last piece ended.
    pub fn finish(&mut self) {
        self.arrived.finished = true;
        self.wanted = 0;
    }

    /// Geometry spans in memory.
    pub fn kept_spans(&self) -> usize {
        self.arrived.breaks.len() - 1
    }

    /// Commits the next piece of motion; `None` when more of the path has to arrive first, or everything is committed.
    ///
    /// Call it again until it gives `None`. Cost: one window of lookahead + advance braking distances, whatever the
    /// length of the path.
    ///
    /// # Errors
    ///
    /// [`PlanError`] as of [`super::plan`]; `u` counts from the start of the path, spans from the start of the window.
    /// What has been committed stays valid, with its stop.
    pub fn advance(&mut self, deadline: Deadline) -> Result<Option<Commit>, PlanError> {
        if self.complete || self.arrived.breaks[self.arrived.last_end()] < self.wanted {
            return Ok(None);
        }
        let origin = self.arrived.origin() as f64 * self.arrived.step;
        // On a worker of the pool: none of the short passes waits for threads to wake up.
        rayon::scope(|_| window::advance(self, deadline)).map_err(|fault| moved(fault, origin))
    }
}

/// The fault with its place `by` further along.
fn moved(mut fault: PlanError, by: f64) -> PlanError {
    match &mut fault {
        PlanError::Cap { u, .. }
        | PlanError::Slow { u, .. }
        | PlanError::Uneven { u, .. }
        | PlanError::Resolution { u, .. } => *u += by,
        _ => {}
    }
    fault
}

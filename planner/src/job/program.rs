//! A part program as the planner sees it: a stream of moves, dwells and stops, whatever language it came in.

use serde::{Deserialize, Serialize};

use super::machine::Point;

/// One thing the machine has to do, in program order.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// Motion along one programmed primitive.
    Move(Move),
    /// Stand still for a time.
    Dwell {
        /// How long [s].
        seconds: f64,
        /// Line of the program, from 1.
        line: u32,
    },
    /// Motion must come to rest here, although nothing is waited for.
    Stop {
        /// Why.
        cause: StopCause,
        /// Line of the program, from 1.
        line: u32,
    },
    /// A remark that the report shows (tool change, operation name, skipped code); motion does not stop for it.
    Note {
        /// What to show.
        text: String,
        /// Line of the program, from 1.
        line: u32,
    },
}

/// One programmed motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Move {
    /// Rapid or feed.
    pub kind: MoveKind,
    /// The curve, in axis space.
    pub shape: Shape,
    /// Where it starts (the end of the move before it) [axis units].
    pub start: Point,
    /// Where it ends [axis units].
    pub end: Point,
    /// The programmed feed; `None` on rapids.
    pub feed: Option<Feed>,
    /// How this move may be joined to the next one.
    pub corner: Corner,
    /// Line of the program, from 1.
    pub line: u32,
}

/// Rapid or feed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum MoveKind {
    /// As fast as the axes' rapid limits allow, on a straight line in axis space.
    Rapid,
    /// At the programmed feed at most.
    Feed,
}

/// The curve of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Straight in axis space.
    Line,
    /// A circular arc in the plane of two linear axes; all other axes move linearly with the angle (helix).
    Arc(Arc),
}

/// A circular arc: `position = centre + radius (cos(a0 + sweep t), sin(a0 + sweep t))`, `t` in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Indices of the two axes of the plane, in right-handed order (G17: X, Y; G18: Z, X; G19: Y, Z).
    pub plane: [usize; 2],
    /// Centre in the plane [mm].
    pub centre: [f64; 2],
    /// Radius at the start [mm].
    pub radius: f64,
    /// Radius at the end minus radius at the start [mm]; within the arc tolerance, interpolated linearly.
    pub radius_change: f64,
    /// Angle of the start [rad].
    pub start_angle: f64,
    /// Angle travelled, positive counter-clockwise [rad]; may exceed a full turn.
    pub sweep: f64,
}

/// A programmed feed, already in axis units per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feed {
    /// G94: speed along the linear axes [mm/s]; along the rotary axes [unit/s] when no linear axis moves.
    Speed(f64),
    /// G93: this move takes at least so long [s].
    Duration(f64),
}

/// How the end of a move may be rounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Corner {
    /// G61.1: come to rest at the end of this move.
    Stop,
    /// G61: programmed points are hit; rest only where the direction changes.
    Exact,
    /// G64 and defaults: stay within this distance of the programmed contour, nothing more.
    Within {
        /// The distance [mm].
        tolerance_mm: f64,
        /// Who asked for it.
        source: ToleranceSource,
    },
}

/// Who set a path tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ToleranceSource {
    /// G64 P in the program.
    Program,
    /// The machine file; the program says nothing.
    Machine,
    /// The command line, over program and machine.
    CommandLine,
    /// G64 without P: the machine's best-speed tolerance.
    BestSpeed,
    /// Way-points: their last digit, or a drive count.
    Resolution,
}

/// Why motion comes to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum StopCause {
    /// M0, M1, M60.
    ProgramStop,
    /// M2, M30 or the end of the file.
    ProgramEnd,
    /// M3, M4, M5 or a change of S.
    Spindle,
    /// M6.
    ToolChange,
    /// G10, G92, G5x and tool length changes move the coordinate system.
    OffsetChange,
    /// G4.
    Dwell,
    /// G61.1 or G9.
    ExactStop,
    /// G61 with a change of direction, or a tolerance of zero.
    ExactPathCorner,
    /// The direction turns by more than 170 degrees.
    Reversal,
    /// Between a rapid and a feed move, or between rapids.
    Rapid,
}

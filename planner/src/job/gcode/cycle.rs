//! Drilling cycles (G73, G74, G81 to G86, G89), expanded move by move.
//!
//! Names: the cycle works along the normal of the plane, from the retract plane R down to the bottom. It ends on
//! the clear level: R with G99; with G98 the level on which the series of cycles began, if that is higher.

use std::io::BufRead;

use super::code::Code;
use super::fault::{ErrorKind, Fault};
use super::interpreter::Program;
use super::notes::Once;
use crate::job::program::{Feed, StopCause};

/// Most repetitions (L) of one block.
const REPEAT_LIMIT: u32 = 100_000;

/// Most pecks of one hole.
const PECK_LIMIT: f64 = 100_000.0;

/// Distance kept from the bottom of the last peck on the way back in [mm]: 0.01 in (RS-274/NGC 3.5.16.4).
const PECK_CLEARANCE_MM: f64 = 0.254;

/// What a cycle does between R and the bottom, and on the way back.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Style {
    /// One feed move down; then the way back.
    Plain { back: Back },
    /// Pecks of this depth [mm]; fully out of the hole after each, or just breaking the chip.
    Pecks { depth: f64, full: bool },
}

/// How the tool leaves the bottom.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Back {
    Rapid,
    Feed,
    /// The spindle stops, rapid, the spindle starts again.
    SpindleStopped,
    /// The spindle reverses, feed, the spindle reverses again.
    SpindleReversed,
}

/// A running cycle; positions are machine positions [mm].
#[derive(Clone, Debug)]
pub(super) struct Drilling {
    style: Style,
    plane: [usize; 2],
    normal: usize,
    /// The hole being drilled.
    hole: [f64; 2],
    /// From hole to hole.
    step: [f64; 2],
    holes_left: u32,
    retract: f64,
    bottom: f64,
    clear: f64,
    dwell_s: f64,
    feed: Option<Feed>,
    /// Pecks done in this hole; `None` before the hole is approached.
    pecks: Option<f64>,
}

impl<R: BufRead> Program<R> {
    /// Checks the words of a cycle and starts it.
    pub(super) fn start_cycle(&mut self, code: Code) -> Result<(), Fault> {
        let (plane_letters, normal_letter) = self.modal.plane.letters();
        if let Some(letter) = self.block.first_unused(b"ABCUVW") {
            return Err(self.block.fault(letter, ErrorKind::CycleAxis { letter: char::from(letter) }));
        }
        if self.modal.inverse_time {
            return Err(self.motion_fault(ErrorKind::CycleInverseTime));
        }
        let mut plane = [0; 2];
        for (slot, letter) in plane.iter_mut().zip(plane_letters) {
            *slot = self.axes.find(letter).map_err(|kind| self.motion_fault(kind))?;
        }
        let normal = self.axes.find(normal_letter).map_err(|kind| self.motion_fault(kind))?;
        for axis in [plane[0], plane[1], normal] {
            if !self.axes.is_linear(axis) {
                let axis = self.axes.letter(axis).map_or('?', char::from);
                return Err(self.motion_fault(ErrorKind::ArcAxisRotary { axis }));
            }
        }
        let unit_mm = self.modal.unit_mm;
        let moves = plane_letters.iter().any(|&l| self.block.peek(l).is_some());
        let deepens = self.block.peek(normal_letter).is_some();
        let mut sticky = self.modal.sticky;
        let update = |slot: &mut Option<f64>, value: Option<f64>, scale: f64| {
            if let Some(value) = value {
                *slot = Some(value * scale);
            }
        };
        update(&mut sticky.retract, self.block.take(b'R'), unit_mm);
        update(&mut sticky.bottom, self.block.take(normal_letter), unit_mm);
        if matches!(code.tenths(), 730 | 830) {
            update(&mut sticky.peck, self.block.take(b'Q'), unit_mm);
        }
        if matches!(code.tenths(), 740 | 820 | 840 | 860 | 890) {
            update(&mut sticky.dwell, self.not_negative(b'P')?, 1.0);
        }
        self.modal.sticky = sticky;
        let (Some(bottom), true) = (sticky.bottom, moves || deepens) else {
            return Err(
                self.missing(code, if sticky.bottom.is_none() { normal_letter } else { plane_letters[0] })
            );
        };
        let Some(retract) = sticky.retract else { return Err(self.missing(code, b'R')) };
        let repeats = self.whole_number(b'L', 1, REPEAT_LIMIT)?.unwrap_or(1);
        let offset = self.modal.offsets.of(normal);
        let (retract, bottom) = if self.modal.incremental {
            let retract = self.position[normal] + retract;
            (retract, retract + bottom)
        } else {
            (retract + offset, bottom + offset)
        };
        if bottom > retract {
            return Err(self.motion_fault(ErrorKind::CycleUpwards { bottom, r: retract }));
        }
        let (target, _) = self.target(false)?;
        let hole = plane.map(|axis| target[axis]);
        let incremental = self.modal.incremental;
        let step = plane.map(|axis| if incremental { target[axis] - self.position[axis] } else { 0.0 });
        let drilling = Drilling {
            style: self.style(code, retract - bottom)?,
            plane,
            normal,
            hole,
            step,
            holes_left: repeats,
            retract,
            bottom,
            clear: if self.modal.retract_to_r { retract } else { retract.max(self.modal.cycle_level) },
            dwell_s: sticky.dwell.unwrap_or(0.0),
            feed: self.feed(&self.position, true)?,
            pecks: None,
        };
        self.drilling = Some(drilling);
        Ok(())
    }

    fn style(&mut self, code: Code, depth: f64) -> Result<Style, Fault> {
        let sticky = self.modal.sticky;
        let back = match code.tenths() {
            820 | 860 | 890 if sticky.dwell.is_none() => return Err(self.missing(code, b'P')),
            730 | 830 => {
                let Some(peck) = sticky.peck else { return Err(self.missing(code, b'Q')) };
                if peck <= 0.0 {
                    let kind = ErrorKind::OutOfRange { letter: 'Q', value: peck, min: 0.0, max: depth };
                    return Err(self.motion_fault(kind));
                }
                let count = (depth / peck).ceil();
                if count > PECK_LIMIT {
                    return Err(self.motion_fault(ErrorKind::TooManyPecks { count, most: PECK_LIMIT }));
                }
                return Ok(Style::Pecks { depth: peck, full: code.tenths() == 830 });
            }
            740 | 840 => {
                let text = format!("{code}: compensating holder, the spindle is not tied to the feed");
                self.note_once(Once::Tapping, &text);
                Back::SpindleReversed
            }
            850 | 890 => Back::Feed,
            860 => Back::SpindleStopped,
            _ => Back::Rapid,
        };
        Ok(Style::Plain { back })
    }

    /// One step of the running cycle: the approach, a peck, or the bottom and the way back.
    pub(super) fn drill(&mut self) -> Result<(), Fault> {
        let Some(mut run) = self.drilling.take() else { return Ok(()) };
        let Some(pecks) = run.pecks else {
            self.approach(&run)?;
            run.pecks = Some(0.0);
            self.drilling = Some(run);
            return Ok(());
        };
        if let Style::Pecks { depth, full } = run.style {
            // Counted, not summed up: the last peck is never a leftover of rounding.
            let reached = run.retract - (pecks + 1.0) * depth;
            if reached > run.bottom {
                self.down(&run, reached)?;
                let clear = reached + PECK_CLEARANCE_MM.min(depth);
                if full {
                    self.along(&run, run.retract)?;
                }
                self.along(&run, clear)?;
                run.pecks = Some(pecks + 1.0);
                self.drilling = Some(run);
                return Ok(());
            }
        }
        self.down(&run, run.bottom)?;
        self.leave(&run)?;
        self.counters.holes += 1;
        run.holes_left -= 1;
        if run.holes_left == 0 {
            let stop = self.stop_after_drilling.take();
            return self.end_block(stop);
        }
        run.hole = [run.hole[0] + run.step[0], run.hole[1] + run.step[1]];
        run.pecks = None;
        self.drilling = Some(run);
        Ok(())
    }

    /// Above the hole, then to R (RS-274/NGC 3.5.16).
    fn approach(&mut self, run: &Drilling) -> Result<(), Fault> {
        if self.position[run.normal] < run.retract {
            self.along(run, run.retract)?;
        }
        let mut above = self.position;
        above[run.plane[0]] = run.hole[0];
        above[run.plane[1]] = run.hole[1];
        if above != self.position {
            self.rapid(above)?;
        }
        self.along(run, run.retract)
    }

    /// From the bottom to the clear level.
    fn leave(&mut self, run: &Drilling) -> Result<(), Fault> {
        let Style::Plain { back } = run.style else { return self.along(run, run.clear) };
        if run.dwell_s > 0.0 {
            self.push_dwell(run.dwell_s);
        }
        match back {
            Back::Rapid => self.along(run, run.clear),
            Back::Feed => self.up(run),
            Back::SpindleStopped => {
                self.stop(StopCause::Spindle);
                self.along(run, run.clear)?;
                self.stop(StopCause::Spindle);
                Ok(())
            }
            Back::SpindleReversed => {
                self.stop(StopCause::Spindle);
                self.up(run)?;
                self.stop(StopCause::Spindle);
                Ok(())
            }
        }
    }

    /// Feed to R, then rapid to the clear level.
    fn up(&mut self, run: &Drilling) -> Result<(), Fault> {
        self.down(run, run.retract)?;
        self.along(run, run.clear)
    }

    /// Feed along the normal to `level`.
    fn down(&mut self, run: &Drilling, level: f64) -> Result<(), Fault> {
        let mut target = self.position;
        target[run.normal] = level;
        if target == self.position {
            return Ok(());
        }
        self.line_feed(target, run.feed)
    }

    /// Rapid along the normal to `level`.
    fn along(&mut self, run: &Drilling, level: f64) -> Result<(), Fault> {
        let mut target = self.position;
        target[run.normal] = level;
        if target == self.position {
            return Ok(());
        }
        self.rapid(target)
    }
}

//! Time series of a job for plots: exact states, thinned so that every peak stays where it is.

use serde::Serialize;

use super::motion::{AxisState, pieces, spans};
use crate::feed::job::{JobItem, PlannedSection};

/// States taken inside every span, its ends beside them.
const PER_SPAN: usize = 4;

/// The state of everything at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Instant {
    /// Time [s].
    pub time_s: f64,
    /// Place on the path [u].
    pub u: f64,
    /// du/dt [u/s].
    pub speed: f64,
    /// The axes.
    pub axes: Vec<AxisState>,
}

/// Visits the states of a section in order: both ends of every span (jerk jumps there, so knots come twice) and
/// `inside` more, evenly in time. Times count from the start of the section.
pub fn sample(section: &PlannedSection, inside: usize, mut see: impl FnMut(&Instant)) {
    let table = &section.table;
    let mut now = Instant { time_s: 0.0, u: 0.0, speed: 0.0, axes: Vec::new() };
    now.axes.resize(table.path.axes.len(), AxisState::default());
    let (mut geometry, mut cubics) = (usize::MAX, Vec::new());
    for span in spans(table) {
        if span.geometry != geometry {
            geometry = span.geometry;
            cubics = pieces(table, geometry);
        }
        for k in 0..=inside + 1 {
            let t = span.duration_s * k as f64 / (inside + 1) as f64;
            let state = span.at_time(t);
            now.time_s = span.start_s + t;
            now.u = span.from as f64 * table.path.step + state.x;
            now.speed = state.speed;
            for ((axis, cubic), grid) in now.axes.iter_mut().zip(&cubics).zip(&table.path.axes) {
                *axis = span.axis(cubic, grid.lsb, &state);
            }
            see(&now);
        }
    }
}

/// Columns of a plot.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Series {
    /// Time from the start of the job [s].
    pub time_s: Vec<f64>,
    /// Distance along all paths so far [u].
    pub u: Vec<f64>,
    /// du/dt [u/s].
    pub speed: Vec<f64>,
    /// One per axis.
    pub axes: Vec<AxisSeries>,
}

/// Columns of one axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AxisSeries {
    /// Position [axis units].
    pub position: Vec<f64>,
    /// Velocity [axis units/s].
    pub velocity: Vec<f64>,
    /// Acceleration [axis units/s^2].
    pub acceleration: Vec<f64>,
    /// Jerk [axis units/s^3].
    pub jerk: Vec<f64>,
}

/// The whole job in at most about `budget` rows.
///
/// Time is cut into equal slots; a slot keeps the rows in which any column is lowest or highest, so no peak is
/// lost or moved whatever the budget.
pub fn series(items: &[JobItem], budget: usize) -> Series {
    let (mut total_s, mut axes) = (0.0, 0);
    for item in items {
        match item {
            JobItem::Section(s) => {
                total_s += s.table.duration();
                axes = axes.max(s.table.path.axes.len());
            }
            JobItem::Dwell { seconds, .. } => total_s += seconds,
            JobItem::Note { .. } => {}
        }
    }
    let signals = 1 + 4 * axes;
    let slots = (budget / (2 * signals)).max(1);
    let slot_s = if total_s > 0.0 { total_s / slots as f64 } else { 1.0 };
    let mut thin = Thinner { slot_s, slot: 0, extremes: vec![None; 2 * signals], out: Series::default() };
    thin.out.axes.resize(axes, AxisSeries::default());
    let (mut start_s, mut start_u) = (0.0, 0.0);
    let mut last: Option<Instant> = None;
    for item in items {
        match item {
            JobItem::Section(s) => {
                sample(s, PER_SPAN, |now| {
                    let mut row = now.clone();
                    row.time_s += start_s;
                    row.u += start_u;
                    row.axes.resize(axes, AxisState::default());
                    thin.add(&row);
                    last = Some(row);
                });
                start_s += s.table.duration();
                start_u += s.table.path.length();
            }
            JobItem::Dwell { seconds, .. } => {
                start_s += seconds;
                if let Some(row) = &mut last {
                    let at_rest = |a: &AxisState| AxisState { position: a.position, ..AxisState::default() };
                    row.axes = row.axes.iter().map(at_rest).collect();
                    row.speed = 0.0;
                    thin.add(row);
                    row.time_s = start_s;
                    thin.add(row);
                }
            }
            JobItem::Note { .. } => {}
        }
    }
    thin.finish()
}

/// Keeps the extreme rows of one slot at a time.
struct Thinner {
    slot_s: f64,
    slot: u64,
    /// Row with the lowest and the highest value of each column, by turns.
    extremes: Vec<Option<Instant>>,
    out: Series,
}

/// Value of column `signal`: the speed, then four columns per axis.
fn signal(row: &Instant, signal: usize) -> f64 {
    let Some(k) = signal.checked_sub(1) else { return row.speed };
    let a = &row.axes[k / 4];
    [a.position, a.velocity, a.acceleration, a.jerk][k % 4]
}

impl Thinner {
    fn add(&mut self, row: &Instant) {
        let slot = (row.time_s / self.slot_s) as u64;
        if slot != self.slot {
            self.flush();
            self.slot = slot;
        }
        for (k, held) in self.extremes.iter_mut().enumerate() {
            let value = signal(row, k / 2);
            let beats = |old: &Instant| {
                let old = signal(old, k / 2);
                if k % 2 == 0 { value < old } else { value > old }
            };
            if held.as_ref().is_none_or(beats) {
                *held = Some(row.clone());
            }
        }
    }

    fn flush(&mut self) {
        let mut rows: Vec<Instant> = self.extremes.iter_mut().filter_map(Option::take).collect();
        rows.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        // Both sides of a knot have the same time; a jump of jerk keeps both.
        rows.dedup();
        for row in rows {
            self.out.time_s.push(row.time_s);
            self.out.u.push(row.u);
            self.out.speed.push(row.speed);
            for (columns, a) in self.out.axes.iter_mut().zip(&row.axes) {
                columns.position.push(a.position);
                columns.velocity.push(a.velocity);
                columns.acceleration.push(a.acceleration);
                columns.jerk.push(a.jerk);
            }
        }
    }

    fn finish(mut self) -> Series {
        self.flush();
        self.out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::samples::{back_section, bent_section};

    fn job() -> Vec<JobItem> {
        vec![
            JobItem::Section(bent_section()),
            JobItem::Dwell { seconds: 1.0, line: 5 },
            JobItem::Section(back_section()),
        ]
    }

    #[test]
    fn a_section_starts_and_ends_at_rest_on_its_end_points() {
        let section = bent_section();
        let mut rows = Vec::new();
        sample(&section, 3, |now| rows.push(now.clone()));
        let (first, last) = (&rows[0], &rows[rows.len() - 1]);
        assert_eq!((first.speed, last.speed), (0.0, 0.0));
        assert!((last.time_s - section.table.duration()).abs() < 1e-12);
        assert!((last.axes[0].position - 9.3).abs() < 1e-12 && (last.axes[1].position - 6.4).abs() < 1e-12);
        assert!(rows.windows(2).all(|w| w[0].time_s <= w[1].time_s && w[0].u <= w[1].u + 1e-12));
    }

    #[test]
    fn thinning_keeps_every_peak_and_the_budget() {
        let fine = series(&job(), usize::MAX / 2);
        let coarse = series(&job(), 60);
        assert!(coarse.time_s.len() <= 60 && fine.time_s.len() > 60);
        let range =
            |v: &[f64]| v.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| (a.min(x), b.max(x)));
        for (a, b) in fine.axes.iter().zip(&coarse.axes) {
            assert_eq!(range(&a.position), range(&b.position));
            assert_eq!(range(&a.velocity), range(&b.velocity));
            assert_eq!(range(&a.acceleration), range(&b.acceleration));
            assert_eq!(range(&a.jerk), range(&b.jerk));
        }
        assert_eq!(range(&fine.speed), range(&coarse.speed));
        assert!(coarse.time_s.windows(2).all(|w| w[0] <= w[1]));
    }

    #[test]
    fn a_wait_is_a_level_stretch() {
        let fine = series(&job(), 100_000);
        let duration = bent_section().table.duration();
        let during = |t: f64| t > duration && t < duration + 1.0;
        assert!(!fine.time_s.iter().any(|&t| during(t)));
        let rest = fine.time_s.iter().position(|&t| (t - duration - 1.0).abs() < 1e-9).unwrap();
        assert_eq!((fine.speed[rest], fine.axes[0].jerk[rest]), (0.0, 0.0));
        assert_eq!(series(&[], 100), Series::default());
    }
}
